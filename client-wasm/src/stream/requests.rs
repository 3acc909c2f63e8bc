//! What is asked for: bounded in flight, most wanted first, cancelled when no longer wanted, tried
//! again later when it failed.

use serde::Serialize;
use std::collections::{HashMap, HashSet};
use treeline_core::layer::Layer;
use treeline_core::tile::TileAddress;

/// A tile of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TileKey {
    /// The layer.
    pub layer: Layer,
    /// The tile.
    pub address: TileAddress,
}

impl std::fmt::Display for TileKey {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{} {}", self.layer.name(), self.address)
    }
}

/// Names one request; never used again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(transparent)]
pub struct RequestId(pub u64);

/// Why a tile did not come.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FetchFailure {
    /// It may come next time: the link broke, the server was busy, the body was torn.
    #[error("{0}")]
    Temporary(String),
    /// Asking again will not help soon: the server refused (4xx), or its tile is of another version.
    #[error("{0}")]
    Permanent(String),
}

/// A tile wanted, and how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// The tile.
    pub key: TileKey,
    /// Larger is sooner.
    pub priority: f64,
    /// Not to be asked for yet; what is under way goes on.
    pub waits: bool,
}

/// What to do on the network now.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// To ask for.
    pub start: Vec<(RequestId, TileKey)>,
    /// To abort.
    pub cancel: Vec<RequestId>,
}

/// A tile that failed, until it comes.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// How often, one after the other.
    pub attempts: u32,
    /// It is not asked for again before this time, seconds.
    pub not_before: f64,
    /// The last one, and whether asking again would help.
    pub last: FetchFailure,
}

/// Delay after the first failure, seconds; each further one doubles it.
const FIRST_DELAY_SECONDS: f64 = 0.5;
/// Longest delay, seconds; at once that of a refusal.
const LONGEST_DELAY_SECONDS: f64 = 30.0;
/// Failures remembered beyond those of tiles wanted now.
const MAXIMUM_FAILURES: usize = 1024;

/// The requests under way and those that failed.
#[derive(Debug)]
pub struct Requests {
    maximum_in_flight: usize,
    next_id: u64,
    in_flight: HashMap<RequestId, TileKey>,
    asked: HashSet<TileKey>,
    failures: HashMap<TileKey, Failure>,
}

impl Requests {
    /// With at most `maximum_in_flight` (at least one) under way.
    pub fn new(maximum_in_flight: usize) -> Self {
        Self {
            maximum_in_flight: maximum_in_flight.max(1),
            next_id: 0,
            in_flight: HashMap::new(),
            asked: HashSet::new(),
            failures: HashMap::new(),
        }
    }

    /// What to start and what to cancel, given everything that is wanted and has not come.
    pub fn plan(&mut self, now: f64, wishes: &[Wish]) -> Plan {
        // A view at rest, or one over tiles that have all come, costs nothing.
        if wishes.is_empty() && self.in_flight.is_empty() && self.failures.len() <= MAXIMUM_FAILURES {
            return Plan::default();
        }
        let wanted: HashSet<TileKey> = wishes.iter().map(|wish| wish.key).collect();
        let mut cancel: Vec<RequestId> =
            self.in_flight.iter().filter(|(_, key)| !wanted.contains(key)).map(|(&id, _)| id).collect();
        cancel.sort_unstable();
        for id in &cancel {
            if let Some(key) = self.in_flight.remove(id) {
                self.asked.remove(&key);
            }
        }
        if self.failures.len() > MAXIMUM_FAILURES {
            self.failures.retain(|key, failure| wanted.contains(key) || failure.not_before > now);
        }
        let room = self.maximum_in_flight.saturating_sub(self.in_flight.len());
        let mut waiting: Vec<&Wish> = wishes
            .iter()
            .filter(|wish| !wish.waits && !self.asked.contains(&wish.key))
            .filter(|wish| self.failures.get(&wish.key).is_none_or(|failure| failure.not_before <= now))
            .collect();
        waiting.sort_by(|a, b| b.priority.total_cmp(&a.priority).then_with(|| a.key.cmp(&b.key)));
        waiting.dedup_by_key(|wish| wish.key);
        let mut start = Vec::new();
        for wish in waiting.into_iter().take(room) {
            let id = self.next_id();
            self.in_flight.insert(id, wish.key);
            self.asked.insert(wish.key);
            start.push((id, wish.key));
        }
        Plan { start, cancel }
    }

