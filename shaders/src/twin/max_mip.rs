//! Twin of `max_mip.wgsl`: maximum mip, advance to a node's plane, exact patch, and the carried side.

use super::patch::{first_crossing, ray_minus_patch};
use super::ray::{Segment, cell_at, crossings, quadratic_at};
use super::{Texels, World};
use crate::layout::VOID_HEIGHT;
use glam::{BVec2, IVec2, Vec2, Vec3, Vec4};

/// On which side of the surface a ray is known to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// It came out of a void, or in from beside the data.
    Unknown,
    /// Over the surface.
    Above,
    /// Under it.
    Below,
    /// Unknown, and the ray starts here: being below is no wall.
    AtEye,
}

/// Bound of the relative error of a height along a ray in f32.
pub const HEIGHT_SLACK: f32 = 4.0e-7;

/// What a ray carries from cell to cell, segment to segment and leaf to leaf.
#[derive(Clone, Copy, Debug)]
pub struct Carried {
    /// Its side.
    pub side: Side,
    /// Node loads and gathers of four.
    pub fetches: u32,
}

/// How a segment ended: with a hit at r, or by leaving the leaf's cells (±1 along the axes crossed),
/// or neither: at its end.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Whether it hit.
    pub hit: bool,
    /// Where.
    pub r: f32,
    /// The axes crossed.
    pub step: IVec2,
}

/// The four nodes of a cell.
pub fn patch_nodes<T: Texels>(world: &World<'_, T>, slot: u32, cell: IVec2) -> Vec4 {
    let texel = cell + world.border();
    let load = |x: i32, y: i32| world.texels.height(slot, texel.x + x, texel.y + y);
    Vec4::new(load(0, 0), load(1, 0), load(0, 1), load(1, 1))
}

fn is_void(nodes: Vec4) -> bool {
    nodes.min_element() <= VOID_HEIGHT
}

fn advance_to_plane(height: f32, rise: f32, curvature: f32, maximum: f32, slack: f32) -> f32 {
    let drop = height - maximum - slack;
    let discriminant = rise * rise - 4.0 * curvature * drop;
    if drop <= 0.0 || rise >= 0.0 || discriminant < 0.0 {
        return 0.0;
    }
    2.0 * drop / (discriminant.sqrt() - rise)
}

fn height_slack(segment: &Segment, height_in: f32, height_out: f32) -> f32 {
    HEIGHT_SLACK * height_in.abs().max(height_out.abs()).max(segment.height.x.abs())
}

/// The way along each axis.
pub fn direction_of(forward: BVec2) -> IVec2 {
    IVec2::select(forward, IVec2::ONE, IVec2::NEG_ONE)
}

struct Clearance {
    clear: bool,
    advance: f32,
}

fn clear_of_ceiling(segment: &Segment, r: f32, end: f32) -> Clearance {
    let curvature = segment.height.z;
    let height_in = quadratic_at(segment.height, r);
    let height_out = quadratic_at(segment.height, end);
    let slack = height_slack(segment, height_in, height_out);
    let rise = segment.height.y + 2.0 * curvature * r;
    let mut lowest = height_in.min(height_out);
    if rise < 0.0 || curvature < 0.0 {
        lowest -= curvature.max(0.0) * (end - r) * (end - r) * 0.25;
    }
    if lowest - slack > segment.ceiling {
        return Clearance { clear: true, advance: 0.0 };
    }
    Clearance { clear: false, advance: advance_to_plane(height_in, rise, curvature, segment.ceiling, slack) }
}

/// The level on which to go on in a node that is left after `cells` more: a large node tells little about a short way.
fn level_below(level: u32, cells: f32) -> u32 {
    let whole = 1 + cells.clamp(1.0, 65536.0) as u32;
    (level - 1).min(whole.ilog2() + 1)
}

