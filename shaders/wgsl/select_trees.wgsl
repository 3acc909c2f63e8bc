// Which trees are drawn one by one, and at which level of detail: a thread a candidate seed of the active cells.
//
// `decide` finds the tree that the server has there, in the same integers, and tests it; each work group counts its
// trees by species and level. `scan` makes sums of the counts, which are places in the list, and the arguments of
// the draws. `scatter` writes the instances there, in the order of cells and seeds: whatever the adapter does first.
// Twin: `twin/select_trees.rs`.

override WITH_PHOTO: bool = true;
override WITH_SHADOWS: bool = true;
override WITH_SEASON: bool = false;
override WITH_CLOUDS: bool = false;

// Bins: 255 species of four levels, and one that counts every tree once.
const MOST_BINS: u32 = 1021u;
// A work group's candidates: so many columns of sub-cells of a cell, all their rows.
const BLOCK_COLUMNS: u32 = 8u;
const BLOCK_SEEDS: u32 = 192u;
const SCAN_THREADS: u32 = 256u;
// Anchor heights beside a void.
const ANCHOR_VOID: i32 = -2147483647 - 1;
// Radians of a unit of place: 2π / 2^32.
const UNIT_RADIANS: f32 = 1.4629180792671596e-9;
// Stands lower than this are the ground's texture, quarter metres.
const LEAST_STAND_HEIGHT: u32 = 8u;
// Heights are counted in 1/1024 m.
const HEIGHT_UNIT: f32 = 0.0009765625;
// How much farther than the surface at its pixels a tree's top may be and count as visible, metres: where the heights
// hold every crown, and where the terrain drawn is simplified.
const TOP_TOLERANCE: vec2<f32> = vec2<f32>(15.0, 50.0);
// Cells longer than this hold the canopy's mean, metres.
const FINE_CELLS: f32 = 1.8;
// A tree's level of detail changes up to this factor (as a power of two) sooner or later than its species'.
const LEVEL_JITTER: f32 = 0.5;
// Over this ratio of sizes one level fades into the next.
const LEVEL_BAND: f32 = 1.25;
// Shares of the range: over which each tree ends sooner, and over which it fades.
const RANGE_JITTER: f32 = 0.15;
const RANGE_BAND: f32 = 0.1;
// Distances from which on there is no first and no second level, metres.
const RADIAL_LEVELS: vec2<f32> = vec2<f32>(700.0, 1400.0);

@group(1) @binding(0) var<uniform> seed_frame: SeedFrame;
@group(1) @binding(1) var<uniform> seed_species: array<SeedSpecies, 255>;
@group(1) @binding(2) var<storage, read> seed_cells: array<SeedCell>;
// A word a candidate: its bin plus one, and (from bit 16) that of the next level where it is fading into that.
@group(1) @binding(3) var<storage, read_write> decided: array<u32>;
// Bin by bin: a word a work group.
@group(1) @binding(4) var<storage, read_write> counts: array<u32>;
@group(1) @binding(5) var<storage, read_write> instances: array<TreeInstance>;
// Species, closure and height of the stand.
@group(1) @binding(6) var land_cover: texture_2d_array<u32>;
@group(1) @binding(7) var anchors: texture_2d_array<i32>;
@group(1) @binding(8) var distance_texture: texture_2d<f32>;
@group(1) @binding(9) var hit_texture: texture_2d<u32>;
// `instance_count` is written; a bin's instances begin at the first of its counts.
@group(2) @binding(0) var<storage, read_write> draws: array<Draw>;

// A tree as the server has it.
struct SeedTree {
    lives: bool,
    // Index in the table.
    species: u32,
    // Place in its cell, units.
    units: vec2<u32>,
    // Anchor, quanta.
    ground: i32,
    // Height, 1/1024 m.
    height: u32,
    rotation: u32,
    // Its own, for all that is jittered.
    bits: u32,
}

// The same, seen from the eye.
struct PlacedTree {
    foot: vec3<f32>,
    up: vec3<f32>,
    height: f32,
    crown_radius: f32,
}

