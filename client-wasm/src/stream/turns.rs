//! Whether tiles take turns in the same slots while the camera rests.
//!
//! What a map names depends a little on what is drawn: a coarser surface hides less, or more. Where slots are short, one
//! tile can push out another, and the map that is made then ask for that one again, for ever.

use super::requests::TileKey;
use std::collections::HashSet;

/// Tiles that may come back: a surface that gets finer may want one again, but not many.
const MOST_RETURNS: u32 = 6;

/// What has made room since the camera came to rest.
#[derive(Clone, Debug, Default)]
pub struct Turns {
    evicted: HashSet<TileKey>,
    returns: u32,
}

impl Turns {
    /// Counts a tile that has come, and the one that it pushed out; answers whether too many have come back. Then
    /// counting starts anew.
    pub fn count(&mut self, came: TileKey, evicted: Option<TileKey>) -> bool {
        self.returns += u32::from(self.evicted.contains(&came));
        self.evicted.extend(evicted);
        let too_many = self.returns > MOST_RETURNS;
        if too_many {
            *self = Self::default();
        }
        too_many
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use treeline_core::layer::Layer;
    use treeline_core::tile::TileAddress;

    fn key(column: u32) -> TileKey {
        TileKey { layer: Layer::Texture, address: TileAddress { level: 9, row: 3, column } }
    }

    #[test]
    fn two_tiles_in_one_slot_are_found_out() {
        let mut turns = Turns::default();
        let found = (0..40).position(|turn| turns.count(key(turn % 2), Some(key((turn + 1) % 2))));
        assert_eq!(found, Some(MOST_RETURNS as usize + 1));
    }

    #[test]
    fn new_tiles_may_come_as_they_like() {
        let mut turns = Turns::default();
        assert!((0..400).all(|turn| !turns.count(key(turn), turn.checked_sub(40).map(key))));
    }
}
