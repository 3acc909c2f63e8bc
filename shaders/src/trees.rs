//! Layouts of the `select_trees` pass, which chooses the trees that are drawn one by one.

use bytemuck::{Pod, Zeroable};
use treeline_core::seeds::Species;
use treeline_core::seeds::pattern::ROWS;

/// Levels of detail of a species, finest first.
pub const LEVELS: u32 = 4;
/// Species of a scene at most: what a byte of land cover names.
pub const MOST_SPECIES: usize = 255;
/// Columns of sub-cells that a work group looks at, all rows of them.
pub const BLOCK_COLUMNS: u32 = 8;
/// Candidates of a work group.
pub const BLOCK_SEEDS: u32 = BLOCK_COLUMNS * ROWS;

/// What decides a species' trees.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SeedSpecies {
    /// As [`Species::lowest`].
    pub lowest: u32,
    /// As [`Species::highest`].
    pub highest: u32,
    /// As [`Species::mean_height`].
    pub mean: u32,
    /// As [`Species::tallest`].
    pub tallest: u32,
    /// As [`Species::share`].
    pub share: u32,
    /// Radius of the crown over the height of the tree.
    pub crown_radius: f32,
    /// Zero.
    pub padding: [u32; 2],
}

impl From<&Species> for SeedSpecies {
    fn from(species: &Species) -> Self {
        Self {
            lowest: species.lowest,
            highest: species.highest,
            mean: species.mean_height(),
            tallest: species.tallest,
            share: species.share,
            crown_radius: species.definition.crown_radius_ratio as f32,
            padding: [0; 2],
        }
    }
}

/// A cell of the seeds' pattern that is looked at.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct SeedCell {
    /// Column and row of `treeline_core::seeds::pattern::LEVEL`.
    pub cell: [u32; 2],
    /// From the eye's whole unit of place to the cell's north-west corner, east and south.
    pub offset: [i32; 2],
    /// Layer of its land cover.
    pub slot: u32,
    /// Zero.
    pub padding: u32,
}

/// What the pass knows of a frame beside the view.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SeedFrame {
    /// Of the eye: sine and cosine of the latitude, height (metres), prime vertical radius (metres).
    pub eye: [f32; 4],
    /// Inward unit normals of the frustum's four sides, east-north-up at the eye; w: 0.
    pub sides: [[f32; 4]; 4],
    /// A tree that fills so many pixels from foot to top is drawn on the first, second and third level.
    pub level_pixels: [f32; 4],
    /// Part of a unit of place by which the eye is farther east and south than its whole one.
    pub eye_fraction: [f32; 2],
    /// Trees are drawn up to this distance, metres.
    pub range: f32,
    /// Metres of a quantum of the anchors.
    pub anchor_quantum: f32,
    /// Cells looked at.
    pub cells: u32,
    /// Work groups a cell.
    pub blocks: u32,
    /// Species of the scene.
    pub species: u32,
    /// Units of place along a cell of land cover, as a power of two.
    pub cover_bits: u32,
    /// The same along a tile of land cover.
    pub tile_bits: u32,
    /// The same along a cell of the anchors' level.
    pub anchor_bits: u32,
    /// Zero.
    pub padding: [u32; 2],
}

impl SeedFrame {
    /// Words of `decided`: candidates, with those that work groups have beyond a cell's columns.
    pub fn candidates(&self) -> u32 {
        self.cells * self.blocks * BLOCK_SEEDS
    }

    /// Bins that are drawn: levels of all species.
    pub fn bins(&self) -> u32 {
        self.species * LEVELS
    }

    /// Words of `counts`: one more bin counts every tree once.
    pub fn counts(&self) -> u32 {
        (self.bins() + 1) * self.cells * self.blocks
    }
}

