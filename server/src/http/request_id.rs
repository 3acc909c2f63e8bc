//! A name for every request, in the answer and in the log, so that what a client saw and what happened here can be told
//! to be the same.

use axum::http::{HeaderMap, HeaderName, HeaderValue};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{SystemTime, UNIX_EPOCH};

/// The header that carries it, as most proxies have it.
pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
/// Longest name that is taken over from a proxy.
const LONGEST: usize = 64;

/// The name that a proxy gave the request, or a new one.
pub fn of(headers: &HeaderMap) -> HeaderValue {
    headers.get(REQUEST_ID).filter(|given| is_plain(given)).cloned().unwrap_or_else(next)
}

/// Whether it may stand in a log as it is.
fn is_plain(given: &HeaderValue) -> bool {
    let bytes = given.as_bytes();
    (1..=LONGEST).contains(&bytes.len())
        && bytes.iter().all(|byte| byte.is_ascii_alphanumeric() || b"-_.:".contains(byte))
}

/// When the process began, and which of its requests this is.
fn next() -> HeaderValue {
    static START: LazyLock<u64> = LazyLock::new(|| {
        SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as u64)
    });
    static NUMBER: AtomicU64 = AtomicU64::new(1);
    let text = format!("{:x}-{:x}", *START, NUMBER.fetch_add(1, Relaxed));
    // Digits and a dash.
    HeaderValue::try_from(text).unwrap_or(HeaderValue::from_static("none"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_proxys_name_is_kept_and_nothing_that_forges_a_log() {
        let of_text = |text: &[u8]| {
            let value = HeaderValue::from_bytes(text).unwrap();
            of(&[(REQUEST_ID, value)].into_iter().collect())
        };
        assert_eq!(of_text(b"a1-b2"), "a1-b2");
        for wrong in [&b""[..], b"a b", b"\"x\"", &[b'x'; 65], b"\xff"] {
            assert!(of_text(wrong).to_str().unwrap().contains('-'), "{wrong:?}");
        }
        assert_ne!(of(&HeaderMap::new()), of(&HeaderMap::new()));
    }
}
