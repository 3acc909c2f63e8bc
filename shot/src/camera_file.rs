//! `camera.json`, of both kinds.

use crate::error::ShotError;
use serde::Deserialize;
use std::path::Path;
use treeline_core::camera::{DEFAULT_FIELD_OF_VIEW_DEGREES, GeographicCamera};
use treeline_server::small_file::read_text;
use treeline_shaders::height_field::PlaneCamera;

/// Longest camera file, bytes.
const MAXIMUM_BYTES: u64 = 1 << 20;
/// Farthest coordinate, metres: beyond, squares of distances leave the range of what can be computed with.
const FARTHEST: f64 = 1e12;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaneFile {
    eye: [f64; 3],
    target: [f64; 3],
    #[serde(default = "zenith")]
    up: [f64; 3],
    #[serde(default = "field_of_view")]
    fov_y_deg: f64,
}

fn zenith() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn field_of_view() -> f64 {
    DEFAULT_FIELD_OF_VIEW_DEGREES
}

fn read<T: serde::de::DeserializeOwned>(path: &Path, keys: &str) -> Result<T, ShotError> {
    let text = read_text(path, MAXIMUM_BYTES).map_err(|error| {
        ShotError::input(format!(
            "--camera {}: cannot be read ({error}); the keys are {keys}",
            path.display()
        ))
    })?;
    // Some editors begin a text with a mark of its byte order.
    let text = text.trim_start_matches('\u{feff}');
    serde_json::from_str(text).map_err(|error| {
        ShotError::input(format!("--camera {}: {error}; the keys are {keys}", path.display()))
    })
}

/// The camera of a height field.
pub fn plane(path: &Path) -> Result<PlaneCamera, ShotError> {
    let file: PlaneFile = read(path, "eye, target, up, fov_y_deg")?;
    let wrong = |text: String| Err(ShotError::input(format!("--camera {}: {text}", path.display())));
    for (name, place) in [("eye", file.eye), ("target", file.target)] {
        if let Some(far) = place.iter().find(|coordinate| coordinate.abs() > FARTHEST) {
            return wrong(format!("{name} holds {far:e}; coordinates must lie within {FARTHEST:e} m"));
        }
    }
    let up: f64 = file.up.iter().map(|part| part * part).sum();
    if !up.is_normal() {
        return wrong("up has no direction; leave it out, or write [0, 0, 1]".into());
    }
    Ok(PlaneCamera {
        eye: file.eye.into(),
        target: file.target.into(),
        up: file.up.into(),
        fov_y_degrees: file.fov_y_deg,
    })
}

/// The camera of a scene.
pub fn geographic(path: &Path) -> Result<GeographicCamera, ShotError> {
    let camera: GeographicCamera = read(path, "lon, lat, height, heading_deg, pitch_deg, fov_y_deg")?;
    camera.check().map_err(|error| ShotError::input(format!("--camera {}: {error}", path.display())))?;
    Ok(camera)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        file
    }

    #[test]
    fn both_kinds() {
        let camera = plane(file(r#"{"eye": [1, -2, 3], "target": [0, 0, 0]}"#).path()).unwrap();
        assert_eq!((camera.eye.y, camera.up.z, camera.fov_y_degrees), (-2.0, 1.0, 50.0));
        let camera = geographic(
            file(r#"{"lon": -1, "lat": 2, "height": 3, "heading_deg": 4, "pitch_deg": -5}"#).path(),
        );
        assert_eq!(camera.unwrap().pitch_deg, -5.0);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, word) in [
            (r#"{"eye": [1, 2, 3], "target": [0, 0, 0], "roll": 3}"#, "roll"),
            (r#"{"eye": [1, 2], "target": [0, 0, 0]}"#, "3"),
            (r#"{"eye": [1, 2, 3]}"#, "target"),
            ("{", "EOF"),
            (r#"{"eye": [1, 2, 3], "target": [0, 0, 0], "up": [0, 0, 0]}"#, "up has no direction"),
            (r#"{"eye": [1e300, 2, 3], "target": [0, 0, 0]}"#, "eye holds 1e300"),
        ] {
            let error = plane(file(text).path()).unwrap_err().to_string();
            assert!(error.contains(word) && !error.contains('\n'), "{error}");
        }
        let error = geographic(
            file(r#"{"lon": 0, "lat": 95, "height": 3, "heading_deg": 4, "pitch_deg": -5}"#).path(),
        );
        assert!(error.unwrap_err().to_string().contains("lat is 95"));
        for path in ["/nowhere/c.json", "/"] {
            let error = plane(Path::new(path)).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(path), "{error}");
        }
        #[cfg(unix)]
        assert!(plane(Path::new("/dev/zero")).unwrap_err().to_string().contains("no regular file"));
    }
}
