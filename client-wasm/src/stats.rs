//! What the engine did, as `treeline-shot --stats` writes it and `window.treeline.stats()` answers it.

use serde::Serialize;
use std::collections::BTreeMap;

/// Counters since the engine was made.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Stats {
    /// The adapter that draws.
    pub adapter: String,
    /// Median milliseconds by pass; empty where the adapter cannot time them.
    pub passes: BTreeMap<&'static str, f64>,
    /// Pipelines compiled.
    pub pipelines: Vec<&'static str>,
    /// Tiles received, by layer.
    pub tiles: BTreeMap<&'static str, u64>,
    /// Bytes received (as they came to the engine, decompressed), by layer.
    pub bytes: BTreeMap<&'static str, u64>,
    /// Tiles that stand in slots now, by layer.
    pub resident: BTreeMap<&'static str, usize>,
    /// What was asked for.
    pub requests: RequestStats,
    /// Frames drawn.
    pub frames: u64,
    /// Whether slots ran out before every tile was as fine as the view allows.
    pub limited: bool,
}

/// Requests since the engine was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RequestStats {
    /// Asked for.
    pub started: u64,
    /// Came and was good.
    pub succeeded: u64,
    /// Failed: each will have been, or will be, asked for again.
    pub failed: u64,
    /// Aborted because the view no longer wanted it.
    pub cancelled: u64,
    /// Under way now.
    pub in_flight: usize,
}
