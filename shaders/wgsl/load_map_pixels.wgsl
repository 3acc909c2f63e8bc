// What each pixel of the ray caster says of the load map: the cell that it hits, and the cells that lie between it
// and its neighbours. Where what lies between cannot be told, the quad is a gap of the pyramid of distances.

@group(1) @binding(3) var<storage, read_write> pixels: array<atomic<u32>>;
@group(1) @binding(4) var distance_texture: texture_2d<f32>;
@group(1) @binding(5) var hit_texture: texture_2d<u32>;

// A work group has 16 × 16 quads, and so 17 × 17 pixels.
const QUADS: u32 = 16u;
const ROW: u32 = 17u;
// Cells that a work group counts for itself: neighbours mostly hit the same.
const SLOTS: u32 = 4u;

var<workgroup> grids: array<vec2<u32>, 289>;
var<workgroup> distances: array<f32, 289>;
var<workgroup> slot_cells: array<atomic<u32>, 4>;
var<workgroup> slot_counts: array<atomic<u32>, 4>;
var<workgroup> slot_marks: array<atomic<u32>, 4>;
var<workgroup> texels: array<vec4<f32>, 64>;

struct Sample {
    // Metres from the eye; negative: a miss.
    distance: f32,
    // Grid coordinates of the hit.
    grid: vec2<u32>,
}

fn sample_at(pixel: vec2<i32>) -> Sample {
    let distance = textureLoad(distance_texture, pixel, 0).x;
    if distance < 0.0 {
        return Sample(-1.0, vec2<u32>(0u));
    }
    let hit = textureLoad(hit_texture, pixel, 0);
    let index = hit.x;
    let place = bitcast<vec2<f32>>(hit.yz);
    // Sides and cells are powers of two: nothing is rounded but the place itself.
    let side = leaves[index].grid_side;
    let unit = vec2<f32>(f32(side)) / vec2<f32>(leaves[index].cells);
    let along = (place - vec2<f32>(leaves[index].first_cell)) * unit;
    let whole = vec2<u32>(clamp(along, vec2<f32>(0.0), vec2<f32>(f32(side))));
    return Sample(distance, leaves[index].grid_origin + min(whole, vec2<u32>(side - 1u)));
}

// As far beyond `a` as `b` lies on its other side, within 0…limit.
fn mirrored(a: u32, b: u32, limit: u32) -> u32 {
    if a >= b {
        return a + min(a - b, limit - a);
    }
    return a - min(b - a, a);
}

// A pixel's sample; just beyond the picture, where its edge goes on evenly.
fn sample_around(pixel: vec2<i32>) -> Sample {
    let last = vec2<i32>(view.size) - 1;
    let inside = clamp(pixel, vec2<i32>(0), last);
    let near = sample_at(inside);
    if all(pixel == inside) {
        return near;
    }
    let far = sample_at(clamp((2 * inside) - pixel, vec2<i32>(0), last));
    if near.distance < 0.0 || far.distance < 0.0 {
        return near;
    }
    // 64 roots along an axis are all of 32 bits.
    let limit = (view.root_size << vec2<u32>(ROOT_BITS)) - 1u;
    let grid = vec2<u32>(
        mirrored(near.grid.x, far.grid.x, limit.x),
        mirrored(near.grid.y, far.grid.y, limit.y),
    );
    return Sample(max((2.0 * near.distance) - far.distance, 0.5 * near.distance), grid);
}

// Counts a pixel for its cell: in a slot of the work group where one is the cell's or free.
fn count_pixel(cell: u32, marks: u32) {
    for (var slot = 0u; slot < SLOTS; slot++) {
        let claimed = atomicCompareExchangeWeak(&slot_cells[slot], EMPTY, cell);
        if claimed.exchanged || claimed.old_value == cell {
            atomicAdd(&slot_counts[slot], 1u);
            atomicOr(&slot_marks[slot], marks);
            return;
        }
    }
    atomicAdd(&pixels[cell], 1u);
    mark_cell(cell, marks);
}

