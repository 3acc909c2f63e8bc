//! Land cover as trees see it: the cells of the quadtree's level 1 over a window.

use super::RecipeError;
use crate::scene::Scene;
use crate::source::{Cover, SampleGrid};
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::scene::LandCoverLevels;
use treeline_core::seeds::place::{POLE_TO_POLE, UNIT_LEVEL};
use treeline_core::seeds::{Stand, Window};
use treeline_core::tile::{CELLS, rows};

/// Level-1 cells of a window of places.
pub struct Stands {
    shift: u32,
    first_column: i64,
    first_row: i64,
    width: usize,
    cells: Vec<Cover>,
}

impl Stands {
    /// Reads the cells that a window touches; `None` where the scene knows of no cover there.
    pub fn read(
        scene: &Scene,
        levels: &LandCoverLevels,
        window: &Window,
    ) -> Result<Option<Self>, RecipeError> {
        let Some(cover) = &scene.cover else { return Ok(None) };
        let shift = u32::from(UNIT_LEVEL - levels.l1);
        let (north, south) = (window.north.max(0), window.south.min(POLE_TO_POLE));
        if north >= south || window.west >= window.east {
            return Ok(None);
        }
        let (first_column, first_row) = (window.west >> shift, north >> shift);
        let lattice = LatticeWindow {
            level: levels.l1,
            registration: Registration::Cell,
            first_column,
            first_row,
            width: (((window.east - 1) >> shift) - first_column + 1) as u32,
            height: (((south - 1) >> shift) - first_row + 1) as u32,
        };
        if !cover.extent().bounds.intersects(&lattice.pixel_box()) {
            return Ok(None);
        }
        let mut cells = vec![Cover::default(); lattice.len()];
        cover.sample(&SampleGrid::Lattice(lattice), &mut cells)?;
        Ok(Some(Self { shift, first_column, first_row, width: lattice.width as usize, cells }))
    }

    /// Index of the cell's column of a place; places must lie in the window.
    pub fn column(&self, x: i64) -> usize {
        ((x >> self.shift) - self.first_column) as usize
    }

    /// The row of cells of a place; outside the poles the nearest.
    pub fn row(&self, y: i64) -> &[Cover] {
        let last = self.cells.len() / self.width - 1;
        let row = ((y >> self.shift) - self.first_row).clamp(0, last as i64) as usize;
        &self.cells[row * self.width..(row + 1) * self.width]
    }

    /// What grows at a place in the window.
    pub fn stand(&self, x: i64, y: i64) -> Stand {
        stand_of(self.row(y)[self.column(x)])
    }

    /// Whether any cell has a species.
    pub fn any_species(&self) -> bool {
        self.cells.iter().any(|cover| cover.species != 0)
    }
}

/// The part of a cover that decides trees.
pub fn stand_of(cover: Cover) -> Stand {
    Stand { species: cover.species, closure: cover.closure, height: cover.height }
}

/// The cover of each cell of a window of the lattice's cells, whatever its level: the class of the
/// level-1 cell that holds its middle (south-east of it where the middle is a corner), so that a
/// place has the same class on every level.
pub fn cover_of_cells(
    scene: &Scene,
    levels: &LandCoverLevels,
    cells: &LatticeWindow,
) -> Result<Vec<Cover>, RecipeError> {
    let mut out = vec![Cover::default(); cells.len()];
    let Some(cover) = &scene.cover else { return Ok(out) };
    if !cover.extent().bounds.intersects(&cells.pixel_box()) {
        return Ok(out);
    }
    if cells.level < levels.l1 {
        // Pixels of a box of the same step, moved by half a level-1 cell.
        let bounds = cells.pixel_box();
        let half = 90.0 / f64::from(CELLS) / (1_u64 << levels.l1) as f64;
        let moved = SampleGrid::Box {
            crs: crate::source::RequestCrs::Geographic,
            west: bounds.west + half,
            south: bounds.south - half,
            east: bounds.east + half,
            north: bounds.north - half,
            width: cells.width,
            height: cells.height,
        };
        cover.sample(&moved, &mut out)?;
        return Ok(out);
    }
    let shift = cells.level - levels.l1;
    let last_row = i64::from(rows(levels.l1)) * i64::from(CELLS) - 1;
    let row_of = |row: i64| (row >> shift).clamp(0, last_row);
    let (first_column, first_row) = (cells.first_column >> shift, row_of(cells.first_row));
    let window = LatticeWindow {
        level: levels.l1,
        registration: Registration::Cell,
        first_column,
        first_row,
        width: (((cells.first_column + i64::from(cells.width) - 1) >> shift) - first_column + 1) as u32,
        height: (row_of(cells.first_row + i64::from(cells.height) - 1) - first_row + 1) as u32,
    };
    let mut own = vec![Cover::default(); window.len()];
    cover.sample(&SampleGrid::Lattice(window), &mut own)?;
    for (row, line) in out.chunks_exact_mut(cells.width as usize).enumerate() {
        let source_row = (row_of(cells.first_row + row as i64) - first_row) as usize;
        let source = &own[source_row * window.width as usize..(source_row + 1) * window.width as usize];
        for (column, cell) in line.iter_mut().enumerate() {
            *cell = source[(((cells.first_column + column as i64) >> shift) - first_column) as usize];
        }
    }
    Ok(out)
}
