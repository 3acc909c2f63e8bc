//! Twin of `select_trees.wgsl`: which trees are drawn one by one, in which order, at which level of detail.
//!
//! Candidates, stands and anchors are `treeline_core::seeds`' own: the shader is their twin.

use super::load_map_place::enu_from_place;
use crate::layout::{HARD_SWITCH, View};
use crate::trees::{LEVELS, SeedCell, SeedFrame};
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};
use treeline_core::codec::elevation::VOID;
use treeline_core::hash::mix;
use treeline_core::seeds::pattern::{CELL_UNITS, CellRow, ROWS, candidate, pattern_of_cell};
use treeline_core::seeds::species::HEIGHT_UNITS;
use treeline_core::seeds::{Species, Stand, anchor};

const UNIT_RADIANS: f32 = 1.462_918e-9;
const TOP_TOLERANCE: [f32; 2] = [15.0, 50.0];
const LEVEL_JITTER: f32 = 0.5;
const LEVEL_BAND: f32 = 1.25;
const RANGE_JITTER: f32 = 0.15;
const RANGE_BAND: f32 = 0.1;
const RADIAL_LEVELS: [f32; 2] = [700.0, 1_400.0];

/// What the pass has bound.
pub trait SeedTexels {
    /// Species, closure and height of the stand of a cell of land cover.
    fn stand(&self, slot: u32, column: u32, row: u32) -> Stand;
    /// An anchor node, quanta.
    fn anchor(&self, slot: u32, column: u32, row: u32) -> i32;
    /// Distance that the terrain pass wrote, metres; negative for a miss.
    fn distance(&self, x: u32, y: u32) -> f32;
    /// Whether the surface at a pixel holds every crown: its cells are no longer than 1.8 m.
    fn is_fine(&self, x: u32, y: u32) -> bool;
}

/// The frame, and the textures.
pub struct SeedWorld<'a, T: SeedTexels> {
    /// The view.
    pub view: &'a View,
    /// The pass's own.
    pub frame: &'a SeedFrame,
    /// The table.
    pub species: &'a [Species],
    /// The textures.
    pub texels: &'a T,
}

/// A tree as the server has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeedTree {
    /// Index in the table.
    pub species: u32,
    /// Place in its cell, units.
    pub units: [u32; 2],
    /// Anchor, quanta.
    pub ground: i32,
    /// Height, 1/1024 m.
    pub height: u32,
    /// 1/256 of a turn.
    pub rotation: u8,
    /// Its own, for all that is jittered.
    pub bits: u32,
}

/// The same, seen from the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedTree {
    /// Foot of the trunk, metres from the eye, east-north-up.
    pub foot: Vec3,
    /// Upward at the tree.
    pub up: Vec3,
    /// Metres.
    pub height: f32,
    /// Metres.
    pub crown_radius: f32,
}

impl PlacedTree {
    /// Half-way up.
    pub fn centre(&self) -> Vec3 {
        self.foot + 0.5 * self.height * self.up
    }
}

/// Levels at which a tree is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeLevels {
    /// 0 the finest.
    pub level: u32,
    /// Whether the next level is drawn too.
    pub fades: bool,
    /// Share of the pixels that the level takes.
    pub own: f32,
    /// Share that both take.
    pub both: f32,
}

/// The tree of a seed, where one lives.
pub fn tree_of_seed<T: SeedTexels>(
    world: &SeedWorld<'_, T>,
    cell: &SeedCell,
    sub_cell: [u32; 2],
) -> Option<SeedTree> {
    let [column, row] = cell.cell;
    let cell_row = CellRow::new(row);
    if sub_cell[0] >= cell_row.columns {
        return None;
    }
    let pattern = pattern_of_cell(column, row, world.view.scene_seed);
    let candidate = candidate(pattern, cell_row.columns, sub_cell[0], sub_cell[1]);
    let place = [column * CELL_UNITS + candidate.x, row * CELL_UNITS + candidate.y];
    let tile = place.map(|place| place >> world.frame.tile_bits << world.frame.tile_bits);
    let within = |axis: usize| (place[axis] - tile[axis]) >> world.frame.cover_bits;
    let stand = world.texels.stand(cell.slot, within(0), within(1));
    let species = stand.species(world.species)?;
    if candidate.rank >= (stand.share(species) * cell_row.aspect) >> 14 {
        return None;
    }
    let ground = anchor_at(world, place, tile, cell.slot);
    (ground != VOID).then(|| SeedTree {
        species: u32::from(stand.species) - 1,
        units: [candidate.x, candidate.y],
        ground,
        height: species.tree_height(candidate.size, stand.height),
        rotation: candidate.rotation,
        bits: mix(place[0].wrapping_add(mix(place[1]))),
    })
}

