// The pyramid of maxima over a tile's cells, run when a tile is uploaded: `cells_to_mip` makes mip 0 (a texel
// for 2 × 2 cells), `mip_to_mip` each next one. Texels beyond the cells are void, so that any size will do.

// Build minima instead.
override MINIMUM: bool = false;
// Samples of the heights beyond the tile on each side.
override BORDER: u32 = 1u;

// Heights at or below this are voids; their cells have no maximum.
const VOID_HEIGHT: f32 = -1.0e30;

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var target_mip: texture_storage_2d<r32float, write>;

fn nothing() -> f32 {
    return select(VOID_HEIGHT, -VOID_HEIGHT, MINIMUM);
}

fn greater(a: f32, b: f32) -> f32 {
    return select(max(a, b), min(a, b), MINIMUM);
}

// The extreme of one cell; nothing where a corner is void or the cell is not there.
fn cell_extreme(cell: vec2<u32>, cells: vec2<u32>) -> f32 {
    if any(cell >= cells) {
        return nothing();
    }
    let texel = cell + BORDER;
    let north_west = textureLoad(source, texel, 0).x;
    let north_east = textureLoad(source, texel + vec2<u32>(1u, 0u), 0).x;
    let south_west = textureLoad(source, texel + vec2<u32>(0u, 1u), 0).x;
    let south_east = textureLoad(source, texel + vec2<u32>(1u, 1u), 0).x;
    if min(min(north_west, north_east), min(south_west, south_east)) <= VOID_HEIGHT {
        return nothing();
    }
    return greater(greater(north_west, north_east), greater(south_west, south_east));
}

@compute @workgroup_size(8, 8)
fn cells_to_mip(@builtin(global_invocation_id) id: vec3<u32>) {
    let texel = id.xy;
    if any(texel >= textureDimensions(target_mip)) {
        return;
    }
    let size = textureDimensions(source);
    let cells = max(size, vec2<u32>(2u * BORDER + 1u)) - (2u * BORDER + 1u);
    let cell = 2u * texel;
    let north = greater(cell_extreme(cell, cells), cell_extreme(cell + vec2<u32>(1u, 0u), cells));
    let south = greater(
        cell_extreme(cell + vec2<u32>(0u, 1u), cells),
        cell_extreme(cell + vec2<u32>(1u, 1u), cells),
    );
    textureStore(target_mip, texel, vec4<f32>(greater(north, south)));
}

@compute @workgroup_size(8, 8)
fn mip_to_mip(@builtin(global_invocation_id) id: vec3<u32>) {
    let texel = id.xy;
    if any(texel >= textureDimensions(target_mip)) {
        return;
    }
    // Where one axis is down to one texel, both halves are that texel.
    let first = 2u * texel;
    let last = min(first + 1u, textureDimensions(source) - 1u);
    let north = greater(textureLoad(source, first, 0).x, textureLoad(source, vec2<u32>(last.x, first.y), 0).x);
    let south = greater(textureLoad(source, vec2<u32>(first.x, last.y), 0).x, textureLoad(source, last, 0).x);
    textureStore(target_mip, texel, vec4<f32>(greater(north, south)));
}
