//! Twin of `terrain.wgsl`: a ray, from leaf to leaf through the page table.

use super::max_mip::{Carried, Crossing, Side, direction_of, max_mip};
use super::page_table::{across_edge, enter_grid, find_square, root_index};
use super::ray::{
    Ray, Segment, along_leaf, picture_place, quadratic_at, segment_of, stands, straight_length,
};
use super::{Texels, World};
use crate::layout::{EMPTY, LEAF_BIT, ROOT_BITS, View};
use glam::{IVec2, UVec2, Vec2, Vec3, Vec4, Vec4Swizzles};

/// Leaves that a ray may visit.
pub const LEAF_LIMIT: u32 = 4096;
/// Segments of a ray within a leaf.
pub const SEGMENT_LIMIT: u32 = 256;
const LEAST_ADVANCE: Vec2 = Vec2::new(2.4e-7, 1.0e-5);
const LOWEST: f32 = -2.0e4;
const LOW_LEVEL: u32 = 2;

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Metres from the eye; negative: a miss.
    pub distance: f32,
    /// Index of the leaf, `EMPTY` for a miss.
    pub leaf: u32,
    /// Cells of the leaf's tile.
    pub place: Vec2,
    /// Node loads and gathers.
    pub fetches: u32,
}

/// The ray through a pixel's centre.
pub fn view_ray(view: &View, pixel: UVec2) -> Ray {
    let place = picture_place(view, pixel);
    let axis = |vector: [f32; 4]| Vec4::from_array(vector).xyz();
    let direction = axis(view.forward) + place.x * axis(view.right) + place.y * axis(view.up);
    Ray { origin: Vec3::ZERO, direction: direction.normalize() }
}

/// 0…1, of a pixel: which leaf of a fading pair it sees.
pub fn pixel_share(pixel: UVec2) -> f32 {
    let mut x = pixel.x.wrapping_mul(0x9e37_79b1) ^ pixel.y.wrapping_mul(0x85eb_ca77);
    x = (x ^ (x >> 15)).wrapping_mul(0x2c1b_3c6d);
    x = (x ^ (x >> 12)).wrapping_mul(0x297a_2d39);
    ((x ^ (x >> 15)) >> 8) as f32 / 16_777_216.0
}

fn missed(fetches: u32) -> Hit {
    Hit { distance: -1.0, leaf: EMPTY, place: Vec2::ZERO, fetches }
}

fn leave_box(segment: &Segment, low: Vec2, high: Vec2) -> Crossing {
    let forward = segment.slope.cmpgt(Vec2::ZERO);
    let raw = (Vec2::select(forward, high, low) - segment.place) * segment.inverse;
    let exits = Vec2::select(stands(segment), Vec2::splat(segment.length), raw);
    let nearest = exits.min_element();
    if nearest >= segment.length {
        return Crossing { hit: false, r: segment.length, step: IVec2::ZERO };
    }
    let crossed = exits.cmple(Vec2::splat(nearest));
    let step = IVec2::select(crossed, direction_of(forward), IVec2::ZERO);
    Crossing { hit: false, r: nearest.max(0.0), step }
}

/// Casts a ray from the eye; `share` chooses between a leaf that fades in and its stand-in.
pub fn cast_ray<T: Texels>(world: &World<'_, T>, ray: &Ray, share: f32) -> Hit {
    let view = world.view;
    let highest = view.forward[3];
    let mut s = 0.0_f32;
    let mut grid = UVec2::from_array(view.eye_grid);
    let mut carried = Carried { side: Side::AtEye, fetches: 0 };
    if view.eye_inside == 0 || view.up[3] > highest {
        let Some(entry) = enter_grid(world, ray) else {
            return missed(0);
        };
        (s, grid) = entry;
        carried.side = Side::Unknown;
    }
    for _ in 0..LEAF_LIMIT {
        let square = find_square(world, grid);
        let is_empty = square.entry == EMPTY;
        let mut index = square.entry & !LEAF_BIT;
        if is_empty {
            index = root_index(world, grid);
            carried.side = Side::Unknown;
        } else {
            let leaf = &world.leaves[index as usize];
            if leaf.stand_in != EMPTY && share >= leaf.h_cross_maximum_fade[3] {
                index = leaf.stand_in;
            }
        }
        let leaf = &world.leaves[index as usize];
        let along = along_leaf(leaf, ray, true);
        let stretch = straight_length(&along);
        let cells = leaf.cells[0].min(leaf.cells[1]).max(1);
        let top = cells.ilog2().min(world.texels.levels());
        let mut low =
            (UVec2::from_array(leaf.first_cell).as_ivec2() - IVec2::from_array(leaf.eye_cell)).as_vec2();
        let mut sides = UVec2::from_array(leaf.cells).as_vec2();
        if is_empty {
            let unit = sides / (1_u32 << ROOT_BITS) as f32;
            low += (square.origin & UVec2::splat((1 << ROOT_BITS) - 1)).as_vec2() * unit;
            sides = square.side as f32 * unit;
        }
        let came = s;
        let mut step = IVec2::ZERO;
        for _ in 0..SEGMENT_LIMIT {
            let rise = along.h.y + 2.0 * along.h.z * s;
            let height = quadratic_at(along.h, s);
            if (height > highest && rise >= 0.0) || (height < LOWEST && rise < 0.0) {
                return missed(carried.fetches);
            }
            let segment = segment_of(&along, s, stretch, leaf);
            let crossing = if is_empty {
                let offset = (segment.cell - IVec2::from_array(leaf.eye_cell)).as_vec2();
                leave_box(&segment, low - offset, low + sides - offset)
            } else {
                max_mip(world, &segment, leaf.slot, top, LOW_LEVEL.min(top), 0.0, IVec2::ZERO, &mut carried)
            };
            let place = segment.cell.as_vec2() + segment.place + crossing.r * segment.slope;
            s += crossing.r;
            if crossing.hit {
                return Hit { distance: s, leaf: index, place, fetches: carried.fetches };
            }
            step = crossing.step;
            if step != IVec2::ZERO {
                break;
            }
        }
        if step == IVec2::ZERO {
            break;
        }
        s = s.max(came + (came * LEAST_ADVANCE.x).max(LEAST_ADVANCE.y));
        let place = Vec2::new(quadratic_at(along.u, s), quadratic_at(along.v, s));
        let Some(next) = across_edge(world, &square, step, (place - low) / sides) else {
            return missed(carried.fetches);
        };
        grid = next;
    }
    missed(carried.fetches)
}
