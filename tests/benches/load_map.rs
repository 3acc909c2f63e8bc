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
/// Pixels that a texel of the photo, and a cell of the heights, may fill: as both have it by default, then finer, until
/// the load map's pictures are no worse than the quadtree's. (The quadtree refines a tile for its nearest point, so
/// that most of what it draws is finer than asked for; the map wants for each point what that point needs.) A photo
/// tile weighs a fifth of one of heights, so that finer photos come first.
const PIXELS: [[f64; 2]; 6] =
    [[1.42, 1.42], [0.71, 1.42], [0.5, 1.0], [0.84, 0.84], [0.71, 0.71], [0.5, 0.5]];
/// The pictures to compare with: finer than all of these, and memory for all of it.
const REFERENCE: (f64, u64) = (0.25, 3 << 30);
/// Rays a side of a pixel in pictures without noise of one ray a pixel.
const FINE: u32 = 4;

/// A flight flown.
struct Run {
    /// Of the last view.
    picture: image::RgbaImage,
    /// The same tiles, drawn with [`FINE`]² rays a pixel.
    fine: image::RgbaImage,
    /// Of tiles.
    bytes: u64,
    /// Of models of trees, which both ways want alike.
    model_bytes: u64,
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
        session.settle(&view(camera, 1), &tiles)?;
    }
    let picture = drawn(&session, 1)?;
    let (model_bytes, requests) = (tiles.model_bytes(), tiles.requests());
    let bytes = tiles.bytes() - model_bytes;
    // What is here, drawn finer: nothing more is fetched.
    session.draw(&view(*views.last().context("a flight without views")?, FINE))?;
    let fine = picture::reduced(&drawn(&session, FINE)?, FINE);
    Ok(Run { picture, fine, bytes, model_bytes, requests })
}

/// A view whose picture is `scale` times as large as [`SIZE`].
fn view(camera: GeographicCamera, scale: u32) -> ViewRequest {
    ViewRequest {
        camera,
        width: SIZE[0] * scale,
        height: SIZE[1] * scale,
        sun_unix_seconds: None,
        shadow_steps: DEFAULT_SHADOW_STEPS,
        weather: Weather::default(),
    }
}

/// The picture last drawn, `scale` times as large as [`SIZE`].
fn drawn(session: &Session, scale: u32) -> anyhow::Result<image::RgbaImage> {
    let [width, height] = SIZE.map(|side| side * scale);
    image::RgbaImage::from_raw(width, height, session.capture()?.rgba).context("a picture of another size")
}

/// Mean difference of two runs' last pictures, of 255: of those without the noise of one ray a pixel, and of those
/// that are seen.
fn errors(one: &Run, other: &Run) -> [f64; 2] {
    [(&one.fine, &other.fine), (&one.picture, &other.picture)]
        .map(|(one, other)| picture::difference(one, other, 24).mean)
}

fn with(tile_choice: TileChoice, [texel_pixels, cell_pixels]: [f64; 2]) -> StreamOptions {
    StreamOptions { tile_choice, texel_pixels, cell_pixels, ..StreamOptions::default() }
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
            StreamOptions { memory_budget_bytes: REFERENCE.1, ..with(TileChoice::LoadMap, [REFERENCE.0; 2]) };
        let reference = fly(&base, &views[VIEWS - 1..], finest)?;
        let quadtree = fly(&base, &views, with(TileChoice::Cpu, PIXELS[0]))?;
        let [bar, seen] = errors(&quadtree, &reference);
        print("quadtree, error, 16 rays a pixel", bar, "of 255");
        print("quadtree, error, one ray a pixel", seen, "of 255");
        print("quadtree, bytes of tiles", quadtree.bytes as f64, "B");
        print("bytes of models of trees", quadtree.model_bytes as f64, "B");
        print("quadtree, requests", quadtree.requests as f64, "");
        for pixels in PIXELS {
            let map = fly(&base, &views, with(TileChoice::LoadMap, pixels))?;
            let of =
                |what: &str| format!("load map, {} pixels a texel, {} a cell, {what}", pixels[0], pixels[1]);
            let [error, seen] = errors(&map, &reference);
            print(&of("error, 16 rays a pixel"), error, "of 255");
            print(&of("error, one ray a pixel"), seen, "of 255");
            print(&of("requests"), map.requests as f64, "");
            print(&of("bytes over the quadtree's"), map.bytes as f64 / quadtree.bytes as f64, "ratio");
            if error <= bar {
                break;
            }
        }
    }
    Ok(())
}
