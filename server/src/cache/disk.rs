//! One file per tile, renamed into place when complete, checked when read.

use crate::digest::{Digest, checksum};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

/// First bytes of a file; the digit is the layout's version.
const MAGIC: &[u8; 8] = b"TLCACHE1";
/// Magic, length of the key, length of the payload, checksum of the payload.
const HEADER: usize = 8 + 4 + 8 + 8;

/// A folder of tiles of one revision.
///
/// A file holds its key and a checksum, so that neither a torn file, nor one of another release,
/// nor a collision of names is ever served.
#[derive(Debug)]
pub struct DiskCache {
    folder: PathBuf,
}

impl DiskCache {
    /// Opens (and makes) `folder`/`revision`.
    pub fn open(folder: &Path, revision: &str) -> io::Result<Self> {
        let folder = folder.join(revision);
        std::fs::create_dir_all(&folder)?;
        // Found out now rather than with the first tile: a folder that cannot be written to.
        tempfile::tempfile_in(&folder)?;
        Ok(Self { folder })
    }

    /// The revision's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Where a key's file lies: 256 folders, so that none grows too long.
    fn path(&self, key: &str) -> PathBuf {
        let name = Digest::new().bytes(key.as_bytes()).hex();
        self.folder.join(&name[..2]).join(format!("{name}.tile"))
    }

    /// The payload, or `None` where there is no file or it is not whole.
    pub fn read(&self, key: &str) -> Option<Vec<u8>> {
        let mut bytes = std::fs::read(self.path(key)).ok()?;
        let header = bytes.get(..HEADER)?;
        let number = |range: std::ops::Range<usize>| {
            header[range].iter().rev().fold(0_u64, |value, &byte| value << 8 | u64::from(byte))
        };
        let (key_length, length, sum) = (number(8..12) as usize, number(12..20), number(20..28));
        let payload = HEADER.checked_add(key_length)?;
        let whole = header.starts_with(MAGIC)
            && bytes.get(HEADER..payload)? == key.as_bytes()
            && (bytes.len() - payload) as u64 == length
            && checksum(&bytes[payload..]) == sum;
        if !whole {
            return None;
        }
        bytes.drain(..payload);
        Some(bytes)
    }

    /// Writes a file beside its place and renames it: readers see all of it or nothing.
    pub fn write(&self, key: &str, payload: &[u8]) -> io::Result<()> {
        let path = self.path(key);
        let folder = path.parent().unwrap_or(&self.folder);
        std::fs::create_dir_all(folder)?;
        let key_length = u32::try_from(key.len()).map_err(io::Error::other)?;
        let mut file = tempfile::Builder::new().prefix(".incomplete-").tempfile_in(folder)?;
        let mut header = Vec::with_capacity(HEADER + key.len());
        header.extend(MAGIC);
        header.extend(key_length.to_le_bytes());
        header.extend((payload.len() as u64).to_le_bytes());
        header.extend(checksum(payload).to_le_bytes());
        header.extend(key.as_bytes());
        file.write_all(&header)?;
        file.write_all(payload)?;
        file.persist(&path).map_err(|error| error.error)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cache() -> (tempfile::TempDir, DiskCache) {
        let folder = tempfile::tempdir().unwrap();
        let cache = DiskCache::open(folder.path(), "r1").unwrap();
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
        let other = DiskCache::open(folder.path(), "r2").unwrap();
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
        }
        for bit in 0..8 * whole.len() {
            let mut altered = whole.clone();
            altered[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(&path, &altered).unwrap();
            assert_eq!(cache.read("key"), None, "bit {bit} flipped");
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
        assert!(DiskCache::open(file.path(), "r").is_err());
    }
}
