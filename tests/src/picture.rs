//! Comparing pictures: by mean error and by the share of pixels that differ, two separate limits.
//! Adapters differ at silhouettes by up to everything, so the largest difference says nothing.

use anyhow::Context;
use image::RgbaImage;
use std::path::PathBuf;

/// How two pictures differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Mean over pixels and colour channels of the absolute difference, of 255.
    pub mean: f64,
    /// Share of pixels of which a channel differs by more than the threshold.
    pub share_over: f64,
}

/// Compares two pictures of one size; a pixel counts in `share_over` where a channel differs by more
/// than `threshold` of 255.
///
/// # Panics
/// Where the sizes differ.
#[must_use]
pub fn difference(first: &RgbaImage, second: &RgbaImage, threshold: u8) -> Difference {
    assert_eq!(first.dimensions(), second.dimensions(), "pictures of one size");
    let mut sum = 0_u64;
    let mut over = 0_u64;
    for (one, other) in first.pixels().zip(second.pixels()) {
        let differences = [0, 1, 2].map(|channel| one[channel].abs_diff(other[channel]));
        sum += differences.iter().map(|&difference| u64::from(difference)).sum::<u64>();
        over += u64::from(differences.iter().any(|&difference| difference > threshold));
    }
    let pixels = f64::from(first.width()) * f64::from(first.height());
    Difference { mean: sum as f64 / (3.0 * pixels), share_over: over as f64 / pixels }
}

/// A picture `factor` times as small a side: every pixel the mean of what it replaces, as light adds up.
///
/// # Panics
/// Where the sides are no multiples of the factor.
#[must_use]
pub fn reduced(picture: &RgbaImage, factor: u32) -> RgbaImage {
    let [width, height] = [picture.width(), picture.height()].map(|side| {
        assert_eq!(side % factor, 0, "a side of {side} pixels in steps of {factor}");
        side / factor
    });
    let linear = |encoded: u8| {
        let value = f64::from(encoded) / 255.0;
        if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    };
    let encoded = |linear: f64| {
        let value =
            if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
        (value * 255.0).round() as u8
    };
    RgbaImage::from_fn(width, height, |x, y| {
        let mean = [0, 1, 2].map(|channel| {
            let cells = (0..factor * factor).map(|cell| {
                let (dx, dy) = (cell % factor, cell / factor);
                linear(picture.get_pixel(x * factor + dx, y * factor + dy)[channel])
            });
            encoded(cells.sum::<f64>() / f64::from(factor * factor))
        });
        image::Rgba([mean[0], mean[1], mean[2], 255])
    })
}

/// Keeps a picture for whoever looks at a failed test, in `failed-images` beside the test program's
/// profile folder; gives its path.
pub fn keep(name: &str, picture: &RgbaImage) -> anyhow::Result<PathBuf> {
    let program = std::env::current_exe()?;
    let folder =
        program.ancestors().nth(3).context("a test lies in target/PROFILE/deps")?.join("failed-images");
    std::fs::create_dir_all(&folder)?;
    let path = folder.join(format!("{name}.png"));
    picture.save(&path)?;
    Ok(path)
}

/// Standard deviation of the brightness, of 255: near 0 for a picture that shows nothing.
#[must_use]
pub fn contrast(picture: &RgbaImage) -> f64 {
    let brightness: Vec<f64> = picture
        .pixels()
        .map(|pixel| 0.3 * f64::from(pixel[0]) + 0.6 * f64::from(pixel[1]) + 0.1 * f64::from(pixel[2]))
        .collect();
    let mean = brightness.iter().sum::<f64>() / brightness.len() as f64;
    (brightness.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / brightness.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

    #[test]
    fn one_pixel_of_four() {
        let plain = RgbaImage::from_pixel(2, 2, Rgba([10, 10, 10, 255]));
        let mut other = plain.clone();
        other.put_pixel(1, 1, Rgba([10, 40, 10, 255]));
        let found = difference(&plain, &other, 20);
        assert_eq!(found, Difference { mean: 2.5, share_over: 0.25 });
        assert_eq!(difference(&plain, &other, 30).share_over, 0.0);
        assert_eq!(contrast(&plain), 0.0);
        assert!(contrast(&other) > 5.0);
    }
}
