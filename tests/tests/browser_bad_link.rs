//! A real browser on a link of 1 Mbit/s and 200 ms on which one request in ten fails: no frame has a hole
//! while it flies, and in the end the picture is that of a fast link.

use anyhow::{Context, ensure};
use std::time::{Duration, Instant};
use treeline_client::stream::view::ViewGeometry;
use treeline_core::camera::GeographicCamera;
use treeline_core::geodesy::Geodetic;
use treeline_tests::browser::{Browser, FRAME_RECORDER, Page, RecordedFrame};
use treeline_tests::faulty_link::{FaultyLink, Quality};
use treeline_tests::geotiff::{self, Placement};
use treeline_tests::picture;
use treeline_tests::program::Server;

/// The picture: small, so that a software adapter draws many frames.
const SIZE: (u32, u32) = (128, 96);
/// The terrain: 9 km by 13 km in steps of some 5 m, so that there are four levels of tiles to see.
const PLACEMENT: Placement =
    Placement { west: 11.0, north: 47.12, step: [5.0e-5; 2], columns: 2400, rows: 2400 };
/// Bounds of [`ground`], metres.
const LOWEST: f64 = 500.0;
const HIGHEST: f64 = 1300.0;
/// Beside the data's edge a coarse cell may have no node: so far from it nothing is claimed, degrees.
const MARGIN: f64 = 0.002;
/// Least requests that must have failed for the link to have been bad.
const FAILURES: u64 = 3;

/// Rolling hills, height in metres.
fn ground(longitude: f64, latitude: f64) -> f64 {
    let (x, y) = (longitude.to_radians() * 4.35e6, latitude.to_radians() * 6.37e6);
    900.0 + 260.0 * (x / 700.0).sin() * (y / 900.0).cos() + 90.0 * (x / 210.0 + y / 330.0).sin()
}

fn inside(place: &Geodetic) -> bool {
    let Placement { west, north, step, columns, rows } = PLACEMENT;
    let (east, south) = (west + step[0] * f64::from(columns), north - step[1] * f64::from(rows));
    (west + MARGIN..=east - MARGIN).contains(&place.longitude)
        && (south + MARGIN..=north - MARGIN).contains(&place.latitude)
}

/// Whether a ray must meet the ground whatever tiles are there: it begins above the greatest height, or at
/// least above the ground, and comes down below the least height before it leaves the data. What lies
/// between is continuous, so it cannot slip through.
fn must_hit(view: &ViewGeometry, direction: glam::DVec3) -> bool {
    for step in 0..400 {
        let place = view.geodetic(direction * (50.0 * f64::from(step)));
        if !inside(&place) || (place.height > HIGHEST && direction.z > 0.0) {
            return false;
        }
        if place.height < LOWEST {
            return true;
        }
    }
    false
}

/// Pixels that must show the ground, of which it is claimed here; and lines about those that do not, or
/// that show it where it is not.
fn faults(frame: &RecordedFrame, camera: &GeographicCamera) -> Vec<String> {
    let view = ViewGeometry::new(camera, frame.width, frame.height);
    let mut faults = Vec::new();
    for (index, &distance) in frame.distances.iter().enumerate() {
        let (x, y) = (index as u32 % frame.width, index as u32 / frame.width);
        let direction = view.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
        if distance < 0.0 {
            if must_hit(&view, direction) {
                faults.push(format!("pixel {x}, {y} is a hole"));
            }
            continue;
        }
        let place = view.geodetic(direction * f64::from(distance));
        let error = place.height - ground(place.longitude, place.latitude);
        // A coarse stand-in strays by its cell's bend; what is seen through a crack lies far off.
        if error.abs() > 12.0 + 0.01 * f64::from(distance) {
            faults.push(format!("pixel {x}, {y} lies {error:.1} m over the ground, {distance} m away"));
        }
    }
    faults
}

/// How many pixels of a frame must show the ground.
fn claimed(frame: &RecordedFrame, camera: &GeographicCamera) -> usize {
    let view = ViewGeometry::new(camera, frame.width, frame.height);
    let pixels = (0..frame.height).flat_map(|y| (0..frame.width).map(move |x| (x, y)));
    pixels.filter(|&(x, y)| must_hit(&view, view.direction(f64::from(x) + 0.5, f64::from(y) + 0.5))).count()
}

fn camera(lon: f64, lat: f64, height: f64, heading_deg: f64, pitch_deg: f64) -> GeographicCamera {
    GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 50.0 }
}