fn anchor_at<T: SeedTexels>(world: &SeedWorld<'_, T>, place: [u32; 2], tile: [u32; 2], slot: u32) -> i32 {
    let bits = world.frame.anchor_bits;
    let node = [0, 1].map(|axis| (place[axis] >> bits) - (tile[axis] >> bits));
    let nodes =
        [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[i, j]| world.texels.anchor(slot, node[0] + i, node[1] + j));
    anchor::between(nodes, place.map(|place| place & ((1 << bits) - 1)), bits)
}

/// A tree, seen from the eye.
pub fn placed_tree<T: SeedTexels>(world: &SeedWorld<'_, T>, cell: &SeedCell, tree: &SeedTree) -> PlacedTree {
    let frame = world.frame;
    let apart =
        [0, 1].map(|axis| (cell.offset[axis] + tree.units[axis] as i32) as f32 - frame.eye_fraction[axis]);
    let angles = apart.map(|units| units * UNIT_RADIANS);
    let ground = tree.ground as f32 * frame.anchor_quantum;
    let foot = enu_from_place(frame.eye, angles[0], -angles[1], ground);
    let radius = world.view.sun[3];
    let up = Vec3::new(foot.x / radius, foot.y / radius, 1.0).normalize();
    let height = tree.height as f32 / HEIGHT_UNITS as f32;
    let species = &world.species[tree.species as usize];
    PlacedTree { foot, up, height, crown_radius: height * species.definition.crown_radius_ratio as f32 }
}

/// Whether any of a tree's sphere may be in the picture.
pub fn in_frustum(frame: &SeedFrame, tree: &PlacedTree) -> bool {
    let radius = 0.5 + Vec2::new(0.5 * tree.height, tree.crown_radius).length();
    frame.sides.iter().all(|&side| Vec4::from(side).xyz().dot(tree.centre()) >= -radius)
}

/// Whether the surface at a tree's top lies before it. A top off the picture counts as visible.
pub fn top_hidden<T: SeedTexels>(world: &SeedWorld<'_, T>, tree: &PlacedTree) -> bool {
    let view = world.view;
    let axis = |vector: [f32; 4]| Vec4::from(vector).xyz();
    let top = tree.foot + tree.height * tree.up;
    let depth = top.dot(axis(view.forward));
    if depth <= 0.1 {
        return false;
    }
    let (right, above) = (axis(view.right), axis(view.up));
    let screen = Vec2::new(top.dot(right / right.dot(right)), -top.dot(above / above.dot(above))) / depth;
    if screen.abs().max_element() > 1.0 {
        return false;
    }
    let size = Vec2::new(view.size[0] as f32, view.size[1] as f32);
    let pixel = 0.5 * (screen + 1.0) * size;
    let away = top.length();
    let reach = (0.7 * tree.crown_radius / (away * view.right[3])).clamp(1.0, 12.0);
    let mut farthest = 0.0_f32;
    for sample in 0..9_u32 {
        let offset = Vec2::new((sample % 3) as f32, (sample / 3) as f32) - 1.0;
        let at = (pixel + offset * reach).clamp(Vec2::ZERO, size - 1.0).as_uvec2();
        let distance = world.texels.distance(at.x, at.y);
        if distance < 0.0 {
            return false;
        }
        farthest = farthest.max(distance);
    }
    let at = pixel.clamp(Vec2::ZERO, size - 1.0).as_uvec2();
    let tolerance = TOP_TOLERANCE[usize::from(!world.texels.is_fine(at.x, at.y))];
    away > farthest + tolerance
}

