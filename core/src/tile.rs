//! Addresses in the canonical tile matrix: a geographic quadtree.
//!
//! Level 0 is two tiles of 180°; level L has 2^(L+1) columns and 2^L rows, counted from the
//! north-west corner (180° W, 90° N). A tile has [`CELLS`] cells a side on every layer.

use serde::{Deserialize, Serialize};

/// Cells along a tile's side, on every layer and level.
pub const CELLS: u32 = 512;

/// The deepest level that an address may have: texels of 0.6 mm, sample indices still fit in 42 bits.
pub const MAXIMUM_LEVEL: u8 = 26;

/// A geographic box in degrees. East may exceed 180 where a box crosses the antimeridian,
/// so west ≤ east always holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GeographicBox {
    /// Western longitude, degrees.
    pub west: f64,
    /// Southern latitude, degrees.
    pub south: f64,
    /// Eastern longitude, degrees, at least `west`.
    pub east: f64,
    /// Northern latitude, degrees.
    pub north: f64,
}

impl GeographicBox {
    /// The whole ellipsoid.
    pub const WORLD: Self = Self { west: -180.0, south: -90.0, east: 180.0, north: 90.0 };

    /// Whether the two boxes share area, trying the neighbouring turns of longitude too.
    pub fn intersects(&self, other: &Self) -> bool {
        self.south < other.north
            && other.south < self.north
            && [-360.0, 0.0, 360.0]
                .iter()
                .any(|turn| self.west + turn < other.east && other.west < self.east + turn)
    }

    /// Whether the point lies in the box (borders included), trying the neighbouring turns of longitude.
    pub fn contains(&self, longitude: f64, latitude: f64) -> bool {
        (self.south..=self.north).contains(&latitude)
            && [-360.0, 0.0, 360.0].iter().any(|turn| (self.west..=self.east).contains(&(longitude + turn)))
    }

    /// Longitude and latitude of the middle, degrees.
    pub fn centre(&self) -> (f64, f64) {
        (0.5 * (self.west + self.east), 0.5 * (self.south + self.north))
    }
}

/// One tile of the matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct TileAddress {
    /// 0 is two tiles of 180°; each level halves the span.
    pub level: u8,
    /// From the north, 0 ≤ row < 2^level.
    pub row: u32,
    /// From 180° W eastward, 0 ≤ column < 2^(level+1).
    pub column: u32,
}

/// Span of a tile of `level` in degrees, along either axis.
pub fn span_degrees(level: u8) -> f64 {
    180.0 / (1_u64 << level) as f64
}

/// Columns of the matrix at `level`.
pub fn columns(level: u8) -> u32 {
    2_u32 << level
}

/// Rows of the matrix at `level`.
pub fn rows(level: u8) -> u32 {
    1_u32 << level
}

/// Length of one cell of `level` along a meridian, or along the equator, in metres:
/// 39,136 m / 2^level (the equator's circumference over 1,024 × 2^level cells).
pub fn cell_metres(level: u8) -> f64 {
    crate::geodesy::EQUATOR_METRES / (2.0 * f64::from(CELLS)) / (1_u64 << level) as f64
}

/// The coarsest level whose cell is at most `metres` long (within 0.1 %); at most [`MAXIMUM_LEVEL`].
pub fn level_for_cell_metres(metres: f64) -> u8 {
    (0..MAXIMUM_LEVEL).find(|&level| cell_metres(level) <= metres * 1.001).unwrap_or(MAXIMUM_LEVEL)
}

impl TileAddress {
    /// The address, or `None` where level, row or column are out of range.
    pub fn new(level: u8, row: u32, column: u32) -> Option<Self> {
        (level <= MAXIMUM_LEVEL && row < rows(level) && column < columns(level)).then_some(Self {
            level,
            row,
            column,
        })
    }

    /// The tile's box in degrees.
    pub fn bounds(&self) -> GeographicBox {
        let span = span_degrees(self.level);
        let west = -180.0 + span * f64::from(self.column);
        let north = 90.0 - span * f64::from(self.row);
        GeographicBox { west, south: north - span, east: west + span, north }
    }

    /// The tile of `level` that holds the point; longitude wraps, the poles and NaN are clamped into the matrix.
    pub fn at(level: u8, longitude: f64, latitude: f64) -> Self {
        let span = span_degrees(level);
        let column = (((longitude + 180.0).rem_euclid(360.0)) / span) as u32;
        let row = ((90.0 - latitude) / span) as u32;
        Self { level, row: row.min(rows(level) - 1), column: column.min(columns(level) - 1) }
    }