fn go(page: &mut Page, camera: &GeographicCamera) -> anyhow::Result<()> {
    page.evaluate(&format!("window.treeline.setCamera({})", serde_json::to_string(camera)?))?;
    Ok(())
}

#[test]
fn browser_on_a_bad_link_draws_no_hole_and_ends_with_the_same_picture() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let dem = folder.path().join("hills.tif");
    geotiff::write_heights(&dem, &PLACEMENT, |longitude, latitude| ground(longitude, latitude) as f32)?;
    let server = Server::start(&["--dem", dem.to_str().context("a path")?])?;
    let link = FaultyLink::before(server.address(), Quality::bad(7))?;
    let browser = Browser::start()?;

    let first = camera(11.02, 47.02, 1_700.0, 60.0, -35.0);
    let fragment = "/#camera=11.02,47.02,1700,60,-35";
    let mut page = browser.open_after(FRAME_RECORDER, &link.url(fragment), SIZE.0, SIZE.1)?;
    page.wait_for("window.treeline?.stats().page.frames_drawn > 0", Duration::from_secs(60))?;
    let start = Instant::now();
    // Low and high, down and toward the horizon, never waiting for what was left behind to come.
    let places = [
        camera(11.03, 47.04, 1_450.0, 120.0, -20.0),
        camera(11.08, 47.06, 2_600.0, 250.0, -60.0),
        camera(11.06, 47.08, 1_380.0, 200.0, -12.0),
        camera(11.09, 47.03, 1_500.0, 300.0, -30.0),
        camera(11.04, 47.06, 1_420.0, 20.0, -25.0),
        camera(11.07, 47.05, 1_900.0, 90.0, -45.0),
        camera(11.02, 47.09, 1_400.0, 150.0, -20.0),
        camera(11.10, 47.09, 1_450.0, 230.0, -20.0),
    ];
    for (index, place) in places.iter().enumerate() {
        if index >= 4 && link.failed() >= FAILURES {
            break;
        }
        page.hold_key("KeyW", "w", Duration::from_millis(700))?;
        page.hold_key("KeyE", "e", Duration::from_millis(500))?;
        go(&mut page, place)?;
        std::thread::sleep(Duration::from_millis(1_500));
    }
    let last = camera(11.06, 47.05, 1_500.0, 330.0, -28.0);
    go(&mut page, &last)?;
    page.settle()?;
    println!("flown and settled in {:?}, {} requests failed", start.elapsed(), link.failed());
    ensure!(link.failed() >= FAILURES, "only {} requests failed", link.failed());

    let frames = page.recorded_frames()?;
    ensure!(frames.len() > 30, "only {} frames were drawn", frames.len());
    let mut total = 0;
    for (index, frame) in frames.iter().enumerate() {
        let at = frame.camera.unwrap_or(first);
        let faults = faults(frame, &at);
        ensure!(faults.is_empty(), "frame {index} of {} at {at:?}: {faults:?}", frames.len());
        total += frame.distances.len();
    }
    println!("{} frames, {total} pixels, no hole", frames.len());
    // What was claimed is most of what there is to see.
    let end = frames.last().context("a frame")?;
    ensure!(claimed(end, &last) > end.distances.len() / 2, "{}", claimed(end, &last));

    let slow = page.picture()?;
    let complaints: Vec<String> = page.complaints()?.into_iter().filter(|line| !is_network(line)).collect();
    ensure!(complaints.is_empty(), "{complaints:?}");
    drop(page);
    let mut page = browser.open(&server.url("/"), SIZE.0, SIZE.1)?;
    page.settle()?;
    go(&mut page, &last)?;
    page.settle()?;
    let fast = page.picture()?;
    let difference = picture::difference(&slow, &fast, 24);
    println!("bad link against fast link: {difference:?}");
    if difference.mean >= 0.5 || difference.share_over >= 0.005 {
        let paths = [picture::keep("bad-link", &slow)?, picture::keep("fast-link", &fast)?];
        anyhow::bail!("{difference:?}; see {paths:?}");
    }
    ensure!(picture::contrast(&fast) > 5.0, "a blank picture");
    Ok(())
}

/// Whether a line of the console is the browser's own about a request that failed, as it was meant to.
fn is_network(line: &str) -> bool {
    line.contains("Failed to load resource") || line.contains("net::ERR")
}
