//! A canvas for twigs: strokes and leaves, painted sharp at four times the size and then averaged.

use glam::{Vec2, Vec3};

/// Samples along a texel's side.
const FINE: usize = 4;

/// A picture with coverage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width, texels.
    pub width: usize,
    /// Height, texels.
    pub height: usize,
    /// RGBA8, row-major from the upper left.
    pub rgba: Vec<u8>,
}

/// Something to paint on; lengths in texels, x to the right, y down, colours sRGB 0 … 1.
pub struct Canvas {
    width: usize,
    height: usize,
    samples: Vec<Option<Vec3>>,
}

impl Canvas {
    /// An empty canvas of a size in texels.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, samples: vec![None; width * height * FINE * FINE] }
    }

    /// Paints where `inside` gives a colour, within a box.
    pub fn fill(&mut self, low: Vec2, high: Vec2, mut inside: impl FnMut(Vec2) -> Option<Vec3>) {
        let fine = FINE as f32;
        let range = |low: f32, high: f32, count: usize| {
            let end = (high * fine).ceil().clamp(0.0, (count * FINE) as f32) as usize;
            ((low * fine).floor().max(0.0) as usize).min(end)..end
        };
        for row in range(low.y, high.y, self.height) {
            for column in range(low.x, high.x, self.width) {
                let at = (Vec2::new(column as f32, row as f32) + 0.5) / fine;
                if let Some(colour) = inside(at) {
                    self.samples[row * self.width * FINE + column] = Some(colour);
                }
            }
        }
    }

    /// A stroke that narrows from one width to another.
    pub fn stroke(&mut self, from: Vec2, to: Vec2, widths: [f32; 2], colour: Vec3) {
        let way = to - from;
        let length_squared = way.length_squared().max(1e-9);
        let margin = Vec2::splat(0.5 * widths[0].max(widths[1]));
        self.fill(from.min(to) - margin, from.max(to) + margin, |at| {
            let along = ((at - from).dot(way) / length_squared).clamp(0.0, 1.0);
            let half = 0.5 * (widths[0] + (widths[1] - widths[0]) * along);
            ((at - from - way * along).length_squared() <= half * half).then_some(colour)
        });
    }

    /// A leaf from its stalk along a direction. `outline` gives half its width, as a share of
    /// `width`, along its length 0 … 1. The vein is lighter, the two halves differ as a fold does.
    pub fn leaf(&mut self, stalk: Vec2, along: Vec2, size: Vec2, colour: Vec3, outline: impl Fn(f32) -> f32) {
        let (length, width) = (size.x, size.y);
        let across = along.perp();
        let tip = stalk + along * length;
        let margin = Vec2::splat(width);
        self.fill(stalk.min(tip) - margin, stalk.max(tip) + margin, |at| {
            let place = at - stalk;
            let (share, side) = (place.dot(along) / length, place.dot(across));
            let inside = (0.0..=1.0).contains(&share) && side.abs() <= 0.5 * width * outline(share);
            let light = if side.abs() < 0.05 * width {
                1.14
            } else if side > 0.0 {
                1.03
            } else {
                0.92
            };
            inside.then_some(colour * light)
        });
    }

    /// The picture: colours averaged over what is painted, coverage over all.
    pub fn picture(&self) -> Picture {
        let mut rgba = Vec::with_capacity(self.width * self.height * 4);
        for row in 0..self.height {
            for column in 0..self.width {
                let painted = (0..FINE * FINE).filter_map(|sample| {
                    let (y, x) = (row * FINE + sample / FINE, column * FINE + sample % FINE);
                    self.samples[y * self.width * FINE + x]
                });
                let (sum, count) =
                    painted.fold((Vec3::ZERO, 0), |(sum, count), colour| (sum + colour, count + 1));
                let mean = sum / (count.max(1) as f32);
                rgba.extend(mean.to_array().map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8));
                rgba.push((count * 255 / (FINE * FINE)) as u8);
            }
        }
        Picture { width: self.width, height: self.height, rgba }
    }
}
