//! A scene, opened: the fields that recipes read, and what people and clients are told about it.

use crate::source::{ColourField, CoverField, HeightField};
use std::sync::Arc;
use treeline_core::camera::GeographicCamera;
use treeline_core::codec::land_cover::CodeBits;
use treeline_core::scene::Place;
use treeline_core::seeds::Species;

/// Everything that a recipe needs, immutable while the server runs.
pub struct Scene {
    /// For people.
    pub name: String,
    /// Data version: changes whenever any tile would.
    pub revision: String,
    /// Terrain (vertical scale and offset already applied).
    pub height: Arc<dyn HeightField>,
    /// Photo, where there is one; without it the relief gives the colour.
    pub colour: Option<Arc<dyn ColourField>>,
    /// What grows, where anything is known of it.
    pub cover: Option<Arc<dyn CoverField>>,
    /// Species by code: index 0 is code 1.
    pub species: Vec<Species>,
    /// Codes of the species that [`Self::cover`] may have, ascending.
    pub growing: Vec<u8>,
    /// Bits of a packed land-cover code.
    pub code_bits: CodeBits,
    /// The seed that grows the forest.
    pub seed: u32,
    /// Shown beside the picture.
    pub attribution: Vec<String>,
    /// Where the sun stands by default, RFC 3339.
    pub sun_time: String,
    /// A view that shows the scene well.
    pub camera: GeographicCamera,
    /// Named places.
    pub places: Vec<Place>,
}
