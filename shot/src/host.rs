//! Where tiles come from: the server's router in this process, or a server over HTTP.

use crate::arguments::Arguments;
use crate::error::ShotError;
use axum::Router;
use axum::body::Body;
use axum::http::HeaderMap;
use axum::http::header::{ACCEPT_ENCODING, CONTENT_ENCODING};
use std::io::Read as _;
use std::sync::Arc;
use std::time::Duration;
use tokio::runtime::Runtime;
use tower::ServiceExt as _;
use treeline_client::headless::{Fetched, TileFetcher};
use treeline_client::stream::requests::FetchFailure;
use treeline_core::scene::SceneDescription;
use treeline_server::config::Config;
use treeline_server::state::App;
use treeline_server::{http, opening};

/// The Content-Encoding that is asked for: quick to undo, and every Treeline server has it.
const ENCODING: &str = "zstd";
/// Larger than any tile or scene description.
const BODY_LIMIT: usize = 64 << 20;
/// A server that takes longer than this for a tile is not waited for.
const TIMEOUT: Duration = Duration::from_secs(60);

/// A source of tiles with its scene.
pub enum Host {
    /// The router, called as a function.
    InProcess {
        /// Runs its handlers.
        runtime: Runtime,
        /// The application.
        router: Router,
    },
    /// Over the network.
    Remote {
        /// Keeps connections.
        agent: ureq::Agent,
        /// Scheme, host, port and path, without a slash at the end.
        base: String,
    },
}

impl Host {
    /// Opens what the flags name.
    pub fn open(arguments: &Arguments) -> Result<Self, ShotError> {
        match &arguments.server {
            Some(url) => Self::remote(url),
            None => Self::in_process(arguments),
        }
    }

    fn remote(url: &str) -> Result<Self, ShotError> {
        let base = url.trim_end_matches('/').to_owned();
        if !base.starts_with("http://") {
            let mend = if base.starts_with("https://") {
                "this program speaks http only; name the server's own address, without the proxy before it"
            } else {
                "write it as http://host:port"
            };
            return Err(ShotError::input(format!("--server {url}: {mend}")));
        }
        let config =
            ureq::Agent::config_builder().http_status_as_error(false).timeout_global(Some(TIMEOUT)).build();
        Ok(Self::Remote { agent: ureq::Agent::new_with_config(config), base })
    }

    fn in_process(arguments: &Arguments) -> Result<Self, ShotError> {
        let scene = opening::open(&arguments.scene).map_err(ShotError::input)?;
        let app = App::new(Arc::new(scene), &Config::default()).map_err(ShotError::input)?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .map_err(|error| ShotError::failure(format!("the system gives no threads ({error})")))?;
        Ok(Self::InProcess { runtime, router: http::router(app) })
    }

    /// What the scene has.
    pub fn scene(&self) -> Result<SceneDescription, ShotError> {
        let about = |problem: String| match self {
            Self::Remote { base, .. } => ShotError::failure(format!(
                "--server {base}/scene.json: {problem}; is a Treeline server running there?"
            )),
            Self::InProcess { .. } => ShotError::failure(format!("/scene.json: {problem}")),
        };
        let fetched = self.fetch("/scene.json").map_err(|failure| about(failure.to_string()))?;
        serde_json::from_slice(&fetched.body)
            .map_err(|error| about(format!("no scene description ({error})")))
    }
}

/// An answer of any status, as it came.
struct Answer {
    status: u16,
    /// Content-Encoding, where there is one.
    encoding: Option<String>,
    /// Still encoded.
    body: Vec<u8>,
}

/// An answer as a tile, a refusal or a pause.
fn fetched(Answer { status, encoding, body }: Answer) -> Result<Fetched, FetchFailure> {
    let wire_bytes = body.len() as u64;
    let body = decoded(encoding.as_deref(), body)?;
    if (200..300).contains(&status) {
        return Ok(Fetched { body, wire_bytes });
    }
    // A service exception is XML: what it says is between the tags.
    let text = String::from_utf8_lossy(&body[..body.len().min(2_000)]).into_owned();
    let words = text.split('<').filter_map(|part| part.split('>').nth(1)).collect::<String>();
    let words = if text.trim_start().starts_with('<') { words } else { text };
    let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
    let line = format!("HTTP {status}: {words}");
    match status {
        408 | 429 | 500.. => Err(FetchFailure::Temporary(line)),
        _ => Err(FetchFailure::Permanent(line)),
    }
}

fn encoding_of(headers: &HeaderMap) -> Option<String> {
    headers.get(CONTENT_ENCODING).and_then(|value| value.to_str().ok()).map(str::to_ascii_lowercase)
}

