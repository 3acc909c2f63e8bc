//! Layouts of the passes that select and draw the undergrowth ([`treeline_core::seeds::metaseed`]).

use bytemuck::{Pod, Zeroable};
use treeline_core::seeds::metaseed::{Community, theme};

/// Draws: the kinds of members, and grass that is not near.
pub const BINS: u32 = treeline_core::seeds::metaseed::KINDS as u32 + 1;
/// The draw of grass that is not near.
pub const FAR_GRASS: u32 = BINS - 1;
/// Sub-cells along a side of a block.
pub const BLOCK_SIDE: u32 = 8;
/// Metaseeds of a block at most: threads of its work group.
pub const BLOCK_SEEDS: u32 = BLOCK_SIDE * BLOCK_SIDE;

/// A block of metaseeds that is looked at.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct UndergrowthBlock {
    /// Column and row of its cell of the seeds' pattern.
    pub cell: [u32; 2],
    /// From the eye's whole unit of place to the cell's north-west corner, east and south.
    pub offset: [i32; 2],
    /// Its first sub-cell of metaseeds: column and row.
    pub first: [u32; 2],
    /// Columns of metaseeds in the cell.
    pub columns: u32,
    /// Zero.
    pub padding: u32,
}

/// What the passes know of a frame beside the view.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct UndergrowthFrame {
    /// Of the eye: sine and cosine of the latitude, height (metres), prime vertical radius (metres).
    pub eye: [f32; 4],
    /// Inward unit normals of the frustum's four sides, east-north-up at the eye; w: 0.
    pub sides: [[f32; 4]; 4],
    /// Part of a unit of place by which the eye is farther east and south than its whole one.
    pub eye_fraction: [f32; 2],
    /// Nothing grows farther than this from the eye, metres.
    pub range: f32,
    /// Up to this distance the canopy of the heights gives way to trees, metres; 0 where it does not.
    pub canopy_gone: f32,
    /// Blocks looked at.
    pub blocks: u32,
    /// Zero.
    pub padding: u32,
    /// Zero.
    pub more_padding: [u32; 2],
}

/// A plant (or a stone) to draw.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Plant {
    /// Foot, metres from the eye (east-north-up at the eye); size as far as it has grown, metres.
    pub foot_size: [f32; 4],
    /// Lowest byte first: rotation (1/256 of a turn), hash, kind; then community and colour of the blossoms, 4 bits
    /// each.
    pub look: u32,
    /// Block (from bit 12), place of the metaseed in it (from bit 6), number of the member.
    pub seed: u32,
    /// East and south of the cell's north-west corner, units, 16 bits each, over [`PLACE_ZERO`].
    pub place: u32,
    /// Size in 1/1024 m; from bit 16 on how far it has grown, from bit 24 on the snow on it, of 255.
    pub size: u32,
    /// Roots of its reflectance, and the share of the sun's disc that it sees: bytes.
    pub colour: u32,
    /// Normal of the ground and share of the sky, signed bytes.
    pub ground: u32,
    /// Zero.
    pub padding: [u32; 2],
}

/// What [`Plant::place`] says of the cell's corner.
pub const PLACE_ZERO: i32 = 8_192;

/// What light falls on all of it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct PlantLight {
    /// Sunlight before shadow and angle; w: exposure of the picture.
    pub sun: [f32; 4],
    /// Light of the open sky over π; w: 0.
    pub sky: [f32; 4],
    /// What 100 m of air add; w: share of light that they let through.
    pub air: [f32; 4],
}

/// Arguments of an indexed indirect draw.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct IndexedDraw {
    /// Indices of the model.
    pub index_count: u32,
    /// Instances, which the pass writes.
    pub instance_count: u32,
    /// First index of the model in the list of all.
    pub first_index: u32,
    /// 0.
    pub base_vertex: i32,
    /// 0.
    pub first_instance: u32,
}

/// The draws, a last one that counts metaseeds, and the light.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct UndergrowthDraws {
    /// Of each bin; of the last one `instance_count` is the number of metaseeds.
    pub draws: [IndexedDraw; BINS as usize + 1],
    /// Which the pass writes.
    pub light: PlantLight,
}

/// What a draw knows of its model.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct PlantDraw {
    /// Bin, first corner in the list of all, corners of a variant, variants.
    pub model: [u32; 4],
}

/// The communities' themes as the shader reads them: eight a community.
pub fn themes() -> [[u32; 4]; 32] {
    let communities = [Community::Wood, Community::Meadow, Community::Open, Community::Rock];
    std::array::from_fn(|index| theme(communities[index / 8], index as u32 % 8))
}
