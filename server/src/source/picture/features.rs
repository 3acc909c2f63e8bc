//! What is measured at each cell of a photo: colour free of haze and of the slope's light, texture, slope.

use super::Patch;
use super::number::ln;
use super::statistics::NOISE;
use crate::source::wide::wide;

/// Light on slopes of less than this, of level ground's, is not believed.
const LEAST_LIGHT: f32 = 0.3;
const MOST_LIGHT: f32 = 2.0;
/// Channels below this are not believed, of 255.
const LEAST_CHANNEL: f32 = 1.0;
/// Cells on either side over which texture is measured.
pub const TEXTURE_REACH: usize = 2;

/// How a photo was lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Added by the air to red, green and blue.
    pub haze: [f32; 3],
    /// Toward the sun, east, north and up, as the brightness of slopes has it: light on a slope of normal n is
    /// its product with n over `sun[2]`.
    pub sun: [f32; 3],
}

/// Measurements of the cells of a patch, row by row, rounded up to whole lanes.
#[derive(Clone, Debug, Default)]
pub struct Features {
    /// ln(green/red).
    pub green: Vec<f32>,
    /// ln(blue/green).
    pub blue: Vec<f32>,
    /// ln(brightness on level ground).
    pub bright: Vec<f32>,
    /// Variance of `green` by noise alone.
    pub green_noise: Vec<f32>,
    /// Variance of `blue` by noise alone.
    pub blue_noise: Vec<f32>,
    /// ln of the deviation of ln(brightness) around.
    pub texture: Vec<f32>,
    /// Steepness, metres per metre; 0 where the ground is not known.
    pub slope: Vec<f32>,
}

