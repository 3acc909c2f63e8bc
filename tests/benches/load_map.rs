//! What the Tile Load Map saves: bytes along recorded flights over the built-in landscape against the quadtree on the
//! CPU, at the same error of the last picture. Figures as JSON lines.

use anyhow::Context;
use treeline_client::engine::{DEFAULT_SHADOW_STEPS, Engine, EngineOptions, ViewRequest, Weather};
use treeline_client::headless::{self, AdapterChoice, Session};
use treeline_client::stream::StreamOptions;
use treeline_client::stream::tile_choice::TileChoice;
use treeline_core::camera::GeographicCamera;
use treeline_tests::flights::FLIGHTS;
use treeline_tests::http_tiles::HttpTiles;
use treeline_tests::picture;
use treeline_tests::program::Server;

const SIZE: [u32; 2] = [320, 256];
/// Views of a flight at which everything is awaited: so many that each shows much of what the one before did.
const VIEWS: usize = 24;
/// Pixels that a texel may fill: by default, and smaller, until the load map's pictures are no worse than the
/// quadtree's. (The quadtree refines a tile for its nearest point, so that most of what it draws is finer than asked
/// for; the map wants for each point what that point needs.)
const TEXEL_PIXELS: [f64; 4] = [1.42, 1.19, 1.0, 0.84];
/// The pictures to compare with: nearly three times as fine, and memory for all of it.
const REFERENCE: (f64, u64) = (0.5, 1 << 30);

/// A flight flown.
struct Run {
    /// Of the last view.
    picture: image::RgbaImage,
    bytes: u64,
    requests: u64,
}

fn fly(base: &str, views: &[GeographicCamera], stream: StreamOptions) -> anyhow::Result<Run> {
    let tiles = HttpTiles::new(base);
    let options = EngineOptions {
        stream: StreamOptions { fade_seconds: 0.0, ..stream },
        uploads_per_step: usize::MAX,
        // As on a graphics card.
        tree_metres: Some(1_000.0),
        ..EngineOptions::default()
    };
    let engine = Engine::new(headless::open(AdapterChoice::Software)?, tiles.scene()?, options)?;
    let mut session = Session::new(engine, SIZE[0], SIZE[1], 2)?;
    for &camera in views {
        let view = ViewRequest {
            camera,
            width: SIZE[0],
            height: SIZE[1],
            sun_unix_seconds: None,
            shadow_steps: DEFAULT_SHADOW_STEPS,
            weather: Weather::default(),
        };
        session.settle(&view, &tiles)?;
    }
    let picture = image::RgbaImage::from_raw(SIZE[0], SIZE[1], session.capture()?.rgba);
    let picture = picture.context("a picture of another size")?;
    Ok(Run { picture, bytes: tiles.bytes(), requests: tiles.requests() })
}

/// Mean difference of two runs' last pictures, of 255.
fn error(one: &Run, other: &Run) -> f64 {
    picture::difference(&one.picture, &other.picture, 24).mean
}

fn with(tile_choice: TileChoice, pixels: f64) -> StreamOptions {
    StreamOptions { tile_choice, texel_pixels: pixels, cell_pixels: pixels, ..StreamOptions::default() }
}

fn main() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let base = server.url("");
    for flight in FLIGHTS {
        let views = flight.views(VIEWS);
        let print = |name: &str, value: f64, unit: &str| {
            let name = format!("{}: {name}", flight.name);
            println!("{}", serde_json::json!({ "name": name, "value": value, "unit": unit }));
        };
        let finest =
            StreamOptions { memory_budget_bytes: REFERENCE.1, ..with(TileChoice::LoadMap, REFERENCE.0) };
        let reference = fly(&base, &views[VIEWS - 1..], finest)?;
        let quadtree = fly(&base, &views, with(TileChoice::Cpu, TEXEL_PIXELS[0]))?;
        let bar = error(&quadtree, &reference);
        print("quadtree, error", bar, "of 255");
        print("quadtree, bytes", quadtree.bytes as f64, "B");
        print("quadtree, requests", quadtree.requests as f64, "");
        for pixels in TEXEL_PIXELS {
            let map = fly(&base, &views, with(TileChoice::LoadMap, pixels))?;
            let of = |what: &str| format!("load map, {pixels} pixels a texel, {what}");
            print(&of("error"), error(&map, &reference), "of 255");
            print(&of("requests"), map.requests as f64, "");
            print(&of("bytes over the quadtree's"), map.bytes as f64 / quadtree.bytes as f64, "ratio");
            if error(&map, &reference) <= bar {
                break;
            }
        }
    }
    Ok(())
}
