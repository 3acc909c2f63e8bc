//! A map to look at: heights as tints under light from the north-west.

use super::RecipeError;
use super::grid_places::{spacing, with_margin};
use super::relief_colours::{ground, mix, smooth_step};
use crate::source::SampleGrid;
use treeline_core::layer::SurfaceType;

/// Light falls mostly from the north-west, as on printed maps, and some from either side of it, so
/// that ridges along the light show too: (azimuth in degrees clockwise from north, share).
const LIGHTS: [(f32, f32); 4] = [(315.0, 0.52), (270.0, 0.18), (0.0, 0.2), (225.0, 0.1)];
/// Tangent of the lights' height over the horizon (45°).
const LIGHT_RISE: f32 = 1.0;
/// Tint of crowns, and how much of their flanks' slope shows: as steep as they are, all would be dark.
pub(super) const CANOPY: [f32; 3] = [84.0, 122.0, 80.0];
const CANOPY_STEEPNESS: f32 = 0.25;
/// Colours of full shadow and full light are mixed in this far.
const SHADOW: [f32; 3] = [38.0, 46.0, 70.0];
const HIGHLIGHT: [f32; 3] = [255.0, 250.0, 236.0];

/// Heights on a grid, and where they are known the surface types.
pub type Sampled = (Vec<f32>, Option<Vec<u8>>);

/// The map of what `sample` gives for a grid: RGBA with straight alpha.
pub fn pixels(
    grid: &SampleGrid,
    sample: impl Fn(&SampleGrid) -> Result<Sampled, RecipeError>,
) -> Result<Vec<[u8; 4]>, RecipeError> {
    let (heights, types) = sample(&with_margin(grid, 1))?;
    // From afar slopes average out: what is left of them is steepened, or mountains look flat.
    let apart = spacing(grid).first().map_or(1.0, |step| step.1);
    let steepen = (apart / 40.0).powf(0.3).clamp(1.0, 4.0);
    let lights = LIGHTS.map(|(azimuth, share)| {
        let (sine, cosine) = azimuth.to_radians().sin_cos();
        (sine, cosine, share)
    });
    let width = grid.size().0 as usize;
    Ok(slopes(grid, &heights)
        .enumerate()
        .map(|(index, sample)| {
            let Some((height, east, north)) = sample else { return [0; 4] };
            let with_margin = (index / width + 1) * (width + 2) + index % width + 1;
            let (tint, steepen) = match &types {
                Some(types) if types[with_margin] == SurfaceType::Canopy as u8 => {
                    (CANOPY, CANOPY_STEEPNESS * steepen)
                }
                _ => (ground(height, east.hypot(north), None), steepen),
            };
            shaded(tint, steepen * east, steepen * north, &lights)
        })
        .collect())
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

/// Colour of a sample of a tint and slopes: darker where the light does not reach. Lights are
/// given by sine and cosine of the azimuth, and share.
fn shaded(tint: [f32; 3], east: f32, north: f32, lights: &[(f32, f32, f32)]) -> [u8; 4] {
    let normal = 1.0 / (1.0 + east * east + north * north).sqrt();
    let light: f32 = lights
        .iter()
        .map(|&(sine, cosine, share)| {
            // Cosine between the normal (−east, −north, 1) and the light, over the light's own.
            let toward = LIGHT_RISE - east * sine - north * cosine;
            share * (toward * normal / (1.0 + LIGHT_RISE * LIGHT_RISE).sqrt()).max(0.0)
        })
        .sum();
    // A plain lies at 0.707: that is where the tint stands as it is.
    let plain = LIGHT_RISE / (1.0 + LIGHT_RISE * LIGHT_RISE).sqrt();
    let colour = if light < plain {
        mix(tint, SHADOW, 0.68 * (1.0 - light / plain))
    } else {
        mix(tint, HIGHLIGHT, 0.75 * smooth_step(0.0, 1.0, (light - plain) / (1.0 - plain)))
    };
    let [red, green, blue] = colour.map(|value| value.round().clamp(0.0, 255.0) as u8);
    [red, green, blue, 255]
}
