//! GPU struct layouts, each stated once: `repr(C)` here, and compared with what naga makes of the
//! WGSL by a test. Vectors of three are padded to four, and the padding is put to use.

use bytemuck::{Pod, Zeroable};

/// An entry of the page table, or a reference to a leaf or slot, that stands for nothing.
pub const EMPTY: u32 = u32::MAX;
/// Set in an entry of the elevation page table that is a leaf; the other bits are its index in `leaves`.
pub const LEAF_BIT: u32 = 1 << 31;
/// A root tile spans 2^26 units of the grid's fixed-point coordinates along each axis; the root
/// grid has at most 64 × 64 root tiles, so a coordinate fits 32 bits.
pub const ROOT_BITS: u32 = 26;
/// Heights at or below this are voids on the GPU (WGSL may assume that there is no NaN).
pub const VOID_HEIGHT: f32 = -1.0e30;

/// One square of the page table's cut, with the ray frame of its tile (docs/ARCHITECTURE.md).
///
/// For a point x (metres, east-north-up axes at the eye, relative to the eye) the leaf's tile has
/// `u(x) = u_cell + u_gradient.w + u_gradient.xyz·x + Σ h_ij x_i x_j`, in cells of the tile from its
/// north-west node eastward; v likewise southward; h in metres, without an integer part.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Leaf {
    /// Gradient of u, and the fraction (0…1) of u at the eye.
    pub u_gradient: [f32; 4],
    /// Gradient of v, and the fraction of v at the eye.
    pub v_gradient: [f32; 4],
    /// Gradient of h, and h at the eye.
    pub h_gradient: [f32; 4],
    /// Second order of u: xx, yy, zz, xy (off-diagonal terms hold both halves).
    pub u_second: [f32; 4],
    /// Second order of v: xx, yy, zz, xy.
    pub v_second: [f32; 4],
    /// Second order of h: xx, yy, zz, xy.
    pub h_second: [f32; 4],
    /// u: xz, yz; v: xz, yz.
    pub uv_cross: [f32; 4],
    /// h: xz, yz; then the upper bound of h in the leaf; then its fade (1: drawn everywhere, else the
    /// share of pixels; the others use `stand_in`).
    pub h_cross_maximum_fade: [f32; 4],
    /// Integer part of u and v at the eye.
    pub eye_cell: [i32; 2],
    /// First cell of the leaf in its tile (u, v).
    pub first_cell: [u32; 2],
    /// Cells of the leaf along u and v.
    pub cells: [u32; 2],
    /// Fixed-point grid coordinates of the leaf's north-west corner.
    pub grid_origin: [u32; 2],
    /// Side of the leaf in the grid's units (a power of two).
    pub grid_side: u32,
    /// Layer of the tile in the elevation arrays.
    pub slot: u32,
    /// Matrix level of the tile.
    pub level: u32,
    /// Leaf that stands in while this one fades in, or [`EMPTY`].
    pub stand_in: u32,
    /// Length of a cell, metres: along u, along v.
    pub cell_metres: [f32; 2],
    /// Zero.
    pub padding: [f32; 2],
}

/// What every pass knows of the frame: bind group 0, binding 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct View {
    /// Camera's right axis × tan(half horizontal field of view), east-north-up at the eye; w: pixel angle, radians.
    pub right: [f32; 4],
    /// Camera's up axis × tan(half vertical field of view); w: height of the eye, metres.
    pub up: [f32; 4],
    /// Camera's forward axis; w: the largest height in the scene, metres.
    pub forward: [f32; 4],
    /// Direction to the sun (unit, east-north-up at the eye); w: Earth's radius of curvature at the eye, metres.
    pub sun: [f32; 4],
    /// Picture size in pixels.
    pub size: [u32; 2],
    /// Columns and rows of the root grid.
    pub root_size: [u32; 2],
    /// Grid coordinates of the eye (meaningful where `eye_inside` is 1).
    pub eye_grid: [u32; 2],
    /// 1 where the eye is over the root grid: rays start in the leaf at `eye_grid`.
    pub eye_inside: u32,
    /// 1 where the root grid goes round the Earth: columns wrap.
    pub wraps: u32,
    /// Matrix level of the root tiles.
    pub root_level: u32,
    /// Steps of the shadow march.
    pub shadow_steps: u32,
    /// What the scene has and the panel asks for, as bits (see `view.wgsl`).
    pub flags: u32,
    /// Counts frames, for dithering; 0 in tests.
    pub frame: u32,
}

/// Entry of the photo's page table: a tile that may be resident, and where its children are.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct TexturePage {
    /// Layer in the photo array, or [`EMPTY`]: then the nearest resident ancestor serves.
    pub slot: u32,
    /// Index of the first of four children (NW, NE, SW, SE), or [`EMPTY`].
    pub children: u32,
    /// Fade-in 0…1 as f32 bits.
    pub fade: u32,
    /// Zero.
    pub padding: u32,
}
