// Structs of the trees that are drawn one by one: `shaders/src/trees.rs`, compared with these by a test.

// Levels of detail of a species.
const TREE_LEVELS: u32 = 4u;

struct SeedSpecies {
    lowest: u32,
    highest: u32,
    mean: u32,
    tallest: u32,
    share: u32,
    crown_radius: f32,
    padding: vec2<u32>,
}

// A cell of the pattern that is looked at.
struct SeedCell {
    // Column and row.
    cell: vec2<u32>,
    // From the eye's whole unit of place to its north-west corner.
    offset: vec2<i32>,
    // Layer of its land cover.
    slot: u32,
    padding: u32,
}

struct SeedFrame {
    // Of the eye: sine and cosine of the latitude, height in metres, prime vertical radius.
    eye: vec4<f32>,
    // Inward unit normals of the frustum's sides.
    sides: array<vec4<f32>, 4>,
    // A tree that fills so many pixels is drawn on the first, second and third level.
    level_pixels: vec4<f32>,
    // Part of a unit by which the eye is farther east and south.
    eye_fraction: vec2<f32>,
    // Trees are drawn up to this distance, metres.
    range: f32,
    // Metres of a quantum of the anchors.
    anchor_quantum: f32,
    cells: u32,
    // Work groups a cell.
    blocks: u32,
    species: u32,
    // Units of place along a cell of land cover, of a tile of it, and of an anchor's, as powers of two.
    cover_bits: u32,
    tile_bits: u32,
    anchor_bits: u32,
    padding: vec2<u32>,
}

struct TreeInstance {
    // Foot of the trunk, metres from the eye (east-north-up at the eye); its height, metres.
    foot_height: vec4<f32>,
    // Rotation, hash, and the pixels' shares between which it is drawn, 8 bits each.
    look: u32,
    // Cell (from bit 10), column (from bit 5) and row of its seed.
    seed: u32,
    // Anchor, quanta.
    ground: i32,
    // Height in 1/1024 m; bit 16: not a second level of a tree that has another; from bit 17 its leaves, of 127, and
    // from bit 24 the snow on it, of 255.
    height_units: u32,
    // Reflectance of its leaves; w: share of the sun's disc that its top sees.
    colour: vec4<f32>,
    // Sunlight before shadow and angle; w: exposure of the picture.
    sun: vec4<f32>,
    // Light of the open sky over π; w: share of the sky that its top sees.
    sky: vec4<f32>,
    // What the air adds on the way to the eye; w: share of light that it lets through.
    air: vec4<f32>,
}

struct Draw {
    vertex_count: u32,
    instance_count: u32,
    first_vertex: u32,
    first_instance: u32,
}
