//! Candidates: where trees may stand, before anything is known of the ground.

use super::place::TURN_BITS;
use crate::hash::{hash, mix, pattern_index};

/// Matrix level whose tiles are the cells of the pattern: 152.9 m from north to south.
pub const LEVEL: u8 = 17;
/// Units along a cell's side.
pub const CELL_UNITS: u32 = 1 << (TURN_BITS - 1 - LEVEL as u32);
/// Rows of sub-cells in a cell.
pub const ROWS: u32 = 24;
/// Candidates per square kilometre before thinning, at any latitude.
pub const CANDIDATES_PER_KM2: f64 = {
    let metres = CELL_UNITS as f64 * super::place::UNIT_METRES / ROWS as f64;
    1.0e6 / (metres * metres)
};
/// Rank of a candidate: 0 lives wherever anything does, the last only where every candidate does.
pub const RANKS: u32 = 1 << 16;

/// A row of cells of the matrix: what depends on latitude alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellRow {
    /// Row of [`LEVEL`].
    pub row: u32,
    /// Columns of sub-cells in a cell, 0 near the poles.
    pub columns: u32,
    /// What makes the density the same for every number of columns: width of a sub-cell over its
    /// height, in 1/16384.
    pub aspect: u32,
}

impl CellRow {
    /// The row; beyond the matrix it has no columns.
    pub fn new(row: u32) -> Self {
        let cosine = cosine(row);
        let columns = (ROWS * cosine + (1 << 15)) >> 16;
        if columns < 2 {
            return Self { row, columns: 0, aspect: 0 };
        }
        Self { row, columns, aspect: (ROWS * cosine / columns) >> 2 }
    }
}

/// Cosine of the latitude of the middle of a row of cells, in 1/65536, by a polynomial of sixth
/// degree in integers (error below 1e-4); 0 beyond the matrix.
///
/// The ellipsoid's flattening is left out: density and squareness of sub-cells are off by up to 0.7 %.
pub fn cosine(row: u32) -> u32 {
    let rows = 1_u32 << LEVEL;
    if row >= rows {
        return 0;
    }
    // Distance from the equator in 1/65536 of a quarter turn.
    let angle = (2 * row + 1).abs_diff(rows) >> 1;
    let square = (angle * angle) >> 16;
    let sum = 16_561 - ((square * 1_255) >> 16);
    let sum = 80_842 - ((square * sum) >> 16);
    65_536 - (((square >> 1) * sum) >> 15)
}

/// The pattern of a cell of [`LEVEL`] in a scene, 1 … 255. Columns wrap around the Earth.
pub fn pattern_of_cell(column: u32, row: u32, scene_seed: u32) -> u8 {
    pattern_index(column & ((2 << LEVEL) - 1), row, scene_seed)
}

/// A place where a tree may stand, and what it is like if it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// Units east of the cell's west edge, below [`CELL_UNITS`].
    pub x: u32,
    /// Units south of the cell's north edge, below [`CELL_UNITS`].
    pub y: u32,
    /// Below [`RANKS`]: the share of trees from which on it stands.
    pub rank: u32,
    /// 0 the smallest of its stand, 255 the tallest.
    pub size: u8,
    /// Turn about its axis, 1/256 of a turn.
    pub rotation: u8,
}

/// The candidate of sub-cell (i, j) of a cell with `columns` columns; i < columns, j < [`ROWS`].
///
/// It stands in the middle three quarters of its sub-cell's height and width, and every other row is
/// shifted by a quarter of the width: two candidates are never closer than a quarter of a sub-cell.
pub fn candidate(pattern: u8, columns: u32, i: u32, j: u32) -> Candidate {
    candidate_of(pattern, [columns, ROWS], i, j)
}

/// The same of a cell that is cut into other columns and rows, 96 of each at most.
pub fn candidate_of(pattern: u8, [columns, rows]: [u32; 2], i: u32, j: u32) -> Candidate {
    let pattern = u32::from(pattern);
    let bits = hash(i, j, pattern);
    let [u, v] = jittered(bits, i, j);
    let more = mix(bits ^ 0xa511_e9b3);
    Candidate {
        x: (u << 2) / columns,
        y: (v << 2) / rows,
        rank: rank(pattern, i, j, more & 0x3ff),
        size: (bits >> 24) as u8,
        rotation: (more >> 24) as u8,
    }
}