// Levels at which a tree is drawn.
struct TreeLevels {
    level: u32,
    // Whether the next level is drawn too.
    fades: bool,
    // Shares of the pixels that the level takes, and that both take.
    own: f32,
    both: f32,
}

// a · b in 64 bits, lower word first.
fn wide_product(a: u32, b: u32) -> vec2<u32> {
    let low = vec2<u32>(a, b) & vec2<u32>(0xffffu);
    let high = vec2<u32>(a, b) >> vec2<u32>(16u);
    let low_low = low.x * low.y;
    let low_high = low.x * high.y;
    let high_low = high.x * low.y;
    let middle = (low_low >> 16u) + (low_high & 0xffffu) + (high_low & 0xffffu);
    return vec2<u32>(
        (low_low & 0xffffu) | (middle << 16u),
        (high.x * high.y) + (low_high >> 16u) + (high_low >> 16u) + (middle >> 16u),
    );
}

fn wide_sum(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}

// Height of the patch between four nodes, quanta, to the nearest (`core::seeds::anchor::between`).
fn anchor_between(nodes: vec4<i32>, offset: vec2<u32>, bits: u32) -> i32 {
    let lowest = min(min(nodes.x, nodes.y), min(nodes.z, nodes.w));
    let over = vec4<u32>(nodes - vec4<i32>(lowest));
    let far = vec2<u32>(1u << bits) - offset;
    var sum = wide_product(over.x, far.x * far.y);
    sum = wide_sum(sum, wide_product(over.y, offset.x * far.y));
    sum = wide_sum(sum, wide_product(over.z, far.x * offset.y));
    sum = wide_sum(sum, wide_product(over.w, offset.x * offset.y));
    sum = wide_sum(sum, vec2<u32>(1u << ((2u * bits) - 1u), 0u));
    return lowest + i32((sum.x >> (2u * bits)) | (sum.y << (32u - (2u * bits))));
}

// The ground under a place, quanta; `place` and its tile's corner in units.
fn anchor_at(place: vec2<u32>, tile: vec2<u32>, slot: u32) -> i32 {
    let bits = seed_frame.anchor_bits;
    let node = vec2<i32>((place >> vec2<u32>(bits)) - (tile >> vec2<u32>(bits)));
    let nodes = vec4<i32>(
        textureLoad(anchors, node, slot, 0).x,
        textureLoad(anchors, node + vec2<i32>(1, 0), slot, 0).x,
        textureLoad(anchors, node + vec2<i32>(0, 1), slot, 0).x,
        textureLoad(anchors, node + vec2<i32>(1, 1), slot, 0).x,
    );
    if any(nodes == vec4<i32>(ANCHOR_VOID)) {
        return ANCHOR_VOID;
    }
    return anchor_between(nodes, place & vec2<u32>((1u << bits) - 1u), bits);
}

// Share of a stand's candidates that live, of 65536 (`core::seeds::Stand::share`).
fn stand_share(species: SeedSpecies, closure: u32, height: u32) -> u32 {
    let share = min((species.share * closure) / 255u, 65535u);
    if height == 0u {
        return share;
    }
    return min((share * species.mean) / (height * 256u), 65536u);
}

// Height of a tree, 1/1024 m (`core::seeds::Species::tree_height`).
fn tree_height(species: SeedSpecies, size: u32, height: u32) -> u32 {
    let own = species.lowest + (((species.highest - species.lowest) * size) / 255u);
    if height == 0u {
        return min(own, species.tallest);
    }
    return min((own * (height * 256u)) / species.mean, species.tallest);
}

fn no_tree() -> SeedTree {
    return SeedTree(false, 0u, vec2<u32>(0u), 0, 0u, 0u, 0u);
}

