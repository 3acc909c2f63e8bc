// Structs of the undergrowth: `shaders/src/undergrowth.rs`, compared with these by a test.

struct UndergrowthBlock {
    // Column and row of its cell of the seeds' pattern.
    cell: vec2<u32>,
    // From the eye's whole unit of place to the cell's north-west corner.
    offset: vec2<i32>,
    // Its first sub-cell of metaseeds.
    first: vec2<u32>,
    // Columns of metaseeds in the cell.
    columns: u32,
    padding: u32,
}

struct UndergrowthFrame {
    // Of the eye: sine and cosine of the latitude, height in metres, prime vertical radius.
    eye: vec4<f32>,
    // Inward unit normals of the frustum's sides.
    sides: array<vec4<f32>, 4>,
    // Part of a unit by which the eye is farther east and south.
    eye_fraction: vec2<f32>,
    // Nothing grows farther than this from the eye, metres.
    range: f32,
    // Up to this distance the canopy of the heights gives way to trees; 0 where it does not.
    canopy_gone: f32,
    blocks: u32,
    padding: u32,
    more_padding: vec2<u32>,
}

struct Plant {
    // Foot, metres from the eye (east-north-up at the eye); size as far as it has grown, metres.
    foot_size: vec4<f32>,
    // Rotation, hash, kind, community, 8 bits each.
    look: u32,
    // Block (from bit 12), place in it (from bit 6), member.
    seed: u32,
    // East and south of the cell's corner, units, 16 bits each, over 8192.
    place: u32,
    // 1/1024 m; from bit 16 on how far it has grown, of 255; from bit 24 on the snow on it.
    size: u32,
    // Roots of its reflectance, and the share of the sun's disc that it sees: bytes.
    colour: u32,
    // Normal of the ground (signed bytes), share of the sky.
    ground: u32,
    padding: vec2<u32>,
}

// What light falls on all of it.
struct PlantLight {
    // Sunlight before shadow and angle; w: exposure of the picture.
    sun: vec4<f32>,
    // Light of the open sky over π.
    sky: vec4<f32>,
    // What 100 m of air add; w: share of light that they let through.
    air: vec4<f32>,
}

struct IndexedDraw {
    index_count: u32,
    instance_count: u32,
    first_index: u32,
    base_vertex: i32,
    first_instance: u32,
}

// The bins' draws and a last one that counts metaseeds, and the light.
struct UndergrowthDraws {
    draws: array<IndexedDraw, 8>,
    light: PlantLight,
}

// Bins are the kinds, and grass that is not near: farther than this, metres.
const PLANT_BINS: u32 = 7u;
const FAR_GRASS: u32 = 6u;
const NEAR_GRASS: f32 = 12.0;
