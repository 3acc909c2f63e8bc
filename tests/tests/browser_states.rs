//! The page when things go wrong or are unusual: a lost device, a server that goes away, nothing to show, a
//! link that cannot be read; fingers instead of a mouse; and how many bytes all that took.

use anyhow::{Context, ensure};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::Duration;
use treeline_tests::browser::{Browser, Page};
use treeline_tests::geotiff::{self, NODATA, Placement};
use treeline_tests::picture;
use treeline_tests::program::Server;

const SIZE: (u32, u32) = (256, 192);
/// How long a software adapter on a busy machine may take for anything.
const PATIENCE: Duration = Duration::from_secs(60);
/// A small terrain, but with finer levels than those that are loaded first and kept.
const PLACEMENT: Placement =
    Placement { west: 8.0, north: 46.5, step: [5.0e-5; 2], columns: 1600, rows: 1200 };
/// A view of it, as an address has it.
const VIEW: &str = "/#camera=8.04,46.45,3200,20,-35";
/// Keeps every device that the page opens.
const DEVICE_KEEPER: &str = "window.devices = []; \
    const requestDevice = GPUAdapter.prototype.requestDevice; \
    GPUAdapter.prototype.requestDevice = async function (...all) { \
      const device = await requestDevice.apply(this, all); \
      window.devices.push(device); return device; };";

fn hills(longitude: f64, latitude: f64) -> f32 {
    (1_200.0 + 400.0 * (longitude * 220.0).sin() * (latitude * 260.0).cos()) as f32
}

/// A DEM in a folder; gives its path.
fn dem(folder: &Path, height: impl Fn(f64, f64) -> f32) -> anyhow::Result<String> {
    let path = folder.join("terrain.tif");
    geotiff::write_heights(&path, &PLACEMENT, height)?;
    Ok(path.to_str().context("a path")?.to_owned())
}

fn open(browser: &Browser, url: &str) -> anyhow::Result<Page> {
    let mut page = browser.open(url, SIZE.0, SIZE.1)?;
    page.settle()?;
    Ok(page)
}

/// The text of the notice about something, empty where there is none.
fn notice(page: &mut Page, about: &str) -> anyhow::Result<String> {
    let text =
        page.evaluate(&format!("document.querySelector('#notice [data-about={about}]')?.textContent ?? ''"))?;
    Ok(text.as_str().unwrap_or_default().to_owned())
}

fn wait_for_notice(page: &mut Page, about: &str, is_there: bool) -> anyhow::Result<()> {
    let found = format!("document.querySelector('#notice [data-about={about}]')");
    page.wait_for(&format!("Boolean({found}) === {is_there}"), PATIENCE)
}

#[test]
fn browser_that_loses_its_device_opens_another_and_draws_the_same() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let server = Server::start(&["--dem", &dem(folder.path(), hills)?])?;
    let browser = Browser::start()?;
    let mut page = browser.open_after(DEVICE_KEEPER, &server.url(VIEW), SIZE.0, SIZE.1)?;
    page.settle()?;
    let before = page.picture()?;
    ensure!(picture::contrast(&before) > 5.0, "a blank picture");
    let started = page.evaluate("window.treeline.stats().requests.started")?.as_u64().context("a count")?;
    page.evaluate("window.treeline.resume()")?;

    // As when a driver gives up, and as when the browser's whole process for graphics ends.
    for devices in 2..=3 {
        if devices == 2 {
            page.evaluate("window.devices.at(-1).destroy()")?;
        } else {
            page.crash_graphics()?;
        }
        page.wait_for(&format!("window.treeline.stats().page.devices === {devices}"), PATIENCE)?;
        page.settle()?;
        ensure!(page.picture()? == before, "another picture on device {devices}");
        ensure!(notice(&mut page, "device")?.is_empty(), "{}", notice(&mut page, "device")?);
        page.evaluate("window.treeline.resume()")?;
    }
    let counted = page.evaluate("window.treeline.stats().requests.started")?.as_u64().context("a count")?;
    ensure!(counted >= 3 * started, "{counted} requests since the start, after {started} for one picture");
    let camera = page.camera()?;
    ensure!((camera.lon - 8.04).abs() < 1e-6 && (camera.height - 3200.0).abs() < 0.01, "{camera:?}");

    // Lost again and again: the page says so, and offers to begin anew.
    page.evaluate("setInterval(() => window.devices.at(-1).destroy(), 50)")?;
    page.wait_for("document.getElementById('message').hidden === false", PATIENCE)?;
    let shown = page.evaluate(
        "[document.getElementById('message').dataset.kind, document.querySelector('#message button').hidden]",
    )?;
    ensure!(shown == json!(["device-lost", false]), "{shown}");
    keep_if_asked(&mut page, "device-lost")?;
    page.evaluate("document.querySelector('#message button').click()")?;
    page.wait_for("window.treeline?.stats().page.devices === 1", PATIENCE)?;
    page.settle()?;
    ensure!(page.picture()? == before, "another picture after a new beginning");
    Ok(())
}