// The tree of a seed, where one lives.
fn tree_of_seed(cell: SeedCell, sub_cell: vec2<u32>) -> SeedTree {
    let row = seed_row(cell.cell.y);
    if sub_cell.x >= row.columns {
        return no_tree();
    }
    let candidate = seed_candidate(seed_pattern(pattern_of_cell(cell.cell, view.scene_seed)), sub_cell);
    let units = seed_units(candidate, row.columns);
    let place = (cell.cell << vec2<u32>(SEED_CELL_BITS)) + units;
    let tile = (place >> vec2<u32>(seed_frame.tile_bits)) << vec2<u32>(seed_frame.tile_bits);
    let stand = textureLoad(land_cover, vec2<i32>((place - tile) >> vec2<u32>(seed_frame.cover_bits)), cell.slot, 0);
    let grows = stand.y > 0u && (stand.z == 0u || stand.z >= LEAST_STAND_HEIGHT);
    if stand.x == 0u || stand.x > seed_frame.species || !grows {
        return no_tree();
    }
    let species = seed_species[stand.x - 1u];
    if candidate.rank >= ((stand_share(species, stand.y, stand.z) * row.aspect) >> 14u) {
        return no_tree();
    }
    let ground = anchor_at(place, tile, cell.slot);
    if ground == ANCHOR_VOID {
        return no_tree();
    }
    let height = tree_height(species, candidate.size, stand.z);
    let bits = mix_bits(place.x + mix_bits(place.y));
    return SeedTree(true, stand.x - 1u, units, ground, height, candidate.rotation, bits);
}

fn placed_tree(cell: SeedCell, tree: SeedTree) -> PlacedTree {
    // Whole units up to 2^24 are exact.
    let apart = vec2<f32>(cell.offset + vec2<i32>(tree.units)) - seed_frame.eye_fraction;
    let angles = apart * UNIT_RADIANS;
    let ground = f32(tree.ground) * seed_frame.anchor_quantum;
    let foot = enu_from_place(seed_frame.eye, angles.x, -angles.y, ground);
    let up = normalize(vec3<f32>(foot.xy / view.sun.w, 1.0));
    let height = f32(tree.height) * HEIGHT_UNIT;
    return PlacedTree(foot, up, height, height * seed_species[tree.species].crown_radius);
}

// Whether any of a tree's sphere may be in the picture.
fn in_frustum(tree: PlacedTree) -> bool {
    let centre = tree.foot + (0.5 * tree.height * tree.up);
    let radius = 0.5 + length(vec2<f32>(0.5 * tree.height, tree.crown_radius));
    for (var side = 0u; side < 4u; side++) {
        if dot(seed_frame.sides[side].xyz, centre) < -radius {
            return false;
        }
    }
    return true;
}

// Whether the surface at a tree's top lies before it. A top off the picture counts as visible.
fn top_hidden(tree: PlacedTree) -> bool {
    let top = tree.foot + (tree.height * tree.up);
    let depth = dot(top, view.forward.xyz);
    if depth <= 0.1 {
        return false;
    }
    let right = view.right.xyz / dot(view.right.xyz, view.right.xyz);
    let above = view.up.xyz / dot(view.up.xyz, view.up.xyz);
    let screen = vec2<f32>(dot(top, right), -dot(top, above)) / depth;
    if any(abs(screen) > vec2<f32>(1.0)) {
        return false;
    }
    let size = vec2<f32>(view.size);
    let pixel = 0.5 * (screen + 1.0) * size;
    let away = length(top);
    let reach = clamp(0.7 * tree.crown_radius / (away * view.right.w), 1.0, 12.0);
    var farthest = 0.0;
    for (var sample = 0u; sample < 9u; sample++) {
        let offset = vec2<f32>(f32(sample % 3u), f32(sample / 3u)) - 1.0;
        let at = vec2<i32>(clamp(pixel + (offset * reach), vec2<f32>(0.0), size - 1.0));
        let distance = textureLoad(distance_texture, at, 0).x;
        if distance < 0.0 {
            return false;
        }
        farthest = max(farthest, distance);
    }
    let leaf = textureLoad(hit_texture, vec2<i32>(clamp(pixel, vec2<f32>(0.0), size - 1.0)), 0).x;
    var tolerance = TOP_TOLERANCE.y;
    if leaf != EMPTY {
        tolerance = select(TOP_TOLERANCE.x, TOP_TOLERANCE.y, leaves[leaf].cell_metres.y > FINE_CELLS);
    }
    return away > farthest + tolerance;
}

