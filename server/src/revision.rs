//! The data version: changes whenever any tile would.

use crate::digest::Digest;
use crate::scene_file::SceneFile;
use crate::user_error::UserError;
use std::path::Path;
use std::time::UNIX_EPOCH;

/// Digest of the code that makes tiles, from build.rs.
const TILE_CODE: &str = env!("TREELINE_TILE_CODE");

/// The revision of a scene: what it says of its sources, the identity of their files, and the code
/// that makes tiles. `None` is the built-in scene. Views, names and attributions change no tile.
pub fn revision(scene: Option<&SceneFile>) -> Result<String, UserError> {
    let mut digest = Digest::new().text(TILE_CODE);
    if let Some(scene) = scene {
        let relevant = SceneFile {
            name: None,
            attribution: Vec::new(),
            sun: None,
            camera: None,
            places: Vec::new(),
            ..scene.clone()
        };
        let text = serde_json::to_string(&relevant)
            .map_err(|error| UserError::new(format!("the scene's settings cannot be written: {error}")))?;
        digest = digest.text(&text);
        for path in scene.paths() {
            digest = digest.text(&identity(path)?);
        }
    }
    Ok(digest.short_hex())
}

/// Place, length and time of change of a file.
fn identity(path: &Path) -> Result<String, UserError> {
    let unreadable = |error: std::io::Error| {
        UserError::new(format!(
            "{}: cannot be read ({error}); name a file that exists and that this user may read",
            path.display()
        ))
    };
    let metadata = path.metadata().map_err(unreadable)?;
    let place = path.canonicalize().map_err(unreadable)?;
    let changed = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    Ok(format!("{}|{}|{}", place.display(), metadata.len(), changed.unwrap_or_default().as_nanos()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene_file::DemSource;

    #[test]
    fn it_follows_the_data_and_not_the_view() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dem.tif");
        std::fs::write(&path, b"one").unwrap();
        let scene = SceneFile {
            dem: Some(DemSource { path: path.clone(), ..DemSource::default() }),
            ..SceneFile::default()
        };
        let first = revision(Some(&scene)).unwrap();
        assert_eq!(revision(Some(&scene)), Ok(first.clone()));
        let renamed = SceneFile { name: Some("x".to_owned()), ..scene.clone() };
        assert_eq!(revision(Some(&renamed)), Ok(first.clone()));
        let seeded = SceneFile { seed: Some(9), ..scene.clone() };
        assert_ne!(revision(Some(&seeded)), Ok(first.clone()));
        std::fs::write(&path, b"other").unwrap();
        assert_ne!(revision(Some(&scene)), Ok(first.clone()));
        assert_ne!(revision(None), Ok(first));
        std::fs::remove_file(&path).unwrap();
        assert!(revision(Some(&scene)).unwrap_err().to_string().contains("dem.tif: cannot be read"));
    }
}
