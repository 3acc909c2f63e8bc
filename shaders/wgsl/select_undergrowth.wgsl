// The undergrowth: clusters of the metaseeds near the eye, a thread a metaseed of the blocks in sight.
//
// `decide_plants` finds each metaseed's cluster and tests its members: a bit a member that is drawn; each work group
// counts them by bin. `scan_plants` makes sums of the counts, which are places in the list, and the arguments of the
// draws. `scatter_plants` writes the plants there, in the order of blocks, metaseeds and members. Twin:
// `twin/select_undergrowth.rs`.

override WITH_PHOTO: bool = true;
override WITH_SHADOWS: bool = true;
override WITH_SEASON: bool = false;
override WITH_CLOUDS: bool = false;

// A block is so many sub-cells wide and high: a work group's.
const PLANT_BLOCK: u32 = 8u;
const PLANT_THREADS: u32 = 64u;
const PLANT_SCAN_THREADS: u32 = 256u;
// Radians of a unit of place: 2π / 2^32.
const UNIT_RADIANS: f32 = 1.4629180792671596e-9;
const SIZE_METRES: f32 = 0.0009765625;
// A cluster with its members lies within so many metres of its metaseed.
const CLUSTER_METRES: f32 = 3.4;
// Canopies lower than this, quarter metres, are no crowns; and so far from a metaseed they count, metres.
const LEAST_CROWN: u32 = 8u;
const CROWNS_METRES: f32 = 3.5;
// As the shade pass has it: what is higher over the ground is canopy, metres.
const CANOPY_FOOT: f32 = 0.05;
// No ground lies so low, metres: a void, or what is mixed with one.
const VOID_BELOW: f32 = -100000.0;
// A plant smaller than this in the picture is not drawn, pixels.
const LEAST_PIXELS: f32 = 1.6;
// Shares of its own range over which a plant grows from nothing; how much sooner than the last the first one ends.
const GROWTH_BAND: f32 = 0.3;
const RANGE_SPREAD: f32 = 0.75;
// Nearer to the eye than the first nothing stands, from the second on all of it, metres.
const NEAR_EYE: vec2<f32> = vec2<f32>(0.25, 0.9);
// Shares of the range of each kind: grass, flowers, ferns, dwarf shrubs, stones, wood.
const KIND_RANGES: array<f32, 6> = array<f32, 6>(0.75, 0.6, 0.9, 0.9, 1.0, 1.0);

@group(1) @binding(0) var<uniform> undergrowth: UndergrowthFrame;
// Of a community's themes: members at least, how many more at most, kinds of sixteenths.
@group(1) @binding(1) var<uniform> themes: array<vec4<u32>, 32>;
@group(1) @binding(2) var<storage, read> blocks: array<UndergrowthBlock>;
// A bit a member.
@group(1) @binding(3) var<storage, read_write> chosen: array<vec2<u32>>;
// Bin by bin, then metaseeds: a word a block.
@group(1) @binding(4) var<storage, read_write> counts: array<u32>;
@group(1) @binding(5) var<storage, read_write> plants: array<Plant>;
// Instance counts and the light are written.
@group(2) @binding(0) var<storage, read_write> drawn: UndergrowthDraws;

// A metaseed on its ground.
struct Site {
    grows: bool,
    seed: Metaseed,
    cluster: Cluster,
    leaf: u32,
    // From the eye, metres.
    foot: vec3<f32>,
    // Share of the nine places about it that lie under crowns, 0…9.
    crowns: u32,
}

// A member on its ground.
struct Placed {
    // How far it has grown, 0…1: 0 where it is not drawn.
    grown: f32,
    foot: vec3<f32>,
    height: f32,
    unit: vec2<u32>,
    leaf: u32,
    away: f32,
}

// The node nearest to grid coordinates of a leaf.
fn nearest_node(index: u32, unit: vec2<u32>) -> vec2<i32> {
    let units = max(vec2<u32>(leaves[index].grid_side) / leaves[index].cells, vec2<u32>(1u));
    let within = (unit - leaves[index].grid_origin) + (units >> vec2<u32>(1u));
    return vec2<i32>(leaves[index].first_cell + (within / units));
}

