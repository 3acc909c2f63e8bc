//! Twin of `wgsl/crowns.wgsl`: the trees along a ray where the heights hold only the canopy's mean.
//!
//! The candidates are `treeline_core::seeds`' own: the twin of `wgsl/seeds.wgsl` is the original.

use crate::layout::View;
use glam::{BVec2, IVec2, UVec2, Vec2};
use std::f32::consts::PI;
use treeline_core::seeds::pattern::{CELL_UNITS, CellRow, ROWS, candidate, pattern_of_cell, sub_cell_place};

const CROWN_ROWS: i32 = 8;
const CLOSED_CANOPY: f32 = 0.37;
pub(super) const CROWN_BASE: f32 = 0.2;
const LOWEST_TREE: f32 = 0.7;
pub(super) const TALLEST_TREE: f32 = 1.3;
const CLOSED_SHARE: f32 = 52_000.0;
const PLACE_UNIT: f32 = 0.009_330_6;

/// The trees about a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stand {
    /// Mean height of the trees, metres.
    pub height: f32,
    /// Radius of a crown at its rim over the tree's height.
    pub crown_radius: f32,
    /// Ranks below this live.
    pub share: u32,
    /// Area under all crowns' discs over the ground's, their overlaps counted twice.
    pub cover: f32,
}

/// A ray over the ground about the point where it has met the canopy's mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CanopyRay {
    /// Place of the point, units of `treeline_core::seeds::place`.
    pub place: UVec2,
    /// The point's height over the ground, metres.
    pub height: f32,
    /// Unit direction, east and south.
    pub along: Vec2,
    /// Metres that the ray falls towards the ground per metre along.
    pub fall: f32,
    /// Metres per unit of place, east and south.
    pub unit_metres: Vec2,
}

/// What a ray meets in the canopy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Met {
    /// A crown.
    Crown(CrownHit),
    /// Nothing: it was followed to the ground.
    Gap,
    /// Nothing, and it was not followed to the ground.
    CutShort,
}

/// Where a ray meets a crown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrownHit {
    /// From the tree's axis to the point: unit vector, east and south.
    pub outward: Vec2,
    /// The crown's slope there, rise per metre towards the axis.
    pub steepness: f32,
    /// Height over the ground in mean heights of the stand's trees.
    pub height: f32,
    /// The tree's own, 0…1, alike for all sizes.
    pub tone: f32,
}

/// The stand of a mean canopy height, metres. `closed`: share of the ground that is forest rather than open.
pub fn stand_of(view: &View, canopy_height: f32, closed: f32) -> Stand {
    let typical = view.tree_size[0];
    let share_of_closed = (canopy_height / (CLOSED_CANOPY * typical)).max(1e-3);
    let lower = 0.15 + 0.2 * closed;
    let height = typical * share_of_closed.powf(lower).clamp(0.3, 1.6);
    let closure = share_of_closed.powf(1.0 - lower).min(1.0);
    let share = (CLOSED_SHARE * closure * typical / height).min(65_536.0);
    let radius = view.tree_size[1] * height;
    let sub_cell = PLACE_UNIT * CELL_UNITS as f32 / ROWS as f32;
    let cover = share / 65_536.0 * PI * radius * radius / (sub_cell * sub_cell);
    Stand { height, crown_radius: view.tree_size[1], share: share as u32, cover }
}

/// Place of a point of the grid.
pub fn place_of_grid(view: &View, unit: UVec2) -> UVec2 {
    let corner = UVec2::from(view.grid_place);
    let units = if view.root_level >= 5 {
        unit >> UVec2::splat(view.root_level - 5)
    } else {
        unit << UVec2::splat(5 - view.root_level)
    };
    corner.wrapping_add(units)
}

fn crown_meeting_height(fall: f32) -> f32 {
    0.70 - 0.085 * fall.log2().clamp(-4.0, 2.0)
}

