//! The Tile Load Map's layout: what its pass is told of a frame, and what it answers a cell.
//!
//! The map is a stack: [`MAPS`] square maps of [`SIDE`] × [`SIDE`] cells, one for each matrix level
//! in use, each centred on the viewer. A cell of the map of a level is a tile of that level. In all
//! 65,536 cells, the 256 × 256 of Amara, Meunier and Marsault (ISVC 2007, section 4.1), at a cost
//! that depends on neither the scene's size nor the deepest level.
//!
//! A cell's answer is one word, their four features (visibility, smallest and largest texture level,
//! radial level) with flags in the bits that are left over; beside it stands the number of pixels
//! whose centre's ray hits the cell and wants its level.

use bytemuck::{Pod, Zeroable};

/// Maps in the stack.
pub const MAPS: u32 = 16;
/// Cells along a map's side.
pub const SIDE: u32 = 64;
/// Cells of the whole stack, map by map, row-major from the north-west.
pub const CELLS: u32 = MAPS * SIDE * SIDE;
/// Cells of a tile's side that are tested one by one: boxes of sub-cells.
pub const SUB_CELLS: u32 = 8;

/// Bits 0–7 of a cell: 0 hidden or outside; else visible, on the map of the patterns' level with the
/// seed pattern's index, on others 1.
pub const VISIBLE: u32 = 0xff;
/// Bits 8–15: 255 − the smallest texture level that a visible part of the cell wants (inverted,
/// so that the largest of two values is the union). On the coarsest map it may be coarser than the
/// map's own level.
pub const SMALLEST_SHIFT: u32 = 8;
/// Bits 16–23: the largest texture level that a visible part of the cell wants.
pub const LARGEST_SHIFT: u32 = 16;
/// Bits 24–25: radial level, 0 to 2 by [`RADIAL_METRES`]; 3: no vegetation.
pub const RADIAL_SHIFT: u32 = 24;
/// Set where a visible part of the cell wants exactly the cell's own level.
pub const WANTED: u32 = 1 << 26;
/// Set where the cell would be wanted from where the eye will soon be ([`LoadMapFrame::look_ahead`]).
pub const AHEAD: u32 = 1 << 27;
/// Set where a visible part of the cell blends into its level's texels from the next finer level: wanted
/// too, but not the level of any pixel. The part of the next finer band that blends is the farthest
/// 2^−[`BLEND_LEVELS`].
pub const BLENDED: u32 = 1 << 28;
/// Part of a level over which the photo blends into the coarser one (`twin::photo::PHOTO_BLEND`).
pub const BLEND_LEVELS: f32 = crate::twin::photo::PHOTO_BLEND;
/// Distances that end the radial levels 0, 1 and 2, metres.
pub const RADIAL_METRES: [f32; 3] = [700.0, 1_400.0, 3_000.0];

/// One map of the stack.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct LoadMapLevel {
    /// The map's north-west cell, counted in cells of its level from the root grid's north-west
    /// corner. Where the grid goes round the Earth and has more columns than the map, columns wrap; else
    /// cells that lie outside the grid are hidden.
    pub first: [i32; 2],
    /// The eye's place in the map, cells from the map's north-west corner.
    pub eye: [f32; 2],
    /// Distances from the eye (metres) at which a point wants this level: from the first, up to but
    /// not including the second.
    pub band: [f32; 2],
    /// Angle of a cell's side, radians.
    pub span: f32,
    /// Matrix level.
    pub level: u32,
}

/// What the pass knows beside the frame's bind group 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LoadMapFrame {
    /// Of the eye: sine and cosine of the latitude, height (metres), prime vertical radius (metres).
    pub eye: [f32; 4],
    /// Where the eye will be when what is asked for now has come: offset in metres, east-north-up at
    /// the eye; w: 1 where that is to be looked at.
    pub look_ahead: [f32; 4],
    /// Least and greatest height of the scene, metres.
    pub heights: [f32; 2],
    /// Maps in use; they stand for the levels from the coarsest, [`LoadMapLevel::level`] of the first, on.
    pub maps: u32,
    /// The map of the seed patterns' level, or `u32::MAX` where vegetation is of no interest.
    pub pattern_map: u32,
    /// The seed that grows the scene's forest.
    pub scene_seed: u32,
    /// Angle that a texel may fill, radians: 1.42 pixels by default.
    pub texel_angle: f32,
    /// Deepest level of the elevation: where a coarser tile is drawn for now, finer ground may rise above it.
    /// 0 where it never does.
    pub elevation_level: u32,
    /// Distance, metres, from which a level coarser than the coarsest map's would do; twice that for the next
    /// coarser one, and so on.
    pub coarser_from: f32,
    /// The maps, coarsest first.
    pub levels: [LoadMapLevel; MAPS as usize],
}

impl Default for LoadMapFrame {
    fn default() -> Self {
        Self::zeroed()
    }
}
