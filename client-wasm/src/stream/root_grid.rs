//! The root grid: the rectangle of tiles of one level at which the page tables begin, and the
//! fixed-point coordinates that count from its north-west corner.

use treeline_core::seeds::place::TURN_BITS;
use treeline_core::tile::{self, GeographicBox, TileAddress};
use treeline_shaders::layout::ROOT_BITS;

/// Leaves of the page table are never larger than a tile of this level: a larger one bends by more
/// than the ray frame's quadratics follow.
pub const COARSEST_LEAF_LEVEL: u8 = 7;
/// At most this many tiles of the coarsest level are loaded first and kept for ever.
const BASE_TILES: u32 = 4;
/// At most this many roots, so that coordinates fit 32 bits and the pages of large scenes stay few.
const ROOTS: u32 = 64;

/// The rectangle of root tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RootGrid {
    /// Matrix level of the roots.
    pub level: u8,
    /// Column of the first root.
    pub first_column: u32,
    /// Row of the first root.
    pub first_row: u32,
    /// Columns; they wrap at the antimeridian.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
}

impl RootGrid {
    /// The tiles of `level` that the box touches.
    pub fn covering(extent: &GeographicBox, level: u8) -> Self {
        let span = tile::span_degrees(level);
        let all = tile::columns(level);
        let clamp = |latitude: f64| latitude.clamp(-90.0, 90.0);
        let first = ((extent.west + 180.0) / span).floor();
        // A box that ends exactly on a tile's edge does not touch the next tile.
        let last = (((extent.east + 180.0) / span).ceil() - 1.0).max(first);
        let first_row = ((90.0 - clamp(extent.north)) / span).floor().min(f64::from(tile::rows(level) - 1));
        let last_row = (((90.0 - clamp(extent.south)) / span).ceil() - 1.0).max(first_row);
        Self {
            level,
            first_column: (first as i64).rem_euclid(i64::from(all)) as u32,
            first_row: first_row as u32,
            columns: ((last - first) as u32 + 1).min(all),
            rows: (last_row - first_row) as u32 + 1,
        }
    }

    /// Where the page tables of a scene begin. `deepest`: the deepest level that there is.
    pub fn of_scene(extent: &GeographicBox, deepest: u8) -> Self {
        let base = Self::base_of_scene(extent, deepest);
        if base.level >= COARSEST_LEAF_LEVEL {
            return base;
        }
        let mut grid = base;
        for level in base.level + 1..=COARSEST_LEAF_LEVEL {
            let next = Self::covering(extent, level);
            if next.columns * next.rows > ROOTS {
                break;
            }
            grid = next;
        }
        grid
    }

    /// The coarsest tiles of a layer that a scene loads: a handful, first of all, for ever.
    pub fn base_of_scene(extent: &GeographicBox, deepest: u8) -> Self {
        (0..=deepest)
            .rev()
            .map(|level| Self::covering(extent, level))
            .find(|grid| u64::from(grid.columns) * u64::from(grid.rows) <= u64::from(BASE_TILES))
            .unwrap_or_else(|| Self::covering(extent, 0))
    }

    /// Number of roots.
    pub fn len(&self) -> usize {
        (self.columns * self.rows) as usize
    }

    /// Never: a grid has at least one root.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether the grid goes round the Earth.
    pub fn wraps(&self) -> bool {
        self.columns == tile::columns(self.level)
    }

