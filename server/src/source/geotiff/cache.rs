//! Things that are dear to make, bounded in bytes, least recently used first out, each made by one
//! thread however many want it. Decoded chunks of all rasters share one such cache.

use super::chunk::Samples;
use std::collections::{BTreeMap, HashMap};
use std::hash::Hash;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Bytes that all caches of this kind hold.
static HELD_BY_ALL: AtomicUsize = AtomicUsize::new(0);

/// Bytes that all caches of this kind hold now: decoded chunks, and what is made of them.
pub fn held_by_all() -> usize {
    HELD_BY_ALL.load(Relaxed)
}

/// Bytes that all open rasters together keep decoded.
pub const CACHE_BYTES: usize = 256 << 20;

/// Raster (by a number that no other open raster has), image within it, chunk within the image.
pub type Key = (u64, u32, u32);

/// Decoded chunks.
pub type ChunkCache = MakerCache<Key, Samples, String>;

/// What a cache can weigh.
pub trait Weigh {
    /// Bytes held.
    fn bytes(&self) -> usize;
}

impl Weigh for Samples {
    fn bytes(&self) -> usize {
        Samples::bytes(self)
    }
}

type Slot<V, E> = Arc<OnceLock<Result<Arc<V>, E>>>;

/// The cache: values by key, errors told to all who wait.
pub struct MakerCache<K, V, E> {
    inner: Mutex<Inner<K, V, E>>,
    limit: usize,
}

impl<K, V, E> Drop for MakerCache<K, V, E> {
    fn drop(&mut self) {
        let inner = self.inner.get_mut().unwrap_or_else(PoisonError::into_inner);
        HELD_BY_ALL.fetch_sub(inner.bytes, Relaxed);
    }
}

struct Inner<K, V, E> {
    slots: HashMap<K, Held<V, E>>,
    /// Keys by when they were used last.
    order: BTreeMap<u64, K>,
    clock: u64,
    bytes: usize,
}

struct Held<V, E> {
    slot: Slot<V, E>,
    used: u64,
    bytes: usize,
}

impl ChunkCache {
    /// The one that all rasters share.
    pub fn shared() -> &'static Arc<Self> {
        static SHARED: OnceLock<Arc<ChunkCache>> = OnceLock::new();
        SHARED.get_or_init(|| Arc::new(Self::new(CACHE_BYTES)))
    }
}

impl<K: Copy + Eq + Hash, V: Weigh, E: Clone> MakerCache<K, V, E> {
    /// A cache that holds up to `limit` bytes.
    pub fn new(limit: usize) -> Self {
        let inner = Inner { slots: HashMap::new(), order: BTreeMap::new(), clock: 0, bytes: 0 };
        Self { inner: Mutex::new(inner), limit }
    }

    /// The value, from the cache or from `make`. A failure is told to all who wait, and is not kept:
    /// the next one tries again.
    ///
    /// # Errors
    /// What `make` says.
    pub fn get(&self, key: K, make: impl FnOnce() -> Result<V, E>) -> Result<Arc<V>, E> {
        let slot = self.touch(key);
        let mut fresh = false;
        let result = slot
            .get_or_init(|| {
                fresh = true;
                make().map(Arc::new)
            })
            .clone();
        if fresh {
            self.settle(key, &slot, result.as_ref().map_or(None, |value| Some(value.bytes())));
        }
        result
    }

    /// Whether the value is there, made; not a use of it.
    pub fn holds(&self, key: &K) -> bool {
        let inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        inner.slots.get(key).is_some_and(|held| held.slot.get().is_some())
    }

    fn touch(&self, key: K) -> Slot<V, E> {
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

    fn settle(&self, key: K, slot: &Slot<V, E>, bytes: Option<usize>) {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(held) = inner.slots.get_mut(&key).filter(|held| Arc::ptr_eq(&held.slot, slot)) else {
            return;
        };
        if let Some(bytes) = bytes {
            held.bytes = bytes;
            inner.bytes += bytes;
            HELD_BY_ALL.fetch_add(bytes, Relaxed);
            while inner.bytes > self.limit {
                let Some((_, oldest)) = inner.order.pop_first() else { break };
                if let Some(gone) = inner.slots.remove(&oldest) {
                    inner.bytes -= gone.bytes;
                    HELD_BY_ALL.fetch_sub(gone.bytes, Relaxed);
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

    #[test]
    fn bounded_and_least_recently_used_first_out() {
        let cache = ChunkCache::new(30);
        let made = AtomicUsize::new(0);
        let get = |index| {
            cache
                .get((0, 0, index), || {
                    made.fetch_add(1, Relaxed);
                    Ok(Samples::U8(vec![index as u8; 10]))
                })
                .unwrap()
        };
        for index in 0..3 {
            get(index);
        }
        get(0);
        assert!(cache.holds(&(0, 0, 1)));
        get(3);
        assert!(!cache.holds(&(0, 0, 1)));
        assert_eq!(cache.bytes(), 30);
        assert_eq!(made.load(Relaxed), 4);
        get(0);
        assert_eq!(made.load(Relaxed), 4, "0 was used after 1");
        get(1);
        assert_eq!(made.load(Relaxed), 5, "1 was the oldest");
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
                            made.fetch_add(1, Relaxed);
                            Ok(Samples::U8(vec![1]))
                        })
                        .unwrap();
                });
            }
        });
        assert_eq!(made.load(Relaxed), 1);
        assert_eq!(cache.get((1, 0, 1), || Err("damaged".to_owned())).unwrap_err(), "damaged");
        assert!(cache.get((1, 0, 1), || Ok(Samples::U8(vec![1]))).is_ok());
    }
}
