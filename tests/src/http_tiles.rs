//! Tiles of a running server, for an engine in this process.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use treeline_client::headless::{Fetched, TileFetcher};
use treeline_client::stream::requests::FetchFailure;
use treeline_core::scene::SceneDescription;

/// Larger than any tile.
const BODY_LIMIT: u64 = 64 << 20;

/// A server's tiles over HTTP, and what they weighed.
pub struct HttpTiles {
    agent: ureq::Agent,
    base: String,
    requests: AtomicU64,
    bytes: AtomicU64,
    model_bytes: AtomicU64,
}

impl HttpTiles {
    /// Of the server at `base`, an address without a slash at the end.
    pub fn new(base: &str) -> Self {
        let config = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(Duration::from_secs(60)))
            .build();
        Self {
            agent: ureq::Agent::new_with_config(config),
            base: base.trim_end_matches('/').to_owned(),
            requests: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            model_bytes: AtomicU64::new(0),
        }
    }

    /// The scene's description.
    pub fn scene(&self) -> anyhow::Result<SceneDescription> {
        let text = self.agent.get(format!("{}/scene.json", self.base)).call()?.body_mut().read_to_string()?;
        Ok(serde_json::from_str(&text)?)
    }

    /// Requests answered since the start.
    pub fn requests(&self) -> u64 {
        self.requests.load(Ordering::Relaxed)
    }

    /// Bytes of bodies since the start, as they came over the wire.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Those among them that are no tiles: the models of the species in sight, once each, whatever chooses the tiles.
    pub fn model_bytes(&self) -> u64 {
        self.model_bytes.load(Ordering::Relaxed)
    }
}

impl TileFetcher for HttpTiles {
    fn fetch(&self, url: &str) -> Result<Fetched, FetchFailure> {
        let temporary = |error: ureq::Error| FetchFailure::Temporary(error.to_string());
        let url = if url.starts_with('/') { format!("{}{url}", self.base) } else { url.to_owned() };
        // As browsers ask; asked for by hand, it is handed on as it came, and its length on the wire is known.
        let asked = self.agent.get(&url).header("Accept-Encoding", "zstd");
        let mut response = asked.call().map_err(temporary)?;
        let status = response.status().as_u16();
        let packed = response.headers().get("Content-Encoding").is_some_and(|encoding| encoding == "zstd");
        let wire = response.body_mut().with_config().limit(BODY_LIMIT).read_to_vec().map_err(temporary)?;
        let wire_bytes = wire.len() as u64;
        self.requests.fetch_add(1, Ordering::Relaxed);
        self.bytes.fetch_add(wire_bytes, Ordering::Relaxed);
        if url[self.base.len()..].starts_with("/trees/") {
            self.model_bytes.fetch_add(wire_bytes, Ordering::Relaxed);
        }
        let body = if packed {
            zstd::decode_all(&wire[..]).map_err(|error| FetchFailure::Temporary(error.to_string()))?
        } else {
            wire
        };
        match status {
            200..300 => Ok(Fetched { body, wire_bytes }),
            408 | 429 | 500.. => Err(FetchFailure::Temporary(format!("HTTP {status}"))),
            _ => Err(FetchFailure::Permanent(format!("HTTP {status}: {}", String::from_utf8_lossy(&body)))),
        }
    }
}
