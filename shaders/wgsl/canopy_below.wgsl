// Under trees that are drawn one by one the canopy of the heights gives way to the ground: it fades, pixel by pixel,
// where every tree has already faded in, and a second ray goes on to what lies below.

// Shares of the trees' range between which the canopy comes back: nearer than the nearest end of a tree's own fade.
const CANOPY_BACK: vec2<f32> = vec2<f32>(0.62, 0.74);
// Steps of the ray below the canopy: of half a cell at first, longer and longer, then much longer.
const BELOW_STEPS: u32 = 64u;
const BELOW_FAR_STEPS: u32 = 28u;
const BELOW_HALVINGS: i32 = 14;
const BELOW_GROWTH: vec2<f32> = vec2<f32>(1.06, 1.25);
// Trees drawn over a canopy that is still there stand within it: so far behind its surface it hides them, metres.
const CANOPY_DEPTH: f32 = 10.0;

// Where trees are drawn one by one.
struct TreeCells {
    // Cell of the seeds' pattern at the window's north-west corner.
    first: vec2<u32>,
    // Trees are drawn up to this distance, metres.
    range: f32,
    // Nearer than this the ground has its grain, metres; 0 without undergrowth.
    turf: f32,
    // x: 1 where the eye is below the canopy, between the trees.
    under: vec4<u32>,
    // A bit a cell, 64 × 64 of them, row by row.
    bits: array<vec4<u32>, 32>,
}

@group(1) @binding(2) var<uniform> tree_cells: TreeCells;

// What a ray meets below the canopy.
struct Below {
    found: bool,
    distance: f32,
    leaf: u32,
    cell: vec2<f32>,
    place: MapPlace,
    // Whether it is a canopy that has not faded.
    canopy: bool,
}

// Whether the trees at grid coordinates are drawn one by one.
fn has_trees(unit: vec2<u32>) -> bool {
    var place = unit;
    if view.root_level >= 5u {
        place = unit >> vec2<u32>(view.root_level - 5u);
    } else {
        place = unit << vec2<u32>(5u - view.root_level);
    }
    // Columns wrap around the Earth.
    let cell = (((place + view.grid_place) >> vec2<u32>(14u)) - tree_cells.first) & vec2<u32>(0x3ffffu, 0xffffffffu);
    if any(cell >= vec2<u32>(64u)) {
        return false;
    }
    let word = (cell.y * 2u) + (cell.x >> 5u);
    return ((tree_cells.bits[word >> 2u][word & 3u] >> (cell.x & 31u)) & 1u) == 1u;
}

// Share of the canopy that is still drawn at a distance.
fn canopy_share(distance: f32) -> f32 {
    if (view.flags & HARD_SWITCH) != 0u {
        return step(tree_cells.range, distance);
    }
    return smoothstep(CANOPY_BACK.x, CANOPY_BACK.y, distance / tree_cells.range);
}

// Height of the surface at a cell coordinate without the canopy, metres.
fn ground_height_at(cell: vec2<f32>, slot: u32) -> f32 {
    let node = clamp(vec2<i32>(round(cell)), vec2<i32>(-1), vec2<i32>(513));
    return node_height(node, slot) - f32(node_surface(node, slot).y) * CANOPY_UNIT;
}

// Up to this distance the ground below a canopy is smooth between its nodes; farther it is the nearest node's, metres.
const SMOOTH_GROUND: f32 = 60.0;
// What lies between nodes differs no more than this from the nearest, metres, where it is not a cliff.
const SMOOTH_MARGIN: f32 = 0.45;

// The same between the four nodes about it.
fn smooth_ground_at(cell: vec2<f32>, slot: u32) -> f32 {
    let base = floor(cell);
    let part = cell - base;
    let north = mix(ground_height_at(base, slot), ground_height_at(base + vec2<f32>(1.0, 0.0), slot), part.x);
    let south = mix(ground_height_at(base + vec2<f32>(0.0, 1.0), slot), ground_height_at(base + vec2<f32>(1.0, 1.0), slot), part.x);
    return mix(north, south, part.y);
}

// The ground where a ray so far from the eye is so high: smooth near by, where it may matter.
fn ground_beside_ray(cell: vec2<f32>, slot: u32, ray: f32, distance: f32) -> f32 {
    let nearest = ground_height_at(cell, slot);
    if distance > SMOOTH_GROUND || ray > nearest + SMOOTH_MARGIN || nearest <= VOID_HEIGHT {
        return nearest;
    }
    return smooth_ground_at(cell, slot);
}

