//! Land cover seen in a picture: a photo, or a topographic map with its forest tint.
//!
//! Pictures are judged on the matrix's lattice, in blocks with a margin: on the finest level whose cells
//! are no finer than the picture's pixels, or on a coarser one where a grid's samples lie far apart. What a
//! cell is told to be depends on its global indices alone, so that no block shows a seam. Blocks are kept
//! as long as there is room.

mod features;
pub mod map;
mod model;
mod number;
pub mod photo;
mod smoothing;
mod statistics;
#[cfg(test)]
mod tests;
mod tint;

use super::crs::Crs;
use super::geotiff::cache::{MakerCache, Weigh};
use super::geotiff::georeference::Affine;
use super::geotiff::image::Rect;
use super::growth::altitude_at_47_degrees;
use super::placement::Placement;
use super::projector::Projector;
use super::window::View;
use super::{ColourField, Cover, CoverField, FieldExtent, HeightField, SampleGrid, SourceError};
use std::sync::Arc;
use treeline_core::geodesy;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::tile::{CELLS, cell_metres, level_for_cell_metres, span_degrees};

/// Cells along a block's side.
const SIDE: i64 = 128;
/// Bytes of blocks that are kept.
const BLOCK_BYTES: usize = 64 << 20;
/// Cells are no finer than this, metres: below it a picture shows parts of trees.
const FINEST_CELL_METRES: f64 = 4.0;
/// Windows along each side, and cells along theirs, by which a picture is known before all of it is read.
const PROBES: i64 = 8;
const PROBE_CELLS: i64 = 32;

/// Tells what lies at each cell of a patch of a picture.
pub trait Judge: Send + Sync {
    /// Cells around a patch that must be seen to judge it.
    fn margin(&self) -> u32;

    /// Whether it looks at the ground's height and slope.
    fn needs_terrain(&self) -> bool;

    /// The cover of every cell of a patch but its margin, row by row.
    ///
    /// # Errors
    /// Where other parts of the picture are needed and cannot be read.
    fn judge(&self, picture: &Picture, patch: &Patch) -> Result<Vec<Cover>, SourceError>;
}

/// A picture and the terrain below it.
pub struct Picture {
    colour: Arc<dyn ColourField>,
    height: Option<Arc<dyn HeightField>>,
    finest: u8,
}

/// A window of a level's cells, and what is seen there.
pub struct Patch {
    /// Which cells.
    pub window: LatticeWindow,
    /// Their colours; alpha 0 where there is no picture.
    pub colours: Vec<[u8; 4]>,
    /// Heights of the ground, metres; NaN where they are not known.
    pub heights: Vec<f32>,
    /// By row: metres between cells along it, and what to add to a height for that of its climate at 47°.
    rows: Vec<(f32, f32)>,
}

impl Patch {
    /// What is seen in a window of cells.
    pub fn new(window: LatticeWindow, colours: Vec<[u8; 4]>, heights: Vec<f32>) -> Self {
        let step = window.step_degrees() * geodesy::EQUATOR_METRES / 360.0;
        let rows = (0..i64::from(window.height))
            .map(|row| window.latitude(window.first_row + row))
            .map(|latitude| {
                let along = step * latitude.to_radians().cos().abs().max(1e-3);
                (along as f32, altitude_at_47_degrees(0.0, latitude))
            })
            .collect();
        Self { window, colours, heights, rows }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.window.width as usize
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.window.height as usize
    }

    /// Metres between cells along a row, and between rows.
    pub fn spacing(&self, row: usize) -> (f32, f32) {
        (self.rows[row].0, (self.window.step_degrees() * geodesy::EQUATOR_METRES / 360.0) as f32)
    }

    /// The height at 47° whose climate a height in a row has, metres.
    pub fn altitude(&self, row: usize, height: f32) -> f32 {
        height + self.rows[row].1
    }

    /// Whether nothing is seen.
    pub fn is_empty(&self) -> bool {
        self.colours.iter().all(|colour| colour[3] == 0)
    }
}

impl Picture {
    fn new(colour: Arc<dyn ColourField>, height: Option<Arc<dyn HeightField>>) -> Self {
        let metres = colour.extent().resolution_metres.max(FINEST_CELL_METRES);
        Self { finest: level_for_cell_metres(metres), colour, height }
    }

    /// What is seen in a window of cells.
    ///
    /// # Errors
    /// Where the picture or the terrain cannot be read.
    pub fn patch(&self, window: LatticeWindow) -> Result<Patch, SourceError> {
        let grid = SampleGrid::Lattice(window);
        let mut colours = vec![[0; 4]; window.len()];
        self.colour.sample(&grid, &mut colours)?;
        let mut heights = vec![f32::NAN; window.len()];
        if let Some(height) = &self.height
            && colours.iter().any(|colour| colour[3] != 0)
        {
            height.sample(&grid, &mut heights)?;
        }
        Ok(Patch::new(window, colours, heights))
    }

    /// Patches spread evenly over the picture, on its finest level.
    ///
    /// # Errors
    /// As [`Self::patch`].
    pub fn probes(&self) -> Result<Vec<Patch>, SourceError> {
        let (column, row, width, height) = cells_of(self.colour.extent(), self.finest);
        let mut patches = Vec::new();
        for j in 0..PROBES {
            for i in 0..PROBES {
                let along = |index: i64, size: i64| (size - PROBE_CELLS).max(0) * index / (PROBES - 1);
                let patch = self.patch(LatticeWindow {
                    level: self.finest,
                    registration: Registration::Cell,
                    first_column: column + along(i, width),
                    first_row: row + along(j, height),
                    width: width.min(PROBE_CELLS) as u32,
                    height: height.min(PROBE_CELLS) as u32,
                })?;
                patches.push(patch);
            }
        }
        Ok(patches)
    }
}

