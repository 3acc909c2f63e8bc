//! The light of a forest whose heights hold every crown, and of the same forest where they hold the mean: how much
//! brighter the second is, by sun and direction of sight. Figures as JSON lines.

use treeline_client::engine::{DEFAULT_SHADOW_STEPS, Engine, EngineOptions, ViewRequest};
use treeline_client::headless::{self, AdapterChoice, Session};
use treeline_client::stream::tile_choice::TileChoice;
use treeline_client::stream::{StreamOptions, SurfaceChoice};
use treeline_core::camera::GeographicCamera;
use treeline_tests::http_tiles::HttpTiles;
use treeline_tests::program::Server;

const SIZE: [u32; 2] = [192, 120];
/// Pixels that a cell may fill: crowns, and their mean.
const CELL_PIXELS: [f64; 2] = [0.5, 2.2];
/// Distances of the forest compared, metres.
const DISTANCES: std::ops::Range<f32> = 700.0..2_000.0;
/// Over the built-in landscape's forest slopes; metres, heading and pitch.
const VIEWS: [[f64; 5]; 4] = [
    [11.1962, 47.0463, 1_000.0, 250.0, -6.0],
    [11.1962, 47.0463, 1_000.0, 70.0, -6.0],
    [11.194, 47.0700, 1_200.0, 200.0, -18.0],
    [11.194, 47.0700, 1_200.0, 20.0, -18.0],
];
/// Morning, noon and late afternoon of the scene's day, seconds after its own time.
const HOURS: [f64; 3] = [-3.0, 0.0, 5.0];

/// Linear brightness of each pixel of a picture, and whether it lies in the distances compared.
type Picture = Vec<(f64, [u8; 3], bool)>;

fn picture(session: &mut Session, tiles: &HttpTiles, view: [f64; 5], hours: f64) -> anyhow::Result<Picture> {
    let [lon, lat, height, heading_deg, pitch_deg] = view;
    let time = treeline_core::sun::unix_seconds_from_rfc3339(&session.engine.scene().sun.time)?;
    let view = ViewRequest {
        camera: GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 20.0 },
        width: SIZE[0],
        height: SIZE[1],
        sun_unix_seconds: Some(time + 3_600.0 * hours),
        shadow_steps: DEFAULT_SHADOW_STEPS,
        weather: treeline_client::engine::Weather::default(),
    };
    session.settle(&view, tiles)?;
    let capture = session.capture()?;
    let linear = |value: u8| (f64::from(value) / 255.0).powf(2.2);
    Ok(capture
        .rgba
        .chunks_exact(4)
        .zip(&capture.distance)
        .map(|(rgba, distance)| {
            let light = 0.2126 * linear(rgba[0]) + 0.7152 * linear(rgba[1]) + 0.0722 * linear(rgba[2]);
            (light, [rgba[0], rgba[1], rgba[2]], DISTANCES.contains(distance))
        })
        .collect())
}

fn main() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let tiles = HttpTiles::new(&server.url(""));
    let session = |cell_pixels: f64, surface: SurfaceChoice| -> anyhow::Result<Session> {
        let stream = StreamOptions {
            fade_seconds: 0.0,
            cell_pixels,
            surface,
            tile_choice: TileChoice::Cpu,
            memory_budget_bytes: 1 << 30,
            ..StreamOptions::default()
        };
        let options = EngineOptions {
            stream,
            uploads_per_step: usize::MAX,
            tree_metres: Some(0.0),
            ..EngineOptions::default()
        };
        let engine = Engine::new(headless::open(AdapterChoice::Software)?, tiles.scene()?, options)?;
        Ok(Session::new(engine, SIZE[0], SIZE[1], 2)?)
    };
    let mut crowns = session(CELL_PIXELS[0], SurfaceChoice::Combined)?;
    let mut mean = session(CELL_PIXELS[1], SurfaceChoice::Combined)?;
    let mut bare = session(CELL_PIXELS[1], SurfaceChoice::Elevation)?;
    let start = treeline_core::sun::unix_seconds_from_rfc3339(&tiles.scene()?.sun.time)?;
    for view in VIEWS {
        for hours in HOURS {
            let crowns = picture(&mut crowns, &tiles, view, hours)?;
            let mean = picture(&mut mean, &tiles, view, hours)?;
            let bare = picture(&mut bare, &tiles, view, hours)?;
            // Forest is what the bare ground looks unlike.
            let forest: Vec<usize> = (0..mean.len())
                .filter(|&at| mean[at].2 && crowns[at].2)
                .filter(|&at| (0..3).any(|band| mean[at].1[band].abs_diff(bare[at].1[band]) > 8))
                .collect();
            let sum = |picture: &Picture| {
                forest.iter().map(|&at| picture[at].0).sum::<f64>() / forest.len().max(1) as f64
            };
            let square = |picture: &Picture| {
                let average = sum(picture);
                let spread: f64 = forest.iter().map(|&at| (picture[at].0 - average).powi(2)).sum();
                (spread / forest.len().max(1) as f64).sqrt() / average
            };
            let sun = treeline_core::sun::SunPosition::at(start + 3_600.0 * hours, view[0], view[1])
                .direction_enu();
            println!(
                "{}",
                serde_json::json!({
                    "name": format!("heading {}, {hours:+} h", view[3]),
                    "pixels": forest.len(), "sun": [sun.z.asin().to_degrees(), sun.x.atan2(sun.y).to_degrees()],
                    "light of the mean over that of crowns": sum(&mean) / sum(&crowns),
                    "light of crowns": sum(&crowns),
                    "contrast of crowns": square(&crowns),
                    "contrast of the mean": square(&mean),
                })
            );
        }
    }
    Ok(())
}
