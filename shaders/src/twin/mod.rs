//! The passes on the CPU, in f32: the functions of `wgsl/`, file by file and name by name.
//!
//! The texts follow each other line by line, so that they can be compared; nothing here is made
//! clever. Production uses them where the answer is wanted without the GPU: the height under the camera, the
//! place under the pointer, the rays that a frame missed.

pub mod compress_photo_astc;
pub mod compress_photo_bc7;
pub mod crown_light;
pub mod crowns;
pub mod distance_pyramid;
pub mod height_field;
pub mod leaf_at;
pub mod load_map;
pub mod load_map_box;
pub mod load_map_cells;
pub mod load_map_pixels;
pub mod load_map_place;
pub mod max_mip;
pub mod maximum_mip;
pub mod page_table;
pub mod patch;
pub mod photo;
pub mod photo_block;
pub mod ray;
pub mod select_trees;
pub mod select_undergrowth;
pub mod shadow;
pub mod sky;
pub mod terrain;
pub mod weather;

use crate::layout::{Leaf, Sheet, View};

/// What the texture arrays hold.
pub trait Texels {
    /// A height, metres; the texel counts the border. At or below `VOID_HEIGHT`: a void.
    fn height(&self, slot: u32, x: i32, y: i32) -> f32;
    /// A texel of a mip of the maxima.
    fn maximum(&self, slot: u32, mip: u32, x: i32, y: i32) -> f32;
    /// A texel of a mip of the minima; asked for only where the world says so.
    fn minimum(&self, slot: u32, mip: u32, x: i32, y: i32) -> f32;
    /// Mips of the maxima.
    fn levels(&self) -> u32;
}

/// What a pass has bound.
#[derive(Clone, Copy)]
pub struct World<'a, T: Texels> {
    /// The frame.
    pub view: &'a View,
    /// The page table.
    pub nodes: &'a [u32],
    /// Its leaves.
    pub leaves: &'a [Leaf],
    /// The arrays.
    pub texels: &'a T,
    /// The height field's own, where this is one: a sheet without border; otherwise solid ground with
    /// a border of one.
    pub sheet: Option<&'a Sheet>,
    /// The pipeline constant of that name.
    pub use_minima: bool,
}

impl<T: Texels> World<'_, T> {
    pub(crate) fn solid(&self) -> bool {
        self.sheet.is_none()
    }

    pub(crate) fn border(&self) -> i32 {
        i32::from(self.solid())
    }
}
