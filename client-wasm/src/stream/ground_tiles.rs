//! The tiles of the ground as the page's map of them shows it.

use super::Stream;
use serde::Serialize;
use std::collections::BTreeMap;
use treeline_core::tile::TileAddress;

/// A tile of the ground, and what there is to say of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct GroundTile {
    /// Matrix level.
    pub level: u8,
    /// Row from the north.
    pub row: u32,
    /// Column from the west.
    pub column: u32,
    /// In sight on its own level, by the last load map.
    pub visible: bool,
    /// Asked for, or here and kept.
    pub wanted: bool,
    /// In a slot.
    pub resident: bool,
}

impl Stream {
    /// The tiles of the photo (of the elevation, where there is no photo) that are in sight, wanted or
    /// resident; coarsest first.
    pub fn ground_tiles(&self) -> Vec<GroundTile> {
        let mut tiles: BTreeMap<TileAddress, GroundTile> = BTreeMap::new();
        let mut at = |address: TileAddress, say: fn(&mut GroundTile)| {
            let TileAddress { level, row, column } = address;
            let new = GroundTile { level, row, column, visible: false, wanted: false, resident: false };
            say(tiles.entry(address).or_insert(new));
        };
        let layer = self.texture.as_ref().unwrap_or(&self.elevation);
        layer.cut.nodes.keys().for_each(|&address| at(address, |tile| tile.wanted = true));
        layer.pool.residents().for_each(|(&address, _)| at(address, |tile| tile.resident = true));
        self.visible().iter().for_each(|&address| at(address, |tile| tile.visible = true));
        tiles.into_values().collect()
    }
}
