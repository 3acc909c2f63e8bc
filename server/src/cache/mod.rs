//! Made tiles: a bounded memory, optionally a folder, one maker per key, work on a bounded pool.
//!
//! A lookup that misses is flown by a task of its own: a client that goes away cancels neither the
//! work that others wait for nor work that has begun. Work that still waits in the queue when its
//! last client has left is dropped instead of done.

mod at_once;
mod disk;
mod keeper;
mod space;
mod waiting;
mod workers;

pub use disk::DiskCache;
pub use workers::{Overload, Workers};

use crate::metrics::{Metrics, Outcome, Product};
use axum::body::Bytes;
use keeper::Keeper;
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};
use waiting::Waiting;

/// What identifies an answer: everything that changes its bytes but the scene's revision, spelt in
/// one canonical way.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct TileKey {
    /// What it is, for the metrics.
    pub product: Product,
    /// The canonical spelling (it names the layer, too).
    pub text: Arc<str>,
}

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MakeError {
    /// The request asks for something that cannot be: the client's to mend.
    #[error("{0}")]
    Refused(String),
    /// Making it failed: a file changed or is damaged.
    #[error("{0}")]
    Failed(String),
    /// A server that has a source does not answer as it should: it may later.
    #[error("{0}")]
    Upstream(String),
    /// Too many tiles wait already.
    #[error("the server is busy: too many tiles wait to be made; ask again in a second")]
    Busy,
    /// A defect of ours.
    #[error("making this tile failed unexpectedly; the server's log has the details")]
    Panicked,
    /// Everybody who waited went away before the work began. Never seen by one who waits.
    #[error("nobody waits for this tile any more")]
    Abandoned,
}

/// How a tile is made: called on a worker, at most once at a time for one key.
pub type Maker = Arc<dyn Fn() -> Result<Vec<u8>, MakeError> + Send + Sync>;

/// What a tile takes in memory, bytes.
fn weight(key: &str, tile: &Bytes) -> u64 {
    // A map entry, its key and moka's own bookkeeping weigh a few hundred bytes even for an empty tile.
    const OVERHEAD_BYTES: usize = 256;
    (key.len() + room(tile.len()) + OVERHEAD_BYTES) as u64
}

/// What an allocator takes for so many bytes: it has four sizes for each doubling, and gives the next larger one.
fn room(bytes: usize) -> usize {
    let step = (bytes.max(64).next_power_of_two() / 8).max(16);
    bytes.next_multiple_of(step)
}

/// The cache.
pub struct TileCache {
    memory: moka::future::Cache<Arc<str>, Bytes>,
    disk: Option<(Arc<DiskCache>, Keeper)>,
    workers: Arc<Workers>,
    waiting: Waiting,
    metrics: Arc<Metrics>,
}

impl TileCache {
    /// A cache of at most `memory_bytes`, in front of the folder if there is one. Errors where the system gives no
    /// thread to write with.
    pub fn new(
        memory_bytes: u64,
        disk: Option<Arc<DiskCache>>,
        workers: Arc<Workers>,
        metrics: Arc<Metrics>,
    ) -> io::Result<Self> {
        let memory = moka::future::Cache::builder()
            .max_capacity(memory_bytes)
            .weigher(|key: &Arc<str>, value: &Bytes| u32::try_from(weight(key, value)).unwrap_or(u32::MAX))
            .build();
        let disk = match disk {
            Some(disk) => Some((disk.clone(), Keeper::new(disk)?)),
            None => None,
        };
        Ok(Self { memory, disk, workers, waiting: Waiting::default(), metrics })
    }

    /// The answer for a key: from memory, the folder, someone else's flight, or made now.
    pub async fn get(self: &Arc<Self>, key: &TileKey, make: Maker) -> Result<Bytes, MakeError> {
        let answer = self.look_up(key, make).await;
        match &answer {
            Ok((bytes, outcome)) => self.metrics.tile(key.product, *outcome, bytes.len()),
            Err(MakeError::Busy) => self.metrics.tile(key.product, Outcome::Busy, 0),
            Err(_) => self.metrics.tile(key.product, Outcome::Failed, 0),
        }
        answer.map(|(bytes, _)| bytes)
    }