// Follows a ray from where it met the canopy. `rate`: grid units per metre along it, `rise`: metres per metre.
fn ground_below(start: MapPlace, index: u32, from_distance: f32, height: f32, rate: vec2<f32>, rise: f32, dither: f32) -> Below {
    var found = Below(false, 0.0, EMPTY, vec2<f32>(0.0), start, false);
    var leaf = ground_leaf(index);
    var at = index;
    let along = max(length(rate * leaf.cells_per_unit), 1e-3);
    var stride = clamp(0.6 / along, 0.3, 8.0);
    var travelled = 0.0;
    var before = 0.0;
    for (var step = 0u; step < BELOW_STEPS + BELOW_FAR_STEPS; step++) {
        before = travelled;
        travelled += stride * select(1.0, 0.4 + 0.6 * dither, step == 0u);
        stride *= select(BELOW_GROWTH.x, BELOW_GROWTH.y, step >= BELOW_STEPS);
        let ray = height + rise * travelled;
        if ray > view.forward.w {
            return found;
        }
        let place = moved(start, travelled * rate);
        if !covers(leaf, place) {
            at = leaf_index_at(place.unit);
            if at == EMPTY {
                return found;
            }
            leaf = ground_leaf(at);
        }
        let cell = cell_in(leaf, place);
        let stays = canopy_share(from_distance + travelled) > dither || !has_trees(place.unit);
        var surface_height = ground_beside_ray(cell, leaf.slot, ray, from_distance + travelled);
        if stays {
            surface_height = height_at(cell, leaf.slot, false);
        }
        if ray <= surface_height && surface_height > VOID_HEIGHT {
            // Half-way between the last point above and the first below, until a pixel does not show the difference.
            var high = before;
            var low = travelled;
            let fine_enough = 0.5 * (from_distance + travelled) * view.right.w;
            for (var halving = 0; halving < BELOW_HALVINGS; halving++) {
                if halving >= 5 && (low - high) < fine_enough {
                    break;
                }
                let middle = 0.5 * (high + low);
                let middle_place = moved(start, middle * rate);
                if !covers(leaf, middle_place) {
                    // The point above lies in another tile.
                    let index_there = leaf_index_at(middle_place.unit);
                    if index_there == EMPTY {
                        high = middle;
                        continue;
                    }
                    at = index_there;
                    leaf = ground_leaf(at);
                }
                let there = cell_in(leaf, middle_place);
                let middle_ray = height + rise * middle;
                var middle_height = ground_beside_ray(there, leaf.slot, middle_ray, from_distance + middle);
                if stays {
                    middle_height = height_at(there, leaf.slot, true);
                }
                if middle_ray <= middle_height {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let end = moved(start, low * rate);
            if !covers(leaf, end) {
                let index_there = leaf_index_at(end.unit);
                if index_there == EMPTY {
                    return found;
                }
                at = index_there;
                leaf = ground_leaf(at);
            }
            return Below(true, from_distance + low, at, cell_in(leaf, end), end, stays);
        }
    }
    return found;
}

// Steps of a ray from an eye below the canopy to the ground.
const UNDER_STEPS: u32 = 64u;

// The ground that a ray from an eye below the canopy meets among trees: the terrain pass, for which leaving the surface
// is no hit, sees through it.
fn ground_under_eye(index: u32, rate: vec2<f32>, rise: f32, dither: f32) -> Below {
    let start = MapPlace(view.eye_grid, vec2<f32>(0.5));
    let nothing = Below(false, 0.0, EMPTY, vec2<f32>(0.0), start, false);
    var leaf = ground_leaf(index);
    var at = index;
    let along = max(length(rate * leaf.cells_per_unit), 1e-3);
    var stride = clamp(0.5 / along, 0.2, 6.0);
    var before = 0.0;
    var travelled = 0.0;
    for (var step = 0u; step < UNDER_STEPS; step++) {
        before = travelled;
        travelled += stride * select(1.0, 0.4 + (0.6 * dither), step == 0u);
        stride *= BELOW_GROWTH.x;
        let ray = view.up.w + (rise * travelled);
        let place = moved(start, travelled * rate);
        if !covers(leaf, place) {
            at = leaf_index_at(place.unit);
            if at == EMPTY {
                return nothing;
            }
            leaf = ground_leaf(at);
        }
        let cell = cell_in(leaf, place);
        if ray > view.forward.w || !has_trees(place.unit) || canopy_share(travelled) > dither {
            return nothing;
        }
        let ground = ground_beside_ray(cell, leaf.slot, ray, travelled);
        if ray <= ground && ground > VOID_HEIGHT {
            var high = before;
            var low = travelled;
            for (var halving = 0; halving < 6; halving++) {
                let middle = 0.5 * (high + low);
                let there = cell_in(leaf, moved(start, middle * rate));
                let middle_ray = view.up.w + (rise * middle);
                if middle_ray <= ground_beside_ray(there, leaf.slot, middle_ray, middle) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let end = moved(start, low * rate);
            return Below(true, low, at, cell_in(leaf, end), end, false);
        }
    }
    return nothing;
}
