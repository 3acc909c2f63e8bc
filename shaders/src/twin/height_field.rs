//! Twin of `height_field.wgsl`: one leaf, a plane, rays that start on the sheet's base plane.

use super::max_mip::{Carried, Crossing, Side, direction_of, max_mip};
use super::ray::{Ray, along_leaf, crossings, picture_place, segment_of, stands};
use super::{Texels, World};
use crate::layout::EMPTY;
use glam::{BVec2, IVec2, UVec2, Vec2, Vec4, Vec4Swizzles};

const LOW_LEVEL: u32 = 2;

/// What a pixel of the height field's picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter from the base plane, in units of the forward axis; negative: a miss.
    pub parameter: f32,
    /// 0, or `EMPTY` for a miss.
    pub leaf: u32,
    /// Cells.
    pub place: Vec2,
    /// Node loads and gathers.
    pub fetches: u32,
}

/// Casts the ray through a pixel. A world without a sheet has no base plane: the eye's.
pub fn height_field<T: Texels>(world: &World<'_, T>, pixel: UVec2) -> Hit {
    let view = world.view;
    let place = picture_place(view, pixel);
    let axis = |vector: [f32; 4]| Vec4::from_array(vector).xyz();
    let across = place.x * axis(view.right) + place.y * axis(view.up);
    let base = world.sheet.map_or(0.0, |sheet| sheet.base);
    let ray = Ray { origin: base * across, direction: axis(view.forward) + across };
    let leaf = &world.leaves[0];
    let segment = segment_of(&along_leaf(leaf, &ray, false), 0.0, leaf.distance_range[1], leaf);

    let forward = segment.slope.cmpgt(Vec2::ZERO);
    let near = crossings(&segment, IVec2::select(forward, segment.first, segment.end));
    let far = crossings(&segment, IVec2::select(forward, segment.end, segment.first));
    let low = (segment.first - segment.cell).as_vec2() - segment.place;
    let high = (segment.end - segment.cell).as_vec2() - segment.place;
    let standing = stands(&segment);
    let beside: BVec2 = standing & (low.cmpgt(Vec2::ZERO) | high.cmplt(Vec2::ZERO));
    let begins = Vec2::select(standing, Vec2::ZERO, near);
    let start = begins.max_element().max(0.0);
    let mut carried = Carried { side: if start == 0.0 { Side::AtEye } else { Side::Unknown }, fetches: 0 };
    let mut crossing = Crossing { hit: false, r: 0.0, step: IVec2::ZERO };
    if !beside.any() && start <= far.min_element().min(segment.length) {
        let at_start = begins.cmpeq(Vec2::splat(start)) & begins.cmpgt(Vec2::ZERO);
        let entered = IVec2::select(at_start, direction_of(forward), IVec2::ZERO);
        let top = world.texels.levels();
        let level = if start == 0.0 { LOW_LEVEL.min(top) } else { top };
        crossing = max_mip(world, &segment, leaf.slot, top, level, start, entered, &mut carried);
    }
    if !crossing.hit {
        return Hit { parameter: -1.0, leaf: EMPTY, place: Vec2::ZERO, fetches: carried.fetches };
    }
    let at = segment.cell.as_vec2() + segment.place + crossing.r * segment.slope;
    Hit { parameter: crossing.r, leaf: 0, place: at, fetches: carried.fetches }
}