    /// The answer for a key where it can be had without waiting: from memory, or from what the system holds of the
    /// folder. It counts as a lookup only then.
    pub async fn get_at_once(&self, key: &TileKey) -> Option<Bytes> {
        let (bytes, outcome) = self.look_at_once(key).await?;
        self.metrics.tile(key.product, outcome, bytes.len());
        Some(bytes)
    }

    async fn look_at_once(&self, key: &TileKey) -> Option<(Bytes, Outcome)> {
        if let Some(bytes) = self.memory.get(&key.text).await {
            return Some((bytes, Outcome::Memory));
        }
        let bytes = self.disk()?.read_at_once(&key.text)?;
        if self.memory.policy().max_capacity().is_none_or(|most| weight(&key.text, &bytes) <= most) {
            self.memory.insert(key.text.clone(), bytes.clone()).await;
        }
        Some((bytes, Outcome::Disk))
    }

    async fn look_up(self: &Arc<Self>, key: &TileKey, make: Maker) -> Result<(Bytes, Outcome), MakeError> {
        if let Some(found) = self.look_at_once(key).await {
            return Ok(found);
        }
        let _waits = self.waiting.enter(key.text.clone());
        loop {
            let flight = tokio::spawn(self.clone().fly(key.clone(), make.clone()));
            match flight.await {
                // The flight that this one joined was given up just before; this one flies again.
                Ok(Err(MakeError::Abandoned)) => {}
                Ok(answer) => return answer,
                Err(_) => return Err(MakeError::Panicked),
            }
        }
    }

    async fn fly(self: Arc<Self>, key: TileKey, make: Maker) -> Result<(Bytes, Outcome), MakeError> {
        let mut outcome = Outcome::Memory;
        let entry = self
            .memory
            .entry(key.text.clone())
            .or_try_insert_with(async {
                if let Some(bytes) = self.read_disk(&key).await {
                    outcome = Outcome::Disk;
                    return Ok(bytes);
                }
                outcome = Outcome::Made;
                self.make(&key, make).await
            })
            .await
            .map_err(|error| (*error).clone())?;
        Ok((entry.into_value(), outcome))
    }

    async fn read_disk(&self, key: &TileKey) -> Option<Bytes> {
        let disk = self.disk()?.clone();
        let text = key.text.clone();
        tokio::task::spawn_blocking(move || disk.read(&text)).await.ok().flatten()
    }

    async fn make(self: &Arc<Self>, key: &TileKey, make: Maker) -> Result<Bytes, MakeError> {
        let (cache, key) = (self.clone(), key.clone());
        let job = move || {
            if !cache.waiting.anyone(&key.text) {
                return Err(MakeError::Abandoned);
            }
            let start = Instant::now();
            // Without the room that was left to grow, which nobody would count.
            let bytes = Bytes::from(make()?.into_boxed_slice());
            cache.metrics.made(key.product, start.elapsed());
            // Written after it has been answered.
            if let Some((_, keeper)) = &cache.disk {
                keeper.keep(&key.text, &bytes);
            }
            Ok(bytes)
        };
        match self.workers.run(job).await {
            Ok(made) => made,
            Err(Overload::QueueFull) => Err(MakeError::Busy),
            Err(Overload::Panicked) => Err(MakeError::Panicked),
        }
    }

    /// Whether the folder holds the key's answer, whole.
    pub fn is_on_disk(&self, key: &TileKey) -> bool {
        self.disk().is_some_and(|disk| disk.read(&key.text).is_some())
    }

    /// The folder, where there is one.
    pub fn disk(&self) -> Option<&Arc<DiskCache>> {
        self.disk.as_ref().map(|(disk, _)| disk)
    }

    /// Waits until the folder has all tiles that were made; `false` where that takes longer. Blocks: not for async
    /// threads that serve.
    pub fn flush(&self, longest: Duration) -> bool {
        self.disk.as_ref().is_none_or(|(_, keeper)| keeper.flush(longest))
    }

    /// The pool that makes tiles, for other work that must not run on the async threads.
    pub fn workers(&self) -> &Arc<Workers> {
        &self.workers
    }

    /// Bytes held in memory, as weighed (eventually consistent).
    pub fn memory_bytes(&self) -> u64 {
        self.memory.weighted_size()
    }

    /// Tiles held in memory (eventually consistent).
    pub fn memory_tiles(&self) -> u64 {
        self.memory.entry_count()
    }
}

#[cfg(test)]
mod tests;
