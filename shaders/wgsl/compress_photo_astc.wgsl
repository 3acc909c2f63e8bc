// ASTC of 4 × 4 texels, one line a block; without alpha 16 colours along it, with alpha 8.
// Twin: `twin/compress_photo_astc.rs`.
//
// Ends are stored with 192 steps, as six bits and a trit, five trits in eight bits; such a step v is 4x + t or, with the
// lowest of its bits set, 255 − (4x + t), where x is the other five bits and t the trit.

fn last_index() -> i32 {
    var alpha = 255;
    for (var texel = 0u; texel < 16u; texel++) {
        alpha = min(alpha, texels[texel].w);
    }
    return select(7, 15, alpha == 255);
}

// The second end's share in a texel's colour, of 64.
fn weight_of(index: i32) -> i32 {
    let spread = select((index << 3u) | index, (index << 2u) | (index >> 2u), last == 15);
    return select(spread, spread + 1, spread > 32);
}

// The nearest of the steps that an end's channel can have; `value` in sixteenths.
fn step_of(value: i32) -> i32 {
    let mirrored = value > 2040;
    let inner = select(value, 4080 - value, mirrored);
    var fours = inner / 64;
    let rest = inner - 64 * fours;
    var trit = min((rest + 8) / 16, 2);
    if rest >= 48 && fours < 31 {
        fours += 1;
        trit = 0;
    }
    let found = 4 * fours + trit;
    return select(found, 255 - found, mirrored);
}

fn quantised(end: vec4<i32>) -> vec4<i32> {
    return vec4<i32>(step_of(end.x), step_of(end.y), step_of(end.z), step_of(end.w));
}

// Six bits and the trit of a step.
fn bits_and_trit(value: i32) -> vec2<u32> {
    let mirrored = value > 127;
    let inner = u32(select(value, 255 - value, mirrored));
    return vec2<u32>((inner / 4u) * 2u + u32(mirrored), inner & 3u);
}

// Five trits in eight bits.
fn packed_trits(trits: array<u32, 5>) -> u32 {
    var low = (trits[2] << 4u) | (trits[1] << 2u) | trits[0];
    if trits[2] == 2u && trits[1] == 2u {
        low = 12u | trits[0];
    } else if trits[2] == 2u {
        low = (trits[1] << 4u) | (trits[0] << 2u) | 3u;
    }
    if trits[4] == 2u && trits[3] == 2u {
        return ((low >> 2u) << 5u) | 28u | (low & 3u);
    } else if trits[4] == 2u {
        return (trits[3] << 7u) | 96u | low;
    }
    return (trits[4] << 7u) | (trits[3] << 5u) | low;
}

// Writes up to five values, beginning with value `from_value` of `count`, at bit `first_bit`.
fn put_values(first_bit: u32, values: array<i32, 8>, from_value: u32, count: u32) {
    var trits = array<u32, 5>();
    for (var place = 0u; place < 5u && from_value + place < count; place++) {
        trits[place] = bits_and_trit(values[from_value + place]).y;
    }
    let together = packed_trits(trits);
    var at = first_bit;
    var taken = 0u;
    for (var place = 0u; place < 5u && from_value + place < count; place++) {
        put(at, 6u, bits_and_trit(values[from_value + place]).x);
        // Bits of the trits stand between the values: two, two, one, two, one.
        let width = select(2u, 1u, place == 2u || place == 4u);
        put(at + 6u, width, (together >> taken) & ((1u << width) - 1u));
        at += 6u + width;
        taken += width;
    }
}

fn pack(line: Line) {
    // A decoder takes ends in falling order for another encoding of them.
    let turned = line.second.x + line.second.y + line.second.z < line.first.x + line.first.y + line.first.z;
    let first = select(line.first, line.second, turned);
    let second = select(line.second, line.first, turned);
    let values = array<i32, 8>(first.x, second.x, first.y, second.y, first.z, second.z, first.w, second.w);
    // Weights of 4 × 4, sixteen or eight of them; the ends' mode.
    let opaque = last == 15;
    bits = array<u32, 4>(select(0x53u | (12u << 13u), 0x242u | (8u << 13u), opaque), 0u, 0u, 0u);
    let count = select(8u, 6u, opaque);
    put_values(17u, values, 0u, count);
    put_values(55u, values, 5u, count);
    // From the block's other end, each mirrored.
    let width = select(3u, 4u, opaque);
    for (var texel = 0u; texel < 16u; texel++) {
        let index = u32(select(line.indices[texel], last - line.indices[texel], turned));
        put(128u - (texel + 1u) * width, width, reverseBits(index) >> (32u - width));
    }
}
