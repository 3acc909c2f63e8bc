//! The real router in this process as a source of tiles.

use anyhow::{Context as _, ensure};
use axum::Router;
use axum::body::Body;
use axum::http::Request;
use std::sync::Arc;
use std::sync::Mutex;
use tokio::runtime::Runtime;
use tower::ServiceExt as _;
use treeline_client::headless::{Fetched, TileFetcher};
use treeline_client::stream::requests::FetchFailure;
use treeline_core::scene::SceneDescription;
use treeline_server::config::Config;
use treeline_server::scene::Scene;
use treeline_server::state::App;
use treeline_server::{http, opening};

/// Larger than any answer.
const BODY_LIMIT: usize = 64 << 20;

/// A router, and what was asked of it.
pub struct RouterTiles {
    runtime: Runtime,
    router: Router,
    asked: Mutex<Vec<String>>,
}

impl RouterTiles {
    /// Of the built-in landscape.
    pub fn built_in() -> anyhow::Result<Self> {
        let scene = opening::open(&Default::default()).map_err(|error| anyhow::anyhow!("{error}"))?;
        Self::of(scene)
    }

    /// Of a scene.
    pub fn of(scene: Scene) -> anyhow::Result<Self> {
        let app =
            App::new(Arc::new(scene), &Config::default()).map_err(|error| anyhow::anyhow!("{error}"))?;
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        Ok(Self { runtime, router: http::router(app), asked: Mutex::default() })
    }

    /// A good answer's body, without Content-Encoding.
    pub fn get(&self, url: &str) -> anyhow::Result<Vec<u8>> {
        if let Ok(mut asked) = self.asked.lock() {
            asked.push(url.to_owned());
        }
        self.runtime.block_on(async {
            let response = self.router.clone().oneshot(Request::get(url).body(Body::empty())?).await?;
            let status = response.status();
            let body = axum::body::to_bytes(response.into_body(), BODY_LIMIT).await?;
            ensure!(status.is_success(), "{url}: {status}: {}", String::from_utf8_lossy(&body));
            Ok(body.into())
        })
    }

    /// What the scene has.
    pub fn scene(&self) -> anyhow::Result<SceneDescription> {
        serde_json::from_slice(&self.get("/scene.json")?).context("/scene.json")
    }

    /// Addresses asked for since the start that contain a text.
    pub fn asked(&self, text: &str) -> usize {
        self.asked.lock().map_or(0, |asked| asked.iter().filter(|url| url.contains(text)).count())
    }
}

impl TileFetcher for RouterTiles {
    fn fetch(&self, url: &str) -> Result<Fetched, FetchFailure> {
        self.get(url).map(Fetched::plain).map_err(|error| FetchFailure::Permanent(error.to_string()))
    }
}
