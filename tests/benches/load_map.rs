//! What the Tile Load Map saves: bytes along recorded flights against the quadtree on the CPU, at the
//! same final picture; and what reading a map costs.

use anyhow::ensure;
use treeline_client::engine::{DEFAULT_SHADOW_STEPS, Engine, EngineOptions, ViewRequest};
use treeline_client::headless::{self, AdapterChoice, Session};
use treeline_client::stream::StreamOptions;
use treeline_client::stream::tile_choice::TileChoice;
use treeline_core::camera::GeographicCamera;
use treeline_tests::flights::FLIGHTS;
use treeline_tests::http_tiles::HttpTiles;
use treeline_tests::picture;
use treeline_tests::program::Server;

const SIZE: [u32; 2] = [320, 256];
/// Views of a flight at which everything is awaited.
const VIEWS: usize = 5;
/// Memory of a run in which whatever is wanted is resident, bytes.
const ALL_BYTES: u64 = 1 << 30;

/// A flight flown.
struct Run {
    pictures: Vec<image::RgbaImage>,
    bytes: u64,
    requests: u64,
}

fn fly(
    base: &str,
    views: &[GeographicCamera],
    choice: TileChoice,
    budget: Option<u64>,
) -> anyhow::Result<Run> {
    let tiles = HttpTiles::new(base);
    let defaults = StreamOptions::default();
    let options = EngineOptions {
        stream: StreamOptions {
            tile_choice: choice,
            memory_budget_bytes: budget.unwrap_or(defaults.memory_budget_bytes),
            fade_seconds: 0.0,
            ..defaults
        },
        uploads_per_step: usize::MAX,
        ..EngineOptions::default()
    };
    let engine = Engine::new(headless::open(AdapterChoice::Software)?, tiles.scene()?, options)?;
    let mut session = Session::new(engine, SIZE[0], SIZE[1], 2)?;
    let mut pictures = Vec::new();
    for &camera in views {
        let view = ViewRequest {
            camera,
            width: SIZE[0],
            height: SIZE[1],
            sun_unix_seconds: None,
            shadow_steps: DEFAULT_SHADOW_STEPS,
        };
        session.settle(&view, &tiles)?;
        let capture = session.capture()?;
        let picture = image::RgbaImage::from_raw(SIZE[0], SIZE[1], capture.rgba);
        pictures.extend(picture);
    }
    ensure!(pictures.len() == views.len(), "a picture of another size");
    Ok(Run { pictures, bytes: tiles.bytes(), requests: tiles.requests() })
}

/// Mean difference of two runs' pictures, of 255.
fn difference(one: &Run, other: &Run) -> f64 {
    let pairs = one.pictures.iter().zip(&other.pictures);
    pairs.map(|(one, other)| picture::difference(one, other, 24).mean).sum::<f64>()
        / one.pictures.len() as f64
}

fn print(name: &str, value: f64, unit: &str) {
    println!("{}", serde_json::json!({ "name": name, "value": value, "unit": unit }));
}

fn main() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let base = server.url("");
    for flight in FLIGHTS {
        let views = flight.views(VIEWS);
        let all = fly(&base, &views, TileChoice::Cpu, Some(ALL_BYTES))?;
        let cpu = fly(&base, &views, TileChoice::Cpu, None)?;
        let map = fly(&base, &views, TileChoice::LoadMap, None)?;
        let name = flight.name;
        print(
            &format!("{name}: bytes, load map over quadtree"),
            map.bytes as f64 / cpu.bytes as f64,
            "ratio",
        );
        print(&format!("{name}: requests, load map"), map.requests as f64, "");
        print(&format!("{name}: requests, quadtree"), cpu.requests as f64, "");
        print(&format!("{name}: picture, load map against all"), difference(&map, &all), "of 255");
        print(&format!("{name}: picture, quadtree against all"), difference(&cpu, &all), "of 255");
    }
    Ok(())
}
