//! `/scene.json`.

use crate::http::answer;
use crate::http::base_url::base_url;
use crate::http::layers::{extent, layers, maximum_level, minimum_level};
use crate::recipe::{land_cover_levels, scene_species, tallest_tree_metres};
use crate::scene::Scene;
use crate::state::AppState;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use treeline_core::scene::{SceneDescription, SceneLayer, Sun};

/// Answers with the scene's description.
pub async fn scene_json(State(app): State<AppState>, headers: HeaderMap) -> Response {
    let base = base_url(app.public_url.as_deref(), &headers);
    let description = describe(&app.scene, &base);
    match serde_json::to_vec(&description) {
        Ok(body) => answer::document(&app, "application/json", body, &headers),
        Err(error) => answer::refusal(
            axum::http::StatusCode::INTERNAL_SERVER_ERROR,
            format!("the scene's description cannot be written: {error}"),
        ),
    }
}

/// What a client is told of a scene; `base` is how links start, without a slash at the end.
pub fn describe(scene: &Scene, base: &str) -> SceneDescription {
    let (minimum_height, maximum_height) = scene.height.range();
    let tallest = tallest_tree_metres(scene);
    SceneDescription {
        name: scene.name.clone(),
        revision: scene.revision.clone(),
        wms: format!("{base}/wms?"),
        attribution: scene.attribution.clone(),
        extent: scene.height.extent().bounds,
        minimum_height: f64::from(minimum_height),
        maximum_height: f64::from(maximum_height) + tallest,
        layers: layers(scene)
            .map(|row| {
                let bounds = extent(scene, row.layer).bounds;
                let maximum_level = maximum_level(scene, row.layer);
                SceneLayer {
                    name: row.layer,
                    title: row.title.to_owned(),
                    minimum_level: minimum_level(&bounds).min(maximum_level),
                    maximum_level,
                    registration: row.registration,
                    border: row.border,
                    client_format: row.client_format.to_owned(),
                    formats: row.formats.iter().map(|&format| format.to_owned()).collect(),
                    extent: bounds,
                }
            })
            .collect(),
        vegetation: scene.cover.is_some(),
        land_cover: land_cover_levels(scene),
        species: scene_species(scene),
        trees: scene.cover.is_some().then(|| format!("{base}/trees/")),
        seed: scene.seed,
        sun: Sun { time: scene.sun_time.clone() },
        camera: scene.camera,
        places: scene.places.clone(),
    }
}
