// From grid coordinates to squares of the page table, and from square to square.

// A square of the cut: a leaf, or EMPTY.
struct GridSquare {
    entry: u32,
    origin: vec2<u32>,
    side: u32,
}

struct GridPlace {
    // False: outside the root grid.
    inside: bool,
    grid: vec2<u32>,
}

struct GridEntry {
    found: bool,
    s: f32,
    grid: vec2<u32>,
}

fn root_index(grid: vec2<u32>) -> u32 {
    let root = grid >> vec2<u32>(ROOT_BITS);
    return root.y * view.root_size.x + root.x;
}

// The square that holds a place, by the place's bits from the root tile down.
fn find_square(grid: vec2<u32>) -> GridSquare {
    var entry = nodes[root_index(grid)];
    var bits = ROOT_BITS;
    while bits > 0u && (entry & LEAF_BIT) == 0u {
        bits -= 1u;
        let quadrant = (grid >> vec2<u32>(bits)) & vec2<u32>(1u);
        entry = nodes[entry + 2u * quadrant.y + quadrant.x];
    }
    // EMPTY has the leaf's bit too.
    return GridSquare(entry, (grid >> vec2<u32>(bits)) << vec2<u32>(bits), 1u << bits);
}

// The place just across a square's edge (or corner): integer and exact on the axes crossed (`step`); on the
// other, `share` (0…1) of the way along the edge.
fn across_edge(square: GridSquare, step: vec2<i32>, share: vec2<f32>) -> GridPlace {
    let along = min(vec2<u32>(clamp(share, vec2<f32>(0.0), vec2<f32>(1.0)) * f32(square.side)), vec2<u32>(square.side - 1u));
    var grid = square.origin + along;
    var inside = true;
    let last = square.origin + (square.side - 1u);
    let roots = view.root_size;
    let in_root = (1u << ROOT_BITS) - 1u;
    if step.x > 0 {
        grid.x = last.x + 1u;
        if (last.x >> ROOT_BITS) + 1u == roots.x && (last.x & in_root) == in_root {
            inside = view.wraps == 1u;
            grid.x = 0u;
        }
    } else if step.x < 0 {
        grid.x = square.origin.x - 1u;
        if square.origin.x == 0u {
            inside = view.wraps == 1u;
            grid.x = (roots.x << ROOT_BITS) - 1u;
        }
    }
    if step.y > 0 {
        grid.y = last.y + 1u;
        inside = inside && !((last.y >> ROOT_BITS) + 1u == roots.y && (last.y & in_root) == in_root);
    } else if step.y < 0 {
        inside = inside && square.origin.y != 0u;
        grid.y = square.origin.y - 1u;
    }
    return GridPlace(inside, grid);
}

// Cuts low…high to where the quadratic lies in least…greatest; its bend is allowed for. Empty where high < low.
fn cut_to_band(q: vec3<f32>, range: vec2<f32>, least: f32, greatest: f32) -> vec2<f32> {
    let span = max(range.y - range.x, 0.0);
    let bend = abs(q.z) * span * span * 0.25;
    let value = quadratic_at(q, range.x);
    let slope = q.y + q.z * (2.0 * range.x + span);
    let from_value = least - bend - value;
    let to_value = greatest + bend - value;
    if abs(slope) < LEAST_SLOPE {
        if from_value <= 0.0 && to_value >= 0.0 {
            return range;
        }
        return vec2<f32>(1.0, 0.0);
    }
    let inverse = 1.0 / slope;
    let ends = vec2<f32>(from_value, to_value) * inverse;
    return vec2<f32>(range.x + max(min(ends.x, ends.y), 0.0), range.x + min(max(ends.x, ends.y), span));
}

// Distances between which a ray is over a root tile and no higher than the scene, by its own frame.
// Cutting the chord, then the chord of what is left, soon leaves no bend to allow for.
fn range_in_root(leaf: Leaf, along: LeafRay) -> vec2<f32> {
    let first = vec2<f32>(vec2<i32>(leaf.first_cell) - leaf.eye_cell);
    let end = first + vec2<f32>(leaf.cells);
    var range = leaf.distance_range;
    for (var pass_index = 0; pass_index < 4 && range.x <= range.y; pass_index++) {
        range = cut_to_band(along.u, range, first.x, end.x);
        if range.x <= range.y {
            range = cut_to_band(along.v, range, first.y, end.y);
        }
        if range.x <= range.y {
            range = cut_to_band(along.h, range, -1.0e9, view.forward.w);
        }
    }
    return range;
}

// Where a ray whose eye is beside the root grid, or above all of the scene, comes in.
fn enter_grid(ray: Ray) -> GridEntry {
    var best = GridEntry(false, 0.0, vec2<u32>(0u));
    let count = view.root_size.x * view.root_size.y;
    for (var index = 0u; index < count; index++) {
        if nodes[index] == EMPTY {
            continue;
        }
        let leaf = leaves[index];
        let along = along_leaf(leaf, ray);
        let range = range_in_root(leaf, along);
        if range.x > range.y || (best.found && range.x >= best.s) {
            continue;
        }
        let place = vec2<f32>(quadratic_at(along.u, range.x), quadratic_at(along.v, range.x));
        let first = vec2<f32>(vec2<i32>(leaf.first_cell) - leaf.eye_cell);
        let share = clamp((place - first) / vec2<f32>(leaf.cells), vec2<f32>(0.0), vec2<f32>(1.0));
        let side = 1u << ROOT_BITS;
        let in_root = min(vec2<u32>(share * f32(side)), vec2<u32>(side - 1u));
        let root = vec2<u32>(index % view.root_size.x, index / view.root_size.x);
        best = GridEntry(true, range.x, (root << vec2<u32>(ROOT_BITS)) + in_root);
    }
    return best;
}
