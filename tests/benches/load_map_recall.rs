//! How much of what is to be seen the Tile Load Map names, and how much of what it names is to be seen: random
//! views of the built-in landscape and of real ones, 160 × 128, against 16 rays a pixel.
//!
//! `VIEWS=200` in the environment for the long form; 24 views of each scene otherwise.

use anyhow::Context;
use std::collections::BTreeSet;
use treeline_client::engine::{Engine, EngineOptions, ViewRequest};
use treeline_client::headless::{self, AdapterChoice, Capture, Session, TileFetcher};
use treeline_client::stream::StreamOptions;
use treeline_client::stream::view::ViewGeometry;
use treeline_core::camera::GeographicCamera;
use treeline_core::hash::{minimal_standard, uniform};
use treeline_core::layer::Layer;
use treeline_core::tile::{self, TileAddress};
use treeline_tests::data;
use treeline_tests::http_tiles::HttpTiles;
use treeline_tests::program::Server;

/// The picture whose tiles are named.
const SIZE: [u32; 2] = [160, 128];
/// Rays along a pixel's side, for the truth.
const RAYS: u32 = 4;
/// A texel may be as long as this many pixels.
const TEXEL_PIXELS: f64 = 1.42;

/// Random numbers, the same in every run.
struct Random(u32);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = minimal_standard(self.0);
        low + (high - low) * f64::from(uniform(self.0))
    }
}

/// Height of the ground at a place, metres.
fn ground(tiles: &HttpTiles, longitude: f64, latitude: f64) -> anyhow::Result<f64> {
    let (west, south) = (longitude - 1e-4, latitude - 1e-4);
    let url = format!(
        "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=combined-elevation&STYLES=&CRS=CRS:84\
         &BBOX={west},{south},{},{}&WIDTH=1&HEIGHT=1&FORMAT=application/bil32",
        west + 2e-4,
        south + 2e-4
    );
    let body = tiles.fetch(&url)?.body;
    let bytes: [u8; 4] = body[..].try_into().context("one sample")?;
    Ok(f64::from(f32::from_le_bytes(bytes)))
}

/// The tiles that a picture's rays hit, each on the level that a pixel of `pixel_angle` wants there.
fn hit(capture: &Capture, view: &ViewGeometry, pixel_angle: f64, deepest: u8) -> BTreeSet<TileAddress> {
    let width = view.size[0] as usize;
    let rays = capture.distance.iter().enumerate().filter(|(_, distance)| **distance >= 0.0);
    rays.map(|(index, &distance)| {
        let (x, y) = ((index % width) as f64, (index / width) as f64);
        let place = view.geodetic(view.direction(x + 0.5, y + 0.5) * f64::from(distance));
        let longest = TEXEL_PIXELS * f64::from(distance) * pixel_angle;
        let level = (0..deepest).find(|&level| tile::cell_metres(level) <= longest).unwrap_or(deepest);
        TileAddress::at(level, place.longitude, place.latitude)
    })
    .collect()
}

/// Counts over many views.
#[derive(Default)]
struct Tally {
    needed: usize,
    named: usize,
    found: usize,
    centres: usize,
    centres_found: usize,
}

impl Tally {
    fn print(&self, name: &str) {
        let share = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
        for (what, value) in [
            ("recall, pixel centres", share(self.centres_found, self.centres)),
            ("recall, 16 rays a pixel", share(self.found, self.needed)),
            ("precision", share(self.found, self.named)),
        ] {
            println!(
                "{}",
                serde_json::json!({ "name": format!("{name}: {what}"), "value": value, "unit": "%" })
            );
        }
    }
}

fn survey(name: &str, arguments: &[&str], views: u32) -> anyhow::Result<()> {
    let server = Server::start(arguments)?;
    let tiles = HttpTiles::new(&server.url(""));
    let scene = tiles.scene()?;
    let layer = scene.layer(Layer::Texture).or(scene.layer(Layer::Elevation)).context("a layer")?;
    let (extent, deepest) = (layer.extent, layer.maximum_level);
    let options = EngineOptions {
        stream: StreamOptions { fade_seconds: 0.0, ..StreamOptions::default() },
        uploads_per_step: usize::MAX,
        ..EngineOptions::default()
    };
    let gpu = headless::open(AdapterChoice::Software)?;
    let engine = Engine::new(gpu, scene.clone(), options)?;
    let mut session = Session::new(engine, SIZE[0] * RAYS, SIZE[1] * RAYS, 2)?;
    session.engine.choose_for(SIZE);
    let mut random = Random(20_261);
    let (mut oblique, mut panorama) = (Tally::default(), Tally::default());
    for index in 0..views {
        let inner = |low: f64, high: f64, share: f64| low + (high - low) * (0.15 + 0.7 * share);
        let lon = inner(extent.west, extent.east, random.between(0.0, 1.0));
        let lat = inner(extent.south, extent.north, random.between(0.0, 1.0));
        let is_oblique = index % 2 == 0;
        let over = if is_oblique { random.between(500.0, 4_000.0) } else { random.between(30.0, 600.0) };
        let camera = GeographicCamera {
            lon,
            lat,
            height: ground(&tiles, lon, lat)? + over,
            heading_deg: random.between(0.0, 360.0),
            pitch_deg: if is_oblique { random.between(-60.0, -25.0) } else { random.between(-12.0, 0.0) },
            fov_y_deg: 50.0,
        };
        let view = |size: [u32; 2]| ViewRequest {
            camera,
            width: size[0],
            height: size[1],
            sun_unix_seconds: None,
            shadow_steps: 0,
        };
        session.settle(&view(SIZE), &tiles)?;
        let named: BTreeSet<TileAddress> = session.engine.visible().iter().copied().collect();
        let seen = ViewGeometry::new(&camera, SIZE[0], SIZE[1]);
        let centres = hit(&session.capture()?, &seen, seen.pixel_angle, deepest);
        session.draw(&view(SIZE.map(|side| side * RAYS)))?;
        let fine = ViewGeometry::new(&camera, SIZE[0] * RAYS, SIZE[1] * RAYS);
        let needed = hit(&session.capture()?, &fine, seen.pixel_angle, deepest);
        let tally = if is_oblique { &mut oblique } else { &mut panorama };
        tally.needed += needed.len();
        tally.named += named.len();
        tally.found += needed.intersection(&named).count();
        tally.centres += centres.len();
        tally.centres_found += centres.intersection(&named).count();
    }
    oblique.print(&format!("{name}, {} oblique", views.div_ceil(2)));
    panorama.print(&format!("{name}, {} panoramas", views / 2));
    Ok(())
}

fn main() -> anyhow::Result<()> {
    let views = match std::env::var("VIEWS") {
        Ok(text) => text.parse().context("VIEWS is a number of views")?,
        Err(_) => 24,
    };
    survey("built-in", &[], views)?;
    for (name, folder, dem, photo) in [
        ("Hong Kong", "scene_hongkong", "dem_utm50n_30m.tif", Some("ortho_utm50n_15m.tif")),
        ("Lolo", "scene_lolo_montana", "dem_m.tif", None),
    ] {
        let Some(folder) = data::find(folder) else { continue };
        let path = |file: &str| folder.join(file).display().to_string();
        let mut arguments = vec!["--dem".to_owned(), path(dem)];
        if let Some(photo) = photo {
            arguments.extend(["--photo".to_owned(), path(photo)]);
        }
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        survey(name, &arguments, views)?;
    }
    Ok(())
}
