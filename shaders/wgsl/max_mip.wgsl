// The intersector: maximum mip, advance to a node's plane, exact patch, and the carried side.
//
// A node of level 0 is a cell; one of level k covers 2^k × 2^k cells, and its maximum is in mip k − 1.

// Skip nodes that lie wholly above a ray that is under the surface. Of solid ground a ray from an eye inside then does
// not see the voids that it passes below the surface around them.
override USE_MINIMA: bool = false;

const SIDE_UNKNOWN: i32 = 0;
const SIDE_ABOVE: i32 = 1;
const SIDE_BELOW: i32 = -1;
// Unknown, and the ray starts here: being below is no wall.
const SIDE_AT_EYE: i32 = 2;

// Bound of the relative error of a height along a ray in f32.
const HEIGHT_SLACK: f32 = 4.0e-7;

// What a ray carries from cell to cell, segment to segment and leaf to leaf.
struct Carried {
    side: i32,
    // Node loads and gathers of four.
    fetches: u32,
}

// How a segment ended: with a hit at r, or by leaving the leaf's cells (±1 along the axes crossed), or neither: at its end.
struct Crossing {
    hit: bool,
    r: f32,
    step: vec2<i32>,
}

fn patch_nodes(slot: u32, cell: vec2<i32>) -> vec4<f32> {
    let texel = cell + BORDER;
    return vec4<f32>(
        textureLoad(heights, texel, slot, 0).x,
        textureLoad(heights, texel + vec2<i32>(1, 0), slot, 0).x,
        textureLoad(heights, texel + vec2<i32>(0, 1), slot, 0).x,
        textureLoad(heights, texel + vec2<i32>(1, 1), slot, 0).x,
    );
}

fn is_void(nodes: vec4<f32>) -> bool {
    return min(min(nodes.x, nodes.y), min(nodes.z, nodes.w)) <= VOID_HEIGHT;
}

// The maxima of a node's four children, which lie on `level`. A child beyond the mip is never asked about.
fn family_maxima(slot: u32, parent: vec2<i32>, level: u32) -> vec4<f32> {
    let texel = 2 * parent;
    return vec4<f32>(
        textureLoad(maxima, texel, slot, level - 1u).x,
        textureLoad(maxima, texel + vec2<i32>(1, 0), slot, level - 1u).x,
        textureLoad(maxima, texel + vec2<i32>(0, 1), slot, level - 1u).x,
        textureLoad(maxima, texel + vec2<i32>(1, 1), slot, level - 1u).x,
    );
}

fn node_minimum(slot: u32, node: vec2<i32>, level: u32) -> f32 {
    return textureLoad(minima, node, slot, level - 1u).x;
}

// How far from `height`, with the slope `rise`, a falling ray is above the plane `maximum`; 0 where it
// never comes down to it within rounding.
fn advance_to_plane(height: f32, rise: f32, curvature: f32, maximum: f32, slack: f32) -> f32 {
    let drop = height - maximum - slack;
    let discriminant = rise * rise - 4.0 * curvature * drop;
    if drop <= 0.0 || rise >= 0.0 || discriminant < 0.0 {
        return 0.0;
    }
    return 2.0 * drop / (sqrt(discriminant) - rise);
}

fn height_slack(segment: Segment, height_in: f32, height_out: f32) -> f32 {
    return HEIGHT_SLACK * max(max(abs(height_in), abs(height_out)), abs(segment.height.x));
}

fn direction_of(forward: vec2<bool>) -> vec2<i32> {
    return select(vec2<i32>(-1), vec2<i32>(1), forward);
}

struct Clearance {
    // Above all of the leaf from r to the end.
    clear: bool,
    // How far it stays above it.
    advance: f32,
}

fn clear_of_ceiling(segment: Segment, r: f32, end: f32) -> Clearance {
    let curvature = segment.height.z;
    let height_in = quadratic_at(segment.height, r);
    let height_out = quadratic_at(segment.height, end);
    let slack = height_slack(segment, height_in, height_out);
    let rise = segment.height.y + 2.0 * curvature * r;
    var lowest = min(height_in, height_out);
    // A ray that already rises, and bends upward, is lowest where it stands.
    if rise < 0.0 || curvature < 0.0 {
        lowest -= max(curvature, 0.0) * (end - r) * (end - r) * 0.25;
    }
    if lowest - slack > segment.ceiling {
        return Clearance(true, 0.0);
    }
    return Clearance(false, advance_to_plane(height_in, rise, curvature, segment.ceiling, slack));
}

