//! Twin of `leaf_at.wgsl`: from a place to the leaf that is drawn there.

use super::photo::root_entry;
use super::{Texels, World};
use crate::layout::{EMPTY, LEAF_BIT, ROOT_BITS, View};
use glam::UVec2;

/// Grid coordinates of a place in units (`treeline_core::seeds::place`).
pub fn grid_of_place(view: &View, place: UVec2) -> UVec2 {
    let apart =
        UVec2::new(place.x.wrapping_sub(view.grid_place[0]), place.y.wrapping_sub(view.grid_place[1]));
    if view.root_level >= 5 { apart << (view.root_level - 5) } else { apart >> (5 - view.root_level) }
}

/// Index of the leaf at grid coordinates, or [`EMPTY`].
pub fn leaf_index_at<T: Texels>(world: &World<'_, T>, unit: UVec2) -> u32 {
    let root = root_entry(world.view, unit);
    if root == EMPTY {
        return EMPTY;
    }
    let mut entry = world.nodes[root as usize];
    for depth in 0..ROOT_BITS {
        if entry & LEAF_BIT != 0 {
            break;
        }
        let quadrant = (unit >> (ROOT_BITS - 1 - depth)) & 1;
        entry = world.nodes[(entry + 2 * quadrant.y + quadrant.x) as usize];
    }
    let index = entry & !LEAF_BIT;
    if entry == EMPTY || entry & LEAF_BIT == 0 || world.leaves[index as usize].slot == EMPTY {
        return EMPTY;
    }
    index
}
