//! A link of 1 Mbit/s and 200 ms, on which requests fail: the picture is the same in the end.

use anyhow::{Context, ensure};
use std::path::Path;
use std::process::Command;
use treeline_tests::faulty_link::{FaultyLink, Quality};
use treeline_tests::picture;
use treeline_tests::program::{self, Server};

/// A view that wants few tiles: from above, and small.
const CAMERA: &str =
    r#"{"lon": 11.0, "lat": 46.93, "height": 6000, "heading_deg": 20, "pitch_deg": -80, "fov_y_deg": 40}"#;

fn shoot(server: &str, folder: &Path, name: &str) -> anyhow::Result<image::RgbaImage> {
    let camera = folder.join("camera.json");
    std::fs::write(&camera, CAMERA)?;
    let color = folder.join(name);
    let output = Command::new(program::path("treeline-shot")?)
        .args(["--server", server, "--adapter", "software", "--size", "64x48"])
        .arg("--camera")
        .arg(&camera)
        .arg("--color")
        .arg(&color)
        .output()?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Ok(image::open(&color).with_context(|| format!("{}", color.display()))?.to_rgba8())
}

#[test]
fn a_bad_link_ends_with_the_same_picture() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let folder = tempfile::tempdir()?;
    let good = shoot(&server.url("/"), folder.path(), "good.png")?;
    // The view wants few tiles: more of them fail than one in ten, so that any do.
    let mut bad = None;
    for seed in 5..9 {
        let quality = Quality { one_failing_in: 3, ..Quality::bad(seed) };
        let link = FaultyLink::before(server.address(), quality)?;
        bad = Some(shoot(&link.url("/"), folder.path(), "bad.png")?);
        if link.failed() > 0 {
            break;
        }
        bad = None;
    }
    let bad = bad.context("no request failed")?;
    // What the map names on the way depends on what has come by then; what a ray hits in the end does not,
    // but for tiles that are in sight between the pixels only.
    let difference = picture::difference(&good, &bad, 8);
    println!("good against bad: {difference:?}");
    ensure!(difference.mean < 0.1 && difference.share_over < 0.005, "the pictures differ: {difference:?}");
    Ok(())
}
