//! The map in a real browser, over the built-in landscape.

use anyhow::{Context, ensure};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::time::Duration;
use treeline_core::camera::GeographicCamera;
use treeline_tests::browser::{Browser, Page, Pointer};
use treeline_tests::geotiff::{self, Placement};
use treeline_tests::picture;
use treeline_tests::program::{self, Server};

/// Size of the picture: small enough for a software adapter.
const SIZE: (u32, u32) = (256, 192);
/// How long a software adapter on a busy machine may take for anything.
const PATIENCE: Duration = Duration::from_secs(90);

/// The map, settled, with everything on screen but the picture hidden.
fn open(browser: &Browser, url: &str) -> anyhow::Result<Page> {
    let mut page = browser.open(url, SIZE.0, SIZE.1)?;
    page.settle()?;
    Ok(page)
}

fn same_view(one: &GeographicCamera, other: &GeographicCamera) -> bool {
    (one.lon - other.lon).abs() < 1e-7
        && (one.lat - other.lat).abs() < 1e-7
        && (one.height - other.height).abs() < 0.01
        && (one.heading_deg - other.heading_deg).abs() < 1e-3
        && (one.pitch_deg - other.pitch_deg).abs() < 1e-3
}

#[test]
fn browser_opens_flies_and_rests() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let browser = Browser::start()?;
    let mut page = open(&browser, &server.url("/"))?;

    // Every tile is asked for by GetMap, and nothing complained.
    let requests = page.requests()?;
    let data: Vec<&String> =
        requests.iter().filter(|url| url.contains("/wms") || url.contains("/tiles/")).collect();
    ensure!(data.len() > 3, "tiles were requested: {requests:?}");
    for url in data {
        ensure!(url.contains("/wms?") && url.contains("REQUEST=GetMap"), "{url}");
    }
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);

    // Nothing moves: no frame is drawn.
    let frames = "window.treeline.stats().page.frames_drawn";
    let before = page.evaluate(frames)?;
    std::thread::sleep(Duration::from_millis(700));
    ensure!(page.evaluate(frames)? == before, "frames were drawn while nothing changed");
    ensure!(before.as_u64().is_some_and(|count| count > 0), "{before}");

    // By keyboard.
    let start = page.camera()?;
    page.hold_key("KeyW", "w", Duration::from_millis(400))?;
    page.wait_for(&format!("window.treeline.camera().lat !== {}", start.lat), PATIENCE)?;
    page.settle()?;
    let flown = page.camera()?;
    ensure!(!same_view(&start, &flown), "{flown:?}");
    ensure!((flown.pitch_deg - start.pitch_deg).abs() < 1e-6, "W flies level: {flown:?}");

    // By dragging the ground, and by turning.
    page.drag(Pointer::Left, (128.0, 120.0), (140.0, 160.0))?;
    page.wait_for(&format!("window.treeline.camera().lat !== {}", flown.lat), PATIENCE)?;
    page.settle()?;
    let dragged = page.camera()?;
    ensure!(!same_view(&flown, &dragged), "{dragged:?}");
    page.drag(Pointer::Right, (128.0, 96.0), (168.0, 96.0))?;
    page.wait_for(&format!("window.treeline.camera().heading_deg !== {}", dragged.heading_deg), PATIENCE)?;
    page.wheel((128.0, 120.0), -200.0)?;
    page.settle()?;
    ensure!((page.camera()?.heading_deg - dragged.heading_deg).abs() > 10.0, "a right drag turns");

    // The address holds the view, and another tab restores it.
    let place = page.camera()?;
    page.wait_for("location.hash.startsWith('#camera=')", PATIENCE)?;
    let address = page.evaluate("location.href")?;
    let mut link = open(&browser, address.as_str().context("an address")?)?;
    ensure!(same_view(&place, &link.camera()?), "{place:?} is not {:?}", link.camera()?);
    for page in [&mut page, &mut link] {
        ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    }
    Ok(())
}

