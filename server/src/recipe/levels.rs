//! At which levels of the matrix a scene's forest is decided, and what clients are told of it.

use crate::scene::Scene;
use treeline_core::codec::land_cover::CodeBits;
use treeline_core::scene::{LandCoverLevels, SceneSpecies};
use treeline_core::seeds::anchor;
use treeline_core::seeds::species::{HEIGHT_UNITS, tallest_metres};
use treeline_core::tile::{cell_metres, level_for_cell_metres};

/// Samples up to this far apart show the exact envelope of the crowns, metres; coarser ones their mean.
pub const ENVELOPE_METRES: f64 = 2.0;
/// Between these, land cover has its level 1: cells of 38 m to 1.2 m.
const LAND_COVER_LEVELS: std::ops::RangeInclusive<u8> = 10..=15;

/// Whether samples of the level are so close that they show the exact envelope.
pub fn shows_crowns(level: u8) -> bool {
    cell_metres(level) <= ENVELOPE_METRES
}

/// The level whose nodes carry the trees' anchors: a tree stands on the bilinear patch of the four
/// around it, whatever level is drawn. Two levels finer than the terrain's samples, so that the
/// patch follows them.
pub fn anchor_level(scene: &Scene) -> u8 {
    (level_for_cell_metres(scene.height.extent().resolution_metres) + 2)
        .clamp(anchor::COARSEST_LEVEL, anchor::FINEST_LEVEL)
}

/// The levels of the land-cover quadtree and the bits of its codes; `None` without land cover.
pub fn land_cover_levels(scene: &Scene) -> Option<LandCoverLevels> {
    let cover = scene.cover.as_ref()?;
    let own = level_for_cell_metres(cover.extent().resolution_metres);
    let anchor = anchor_level(scene);
    // Its tiles carry the anchors' nodes: no more than four for each of their cells.
    let l1 = own.clamp(*LAND_COVER_LEVELS.start(), *LAND_COVER_LEVELS.end()).max(anchor - 1);
    Some(LandCoverLevels { l0: l1 + 1, l1, l2: l1 - 1, bits: scene.code_bits as u8, anchor })
}

/// Bits of the scene's land-cover codes.
pub(super) fn code_bits(levels: &LandCoverLevels) -> CodeBits {
    CodeBits::new(levels.bits).unwrap_or_default()
}

/// A bound of what trees add to the terrain's greatest height, metres.
pub fn tallest_tree_metres(scene: &Scene) -> f64 {
    if scene.cover.is_some() { f64::from(tallest_metres(&scene.species)) } else { 0.0 }
}

/// The species that may grow, for clients; empty where nothing does.
pub fn scene_species(scene: &Scene) -> Vec<SceneSpecies> {
    if scene.cover.is_none() {
        return Vec::new();
    }
    scene
        .species
        .iter()
        .filter(|species| scene.growing.contains(&species.code))
        .map(|species| SceneSpecies {
            code: species.code,
            name: species.definition.name.clone(),
            height: f64::from(species.mean_height()) / f64::from(HEIGHT_UNITS),
            crown_radius_ratio: species.definition.crown_radius_ratio,
            definition: species.definition.clone(),
        })
        .collect()
}
