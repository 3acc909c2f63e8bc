//! What a client is told of the built-in scene: its name, its views, its light.

use treeline_core::camera::{DEFAULT_FIELD_OF_VIEW_DEGREES, GeographicCamera};
use treeline_core::scene::Place;

/// The parts of a scene that are not samples.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneDefaults {
    /// Name, for people.
    pub name: String,
    /// What is shown beside the picture.
    pub attribution: Vec<String>,
    /// The first view: over the lake to the main ridge.
    pub camera: GeographicCamera,
    /// Named views.
    pub places: Vec<Place>,
    /// Where the sun stands, RFC 3339, UTC.
    pub sun_time: String,
    /// The seed that grows the forest.
    pub seed: u32,
}

/// Name; longitude, latitude, height in metres; heading and pitch in degrees.
const VIEWS: [(&str, f64, f64, f64, f64, f64); 6] = [
    ("Lago Drosa", 10.925, 46.893, 1650.0, 350.0, -6.0),
    ("Lake from the east", 10.97, 46.93, 2500.0, 250.0, -10.0),
    ("North ridge", 10.925, 47.02, 3600.0, 100.0, -12.0),
    ("Main valley", 11.13, 46.92, 1500.0, 300.0, -5.0),
    ("Tree line", 10.95, 46.95, 2250.0, 330.0, -8.0),
    ("Whole massif", 10.986, 46.70, 9000.0, 0.0, -18.0),
];

/// The built-in scene's name, views and light.
pub fn scene_defaults() -> SceneDefaults {
    let places: Vec<Place> = VIEWS
        .iter()
        .map(|&(name, lon, lat, height, heading_deg, pitch_deg)| Place {
            name: name.into(),
            camera: GeographicCamera {
                lon,
                lat,
                height,
                heading_deg,
                pitch_deg,
                fov_y_deg: DEFAULT_FIELD_OF_VIEW_DEGREES,
            },
        })
        .collect();
    SceneDefaults {
        name: "Valdrosa (an invented massif)".into(),
        attribution: vec!["Valdrosa: procedural landscape, made by Treeline".into()],
        camera: places[0].camera,
        places,
        sun_time: "2026-07-15T13:30:00Z".into(),
        seed: 1,
    }
}