/// Undoes a Content-Encoding.
fn decoded(encoding: Option<&str>, body: Vec<u8>) -> Result<Vec<u8>, FetchFailure> {
    match encoding {
        None | Some("identity") => Ok(body),
        Some(ENCODING) => {
            let mut plain = Vec::new();
            let limit = BODY_LIMIT as u64 + 1;
            zstd::Decoder::new(&body[..])
                .and_then(|decoder| decoder.take(limit).read_to_end(&mut plain))
                .map_err(|error| FetchFailure::Temporary(format!("a torn {ENCODING} body: {error}")))?;
            if plain.len() > BODY_LIMIT {
                let line = format!("a body of more than {BODY_LIMIT} bytes");
                return Err(FetchFailure::Permanent(line));
            }
            Ok(plain)
        }
        Some(other) => {
            Err(FetchFailure::Permanent(format!("Content-Encoding {other} where {ENCODING} was asked for")))
        }
    }
}

impl TileFetcher for Host {
    fn fetch(&self, url: &str) -> Result<Fetched, FetchFailure> {
        let temporary = |error: &dyn std::fmt::Display| FetchFailure::Temporary(error.to_string());
        match self {
            Self::InProcess { runtime, router } => {
                let request = axum::http::Request::get(url)
                    .header(ACCEPT_ENCODING, ENCODING)
                    .body(Body::empty())
                    .map_err(|error| FetchFailure::Permanent(error.to_string()))?;
                runtime.block_on(async {
                    let response = match router.clone().oneshot(request).await {
                        Ok(response) => response,
                        Err(never) => match never {},
                    };
                    let status = response.status().as_u16();
                    let encoding = encoding_of(response.headers());
                    let body = axum::body::to_bytes(response.into_body(), BODY_LIMIT)
                        .await
                        .map_err(|error| temporary(&error))?;
                    fetched(Answer { status, encoding, body: body.into() })
                })
            }
            Self::Remote { agent, base } => {
                let url = if url.starts_with('/') { format!("{base}{url}") } else { url.to_owned() };
                // Asked for by hand, it is handed on as it came: its length on the wire is counted.
                let asked = agent.get(&url).header(ACCEPT_ENCODING, ENCODING);
                let mut response = asked.call().map_err(|error| temporary(&error))?;
                let encoding = encoding_of(response.headers());
                let body = response
                    .body_mut()
                    .with_config()
                    .limit(BODY_LIMIT as u64)
                    .read_to_vec()
                    .map_err(|error| temporary(&error))?;
                fetched(Answer { status: response.status().as_u16(), encoding, body })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_a_tile_a_refusal_or_a_pause() {
        let answer = |status, body| fetched(Answer { status, encoding: None, body });
        assert_eq!(answer(200, vec![1]), Ok(Fetched::plain(vec![1])));
        let refusal = answer(400, b"<?xml version=\"1.0\"?><S><E code=\"x\">BBOX is empty</E></S>".to_vec());
        assert_eq!(refusal, Err(FetchFailure::Permanent("HTTP 400: BBOX is empty".into())));
        assert!(matches!(answer(503, b"busy".to_vec()), Err(FetchFailure::Temporary(_))));
    }

    #[test]
    fn what_is_counted_is_what_came() {
        let plain = vec![7; 10_000];
        let body = zstd::encode_all(&plain[..], 3).unwrap();
        let wire_bytes = body.len() as u64;
        let came = |encoding: &str, body: &[u8]| {
            fetched(Answer { status: 200, encoding: Some(encoding.to_owned()), body: body.to_vec() })
        };
        assert_eq!(came("zstd", &body), Ok(Fetched { body: plain, wire_bytes }));
        assert!(wire_bytes < 100);
        assert!(matches!(came("zstd", &body[..body.len() / 2]), Err(FetchFailure::Temporary(_))));
        assert!(matches!(came("br", &body), Err(FetchFailure::Permanent(line)) if line.contains("br")));
        let bomb = zstd::encode_all(&vec![0; BODY_LIMIT + 1][..], 3).unwrap();
        assert!(matches!(came("zstd", &bomb), Err(FetchFailure::Permanent(_))));
    }

    #[test]
    fn a_server_that_cannot_be_reached_is_named() {
        for (url, word) in [("https://h", "http only"), ("h:80", "http://host:port")] {
            assert!(Host::remote(url).err().unwrap().to_string().contains(word));
        }
        let host = Host::remote("http://127.0.0.1:1/").unwrap();
        let error = host.scene().unwrap_err();
        assert!(error.to_string().contains("http://127.0.0.1:1/scene.json"), "{error}");
        assert_eq!(error.exit_code(), 1);
    }
}