    /// The roots, row-major from the north-west.
    pub fn tiles(&self) -> impl Iterator<Item = TileAddress> + '_ {
        (0..self.rows).flat_map(move |row| (0..self.columns).map(move |column| self.tile(column, row)))
    }

    /// The root at a column and row of the grid.
    fn tile(&self, column: u32, row: u32) -> TileAddress {
        TileAddress {
            level: self.level,
            row: self.first_row + row,
            column: (self.first_column + column) % tile::columns(self.level),
        }
    }

    /// The north-west corner in units of `treeline_core::seeds::place`.
    pub fn place(&self) -> [u32; 2] {
        let side_bits = TURN_BITS - 1 - u32::from(self.level);
        [self.first_column << side_bits, self.first_row << side_bits]
    }

    /// Grid coordinates of a square's north-west corner and its side; the square lies in the grid
    /// and at most [`ROOT_BITS`] levels below it.
    pub fn square(&self, address: TileAddress) -> Option<([u32; 2], u32)> {
        let down = u32::from(address.level.checked_sub(self.level)?);
        let root = address.ancestor(self.level)?;
        let all = tile::columns(self.level);
        let column = (root.column + all - self.first_column) % all;
        let row = root.row.checked_sub(self.first_row)?;
        if down > ROOT_BITS || column >= self.columns || row >= self.rows {
            return None;
        }
        let side = 1_u32 << (ROOT_BITS - down);
        let mask = (1_u32 << down) - 1;
        Some((
            [
                (column << ROOT_BITS) + (address.column & mask) * side,
                (row << ROOT_BITS) + (address.row & mask) * side,
            ],
            side,
        ))
    }

    /// Grid coordinates of a place, where it lies over the grid.
    pub fn coordinates(&self, longitude: f64, latitude: f64) -> Option<[u32; 2]> {
        let span = tile::span_degrees(self.level);
        let all = f64::from(tile::columns(self.level));
        let x = ((longitude + 180.0) / span - f64::from(self.first_column)).rem_euclid(all);
        let y = (90.0 - latitude) / span - f64::from(self.first_row);
        if !(x >= 0.0 && x < f64::from(self.columns) && y >= 0.0 && y < f64::from(self.rows)) {
            return None;
        }
        let unit = f64::from(1_u32 << ROOT_BITS);
        Some([(x * unit) as u32, (y * unit) as u32])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_of_forty_kilometres_has_a_handful_of_roots() {
        let extent = GeographicBox { west: 10.0, south: 46.0, east: 10.5, north: 46.4 };
        let grid = RootGrid::of_scene(&extent, 16);
        assert!(grid.len() <= 4 && grid.level >= 8, "{grid:?}");
        for root in grid.tiles() {
            assert!(extent.intersects(&root.bounds()));
            let ([x, y], side) = grid.square(root).unwrap();
            assert_eq!((x % side, y % side, side), (0, 0, 1 << ROOT_BITS));
        }
    }

    #[test]
    fn grids_cross_the_antimeridian_and_go_round_the_earth() {
        let fiji = GeographicBox { west: 177.0, south: -19.0, east: 181.0, north: -16.0 };
        let grid = RootGrid::of_scene(&fiji, 14);
        assert!(grid.coordinates(-179.5, -17.0).is_some() && grid.coordinates(178.0, -17.0).is_some());
        assert!(grid.coordinates(-170.0, -17.0).is_none());
        let [west, _] = grid.coordinates(179.9, -17.0).unwrap();
        let [east, _] = grid.coordinates(-179.9, -17.0).unwrap();
        assert!(east > west);

        let world = RootGrid::of_scene(&GeographicBox::WORLD, 12);
        assert!(world.wraps() && world.len() <= 64);
        assert_eq!(RootGrid::base_of_scene(&GeographicBox::WORLD, 12).level, 0);
    }

    #[test]
    fn a_square_below_a_root() {
        let extent = GeographicBox { west: 0.0, south: 0.0, east: 0.1, north: 0.1 };
        let grid = RootGrid::covering(&extent, 8);
        let root = grid.tiles().next().unwrap();
        let child = root.children()[3];
        assert_eq!(grid.square(child), Some(([1 << 25, 1 << 25], 1 << 25)));
        assert_eq!(grid.square(TileAddress::at(8, 50.0, 0.05)), None);
    }

    #[test]
    fn the_corner_is_where_the_first_root_begins() {
        use treeline_core::seeds::place::{x_from_longitude, y_from_latitude};
        for (west, north, level) in [(11.3, 46.9, 9), (-179.0, -10.0, 14), (179.0, 89.0, 7), (-1.0, 1.0, 2)] {
            let extent = GeographicBox { west, south: north - 0.01, east: west + 0.01, north };
            let grid = RootGrid::covering(&extent, level);
            let bounds = grid.tile(0, 0).bounds();
            assert_eq!(
                grid.place().map(f64::from),
                [x_from_longitude(bounds.west), y_from_latitude(bounds.north)]
            );
        }
    }

    #[test]
    fn a_source_with_one_coarse_level_keeps_it() {
        let extent = GeographicBox { west: 0.0, south: 0.0, east: 40.0, north: 40.0 };
        assert_eq!(RootGrid::base_of_scene(&extent, 0).level, 0);
        assert!(RootGrid::of_scene(&extent, 0).level > 0, "roots are squares, not tiles");
    }
}