impl Features {
    /// Measures a patch.
    pub fn of(patch: &Patch, light: &Light) -> Self {
        let count = patch.colours.len();
        let mut out = Self {
            green: vec![0.0; count],
            blue: vec![0.0; count],
            bright: vec![0.0; count],
            green_noise: vec![0.0; count],
            blue_noise: vec![0.0; count],
            texture: vec![0.0; count],
            slope: vec![0.0; count],
        };
        let width = patch.width();
        let mut brightness = vec![0.0; count];
        let mut row = Row::new(width);
        for line in 0..patch.height() {
            row.fill(patch, line, &light.haze);
            let cells = line * width..(line + 1) * width;
            let mut target = Target {
                green: &mut out.green[cells.clone()],
                blue: &mut out.blue[cells.clone()],
                bright: &mut out.bright[cells.clone()],
                green_noise: &mut out.green_noise[cells.clone()],
                blue_noise: &mut out.blue_noise[cells.clone()],
                slope: &mut out.slope[cells.clone()],
                brightness: &mut brightness[cells],
            };
            wide!(measure(row: &Row = &row, sun: &[f32; 3] = &light.sun, out: &mut Target<'_> = &mut target));
        }
        roughness(&brightness, width, &mut out.texture);
        out
    }
}

/// A row of cells: channels without haze, and the rise of the ground.
struct Row {
    red: Vec<f32>,
    green: Vec<f32>,
    blue: Vec<f32>,
    east: Vec<f32>,
    north: Vec<f32>,
}

impl Row {
    fn new(width: usize) -> Self {
        let empty = || vec![0.0; width];
        Self { red: empty(), green: empty(), blue: empty(), east: empty(), north: empty() }
    }

    fn fill(&mut self, patch: &Patch, row: usize, haze: &[f32; 3]) {
        let width = patch.width();
        for column in 0..width {
            (self.east[column], self.north[column]) = rise(patch, column, row);
            let [red, green, blue] = clear(patch.colours[row * width + column], haze);
            (self.red[column], self.green[column], self.blue[column]) = (red, green, blue);
        }
    }
}

/// Where a row's measurements go, named as in [`Features`].
struct Target<'a> {
    green: &'a mut [f32],
    blue: &'a mut [f32],
    bright: &'a mut [f32],
    green_noise: &'a mut [f32],
    blue_noise: &'a mut [f32],
    slope: &'a mut [f32],
    brightness: &'a mut [f32],
}

/// Measures a row.
#[inline(always)]
fn measure(row: &Row, sun: &[f32; 3], out: &mut Target<'_>) {
    let count = out.green.len();
    let (red, green, blue) = (&row.red[..count], &row.green[..count], &row.blue[..count]);
    let (east, north) = (&row.east[..count], &row.north[..count]);
    let (ratio, other) = (&mut out.green[..count], &mut out.blue[..count]);
    let (noise, other_noise) = (&mut out.green_noise[..count], &mut out.blue_noise[..count]);
    let (bright, slope) = (&mut out.bright[..count], &mut out.slope[..count]);
    let brightness = &mut out.brightness[..count];
    for k in 0..count {
        let mean = (red[k] + green[k] + blue[k]) / 3.0;
        slope[k] = (east[k] * east[k] + north[k] * north[k]).sqrt();
        brightness[k] = ln(mean + NOISE);
        ratio[k] = ln(green[k] / red[k]);
        other[k] = ln(blue[k] / green[k]);
        bright[k] = ln(mean / on_slope(sun, east[k], north[k]));
        let of_green = NOISE * NOISE / (green[k] * green[k]);
        noise[k] = NOISE * NOISE / (red[k] * red[k]) + of_green;
        other_noise[k] = NOISE * NOISE / (blue[k] * blue[k]) + of_green;
    }
}

/// A colour without its haze.
pub fn clear(colour: [u8; 4], haze: &[f32; 3]) -> [f32; 3] {
    std::array::from_fn(|channel| (f32::from(colour[channel]) - haze[channel]).max(LEAST_CHANNEL))
}

/// Light on a slope that rises so much eastward and northward, 1 on level ground.
#[inline(always)]
fn on_slope(sun: &[f32; 3], east: f32, north: f32) -> f32 {
    let facing = (sun[2] - east * sun[0] - north * sun[1]) / (1.0 + east * east + north * north).sqrt();
    (facing / sun[2]).clamp(LEAST_LIGHT, MOST_LIGHT)
}

/// Rise of the ground eastward and northward, metres per metre; 0 where it is not known.
pub fn rise(patch: &Patch, column: usize, row: usize) -> (f32, f32) {
    let (width, height) = (patch.width(), patch.height());
    let (dx, dy) = patch.spacing(row);
    let at = |x: usize, y: usize| patch.heights[y * width + x];
    let (left, right) = (column.saturating_sub(1), (column + 1).min(width - 1));
    let (above, below) = (row.saturating_sub(1), (row + 1).min(height - 1));
    let east = (at(right, row) - at(left, row)) / (dx * (right - left).max(1) as f32);
    let north = (at(column, above) - at(column, below)) / (dy * (below - above).max(1) as f32);
    if east.is_nan() || north.is_nan() { (0.0, 0.0) } else { (east, north) }
}

/// ln of the standard deviation over [`TEXTURE_REACH`] cells around each.
fn roughness(brightness: &[f32], width: usize, out: &mut [f32]) {
    let squares: Vec<f32> = brightness.iter().map(|value| value * value).collect();
    let (mean, mean_square) =
        (box_mean(brightness, width, TEXTURE_REACH), box_mean(&squares, width, TEXTURE_REACH));
    for ((out, mean), square) in out.iter_mut().zip(&mean).zip(&mean_square) {
        *out = 0.5 * ln((square - mean * mean).max(1e-5));
    }
}

/// Mean over the square of `reach` cells around each; the edge is repeated. Summed in an order that the place alone
/// decides.
pub fn box_mean(values: &[f32], width: usize, reach: usize) -> Vec<f32> {
    let height = values.len() / width.max(1);
    let share = 1.0 / (2 * reach + 1) as f32;
    let mut rows = vec![0.0; values.len()];
    let mut padded = vec![0.0; width + 2 * reach];
    for (line, out) in values.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        padded[..reach].fill(line[0]);
        padded[reach..reach + width].copy_from_slice(line);
        padded[reach + width..].fill(line[width - 1]);
        for step in 0..=2 * reach {
            for (out, value) in out.iter_mut().zip(&padded[step..step + width]) {
                *out += value;
            }
        }
        for out in out {
            *out *= share;
        }
    }
    let mut out = vec![0.0; values.len()];
    for (row, line) in out.chunks_exact_mut(width).enumerate() {
        for step in 0..=2 * reach {
            let source = (row + step).saturating_sub(reach).min(height - 1);
            for (out, value) in line.iter_mut().zip(&rows[source * width..(source + 1) * width]) {
                *out += value * share;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use treeline_core::grid::{LatticeWindow, Registration};

    #[test]
    fn haze_and_slope_are_taken_out() {
        let window = LatticeWindow {
            level: 12,
            registration: Registration::Cell,
            first_column: 1_000_000,
            first_row: 500_000,
            width: 8,
            height: 8,
        };
        let light = Light { haze: [10.0, 12.0, 20.0], sun: [0.5, 0.0, 0.8] };
        let step = treeline_core::tile::cell_metres(12) as f32;
        // A slope that falls to the east by one in two, toward the sun, and the same ground level.
        for (fall, gain) in [(0.0, 1.0), (0.5, (0.8 + 0.25) / 1.25_f32.sqrt() / 0.8)] {
            let shrink = window.latitude(500_000).to_radians().cos() as f32;
            let heights = (0..64).map(|k| -fall * step * shrink * (k % 8) as f32).collect();
            let seen = [40.0, 60.0, 30.0].map(|channel: f32| channel * gain);
            let colour = [seen[0] + 10.0, seen[1] + 12.0, seen[2] + 20.0].map(|v| v.round() as u8);
            let colours = vec![[colour[0], colour[1], colour[2], 255]; 64];
            let features = Features::of(&Patch::new(window, colours, heights), &light);
            let middle = 4 * 8 + 4;
            assert!((features.green[middle] - (1.5_f32).ln()).abs() < 0.03);
            assert!((features.blue[middle] - (0.5_f32).ln()).abs() < 0.03);
            assert!((features.bright[middle] - (130.0_f32 / 3.0).ln()).abs() < 0.03, "{fall}");
            assert!((features.slope[middle] - fall).abs() < 0.01);
            assert!(features.texture[middle] < -5.0, "an even colour has no texture");
        }
    }
}
