//! Answers: documents, tiles, and refusals of one line.

use crate::cache::{MakeError, Maker, TileKey};
use crate::digest::Digest;
use crate::http::middleware::is_compressible_type;
use crate::http::order::Order;
use crate::state::App;
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::sync::Arc;
use std::time::SystemTime;

/// For URLs that carry the data version: their answer never changes.
const IMMUTABLE: &str = "public, max-age=31536000, immutable";
/// For URLs without it: fresh for a while, then asked again with the ETag.
const FOR_MINUTES: &str = "public, max-age=300";
/// For what must be asked again each time.
pub const ASK_AGAIN: &str = "no-cache";

/// A refusal outside WMS: a status and one line.
pub fn refusal(status: StatusCode, line: impl AsRef<str>) -> Response {
    let line = format!("{}\n", line.as_ref().trim_end());
    let headers = [
        (header::CONTENT_TYPE, "text/plain; charset=utf-8"),
        (header::CACHE_CONTROL, "no-store"),
        // What was asked stands in the line: it must not be taken for a page.
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    ];
    let mut response = (status, headers, line).into_response();
    say_when(&mut response);
    response
}

/// Says of an answer that may be another in a while when to ask again.
pub fn say_when(response: &mut Response) {
    let seconds = match response.status() {
        StatusCode::SERVICE_UNAVAILABLE => "1",
        StatusCode::BAD_GATEWAY => "5",
        _ => return,
    };
    response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from_static(seconds));
}

/// Status of an answer that could not be made.
pub fn status_of(error: &MakeError) -> StatusCode {
    match error {
        MakeError::Refused(_) => StatusCode::BAD_REQUEST,
        MakeError::Busy | MakeError::Abandoned => StatusCode::SERVICE_UNAVAILABLE,
        MakeError::Upstream(_) => StatusCode::BAD_GATEWAY,
        MakeError::Failed(_) | MakeError::Panicked => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

/// A document that is asked again each time, and not sent again where the client has it.
pub fn document(
    app: &App,
    content_type: &'static str,
    body: impl Into<Bytes>,
    headers: &HeaderMap,
) -> Response {
    let body = body.into();
    let tag = format!("W/\"{}\"", Digest::new().bytes(&body).short_hex());
    let version = Version { tag, modified: &app.modified, cache_control: ASK_AGAIN, content_type };
    version.unchanged(headers).unwrap_or_else(|| version.answer(body))
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
    let version = Version { tag, modified: &app.modified, cache_control, content_type };
    if let Some(unchanged) = version.unchanged(headers) {
        return Ok(unchanged);
    }
    let bytes = app.cache.get(key, maker).await?;
    let mut response = version.answer(bytes);
    response.extensions_mut().insert(Kept(key.clone()));
    Ok(response)
}

/// Of an answer whose bytes are kept: their key.
#[derive(Clone)]
pub struct Kept(pub TileKey);

/// Whether the client's copy has the tag, or, where it names none, is no older (RFC 9110, 13.2.2).
pub fn is_known_version(headers: &HeaderMap, tag: &str, modified: &Modified) -> bool {
    if headers.contains_key(header::IF_NONE_MATCH) {
        let known = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
        let bare = tag.trim_start_matches("W/");
        return known
            .flat_map(|list| list.split(','))
            .map(|known| known.trim().trim_start_matches("W/"))
            .any(|known| known == "*" || known == bare);
    }
    headers
        .get(header::IF_MODIFIED_SINCE)
        .and_then(|value| httpdate::parse_http_date(value.to_str().ok()?).ok())
        .is_some_and(|since| since >= modified.time)
}

/// What tells one version of an answer from another (RFC 9110, 8.8).
struct Version<'a> {
    /// The entity tag.
    tag: String,
    /// When the data was opened: nothing of it is younger.
    modified: &'a Modified,
    cache_control: &'static str,
    content_type: &'static str,
}

impl Version<'_> {
    /// 304 where the client's copy is this version.
    fn unchanged(&self, headers: &HeaderMap) -> Option<Response> {
        if !is_known_version(headers, &self.tag, self.modified) {
            return None;
        }
        let mut response = StatusCode::NOT_MODIFIED.into_response();
        self.describe(&mut response);
        Some(response)
    }

    fn answer(&self, body: Bytes) -> Response {
        let mut response = Body::from(body).into_response();
        response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(self.content_type));
        self.describe(&mut response);
        response
    }

    /// What answers with and without a body say of the version.
    fn describe(&self, response: &mut Response) {
        let headers = response.headers_mut();
        // A tag is quotes and hexadecimal digits.
        if let Ok(tag) = HeaderValue::from_str(&self.tag) {
            headers.insert(header::ETAG, tag);
        }
        headers.insert(header::LAST_MODIFIED, self.modified.header.clone());
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(self.cache_control));
        if is_compressible_type(self.content_type) {
            headers.insert(header::VARY, HeaderValue::from_static("accept-encoding"));
        }
    }
}

/// When data was opened, as HTTP writes it.
#[derive(Clone, Debug)]
pub struct Modified {
    /// In whole seconds.
    time: SystemTime,
    header: HeaderValue,
}

impl Modified {
    /// At a time.
    pub fn at(time: SystemTime) -> Self {
        let text = httpdate::fmt_http_date(time);
        let time = httpdate::parse_http_date(&text).unwrap_or(time);
        // A date is printable.
        let header = HeaderValue::from_str(&text).unwrap_or(HeaderValue::from_static(""));
        Self { time, header }
    }
}
