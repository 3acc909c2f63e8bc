//! Requests that were answered before, word for word: their answer is at hand, and what their words mean need not be
//! found out again. Nothing else about them differs: the same bounds, headers, counters and log.

use super::answer::{Kept, is_known_version};
use super::middleware::tell;
use super::request_id;
use crate::cache::TileKey;
use crate::state::App;
use axum::body::Body;
use axum::extract::Request;
use axum::http::uri::PathAndQuery;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::Response;
use std::sync::Arc;
use std::time::Instant;

/// What an entry weighs besides its words: headers, key, bookkeeping.
const ENTRY_BYTES: usize = 2048;

/// What a request's words came down to.
struct Answer {
    key: TileKey,
    /// Of an answer with a body, but for what is each request's own.
    headers: HeaderMap,
}

/// The requests that are remembered, of one version of the data.
pub struct Known(moka::future::Cache<Arc<str>, Arc<Answer>>);

impl Known {
    /// What is remembered takes no more than this, bytes.
    pub const MOST_BYTES: u64 = 4 << 20;
}

impl Default for Known {
    fn default() -> Self {
        let words = moka::future::Cache::builder()
            .max_capacity(Self::MOST_BYTES)
            .weigher(|words: &Arc<str>, _| u32::try_from(words.len() + ENTRY_BYTES).unwrap_or(u32::MAX))
            .build();
        Self(words)
    }
}

/// What a request is remembered by, where it may be: the words themselves.
pub fn words<B>(request: &Request<B>) -> Option<PathAndQuery> {
    request.uri().path_and_query().filter(|_| request.method() == Method::GET).cloned()
}

/// The answer to a request whose words are known, where its bytes are still at hand and there is no crowd.
pub async fn answer<B>(app: &App, request: &Request<B>) -> Option<Response> {
    if request.method() != Method::GET {
        return None;
    }
    let known = app.known.0.get(request.uri().path_and_query()?.as_str()).await?;
    let start = Instant::now();
    let under_way = app.metrics.begin();
    if app.metrics.under_way() > app.limits.maximum_requests as u64 {
        return None;
    }
    let tag = known.headers.get(header::ETAG).and_then(|tag| tag.to_str().ok())?;
    let mut response = if is_known_version(request.headers(), tag, &app.modified) {
        let mut response = Response::new(Body::empty());
        *response.status_mut() = StatusCode::NOT_MODIFIED;
        *response.headers_mut() = known.headers.clone();
        response.headers_mut().remove(header::CONTENT_TYPE);
        app.metrics.response(StatusCode::NOT_MODIFIED.as_u16(), 0);
        response
    } else {
        let bytes = app.cache.get_at_once(&known.key).await?;
        let length = bytes.len() as u64;
        let mut response = Response::new(Body::from(bytes));
        *response.headers_mut() = known.headers.clone();
        app.metrics.response(StatusCode::OK.as_u16(), length);
        response
    };
    drop(under_way);
    let id: HeaderValue = request_id::of(request.headers());
    tell(request.method(), request.uri(), &id, response.status(), start.elapsed());
    response.headers_mut().insert(request_id::REQUEST_ID, id);
    Some(response)
}

/// Remembers a request by its answer, where that is a whole tile or map that depends on nothing but the words.
pub async fn remember(app: &App, words: PathAndQuery, response: &mut Response) {
    let Some(Kept(key)) = response.extensions_mut().remove::<Kept>() else { return };
    let varies =
        [header::VARY, header::CONTENT_ENCODING].iter().any(|name| response.headers().contains_key(name));
    if response.status() != StatusCode::OK || varies {
        return;
    }
    let mut headers = response.headers().clone();
    headers.remove(request_id::REQUEST_ID);
    headers.remove(header::CONTENT_LENGTH);
    app.known.0.insert(words.as_str().into(), Arc::new(Answer { key, headers })).await;
}