/// First column and row, columns and rows of a level's cells that a field touches.
fn cells_of(extent: &FieldExtent, level: u8) -> (i64, i64, i64, i64) {
    let step = span_degrees(level) / f64::from(CELLS);
    let (west, north) =
        (((extent.bounds.west + 180.0) / step).floor(), ((90.0 - extent.bounds.north) / step).floor());
    let east = ((extent.bounds.east + 180.0) / step).ceil();
    let south = ((90.0 - extent.bounds.south) / step).ceil();
    (west as i64, north as i64, (east - west).max(1.0) as i64, (south - north).max(1.0) as i64)
}

struct Block(Vec<Cover>);

impl Weigh for Block {
    fn bytes(&self) -> usize {
        // With the cache's own bookkeeping.
        self.0.len() * size_of::<Cover>() + 256
    }
}

/// Cover by a judge of a picture.
pub struct PictureCover {
    picture: Picture,
    judge: Box<dyn Judge>,
    extent: FieldExtent,
    blocks: MakerCache<(u8, i64, i64), Block, SourceError>,
}

impl PictureCover {
    /// Judges a picture; without terrain its judge sees heights of NaN.
    pub fn new(
        colour: Arc<dyn ColourField>,
        height: Option<Arc<dyn HeightField>>,
        judge: Box<dyn Judge>,
    ) -> Self {
        let picture = Picture::new(colour, height.filter(|_| judge.needs_terrain()));
        let extent =
            FieldExtent { resolution_metres: cell_metres(picture.finest), ..picture.colour.extent().clone() };
        Self { picture, judge, extent, blocks: MakerCache::new(BLOCK_BYTES) }
    }

    fn block(&self, level: u8, column: i64, row: i64) -> Result<Arc<Block>, SourceError> {
        self.blocks.get((level, column, row), || {
            let margin = i64::from(self.judge.margin());
            let side = (SIDE + 2 * margin) as u32;
            let patch = self.picture.patch(LatticeWindow {
                level,
                registration: Registration::Cell,
                first_column: column * SIDE - margin,
                first_row: row * SIDE - margin,
                width: side,
                height: side,
            })?;
            if patch.is_empty() {
                return Ok(Block(vec![Cover::default(); (SIDE * SIDE) as usize]));
            }
            self.judge.judge(&self.picture, &patch).map(Block)
        })
    }

    /// Covers of a window of a level's cells.
    fn cells(&self, level: u8, column: i64, row: i64, rect: Rect) -> Result<Vec<Cover>, SourceError> {
        let (left, top) = (column + i64::from(rect.x), row + i64::from(rect.y));
        let (right, bottom) = (left + i64::from(rect.width), top + i64::from(rect.height));
        let mut out = vec![Cover::default(); rect.len()];
        for block_row in top.div_euclid(SIDE)..=(bottom - 1).div_euclid(SIDE) {
            for block_column in left.div_euclid(SIDE)..=(right - 1).div_euclid(SIDE) {
                let block = self.block(level, block_column, block_row)?;
                let (west, north) = (block_column * SIDE, block_row * SIDE);
                let (from, to) = (left.max(west), right.min(west + SIDE));
                for y in top.max(north)..bottom.min(north + SIDE) {
                    let source = ((y - north) * SIDE + from - west) as usize;
                    let target = (y - top) as usize * rect.width as usize + (from - left) as usize;
                    let count = (to - from) as usize;
                    out[target..target + count].copy_from_slice(&block.0[source..source + count]);
                }
            }
        }
        Ok(out)
    }

    /// The place of a level's cells as if they were a raster of their own; none where there is no picture.
    fn placement(&self, level: u8) -> Option<(Placement, i64, i64)> {
        let (column, row, width, height) = cells_of(self.picture.colour.extent(), level);
        let step = span_degrees(level) / f64::from(CELLS);
        let affine = Affine {
            x: (column as f64 * step - 180.0, step, 0.0),
            y: (90.0 - row as f64 * step, 0.0, -step),
        };
        Placement::new(Crs::wgs84(), affine, width as u32, height as u32)
            .ok()
            .map(|placement| (placement, column, row))
    }

    /// Levels from the finest to the one whose cells are judged for samples so many finest cells apart.
    fn coarser(&self, step: (f64, f64)) -> u8 {
        let apart = step.0.min(step.1).max(1.0);
        (apart.log2() - 1.0).clamp(0.0, f64::from(self.picture.finest)) as u8
    }
}

impl CoverField for PictureCover {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        out.fill(Cover::default());
        let Some((placement, ..)) = self.placement(self.picture.finest) else { return Ok(()) };
        let level = self.picture.finest - self.coarser(Projector::new(&placement, grid).pixels_per_sample());
        let Some((placement, column, row)) = self.placement(level) else { return Ok(()) };
        let view = View::of_placement(&placement);
        let width = grid.size().0 as usize;
        view.visit(&Projector::new(&placement, grid), grid.size(), &mut |block| {
            if block.is_outside() {
                return Ok(());
            }
            let window = view.fetch(block, |rect| self.cells(level, column, row, rect))?;
            let (left, top) = (block.window_origin.0 as f64, block.window_origin.1 as f64);
            for line in 0..block.size.1 {
                let start = (block.origin.1 + line) as usize * width + block.origin.0 as usize;
                for (target, &(u, v)) in out[start..].iter_mut().zip(block.row(line)) {
                    if !u.is_nan() {
                        // Half a cell belongs to the cell that begins there.
                        let (x, y) = ((u + 0.5).floor() - left, (v + 0.5).floor() - top);
                        *target = window[y as usize * block.window_size.0 as usize + x as usize];
                    }
                }
            }
            Ok(())
        })
    }
}
