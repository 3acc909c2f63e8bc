//! Getting tiles, and decoding photos.

use crate::engine::{Payload, PhotoPixels, Resource};
use crate::stream::requests::FetchFailure;

/// A good answer's body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fetched {
    /// The body, Content-Encoding undone.
    pub body: Vec<u8>,
    /// Its length on the wire, Content-Encoding still on; in one process with the server: what it would
    /// have sent.
    pub wire_bytes: u64,
}

impl Fetched {
    /// A body that came as it is.
    pub fn plain(body: Vec<u8>) -> Self {
        Self { wire_bytes: body.len() as u64, body }
    }
}

/// Where tiles come from: a server over HTTP, or its router in this process. Called from several threads.
pub trait TileFetcher: Sync {
    /// The answer of an address as the scene spells it (absolute, or a path).
    fn fetch(&self, url: &str) -> Result<Fetched, FetchFailure>;
}

impl<F: Fn(&str) -> Result<Fetched, FetchFailure> + Sync> TileFetcher for F {
    fn fetch(&self, url: &str) -> Result<Fetched, FetchFailure> {
        self(url)
    }
}

/// A tile as the engine takes it, and its length on the wire.
#[derive(Debug)]
pub struct FetchedTile {
    /// For the engine.
    pub payload: Payload,
    /// As [`Fetched::wire_bytes`].
    pub wire_bytes: u64,
}

/// Fetches a tile and decodes what the engine does not decode itself.
pub fn fetch_tile(
    fetcher: &dyn TileFetcher,
    resource: &Resource,
    url: &str,
) -> Result<FetchedTile, FetchFailure> {
    let Fetched { body, wire_bytes } = fetcher.fetch(url)?;
    let payload = if resource.is_photo() { decode_photo(&body)? } else { Payload::Bytes(body) };
    Ok(FetchedTile { payload, wire_bytes })
}

/// Decodes a photo (JPEG, PNG, WebP).
pub fn decode_photo(bytes: &[u8]) -> Result<Payload, FetchFailure> {
    let picture = image::load_from_memory(bytes)
        .map_err(|error| FetchFailure::Temporary(format!("not a picture: {error}")))?
        .into_rgba8();
    let (width, height) = picture.dimensions();
    Ok(Payload::Photo { width, height, pixels: PhotoPixels::Rgba(picture.into_raw()) })
}
