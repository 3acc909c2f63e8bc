//! GPU struct layouts, each stated once: `repr(C)` here, and compared with what naga makes of the
//! WGSL by a test. Vectors of three are padded to four, and the padding is put to use.

use bytemuck::{Pod, Zeroable};
use treeline_core::ray_frame::{Quadratic, RayFrame};

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
    /// Least and greatest distance from the eye at which a ray can be in the leaf's volume, metres;
    /// the frame means nothing outside it.
    pub distance_range: [f32; 2],
}

/// What a leaf is beside its ray frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeafPlace {
    /// First cell of the leaf in its tile (u, v).
    pub first_cell: [u32; 2],
    /// Cells of the leaf along u and v.
    pub cells: [u32; 2],
    /// Fixed-point grid coordinates of the leaf's north-west corner.
    pub grid_origin: [u32; 2],
    /// Side of the leaf in the grid's units (a power of two).
    pub grid_side: u32,
    /// Layer of the tile in the elevation arrays, or [`EMPTY`].
    pub slot: u32,
    /// Matrix level of the tile.
    pub level: u8,
    /// Leaf that stands in while this one fades in, or [`EMPTY`].
    pub stand_in: u32,
    /// Upper bound of the heights in the leaf, metres.
    pub maximum: f32,
    /// 1: drawn everywhere, else the share of pixels.
    pub fade: f32,
    /// Length of a cell, metres: along u, along v.
    pub cell_metres: [f32; 2],
}

impl Leaf {
    /// The leaf as the GPU sees it: the frame's coefficients in f32, u and v at the eye split into
    /// cell and fraction before they lose digits.
    pub fn from_frame(frame: &RayFrame, place: &LeafPlace) -> Self {
        let gradient = |quadratic: &Quadratic, constant: f64| {
            let g = quadratic.gradient;
            [g.x as f32, g.y as f32, g.z as f32, constant as f32]
        };
        let second = |quadratic: &Quadratic| [0, 1, 2, 3].map(|index| quadratic.second[index] as f32);
        let (u_cell, u_fraction) = cell_and_fraction(frame.u.constant);
        let (v_cell, v_fraction) = cell_and_fraction(frame.v.constant);
        let cross = |quadratic: &Quadratic| [quadratic.second[4] as f32, quadratic.second[5] as f32];
        let (u_cross, v_cross, h_cross) = (cross(&frame.u), cross(&frame.v), cross(&frame.h));
        Self {
            u_gradient: gradient(&frame.u, u_fraction),
            v_gradient: gradient(&frame.v, v_fraction),
            h_gradient: gradient(&frame.h, frame.h.constant),
            u_second: second(&frame.u),
            v_second: second(&frame.v),
            h_second: second(&frame.h),
            uv_cross: [u_cross[0], u_cross[1], v_cross[0], v_cross[1]],
            h_cross_maximum_fade: [h_cross[0], h_cross[1], place.maximum, place.fade],
            eye_cell: [u_cell, v_cell],
            first_cell: place.first_cell,
            cells: place.cells,
            grid_origin: place.grid_origin,
            grid_side: place.grid_side,
            slot: place.slot,
            level: u32::from(place.level),
            stand_in: place.stand_in,
            cell_metres: place.cell_metres,
            distance_range: [frame.distance_range[0] as f32, frame.distance_range[1] as f32],
        }
    }
}

/// Integer cell and fraction (0 ≤ fraction < 1, in f32 too) of a coordinate in cells.
pub(crate) fn cell_and_fraction(coordinate: f64) -> (i32, f64) {
    let cell = coordinate.floor().clamp(-1.0e9, 1.0e9);
    let fraction = coordinate - cell;
    if fraction as f32 == 1.0 { (cell as i32 + 1, 0.0) } else { (cell as i32, fraction) }
}

/// Bit of [`View::flags`]: trees, their levels and the canopy take each other's places at once.
pub const HARD_SWITCH: u32 = 1;

/// Bit of [`View::flags`]: the eye is below the surface (among trees, or under the ground), so that the terrain pass
/// skips what lies wholly above a ray, where there are minima. No shader reads it.
pub const EYE_BELOW: u32 = 16;

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
    /// Bits: [`HARD_SWITCH`], [`EYE_BELOW`], [`crate::season::FLAG_SEASON`], [`crate::weather::FLAG_WIND`],
    /// [`crate::weather::FLAG_CLOUDS`].
    pub flags: u32,
    /// Counts frames, for dithering; 0 in tests.
    pub frame: u32,
    /// Place of the root grid's north-west corner, units of `treeline_core::seeds::place`.
    pub grid_place: [u32; 2],
    /// A typical tree of the scene: height in metres, radius of the crown over it.
    pub tree_size: [f32; 2],
    /// The seed that grows the scene's forest.
    pub scene_seed: u32,
    /// Share of the sky under clouds, 0 … 1. This and what follows is [`crate::weather`]'s, looked at only by variants
    /// with wind or clouds; but for `season`.
    pub clouds: f32,
    /// Zero.
    pub padding: [u32; 2],
    /// As `treeline_core::seeds::season::YearDay` has it: day, degrees beyond 47, strength of the seasons, height of
    /// the snow line (metres). Looked at only by variants with seasons.
    pub season: [f32; 4],
    /// Where the wind blows to (unit, east and north), its speed (m/s), share of the period of what sways.
    pub wind: [f32; 4],
    /// Whole lumps of gusts, east and north, of the eye's place in them.
    pub gust_cell: [i32; 2],
    /// The same of clouds.
    pub cloud_cell: [i32; 2],
    /// The rest of the eye's place, lumps of gusts.
    pub gust_part: [f32; 2],
    /// The same of clouds.
    pub cloud_part: [f32; 2],
}

/// What the height-field pass knows beside the view: bind group 0, binding 10.
///
/// Rays start on the plane `base` × forward before the eye, so that a far eye costs no digits; the one
/// leaf's constants are those of that place. Where the eye is over a cell, the cell's patch about the eye is
/// worked out in f64: beside a clearance of a millimetre, node heights in f32 are coarse.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Sheet {
    /// Height of the eye above the patch, metres; slope of the patch at the eye, metres a cell along u
    /// and v; its twist, metres a square cell.
    pub eye_patch: [f32; 4],
    /// Distance from the eye to the plane on which rays start, metres.
    pub base: f32,
    /// 1 where `eye_patch` holds.
    pub eye_patch_known: u32,
    /// Zero.
    pub padding: [u32; 2],
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
