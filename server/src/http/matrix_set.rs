//! Tile matrix sets: which box a tile of a level, row and column stands for (OGC 17-083r4).

use crate::http::order::geographic_grid;
use crate::recipe::Format;
use crate::source::{RequestCrs, SampleGrid};
use treeline_core::geodesy::{EQUATOR_METRES, geographic_from_web_mercator, web_mercator_from_geographic};
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::layer::LayerRow;
use treeline_core::tile::{CELLS, GeographicBox, MAXIMUM_LEVEL, TileAddress, columns, rows};

/// Id of our own tile matrix set: the canonical quadtree with 512-sample tiles.
pub const OWN_MATRIX_SET: &str = "TreelineGeographic";
/// Samples along the side of a tile of the standard sets.
const STANDARD_SIDE: u32 = 256;
/// Deepest level of the standard sets: 0.3 mm at the equator.
const STANDARD_LEVELS: u8 = 28;

/// A tile matrix set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatrixSet {
    /// The canonical quadtree.
    Own,
    /// OGC's geographic quadtree of 256-sample tiles.
    WorldCrs84Quad,
    /// OGC's Web Mercator quadtree of 256-sample tiles, as most web maps have it.
    WebMercatorQuad,
}

/// The sets by their ids.
pub const MATRIX_SETS: [(&str, MatrixSet); 3] = [
    (OWN_MATRIX_SET, MatrixSet::Own),
    ("WorldCRS84Quad", MatrixSet::WorldCrs84Quad),
    ("WebMercatorQuad", MatrixSet::WebMercatorQuad),
];

/// Side of a standard pixel of a screen, metres: what scale denominators go by.
const STANDARD_PIXEL_METRES: f64 = 0.000_28;

