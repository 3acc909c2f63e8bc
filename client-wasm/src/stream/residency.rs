//! Which tile stands in which slot: a fixed pool, a stack of free slots, least recently used out
//! first, and never a tile that is wanted now.

use std::collections::{HashMap, HashSet};
use treeline_core::tile::TileAddress;

/// A tile that is known.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Entry {
    /// It has come and holds nothing: it needs no slot.
    Empty,
    /// It stands in a slot.
    Resident(Resident),
}

/// A tile in a slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resident {
    /// The slot: layer of the pool's texture arrays.
    pub slot: u32,
    /// Frame in which it was last wanted or drawn.
    last_used: u64,
    /// Frame in which it was last drawn.
    last_drawn: u64,
    /// When it came into the picture, seconds; −∞ where it was not to fade in.
    shown_since: f64,
}

/// Where an arrived tile goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// Into this slot; whatever stood there is gone.
    Slot(u32),
    /// Everything is wanted more: the tile is dropped.
    NoRoom,
}

/// Empty tiles that are remembered at most; more are forgotten, and asked for again if need be.
const MAXIMUM_EMPTY: usize = 4096;

/// The slots of one kind of tile.
#[derive(Clone, Debug)]
pub struct Pool {
    capacity: u32,
    free: Vec<u32>,
    entries: HashMap<TileAddress, Entry>,
    empty: usize,
    frame: u64,
}

impl Pool {
    /// With `capacity` slots.
    pub fn new(capacity: u32) -> Self {
        Self {
            capacity,
            // The lowest slot on top.
            free: (0..capacity).rev().collect(),
            entries: HashMap::new(),
            empty: 0,
            frame: 1,
        }
    }

    /// All slots.
    pub fn capacity(&self) -> usize {
        self.capacity as usize
    }

    /// Slots in use.
    pub fn used(&self) -> usize {
        self.capacity as usize - self.free.len()
    }

    /// The tile's slot and state, where it stands in one.
    pub fn resident(&self, address: &TileAddress) -> Option<&Resident> {
        match self.entries.get(address) {
            Some(Entry::Resident(resident)) => Some(resident),
            _ => None,
        }
    }

    /// Whether the tile has come, with or without content.
    pub fn is_known(&self, address: &TileAddress) -> bool {
        self.entries.contains_key(address)
    }

    /// Whether the tile has come and holds nothing.
    pub fn is_empty_tile(&self, address: &TileAddress) -> bool {
        self.entries.get(address) == Some(&Entry::Empty)
    }

    /// Tiles in slots.
    pub fn residents(&self) -> impl Iterator<Item = (&TileAddress, &Resident)> {
        self.entries.iter().filter_map(|(address, entry)| match entry {
            Entry::Resident(resident) => Some((address, resident)),
            Entry::Empty => None,
        })
    }

    /// The finest tile in a slot among the square's own and its ancestors'.
    pub fn nearest(&self, address: TileAddress) -> Option<(TileAddress, &Resident)> {
        (0..=address.level).rev().find_map(|level| {
            let ancestor = address.ancestor(level)?;
            self.resident(&ancestor).map(|resident| (ancestor, resident))
        })
    }

    /// Remembers that a tile holds nothing.
    pub fn insert_empty(&mut self, address: TileAddress) {
        if self.empty >= MAXIMUM_EMPTY {
            self.entries.retain(|_, entry| *entry != Entry::Empty);
            self.empty = 0;
        }
        if self.entries.insert(address, Entry::Empty).is_none() {
            self.empty += 1;
        }
    }

    /// Finds a slot for a tile that has come: a free one, else that of the tile used least
    /// recently among those that are not in `wanted`. Answers the tile evicted, too.
    pub fn place(
        &mut self,
        address: TileAddress,
        wanted: &HashSet<TileAddress>,
    ) -> (Placement, Option<TileAddress>) {
        if let Some(resident) = self.resident(&address) {
            return (Placement::Slot(resident.slot), None);
        }
        let (slot, evicted) = match self.free.pop() {
            Some(slot) => (slot, None),
            None => {
                let least = self
                    .residents()
                    .filter(|(address, _)| !wanted.contains(address))
                    .min_by_key(|(address, resident)| (resident.last_used, **address))
                    .map(|(address, resident)| (*address, *resident));
                // A tile that nobody wants does not push out another.
                let Some((old, resident)) = least.filter(|_| wanted.contains(&address)) else {
                    return (Placement::NoRoom, None);
                };
                self.entries.remove(&old);
                (resident.slot, Some(old))
            }
        };
        let resident = Resident { slot, last_used: self.frame, last_drawn: 0, shown_since: f64::NAN };
        self.entries.insert(address, Entry::Resident(resident));
        (Placement::Slot(slot), evicted)
    }