// The level on which to go on in a node that is left after `cells` more: a large node tells little about a short way.
fn level_below(level: u32, cells: f32) -> u32 {
    let whole = 1u + u32(clamp(cells, 1.0, 65536.0));
    return min(level - 1u, firstLeadingBit(whole) + 1u);
}

// Casts the segment from r = start; the ray enters its first cell there, having stepped by `entered`
// (0, 0 where it did not cross a line). Levels go no higher than `top`.
fn max_mip(
    segment: Segment,
    slot: u32,
    top: u32,
    start_level: u32,
    start: f32,
    entered: vec2<i32>,
    carried: ptr<function, Carried>,
) -> Crossing {
    let forward = segment.slope > vec2<f32>(0.0);
    let curvature = segment.height.z;
    var r = start;
    var step = entered;
    var level = start_level;

    // Clear of all that is in the leaf, or falling from above it: no fetch.
    let borders = select(segment.first, segment.end, forward);
    let ends = crossings(segment, borders);
    let end = clamp(min(ends.x, ends.y), r, segment.length);
    let clearance = clear_of_ceiling(segment, r, end);
    if clearance.clear {
        if (*carried).side != SIDE_BELOW {
            (*carried).side = SIDE_ABOVE;
            let leaves_cells = (ends <= vec2<f32>(end)) & (vec2<f32>(end) < vec2<f32>(segment.length));
            return Crossing(false, end, select(vec2<i32>(0), direction_of(forward), leaves_cells));
        }
    } else if clearance.advance > 0.0 && (*carried).side != SIDE_BELOW {
        r = min(r + clearance.advance, end);
        step = vec2<i32>(0);
        level = top;
        (*carried).side = SIDE_ABOVE;
    }
    var cell = cell_at(segment, r, segment.first, segment.end);
    cell = select(cell, select(segment.end - 1, segment.first, forward), step != vec2<i32>(0));

    var family = vec2<i32>(0);
    var family_level = 0u;
    var maximum_of = vec4<f32>(0.0);

    // Each cell and each node is entered once: a bound that only a defect could reach.
    let limit = 64 + 8 * (segment.end.x - segment.first.x + segment.end.y - segment.first.y);
    for (var count = 0; count < limit; count++) {
        let shift = vec2<u32>(level);
        let node = cell >> shift;
        let low = max(node << shift, segment.first);
        let high = min((node + 1) << shift, segment.end);
        let lines = select(low, high, forward);
        let exits = crossings(segment, lines);
        let nearest = min(exits.x, exits.y);
        let r_out = clamp(nearest, r, segment.length);
        let span = r_out - r;
        let height_in = quadratic_at(segment.height, r);
        let height_out = quadratic_at(segment.height, r_out);
        let slack = height_slack(segment, height_in, height_out);
        let sag = curvature * span * span * 0.25;

        if level > 0u {
            // One gather serves all four children of a parent: a ray that comes to one mostly comes to another.
            let parent = node >> vec2<u32>(1u);
            if family_level != level || any(family != parent) {
                family_level = level;
                family = parent;
                maximum_of = family_maxima(slot, parent, level);
                (*carried).fetches += 1u;
            }
            let maximum = maximum_of[u32(node.x & 1) + 2u * u32(node.y & 1)];
            let lowest = min(height_in, height_out) - max(sag, 0.0) - slack;
            if maximum <= VOID_HEIGHT {
                (*carried).side = SIDE_UNKNOWN;
            } else if (*carried).side != SIDE_BELOW && lowest > maximum {
                (*carried).side = SIDE_ABOVE;
            } else {
                var skipped = false;
                // Into solid ground a ray comes from a void or from outside through a wall, which is in a cell.
                if USE_MINIMA && (*carried).side != SIDE_ABOVE && !(SOLID && (*carried).side == SIDE_UNKNOWN) {
                    (*carried).fetches += 1u;
                    let highest = max(height_in, height_out) - min(sag, 0.0) + slack;
                    skipped = highest < node_minimum(slot, node, level);
                }
                if !skipped {
                    if (*carried).side != SIDE_BELOW {
                        let rise = segment.height.y + 2.0 * curvature * r;
                        let advance = advance_to_plane(height_in, rise, curvature, maximum, slack);
                        if advance > 0.0 {
                            r = min(r + advance, r_out);
                            step = vec2<i32>(0);
                            (*carried).side = SIDE_ABOVE;
                            cell = cell_at(segment, r, low, high);
                        }
                    }
                    let left = abs((r_out - r) * segment.slope);
                    level = level_below(level, max(left.x, left.y));
                    continue;
                }
                (*carried).side = SIDE_BELOW;
            }
        } else {
            (*carried).fetches += 1u;
            let nodes = patch_nodes(slot, cell);
            if is_void(nodes) {
                (*carried).side = SIDE_UNKNOWN;
            } else {
                var place = clamp(
                    vec2<f32>(segment.cell - cell) + segment.place + r * segment.slope,
                    vec2<f32>(0.0),
                    vec2<f32>(1.0),
                );
                // On the line just crossed, exactly.
                place = select(place, select(vec2<f32>(1.0), vec2<f32>(0.0), forward), step != vec2<i32>(0));
                let rise = segment.height.y + 2.0 * curvature * r;
                var above = ray_minus_patch(nodes, place, segment.slope, height_in, rise, curvature);
                if (*carried).side == SIDE_AT_EYE && eye_patch_known() {
                    above = ray_minus_eye_patch(segment.slope, rise, curvature);
                }
                if enters_through_surface(above, slot, cell, step, segment, carried) {
                    return Crossing(true, r, vec2<i32>(0));
                }
                let upright = select(above, -above, (*carried).side == SIDE_BELOW);
                let root = first_crossing(upright, span);
                if root >= 0.0 {
                    return Crossing(true, r + root, vec2<i32>(0));
                }
            }
        }

        // On to the next node.
        if nearest >= segment.length {
            return Crossing(false, segment.length, vec2<i32>(0));
        }
        r = r_out;
        let crossed = exits <= vec2<f32>(nearest);
        let direction = direction_of(forward);
        step = select(vec2<i32>(0), direction, crossed);
        let outside = crossed & (lines == borders);
        if any(outside) {
            return Crossing(false, r, select(vec2<i32>(0), direction, outside));
        }
        let within = cell_at(segment, r, low, high);
        let next = select(within, select(low - 1, high, forward), crossed);
        if level < top && any((next >> (shift + 1u)) != (node >> vec2<u32>(1u))) {
            level += 1u;
        }
        cell = next;
    }
    // Never reached. Solid ground has no holes; a sheet is not where it was not found.
    return Crossing(SOLID, r, vec2<i32>(0));
}

