//! `/` and its files: the client's bundle, embedded when the server was built.

use crate::digest::Digest;
use crate::http::answer::{ASK_AGAIN, refusal};
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};

/// A file of the bundle.
struct Asset {
    /// Path within the bundle.
    path: &'static str,
    /// As it is.
    plain: &'static [u8],
    /// Compressed with brotli, where the bundle has that.
    brotli: Option<&'static [u8]>,
}

// `static ASSETS: &[Asset]`, written by build.rs from client-wasm/www/dist.
include!(concat!(env!("OUT_DIR"), "/assets.rs"));

/// Answers `/` and every path that no other route has.
pub async fn page(uri: Uri, headers: HeaderMap) -> Response {
    let path = uri.path().trim_start_matches('/');
    let wanted = if path.is_empty() { "index.html" } else { path };
    match ASSETS.iter().find(|asset| asset.path == wanted) {
        Some(asset) => send(asset, &headers),
        None if wanted == "index.html" => refusal(
            StatusCode::NOT_FOUND,
            "this server was built without the page; `cargo xtask wasm` builds it, then build the server again (`cargo xtask serve` does both)",
        ),
        None => refusal(
            StatusCode::NOT_FOUND,
            format!(
                "nothing at {}; there are /, /wms, /tiles/{{layer}}/{{matrix set}}/{{level}}/{{row}}/{{column}}, /scene.json, /healthz, /readyz and /metrics",
                uri.path()
            ),
        ),
    }
}

fn send(asset: &'static Asset, headers: &HeaderMap) -> Response {
    let tag = format!("\"{}\"", Digest::new().bytes(asset.plain).short_hex());
    let known = headers.get(header::IF_NONE_MATCH).and_then(|value| value.to_str().ok()).unwrap_or_default();
    if known.split(',').any(|known| known.trim().trim_start_matches("W/") == tag) {
        return (
            StatusCode::NOT_MODIFIED,
            [(header::ETAG, tag), (header::CACHE_CONTROL, ASK_AGAIN.to_owned())],
        )
            .into_response();
    }
    let common = [
        (header::CONTENT_TYPE, content_type(asset.path)),
        (header::CACHE_CONTROL, ASK_AGAIN),
        (header::VARY, "accept-encoding"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    ];
    let mut response = match asset.brotli {
        Some(brotli) if accepts_brotli(headers) => {
            let encoding = [(header::CONTENT_ENCODING, "br")];
            (encoding, common, Body::from(Bytes::from_static(brotli))).into_response()
        }
        _ => (common, Body::from(Bytes::from_static(asset.plain))).into_response(),
    };
    if let Ok(tag) = tag.parse() {
        response.headers_mut().insert(header::ETAG, tag);
    }
    response
}

fn accepts_brotli(headers: &HeaderMap) -> bool {
    headers.get_all(header::ACCEPT_ENCODING).iter().filter_map(|value| value.to_str().ok()).any(|list| {
        list.split(',').any(|range| {
            let mut parts = range.split(';').map(str::trim);
            parts.next().is_some_and(|name| name.eq_ignore_ascii_case("br"))
                && !parts.any(|part| part.strip_prefix("q=").is_some_and(|q| q.parse() == Ok(0.0)))
        })
    })
}

fn content_type(path: &str) -> &'static str {
    match path.rsplit('.').next().unwrap_or_default() {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "wasm" => "application/wasm",
        "json" | "webmanifest" => "application/json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        "txt" => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brotli_only_where_it_is_welcome() {
        let of = |value: &str| {
            accepts_brotli(&[(header::ACCEPT_ENCODING, value.parse().unwrap())].into_iter().collect())
        };
        assert!(of("gzip, deflate, br, zstd"));
        assert!(of("br;q=0.5"));
        assert!(!of("br;q=0, gzip"));
        assert!(!of("gzip"));
    }
}
