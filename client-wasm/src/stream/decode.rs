//! From a tile's bytes to what the GPU takes and what the CPU keeps of it.

use super::requests::FetchFailure;
use std::sync::Arc;
use treeline_core::codec::elevation::{self, ElevationTile, MAXIMA_BLOCK_CELLS, VOID};
use treeline_core::codec::land_cover::{LandCoverTile, Step};
use treeline_core::seeds::season;
use treeline_core::tile::{CELLS, TileAddress};
use treeline_shaders::layout::VOID_HEIGHT;
use treeline_shaders::season::SPECIES_SHIFT;

/// Nodes along a side of an elevation tile with its border.
pub const ELEVATION_SIDE: u32 = CELLS + 3;
/// Texels along a side of a photo tile with its border.
pub const TEXTURE_SIDE: u32 = CELLS + 8;
/// Blocks along a side of the CPU's summaries.
const BLOCKS: u32 = CELLS / MAXIMA_BLOCK_CELLS;
const BORDER: u32 = 1;
/// Unit of canopy heights on the wire and in the surface texture.
const CANOPY_METRES: f32 = 0.25;

/// A decoded elevation tile.
#[derive(Clone, Debug)]
pub struct ElevationPixels {
    /// Surface type (and from its fourth bit on the canopy's species) and canopy height (quarter metres), 515 × 515
    /// pairs; `None` for bare terrain.
    pub surface: Option<Vec<u8>>,
    /// What the CPU keeps.
    pub summary: ElevationSummary,
}

impl ElevationPixels {
    /// Whether any node has canopy.
    pub fn grows(&self) -> bool {
        self.surface.iter().flat_map(|pairs| pairs.as_chunks::<2>().0).any(|&[_, canopy]| canopy > 0)
    }
}

/// What the CPU keeps of an elevation tile while it is resident.
#[derive(Clone, Debug)]
pub struct ElevationSummary {
    /// 515 × 515 heights in metres, border included, voids [`VOID_HEIGHT`].
    pub heights: Arc<[f32]>,
    /// 64 × 64: greatest height of the tile's own surface in each block of 8 × 8 cells, −∞ for none.
    own_maxima: Vec<f32>,
    /// 64 × 64: bound of everything below the block on every level, −∞ where there is nothing.
    deep_maxima: Vec<f32>,
    /// Least height of the tile's own surface, metres.
    minimum: f32,
    /// 64 × 64: least and greatest height of the ground below the canopy in each block, metres; empty for bare terrain.
    ground: Vec<[f32; 2]>,
}

impl ElevationSummary {
    /// Whether nothing is there, on this level or deeper.
    pub fn is_empty(&self) -> bool {
        self.deep_maxima.iter().chain(&self.own_maxima).all(|&value| value == f32::NEG_INFINITY)
    }

    /// Least height of the tile's own surface, metres; +∞ where it has none.
    pub fn minimum(&self) -> f32 {
        self.minimum
    }

    /// Greatest height of the tile's own surface in the square of cells, metres; −∞ for none.
    /// Conservative: whole blocks count.
    pub fn own_maximum(&self, first: (f64, f64), side: f64) -> f32 {
        largest(&self.own_maxima, first, side)
    }

    /// Bound of all heights below the square of cells on every level, metres; −∞ for none.
    pub fn deep_maximum(&self, first: (f64, f64), side: f64) -> f32 {
        largest(&self.deep_maxima, first, side).max(self.own_maximum(first, side))
    }

    /// Whether there is anything in the square of cells, on any level. Conservative: whole blocks count.
    pub fn holds(&self, first: (f64, f64), side: f64) -> bool {
        let any = |blocks: &[f32]| {
            let mut rows = block_rows(first, side);
            rows.any(|row| blocks[row].iter().any(|&value| value > f32::NEG_INFINITY))
        };
        any(&self.deep_maxima) || any(&self.own_maxima)
    }

    /// A summary of a world between two heights, for tests that need no samples.
    #[cfg(test)]
    pub fn between(minimum: f32, maximum: f32) -> Self {
        let blocks = (BLOCKS * BLOCKS) as usize;
        Self {
            heights: Arc::new([]),
            own_maxima: vec![maximum; blocks],
            deep_maxima: vec![maximum; blocks],
            minimum,
            ground: Vec::new(),
        }
    }