// Settles the side at the entry of a cell. True where the ray has come through the surface, or through a
// wall of solid ground, on the way in.
fn enters_through_surface(
    above: vec3<f32>,
    slot: u32,
    cell: vec2<i32>,
    step: vec2<i32>,
    segment: Segment,
    carried: ptr<function, Carried>,
) -> bool {
    let before = (*carried).side;
    let known = before == SIDE_ABOVE || before == SIDE_BELOW;
    if above.x == 0.0 && known {
        return false;
    }
    // On the surface itself, the side is the one to which the ray goes.
    let value = select(above.x, select(above.y, above.z, above.y == 0.0), above.x == 0.0);
    let side = select(SIDE_BELOW, SIDE_ABOVE, value >= 0.0);
    (*carried).side = side;
    if !known {
        return SOLID && side == SIDE_BELOW && before == SIDE_UNKNOWN;
    }
    if side == before {
        return false;
    }
    if SOLID || all(step == vec2<i32>(0)) {
        return true;
    }
    // A node may have been passed above (or below) without looking at its voids: through a hole's edge a
    // sheet is entered on either side.
    let previous = cell - step;
    if any(previous < segment.first) || any(previous >= segment.end) {
        return false;
    }
    (*carried).fetches += 1u;
    return !is_void(patch_nodes(slot, previous));
}
