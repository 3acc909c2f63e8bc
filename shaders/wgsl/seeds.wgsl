// Where trees may stand: `core::hash` and `core::seeds::pattern` in the same 32-bit integers. They are this
// module's twin: a test compares every bit.

// A cell of the pattern is a tile of matrix level 17: 2^14 units of place a side, 24 rows of sub-cells.
const SEED_LEVEL: u32 = 17u;
const SEED_CELL_BITS: u32 = 14u;
const SEED_ROWS: u32 = 24u;
const MINIMAL_STANDARD_MODULUS: u32 = 0x7fffffffu;

// What depends on the row of cells alone.
struct SeedRow {
    // Columns of sub-cells in a cell; 0 near the poles.
    columns: u32,
    // Width of a sub-cell over its height, in 1/16384.
    aspect: u32,
}

// A cell's pattern: what its hashes start from. x: candidates; y, z, w: the three digits of their ranks.
struct SeedPattern {
    streams: vec4<u32>,
}

struct SeedCandidate {
    // Place in the cell, in 1/4096 of a sub-cell.
    place: vec2<u32>,
    // Below 65536: the share of trees from which on it stands.
    rank: u32,
    // 0 the smallest of its stand, 255 the tallest.
    size: u32,
    // 1/256 of a turn.
    rotation: u32,
}

fn mix_bits(word: u32) -> u32 {
    var x = (word ^ (word >> 16u)) * 0x7feb352du;
    x = (x ^ (x >> 15u)) * 0x846ca68bu;
    return x ^ (x >> 16u);
}

// What hashes under a seed start from.
fn hash_stream(seed: u32) -> u32 {
    return mix_bits(seed ^ 0x9e3779b9u);
}

fn hash_place(stream: u32, place: vec2<u32>) -> u32 {
    return mix_bits(place.x + mix_bits(place.y + stream));
}

fn minimal_standard(state: u32) -> u32 {
    let low = 16807u * (state & 0xffffu);
    let high = 16807u * (state >> 16u);
    let sum = low + ((high & 0x7fffu) << 16u) + (high >> 15u);
    return select(sum, sum - MINIMAL_STANDARD_MODULUS, sum >= MINIMAL_STANDARD_MODULUS);
}

// Pattern of a cell, 1…255; columns wrap around the Earth.
fn pattern_of_cell(cell: vec2<u32>, scene_seed: u32) -> u32 {
    let wrapped = vec2<u32>(cell.x & ((2u << SEED_LEVEL) - 1u), cell.y);
    let start = (hash_place(hash_stream(scene_seed), wrapped) % (MINIMAL_STANDARD_MODULUS - 1u)) + 1u;
    return 1u + (((minimal_standard(start) >> 7u) * 255u) >> 24u);
}

fn seed_pattern(index: u32) -> SeedPattern {
    return SeedPattern(vec4<u32>(
        hash_stream(index),
        hash_stream(index | (1u << 8u)),
        hash_stream(index | (2u << 8u)),
        hash_stream(index | (3u << 8u)),
    ));
}

// Cosine of the latitude of a row of cells, in 1/65536; 0 beyond the matrix.
fn seed_cosine(row: u32) -> u32 {
    let rows = 1u << SEED_LEVEL;
    if row >= rows {
        return 0u;
    }
    let twice = (2u * row) + 1u;
    let angle = (max(twice, rows) - min(twice, rows)) >> 1u;
    let square = (angle * angle) >> 16u;
    let first = 16561u - ((square * 1255u) >> 16u);
    let sum = 80842u - ((square * first) >> 16u);
    return 65536u - (((square >> 1u) * sum) >> 15u);
}

fn seed_row(row: u32) -> SeedRow {
    let cosine = seed_cosine(row);
    let columns = ((SEED_ROWS * cosine) + (1u << 15u)) >> 16u;
    if columns < 2u {
        return SeedRow(0u, 0u);
    }
    return SeedRow(columns, ((SEED_ROWS * cosine) / columns) >> 2u);
}

// A base-4 digit of a rank: which of its 2 × 2 squares of 2^scale sub-cells comes how soon.
fn rank_digit(stream: u32, sub_cell: vec2<u32>, scale: u32) -> u32 {
    let scramble = hash_place(stream, sub_cell >> vec2<u32>(scale + 1u));
    let quarter = (sub_cell >> vec2<u32>(scale)) & vec2<u32>(1u);
    let place = (quarter.x | (quarter.y << 1u)) ^ (scramble & 3u);
    let later = 2u + ((place & 1u) ^ ((scramble >> 2u) & 1u));
    return select(select(later, 1u, place == 3u), 0u, place == 0u);
}

// The candidate of a sub-cell (column, row) of a cell.
fn seed_candidate(pattern: SeedPattern, sub_cell: vec2<u32>) -> SeedCandidate {
    let bits = hash_place(pattern.streams.x, sub_cell);
    let jitter = vec2<u32>(bits, bits >> 12u) & vec2<u32>(0xfffu);
    let shift = vec2<u32>((sub_cell.y & 1u) << 10u, 1u << 9u);
    let place = (sub_cell << vec2<u32>(12u)) + shift + ((jitter * 3u) >> vec2<u32>(2u));
    let more = mix_bits(bits ^ 0xa511e9b3u);
    let rank = (rank_digit(pattern.streams.y, sub_cell, 0u) << 14u)
        | (rank_digit(pattern.streams.z, sub_cell, 1u) << 12u)
        | (rank_digit(pattern.streams.w, sub_cell, 2u) << 10u)
        | (more & 0x3ffu);
    return SeedCandidate(place, rank, bits >> 24u, more >> 24u);
}

// A candidate's place in its cell in whole units of place (9.3 mm), as the server decides its ground.
fn seed_units(candidate: SeedCandidate, columns: u32) -> vec2<u32> {
    return (candidate.place << vec2<u32>(2u)) / vec2<u32>(columns, SEED_ROWS);
}
