//! WGSL passes, their GPU struct layouts and their CPU twins.
//!
//! A pass is a list of modules, each a file of `wgsl/`, put together by [`source`]; the pass's own
//! file comes last. Modules are constants of this crate, so that there is no import to get wrong
//! at run time, and a test runs naga over every pass exactly as it is assembled.

pub mod height_field;
pub mod layout;
pub mod lighting;
pub mod load_map;
pub mod season;
pub mod trees;
pub mod twin;
pub mod undergrowth;
pub mod weather;

/// The passes, each named as its file in `wgsl/`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Pass {
    /// Compute: the pyramid of maxima (or minima) over a tile's cells, one dispatch a level.
    MaximumMip,
    /// Compute: a photo tile as blocks of BC7.
    CompressPhotoBc7,
    /// Compute: a photo tile as blocks of ASTC, 4 × 4 texels each.
    CompressPhotoAstc,
    /// Full-screen: casts a ray a pixel through the page table.
    Terrain,
    /// Full-screen: casts a ray a pixel at a height field in a plane.
    HeightField,
    /// Compute: counts and marks the load map's cells that pixels hit ([`load_map`]), and the finest mips of
    /// the pyramid of distances.
    LoadMapPixels,
    /// Compute: the pyramid's other mips, four a dispatch.
    DistanceMips,
    /// Compute: tests the boxes of the load map's cells against the pyramid, and writes the cells' words.
    LoadMapCells,
    /// Compute: the trees that are drawn one by one ([`trees`]), sorted by species and level.
    SelectTrees,
    /// Full-screen: light, shadow, sky and haze, from what [`Pass::Terrain`] wrote ([`lighting`]).
    Shade,
    /// The same over trees that are drawn one by one: the canopy gives way to the ground, and depths are written.
    ShadeTrees,
    /// The trees that [`Pass::SelectTrees`] chose.
    Trees,
    /// Compute: plants and stones near the eye ([`undergrowth`]), sorted by kind.
    SelectUndergrowth,
    /// The plants that [`Pass::SelectUndergrowth`] chose.
    Undergrowth,
}

impl Pass {
    /// All passes.
    pub const ALL: [Self; 14] = [
        Self::MaximumMip,
        Self::CompressPhotoBc7,
        Self::CompressPhotoAstc,
        Self::Terrain,
        Self::HeightField,
        Self::LoadMapPixels,
        Self::DistanceMips,
        Self::LoadMapCells,
        Self::SelectTrees,
        Self::Shade,
        Self::ShadeTrees,
        Self::Trees,
        Self::SelectUndergrowth,
        Self::Undergrowth,
    ];

    /// The pass's modules in the order in which they are put together.
    pub fn modules(self) -> &'static [&'static str] {
        match self {
            Self::MaximumMip => &[include_str!("../wgsl/maximum_mip.wgsl")],
            Self::CompressPhotoBc7 => &[include_str!("../wgsl/compress_photo_bc7.wgsl"), PHOTO_BLOCK],
            Self::CompressPhotoAstc => &[include_str!("../wgsl/compress_photo_astc.wgsl"), PHOTO_BLOCK],
            Self::Terrain => &[
                LAYOUT,
                FRAME_BINDINGS,
                FULL_SCREEN,
                include_str!("../wgsl/solid.wgsl"),
                RAY,
                PATCH,
                MAX_MIP,
                PAGE_TABLE,
                include_str!("../wgsl/terrain.wgsl"),
            ],
            Self::HeightField => &[
                LAYOUT,
                FRAME_BINDINGS,
                FULL_SCREEN,
                include_str!("../wgsl/sheet.wgsl"),
                RAY,
                PATCH,
                MAX_MIP,
                include_str!("../wgsl/height_field.wgsl"),
            ],
            Self::LoadMapPixels => &[
                LAYOUT,
                FRAME_BINDINGS,
                LOAD_MAP,
                DISTANCE_PYRAMID,
                include_str!("../wgsl/load_map_pixels.wgsl"),
            ],
            Self::DistanceMips => {
                &[LAYOUT, FRAME_BINDINGS, DISTANCE_PYRAMID, include_str!("../wgsl/distance_mips.wgsl")]
            }
            Self::LoadMapCells => &[
                LAYOUT,
                FRAME_BINDINGS,
                include_str!("../wgsl/solid.wgsl"),
                RAY,
                PAGE_TABLE,
                SEEDS,
                LOAD_MAP,
                DISTANCE_PYRAMID,
                PLACE_FROM_EYE,
                include_str!("../wgsl/load_map_box.wgsl"),
                include_str!("../wgsl/load_map_cells.wgsl"),
            ],
            Self::SelectTrees => &[
                LAYOUT,
                FRAME_BINDINGS,
                SKY,
                PHOTO,
                SHADOW,
                LIGHTING,
                SEEDS,
                PLACE_FROM_EYE,
                TREE_LAYOUT,
                LEAF_AT,
                SEASON,
                WEATHER,
                include_str!("../wgsl/tree_lights.wgsl"),
                include_str!("../wgsl/select_trees.wgsl"),
            ],
            Self::Shade => &[
                LAYOUT,
                FRAME_BINDINGS,
                FULL_SCREEN,
                SKY,
                PHOTO,
                SHADOW,
                include_str!("../wgsl/material.wgsl"),
                LIGHTING,
                SEEDS,
                CROWNS,
                CROWN_LIGHT,
                SEASON,
                CANOPY_SEASON,
                WEATHER,
                include_str!("../wgsl/forest.wgsl"),
                include_str!("../wgsl/shade.wgsl"),
            ],
            Self::ShadeTrees => &[
                LAYOUT,
                FRAME_BINDINGS,
                FULL_SCREEN,
                SKY,
                PHOTO,
                SHADOW,
                include_str!("../wgsl/material.wgsl"),
                LIGHTING,
                SEEDS,
                CROWNS,
                CROWN_LIGHT,
                SEASON,
                CANOPY_SEASON,
                WEATHER,
                include_str!("../wgsl/forest.wgsl"),
                include_str!("../wgsl/shade.wgsl"),
                LEAF_AT,
                include_str!("../wgsl/canopy_below.wgsl"),
                include_str!("../wgsl/shade_trees.wgsl"),
            ],
            Self::Trees => &[
                LAYOUT,
                FRAME_BINDINGS,
                SKY,
                LIGHTING,
                TREE_LAYOUT,
                WEATHER,
                include_str!("../wgsl/trees.wgsl"),
            ],
            Self::SelectUndergrowth => &[
                LAYOUT,
                FRAME_BINDINGS,
                SKY,
                PHOTO,
                SHADOW,
                include_str!("../wgsl/material.wgsl"),
                LIGHTING,
                SEEDS,
                METASEEDS,
                PLACE_FROM_EYE,
                UNDERGROWTH_LAYOUT,
                LEAF_AT,
                SEASON,
                WEATHER,
                include_str!("../wgsl/select_undergrowth.wgsl"),
                include_str!("../wgsl/undergrowth_lights.wgsl"),
            ],
            Self::Undergrowth => &[
                LAYOUT,
                FRAME_BINDINGS,
                SKY,
                LIGHTING,
                UNDERGROWTH_LAYOUT,
                WEATHER,
                include_str!("../wgsl/undergrowth.wgsl"),
            ],
        }
    }
}

