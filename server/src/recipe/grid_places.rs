//! Where the samples of a grid stand: longitude and latitude, and how far apart, in metres.

use super::RecipeError;
use crate::source::crs::Crs;
use crate::source::{RequestCrs, SampleGrid};
use treeline_core::geodesy;
use treeline_core::grid::Registration;

/// The places of a grid's samples, degrees.
pub enum Places {
    /// Sample (i, j) stands at (longitudes\[i\], latitudes\[j\]).
    Separable {
        /// By column, eastward, not wrapped.
        longitudes: Vec<f64>,
        /// By row, southward.
        latitudes: Vec<f64>,
    },
    /// Every sample has its own longitude and latitude; NaN where the projection has none.
    Scattered(Vec<(f64, f64)>),
}

/// The places of a grid.
pub fn places(grid: &SampleGrid) -> Result<Places, RecipeError> {
    Ok(match grid {
        SampleGrid::Lattice(window) => Places::Separable {
            longitudes: (0..i64::from(window.width))
                .map(|column| window.longitude(window.first_column + column))
                .collect(),
            latitudes: (0..i64::from(window.height))
                .map(|row| window.latitude(window.first_row + row))
                .collect(),
        },
        SampleGrid::Box { crs, west, south, east, north, width, height } => {
            let along = |count: u32, from: f64, to: f64| {
                (0..count).map(move |index| from + (f64::from(index) + 0.5) * (to - from) / f64::from(count))
            };
            match crs {
                RequestCrs::Geographic => Places::Separable {
                    longitudes: along(*width, *west, *east).collect(),
                    latitudes: along(*height, *north, *south).collect(),
                },
                RequestCrs::WebMercator => Places::Separable {
                    longitudes: along(*width, *west, *east)
                        .map(|x| geodesy::geographic_from_web_mercator(x, 0.0).0)
                        .collect(),
                    latitudes: along(*height, *north, *south)
                        .map(|y| geodesy::geographic_from_web_mercator(0.0, y).1)
                        .collect(),
                },
                RequestCrs::Projected(epsg) => {
                    let crs = Crs::from_epsg(*epsg).map_err(|error| RecipeError::ReferenceSystem {
                        epsg: *epsg,
                        problem: error.to_string(),
                    })?;
                    Places::Scattered(
                        along(*height, *north, *south)
                            .flat_map(|y| along(*width, *west, *east).map(move |x| (x, y)))
                            .map(|(x, y)| crs.to_geographic(x, y).unwrap_or((f64::NAN, f64::NAN)))
                            .collect(),
                    )
                }
            }
        }
    })
}

/// Distance between samples, metres, by row: (eastward, southward). Never zero.
pub fn spacing(grid: &SampleGrid) -> Vec<(f32, f32)> {
    let degree = geodesy::EQUATOR_METRES / 360.0;
    let geographic = |step_x: f64, step_y: f64, latitude: f64| {
        // At the poles columns meet; a hundredth of the step keeps slopes finite.
        let shrink = latitude.clamp(-90.0, 90.0).to_radians().cos().max(0.01);
        ((step_x * degree * shrink) as f32, (step_y * degree) as f32)
    };
    match grid {
        SampleGrid::Lattice(window) => {
            let step = window.step_degrees();
            (0..i64::from(window.height))
                .map(|row| geographic(step, step, window.latitude(window.first_row + row)))
                .collect()
        }
        SampleGrid::Box { crs, west, south, east, north, width, height } => {
            let step_x = (east - west).abs() / f64::from((*width).max(1));
            let step_y = (north - south).abs() / f64::from((*height).max(1));
            let at = |row: u32| north + (f64::from(row) + 0.5) * (south - north) / f64::from(*height);
            (0..*height)
                .map(|row| match crs {
                    RequestCrs::Geographic => geographic(step_x, step_y, at(row)),
                    RequestCrs::WebMercator => {
                        let latitude = geodesy::geographic_from_web_mercator(0.0, at(row)).1;
                        let shrink = latitude.to_radians().cos();
                        ((step_x * shrink) as f32, (step_y * shrink) as f32)
                    }
                    // Near enough for shading, whatever the projection's scale.
                    RequestCrs::Projected(_) => (step_x as f32, step_y as f32),
                })
                .map(|(x, y)| (x.max(1e-6), y.max(1e-6)))
                .collect()
        }
    }
}

/// The larger distance between samples, metres, in the middle of the grid.
pub fn coarsest_spacing(grid: &SampleGrid) -> f64 {
    let rows = spacing(grid);
    let (x, y) = rows.get(rows.len() / 2).copied().unwrap_or((1.0, 1.0));
    f64::from(x.max(y))
}

/// The grid with `margin` samples more on every side, at the same places within.
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
            let step_x = (*east - *west) / f64::from((*width).max(1)) * f64::from(margin);
            let step_y = (*north - *south) / f64::from((*height).max(1)) * f64::from(margin);
            *west -= step_x;
            *east += step_x;
            *south -= step_y;
            *north += step_y;
            *width += 2 * margin;
            *height += 2 * margin;
        }
    }
    wider
}

/// Rows `first` to `first + count` of the grid, at the same places.
pub fn band(grid: &SampleGrid, first: u32, count: u32) -> SampleGrid {
    let mut part = grid.clone();
    match &mut part {
        SampleGrid::Lattice(window) => {
            window.first_row += i64::from(first);
            window.height = count;
        }
        SampleGrid::Box { south, north, height, .. } => {
            let step = (*south - *north) / f64::from((*height).max(1));
            let top = *north;
            *north = top + step * f64::from(first);
            *south = top + step * f64::from(first + count);
            *height = count;
        }
    }
    part
}

/// Georeference of a grid's pixels: (west, north, step eastward, step southward) of the box whose
/// pixels they are, and the EPSG code of its reference system.
pub fn georeference(grid: &SampleGrid) -> ([f64; 4], u32) {
    match grid {
        SampleGrid::Lattice(window) => {
            let bounds = window.pixel_box();
            let step = window.step_degrees();
            ([bounds.west, bounds.north, step, step], 4326)
        }
        SampleGrid::Box { crs, west, south, east, north, width, height } => {
            let steps = [
                *west,
                *north,
                (east - west) / f64::from((*width).max(1)),
                (north - south) / f64::from((*height).max(1)),
            ];
            let epsg = match crs {
                RequestCrs::Geographic => 4326,
                RequestCrs::WebMercator => 3857,
                RequestCrs::Projected(epsg) => *epsg,
            };
            (steps, epsg)
        }
    }
}

/// Whether samples stand on the corners of cells.
pub fn is_node_registered(grid: &SampleGrid) -> bool {
    matches!(grid, SampleGrid::Lattice(window) if window.registration == Registration::Node)
}