#[test]
fn browser_draws_what_treeline_shot_draws() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let scene = ureq::get(&server.url("/scene.json")).call()?.body_mut().read_to_string()?;
    let scene: treeline_core::scene::SceneDescription = serde_json::from_str(&scene)?;
    let browser = Browser::start()?;
    let mut page = open(&browser, &server.url("/"))?;
    page.evaluate(&format!(
        "window.treeline.setCamera({}); window.treeline.settled().then(() => true)",
        serde_json::to_string(&scene.camera)?
    ))?;
    let shown = page.picture()?;
    ensure!(shown.dimensions() == SIZE, "{:?}", shown.dimensions());
    ensure!(picture::contrast(&shown) > 10.0, "a blank picture");
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);

    let folder = tempfile::tempdir()?;
    let camera = folder.path().join("camera.json");
    std::fs::write(&camera, serde_json::to_string(&scene.camera)?)?;
    let (color, stats) = (folder.path().join("color.png"), folder.path().join("stats.json"));
    let output = std::process::Command::new(program::path("treeline-shot")?)
        .args(["--server", &server.url("/")])
        .args(["--adapter", "software", "--size", &format!("{}x{}", SIZE.0, SIZE.1)])
        .arg("--camera")
        .arg(&camera)
        .arg("--color")
        .arg(&color)
        .arg("--stats")
        .arg(&stats)
        .output()?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let shot = image::open(&color)?.to_rgba8();
    let difference = picture::difference(&shown, &shot, 24);
    println!("page against treeline-shot: {difference:?}");

    // The tiles in sight are the same, read back in the browser and natively.
    let stats: Value = serde_json::from_slice(&std::fs::read(&stats)?)?;
    let native: BTreeSet<Vec<u64>> = serde_json::from_value(stats["load_map"]["visible"].clone())?;
    let in_sight = "window.treeline.loadMap().filter((tile) => tile.visible)\
                    .map((tile) => [tile.level, tile.row, tile.column])";
    let read_back: BTreeSet<Vec<u64>> = serde_json::from_value(page.evaluate(in_sight)?)?;
    println!("{} tiles in sight", native.len());
    ensure!(native.len() > 5 && native == read_back, "{native:?} natively, {read_back:?} in the browser");
    // Two limits: how far off on the whole, and how many pixels are off at all.
    if difference.mean >= 0.5 || difference.share_over >= 0.005 {
        let paths = [picture::keep("browser", &shown)?, picture::keep("shot", &shot)?];
        anyhow::bail!("{difference:?}; see {paths:?}");
    }
    Ok(())
}

/// A link into the wood near the middle of the built-in landscape, looking along a slope.
const WOOD: &str = "#camera=10.87,46.85,1650,40,-20";

#[test]
fn browser_selects_the_trees_that_treeline_shot_lists() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let browser = Browser::start()?;
    let mut page = open(&browser, &server.url(&format!("/?trees=250{WOOD}")))?;
    // The camera as the page has it, once it has lifted it over the ground.
    let camera = page.camera()?;
    // Counts come back a frame later.
    page.evaluate(
        "window.treeline.pause(); window.treeline.step().then(() => window.treeline.step()).then(() => true)",
    )?;
    page.wait_for("window.treeline.stats().seeds.selected > 0", PATIENCE)?;
    let stats = page.evaluate("window.treeline.stats().seeds")?;
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);

    let folder = tempfile::tempdir()?;
    let (view, trees) = (folder.path().join("camera.json"), folder.path().join("trees.csv"));
    std::fs::write(&view, serde_json::to_string(&camera)?)?;
    let output = std::process::Command::new(program::path("treeline-shot")?)
        .args(["--server", &server.url("/"), "--adapter", "software", "--tree-distance", "250"])
        .args(["--size", &format!("{}x{}", SIZE.0, SIZE.1)])
        .args([std::ffi::OsStr::new("--camera"), view.as_os_str()])
        .args([std::ffi::OsStr::new("--trees"), trees.as_os_str()])
        .output()?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let listed = std::fs::read_to_string(&trees)?.lines().count() - 1;
    println!("{listed} trees; the page says {stats}");
    ensure!(listed > 50 && stats["selected"] == json!(listed), "{listed} listed, {stats} in the browser");
    ensure!(stats["checked"].as_u64() > stats["selected"].as_u64(), "{stats}");
    Ok(())
}