/// Whether a tree is near enough, and its levels.
pub fn levels_of(view: &View, frame: &SeedFrame, away: f32, height: f32, bits: u32) -> TreeLevels {
    let hard = view.flags & HARD_SWITCH != 0;
    let level_jitter = if hard { 0.0 } else { (bits & 0xff) as f32 / 255.0 - 0.5 };
    let range_jitter = (bits >> 8 & 0xff) as f32 / 255.0;
    let thresholds = frame.level_pixels;
    let mut pixels = height / (away * view.right[3]).max(1e-6) * (LEVEL_JITTER * level_jitter).exp2();
    pixels = pixels.min(thresholds[0] * RADIAL_LEVELS[0] / away.max(1e-3));
    pixels = pixels.min(thresholds[1] * RADIAL_LEVELS[1] / away.max(1e-3));
    let end = frame.range * (1.0 - RANGE_JITTER * range_jitter);
    let both = if hard { 1.0 } else { ((end - away) / (RANGE_BAND * frame.range)).clamp(0.0, 1.0) };
    let level = thresholds[..3].iter().position(|&threshold| pixels >= threshold).unwrap_or(3);
    let own = match level {
        3 => 1.0,
        _ if hard => 1.0,
        level => ((pixels / thresholds[level] - 1.0) / (LEVEL_BAND - 1.0)).clamp(0.0, 1.0),
    };
    TreeLevels { level: level as u32, fades: own < 1.0, own: own * both, both }
}

/// The levels at which a seed's tree is drawn; `None` where there is none to draw.
pub fn decide_seed<T: SeedTexels>(
    world: &SeedWorld<'_, T>,
    cell: &SeedCell,
    sub_cell: [u32; 2],
) -> Option<(SeedTree, TreeLevels)> {
    let tree = tree_of_seed(world, cell, sub_cell)?;
    let placed = placed_tree(world, cell, &tree);
    let away = placed.centre().length();
    if away >= world.frame.range || !in_frustum(world.frame, &placed) {
        return None;
    }
    let levels = levels_of(world.view, world.frame, away, placed.height, tree.bits);
    (levels.both > 0.0 && !top_hidden(world, &placed)).then_some((tree, levels))
}

/// A tree selected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selected {
    /// Index of its cell.
    pub cell: u32,
    /// Column and row of its seed.
    pub sub_cell: [u32; 2],
    /// The tree.
    pub tree: SeedTree,
    /// Whether it is the second of two levels of one tree.
    pub second: bool,
}

/// The instances of every bin (species by species, level by level), each in the order of cells and seeds.
pub fn select_trees<T: SeedTexels>(world: &SeedWorld<'_, T>, cells: &[SeedCell]) -> Vec<Vec<Selected>> {
    let mut bins = vec![Vec::new(); world.frame.bins() as usize];
    for (index, cell) in (0..).zip(cells) {
        let columns = CellRow::new(cell.cell[1]).columns;
        for sub_cell in (0..columns).flat_map(|i| (0..ROWS).map(move |j| [i, j])) {
            let Some((tree, levels)) = decide_seed(world, cell, sub_cell) else { continue };
            let bin = (tree.species * LEVELS + levels.level) as usize;
            bins[bin].push(Selected { cell: index, sub_cell, tree, second: false });
            if levels.fades {
                bins[bin + 1].push(Selected { cell: index, sub_cell, tree, second: true });
            }
        }
    }
    bins
}

#[cfg(test)]
mod tests {
    use super::*;
    use treeline_core::seeds::pattern::LEVEL;

    /// A wood on a plane, seen from its edge; `wall`: a surface before everything, metres from the eye.
    struct Wood {
        stand: Stand,
        ground: i32,
        wall: f32,
    }

    impl SeedTexels for Wood {
        fn stand(&self, _slot: u32, _column: u32, _row: u32) -> Stand {
            self.stand
        }

        fn anchor(&self, _slot: u32, column: u32, _row: u32) -> i32 {
            // A cliff of 2 km in one cell.
            if column < 64 { self.ground } else { self.ground.saturating_add(1 << 17) }
        }

        fn distance(&self, _x: u32, _y: u32) -> f32 {
            self.wall
        }

        fn is_fine(&self, _x: u32, _y: u32) -> bool {
            true
        }
    }

    fn view() -> View {
        View {
            right: [0.6, 0.0, 0.0, 0.001],
            up: [0.0, 0.0, 0.45, 30.0],
            forward: [0.0, 1.0, 0.0, 4_000.0],
            sun: [0.0, 0.0, 1.0, 6.37e6],
            size: [640, 480],
            scene_seed: 1,
            ..View::default()
        }
    }

    fn frame(row: u32) -> SeedFrame {
        let latitude = (90.0 - 180.0 * (f64::from(row) + 0.5) / f64::from(1_u32 << LEVEL)).to_radians();
        let side = |x: f32, y: f32, z: f32| {
            let normal = Vec3::new(x, y, z).normalize();
            [normal.x, normal.y, normal.z, 0.0]
        };
        SeedFrame {
            eye: [latitude.sin() as f32, latitude.cos() as f32, 30.0, 6.38e6],
            sides: [side(1.0, 0.6, 0.0), side(-1.0, 0.6, 0.0), side(0.0, 0.45, 1.0), side(0.0, 0.45, -1.0)],
            level_pixels: [240.0, 80.0, 26.0, 0.0],
            range: 1_000.0,
            anchor_quantum: 1.0 / 64.0,
            cells: 1,
            blocks: 3,
            species: 2,
            cover_bits: 7,
            tile_bits: 16,
            anchor_bits: 7,
            ..SeedFrame::default()
        }
    }

