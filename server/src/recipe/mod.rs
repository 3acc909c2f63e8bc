//! How a layer's tile is made from the scene's fields: samples for a grid, then bytes of a format.
//!
//! Everything here is synchronous work on one core; the cache runs it on its pool. One file per
//! layer; [`canopy`] grows the crowns, `encode` writes the formats.

pub mod canopy;
pub mod combined_elevation;
pub mod elevation;
mod encode;
mod format;
mod grid_places;
pub mod land_cover;
pub mod legend;
pub mod lettering;
pub mod levels;
mod picture;
mod point;
mod relief_colours;
mod shaded_relief;
mod stands;
pub mod texture;

#[cfg(test)]
mod test_fields;
#[cfg(test)]
mod tests;

pub use encode::picture as encode_pixels;
pub use format::Format;
pub use levels::{anchor_level, land_cover_levels, scene_species, tallest_tree_metres};
pub use point::{PointInfo, point};

use crate::scene::Scene;
use crate::source::{SampleGrid, SourceError};
use treeline_core::codec::land_cover::ClassOverflow;
use treeline_core::layer::Layer;

/// A layer, as a picture shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drawn {
    /// The layer.
    pub layer: Layer,
    /// Texture: the relief's colours where the photo has nothing.
    pub filled: bool,
}

/// What is wanted: a layer's samples on a grid, as bytes of a format.
#[derive(Clone, Debug, PartialEq)]
pub struct TileRequest {
    /// The layer.
    pub layer: Layer,
    /// Where the samples stand. Treeline's own formats want a tile of the lattice, with any border.
    pub grid: SampleGrid,
    /// What the bytes are to be.
    pub format: Format,
    /// Texture: the relief's colours where the photo has nothing.
    pub filled: bool,
    /// Pictures: layers that are drawn over this one, the lowest first.
    pub above: Vec<Drawn>,
    /// PNG and WebP: pixels without data are transparent.
    pub transparent: bool,
    /// Colour of pixels without data where they are not transparent.
    pub background: [u8; 3],
    /// bil: the number that stands for no data.
    pub nodata: f64,
}

impl TileRequest {
    /// A request with the defaults of WMS: white background, not transparent, 0 for no data.
    pub fn new(layer: Layer, grid: SampleGrid, format: Format) -> Self {
        Self {
            layer,
            grid,
            format,
            filled: false,
            above: Vec::new(),
            transparent: false,
            background: [255; 3],
            nodata: 0.0,
        }
    }

    /// Its layers, the lowest first.
    pub fn layers(&self) -> impl Iterator<Item = Layer> + '_ {
        std::iter::once(self.layer).chain(self.above.iter().map(|drawn| drawn.layer))
    }
}

/// Why a tile could not be made.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RecipeError {
    /// A source could not be read.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The layer is not made in this format.
    #[error("layer {layer} is not made as {format}; its formats are {}", .formats.join(", "))]
    Format {
        /// WMS name of the layer.
        layer: &'static str,
        /// Media type asked for.
        format: &'static str,
        /// Media types that there are.
        formats: &'static [&'static str],
    },
    /// Treeline's own format for samples that are no tile.
    #[error("{format} is for tiles of the matrix only; ask for a tile's box, or for another format")]
    NotATile {
        /// Media type asked for.
        format: &'static str,
    },
    /// The scene has no such layer.
    #[error("the scene has no {layer}; scene.json lists its layers")]
    NoLayer {
        /// WMS name of the layer.
        layer: &'static str,
    },
    /// A class of the land cover is larger than the species table allows.
    #[error(transparent)]
    Class(#[from] ClassOverflow),
    /// The box's reference system cannot be used.
    #[error("EPSG:{epsg}: {problem}")]
    ReferenceSystem {
        /// The code.
        epsg: u32,
        /// What is wrong with it.
        problem: String,
    },
    /// An image could not be written: its size does not suit its format.
    #[error("{format} of {width} × {height} pixels: {problem}")]
    Encode {
        /// Media type asked for.
        format: &'static str,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// What the encoder says.
        problem: String,
    },
}

impl RecipeError {
    /// Whether another request would do (4xx), rather than the source or the server being at fault.
    pub fn is_request(&self) -> bool {
        !matches!(self, Self::Source(_) | Self::Class(_))
    }
}

/// Makes the bytes of a request.
pub fn make(scene: &Scene, request: &TileRequest) -> Result<Vec<u8>, RecipeError> {
    let row = request.layer.row();
    if request.format.is_picture() && request.layers().any(|layer| request.format.serves(layer)) {
        return picture::make(scene, request);
    }
    if !request.format.serves(request.layer) || !request.above.is_empty() {
        return Err(RecipeError::Format {
            layer: row.name,
            format: request.format.media_type(request.layer),
            formats: row.formats,
        });
    }
    match request.layer {
        Layer::Elevation => elevation::make(scene, request),
        Layer::CombinedElevation => combined_elevation::make(scene, request),
        Layer::Lcc => land_cover::make(scene, request),
        // All of its formats are pictures.
        Layer::Texture => picture::make(scene, request),
    }
}
