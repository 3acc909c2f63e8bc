//! Twin of `page_table.wgsl`: from grid coordinates to squares of the page table, and from square to square.

use super::ray::{LEAST_SLOPE, LeafRay, Ray, along_leaf, quadratic_at};
use super::{Texels, World};
use crate::layout::{EMPTY, LEAF_BIT, Leaf, ROOT_BITS};
use glam::{IVec2, UVec2, Vec2, Vec3};

/// A square of the cut: a leaf, or `EMPTY`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridSquare {
    /// Entry of the page table.
    pub entry: u32,
    /// North-west corner.
    pub origin: UVec2,
    /// Side, in the grid's units.
    pub side: u32,
}

const IN_ROOT: u32 = (1 << ROOT_BITS) - 1;

/// Index of the root tile over which a place is.
pub fn root_index<T: Texels>(world: &World<'_, T>, grid: UVec2) -> u32 {
    (grid.y >> ROOT_BITS) * world.view.root_size[0] + (grid.x >> ROOT_BITS)
}

/// The square that holds a place, by the place's bits from the root tile down.
pub fn find_square<T: Texels>(world: &World<'_, T>, grid: UVec2) -> GridSquare {
    let mut entry = world.nodes[root_index(world, grid) as usize];
    let mut bits = ROOT_BITS;
    while bits > 0 && entry & LEAF_BIT == 0 {
        bits -= 1;
        let quadrant = (grid.x >> bits & 1) + 2 * (grid.y >> bits & 1);
        entry = world.nodes[(entry + quadrant) as usize];
    }
    let corner = |coordinate: u32| (coordinate >> bits) << bits;
    GridSquare { entry, origin: UVec2::new(corner(grid.x), corner(grid.y)), side: 1 << bits }
}

/// The place just across a square's edge (or corner), `None` outside the root grid: integer and exact on the axes
/// crossed (`step`); on the other, `share` (0…1) of the way along the edge.
pub fn across_edge<T: Texels>(
    world: &World<'_, T>,
    square: &GridSquare,
    step: IVec2,
    share: Vec2,
) -> Option<UVec2> {
    let along = (share.clamp(Vec2::ZERO, Vec2::ONE) * square.side as f32).as_uvec2();
    let mut grid = square.origin + along.min(UVec2::splat(square.side - 1));
    let mut inside = true;
    let last = square.origin + (square.side - 1);
    let [columns, rows] = world.view.root_size;
    if step.x > 0 {
        grid.x = last.x.wrapping_add(1);
        if (last.x >> ROOT_BITS) + 1 == columns && last.x & IN_ROOT == IN_ROOT {
            inside = world.view.wraps == 1;
            grid.x = 0;
        }
    } else if step.x < 0 {
        grid.x = square.origin.x.wrapping_sub(1);
        if square.origin.x == 0 {
            inside = world.view.wraps == 1;
            grid.x = (columns << ROOT_BITS).wrapping_sub(1);
        }
    }
    if step.y > 0 {
        grid.y = last.y.wrapping_add(1);
        inside = inside && !((last.y >> ROOT_BITS) + 1 == rows && last.y & IN_ROOT == IN_ROOT);
    } else if step.y < 0 {
        inside = inside && square.origin.y != 0;
        grid.y = square.origin.y.wrapping_sub(1);
    }
    inside.then_some(grid)
}

fn cut_to_band(q: Vec3, range: Vec2, least: f32, greatest: f32) -> Vec2 {
    let span = (range.y - range.x).max(0.0);
    let bend = q.z.abs() * span * span * 0.25;
    let value = quadratic_at(q, range.x);
    let slope = q.y + q.z * (2.0 * range.x + span);
    let from_value = least - bend - value;
    let to_value = greatest + bend - value;
    if slope.abs() < LEAST_SLOPE {
        if from_value <= 0.0 && to_value >= 0.0 {
            return range;
        }
        return Vec2::new(1.0, 0.0);
    }
    let inverse = 1.0 / slope;
    let ends = Vec2::new(from_value, to_value) * inverse;
    Vec2::new(range.x + ends.min_element().max(0.0), range.x + ends.max_element().min(span))
}

fn range_in_root(leaf: &Leaf, along: &LeafRay, highest: f32) -> Vec2 {
    let (first, cells) = root_box(leaf);
    let end = first + cells;
    let mut range = Vec2::from_array(leaf.distance_range);
    for _ in 0..4 {
        if range.x > range.y {
            break;
        }
        range = cut_to_band(along.u, range, first.x, end.x);
        if range.x <= range.y {
            range = cut_to_band(along.v, range, first.y, end.y);
        }
        if range.x <= range.y {
            range = cut_to_band(along.h, range, -1.0e9, highest);
        }
    }
    range
}

fn root_box(leaf: &Leaf) -> (Vec2, Vec2) {
    let first = UVec2::from_array(leaf.first_cell).as_ivec2() - IVec2::from_array(leaf.eye_cell);
    (first.as_vec2(), UVec2::from_array(leaf.cells).as_vec2())
}

/// Where a ray whose eye is beside the root grid, or above all of the scene, comes in: distance and place.
pub fn enter_grid<T: Texels>(world: &World<'_, T>, ray: &Ray) -> Option<(f32, UVec2)> {
    let mut best: Option<(f32, UVec2)> = None;
    let [columns, rows] = world.view.root_size;
    for index in 0..columns * rows {
        if world.nodes[index as usize] == EMPTY {
            continue;
        }
        let leaf = &world.leaves[index as usize];
        let along = along_leaf(leaf, ray, true);
        let range = range_in_root(leaf, &along, world.view.forward[3]);
        if range.x > range.y || best.is_some_and(|(s, _)| range.x >= s) {
            continue;
        }
        let place = Vec2::new(quadratic_at(along.u, range.x), quadratic_at(along.v, range.x));
        let (first, cells) = root_box(leaf);
        let share = ((place - first) / cells).clamp(Vec2::ZERO, Vec2::ONE);
        let in_root = (share * (IN_ROOT + 1) as f32).as_uvec2().min(UVec2::splat(IN_ROOT));
        let root = UVec2::new(index % columns, index / columns);
        best = Some((range.x, (root << UVec2::splat(ROOT_BITS)) + in_root));
    }
    best
}