    fn selected(wood: &Wood, species: &[Species], row: u32, south: i32) -> Vec<Vec<Selected>> {
        let cell = SeedCell { cell: [4 * 9_000, row & !3], offset: [-8_000, south], ..SeedCell::default() };
        let (view, frame) = (view(), frame(row));
        select_trees(&SeedWorld { view: &view, frame: &frame, species, texels: wood }, &[cell])
    }

    fn count(bins: &[Vec<Selected>]) -> usize {
        bins.iter().flatten().filter(|tree| !tree.second).count()
    }

    const CLOSED: Stand = Stand { species: 1, closure: 255, height: 0 };
    const ROW: u32 = 40_000;

    #[test]
    fn trees_ahead_are_selected_and_those_behind_the_eye_or_a_wall_are_not() {
        let species = Species::built_in();
        let open = Wood { stand: CLOSED, ground: 0, wall: -1.0 };
        let ahead = count(&selected(&open, &species, ROW, -30_000));
        assert!(ahead > 50, "{ahead}");
        assert_eq!(count(&selected(&open, &species, ROW, 30_000)), 0, "behind");
        assert_eq!(count(&selected(&open, &species, ROW, -200_000)), 0, "beyond the range");
        let walled = Wood { wall: 20.0, ..open };
        // Tops off the picture count as visible.
        assert!(count(&selected(&walled, &species, ROW, -30_000)) < ahead / 2);
    }

    #[test]
    fn nothing_grows_on_voids_near_the_poles_or_for_unknown_species() {
        let species = Species::built_in();
        let wood = |stand, ground| Wood { stand, ground, wall: -1.0 };
        assert_eq!(count(&selected(&wood(CLOSED, VOID), &species, ROW, -30_000)), 0);
        assert_eq!(count(&selected(&wood(CLOSED, 0), &species, 0, -30_000)), 0);
        let unknown = Stand { species: 200, ..CLOSED };
        assert_eq!(count(&selected(&wood(unknown, 0), &species, ROW, -30_000)), 0);
        assert_eq!(count(&selected(&wood(Stand { closure: 0, ..CLOSED }, 0), &species, ROW, -30_000)), 0);
    }

    #[test]
    fn a_tiny_species_is_drawn_coarse_and_a_tree_in_a_cliff_stands_between_its_ends() {
        let mut definition = Species::built_in()[0].definition.clone();
        (definition.lowest_metres, definition.highest_metres, definition.tallest_metres) = (0.5, 0.5, 0.5);
        let tiny = [Species::new(1, definition).unwrap()];
        let wood = Wood { stand: CLOSED, ground: 0, wall: -1.0 };
        let cell = SeedCell { cell: [4 * 9_000, ROW & !3], offset: [-8_000, -30_000], ..SeedCell::default() };
        let (view, frame) = (view(), SeedFrame { species: 1, ..frame(ROW) });
        let bins =
            select_trees(&SeedWorld { view: &view, frame: &frame, species: &tiny, texels: &wood }, &[cell]);
        assert!(count(&bins) > 50 && bins[0].is_empty() && bins[1].is_empty());
        for tree in bins.iter().flatten() {
            assert!((0..=1 << 17).contains(&tree.tree.ground) && tree.tree.height == 512);
        }
    }

    #[test]
    fn levels_get_coarser_with_distance_and_fade_without_a_gap() {
        let (view, frame) = (view(), frame(ROW));
        for bits in [0, 0x7f7f, u32::MAX] {
            let (mut last, mut ended) = (0, false);
            for step in 1..2_000 {
                let levels = levels_of(&view, &frame, step as f32 * 0.5, 25.0, bits);
                assert!(levels.level >= last && levels.own <= levels.both);
                assert!(levels.level == last || levels.level == last + 1);
                assert!(!ended || levels.both == 0.0, "it does not come back");
                ended = levels.both == 0.0;
                last = levels.level;
            }
            assert_eq!(levels_of(&view, &frame, 1_000.0, 25.0, bits).both, 0.0);
        }
    }
}
