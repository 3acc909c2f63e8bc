// What the ground is made of at a point: shares of surface types, crowns, base colour, and noise that
// stands still on the map. Types are never interpolated as numbers: their shares are.

const TYPE_CANOPY: u32 = 1u;
const TYPE_WATER: u32 = 2u;
const TYPE_ROCK: u32 = 3u;
const TYPE_SNOW: u32 = 4u;
const TYPE_GRASS: u32 = 5u;
// Bits of a node's type; the code of its canopy's species is above them.
const SPECIES_SHIFT: u32 = 3u;
const TYPE_MASK: u32 = 7u;
// Unit of canopy heights in `surface`, metres.
const CANOPY_UNIT: f32 = 0.25;

// Shares of the surface types at a point (the rest is plain), and its crowns.
struct Cover {
    canopy: f32,
    water: f32,
    rock: f32,
    snow: f32,
    grass: f32,
    // Height of the canopy over the ground, metres.
    canopy_height: f32,
    // Height within the crown: 0 in the gap between crowns, 1 at a top.
    crown_place: f32,
}

// Surface type and canopy height (metres) of a node.
fn node_surface(node: vec2<i32>, slot: u32) -> vec2<u32> {
    let inside = clamp(node, vec2<i32>(-1), vec2<i32>(513));
    return textureLoad(surface, inside + vec2<i32>(1), slot, 0).xy;
}

fn add_node(cover: ptr<function, Cover>, node: vec2<u32>, share: f32) {
    let kind = node.x & TYPE_MASK;
    (*cover).canopy += select(0.0, share, kind == TYPE_CANOPY);
    (*cover).water += select(0.0, share, kind == TYPE_WATER);
    (*cover).rock += select(0.0, share, kind == TYPE_ROCK);
    (*cover).snow += select(0.0, share, kind == TYPE_SNOW);
    (*cover).grass += select(0.0, share, kind == TYPE_GRASS);
    (*cover).canopy_height += share * f32(node.y) * CANOPY_UNIT;
}

// The cover at a cell coordinate of a tile, blended between the four nodes around it.
fn cover_at(cell: vec2<f32>, slot: u32) -> Cover {
    var cover = Cover(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let base = vec2<i32>(floor(cell));
    let part = cell - floor(cell);
    add_node(&cover, node_surface(base, slot), (1.0 - part.x) * (1.0 - part.y));
    add_node(&cover, node_surface(base + vec2<i32>(1, 0), slot), part.x * (1.0 - part.y));
    add_node(&cover, node_surface(base + vec2<i32>(0, 1), slot), (1.0 - part.x) * part.y);
    add_node(&cover, node_surface(base + vec2<i32>(1, 1), slot), part.x * part.y);
    return cover;
}

// How high a point stands within the crowns around it, looked for one crown's radius (cells) away.
fn crown_place(cell: vec2<f32>, slot: u32, height: f32, radius: i32) -> f32 {
    let centre = vec2<i32>(round(cell));
    var highest = height;
    var sum = 0.0;
    for (var side = 0; side < 4; side++) {
        let along = select(vec2<i32>(radius, 0), vec2<i32>(0, radius), (side & 1) == 1) * select(1, -1, side >= 2);
        let there = f32(node_surface(centre + along, slot).y) * CANOPY_UNIT;
        highest = max(highest, there);
        sum += there;
    }
    // A little of the mean, so that even canopy is not all tops.
    return saturate(height / max(0.8 * highest + 0.05 * sum, 0.5));
}

// A hash of a lattice point to 0…1.
fn lattice_hash(point: vec2<u32>, seed: u32) -> f32 {
    var mixed = (point.x * 0x9e3779b1u) ^ (point.y * 0x85ebca77u + seed);
    mixed = (mixed ^ (mixed >> 15u)) * 0x2c1b3c6du;
    mixed = (mixed ^ (mixed >> 12u)) * 0x297a2d39u;
    mixed ^= mixed >> 15u;
    return f32(mixed >> 8u) * 5.9604645e-8;
}

// Smooth noise in 0…1 with lumps 2^bits grid units wide: it stands still on the map whatever is resident.
fn map_noise(place: MapPlace, bits: u32, seed: u32) -> f32 {
    let lattice = place.unit >> vec2<u32>(bits);
    let within = place.unit & vec2<u32>((1u << bits) - 1u);
    let part = (vec2<f32>(within) + place.fraction) / f32(1u << bits);
    let smoothed = part * part * (3.0 - 2.0 * part);
    let north = mix(lattice_hash(lattice, seed), lattice_hash(lattice + vec2<u32>(1u, 0u), seed), smoothed.x);
    let south = mix(lattice_hash(lattice + vec2<u32>(0u, 1u), seed), lattice_hash(lattice + vec2<u32>(1u, 1u), seed), smoothed.x);
    return mix(north, south, smoothed.y);
}

// Noise about 0 (−1…1) of a width in metres, gone where the pixel's footprint is as wide.
fn metric_noise(ground: Ground, width: f32, footprint: f32, seed: u32) -> f32 {
    let visible = saturate(1.5 - 2.0 * footprint / width);
    if visible <= 0.0 {
        return 0.0;
    }
    let bits = log2(max(width * ground.units_per_metre.y, 1.0));
    return visible * (2.0 * map_noise(ground.place, u32(clamp(bits, 0.0, 25.0)), seed) - 1.0);
}

// The same for what stands upright, −1…1: lumps differ along the height too, or crowns would be streaked
// from top to bottom.
fn upright_noise(ground: Ground, width: f32, footprint: f32, seed: u32) -> f32 {
    var skewed = ground;
    skewed.place = moved(ground.place, ground.height * vec2<f32>(0.83, 0.71) * ground.units_per_metre);
    return metric_noise(skewed, width, footprint, seed);
}

// Colour of ground that no photo shows, by what it is and how steep.
fn neutral_colour(cover: Cover, steepness: f32) -> vec3<f32> {
    let plain = mix(vec3<f32>(0.105, 0.115, 0.062), vec3<f32>(0.17, 0.155, 0.135), smoothstep(0.25, 0.6, steepness));
    let shares = vec3<f32>(0.035, 0.06, 0.022) * cover.canopy + vec3<f32>(0.02, 0.045, 0.055) * cover.water
        + vec3<f32>(0.2, 0.185, 0.165) * cover.rock + vec3<f32>(0.82, 0.85, 0.9) * cover.snow
        + vec3<f32>(0.10, 0.125, 0.05) * cover.grass;
    let rest = 1.0 - cover.canopy - cover.water - cover.rock - cover.snow - cover.grass;
    return shares + plain * max(rest, 0.0);
}
