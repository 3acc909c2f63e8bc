//! Real rasters for tests: `shared/data` beside the repository, or where `TREELINE_DATA` says.
//!
//! A test that needs them returns early where there are none, after a printed word; where
//! `TREELINE_DATA` is set and wrong it fails.

use std::path::{Path, PathBuf};

/// The repository's root.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the test crate lies in the workspace")
        .to_path_buf()
}

/// The folder of real rasters, or `None` where there is none.
///
/// # Panics
/// Where `TREELINE_DATA` is set and names no folder of rasters.
pub fn folder() -> Option<PathBuf> {
    match locate(std::env::var_os("TREELINE_DATA").map(PathBuf::from), &workspace()) {
        Ok(folder) => folder,
        Err(problem) => panic!("{problem}"),
    }
}

/// A file or folder of the real rasters, by its path there; `None`, after a printed word, where there are none.
///
/// # Panics
/// Where `TREELINE_DATA` is set and has no such file.
pub fn find(relative: &str) -> Option<PathBuf> {
    let Some(folder) = folder() else {
        println!("skipped: no {relative}; TREELINE_DATA may name a folder that has it");
        return None;
    };
    let path = folder.join(relative);
    if path.exists() {
        return Some(path);
    }
    assert!(
        std::env::var_os("TREELINE_DATA").is_none(),
        "TREELINE_DATA is set, but there is no {}",
        path.display()
    );
    println!("skipped: no {}", path.display());
    None
}

/// Where the rasters are: at `told`, which must then be right, or beside the workspace.
fn locate(told: Option<PathBuf>, workspace: &Path) -> Result<Option<PathBuf>, String> {
    if let Some(folder) = told {
        return if folder.join("INVENTORY.md").is_file() {
            Ok(Some(folder))
        } else {
            Err(format!(
                "TREELINE_DATA is {}, which has no INVENTORY.md; name the folder of test rasters, or unset it",
                folder.display()
            ))
        };
    }
    let beside = workspace.join("../shared/data");
    Ok(beside.join("INVENTORY.md").is_file().then_some(beside))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_folder_is_an_error_and_none_is_not() {
        let empty = tempfile::tempdir().unwrap();
        let inner = empty.path().join("repository");
        std::fs::create_dir(&inner).unwrap();
        assert_eq!(locate(None, &inner), Ok(None));
        assert!(locate(Some(empty.path().to_path_buf()), &inner).unwrap_err().contains("TREELINE_DATA"));
        std::fs::write(empty.path().join("INVENTORY.md"), "").unwrap();
        assert_eq!(locate(Some(empty.path().to_path_buf()), &inner), Ok(Some(empty.path().to_path_buf())));
    }
}
