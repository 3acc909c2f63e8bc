//! A MapServer as the upstream of both photo and heights: its maps become our tiles, and the page shows them, whether it is
//! slow, wrong, without end or gone.

use anyhow::{Context, ensure};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use treeline_tests::browser::Browser;
use treeline_tests::geotiff::{self, Placement};
use treeline_tests::mapserver::{MapServer, Mood, SLOWNESS};
use treeline_tests::program::{self, Server};
use treeline_tests::raw_http::{Answer, Connection};

/// What MapServer has: 13 km by 13 km, a little more than is asked for.
const PLACEMENT: Placement = Placement { west: 9.9, north: 46.2, step: [2.0e-4; 2], columns: 900, rows: 650 };
/// What Treeline is told to show: west, south, east, north.
const PART: [f64; 4] = [9.92, 46.09, 10.06, 46.18];

fn height(longitude: f64, latitude: f64) -> f32 {
    (800.0 + 150.0 * (longitude * 150.0).sin() * (latitude * 200.0).cos()) as f32
}

/// Sand in the west, gravel in the east: nothing that is taken for water or forest.
fn colour(longitude: f64) -> [u8; 3] {
    if longitude < 9.99 { [200, 160, 105] } else { [120, 122, 126] }
}

fn layers(folder: &Path) -> anyhow::Result<String> {
    let Placement { west, north, step, columns, rows } = PLACEMENT;
    geotiff::write_heights(&folder.join("height.tif"), &PLACEMENT, height)?;
    image::RgbImage::from_fn(columns, rows, |x, _| image::Rgb(colour(west + (f64::from(x) + 0.5) * step[0])))
        .save(folder.join("photo.png"))?;
    let world = [step[0], 0.0, 0.0, -step[1], west + step[0] / 2.0, north - step[1] / 2.0];
    std::fs::write(folder.join("photo.pgw"), world.map(|number| number.to_string()).join("\n"))?;
    let layer = |name: &str, file: &str| {
        format!(
            "LAYER NAME \"{name}\" TYPE RASTER STATUS ON DATA \"{}\" PROCESSING \"RESAMPLE=BILINEAR\"\n\
             PROJECTION \"init=epsg:4326\" END METADATA \"wms_title\" \"{name}\" END END\n",
            folder.join(file).display()
        )
    };
    Ok(format!(
        "MAP NAME \"upstream\" SIZE 512 512 EXTENT {west} {} {} {north} PROJECTION \"init=epsg:4326\" END\n\
         OUTPUTFORMAT NAME \"png\" DRIVER \"AGG/PNG\" MIMETYPE \"image/png\" IMAGEMODE RGBA TRANSPARENT ON END\n\
         OUTPUTFORMAT NAME \"tiff\" DRIVER \"GDAL/GTiff\" MIMETYPE \"image/tiff\" IMAGEMODE FLOAT32 FORMATOPTION \"NULLVALUE=-9999\" END\n\
         WEB METADATA \"wms_title\" \"upstream\" \"wms_enable_request\" \"*\" \"wms_srs\" \"EPSG:4326 EPSG:3857\" \
         \"wms_onlineresource\" \"http://localhost/\" END END\n{}{}END\n",
        north - step[1] * f64::from(rows),
        west + step[0] * f64::from(columns),
        layer("height", "height.tif"),
        layer("photo", "photo.png"),
    ))
}

fn map(layer: &str, bounds: [f64; 4], format: &str) -> String {
    let [west, south, east, north] = bounds;
    format!(
        "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS={layer}&STYLES=&CRS=CRS:84&BBOX={west},{south},{east},{north}\
         &WIDTH=64&HEIGHT=64&FORMAT={format}"
    )
}

fn ask(server: &Server, path: &str) -> anyhow::Result<Answer> {
    Connection::open(server.address())?.get(path)
}

/// A small box of the part, another one for each number.
fn corner(index: u32) -> [f64; 4] {
    let west = PART[0] + 0.02 * f64::from(index);
    [west, 46.12, west + 0.004, 46.124]
}

/// Whether `treeline check` finds nothing wrong, and what it says.
fn check(scene: &str) -> anyhow::Result<(bool, String)> {
    let output = Command::new(program::path("treeline")?).args(["check", "--scene", scene]).output()?;
    let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
    Ok((output.status.success(), said))
}

