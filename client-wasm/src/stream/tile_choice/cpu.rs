//! Tile choice on the CPU: a quadtree refined by screen-space error, best first.
//!
//! Refining always the tile with the largest error means that where slots run out, the error that
//! is left over is the same everywhere: nothing near is starved by something far.

use super::{Cut, CutNode};
use crate::stream::view::{ViewGeometry, Volume};
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use treeline_core::tile::{self, TileAddress};

/// What is known of the heights in a square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HeightRange {
    /// No data at all: nothing to ask for.
    Empty,
    /// All heights lie between these, metres.
    Between(f64, f64),
}

/// What may be asked for, and how fine it should be.
pub struct Limits<'a> {
    /// Tiles to begin with, always wanted.
    pub base: &'a [TileAddress],
    /// Deepest level that has anything new to show.
    pub maximum_level: u8,
    /// A cell or texel may appear as large as this, pixels.
    pub cell_pixels: f64,
    /// Never more tiles than this (base tiles excepted).
    pub capacity: usize,
    /// Lowest height of the scene, metres: what lies under the horizon of that height is hidden.
    pub lowest_height: f64,
}

struct Candidate {
    error: f64,
    address: TileAddress,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Candidate {}
impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Candidate {
    /// Largest error first; among equals the address decides, so that a cut is the same every time.
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error).then_with(|| other.address.cmp(&self.address))
    }
}

/// The error of a tile in multiples of what is allowed, or `None` where it cannot be seen.
fn error(view: &ViewGeometry, address: TileAddress, range: (f64, f64), limits: &Limits<'_>) -> Option<f64> {
    let volume = Volume::new(view, &address.bounds(), range.0, range.1);
    if volume.outside_frustum(view) || volume.below_horizon(view, limits.lowest_height) {
        return None;
    }
    let pixel_metres = volume.distance(view).max(1e-3) * view.pixel_angle;
    Some(tile::cell_metres(address.level) / pixel_metres / limits.cell_pixels)
}

