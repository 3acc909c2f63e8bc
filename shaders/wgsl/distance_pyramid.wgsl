// The picture's distances as a pyramid. A quad lies between the centres of four pixels (or, at the picture's edge,
// reaches half a pixel beyond); texel (x, y) of mip 0 stands for 2 × 2 quads, each next mip halves, rounded up.

// x, y: least and greatest distance between which something may show that no pixel's centre shows, over the quads that
// are gaps; ENDLESS, −1 where there is none. z, w: least and greatest distance of all pixels; a miss is ENDLESS.
const NO_DISTANCES: vec4<f32> = vec4<f32>(3.0e38, -1.0, 3.0e38, -1.0);

@group(1) @binding(2) var<storage, read_write> pyramid: array<vec4<f32>>;

fn join_distances(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(min(a.x, b.x), max(a.y, b.y), min(a.z, b.z), max(a.w, b.w));
}

// Columns and rows of a mip.
fn mip_size(mip: u32) -> vec2<u32> {
    let base = (view.size + 2u) >> vec2<u32>(1u);
    return (base + ((1u << mip) - 1u)) >> vec2<u32>(mip);
}

// Where a mip begins in the buffer.
fn mip_offset(mip: u32) -> u32 {
    var offset = 0u;
    for (var finer = 0u; finer < mip; finer++) {
        let size = mip_size(finer);
        offset += size.x * size.y;
    }
    return offset;
}

fn store_distances(mip: u32, texel: vec2<u32>, distances: vec4<f32>) {
    let size = mip_size(mip);
    if all(texel < size) {
        pyramid[mip_offset(mip) + (texel.y * size.x) + texel.x] = distances;
    }
}

fn load_distances(mip: u32, texel: vec2<u32>) -> vec4<f32> {
    let size = mip_size(mip);
    if any(texel >= size) {
        return NO_DISTANCES;
    }
    return pyramid[mip_offset(mip) + (texel.y * size.x) + texel.x];
}
