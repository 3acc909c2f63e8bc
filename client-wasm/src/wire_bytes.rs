//! What tiles were on the wire, where the platform says it apart from the answer, and later or not at
//! all: the browser. A plain state machine that is told what was asked, what came and what was measured.

use std::collections::{BTreeMap, HashMap};

/// Clocks of a browser may be coarsened by so many milliseconds.
const CLOCK_MILLISECONDS: f64 = 1.0;

/// The count of bodies' bytes by layer.
#[derive(Clone, Debug, Default)]
pub struct WireBytes {
    settled: BTreeMap<&'static str, u64>,
    /// By absolute address: asked for, and not settled yet.
    open: HashMap<String, Open>,
}

/// A request whose count is open.
#[derive(Clone, Copy, Debug)]
struct Open {
    name: &'static str,
    /// When it was asked for, milliseconds.
    since: f64,
    /// Where its body has come: at most so many bytes.
    bound: Option<u64>,
    /// Bytes of its body on the wire, where the platform has told.
    measured: Option<u64>,
    /// Whether the platform has told what it will.
    told: bool,
}

/// Bytes of a body that crossed the network, from what Resource Timing says of the request:
/// `transferSize` (with heads; 0 from a cache) and `encodedBodySize` (the body's, wherever it came
/// from). `None` where a server of another origin hides both.
pub fn body_bytes(transfer_size: f64, encoded_body_size: f64) -> Option<u64> {
    match (transfer_size > 0.0, encoded_body_size > 0.0) {
        (false, false) => None,
        // From a cache on this machine, asked again (only heads crossed) or not.
        (false, true) => Some(0),
        (true, _) if encoded_body_size > transfer_size => Some(0),
        (true, _) => Some(encoded_body_size as u64),
    }
}

impl WireBytes {
    /// An address is asked for, at `now` milliseconds.
    pub fn asked(&mut self, url: String, name: &'static str, now: f64) {
        let open = Open { name, since: now, bound: None, measured: None, told: false };
        if let Some(before) = self.open.insert(url, open) {
            // The platform never told of the last time.
            self.settle(before);
        }
    }

    /// Its body has come in full; on the wire it was at most `bound` bytes.
    pub fn came(&mut self, url: &str, bound: u64) {
        self.update(url, |open| open.bound = Some(bound));
    }

    /// It did not come.
    pub fn failed(&mut self, url: &str) {
        self.open.remove(url);
    }

    /// What the platform measured of a request that began at `since` milliseconds, if it may tell.
    pub fn measured(&mut self, url: &str, since: f64, bytes: Option<u64>) {
        self.update(url, |open| {
            // An earlier request of the same address is none of this one's.
            if since + CLOCK_MILLISECONDS >= open.since {
                (open.measured, open.told) = (bytes, true);
            }
        });
    }

    /// Bytes by layer; of what came and is not measured (yet), the bound.
    pub fn totals(&self) -> BTreeMap<&'static str, u64> {
        let mut totals = self.settled.clone();
        for open in self.open.values() {
            add(&mut totals, open);
        }
        totals
    }

    fn update(&mut self, url: &str, change: impl FnOnce(&mut Open)) {
        let Some(open) = self.open.get_mut(url) else { return };
        change(open);
        if open.bound.is_some() && open.told {
            let open = *open;
            self.open.remove(url);
            self.settle(open);
        }
    }

    fn settle(&mut self, open: Open) {
        add(&mut self.settled, &open);
    }
}

/// Adds what came; what did not come counts nothing.
fn add(totals: &mut BTreeMap<&'static str, u64>, open: &Open) {
    if let Some(bound) = open.bound {
        *totals.entry(open.name).or_default() += open.measured.unwrap_or(bound);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TILE: &str = "http://host/wms?1";

    fn total(bytes: &WireBytes) -> u64 {
        bytes.totals().get("texture").copied().unwrap_or_default()
    }

    #[test]
    fn what_crossed_the_network() {
        assert_eq!(body_bytes(4_300.0, 4_000.0), Some(4_000));
        assert_eq!(body_bytes(0.0, 4_000.0), Some(0), "from a cache");
        assert_eq!(body_bytes(300.0, 4_000.0), Some(0), "asked again and unchanged");
        assert_eq!(body_bytes(0.0, 0.0), None, "hidden");
    }

    #[test]
    fn the_measure_counts_whether_it_comes_before_the_body_or_after() {
        for measured_first in [true, false] {
            let mut bytes = WireBytes::default();
            bytes.asked(TILE.into(), "texture", 10.0);
            if measured_first {
                bytes.measured(TILE, 10.2, Some(400));
                assert_eq!(total(&bytes), 0, "nothing has come");
            }
            bytes.came(TILE, 1_000);
            if !measured_first {
                assert_eq!(total(&bytes), 1_000, "until it is measured");
                bytes.measured(TILE, 10.2, Some(400));
            }
            assert_eq!(total(&bytes), 400);
            bytes.measured(TILE, 10.2, Some(400));
            assert_eq!(total(&bytes), 400, "counted once");
        }
    }

    #[test]
    fn what_is_never_measured_counts_with_its_bound() {
        let mut bytes = WireBytes::default();
        for now in [10.0, 20.0] {
            bytes.asked(TILE.into(), "texture", now);
            bytes.came(TILE, 1_000);
            bytes.measured(TILE, now, None);
        }
        assert_eq!(total(&bytes), 2_000);
    }

    #[test]
    fn what_failed_counts_nothing_and_its_measure_is_not_the_next_ones() {
        let mut bytes = WireBytes::default();
        bytes.asked(TILE.into(), "texture", 10.0);
        bytes.failed(TILE);
        bytes.asked(TILE.into(), "texture", 500.0);
        bytes.measured(TILE, 10.0, Some(77));
        bytes.came(TILE, 1_000);
        assert_eq!(total(&bytes), 1_000);
        bytes.measured(TILE, 500.1, Some(300));
        assert_eq!(total(&bytes), 300);
    }
}
