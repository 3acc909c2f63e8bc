//! The lists that are read from the map: what is wanted now, what was before, what is to load and what
//! is given up (Amara, Meunier and Marsault, ISVC 2007, section 4.2).

use std::collections::HashSet;
use treeline_core::tile::TileAddress;

/// A tile that the map names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Named {
    /// The tile.
    pub address: TileAddress,
    /// Pixels whose ray hits it and wants its level.
    pub pixels: u32,
    /// Named only for where the eye will soon be.
    pub ahead: bool,
    /// When the map last named it, seconds.
    pub at: f64,
}

/// One kind of tile: current and previous list, and their differences. Lists are sorted by address; their
/// memory is used again, so that in the steady state nothing is allocated.
#[derive(Clone, Debug, Default)]
pub struct TileList {
    named: Vec<Named>,
    current: Vec<Named>,
    previous: Vec<Named>,
    push: Vec<TileAddress>,
    complement: Vec<TileAddress>,
    cleared: HashSet<TileAddress>,
}

/// What becomes of a tile that the map no longer names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hold {
    /// The camera moves: a tile named at this time or later is kept, so that nothing flickers.
    Since(f64),
    /// The camera rests: it is given up. Where it had come, so that it was drawn and found hidden, its
    /// bounds alone no longer bring it back (only a pixel does): a coarser surface drawn in its place is
    /// less certain of being hidden, and the two would take turns for ever.
    Clears,
}

impl TileList {
    /// Begins a reading.
    pub fn begin(&mut self) {
        self.named.clear();
    }

    /// The map names a tile; more than once is one tile, its pixels added up.
    pub fn name(&mut self, address: TileAddress, pixels: u32, ahead: bool, now: f64) {
        self.named.push(Named { address, pixels, ahead, at: now });
    }

    /// Leaves tiles that show in fewer pixels than `least` to their parents, whose samples are twice as far apart:
    /// a tile costs the same however little of it is seen. Not above the level `coarsest`, and only one level up.
    pub fn leave_to_parents(&mut self, least: u32, coarsest: u8) {
        merge_same(&mut self.named);
        for named in
            self.named.iter_mut().filter(|named| named.pixels < least && named.address.level > coarsest)
        {
            named.address = named.address.parent().unwrap_or(named.address);
        }
    }

    /// Ends a reading: what was named becomes the current list, with what is held of the last one. `is_here`
    /// says which tiles have come.
    pub fn end(&mut self, hold: Hold, is_here: impl Fn(&TileAddress) -> bool) {
        merge_same(&mut self.named);
        match hold {
            Hold::Since(_) => self.cleared.clear(),
            Hold::Clears => {
                let cleared = &self.cleared;
                self.named.retain(|named| named.pixels > 0 || !cleared.contains(&named.address));
            }
        }
        std::mem::swap(&mut self.current, &mut self.previous);
        self.current.clear();
        self.push.clear();
        self.complement.clear();
        let (mut new, mut old) = (self.named.iter().peekable(), self.previous.iter().peekable());
        loop {
            let order = match (new.peek(), old.peek()) {
                (Some(new), Some(old)) => new.address.cmp(&old.address),
                (Some(_), None) => std::cmp::Ordering::Less,
                (None, Some(_)) => std::cmp::Ordering::Greater,
                (None, None) => break,
            };
            if order.is_gt() {
                let Some(&old) = old.next() else { break };
                match hold {
                    Hold::Since(time) if old.at >= time => self.current.push(Named { pixels: 0, ..old }),
                    Hold::Clears if is_here(&old.address) => {
                        self.cleared.insert(old.address);
                        self.complement.push(old.address);
                    }
                    _ => self.complement.push(old.address),
                }
                continue;
            }
            if order.is_eq() {
                old.next();
            }
            let Some(&new) = new.next() else { break };
            self.current.push(new);
            if order.is_lt() {
                self.push.push(new.address);
            }
        }
    }

    /// What is wanted: named now, or named lately.
    pub fn current(&self) -> &[Named] {
        &self.current
    }

    /// In the current list and not in the previous one: to load, where it is not resident.
    pub fn push_list(&self) -> &[TileAddress] {
        &self.push
    }

    /// In the previous list and not in the current one: its slots are free for others.
    pub fn complement(&self) -> &[TileAddress] {
        &self.complement
    }
}

/// Sorts by address and makes one of what is the same tile.
fn merge_same(named: &mut Vec<Named>) {
    named.sort_unstable_by_key(|named| named.address);
    named.dedup_by(|later, kept| {
        let same = later.address == kept.address;
        if same {
            kept.pixels = kept.pixels.saturating_add(later.pixels);
            kept.ahead &= later.ahead;
        }
        same
    });
}

/// A cell of the seed patterns' level with vegetation in sight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PatternCell {
    /// Which seed pattern stands on it, 1 … 255.
    pub pattern: u8,
    /// The cell.
    pub address: TileAddress,
    /// Radial level, 0 … 2.
    pub radial: u8,
}

/// The cells with vegetation, grouped by pattern, so that one draw serves all that share one.
#[derive(Clone, Debug, Default)]
pub struct PatternList {
    cells: Vec<PatternCell>,
}

