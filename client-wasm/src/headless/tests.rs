//! The engine on a software adapter, over an analytic world: from request to picture.

use super::capture::Capture;
use super::fetch::{Fetched, TileFetcher};
use super::session::Session;
use super::{AdapterChoice, HeadlessError, open};
use crate::engine::{Engine, EngineOptions, ViewRequest, Weather};
use crate::passes::compress_photo::PhotoCompression;
use crate::stream::StreamOptions;
use crate::stream::decode::TEXTURE_SIDE;
use crate::stream::decode::tests::encoded;
use crate::stream::requests::FetchFailure;
use crate::stream::simulation::scene;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use treeline_core::camera::GeographicCamera;
use treeline_core::grid::LatticeWindow;
use treeline_core::layer::Layer;
use treeline_core::tile::{GeographicBox, TileAddress, cell_metres};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 64;
/// What the analytic world says that an elevation tile was on the wire.
const ELEVATION_WIRE_BYTES: u64 = 1_000;

/// Hills of 300 m, a few kilometres apart.
fn hills(longitude: f64, latitude: f64) -> f64 {
    1_200.0 + 300.0 * (longitude * 150.0).sin() * (latitude * 190.0).cos()
}

/// Finds the tile that a GetMap address asks for, as a server does.
fn tile_of(url: &str) -> (Layer, TileAddress) {
    let value = |name: &str| {
        let (_, rest) = url.split_once(&format!("{name}=")).unwrap_or_else(|| panic!("{url} lacks {name}"));
        rest.split('&').next().unwrap().to_owned()
    };
    let layer = Layer::from_name(&value("LAYERS")).unwrap();
    let edges: Vec<f64> = value("BBOX").split(',').map(|edge| edge.parse().unwrap()).collect();
    let bounds = GeographicBox { west: edges[0], south: edges[1], east: edges[2], north: edges[3] };
    let (width, height) = (value("WIDTH").parse().unwrap(), value("HEIGHT").parse().unwrap());
    let window = LatticeWindow::from_pixel_box(&bounds, width, height, layer.row().registration).unwrap();
    (layer, window.as_tile().unwrap().0)
}

/// The analytic world as a server; every `fails_one_in`-th answer is an error, and what was asked for is kept.
struct World {
    fails_one_in: u32,
    count: AtomicU32,
    asked: Mutex<Vec<String>>,
}

impl World {
    fn new(fails_one_in: u32) -> Self {
        Self { fails_one_in, count: AtomicU32::new(0), asked: Mutex::new(Vec::new()) }
    }
}

impl TileFetcher for World {
    fn fetch(&self, url: &str) -> Result<Fetched, FetchFailure> {
        assert!(url.starts_with("/wms?SERVICE=WMS&"), "{url}");
        let count = self.count.fetch_add(1, Ordering::Relaxed);
        if self.fails_one_in > 0 && count % self.fails_one_in == 1 {
            return Err(FetchFailure::Temporary("503".into()));
        }
        self.asked.lock().unwrap().push(url.to_owned());
        let (layer, address) = tile_of(url);
        if layer.is_elevation() {
            let body = encoded(address, hills);
            return Ok(Fetched { body, wire_bytes: ELEVATION_WIRE_BYTES });
        }
        let shade = address.level.wrapping_mul(40);
        let picture = image::RgbImage::from_fn(TEXTURE_SIDE, TEXTURE_SIDE, |x, y| {
            image::Rgb([shade, (x / 4) as u8, (y / 4) as u8])
        });
        let mut png = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
        Ok(Fetched::plain(png.into_inner()))
    }
}

fn view(height: f64, pitch_deg: f64) -> ViewRequest {
    let camera =
        GeographicCamera { lon: 11.12, lat: 47.0, height, heading_deg: 30.0, pitch_deg, fov_y_deg: 50.0 };
    ViewRequest {
        camera,
        width: WIDTH,
        height: HEIGHT,
        sun_unix_seconds: None,
        shadow_steps: 4,
        weather: Weather::default(),
    }
}

fn session() -> Session {
    let gpu = open(AdapterChoice::Software).unwrap();
    let options = EngineOptions {
        stream: StreamOptions { fade_seconds: 0.0, ..StreamOptions::default() },
        photo_compression: PhotoCompression::default(),
        uploads_per_step: usize::MAX,
        count_fetches: true,
        ..EngineOptions::default()
    };
    Session::new(Engine::new(gpu, scene(), options).unwrap(), WIDTH, HEIGHT, 2).unwrap()
}

