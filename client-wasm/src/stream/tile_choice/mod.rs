//! Which tiles a view wants.

pub mod cpu;
pub mod load_map;

use std::collections::HashMap;
use treeline_core::tile::TileAddress;

/// Who chooses the tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TileChoice {
    /// The Tile Load Map: the GPU says what is in sight, and the answer is read back.
    #[default]
    LoadMap,
    /// A quadtree refined on the CPU by screen-space error, without occlusion.
    Cpu,
}

/// A layer's tiles that a view wants: a quadtree, cut where it is fine enough.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cut {
    /// Every tile wanted, inner ones (which stand in while finer ones come) and leaves.
    pub nodes: HashMap<TileAddress, CutNode>,
    /// Whether slots ran out before every tile was fine enough.
    pub limited: bool,
}

/// A tile of a cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutNode {
    /// Whether finer tiles are wanted below.
    pub split: bool,
    /// Error on the screen if this tile were not refined, in multiples of what is allowed.
    pub error: f64,
    /// Whether it is known to be needed: a pixel's ray wants it, or the eye's next place will. Else its bounds
    /// alone say that it may be in sight, over a surface that may still be too coarse to hide it.
    pub sure: bool,
}

impl Cut {
    /// Whether finer tiles are wanted below the square.
    pub fn is_split(&self, address: &TileAddress) -> bool {
        self.nodes.get(address).is_some_and(|node| node.split)
    }
}