// What a visible place adds to the pattern map.
fn mark_pattern(hit: Sample, marks: u32) {
    if radial_mark(hit.distance) != 0u && stack.pattern_map < stack.maps {
        let pattern = cell_index(stack.pattern_map, hit.grid);
        if pattern != EMPTY {
            mark_cell(pattern, marks);
        }
    }
}

// Marks of a place that shows.
fn marks_of(hit: Sample, map: u32) -> u32 {
    return wanted_marks(map, hit.distance, hit.distance);
}

fn mark_pixel(hit: Sample) {
    let map = map_at(hit.distance);
    let marks = marks_of(hit, map);
    let cell = cell_index(map, hit.grid);
    if cell != EMPTY {
        count_pixel(cell, marks | MARK_WANTED);
    }
    mark_pattern(hit, marks);
    if map > 0u && hit.distance >= (BLENDS_FROM * stack.levels[map].band.y) {
        let coarser = cell_index(map - 1u, hit.grid);
        if coarser != EMPTY {
            mark_cell(coarser, MARK_BLENDED);
        }
    }
}

// The same of a place between pixels, which is not counted.
fn mark_place(hit: Sample) {
    let map = map_at(hit.distance);
    let marks = marks_of(hit, map);
    let cell = cell_index(map, hit.grid);
    if cell != EMPTY {
        mark_cell(cell, marks | MARK_WANTED);
    }
    mark_pattern(hit, marks);
}

// Whether a box touches more than 2 × 2 cells of a map.
fn spreads(map: u32, low: vec2<u32>, high: vec2<u32>) -> bool {
    let bits = vec2<u32>(cell_bits(map));
    return any(((high >> bits) - (low >> bits)) > vec2<u32>(1u));
}

// Whether a box touches more than one cell of a map.
fn parts(map: u32, low: vec2<u32>, high: vec2<u32>) -> bool {
    let bits = vec2<u32>(cell_bits(map));
    return any((high >> bits) != (low >> bits));
}

// Places in a quad, along each axis, at which what lies between its pixels is marked.
const BETWEEN: u32 = 4u;
// Pixels whose distances differ by more are of two slopes, with perhaps something between.
const SMOOTH: f32 = 1.25;

// Marks what lies between four pixels of one smooth slope, as flat as it is between them; a quad at the picture's
// edge ends there. `low`: the least of the four grid coordinates.
fn mark_between(corner: u32, quad: vec2<u32>, low: vec2<u32>) {
    // In perspective the nearer count for more.
    let closeness = 1.0 / vec4<f32>(
        distances[corner],
        distances[corner + 1u],
        distances[corner + ROW],
        distances[corner + ROW + 1u],
    );
    let a = vec2<f32>(grids[corner] - low);
    let b = vec2<f32>(grids[corner + 1u] - low);
    let c = vec2<f32>(grids[corner + ROW] - low);
    let d = vec2<f32>(grids[corner + ROW + 1u] - low);
    for (var part = 0u; part < (BETWEEN * BETWEEN); part++) {
        let share = (vec2<f32>(vec2<u32>(part % BETWEEN, part / BETWEEN)) + 0.5) / f32(BETWEEN);
        let place = vec2<f32>(quad) + share - 0.5;
        if any(place < vec2<f32>(0.0)) || any(place > vec2<f32>(view.size)) {
            continue;
        }
        let rest = 1.0 - share;
        let weights = closeness * vec4<f32>(rest.x * rest.y, share.x * rest.y, rest.x * share.y, share.x * share.y);
        let distance = 1.0 / dot(weights, vec4<f32>(1.0));
        let offset = ((a * weights.x) + (b * weights.y) + (c * weights.z) + (d * weights.w)) * distance;
        mark_place(Sample(distance, low + vec2<u32>(offset)));
    }
}