    /// Between which heights the ground below the canopy lies in the block of 8 × 8 cells at (u, v) in cells, metres;
    /// `None` where there is none, or where the tile does not tell ground and canopy apart.
    pub fn ground_between(&self, u: f64, v: f64) -> Option<[f32; 2]> {
        let block = |cell: f64| ((cell / f64::from(MAXIMA_BLOCK_CELLS)) as usize).min(BLOCKS as usize - 1);
        let bounds = self.ground.get(block(v) * BLOCKS as usize + block(u))?;
        (bounds[0] <= bounds[1]).then_some(*bounds)
    }

    /// Whether the tile has a canopy that rises over a height (metres) in the square of cells; `None` where it does not
    /// tell ground and canopy apart. Conservative: whole blocks count.
    pub fn has_canopy_over(&self, height: f32, first: (f64, f64), side: f64) -> Option<bool> {
        if self.ground.is_empty() {
            return None;
        }
        let first = (first.0.max(0.0), first.1.max(0.0));
        Some(block_rows(first, side).flatten().any(|block| {
            let (top, [_, ground]) = (self.own_maxima[block], self.ground[block]);
            top > height && top - ground > LEAST_CANOPY
        }))
    }

    /// Height by the bilinear patch at (u, v) in cells from the tile's north-west node; `None` in a void.
    pub fn height(&self, u: f64, v: f64) -> Option<f64> {
        let limit = f64::from(CELLS - 1);
        let (column, row) = (u.floor().clamp(0.0, limit), v.floor().clamp(0.0, limit));
        let (x, y) = ((u - column).clamp(0.0, 1.0), (v - row).clamp(0.0, 1.0));
        let node = |i: u32, j: u32| {
            let index = (row as u32 + BORDER + j) * ELEVATION_SIDE + column as u32 + BORDER + i;
            let height = self.heights[index as usize];
            (height > VOID_HEIGHT).then_some(f64::from(height))
        };
        let (a, b, c, d) = (node(0, 0)?, node(1, 0)?, node(0, 1)?, node(1, 1)?);
        Some((a * (1.0 - x) + b * x) * (1.0 - y) + (c * (1.0 - x) + d * x) * y)
    }
}

/// Over the ground of its block by more than this, a surface is a canopy's, metres.
const LEAST_CANOPY: f32 = 2.0;

/// A decoded tile of land cover, on the level that decides trees.
#[derive(Clone, Debug)]
pub struct LandCoverPixels {
    /// 512 × 512: species, closure, height of the stand, 0.
    pub stands: Vec<u8>,
    /// The ground under the trees, quanta of the anchors' level, row-major.
    pub anchors: Vec<i32>,
    /// Columns and rows of the anchors.
    pub anchor_side: u32,
    /// Codes of the species that grow there.
    pub species: Vec<u8>,
}

/// Decodes a tile of land cover and checks that it is the one that was asked for. `anchors`: level of the anchors,
/// and how many they are along a side.
pub fn land_cover(
    bytes: &[u8],
    address: TileAddress,
    anchors: (u8, u32),
) -> Result<LandCoverPixels, FetchFailure> {
    let tile = LandCoverTile::decode(bytes).map_err(|error| FetchFailure::Temporary(error.to_string()))?;
    let (level, side) = anchors;
    let unexpected = |what: String| {
        FetchFailure::Permanent(format!(
            "the server's tile of land cover has {what}; this client expects another"
        ))
    };
    if tile.level != address.level || tile.side != CELLS || tile.step != Step::Classes {
        return Err(unexpected(format!("level {}, {} cells a side", tile.level, tile.side)));
    }
    let mut grow = [false; 256];
    tile.codes.iter().for_each(|&code| grow[code as usize & 255] = true);
    let species: Vec<u8> = (1..=255).filter(|&code| grow[usize::from(code)]).collect();
    if species.is_empty() {
        return Ok(LandCoverPixels { stands: Vec::new(), anchors: Vec::new(), anchor_side: side, species });
    }
    let (Some(stands), Some(nodes)) = (tile.stands, tile.anchors) else {
        return Err(unexpected("no stands or no anchors".to_owned()));
    };
    if nodes.level != level || nodes.width != side || nodes.height != side {
        return Err(unexpected(format!(
            "{} × {} anchors of level {}",
            nodes.width, nodes.height, nodes.level
        )));
    }
    let cells = tile.codes.iter().zip(&stands.closures).zip(&stands.heights);
    let stands = cells.flat_map(|((&code, &closure), &height)| [code as u8, closure, height, 0]).collect();
    Ok(LandCoverPixels { stands, anchors: nodes.quanta, anchor_side: side, species })
}

