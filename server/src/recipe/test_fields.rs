//! Analytic fields and scenes made of them, for the recipes' tests.

use crate::scene::Scene;
use crate::source::{
    ColourField, Cover, CoverField, FieldExtent, HeightField, RequestCrs, SampleGrid, SourceError,
};
use std::sync::Arc;
use treeline_core::camera::GeographicCamera;
use treeline_core::codec::land_cover::CodeBits;
use treeline_core::geodesy;
use treeline_core::layer::SurfaceType;
use treeline_core::seeds::Species;
use treeline_core::tile::GeographicBox;

/// Longitude and latitude of each sample.
fn places(grid: &SampleGrid) -> Vec<(f64, f64)> {
    let (width, height) = grid.size();
    let mut out = Vec::with_capacity(grid.len());
    for row in 0..height {
        for column in 0..width {
            out.push(match grid {
                SampleGrid::Lattice(window) => (
                    window.longitude(window.first_column + i64::from(column)),
                    window.latitude(window.first_row + i64::from(row)),
                ),
                SampleGrid::Box { crs, west, south, east, north, .. } => {
                    let x = west + (f64::from(column) + 0.5) * (east - west) / f64::from(width);
                    let y = north - (f64::from(row) + 0.5) * (north - south) / f64::from(height);
                    match crs {
                        RequestCrs::Geographic => (x, y),
                        RequestCrs::WebMercator => geodesy::geographic_from_web_mercator(x, y),
                        RequestCrs::Projected(code) => {
                            crate::source::crs::Crs::from_epsg(*code).unwrap().to_geographic(x, y).unwrap()
                        }
                    }
                }
            });
        }
    }
    out
}

/// Longitude on the field's turn.
fn turned(longitude: f64) -> f64 {
    (longitude + 180.0).rem_euclid(360.0) - 180.0
}

/// Hills; void west of `void_west`.
pub struct Hills {
    pub extent: FieldExtent,
    pub void_west: f64,
}

impl Hills {
    fn height(&self, longitude: f64, latitude: f64) -> f32 {
        let longitude = turned(longitude);
        if longitude < self.void_west || !self.extent.bounds.contains(longitude, latitude) {
            return f32::NAN;
        }
        let (x, y) = (longitude * 78_000.0, latitude * 111_320.0);
        let hills = 300.0 * (x / 900.0).sin() * (y / 1_100.0).cos()
            + 20.0 * (x / 70.0).sin()
            + 3.0 * (y / 11.0).sin();
        (1_200.0 + hills) as f32
    }
}

impl HeightField for Hills {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [f32]) -> Result<(), SourceError> {
        for (out, (longitude, latitude)) in out.iter_mut().zip(places(grid)) {
            *out = self.height(longitude, latitude);
        }
        Ok(())
    }

    fn maxima(&self, bounds: &GeographicBox, columns: u32, rows: u32) -> Result<Vec<f32>, SourceError> {
        // Densely sampled, plus the most that lies between; not tight, and a bound.
        let dense = 3;
        let grid = SampleGrid::Box {
            crs: RequestCrs::Geographic,
            west: bounds.west,
            south: bounds.south,
            east: bounds.east,
            north: bounds.north,
            width: columns * dense,
            height: rows * dense,
        };
        let mut heights = vec![0.0; grid.len()];
        self.sample(&grid, &mut heights)?;
        let step = (bounds.north - bounds.south) / f64::from(rows * dense) * 111_320.0;
        let between = (0.9 * step).min(330.0) as f32;
        let mut out = vec![f32::NAN; (columns * rows) as usize];
        for (index, height) in heights.iter().enumerate() {
            let (row, column) = (index as u32 / (columns * dense), index as u32 % (columns * dense));
            let block = &mut out[((row / dense) * columns + column / dense) as usize];
            *block = block.max(height + between);
        }
        Ok(out)
    }

    fn range(&self) -> (f32, f32) {
        (800.0, 1_600.0)
    }
}

/// Stands in a checkerboard of about 100 m, with water and rock between.
pub struct Woods {
    pub extent: FieldExtent,
    /// Everything is one closed stand.
    pub closed: bool,
}

impl Woods {
    pub fn cover(&self, longitude: f64, latitude: f64) -> Cover {
        let longitude = turned(longitude);
        if !self.extent.bounds.contains(longitude, latitude) {
            return Cover::default();
        }
        if self.closed {
            return Cover { species: 1, closure: 255, height: 0, surface: SurfaceType::Grass as u8 };
        }
        let (x, y) = ((longitude * 780.0).floor() as i64, (latitude * 1_113.0).floor() as i64);
        match (x.rem_euclid(3), y.rem_euclid(3)) {
            (0, 0) => Cover { species: 0, closure: 0, height: 0, surface: SurfaceType::Water as u8 },
            (1, 1) => Cover { species: 0, closure: 40, height: 0, surface: SurfaceType::Rock as u8 },
            (2, _) => Cover { species: 2, closure: 180, height: 90, surface: SurfaceType::Grass as u8 },
            _ => Cover { species: 1, closure: 230, height: 0, surface: SurfaceType::Grass as u8 },
        }
    }
}

impl CoverField for Woods {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        for (out, (longitude, latitude)) in out.iter_mut().zip(places(grid)) {
            *out = self.cover(longitude, latitude);
        }
        Ok(())
    }
}

/// A photo of stripes with a hole.
pub struct Stripes {
    pub extent: FieldExtent,
}

impl ColourField for Stripes {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [[u8; 4]]) -> Result<(), SourceError> {
        for (out, (longitude, latitude)) in out.iter_mut().zip(places(grid)) {
            *out = if self.extent.bounds.contains(longitude, latitude) {
                [((longitude * 1e4) as i64).rem_euclid(256) as u8, 90, 60, 255]
            } else {
                [0; 4]
            };
        }
        Ok(())
    }
}

pub fn extent(west: f64, south: f64, east: f64, north: f64, resolution_metres: f64) -> FieldExtent {
    FieldExtent {
        bounds: GeographicBox { west, south, east, north },
        resolution_metres,
        projected_epsg: None,
    }
}

/// The Alps' latitude: hills with woods to 15 m, a photo of the eastern half.
pub fn scene() -> Scene {
    scene_of(extent(10.0, 46.0, 11.0, 47.0, 30.0))
}

pub fn scene_of(bounds: FieldExtent) -> Scene {
    let GeographicBox { west, south, east, north } = bounds.bounds;
    Scene {
        name: "Hills".into(),
        revision: "1".into(),
        height: Arc::new(Hills { extent: bounds, void_west: f64::NEG_INFINITY }),
        colour: Some(Arc::new(Stripes { extent: extent(0.5 * (west + east), south, east, north, 1.0) })),
        cover: Some(Arc::new(Woods { extent: extent(west, south, east, north, 15.0), closed: false })),
        species: Species::built_in(),
        growing: vec![1, 2],
        code_bits: CodeBits::default(),
        seed: 7,
        attribution: Vec::new(),
        sun_time: "2026-07-15T09:00:00Z".into(),
        camera: GeographicCamera {
            lon: 10.0,
            lat: 46.0,
            height: 3_000.0,
            heading_deg: 0.0,
            pitch_deg: -20.0,
            fov_y_deg: 50.0,
        },
        places: Vec::new(),
    }
}
