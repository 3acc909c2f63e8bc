//! What a request may ask for, and how much the server takes on at once.

use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Bounds on requests; `[limits]` in `treeline.toml`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Largest WIDTH of a map, pixels. Default: 4096.
    pub maximum_width: u32,
    /// Largest HEIGHT of a map, pixels. Default: 4096.
    pub maximum_height: u32,
    /// Most layers of one map (one named twice counts once). Default: 16.
    pub maximum_layers: u32,
    /// Longest URL, bytes. Default: 8192.
    pub maximum_url_bytes: usize,
    /// Requests that may be under way at once; more are answered 503 with Retry-After. Default: 2048.
    pub maximum_requests: usize,
    /// Tiles that may wait for a worker; more are answered 503 with Retry-After. Default: 512.
    pub maximum_queue: usize,
    /// Longest time for one request, seconds. Default: 60.
    pub request_timeout_seconds: u64,
    /// Connections that are open at once; more wait until one closes. Default: 4096.
    pub maximum_connections: usize,
    /// Longest time for a request's head to arrive, and for a connection to stay open between requests, seconds.
    /// Default: 30.
    pub header_timeout_seconds: u64,
    /// Longest time for which a client may take nothing of its answer, seconds. Default: 60.
    pub write_timeout_seconds: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            maximum_width: 4096,
            maximum_height: 4096,
            maximum_layers: 16,
            maximum_url_bytes: 8192,
            maximum_requests: 2048,
            maximum_queue: 512,
            request_timeout_seconds: 60,
            maximum_connections: 4096,
            header_timeout_seconds: 30,
            write_timeout_seconds: 60,
        }
    }
}

impl Limits {
    /// The first limit that makes no sense, named as in the file, or `Ok`.
    pub fn check(&self) -> Result<(), String> {
        let positive = [
            ("maximum_width", u64::from(self.maximum_width)),
            ("maximum_height", u64::from(self.maximum_height)),
            ("maximum_layers", u64::from(self.maximum_layers)),
            ("maximum_url_bytes", self.maximum_url_bytes as u64),
            ("maximum_requests", self.maximum_requests as u64),
            ("maximum_queue", self.maximum_queue as u64),
            ("request_timeout_seconds", self.request_timeout_seconds),
            ("maximum_connections", self.maximum_connections as u64),
            ("header_timeout_seconds", self.header_timeout_seconds),
            ("write_timeout_seconds", self.write_timeout_seconds),
        ];
        for (name, value) in positive {
            if value == 0 {
                return Err(format!("limits.{name} is 0; it must be at least 1"));
            }
        }
        for (name, value) in [("maximum_width", self.maximum_width), ("maximum_height", self.maximum_height)]
        {
            if value > 16_384 {
                return Err(format!(
                    "limits.{name} is {value}; it must be at most 16384 (a map of that side takes gigabytes)"
                ));
            }
        }
        Ok(())
    }

    /// Longest time for one request.
    pub fn request_timeout(&self) -> Duration {
        Duration::from_secs(self.request_timeout_seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_senseless_limit_is_named() {
        assert_eq!(Limits::default().check(), Ok(()));
        let zero = Limits { maximum_queue: 0, ..Limits::default() };
        assert_eq!(zero.check().unwrap_err(), "limits.maximum_queue is 0; it must be at least 1");
        let huge = Limits { maximum_height: 20_000, ..Limits::default() };
        assert!(huge.check().unwrap_err().starts_with("limits.maximum_height is 20000"));
    }
}
