//! `/scene.json`: what a scene has, for a client. What it lacks is absent, and the client leaves it out.

use crate::camera::GeographicCamera;
use crate::grid::Registration;
use crate::layer::Layer;
use crate::seeds::SpeciesDefinition;
use crate::tile::GeographicBox;
use serde::{Deserialize, Serialize};

/// The document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneDescription {
    /// For people.
    pub name: String,
    /// Data version: part of every tile URL, and of ETags.
    pub revision: String,
    /// Absolute or relative URL of the WMS endpoint, ending in `?` or `&`.
    pub wms: String,
    /// What must be shown beside the picture, one entry per source.
    pub attribution: Vec<String>,
    /// Where there is terrain.
    pub extent: GeographicBox,
    /// Lowest height of the terrain, metres (a bound, never above the truth).
    pub minimum_height: f64,
    /// Greatest height of terrain and canopy, metres (a bound, never below the truth).
    pub maximum_height: f64,
    /// The layers that there are.
    pub layers: Vec<SceneLayer>,
    /// Whether anything grows: without it `combined-elevation` is `elevation`.
    pub vegetation: bool,
    /// Land-cover quadtree, where there is land cover.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub land_cover: Option<LandCoverLevels>,
    /// Species by code, where something grows.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub species: Vec<SceneSpecies>,
    /// Absolute or relative URL of the species' models, where something grows: a code follows.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub trees: Option<String>,
    /// The seed that grows the forest.
    pub seed: u32,
    /// Where the sun stands where the client says nothing.
    pub sun: Sun,
    /// A view that shows the scene well.
    pub camera: GeographicCamera,
    /// Named places.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub places: Vec<Place>,
}

impl SceneDescription {
    /// The row of a layer, if the scene has it.
    pub fn layer(&self, layer: Layer) -> Option<&SceneLayer> {
        self.layers.iter().find(|row| row.name == layer)
    }
}

/// A layer of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneLayer {
    /// Its WMS name.
    pub name: Layer,
    /// Its title.
    pub title: String,
    /// Coarsest level at which a tile has anything to show.
    pub minimum_level: u8,
    /// Deepest level: below it the source has no more detail.
    pub maximum_level: u8,
    /// How samples stand in the client's tiles.
    pub registration: Registration,
    /// Border of the client's tiles, samples.
    pub border: u32,
    /// Media type of the client's tiles.
    pub client_format: String,
    /// All media types.
    pub formats: Vec<String>,
    /// Where it has data.
    pub extent: GeographicBox,
}

/// On which matrix levels the land-cover quadtree's levels stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LandCoverLevels {
    /// Each level-1 code repeated on its four children.
    pub l0: u8,
    /// One class per code: the level at which trees are decided.
    pub l1: u8,
    /// Four level-1 neighbours packed into one code.
    pub l2: u8,
    /// Bits of a code: 8, 16 or 32.
    pub bits: u8,
    /// Level whose elevation nodes carry the trees' anchors: a trunk stands on the bilinear patch of
    /// the four around it, whatever terrain is drawn.
    pub anchor: u8,
}

/// A species as the client needs it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneSpecies {
    /// Code in land cover, 1 and up.
    pub code: u8,
    /// Name.
    pub name: String,
    /// Typical height, metres.
    pub height: f64,
    /// Crown radius over height.
    pub crown_radius_ratio: f64,
    /// As the scene states it: [`crate::seeds::Species::new`] makes of it the very numbers that decide the trees.
    pub definition: SpeciesDefinition,
}

/// Date and time that place the sun, UTC.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sun {
    /// RFC 3339, e.g. `2026-07-15T09:00:00Z`.
    pub time: String,
}

/// A named place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Name.
    pub name: String,
    /// View on it.
    pub camera: GeographicCamera,
}