// Height of the ground that is drawn, below any canopy, and of the canopy over it, metres.
fn drawn_ground(index: u32, unit: vec2<u32>) -> vec2<f32> {
    let leaf = ground_leaf(index);
    let cell = cell_in(leaf, MapPlace(unit, vec2<f32>(0.5)));
    let base = vec2<i32>(floor(cell));
    let part = cell - floor(cell);
    let north = mix(bare_node(base, leaf.slot), bare_node(base + vec2<i32>(1, 0), leaf.slot), part.x);
    let south = mix(bare_node(base + vec2<i32>(0, 1), leaf.slot), bare_node(base + vec2<i32>(1, 1), leaf.slot), part.x);
    let ground = mix(north, south, part.y);
    // Beside a void there is none.
    return select(ground, vec2<f32>(VOID_HEIGHT, 0.0), ground.x < VOID_BELOW);
}

// Height of a node's ground and of the canopy over it, metres.
fn bare_node(node: vec2<i32>, slot: u32) -> vec2<f32> {
    let inside = clamp(node, vec2<i32>(-1), vec2<i32>(513));
    let canopy = f32(node_surface(inside, slot).y) * CANOPY_UNIT;
    return vec2<f32>(node_height(inside, slot) - canopy, canopy);
}

// Of the nine places about a metaseed, how many lie under crowns.
fn crowns_about(index: u32, unit: vec2<u32>) -> u32 {
    let node = nearest_node(index, unit);
    let reach = vec2<i32>(max(round(vec2<f32>(CROWNS_METRES) / leaves[index].cell_metres), vec2<f32>(1.0)));
    var crowns = 0u;
    for (var tap = 0; tap < 9; tap++) {
        let offset = vec2<i32>(tap % 3, tap / 3) - vec2<i32>(1);
        crowns += select(0u, 1u, node_surface(node + (offset * reach), leaves[index].slot).y >= LEAST_CROWN);
    }
    return crowns;
}

fn foot_of(block: UndergrowthBlock, place: vec2<i32>, height: f32) -> vec3<f32> {
    // Whole units up to 2^24 are exact.
    let angles = (vec2<f32>(block.offset + place) - undergrowth.eye_fraction) * UNIT_RADIANS;
    return enu_from_place(undergrowth.eye, angles.x, -angles.y, height);
}

fn outside_picture(centre: vec3<f32>, radius: f32) -> bool {
    for (var side = 0u; side < 4u; side++) {
        if dot(undergrowth.sides[side].xyz, centre) < -radius {
            return true;
        }
    }
    return false;
}

fn unit_of(block: UndergrowthBlock, place: vec2<i32>) -> vec2<u32> {
    return grid_of_place((block.cell << vec2<u32>(SEED_CELL_BITS)) + vec2<u32>(place));
}

fn site_of(block: UndergrowthBlock, local: u32) -> Site {
    var site: Site;
    site.grows = false;
    let sub_cell = block.first + vec2<u32>(local % PLANT_BLOCK, local / PLANT_BLOCK);
    if sub_cell.x >= block.columns || sub_cell.y >= METASEED_ROWS {
        return site;
    }
    site.seed = metaseed_at(block.cell, sub_cell, block.columns, view.scene_seed);
    let place = vec2<i32>(site.seed.place);
    let unit = unit_of(block, place);
    site.leaf = leaf_index_at(unit);
    if site.leaf == EMPTY {
        return site;
    }
    let ground = drawn_ground(site.leaf, unit);
    if ground.x <= VOID_HEIGHT {
        return site;
    }
    site.foot = foot_of(block, place, ground.x);
    if length(site.foot) > undergrowth.range + CLUSTER_METRES || outside_picture(site.foot, CLUSTER_METRES) {
        return site;
    }
    let kind = node_surface(nearest_node(site.leaf, unit), leaves[site.leaf].slot).x & TYPE_MASK;
    site.crowns = crowns_about(site.leaf, unit);
    let community = community_of(kind, site.crowns, site.seed.bits);
    if community == COMMUNITY_NOTHING {
        return site;
    }
    site.cluster = cluster_of(site.seed, community);
    site.grows = site.cluster.lives;
    return site;
}

// What the year leaves of a member, 0…1.
fn grown_in_season(member: Member, height: f32, snow: f32) -> f32 {
    let herbs = foliage_at(GROUND_SEASON, height);
    let own = f32(member.bits & 0xffu) / 255.0;
    let green = herbs.leaves * (1.0 - herbs.turned);
    var grown = 1.0;
    if member.kind == KIND_FLOWER {
        // Most are over when half of the meadow has turned.
        grown = step(own, (1.8 * green) - 0.8);
    } else if member.kind == KIND_FERN {
        // Brown fronds lie down one after the other.
        grown = mix(0.45, 1.0, smoothstep(own * 0.7, (own * 0.7) + 0.3, herbs.leaves));
    } else if member.kind == KIND_GRASS {
        grown = mix(0.6, 1.0, herbs.leaves);
    }
    let deep = smoothstep(0.25 + (0.3 * own), 0.5 + (0.4 * own), snow);
    // What is low lies under the snow.
    let low = select(1.0, 1.0 - smoothstep(300.0, 700.0, f32(member.size)), member.kind == KIND_STONE);
    return grown * (1.0 - (deep * low));
}

