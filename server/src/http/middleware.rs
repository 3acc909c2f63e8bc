//! What happens round every request: bounds first, then counting.

use crate::http::answer::refusal;
use crate::http::request_id;
use crate::state::AppState;
use axum::body::HttpBody as _;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, Version, header};
use axum::middleware::Next;
use axum::response::Response;
use std::any::Any;
use std::time::{Duration, Instant};

/// Refuses URLs and crowds beyond the limits, ends requests that take too long, and counts.
pub async fn bounds(State(app): State<AppState>, request: Request, next: Next) -> Response {
    let under_way = app.metrics.begin();
    let start = Instant::now();
    let id = request_id::of(request.headers());
    let (method, uri) = (request.method().clone(), request.uri().clone());
    let path = request.uri().path();
    // Those who watch the server must hear from it when it is busiest.
    let watches = matches!(path, "/healthz" | "/readyz" | "/metrics");
    let length = request.uri().path_and_query().map_or(0, |text| text.as_str().len());
    let mut response = if length > app.limits.maximum_url_bytes {
        refusal(
            StatusCode::URI_TOO_LONG,
            format!("the URL has {length} bytes; at most {} are read", app.limits.maximum_url_bytes),
        )
    } else if !watches && app.metrics.under_way() > app.limits.maximum_requests as u64 {
        refusal(
            StatusCode::SERVICE_UNAVAILABLE,
            "the server is busy: too many requests at once; ask again in a second",
        )
    } else {
        tokio::time::timeout(app.limits.request_timeout(), next.run(request)).await.unwrap_or_else(|_| {
            refusal(
                StatusCode::SERVICE_UNAVAILABLE,
                format!("no answer within {} seconds; ask again later", app.limits.request_timeout_seconds),
            )
        })
    };
    app.metrics.response(response.status().as_u16(), response.body().size_hint().exact().unwrap_or(0));
    drop(under_way);
    tell(&method, &uri, &id, response.status(), start.elapsed());
    response.headers_mut().insert(request_id::REQUEST_ID, id);
    response
}

/// Logs a request: what went wrong here as a warning, all else where somebody wants to know.
pub fn tell(method: &Method, uri: &Uri, id: &HeaderValue, status: StatusCode, took: Duration) {
    // It has been looked at.
    let id = id.to_str().unwrap_or_default();
    let (path, query) = (uri.path(), uri.query().unwrap_or_default());
    let (status, milliseconds) = (status.as_u16(), took.as_secs_f64() * 1e3);
    if status >= 500 {
        tracing::warn!(id, %method, path, query, status, milliseconds, "answered");
    } else {
        tracing::info!(id, %method, path, query, status, milliseconds, "answered");
    }
}

/// Any origin may time what it reads here, too: without this a page elsewhere cannot tell how many bytes
/// its tiles were on the wire.
pub fn timing<B>(mut response: Response<B>) -> Response<B> {
    response.headers_mut().insert("timing-allow-origin", HeaderValue::from_static("*"));
    response
}

/// A panic in a handler: 500 with one line; the message goes to the log.
pub fn on_panic(panic: Box<dyn Any + Send + 'static>) -> Response {
    let message = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    tracing::error!("a request's handler panicked: {message}");
    refusal(
        StatusCode::INTERNAL_SERVER_ERROR,
        "the server made a mistake on this request; its log has the details",
    )
}

/// Whether compression pays: our own formats, heights and text; pictures are compressed already.
pub fn is_compressible(_: StatusCode, _: Version, headers: &HeaderMap, _: &axum::http::Extensions) -> bool {
    let Some(kind) = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()) else {
        return false;
    };
    let small = headers
        .get(header::CONTENT_LENGTH)
        .and_then(|value| value.to_str().ok()?.parse::<u64>().ok())
        .is_some_and(|length| length < 256);
    !small && is_compressible_type(kind)
}

/// Whether bodies of a media type are compressed where the client can read that.
pub fn is_compressible_type(kind: &str) -> bool {
    let kinds = [
        "application/vnd.treeline.",
        "application/bil",
        "image/x-bil",
        "application/json",
        "text/",
        "application/vnd.ogc.",
    ];
    kinds.iter().any(|prefix| kind.starts_with(prefix))
}
