//! Twin of `load_map.wgsl`: the stack and its marks; and the passes of the Tile Load Map one after the other.

use super::distance_pyramid::{DistancePyramid, mip_count};
use super::load_map_cells::{choose_cells, test_sub_cell, write_cell};
use super::load_map_pixels::mark_pixels;
use super::{Texels, World};
use crate::layout::{EMPTY, ROOT_BITS};
use crate::load_map::{CELLS, LoadMapFrame, RADIAL_METRES, SIDE, SUB_CELLS};
use glam::{IVec2, UVec2};

/// Cells of a map.
pub const MAP_CELLS: u32 = SIDE * SIDE;
/// A distance that nothing reaches, metres.
pub const ENDLESS: f32 = 3.0e38;
/// Wanted from where the eye will be.
pub const MARK_AHEAD: u32 = 8;
/// Something visible wants the cell's own level.
pub const MARK_WANTED: u32 = 16;
/// Bits of the radial levels.
pub const MARK_RADIAL: u32 = 7;
/// First bit of how many levels coarser what wants the coarsest map's level would have it.
pub const MARK_COARSER: u32 = 5;
/// The most of it.
pub const MOST_COARSER: u32 = 9;
/// A pixel of the next finer level blends into this cell's texels.
pub const MARK_BLENDED: u32 = 0x8000;
/// Share of a band's far end at which that begins: 2^−`load_map::BLEND_LEVELS`.
pub const BLENDS_FROM: f32 = 0.840_896_4;
/// First bit of the visible levels, counted from the coarsest map's.
pub const MARK_LEVELS: u32 = 16;

/// What the passes share: what is bound, and the cells' marks.
pub struct LoadMap<'a, T: Texels> {
    /// The frame's bind group, whose sizes are those of the picture.
    pub world: World<'a, T>,
    /// The stack.
    pub stack: &'a LoadMapFrame,
    /// Marks, in the end words.
    pub cells: Vec<u32>,
    /// Pixels of each cell.
    pub pixels: Vec<u32>,
    /// Distances of the picture.
    pub pyramid: DistancePyramid,
    /// Cells whose boxes are tested.
    pub candidates: Vec<u32>,
}

impl<'a, T: Texels> LoadMap<'a, T> {
    /// All passes over a picture: distances (metres, negative: a miss) and hits as the terrain pass writes them,
    /// row-major.
    pub fn of_picture(
        world: World<'a, T>,
        stack: &'a LoadMapFrame,
        distances: &[f32],
        hits: &[[u32; 4]],
    ) -> Self {
        let size = UVec2::from_array(world.view.size);
        let mut map = Self {
            world,
            stack,
            cells: vec![0; CELLS as usize],
            pixels: vec![0; CELLS as usize],
            pyramid: DistancePyramid::new(size),
            candidates: Vec::new(),
        };
        mark_pixels(&mut map, distances, hits);
        for mip in 1..mip_count(size) {
            map.pyramid.derive(mip);
        }
        for index in 0..stack.maps * MAP_CELLS {
            choose_cells(&mut map, index);
        }
        for candidate in 0..map.candidates.len() {
            let index = map.candidates[candidate];
            // Sub-cells run at once on the GPU; what one of them sees of another's marks saves work, no more.
            for sub_cell in 0..SUB_CELLS * SUB_CELLS {
                let place = UVec2::new(sub_cell % SUB_CELLS, sub_cell / SUB_CELLS);
                test_sub_cell(&mut map, index, place);
            }
        }
        for index in 0..CELLS {
            write_cell(&mut map, index);
        }
        map
    }

    /// The map whose level a point at a distance wants.
    pub fn map_at(&self, distance: f32) -> u32 {
        let mut map = 0;
        while map + 1 < self.stack.maps && distance < self.stack.levels[map as usize].band[0] {
            map += 1;
        }
        map
    }

    /// How many levels coarser than the coarsest map's a point at a distance wants.
    pub fn levels_coarser(&self, distance: f32) -> u32 {
        let (mut count, mut reach) = (0, self.stack.coarser_from);
        while count < MOST_COARSER && distance >= reach {
            count += 1;
            reach *= 2.0;
        }
        count
    }

    /// Marks of what wants a map's level from one distance to another.
    pub fn wanted_marks(&self, map: u32, near: f32, far: f32) -> u32 {
        let own = (1 << (MARK_LEVELS + map)) | radial_mark(near);
        if map > 0 {
            return own;
        }
        own | ((2 << self.levels_coarser(far)) - (1 << self.levels_coarser(near))) << MARK_COARSER
    }

    /// Bits of a grid coordinate below a map's cell.
    pub fn cell_bits(&self, map: u32) -> u32 {
        let level = self.stack.levels[map as usize].level;
        ROOT_BITS - (level.wrapping_sub(self.world.view.root_level)).min(ROOT_BITS)
    }

    /// Cells of the grid along a row of a map's level.
    pub fn grid_columns(&self, map: u32) -> u32 {
        self.world.view.root_size[0] << (ROOT_BITS - self.cell_bits(map))
    }

    /// Whether the maps of a level go on across the grid's edge.
    pub fn wrapped(&self, map: u32, mut cell: IVec2) -> IVec2 {
        let columns = self.grid_columns(map) as i32;
        if self.world.view.wraps == 1 && columns > SIDE as i32 {
            cell.x %= columns;
            if cell.x < 0 {
                cell.x += columns;
            }
        }
        cell
    }

    /// Where a place's cell stands in a map.
    pub fn place_in_map(&self, map: u32, grid: UVec2) -> IVec2 {
        let cell = (grid >> UVec2::splat(self.cell_bits(map))).as_ivec2();
        self.wrapped(map, cell - IVec2::from_array(self.stack.levels[map as usize].first))
    }

    /// Index of the cell that holds a place, on the map or the next coarser one that has it; `EMPTY` where none has.
    pub fn cell_index(&self, finest: u32, grid: UVec2) -> u32 {
        for map in (0..=finest).rev() {
            let place = self.place_in_map(map, grid);
            if place.cmpge(IVec2::ZERO).all() && place.cmplt(IVec2::splat(SIDE as i32)).all() {
                return map * MAP_CELLS + place.y as u32 * SIDE + place.x as u32;
            }
        }
        EMPTY
    }

    /// Joins marks to a cell's.
    pub fn mark_cell(&mut self, index: u32, marks: u32) {
        self.cells[index as usize] |= marks;
    }
}

/// The radial level's bit; none beyond the last.
pub fn radial_mark(distance: f32) -> u32 {
    if distance >= RADIAL_METRES[2] {
        return 0;
    }
    1 << (u32::from(distance >= RADIAL_METRES[0]) + u32::from(distance >= RADIAL_METRES[1]))
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_photo_and_the_map_blend_over_the_same_part_of_a_level() {
        let from = (-crate::load_map::BLEND_LEVELS).exp2();
        assert!((super::BLENDS_FROM - from).abs() < 1e-6);
    }
}
