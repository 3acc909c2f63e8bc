//! One row per layer: what its tiles look like. Server and client read this table, nothing else.

use crate::grid::Registration;
use serde::{Deserialize, Serialize};

/// Media type of Treeline's own elevation tiles ([`crate::codec::elevation`]).
pub const ELEVATION_MEDIA_TYPE: &str = "application/vnd.treeline.elevation";
/// Media type of Treeline's own land-cover tiles ([`crate::codec::land_cover`]).
pub const LAND_COVER_MEDIA_TYPE: &str = "application/vnd.treeline.lcc";

/// The layers, by their WMS names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layer {
    /// Bare terrain, metres.
    Elevation,
    /// Terrain and canopy, metres.
    CombinedElevation,
    /// Land-cover classes.
    Lcc,
    /// The photo.
    Texture,
}

/// A layer's row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerRow {
    /// The layer.
    pub layer: Layer,
    /// Name in WMS, `/tiles` and `scene.json`.
    pub name: &'static str,
    /// Title for people.
    pub title: &'static str,
    /// How samples stand, in tiles as the client asks for them.
    pub registration: Registration,
    /// Samples beyond the tile on each side, in tiles as the client asks for them.
    pub border: u32,
    /// Media type in which the client asks for tiles.
    pub client_format: &'static str,
    /// All media types it is served in; the first is the default.
    pub formats: &'static [&'static str],
}

const ELEVATION_FORMATS: &[&str] = &[
    "image/png",
    "application/bil16",
    "application/bil32",
    "image/x-bil;bits=32",
    "image/tiff",
    ELEVATION_MEDIA_TYPE,
];

/// The table.
pub const LAYERS: [LayerRow; 4] = [
    LayerRow {
        layer: Layer::Elevation,
        name: "elevation",
        title: "Terrain elevation",
        registration: Registration::Node,
        // One ring of neighbours, for normals by central differences on the tile's edge.
        border: 1,
        client_format: ELEVATION_MEDIA_TYPE,
        formats: ELEVATION_FORMATS,
    },
    LayerRow {
        layer: Layer::CombinedElevation,
        name: "combined-elevation",
        title: "Terrain and canopy elevation",
        registration: Registration::Node,
        border: 1,
        client_format: ELEVATION_MEDIA_TYPE,
        formats: ELEVATION_FORMATS,
    },
    LayerRow {
        layer: Layer::Lcc,
        name: "lcc",
        title: "Land cover",
        registration: Registration::Cell,
        border: 0,
        client_format: LAND_COVER_MEDIA_TYPE,
        formats: &["image/png", LAND_COVER_MEDIA_TYPE],
    },
    LayerRow {
        layer: Layer::Texture,
        name: "texture",
        title: "Aerial photo",
        registration: Registration::Cell,
        // Filtering never reads a neighbour's texels; 520 is a whole number of 4 × 4 blocks.
        border: 4,
        client_format: "image/jpeg",
        formats: &["image/png", "image/jpeg", "image/webp"],
    },
];

impl Layer {
    /// The layer's row.
    pub fn row(self) -> &'static LayerRow {
        &LAYERS[self as usize]
    }

    /// Name in WMS, `/tiles` and `scene.json`.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The layer of a name, exactly as spelt in the table.
    pub fn from_name(name: &str) -> Option<Self> {
        LAYERS.iter().find(|row| row.name == name).map(|row| row.layer)
    }

    /// Whether samples are heights.
    pub fn is_elevation(self) -> bool {
        matches!(self, Self::Elevation | Self::CombinedElevation)
    }
}

/// What a texel of the combined elevation map is made of: selects the shading, never interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[repr(u8)]
pub enum SurfaceType {
    /// Nothing special: the photo as it is.
    #[default]
    Plain = 0,
    /// A tree's crown.
    Canopy = 1,
    /// Open water.
    Water = 2,
    /// Bare rock and scree.
    Rock = 3,
    /// Snow and ice.
    Snow = 4,
    /// Grass and low plants.
    Grass = 5,
}

impl SurfaceType {
    /// All types, by code.
    pub const ALL: [Self; 6] = [Self::Plain, Self::Canopy, Self::Water, Self::Rock, Self::Snow, Self::Grass];

    /// The type of a code, `None` for one that is not ours.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_indexed_by_the_layer() {
        for row in &LAYERS {
            assert_eq!(row.layer.row(), row);
            assert_eq!(Layer::from_name(row.name), Some(row.layer));
            assert_eq!(serde_json::to_string(&row.layer).unwrap(), format!("\"{}\"", row.name));
            assert!(row.formats.contains(&row.client_format));
        }
        for (code, surface) in SurfaceType::ALL.iter().enumerate() {
            assert_eq!(*surface as usize, code);
        }
    }
}