fn shot(view: &ViewRequest, fails_one_in: u32) -> (Session, Capture) {
    let mut session = session();
    let report = session.settle(view, &World::new(fails_one_in)).unwrap();
    assert!(report.drawn && report.settled, "{report:?}");
    let capture = session.capture().unwrap();
    (session, capture)
}

#[test]
fn depths_are_those_of_the_analytic_world_and_no_ray_is_missed() {
    let view = view(2_600.0, -25.0);
    let (session, capture) = shot(&view, 0);
    let geometry = session.engine.drawn_geometry().unwrap();
    let mut hits = 0;
    for (index, &distance) in capture.distance.iter().enumerate() {
        if distance < 0.0 {
            continue;
        }
        hits += 1;
        let (x, y) = (index as u32 % WIDTH, index as u32 / WIDTH);
        let direction = geometry.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let place = geometry.geodetic(direction * f64::from(distance));
        let error = place.height - hills(place.longitude, place.latitude);
        // The chords of a ray stray by up to 1/16 cell sideways, the slope here is up to 0.6, and patches
        // stray from the sine; the coarsest cells drawn are those of level 9.
        let cell = (1.42 * f64::from(distance) * geometry.pixel_angle).min(cell_metres(9));
        assert!(error.abs() < 0.3 + 0.04 * cell, "{error} m at {x}, {y}, {distance} m away");
    }
    assert!(hits > 4_000, "{hits}");
    let twin = session.engine.twin_hits();
    assert!(twin.iter().zip(&capture.distance).all(|(twin, distance)| !twin || *distance >= 0.0));
    let picked = session.engine.pick(48.0, 50.0).unwrap();
    let ground = session.engine.ground_height(picked.longitude, picked.latitude).unwrap();
    assert!((picked.height - ground).abs() < 1.0, "{} {ground}", picked.height);
}

#[test]
fn a_failing_server_gives_the_same_picture() {
    let view = view(2_000.0, -12.0);
    let (_, good) = shot(&view, 0);
    let (_, bad) = shot(&view, 5);
    assert_eq!(good.distance, bad.distance);
    assert_eq!(good.rgba, bad.rgba);
}

#[test]
fn nothing_is_drawn_or_asked_for_while_nothing_changes() {
    let view = view(2_000.0, -20.0);
    let (mut session, _) = shot(&view, 0);
    let before = session.engine.stats();
    for step in 0..5 {
        let report = session.engine.step(100.0 + f64::from(step), &view, None);
        assert!(!report.drawn && report.settled && report.requests.is_empty());
    }
    assert_eq!(session.engine.stats().frames, before.frames);
    assert_eq!(before.requests.started, before.requests.succeeded);
    // Counted is what the fetcher says of the wire, not what the engine sees.
    let layer = Layer::CombinedElevation.name();
    assert_eq!(before.bytes[layer], before.tiles[layer] * ELEVATION_WIRE_BYTES);
    assert!(before.bytes["texture"] > before.tiles["texture"] * 1_000);
}

#[test]
fn each_tile_is_asked_for_once() {
    let world = World::new(0);
    let mut session = session();
    session.settle(&view(2_000.0, -20.0), &world).unwrap();
    session.settle(&view(1_900.0, -30.0), &world).unwrap();
    let mut asked = world.asked.into_inner().unwrap();
    let count = asked.len();
    asked.sort();
    asked.dedup();
    assert_eq!(asked.len(), count);
}

#[test]
fn a_refused_tile_is_an_error_that_names_it() {
    let refuse =
        |_: &str| -> Result<Fetched, FetchFailure> { Err(FetchFailure::Permanent("HTTP 404: gone".into())) };
    let error = session().settle(&view(2_000.0, -20.0), &refuse).unwrap_err();
    assert!(
        matches!(&error, HeadlessError::Tile { url, problem } if url.contains("BBOX=") && problem == "HTTP 404: gone")
    );
}

/// Extreme places of the eye: stated outcomes, no panic, no defect reported by the driver.
#[test]
fn extreme_views() {
    let world = World::new(0);
    let mut session = session();
    for (height, pitch) in [(1.0e7, -90.0), (5.0e5, -60.0), (900.0, 0.0), (1_600.0, 90.0), (1_501.0, -90.0)] {
        session.settle(&view(height, pitch), &world).unwrap();
        let capture = session.capture().unwrap();
        let hits = capture.distance.iter().filter(|distance| **distance >= 0.0).count();
        match (height, pitch) {
            (_, 90.0) => assert_eq!(hits, 0, "the sky is empty"),
            (1_501.0, _) => assert_eq!(hits, capture.distance.len(), "the ground fills the picture"),
            _ => {}
        }
    }
}
