// BC7 in its mode 6: one line of 16 colours with alpha a block. Twin: `twin/compress_photo_bc7.rs`.

fn last_index() -> i32 {
    return 15;
}

// The second end's share in a texel's colour, of 64.
fn weight_of(index: i32) -> i32 {
    return (64 * index + 7) / 15;
}

// The nearest colour that an end (in sixteenths) can have: all channels share their lowest bit.
fn quantised(end: vec4<i32>) -> vec4<i32> {
    let even = 2 * clamp((end + 16) / 32, vec4<i32>(0), vec4<i32>(127));
    let odd = 2 * clamp(end / 32, vec4<i32>(0), vec4<i32>(127)) + 1;
    let even_off = 16 * even - end;
    let odd_off = 16 * odd - end;
    return select(odd, even, dot(even_off, even_off) < dot(odd_off, odd_off));
}

fn pack(line: Line) {
    // The first texel's highest bit is not written: its index must be among the lower half.
    let turned = line.indices[0] >= 8;
    let first = vec4<u32>(select(line.first, line.second, turned));
    let second = vec4<u32>(select(line.second, line.first, turned));
    bits = array<u32, 4>(64u, 0u, 0u, 0u);
    for (var channel = 0u; channel < 4u; channel++) {
        let at = 7u + 14u * channel;
        put(at, 7u, first[channel] >> 1u);
        put(at + 7u, 7u, second[channel] >> 1u);
    }
    put(63u, 1u, first.x & 1u);
    put(64u, 1u, second.x & 1u);
    for (var texel = 0u; texel < 16u; texel++) {
        let index = u32(select(line.indices[texel], 15 - line.indices[texel], turned));
        if texel == 0u {
            put(65u, 3u, index);
        } else {
            put(64u + 4u * texel, 4u, index);
        }
    }
}
