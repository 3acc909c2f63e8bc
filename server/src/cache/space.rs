//! How much a cache's folder holds, and what goes where that is too much.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, SystemTime};

/// Beginning of the names of files that are being written.
pub const INCOMPLETE: &str = ".incomplete-";
/// A file that is still incomplete after this long belongs to a process that is gone.
const ABANDONED: Duration = Duration::from_secs(3600);
/// What is kept of the limit once something has to go, so that not every write has to look for room.
const KEPT: f64 = 0.9;
/// Part of a folder's tiles that goes at a time.
const PART: usize = 4;

/// The space of a folder that holds one folder of tiles for each revision.
#[derive(Debug)]
pub struct Space {
    root: PathBuf,
    /// The revision that is served.
    revision: String,
    limit: u64,
    used: AtomicU64,
    evicted: AtomicU64,
    /// The next folder that gives room.
    turn: Mutex<usize>,
    opened: SystemTime,
}

/// A tile's file.
struct Entry {
    path: PathBuf,
    bytes: u64,
    /// When it was written or, roughly, last read.
    used: SystemTime,
}

impl Space {
    /// Of a folder, of which nothing is known yet.
    pub fn new(root: &Path, revision: &str, limit: u64) -> Self {
        Self {
            root: root.to_owned(),
            revision: revision.to_owned(),
            limit,
            used: AtomicU64::new(0),
            evicted: AtomicU64::new(0),
            turn: Mutex::new(0),
            opened: SystemTime::now(),
        }
    }

    /// Bytes of tiles, as far as they have been counted.
    pub fn used(&self) -> u64 {
        self.used.load(Relaxed)
    }

    /// Tiles that had to go since the start.
    pub fn evicted(&self) -> u64 {
        self.evicted.load(Relaxed)
    }

    /// Counts what was there before, clears away what writers left that are gone, and makes room. What is written
    /// meanwhile is counted by [`Self::grew`].
    pub fn count(&self) {
        for shard in self.shards() {
            for entry in entries(&shard) {
                if entry.used < self.opened {
                    self.used.fetch_add(entry.bytes, Relaxed);
                }
            }
        }
        self.make_room();
    }

    /// A file of so many bytes took the place of one of `before`.
    pub fn grew(&self, bytes: u64, before: u64) {
        self.used.fetch_add(bytes, Relaxed);
        self.shrank(before);
    }

    fn shrank(&self, bytes: u64) {
        // Counting is not locked: never below nothing.
        let _ = self.used.fetch_update(Relaxed, Relaxed, |used| Some(used.saturating_sub(bytes)));
    }

    /// Where there is too much, tiles of other revisions go first, then, folder by folder, those that were used least
    /// recently. One thread at a time looks for room; the others go on.
    pub fn make_room(&self) {
        if self.used() <= self.limit {
            return;
        }
        let Ok(mut turn) = self.turn.try_lock() else { return };
        let enough = (self.limit as f64 * KEPT) as u64;
        let (own, other): (Vec<_>, Vec<_>) =
            self.shards().into_iter().partition(|shard| shard.starts_with(self.root.join(&self.revision)));
        for shard in other {
            if self.used() <= enough {
                return;
            }
            entries(&shard).iter().for_each(|entry| self.remove(entry));
        }
        // Every folder may have to give all parts; then there is nothing left.
        for _ in 0..PART * own.len() {
            if self.used() <= enough {
                return;
            }
            *turn = (*turn + 1) % own.len();
            let mut entries = entries(&own[*turn]);
            entries.sort_by_key(|entry| entry.used);
            entries.iter().take(entries.len().div_ceil(PART)).for_each(|entry| self.remove(entry));
        }
    }

    fn remove(&self, entry: &Entry) {
        // A tile that is gone already made room, too.
        if std::fs::remove_file(&entry.path).is_ok() {
            self.evicted.fetch_add(1, Relaxed);
        }
        self.shrank(entry.bytes);
    }

    /// The folders of tiles of all revisions, in order.
    fn shards(&self) -> Vec<PathBuf> {
        let mut shards: Vec<PathBuf> =
            folders(&self.root).iter().flat_map(|revision| folders(revision)).collect();
        shards.sort();
        shards
    }
}

fn folders(of: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(of) else { return Vec::new() };
    entries
        .filter_map(Result::ok)
        .filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()))
        .map(|entry| entry.path())
        .collect()
}

/// The tiles of a folder; what a writer left there that is gone is removed.
fn entries(shard: &Path) -> Vec<Entry> {
    let Ok(entries) = std::fs::read_dir(shard) else { return Vec::new() };
    entries
        .filter_map(Result::ok)
        .filter_map(|entry| {
            let metadata = entry.metadata().ok().filter(|metadata| metadata.is_file())?;
            let (path, used) = (entry.path(), metadata.modified().ok()?);
            if entry.file_name().to_string_lossy().starts_with(INCOMPLETE) {
                if used.elapsed().is_ok_and(|age| age > ABANDONED) {
                    let _ = std::fs::remove_file(path);
                }
                return None;
            }
            Some(Entry { path, bytes: metadata.len(), used })
        })
        .collect()
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// All files below a folder.
    pub fn files(of: &Path) -> Vec<PathBuf> {
        let mut found = Vec::new();
        for entry in std::fs::read_dir(of).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
        }
        found
    }

    #[test]
    fn what_a_dead_writer_left_is_cleared_away() {
        let folder = tempfile::tempdir().unwrap();
        let shard = folder.path().join("r1/ab");
        std::fs::create_dir_all(&shard).unwrap();
        let [old, new] = ["old", "new"].map(|name| shard.join(format!("{INCOMPLETE}{name}")));
        for path in [&old, &new] {
            std::fs::write(path, b"torn").unwrap();
        }
        let long_ago = SystemTime::now() - 2 * ABANDONED;
        std::fs::File::options().write(true).open(&old).unwrap().set_modified(long_ago).unwrap();
        let space = Space::new(folder.path(), "r1", 0);
        space.count();
        assert_eq!((old.exists(), new.exists(), space.used()), (false, true, 0));
    }
}
