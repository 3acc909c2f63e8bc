//! Tile choice by the Tile Load Map: what the map names, with what stands in for it meanwhile.

use super::{Cut, CutNode};
use crate::stream::load_map::lists::{Named, TileList};
use crate::stream::residency::Pool;
use treeline_core::tile::TileAddress;

/// A tile is asked for at most this many levels below the one that is drawn in its place: the picture
/// gets finer step by step, and what a coarse surface does not hide after all is not asked for in vain.
const LEVELS_AT_ONCE: u8 = 3;
/// Largest error that counts: that many levels too coarse.
const MOST_LEVELS: i32 = 6;
/// What a tile counts for that only the eye's next place wants.
const AHEAD_WEIGHT: f64 = 0.05;

/// A tile that is wanted next.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    address: TileAddress,
    /// What is wanted in the end; the same, or below it.
    wanted: TileAddress,
    /// What it would matter if nothing at all had come: says who stays where slots run out. It does not change with
    /// what comes, or tiles would push each other out for ever.
    worth: f64,
    /// How much is wrong without it now: says what is asked for first.
    error: f64,
    /// [`CutNode::sure`].
    sure: bool,
    /// Whether it fills pixels: what stands in for it is on the screen.
    seen: bool,
    /// Tiles that will be asked for on the way before the one that is wanted.
    stops: usize,
}

impl Step {
    /// What is drawn in its place: itself, or until it comes the finest that is there.
    fn drawn(&self, pool: &Pool) -> Option<TileAddress> {
        if pool.is_known(&self.address) {
            pool.resident(&self.address).map(|_| self.address)
        } else {
            pool.nearest(self.address).map(|(tile, _)| tile)
        }
    }
}

/// What a layer may ask for.
pub struct Layer<'a> {
    /// Tiles that are always wanted.
    pub base: &'a [TileAddress],
    /// What is resident.
    pub pool: &'a Pool,
    /// Never more tiles than this (base tiles excepted).
    pub capacity: usize,
}

/// Makes the cut of a layer from its list, in the memory of the last one. `has` says whether there may
/// be anything in a square at all.
pub fn choose(
    cut: &mut Cut,
    list: &TileList,
    layer: &Layer<'_>,
    scratch: &mut Vec<Step>,
    has: impl Fn(TileAddress) -> bool,
) {
    cut.nodes.clear();
    cut.limited = false;
    for &address in layer.base {
        cut.nodes.insert(address, CutNode { split: false, error: 0.0, sure: true });
    }
    scratch.clear();
    scratch.extend(list.current().iter().filter(|named| has(named.address)).map(|named| step(named, layer)));
    // What is not sure to be needed is not asked for before all that is: it must not take the slots of that.
    scratch.sort_unstable_by(|a, b| {
        let order = b.sure.cmp(&a.sure).then_with(|| b.worth.total_cmp(&a.worth));
        order.then_with(|| a.wanted.cmp(&b.wanted))
    });
    // What is on the screen stays, whatever else comes.
    for step in scratch.iter().filter(|step| step.seen) {
        if cut.nodes.len() < layer.capacity
            && let Some(tile) = step.drawn(layer.pool)
        {
            cut.nodes.entry(tile).or_insert(CutNode { split: false, error: 0.0, sure: true });
        }
    }
    // Each tile is promised a slot, and one more for every stop on its way down, which will be drawn meanwhile. What is
    // promised never grows as tiles come: who is in stays in, and others follow.
    let mut promised = cut.nodes.len();
    for step in scratch.iter() {
        let &Step { address, error, sure, stops, .. } = step;
        let stand_in = step.drawn(layer.pool).filter(|&tile| tile != address);
        let new = [Some((address, error, sure)), stand_in.map(|tile| (tile, 0.0, true))];
        promised += new.iter().flatten().filter(|(tile, ..)| !cut.nodes.contains_key(tile)).count() + stops;
        if promised > layer.capacity {
            cut.limited = true;
            break;
        }
        for (tile, error, sure) in new.into_iter().flatten() {
            let node = cut.nodes.entry(tile).or_insert(CutNode { split: false, error, sure });
            node.error = node.error.max(error);
            node.sure |= sure;
        }
    }
    mark_split(cut, scratch);
}

/// What is asked for now on the way to a tile, and how much it matters: pixels times how many times too
/// coarse they are drawn.
fn step(named: &Named, layer: &Layer<'_>) -> Step {
    let wanted = named.address;
    let drawn = layer.pool.nearest(wanted).map_or(0, |(tile, _)| tile.level);
    let known = layer.pool.is_known(&wanted);
    let too_coarse =
        |level: u8| f64::from((i32::from(wanted.level) - i32::from(level)).min(MOST_LEVELS)).exp2();
    let weight = if named.ahead { AHEAD_WEIGHT } else { 1.0 };
    // A tile of which only a corner shows has no pixel's centre, and still counts.
    let pixels = (f64::from(named.pixels) + 0.5) * weight;
    let level = if known { wanted.level } else { wanted.level.min(drawn.saturating_add(LEVELS_AT_ONCE)) };
    Step {
        address: wanted.ancestor(level).unwrap_or(wanted),
        wanted,
        worth: pixels * too_coarse(layer.base.first().map_or(0, |tile| tile.level)),
        error: pixels * too_coarse(drawn),
        sure: named.pixels > 0 || named.ahead,
        seen: named.pixels > 0,
        stops: usize::from((wanted.level - level).div_ceil(LEVELS_AT_ONCE)),
    }
}

