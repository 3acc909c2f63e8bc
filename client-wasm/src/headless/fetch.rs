//! Getting tiles, and decoding photos.

use crate::engine::{Payload, PhotoPixels};
use crate::stream::requests::{FetchFailure, TileKey};
use treeline_core::layer::Layer;

/// Where tiles come from: a server over HTTP, or its router in this process. Called from several threads.
pub trait TileFetcher: Sync {
    /// The body of an address as the scene spells it (absolute, or a path), Content-Encoding undone.
    fn fetch(&self, url: &str) -> Result<Vec<u8>, FetchFailure>;
}

impl<F: Fn(&str) -> Result<Vec<u8>, FetchFailure> + Sync> TileFetcher for F {
    fn fetch(&self, url: &str) -> Result<Vec<u8>, FetchFailure> {
        self(url)
    }
}

/// Fetches a tile and decodes what the engine does not decode itself.
pub fn fetch_tile(fetcher: &dyn TileFetcher, key: TileKey, url: &str) -> Result<Payload, FetchFailure> {
    let bytes = fetcher.fetch(url)?;
    if key.layer == Layer::Texture { decode_photo(&bytes) } else { Ok(Payload::Bytes(bytes)) }
}

/// Decodes a photo (JPEG, PNG, WebP).
pub fn decode_photo(bytes: &[u8]) -> Result<Payload, FetchFailure> {
    let picture = image::load_from_memory(bytes)
        .map_err(|error| FetchFailure::Temporary(format!("not a picture: {error}")))?
        .into_rgba8();
    let (width, height) = picture.dimensions();
    Ok(Payload::Photo {
        width,
        height,
        bytes: bytes.len() as u64,
        pixels: PhotoPixels::Rgba(picture.into_raw()),
    })
}