#[test]
fn browser_api_pauses_steps_and_sizes() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let browser = Browser::start()?;
    let mut page = open(&browser, &server.url("/"))?;
    page.evaluate("window.treeline.setSize(128, 96)")?;
    page.settle()?;
    let size = page.evaluate("[window.treeline.stats().page.width, window.treeline.stats().page.height]")?;
    ensure!(size == json!([128, 96]), "{size}");
    let frames = "window.treeline.stats().page.frames_drawn";
    page.evaluate("window.treeline.pause()")?;
    let paused = page.evaluate(frames)?.as_u64().context("a count")?;
    page.evaluate("window.treeline.setCamera({...window.treeline.camera(), heading_deg: 77})")?;
    std::thread::sleep(Duration::from_millis(300));
    ensure!(page.evaluate(frames)? == json!(paused), "a paused page draws nothing");
    page.evaluate("window.treeline.step().then(() => true)")?;
    ensure!(page.evaluate(frames)? == json!(paused + 1), "a step is one frame");
    page.evaluate("window.treeline.resume()")?;
    page.settle()?;
    ensure!((page.camera()?.heading_deg - 77.0).abs() < 1e-9);
    // A camera that cannot be is refused with a line that names the field.
    let refused = page
        .evaluate("try { window.treeline.setCamera({...window.treeline.camera(), lat: 91}); '' } catch (error) { error.message }")?;
    ensure!(refused.as_str().is_some_and(|text| text.contains("lat")), "{refused}");
    // Under the ground is lifted above it.
    page.evaluate("window.treeline.setCamera({...window.treeline.camera(), height: -4000})")?;
    page.settle()?;
    ensure!(page.camera()?.height > -4000.0, "{:?}", page.camera()?);
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    Ok(())
}

#[test]
fn browser_leaves_the_choice_of_tiles_to_the_quadtree_where_asked() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let dem = folder.path().join("terrain.tif");
    let placement = Placement { west: 8.0, north: 46.5, step: [5.0e-5; 2], columns: 1200, rows: 1000 };
    geotiff::write_heights(&dem, &placement, |longitude, latitude| {
        (900.0 + 300.0 * (longitude * 230.0).sin() * (latitude * 250.0).cos()) as f32
    })?;
    let server = Server::start(&["--dem", dem.to_str().context("a path")?])?;
    let browser = Browser::start()?;
    let view = "#camera=8.03,46.46,2600,20,-35";
    let mut pictures = Vec::new();
    for (tiles, has_map) in [("cpu", false), ("load-map", true)] {
        let mut page = open(&browser, &server.url(&format!("/?tiles={tiles}{view}")))?;
        let pipelines = page.evaluate("window.treeline.stats().pipelines.includes('load_map')")?;
        ensure!(pipelines == json!(has_map), "?tiles={tiles}");
        ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
        pictures.push(page.picture()?);
    }
    let difference = picture::difference(&pictures[0], &pictures[1], 24);
    println!("load map against quadtree: {difference:?}");
    ensure!(difference.mean < 0.5 && difference.share_over < 0.005, "{difference:?}");
    Ok(())
}

/// Which of its messages the page shows.
fn message(page: &mut Page) -> anyhow::Result<Value> {
    page.wait_for("document.getElementById('message').hidden === false", PATIENCE)?;
    page.evaluate("document.getElementById('message').dataset.kind")
}

#[test]
fn browser_that_lacks_something_is_told_what() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let browser = Browser::start_without_adapter()?;
    let mut page = browser.open(&server.url("/"), SIZE.0, SIZE.1)?;
    ensure!(message(&mut page)? == "no-adapter");
    // As in a browser that never heard of WebGPU.
    let forget = "delete Navigator.prototype.gpu";
    let mut page = browser.open_after(forget, &server.url("/"), SIZE.0, SIZE.1)?;
    ensure!(message(&mut page)? == "no-webgpu");
    drop((page, browser));
    // The same server by a name that makes no secure context: WebGPU seems missing there, but is not.
    let browser = Browser::start()?;
    let (_, port) = server.address().rsplit_once(':').context("a port")?;
    let mut page = browser.open(&format!("http://treeline.test:{port}/"), SIZE.0, SIZE.1)?;
    ensure!(message(&mut page)? == "insecure");
    let text = page.evaluate("document.getElementById('message').innerText")?;
    ensure!(text.as_str().is_some_and(|text| text.contains("https://treeline.test")), "{text}");
    Ok(())
}
