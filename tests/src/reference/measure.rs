//! How far a picture of depths is from the truth.
//!
//! The error of a depth, in pixels, is its distance in metres from the exact interval ÷ the larger of
//! depth × pixel angle and the change of depth per pixel of sideways shift. The interval is taken over the pixel's centre
//! and four rays at ±1/32 pixel; a pixel whose five rays disagree on hit or miss is not counted.

use super::{Camera, Ground, exact};
use glam::DVec2;

const SHIFT: f64 = 1.0 / 32.0;

/// What the picture must show in one pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Truth {
    /// The five rays disagree: anything.
    Either,
    /// Nothing.
    Miss,
    /// A depth between these, metres; an error of one pixel is so many metres.
    Hit {
        /// Least.
        least: f64,
        /// Greatest.
        greatest: f64,
        /// Metres of a pixel of error.
        pixel: f64,
    },
}

/// The truth of a whole picture, row-major from the top.
pub fn truth(ground: &Ground, camera: &Camera, size: [u32; 2]) -> Vec<Truth> {
    let angle = camera.pixel_angle(size);
    let shifts = [
        DVec2::ZERO,
        DVec2::new(SHIFT, 0.0),
        DVec2::new(-SHIFT, 0.0),
        DVec2::new(0.0, SHIFT),
        DVec2::new(0.0, -SHIFT),
    ];
    let mut pixels = Vec::with_capacity(size[0] as usize * size[1] as usize);
    for row in 0..size[1] {
        for column in 0..size[0] {
            let centre = DVec2::new(f64::from(column) + 0.5, f64::from(row) + 0.5);
            let depths = shifts
                .map(|shift| exact::first_hit(ground, camera.eye, camera.direction(size, centre + shift)));
            let hits = depths.iter().filter(|depth| depth.is_finite()).count();
            pixels.push(match hits {
                0 => Truth::Miss,
                5 => {
                    let change =
                        (depths[1] - depths[2]).abs().max((depths[3] - depths[4]).abs()) / (2.0 * SHIFT);
                    Truth::Hit {
                        least: depths.into_iter().fold(f64::INFINITY, f64::min),
                        greatest: depths.into_iter().fold(0.0, f64::max),
                        pixel: (depths[0] * angle).max(change),
                    }
                }
                _ => Truth::Either,
            });
        }
    }
    pixels
}

/// A picture's errors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Errors {
    /// Pixels that must hit and do.
    pub hits: usize,
    /// Pixels that must hit and do not.
    pub missed: usize,
    /// Pixels that must not hit and do.
    pub false_hits: usize,
    /// Pixels whose rays disagree.
    pub uncounted: usize,
    /// Share of the hits within 0.05 pixel.
    pub within: f64,
    /// Greatest error, pixels.
    pub worst: f64,
    /// Where that is: column, row.
    pub worst_at: [usize; 2],
}

/// Hits within this are right, pixels.
pub const SMALL_ERROR: f64 = 0.05;

impl Errors {
    /// Compares a picture (metres, +∞ for a miss) with the truth.
    pub fn of(truth: &[Truth], depths: &[f32], width: u32) -> Self {
        assert_eq!(truth.len(), depths.len());
        let mut errors = Self::default();
        let mut small = 0_usize;
        for (index, (truth, &depth)) in truth.iter().zip(depths).enumerate() {
            match *truth {
                Truth::Either => errors.uncounted += 1,
                Truth::Miss => errors.false_hits += usize::from(depth.is_finite()),
                Truth::Hit { .. } if !depth.is_finite() => errors.missed += 1,
                Truth::Hit { least, greatest, pixel } => {
                    errors.hits += 1;
                    let depth = f64::from(depth);
                    let error = (least - depth).max(depth - greatest).max(0.0) / pixel;
                    small += usize::from(error <= SMALL_ERROR);
                    if error > errors.worst {
                        errors.worst = error;
                        errors.worst_at = [index % width as usize, index / width as usize];
                    }
                }
            }
        }
        errors.within = if errors.hits == 0 { 1.0 } else { small as f64 / errors.hits as f64 };
        errors
    }

    /// Whether the picture is as right as it must be.
    pub fn are_small(&self) -> bool {
        self.missed == 0 && self.false_hits == 0 && self.within >= 0.999 && self.worst <= 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_seen() {
        let truth = [
            Truth::Miss,
            Truth::Either,
            Truth::Hit { least: 10.0, greatest: 11.0, pixel: 2.0 },
            Truth::Hit { least: 10.0, greatest: 11.0, pixel: 2.0 },
        ];
        let far = f32::INFINITY;
        assert!(Errors::of(&truth, &[far, 3.0, 10.5, 11.0], 2).are_small());
        assert_eq!(Errors::of(&truth, &[far, far, far, 11.0], 2).missed, 1);
        assert_eq!(Errors::of(&truth, &[1.0, far, 10.0, 11.0], 2).false_hits, 1);
        let wrong = Errors::of(&truth, &[far, far, 8.0, 14.0], 2);
        assert_eq!((wrong.worst, wrong.worst_at, wrong.within), (1.5, [1, 1], 0.0));
    }

    #[test]
    fn a_flat_ground_seen_from_above() {
        let ground = Ground::from_function(11, 11, 10.0, |_, _| 0.0);
        let camera = Camera::new([50.0, 50.0, 100.0], [50.0, 50.0, 0.0], 60.0).with_up([0.0, 1.0, 0.0]);
        let truth = truth(&ground, &camera, [33, 33]);
        let Truth::Hit { least, greatest, .. } = truth[16 * 33 + 16] else { panic!("the middle hits") };
        assert!(least <= 100.0 && greatest >= 100.0 && greatest - least < 1e-4);
        assert_eq!(truth[0], Truth::Miss);
    }
}
