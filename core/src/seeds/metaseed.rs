//! Metaseeds: seeds of small communities of plants (Mantler & Jeschke's "clusters and metaseeds"), near the eye alone.
//!
//! A cell of the trees' pattern is cut three times as fine, into sub-cells 2.1 m high and as wide; each has one
//! metaseed, by the same jitter and ranks. A metaseed grows a *cluster*: 8 to 40 members about it, their kind, place,
//! size and rotation by 32-bit integers from its hash, the same on CPU and GPU. What community it is the ground says,
//! and which of a community's themes patches some 8 m wide, whose borders are frayed.

use super::pattern::{CELL_UNITS, CellRow, candidate_of, cosine, pattern_of_cell};
use super::place::UNIT_METRES;
use crate::hash::{hash, mix};
use crate::layer::SurfaceType;

/// Sub-cells of a metaseed are so many times as fine as a tree's.
pub const FINENESS: u32 = 3;
/// Rows of metaseeds in a cell.
pub const ROWS: u32 = FINENESS * super::pattern::ROWS;
/// Mean distance of neighbouring metaseeds, metres.
pub const SPACING_METRES: f64 = CELL_UNITS as f64 * UNIT_METRES / ROWS as f64;
/// Members of a cluster at most.
pub const MOST_MEMBERS: u32 = 40;
/// Farthest that a member stands from its metaseed to the east, west, north or south, units of a meridian.
pub const REACH_UNITS: u32 = 205;
/// Kinds of members.
pub const KINDS: usize = 6;
/// Metres of a unit of size.
pub const SIZE_METRES: f64 = 1.0 / 1024.0;

/// Makes the patterns of metaseeds others than those of the trees.
const OWN_PATTERNS: u32 = 0x6d65_7461;
/// Of nine places about a metaseed: from so many under crowns on it grows what grows in a wood, whatever its hash.
const CLOSED: u32 = 4;
/// Ranks below which a metaseed of a community lives, of 65,536.
const SHARES: [u32; 5] = [0, 58_000, 65_536, 56_000, 40_000];
/// Themes of a community.
const THEMES: usize = 8;

/// What a member of a cluster is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Kind {
    /// A tuft of grass.
    Grass = 0,
    /// Flowers on their stems.
    Flower = 1,
    /// A fern.
    Fern = 2,
    /// A dwarf shrub.
    Shrub = 3,
    /// A stone.
    Stone = 4,
    /// Dead wood that lies on the ground.
    Wood = 5,
}

impl Kind {
    /// All, by their number.
    pub const ALL: [Self; KINDS] =
        [Self::Grass, Self::Flower, Self::Fern, Self::Shrub, Self::Stone, Self::Wood];
    /// Least size and how much more the largest has, 1/1024 m: height of what stands, length of what lies.
    const SIZES: [[u32; 2]; KINDS] =
        [[190, 300], [200, 240], [340, 560], [200, 360], [80, 620], [600, 2_300]];

    fn of_letter(letter: u8) -> u32 {
        match letter {
            b'g' => Self::Grass as u32,
            b'b' => Self::Flower as u32,
            b'f' => Self::Fern as u32,
            b's' => Self::Shrub as u32,
            b'o' => Self::Stone as u32,
            _ => Self::Wood as u32,
        }
    }
}

/// What grows at a metaseed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Community {
    /// Nothing: water, ice, no ground.
    Nothing = 0,
    /// Under crowns: ferns, dwarf shrubs, dead wood, stones with moss.
    Wood = 1,
    /// Grass and flowers.
    Meadow = 2,
    /// Thinner grass, and dwarf shrubs.
    Open = 3,
    /// Stones, and what grows between them.
    Rock = 4,
}

impl Community {
    /// By the surface type at a metaseed and the places under crowns of the nine about it (3.5 m apart).
    pub fn of(surface: u32, crowns: u32, bits: u32) -> Self {
        const WATER: u32 = SurfaceType::Water as u32;
        const ROCK: u32 = SurfaceType::Rock as u32;
        const SNOW: u32 = SurfaceType::Snow as u32;
        const GRASS: u32 = SurfaceType::Grass as u32;
        const CANOPY: u32 = SurfaceType::Canopy as u32;
        if surface == WATER || surface == SNOW {
            return Self::Nothing;
        }
        if surface == CANOPY || crowns * (8 / CLOSED) > bits >> 29 {
            return Self::Wood;
        }
        match surface {
            ROCK => Self::Rock,
            GRASS => Self::Meadow,
            _ => Self::Open,
        }
    }
}