// Marks what lies between four pixels, whose first stands at `corner`; answers the quad's distances.
fn mark_quad(corner: u32, quad: vec2<u32>) -> vec4<f32> {
    let at = vec4<f32>(
        distances[corner],
        distances[corner + 1u],
        distances[corner + ROW],
        distances[corner + ROW + 1u],
    );
    let hits = at >= vec4<f32>(0.0);
    let seen = select(vec4<f32>(ENDLESS), at, hits);
    let nearest = min(min(seen.x, seen.y), min(seen.z, seen.w));
    let farthest = max(max(seen.x, seen.y), max(seen.z, seen.w));
    // Half a pixel of the picture lies beyond the outermost centres: what is nearer may begin there.
    let outermost = any(quad == vec2<u32>(0u)) || any(quad == view.size);
    if !any(hits) {
        return vec4<f32>(select(NO_DISTANCES.xy, vec2<f32>(0.0, ENDLESS), outermost), nearest, farthest);
    }
    let gap = vec4<f32>(select(nearest, 0.0, outermost), farthest, nearest, farthest);
    if !all(hits) {
        return gap;
    }
    let a = grids[corner];
    let b = grids[corner + 1u];
    let c = grids[corner + ROW];
    let d = grids[corner + ROW + 1u];
    let low = min(min(a, b), min(c, d));
    let high = max(max(a, b), max(c, d));
    let finest = map_at(nearest);
    let coarsest = map_at(farthest);
    let radial = radial_mark(nearest);
    let patterned = radial != 0u && stack.pattern_map < stack.maps;
    let is_gap = farthest > (SMOOTH * nearest) || finest > coarsest + 1u || spreads(finest, low, high)
        || (patterned && spreads(stack.pattern_map, low, high));
    if is_gap {
        return gap;
    }
    // Four pixels of one cell and one level have marked it themselves.
    let apart = coarsest != finest || parts(finest, low, high);
    if apart || (patterned && parts(stack.pattern_map, low, high)) {
        mark_between(corner, quad, low);
    }
    return vec4<f32>(select(NO_DISTANCES.xy, gap.xy, outermost), nearest, farthest);
}

@compute @workgroup_size(8, 8)
fn mark_pixels(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    // Pixel of the group's first sample: the group's first quad begins there.
    let origin = vec2<i32>(group.xy * QUADS) - 1;
    for (var entry = index; entry < (ROW * ROW); entry += 64u) {
        let pixel = origin + vec2<i32>(vec2<u32>(entry % ROW, entry / ROW));
        let found = sample_around(pixel);
        grids[entry] = found.grid;
        distances[entry] = found.distance;
    }
    if index < SLOTS {
        atomicStore(&slot_cells[index], EMPTY);
        atomicStore(&slot_counts[index], 0u);
        atomicStore(&slot_marks[index], 0u);
    }
    workgroupBarrier();

    var texel = NO_DISTANCES;
    for (var part = 0u; part < 4u; part++) {
        let quad = (2u * local.xy) + vec2<u32>(part & 1u, part >> 1u);
        let corner = (quad.y * ROW) + quad.x;
        // The quad's last pixel is this thread's to count.
        let pixel = (group.xy * QUADS) + quad;
        let own = corner + ROW + 1u;
        if all(pixel < view.size) && distances[own] >= 0.0 {
            mark_pixel(Sample(distances[own], grids[own]));
        }
        if all(pixel <= view.size) {
            texel = join_distances(texel, mark_quad(corner, pixel));
        }
    }
    let place = (group.xy * (QUADS / 2u)) + local.xy;
    texels[index] = texel;
    store_distances(0u, place, texel);
    for (var step = 1u; step <= 3u; step++) {
        workgroupBarrier();
        let stride = 1u << step;
        if all((local.xy & vec2<u32>(stride - 1u)) == vec2<u32>(0u)) {
            let half = stride >> 1u;
            let east = join_distances(texels[index], texels[index + half]);
            let below = index + (8u * half);
            texels[index] = join_distances(east, join_distances(texels[below], texels[below + half]));
            store_distances(step, place >> vec2<u32>(step), texels[index]);
        }
    }

    // Barriers lie between: every count is in.
    if index < SLOTS {
        let cell = atomicLoad(&slot_cells[index]);
        if cell != EMPTY {
            atomicAdd(&pixels[cell], atomicLoad(&slot_counts[index]));
            mark_cell(cell, atomicLoad(&slot_marks[index]));
        }
    }
}
