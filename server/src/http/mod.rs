//! HTTP: routes, and what stands round them.

mod answer;
mod base_url;
mod description;
mod known;
mod layers;
mod live;
mod make;
mod matrix_set;
mod middleware;
mod operations;
mod order;
mod page;
mod query;
mod request_id;
mod serve;
mod tile_metadata;
mod tiles;
mod trees;
mod wms;
mod wmts;
mod world_wind;

pub use answer::Modified;
pub use description::describe;
pub use known::Known;
pub use layers::{extent, has_layer, layer_names, layers, maximum_level, minimum_level};
pub use live::Live;
pub use make::make;
pub use matrix_set::OWN_MATRIX_SET;
pub use order::{Order, geographic_grid};
pub use serve::serve;

use crate::state::AppState;
use axum::Router;
use axum::body::Body;
use axum::http::{HeaderName, StatusCode, Uri};
use axum::response::Response;
use axum::routing::get;
use tower::ServiceBuilder;
use tower_http::CompressionLevel;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::cors::{Any, CorsLayer};

/// The application as a function from request to answer: tests and tools call it in process.
pub fn router(state: AppState) -> Router {
    // Any origin may read everything; nothing here depends on the origin, so nothing varies with it.
    let cors = CorsLayer::new()
        .allow_origin(Any)
        .allow_methods(Any)
        .allow_headers(Any)
        .expose_headers(Any)
        .vary(Vec::<HeaderName>::new());
    Router::new()
        .route("/", get(page::page))
        .route("/wms", get(wms::wms))
        .route("/world-wind", get(world_wind::world_wind))
        .route("/wmts", get(wmts::key_value_pairs))
        .route("/wmts/1.0.0/WMTSCapabilities.xml", get(wmts::rest_capabilities))
        .route("/wmts/1.0.0/{layer}/{style}/{set}/{level}/{row}/{column}", get(wmts::rest_tile))
        .route("/tiles", get(tile_metadata::all))
        .route("/tiles/{layer}", get(tile_metadata::of_layer))
        .route("/tiles/{layer}/{set}", get(tile_metadata::of_set))
        .route("/tiles/{layer}/{set}/{level}/{row}/{column}", get(tiles::tile))
        .route("/tileMatrixSets", get(tile_metadata::matrix_sets))
        .route("/tileMatrixSets/{id}", get(tile_metadata::matrix_set_by_id))
        .route("/conformance", get(tile_metadata::conformance))
        .route("/trees/{code}", get(trees::trees))
        .route("/scene.json", get(description::scene_json))
        .route("/healthz", get(operations::healthz))
        .route("/readyz", get(operations::readyz))
        .route("/metrics", get(operations::metrics))
        .fallback(get(page::page).fallback(wrong_method))
        .method_not_allowed_fallback(wrong_method)
        // One stack, outermost first: each `layer` of a router boxes every request and its answer once more.
        .layer(
            ServiceBuilder::new()
                .layer(cors)
                .map_response(middleware::timing)
                // What compresses is two kilobytes of state even where it does not: it moves once.
                .map_response(|response: Response<_>| response.map(Body::new))
                // zstd's own default. On a megabyte of heights brotli takes 9 ms at 3 (35 ms at its default) for the same size.
                .layer(
                    CompressionLayer::new()
                        .quality(CompressionLevel::Precise(3))
                        .compress_when(middleware::is_compressible),
                )
                .layer(axum::middleware::from_fn_with_state(state.clone(), middleware::bounds))
                .layer(CatchPanicLayer::custom(middleware::on_panic)),
        )
        .with_state(state)
}

async fn wrong_method(method: axum::http::Method, uri: Uri) -> Response {
    let line =
        format!("{method} is not understood at {}; everything here is read with GET or HEAD", uri.path());
    let mut response = answer::refusal(StatusCode::METHOD_NOT_ALLOWED, line);
    response
        .headers_mut()
        .insert(axum::http::header::ALLOW, axum::http::HeaderValue::from_static("GET, HEAD, OPTIONS"));
    response
}
