//! The page tables of a frame: which square is drawn from which slot (docs/ARCHITECTURE.md).
//!
//! A square is drawn from its own tile where that is resident, else from the nearest ancestor: so
//! nothing that has ever been covered is left open, whatever comes late or not at all.

use super::decode::ElevationSummary;
use super::residency::Pool;
use super::root_grid::RootGrid;
use super::tile_choice::Cut;
use super::view::{ViewGeometry, Volume};
use std::collections::{HashMap, HashSet};
use treeline_core::geodesy;
use treeline_core::ray_frame::{EyeFrame, LeafFit, TileSquare, coarsest_leaf_level};
use treeline_core::tile::{self, TileAddress};
use treeline_shaders::layout::{EMPTY, LEAF_BIT, Leaf, LeafPlace, TexturePage, VOID_HEIGHT};

/// A square is at most this many levels below the tile that it is drawn from: it has whole cells.
const DEEPEST_SQUARE: u8 = 8;
/// A square that appears smaller than this many pixels is not split to keep its frame exact.
const SMALLEST_SPLIT_PIXELS: f64 = 8.0;
/// Fits that are kept; all are dropped when there are more.
const MAXIMUM_FITS: usize = 4096;

/// What the GPU needs of a frame's tiles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tables {
    /// Elevation page table.
    pub nodes: Vec<u32>,
    /// Leaves; the roots' own frames first.
    pub leaves: Vec<Leaf>,
    /// The photo's page table; the roots first.
    pub pages: Vec<TexturePage>,
    /// The tile behind each leaf, `None` where there is nothing (the roots').
    pub leaf_tiles: Vec<Option<TileAddress>>,
    /// Whether a tile is still fading in.
    pub fading: bool,
}

/// Ray-frame fits by square and tile: independent of the eye, so kept from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct FitCache {
    fits: HashMap<(TileAddress, TileAddress), ((f64, f64), LeafFit)>,
}

impl FitCache {
    fn fit(
        &mut self,
        square: TileAddress,
        tile: TileAddress,
        place: TileSquare,
        heights: (f64, f64),
    ) -> LeafFit {
        if self.fits.len() > MAXIMUM_FITS {
            self.fits.clear();
        }
        let entry =
            self.fits.entry((square, tile)).or_insert_with(|| (heights, LeafFit::new(tile, place, heights)));
        if entry.0 != heights {
            *entry = (heights, LeafFit::new(tile, place, heights));
        }
        entry.1
    }
}

/// What the elevation page table is made from.
pub struct ElevationInput<'a> {
    /// Where the tables begin.
    pub grid: &'a RootGrid,
    /// Who looks.
    pub view: &'a ViewGeometry,
    /// What is wanted.
    pub cut: &'a Cut,
    /// What is resident.
    pub pool: &'a mut Pool,
    /// What is known of resident tiles.
    pub summaries: &'a HashMap<TileAddress, ElevationSummary>,
    /// Fits of earlier frames.
    pub fits: &'a mut FitCache,
    /// Bounds of the scene's heights, metres.
    pub heights: (f64, f64),
    /// Seconds.
    pub now: f64,
    /// Length of a fade, seconds; 0 for none.
    pub fade_seconds: f64,
}

/// Squares that have something to draw below them: the strict ancestors of every tile that is
/// wanted and resident, and of the children that keep the picture sharp while a coarser tile
/// that is wanted now is still missing.
fn ancestors_of_drawable(cut: &Cut, pool: &Pool, top: u8) -> HashSet<TileAddress> {
    let mut above = HashSet::new();
    let mut add = |tile: TileAddress| {
        let mut next = tile.parent();
        while let Some(ancestor) = next.filter(|ancestor| ancestor.level >= top) {
            if !above.insert(ancestor) {
                break;
            }
            next = ancestor.parent();
        }
    };
    for (address, node) in &cut.nodes {
        if pool.resident(address).is_some() {
            add(*address);
        } else if !node.split && !pool.is_known(address) {
            let children = address.children();
            let complete = children.iter().all(|child| pool.is_known(child));
            if let Some(child) = children.iter().find(|child| complete && pool.resident(child).is_some()) {
                add(*child);
            }
        }
    }
    above
}

struct ElevationBuilder<'a> {
    input: ElevationInput<'a>,
    eye: EyeFrame,
    above: HashSet<TileAddress>,
    tables: Tables,
}

