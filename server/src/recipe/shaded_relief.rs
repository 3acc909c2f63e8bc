//! A map to look at: heights as tints under light from the north-west.

use super::encode;
use super::grid_places::{spacing, with_margin};
use super::relief_colours::{ground, mix, smooth_step};
use super::{RecipeError, TileRequest};
use crate::source::SampleGrid;

/// Light falls mostly from the north-west, as on printed maps, and some from either side of it, so
/// that ridges along the light show too: (azimuth in degrees clockwise from north, share).
const LIGHTS: [(f32, f32); 4] = [(315.0, 0.52), (270.0, 0.18), (0.0, 0.2), (225.0, 0.1)];
/// Tangent of the lights' height over the horizon (45°).
const LIGHT_RISE: f32 = 1.0;
/// Colours of full shadow and full light are mixed in this far.
const SHADOW: [f32; 3] = [38.0, 46.0, 70.0];
const HIGHLIGHT: [f32; 3] = [255.0, 250.0, 236.0];

/// The map of heights that `sample` gives for a grid.
pub fn make(
    request: &TileRequest,
    sample: impl Fn(&SampleGrid) -> Result<Vec<f32>, RecipeError>,
) -> Result<Vec<u8>, RecipeError> {
    let heights = sample(&with_margin(&request.grid, 1))?;
    // From afar slopes average out: what is left of them is steepened, or mountains look flat.
    let apart = spacing(&request.grid).first().map_or(1.0, |step| step.1);
    let steepen = (apart / 40.0).powf(0.3).clamp(1.0, 4.0);
    let pixels = slopes(&request.grid, &heights)
        .map(|sample| match sample {
            Some((height, east, north)) => shaded(height, east, north, steepen),
            None => [0; 4],
        })
        .collect();
    encode::picture(request, pixels)
}

/// For each sample of a grid whose heights are given with a margin of one: height, and rise over
/// run toward east and north; none where there is no data. A void beside it does not count.
pub fn slopes<'a>(
    grid: &SampleGrid,
    heights: &'a [f32],
) -> impl Iterator<Item = Option<(f32, f32, f32)>> + 'a {
    let (width, height) = grid.size();
    let (width, height) = (width as usize, height as usize);
    let stride = width + 2;
    let spacing = spacing(grid);
    (0..height).flat_map(move |row| {
        let (step_x, step_y) = spacing[row];
        (0..width).map(move |column| {
            let at = (row + 1) * stride + column + 1;
            let here = heights[at];
            if !here.is_finite() {
                return None;
            }
            Some((
                here,
                difference(heights[at - 1], here, heights[at + 1]) / step_x,
                difference(heights[at + stride], here, heights[at - stride]) / step_y,
            ))
        })
    })
}

/// Rise from one sample to the next, by those around it that there are.
fn difference(before: f32, here: f32, after: f32) -> f32 {
    match (before.is_finite(), after.is_finite()) {
        (true, true) => 0.5 * (after - before),
        (true, false) => here - before,
        (false, true) => after - here,
        (false, false) => 0.0,
    }
}

/// Colour of a sample: its tint, darker where the light does not reach.
fn shaded(height: f32, east: f32, north: f32, steepen: f32) -> [u8; 4] {
    let tint = ground(height, east.hypot(north), None);
    let (east, north) = (steepen * east, steepen * north);
    let slope = east.hypot(north);
    let normal = 1.0 / (1.0 + slope * slope).sqrt();
    let light: f32 = LIGHTS
        .iter()
        .map(|&(azimuth, share)| {
            let (sine, cosine) = azimuth.to_radians().sin_cos();
            // Cosine between the normal (−east, −north, 1) and the light, over the light's own.
            let toward = LIGHT_RISE - east * sine - north * cosine;
            share * (toward * normal / (1.0 + LIGHT_RISE * LIGHT_RISE).sqrt()).max(0.0)
        })
        .sum();
    // A plain lies at 0.707: that is where the tint stands as it is.
    let plain = LIGHT_RISE / (1.0 + LIGHT_RISE * LIGHT_RISE).sqrt();
    let colour = if light < plain {
        mix(tint, SHADOW, 0.85 * (1.0 - light / plain).powf(0.9))
    } else {
        mix(tint, HIGHLIGHT, 0.75 * smooth_step(0.0, 1.0, (light - plain) / (1.0 - plain)))
    };
    let [red, green, blue] = colour.map(|value| value.round().clamp(0.0, 255.0) as u8);
    [red, green, blue, 255]
}
