//! A simulated connection, on a virtual clock: bytes a second, latency, failures, answers in any order.

use treeline_client::stream::requests::{RequestId, TileKey};
use treeline_core::hash::hash;

/// What a connection is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkQuality {
    /// Bytes a second.
    pub bytes_per_second: f64,
    /// From the last byte sent to the first received, seconds.
    pub latency_seconds: f64,
    /// One request in so many fails; 0: none.
    pub fails_one_in: u32,
    /// Each answer is held up by up to this, seconds: they come in any order.
    pub disorder_seconds: f64,
}

impl LinkQuality {
    /// So fast that only the latency counts.
    pub const FAST: Self =
        Self { bytes_per_second: 1e9, latency_seconds: 0.02, fails_one_in: 0, disorder_seconds: 0.0 };
    /// 1 Mbit/s, 300 ms, one request in ten failing, answers in any order.
    pub const BAD: Self =
        Self { bytes_per_second: 125_000.0, latency_seconds: 0.3, fails_one_in: 10, disorder_seconds: 2.0 };
}

/// Bytes of a tile's answer, about as many as real ones have.
fn bytes_of(key: TileKey) -> f64 {
    if key.layer.is_elevation() { 90_000.0 } else { 56_000.0 }
}

/// The connection: requests share it one after the other.
#[derive(Clone, Debug)]
pub struct Link {
    quality: LinkQuality,
    free_at: f64,
    under_way: Vec<(f64, RequestId, TileKey)>,
    /// Requests so far.
    pub asked: u64,
    /// Bytes asked for so far.
    pub bytes: f64,
}

impl Link {
    /// An idle connection.
    pub fn new(quality: LinkQuality) -> Self {
        Self { quality, free_at: 0.0, under_way: Vec::new(), asked: 0, bytes: 0.0 }
    }

    /// Asks for a tile.
    pub fn ask(&mut self, now: f64, id: RequestId, key: TileKey) {
        let share = f64::from(hash(self.asked as u32, 17, 3)) / f64::from(u32::MAX);
        self.free_at = self.free_at.max(now) + bytes_of(key) / self.quality.bytes_per_second;
        let at = self.free_at + self.quality.latency_seconds + share * self.quality.disorder_seconds;
        self.under_way.push((at, id, key));
        self.asked += 1;
        self.bytes += bytes_of(key);
    }

    /// Gives a request up.
    pub fn cancel(&mut self, id: RequestId) -> Option<TileKey> {
        let index = self.under_way.iter().position(|(_, other, _)| *other == id)?;
        Some(self.under_way.swap_remove(index).2)
    }

    /// What has come by `now`, in order of arrival, and whether it is good.
    pub fn arrivals(&mut self, now: f64) -> Vec<(RequestId, TileKey, bool)> {
        let (mut done, left): (Vec<_>, Vec<_>) = self.under_way.drain(..).partition(|(at, _, _)| *at <= now);
        self.under_way = left;
        done.sort_by(|a, b| a.0.total_cmp(&b.0));
        let fails = self.quality.fails_one_in;
        let good = |id: RequestId| fails == 0 || id.0 % u64::from(fails) != u64::from(fails / 2);
        done.into_iter().map(|(_, id, key)| (id, key, good(id))).collect()
    }
}