impl PatternList {
    /// Begins a reading.
    pub fn begin(&mut self) {
        self.cells.clear();
    }

    /// The map shows a cell.
    pub fn show(&mut self, cell: PatternCell) {
        self.cells.push(cell);
    }

    /// Ends a reading.
    pub fn end(&mut self) {
        self.cells.sort_unstable();
    }

    /// All cells, sorted by pattern, then address.
    pub fn cells(&self) -> &[PatternCell] {
        &self.cells
    }

    /// The cells of each pattern in sight.
    pub fn groups(&self) -> impl Iterator<Item = &[PatternCell]> {
        self.cells.chunk_by(|a, b| a.pattern == b.pattern)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_hardly_shows_is_left_to_its_parent() {
        let parent = TileAddress::at(12, 11.0, 47.0);
        let [first, second, third, _] = parent.children();
        let mut list = TileList::default();
        for (tile, pixels) in [(first, 4), (second, 30), (third, 5), (third.children()[2], 9), (parent, 3)] {
            list.name(tile, pixels, false, 0.0);
        }
        list.leave_to_parents(10, 12);
        list.end(Hold::Clears, |_| true);
        let found: Vec<_> = list.current().iter().map(|named| (named.address, named.pixels)).collect();
        // One level up, however few pixels there are then, and not above the coarsest.
        assert_eq!(found, [(parent, 12), (second, 30), (third, 9)]);
    }
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn tile(column: u32) -> TileAddress {
        TileAddress { level: 12, row: 5, column }
    }

    proptest! {
        /// The differences are those of sets, and a tile is held as long as it should be.
        #[test]
        fn lists_are_differences_of_sets(readings in proptest::collection::vec(proptest::collection::vec(0_u32..30, 0..20), 1..12), hold in 0_u32..4) {
            let mut list = TileList::default();
            let mut previous = BTreeSet::new();
            for (time, reading) in readings.iter().enumerate() {
                let now = time as f64;
                list.begin();
                for &column in reading {
                    list.name(tile(column), 1, false, now);
                }
                list.end(Hold::Since(now - f64::from(hold)), |_| true);
                let lately = &readings[time.saturating_sub(hold as usize)..=time];
                let expected: BTreeSet<u32> = lately.iter().flatten().copied().collect();
                let current: Vec<u32> = list.current().iter().map(|named| named.address.column).collect();
                prop_assert_eq!(&current, &expected.iter().copied().collect::<Vec<_>>());
                let columns = |tiles: &[TileAddress]| tiles.iter().map(|tile| tile.column).collect::<BTreeSet<_>>();
                prop_assert_eq!(columns(list.push_list()), &expected - &previous);
                prop_assert_eq!(columns(list.complement()), &previous - &expected);
                for named in list.current() {
                    let pixels = reading.iter().filter(|&&column| column == named.address.column).count();
                    prop_assert_eq!(named.pixels as usize, pixels);
                }
                previous = expected;
            }
        }
    }

    #[test]
    fn a_tile_in_sight_is_not_one_ahead() {
        let mut list = TileList::default();
        list.name(tile(1), 0, true, 0.0);
        list.name(tile(1), 3, false, 0.0);
        list.name(tile(2), 0, true, 0.0);
        list.end(Hold::Clears, |_| true);
        assert_eq!(list.current().iter().map(|named| named.ahead).collect::<Vec<_>>(), [false, true]);
    }

    #[test]
    fn what_was_seen_to_be_hidden_comes_back_only_for_a_pixel_or_another_view() {
        let mut list = TileList::default();
        let mut read = |tiles: &[(u32, u32)], hold| {
            list.begin();
            for &(column, pixels) in tiles {
                list.name(tile(column), pixels, false, 0.0);
            }
            list.end(hold, |tile| tile.column != 2);
            list.current().iter().map(|named| named.address.column).collect::<Vec<_>>()
        };
        assert_eq!(read(&[(1, 0), (2, 0), (3, 4)], Hold::Clears), [1, 2, 3]);
        assert_eq!(read(&[(3, 4)], Hold::Clears), [3]);
        // 2 never came: it may be asked for again.
        assert_eq!(read(&[(1, 0), (2, 0), (3, 4)], Hold::Clears), [2, 3]);
        assert_eq!(read(&[(1, 1), (3, 4)], Hold::Clears), [1, 3]);
        assert_eq!(read(&[(3, 4)], Hold::Clears), [3]);
        assert_eq!(read(&[(1, 0), (3, 4)], Hold::Since(1.0)), [1, 3]);
    }

    #[test]
    fn cells_of_one_pattern_stand_together() {
        let mut list = PatternList::default();
        for (pattern, column) in [(3, 1), (1, 2), (3, 0), (1, 9), (2, 4)] {
            list.show(PatternCell { pattern, address: tile(column), radial: 0 });
        }
        list.end();
        assert_eq!(list.groups().map(<[_]>::len).collect::<Vec<_>>(), [2, 1, 2]);
        assert_eq!(list.cells()[0], PatternCell { pattern: 1, address: tile(2), radial: 0 });
    }
}