/// The first crown along a ray.
pub fn first_crown(view: &View, ray: &CanopyRay, stand: &Stand) -> Met {
    let cell = ray.place / CELL_UNITS;
    let own_row = CellRow::new(cell.y);
    if own_row.columns == 0 {
        return Met::Gap;
    }
    let counts = Vec2::new(own_row.columns as f32, ROWS as f32);
    let cell_units = CELL_UNITS as f32;
    let start = (ray.place % CELL_UNITS).as_vec2() * (counts / cell_units);
    let metres = ray.unit_metres * (cell_units / counts);
    let rate = ray.along / metres;
    let by_columns = rate.x.abs() > rate.y.abs();
    let major = if by_columns { Vec2::X } else { Vec2::Y };
    let minor = Vec2::ONE - major;
    let speed = rate.dot(major);
    let ahead = if speed < 0.0 { -1.0 } else { 1.0 };

    let fall = ray.fall;
    let bottom = (ray.height - 0.5 * CROWN_BASE * stand.height) / fall;
    let reach = (CROWN_ROWS as f32 - 1.5) / speed.abs();
    let meets = stand.height * crown_meeting_height(fall);
    let flat_first = (ray.height - meets) / fall - 0.35 * reach;
    let first = ((ray.height - TALLEST_TREE * stand.height) / fall).max(flat_first.min(bottom - reach));
    let origin = start.dot(major);
    let nearest_row = (origin + speed * first - 0.3 * ahead).floor() as i32;
    let last_row = (origin + speed * bottom + 0.3 * ahead).floor() as i32;
    let all_rows = (last_row - nearest_row).abs() + 1;
    let rows = all_rows.min(CROWN_ROWS);
    let cut_short = all_rows > CROWN_ROWS;

    let taper = stand.crown_radius / (1.0 - CROWN_BASE);
    let steep = taper * fall;
    let squared = 1.0 - steep * steep;
    let mut hit = if cut_short { Met::CutShort } else { Met::Gap };
    let mut nearest = 1e9;
    for step in 0..rows {
        let line = nearest_row + step * ahead as i32;
        let at = ((line as f32 + 0.5 - origin) / speed).clamp(first, bottom);
        let beside = ((start + rate * at).dot(minor) - 0.5).floor() as i32;
        for side in 0..2 {
            let sub_cell = IVec2::new(beside + side, line);
            let sub_cell =
                IVec2::select(BVec2::splat(by_columns), IVec2::new(sub_cell.y, sub_cell.x), sub_cell);
            let off = IVec2::new(
                ((sub_cell.x as f32 + 0.5) / counts.x).floor() as i32,
                (sub_cell.y as f32 / ROWS as f32).floor() as i32,
            );
            let its_cell = cell.wrapping_add_signed(off);
            let row = CellRow::new(its_cell.y);
            let columns = row.columns.max(1);
            let pattern = pattern_of_cell(its_cell.x, its_cell.y, view.scene_seed);
            let i = ((sub_cell.x - off.x * own_row.columns as i32) as u32).min(columns - 1);
            let j = (sub_cell.y - off.y * ROWS as i32) as u32;
            let tree = candidate(pattern, columns, i, j);
            if tree.rank >= stand.share {
                continue;
            }
            let corner = off.as_vec2() * counts;
            let place = UVec2::from(sub_cell_place(pattern, i, j)).as_vec2() / 4096.0;
            let foot = (corner + place - start) * metres;
            let size = f32::from(tree.size) / 255.0;
            let height = stand.height * (LOWEST_TREE + (TALLEST_TREE - LOWEST_TREE) * size);
            let closest = ray.along.dot(foot);
            let off_axis = foot.dot(foot) - closest * closest;
            let below_top = height - ray.height + fall * closest;
            let root = taper * taper * below_top * below_top - squared * off_axis;
            if below_top <= 0.0 || root <= 0.0 {
                continue;
            }
            let t = closest + (steep * taper * below_top - root.sqrt()) / squared;
            let z = ray.height - fall * t;
            if t < nearest && z >= CROWN_BASE * height {
                nearest = t;
                let from_axis = ray.along * t - foot;
                hit = Met::Crown(CrownHit {
                    outward: from_axis / from_axis.length().max(1e-3),
                    steepness: 1.0 / taper,
                    height: z / stand.height,
                    tone: f32::from(tree.rotation) / 255.0,
                });
            }
        }
        if matches!(hit, Met::Crown(_)) {
            break;
        }
    }
    hit
}
