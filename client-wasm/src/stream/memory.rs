//! One budget of GPU memory for all tiles, and the slots that it buys.
//!
//! Elevation and photo share it by a fixed rule: for three slots of elevation there are five of the photo,
//! about what views of mountains want of each (a photo has finer tiles than the terrain below it). A scene
//! without a photo gives everything to elevation.

use super::decode::ELEVATION_SIDE;
use crate::passes::compress_photo::PhotoFormat;
use serde::Serialize;
use treeline_core::tile::CELLS;

/// Default budget: 96 slots of combined elevation and 160 of the photo, 143 and 242 of it compressed.
pub const DEFAULT_BUDGET_BYTES: u64 = 375 << 20;
/// Slots of elevation and of the photo are as these to each other.
const SHARES: [u64; 2] = [3, 5];
/// Layers that an array texture of any WebGPU adapter has.
const MAXIMUM_SLOTS: u32 = 256;

/// What a scene's elevation tiles consist of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ElevationParts {
    /// Surface types and canopy heights.
    pub surface: bool,
    /// Pyramids of minima beside those of maxima, as the Tile Load Map needs them.
    pub minima: bool,
}

impl ElevationParts {
    /// Bytes of a slot on the GPU.
    pub fn slot_bytes(self) -> u64 {
        let nodes = u64::from(ELEVATION_SIDE * ELEVATION_SIDE);
        // Mips of 256², 128² … 1² texels.
        let pyramid: u64 = (1..=CELLS.ilog2()).map(|mip| u64::from(CELLS >> mip).pow(2)).sum();
        let surface = if self.surface { 2 * nodes } else { 0 };
        4 * nodes + 4 * pyramid * (1 + u64::from(self.minima)) + surface
    }
}

/// Slots, and what they cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slots {
    /// For elevation tiles.
    pub elevation: u32,
    /// For photo tiles; 0 without a photo.
    pub texture: u32,
    /// For tiles of land cover; 0 where no trees are drawn one by one.
    pub land_cover: u32,
    /// What elevation slots consist of.
    pub parts: ElevationParts,
    /// What a photo slot takes, bytes.
    pub texture_bytes: u64,
    /// What a slot of land cover takes, bytes.
    pub land_cover_bytes: u64,
    /// The budget, bytes: as asked for, or the least that holds what a scene cannot do without.
    pub budget_bytes: u64,
}

impl Slots {
    /// Shares `budget_bytes` out, no fewer than `least` slots of elevation and of the photo (`None`: there
    /// is no photo), of which one takes `texture_bytes`. `land_cover`: slots that trees need and what one takes, of
    /// which there are fewer where they would be more than a quarter of all.
    pub fn of_budget(
        budget_bytes: u64,
        parts: ElevationParts,
        texture_bytes: u64,
        land_cover: (u32, u64),
        least: (u32, Option<u32>),
    ) -> Self {
        let all_bytes = budget_bytes;
        let (land_cover_slots, land_cover_bytes) = land_cover;
        let affordable = (budget_bytes / 4).checked_div(land_cover_bytes).unwrap_or(0);
        let land_cover =
            u64::from(land_cover_slots).min(affordable).max(u64::from(land_cover_slots.min(4))) as u32;
        let cover_bytes = u64::from(land_cover) * land_cover_bytes;
        let budget_bytes = all_bytes.saturating_sub(cover_bytes);
        let elevation_bytes = parts.slot_bytes();
        let (least_elevation, least_texture) = (least.0.min(MAXIMUM_SLOTS), least.1.unwrap_or(0));
        let least_bytes = |slots: u32, bytes: u64| u64::from(slots) * bytes;
        let kept = [
            least_bytes(least_elevation, elevation_bytes),
            least_bytes(least_texture.min(MAXIMUM_SLOTS), texture_bytes),
        ];
        let budget_bytes = budget_bytes.max(kept[0] + kept[1]);
        let slots = |bytes: u64, slot_bytes: u64, least: u32| {
            ((bytes / slot_bytes).min(u64::from(MAXIMUM_SLOTS)) as u32).max(least)
        };
        let Some(least_texture) = least.1 else {
            let elevation = slots(budget_bytes, elevation_bytes, least_elevation);
            let budget_bytes = budget_bytes + cover_bytes;
            let texture = 0;
            return Self {
                elevation,
                texture,
                land_cover,
                parts,
                texture_bytes,
                land_cover_bytes,
                budget_bytes,
            };
        };
        let weights = [SHARES[0] * elevation_bytes, SHARES[1] * texture_bytes];
        let share = (budget_bytes as f64 * weights[0] as f64 / (weights[0] + weights[1]) as f64) as u64;
        // What the photo cannot do without is not given away.
        let share = share.min(budget_bytes - kept[1]);
        let elevation = slots(share, elevation_bytes, least_elevation);
        let rest = budget_bytes - u64::from(elevation) * elevation_bytes;
        let texture = slots(rest, texture_bytes, least_texture.min(MAXIMUM_SLOTS));
        let budget_bytes = budget_bytes + cover_bytes;
        Self { elevation, texture, land_cover, parts, texture_bytes, land_cover_bytes, budget_bytes }
    }