fn largest(blocks: &[f32], first: (f64, f64), side: f64) -> f32 {
    block_rows(first, side).flat_map(|row| &blocks[row]).copied().fold(f32::NEG_INFINITY, f32::max)
}

/// The blocks that a square of cells touches: ranges of indices, row by row.
fn block_rows(first: (f64, f64), side: f64) -> impl Iterator<Item = std::ops::RangeInclusive<usize>> {
    let block = |cell: f64| ((cell / f64::from(MAXIMA_BLOCK_CELLS)) as usize).min(BLOCKS as usize - 1);
    // The last cell of the square, not the first of the next.
    let (x0, x1) = (block(first.0), block((first.0 + side).ceil() - 1.0));
    let (y0, y1) = (block(first.1), block((first.1 + side).ceil() - 1.0));
    (y0..=y1).map(move |y| y * BLOCKS as usize + x0..=y * BLOCKS as usize + x1)
}

/// Decodes an elevation tile and checks that it is the one that was asked for.
pub fn elevation(bytes: &[u8], address: TileAddress) -> Result<ElevationPixels, FetchFailure> {
    let tile = ElevationTile::decode(bytes).map_err(|error| FetchFailure::Temporary(error.to_string()))?;
    if tile.level != address.level || tile.side != ELEVATION_SIDE || tile.maxima_side != BLOCKS {
        return Err(FetchFailure::Permanent(format!(
            "the server's tile has level {}, {} nodes and {} blocks a side; this client expects level {}, {ELEVATION_SIDE} and {BLOCKS}",
            tile.level, tile.side, tile.maxima_side, address.level
        )));
    }
    let quantum = elevation::quantum_metres(tile.level);
    let metres =
        |value: i32, void: f32| if value == VOID { void } else { (f64::from(value) * quantum) as f32 };
    let heights: Arc<[f32]> = tile.heights.iter().map(|&value| metres(value, VOID_HEIGHT)).collect();
    let deep_maxima = tile.maxima.iter().map(|&value| metres(value, f32::NEG_INFINITY)).collect();
    let (own_maxima, minimum) = summarise(&heights);
    let surface = tile.surface.map(|surface| {
        let mut pairs = vec![0_u8; 2 * surface.types.len()];
        for ((pair, kind), canopy) in pairs.chunks_exact_mut(2).zip(&surface.types).zip(&surface.canopy) {
            pair.copy_from_slice(&[*kind, *canopy]);
        }
        for (pair, &code) in pairs.chunks_exact_mut(2).zip(surface.species.iter().flatten()) {
            // Codes beyond the table of seasons are as none.
            let known = if usize::from(code) <= season::MOST_SPECIES { code } else { 0 };
            pair[0] |= known << SPECIES_SHIFT;
        }
        pairs
    });
    let ground = surface.as_deref().map_or_else(Vec::new, |surface| ground_bounds(&heights, surface));
    let summary = ElevationSummary { heights, own_maxima, deep_maxima, minimum, ground };
    Ok(ElevationPixels { surface, summary })
}

/// Least and greatest height without the canopy of each block; the first above the second where there is none.
fn ground_bounds(heights: &[f32], surface: &[u8]) -> Vec<[f32; 2]> {
    let mut bounds = vec![[f32::INFINITY, f32::NEG_INFINITY]; (BLOCKS * BLOCKS) as usize];
    for (index, bounds) in bounds.iter_mut().enumerate() {
        for row in block_nodes(index) {
            for (&height, pair) in
                heights[row.clone()].iter().zip(surface[2 * row.start..].as_chunks::<2>().0)
            {
                if height > VOID_HEIGHT {
                    let ground = height - f32::from(pair[1]) * CANOPY_METRES;
                    *bounds = [bounds[0].min(ground), bounds[1].max(ground)];
                }
            }
        }
    }
    bounds
}

/// The nodes of a block with its edges, row by row.
fn block_nodes(index: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
    let (side, block) = (ELEVATION_SIDE as usize, MAXIMA_BLOCK_CELLS as usize);
    let (x, y) = (index % BLOCKS as usize * block, index / BLOCKS as usize * block);
    (y..=y + block).map(move |row| {
        let start = (row + BORDER as usize) * side + x + BORDER as usize;
        start..start + block + 1
    })
}