#[test]
fn a_mapserver_may_have_the_photo_and_the_heights() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let Some(upstream) = MapServer::start(&layers(folder.path())?)? else { return Ok(()) };
    let scene = folder.path().join("scene.toml");
    std::fs::write(
        &scene,
        format!(
            "name = \"Upstream\"\n[dem]\npath = \"{}\"\nbbox = {PART:?}\nresolution_metres = 20\n[photo]\npath = \"{}\"\nmaximum_zoom = 18\n",
            upstream.layer("height", "image/tiff"),
            upstream.layer("photo", "image/png"),
        ),
    )?;
    let scene = scene.to_str().context("a path")?;

    // Nothing starts on an upstream that has no heights: one line says so.
    for mood in [Mood::Wrong, Mood::Gone, Mood::Huge] {
        upstream.be(mood);
        let start = Instant::now();
        let (works, said) = check(scene)?;
        ensure!(!works && said.contains("LAYERS=height"), "{mood:?}: {said}");
        ensure!(said.contains("check the address"), "{mood:?}: {said}");
        println!("{mood:?}: told after {:?}: {}", start.elapsed(), said.trim());
    }

    upstream.be(Mood::Well);
    let (works, said) = check(scene)?;
    ensure!(works && said.contains("maps of a service"), "{said}");
    println!("{said}");
    let server = Server::start(&["--scene", scene])?;
    let mut worst: f32 = 0.0;
    for index in 0..6 {
        let bounds = corner(index);
        let answer = ask(&server, &map("elevation", bounds, "application/bil32"))?;
        ensure!(answer.status == 200, "{}", String::from_utf8_lossy(&answer.body));
        for (sample, four) in answer.body.chunks_exact(4).enumerate() {
            let found = f32::from_le_bytes(four.try_into()?);
            let at = |place: usize| (place as f64 + 0.5) / 64.0 * 0.004;
            worst =
                worst.max((found - height(bounds[0] + at(sample % 64), bounds[3] - at(sample / 64))).abs());
        }
    }
    // Twice bilinear, and rounded to the tiles' quanta.
    println!("heights are within {worst} m");
    ensure!(worst < 1.5, "{worst} m");

    let mut page_of = {
        let browser = Browser::start()?;
        let mut page = browser.open(&server.url("/#camera=9.99,46.135,5000,0,-89"), 200, 160)?;
        page.settle()?;
        let picture = page.picture()?;
        let middle = |x: u32| picture.get_pixel(x, 80).0.map(i32::from);
        let (west, east) = (middle(50), middle(150));
        println!("the page: {west:?} in the west, {east:?} in the east");
        ensure!(west[0] - west[2] > east[0] - east[2] + 30, "{west:?} {east:?}");
        ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
        (browser, page)
    };

    // So near that none of it is among what the page has asked for.
    let photo = |index: u32| {
        let [west, south, ..] = corner(index);
        map("texture", [west, south, west + 4e-4, south + 4e-4], "image/png")
    };
    ensure!(ask(&server, &photo(0))?.status == 200);

    upstream.be(Mood::Slow);
    let start = Instant::now();
    let answer = ask(&server, &photo(1))?;
    ensure!(answer.status == 200, "slow: {}", answer.status);
    println!("from a slow upstream after {:?}", start.elapsed());
    ensure!(start.elapsed() >= SLOWNESS);

    for (next, mood) in (2..).zip([Mood::Wrong, Mood::Huge, Mood::Gone]) {
        upstream.be(mood);
        let answer = ask(&server, &photo(next))?;
        let said = String::from_utf8_lossy(&answer.body).into_owned();
        ensure!(answer.status == 502, "{mood:?}: {} {said}", answer.status);
        ensure!(said.contains("LAYERS=photo"), "{mood:?} does not name the source: {said}");
        ensure!(answer.head.to_lowercase().contains("retry-after"), "{mood:?}: {}", answer.head);
        // What was made before, and all that needs only the heights, is there as ever.
        ensure!(ask(&server, &photo(0))?.status == 200, "{mood:?}");
        let heights = map("elevation", corner(next), "application/bil32");
        ensure!(ask(&server, &heights)?.status == 200, "{mood:?}");
        // And nothing wrong was kept.
        upstream.be(Mood::Well);
        let start = Instant::now();
        while ask(&server, &photo(next))?.status != 200 {
            ensure!(start.elapsed() < Duration::from_secs(30), "{mood:?}: it is not asked again");
            std::thread::sleep(Duration::from_millis(250));
        }
    }
    println!("{} bytes of endless answers were taken", upstream.wasted());
    ensure!(upstream.wasted() < 128 << 20, "{} bytes", upstream.wasted());

    // The page goes on showing what it has while the upstream is gone.
    upstream.be(Mood::Gone);
    let (_, page) = &mut page_of;
    let drawn = "window.treeline.stats().page.frames_drawn";
    let before = page.evaluate(drawn)?;
    // Taking its picture paused it.
    page.evaluate("window.treeline.resume()")?;
    page.evaluate(
        "window.treeline.setCamera({lon: 10.0, lat: 46.13, height: 2500, heading_deg: 30, pitch_deg: -50})",
    )?;
    page.wait_for(&format!("{drawn} > {before}"), Duration::from_secs(30))?;
    let picture = page.picture()?;
    let lit = picture.pixels().filter(|pixel| pixel.0[..3].iter().any(|&value| value > 20)).count();
    ensure!(lit * 10 > picture.pixels().len() * 9, "{lit} pixels show something");
    Ok(())
}
