//! One file per tile, renamed into place when complete, checked when read.

use super::at_once;
use super::space::{INCOMPLETE, Space};
use crate::digest::{Digest, checksum};
use axum::body::Bytes;
use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// First bytes of a file; the digit is the layout's version.
const MAGIC: &[u8; 8] = b"TLCACHE2";
/// Magic, length of the key, length of the payload, checksum of the payload.
const HEADER: usize = 8 + 4 + 8 + 8;

/// A file's time says when its tile was last asked for, to this.
const USE_RESOLUTION: Duration = Duration::from_secs(3600);

/// A folder of tiles of one revision, beside those of others; together they hold so many bytes at most.
///
/// A file holds its key and a checksum, so that neither a torn file, nor one of another release,
/// nor a collision of names is ever served.
#[derive(Debug)]
pub struct DiskCache {
    folder: PathBuf,
    space: Space,
}

impl DiskCache {
    /// Opens (and makes) `folder`/`revision`; what is in `folder` is kept at `limit` bytes.
    pub fn open(folder: &Path, revision: &str, limit: u64) -> io::Result<Self> {
        let space = Space::new(folder, revision, limit);
        let folder = folder.join(revision);
        std::fs::create_dir_all(&folder)?;
        // Found out now rather than with the first tile: a folder that cannot be written to.
        tempfile::tempfile_in(&folder)?;
        Ok(Self { folder, space })
    }

    /// The revision's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// How much there is.
    pub fn space(&self) -> &Space {
        &self.space
    }

    /// Counts what was there before; takes as long as listing all of it.
    pub fn count(&self) {
        self.space.count();
    }

    /// Where a key's file lies: 256 folders, so that none grows too long.
    fn path(&self, key: &str) -> PathBuf {
        let name = Digest::new().bytes(key.as_bytes()).hex();
        self.folder.join(&name[..2]).join(format!("{name}.tile"))
    }

    /// The payload, or `None` where there is no file or it is not whole. May wait for the disk.
    pub fn read(&self, key: &str) -> Option<Bytes> {
        let mut file = File::open(self.path(key)).ok()?;
        let metadata = file.metadata().ok()?;
        let mut bytes = Vec::with_capacity(usize::try_from(metadata.len()).ok()?);
        file.read_to_end(&mut bytes).ok()?;
        let payload = payload(key, &bytes)?;
        if metadata.modified().is_ok_and(is_long_ago) {
            // Where the system does not let us, the tile goes by when it was written.
            let _ = file.set_modified(SystemTime::now());
        }
        Some(Bytes::from(bytes).slice(payload..))
    }

    /// The same where it can be had without waiting, from what the system holds of the folder; `None` says nothing
    /// about whether there is such a tile.
    pub fn read_at_once(&self, key: &str) -> Option<Bytes> {
        at_once::read(&self.path(key), |file, used| {
            // Marking a tile as used writes: that is for [`Self::read`].
            let payload = payload(key, file).filter(|_| !is_long_ago(used))?;
            Some(Bytes::copy_from_slice(&file[payload..]))
        })
    }

    /// Writes a file beside its place, waits until the disk has it, and renames it: readers see all of it or nothing,
    /// also after the machine lost its power. Then makes room.
    pub fn write(&self, key: &str, payload: &[u8]) -> io::Result<()> {
        let path = self.path(key);
        let folder = path.parent().unwrap_or(&self.folder);
        std::fs::create_dir_all(folder)?;
        let key_length = u32::try_from(key.len()).map_err(io::Error::other)?;
        let mut file = tempfile::Builder::new().prefix(INCOMPLETE).tempfile_in(folder)?;
        let mut header = Vec::with_capacity(HEADER + key.len());
        header.extend(MAGIC);
        header.extend(key_length.to_le_bytes());
        header.extend((payload.len() as u64).to_le_bytes());
        header.extend(checksum(payload).to_le_bytes());
        header.extend(key.as_bytes());
        file.write_all(&header)?;
        file.write_all(payload)?;
        file.as_file().sync_data()?;
        let before = path.metadata().map_or(0, |metadata| metadata.len());
        file.persist(&path).map_err(|error| error.error)?;
        self.space.grew((header.len() + payload.len()) as u64, before);
        self.space.make_room();
        Ok(())
    }
}

/// Whether a tile has to be marked as used.
fn is_long_ago(used: SystemTime) -> bool {
    SystemTime::now().duration_since(used).is_ok_and(|age| age > USE_RESOLUTION)
}

