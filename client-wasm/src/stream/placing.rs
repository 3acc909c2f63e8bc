//! Where a tile that has come is put.

use super::decode::ElevationSummary;
use super::requests::TileKey;
use super::residency::Placement;
use super::{LayerStream, Stream};
use std::collections::HashSet;
use treeline_core::tile::TileAddress;

impl Stream {
    /// Finds a slot for an elevation tile that has come; `None` where it needs none (it is empty) or has no room.
    pub fn place_elevation(&mut self, key: TileKey, summary: ElevationSummary) -> Option<u32> {
        self.arrived.remove(&key);
        if summary.is_empty() {
            self.elevation.pool.insert_empty(key.address);
            return None;
        }
        let (slot, evicted) = place(&mut self.elevation, key.address);
        if let Some(evicted) = evicted {
            self.summaries.remove(&evicted);
        }
        self.count_turn(key, evicted);
        if slot.is_some() {
            self.summaries.insert(key.address, summary);
        }
        slot
    }

    /// Finds a slot for a photo tile that has come; `None` where there is no room.
    pub fn place_texture(&mut self, key: TileKey) -> Option<u32> {
        self.arrived.remove(&key);
        let (slot, evicted) = place(self.texture.as_mut()?, key.address);
        self.count_turn(key, evicted);
        slot
    }

    /// A tile has come, and another may have made room for it.
    fn count_turn(&mut self, key: TileKey, evicted: Option<TileAddress>) {
        let Some(map) = &mut self.map else { return };
        let evicted = evicted.map(|address| TileKey { address, ..key });
        if map.turns.count(key, evicted) {
            map.threshold.takes_turns();
        }
    }
}

/// Places a tile; answers its slot, and the tile that made room.
pub(super) fn place(layer: &mut LayerStream, address: TileAddress) -> (Option<u32>, Option<TileAddress>) {
    // Roots out of sight (of a planet, or around a pole) are not among them: they may make room.
    let wanted: HashSet<TileAddress> = layer.cut.nodes.keys().copied().collect();
    let (placement, evicted) = layer.pool.place(address, &wanted);
    match placement {
        Placement::Slot(slot) => (Some(slot), evicted),
        Placement::NoRoom => (None, evicted),
    }
}