/// Builds the elevation page table; `tables.pages` is left empty.
pub fn elevation(input: ElevationInput<'_>) -> Tables {
    let above = ancestors_of_drawable(input.cut, input.pool, input.grid.level);
    let eye = EyeFrame { ecef: input.view.eye_ecef, ecef_from_enu: input.view.enu_from_ecef.transpose() };
    let roots: Vec<TileAddress> = input.grid.tiles().collect();
    let tables = Tables {
        nodes: vec![EMPTY; roots.len()],
        leaves: vec![Leaf::default(); roots.len()],
        leaf_tiles: vec![None; roots.len()],
        ..Tables::default()
    };
    let mut builder = ElevationBuilder { input, eye, above, tables };
    for (index, root) in roots.into_iter().enumerate() {
        let source = builder.input.pool.nearest(root).map(|(tile, _)| tile);
        builder.root(index, root, source);
    }
    builder.tables
}

impl ElevationBuilder<'_> {
    /// Fills a root's entry and its own frame.
    fn root(&mut self, index: usize, root: TileAddress, source: Option<TileAddress>) {
        let entry = self.visit(root, source, Some(index));
        self.tables.nodes[index] = entry;
        if entry != EMPTY && entry & LEAF_BIT != 0 {
            return; // its leaf is the frame
        }
        let place = LeafPlace {
            maximum: self.input.heights.1 as f32,
            ..self.place(root, root, EMPTY, [0, 0], tile::CELLS)
        };
        let fit = self.input.fits.fit(root, root, TileSquare::WHOLE, self.input.heights);
        self.tables.leaves[index] = Leaf::from_frame(&fit.at_eye(&self.eye), &place);
    }

    /// The entry of a square, `source` being the nearest resident tile above it.
    fn visit(&mut self, square: TileAddress, source: Option<TileAddress>, root: Option<usize>) -> u32 {
        if self.input.pool.is_empty_tile(&square) {
            return EMPTY;
        }
        let source = if self.input.pool.resident(&square).is_some() { Some(square) } else { source };
        let whole_cells = source.is_none_or(|tile| square.level < tile.level + DEEPEST_SQUARE);
        if whole_cells && (self.above.contains(&square) || self.bends(square, source)) {
            let first = self.tables.nodes.len();
            self.tables.nodes.extend([EMPTY; 4]);
            for (offset, child) in square.children().into_iter().enumerate() {
                self.tables.nodes[first + offset] = self.visit(child, source, None);
            }
            return first as u32;
        }
        match source {
            Some(tile) => self.leaf(square, tile, root),
            None => EMPTY,
        }
    }

    /// Whether a square is too large for one frame, and large enough in the picture for that to show.
    fn bends(&self, square: TileAddress, source: Option<TileAddress>) -> bool {
        let bounds = square.bounds();
        let steepest = bounds.north.abs().max(bounds.south.abs());
        if source.is_none() || square.level >= coarsest_leaf_level(steepest) {
            return false;
        }
        let volume = Volume::new(self.input.view, &bounds, self.input.heights.0, self.input.heights.1);
        let side = tile::cell_metres(square.level) * f64::from(tile::CELLS);
        let pixel = volume.distance(self.input.view).max(1.0) * self.input.view.pixel_angle;
        side > SMALLEST_SPLIT_PIXELS * pixel && !volume.outside_frustum(self.input.view)
    }

    /// Appends (or, for a root, fills in) the leaf of a square drawn from a tile.
    fn leaf(&mut self, square: TileAddress, tile: TileAddress, root: Option<usize>) -> u32 {
        let standing = self.stand_in(square, tile);
        let (now, seconds) = (self.input.now, self.input.fade_seconds);
        let fade = self.input.pool.draw(&tile, now, standing.is_some(), seconds) as f32;
        let Some(mut leaf) = self.make(square, tile) else {
            return EMPTY;
        };
        if fade < 1.0
            && let Some(other) = standing
        {
            self.tables.fading = true;
            leaf.h_cross_maximum_fade[3] = fade;
            self.input.pool.draw(&other, now, false, seconds);
            if let Some(stand_in) = self.make(square, other) {
                leaf.stand_in = self.tables.leaves.len() as u32;
                self.tables.leaves.push(stand_in);
                self.tables.leaf_tiles.push(Some(other));
            }
        }
        let index = match root {
            Some(index) => {
                self.tables.leaves[index] = leaf;
                self.tables.leaf_tiles[index] = Some(tile);
                index
            }
            None => {
                self.tables.leaves.push(leaf);
                self.tables.leaf_tiles.push(Some(tile));
                self.tables.leaves.len() - 1
            }
        };
        LEAF_BIT | index as u32
    }

    /// The tile that was drawn in the square's place until now: what a new tile fades in over.
    fn stand_in(&self, square: TileAddress, tile: TileAddress) -> Option<TileAddress> {
        let coarsest = square.level.saturating_sub(DEEPEST_SQUARE);
        (coarsest..tile.level)
            .rev()
            .filter_map(|level| tile.ancestor(level))
            .find(|ancestor| self.input.pool.was_drawn(ancestor))
    }

    /// The leaf of a square as drawn from a tile, not fading; `None` where the tile has a void there.
    fn make(&mut self, square: TileAddress, tile: TileAddress) -> Option<Leaf> {
        let slot = self.input.pool.resident(&tile)?.slot;
        let summary = self.input.summaries.get(&tile)?;
        let (u, v, side) = square.place_in_ancestor(tile.level)?;
        let maximum = summary.own_maximum((u, v), side);
        if maximum == f32::NEG_INFINITY {
            return None;
        }
        // Up to the scene's top: rays pass over a leaf at any height below that.
        let heights = (f64::from(summary.minimum()), self.input.heights.1.max(f64::from(maximum)));
        let fit = self.input.fits.fit(square, tile, TileSquare { u, v, side }, heights);
        let place =
            LeafPlace { maximum, ..self.place(square, tile, slot, [u as u32, v as u32], side as u32) };
        Some(Leaf::from_frame(&fit.at_eye(&self.eye), &place))
    }

    fn place(
        &self,
        square: TileAddress,
        tile: TileAddress,
        slot: u32,
        first_cell: [u32; 2],
        cells: u32,
    ) -> LeafPlace {
        let (grid_origin, grid_side) = self.input.grid.square(square).unwrap_or_default();
        let latitude = square.bounds().centre().1;
        let step = (tile::span_degrees(tile.level) / f64::from(tile::CELLS)).to_radians();
        LeafPlace {
            first_cell,
            cells: [cells, cells],
            grid_origin,
            grid_side,
            slot,
            level: tile.level,
            stand_in: EMPTY,
            maximum: VOID_HEIGHT,
            fade: 1.0,
            cell_metres: [
                (step * geodesy::prime_vertical_radius(latitude) * latitude.to_radians().cos()) as f32,
                (step * geodesy::meridian_radius(latitude)) as f32,
            ],
        }
    }
}