    /// What so many slots in use take, bytes.
    pub fn bytes(&self, elevation: usize, texture: usize, land_cover: usize) -> u64 {
        elevation as u64 * self.parts.slot_bytes()
            + texture as u64 * self.texture_bytes
            + land_cover as u64 * self.land_cover_bytes
    }
}

/// GPU memory of the tiles, for the panel and the stats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MemoryStats {
    /// All slots together take no more than this.
    pub budget_bytes: u64,
    /// Slots that hold a tile.
    pub used_bytes: u64,
    /// Texture arrays as they are: they grow by doubling up to the budget. While one grows, the smaller
    /// one lives on until the GPU has copied it.
    pub allocated_bytes: u64,
    /// How photo tiles are held.
    pub photo_format: PhotoFormat,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ALL: ElevationParts = ElevationParts { surface: true, minima: true };

    #[test]
    fn the_default_buys_what_views_of_mountains_want() {
        let slots = |photo: PhotoFormat| {
            let slots =
                Slots::of_budget(DEFAULT_BUDGET_BYTES, ALL, photo.tile_bytes(), (0, 0), (8, Some(32)));
            (slots.elevation, slots.texture)
        };
        assert_eq!(slots(PhotoFormat::Rgba8), (96, 160));
        assert_eq!(slots(PhotoFormat::Bc7), (143, 242));
        let bare = ElevationParts { surface: false, minima: false };
        assert_eq!(bare.slot_bytes(), 4 * 515 * 515 + 4 * 87_381);
        let alone = Slots::of_budget(DEFAULT_BUDGET_BYTES, ALL, 0, (0, 0), (8, None));
        assert_eq!((alone.elevation, alone.texture), (171, 0));
    }

    proptest! {
        #[test]
        fn a_budget_is_never_exceeded(
            budget in 0_u64..4_000_000_000,
            least in (1_u32..40, proptest::option::of(1_u32..80)),
            parts in (any::<bool>(), any::<bool>()),
            texture_bytes in prop_oneof![Just(270_400_u64), Just(1_081_600)],
            land_cover in prop_oneof![Just((0_u32, 0_u64)), Just((24, 2_100_000)), Just((9, 5_000_000))],
        ) {
            let parts = ElevationParts { surface: parts.0, minima: parts.1 };
            let slots = Slots::of_budget(budget, parts, texture_bytes, land_cover, least);
            let all = [slots.elevation, slots.texture, slots.land_cover].map(|slots| slots as usize);
            prop_assert!(slots.bytes(all[0], all[1], all[2]) <= slots.budget_bytes);
            prop_assert!(slots.elevation >= least.0 && slots.texture >= least.1.unwrap_or(0));
            let needed = slots.bytes(least.0 as usize, least.1.unwrap_or(0) as usize, slots.land_cover as usize);
            prop_assert_eq!(slots.budget_bytes, budget.max(needed));
        }
    }
}
