// What the year does to leaves, herbs and snow: the table and the rules of `core::seeds::season`, the same for the
// trees near by and the canopy far away.

// Row of the herbs of the ground; species beyond the rows before it are evergreens, as row 0 is.
const GROUND_SEASON: u32 = 31u;
// Days by which spring is later and autumn earlier, per degree of latitude and per metre above 600 m.
const LATER_SPRING: vec2<f32> = vec2<f32>(3.0, 0.03);
const EARLIER_AUTUMN: vec2<f32> = vec2<f32>(2.0, 0.015);
const SEASON_HEIGHT: f32 = 600.0;
// However high: leaves are out on the one day, and none turns before the other; days for which they are young.
const LEAVES_OUT: f32 = 160.0;
const FIRST_TURN: f32 = 245.0;
const FRESH_DAYS: f32 = 25.0;
// From the first patches of snow to a whole cover, metres about the line.
const SNOW_EDGE: vec2<f32> = vec2<f32>(-120.0, 260.0);
const SNOW_WHITE: vec3<f32> = vec3<f32>(0.80, 0.83, 0.88);
// Luminance of the leaves of a middling photo, whose light and dark turned leaves keep in part.
const LEAF_TONE: f32 = 0.075;
// How much of the ground shows through a bare canopy.
const BARE_GAPS: f32 = 0.45;

// A species' year (`shaders/src/season.rs`).
struct SeasonRow {
    // First and last day of leaf-out, days between which the leaves turn.
    out_turn: vec4<f32>,
    // Days between which they fall; 1 where they do; 0.
    fall: vec4<f32>,
    // Reflectance of turned leaves, and of what is left without any.
    turned: vec4<f32>,
    bare: vec4<f32>,
}

@group(0) @binding(10) var<uniform> season_rows: array<SeasonRow, 32>;

struct Foliage {
    // Share of the leaves that are there.
    leaves: f32,
    // Share of them that have turned.
    turned: f32,
    // How young they are.
    fresh: f32,
}

fn foliage_at(row: u32, height: f32) -> Foliage {
    let out_turn = season_rows[row].out_turn;
    let fall = season_rows[row].fall;
    if fall.z == 0.0 {
        return Foliage(1.0, 0.0, 0.0);
    }
    let day = view.season.x;
    let strength = abs(view.season.z);
    let rise = vec2<f32>(view.season.y, height - SEASON_HEIGHT);
    let spring = min(dot(LATER_SPRING, rise), LEAVES_OUT - out_turn.y);
    let autumn = min(dot(EARLIER_AUTUMN, rise), out_turn.z - FIRST_TURN);
    let out = smoothstep(out_turn.x + spring, out_turn.y + spring, day);
    let kept = 1.0 - smoothstep(fall.x - autumn, fall.y - autumn, day);
    let grown = out_turn.y + spring;
    return Foliage(
        1.0 - (strength * (1.0 - (out * kept))),
        strength * smoothstep(out_turn.z - autumn, out_turn.w - autumn, day),
        strength * (1.0 - smoothstep(grown, grown + FRESH_DAYS, day)),
    );
}

// Row of a species' code.
fn season_row(code: u32) -> u32 {
    return select(0u, code, code < GROUND_SEASON);
}

// Colour of the leaves that are there, from what they have in summer.
fn seasonal_leaf(row: u32, foliage: Foliage, summer: vec3<f32>) -> vec3<f32> {
    let tone = clamp(luminance(summer) / LEAF_TONE, 0.5, 1.6);
    let young = mix(summer, summer * vec3<f32>(1.5, 1.4, 0.9), 0.8 * foliage.fresh);
    return mix(young, season_rows[row].turned.rgb * mix(1.0, tone, 0.6), foliage.turned);
}

// Ground whose herbs the year has withered.
fn seasonal_ground(base: vec3<f32>, height: f32) -> vec3<f32> {
    let herbs = foliage_at(GROUND_SEASON, height);
    let green = smoothstep(0.02, 0.28, (base.g - (0.5 * (base.r + base.b))) / max(base.g, 1e-3));
    let straw = mix(season_rows[GROUND_SEASON].bare.rgb, season_rows[GROUND_SEASON].turned.rgb, herbs.leaves);
    let tone = clamp(luminance(base) / 0.13, 0.5, 1.5);
    let withered = max(herbs.turned, 1.0 - herbs.leaves);
    let young = mix(base, base * vec3<f32>(1.0, 1.12, 0.75), green * herbs.fresh * herbs.leaves);
    return mix(young, straw * mix(1.0, tone, 0.7), 0.85 * green * withered);
}

// Share of level ground that the season's snow covers at a height.
fn snow_at(height: f32) -> f32 {
    return smoothstep(view.season.w + SNOW_EDGE.x, view.season.w + SNOW_EDGE.y, height);
}

// The same on a slope: snow lies longer where the sun does not come, and not where it is too steep.
fn snow_on(height: f32, normal: vec3<f32>, up: vec3<f32>) -> f32 {
    let shaded = normal.y * select(-1.0, 1.0, view.season.z >= 0.0);
    let steepness = 1.0 - dot(normal, up);
    return snow_at(height + (170.0 * shaded)) * (1.0 - smoothstep(0.2, 0.48, steepness));
}
