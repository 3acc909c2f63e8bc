//! Pictures of tree models by the CPU, and how alike two of them are.

use glam::Vec3;
use image::{Rgb, RgbImage};
use treeline_core::seeds::Species;
use treeline_core::tree_model::raster::Raster;
use treeline_core::tree_model::{TOWARDS_EYE, TreeSpecies, brightness};

/// Colour behind the trees, 0 … 1.
const SKY: Vec3 = Vec3::new(0.72, 0.80, 0.88);
/// Samples along a pixel's side.
const FINE: usize = 4;
/// Width of a picture over the height of the tree.
const WIDTH: f32 = 0.7;
/// Pixels that are added: trees of a few pixels, too, have windows to be compared in.
const MARGIN: usize = 12;

/// From where a tree is seen, by parallel rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Direction of sight, degrees from east to north.
    pub azimuth_deg: f32,
    /// Degrees below the horizon.
    pub down_deg: f32,
    /// Pixels per height of the tree.
    pub pixels: f32,
}

/// A level and variant of a species, in sunlight before the sky. The tree's middle is the picture's.
#[must_use]
pub fn picture(model: &TreeSpecies, level: usize, variant: usize, view: &View) -> RgbImage {
    let height = (1.05 * view.pixels).ceil() as usize + MARGIN;
    let width = (WIDTH * view.pixels).ceil() as usize + MARGIN;
    let (turn, down) = (view.azimuth_deg.to_radians(), view.down_deg.to_radians());
    let forward = Vec3::new(turn.cos() * down.cos(), turn.sin() * down.cos(), -down.sin());
    let right = forward.cross(Vec3::Z).normalize();
    let up = right.cross(forward);
    let middle = Vec3::new(0.0, 0.0, 0.5);
    let mut raster = Raster::new(width * FINE, height * FINE);
    let centre = Vec3::new((width * FINE) as f32 * 0.5, (height * FINE) as f32 * 0.5, 0.0);
    let scale = view.pixels * FINE as f32;
    for quad in &model.levels[level].variants[variant] {
        let places = quad.places().map(|place| {
            let way = place - middle;
            centre + Vec3::new(way.dot(right) * scale, -way.dot(up) * scale, -way.dot(forward))
        });
        raster.draw(quad, places, &model.atlas);
    }
    let sun = Vec3::new(0.5, -0.3, 0.8).normalize();
    let towards_eye = if level > 0 { TOWARDS_EYE } else { 0.0 };
    RgbImage::from_fn(width as u32, height as u32, |x, y| {
        let (x, y) = (x as usize * FINE, y as usize * FINE);
        let samples = (0..FINE * FINE).map(|sample| {
            let at = (y + sample / FINE) * raster.width + x + sample % FINE;
            raster.samples[at].map_or(SKY, |seen| {
                let normal = (seen.normal - forward * towards_eye).normalize_or_zero();
                let light = 0.5 + 0.8 * normal.dot(sun).max(0.0);
                seen.colour / 255.0 * light * brightness(seen.shade) * 1.2
            })
        });
        let mean = samples.sum::<Vec3>() / (FINE * FINE) as f32;
        Rgb(mean.to_array().map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8))
    })
}

/// Structural similarity (Z. Wang and others, 2004) of the brightness of two pictures of one size: the
/// mean over all windows of 7 × 7 pixels in which either shows something before the sky.
///
/// # Panics
/// Where the sizes differ.
#[must_use]
pub fn similarity(first: &RgbImage, second: &RgbImage) -> f64 {
    assert_eq!(first.dimensions(), second.dimensions(), "pictures of one size");
    const SIDE: u32 = 7;
    let luminance = |pixel: &Rgb<u8>| {
        0.299 * f64::from(pixel[0]) + 0.587 * f64::from(pixel[1]) + 0.114 * f64::from(pixel[2])
    };
    let sky = luminance(&Rgb(SKY.to_array().map(|value| (value * 255.0).round() as u8)));
    let (width, height) = first.dimensions();
    let (mut sum, mut windows) = (0.0, 0.0);
    for y in 0..(height + 1).saturating_sub(SIDE) {
        for x in 0..(width + 1).saturating_sub(SIDE) {
            let mut moments = [0.0_f64; 5];
            let mut shows = false;
            for (dx, dy) in (0..SIDE * SIDE).map(|place| (place % SIDE, place / SIDE)) {
                let a = luminance(first.get_pixel(x + dx, y + dy));
                let b = luminance(second.get_pixel(x + dx, y + dy));
                shows |= (a - sky).abs() > 2.0 || (b - sky).abs() > 2.0;
                for (moment, value) in moments.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                    *moment += value / f64::from(SIDE * SIDE);
                }
            }
            if shows {
                let [a, b, aa, bb, ab] = moments;
                let (c1, c2) = ((0.01 * 255.0_f64).powi(2), (0.03 * 255.0_f64).powi(2));
                sum += (2.0 * a * b + c1) * (2.0 * (ab - a * b) + c2)
                    / ((a * a + b * b + c1) * (aa - a * a + bb - b * b + c2));
                windows += 1.0;
            }
        }
    }
    if windows == 0.0 { 1.0 } else { sum / windows }
}

/// Six built-in species of six kinds of growth.
#[must_use]
pub fn six_species() -> Vec<Species> {
    let names =
        ["Norway spruce", "European larch", "Scots pine", "European beech", "Silver birch", "Sessile oak"];
    let is_one = |species: &Species| names.contains(&species.definition.name.as_str());
    Species::built_in().into_iter().filter(is_one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_there_are() {
        assert_eq!(six_species().len(), 6);
    }

    #[test]
    fn alike_and_unlike() {
        let plain = RgbImage::from_fn(20, 20, |x, y| Rgb([(x * 12) as u8, (y * 12) as u8, 40]));
        assert!((similarity(&plain, &plain) - 1.0).abs() < 1e-9);
        let turned = image::imageops::rotate180(&plain);
        assert!(similarity(&plain, &turned) < 0.3);
        let sky =
            RgbImage::from_pixel(20, 20, Rgb(SKY.to_array().map(|value| (value * 255.0).round() as u8)));
        assert!((similarity(&sky, &sky) - 1.0).abs() < 1e-9);
    }
}
