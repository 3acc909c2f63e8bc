// The Tile Load Map's stack: `shaders/src/load_map.rs` says what it is, a test compares the structs.

const MAPS: u32 = 16u;
const MAP_SIDE: u32 = 64u;
const MAP_CELLS: u32 = 4096u;
// A distance that nothing reaches, metres: what a miss counts as.
const ENDLESS: f32 = 3.0e38;
// Distances that end the radial levels 0, 1 and 2, metres.
const RADIAL_METRES: vec3<f32> = vec3<f32>(700.0, 1400.0, 3000.0);

// While the passes run, a cell's word is a set, so that `atomicOr` joins what is found in any order. Bits 0 to 2:
// something visible lies within that radial level; bits 5 to 14: by how many levels what wants the coarsest map's
// level, or a coarser one, would have it coarser; from LEVELS on: visible levels, counted from the coarsest map's.
const MARK_AHEAD: u32 = 8u;
const MARK_WANTED: u32 = 16u;
const MARK_RADIAL: u32 = 7u;
const MARK_COARSER: u32 = 5u;
const MOST_COARSER: u32 = 9u;
// All of how many levels coarser than the coarsest map's is wanted.
const MARKS_COARSER: u32 = ((2u << MOST_COARSER) - 1u) << MARK_COARSER;
// A pixel of the next finer level blends into this cell's texels.
const MARK_BLENDED: u32 = 0x8000u;
// Share of a band's far end at which that begins: 2^−0.25, as the photo blends (`PHOTO_BLEND`).
const BLENDS_FROM: f32 = 0.8408964;
const MARK_LEVELS: u32 = 16u;

struct LoadMapLevel {
    first: vec2<i32>,
    eye: vec2<f32>,
    band: vec2<f32>,
    span: f32,
    level: u32,
}

struct LoadMapFrame {
    eye: vec4<f32>,
    look_ahead: vec4<f32>,
    heights: vec2<f32>,
    maps: u32,
    pattern_map: u32,
    scene_seed: u32,
    texel_angle: f32,
    elevation_level: u32,
    coarser_from: f32,
    levels: array<LoadMapLevel, 16>,
}

@group(1) @binding(0) var<uniform> stack: LoadMapFrame;
@group(1) @binding(1) var<storage, read_write> cells: array<atomic<u32>>;

// The map whose level a point at a distance wants.
fn map_at(distance: f32) -> u32 {
    var map = 0u;
    while map + 1u < stack.maps && distance < stack.levels[map].band.x {
        map += 1u;
    }
    return map;
}

// How many levels coarser than the coarsest map's a point at a distance wants.
fn levels_coarser(distance: f32) -> u32 {
    var count = 0u;
    var reach = stack.coarser_from;
    while count < MOST_COARSER && distance >= reach {
        count += 1u;
        reach *= 2.0;
    }
    return count;
}

// Marks of what wants a map's level from one distance to another.
fn wanted_marks(map: u32, near: f32, far: f32) -> u32 {
    let own = (1u << (MARK_LEVELS + map)) | radial_mark(near);
    if map > 0u {
        return own;
    }
    return own | (((2u << levels_coarser(far)) - (1u << levels_coarser(near))) << MARK_COARSER);
}

// The radial level's bit; none beyond the last.
fn radial_mark(distance: f32) -> u32 {
    if distance >= RADIAL_METRES.z {
        return 0u;
    }
    return 1u << (u32(distance >= RADIAL_METRES.x) + u32(distance >= RADIAL_METRES.y));
}

// Bits of a grid coordinate below a map's cell.
fn cell_bits(map: u32) -> u32 {
    return ROOT_BITS - min(stack.levels[map].level - view.root_level, ROOT_BITS);
}

// Cells of the grid along a row of a map's level.
fn grid_columns(map: u32) -> u32 {
    return view.root_size.x << (ROOT_BITS - cell_bits(map));
}

// Where a place's cell stands in a map, from its north-west corner; outside 0…63 the map does not hold it.
fn place_in_map(map: u32, grid: vec2<u32>) -> vec2<i32> {
    var place = vec2<i32>(grid >> vec2<u32>(cell_bits(map))) - stack.levels[map].first;
    let columns = i32(grid_columns(map));
    if view.wraps == 1u && columns > i32(MAP_SIDE) {
        place.x = place.x % columns;
        if place.x < 0 {
            place.x += columns;
        }
    }
    return place;
}

// Index of the cell that holds a place, on the map or the next coarser one that has it; EMPTY where none has.
fn cell_index(finest: u32, grid: vec2<u32>) -> u32 {
    for (var coarser = 0u; coarser <= finest; coarser++) {
        let map = finest - coarser;
        let place = place_in_map(map, grid);
        if all(place >= vec2<i32>(0)) && all(place < vec2<i32>(i32(MAP_SIDE))) {
            return (map * MAP_CELLS) + (u32(place.y) * MAP_SIDE) + u32(place.x);
        }
    }
    return EMPTY;
}

// Joins marks to a cell's; most have them already, and reading is cheaper.
fn mark_cell(index: u32, marks: u32) {
    if (atomicLoad(&cells[index]) & marks) != marks {
        atomicOr(&cells[index], marks);
    }
}