// Whether a tree is near enough, and its levels.
fn levels_of(away: f32, height: f32, bits: u32) -> TreeLevels {
    let hard = (view.flags & HARD_SWITCH) != 0u;
    let level_jitter = select((f32(bits & 0xffu) / 255.0) - 0.5, 0.0, hard);
    let range_jitter = f32((bits >> 8u) & 0xffu) / 255.0;
    let thresholds = seed_frame.level_pixels;
    var pixels = (height / max(away * view.right.w, 1e-6)) * exp2(LEVEL_JITTER * level_jitter);
    // Beyond the first two radial levels there is no more to see.
    pixels = min(pixels, thresholds.x * RADIAL_LEVELS.x / max(away, 1e-3));
    pixels = min(pixels, thresholds.y * RADIAL_LEVELS.y / max(away, 1e-3));
    let end = seed_frame.range * (1.0 - (RANGE_JITTER * range_jitter));
    let both = select(saturate((end - away) / (RANGE_BAND * seed_frame.range)), 1.0, hard);
    var level = 3u;
    var threshold = 0.0;
    if pixels >= thresholds.x {
        level = 0u;
        threshold = thresholds.x;
    } else if pixels >= thresholds.y {
        level = 1u;
        threshold = thresholds.y;
    } else if pixels >= thresholds.z {
        level = 2u;
        threshold = thresholds.z;
    }
    var own = 1.0;
    if level < 3u && !hard {
        own = saturate(((pixels / threshold) - 1.0) / (LEVEL_BAND - 1.0));
    }
    return TreeLevels(level, own < 1.0, own * both, both);
}

fn bin_of(species: u32, level: u32) -> u32 {
    return (species * TREE_LEVELS) + level;
}

// The word of a candidate.
fn decide_seed(cell: SeedCell, sub_cell: vec2<u32>) -> u32 {
    let tree = tree_of_seed(cell, sub_cell);
    if !tree.lives {
        return 0u;
    }
    let placed = placed_tree(cell, tree);
    let away = length(placed.foot + (0.5 * placed.height * placed.up));
    if away >= seed_frame.range || !in_frustum(placed) {
        return 0u;
    }
    let levels = levels_of(away, placed.height, tree.bits);
    if levels.both <= 0.0 || top_hidden(placed) {
        return 0u;
    }
    let bin = bin_of(tree.species, levels.level);
    return (bin + 1u) | (select(0u, bin + 2u, levels.fades) << 16u);
}

// A thread's seed.
struct Seed {
    // Whether there is one.
    exists: bool,
    cell: u32,
    sub_cell: vec2<u32>,
    // Of its word.
    index: u32,
    // Its work group.
    block: u32,
}

fn seed_of(group: vec3<u32>, local: u32) -> Seed {
    let block = (group.y * seed_frame.blocks) + group.x;
    let sub_cell = vec2<u32>((group.x * BLOCK_COLUMNS) + (local / SEED_ROWS), local % SEED_ROWS);
    let exists = group.y < seed_frame.cells && group.x < seed_frame.blocks;
    return Seed(exists, group.y, sub_cell, (block * BLOCK_SEEDS) + local, block);
}

var<workgroup> histogram: array<atomic<u32>, MOST_BINS>;

@compute @workgroup_size(192)
fn decide(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let seed = seed_of(group, local);
    let bins = seed_frame.species * TREE_LEVELS;
    if seed.exists {
        let word = decide_seed(seed_cells[seed.cell], seed.sub_cell);
        decided[seed.index] = word;
        if word != 0u {
            atomicAdd(&histogram[(word & 0xffffu) - 1u], 1u);
            atomicAdd(&histogram[bins], 1u);
            if (word >> 16u) != 0u {
                atomicAdd(&histogram[(word >> 16u) - 1u], 1u);
            }
        }
    }
    workgroupBarrier();
    if seed.exists {
        let blocks = seed_frame.cells * seed_frame.blocks;
        for (var bin = local; bin <= bins; bin += BLOCK_SEEDS) {
            counts[(bin * blocks) + seed.block] = atomicLoad(&histogram[bin]);
        }
    }
}

