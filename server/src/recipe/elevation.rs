//! Bare terrain.

use super::encode::{self, own};
use super::{Format, RecipeError, TileRequest};
use crate::scene::Scene;
use crate::source::SampleGrid;
use treeline_core::codec::elevation::{ElevationTile, MAXIMA_BLOCK_CELLS};
use treeline_core::grid::LatticeWindow;
use treeline_core::tile::CELLS;

/// Blocks along a tile's side that carry a conservative maximum.
pub(super) const BLOCKS: u32 = CELLS / MAXIMA_BLOCK_CELLS;

/// The tile in the format asked for.
pub fn make(scene: &Scene, request: &TileRequest) -> Result<Vec<u8>, RecipeError> {
    match request.format {
        Format::Own => {
            let window = own::tile_window(request)?;
            let heights = sample(scene, &request.grid)?;
            let maxima = scene.height.maxima(&tile_box(&window), BLOCKS, BLOCKS)?;
            Ok(own::elevation_tile(&window, &heights, &maxima, None).encode())
        }
        _ => encode::heights(request, &sample(scene, &request.grid)?),
    }
}

/// A decoded tile: what [`make`] packs as [`Format::Own`], for callers in process.
pub fn tile(scene: &Scene, window: &LatticeWindow) -> Result<ElevationTile, RecipeError> {
    let heights = sample(scene, &SampleGrid::Lattice(*window))?;
    let maxima = scene.height.maxima(&tile_box(window), BLOCKS, BLOCKS)?;
    Ok(own::elevation_tile(window, &heights, &maxima, None))
}

/// The terrain on a grid, metres, NaN for no data.
pub(super) fn sample(scene: &Scene, grid: &SampleGrid) -> Result<Vec<f32>, RecipeError> {
    let mut heights = vec![f32::NAN; grid.len()];
    scene.height.sample(grid, &mut heights)?;
    Ok(heights)
}

/// The box of the tile that a bordered window is of, or of the window itself.
pub(super) fn tile_box(window: &LatticeWindow) -> treeline_core::tile::GeographicBox {
    window.as_tile().map_or_else(|| window.pixel_box(), |(address, _)| address.bounds())
}