/// A community's themes: members at least, how many more at most, and a letter of a kind for each sixteenth of them
/// (grass, `b`lossom, fern, shrub, st`o`ne, `w`ood).
const TABLE: [[(u32, u32, &[u8; 16]); THEMES]; 4] = [
    [
        (20, 12, b"fffffffggggggsso"),
        (26, 14, b"ssssssssggggggfw"),
        (14, 10, b"gggggggggsssffwo"),
        (26, 14, b"ggggggggggggffsb"),
        (20, 12, b"ffffgggggggsssgw"),
        (24, 14, b"sssssssgggggggfo"),
        (26, 14, b"gggggggggggggfsg"),
        (16, 12, b"fffgggggggsssgow"),
    ],
    [
        (34, 6, b"gggggggggggggggb"),
        (32, 8, b"gggggggggggbbbbb"),
        (34, 6, b"gggggggggggggbbb"),
        (34, 6, b"ggggggggggggggbb"),
        (30, 10, b"gggggggggggbbbbs"),
        (34, 6, b"gggggggggggggggg"),
        (34, 6, b"ggggggggggggbbbb"),
        (30, 8, b"gggggggggggggggb"),
    ],
    [
        (30, 10, b"gggggggggggggggg"),
        (28, 12, b"ggggggggggggggbb"),
        (26, 10, b"ggggggggggggggss"),
        (30, 10, b"gggggggggggggggb"),
        (24, 12, b"gggggggggggggggo"),
        (26, 12, b"gggggggggggggssb"),
        (30, 10, b"gggggggggggggggg"),
        (22, 12, b"ggggggggggsssssg"),
    ],
    [
        (10, 10, b"oooooooooooooogg"),
        (10, 8, b"oooooooooooooooo"),
        (16, 12, b"ooooooggggggggsb"),
        (10, 8, b"oooooooooooogggg"),
        (14, 12, b"ooooooogggggggsb"),
        (10, 8, b"oooooooooooooooo"),
        (10, 10, b"ooooooooooooggbb"),
        (14, 12, b"oooooggggggggsso"),
    ],
];

/// A metaseed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Metaseed {
    /// Units east of its cell's west edge.
    pub x: u32,
    /// Units south of its cell's north edge.
    pub y: u32,
    /// Below 65,536: the share of metaseeds from which on it lives.
    pub rank: u32,
    /// Its hash, from which all of its cluster comes.
    pub bits: u32,
    /// Of its theme, 0 … 7.
    pub theme: u32,
    /// 256 units to the north are so many to the east, over 256: one over the cosine.
    pub stretch: u32,
}

/// Columns of metaseeds in a cell of a row of cells; 0 near the poles.
pub fn columns(row: &CellRow) -> u32 {
    FINENESS * row.columns
}

/// The metaseed of sub-cell (i, j) of a cell; i < [`columns`], j < [`ROWS`].
pub fn metaseed([column, row]: [u32; 2], [i, j]: [u32; 2], scene_seed: u32) -> Metaseed {
    let pattern = pattern_of_cell(column, row, scene_seed ^ OWN_PATTERNS);
    let cells = CellRow::new(row);
    let candidate = candidate_of(pattern, [columns(&cells), ROWS], i, j);
    let place = [column, row].map(|cell| cell.wrapping_mul(CELL_UNITS));
    let place = [place[0].wrapping_add(candidate.x), place[1].wrapping_add(candidate.y)];
    let bits = hash(place[0], place[1], scene_seed ^ OWN_PATTERNS);
    // Patches of 4 × 4 sub-cells, each metaseed looking up to three sub-cells aside.
    let patch = [(i + (bits & 3)) >> 2, (j + (bits >> 2 & 3)) >> 2];
    let theme = hash(patch[0], patch[1], u32::from(pattern) | column << 16 ^ row << 8) & 7;
    Metaseed {
        x: candidate.x,
        y: candidate.y,
        rank: candidate.rank,
        bits,
        theme,
        stretch: (1 << 24) / cosine(row).max(1 << 12),
    }
}