/// Marks the tiles that have others below them.
fn mark_split(cut: &mut Cut, scratch: &mut Vec<Step>) {
    scratch.clear();
    scratch.extend(cut.nodes.keys().map(|&address| Step {
        address,
        wanted: address,
        worth: 0.0,
        error: 0.0,
        sure: true,
        seen: true,
        stops: 0,
    }));
    for &Step { address, .. } in scratch.iter() {
        let mut next = address.parent();
        while let Some(ancestor) = next {
            if let Some(node) = cut.nodes.get_mut(&ancestor) {
                if node.split {
                    break;
                }
                node.split = true;
            }
            next = ancestor.parent();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::load_map::lists::Hold;
    use crate::stream::residency::Placement;
    use proptest::prelude::*;
    use std::collections::HashSet;

    fn chosen(pool: &Pool, list: &TileList, base: &[TileAddress], capacity: usize) -> Cut {
        let mut cut = Cut::default();
        choose(&mut cut, list, &Layer { base, pool, capacity }, &mut Vec::new(), |_| true);
        cut
    }

    fn list(tiles: &[(TileAddress, u32)]) -> TileList {
        let mut list = TileList::default();
        for &(address, pixels) in tiles {
            list.name(address, pixels, false, 0.0);
        }
        list.end(Hold::Clears, |_| true);
        list
    }

    fn hold(pool: &mut Pool, tile: TileAddress) {
        pool.place(tile, &HashSet::from([tile]));
    }

    #[test]
    fn the_way_down_is_taken_in_steps_and_what_is_drawn_stays() {
        let deep = TileAddress::at(17, 11.0, 47.0);
        let base = deep.ancestor(10).unwrap();
        let mut pool = Pool::new(32);
        hold(&mut pool, base);
        let list = list(&[(deep, 9)]);
        for level in [13, 16, 17] {
            let cut = chosen(&pool, &list, &[base], 32);
            let next = deep.ancestor(level).unwrap();
            assert!(cut.nodes.contains_key(&next) && cut.is_split(&base) && !cut.is_split(&next));
            let drawn = pool.nearest(deep).unwrap().0;
            assert!(cut.nodes.contains_key(&drawn), "{drawn} is drawn meanwhile");
            assert!(cut.nodes.len() <= 3);
            hold(&mut pool, next);
        }
        assert_eq!(chosen(&pool, &list, &[base], 32).nodes.len(), 2, "nothing stands in any more");
    }

    #[test]
    fn where_slots_run_out_the_most_visible_stay() {
        let base = TileAddress::at(12, 11.0, 47.0);
        let mut pool = Pool::new(8);
        hold(&mut pool, base);
        let below: Vec<TileAddress> = base.children().iter().flat_map(TileAddress::children).collect();
        let tiles: Vec<(TileAddress, u32)> = below.iter().copied().zip(0..).collect();
        let cut = chosen(&pool, &list(&tiles), &[base], 8);
        assert!(cut.limited && cut.nodes.len() == 8);
        assert!(below[9..].iter().all(|tile| cut.nodes.contains_key(tile)));
    }

    proptest! {
        /// Whatever stands in the slots from the view before, and whoever comes first: it ends.
        #[test]
        fn where_slots_run_out_nothing_comes_and_goes_for_ever(
            capacity in 4_usize..40,
            pixels in proptest::collection::vec(0_u32..4, 1..48),
            before in proptest::collection::vec((0.0..90.0_f64, 2_u8..=10), 0..40),
            turns in proptest::collection::vec(0_usize..40, 1..9),
        ) {
            let base = TileAddress::at(1, 11.0, 47.0);
            let tiles: Vec<(TileAddress, u32)> = pixels
                .iter()
                .enumerate()
                .map(|(index, &pixels)| (TileAddress::at(10, 1.0 + 1.8 * index as f64, 47.0), pixels))
                .collect();
            let mut pool = Pool::new(capacity as u32);
            hold(&mut pool, base);
            for (longitude, level) in before {
                let tile = TileAddress::at(level, longitude, 47.0);
                pool.place(tile, &HashSet::from([base, tile]));
            }
            // At most every tile once on each of four steps down.
            for came in 0.. {
                let cut = chosen(&pool, &list(&tiles), &[base], capacity);
                let wanted: HashSet<TileAddress> = cut.nodes.keys().copied().collect();
                prop_assert!(wanted.len() <= capacity);
                let mut missing: Vec<TileAddress> = wanted.iter().filter(|tile| !pool.is_known(tile)).copied().collect();
                if missing.is_empty() { break; }
                missing.sort_unstable();
                let next = missing[turns[came % turns.len()] % missing.len()];
                prop_assert_ne!(pool.place(next, &wanted).0, Placement::NoRoom);
                prop_assert!(came <= 4 * tiles.len(), "{} slots: it never ends", capacity);
            }
        }
    }

    #[test]
    fn a_large_error_on_few_pixels_waits_for_a_small_one_on_many() {
        let base = TileAddress::at(10, 11.0, 47.0);
        let mut pool = Pool::new(64);
        hold(&mut pool, base);
        let near = base.children()[0];
        let far = base.children()[3].children()[1].children()[0];
        let cut = chosen(&pool, &list(&[(near, 1_000), (far, 10)]), &[base], 64);
        assert!(cut.nodes[&near].error > cut.nodes[&far].error);
    }

    #[test]
    fn nothing_is_asked_for_where_there_is_nothing() {
        let base = TileAddress::at(10, 11.0, 47.0);
        let mut pool = Pool::new(64);
        hold(&mut pool, base);
        let tiles = list(&[(base.children()[0], 3), (base.children()[1], 3)]);
        let mut cut = Cut::default();
        let layer = Layer { base: &[base], pool: &pool, capacity: 64 };
        choose(&mut cut, &tiles, &layer, &mut Vec::new(), |tile| tile != base.children()[1]);
        assert_eq!(cut.nodes.len(), 2);
    }
}