#[test]
fn browser_says_that_the_server_is_gone_and_goes_on_when_it_is_back() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let dem = dem(folder.path(), hills)?;
    let server = Server::start(&["--dem", &dem])?;
    let address = server.address().to_owned();
    let browser = Browser::start()?;
    let mut page = open(&browser, &server.url("/#camera=8.04,46.47,9000,0,-80"))?;
    ensure!(notice(&mut page, "server")?.is_empty());

    // In the middle of a flight to where other tiles are wanted.
    page.key("KeyW", "w", true)?;
    drop(server);
    page.evaluate(
        "window.treeline.setCamera({lon: 8.03, lat: 46.46, height: 1900, heading_deg: 40, pitch_deg: -15})",
    )?;
    wait_for_notice(&mut page, "server", true)?;
    page.key("KeyW", "w", false)?;
    ensure!(notice(&mut page, "server")?.contains("does not answer"), "{}", notice(&mut page, "server")?);
    keep_if_asked(&mut page, "server-gone")?;

    // It still draws what it has.
    let frames = page.evaluate("window.treeline.stats().page.frames_drawn")?;
    page.evaluate(
        "window.treeline.setCamera({lon: 8.03, lat: 46.46, height: 2000, heading_deg: 75, pitch_deg: -25})",
    )?;
    page.wait_for(&format!("window.treeline.stats().page.frames_drawn > {frames}"), PATIENCE)?;
    let coarse = page.picture()?;
    ensure!(picture::contrast(&coarse) > 5.0, "a blank picture");
    page.evaluate("window.treeline.resume()")?;
    ensure!(page.evaluate("window.treeline.stats().page.settled")? == json!(false), "tiles are missing");

    let _server = Server::start_at(&address, &["--dem", &dem])?;
    wait_for_notice(&mut page, "server", false)?;
    page.settle()?;
    let fine = page.picture()?;
    let mut other = open(&browser, &format!("http://{address}/#camera=8.03,46.46,2000,75,-25"))?;
    let difference = picture::difference(&fine, &other.picture()?, 24);
    ensure!(difference.mean < 0.5 && difference.share_over < 0.005, "{difference:?}");
    // Nothing but the browser's own lines about requests that found no server.
    let complaints = page.complaints()?;
    ensure!(complaints.iter().all(|line| line.contains("net::ERR")), "{complaints:?}");
    Ok(())
}

#[test]
fn browser_says_that_there_is_nothing_to_show() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let server = Server::start(&["--dem", &dem(folder.path(), |_, _| NODATA)?])?;
    let browser = Browser::start()?;
    let mut page = browser.open(&server.url("/"), SIZE.0, SIZE.1)?;
    page.wait_for("document.getElementById('message').hidden === false", PATIENCE)?;
    let kind = page.evaluate("document.getElementById('message').dataset.kind")?;
    ensure!(kind == "empty-scene", "{kind}");
    let text = page.evaluate("document.getElementById('message').innerText")?;
    ensure!(
        text.as_str().is_some_and(|text| text.contains("no landscape") && text.contains("no data")),
        "{text}"
    );
    keep_if_asked(&mut page, "empty-scene")?;
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    Ok(())
}

#[test]
fn browser_takes_a_wrong_link_with_a_word() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let server = Server::start(&["--dem", &dem(folder.path(), hills)?])?;
    let browser = Browser::start()?;
    let mut page = open(&browser, &server.url("/"))?;
    let first = page.camera()?;
    for (fragment, word) in [
        ("camera=8.04,north,3200,20,-35", "north"),
        ("camera=8.04,99,3200,20,-35", "lat"),
        ("camera=1,2", "five"),
    ] {
        let mut page = open(&browser, &server.url(&format!("/#{fragment}")))?;
        let text = notice(&mut page, "address")?;
        ensure!(text.contains(word) && text.contains("link"), "{fragment}: {text}");
        keep_if_asked(&mut page, "wrong-link")?;
        let camera = page.camera()?;
        ensure!(
            (camera.lon - first.lon).abs() < 1e-7 && camera.height == first.height,
            "{camera:?} is not {first:?}"
        );
        // The person may close it, and the address becomes a good one.
        page.evaluate("document.querySelector('#notice button').click()")?;
        ensure!(notice(&mut page, "address")?.is_empty());
        page.wait_for("/^#camera=[-0-9.,]+$/.test(location.hash)", PATIENCE)?;
        ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    }
    ensure!(notice(&mut page, "address")?.is_empty());
    Ok(())
}

