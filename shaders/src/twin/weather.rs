//! Twin of `wgsl/weather.wgsl`: wind and the shadows of clouds.

use crate::layout::View;
use glam::{IVec2, Vec2, Vec3};

const GUST_METRES: f32 = 85.0;
const CLOUD_METRES: f32 = 1_700.0;
const CLOUD_HEIGHT: f32 = 4_300.0;
const CLOUD_CLEARANCE: f32 = 600.0;
const CLOUD_SHADE: f32 = 0.8;

fn drift_hash(cell: IVec2, seed: u32) -> f32 {
    let place = cell.as_uvec2();
    let mut bits = place.x.wrapping_mul(0x9e37_79b1) ^ place.y.wrapping_mul(0x85eb_ca77).wrapping_add(seed);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
    bits = (bits ^ (bits >> 12)).wrapping_mul(0x297a_2d39);
    ((bits ^ (bits >> 15)) >> 8) as f32 * 5.960_464_5e-8
}

fn mix(from: f32, to: f32, share: f32) -> f32 {
    from + share * (to - from)
}

fn smoothstep(low: f32, high: f32, value: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn drift_noise(cell: IVec2, at: Vec2, seed: u32) -> f32 {
    let whole = at.floor();
    let corner = cell.wrapping_add(whole.as_ivec2());
    let part = at - whole;
    let smoothed = part * part * (3.0 - 2.0 * part);
    let hash = |x, y| drift_hash(corner.wrapping_add(IVec2::new(x, y)), seed);
    let south = mix(hash(0, 0), hash(1, 0), smoothed.x);
    let north = mix(hash(0, 1), hash(1, 1), smoothed.x);
    mix(south, north, smoothed.y)
}

/// How hard the wind blows at a place (metres east and north of the eye), 0…1.
pub fn gust_at(view: &View, place: Vec2) -> f32 {
    let at = Vec2::from(view.gust_part) + place / GUST_METRES;
    let cell = IVec2::from(view.gust_cell);
    let broad = drift_noise(cell, at, 61);
    let narrow = drift_noise(cell.wrapping_mul(IVec2::splat(2)), at * 2.0, 62);
    0.65 * broad + 0.35 * narrow
}

/// Share of the sun's light that clouds leave to a point (metres from the eye, east-north-up) at a height above
/// the sea, metres.
pub fn cloud_light(view: &View, point: Vec3, height: f32) -> f32 {
    let sun = Vec3::new(view.sun[0], view.sun[1], view.sun[2]);
    let rise = (CLOUD_HEIGHT - height).max(CLOUD_CLEARANCE) / sun.z.max(0.1);
    let at = Vec2::from(view.cloud_part) + (point.truncate() + sun.truncate() * rise) / CLOUD_METRES;
    let cell = IVec2::from(view.cloud_cell);
    let octave =
        |times: i32, seed| drift_noise(cell.wrapping_mul(IVec2::splat(times)), at * times as f32, seed);
    let lumps = 0.5 * octave(1, 71) + 0.27 * octave(2, 72) + 0.15 * octave(4, 73) + 0.08 * octave(8, 74);
    let bare = mix(0.8, 0.2, view.clouds);
    1.0 - CLOUD_SHADE * smoothstep(bare - 0.07, bare + 0.07, lumps)
}