    /// An id that is never given again: for what is asked for beside tiles.
    pub fn next_id(&mut self) -> RequestId {
        self.next_id += 1;
        RequestId(self.next_id - 1)
    }

    /// A request has ended, however: the tile it was for, or `None` where it had been cancelled.
    pub fn finish(&mut self, id: RequestId) -> Option<TileKey> {
        let key = self.in_flight.remove(&id)?;
        self.asked.remove(&key);
        Some(key)
    }

    /// The tile has come: its failures are forgotten.
    pub fn succeeded(&mut self, key: TileKey) {
        self.failures.remove(&key);
    }

    /// The tile did not come: it is not asked for again before a time that doubles with each
    /// failure, spread by up to a quarter so that tiles that failed together do not come back together.
    pub fn failed(&mut self, key: TileKey, now: f64, failure: &FetchFailure) {
        let attempts = self.failures.get(&key).map_or(0, |failure| failure.attempts) + 1;
        let delay = match failure {
            FetchFailure::Temporary(_) => {
                (FIRST_DELAY_SECONDS * f64::from(attempts - 1).exp2()).min(LONGEST_DELAY_SECONDS)
            }
            FetchFailure::Permanent(_) => LONGEST_DELAY_SECONDS,
        };
        let delay = delay * (0.75 + 0.5 * unit_hash(key, attempts));
        self.failures.insert(key, Failure { attempts, not_before: now + delay, last: failure.clone() });
    }

    /// What failed for a while may be asked for again at once: the way there is open again. What was
    /// refused stays refused.
    pub fn retry_now(&mut self, now: f64) {
        for failure in self.failures.values_mut() {
            if matches!(failure.last, FetchFailure::Temporary(_)) {
                failure.not_before = failure.not_before.min(now);
            }
        }
    }

    /// How a tile has failed, if it has since it last came.
    pub fn failure(&self, key: &TileKey) -> Option<&Failure> {
        self.failures.get(key)
    }

    /// When the first of the wishes that failed may be asked for again; `None` where none has to wait.
    pub fn next_retry(&self, wishes: &[Wish]) -> Option<f64> {
        wishes
            .iter()
            .filter(|wish| !self.asked.contains(&wish.key))
            .filter_map(|wish| self.failures.get(&wish.key))
            .map(|failure| failure.not_before)
            .min_by(f64::total_cmp)
    }

    /// Requests under way.
    pub fn in_flight(&self) -> usize {
        self.in_flight.len()
    }
}