impl MatrixSet {
    /// Its id.
    pub fn id(self) -> &'static str {
        MATRIX_SETS[self as usize].0
    }

    /// The set of an id.
    pub fn from_id(id: &str) -> Option<Self> {
        MATRIX_SETS.iter().find(|(name, _)| *name == id).map(|(_, set)| *set)
    }

    /// Address of its definition, where it has one that all know.
    pub fn uri(self) -> Option<String> {
        (self != Self::Own).then(|| format!("http://www.opengis.net/def/tilematrixset/OGC/1.0/{}", self.id()))
    }

    /// Its reference system as a URI.
    pub fn crs_uri(self) -> &'static str {
        match self {
            Self::WebMercatorQuad => "http://www.opengis.net/def/crs/EPSG/0/3857",
            _ => "http://www.opengis.net/def/crs/OGC/1.3/CRS84",
        }
    }

    /// Its reference system as a URN, as WMTS writes it.
    pub fn crs_urn(self) -> &'static str {
        match self {
            Self::WebMercatorQuad => "urn:ogc:def:crs:EPSG::3857",
            _ => "urn:ogc:def:crs:OGC:1.3:CRS84",
        }
    }

    /// Samples along a tile's side.
    pub fn side(self) -> u32 {
        if self == Self::Own { CELLS } else { STANDARD_SIDE }
    }

    /// Deepest level.
    pub fn deepest(self) -> u8 {
        if self == Self::Own { MAXIMUM_LEVEL } else { STANDARD_LEVELS }
    }

    /// The level of the set whose samples are as far apart as those of a level of the canonical quadtree.
    pub fn level_like(self, canonical: u8) -> u8 {
        if self == Self::Own { canonical } else { (canonical + 1).min(STANDARD_LEVELS) }
    }

    /// Its north-western corner: easting and northing in its units.
    pub fn corner(self) -> [f64; 2] {
        match self {
            Self::WebMercatorQuad => {
                let (edge, _) = web_mercator_from_geographic(180.0, 0.0);
                [-edge, edge]
            }
            _ => [-180.0, 90.0],
        }
    }

    /// Side of a sample of a level, in its units.
    pub fn cell(self, level: u8) -> f64 {
        let tile = match self {
            Self::WebMercatorQuad => EQUATOR_METRES,
            _ => 180.0,
        };
        tile / f64::from(1_u32 << level) / f64::from(self.side())
    }

    /// Scale denominator of a level.
    pub fn scale_denominator(self, level: u8) -> f64 {
        let metres = if self == Self::WebMercatorQuad { 1.0 } else { EQUATOR_METRES / 360.0 };
        self.cell(level) * metres / STANDARD_PIXEL_METRES
    }

    /// First and last row, first and last column of a level that reach into a box.
    pub fn reach(self, level: u8, bounds: &GeographicBox) -> Option<[u32; 4]> {
        let (rows, columns) = self.size(level)?;
        let span = self.cell(level) * f64::from(self.side());
        let [left, top] = self.corner();
        let place = |longitude: f64, latitude: f64| match self {
            Self::WebMercatorQuad => {
                let (_, highest) = geographic_from_web_mercator(0.0, top);
                web_mercator_from_geographic(longitude, latitude.clamp(-highest, highest))
            }
            _ => (longitude, latitude),
        };
        // A box over the antimeridian reaches all columns.
        let turned = bounds.west < -180.0 || bounds.east > 180.0;
        let (west, north) = place(if turned { -180.0 } else { bounds.west }, bounds.north);
        let (east, south) = place(if turned { 180.0 } else { bounds.east }, bounds.south);
        let index = |distance: f64, count: u32| ((distance / span).floor().max(0.0) as u32).min(count - 1);
        Some([
            index(top - north, rows),
            index(top - south, rows),
            index(west - left, columns),
            index(east - left, columns),
        ])
    }

    /// Rows and columns of a level; `None` where there is no such level.
    pub fn size(self, level: u8) -> Option<(u32, u32)> {
        match self {
            Self::Own => (level <= MAXIMUM_LEVEL).then(|| (rows(level), columns(level))),
            _ if level > STANDARD_LEVELS => None,
            Self::WorldCrs84Quad => Some((1 << level, 2 << level)),
            Self::WebMercatorQuad => Some((1 << level, 1 << level)),
        }
    }

    /// The samples of a tile of a layer.
    pub fn grid(
        self,
        row_of_layer: &LayerRow,
        format: Format,
        level: u8,
        row: u32,
        column: u32,
    ) -> SampleGrid {
        match self {
            Self::Own => {
                let address = TileAddress { level, row, column };
                let (registration, border) = if format == Format::Own {
                    (row_of_layer.registration, row_of_layer.border)
                } else {
                    (Registration::Cell, 0)
                };
                SampleGrid::Lattice(LatticeWindow::of_tile(address, registration, border))
            }
            Self::WorldCrs84Quad => {
                let span = 180.0 / f64::from(1_u32 << level);
                let west = -180.0 + span * f64::from(column);
                let north = 90.0 - span * f64::from(row);
                let bounds = GeographicBox { west, south: north - span, east: west + span, north };
                geographic_grid(row_of_layer.layer, &bounds, STANDARD_SIDE, STANDARD_SIDE)
            }
            Self::WebMercatorQuad => {
                let span = EQUATOR_METRES / f64::from(1_u32 << level);
                let (edge, _) = web_mercator_from_geographic(180.0, 0.0);
                let west = -edge + span * f64::from(column);
                let north = edge - span * f64::from(row);
                SampleGrid::Box {
                    crs: RequestCrs::WebMercator,
                    west,
                    south: north - span,
                    east: west + span,
                    north,
                    width: STANDARD_SIDE,
                    height: STANDARD_SIDE,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use treeline_core::layer::Layer;

    #[test]
    fn the_standard_set_shares_the_lattice() {
        // A 256-sample tile of level z is a quarter of our tile of level z − 1.
        let grid = MatrixSet::WorldCrs84Quad.grid(Layer::Texture.row(), Format::Png, 12, 1000, 2000);
        let SampleGrid::Lattice(window) = grid else { panic!("{grid:?}") };
        assert_eq!(
            (window.level, window.width, window.first_row, window.first_column),
            (11, 256, 256_000, 512_000)
        );
    }

    #[test]
    fn web_mercator_tiles_tile_the_square() {
        let SampleGrid::Box { west, south, east, north, .. } =
            MatrixSet::WebMercatorQuad.grid(Layer::Texture.row(), Format::Png, 1, 1, 1)
        else {
            panic!()
        };
        assert!(west.abs() < 1e-6 && north.abs() < 1e-6);
        assert!(
            (east - 20_037_508.342_789_244).abs() < 1e-6 && (south + 20_037_508.342_789_244).abs() < 1e-6
        );
    }
}
