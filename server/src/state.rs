//! What every request needs, built once.

use crate::cache::{DiskCache, TileCache, Workers};
use crate::config::{Config, public_url};
use crate::http::{Known, Modified};
use crate::limits::Limits;
use crate::metrics::Metrics;
use crate::scene::Scene;
use crate::user_error::UserError;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::SystemTime;

/// The application's parts.
pub struct App {
    /// What is shown.
    pub scene: Arc<Scene>,
    /// Made tiles.
    pub cache: Arc<TileCache>,
    folder: CacheFolder,
    /// Counters.
    pub metrics: Arc<Metrics>,
    /// Bounds.
    pub limits: Limits,
    /// How links start, without a slash at the end; `None`: as the request's headers say.
    pub public_url: Option<String>,
    /// Requests that were answered before.
    pub known: Known,
    /// When the scene was opened.
    pub modified: Modified,
    /// Set when the server begins to stop: not ready any more, while it drains.
    pub stopping: AtomicBool,
}

/// Shared by all handlers.
pub type AppState = Arc<App>;

impl App {
    /// Builds the parts. Errors name the key of `treeline.toml` or the flag that does not work out.
    pub fn new(scene: Arc<Scene>, config: &Config) -> Result<AppState, UserError> {
        config.check().map_err(UserError::new)?;
        let metrics = Arc::new(Metrics::default());
        let workers = Workers::new(config.threads(), config.limits.maximum_queue).map_err(|error| {
            UserError::new(format!(
                "worker_threads: the system gives no {} threads ({error})",
                config.threads()
            ))
        })?;
        let folder = CacheFolder {
            folder: config.cache.clone(),
            disk_bytes: config.disk_cache_mib << 20,
            memory_bytes: (config.memory_cache_mib << 20).saturating_sub(Known::MOST_BYTES),
        };
        let cache = folder.open(&scene.revision, &Arc::new(workers), &metrics)?;
        let public_url = config
            .public_url
            .as_deref()
            .map(|url| public_url(url).map_err(|error| UserError::new(format!("--public-url {error}"))))
            .transpose()?;
        Ok(Arc::new(Self {
            scene,
            cache,
            folder,
            metrics,
            limits: config.limits,
            public_url,
            known: Known::default(),
            modified: Modified::at(SystemTime::now()),
            stopping: AtomicBool::new(false),
        }))
    }

    /// The same with other data: limits, threads and counters go on, tiles begin anew.
    pub fn reopened(scene: Arc<Scene>, before: &Self) -> Result<AppState, UserError> {
        let cache = before.folder.open(&scene.revision, before.cache.workers(), &before.metrics)?;
        Ok(Arc::new(Self {
            scene,
            cache,
            folder: before.folder.clone(),
            metrics: before.metrics.clone(),
            limits: before.limits,
            public_url: before.public_url.clone(),
            known: Known::default(),
            modified: Modified::at(SystemTime::now()),
            stopping: AtomicBool::new(before.stopping.load(Relaxed)),
        }))
    }

    /// Whether the server wants requests.
    pub fn is_ready(&self) -> bool {
        !self.stopping.load(Relaxed)
    }
}

/// Where made tiles are kept, and how many.
#[derive(Clone, Debug)]
struct CacheFolder {
    folder: Option<PathBuf>,
    disk_bytes: u64,
    memory_bytes: u64,
}

impl CacheFolder {
    fn open(
        &self,
        revision: &str,
        workers: &Arc<Workers>,
        metrics: &Arc<Metrics>,
    ) -> Result<Arc<TileCache>, UserError> {
        let disk = match &self.folder {
            None => None,
            Some(folder) => {
                Some(Arc::new(DiskCache::open(folder, revision, self.disk_bytes).map_err(|error| {
                    UserError::new(format!(
                        "--cache {}: cannot be written to ({error}); name a folder that this user may write",
                        folder.display()
                    ))
                })?))
            }
        };
        let cache =
            TileCache::new(self.memory_bytes, disk, workers.clone(), metrics.clone()).map_err(|error| {
                UserError::new(format!("the system gives no thread to write tiles with ({error})"))
            })?;
        Ok(Arc::new(cache))
    }
}
