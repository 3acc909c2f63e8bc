//! Answers: documents, tiles, and refusals of one line.

use crate::cache::{MakeError, Maker, TileKey};
use crate::digest::Digest;
use crate::http::order::Order;
use crate::state::App;
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::sync::Arc;

/// For URLs that carry the data version: their answer never changes.
const IMMUTABLE: &str = "public, max-age=31536000, immutable";
/// For URLs without it: fresh for a while, then asked again with the ETag.
const FOR_MINUTES: &str = "public, max-age=300";
/// For what must be asked again each time.
pub const ASK_AGAIN: &str = "no-cache";

/// A refusal outside WMS: a status and one line.
pub fn refusal(status: StatusCode, line: impl AsRef<str>) -> Response {
    let line = format!("{}\n", line.as_ref().trim_end());
    let content_type =
        [(header::CONTENT_TYPE, "text/plain; charset=utf-8"), (header::CACHE_CONTROL, "no-store")];
    let mut response = (status, content_type, line).into_response();
    if status == StatusCode::SERVICE_UNAVAILABLE {
        response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
    }
    response
}

/// Status of an answer that could not be made.
pub fn status_of(error: &MakeError) -> StatusCode {
    match error {
        MakeError::Refused(_) => StatusCode::BAD_REQUEST,
        MakeError::Busy | MakeError::Abandoned => StatusCode::SERVICE_UNAVAILABLE,
        MakeError::Failed(_) | MakeError::Panicked => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

/// A document that is asked again each time, and not sent again where the client has it.
pub fn document(content_type: &'static str, body: impl Into<Bytes>, headers: &HeaderMap) -> Response {
    let body = body.into();
    let tag = format!("W/\"{}\"", Digest::new().bytes(&body).short_hex());
    tagged(&tag, ASK_AGAIN, headers).unwrap_or_else(|| with_tag(content_type, &tag, ASK_AGAIN, body))
}

/// Answers with a tile.
///
/// `revision` is the data version in the URL, if there is one.
pub async fn tile(
    app: &Arc<App>,
    order: Order,
    revision: Option<&str>,
    headers: &HeaderMap,
) -> Result<Response, MakeError> {
    let (key, content_type) = (order.key(), order.content_type());
    let scene = app.scene.clone();
    let maker: Maker = Arc::new(move || super::make::make(&scene, &order));
    made(app, &key, content_type, maker, revision, headers).await
}

/// Makes (or finds) what the key names and answers it; without making it where the client's copy is good.
///
/// `revision` is the data version in the URL, if there is one.
pub async fn made(
    app: &Arc<App>,
    key: &TileKey,
    content_type: &'static str,
    maker: Maker,
    revision: Option<&str>,
    headers: &HeaderMap,
) -> Result<Response, MakeError> {
    // The bytes follow from the key and the data's version, so the tag is known before the tile is.
    let tag = format!("W/\"{}\"", Digest::new().text(&app.scene.revision).text(&key.text).short_hex());
    let cache_control = match revision {
        Some(revision) if revision == app.scene.revision => IMMUTABLE,
        // A link from before the data changed: right now, but not for ever.
        Some(_) => ASK_AGAIN,
        None => FOR_MINUTES,
    };
    if let Some(unchanged) = tagged(&tag, cache_control, headers) {
        return Ok(unchanged);
    }
    let bytes = app.cache.get(key, maker).await?;
    Ok(with_tag(content_type, &tag, cache_control, bytes))
}

/// 304 where the client's copy has the tag.
fn tagged(tag: &str, cache_control: &'static str, headers: &HeaderMap) -> Option<Response> {
    let known = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    let bare = tag.trim_start_matches("W/");
    let matches = known
        .flat_map(|list| list.split(','))
        .map(|known| known.trim().trim_start_matches("W/"))
        .any(|known| known == "*" || known == bare);
    matches.then(|| {
        let headers = [(header::ETAG, tag), (header::CACHE_CONTROL, cache_control)];
        (StatusCode::NOT_MODIFIED, headers).into_response()
    })
}

fn with_tag(content_type: &'static str, tag: &str, cache_control: &'static str, body: Bytes) -> Response {
    let headers =
        [(header::CONTENT_TYPE, content_type), (header::ETAG, tag), (header::CACHE_CONTROL, cache_control)];
    (headers, Body::from(body)).into_response()
}
