//! The ground under trees: elevation nodes of one fixed level of the matrix, the same whatever terrain is drawn.
//!
//! A trunk stands on the bilinear patch of the four nodes around it, to the nearest quantum of their level's
//! lattice, in integers: server, CPU and GPU agree on every bit.

use super::place::{POLE_TO_POLE, UNIT_LEVEL};
use super::tree::Window;
use crate::codec::elevation::{VOID, quantum_metres};
use crate::grid::{LatticeWindow, Registration};

/// Anchors stand on no coarser level: a place within a cell then has 15 bits, and a patch's weights fit a word.
pub const COARSEST_LEVEL: u8 = 7;
/// Nor on a finer one: nodes are 1.2 m apart.
pub const FINEST_LEVEL: u8 = 15;

/// Units of place along the side of a cell of a level, as a power of two; the level is an anchor level.
pub fn cell_bits(level: u8) -> u32 {
    u32::from(UNIT_LEVEL - level.clamp(COARSEST_LEVEL, FINEST_LEVEL))
}

/// The window of nodes that the trees of a window of places stand on.
pub fn window(level: u8, places: &Window) -> LatticeWindow {
    let shift = cell_bits(level);
    let first_column = places.west >> shift;
    let first_row = places.north.max(0) >> shift;
    LatticeWindow {
        level,
        registration: Registration::Node,
        first_column,
        first_row,
        // Two nodes for every cell that the window touches.
        width: (((places.east - 1) >> shift) + 2 - first_column).max(2) as u32,
        height: (((places.south.min(POLE_TO_POLE) - 1) >> shift) + 2 - first_row).max(2) as u32,
    }
}

/// Height of the patch between four nodes (north-west, north-east, south-west, south-east; quanta) at an offset
/// within their cell of 2^`bits` units: the nearest quantum, [`VOID`] beside a void.
pub fn between(nodes: [i32; 4], offset: [u32; 2], bits: u32) -> i32 {
    if nodes.contains(&VOID) {
        return VOID;
    }
    let [north_west, north_east, south_west, south_east] = nodes.map(i64::from);
    let (u, v) = (i64::from(offset[0]), i64::from(offset[1]));
    let cell = 1_i64 << bits;
    let north = north_west * (cell - u) + north_east * u;
    let south = south_west * (cell - u) + south_east * u;
    let sum = north * (cell - v) + south * v;
    ((sum + (cell * cell / 2)) >> (2 * bits)) as i32
}

/// Nodes of the anchor level over a window, in quanta of its lattice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Anchors {
    /// Which nodes.
    pub window: LatticeWindow,
    /// Row-major from the north-west, [`VOID`] for no data.
    pub quanta: Vec<i32>,
}

impl Anchors {
    /// Height of the ground under a place of the window, quanta; `None` beside a void and outside.
    pub fn height(&self, x: i64, y: i64) -> Option<i32> {
        let bits = cell_bits(self.window.level);
        let column = usize::try_from((x >> bits) - self.window.first_column).ok()?;
        let row = usize::try_from((y >> bits) - self.window.first_row).ok()?;
        let (width, height) = (self.window.width as usize, self.window.height as usize);
        if column + 1 >= width || row + 1 >= height {
            return None;
        }
        let first = row * width + column;
        let nodes = [first, first + 1, first + width, first + width + 1].map(|index| self.quanta[index]);
        let mask = (1_i64 << bits) - 1;
        let ground = between(nodes, [(x & mask) as u32, (y & mask) as u32], bits);
        (ground != VOID).then_some(ground)
    }
}

/// Metres of a height in quanta of an anchor level (exact).
pub fn metres(quanta: i32, level: u8) -> f32 {
    (f64::from(quanta) * quantum_metres(level)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_patch_is_the_bilinear_one(
            nodes: [i16; 4], level in COARSEST_LEVEL..=FINEST_LEVEL, u in 0.0..1.0_f64, v in 0.0..1.0_f64,
        ) {
            let bits = cell_bits(level);
            let side = f64::from(1_u32 << bits);
            let offset = [(u * side) as u32, (v * side) as u32];
            let nodes = nodes.map(i32::from);
            let found = between(nodes, offset, bits);
            let [a, b, c, d] = nodes.map(f64::from);
            let (x, y) = (f64::from(offset[0]) / side, f64::from(offset[1]) / side);
            let exact = (a * (1.0 - x) + b * x) * (1.0 - y) + (c * (1.0 - x) + d * x) * y;
            prop_assert!((f64::from(found) - exact).abs() <= 0.5 + 1e-6, "{found} {exact}");
            prop_assert_eq!(between([VOID, 0, 0, 0], offset, bits), VOID);
        }
    }

    #[test]
    fn a_window_holds_every_place_of_it() {
        for level in [COARSEST_LEVEL, 12, FINEST_LEVEL] {
            let places = Window { west: -40_000, north: 1 << 29, east: 90_001, south: (1 << 29) + 70_000 };
            let window = window(level, &places);
            let anchors = Anchors { window, quanta: (0..window.len() as i32).collect() };
            for (x, y) in [(places.west, places.north), (places.east - 1, places.south - 1)] {
                assert!(anchors.height(x, y).is_some());
            }
            let beyond = i64::from(window.width) << cell_bits(level);
            assert_eq!(anchors.height(places.west + beyond, places.north), None);
            assert_eq!(anchors.height(places.west - beyond, places.north), None);
        }
    }
}
