//! Where a grid's samples stand in the trees' integer units, and which patch of forest a place is in.

use super::crs::Crs;
use super::growth::metres_of_degrees;
use super::{RequestCrs, SampleGrid};
use treeline_core::geodesy;
use treeline_core::hash::hash;
use treeline_core::seeds::place::{TURN_BITS, latitude_from_y, x_from_longitude, y_from_latitude};

/// Side of the squares that have a patch each: 2^12 units, 38 m from north to south.
const PATCH_BITS: u32 = 12;
/// Side of the squares that are displaced together, which frays the patches' edges: 2^9 units, 4.8 m.
const FRAY_BITS: u32 = 9;
/// Displacement at most: a quarter of a patch's side, either way.
const FRAY: i64 = 1 << (PATCH_BITS - 2);

/// Places of the samples of a grid.
pub enum Places {
    /// Meridians for columns and parallels for rows.
    Separable {
        /// Units east of 180° W, by column.
        xs: Vec<i64>,
        /// Units south of the north pole, by row.
        ys: Vec<i64>,
    },
    /// Each its own.
    Scattered {
        /// Units, row-major.
        places: Vec<(i64, i64)>,
        /// Columns.
        width: usize,
        /// Distance between samples, metres.
        step: f64,
    },
}

impl Places {
    /// The places of a grid; a place that its system does not have is at 0.
    pub fn of(grid: &SampleGrid) -> Self {
        // To the nearest unit: the centres of cells are whole units, whatever way they were reckoned.
        let x = |longitude: f64| x_from_longitude(longitude).round() as i64;
        let y = |latitude: f64| y_from_latitude(latitude).round() as i64;
        match grid {
            SampleGrid::Lattice(window) => Self::Separable {
                xs: (0..i64::from(window.width))
                    .map(|column| x(window.longitude(window.first_column + column)))
                    .collect(),
                ys: (0..i64::from(window.height))
                    .map(|row| y(window.latitude(window.first_row + row)))
                    .collect(),
            },
            SampleGrid::Box { crs, west, south, east, north, width, height } => {
                let along = |count: u32, from: f64, to: f64| {
                    (0..count)
                        .map(move |index| from + (f64::from(index) + 0.5) * (to - from) / f64::from(count))
                };
                let (columns, rows) = (along(*width, *west, *east), along(*height, *north, *south));
                match crs {
                    RequestCrs::Geographic => {
                        Self::Separable { xs: columns.map(x).collect(), ys: rows.map(y).collect() }
                    }
                    RequestCrs::WebMercator => Self::Separable {
                        xs: columns
                            .map(|east| x(geodesy::geographic_from_web_mercator(east, 0.0).0))
                            .collect(),
                        ys: rows
                            .map(|north| y(geodesy::geographic_from_web_mercator(0.0, north).1))
                            .collect(),
                    },
                    RequestCrs::Projected(epsg) => {
                        let crs = Crs::from_epsg(*epsg).ok();
                        let place = |east: f64, north: f64| {
                            let found = crs.as_ref().and_then(|crs| crs.to_geographic(east, north).ok());
                            found.map_or((0, 0), |(longitude, latitude)| (x(longitude), y(latitude)))
                        };
                        Self::Scattered {
                            places: rows
                                .flat_map(|north| columns.clone().map(move |east| (east, north)))
                                .map(|(east, north)| place(east, north))
                                .collect(),
                            width: *width as usize,
                            step: (north - south) / f64::from((*height).max(1)),
                        }
                    }
                }
            }
        }
    }

    /// Units of a sample.
    pub fn units(&self, column: usize, row: usize) -> (i64, i64) {
        match self {
            Self::Separable { xs, ys } => (xs[column], ys[row]),
            Self::Scattered { places, width, .. } => places[row * width + column],
        }
    }

    /// Latitude of a sample, degrees.
    pub fn latitude(&self, column: usize, row: usize) -> f64 {
        latitude_from_y(self.units(column, row).1 as f64)
    }

    /// Distance between samples along a row, on the equator, and between rows, metres. A lattice has the same
    /// in all its windows.
    pub fn step_metres(&self) -> (f64, f64) {
        let degrees = 360.0 / 4_294_967_296.0;
        let step = |line: &[i64]| match line {
            [first, second, ..] => metres_of_degrees((second - first).abs().max(1) as f64 * degrees),
            _ => 1.0,
        };
        match self {
            Self::Separable { xs, ys } => (step(xs), step(ys)),
            Self::Scattered { step, .. } => (step.abs().max(1e-3), step.abs().max(1e-3)),
        }
    }
}