/// Where the payload of a key begins in a file that is whole and the key's.
fn payload(key: &str, file: &[u8]) -> Option<usize> {
    let header = file.get(..HEADER)?;
    let number = |range: std::ops::Range<usize>| {
        header[range].iter().rev().fold(0_u64, |value, &byte| value << 8 | u64::from(byte))
    };
    let (key_length, length, sum) = (number(8..12) as usize, number(12..20), number(20..28));
    let payload = HEADER.checked_add(key_length)?;
    let whole = header.starts_with(MAGIC)
        && file.get(HEADER..payload)? == key.as_bytes()
        && (file.len() - payload) as u64 == length
        && checksum(&file[payload..]) == sum;
    whole.then_some(payload)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cache() -> (tempfile::TempDir, DiskCache) {
        let folder = tempfile::tempdir().unwrap();
        let cache = DiskCache::open(folder.path(), "r1", u64::MAX).unwrap();
        (folder, cache)
    }

    #[test]
    fn what_was_written_is_read_and_nothing_else() {
        let (folder, cache) = cache();
        assert_eq!(cache.read("a"), None);
        cache.write("a", b"payload").unwrap();
        cache.write("empty", b"").unwrap();
        assert_eq!(cache.read("a").as_deref(), Some(&b"payload"[..]));
        assert_eq!(cache.read("empty").as_deref(), Some(&b""[..]));
        assert_eq!(cache.read("b"), None);
        cache.write("a", b"newer").unwrap();
        assert_eq!(cache.read("a").as_deref(), Some(&b"newer"[..]));
        let other = DiskCache::open(folder.path(), "r2", u64::MAX).unwrap();
        assert_eq!(other.read("a"), None, "another revision sees nothing of it");
    }

    #[test]
    fn a_torn_or_altered_file_is_never_served() {
        let (_folder, cache) = cache();
        cache.write("key", b"some payload").unwrap();
        let path = cache.path("key");
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert_eq!(cache.read("key"), None, "cut to {length} bytes");
            assert_eq!(cache.read_at_once("key"), None, "cut to {length} bytes");
        }
        for bit in 0..8 * whole.len() {
            let mut altered = whole.clone();
            altered[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(&path, &altered).unwrap();
            assert_eq!(cache.read("key"), None, "bit {bit} flipped");
            assert_eq!(cache.read_at_once("key"), None, "bit {bit} flipped");
        }
        let mut longer = whole.clone();
        longer.push(0);
        std::fs::write(&path, &longer).unwrap();
        assert_eq!(cache.read("key"), None, "a byte too many");
        std::fs::write(&path, &whole).unwrap();
        assert!(cache.read("key").is_some());
    }

    #[test]
    fn nothing_is_left_beside_the_tile() {
        let (_folder, cache) = cache();
        cache.write("key", b"payload").unwrap();
        let names: Vec<_> = std::fs::read_dir(cache.path("key").parent().unwrap()).unwrap().collect();
        assert_eq!(names.len(), 1);
    }

    #[test]
    fn a_folder_that_cannot_be_is_an_error() {
        let file = tempfile::NamedTempFile::new().unwrap();
        assert!(DiskCache::open(file.path(), "r", 1).is_err());
    }

    #[test]
    fn the_folder_never_holds_more_than_it_may() {
        let folder = tempfile::tempdir().unwrap();
        let old = DiskCache::open(folder.path(), "r0", u64::MAX).unwrap();
        for index in 0..50 {
            old.write(&format!("old {index}"), &[7; 1000]).unwrap();
        }
        let limit = 300_000;
        let cache = DiskCache::open(folder.path(), "r1", limit).unwrap();
        cache.count();
        let held = || {
            let files = super::super::space::tests::files(folder.path());
            files.iter().map(|path| path.metadata().unwrap().len()).sum::<u64>()
        };
        assert_eq!(cache.space().used(), held());
        for index in 0..1_000 {
            cache.write(&format!("tile {index}"), &[1; 1000]).unwrap();
            assert!(cache.space().used() <= limit, "{index}");
        }
        assert_eq!(cache.space().used(), held());
        assert!(held() > limit / 2, "no more goes than has to");
        assert_eq!((0..50).filter(|index| old.read(&format!("old {index}")).is_some()).count(), 0);
        assert!(cache.read("tile 999").is_some() || cache.space().evicted() > 0);
        // What is written again takes no more room.
        let used = cache.space().used();
        let there = (0..1_000).find(|index| cache.read(&format!("tile {index}")).is_some()).unwrap();
        cache.write(&format!("tile {there}"), &[2; 1000]).unwrap();
        assert_eq!(cache.space().used(), used);
    }

    #[test]
    fn what_was_used_last_stays() {
        let folder = tempfile::tempdir().unwrap();
        let cache = DiskCache::open(folder.path(), "r1", u64::MAX).unwrap();
        let long_ago = SystemTime::now() - Duration::from_secs(100_000);
        for index in 0..400 {
            let key = format!("tile {index}");
            cache.write(&key, &[1; 1000]).unwrap();
            File::options().write(true).open(cache.path(&key)).unwrap().set_modified(long_ago).unwrap();
        }
        // Reading marks a tile as used.
        let read: Vec<String> = (0..400).step_by(8).map(|index| format!("tile {index}")).collect();
        assert!(read.iter().all(|key| cache.read(key).is_some()));
        let small = DiskCache::open(folder.path(), "r1", 250_000).unwrap();
        small.count();
        assert!(small.space().used() <= 250_000 && small.space().evicted() > 100);
        let kept = read.iter().filter(|key| small.read(key).is_some()).count();
        assert!(kept >= 45, "{kept} of 50 tiles that had been read");
    }
}