/// Where the candidate of a sub-cell stands, in 1/4096 of a sub-cell from the cell's north-west corner:
/// the same whatever the number of columns.
pub fn sub_cell_place(pattern: u8, i: u32, j: u32) -> [u32; 2] {
    jittered(hash(i, j, u32::from(pattern)), i, j)
}

fn jittered(bits: u32, i: u32, j: u32) -> [u32; 2] {
    let (jitter_x, jitter_y) = (bits & 0xfff, bits >> 12 & 0xfff);
    let stagger = (j & 1) << 10;
    [(i << 12) + stagger + ((jitter_x * 3) >> 2), (j << 12) + (1 << 9) + ((jitter_y * 3) >> 2)]
}

/// Three base-4 digits, then ten random bits: of every 2 × 2 sub-cells one has each first digit, of
/// every 2 × 2 of those one each second digit, and so on, so that any share is spread evenly.
fn rank(pattern: u32, i: u32, j: u32, random: u32) -> u32 {
    let digit = |scale: u32| {
        let scramble = hash(i >> (scale + 1), j >> (scale + 1), pattern | (scale + 1) << 8);
        let place = (i >> scale & 1) | (j >> scale & 1) << 1;
        // The second to come is the diagonal neighbour of the first; then one of the other two.
        match place ^ (scramble & 3) {
            0 => 0,
            3 => 1,
            other => 2 + ((other & 1) ^ (scramble >> 2 & 1)),
        }
    };
    digit(0) << 14 | digit(1) << 12 | digit(2) << 10 | random
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_integer_cosine_is_the_cosine() {
        for row in (0..1_u32 << LEVEL).step_by(97).chain([0, (1 << LEVEL) - 1]) {
            let latitude = 90.0 - 180.0 * (f64::from(row) + 0.5) / f64::from(1_u32 << LEVEL);
            let error = f64::from(cosine(row)) / 65_536.0 - latitude.to_radians().cos();
            assert!(error.abs() < 1.0e-4, "row {row}: {error}");
        }
    }

    #[test]
    fn sub_cells_are_square_and_the_poles_are_bare() {
        for row in 0..1_u32 << LEVEL {
            let cells = CellRow::new(row);
            if cells.columns > 0 {
                let aspect = f64::from(cells.aspect) / 16_384.0;
                assert!((aspect - 1.0).abs() <= 0.5 / f64::from(cells.columns) + 1e-3, "row {row}: {aspect}");
            } else {
                let latitude = 90.0 - 180.0 * f64::from(row) / f64::from(1_u32 << LEVEL);
                assert!(latitude.abs() > 86.4, "{latitude}");
            }
        }
        assert_eq!(CellRow::new(1 << 16).columns, ROWS);
        assert_eq!(CellRow::new(0).columns, 0);
        assert_eq!(CellRow::new(u32::MAX).columns, 0);
    }

    #[test]
    fn each_share_takes_the_same_from_every_square() {
        for pattern in [1_u8, 77, 255] {
            for (i, j) in [(0, 0), (8, 16), (4, 20)] {
                let mut ranks: Vec<u32> = (0..64)
                    .map(|n| candidate(pattern, 24, (i & !7) + n % 8, (j & !7) + n / 8).rank >> 10)
                    .collect();
                ranks.sort_unstable();
                assert_eq!(ranks, (0..64).collect::<Vec<_>>());
            }
        }
    }

    proptest! {
        #[test]
        fn candidates_stay_in_their_sub_cells(pattern in 1_u8..=255, columns in 2_u32..=24, i in 0_u32..24, j in 0_u32..ROWS) {
            let i = i % columns;
            let place = candidate(pattern, columns, i, j);
            prop_assert!(place.x >= i * CELL_UNITS / columns && place.x <= (i + 1) * CELL_UNITS / columns);
            prop_assert!(place.y >= j * CELL_UNITS / ROWS && place.y < (j + 1) * CELL_UNITS / ROWS);
            prop_assert!(place.x < CELL_UNITS && place.rank < RANKS);
        }
    }
}
