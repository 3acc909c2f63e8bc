//! Where the invented massif lies, and the plane in which it is computed.
//!
//! The extent is six tiles of level 10 (three columns, two rows), so that texels of every level
//! from 1 down lie wholly inside or outside. The plane is metres east and north of the extent's
//! centre by constant metres per degree; over 20 km that differs from true distances by 0.3 % at
//! the most, and keeps x a function of the longitude alone and y of the latitude alone.

use crate::source::{RequestCrs, SampleGrid, SourceError};
use treeline_core::geodesy;
use treeline_core::tile::GeographicBox;

/// The massif's box, degrees.
pub(super) const BOUNDS: GeographicBox =
    GeographicBox { west: 10.722_656_25, south: 46.757_812_5, east: 11.25, north: 47.109_375 };
/// Longitude of the plane's origin, degrees.
pub(super) const CENTRE_LONGITUDE: f64 = 10.986_328_125;
/// Latitude of the plane's origin, degrees.
pub(super) const CENTRE_LATITUDE: f64 = 46.933_593_75;
/// Metres per degree of longitude at the centre.
pub(super) const METRES_PER_DEGREE_EAST: f64 = 76_150.0;
/// Metres per degree of latitude at the centre.
pub(super) const METRES_PER_DEGREE_NORTH: f64 = 111_170.0;

/// Metres east of the centre, by the turn of longitude that is nearest.
pub(super) fn east_from_longitude(longitude: f64) -> f64 {
    let degrees = longitude - CENTRE_LONGITUDE;
    let turns = (degrees * (1.0 / 360.0)).round();
    (degrees - 360.0 * turns) * METRES_PER_DEGREE_EAST
}

/// Metres north of the centre.
pub(super) fn north_from_latitude(latitude: f64) -> f64 {
    (latitude - CENTRE_LATITUDE) * METRES_PER_DEGREE_NORTH
}

/// The samples of a grid that lie inside the massif's box. All grids that are served have meridians
/// for columns and parallels for rows.
pub(super) struct Places {
    /// Columns of the grid that are inside, ascending.
    pub columns: Vec<usize>,
    /// Rows of the grid that are inside, ascending.
    pub rows: Vec<usize>,
    /// Metres east, one for each of `columns`.
    pub x: Vec<f64>,
    /// Metres north, one for each of `rows`.
    pub y: Vec<f64>,
    /// Columns of the whole grid.
    pub width: usize,
}

impl Places {
    /// The inside samples of `grid`; an error where its CRS is not one of the globe's.
    pub(super) fn of(grid: &SampleGrid) -> Result<Self, SourceError> {
        let (width, height) = grid.size();
        let (longitudes, latitudes): (Vec<f64>, Vec<f64>) = match grid {
            SampleGrid::Lattice(window) => (
                (0..i64::from(width)).map(|i| window.longitude(window.first_column + i)).collect(),
                (0..i64::from(height)).map(|j| window.latitude(window.first_row + j)).collect(),
            ),
            SampleGrid::Box { crs, west, south, east, north, .. } => {
                let step = (east - west) / f64::from(width);
                let fall = (north - south) / f64::from(height);
                let across = (0..width).map(|i| west + (f64::from(i) + 0.5) * step);
                let down = (0..height).map(|j| north - (f64::from(j) + 0.5) * fall);
                match crs {
                    RequestCrs::Geographic => (across.collect(), down.collect()),
                    RequestCrs::WebMercator => (
                        across.map(|x| geodesy::geographic_from_web_mercator(x, 0.0).0).collect(),
                        down.map(|y| geodesy::geographic_from_web_mercator(0.0, y).1).collect(),
                    ),
                    RequestCrs::Projected(code) => {
                        return Err(SourceError::Unusable {
                            path: "the built-in scene".into(),
                            problem: format!("it has no samples in EPSG:{code}"),
                            mend: "ask for CRS:84, EPSG:4326 or EPSG:3857".into(),
                        });
                    }
                }
            }
        };
        let inside_columns = longitudes.iter().enumerate().filter(|&(_, &longitude)| {
            let x = east_from_longitude(longitude);
            let half = 0.5 * (BOUNDS.east - BOUNDS.west) * METRES_PER_DEGREE_EAST;
            x.abs() <= half
        });
        let (columns, x) = inside_columns.map(|(i, &l)| (i, east_from_longitude(l))).unzip();
        let inside_rows =
            latitudes.iter().enumerate().filter(|&(_, l)| (BOUNDS.south..=BOUNDS.north).contains(l));
        let (rows, y) = inside_rows.map(|(j, &l)| (j, north_from_latitude(l))).unzip();
        Ok(Self { columns, rows, x, y, width: width as usize })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use treeline_core::grid::{LatticeWindow, Registration};
    use treeline_core::tile::TileAddress;

    #[test]
    fn the_plane_keeps_true_scale_at_its_centre() {
        let east = geodesy::prime_vertical_radius(CENTRE_LATITUDE) * CENTRE_LATITUDE.to_radians().cos();
        let north = geodesy::meridian_radius(CENTRE_LATITUDE);
        assert!((east.to_radians() / METRES_PER_DEGREE_EAST - 1.0).abs() < 1e-4, "{}", east.to_radians());
        assert!((north.to_radians() / METRES_PER_DEGREE_NORTH - 1.0).abs() < 1e-4, "{}", north.to_radians());
    }

    #[test]
    fn the_extent_is_six_tiles_of_level_10() {
        let first = TileAddress::at(10, BOUNDS.west + 1e-6, BOUNDS.north - 1e-6);
        let last = TileAddress::at(10, BOUNDS.east - 1e-6, BOUNDS.south + 1e-6);
        assert_eq!((last.column - first.column, last.row - first.row), (2, 1));
        assert_eq!(first.bounds().west, BOUNDS.west);
        assert_eq!(first.bounds().north, BOUNDS.north);
        assert_eq!(last.bounds().east, BOUNDS.east);
        assert_eq!(last.bounds().south, BOUNDS.south);
    }

    #[test]
    fn a_tile_inside_has_all_its_samples_and_one_far_away_none() {
        let grid = |address| SampleGrid::Lattice(LatticeWindow::of_tile(address, Registration::Node, 0));
        let inside = Places::of(&grid(TileAddress::at(10, BOUNDS.west + 0.01, BOUNDS.north - 0.01))).unwrap();
        assert_eq!((inside.x.len(), inside.y.len()), (513, 513));
        let far = Places::of(&grid(TileAddress::at(10, -60.0, BOUNDS.north - 0.01))).unwrap();
        assert!(far.x.is_empty());
    }

    #[test]
    fn another_turn_of_longitude_is_the_same_place() {
        assert!((east_from_longitude(11.0 + 360.0) - east_from_longitude(11.0)).abs() < 1e-6);
    }

    #[test]
    fn a_projected_crs_is_refused_in_a_line() {
        let grid = SampleGrid::Box {
            crs: RequestCrs::Projected(31287),
            west: 0.0,
            south: 0.0,
            east: 1.0,
            north: 1.0,
            width: 1,
            height: 1,
        };
        let error = Places::of(&grid).err().unwrap().to_string();
        assert!(error.contains("EPSG:31287") && error.contains("EPSG:3857"), "{error}");
    }
}
