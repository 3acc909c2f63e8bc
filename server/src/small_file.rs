//! Files that people write by hand, read whole.

use std::io::{Error, ErrorKind, Read as _, Result};
use std::path::Path;

/// Reads a text of at most `limit` bytes.
///
/// # Errors
/// What the system says; also for anything but a regular file (a pipe would wait for a writer, a
/// device might never end) and for files that are longer.
pub fn read_text(path: &Path, limit: u64) -> Result<String> {
    let wrong = |problem: String| Error::new(ErrorKind::InvalidInput, problem);
    if !std::fs::metadata(path)?.is_file() {
        return Err(wrong("it is no regular file".to_owned()));
    }
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(wrong(format!("it is longer than {limit} bytes")));
    }
    String::from_utf8(bytes).map_err(|_| wrong("it is no text".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_short_texts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "abc").unwrap();
        assert_eq!(read_text(&path, 3).unwrap(), "abc");
        assert!(read_text(&path, 2).unwrap_err().to_string().contains("longer"));
        std::fs::write(&path, [0xff, 0xfe]).unwrap();
        assert!(read_text(&path, 9).unwrap_err().to_string().contains("no text"));
        assert!(read_text(folder.path(), 9).unwrap_err().to_string().contains("regular"));
        #[cfg(unix)]
        assert!(read_text(Path::new("/dev/zero"), 9).unwrap_err().to_string().contains("regular"));
        assert_eq!(read_text(&folder.path().join("none"), 9).unwrap_err().kind(), ErrorKind::NotFound);
    }
}
