//! Legends: what the colours of a layer mean.

use super::lettering::{Canvas, LETTER};
use super::relief_colours::{ground, surface_map_colour};
use super::shaded_relief::CANOPY;
use super::{Format, RecipeError, TileRequest, encode};
use crate::scene::Scene;
use crate::source::{RequestCrs, SampleGrid};
use treeline_core::layer::{Layer, SurfaceType};

/// Pixels between and around things.
const MARGIN: u32 = 6;
/// Width and height of a patch of colour.
const PATCH: [u32; 2] = [24, 14];
/// Tints shown of a relief.
const STEPS: u32 = 7;
const INK: [u8; 4] = [30, 34, 38, 255];
const PAPER: [u8; 4] = [255; 4];

/// Whether a layer has colours to explain: a photo has none.
pub fn has_legend(scene: &Scene, layer: Layer) -> bool {
    layer != Layer::Texture || scene.colour.is_none()
}

/// Columns and rows of a layer's legend.
pub fn size(scene: &Scene, layer: Layer) -> [u32; 2] {
    let rows = rows(scene, layer);
    let letters = rows.iter().map(|(_, text)| text.chars().count()).max().unwrap_or(0) as u32;
    let width = 3 * MARGIN + PATCH[0] + letters * LETTER;
    [width, MARGIN + rows.len() as u32 * (PATCH[1] + MARGIN)]
}

/// A layer's legend as an image.
pub fn make(scene: &Scene, layer: Layer, format: Format) -> Result<Vec<u8>, RecipeError> {
    let [width, height] = size(scene, layer);
    let mut canvas = Canvas::new(width, height, PAPER);
    for (index, (colour, text)) in rows(scene, layer).into_iter().enumerate() {
        let top = MARGIN + index as u32 * (PATCH[1] + MARGIN);
        let [red, green, blue] = colour;
        canvas.fill([MARGIN, top, PATCH[0], PATCH[1]], INK);
        canvas.fill([MARGIN + 1, top + 1, PATCH[0] - 2, PATCH[1] - 2], [red, green, blue, 255]);
        canvas.write(2 * MARGIN + PATCH[0], top + (PATCH[1] - LETTER) / 2, &text, INK);
    }
    encode::picture(&drawing(layer, format, width, height), canvas.pixels)
}

/// A request for a picture that is no map.
pub fn drawing(layer: Layer, format: Format, width: u32, height: u32) -> TileRequest {
    let crs = RequestCrs::Geographic;
    let grid = SampleGrid::Box { crs, west: 0.0, south: 0.0, east: 1.0, north: 1.0, width, height };
    TileRequest::new(layer, grid, format)
}

/// Colours and what they mean, the uppermost first.
fn rows(scene: &Scene, layer: Layer) -> Vec<([u8; 3], String)> {
    if layer == Layer::Lcc {
        return classes(scene);
    }
    let mut rows = reliefs(scene);
    if layer == Layer::CombinedElevation && scene.cover.is_some() {
        rows.push((CANOPY.map(|value| value as u8), "trees".to_owned()));
    }
    rows
}

/// Tints of flat ground from the highest to the lowest.
fn reliefs(scene: &Scene) -> Vec<([u8; 3], String)> {
    let (least, greatest) = scene.height.range();
    let (least, greatest) =
        if least.is_finite() && greatest.is_finite() { (least, greatest) } else { (0.0, 0.0) };
    let steps = if greatest > least { STEPS } else { 1 };
    (0..steps)
        .map(|step| {
            let height = greatest - (greatest - least) * step as f32 / (STEPS - 1) as f32;
            // Any slope but that of the sea, which is told from land by being flat.
            let colour = ground(height, 0.01, None).map(|value| value.round().clamp(0.0, 255.0) as u8);
            (colour, format!("{height:.0} m"))
        })
        .collect()
}

fn classes(scene: &Scene) -> Vec<([u8; 3], String)> {
    let growing = scene.growing.iter().filter_map(|&code| {
        let species = scene.species.get(usize::from(code).checked_sub(1)?)?;
        Some((species.definition.colour, species.definition.name.clone()))
    });
    let surfaces = SurfaceType::ALL.into_iter().filter(|surface| *surface != SurfaceType::Canopy);
    let surfaces = surfaces
        .filter_map(|surface| Some((surface_map_colour(surface)?, format!("{surface:?}").to_lowercase())));
    growing.chain(surfaces).collect()
}
