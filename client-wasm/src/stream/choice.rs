//! Which tiles a view wants: by the map last read, or by the quadtree; and what a map that came back changes.

use super::decode::ElevationSummary;
use super::load_map::lists::TileList;
use super::load_map::stack::{Stack, StackOptions};
use super::load_map::threshold::Threshold;
use super::load_map::{Analysis, Reading};
use super::tile_choice::cpu::{self, HeightRange, Limits};
use super::tile_choice::{self, Cut};
use super::turns::Turns;
use super::view::{ViewGeometry, Volume};
use super::{LayerStream, PINNED_TEXTURES, Stream};
use glam::DVec3;
use treeline_core::hash::hash;
use treeline_core::tile::{GeographicBox, TileAddress};

/// What the choice by the Tile Load Map keeps.
#[derive(Debug)]
pub(super) struct MapChoice {
    pub(super) analysis: Analysis,
    /// Deepest level of any layer.
    pub(super) deepest: u8,
    /// The scene's seed, where it has vegetation.
    pub(super) vegetation: Option<u32>,
    pub(super) threshold: Threshold,
    pub(super) turns: Turns,
    pub(super) texel_pixels: f64,
    pub(super) scratch: Vec<tile_choice::load_map::Step>,
}

impl MapChoice {
    /// A texel may fill so many pixels, for all that is in sight to find a slot.
    fn texel_pixels(&self) -> f64 {
        self.texel_pixels * self.threshold.factor()
    }
}

/// What is known of a square.
enum Known<'a> {
    /// There is nothing in it.
    Empty,
    /// The summary of the finest tile that covers it, that tile's level, and the square's place in it.
    Summary(&'a ElevationSummary, u8, (f64, f64, f64)),
    /// Nothing yet.
    Nothing,
}

impl Stream {
    /// Chooses the tiles that the view wants: by the map last read, or by the quadtree, as among trees.
    pub fn choose(&mut self, view: &ViewGeometry) {
        // With very many roots (a planet), of the photo only those in view are always wanted.
        let many = self.texture.as_ref().filter(|layer| layer.base.len() > PINNED_TEXTURES);
        let seen = many.map(|layer| self.seen(view, layer));
        // Among trees the surface that the map looks at is not what is seen.
        let by_map = !self.is_among_trees(view);
        if by_map && let Some(mut map) = self.map.take() {
            self.choose_by_map(&mut map, seen.as_deref());
            self.map = Some(map);
        } else {
            self.elevation.cut = self.choose_by_quadtree(view, &self.elevation, &self.elevation.base);
            let cut = self
                .texture
                .as_ref()
                .map(|layer| self.choose_by_quadtree(view, layer, seen.as_deref().unwrap_or(&layer.base)));
            if let Some((layer, cut)) = self.texture.as_mut().zip(cut) {
                layer.cut = cut;
            }
        }
        self.choose_land_cover(view);
    }

    fn choose_by_quadtree(&self, view: &ViewGeometry, layer: &LayerStream, base: &[TileAddress]) -> Cut {
        let limits = Limits {
            base,
            maximum_level: layer.maximum_level,
            cell_pixels: layer.cell_pixels,
            capacity: layer.pool.capacity(),
            lowest_height: self.heights.0,
        };
        cpu::choose(view, &limits, |address| {
            if layer.layer.is_elevation() && address.crowds_a_pole() {
                return HeightRange::Empty;
            }
            self.range(address, &layer.extent)
        })
    }

    fn choose_by_map(&mut self, map: &mut MapChoice, seen: Option<&[TileAddress]>) {
        let mut cut = std::mem::take(&mut self.elevation.cut);
        let layer = &self.elevation;
        let (extent, pool) = (layer.extent, &layer.pool);
        let chosen = tile_choice::load_map::Layer { base: &layer.base, pool, capacity: pool.capacity() };
        let has = |address| self.may_hold(address, &extent);
        tile_choice::load_map::choose(&mut cut, &map.analysis.elevation, &chosen, &mut map.scratch, has);
        self.elevation.cut = cut;
        let Some(layer) = &mut self.texture else { return };
        let mut cut = std::mem::take(&mut layer.cut);
        let (extent, pool) = (layer.extent, &layer.pool);
        let base = seen.unwrap_or(&layer.base);
        layer.pinned = base.len();
        let chosen = tile_choice::load_map::Layer { base, pool, capacity: pool.capacity() };
        let has = |address: TileAddress| extent.intersects(&address.bounds());
        tile_choice::load_map::choose(&mut cut, &map.analysis.texture, &chosen, &mut map.scratch, has);
        layer.cut = cut;
    }

    /// The stack of maps of a view; `None` where the quadtree chooses. `look_ahead`: where the eye will be when
    /// what is asked for now has come, metres from it (east-north-up).
    pub fn stack(&self, view: &ViewGeometry, look_ahead: Option<DVec3>) -> Option<Stack> {
        let map = self.map.as_ref()?;
        let options = StackOptions {
            deepest: map.deepest,
            elevation: self.elevation.maximum_level,
            texel_pixels: map.texel_pixels(),
            heights: self.heights,
            vegetation: map.vegetation,
            look_ahead,
        };
        Some(Stack::new(view, &self.grid, &options))
    }

