//! Where samples stand: windows of a level's global lattice.
//!
//! Every sample of a level has one global index pair, the same from whichever tile it is seen, so
//! that what is computed from the indices alone is bit-identical in two tiles that share it.

use crate::tile::{self, CELLS, TileAddress};
use serde::{Deserialize, Serialize};

/// How samples stand on the matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Registration {
    /// On the corners of cells: a tile has 513 × 513, neighbours share their edge.
    Node,
    /// At the centres of cells: a tile has 512 × 512.
    Cell,
}

/// A rectangle of a level's lattice. Column indices run past the antimeridian and row indices past
/// the poles where a border does; positions there are still well defined (longitude goes on,
/// latitude beyond ±90 is reflected by whoever samples).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LatticeWindow {
    /// Matrix level.
    pub level: u8,
    /// Nodes or cells.
    pub registration: Registration,
    /// Global index of the first column, from 180° W.
    pub first_column: i64,
    /// Global index of the first row, from 90° N.
    pub first_row: i64,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl LatticeWindow {
    /// The window of a tile with a border of `border` samples on each side.
    pub fn of_tile(address: TileAddress, registration: Registration, border: u32) -> Self {
        let side = CELLS + 2 * border + u32::from(registration == Registration::Node);
        Self {
            level: address.level,
            registration,
            first_column: i64::from(address.column) * i64::from(CELLS) - i64::from(border),
            first_row: i64::from(address.row) * i64::from(CELLS) - i64::from(border),
            width: side,
            height: side,
        }
    }

    /// Distance between samples, degrees.
    pub fn step_degrees(&self) -> f64 {
        tile::span_degrees(self.level) / f64::from(CELLS)
    }

    fn offset(&self) -> f64 {
        if self.registration == Registration::Cell { 0.5 } else { 0.0 }
    }

    /// Longitude of a global column index, degrees (may lie outside ±180).
    pub fn longitude(&self, column: i64) -> f64 {
        -180.0 + (column as f64 + self.offset()) * self.step_degrees()
    }

    /// Latitude of a global row index, degrees (may lie outside ±90).
    pub fn latitude(&self, row: i64) -> f64 {
        90.0 - (row as f64 + self.offset()) * self.step_degrees()
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The box in degrees whose pixels, in the sense of WMS, are these samples: each sample at the
    /// centre of its pixel. For nodes it reaches half a sample beyond the outermost.
    pub fn pixel_box(&self) -> tile::GeographicBox {
        let half = 0.5 - self.offset();
        let step = self.step_degrees();
        let west = -180.0 + (self.first_column as f64 - half) * step;
        let north = 90.0 - (self.first_row as f64 - half) * step;
        tile::GeographicBox {
            west,
            south: north - f64::from(self.height) * step,
            east: west + f64::from(self.width) * step,
            north,
        }
    }

    /// The lattice window whose pixels fill the box, or `None` where the box lines up with no level's
    /// lattice (to a thousandth of a sample). The inverse of [`Self::pixel_box`].
    pub fn from_pixel_box(
        bounds: &tile::GeographicBox,
        width: u32,
        height: u32,
        registration: Registration,
    ) -> Option<Self> {
        if width == 0 || height == 0 {
            return None;
        }
        let step = (bounds.east - bounds.west) / f64::from(width);
        let step_y = (bounds.north - bounds.south) / f64::from(height);
        let level = (180.0 / f64::from(CELLS) / step).log2().round();
        if !(0.0..=f64::from(tile::MAXIMUM_LEVEL)).contains(&level) {
            return None;
        }
        let level = level as u8;
        let exact = tile::span_degrees(level) / f64::from(CELLS);
        let tolerance = 1e-3;
        if ((step - exact) / exact).abs() * f64::from(width) > tolerance
            || ((step_y - exact) / exact).abs() * f64::from(height) > tolerance
        {
            return None;
        }
        let half = if registration == Registration::Cell { 0.0 } else { 0.5 };
        let column = (bounds.west + 180.0) / exact + half;
        let row = (90.0 - bounds.north) / exact + half;
        if (column - column.round()).abs() > tolerance || (row - row.round()).abs() > tolerance {
            return None;
        }
        Some(Self {
            level,
            registration,
            first_column: column.round() as i64,
            first_row: row.round() as i64,
            width,
            height,
        })
    }

    /// The tile and border that this window is exactly, if any.
    pub fn as_tile(&self) -> Option<(TileAddress, u32)> {
        let core = CELLS + u32::from(self.registration == Registration::Node);
        if self.width != self.height || self.width < core || !(self.width - core).is_multiple_of(2) {
            return None;
        }
        let border = (self.width - core) / 2;
        let column = self.first_column + i64::from(border);
        let row = self.first_row + i64::from(border);
        if column < 0 || row < 0 || column % i64::from(CELLS) != 0 || row % i64::from(CELLS) != 0 {
            return None;
        }
        let column = u32::try_from(column / i64::from(CELLS)).ok()?;
        let row = u32::try_from(row / i64::from(CELLS)).ok()?;
        TileAddress::new(self.level, row, column).map(|address| (address, border))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_tile_is_found_again_from_its_box_as_it_is_spelt_in_a_url(
            level in 0_u8..=20, x in 0.0..1.0_f64, y in 0.0..1.0_f64, border in 0_u32..8, node in proptest::bool::ANY,
        ) {
            let registration = if node { Registration::Node } else { Registration::Cell };
            let address = TileAddress::new(level, (y * f64::from(tile::rows(level))) as u32, (x * f64::from(tile::columns(level))) as u32).unwrap();
            let window = LatticeWindow::of_tile(address, registration, border);
            let bounds = window.pixel_box();
            // Twelve decimals are what a careful foreign client writes.
            let spelt = |value: f64| format!("{value:.12}").parse::<f64>().unwrap();
            let bounds = tile::GeographicBox { west: spelt(bounds.west), south: spelt(bounds.south), east: spelt(bounds.east), north: spelt(bounds.north) };
            let found = LatticeWindow::from_pixel_box(&bounds, window.width, window.height, registration);
            prop_assert_eq!(found, Some(window));
            prop_assert_eq!(window.as_tile(), Some((address, border)));
        }

        #[test]
        fn a_node_of_a_parent_is_a_node_of_its_child(level in 0_u8..=20, column in 0_i64..1_000_000, row in 0_i64..1_000_000) {
            let window = |level| LatticeWindow { level, registration: Registration::Node, first_column: 0, first_row: 0, width: 1, height: 1 };
            prop_assert_eq!(window(level).longitude(column), window(level + 1).longitude(2 * column));
            prop_assert_eq!(window(level).latitude(row), window(level + 1).latitude(2 * row));
        }
    }

    #[test]
    fn a_world_wind_box_is_no_tile() {
        let bounds = tile::GeographicBox { west: 0.0, south: 0.0, east: 20.0, north: 20.0 };
        assert_eq!(LatticeWindow::from_pixel_box(&bounds, 512, 512, Registration::Cell), None);
    }
}
