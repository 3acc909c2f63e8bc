//! Twin of `load_map_box.wgsl`: a box of the ground as the eye sees it.

use super::Texels;
use super::load_map::{ENDLESS, LoadMap};
use super::load_map_place::enu_from_place;
use glam::{IVec4, UVec2, Vec2, Vec3, Vec4, Vec4Swizzles};

/// A rectangle of a map between two heights: east-north-up at the eye, metres from it.
#[derive(Clone, Copy, Debug)]
pub struct GroundBox {
    /// West and east, north and south, low and high: bits 0, 1 and 2.
    pub corners: [Vec3; 8],
    /// How far the ground may bulge beyond the corners' hull, and what f32 may lose, metres.
    pub pad: f32,
}

/// Least > greatest: nothing.
pub const NO_RANGE: Vec2 = Vec2::new(3.0e38, -3.0e38);
const ROUNDING: f32 = 1.0e-6;
const LEAST_RADIUS: f32 = 6.33e6;
const GREATEST_RADIUS: f32 = 6.41e6;
const NEAR_PLANE: f32 = 1.0e-4;
const SEARCH_LIMIT: u32 = 512;

/// Between two heights over a rectangle of a map, in cells from the map's corner.
pub fn ground_box<T: Texels>(map: &LoadMap<'_, T>, of: u32, low: Vec2, high: Vec2, range: Vec2) -> GroundBox {
    let level = &map.stack.levels[of as usize];
    let eye = Vec2::from_array(level.eye);
    let start = (low - eye) * level.span;
    let end = (high - eye) * level.span;
    let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| {
        let east = if corner & 1 != 0 { end.x } else { start.x };
        let south = if corner & 2 != 0 { end.y } else { start.y };
        enu_from_place(map.stack.eye, east, -south, if corner & 4 != 0 { range.y } else { range.x })
    });
    let side = end - start;
    let cosine = (map.stack.eye[1] + start.y.abs().max(end.y.abs())).min(1.0);
    let bulge = 0.125 * GREATEST_RADIUS * (side.y * side.y + cosine * side.x * side.x);
    let pad = bulge + level.span * LEAST_RADIUS * 4.0e-6 + ROUNDING * corners[0].length() + 0.01;
    GroundBox { corners, pad }
}

/// Least and greatest distance from a point, metres.
pub fn distance_range(ground: &GroundBox, origin: Vec3) -> Vec2 {
    let mut low = Vec3::splat(ENDLESS);
    let mut high = Vec3::splat(-ENDLESS);
    let mut far = 0.0_f32;
    for corner in ground.corners {
        let place = corner - origin;
        low = low.min(place);
        high = high.max(place);
        far = far.max(place.length());
    }
    let outside = low.max(-high).max(Vec3::ZERO);
    Vec2::new((outside.length() - ground.pad).max(0.0), far + ground.pad)
}

fn axis(vector: [f32; 4]) -> Vec3 {
    Vec4::from_array(vector).xyz()
}

/// Whether a box is quite outside one of the picture's four sides as seen from a point.
pub fn outside_picture<T: Texels>(
    map: &LoadMap<'_, T>,
    ground: &GroundBox,
    origin: Vec3,
    widening: f32,
) -> bool {
    let view = map.world.view;
    let (right, up) = (axis(view.right), axis(view.up));
    let forward = axis(view.forward) * widening;
    let sides = [
        (forward * right.length() + right / right.length()).normalize(),
        (forward * right.length() - right / right.length()).normalize(),
        (forward * up.length() + up / up.length()).normalize(),
        (forward * up.length() - up / up.length()).normalize(),
    ];
    sides.iter().any(|side| {
        ground.corners.iter().map(|&corner| side.dot(corner - origin)).fold(-ENDLESS, f32::max) < -ground.pad
    })
}

