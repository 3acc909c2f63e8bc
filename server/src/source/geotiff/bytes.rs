//! Reading a file, here or at an upstream, at any place from many threads at once.

use crate::source::upstream;
use crate::source::upstream::ranges::RemoteBytes;
use std::fs::File;
use std::io;
use std::path::Path;

/// An open file that is read by position.
#[derive(Debug)]
pub struct FileBytes {
    place: Place,
    length: u64,
}

#[derive(Debug)]
enum Place {
    /// Without a shared position, and without a lock.
    Here(File),
    Remote(RemoteBytes),
    Held(Vec<u8>),
}

impl FileBytes {
    /// Opens a regular file, or one at an address.
    ///
    /// # Errors
    /// What the system or the upstream says; folders and devices are refused.
    pub fn open(path: &Path) -> io::Result<Self> {
        if let Some(address) = path.to_str().filter(|_| upstream::is_address(path)) {
            let remote = RemoteBytes::open(address)?;
            let length = remote.length();
            return Ok(Self { place: Place::Remote(remote), length });
        }
        // Looked at before it is opened: opening a pipe would wait for a writer.
        if !std::fs::metadata(path)?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file"));
        }
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        Ok(Self { place: Place::Here(file), length })
    }

    /// A file that has come whole.
    pub fn held(bytes: Vec<u8>) -> Self {
        Self { length: bytes.len() as u64, place: Place::Held(bytes) }
    }

    /// Bytes in the file when it was opened.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Reads `count` bytes from `offset`.
    ///
    /// # Errors
    /// `UnexpectedEof` where the file ends before; nothing is allocated then.
    pub fn read(&self, offset: u64, count: u64) -> io::Result<Vec<u8>> {
        let end = offset.checked_add(count).ok_or(io::ErrorKind::UnexpectedEof)?;
        if end > self.length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let count = usize::try_from(count).map_err(|_| io::ErrorKind::OutOfMemory)?;
        match &self.place {
            Place::Remote(remote) => remote.read(offset, count),
            Place::Held(bytes) => {
                let start = usize::try_from(offset).map_err(|_| io::ErrorKind::UnexpectedEof)?;
                Ok(bytes[start..start + count].to_vec())
            }
            Place::Here(file) => {
                let mut bytes = vec![0; count];
                read_exact_at(file, &mut bytes, offset)?;
                Ok(bytes)
            }
        }
    }
}

#[cfg(unix)]
fn read_exact_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        let read = std::os::windows::fs::FileExt::seek_read(file, bytes, offset)?;
        if read == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        bytes = &mut bytes[read..];
        offset += read as u64;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_by_position_and_never_past_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bytes");
        std::fs::write(&path, b"abcdef").unwrap();
        let bytes = FileBytes::open(&path).unwrap();
        assert_eq!(bytes.read(2, 3).unwrap(), b"cde");
        assert_eq!(bytes.read(6, 0).unwrap(), b"");
        for (offset, count) in [(0, 7), (6, 1), (u64::MAX, 1), (1, u64::MAX)] {
            assert_eq!(bytes.read(offset, count).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
        }
        assert!(FileBytes::open(folder.path()).is_err());
    }
}