/// Chooses the tiles. `range` answers what is known of a square's heights, or `Empty`, which keeps a
/// square out of the cut altogether (outside the layer, or void).
pub fn choose(
    view: &ViewGeometry,
    limits: &Limits<'_>,
    mut range: impl FnMut(TileAddress) -> HeightRange,
) -> Cut {
    let mut cut = Cut::default();
    let mut heap = BinaryHeap::new();
    for &address in limits.base {
        let HeightRange::Between(low, high) = range(address) else { continue };
        let error = error(view, address, (low, high), limits);
        cut.nodes.insert(address, CutNode { split: false, error: error.unwrap_or(0.0), sure: true });
        if let Some(error) = error {
            heap.push(Candidate { error, address });
        }
    }
    while let Some(Candidate { error: parent_error, address }) = heap.pop() {
        if parent_error <= 1.0 {
            break; // the largest is fine enough, so all are
        }
        if address.level >= limits.maximum_level {
            continue;
        }
        let mut children = [const { None }; 4];
        let mut seen = 0;
        for (slot, child) in children.iter_mut().zip(address.children()) {
            let HeightRange::Between(low, high) = range(child) else { continue };
            // A child is wanted at least as little as its parent: its volume lies in the parent's.
            if let Some(error) = error(view, child, (low, high), limits) {
                *slot = Some(Candidate { error: error.min(parent_error), address: child });
                seen += 1;
            }
        }
        if seen == 0 {
            // Its children's volumes are tighter: nothing of it is in the picture after all.
            if let Some(node) = cut.nodes.get_mut(&address) {
                node.error = 0.0;
            }
            continue;
        }
        if cut.nodes.len() + seen > limits.capacity {
            cut.limited = true;
            break;
        }
        if let Some(node) = cut.nodes.get_mut(&address) {
            node.split = true;
        }
        for candidate in children.into_iter().flatten() {
            cut.nodes.insert(candidate.address, CutNode { split: false, error: candidate.error, sure: true });
            heap.push(candidate);
        }
    }
    cut
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use treeline_core::camera::GeographicCamera;
    use treeline_core::geodesy::{self, Geodetic};

    fn view(height: f64, heading_deg: f64, pitch_deg: f64) -> ViewGeometry {
        let camera =
            GeographicCamera { lon: 11.03, lat: 47.02, height, heading_deg, pitch_deg, fov_y_deg: 50.0 };
        ViewGeometry::new(&camera, 640, 512)
    }

    fn limits(base: &[TileAddress], capacity: usize) -> Limits<'_> {
        Limits { base, maximum_level: 17, cell_pixels: 1.42, capacity, lowest_height: 0.0 }
    }

    fn base() -> Vec<TileAddress> {
        let root = TileAddress::at(7, 11.03, 47.02);
        vec![root, TileAddress { column: root.column + 1, ..root }]
    }

    proptest! {
        #[test]
        fn a_cut_is_a_tree_within_its_capacity(height in 10.0..1.0e6_f64, heading in 0.0..360.0_f64, pitch in -90.0..10.0_f64, capacity in 2_usize..200) {
            let base = base();
            let cut = choose(&view(height, heading, pitch), &limits(&base, capacity), |_| HeightRange::Between(0.0, 3_000.0));
            prop_assert!(cut.nodes.len() <= capacity);
            for (address, node) in &cut.nodes {
                if !base.contains(address) {
                    let parent = cut.nodes[&address.parent().unwrap()];
                    prop_assert!(parent.split && parent.error + 1e-9 >= node.error);
                }
                let below = address.children().iter().filter(|child| cut.nodes.contains_key(child)).count();
                prop_assert_eq!(node.split, below > 0);
            }
        }

        /// Every point of the surface in the picture lies in a leaf that is fine enough for it.
        #[test]
        fn what_is_seen_is_fine_enough(height in 500.0..20_000.0_f64, heading in 0.0..360.0_f64, pitch in -90.0..-5.0_f64, x in 0.0..1.0_f64, y in 0.0..1.0_f64) {
            let view = view(height, heading, pitch);
            let base = base();
            let cut = choose(&view, &limits(&base, 100_000), |_| HeightRange::Between(0.0, 0.0));
            // Where the ray meets height 0, by bisection from above.
            let direction = view.direction(x * 640.0, y * 512.0);
            let (mut near, mut far) = (0.0, 4.0e5);
            if view.geodetic(direction * far).height < 0.0 {
                for _ in 0..60 {
                    let middle = 0.5 * (near + far);
                    if view.geodetic(direction * middle).height > 0.0 { near = middle } else { far = middle }
                }
                let place = view.geodetic(direction * near);
                if let Some(mut tile) = base.iter().copied().find(|tile| tile.bounds().contains(place.longitude, place.latitude)) {
                    while cut.is_split(&tile) {
                        tile = TileAddress::at(tile.level + 1, place.longitude, place.latitude);
                    }
                    let pixels = tile::cell_metres(tile.level) / (near * view.pixel_angle);
                    prop_assert!(pixels <= 1.42 + 1e-9 || tile.level == 17, "{tile} {pixels}");
                }
            }
        }
    }

    #[test]
    fn where_slots_run_out_the_error_is_spread() {
        let base = base();
        let view = view(2_000.0, 30.0, -20.0);
        let free = choose(&view, &limits(&base, 10_000), |_| HeightRange::Between(0.0, 1_000.0));
        let tight = choose(&view, &limits(&base, 40), |_| HeightRange::Between(0.0, 1_000.0));
        assert!(!free.limited && tight.limited && free.nodes.len() > 40);
        let worst =
            tight.nodes.values().filter(|node| !node.split).map(|node| node.error).fold(0.0, f64::max);
        let least_split = tight
            .nodes
            .values()
            .filter(|node| node.split)
            .map(|node| node.error)
            .fold(f64::INFINITY, f64::min);
        assert!(least_split >= worst, "{least_split} {worst}");
    }

    #[test]
    fn voids_are_not_asked_for() {
        let base = base();
        let cut = choose(&view(2_000.0, 30.0, -20.0), &limits(&base, 1_000), |tile| {
            if tile.level > 10 { HeightRange::Empty } else { HeightRange::Between(0.0, 100.0) }
        });
        assert!(cut.nodes.keys().all(|tile| tile.level <= 10));
    }

    #[test]
    fn the_same_tile_whichever_way_the_eye_turns_right_under_it() {
        let place = Geodetic { longitude: 11.03, latitude: 47.02, height: 0.0 };
        assert!(geodesy::ecef_from_geodetic(place).length() > 6.0e6);
        let base = base();
        let cut =
            choose(&view(200.0, 0.0, -90.0), &limits(&base, 1_000), |_| HeightRange::Between(0.0, 10.0));
        assert!(cut.nodes.contains_key(&TileAddress::at(15, 11.03, 47.02)));
    }
}
