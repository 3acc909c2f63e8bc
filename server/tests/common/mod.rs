//! A small analytic scene, and the router as a function.
#![allow(dead_code, reason = "each test file uses its part")]

use axum::Router;
use axum::body::Body;
use axum::http::{HeaderMap, Request, StatusCode};
use http_body_util::BodyExt as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use tower::ServiceExt as _;
use treeline_core::camera::GeographicCamera;
use treeline_core::codec::land_cover::CodeBits;
use treeline_core::geodesy::geographic_from_web_mercator;
use treeline_core::seeds::Species;
use treeline_core::tile::GeographicBox;
use treeline_server::config::Config;
use treeline_server::http::router;
use treeline_server::scene::Scene;
use treeline_server::source::crs::Crs;
use treeline_server::source::{
    ColourField, Cover, CoverField, FieldExtent, HeightField, RequestCrs, SampleGrid, SourceError,
};
use treeline_server::state::{App, AppState};

/// Where the analytic scene has data.
pub const BOUNDS: GeographicBox = GeographicBox { west: 10.0, south: 46.0, east: 11.0, north: 47.0 };

/// Height of the analytic terrain, metres: 100 m a degree eastward, 1,000 m a degree northward.
pub fn height_at(longitude: f64, latitude: f64) -> f32 {
    if (10.0..=11.0).contains(&longitude) && (46.0..=47.0).contains(&latitude) {
        (100.0 * (longitude - 10.0) + 1000.0 * (latitude - 46.0)) as f32
    } else {
        f32::NAN
    }
}

/// Longitude and latitude of every sample of a grid.
fn places(grid: &SampleGrid) -> Vec<(f64, f64)> {
    match grid {
        SampleGrid::Lattice(window) => (0..i64::from(window.height))
            .flat_map(|row| (0..i64::from(window.width)).map(move |column| (row, column)))
            .map(|(row, column)| {
                (window.longitude(window.first_column + column), window.latitude(window.first_row + row))
            })
            .collect(),
        SampleGrid::Box { crs, west, south, east, north, width, height } => (0..*height)
            .flat_map(|row| (0..*width).map(move |column| (row, column)))
            .map(|(row, column)| {
                let x = west + (f64::from(column) + 0.5) * (east - west) / f64::from(*width);
                let y = north - (f64::from(row) + 0.5) * (north - south) / f64::from(*height);
                match crs {
                    RequestCrs::Geographic => (x, y),
                    RequestCrs::WebMercator => geographic_from_web_mercator(x, y),
                    RequestCrs::Projected(epsg) => {
                        Crs::from_epsg(*epsg).unwrap().to_geographic(x, y).unwrap_or((f64::NAN, f64::NAN))
                    }
                }
            })
            .collect(),
    }
}

/// The analytic fields; counts how often heights are asked for.
pub struct Plane {
    extent: FieldExtent,
    /// Calls of `HeightField::sample`.
    pub samples: AtomicUsize,
    fails: bool,
}

impl Plane {
    fn new(epsg: Option<u32>, fails: bool) -> Self {
        let extent = FieldExtent { bounds: BOUNDS, resolution_metres: 30.0, projected_epsg: epsg };
        Self { extent, samples: AtomicUsize::new(0), fails }
    }
}

impl HeightField for Plane {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [f32]) -> Result<(), SourceError> {
        self.samples.fetch_add(1, SeqCst);
        if self.fails {
            return Err(SourceError::Read { path: "dem.tif".to_owned(), problem: "cut short".to_owned() });
        }
        for (value, (longitude, latitude)) in out.iter_mut().zip(places(grid)) {
            *value = height_at(longitude, latitude);
        }
        Ok(())
    }

    fn maxima(&self, _: &GeographicBox, columns: u32, rows: u32) -> Result<Vec<f32>, SourceError> {
        Ok(vec![1100.0; (columns * rows) as usize])
    }

    fn range(&self) -> (f32, f32) {
        (0.0, 1100.0)
    }
}

impl ColourField for Plane {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [[u8; 4]]) -> Result<(), SourceError> {
        for (value, (longitude, latitude)) in out.iter_mut().zip(places(grid)) {
            let there = height_at(longitude, latitude).is_finite();
            *value = if there {
                [(255.0 * (longitude - 10.0)) as u8, (255.0 * (latitude - 46.0)) as u8, 40, 255]
            } else {
                [0; 4]
            };
        }
        Ok(())
    }
}

impl CoverField for Plane {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        for (value, (longitude, latitude)) in out.iter_mut().zip(places(grid)) {
            let grows = longitude < 10.5 && height_at(longitude, latitude).is_finite();
            *value = if grows {
                Cover { species: 1, closure: 255, height: 80, surface: 0 }
            } else {
                Cover::default()
            };
        }
        Ok(())
    }
}

/// What a test's scene has.
#[derive(Clone, Copy, Default)]
pub struct Kind {
    /// Photo and land cover.
    pub full: bool,
    /// The terrain's own projected CRS.
    pub epsg: Option<u32>,
    /// The terrain cannot be read.
    pub fails: bool,
}

/// The application over the analytic scene, and its terrain.
pub fn app_with(kind: Kind, config: &Config) -> (AppState, Arc<Plane>) {
    let plane = Arc::new(Plane::new(kind.epsg, kind.fails));
    let scene = Scene {
        name: "A <plane> & more".to_owned(),
        revision: "r1".to_owned(),
        height: plane.clone(),
        colour: kind.full.then(|| plane.clone() as Arc<dyn ColourField>),
        cover: kind.full.then(|| plane.clone() as Arc<dyn CoverField>),
        species: Species::built_in(),
        growing: vec![1, 2],
        code_bits: CodeBits::default(),
        seed: 1,
        attribution: vec!["© Nobody".to_owned()],
        sun_time: "2026-07-15T09:00:00Z".to_owned(),
        camera: GeographicCamera {
            lon: 10.5,
            lat: 46.2,
            height: 3000.0,
            heading_deg: 0.0,
            pitch_deg: -20.0,
            fov_y_deg: 50.0,
        },
        places: Vec::new(),
    };
    (App::new(Arc::new(scene), config).unwrap(), plane)
}

/// The full analytic scene behind the router.
pub fn full() -> Router {
    router(app_with(Kind { full: true, epsg: Some(31287), fails: false }, &Config::default()).0)
}

/// An answer, read to its end.
pub struct Answer {
    /// Status.
    pub status: StatusCode,
    /// Headers.
    pub headers: HeaderMap,
    /// Body.
    pub body: Vec<u8>,
}

impl Answer {
    /// A header's value, or nothing.
    pub fn header(&self, name: &str) -> &str {
        self.headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default()
    }

    /// The body as text.
    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }
}

/// Asks the router.
pub async fn ask(router: &Router, request: Request<Body>) -> Answer {
    let response = router.clone().oneshot(request).await.unwrap();
    let (parts, body) = response.into_parts();
    let body = body.collect().await.unwrap().to_bytes().to_vec();
    Answer { status: parts.status, headers: parts.headers, body }
}

/// Asks the router with GET.
pub async fn get(router: &Router, uri: &str) -> Answer {
    ask(router, Request::get(uri).header("host", "test.example:8080").body(Body::empty()).unwrap()).await
}

/// A body of 32-bit floats.
pub fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
}
