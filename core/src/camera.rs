//! Who looks: the camera as it stands in an address bar, in `camera.json` and in the engine.

use crate::geodesy::{self, Geodetic};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// Vertical field of view where none is given, degrees.
pub const DEFAULT_FIELD_OF_VIEW_DEGREES: f64 = 50.0;

fn default_field_of_view() -> f64 {
    DEFAULT_FIELD_OF_VIEW_DEGREES
}

/// A camera over the ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GeographicCamera {
    /// Degrees east.
    pub lon: f64,
    /// Degrees north.
    pub lat: f64,
    /// Metres above the ellipsoid.
    pub height: f64,
    /// Clockwise from north, degrees.
    pub heading_deg: f64,
    /// −90 is straight down, 0 the horizontal, degrees.
    pub pitch_deg: f64,
    /// Vertical field of view, degrees.
    #[serde(default = "default_field_of_view")]
    pub fov_y_deg: f64,
}

impl GeographicCamera {
    /// The place of the eye.
    pub fn place(&self) -> Geodetic {
        Geodetic { longitude: self.lon, latitude: self.lat, height: self.height }
    }

    /// The eye, ECEF metres.
    pub fn eye_ecef(&self) -> DVec3 {
        geodesy::ecef_from_geodetic(self.place())
    }

    /// Rotation whose columns are the camera's right, up and backward axes in ENU at the eye:
    /// `enu_from_view`. No roll. Straight down, "up" in the picture is the heading.
    pub fn enu_from_view(&self) -> DMat3 {
        let (sine_heading, cosine_heading) = self.heading_deg.to_radians().sin_cos();
        let (sine_pitch, cosine_pitch) = self.pitch_deg.to_radians().sin_cos();
        let forward = DVec3::new(cosine_pitch * sine_heading, cosine_pitch * cosine_heading, sine_pitch);
        let right = DVec3::new(cosine_heading, -sine_heading, 0.0);
        let up = right.cross(forward);
        DMat3::from_cols(right, up, -forward)
    }

    /// What is wrong with it, naming the field, or `Ok`.
    pub fn check(&self) -> Result<(), String> {
        let fields = [
            ("lon", self.lon, -360.0..=360.0),
            ("lat", self.lat, -90.0..=90.0),
            ("height", self.height, -20_000.0..=1.0e9),
            ("heading_deg", self.heading_deg, -3600.0..=3600.0),
            ("pitch_deg", self.pitch_deg, -90.0..=90.0),
            ("fov_y_deg", self.fov_y_deg, 0.01..=170.0),
        ];
        for (name, value, range) in fields {
            if !range.contains(&value) {
                return Err(format!(
                    "{name} is {value}; it must lie in {} to {}",
                    range.start(),
                    range.end()
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes() {
        let mut camera = GeographicCamera {
            lon: 0.0,
            lat: 0.0,
            height: 0.0,
            heading_deg: 90.0,
            pitch_deg: 0.0,
            fov_y_deg: 50.0,
        };
        let east = -camera.enu_from_view().z_axis;
        assert!((east - DVec3::X).length() < 1e-12);
        camera.pitch_deg = -90.0;
        let rotation = camera.enu_from_view();
        assert!((rotation.y_axis - DVec3::X).length() < 1e-12, "up in the picture is the heading");
        assert!((rotation.z_axis - DVec3::Z).length() < 1e-12);
        assert!((rotation.determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_bad_field_is_named() {
        let camera: GeographicCamera =
            serde_json::from_str(r#"{"lon":0,"lat":91,"height":0,"heading_deg":0,"pitch_deg":0}"#).unwrap();
        assert!(camera.check().unwrap_err().starts_with("lat is 91"));
        assert!(serde_json::from_str::<GeographicCamera>(r#"{"longitude":0}"#).is_err());
    }
}
