// Which cells may show where no pixel's centre says so: `choose_cells` names candidates by their boxes, `test_sub_cells`
// tests 8 × 8 boxes of each against the pyramid of distances, `write_cells` makes the words.

@group(1) @binding(6) var<storage, read_write> candidates: array<u32>;
// x: work groups of `test_sub_cells`, the number of candidates.
@group(2) @binding(0) var<storage, read_write> dispatch: array<atomic<u32>, 3>;

const SUB_CELLS: u32 = 8u;
// A dispatch has no more work groups along an axis.
const MOST_CANDIDATES: u32 = 65535u;
// A picture from where the eye will be is looked at a little wider: it may turn.
const AHEAD_WIDENING: f32 = 1.15;
const CELLS_PER_TILE: u32 = 512u;

// Distances at which a cell of a map is looked at.
fn reach_of(map: u32) -> vec2<f32> {
    let band = stack.levels[map].band;
    if map == stack.pattern_map {
        return vec2<f32>(0.0, max(select(band.y, 0.0, band.x >= ENDLESS), RADIAL_METRES.z));
    }
    return band;
}

// A bound below the distance of everything over a cell, by the angles alone: cheap, and enough for most cells.
fn least_distance(map: u32, place: vec2<f32>) -> f32 {
    let span = stack.levels[map].span;
    let eye = stack.levels[map].eye;
    let apart = max(max(place - eye, eye - place - 1.0), vec2<f32>(0.0)) * span;
    // To the half-plane of a meridian, and to the cone of a latitude.
    let axis = max((stack.eye.w + stack.eye.z) * stack.eye.y, 0.0);
    let east = axis * sine(min(apart.x, QUARTER_TURN));
    let north = 6.2e6 * sine(min(apart.y, QUARTER_TURN));
    let turns = view.wraps == 1u && span * f32(MAP_SIDE) > HALF_TURN;
    return max(select(east, 0.0, turns || apart.x > QUARTER_TURN), north);
}

// The grid's north-west corner of a cell; false where the grid ends before it.
struct CellPlace {
    inside: bool,
    grid: vec2<u32>,
}

fn cell_place(map: u32, place: vec2<u32>) -> CellPlace {
    let bits = cell_bits(map);
    let columns = i32(grid_columns(map));
    let rows = i32(view.root_size.y << (ROOT_BITS - bits));
    var cell = stack.levels[map].first + vec2<i32>(place);
    if view.wraps == 1u && columns > i32(MAP_SIDE) {
        cell.x = cell.x % columns;
        if cell.x < 0 {
            cell.x += columns;
        }
    }
    let inside = all(cell >= vec2<i32>(0)) && cell.x < columns && cell.y < rows;
    return CellPlace(inside, vec2<u32>(max(cell, vec2<i32>(0))) << vec2<u32>(bits));
}

@compute @workgroup_size(64)
fn choose_cells(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    let map = index / MAP_CELLS;
    if map >= stack.maps {
        return;
    }
    let marks = atomicLoad(&cells[index]);
    let patterned = map == stack.pattern_map;
    // What pixels have named needs no box, unless it is on the coarsest map and reaches through more levels than they
    // have named.
    let named = (marks & MARK_WANTED) != 0u && (!patterned || (marks & MARK_RADIAL) != 0u);
    if named && map > 0u {
        return;
    }
    let place = vec2<u32>(index % MAP_SIDE, (index % MAP_CELLS) / MAP_SIDE);
    let reach = reach_of(map);
    let ahead = stack.look_ahead.w != 0.0;
    let farther = select(0.0, length(stack.look_ahead.xyz), ahead);
    if least_distance(map, vec2<f32>(place)) > (reach.y + farther) || !cell_place(map, place).inside {
        return;
    }
    let box = ground_box(map, vec2<f32>(place), vec2<f32>(place + 1u), stack.heights);
    let range = distance_range(box, vec3<f32>(0.0));
    if named && (wanted_marks(map, max(range.x, reach.x), range.y) & MARKS_COARSER & ~marks) == 0u {
        return;
    }
    var candidate = range.x < reach.y && range.y >= reach.x && !outside_picture(box, vec3<f32>(0.0), 1.0);
    if !candidate && ahead {
        let origin = stack.look_ahead.xyz;
        let there = distance_range(box, origin);
        candidate = there.x < reach.y && there.y >= reach.x && !outside_picture(box, origin, AHEAD_WIDENING);
    }
    if candidate {
        let entry = atomicAdd(&dispatch[0], 1u);
        if entry < MOST_CANDIDATES {
            candidates[entry] = index;
        }
    }
}

fn join_ranges(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(min(a.x, b.x), max(a.y, b.y));
}

fn node_height(slot: u32, node: vec2<i32>) -> f32 {
    return textureLoad(heights, node + BORDER, slot, 0).x;
}