/// The grid with `margin` samples more on every side.
pub fn with_margin(grid: &SampleGrid, margin: u32) -> SampleGrid {
    let mut wider = grid.clone();
    match &mut wider {
        SampleGrid::Lattice(window) => {
            window.first_column -= i64::from(margin);
            window.first_row -= i64::from(margin);
            window.width += 2 * margin;
            window.height += 2 * margin;
        }
        SampleGrid::Box { west, south, east, north, width, height, .. } => {
            let dx = (*east - *west) / f64::from((*width).max(1)) * f64::from(margin);
            let dy = (*north - *south) / f64::from((*height).max(1)) * f64::from(margin);
            (*west, *east, *south, *north) = (*west - dx, *east + dx, *south - dy, *north + dy);
            *width += 2 * margin;
            *height += 2 * margin;
        }
    }
    wider
}

/// A hash of the patch that a place is in: all of its 32 bits are even over patches.
pub fn patch_hash(x: i64, y: i64, seed: u32) -> u32 {
    // Meridians draw together: beyond 60° a square is twice as wide in units, and so on.
    let latitude = latitude_from_y(y as f64).abs();
    let wide = match latitude {
        latitude if latitude < 60.0 => 0,
        latitude if latitude < 75.5 => 1,
        _ => 2,
    };
    // A turn further on is the same place.
    let turn = |column: i64, bits: u32| (column & ((1 << (TURN_BITS - bits)) - 1)) as u32;
    let fray =
        hash(turn(x >> (FRAY_BITS + wide), FRAY_BITS + wide), (y >> FRAY_BITS) as u32, seed ^ 0x0066_7261);
    let shift = |bits: u32| i64::from(bits & 0xffff) * 2 * FRAY / 65_536 - FRAY;
    let (x, y) = (x + (shift(fray) << wide), y + shift(fray >> 16));
    // The nearest of the centres of the four squares around; each keeps to the middle half of its square.
    let (across, down) = (PATCH_BITS + wide, PATCH_BITS);
    let (west, north) = ((x - (1 << (across - 1))) >> across, (y - (1 << (down - 1))) >> down);
    let mut nearest = (i64::MAX, 0);
    for (column, row) in [(west, north), (west + 1, north), (west, north + 1), (west + 1, north + 1)] {
        let own = hash(turn(column, across), row as u32, seed);
        let place = |first: i64, bits: u32, jitter: u32| {
            (first << bits) + (1 << (bits - 2)) + ((i64::from(jitter & 0xff) << (bits - 1)) >> 8)
        };
        let (dx, dy) = ((place(column, across, own) - x) >> wide, place(row, down, own >> 8) - y);
        let distance = dx * dx + dy * dy;
        if distance < nearest.0 {
            nearest = (distance, hash(own, 1, seed));
        }
    }
    nearest.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TURN: i64 = 1 << TURN_BITS;

    proptest! {
        #[test]
        fn a_turn_further_is_the_same_patch(x in 0..TURN, y in 0..TURN / 2, seed: u32) {
            prop_assert_eq!(patch_hash(x, y, seed), patch_hash(x + TURN, y, seed));
            prop_assert_eq!(patch_hash(x, y, seed), patch_hash(x - TURN, y, seed));
        }
    }

    #[test]
    fn patches_are_patches_and_even_in_number() {
        let (x, y) = (2_300_000_000, 500_000_000);
        // Cells of 4.8 m over 5 km.
        let side = 1024_i64;
        let of = |i: i64, j: i64| patch_hash(x + 512 * i, y + 512 * j, 1) >> 16;
        let (mut alike, mut low) = (0_u32, 0_u32);
        for j in 0..side {
            for i in 0..side {
                alike += u32::from(of(i, j) == of(i + 1, j));
                low += u32::from(of(i, j) < 65_536 * 3 / 10);
            }
        }
        let cells = (side * side) as f64;
        let (alike, low) = (f64::from(alike) / cells, f64::from(low) / cells);
        assert!((0.6..0.95).contains(&alike), "neighbours are alike: {alike}");
        assert!((low - 0.3).abs() < 0.01, "a share of 0.3 is {low}");
    }
}
