//! What the engine did, as `treeline-shot --stats` writes it and `window.treeline.stats()` answers it.

use crate::stream::memory::MemoryStats;
use crate::survey::SurveyStats;
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
    /// Bytes of the tiles received, by layer, as they crossed the network: the answers' bodies with their
    /// Content-Encoding still on.
    ///
    /// Not counted are heads, answers other than good ones, what came of a body that was torn or given up,
    /// and what a cache on this machine gave. In one process with the server: what it would have sent.
    /// In the browser they are Resource Timing's `encodedBodySize`; where that is hidden (a server of another
    /// origin without `Timing-Allow-Origin`), Content-Length; where there is neither, the
    /// decompressed length, which is a bound from above.
    pub bytes: BTreeMap<&'static str, u64>,
    /// Tiles that stand in slots now, by layer.
    pub resident: BTreeMap<&'static str, usize>,
    /// What was asked for.
    pub requests: RequestStats,
    /// Frames drawn.
    pub frames: u64,
    /// Tile Load Maps: how many, and how long each takes; absent where the quadtree chooses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub survey: Option<SurveyStats>,
    /// Seeds of the last frame; absent where no trees are drawn one by one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seeds: Option<SeedStats>,
    /// Undergrowth of the last frame; absent where it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub undergrowth: Option<UndergrowthStats>,
    /// GPU memory of the tiles.
    pub memory: MemoryStats,
    /// Whether slots ran out before every tile was as fine as the view allows.
    pub limited: bool,
}

impl Stats {
    /// Adds what an earlier engine counted for the same host: since the host began, then.
    pub fn add_earlier(&mut self, earlier: &Self) {
        for (sum, part) in [(&mut self.tiles, &earlier.tiles), (&mut self.bytes, &earlier.bytes)] {
            for (&layer, count) in part {
                *sum.entry(layer).or_default() += count;
            }
        }
        let requests = &mut self.requests;
        requests.started += earlier.requests.started;
        requests.succeeded += earlier.requests.succeeded;
        requests.failed += earlier.requests.failed;
        // What was under way came to nothing.
        requests.cancelled += earlier.requests.cancelled + earlier.requests.in_flight as u64;
        self.frames += earlier.frames;
    }
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

/// Seeds of a frame, as they were last read back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SeedStats {
    /// Candidates looked at.
    pub checked: u64,
    /// Trees selected.
    pub selected: u64,
    /// Draw calls that they take: one a species and level at most.
    pub draw_calls: u32,
}

/// Undergrowth of a frame, as its counts were last read back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct UndergrowthStats {
    /// Metaseeds that grow anything in the picture.
    pub metaseeds: u64,
    /// Plants, stones and dead wood.
    pub plants: u64,
    /// Draw calls that they take: one a kind, two of grass.
    pub draw_calls: u32,
    /// GPU memory, bytes.
    pub bytes: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_earlier_engines_did_counts_too() {
        let count = |tiles: u64, in_flight| Stats {
            tiles: [("texture", tiles)].into(),
            bytes: [("texture", 1_000 * tiles)].into(),
            resident: [("texture", 1)].into(),
            requests: RequestStats {
                started: tiles + in_flight as u64,
                succeeded: tiles,
                in_flight,
                ..Default::default()
            },
            frames: 2,
            ..Stats::default()
        };
        let mut now = count(5, 1);
        now.add_earlier(&count(3, 2));
        assert_eq!((now.tiles["texture"], now.bytes["texture"], now.frames), (8, 8_000, 4));
        assert_eq!(now.resident["texture"], 1, "slots of an engine that is gone are gone");
        let RequestStats { started, succeeded, failed, cancelled, in_flight } = now.requests;
        assert_eq!(started, succeeded + failed + cancelled + in_flight as u64);
    }
}
