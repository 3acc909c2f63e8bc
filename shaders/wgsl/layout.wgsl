// Structs shared with the CPU: `shaders/src/layout.rs`, compared with these by a test.

const EMPTY: u32 = 0xffffffffu;
const LEAF_BIT: u32 = 0x80000000u;
const ROOT_BITS: u32 = 26u;
// Heights at or below this are voids: WGSL may assume that there is no NaN.
const VOID_HEIGHT: f32 = -1.0e30;

// One square of the page table's cut, with the ray frame of its tile.
struct Leaf {
    u_gradient: vec4<f32>,
    v_gradient: vec4<f32>,
    h_gradient: vec4<f32>,
    u_second: vec4<f32>,
    v_second: vec4<f32>,
    h_second: vec4<f32>,
    uv_cross: vec4<f32>,
    h_cross_maximum_fade: vec4<f32>,
    eye_cell: vec2<i32>,
    first_cell: vec2<u32>,
    cells: vec2<u32>,
    grid_origin: vec2<u32>,
    grid_side: u32,
    slot: u32,
    level: u32,
    stand_in: u32,
    cell_metres: vec2<f32>,
    distance_range: vec2<f32>,
}

// Bit of `flags`: trees, their levels and the canopy take each other's places at once.
const HARD_SWITCH: u32 = 1u;

struct View {
    right: vec4<f32>,
    up: vec4<f32>,
    forward: vec4<f32>,
    sun: vec4<f32>,
    size: vec2<u32>,
    root_size: vec2<u32>,
    eye_grid: vec2<u32>,
    eye_inside: u32,
    wraps: u32,
    root_level: u32,
    shadow_steps: u32,
    flags: u32,
    frame: u32,
    grid_place: vec2<u32>,
    tree_size: vec2<f32>,
    scene_seed: u32,
    clouds: f32,
    season: vec4<f32>,
    wind: vec4<f32>,
    gust_cell: vec2<i32>,
    cloud_cell: vec2<i32>,
    gust_part: vec2<f32>,
    cloud_part: vec2<f32>,
}

struct Sheet {
    eye_patch: vec4<f32>,
    base: f32,
    eye_patch_known: u32,
    padding: vec2<u32>,
}

struct TexturePage {
    slot: u32,
    children: u32,
    fade: u32,
    padding: u32,
}
