//! The Tile Load Map read back: from words to lists of tiles. A plain state machine; the pass that
//! makes the words is `passes::load_map`.

pub mod lists;
pub mod stack;
pub mod threshold;

use lists::{Hold, PatternCell, PatternList, TileList};
use stack::Stack;
use treeline_core::scene::LandCoverLevels;
use treeline_core::tile::TileAddress;
use treeline_shaders::load_map::{
    AHEAD, BLENDED, CELLS, LARGEST_SHIFT, RADIAL_SHIFT, SIDE, SMALLEST_SHIFT, VISIBLE, WANTED,
};

/// Seconds for which a tile is wanted on after the map last named it, while the camera moves: what comes
/// and goes at a ridge does not flicker.
const HOLD_SECONDS: f64 = 0.6;

/// An elevation tile that shows in a smaller share of the pixels with ground is left to its parent.
const LEAST_SHARE: f64 = 1.0 / 400.0;

/// What each list may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Depths {
    /// Deepest level of the photo, where there is one.
    pub texture: Option<u8>,
    /// Deepest level of the elevation.
    pub elevation: u8,
    /// So many levels coarser than the photo's texels may the elevation's cells be.
    pub elevation_coarser: u8,
    /// Where the land cover's levels stand, if the scene has vegetation.
    pub land_cover: Option<LandCoverLevels>,
}

/// The map's words as they were read back.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'a> {
    /// A word a cell (`treeline_shaders::load_map`).
    pub cells: &'a [u32],
    /// Pixels that hit a cell and want its level.
    pub pixels: &'a [u32],
}

/// The lists.
#[derive(Clone, Debug)]
pub struct Analysis {
    depths: Depths,
    /// Ground textures wanted (GLM).
    pub texture: TileList,
    /// Elevation tiles wanted.
    pub elevation: TileList,
    /// Land-cover tiles wanted (CLM).
    pub classification: TileList,
    /// Seed patterns in sight (PLM).
    pub patterns: PatternList,
    visible: Vec<TileAddress>,
    readings: u64,
}

impl Analysis {
    /// Nothing is wanted yet.
    pub fn new(depths: Depths) -> Self {
        Self {
            depths,
            texture: TileList::default(),
            elevation: TileList::default(),
            classification: TileList::default(),
            patterns: PatternList::default(),
            visible: Vec::new(),
            readings: 0,
        }
    }

    /// Takes in a map. `moves`: the camera moved since the last one. `is_here` says which tiles of the
    /// photo and of the elevation have come.
    ///
    /// A map whose sizes are not those of a stack is ignored.
    pub fn read(
        &mut self,
        now: f64,
        stack: &Stack,
        reading: Reading<'_>,
        moves: bool,
        is_here: [&dyn Fn(&TileAddress) -> bool; 2],
    ) {
        let used = stack.maps() * (SIDE * SIDE) as usize;
        if reading.cells.len() != CELLS as usize || reading.pixels.len() != CELLS as usize {
            return;
        }
        self.readings += 1;
        let lists = [&mut self.texture, &mut self.elevation, &mut self.classification];
        lists.into_iter().for_each(TileList::begin);
        self.patterns.begin();
        self.visible.clear();
        let words = reading.cells[..used].iter().zip(&reading.pixels[..used]);
        // Nearly all cells are empty: the rest of the loop is for the few that are not.
        for (cell, (&word, &pixels)) in words.enumerate().filter(|(_, (word, _))| **word != 0) {
            let Some(address) = stack.address(cell) else { continue };
            let map = cell / (SIDE * SIDE) as usize;
            if word & (WANTED | BLENDED | AHEAD) != 0 {
                self.name(address, pixels, word, map == 0, now);
            }
            if map as u32 == stack.frame.pattern_map && word & VISIBLE != 0 {
                self.show(word, address, now);
            }
        }
        self.visible.sort_unstable();
        self.visible.dedup();
        let pixels: u64 = reading.pixels[..used].iter().map(|&count| u64::from(count)).sum();
        self.elevation.leave_to_parents((pixels as f64 * LEAST_SHARE) as u32, stack.level(0));
        let hold = if moves { Hold::Since(now - HOLD_SECONDS) } else { Hold::Clears };
        self.texture.end(hold, is_here[0]);
        self.elevation.end(hold, is_here[1]);
        self.classification.end(hold, |_| false);
        self.patterns.end();
    }

