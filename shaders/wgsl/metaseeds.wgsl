// Metaseeds and their clusters: `core::seeds::metaseed` in the same 32-bit integers. A test compares every bit.
// Needs `seeds`.

const METASEED_FINENESS: u32 = 3u;
const METASEED_ROWS: u32 = 72u;
const OWN_PATTERNS: u32 = 0x6d657461u;
const MOST_MEMBERS: u32 = 40u;
// Units of a meridian by which a member is at most beside its metaseed.
const MEMBER_REACH: i32 = 205;
// Crowns about a metaseed count double: four of nine are a closed wood.
const CLOSED_SHARE: u32 = 2u;

const COMMUNITY_NOTHING: u32 = 0u;
const COMMUNITY_WOOD: u32 = 1u;
const COMMUNITY_MEADOW: u32 = 2u;
const COMMUNITY_OPEN: u32 = 3u;
const COMMUNITY_ROCK: u32 = 4u;

const KIND_GRASS: u32 = 0u;
const KIND_FLOWER: u32 = 1u;
const KIND_FERN: u32 = 2u;
const KIND_SHRUB: u32 = 3u;
const KIND_STONE: u32 = 4u;
const KIND_WOOD: u32 = 5u;

struct Metaseed {
    // Place in its cell, units.
    place: vec2<u32>,
    rank: u32,
    bits: u32,
    theme: u32,
    // One over the cosine of the latitude, in 1/256.
    stretch: u32,
}

struct Cluster {
    lives: bool,
    community: u32,
    members: u32,
    vigour: u32,
    kinds: vec2<u32>,
}

struct Member {
    kind: u32,
    // Place in its cell, units; may lie outside it.
    place: vec2<i32>,
    // 1/1024 m.
    size: u32,
    rotation: u32,
    bits: u32,
}

fn metaseed_at(cell: vec2<u32>, sub_cell: vec2<u32>, columns: u32, scene_seed: u32) -> Metaseed {
    let pattern = pattern_of_cell(cell, scene_seed ^ OWN_PATTERNS);
    let candidate = seed_candidate(seed_pattern(pattern), sub_cell);
    let place = (candidate.place << vec2<u32>(2u)) / vec2<u32>(columns, METASEED_ROWS);
    let bits = hash_place(hash_stream(scene_seed ^ OWN_PATTERNS), (cell << vec2<u32>(SEED_CELL_BITS)) + place);
    let about = (sub_cell + vec2<u32>(bits & 3u, (bits >> 2u) & 3u)) >> vec2<u32>(2u);
    let stream = hash_stream(pattern | ((cell.x << 16u) ^ (cell.y << 8u)));
    let theme = hash_place(stream, about) & 7u;
    let stretch = (1u << 24u) / max(seed_cosine(cell.y), 1u << 12u);
    return Metaseed(place, candidate.rank, bits, theme, stretch);
}

// `ground`: the surface type there; `crowns`: of nine places about it, how many lie under crowns.
fn community_of(ground: u32, crowns: u32, bits: u32) -> u32 {
    // Water, snow.
    if ground == 2u || ground == 4u {
        return COMMUNITY_NOTHING;
    }
    // Canopy.
    if ground == 1u || (crowns * CLOSED_SHARE) > (bits >> 29u) {
        return COMMUNITY_WOOD;
    }
    if ground == 3u {
        return COMMUNITY_ROCK;
    }
    return select(COMMUNITY_OPEN, COMMUNITY_MEADOW, ground == 5u);
}

const METASEED_SHARES: array<u32, 5> = array<u32, 5>(0u, 58000u, 65536u, 56000u, 40000u);

fn cluster_of(seed: Metaseed, community: u32) -> Cluster {
    var shares = METASEED_SHARES;
    if seed.rank >= shares[community] {
        return Cluster(false, community, 0u, 0u, vec2<u32>(0u));
    }
    let theme = themes[((community - 1u) * 8u) + seed.theme];
    let vigour = (seed.bits >> 8u) & 0xffu;
    return Cluster(true, community, theme.x + ((theme.y * vigour) >> 8u), vigour, theme.zw);
}

const KIND_SIZES: array<vec2<u32>, 6> = array<vec2<u32>, 6>(
    vec2<u32>(190u, 300u), vec2<u32>(200u, 240u), vec2<u32>(340u, 560u),
    vec2<u32>(200u, 360u), vec2<u32>(80u, 620u), vec2<u32>(600u, 2300u),
);

fn member_size(kind: u32, cluster: Cluster, draw: u32) -> u32 {
    var sizes = KIND_SIZES;
    let own = sizes[kind];
    if kind >= KIND_STONE {
        return own.x + ((own.y * ((draw * draw) >> 8u)) >> 8u);
    }
    let size = ((own.x + ((own.y * draw) >> 8u)) * (176u + ((80u * cluster.vigour) >> 8u))) >> 8u;
    let thin = kind <= KIND_FLOWER && cluster.community != COMMUNITY_MEADOW;
    return select(size, (size * 3u) >> 2u, thin);
}

fn member_of(seed: Metaseed, cluster: Cluster, number: u32) -> Member {
    let bits = hash_place(hash_stream(17u), vec2<u32>(number, seed.bits));
    let along = (number * vec2<u32>(49472u, 37345u)) + vec2<u32>(seed.bits & 0xffffu, seed.bits >> 16u);
    let jittered = (along + vec2<u32>(bits & 0xfffu, (bits >> 12u) & 0xfffu)) & vec2<u32>(0xffffu);
    let apart = vec2<i32>(jittered) - vec2<i32>(32768);
    let reach = vec2<i32>(i32((u32(MEMBER_REACH) * seed.stretch) >> 8u), MEMBER_REACH);
    let slot = mix_bits(bits ^ 0x9e3779b9u);
    let word = select(cluster.kinds.x, cluster.kinds.y, ((slot >> 3u) & 1u) == 1u);
    let kind = (word >> (4u * (slot & 7u))) & 7u;
    let place = vec2<i32>(seed.place) + ((apart * reach) >> vec2<u32>(15u));
    let size = member_size(kind, cluster, (slot >> 8u) & 0xffu);
    return Member(kind, place, size, (slot >> 16u) & 0xffu, bits);
}