    /// Takes in a map that was read back (`moves`: the camera moved since the last one), and chooses
    /// anew. Answers whether tiles that are here are drawn now, or no longer.
    pub fn read_map(
        &mut self,
        now: f64,
        view: &ViewGeometry,
        stack: &Stack,
        reading: Reading<'_>,
        moves: bool,
    ) -> bool {
        let Some(map) = &mut self.map else { return false };
        let (elevation, texture) = (&self.elevation.pool, self.texture.as_ref().map(|layer| &layer.pool));
        let has_elevation = |address: &TileAddress| elevation.is_known(address);
        let has_texture = |address: &TileAddress| texture.is_some_and(|pool| pool.is_known(address));
        if moves {
            map.turns = Turns::default();
        }
        map.analysis.read(now, stack, reading, moves, [&has_texture, &has_elevation]);
        self.choose(view);
        let (crowding, complete) = (self.crowding(), self.has_all());
        let Some(map) = &mut self.map else { return false };
        // A map made before the threshold last changed says nothing of this one.
        if stack.frame.texel_angle == (map.texel_pixels() * view.pixel_angle) as f32 {
            map.threshold.judge(crowding, moves, complete);
        }
        self.drawn_changes()
    }

    /// Whether other tiles would be drawn now than in the last frame.
    fn drawn_changes(&self) -> bool {
        self.signature() != self.drawn_signature
    }

    /// Stands for the set of tiles that are wanted and here.
    pub(super) fn signature(&self) -> u64 {
        let layers = std::iter::once(&self.elevation).chain(&self.texture).enumerate();
        layers.fold(0, |sum, (index, layer)| {
            let drawn = layer.cut.nodes.keys().filter(|address| layer.pool.resident(address).is_some());
            drawn.fold(sum, |sum: u64, address| {
                let place = u64::from(hash(address.row, address.column, u32::from(address.level)));
                sum.wrapping_add((place + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15 + 2 * index as u64))
            })
        })
    }

    /// Tiles wanted over slots, of the layer where it is largest.
    fn crowding(&self) -> f64 {
        let Some(map) = &self.map else { return 0.0 };
        let share = |list: &TileList, layer: &LayerStream| {
            let base = layer.base.first().map_or(0, |tile| tile.level);
            let below = list.current().iter().filter(|named| named.address.level > base).count();
            (below + layer.pinned) as f64 / layer.pool.capacity() as f64
        };
        let elevation = share(&map.analysis.elevation, &self.elevation);
        let texture = self.texture.as_ref();
        texture.map_or(0.0, |layer| share(&map.analysis.texture, layer)).max(elevation)
    }

    /// The tiles of the ground in sight by the last map, each on the level that it wants.
    pub fn visible(&self) -> &[TileAddress] {
        self.map.as_ref().map_or(&[], |map| map.analysis.visible())
    }

    /// How many times coarser than asked for tiles are wanted, so that all in sight find a slot; `None` where
    /// the quadtree chooses.
    pub fn threshold(&self) -> Option<f64> {
        self.map.as_ref().map(|map| map.threshold.factor())
    }

    /// The lists of the last map; `None` where the quadtree chooses.
    pub fn analysis(&self) -> Option<&Analysis> {
        self.map.as_ref().map(|map| &map.analysis)
    }

    /// The base tiles of a layer that may be seen, nearest first, no more than there is room for.
    fn seen(&self, view: &ViewGeometry, layer: &LayerStream) -> Vec<TileAddress> {
        let mut seen: Vec<(f64, TileAddress)> = layer
            .base
            .iter()
            .map(|&root| (Volume::new(view, &root.bounds(), self.heights.0, self.heights.1), root))
            .filter(|(volume, _)| {
                !volume.outside_frustum(view) && !volume.below_horizon(view, self.heights.0)
            })
            .map(|(volume, root)| (volume.distance(view), root))
            .collect();
        seen.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        seen.truncate(layer.pool.capacity() / 4);
        seen.into_iter().map(|(_, root)| root).collect()
    }

    /// The summary of the finest tile above a square that is known, its level, and the square's place in it; or
    /// that there is nothing in the square.
    fn known(&self, address: TileAddress, extent: &GeographicBox) -> Known<'_> {
        if !extent.intersects(&address.bounds()) {
            return Known::Empty;
        }
        for level in (0..=address.level).rev() {
            let Some(tile) = address.ancestor(level) else { break };
            if let Some(summary) = self.summaries.get(&tile)
                && let Some(place) = address.place_in_ancestor(level)
            {
                return Known::Summary(summary, level, place);
            }
            if self.elevation.pool.is_empty_tile(&tile) {
                return Known::Empty;
            }
        }
        Known::Nothing
    }

    /// Whether there may be anything in a square.
    fn may_hold(&self, address: TileAddress, extent: &GeographicBox) -> bool {
        match self.known(address, extent) {
            Known::Empty => false,
            Known::Summary(summary, _, (u, v, side)) => summary.holds((u, v), side),
            Known::Nothing => true,
        }
    }

    /// What is known of the heights in a square.
    pub(super) fn range(&self, address: TileAddress, extent: &GeographicBox) -> HeightRange {
        let (summary, level, (u, v, side)) = match self.known(address, extent) {
            Known::Empty => return HeightRange::Empty,
            Known::Summary(summary, level, place) => (summary, level, place),
            Known::Nothing => return HeightRange::Between(self.heights.0, self.heights.1),
        };
        let maximum = f64::from(summary.deep_maximum((u, v), side));
        if maximum == f64::NEG_INFINITY {
            return HeightRange::Empty;
        }
        // Finer tiles may reach a little lower than this one's samples.
        let minimum = f64::from(summary.minimum()) - 2.0 * treeline_core::tile::cell_metres(level);
        let minimum = minimum.clamp(self.heights.0.min(maximum), maximum);
        HeightRange::Between(minimum, maximum)
    }
}