/// Builds the photo's page table. Answers it and whether a tile is still fading in.
pub fn texture(
    grid: &RootGrid,
    cut: &Cut,
    pool: &mut Pool,
    now: f64,
    fade_seconds: f64,
) -> (Vec<TexturePage>, bool) {
    let above = ancestors_of_drawable(cut, pool, grid.level);
    let mut pages = vec![TexturePage { slot: EMPTY, children: EMPTY, fade: 0, padding: 0 }; grid.len()];
    let mut fading = false;
    let mut open: Vec<(usize, TileAddress, bool)> =
        grid.tiles().enumerate().map(|(index, root)| (index, root, false)).collect();
    while let Some((index, square, covered)) = open.pop() {
        let mut covered = covered;
        if let Some(resident) = pool.resident(&square) {
            let slot = resident.slot;
            // With nothing below it there is nothing to fade from but grey: the first is shown at once.
            let fade = pool.draw(&square, now, covered, fade_seconds) as f32;
            fading |= fade < 1.0;
            pages[index].slot = slot;
            pages[index].fade = fade.to_bits();
            covered = true;
        }
        if above.contains(&square) {
            let first = pages.len();
            pages[index].children = first as u32;
            let empty = TexturePage { slot: EMPTY, children: EMPTY, fade: 0, padding: 0 };
            pages.extend([empty; 4]);
            for (offset, child) in square.children().into_iter().enumerate() {
                open.push((first + offset, child, covered));
            }
        }
    }
    (pages, fading)
}
