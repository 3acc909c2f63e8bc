//! Treeline's own elevation tiles from metres.

use crate::recipe::elevation::BLOCKS;
use crate::recipe::{RecipeError, TileRequest};
use crate::source::SampleGrid;
use treeline_core::codec::elevation::{
    CANOPY_QUANTUM_METRES, ElevationTile, MAXIMA_BLOCK_CELLS, Surface, VOID, lattice_above_metres,
    quantum_metres,
};
use treeline_core::grid::LatticeWindow;

/// The window of a request in a format of ours: it must be a tile of the layer's registration.
pub fn tile_window(request: &TileRequest) -> Result<LatticeWindow, RecipeError> {
    match request.grid {
        SampleGrid::Lattice(window)
            if window.as_tile().is_some() && window.registration == request.layer.row().registration =>
        {
            Ok(window)
        }
        _ => Err(RecipeError::NotATile { format: request.format.media_type(request.layer) }),
    }
}

/// Heights on a level's lattice: nearest, ties away from zero, [`VOID`] for what is not finite.
pub fn lattice(metres: &[f32], level: u8) -> Vec<i32> {
    // A quantum is a power of two: scaling an f32 as f64 and adding a half are exact, and so this
    // is `lattice_from_metres` without a call per node.
    let scale = 1.0 / quantum_metres(level);
    metres
        .iter()
        .map(|&metres| {
            if !metres.is_finite() {
                return VOID;
            }
            let value = f64::from(metres) * scale;
            (value + 0.5_f64.copysign(value)) as i32
        })
        .collect()
}

/// The combined map's extra planes, before they are on the lattice.
pub struct CombinedPlanes<'a> {
    /// Bare terrain, metres.
    pub terrain: &'a [f32],
    /// Surface type codes.
    pub types: Vec<u8>,
    /// Codes of the canopy's species, where anything grows.
    pub species: Option<Vec<u8>>,
}

/// A tile from heights and bounds in metres. Bounds are raised to the tile's own nodes, and
/// rounded up.
pub fn elevation_tile(
    window: &LatticeWindow,
    metres: &[f32],
    maxima: &[f32],
    combined: Option<CombinedPlanes>,
) -> ElevationTile {
    let level = window.level;
    let heights = lattice(metres, level);
    let side = window.width as usize;
    let border = window.as_tile().map_or(0, |(_, border)| border as usize);
    let mut maxima: Vec<i32> =
        maxima.iter().map(|&metres| lattice_above_metres(f64::from(metres), level)).collect();
    raise_to_nodes(&heights, side, border, &mut maxima);
    let surface = combined.map(|planes| {
        let canopy_per_quantum = quantum_metres(level) as f32 / CANOPY_QUANTUM_METRES;
        let canopy = lattice(planes.terrain, level)
            .iter()
            .zip(&heights)
            .map(|(&terrain, &height)| {
                if terrain == VOID || height == VOID {
                    return 0;
                }
                // Saturates at a byte's 63.75 m.
                ((height - terrain) as f32 * canopy_per_quantum + 0.5) as u8
            })
            .collect();
        Surface { types: planes.types, canopy, species: planes.species }
    });
    ElevationTile { level, side: side as u32, heights, maxima_side: BLOCKS, maxima, surface }
}

/// Raises each block's bound to the nodes on and within its edges.
fn raise_to_nodes(heights: &[i32], side: usize, border: usize, maxima: &mut [i32]) {
    let (blocks, cells) = (BLOCKS as usize, MAXIMA_BLOCK_CELLS as usize);
    for row in 0..=blocks * cells {
        let line = &heights[(row + border) * side + border..][..blocks * cells + 1];
        for block in 0..blocks {
            // VOID is the least i32.
            let highest = line[block * cells..=(block + 1) * cells].iter().copied().fold(VOID, i32::max);
            // A row on the edge of two blocks counts for both.
            for block_row in [row.checked_sub(1).map(|row| row / cells), Some(row / cells)] {
                if let Some(bound) = block_row
                    .filter(|&block_row| block_row < blocks)
                    .map(|block_row| &mut maxima[block_row * blocks + block])
                {
                    *bound = highest.max(*bound);
                }
            }
        }
    }
}