/// Block maxima and the least height of the nodes of the tile itself, border left out.
fn summarise(heights: &[f32]) -> (Vec<f32>, f32) {
    let mut maxima = vec![f32::NEG_INFINITY; (BLOCKS * BLOCKS) as usize];
    let mut minimum = f32::INFINITY;
    for (index, maximum) in maxima.iter_mut().enumerate() {
        for row in block_nodes(index) {
            for &height in &heights[row] {
                if height > VOID_HEIGHT {
                    *maximum = maximum.max(height);
                    minimum = minimum.min(height);
                }
            }
        }
    }
    (maxima, minimum)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use treeline_core::codec::elevation::{Surface, lattice_above_metres, lattice_from_metres};
    use treeline_core::grid::{LatticeWindow, Registration};

    /// A tile of an analytic surface, as a server would send it.
    pub fn encoded(address: TileAddress, height: impl Fn(f64, f64) -> f64) -> Vec<u8> {
        let window = LatticeWindow::of_tile(address, Registration::Node, 1);
        let heights: Vec<i32> = (0..i64::from(window.height))
            .flat_map(|row| (0..i64::from(window.width)).map(move |column| (column, row)))
            .map(|(column, row)| {
                let longitude = window.longitude(window.first_column + column);
                let latitude = window.latitude(window.first_row + row);
                lattice_from_metres(height(longitude, latitude), address.level)
            })
            .collect();
        let nodes = heights.len();
        let maxima = (0..64 * 64)
            .map(|index: u32| {
                let (x, y) = (index % 64 * 8 + 1, index / 64 * 8 + 1);
                let block = (y..=y + 8).flat_map(|row| (x..=x + 8).map(move |column| (column, row)));
                block.map(|(column, row)| heights[(row * ELEVATION_SIDE + column) as usize]).max().unwrap()
            })
            .collect();
        let surface = Some(Surface { types: vec![5; nodes], canopy: vec![0; nodes], species: None });
        ElevationTile {
            level: address.level,
            side: ELEVATION_SIDE,
            heights,
            maxima_side: 64,
            maxima,
            surface,
        }
        .encode()
    }

    #[test]
    fn a_plane_comes_through() {
        let address = TileAddress::at(12, 11.0, 47.0);
        let bounds = address.bounds();
        let plane =
            |longitude: f64, latitude: f64| 1e4 * (longitude - bounds.west) + 5e3 * (bounds.north - latitude);
        let pixels = elevation(&encoded(address, plane), address).unwrap();
        let step = (bounds.east - bounds.west) / 512.0;
        for (u, v) in [(0.0, 0.0), (17.25, 300.5), (512.0, 512.0)] {
            let height = pixels.summary.height(u, v).unwrap();
            assert!(
                (height - plane(bounds.west + u * step, bounds.north - v * step)).abs() < 0.07,
                "{u} {v} {height}"
            );
        }
        let whole = pixels.summary.own_maximum((0.0, 0.0), 512.0);
        assert!((f64::from(whole) - 1.5e4 * 512.0 * step).abs() < 0.07);
        let corner = pixels.summary.own_maximum((0.0, 0.0), 8.0);
        assert!((f64::from(corner) - 1.5e4 * 8.0 * step).abs() < 0.07, "{corner}");
        assert!(pixels.summary.minimum().abs() < 0.07);
        assert_eq!(pixels.surface.unwrap().len(), 2 * 515 * 515);
        assert!(lattice_above_metres(0.1, 12) == 1);
    }

    #[test]
    fn voids_have_no_height_and_an_empty_tile_is_empty() {
        let address = TileAddress::at(12, 11.0, 47.0);
        let pixels = elevation(&encoded(address, |_, _| f64::NAN), address).unwrap();
        assert!(pixels.summary.is_empty());
        assert_eq!(pixels.summary.height(3.0, 3.0), None);
        assert!(pixels.summary.heights.iter().all(|&height| height == VOID_HEIGHT));
    }

    #[test]
    fn another_tile_than_the_one_asked_for_is_refused() {
        let address = TileAddress::at(12, 11.0, 47.0);
        let bytes = encoded(address, |_, _| 1.0);
        assert!(matches!(elevation(&bytes, address.parent().unwrap()), Err(FetchFailure::Permanent(_))));
        assert!(matches!(elevation(&bytes[..99], address), Err(FetchFailure::Temporary(_))));
    }
}