    /// Whether heights of this tile are left to a coarser one because a pole is near, where all columns of a level
    /// meet: a ray that passes the axis would cross thousands of them.
    pub fn crowds_a_pole(&self) -> bool {
        const DEEPEST: u8 = 11;
        // The tile's side away from the pole, in degrees from there. So far out, what is drawn finer than level 11
        // is so near the eye that a ray crosses fewer of its columns than it does on level 11 at the pole.
        const NEAR_DEGREES: f64 = 0.25;
        let rows_out = self.row.min(rows(self.level) - 1 - self.row) + 1;
        self.level > DEEPEST && f64::from(rows_out) * span_degrees(self.level) < NEAR_DEGREES
    }

    /// The parent, or `None` on level 0.
    pub fn parent(&self) -> Option<Self> {
        (self.level > 0).then(|| Self { level: self.level - 1, row: self.row / 2, column: self.column / 2 })
    }

    /// The four children: north-west, north-east, south-west, south-east.
    pub fn children(&self) -> [Self; 4] {
        [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(row, column)| Self {
            level: self.level + 1,
            row: 2 * self.row + row,
            column: 2 * self.column + column,
        })
    }

    /// The ancestor on `level`, or `None` where `level` is deeper than this tile; the tile itself on its own level.
    pub fn ancestor(&self, level: u8) -> Option<Self> {
        let up = self.level.checked_sub(level)?;
        Some(Self { level, row: self.row >> up, column: self.column >> up })
    }

    /// Whether `other` is this tile or lies below it.
    pub fn covers(&self, other: &Self) -> bool {
        other.ancestor(self.level) == Some(*self)
    }

    /// This tile's place within its ancestor on `level`, in the ancestor's cells: (x, y, side),
    /// exact (a power of two, below 1 where more than 9 levels lie between).
    pub fn place_in_ancestor(&self, level: u8) -> Option<(f64, f64, f64)> {
        let up = self.level.checked_sub(level)?;
        let tiles = (1_u64 << up) as f64;
        let mask = (1_u32 << up) - 1;
        let side = f64::from(CELLS) / tiles;
        Some((f64::from(self.column & mask) * side, f64::from(self.row & mask) * side, side))
    }
}

impl std::fmt::Display for TileAddress {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}/{}/{}", self.level, self.row, self.column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_cell_of_level_0_is_39136_m() {
        assert!((cell_metres(0) - 39_135.76).abs() < 0.01);
        assert_eq!(level_for_cell_metres(0.5), 17);
        assert_eq!(level_for_cell_metres(30.0), 11);
    }

    #[test]
    fn the_poles_and_the_antimeridian_have_a_tile() {
        assert_eq!(TileAddress::at(3, 180.0, -90.0), TileAddress { level: 3, row: 7, column: 0 });
        assert_eq!(TileAddress::at(3, -180.0, 90.0), TileAddress { level: 3, row: 0, column: 0 });
        assert_eq!(TileAddress::at(0, f64::NAN, f64::NAN), TileAddress { level: 0, row: 0, column: 0 });
    }

    #[test]
    fn heights_are_coarser_around_a_pole() {
        for latitude in [-89.999, 89.95] {
            let tile = TileAddress::at(11, 30.0, latitude);
            assert!(!tile.crowds_a_pole() && tile.children().iter().all(TileAddress::crowds_a_pole));
        }
        for level in 0..=MAXIMUM_LEVEL {
            assert!(!TileAddress::at(level, 30.0, 89.7).crowds_a_pole());
            // What is left to a coarser tile is left to one that is not.
            let tile = TileAddress::at(level, 30.0, -89.9);
            assert!((0..=level).any(|level| !tile.ancestor(level).unwrap().crowds_a_pole()));
        }
    }

    #[test]
    fn boxes_meet_across_the_antimeridian() {
        let fiji = GeographicBox { west: 177.0, south: -19.0, east: 181.0, north: -16.0 };
        let tile = TileAddress::at(5, -179.5, -17.0);
        assert!(fiji.intersects(&tile.bounds()));
        assert!(fiji.contains(-179.5, -17.0));
    }

    proptest! {
        #[test]
        fn a_point_lies_in_its_tile_and_in_all_its_ancestors(level in 0_u8..=22, longitude in -180.0..180.0, latitude in -90.0..90.0) {
            let tile = TileAddress::at(level, longitude, latitude);
            prop_assert!(tile.bounds().contains(longitude, latitude));
            for up in 0..=level {
                let ancestor = tile.ancestor(up).unwrap();
                prop_assert!(ancestor.covers(&tile));
                prop_assert_eq!(ancestor, TileAddress::at(up, longitude, latitude));
            }
            prop_assert!(tile.children().iter().all(|child| child.parent() == Some(tile)));
        }
    }
}
