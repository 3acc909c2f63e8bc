//! The photo; where there is none, the ground's colours, unlit (the client lights them).

use super::grid_places::with_margin;
use super::levels::land_cover_levels;
use super::picture::over;
use super::relief_colours::ground;
use super::stands::cover_of_cells;
use super::{RecipeError, elevation, shaded_relief};
use crate::scene::Scene;
use crate::source::{Cover, SampleGrid};
use treeline_core::grid::Registration;

/// RGBA of a grid, straight alpha: the photo, and where it has nothing and `filled` is wanted, or where
/// the scene has no photo at all, the colours of the ground.
pub fn pixels(scene: &Scene, grid: &SampleGrid, filled: bool) -> Result<Vec<[u8; 4]>, RecipeError> {
    let mut pixels = vec![[0; 4]; grid.len()];
    if let Some(photo) = &scene.colour {
        photo.sample(grid, &mut pixels)?;
        if !filled || pixels.iter().all(|pixel| pixel[3] == 255) {
            return Ok(pixels);
        }
    }
    let below = ground_colours(scene, grid)?;
    for (pixel, ground) in pixels.iter_mut().zip(below) {
        if let Some([red, green, blue]) = ground {
            *pixel = over(*pixel, [red, green, blue, 255]);
        }
    }
    Ok(pixels)
}

/// Colour of the ground at each sample, none where there is no terrain.
fn ground_colours(
    scene: &Scene,
    grid: &SampleGrid,
) -> Result<impl Iterator<Item = Option<[u8; 3]>>, RecipeError> {
    let heights = elevation::sample(scene, &with_margin(grid, 1))?;
    let covers = covers(scene, grid)?;
    let species = scene.species.clone();
    let slopes: Vec<_> = shaded_relief::slopes(grid, &heights).collect();
    Ok(slopes.into_iter().enumerate().map(move |(index, sample)| {
        let (height, east, north) = sample?;
        let cover = covers.as_ref().map(|covers| (covers[index], species.as_slice()));
        Some(ground(height, east.hypot(north), cover).map(|value| value.round().clamp(0.0, 255.0) as u8))
    }))
}

/// Land cover at each sample, where the scene has any.
fn covers(scene: &Scene, grid: &SampleGrid) -> Result<Option<Vec<Cover>>, RecipeError> {
    let (Some(field), Some(levels)) = (&scene.cover, land_cover_levels(scene)) else { return Ok(None) };
    match grid {
        SampleGrid::Lattice(window) if window.registration == Registration::Cell => {
            cover_of_cells(scene, &levels, window).map(Some)
        }
        _ => {
            let mut covers = vec![Cover::default(); grid.len()];
            field.sample(grid, &mut covers)?;
            Ok(Some(covers))
        }
    }
}
