//! Texel fetches per ray: counts that no machine changes, on a 2048² map of 1.7 m.

use treeline_tests::height_field::{by_gpu, forest, mountains};
use treeline_tests::reference::{Camera, Ground};

const SIDE: usize = 2048;
const CELL: f64 = 1.7;
const SIZE: [u32; 2] = [640, 512];

fn check(name: &str, ground: &Ground, camera: &Camera) {
    let frame = by_gpu(ground, camera, SIZE);
    let mut fetches = frame.fetches;
    fetches.sort_unstable();
    let mean = fetches.iter().map(|&count| f64::from(count)).sum::<f64>() / fetches.len() as f64;
    let p99 = fetches[fetches.len() * 99 / 100];
    let most = fetches[fetches.len() - 1];
    println!("{name}: mean {mean:.1}, p99 {p99}, largest {most}; {:.0} ms", frame.milliseconds[0]);
    assert!(mean <= 32.0, "{name}: mean {mean}");
    assert!(p99 <= 80, "{name}: p99 {p99}");
    assert!(most <= 512, "{name}: largest {most}");
}

/// A camera so high over the ground at a share of the map, looking so far down.
fn over(ground: &Ground, share: [f64; 2], height: f64, heading: [f64; 2], pitch: f64) -> Camera {
    let span = (SIDE - 1) as f64 * CELL;
    let [x, y] = share.map(|share| share * span);
    let z = ground.height(x, y).expect("inside") + height;
    let far = 1000.0;
    Camera::new(
        [x, y, z],
        [x + far * heading[0], y + far * heading[1], z + far * pitch.to_radians().tan()],
        50.0,
    )
}

#[test]
fn alpine_views() {
    let alps =
        Ground::from_function(SIDE, SIDE, CELL, |x, y| mountains(x as f64, y as f64, 700.0, 1200.0, 7));
    check("alps, panorama", &alps, &over(&alps, [0.1, 0.1], 150.0, [0.7, 0.7], -3.0));
    check("alps, panorama from the ground", &alps, &over(&alps, [0.45, 0.05], 1.7, [0.1, 1.0], 0.0));
    check("alps, oblique", &alps, &over(&alps, [0.5, 0.02], 900.0, [0.0, 1.0], -30.0));
    check("alps, from above", &alps, &over(&alps, [0.5, 0.49], 3000.0, [0.0, 0.02], -80.0));
}

#[test]
fn forest_views() {
    let forest = Ground::from_function(SIDE, SIDE, CELL, |x, y| forest(x as f64, y as f64, 3));
    check("forest, oblique", &forest, &over(&forest, [0.2, 0.1], 400.0, [0.6, 0.8], -25.0));
    check("forest, grazing", &forest, &over(&forest, [0.1, 0.15], 45.0, [0.8, 0.6], -2.0));
    check("forest, from above", &forest, &over(&forest, [0.5, 0.45], 2500.0, [0.0, 0.2], -85.0));
}