/// A tree to draw.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct TreeInstance {
    /// Foot of the trunk, metres from the eye (east-north-up at the eye); height of the tree, metres.
    pub foot_height: [f32; 4],
    /// Lowest byte first: rotation (1/256 of a turn), hash, and the shares of the pixels (of 255) from which and
    /// up to which the tree is drawn on this level.
    pub look: u32,
    /// Index of its cell (from bit 10), column (from bit 5) and row of its seed.
    pub seed: u32,
    /// Anchor, quanta of the anchors' level.
    pub ground: i32,
    /// Height, 1/1024 m; [`PRIMARY`] is set but on the second of two levels of one tree; leaves and snow
    /// ([`crate::season`]) above it.
    pub height_units: u32,
    /// Reflectance of the leaves; w: share of the sun's disc that its top sees.
    pub colour: [f32; 4],
    /// Sunlight before shadow and angle; w: exposure of the picture.
    pub sun: [f32; 4],
    /// Light of the open sky over π; w: share of the sky that its top sees.
    pub sky: [f32; 4],
    /// What the air adds on the way to the eye; w: share of light that it lets through.
    pub air: [f32; 4],
}

/// Set in [`TreeInstance::height_units`] of the instance by which a tree is counted.
pub const PRIMARY: u32 = 1 << 16;

/// Arguments of an indirect draw.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Draw {
    /// Vertices of the model.
    pub vertex_count: u32,
    /// Instances, which the pass writes.
    pub instance_count: u32,
    /// 0.
    pub first_vertex: u32,
    /// 0.
    pub first_instance: u32,
}

/// Cells along a side of the window of [`TreeCells`].
pub const WINDOW_CELLS: u32 = 64;

/// What the shade pass knows of where trees are drawn one by one.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct TreeCells {
    /// Cell of the seeds' pattern at the window's north-west corner.
    pub first: [u32; 2],
    /// Trees are drawn up to this distance, metres.
    pub range: f32,
    /// Nearer than this the ground has the grain that undergrowth stands on, metres; 0 without undergrowth.
    pub turf: f32,
    /// First: 1 where the eye is below the canopy, between the trees; zeros.
    pub under: [u32; 4],
    /// A bit a cell, row by row.
    pub bits: [[u32; 4]; (WINDOW_CELLS * WINDOW_CELLS / 128) as usize],
}

impl TreeCells {
    /// Of the cells that are looked at, about the eye; a cell beyond the window keeps its canopy.
    pub fn new(cells: &[SeedCell], eye_cell: [u32; 2], range: f32) -> Self {
        let first = eye_cell.map(|cell| cell.wrapping_sub(WINDOW_CELLS / 2));
        let mut window = Self { first, range, ..Self::zeroed() };
        let last_column = (2 << treeline_core::seeds::pattern::LEVEL) - 1;
        for cell in cells {
            // Columns wrap around the Earth.
            let column = cell.cell[0].wrapping_sub(first[0]) & last_column;
            let row = cell.cell[1].wrapping_sub(first[1]);
            if column < WINDOW_CELLS && row < WINDOW_CELLS {
                let word = (2 * row + column / 32) as usize;
                window.bits[word / 4][word % 4] |= 1 << (column % 32);
            }
        }
        window
    }
}

/// What a draw knows of its model.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct TreeDraw {
    /// Bin, first corner of the level in the list of all, quads of a variant, variants.
    pub model: [u32; 4],
    /// Mean reflectance of its foliage; w: layer of the atlas.
    pub foliage: [f32; 4],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_holds_the_cells_about_the_eye() {
        let cell = |column, row| SeedCell { cell: [column, row], ..SeedCell::default() };
        let last = (2 << 17) - 1;
        let window = TreeCells::new(&[cell(last, 70), cell(3, 40), cell(90, 70)], [2, 70], 800.0);
        let set: u32 = window.bits.as_flattened().iter().map(|word| word.count_ones()).sum();
        assert_eq!(set, 2, "the third lies beyond");
        // The eye stands in column 32 of the window, the antimeridian before column 30.
        let at = |column: u32, row: u32| {
            let word = (2 * row + column / 32) as usize;
            window.bits[word / 4][word % 4] >> (column % 32) & 1
        };
        assert_eq!((at(29, 32), at(33, 2)), (1, 1));
    }
}