/// Casts the segment from r = start; the ray enters its first cell there, having stepped by `entered`
/// (0, 0 where it did not cross a line). Levels go no higher than `top`.
#[allow(clippy::too_many_arguments, reason = "the text of the shader")]
pub fn max_mip<T: Texels>(
    world: &World<'_, T>,
    segment: &Segment,
    slot: u32,
    top: u32,
    start_level: u32,
    start: f32,
    entered: IVec2,
    carried: &mut Carried,
) -> Crossing {
    let forward = segment.slope.cmpgt(Vec2::ZERO);
    let curvature = segment.height.z;
    let mut r = start;
    let mut step = entered;
    let mut level = start_level;

    let borders = IVec2::select(forward, segment.end, segment.first);
    let ends = crossings(segment, borders);
    let end = ends.min_element().max(r).min(segment.length);
    let clearance = clear_of_ceiling(segment, r, end);
    if clearance.clear {
        if carried.side != Side::Below {
            carried.side = Side::Above;
            let leaves_cells = if end < segment.length { ends.cmple(Vec2::splat(end)) } else { BVec2::FALSE };
            return Crossing {
                hit: false,
                r: end,
                step: IVec2::select(leaves_cells, direction_of(forward), IVec2::ZERO),
            };
        }
    } else if clearance.advance > 0.0 && carried.side != Side::Below {
        r = (r + clearance.advance).min(end);
        step = IVec2::ZERO;
        level = top;
        carried.side = Side::Above;
    }
    let mut cell = cell_at(segment, r, segment.first, segment.end);
    cell =
        IVec2::select(step.cmpne(IVec2::ZERO), IVec2::select(forward, segment.first, segment.end - 1), cell);

    let limit = 64 + 8 * (segment.end - segment.first).element_sum();
    let mut family = IVec2::ZERO;
    let mut family_level = 0;
    for _ in 0..limit {
        let node = cell >> IVec2::splat(level as i32);
        let low = (node << IVec2::splat(level as i32)).max(segment.first);
        let high = ((node + 1) << IVec2::splat(level as i32)).min(segment.end);
        let lines = IVec2::select(forward, high, low);
        let exits = crossings(segment, lines);
        let nearest = exits.min_element();
        let r_out = nearest.max(r).min(segment.length);
        let span = r_out - r;
        let height_in = quadratic_at(segment.height, r);
        let height_out = quadratic_at(segment.height, r_out);
        let slack = height_slack(segment, height_in, height_out);
        let sag = curvature * span * span * 0.25;

        if level > 0 {
            // The shader gathers all four children of a parent, and keeps them.
            if family_level != level || family != node >> IVec2::ONE {
                family_level = level;
                family = node >> IVec2::ONE;
                carried.fetches += 1;
            }
            let maximum = world.texels.maximum(slot, level - 1, node.x, node.y);
            let lowest = height_in.min(height_out) - sag.max(0.0) - slack;
            if maximum <= VOID_HEIGHT {
                carried.side = Side::Unknown;
            } else if carried.side != Side::Below && lowest > maximum {
                carried.side = Side::Above;
            } else {
                let mut skipped = false;
                let may_be_wall = world.solid() && carried.side == Side::Unknown;
                if world.use_minima && carried.side != Side::Above && !may_be_wall {
                    carried.fetches += 1;
                    let highest = height_in.max(height_out) - sag.min(0.0) + slack;
                    skipped = highest < world.texels.minimum(slot, level - 1, node.x, node.y);
                }
                if !skipped {
                    if carried.side != Side::Below {
                        let rise = segment.height.y + 2.0 * curvature * r;
                        let advance = advance_to_plane(height_in, rise, curvature, maximum, slack);
                        if advance > 0.0 {
                            r = (r + advance).min(r_out);
                            step = IVec2::ZERO;
                            carried.side = Side::Above;
                            cell = cell_at(segment, r, low, high);
                        }
                    }
                    level = level_below(level, ((r_out - r) * segment.slope).abs().max_element());
                    continue;
                }
                carried.side = Side::Below;
            }
        } else {
            carried.fetches += 1;
            let nodes = patch_nodes(world, slot, cell);
            if is_void(nodes) {
                carried.side = Side::Unknown;
            } else {
                let place = ((segment.cell - cell).as_vec2() + segment.place + r * segment.slope)
                    .clamp(Vec2::ZERO, Vec2::ONE);
                let place = Vec2::select(
                    step.cmpne(IVec2::ZERO),
                    Vec2::select(forward, Vec2::ZERO, Vec2::ONE),
                    place,
                );
                let rise = segment.height.y + 2.0 * curvature * r;
                let mut above = ray_minus_patch(nodes, place, segment.slope, height_in, rise, curvature);
                if carried.side == Side::AtEye
                    && let Some(sheet) = world.sheet
                    && sheet.eye_patch_known == 1
                {
                    let [clearance, along_u, along_v, twist] = sheet.eye_patch;
                    above = Vec3::new(
                        clearance,
                        rise - (along_u * segment.slope.x + along_v * segment.slope.y),
                        curvature - twist * segment.slope.x * segment.slope.y,
                    );
                }
                if enters_through_surface(world, above, slot, cell, step, segment, carried) {
                    return Crossing { hit: true, r, step: IVec2::ZERO };
                }
                let upright = if carried.side == Side::Below { -above } else { above };
                let root = first_crossing(upright, span);
                if root >= 0.0 {
                    return Crossing { hit: true, r: r + root, step: IVec2::ZERO };
                }
            }
        }

        if nearest >= segment.length {
            return Crossing { hit: false, r: segment.length, step: IVec2::ZERO };
        }
        r = r_out;
        let crossed = exits.cmple(Vec2::splat(nearest));
        let direction = direction_of(forward);
        step = IVec2::select(crossed, direction, IVec2::ZERO);
        let outside = crossed & lines.cmpeq(borders);
        if outside.any() {
            return Crossing { hit: false, r, step: IVec2::select(outside, direction, IVec2::ZERO) };
        }
        let within = cell_at(segment, r, low, high);
        let next = IVec2::select(crossed, IVec2::select(forward, high, low - 1), within);
        if level < top && next >> IVec2::splat(level as i32 + 1) != node >> IVec2::ONE {
            level += 1;
        }
        cell = next;
    }
    Crossing { hit: world.solid(), r, step: IVec2::ZERO }
}

fn enters_through_surface<T: Texels>(
    world: &World<'_, T>,
    above: Vec3,
    slot: u32,
    cell: IVec2,
    step: IVec2,
    segment: &Segment,
    carried: &mut Carried,
) -> bool {
    let before = carried.side;
    let known = before == Side::Above || before == Side::Below;
    if above.x == 0.0 && known {
        return false;
    }
    let value = if above.x != 0.0 {
        above.x
    } else if above.y != 0.0 {
        above.y
    } else {
        above.z
    };
    let side = if value >= 0.0 { Side::Above } else { Side::Below };
    carried.side = side;
    if !known {
        return world.solid() && side == Side::Below && before == Side::Unknown;
    }
    if side == before {
        return false;
    }
    if world.solid() || step == IVec2::ZERO {
        return true;
    }
    let previous = cell - step;
    if previous.cmplt(segment.first).any() || previous.cmpge(segment.end).any() {
        return false;
    }
    carried.fetches += 1;
    !is_void(patch_nodes(world, slot, previous))
}
