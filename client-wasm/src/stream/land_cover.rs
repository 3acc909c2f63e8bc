//! Land cover about the eye: which tiles of it the trees need, and which cells have all that they need.

use super::Stream;
use super::placing::place;
use super::requests::TileKey;
use super::tile_choice::CutNode;
use super::tile_choice::cpu::HeightRange;
use super::tree_field::{SeedFrameCells, TreeField, with_neighbours};
use super::view::ViewGeometry;
use treeline_core::tile::TileAddress;

/// How much land cover at the eye is wanted, as pixels, and the distance at which half as much, metres.
const NEAR_COVER: f64 = 1_000.0;
const COVER_METRES: f64 = 100.0;

impl Stream {
    /// Chooses the land cover of the trees about the eye: of cells that the map last read shows, or else of all in
    /// the picture.
    pub(super) fn choose_land_cover(&mut self, view: &ViewGeometry) {
        let cells = self.cells_in_sight(view, self.map.is_some());
        let Some((field, layer)) = &mut self.land_cover else { return };
        layer.cut.nodes.clear();
        let wanted = field.tiles_of(&cells);
        layer.cut.limited = wanted.len() > layer.pool.capacity();
        for (distance, tile) in wanted.into_iter().take(layer.pool.capacity()) {
            let error = NEAR_COVER / (1.0 + distance / COVER_METRES);
            layer.cut.nodes.insert(tile, CutNode { split: false, error, sure: true });
        }
    }

    /// The cells that may show a tree, nearest first. `by_map`: the map last read says which may be in sight.
    fn cells_in_sight(&self, view: &ViewGeometry, by_map: bool) -> Vec<(f64, TileAddress)> {
        let Some((field, _)) = &self.land_cover else { return Vec::new() };
        // Over all of the scene by more than trees are drawn: there is nothing to look for.
        if view.eye.height - self.heights.1 > field.range() {
            return Vec::new();
        }
        let shown = self
            .map
            .as_ref()
            .filter(|_| by_map && !self.is_among_trees(view))
            .map(|map| with_neighbours(map.analysis.patterns.cells().iter().map(|cell| cell.address)));
        field.cells_in_sight(view, shown.as_ref(), |cell| match self.range(cell, &self.elevation.extent) {
            HeightRange::Empty => None,
            HeightRange::Between(low, high) => Some((low, high)),
        })
    }

    /// Whether trees that are drawn one by one are near, or soon will be.
    pub fn wants_trees(&self) -> bool {
        self.land_cover.as_ref().is_some_and(|(_, layer)| !layer.cut.nodes.is_empty())
    }

    /// What grows about the eye, where trees are drawn one by one.
    pub fn tree_field(&self) -> Option<&TreeField> {
        self.land_cover.as_ref().map(|(field, _)| field)
    }

    /// The cells whose trees a frame looks at; `None` where there are none. `map_holds`: the map last read is of
    /// this very view.
    pub fn seed_cells(&mut self, view: &ViewGeometry, map_holds: bool) -> Option<SeedFrameCells> {
        let cells = self.cells_in_sight(view, map_holds && self.map.is_some());
        let (field, layer) = self.land_cover.as_mut()?;
        layer.pool.begin_frame(layer.cut.nodes.keys());
        let found = field.seed_frame(view, &cells, |tile| layer.pool.resident(&tile).map(|tile| tile.slot));
        (!found.cells.is_empty()).then_some(found)
    }

    /// Finds a slot for a tile of land cover that has come; `None` where nothing grows on it or there is no room.
    pub fn place_land_cover(&mut self, key: TileKey, grows: bool) -> Option<u32> {
        self.arrived.remove(&key);
        let (_, layer) = self.land_cover.as_mut()?;
        if !grows {
            layer.pool.insert_empty(key.address);
            return None;
        }
        place(layer, key.address).0
    }
}
