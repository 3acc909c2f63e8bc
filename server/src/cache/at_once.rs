//! Reading a file without ever waiting for a disk, so that an async thread may: only what the system holds in its own
//! memory, name and bytes. Linux since 5.12 answers that; elsewhere nothing is had at once.

use std::path::Path;
use std::time::SystemTime;

/// The most that is read in place; copying more would keep other requests waiting.
#[cfg(target_os = "linux")]
const MOST_BYTES: u64 = 512 << 10;

/// What `take` makes of a file's bytes and of when it was last modified; `None` where they cannot be had at once, or not
/// all.
#[cfg(target_os = "linux")]
pub fn read<T>(path: &Path, take: impl FnOnce(&[u8], SystemTime) -> Option<T>) -> Option<T> {
    use rustix::fs::{CWD, Mode, OFlags, ResolveFlags, openat2};
    use rustix::io::{ReadWriteFlags, preadv2};
    use std::cell::RefCell;
    use std::fs::File;
    use std::io::IoSliceMut;
    thread_local! {
        // Kept: fresh room that has to be zeroed costs more than the reading.
        static BUFFER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    }
    let flags = OFlags::RDONLY | OFlags::CLOEXEC | OFlags::NONBLOCK;
    let file = File::from(openat2(CWD, path, flags, Mode::empty(), ResolveFlags::CACHED).ok()?);
    let metadata = file.metadata().ok()?;
    if !metadata.is_file() || metadata.len() > MOST_BYTES {
        return None;
    }
    let (length, modified) = (metadata.len() as usize, metadata.modified().ok()?);
    BUFFER.with_borrow_mut(|buffer| {
        if buffer.len() < length {
            buffer.resize(length, 0);
        }
        let bytes = &mut buffer[..length];
        let read = preadv2(&file, &mut [IoSliceMut::new(bytes)], 0, ReadWriteFlags::NOWAIT).ok()?;
        if read == length { take(bytes, modified) } else { None }
    })
}

/// Nothing: other systems do not say whether a read would wait.
#[cfg(not(target_os = "linux"))]
pub fn read<T>(_: &Path, _: impl FnOnce(&[u8], SystemTime) -> Option<T>) -> Option<T> {
    None
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    fn all(path: &Path) -> Option<(Vec<u8>, SystemTime)> {
        read(path, |bytes, modified| Some((bytes.to_vec(), modified)))
    }

    #[test]
    fn what_was_just_written_is_had_whole_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        assert_eq!(all(&path), None);
        std::fs::write(&path, b"payload").unwrap();
        // A system whose folder cannot say is a system where nothing is had at once.
        if let Some((bytes, modified)) = all(&path) {
            assert_eq!(bytes, b"payload");
            assert!(modified <= SystemTime::now());
        }
        assert_eq!(all(folder.path()), None, "a folder");
        // A longer file before leaves nothing in a shorter one's bytes.
        std::fs::write(&path, b"pay").unwrap();
        assert!(all(&path).is_none_or(|(bytes, _)| bytes == b"pay"));
        std::fs::write(&path, vec![1; MOST_BYTES as usize + 1]).unwrap();
        assert_eq!(all(&path), None, "too long");
    }
}