fn placed_member(block: UndergrowthBlock, site: Site, member: Member, normal: vec3<f32>) -> Placed {
    var placed: Placed;
    placed.grown = 0.0;
    placed.unit = unit_of(block, member.place);
    placed.leaf = site.leaf;
    let within = placed.unit - leaves[site.leaf].grid_origin;
    if any(within >= vec2<u32>(leaves[site.leaf].grid_side)) {
        placed.leaf = leaf_index_at(placed.unit);
        if placed.leaf == EMPTY {
            return placed;
        }
    }
    let ground = drawn_ground(placed.leaf, placed.unit);
    if ground.x <= VOID_HEIGHT {
        return placed;
    }
    placed.height = ground.x;
    placed.foot = foot_of(block, member.place, ground.x);
    placed.away = length(placed.foot);
    if ground.y > CANOPY_FOOT && placed.away >= undergrowth.canopy_gone {
        return placed;
    }
    let size = f32(member.size) * SIZE_METRES;
    if outside_picture(placed.foot + vec3<f32>(0.0, 0.0, 0.5 * size), 1.4 * size) {
        return placed;
    }
    let kind = node_surface(nearest_node(placed.leaf, placed.unit), leaves[placed.leaf].slot).x & TYPE_MASK;
    if kind == TYPE_WATER || kind == TYPE_SNOW {
        return placed;
    }
    // Each ends at a distance of its own: the farther, the fewer.
    let jitter = f32((member.bits >> 8u) & 0xffffu) / 65535.0;
    var ranges = KIND_RANGES;
    var end = undergrowth.range * ranges[member.kind] * (1.0 - (RANGE_SPREAD * jitter * jitter));
    end = min(end, size / (LEAST_PIXELS * view.right.w));
    var grown = smoothstep(0.0, 1.0, saturate((end - placed.away) / (GROWTH_BAND * end)));
    grown *= smoothstep(NEAR_EYE.x, NEAR_EYE.y, placed.away);
    if WITH_SEASON {
        let snow = snow_on(ground.x, normal, vec3<f32>(0.0, 0.0, 1.0));
        grown *= grown_in_season(member, ground.x, snow);
    }
    placed.grown = select(grown, 0.0, grown < 0.02);
    return placed;
}

// Normal of the ground at a site.
fn ground_normal(site: Site, unit: vec2<u32>) -> vec3<f32> {
    let leaf = ground_leaf(site.leaf);
    let metres = leaves[site.leaf].cell_metres;
    let reach = vec2<i32>(max(round(vec2<f32>(2.0) / metres), vec2<f32>(1.0)));
    let node = nearest_node(site.leaf, unit);
    let east = bare_node(node + vec2<i32>(reach.x, 0), leaf.slot).x - bare_node(node - vec2<i32>(reach.x, 0), leaf.slot).x;
    let south = bare_node(node + vec2<i32>(0, reach.y), leaf.slot).x - bare_node(node - vec2<i32>(0, reach.y), leaf.slot).x;
    let slope = clamp(vec2<f32>(east, south) / (2.0 * vec2<f32>(reach) * metres), vec2<f32>(-3.0), vec2<f32>(3.0));
    return normalize(vec3<f32>(-slope.x, slope.y, 1.0));
}

fn bin_of(kind: u32, away: f32) -> u32 {
    return select(kind, FAR_GRASS, kind == KIND_GRASS && away >= NEAR_GRASS);
}

var<workgroup> by_bin: array<atomic<u32>, 8>;

@compute @workgroup_size(64)
fn decide_plants(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let block = blocks[group.x];
    let site = site_of(block, local);
    var mask = vec2<u32>(0u);
    if site.grows {
        var normal = vec3<f32>(0.0, 0.0, 1.0);
        if WITH_SEASON {
            normal = ground_normal(site, unit_of(block, vec2<i32>(site.seed.place)));
        }
        for (var number = 0u; number < site.cluster.members; number++) {
            let member = member_of(site.seed, site.cluster, number);
            let placed = placed_member(block, site, member, normal);
            if placed.grown > 0.0 {
                let bit = 1u << (number & 31u);
                mask |= select(vec2<u32>(bit, 0u), vec2<u32>(0u, bit), number >= 32u);
                atomicAdd(&by_bin[bin_of(member.kind, placed.away)], 1u);
            }
        }
        if any(mask != vec2<u32>(0u)) {
            atomicAdd(&by_bin[PLANT_BINS], 1u);
        }
    }
    chosen[(group.x * PLANT_THREADS) + local] = mask;
    workgroupBarrier();
    if local <= PLANT_BINS {
        counts[(local * undergrowth.blocks) + group.x] = atomicLoad(&by_bin[local]);
    }
}