    fn name(&mut self, address: TileAddress, pixels: u32, word: u32, coarsest: bool, now: f64) {
        let ahead = word & (WANTED | BLENDED) == 0;
        if let Some(texture) = self.depths.texture.and_then(|deepest| within(address, deepest)) {
            self.texture.name(texture, pixels, ahead, now);
        }
        // Heights do not blend: only the photo wants the coarser level too.
        let level = address.level.saturating_sub(self.depths.elevation_coarser);
        let mut elevation = address.ancestor(level.min(self.depths.elevation));
        while elevation.is_some_and(|tile| tile.crowds_a_pole()) {
            elevation = elevation.and_then(|tile| tile.parent());
        }
        if let Some(elevation) = elevation.filter(|_| word & (WANTED | AHEAD) != 0) {
            self.elevation.name(elevation, pixels, ahead, now);
        }
        if word & WANTED == 0 {
            return;
        }
        // On the coarsest map a part in sight may want a level coarser than there is a map for.
        let smallest = (255 - (word >> SMALLEST_SHIFT & 0xff)) as u8;
        let largest = ((word >> LARGEST_SHIFT & 0xff) as u8).min(address.level);
        let deepest = self.depths.texture.unwrap_or(self.depths.elevation);
        let own = if coarsest { smallest.min(largest)..=largest } else { address.level..=address.level };
        self.visible.extend(own.filter_map(|level| address.ancestor(level.min(deepest))));
    }

    /// A cell of the patterns' level is in sight.
    fn show(&mut self, word: u32, address: TileAddress, now: f64) {
        let radial = (word >> RADIAL_SHIFT & 3) as u8;
        let Some(levels) = self.depths.land_cover.filter(|_| radial < 3) else { return };
        self.patterns.show(PatternCell { pattern: (word & VISIBLE) as u8, address, radial });
        // Land cover follows distance alone.
        let level = [levels.l0, levels.l1, levels.l2][usize::from(radial)];
        if let Some(tile) = within(address, level) {
            self.classification.name(tile, 0, false, now);
        }
    }

    /// The tiles of the ground in sight, each on the level that it wants; in order of address.
    pub fn visible(&self) -> &[TileAddress] {
        &self.visible
    }

    /// Maps taken in.
    pub fn readings(&self) -> u64 {
        self.readings
    }
}

