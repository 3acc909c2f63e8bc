//! A link of 1 Mbit/s and 200 ms, on which one request in ten fails: the picture is the same in the end.

use anyhow::{Context, ensure};
use std::path::Path;
use std::process::Command;
use treeline_tests::faulty_link::{FaultyLink, Quality};
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
    let link = FaultyLink::before(server.address(), Quality::bad(5))?;
    let bad = shoot(&link.url("/"), folder.path(), "bad.png")?;
    ensure!(link.failed() > 0, "no request failed");
    // The software adapter draws the same bits from the same tiles.
    ensure!(good == bad, "the pictures differ");
    Ok(())
}