/// The structs of [`layout`].
pub const LAYOUT: &str = include_str!("../wgsl/layout.wgsl");
/// Bind group 0.
pub const FRAME_BINDINGS: &str = include_str!("../wgsl/frame_bindings.wgsl");
/// The vertex stage of full-screen passes, `full_screen`.
pub const FULL_SCREEN: &str = include_str!("../wgsl/full_screen.wgsl");
/// View rays, and the quadratics of a leaf along a ray.
pub const RAY: &str = include_str!("../wgsl/ray.wgsl");
/// The exact bilinear patch.
pub const PATCH: &str = include_str!("../wgsl/patch.wgsl");
/// The intersector.
pub const MAX_MIP: &str = include_str!("../wgsl/max_mip.wgsl");
/// From grid coordinates to leaves, from leaf to leaf.
pub const PAGE_TABLE: &str = include_str!("../wgsl/page_table.wgsl");
/// The load map's stack and its marks.
pub const LOAD_MAP: &str = include_str!("../wgsl/load_map.wgsl");
/// Places in metres from the eye.
pub const PLACE_FROM_EYE: &str = include_str!("../wgsl/load_map_place.wgsl");
/// The structs of [`trees`].
pub const TREE_LAYOUT: &str = include_str!("../wgsl/tree_layout.wgsl");
/// Where the undergrowth's clusters stand and what is in them, as `treeline_core::seeds::metaseed` has it; needs
/// [`SEEDS`], and the pass's table of themes.
pub const METASEEDS: &str = include_str!("../wgsl/metaseeds.wgsl");
/// The structs of [`undergrowth`].
pub const UNDERGROWTH_LAYOUT: &str = include_str!("../wgsl/undergrowth_layout.wgsl");
/// The leaf at a place; needs [`PHOTO`] for the root grid.
pub const LEAF_AT: &str = include_str!("../wgsl/leaf_at.wgsl");
/// Where the pyramid of distances keeps what.
pub const DISTANCE_PYRAMID: &str = include_str!("../wgsl/distance_pyramid.wgsl");
/// A line through the colours of a block of texels; needs what a format can hold.
pub const PHOTO_BLOCK: &str = include_str!("../wgsl/photo_block.wgsl");
/// The atmosphere.
pub const SKY: &str = include_str!("../wgsl/sky.wgsl");
/// The photo through its page table.
pub const PHOTO: &str = include_str!("../wgsl/photo.wgsl");
/// What the ground keeps of the light from the ground; needs [`PHOTO`] for the root grid.
pub const SHADOW: &str = include_str!("../wgsl/shadow.wgsl");
/// Radiance of ground, snow, forest and water, and the picture's exposure; needs [`SKY`].
pub const LIGHTING: &str = include_str!("../wgsl/lighting.wgsl");
/// Where trees may stand, as `treeline_core::seeds` has it.
pub const SEEDS: &str = include_str!("../wgsl/seeds.wgsl");
/// Trees along a ray where the heights do not hold them; needs [`SEEDS`], and [`SKY`] for π.
pub const CROWNS: &str = include_str!("../wgsl/crowns.wgsl");
/// The year of species, herbs and snow; needs [`LIGHTING`].
pub const SEASON: &str = include_str!("../wgsl/season.wgsl");
/// The year in the canopy of the heights; needs [`SEASON`] and the material's nodes.
pub const CANOPY_SEASON: &str = include_str!("../wgsl/canopy_season.wgsl");
/// Wind, and the shadows of clouds.
pub const WEATHER: &str = include_str!("../wgsl/weather.wgsl");
/// Light among the crowns of [`CROWNS`]; needs [`LIGHTING`].
pub const CROWN_LIGHT: &str = include_str!("../wgsl/crown_light.wgsl");

/// The WGSL text of a pass.
pub fn source(pass: Pass) -> String {
    pass.modules().concat()
}
