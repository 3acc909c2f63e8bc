//! The data version: changes whenever any tile would.

use crate::digest::Digest;
use crate::scene_file::SceneFile;
use crate::source::upstream::{self, pictures, ranges::RemoteBytes};
use crate::user_error::UserError;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant, UNIX_EPOCH};

/// Digest of the code that makes tiles, from build.rs.
const TILE_CODE: &str = env!("TREELINE_TILE_CODE");

/// Time between two looks at a file at an upstream.
const REMOTE_INTERVAL: Duration = Duration::from_secs(60);

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
    if pictures::is_service(path) {
        // What such a service changes it does not say.
        return Ok(path.display().to_string());
    }
    if let Some(address) = path.to_str().filter(|_| upstream::is_address(path)) {
        return remote_identity(address).map_err(|error| {
            UserError::new(format!("{address}: {error}; check the address, and whether the server is up"))
        });
    }
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

/// Address, length and version of a file at an upstream, as they were a little while ago: whoever looks every few
/// seconds does not ask every few seconds.
fn remote_identity(address: &str) -> std::io::Result<String> {
    static SEEN: Mutex<BTreeMap<String, (Instant, String)>> = Mutex::new(BTreeMap::new());
    let seen = || SEEN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, identity)) = seen().get(address).filter(|(when, _)| when.elapsed() < REMOTE_INTERVAL) {
        return Ok(identity.clone());
    }
    let identity = format!("{address}|{}", RemoteBytes::identity(address)?);
    seen().insert(address.to_owned(), (Instant::now(), identity.clone()));
    Ok(identity)
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