// Least and greatest height of a leaf's tile over a square of the grid, whose side is a power of two.
fn heights_in_tile(leaf: Leaf, grid: vec2<u32>, side: u32) -> vec2<f32> {
    let cell_side = firstLeadingBit(leaf.grid_side) - min(firstLeadingBit(leaf.cells.x), firstLeadingBit(leaf.grid_side));
    let place = vec2<i32>(grid - leaf.grid_origin) + vec2<i32>(leaf.first_cell << vec2<u32>(cell_side));
    let side_bits = firstLeadingBit(side);
    if side_bits > cell_side {
        let level = side_bits - cell_side;
        let texel = place >> vec2<u32>(cell_side + level);
        let count = i32(CELLS_PER_TILE >> min(level, 31u));
        if any(texel < vec2<i32>(0)) || any(texel >= vec2<i32>(count)) {
            // More than the tile: what lies beside it is not looked up.
            return stack.heights;
        }
        let mip = level - 1u;
        return vec2<f32>(textureLoad(minima, texel, leaf.slot, mip).x, textureLoad(maxima, texel, leaf.slot, mip).x);
    }
    // A part of one cell: the patch is nowhere outside its corners' heights.
    let cell = place >> vec2<u32>(cell_side);
    let north_west = node_height(leaf.slot, cell);
    let north_east = node_height(leaf.slot, cell + vec2<i32>(1, 0));
    let south_west = node_height(leaf.slot, cell + vec2<i32>(0, 1));
    let south_east = node_height(leaf.slot, cell + vec2<i32>(1, 1));
    if min(min(north_west, north_east), min(south_west, south_east)) <= VOID_HEIGHT {
        return NO_RANGE;
    }
    let unit = 1.0 / f32(1u << cell_side);
    let first = vec2<f32>(place - (cell << vec2<u32>(cell_side))) * unit;
    let last = first + (f32(side) * unit);
    let north = mix(vec2<f32>(north_west), vec2<f32>(north_east), vec2<f32>(first.x, last.x));
    let south = mix(vec2<f32>(south_west), vec2<f32>(south_east), vec2<f32>(first.x, last.x));
    let upper = mix(north, south, vec2<f32>(first.y));
    let lower = mix(north, south, vec2<f32>(last.y));
    return vec2<f32>(min(min(upper.x, upper.y), min(lower.x, lower.y)), max(max(upper.x, upper.y), max(lower.x, lower.y)));
}

// Ground of slope 1 rises by half a cell between nodes that do not show it.
const RISE_BETWEEN_NODES: f32 = 0.5;

// Least and greatest height that is drawn over a square of the grid, or may be once its tile of `level` is there.
fn heights_over(grid: vec2<u32>, side: u32, level: u32) -> vec2<f32> {
    let square = find_square(grid + vec2<u32>(side >> 1u));
    if square.entry == EMPTY {
        return NO_RANGE;
    }
    let leaf = leaves[square.entry & ~LEAF_BIT];
    var range = heights_in_tile(leaf, grid, side);
    if leaf.stand_in != EMPTY {
        range = join_ranges(range, heights_in_tile(leaves[leaf.stand_in], grid, side));
    }
    if range.y <= VOID_HEIGHT {
        return NO_RANGE;
    }
    if leaf.level < min(level, stack.elevation_level) {
        range.y += RISE_BETWEEN_NODES * max(leaf.cell_metres.x, leaf.cell_metres.y);
    }
    return range;
}

// Marks of the visible maps from one distance to another.
fn level_marks(range: vec2<f32>) -> u32 {
    let finest = map_at(range.x);
    let coarsest = map_at(range.y);
    return ((2u << finest) - (1u << coarsest)) << MARK_LEVELS;
}

// Boxes that a thread tests at most: all parts of a sub-cell are 273.
const PART_LIMIT: u32 = 300u;
// Pixels by which f32 may be off in the picture.
const PICTURE_SLACK: f32 = 0.05;

// Each sub-cell whose box may show is tested again in so many parts a side, and those that may show once more.
const PARTS: u32 = 4u;

// A square of a sub-cell: its side is the sub-cell's over `PARTS`, `depth` times.
struct Part {
    grid: vec2<u32>,
    depth: u32,
}

// The box of a square of the grid in a cell; its pad is negative where nothing is there.
fn part_box(map: u32, place: vec2<u32>, corner: vec2<u32>, part: Part) -> GroundBox {
    let bits = cell_bits(map);
    let side = max((1u << bits) >> (3u + (2u * part.depth)), 1u);
    let range = heights_over(part.grid, side, stack.levels[map].level);
    if range.x > range.y {
        var nothing: GroundBox;
        nothing.pad = -1.0;
        return nothing;
    }
    let unit = 1.0 / f32(1u << bits);
    let low = vec2<f32>(place) + (vec2<f32>(part.grid - corner) * unit);
    return ground_box(map, low, low + (f32(side) * unit), range);
}

