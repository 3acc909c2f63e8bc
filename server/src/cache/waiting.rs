//! Who waits for which key, so that work nobody waits for is not done.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

type Counts = HashMap<Arc<str>, usize>;

/// Number of waiting clients by key.
#[derive(Clone, Debug, Default)]
pub struct Waiting(Arc<Mutex<Counts>>);

impl Waiting {
    fn counts(&self) -> MutexGuard<'_, Counts> {
        // A count is never left half-changed, so a poisoned lock is as good as another.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts one who waits, until the guard is dropped.
    pub fn enter(&self, key: Arc<str>) -> Waits {
        *self.counts().entry(key.clone()).or_default() += 1;
        Waits { waiting: self.clone(), key }
    }

    /// Whether anyone waits for the key.
    pub fn anyone(&self, key: &str) -> bool {
        self.counts().contains_key(key)
    }
}

/// One who waits.
#[derive(Debug)]
pub struct Waits {
    waiting: Waiting,
    key: Arc<str>,
}

impl Drop for Waits {
    fn drop(&mut self) {
        let mut counts = self.waiting.counts();
        if let Some(count) = counts.get_mut(&self.key) {
            *count -= 1;
            if *count == 0 {
                counts.remove(&self.key);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_to_leave_removes_the_key() {
        let waiting = Waiting::default();
        let first = waiting.enter("a".into());
        let second = waiting.enter("a".into());
        drop(first);
        assert!(waiting.anyone("a") && !waiting.anyone("b"));
        drop(second);
        assert!(!waiting.anyone("a") && waiting.counts().is_empty());
    }
}