/// The tile, or its ancestor on the deepest level that there is.
fn within(address: TileAddress, deepest: u8) -> Option<TileAddress> {
    address.ancestor(address.level.min(deepest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::root_grid::RootGrid;
    use crate::stream::view::ViewGeometry;
    use stack::StackOptions;
    use treeline_core::camera::GeographicCamera;
    use treeline_core::seeds::pattern;
    use treeline_core::tile::GeographicBox;

    fn stack() -> Stack {
        let camera = GeographicCamera {
            lon: 10.5,
            lat: 46.5,
            height: 1_200.0,
            heading_deg: 0.0,
            pitch_deg: -20.0,
            fov_y_deg: 50.0,
        };
        let view = ViewGeometry::new(&camera, 640, 480);
        let grid = RootGrid::covering(&GeographicBox { west: 10.0, south: 46.0, east: 11.0, north: 47.0 }, 7);
        let options = StackOptions {
            deepest: 18,
            elevation: 14,
            texel_pixels: 1.42,
            heights: (0.0, 3_000.0),
            vegetation: Some(5),
            look_ahead: None,
        };
        Stack::new(&view, &grid, &options)
    }

    fn cell(stack: &Stack, address: TileAddress) -> usize {
        (0..CELLS as usize).find(|&cell| stack.address(cell) == Some(address)).unwrap()
    }

    fn analysis() -> Analysis {
        let land_cover = Some(LandCoverLevels { l0: 16, l1: 15, l2: 14, bits: 16, anchor: 14 });
        Analysis::new(Depths { texture: Some(17), elevation: 14, elevation_coarser: 0, land_cover })
    }

    fn read(
        analysis: &mut Analysis,
        now: f64,
        stack: &Stack,
        words: &[(TileAddress, u32, u32)],
        moves: bool,
    ) {
        let (mut cells, mut pixels) = (vec![0; CELLS as usize], vec![0; CELLS as usize]);
        for &(address, word, count) in words {
            cells[cell(stack, address)] = word;
            pixels[cell(stack, address)] = count;
        }
        let here: &dyn Fn(&TileAddress) -> bool = &|_| true;
        analysis.read(now, stack, Reading { cells: &cells, pixels: &pixels }, moves, [here; 2]);
    }

    #[test]
    fn each_list_gets_what_its_layer_has() {
        let (stack, mut lists) = (stack(), analysis());
        let near = TileAddress::at(18, 10.5, 46.5);
        let far = TileAddress::at(12, 10.6, 46.6);
        read(&mut lists, 0.0, &stack, &[(near, 1 | WANTED, 40), (far, 1 | WANTED, 2)], false);
        let addresses =
            |list: &TileList| list.current().iter().map(|named| named.address).collect::<Vec<_>>();
        assert_eq!(addresses(&lists.texture), [far, near.ancestor(17).unwrap()]);
        assert_eq!(addresses(&lists.elevation), [far, near.ancestor(14).unwrap()]);
        assert_eq!(lists.visible(), [far, near.ancestor(17).unwrap()]);
        assert_eq!(lists.texture.current()[1].pixels, 40);
        assert!(lists.patterns.cells().is_empty() && lists.classification.current().is_empty());
    }

    #[test]
    fn vegetation_is_listed_by_distance_alone() {
        let (stack, mut lists) = (stack(), analysis());
        let place = TileAddress::at(pattern::LEVEL, 10.5, 46.5);
        let other = TileAddress { column: place.column + 3, ..place };
        let hidden_level = TileAddress { column: place.column + 9, ..place };
        let words =
            [(place, 77, 0), (other, 78 | 2 << RADIAL_SHIFT, 0), (hidden_level, 9 | 3 << RADIAL_SHIFT, 0)];
        read(&mut lists, 0.0, &stack, &words, false);
        assert_eq!(lists.patterns.cells().len(), 2);
        assert_eq!(lists.patterns.cells()[0].pattern, 77);
        let wanted: Vec<_> = lists.classification.current().iter().map(|named| named.address).collect();
        assert_eq!(wanted, [other.ancestor(14).unwrap(), place.ancestor(16).unwrap()]);
        assert!(lists.texture.current().is_empty(), "seen, but not wanted on this level");
    }

    #[test]
    fn what_was_named_stays_a_while_after_the_camera_moves() {
        let (stack, mut lists) = (stack(), analysis());
        let tile = TileAddress::at(16, 10.5, 46.5);
        read(&mut lists, 0.0, &stack, &[(tile, 1 | WANTED, 1)], true);
        read(&mut lists, 0.5, &stack, &[], true);
        assert_eq!(lists.texture.current().len(), 1);
        assert!(lists.visible().is_empty(), "it is wanted, not visible");
        read(&mut lists, 0.7, &stack, &[], true);
        assert!(lists.texture.current().is_empty());
        assert_eq!(lists.texture.complement(), [tile]);
    }

    #[test]
    fn tiles_ahead_are_wanted_but_not_visible() {
        let (stack, mut lists) = (stack(), analysis());
        let tile = TileAddress::at(16, 10.5, 46.5);
        read(&mut lists, 0.0, &stack, &[(tile, AHEAD, 0)], true);
        assert!(lists.texture.current()[0].ahead && lists.visible().is_empty());
    }

    #[test]
    fn a_torn_map_changes_nothing() {
        let (stack, mut lists) = (stack(), analysis());
        let here: &dyn Fn(&TileAddress) -> bool = &|_| true;
        lists.read(0.0, &stack, Reading { cells: &[WANTED; 12], pixels: &[1; 12] }, false, [here; 2]);
        assert_eq!(lists.readings(), 0);
    }
}
