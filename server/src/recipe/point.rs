//! What there is at one place, for GetFeatureInfo.

use super::levels::land_cover_levels;
use super::{RecipeError, combined_elevation};
use crate::scene::Scene;
use crate::source::{RequestCrs, SampleGrid};

/// Heights and land cover at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct PointInfo {
    /// Height of the ground, metres; none where there is no data.
    pub terrain: Option<f64>,
    /// Height of the highest crown above the ground, metres, 0 in the open; none where there is no
    /// terrain, or the scene knows nothing of what grows.
    pub canopy: Option<f64>,
    /// Land-cover class (species code), 0 for none; none where the scene has no land cover.
    pub class: Option<u8>,
    /// Name of the species, where one grows.
    pub species: Option<String>,
}

/// A box of one pixel this wide stands for a place, degrees (0.1 mm).
const PLACE_DEGREES: f64 = 1e-9;

/// Looks a place up; degrees.
pub fn point(scene: &Scene, longitude: f64, latitude: f64) -> Result<PointInfo, RecipeError> {
    let nothing = PointInfo { terrain: None, canopy: None, class: None, species: None };
    if !longitude.is_finite() || !(-90.0..=90.0).contains(&latitude) {
        return Ok(nothing);
    }
    let grid = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: longitude - PLACE_DEGREES,
        south: latitude - PLACE_DEGREES,
        east: longitude + PLACE_DEGREES,
        north: latitude + PLACE_DEGREES,
        width: 1,
        height: 1,
    };
    let mut ground = [f32::NAN];
    scene.height.sample(&grid, &mut ground)?;
    let terrain = Some(ground[0]).filter(|metres| metres.is_finite()).map(f64::from);
    let Some(levels) = land_cover_levels(scene) else { return Ok(PointInfo { terrain, ..nothing }) };
    let (crown, cover) = combined_elevation::at_place(scene, &levels, longitude, latitude)?;
    let species = usize::from(cover.species)
        .checked_sub(1)
        .and_then(|index| scene.species.get(index))
        .map(|species| species.definition.name.clone());
    Ok(PointInfo {
        terrain,
        canopy: terrain.map(|terrain| (f64::from(crown) - terrain).max(0.0)),
        class: Some(cover.species),
        species,
    })
}