/// 0…1 from a tile and an attempt: the same in every run (murmur3's finaliser over the parts).
fn unit_hash(key: TileKey, attempt: u32) -> f64 {
    let mut state = attempt ^ (key.layer as u32) << 8 ^ u32::from(key.address.level) << 16;
    for part in [key.address.row, key.address.column] {
        state = (state ^ part).wrapping_mul(0x9e37_79b1);
        state = (state ^ state >> 16).wrapping_mul(0x85eb_ca6b);
        state = (state ^ state >> 13).wrapping_mul(0xc2b2_ae35);
        state ^= state >> 16;
    }
    f64::from(state) / f64::from(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wish(column: u32, priority: f64) -> Wish {
        Wish {
            key: TileKey { layer: Layer::Texture, address: TileAddress { level: 9, row: 1, column } },
            priority,
            waits: false,
        }
    }

    fn temporary() -> FetchFailure {
        FetchFailure::Temporary("connection reset".into())
    }

    #[test]
    fn the_most_wanted_go_first_and_never_more_than_allowed() {
        let mut requests = Requests::new(2);
        let wishes = [wish(1, 1.0), wish(2, 3.0), wish(3, 2.0)];
        let plan = requests.plan(0.0, &wishes);
        assert_eq!(plan.start.iter().map(|(_, key)| key.address.column).collect::<Vec<_>>(), [2, 3]);
        assert_eq!(requests.plan(0.0, &wishes), Plan::default(), "nothing is asked for twice");
        assert_eq!(requests.finish(plan.start[0].0), Some(wishes[1].key));
        let plan = requests.plan(0.1, &[wishes[0], wishes[2]]);
        assert_eq!(plan.start.len(), 1);
        assert_eq!(plan.start[0].1, wishes[0].key);
    }

    #[test]
    fn what_waits_is_not_asked_for_and_goes_on_where_it_was() {
        let mut requests = Requests::new(4);
        let waits = |wish: Wish| Wish { waits: true, ..wish };
        let plan = requests.plan(0.0, &[wish(1, 1.0), waits(wish(2, 9.0))]);
        assert_eq!(plan.start.iter().map(|(_, key)| key.address.column).collect::<Vec<_>>(), [1]);
        assert_eq!(requests.plan(0.1, &[waits(wish(1, 1.0)), waits(wish(2, 9.0))]), Plan::default());
        assert_eq!(requests.plan(0.2, &[wish(1, 1.0), wish(2, 9.0)]).start.len(), 1);
    }

    #[test]
    fn what_is_no_longer_wanted_is_cancelled_and_its_answer_ignored() {
        let mut requests = Requests::new(4);
        let plan = requests.plan(0.0, &[wish(1, 1.0), wish(2, 1.0)]);
        let next = requests.plan(0.1, &[wish(2, 1.0)]);
        assert_eq!(next, Plan { start: vec![], cancel: vec![plan.start[0].0] });
        assert_eq!(requests.finish(plan.start[0].0), None);
        let again = requests.plan(0.2, &[wish(1, 1.0), wish(2, 1.0)]);
        assert_eq!(again.start.len(), 1);
        assert_ne!(again.start[0].0, plan.start[0].0);
    }

    #[test]
    fn a_failed_tile_waits_longer_each_time() {
        let mut requests = Requests::new(1);
        let wishes = [wish(1, 1.0)];
        let (mut now, mut last) = (0.0, 0.0);
        for attempt in 1..=12 {
            let plan = requests.plan(now, &wishes);
            let key = requests.finish(plan.start[0].0).unwrap();
            requests.failed(key, now, &temporary());
            assert_eq!(requests.failure(&key).unwrap().attempts, attempt);
            let at = requests.next_retry(&wishes).unwrap();
            assert!(requests.plan(now + 0.99 * (at - now), &wishes).start.is_empty());
            let delay = at - now;
            assert!(
                delay <= 1.25 * LONGEST_DELAY_SECONDS && (attempt > 6 || delay > 1.1 * last),
                "{delay} {last}"
            );
            last = delay;
            now = at;
        }
        let plan = requests.plan(now, &wishes);
        let key = requests.finish(plan.start[0].0).unwrap();
        requests.succeeded(key);
        assert_eq!(requests.failure(&key), None);
    }

    #[test]
    fn tiles_that_fail_together_do_not_come_back_together() {
        let mut requests = Requests::new(64);
        let wishes: Vec<Wish> = (0..64).map(|column| wish(column, 1.0)).collect();
        for (id, _) in requests.plan(0.0, &wishes).start {
            let key = requests.finish(id).unwrap();
            requests.failed(key, 0.0, &temporary());
        }
        let early = requests.plan(0.5, &wishes).start.len();
        assert!((10..54).contains(&early), "{early} of 64 after the mean delay");
    }

    #[test]
    fn once_the_way_is_open_again_nothing_waits_but_what_was_refused() {
        let mut requests = Requests::new(4);
        let wishes = [wish(1, 1.0), wish(2, 1.0)];
        let failures = [temporary(), FetchFailure::Permanent("404".into())];
        for ((id, key), failure) in requests.plan(0.0, &wishes).start.into_iter().zip(failures) {
            requests.finish(id);
            requests.failed(key, 0.0, &failure);
        }
        assert!(requests.plan(0.1, &wishes).start.is_empty());
        requests.retry_now(0.1);
        let again = requests.plan(0.1, &wishes).start;
        assert_eq!(again.iter().map(|(_, key)| *key).collect::<Vec<_>>(), [wishes[0].key]);
    }

    #[test]
    fn a_refusal_is_not_repeated_soon() {
        let mut requests = Requests::new(1);
        let wishes = [wish(1, 1.0)];
        let id = requests.plan(0.0, &wishes).start[0].0;
        let key = requests.finish(id).unwrap();
        requests.failed(key, 0.0, &FetchFailure::Permanent("404".into()));
        assert!(requests.next_retry(&wishes).unwrap() > 20.0);
    }
}
