//! GetLegendGraphic (OGC 05-078r4, 12): what a layer's colours mean.

use super::exception::ServiceException;
use super::shown;
use crate::cache::{Maker, TileKey};
use crate::http::answer;
use crate::http::make::make_error;
use crate::http::query::Parameters;
use crate::recipe::{Format, legend};
use crate::state::AppState;
use axum::http::HeaderMap;
use axum::response::Response;
use std::sync::Arc;

/// Answers a GetLegendGraphic request.
pub async fn answer(
    app: &AppState,
    parameters: &Parameters,
    headers: &HeaderMap,
) -> Result<Response, ServiceException> {
    let layer = shown::layer(app, parameters.require("LAYER", "elevation")?, "LAYER")?;
    shown::filled(parameters.get("STYLE").unwrap_or_default(), layer)?;
    if !legend::has_legend(&app.scene, layer) {
        return Err(ServiceException::new(
            Some("LayerNotDefined"),
            format!("the layer {} is a photo: it has no legend", layer.name()),
        ));
    }
    if let Some(format) = parameters.get("FORMAT")
        && !format.eq_ignore_ascii_case("image/png")
    {
        return Err(ServiceException::new(
            Some("InvalidFormat"),
            format!("FORMAT is \"{format}\"; legends come as image/png"),
        ));
    }
    let key = TileKey { product: layer.into(), text: format!("legend|{}", layer.name()).into() };
    let scene = app.scene.clone();
    let maker: Maker = Arc::new(move || legend::make(&scene, layer, Format::Png).map_err(make_error));
    Ok(answer::made(app, &key, "image/png", maker, parameters.get("REVISION"), headers).await?)
}
