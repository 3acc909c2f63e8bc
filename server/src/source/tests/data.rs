//! Where the real rasters are.

use std::path::{Path, PathBuf};

/// A file or folder of the data, or `None`, said aloud, where there are no data.
///
/// # Panics
/// Where `TREELINE_DATA` is set and wrong.
pub fn find(name: &str) -> Option<PathBuf> {
    let folder = match std::env::var_os("TREELINE_DATA") {
        Some(folder) => {
            let folder = PathBuf::from(folder);
            assert!(folder.is_dir(), "TREELINE_DATA is {}, which is no folder", folder.display());
            folder
        }
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
    };
    if !folder.is_dir() {
        println!("skipped: no data at {} (set TREELINE_DATA)", folder.display());
        return None;
    }
    let path = folder.join(name);
    assert!(path.exists(), "{} is missing from the data", path.display());
    Some(path)
}