    /// A new frame begins, with these tiles wanted.
    pub fn begin_frame<'a>(&mut self, wanted: impl Iterator<Item = &'a TileAddress>) {
        self.frame += 1;
        for address in wanted {
            if let Some(Entry::Resident(resident)) = self.entries.get_mut(address) {
                resident.last_used = self.frame;
            }
        }
    }

    /// Whether the last frame drew the tile, or this one has.
    pub fn was_drawn(&self, address: &TileAddress) -> bool {
        self.resident(address).is_some_and(|resident| resident.last_drawn + 1 >= self.frame)
    }

    /// The tile is drawn in this frame, at `now` seconds; `fades` says whether it may fade in, should
    /// this be the first frame that shows it. Answers its share, 0…1.
    pub fn draw(&mut self, address: &TileAddress, now: f64, fades: bool, fade_seconds: f64) -> f64 {
        let frame = self.frame;
        let Some(Entry::Resident(resident)) = self.entries.get_mut(address) else { return 1.0 };
        if resident.last_drawn + 1 < frame {
            resident.shown_since = if fades && fade_seconds > 0.0 { now } else { f64::NEG_INFINITY };
        }
        resident.last_drawn = frame;
        resident.last_used = frame;
        if resident.shown_since == f64::NEG_INFINITY {
            return 1.0;
        }
        ((now - resident.shown_since) / fade_seconds).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tile(column: u32) -> TileAddress {
        TileAddress { level: 12, row: 5, column }
    }

    proptest! {
        #[test]
        fn slots_are_never_shared_lost_or_taken_from_what_is_wanted(
            steps in proptest::collection::vec((0_u32..40, proptest::collection::hash_set(0_u32..40, 0..8)), 1..200),
        ) {
            let mut pool = Pool::new(8);
            for (column, wanted) in steps {
                let wanted: HashSet<TileAddress> = wanted.into_iter().map(tile).collect();
                let before: Vec<TileAddress> = pool.residents().map(|(address, _)| *address).collect();
                pool.begin_frame(wanted.iter());
                let (placement, evicted) = pool.place(tile(column), &wanted);
                if let Some(evicted) = evicted {
                    prop_assert!(!wanted.contains(&evicted) && before.contains(&evicted));
                }
                if wanted.contains(&tile(column)) {
                    prop_assert!(placement != Placement::NoRoom);
                }
                let slots: HashSet<u32> = pool.residents().map(|(_, resident)| resident.slot).collect();
                prop_assert_eq!(slots.len(), pool.used());
                prop_assert!(slots.iter().all(|&slot| slot < 8));
                prop_assert_eq!(pool.used() + pool.free.len(), 8);
            }
        }
    }

    #[test]
    fn the_least_recently_used_goes() {
        let mut pool = Pool::new(2);
        let all: HashSet<TileAddress> = (0..3).map(tile).collect();
        pool.place(tile(0), &all);
        pool.place(tile(1), &all);
        pool.begin_frame([tile(0)].iter());
        let wanted = HashSet::from([tile(2)]);
        assert_eq!(pool.place(tile(2), &wanted), (Placement::Slot(1), Some(tile(1))));
        assert_eq!(pool.place(tile(3), &wanted).0, Placement::NoRoom, "nobody wants it");
    }

    #[test]
    fn a_tile_fades_in_once() {
        let mut pool = Pool::new(2);
        pool.place(tile(0), &HashSet::new());
        pool.begin_frame([].iter());
        assert_eq!(pool.draw(&tile(0), 10.0, true, 0.5), 0.0);
        pool.begin_frame([].iter());
        assert_eq!(pool.draw(&tile(0), 10.25, true, 0.5), 0.5);
        assert!(pool.draw(&tile(0), 11.0, true, 0.5) >= 1.0);
        pool.begin_frame([].iter());
        pool.begin_frame([].iter());
        assert_eq!(pool.draw(&tile(0), 12.0, false, 0.5), 1.0, "shown again, with nothing to fade from");
    }
}
