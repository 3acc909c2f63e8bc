// Light that the ground keeps from the ground: shadows toward the sun, and the sky's share that the
// surroundings leave. Both walk the page table in grid coordinates, so that they cross tiles and levels as
// view rays do. Twin: `twin/shadow.rs`.

// First step of the march to the sun, metres, where cells are no larger.
const SHADOW_FIRST_STEP: f32 = 1.7;
// How far the march looks for what stands in the light, metres.
const SHADOW_REACH: f32 = 3500.0;
// Width of a shadow's soft edge: at its foot, metres, and per metre of distance from what casts it.
const SHADOW_EDGE: f32 = 0.6;
const SHADOW_EDGE_GROWTH: f32 = 0.035;

// A leaf as a walk over the ground needs it: its square in the grid, and the way into its tile.
struct GroundLeaf {
    origin: vec2<u32>,
    side: u32,
    slot: u32,
    first_cell: vec2<f32>,
    cells_per_unit: vec2<f32>,
    maximum: f32,
}

// A place on the map: whole grid units, and the rest in units.
struct MapPlace {
    unit: vec2<u32>,
    fraction: vec2<f32>,
}

fn ground_leaf(index: u32) -> GroundLeaf {
    let cells = vec2<f32>(leaves[index].cells);
    let side = leaves[index].grid_side;
    return GroundLeaf(
        leaves[index].grid_origin,
        side,
        leaves[index].slot,
        vec2<f32>(leaves[index].first_cell),
        cells / f32(side),
        leaves[index].h_cross_maximum_fade.z,
    );
}

// A leaf without ground, one unit wide: the next place is looked up again.
fn no_ground(unit: vec2<u32>) -> GroundLeaf {
    return GroundLeaf(unit, 1u, EMPTY, vec2<f32>(0.0), vec2<f32>(1.0), VOID_HEIGHT);
}

// The leaf at a place, by the page table.
fn ground_leaf_at(place: vec2<u32>) -> GroundLeaf {
    var unit = place;
    let columns = view.root_size.x << ROOT_BITS;
    if view.wraps != 0u && (unit.x >> ROOT_BITS) >= view.root_size.x {
        // A column west of the first has wrapped round below zero, one east of the last has run past it.
        unit.x = select(unit.x - columns, unit.x + columns, unit.x >= 0x80000000u);
    }
    var entry = root_entry(unit);
    if entry == EMPTY {
        return no_ground(place);
    }
    entry = nodes[entry];
    for (var depth = 0u; depth < ROOT_BITS; depth++) {
        if (entry & LEAF_BIT) != 0u {
            break;
        }
        let quadrant = (unit >> vec2<u32>(ROOT_BITS - 1u - depth)) & vec2<u32>(1u);
        entry = nodes[entry + 2u * quadrant.y + quadrant.x];
    }
    if entry == EMPTY || (entry & LEAF_BIT) == 0u {
        return no_ground(place);
    }
    var leaf = ground_leaf(entry & ~LEAF_BIT);
    if leaf.slot == EMPTY {
        return no_ground(place);
    }
    // In the walk's own turn of longitude.
    leaf.origin.x += place.x - unit.x;
    return leaf;
}

fn moved(place: MapPlace, by: vec2<f32>) -> MapPlace {
    let sum = place.fraction + by;
    let whole = floor(sum);
    return MapPlace(place.unit + vec2<u32>(vec2<i32>(whole)), sum - whole);
}

// The leaf's cell coordinates of a place, which may lie outside it.
fn cell_in(leaf: GroundLeaf, place: MapPlace) -> vec2<f32> {
    return leaf.first_cell + (vec2<f32>(vec2<i32>(place.unit - leaf.origin)) + place.fraction) * leaf.cells_per_unit;
}

fn covers(leaf: GroundLeaf, place: MapPlace) -> bool {
    let within = place.unit - leaf.origin;
    return within.x < leaf.side && within.y < leaf.side;
}

// Height of a tile's node, metres; the border's nodes are −1 and one past the last.
fn node_height(node: vec2<i32>, slot: u32) -> f32 {
    return textureLoad(heights, node + vec2<i32>(1), slot, 0).x;
}

// Height at a cell coordinate, metres: the nearest node's, or smooth between the four around it (then a
// void where any of them is).
fn height_at(cell: vec2<f32>, slot: u32, smooth_between: bool) -> f32 {
    if !smooth_between {
        return node_height(clamp(vec2<i32>(round(cell)), vec2<i32>(-1), vec2<i32>(513)), slot);
    }
    let base = clamp(vec2<i32>(floor(cell)), vec2<i32>(-1), vec2<i32>(512));
    let part = saturate(cell - vec2<f32>(base));
    let north_west = node_height(base, slot);
    let north_east = node_height(base + vec2<i32>(1, 0), slot);
    let south_west = node_height(base + vec2<i32>(0, 1), slot);
    let south_east = node_height(base + vec2<i32>(1, 1), slot);
    if min(min(north_west, north_east), min(south_west, south_east)) <= VOID_HEIGHT {
        return VOID_HEIGHT;
    }
    return mix(mix(north_west, north_east, part.x), mix(south_west, south_east, part.x), part.y);
}

