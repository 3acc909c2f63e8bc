//! A picture of a scene.

use crate::arguments::Arguments;
use crate::camera_file;
use crate::error::ShotError;
use crate::host::Host;
use crate::npy;
use crate::output;
use crate::statistics::{addresses, fetch_statistics, median, visible_textures};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use treeline_client::engine::{Engine, EngineOptions, ViewRequest, Weather};
use treeline_client::headless::{self, Capture, SelectedTree, Session};
use treeline_client::stream::StreamOptions;
use treeline_core::layer::Layer;
use treeline_core::scene::SceneDescription;
use treeline_core::sun::unix_seconds_from_rfc3339;
use treeline_core::tile::TileAddress;

/// Settles, draws and writes.
pub fn shoot(arguments: &Arguments) -> Result<(), ShotError> {
    let camera = arguments.camera.as_deref().map(camera_file::geographic).transpose()?;
    let host = Host::open(arguments)?;
    let scene = host.scene()?;
    let gpu = headless::open(arguments.adapter.into())?;
    let [width, height] = arguments.size;
    let view = ViewRequest {
        camera: camera.unwrap_or(scene.camera),
        width,
        height,
        sun_unix_seconds: time(arguments, &scene)?,
        shadow_steps: arguments.shadow_steps,
        weather: Weather { wind: arguments.wind, seconds: arguments.wind_seconds, clouds: arguments.clouds },
    };
    let options = EngineOptions {
        stream: StreamOptions {
            surface: arguments.surface.into(),
            tile_choice: arguments.tile_choice,
            // One frame, and it is the last one.
            fade_seconds: 0.0,
            ..StreamOptions::default()
        },
        photo_compression: arguments.photo_tiles,
        tree_metres: arguments.tree_distance,
        undergrowth_metres: arguments.undergrowth,
        uploads_per_step: usize::MAX,
        count_fetches: arguments.stats.is_some(),
        ..EngineOptions::default()
    };
    let engine = Engine::new(gpu, scene, options).map_err(ShotError::failure)?;
    let workers = std::thread::available_parallelism().map_or(2, usize::from).clamp(2, 8);
    let mut session = Session::new(engine, width, height, workers)?;
    session.settle(&view, &host)?;
    let times =
        if arguments.repeat > 1 { session.repeat(&view, arguments.repeat as usize)? } else { Vec::new() };
    let capture = session.capture()?;
    if let Some(path) = &arguments.color {
        output::picture(path, width, height, &capture.rgba)?;
    }
    if let Some(path) = &arguments.depth {
        let depths: Vec<f32> = capture
            .distance
            .iter()
            .map(|&distance| if distance < 0.0 { f32::INFINITY } else { distance })
            .collect();
        output::write("--depth", path, &npy::write(height, width, &depths))?;
    }
    if let Some(path) = &arguments.trees {
        output::write("--trees", path, trees(&session)?.as_bytes())?;
    }
    if let Some(path) = &arguments.stats {
        let document = statistics(&mut session, &capture, &times)?;
        output::write("--stats", path, format!("{document:#}\n").as_bytes())?;
    }
    Ok(())
}

/// When it is, where the command line says so: seconds since 1970.
fn time(arguments: &Arguments, scene: &SceneDescription) -> Result<Option<f64>, ShotError> {
    let Some(season) = arguments.season else { return Ok(arguments.time) };
    let own = unix_seconds_from_rfc3339(&scene.sun.time).map_err(ShotError::failure)?;
    Ok(Some(season.near(own, scene.extent.centre().1)))
}

/// The table of `--trees`.
fn trees(session: &Session) -> Result<String, ShotError> {
    let mut table = String::from("lon,lat,ground_m,height_m,species,level\n");
    for tree in session.trees()? {
        let SelectedTree { longitude, latitude, ground_metres, height_metres, species, level } = tree;
        // Each number is the shortest that reads back as itself.
        writeln!(table, "{longitude},{latitude},{ground_metres},{height_metres},{species},{level}")
            .map_err(ShotError::failure)?;
    }
    Ok(table)
}

/// The document of `--stats`.
fn statistics(session: &mut Session, capture: &Capture, times: &[f64]) -> Result<Value, ShotError> {
    let missed = session
        .engine
        .twin_hits()
        .into_iter()
        .zip(&capture.distance)
        .filter(|(twin, distance)| *twin && **distance < 0.0)
        .count();
    let deepest = session.engine.scene().layer(Layer::Texture).map(|row| row.maximum_level);
    let visible: Vec<TileAddress> = match (session.engine.drawn_geometry(), deepest) {
        _ if session.engine.analysis().is_some() => session.engine.visible().to_vec(),
        // The quadtree does not know what is in sight: the picture does.
        (Some(view), Some(deepest)) => visible_textures(capture, view, deepest).into_iter().collect(),
        _ => Vec::new(),
    };
    let requested: Map<String, Value> = session
        .engine
        .wanted()
        .iter()
        .map(|(layer, tiles)| (layer.name().to_owned(), addresses(tiles)))
        .collect();
    let mut document = serde_json::to_value(session.engine.stats()).map_err(ShotError::failure)?;
    document["texel_fetches_per_ray"] = fetch_statistics(capture.hit.iter().map(|hit| hit[3]));
    document["missed_rays"] = json!(missed);
    document["load_map"] = json!({"visible": addresses(&visible), "requested": requested});
    document["size"] = json!([capture.width, capture.height]);
    if !times.is_empty() {
        document["frame_milliseconds"] = json!(median(times));
    }
    Ok(document)
}