// What a box adds to its cell's marks.
fn marks_of_box(map: u32, box: GroundBox, marks: u32) -> u32 {
    let band = stack.levels[map].band;
    let range = distance_range(box, vec3<f32>(0.0));
    let rectangle = pyramid_rectangle(picture_rectangle(box, range.y), PICTURE_SLACK);
    var found = 0u;
    if rectangle.x <= rectangle.z && !outside_picture(box, vec3<f32>(0.0), 1.0) {
        let wanted = vec2<f32>(max(range.x, band.x), min(range.y, band.y));
        // What a box adds does not depend on which others came before it: only the search is saved.
        let own = wanted_marks(map, wanted.x, wanted.y) | MARK_WANTED;
        // Bands hold their near end only.
        let holds = wanted.x <= wanted.y && wanted.x < band.y;
        if holds && (own & ~marks) != 0u && shows(rectangle, wanted, true) {
            found = own;
        }
        let near = vec2<f32>(range.x, min(range.y, RADIAL_METRES.z));
        if map == stack.pattern_map && near.x < near.y {
            let every = level_marks(near) | radial_mark(near.x);
            if (every & ~marks) != 0u && shows(rectangle, near, true) {
                found |= every;
            }
        }
    }
    if stack.look_ahead.w == 0.0 || (marks & MARK_AHEAD) != 0u {
        return found;
    }
    let origin = stack.look_ahead.xyz;
    let there = distance_range(box, origin);
    let wanted = vec2<f32>(max(there.x, band.x), min(there.y, band.y));
    if wanted.x > wanted.y || wanted.x >= band.y || outside_picture(box, origin, AHEAD_WIDENING) {
        return found;
    }
    // What this frame hides at the same place of the picture stays hidden; beside the picture nothing is known.
    let way = length(origin);
    let beside = rectangle.x > rectangle.z;
    if beside || shows(rectangle, vec2<f32>(range.x - way, range.y + way), false) {
        found |= MARK_AHEAD;
    }
    return found;
}

@compute @workgroup_size(8, 8)
fn test_sub_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let index = candidates[group.x];
    let map = index / MAP_CELLS;
    let place = vec2<u32>(index % MAP_SIDE, (index % MAP_CELLS) / MAP_SIDE);
    let bits = cell_bits(map);
    let corner = cell_place(map, place).grid;
    let sub_cell = corner + ((local.xy << vec2<u32>(bits)) >> vec2<u32>(3u));
    // From the sub-cell down, in order of parts; only what no other has marked is looked for.
    var part = Part(sub_cell, 0u);
    var counts = vec3<u32>(0u);
    for (var count = 0u; count < PART_LIMIT; count++) {
        let marks = atomicLoad(&cells[index]);
        let box = part_box(map, place, corner, part);
        var found = 0u;
        if box.pad >= 0.0 {
            found = marks_of_box(map, box, marks) & ~marks;
        }
        if found != 0u && part.depth < 2u && bits >= (3u + (2u * (part.depth + 1u))) {
            part.depth += 1u;
            continue;
        }
        if found != 0u {
            mark_cell(index, found);
        }
        // On to the next part of this depth, or of the one above.
        var side = (1u << bits) >> (3u + (2u * part.depth));
        while part.depth > 0u {
            counts[part.depth] += 1u;
            if counts[part.depth] < (PARTS * PARTS) {
                let step = counts[part.depth] % PARTS;
                if step == 0u {
                    part.grid = vec2<u32>(part.grid.x - ((PARTS - 1u) * side), part.grid.y + side);
                } else {
                    part.grid.x += side;
                }
                break;
            }
            counts[part.depth] = 0u;
            part.grid -= vec2<u32>((PARTS - 1u) * side);
            part.depth -= 1u;
            side *= PARTS;
        }
        if part.depth == 0u {
            return;
        }
    }
}

@compute @workgroup_size(64)
fn write_cells(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    let marks = atomicLoad(&cells[index]);
    if marks == 0u {
        return;
    }
    let map = index / MAP_CELLS;
    let coarsest = stack.levels[0].level;
    let levels = marks >> MARK_LEVELS;
    var word = select(0u, 1u << 27u, (marks & MARK_AHEAD) != 0u);
    word |= select(0u, 1u << 28u, (marks & MARK_BLENDED) != 0u);
    if levels != 0u {
        var visible = 1u;
        if map == stack.pattern_map {
            let place = vec2<u32>(index % MAP_SIDE, (index % MAP_CELLS) / MAP_SIDE);
            let cell = cell_place(map, place).grid >> vec2<u32>(cell_bits(map));
            // Units of place per cell: 2^31 from pole to pole, 2^level cells.
            let first = view.grid_place >> vec2<u32>(31u - stack.levels[map].level);
            visible = pattern_of_cell(first + cell, stack.scene_seed);
        }
        var smallest = coarsest + firstTrailingBit(levels);
        var largest = coarsest + firstLeadingBit(levels);
        let coarser = (marks & MARKS_COARSER) >> MARK_COARSER;
        if coarser != 0u {
            smallest -= min(firstLeadingBit(coarser), smallest);
            if levels == 1u {
                largest -= min(firstTrailingBit(coarser), largest);
            }
        }
        let radial = min(firstTrailingBit((marks & MARK_RADIAL) | 8u), 3u);
        word |= visible | ((255u - smallest) << 8u) | (largest << 16u) | (radial << 24u);
        word |= select(0u, 1u << 26u, (marks & MARK_WANTED) != 0u);
    }
    atomicStore(&cells[index], word);
}
