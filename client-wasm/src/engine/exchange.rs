//! What a host and the engine hand each other.

use crate::passes::compress_photo::PhotoCompression;
use crate::stream::requests::{RequestId, TileKey};
use crate::stream::{StreamError, StreamOptions};
use treeline_core::camera::GeographicCamera;
use treeline_core::layer::Layer;
use treeline_core::sun::TimeError;
pub use treeline_shaders::weather::Weather;

/// Shadow steps where the host says nothing (the design's example: a reach of 3.5 km).
pub const DEFAULT_SHADOW_STEPS: u32 = 30;

/// Up to which distance trees are drawn one by one where the host says nothing, metres: on a graphics card, and on
/// an adapter that runs on the processor.
pub const DEFAULT_TREE_METRES: [f64; 2] = [1_000.0, 400.0];

/// Up to which distance undergrowth is drawn where the host says nothing, metres: on a graphics card, and on an adapter
/// that runs on the processor.
pub const DEFAULT_UNDERGROWTH_METRES: [f64; 2] = [80.0, 60.0];

/// What the engine is made with.
#[derive(Clone, Debug, PartialEq)]
pub struct EngineOptions {
    /// Streaming.
    pub stream: StreamOptions,
    /// Whether photo tiles are compressed on the GPU.
    pub photo_compression: PhotoCompression,
    /// Up to which distance trees are drawn one by one, metres; 0 for none. [`DEFAULT_TREE_METRES`] where `None`.
    pub tree_metres: Option<f64>,
    /// Up to which distance undergrowth is drawn, metres; 0 for none. [`DEFAULT_UNDERGROWTH_METRES`] where `None`.
    pub undergrowth_metres: Option<f64>,
    /// Tiles uploaded in one step at most: more would make a frame late.
    pub uploads_per_step: usize,
    /// Count texel fetches per ray.
    pub count_fetches: bool,
    /// How trees, their levels and the canopy take each other's places.
    pub hand_over: HandOver,
}

/// How trees, their levels of detail and the canopy take each other's places.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HandOver {
    /// Each tree at a place of its own, one fading into the other.
    #[default]
    Faded,
    /// All at the same size and distance, at once: what fading is measured against.
    Hard,
}

impl Default for EngineOptions {
    fn default() -> Self {
        Self {
            stream: StreamOptions::default(),
            photo_compression: PhotoCompression::default(),
            tree_metres: None,
            undergrowth_metres: None,
            uploads_per_step: 6,
            count_fetches: false,
            hand_over: HandOver::default(),
        }
    }
}

/// Who looks, at what size, under which sun.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewRequest {
    /// The camera; [`GeographicCamera::check`] holds.
    pub camera: GeographicCamera,
    /// Picture, pixels.
    pub width: u32,
    /// Picture, pixels.
    pub height: u32,
    /// Seconds since 1970-01-01T00:00Z for the sun's place; the scene's own time where `None`.
    pub sun_unix_seconds: Option<f64>,
    /// Steps of the shadow march; 0 for no shadows.
    pub shadow_steps: u32,
    /// Wind and clouds.
    pub weather: Weather,
}

/// What the host fetched.
#[derive(Clone, Debug)]
pub enum Payload {
    /// The bytes of a tile of elevation or land cover, or of a model, Content-Encoding undone.
    Bytes(Vec<u8>),
    /// A decoded photo.
    Photo {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// The picture.
        pixels: PhotoPixels,
    },
}

/// A decoded photo tile, in the form the host has it.
#[derive(Clone, Debug)]
pub enum PhotoPixels {
    /// sRGB with straight alpha, row-major from the north-west.
    Rgba(Vec<u8>),
    /// The browser's, decoded off the main thread.
    #[cfg(target_arch = "wasm32")]
    Bitmap(crate::web::ImageBitmap),
}

/// What can be fetched; it says how to decode the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Resource {
    /// A tile.
    Tile(TileKey),
    /// The models of the species of a code.
    TreeModel(u8),
}

impl Resource {
    /// Whether the host decodes it: a photo. All else comes to the engine as bytes.
    pub fn is_photo(&self) -> bool {
        matches!(self, Self::Tile(TileKey { layer: Layer::Texture, .. }))
    }

    /// What its bytes are counted under.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Tile(key) => key.layer.name(),
            Self::TreeModel(_) => "trees",
        }
    }
}

/// Something to fetch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileRequest {
    /// Names the request.
    pub id: RequestId,
    /// What it is.
    pub resource: Resource,
    /// Where it is: of tiles the scene's WMS endpoint with a GetMap query.
    pub url: String,
}

/// What a step did and asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameReport {
    /// Whether a frame was drawn into the target.
    pub drawn: bool,
    /// Whether everything the view wants is resident, drawn and faded in.
    pub settled: bool,
    /// To fetch.
    pub requests: Vec<TileRequest>,
    /// To abort.
    pub cancelled: Vec<RequestId>,
    /// Tiles that the view wants, and how many of them are here.
    pub progress: (usize, usize),
    /// Whether every tile that the view wants is here and uploaded.
    pub complete: bool,
    /// Whether the coarsest tiles are here, so that there is a landscape at all.
    pub ready: bool,
    /// Whether something still fades in: step again with the next frame.
    pub fading: bool,
    /// Where a tile failed: when it will be asked for again, in the host's seconds.
    pub retry_at: Option<f64>,
}

/// Why an engine cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EngineError {
    /// The scene cannot be streamed.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The scene's sun has no time.
    #[error("the scene's sun: {0}")]
    Sun(#[from] TimeError),
}