var<workgroup> part_sums: array<u32, SCAN_THREADS>;

// One work group: each thread sums its part, the parts' sums are summed up, and each writes sums of what lies before.
@compute @workgroup_size(256)
fn scan(@builtin(local_invocation_index) local: u32) {
    let blocks = seed_frame.cells * seed_frame.blocks;
    let bins = seed_frame.species * TREE_LEVELS;
    let length = (bins + 1u) * blocks;
    let part = (length + SCAN_THREADS - 1u) / SCAN_THREADS;
    let first = min(local * part, length);
    let end = min(first + part, length);
    var sum = 0u;
    for (var index = first; index < end; index++) {
        sum += counts[index];
    }
    part_sums[local] = sum;
    workgroupBarrier();
    for (var step = 1u; step < SCAN_THREADS; step *= 2u) {
        var before = 0u;
        if local >= step {
            before = part_sums[local - step];
        }
        workgroupBarrier();
        part_sums[local] += before;
        workgroupBarrier();
    }
    sum = part_sums[local] - sum;
    for (var index = first; index < end; index++) {
        let count = counts[index];
        counts[index] = sum;
        sum += count;
    }
    storageBarrier();
    workgroupBarrier();
    let total = part_sums[SCAN_THREADS - 1u];
    // What finds no room is not drawn. (The last bin only counts.)
    let room = arrayLength(&instances);
    for (var bin = local; bin < bins; bin += SCAN_THREADS) {
        let from_place = min(counts[bin * blocks], room);
        draws[bin].instance_count = min(counts[(bin + 1u) * blocks], room) - from_place;
    }
    if local == 0u {
        draws[bins].instance_count = total - counts[bins * blocks];
    }
}

var<workgroup> words: array<u32, BLOCK_SEEDS>;

@compute @workgroup_size(192)
fn scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let seed = seed_of(group, local);
    var word = 0u;
    if seed.exists {
        word = decided[seed.index];
    }
    words[local] = word;
    workgroupBarrier();
    if word == 0u {
        return;
    }
    let blocks = seed_frame.cells * seed_frame.blocks;
    let bins = vec2<u32>(word & 0xffffu, word >> 16u);
    var before = vec2<u32>(0u);
    for (var other = 0u; other < local; other++) {
        let theirs = words[other];
        let both = vec2<u32>(theirs & 0xffffu, theirs >> 16u);
        before += select(vec2<u32>(0u), vec2<u32>(1u), (both.xx == bins) | (both.yy == bins));
    }
    let cell = seed_cells[seed.cell];
    let tree = tree_of_seed(cell, seed.sub_cell);
    let placed = placed_tree(cell, tree);
    let away = length(placed.foot + (0.5 * placed.height * placed.up));
    let levels = levels_of(away, placed.height, tree.bits);
    let own = u32(round(255.0 * levels.own));
    let both = u32(round(255.0 * levels.both));
    let lights = lights_of(cell, tree, placed, away);
    let base = tree.rotation | (((tree.bits >> 16u) & 0xffu) << 8u);
    let seed_word = (seed.cell << 10u) | (seed.sub_cell.x << 5u) | seed.sub_cell.y;
    let foot = vec4<f32>(placed.foot, placed.height);
    let place = counts[((bins.x - 1u) * blocks) + seed.block] + before.x;
    let until = select(both, own, bins.y != 0u);
    var tree_instance = TreeInstance(
        foot, base | (until << 24u), seed_word, tree.ground, tree.height | 0x10000u | lights.season,
        lights.colour, lights.sun, lights.sky, lights.air,
    );
    let room = arrayLength(&instances);
    if place < room {
        instances[place] = tree_instance;
    }
    if bins.y != 0u {
        let second = counts[((bins.y - 1u) * blocks) + seed.block] + before.y;
        if second >= room {
            return;
        }
        tree_instance.look = base | (own << 16u) | (both << 24u);
        tree_instance.height_units = tree.height | lights.season;
        instances[second] = tree_instance;
    }
}
