//! Draws a height field by the GPU pass and by its twin, and holds both against the exact reference.

use crate::gpu::software_gpu;
use crate::reference::measure::{Errors, truth};
use crate::reference::{Camera, Ground};
use treeline_client::headless::height_field::{HeightFieldFrame, HeightFieldOptions, render_height_field};
use treeline_shaders::height_field::{HeightField, PlaneCamera, Prepared, Samples};

/// The ground as the code under test takes it.
pub fn field_of(ground: &Ground) -> HeightField {
    HeightField::new(
        ground.columns as u32,
        ground.rows as u32,
        Samples::F64(ground.heights.clone()),
        ground.cell,
        ground.origin,
    )
    .expect("a height field")
}

/// The camera as the code under test takes it.
pub fn plane_camera(camera: &Camera) -> PlaneCamera {
    PlaneCamera { eye: camera.eye, target: camera.target, up: camera.up, fov_y_degrees: camera.fov_y_degrees }
}

fn earth_radius(ground: &Ground) -> Option<f64> {
    (ground.bend > 0.0).then(|| 0.5 / ground.bend)
}

/// The picture by the GPU.
pub fn by_gpu(ground: &Ground, camera: &Camera, size: [u32; 2]) -> HeightFieldFrame {
    let (device, queue) = software_gpu();
    let options = HeightFieldOptions { size, earth_radius: earth_radius(ground), repeat: 1 };
    render_height_field(device, queue, &field_of(ground), &plane_camera(camera), &options).expect("a picture")
}

/// Depths and fetches by the twin.
pub fn by_twin(ground: &Ground, camera: &Camera, size: [u32; 2]) -> (Vec<f32>, Vec<u32>) {
    let pixels = (size[0] * size[1]) as usize;
    let prepared = Prepared::new(&field_of(ground), &plane_camera(camera), size, earth_radius(ground))
        .expect("a camera");
    match prepared {
        None => (vec![f32::INFINITY; pixels], vec![0; pixels]),
        Some(prepared) => {
            (0..pixels as u32).map(|index| prepared.by_twin(index % size[0], index / size[0])).unzip()
        }
    }
}

/// Draws both ways, and fails where either is not as right as it must be. Answers the errors of the GPU's picture.
pub fn check(name: &str, ground: &Ground, camera: &Camera, size: [u32; 2]) -> Errors {
    let truth = truth(ground, camera, size);
    let frame = by_gpu(ground, camera, size);
    let errors = Errors::of(&truth, &frame.distance, size[0]);
    let (depths, fetches) = by_twin(ground, camera, size);
    let twin_errors = Errors::of(&truth, &depths, size[0]);
    let most = frame.fetches.iter().max().copied().unwrap_or(0);
    let mean = frame.fetches.iter().map(|&count| f64::from(count)).sum::<f64>() / frame.fetches.len() as f64;
    println!("{name}: GPU {errors:?}; fetches {mean:.1}, at most {most}");
    println!("{name}: twin {twin_errors:?}; fetches at most {}", fetches.iter().max().copied().unwrap_or(0));
    assert!(twin_errors.are_small(), "{name}, by the twin: {twin_errors:?}");
    assert!(errors.are_small(), "{name}, by the GPU: {errors:?}");
    errors
}

/// Deterministic noise in 0…1 of a lattice point.
pub fn noise(x: i64, y: i64, seed: u32) -> f64 {
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77)
        ^ seed.wrapping_mul(0xc2b2_ae3d);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    f64::from(h ^ (h >> 15)) / f64::from(u32::MAX)
}

/// Smooth noise in −1…1.
pub fn smooth_noise(x: f64, y: f64, seed: u32) -> f64 {
    let (i, j) = (x.floor(), y.floor());
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let (a, b) = (ease(x - i), ease(y - j));
    let at = |di: i64, dj: i64| noise(i as i64 + di, j as i64 + dj, seed);
    let north = at(0, 0) * (1.0 - a) + at(1, 0) * a;
    let south = at(0, 1) * (1.0 - a) + at(1, 1) * a;
    2.0 * (north * (1.0 - b) + south * b) - 1.0
}

/// Mountains: ridged octaves, `relief` metres from valley to summit, features of `size` samples.
pub fn mountains(x: f64, y: f64, size: f64, relief: f64, seed: u32) -> f64 {
    let (mut height, mut amplitude, mut frequency) = (0.0, 0.5, 1.0 / size);
    for octave in 0..8 {
        let ridge = 1.0 - smooth_noise(x * frequency, y * frequency, seed + octave).abs();
        height += amplitude * ridge * ridge;
        amplitude *= 0.45;
        frequency *= 2.1;
    }
    height * relief
}

/// A forest on hills: crowns of some five samples, as high as 30 m, with gaps.
pub fn forest(x: f64, y: f64, seed: u32) -> f64 {
    let hills =
        120.0 * smooth_noise(x / 300.0, y / 300.0, seed) + 15.0 * smooth_noise(x / 60.0, y / 60.0, seed + 1);
    let spacing = 4.0;
    let (i, j) = ((x / spacing).floor() as i64, (y / spacing).floor() as i64);
    let mut canopy = 0.0_f64;
    for (di, dj) in (-1..=1).flat_map(|dj| (-1..=1).map(move |di| (di, dj))) {
        let (i, j) = (i + di, j + dj);
        if noise(i, j, seed + 5) < 0.25 {
            continue;
        }
        let top_x = (i as f64 + noise(i, j, seed + 2)) * spacing;
        let top_y = (j as f64 + noise(i, j, seed + 3)) * spacing;
        let height = 14.0 + 16.0 * noise(i, j, seed + 4);
        let distance = (x - top_x).hypot(y - top_y) / 2.6;
        if distance < 1.0 {
            canopy = canopy.max(height * (1.0 - 0.6 * distance * distance));
        }
    }
    hills + canopy
}
