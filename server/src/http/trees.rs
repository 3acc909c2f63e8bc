//! `/trees/{code}`: the models of a species, grown on first demand and kept like tiles.

use crate::cache::{Maker, TileKey};
use crate::http::answer::{self, refusal, status_of};
use crate::http::query::Parameters;
use crate::metrics::Product;
use crate::scene::Scene;
use crate::state::AppState;
use axum::extract::{Path, RawQuery, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use std::sync::Arc;
use treeline_core::seeds::Species;
use treeline_core::tree_model::{MEDIA_TYPE, TreeSpecies};

/// Answers with a species' models.
pub async fn trees(
    State(app): State<AppState>,
    Path(code): Path<String>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Response {
    let parameters = match Parameters::parse(&query.unwrap_or_default()) {
        Ok(parameters) => parameters,
        Err(line) => return refusal(StatusCode::BAD_REQUEST, line),
    };
    let grown = growing(&app.scene);
    let asked = code.parse().ok().and_then(|code: u8| grown.iter().find(|species| species.code == code));
    let Some(&species) = asked else {
        return refusal(StatusCode::NOT_FOUND, unknown(&grown, &code));
    };
    let key = TileKey { product: Product::Trees, text: format!("trees|{}", species.code).into() };
    let species = species.clone();
    let maker: Maker = Arc::new(move || Ok(TreeSpecies::grow(&species).encode()));
    answer::made(&app, &key, MEDIA_TYPE, maker, parameters.get("REVISION"), &headers)
        .await
        .unwrap_or_else(|error| refusal(status_of(&error), error.to_string()))
}

/// The species that the scene's cover may have: nothing grows where there is none.
fn growing(scene: &Scene) -> Vec<&Species> {
    let grows = |species: &&Species| scene.cover.is_some() && scene.growing.contains(&species.code);
    scene.species.iter().filter(grows).collect()
}

/// Says which codes there are.
fn unknown(species: &[&Species], code: &str) -> String {
    if species.is_empty() {
        return format!("no trees \"{code}\": nothing grows in this scene");
    }
    let known: Vec<String> =
        species.iter().map(|species| format!("{} ({})", species.code, species.definition.name)).collect();
    format!("no trees \"{code}\"; this scene's species are {}", known.join(", "))
}
