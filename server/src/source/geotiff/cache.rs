//! Decoded chunks of all rasters, bounded in bytes, least recently used first out, each decoded by
//! one thread however many want it.

use super::chunk::Samples;
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Bytes that all open rasters together keep decoded.
pub const CACHE_BYTES: usize = 256 << 20;

/// Raster (by a number that no other open raster has), image within it, chunk within the image.
pub type Key = (u64, u32, u32);

type Slot = Arc<OnceLock<Result<Arc<Samples>, String>>>;

/// The cache.
#[derive(Default)]
pub struct ChunkCache {
    inner: Mutex<Inner>,
    limit: usize,
}

#[derive(Default)]
struct Inner {
    slots: HashMap<Key, Held>,
    /// Keys by when they were used last.
    order: BTreeMap<u64, Key>,
    clock: u64,
    bytes: usize,
}

struct Held {
    slot: Slot,
    used: u64,
    bytes: usize,
}

impl ChunkCache {
    /// A cache that holds up to `limit` bytes.
    pub fn new(limit: usize) -> Self {
        Self { inner: Mutex::default(), limit }
    }

    /// The one that all rasters share.
    pub fn shared() -> &'static Arc<Self> {
        static SHARED: OnceLock<Arc<ChunkCache>> = OnceLock::new();
        SHARED.get_or_init(|| Arc::new(Self::new(CACHE_BYTES)))
    }

    /// The chunk, from the cache or from `decode`. A failure is told to all who wait, and is not
    /// kept: the next one tries again.
    ///
    /// # Errors
    /// What `decode` says.
    pub fn get(
        &self,
        key: Key,
        decode: impl FnOnce() -> Result<Samples, String>,
    ) -> Result<Arc<Samples>, String> {
        let slot = self.touch(key);
        let mut fresh = false;
        let result = slot
            .get_or_init(|| {
                fresh = true;
                decode().map(Arc::new)
            })
            .clone();
        if fresh {
            self.settle(key, &slot, result.as_ref().map_or(None, |samples| Some(samples.bytes())));
        }
        result
    }

    fn touch(&self, key: Key) -> Slot {
        // A panic elsewhere leaves the map whole: every change below is finished before anything can fail.
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        inner.clock += 1;
        let now = inner.clock;
        let held =
            inner.slots.entry(key).or_insert_with(|| Held { slot: Slot::default(), used: 0, bytes: 0 });
        let before = std::mem::replace(&mut held.used, now);
        let slot = Arc::clone(&held.slot);
        inner.order.remove(&before);
        inner.order.insert(now, key);
        slot
    }

    fn settle(&self, key: Key, slot: &Slot, bytes: Option<usize>) {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(held) = inner.slots.get_mut(&key).filter(|held| Arc::ptr_eq(&held.slot, slot)) else {
            return;
        };
        if let Some(bytes) = bytes {
            held.bytes = bytes;
            inner.bytes += bytes;
            while inner.bytes > self.limit {
                let Some((_, oldest)) = inner.order.pop_first() else { break };
                if let Some(gone) = inner.slots.remove(&oldest) {
                    inner.bytes -= gone.bytes;
                }
            }
        } else {
            let used = held.used;
            inner.slots.remove(&key);
            inner.order.remove(&used);
        }
    }

    /// Bytes held now.
    pub fn bytes(&self) -> usize {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner).bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn bounded_and_least_recently_used_first_out() {
        let cache = ChunkCache::new(30);
        let made = AtomicUsize::new(0);
        let get = |index| {
            cache
                .get((0, 0, index), || {
                    made.fetch_add(1, Ordering::Relaxed);
                    Ok(Samples::U8(vec![index as u8; 10]))
                })
                .unwrap()
        };
        for index in 0..3 {
            get(index);
        }
        get(0);
        get(3);
        assert_eq!(cache.bytes(), 30);
        assert_eq!(made.load(Ordering::Relaxed), 4);
        get(0);
        assert_eq!(made.load(Ordering::Relaxed), 4, "0 was used after 1");
        get(1);
        assert_eq!(made.load(Ordering::Relaxed), 5, "1 was the oldest");
    }

    #[test]
    fn one_decodes_for_all_and_failures_are_not_kept() {
        let cache = ChunkCache::new(1000);
        let made = AtomicUsize::new(0);
        let barrier = std::sync::Barrier::new(8);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    barrier.wait();
                    cache
                        .get((1, 0, 0), || {
                            made.fetch_add(1, Ordering::Relaxed);
                            Ok(Samples::U8(vec![1]))
                        })
                        .unwrap();
                });
            }
        });
        assert_eq!(made.load(Ordering::Relaxed), 1);
        assert_eq!(cache.get((1, 0, 1), || Err("damaged".to_owned())).unwrap_err(), "damaged");
        assert!(cache.get((1, 0, 1), || Ok(Samples::U8(vec![1]))).is_ok());
    }
}