// What a point of the ground knows of its surroundings.
struct Ground {
    place: MapPlace,
    // Index of its leaf.
    leaf: u32,
    // Metres.
    height: f32,
    // Grid units per metre eastward and southward.
    units_per_metre: vec2<f32>,
    // Length of a cell over the pixel's width there: above 1 cells show, and heights are taken between nodes.
    cell_over_footprint: f32,
    // How far the nearest node's height may be from the surface's, metres.
    node_error: f32,
}

// Share of the sun's disc that a point sees, `sun` being east, south and up there. The k-th step is
// s₀ + k·g: near occluders count fully, far ones fade, and every edge softens with distance. `dither` in
// 0…1 shifts the steps, so that they leave no bands.
fn sun_visibility(ground: Ground, sun: vec3<f32>, dither: f32) -> f32 {
    let steps = view.shadow_steps;
    if steps == 0u {
        return 1.0;
    }
    var leaf = ground_leaf(ground.leaf);
    let count = f32(steps);
    // Steps shorter than a cell would see the same patch again.
    let cell = 1.0 / max(leaf.cells_per_unit.y * ground.units_per_metre.y, 1e-6);
    let first = max(SHADOW_FIRST_STEP, 0.7 * cell);
    let growth = max(2.0 * (SHADOW_REACH - count * first) / max(count * (count - 1.0), 1.0), 0.0);
    let reach = count * first + 0.5 * growth * count * (count - 1.0);
    let rate = sun.xy * ground.units_per_metre;
    var light = 1.0;
    var travelled = 0.0;
    for (var step = 0u; step < steps; step++) {
        let stride = first + f32(step) * growth;
        let at = travelled + stride * (0.35 + 0.65 * dither);
        travelled += stride;
        let ray = ground.height + at * sun.z;
        if ray > view.forward.w {
            break;
        }
        let place = moved(ground.place, at * rate);
        if !covers(leaf, place) {
            leaf = ground_leaf_at(place.unit);
        }
        let edge = SHADOW_EDGE + SHADOW_EDGE_GROWTH * at;
        // Above all of the leaf: nothing to fetch. (A leaf without ground has its maximum at the void.)
        if ray > leaf.maximum + edge {
            continue;
        }
        let smooth_between = ground.cell_over_footprint > 1.5 && step < 8u;
        let height = height_at(cell_in(leaf, place), leaf.slot, smooth_between);
        if height <= VOID_HEIGHT {
            continue;
        }
        // No ground shades itself by being a node's width out of place.
        let above = height - ray - select(ground.node_error, 0.0, smooth_between);
        // A long stride that meets a tree has met it by chance, and counts the less the longer it is; what
        // stands as far above the ray as the stride is long is solid.
        let chance = 1.0 / (1.0 + max(stride - 6.0, 0.0) / 45.0);
        let far = at / reach;
        let weight = (1.0 - far * far * far) * max(chance, smoothstep(0.3, 1.0, above / stride));
        light *= 1.0 - weight * smoothstep(0.0, edge, above);
        if light < 0.02 {
            return 0.0;
        }
    }
    return light;
}

// Share of the sky that the surroundings leave to a point, from the slopes to four sides at two distances.
fn sky_visibility(ground: Ground, near: f32, far: f32) -> f32 {
    let leaf = ground_leaf(ground.leaf);
    var open = 0.0;
    for (var side = 0u; side < 4u; side++) {
        let along = select(vec2<f32>(1.0, 0.0), vec2<f32>(0.0, 1.0), (side & 1u) == 1u) * select(1.0, -1.0, side >= 2u);
        // The far ring stands between the near ring's sides.
        let between = vec2<f32>(along.x - along.y, along.x + along.y) * 0.70710678;
        let near_slope = slope_to(leaf, ground, along, near);
        let far_slope = slope_to(leaf, ground, between, far);
        let slope = max(near_slope, 0.0) * 0.5 + max(far_slope, 0.0) * 0.8;
        // A horizon at angle a leaves cos²a of a side's sky: 1 / (1 + slope²).
        open += 1.0 / (1.0 + slope * slope);
    }
    return 0.25 * open;
}

// Rise per metre from a point to the ground at a distance (metres) in a direction (east, south).
fn slope_to(leaf: GroundLeaf, ground: Ground, direction: vec2<f32>, distance: f32) -> f32 {
    let place = moved(ground.place, direction * distance * ground.units_per_metre);
    var there = leaf;
    if !covers(there, place) {
        there = ground_leaf_at(place.unit);
        if there.slot == EMPTY {
            return 0.0;
        }
    }
    let height = height_at(cell_in(there, place), there.slot, ground.cell_over_footprint > 1.5);
    return select((height - ground.height) / distance, 0.0, height <= VOID_HEIGHT);
}
