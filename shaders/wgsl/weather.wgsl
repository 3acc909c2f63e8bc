// Wind and the shadows of clouds: lumps of noise that drift over the land with the wind, the same for ground, canopy
// and trees. The drift is worked out in f64 on the CPU (`shaders/src/weather.rs`). Twin: `twin/weather.rs`.

// Width of a gust and of a cloud, metres.
const GUST_METRES: f32 = 85.0;
const CLOUD_METRES: f32 = 1700.0;
// Height of the clouds above the sea, and least height above the ground, metres.
const CLOUD_HEIGHT: f32 = 4300.0;
const CLOUD_CLEARANCE: f32 = 600.0;
// Share of the sun's light that the middle of a cloud keeps back.
const CLOUD_SHADE: f32 = 0.8;
// Turned leaves show a lighter side: how much brighter the gusts make them at this speed, m/s.
const SHIMMER: f32 = 0.16;
const SHIMMER_SPEED: f32 = 8.0;

fn drift_hash(cell: vec2<i32>, seed: u32) -> f32 {
    let place = bitcast<vec2<u32>>(cell);
    var bits = (place.x * 0x9e3779b1u) ^ ((place.y * 0x85ebca77u) + seed);
    bits = (bits ^ (bits >> 15u)) * 0x2c1b3c6du;
    bits = (bits ^ (bits >> 12u)) * 0x297a2d39u;
    return f32((bits ^ (bits >> 15u)) >> 8u) * 5.9604645e-8;
}

// Smooth noise in 0…1 with lumps of one: at a place of which a whole part is given apart.
fn drift_noise(cell: vec2<i32>, at: vec2<f32>, seed: u32) -> f32 {
    let whole = floor(at);
    let corner = cell + vec2<i32>(whole);
    let part = at - whole;
    let smoothed = part * part * (3.0 - (2.0 * part));
    let south = mix(drift_hash(corner, seed), drift_hash(corner + vec2<i32>(1, 0), seed), smoothed.x);
    let north = mix(drift_hash(corner + vec2<i32>(0, 1), seed), drift_hash(corner + vec2<i32>(1, 1), seed), smoothed.x);
    return mix(south, north, smoothed.y);
}

// How hard the wind blows at a place (metres east and north of the eye), 0…1.
fn gust_at(place: vec2<f32>) -> f32 {
    let at = view.gust_part + (place / GUST_METRES);
    let broad = drift_noise(view.gust_cell, at, 61u);
    let narrow = drift_noise(view.gust_cell * 2, at * 2.0, 62u);
    return (0.65 * broad) + (0.35 * narrow);
}

// What the gust makes of the leaves' light.
fn leaf_shimmer(gust: f32) -> f32 {
    return 1.0 + (SHIMMER * min(view.wind.z / SHIMMER_SPEED, 1.5) * ((2.0 * gust) - 1.0));
}

// Share of the sun's light that clouds leave to a point (metres from the eye, east-north-up) at a height above the sea.
fn cloud_light(point: vec3<f32>, height: f32) -> f32 {
    let rise = max(CLOUD_HEIGHT - height, CLOUD_CLEARANCE) / max(view.sun.z, 0.1);
    let at = view.cloud_part + ((point.xy + (view.sun.xy * rise)) / CLOUD_METRES);
    let cell = view.cloud_cell;
    let lumps = (0.5 * drift_noise(cell, at, 71u)) + (0.27 * drift_noise(cell * 2, at * 2.0, 72u))
        + (0.15 * drift_noise(cell * 4, at * 4.0, 73u)) + (0.08 * drift_noise(cell * 8, at * 8.0, 74u));
    let bare = mix(0.8, 0.2, view.clouds);
    return 1.0 - (CLOUD_SHADE * smoothstep(bare - 0.07, bare + 0.07, lumps));
}