#[test]
fn browser_follows_fingers() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let server = Server::start(&["--dem", &dem(folder.path(), hills)?])?;
    let browser = Browser::start()?;
    let mut page = open(&browser, &server.url("/#camera=8.04,46.47,6000,0,-70"))?;
    let start = page.camera()?;

    // One finger holds the ground: drawn down, the eye goes north, and nothing else changes.
    page.swipe(&[(128.0, 80.0)], &[(128.0, 130.0)])?;
    page.settle()?;
    let panned = page.camera()?;
    ensure!(panned.lat > start.lat + 1e-4, "{start:?} {panned:?}");
    ensure!(
        (panned.lon - start.lon).abs() < 1e-3 && (panned.pitch_deg - start.pitch_deg).abs() < 0.5,
        "{panned:?}"
    );

    // Two fingers apart come nearer.
    page.swipe(&[(118.0, 96.0), (138.0, 96.0)], &[(88.0, 96.0), (168.0, 96.0)])?;
    page.settle()?;
    let near = page.camera()?;
    ensure!(near.height < panned.height - 1_000.0, "{panned:?} {near:?}");

    // Two fingers round each other turn: a quarter clockwise.
    let round = |degrees: f64| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        vec![(128.0 - 40.0 * cosine, 96.0 - 40.0 * sine), (128.0 + 40.0 * cosine, 96.0 + 40.0 * sine)]
    };
    page.swipe(&round(0.0), &round(60.0))?;
    page.settle()?;
    let turned = page.camera()?;
    let turn = (turned.heading_deg - near.heading_deg + 540.0).rem_euclid(360.0) - 180.0;
    ensure!((-80.0..-30.0).contains(&turn), "turned by {turn}°: {turned:?}");

    // Two fingers side by side, both up: tilts.
    page.swipe(&[(98.0, 130.0), (158.0, 130.0)], &[(98.0, 90.0), (158.0, 90.0)])?;
    page.settle()?;
    ensure!((page.camera()?.pitch_deg - turned.pitch_deg).abs() > 5.0, "{turned:?} {:?}", page.camera()?);
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    Ok(())
}

/// Bytes of the bodies of all tiles that were asked for, by layer, as a server sends them in an encoding.
fn sent(server: &Server, requests: &[String], encoding: &str) -> anyhow::Result<BTreeMap<String, u64>> {
    let mut sent = BTreeMap::new();
    for url in requests.iter().filter(|url| url.contains("/wms?")) {
        let (_, rest) = url.split_once("LAYERS=").context("a layer")?;
        let layer = rest.split('&').next().unwrap_or_default().to_owned();
        let (_, path) = url.split_once("/wms?").context("a query")?;
        // By hand, and by HTTP 1.0: neither unpacked nor in chunks.
        let mut stream = TcpStream::connect(server.address())?;
        write!(stream, "GET /wms?{path} HTTP/1.0\r\nAccept-Encoding: {encoding}\r\n\r\n")?;
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer)?;
        let head = answer.windows(4).position(|four| four == b"\r\n\r\n").context("a head")? + 4;
        ensure!(answer.starts_with(b"HTTP/1.0 200"), "{url}: {}", String::from_utf8_lossy(&answer[..head]));
        *sent.entry(layer).or_default() += (answer.len() - head) as u64;
    }
    Ok(sent)
}

#[test]
fn browser_counts_what_crossed_the_network() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let dem = dem(folder.path(), hills)?;
    let same = Server::start(&["--dem", &dem])?;
    // A server that says another name of itself: its tiles are of another origin than the page.
    let port = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
    let public = format!("http://treeline.test:{port}");
    let other = Server::start_at(&format!("127.0.0.1:{port}"), &["--dem", &dem, "--public-url", &public])?;
    let browser = Browser::start()?;
    for server in [&same, &other] {
        let mut page = open(&browser, &server.url(VIEW))?;
        let counted = page.evaluate("window.treeline.stats().bytes")?;
        let requests = page.requests()?;
        // Which encoding the two agreed on depends on how secure the browser thinks that the address is.
        let heights = requests.iter().find(|url| url.contains("LAYERS=elevation")).context("heights")?;
        let encoding = page.evaluate(&format!(
            "fetch('{heights}', {{cache: 'force-cache'}}).then(answer => answer.headers.get('content-encoding'))"
        ))?;
        let encoding = encoding.as_str().context("an encoding")?;
        let on_wire = sent(server, &requests, encoding)?;
        ensure!(on_wire.len() == 2, "two layers: {on_wire:?}");
        ensure!(counted == json!(on_wire), "counted {counted}, sent {on_wire:?}");
        // And not what they are once unpacked.
        let plain = sent(server, &requests, "identity")?;
        ensure!(plain["elevation"] > on_wire["elevation"] + 10_000, "{plain:?} {on_wire:?}");
        // From the browser's own cache nothing crosses the network.
        let mut again = open(&browser, &server.url(VIEW))?;
        let cached = again.evaluate("window.treeline.stats()")?;
        let total: u64 =
            cached["bytes"].as_object().into_iter().flatten().filter_map(|(_, count)| count.as_u64()).sum();
        ensure!(total == 0, "{cached}");
        ensure!(cached["tiles"]["elevation"] != Value::Null, "{cached}");
        ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    }
    Ok(())
}

/// Keeps a screenshot of a state where TREELINE_SCREENSHOTS names a folder: for whoever works on its looks.
fn keep_if_asked(page: &mut Page, name: &str) -> anyhow::Result<()> {
    if let Some(folder) = std::env::var_os("TREELINE_SCREENSHOTS") {
        page.screenshot()?.save(Path::new(&folder).join(format!("{name}.png")))?;
    }
    Ok(())
}