var<workgroup> part_sums: array<u32, PLANT_SCAN_THREADS>;

// One work group: each thread sums its part, the parts' sums are summed up, and each writes sums of what lies before.
@compute @workgroup_size(256)
fn scan_plants(@builtin(local_invocation_index) local: u32) {
    let length = (PLANT_BINS + 1u) * undergrowth.blocks;
    let part = (length + PLANT_SCAN_THREADS - 1u) / PLANT_SCAN_THREADS;
    let first = min(local * part, length);
    let end = min(first + part, length);
    var sum = 0u;
    for (var index = first; index < end; index++) {
        sum += counts[index];
    }
    part_sums[local] = sum;
    workgroupBarrier();
    for (var step = 1u; step < PLANT_SCAN_THREADS; step *= 2u) {
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
    // What finds no room is not drawn. (The last only counts metaseeds.)
    let room = arrayLength(&plants);
    if local < PLANT_BINS {
        let from_place = min(counts[local * undergrowth.blocks], room);
        drawn.draws[local].instance_count = min(counts[(local + 1u) * undergrowth.blocks], room) - from_place;
    }
    if local == 0u {
        drawn.draws[PLANT_BINS].instance_count = part_sums[PLANT_SCAN_THREADS - 1u] - counts[PLANT_BINS * undergrowth.blocks];
        // What is the same for all: it reaches no farther than some dozens of metres.
        let cosine = view.sun.z;
        let air = air_along(normalize(vec3<f32>(view.forward.xy, 0.0) + vec3<f32>(1e-6)), 0.0, 100.0, 4u);
        drawn.light.sun = vec4<f32>(sun_transmittance(view.up.w, cosine), exposure());
        drawn.light.sky = vec4<f32>(sky_ambient(cosine), 0.0);
        drawn.light.air = vec4<f32>(air.inscatter, luminance(air.transmittance));
    }
}

// What a thread has in each bin, a byte each.
var<workgroup> bins_of: array<vec2<u32>, PLANT_THREADS>;

fn is_chosen(mask: vec2<u32>, number: u32) -> bool {
    return ((select(mask.x, mask.y, number >= 32u) >> (number & 31u)) & 1u) == 1u;
}

@compute @workgroup_size(64)
fn scatter_plants(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let block = blocks[group.x];
    let mask = chosen[(group.x * PLANT_THREADS) + local];
    var site: Site;
    var normal = vec3<f32>(0.0, 0.0, 1.0);
    var own = vec2<u32>(0u);
    if any(mask != vec2<u32>(0u)) {
        site = site_of(block, local);
        normal = ground_normal(site, unit_of(block, vec2<i32>(site.seed.place)));
        for (var number = 0u; number < site.cluster.members; number++) {
            if is_chosen(mask, number) {
                let member = member_of(site.seed, site.cluster, number);
                let bin = bin_of(member.kind, placed_member(block, site, member, normal).away);
                let one = 1u << (8u * (bin & 3u));
                own += select(vec2<u32>(one, 0u), vec2<u32>(0u, one), bin >= 4u);
            }
        }
    }
    bins_of[local] = own;
    workgroupBarrier();
    if all(mask == vec2<u32>(0u)) {
        return;
    }
    var next: array<u32, PLANT_BINS>;
    for (var bin = 0u; bin < PLANT_BINS; bin++) {
        var before = counts[(bin * undergrowth.blocks) + group.x];
        for (var other = 0u; other < local; other++) {
            let word = select(bins_of[other].x, bins_of[other].y, bin >= 4u);
            before += (word >> (8u * (bin & 3u))) & 0xffu;
        }
        next[bin] = before;
    }
    let room = arrayLength(&plants);
    let light = site_light(block, site, normal);
    for (var number = 0u; number < site.cluster.members; number++) {
        if is_chosen(mask, number) {
            let member = member_of(site.seed, site.cluster, number);
            let placed = placed_member(block, site, member, normal);
            let bin = bin_of(member.kind, placed.away);
            let place = next[bin];
            next[bin] = place + 1u;
            if place < room {
                let seed = (group.x << 12u) | (local << 6u) | number;
                plants[place] = plant_of(site, member, placed, light, seed);
            }
        }
    }
}