/// What grows about a metaseed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cluster {
    /// What it is.
    pub community: Community,
    /// Members.
    pub members: u32,
    /// 0 … 255: how well it does.
    pub vigour: u32,
    /// Kinds of the sixteenths of its members, four bits each.
    kinds: [u32; 2],
}

/// The cluster of a metaseed, where it lives.
pub fn cluster(seed: &Metaseed, community: Community) -> Option<Cluster> {
    if seed.rank >= SHARES[community as usize] {
        return None;
    }
    let [least, more, low, high] = theme(community, seed.theme);
    let vigour = seed.bits >> 8 & 0xff;
    Some(Cluster { community, members: least + ((more * vigour) >> 8), vigour, kinds: [low, high] })
}

/// A row of the table as the shader has it: members at least, how many more, and two words of kinds.
pub fn theme(community: Community, theme: u32) -> [u32; 4] {
    let (least, more, letters) = TABLE[community as usize - 1][theme as usize];
    let word =
        |letters: &[u8]| letters.iter().rev().fold(0, |word, &letter| word << 4 | Kind::of_letter(letter));
    [least, more, word(&letters[..8]), word(&letters[8..])]
}

/// A member of a cluster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Member {
    /// What it is.
    pub kind: Kind,
    /// Units east of its cell's west edge; may lie outside it.
    pub x: i32,
    /// Units south of its cell's north edge.
    pub y: i32,
    /// 1/1024 m.
    pub size: u32,
    /// 1/256 of a turn.
    pub rotation: u8,
    /// Its own, for all that is jittered.
    pub bits: u32,
}

/// Member `number` of a cluster.
pub fn member(seed: &Metaseed, cluster: &Cluster, number: u32) -> Member {
    let bits = hash(number, seed.bits, 17);
    // The two-dimensional golden ratio (M. Roberts) in 1/65536, from a place of the cluster's own: evenly spread
    // whatever the number of members; then a jitter.
    let along = [49_472, 37_345].map(|step: u32| number.wrapping_mul(step));
    let u = along[0].wrapping_add(seed.bits & 0xffff).wrapping_add(bits & 0xfff) & 0xffff;
    let v = along[1].wrapping_add(seed.bits >> 16).wrapping_add(bits >> 12 & 0xfff) & 0xffff;
    let [u, v] = [u, v].map(|place| place as i32 - (1 << 15));
    let reach = (REACH_UNITS * seed.stretch) >> 8;
    let slot = mix(bits ^ 0x9e37_79b9);
    let kind = Kind::ALL[(cluster.kinds[(slot >> 3 & 1) as usize] >> (4 * (slot & 7)) & 7) as usize];
    Member {
        kind,
        x: seed.x as i32 + ((u * reach as i32) >> 15),
        y: seed.y as i32 + ((v * REACH_UNITS as i32) >> 15),
        size: size(kind, cluster, slot >> 8 & 0xff),
        rotation: (slot >> 16) as u8,
        bits,
    }
}

/// Size of a member, 1/1024 m; `draw`: 0 the smallest of its kind, 255 the largest.
fn size(kind: Kind, cluster: &Cluster, draw: u32) -> u32 {
    let [least, more] = Kind::SIZES[kind as usize];
    let thin = cluster.community != Community::Meadow;
    match kind {
        // Many small ones, few large ones.
        Kind::Stone | Kind::Wood => least + ((more * ((draw * draw) >> 8)) >> 8),
        Kind::Grass | Kind::Flower if thin => (own_size(least, more, cluster, draw) * 3) >> 2,
        _ => own_size(least, more, cluster, draw),
    }
}

fn own_size(least: u32, more: u32, cluster: &Cluster, draw: u32) -> u32 {
    ((least + ((more * draw) >> 8)) * (176 + ((80 * cluster.vigour) >> 8))) >> 8
}

#[cfg(test)]
#[path = "metaseed_tests.rs"]
mod tests;