/// The picture's rectangle that a box covers, −1…1 right and up: least x, y, greatest x, y.
pub fn picture_rectangle<T: Texels>(map: &LoadMap<'_, T>, ground: &GroundBox, far: f32) -> Vec4 {
    let view = map.world.view;
    let right = axis(view.right) / axis(view.right).dot(axis(view.right));
    let up = axis(view.up) / axis(view.up).dot(axis(view.up));
    let pad = ground.pad * Vec2::new(right.length(), up.length());
    let near = NEAR_PLANE * far;
    let seen = ground
        .corners
        .map(|place| Vec3::new(right.dot(place), up.dot(place), axis(view.forward).dot(place) + ground.pad));
    let mut low = Vec2::splat(ENDLESS);
    let mut high = Vec2::splat(-ENDLESS);
    for corner in 0..8 {
        let a = seen[corner];
        let across = Vec2::new(a.x, a.y);
        if a.z >= near {
            let depths = Vec2::new((a.z - 2.0 * ground.pad).max(near), a.z);
            low = low.min(((across - pad) / depths.x).min((across - pad) / depths.y));
            high = high.max(((across + pad) / depths.x).max((across + pad) / depths.y));
        }
        for bit in [1, 2, 4] {
            if corner & bit == 0 {
                let b = seen[corner | bit];
                if (a.z >= near) != (b.z >= near) {
                    let share = (near - a.z) / (b.z - a.z);
                    let cut = across * (1.0 - share) + Vec2::new(b.x, b.y) * share;
                    low = low.min((cut - pad) / near);
                    high = high.max((cut + pad) / near);
                }
            }
        }
    }
    Vec4::new(low.x, low.y, high.x, high.y)
}

/// The same in texels of the pyramid's mip 0, inclusive; x > z where none of it is in the picture.
pub fn pyramid_rectangle<T: Texels>(map: &LoadMap<'_, T>, rectangle: Vec4, slack: f32) -> IVec4 {
    let size = UVec2::from_array(map.world.view.size).as_vec2();
    let clamped = rectangle.clamp(Vec4::splat(-2.0), Vec4::splat(2.0));
    let west_north = (Vec2::new(clamped.x, -clamped.w) + 1.0) * 0.5 * size;
    let east_south = (Vec2::new(clamped.z, -clamped.y) + 1.0) * 0.5 * size;
    let first = ((west_north + (0.5 - slack)) * 0.5).floor().as_ivec2();
    let last = ((east_south + (0.5 + slack)) * 0.5).floor().as_ivec2();
    let end = map.pyramid.mip_size(0).as_ivec2() - 1;
    let beside = rectangle.xy().cmpgt(rectangle.zw()).any()
        || last.cmplt(glam::IVec2::ZERO).any()
        || first.cmpgt(end).any();
    if beside {
        return IVec4::new(1, 1, 0, 0);
    }
    let (first, last) = (first.max(glam::IVec2::ZERO), last.min(end));
    IVec4::new(first.x, first.y, last.x, last.y)
}

/// Whether distances from `range.x` to `range.y` show in a rectangle of the pyramid: in its gaps, or anywhere.
pub fn shows<T: Texels>(map: &LoadMap<'_, T>, rectangle: IVec4, range: Vec2, gaps: bool) -> bool {
    let low = rectangle.xy().as_uvec2();
    let high = rectangle.zw().as_uvec2();
    let apart = (low.x ^ high.x) | (low.y ^ high.y);
    let mut mip = if apart != 0 { apart.ilog2() + 1 } else { 0 };
    let top = mip;
    let mut texel = low >> UVec2::splat(mip);
    for _ in 0..SEARCH_LIMIT {
        let first = texel << UVec2::splat(mip);
        let last = first + ((1 << mip) - 1);
        if first.cmple(high).all() && last.cmpge(low).all() {
            let distances = map.pyramid.load(mip, texel);
            let found = if gaps { distances.xy() } else { distances.zw() };
            if found.x <= range.y && found.y >= range.x {
                if mip == 0 {
                    return true;
                }
                mip -= 1;
                texel *= 2;
                continue;
            }
        }
        while mip < top && texel & UVec2::ONE == UVec2::ONE {
            mip += 1;
            texel = texel >> UVec2::ONE;
        }
        if mip == top {
            return false;
        }
        texel = if texel.x & 1 == 0 { texel + UVec2::X } else { UVec2::new(texel.x - 1, texel.y + 1) };
    }
    true
}
