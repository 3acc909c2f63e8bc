//! How much of what is to be seen the Tile Load Map names, and how much of what it names is to be seen: random
//! views of an analytic world, the built-in landscape and real ones, 160 × 128, against 16 rays a pixel.
//!
//! `VIEWS=200` in the environment for the long form; 24 views of each scene otherwise.

use anyhow::Context;
use std::time::Instant;
use treeline_core::camera::GeographicCamera;
use treeline_core::hash::{minimal_standard, uniform};
use treeline_shaders::load_map::WANTED;
use treeline_tests::load_map::{DEEPEST, Scene, analytic_world, ground};
use treeline_tests::program::Server;
use treeline_tests::recall::{SIZE, Sight, Surveyor, Tally};
use treeline_tests::{data, measure};

/// Random numbers, the same in every run.
struct Random(u32);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = minimal_standard(self.0);
        low + (high - low) * f64::from(uniform(self.0))
    }

    /// Over ground of a height, metres: an oblique view, or a panorama where the index is odd.
    fn camera(&mut self, lon: f64, lat: f64, ground: f64, index: u32) -> GeographicCamera {
        let is_oblique = index.is_multiple_of(2);
        let over = if is_oblique { self.between(500.0, 4_000.0) } else { self.between(30.0, 600.0) };
        GeographicCamera {
            lon,
            lat,
            height: ground + over,
            heading_deg: self.between(0.0, 360.0),
            pitch_deg: if is_oblique { self.between(-60.0, -25.0) } else { self.between(-12.0, 0.0) },
            fov_y_deg: 50.0,
        }
    }
}

fn print(name: &str, tally: &Tally) {
    for (what, value) in [
        ("recall, pixel centres", tally.recall_of_centres()),
        ("recall, 16 rays a pixel", tally.recall()),
        ("precision", tally.precision()),
    ] {
        println!(
            "{}",
            serde_json::json!({ "name": format!("{name}: {what}"), "value": 100.0 * value, "unit": "%" })
        );
    }
}

/// The analytic world, by the twin: all of it is there on its finest level.
fn survey_analytic(views: u32) {
    let world = analytic_world();
    let (root, _) = world.roots();
    let bounds = root.bounds();
    let mut random = Random(20_261);
    let (mut oblique, mut panorama) = (Tally::default(), Tally::default());
    let (mut twin, mut gpu) = (Vec::new(), Vec::new());
    for index in 0..views {
        let lon = bounds.east + random.between(-0.04, 0.04);
        let lat = bounds.south + random.between(-0.04, 0.04);
        let camera = random.camera(lon, lat, ground(&world, lon, lat), index);
        let scene = Scene::new(&world, camera, SIZE, DEEPEST, None, None);
        let (distances, hits) = scene.picture(1);
        let start = Instant::now();
        let map = scene.by_twin(&distances, &hits);
        twin.push(1e3 * start.elapsed().as_secs_f64());
        gpu.push(1e3 * scene.by_gpu().seconds);
        let named = scene.named(&map.cells, |word| word & WANTED != 0);
        let centres = scene.tiles_of(&distances, &hits);
        let (distances, hits) = scene.picture(4);
        let needed = scene.tiles_of(&distances, &hits);
        let missed: Vec<String> = needed.difference(&named).map(ToString::to_string).collect();
        if !missed.is_empty() {
            eprintln!("analytic, {camera:?}: missed {}", missed.join(" "));
        }
        let misses = distances.iter().filter(|distance| **distance < 0.0).count();
        let sight = Sight { needed, centres, named, misses, threshold: 1.0 };
        if index % 2 == 0 { &mut oblique } else { &mut panorama }.add(&sight);
    }
    print(&format!("analytic world, {} oblique", views.div_ceil(2)), &oblique);
    print(&format!("analytic world, {} panoramas", views / 2), &panorama);
    for (name, milliseconds) in [("its CPU twin", &twin), ("the software adapter, with read-back", &gpu)] {
        measure::print(
            &format!("a map of 160 × 128 by {name}, median"),
            measure::quantile(milliseconds, 0.5),
            "ms",
        );
    }
}

fn survey(name: &str, arguments: &[&str], views: u32) -> anyhow::Result<()> {
    let server = Server::start(arguments)?;
    let mut surveyor = Surveyor::new(&server.url(""))?;
    let extent = surveyor.ground().extent;
    let mut random = Random(20_261);
    let (mut oblique, mut panorama) = (Tally::default(), Tally::default());
    for index in 0..views {
        let inner = |low: f64, high: f64, share: f64| low + (high - low) * (0.15 + 0.7 * share);
        let lon = inner(extent.west, extent.east, random.between(0.0, 1.0));
        let lat = inner(extent.south, extent.north, random.between(0.0, 1.0));
        let camera = random.camera(lon, lat, surveyor.height(lon, lat)?, index);
        let sight = surveyor.look(camera)?;
        if index % 2 == 0 { &mut oblique } else { &mut panorama }.add(&sight);
        let missed: Vec<String> = sight.needed.difference(&sight.named).map(ToString::to_string).collect();
        if !missed.is_empty() {
            eprintln!("{name}, {camera:?}: missed {}", missed.join(" "));
        }
    }
    print(&format!("{name}, {} oblique", views.div_ceil(2)), &oblique);
    print(&format!("{name}, {} panoramas", views / 2), &panorama);
    Ok(())
}

fn main() -> anyhow::Result<()> {
    let views = match std::env::var("VIEWS") {
        Ok(text) => text.parse().context("VIEWS is a number of views")?,
        Err(_) => 24,
    };
    survey_analytic(views);
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
