//! Twin of `load_map_cells.wgsl`: which cells may show where no pixel's centre says so.

use super::Texels;
use super::load_map::{
    ENDLESS, LoadMap, MAP_CELLS, MARK_AHEAD, MARK_BLENDED, MARK_COARSER, MARK_LEVELS, MARK_RADIAL,
    MARK_WANTED, MOST_COARSER, radial_mark,
};
use super::load_map_box::{
    GroundBox, NO_RANGE, distance_range, ground_box, outside_picture, picture_rectangle, pyramid_rectangle,
    shows,
};
use super::load_map_place::sine;
use super::page_table::find_square;
use crate::layout::{EMPTY, LEAF_BIT, Leaf, ROOT_BITS, VOID_HEIGHT};
use crate::load_map::{
    AHEAD, BLENDED, LARGEST_SHIFT, RADIAL_METRES, RADIAL_SHIFT, SIDE, SMALLEST_SHIFT, WANTED,
};
use glam::{IVec2, UVec2, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};
use treeline_core::seeds::pattern::pattern_of_cell;
use treeline_core::tile;

const MOST_CANDIDATES: usize = 65_535;
const AHEAD_WIDENING: f32 = 1.15;
const PICTURE_SLACK: f32 = 0.05;
/// Parts along a side in which a box that may show is tested again.
const PARTS: u32 = 4;
/// Ground of slope 1 rises by half a cell between nodes that do not show it.
const RISE_BETWEEN_NODES: f32 = 0.5;
/// How often that is done.
const DEEPEST_PART: u32 = 2;

/// All of how many levels coarser than the coarsest map's is wanted.
const MARKS_COARSER: u32 = ((2 << MOST_COARSER) - 1) << MARK_COARSER;

fn reach_of<T: Texels>(map: &LoadMap<'_, T>, of: u32) -> Vec2 {
    let [near, far] = map.stack.levels[of as usize].band;
    if of == map.stack.pattern_map {
        return Vec2::new(0.0, (if near >= ENDLESS { 0.0 } else { far }).max(RADIAL_METRES[2]));
    }
    Vec2::new(near, far)
}

fn least_distance<T: Texels>(map: &LoadMap<'_, T>, of: u32, place: Vec2) -> f32 {
    let level = &map.stack.levels[of as usize];
    let eye = Vec2::from_array(level.eye);
    let apart = (place - eye).max(eye - place - 1.0).max(Vec2::ZERO) * level.span;
    let axis = ((map.stack.eye[3] + map.stack.eye[2]) * map.stack.eye[1]).max(0.0);
    let east = axis * sine(apart.x.min(FRAC_PI_2));
    let north = 6.2e6 * sine(apart.y.min(FRAC_PI_2));
    let turns = map.world.view.wraps == 1 && level.span * SIDE as f32 > PI;
    (if turns || apart.x > FRAC_PI_2 { 0.0 } else { east }).max(north)
}

/// The grid's north-west corner of a cell; `None` where the grid ends before it.
fn cell_place<T: Texels>(map: &LoadMap<'_, T>, of: u32, place: UVec2) -> Option<UVec2> {
    let bits = map.cell_bits(of);
    let columns = map.grid_columns(of) as i32;
    let rows = (map.world.view.root_size[1] << (ROOT_BITS - bits)) as i32;
    let first = IVec2::from_array(map.stack.levels[of as usize].first);
    let cell = map.wrapped(of, first + place.as_ivec2());
    let inside = cell.cmpge(IVec2::ZERO).all() && cell.x < columns && cell.y < rows;
    inside.then(|| cell.as_uvec2() << UVec2::splat(bits))
}

fn place_of(index: u32) -> UVec2 {
    UVec2::new(index % SIDE, index % MAP_CELLS / SIDE)
}

/// Names the cell a candidate if its box may be visible, or will be. What pixels have named needs no box, unless it is on
/// the coarsest map and reaches through more levels than they have named.
pub fn choose_cells<T: Texels>(map: &mut LoadMap<'_, T>, index: u32) {
    let of = index / MAP_CELLS;
    let marks = map.cells[index as usize];
    let patterned = of == map.stack.pattern_map;
    let named = marks & MARK_WANTED != 0 && (!patterned || marks & MARK_RADIAL != 0);
    if named && of > 0 {
        return;
    }
    let place = place_of(index);
    let reach = reach_of(map, of);
    let [x, y, z, ahead] = map.stack.look_ahead;
    let (origin, ahead) = (Vec3::new(x, y, z), ahead != 0.0);
    let farther = if ahead { origin.length() } else { 0.0 };
    if least_distance(map, of, place.as_vec2()) > reach.y + farther || cell_place(map, of, place).is_none() {
        return;
    }
    let heights = Vec2::from_array(map.stack.heights);
    let ground = ground_box(map, of, place.as_vec2(), (place + 1).as_vec2(), heights);
    if named {
        let range = distance_range(&ground, Vec3::ZERO);
        if map.wanted_marks(of, range.x.max(reach.x), range.y) & MARKS_COARSER & !marks == 0 {
            return;
        }
    }
    let may_show = |origin: Vec3, widening: f32| {
        let range = distance_range(&ground, origin);
        range.x < reach.y && range.y >= reach.x && !outside_picture(map, &ground, origin, widening)
    };
    let candidate = may_show(Vec3::ZERO, 1.0) || (ahead && may_show(origin, AHEAD_WIDENING));
    if candidate && map.candidates.len() < MOST_CANDIDATES {
        map.candidates.push(index);
    }
}

fn join_ranges(a: Vec2, b: Vec2) -> Vec2 {
    Vec2::new(a.x.min(b.x), a.y.max(b.y))
}

/// Least and greatest height of a leaf's tile over a square of the grid.
fn heights_in_tile<T: Texels>(map: &LoadMap<'_, T>, leaf: &Leaf, grid: UVec2, side: u32) -> Vec2 {
    let texels = map.world.texels;
    let cell_side = leaf.grid_side.ilog2() - leaf.cells[0].ilog2().min(leaf.grid_side.ilog2());
    let origin = UVec2::from_array(leaf.grid_origin);
    let relative =
        IVec2::new(grid.x.wrapping_sub(origin.x).cast_signed(), grid.y.wrapping_sub(origin.y).cast_signed());
    let place = relative + (UVec2::from_array(leaf.first_cell) << UVec2::splat(cell_side)).as_ivec2();
    let side_bits = side.ilog2();
    if side_bits > cell_side {
        let level = side_bits - cell_side;
        let texel = place >> IVec2::splat((cell_side + level) as i32);
        let count = (tile::CELLS >> level.min(31)) as i32;
        if texel.cmplt(IVec2::ZERO).any() || texel.cmpge(IVec2::splat(count)).any() {
            return Vec2::from_array(map.stack.heights);
        }
        let mip = level - 1;
        return Vec2::new(
            texels.minimum(leaf.slot, mip, texel.x, texel.y),
            texels.maximum(leaf.slot, mip, texel.x, texel.y),
        );
    }
    let cell = place >> IVec2::splat(cell_side as i32);
    let border = map.world.border();
    let node = |x: i32, y: i32| texels.height(leaf.slot, cell.x + x + border, cell.y + y + border);
    let (north_west, north_east, south_west, south_east) = (node(0, 0), node(1, 0), node(0, 1), node(1, 1));
    if north_west.min(north_east).min(south_west).min(south_east) <= VOID_HEIGHT {
        return NO_RANGE;
    }
    let unit = 1.0 / (1_u32 << cell_side) as f32;
    let first = (place - (cell << IVec2::splat(cell_side as i32))).as_vec2() * unit;
    let last = first + side as f32 * unit;
    let mix = |a: Vec2, b: Vec2, share: Vec2| a * (1.0 - share) + b * share;
    let across = Vec2::new(first.x, last.x);
    let north = mix(Vec2::splat(north_west), Vec2::splat(north_east), across);
    let south = mix(Vec2::splat(south_west), Vec2::splat(south_east), across);
    let upper = mix(north, south, Vec2::splat(first.y));
    let lower = mix(north, south, Vec2::splat(last.y));
    Vec2::new(upper.min(lower).min_element(), upper.max(lower).max_element())
}

fn heights_over<T: Texels>(map: &LoadMap<'_, T>, grid: UVec2, side: u32, level: u32) -> Vec2 {
    let square = find_square(&map.world, grid + (side >> 1));
    if square.entry == EMPTY {
        return NO_RANGE;
    }
    let leaf = &map.world.leaves[(square.entry & !LEAF_BIT) as usize];
    let mut range = heights_in_tile(map, leaf, grid, side);
    if leaf.stand_in != EMPTY {
        let other = &map.world.leaves[leaf.stand_in as usize];
        range = join_ranges(range, heights_in_tile(map, other, grid, side));
    }
    if range.y <= VOID_HEIGHT {
        return NO_RANGE;
    }
    if leaf.level < level.min(map.stack.elevation_level) {
        range.y += RISE_BETWEEN_NODES * leaf.cell_metres[0].max(leaf.cell_metres[1]);
    }
    range
}

fn level_marks<T: Texels>(map: &LoadMap<'_, T>, range: Vec2) -> u32 {
    let finest = map.map_at(range.x);
    let coarsest = map.map_at(range.y);
    ((2 << finest) - (1 << coarsest)) << MARK_LEVELS
}

fn marks_of_box<T: Texels>(map: &LoadMap<'_, T>, of: u32, ground: &GroundBox, marks: u32) -> u32 {
    let [band_near, band_far] = map.stack.levels[of as usize].band;
    let range = distance_range(ground, Vec3::ZERO);
    let rectangle = pyramid_rectangle(map, picture_rectangle(map, ground, range.y), PICTURE_SLACK);
    let mut found = 0;
    if rectangle.x <= rectangle.z && !outside_picture(map, ground, Vec3::ZERO, 1.0) {
        let wanted = Vec2::new(range.x.max(band_near), range.y.min(band_far));
        let own = map.wanted_marks(of, wanted.x, wanted.y) | MARK_WANTED;
        let holds = wanted.x <= wanted.y && wanted.x < band_far;
        if holds && own & !marks != 0 && shows(map, rectangle, wanted, true) {
            found = own;
        }
        let near = Vec2::new(range.x, range.y.min(RADIAL_METRES[2]));
        if of == map.stack.pattern_map && near.x < near.y {
            let every = level_marks(map, near) | radial_mark(near.x);
            if every & !marks != 0 && shows(map, rectangle, near, true) {
                found |= every;
            }
        }
    }
    let [x, y, z, ahead] = map.stack.look_ahead;
    if ahead == 0.0 || marks & MARK_AHEAD != 0 {
        return found;
    }
    let origin = Vec3::new(x, y, z);
    let there = distance_range(ground, origin);
    let wanted = Vec2::new(there.x.max(band_near), there.y.min(band_far));
    if wanted.x > wanted.y || wanted.x >= band_far || outside_picture(map, ground, origin, AHEAD_WIDENING) {
        return found;
    }
    let way = origin.length();
    let beside = rectangle.x > rectangle.z;
    if beside || shows(map, rectangle, Vec2::new(range.x - way, range.y + way), false) {
        found |= MARK_AHEAD;
    }
    found
}

/// The box of a square of the grid in a cell; `None` where nothing is there.
fn part_box<T: Texels>(
    map: &LoadMap<'_, T>,
    of: u32,
    place: UVec2,
    corner: UVec2,
    grid: UVec2,
    depth: u32,
) -> Option<GroundBox> {
    let bits = map.cell_bits(of);
    let side = ((1_u32 << bits) >> (3 + 2 * depth)).max(1);
    let range = heights_over(map, grid, side, map.stack.levels[of as usize].level);
    if range.x > range.y {
        return None;
    }
    let unit = 1.0 / (1_u32 << bits) as f32;
    let low = place.as_vec2() + (grid - corner).as_vec2() * unit;
    Some(ground_box(map, of, low, low + side as f32 * unit, range))
}

/// Tests a sub-cell of a candidate, and its parts where it may show.
pub fn test_sub_cell<T: Texels>(map: &mut LoadMap<'_, T>, index: u32, sub_cell: UVec2) {
    let of = index / MAP_CELLS;
    let place = place_of(index);
    let Some(corner) = cell_place(map, of, place) else { return };
    let bits = map.cell_bits(of);
    let grid = corner + ((sub_cell << UVec2::splat(bits)) >> UVec2::splat(3));
    test_part(map, index, corner, grid, 0);
}

/// The shader's loop, as the recursion that it stands for.
fn test_part<T: Texels>(map: &mut LoadMap<'_, T>, index: u32, corner: UVec2, grid: UVec2, depth: u32) {
    let of = index / MAP_CELLS;
    let marks = map.cells[index as usize];
    let Some(ground) = part_box(map, of, place_of(index), corner, grid, depth) else { return };
    let found = marks_of_box(map, of, &ground, marks) & !marks;
    if found == 0 {
        return;
    }
    let bits = map.cell_bits(of);
    if depth == DEEPEST_PART || bits < 3 + 2 * (depth + 1) {
        map.mark_cell(index, found);
        return;
    }
    let side = (1_u32 << bits) >> (3 + 2 * (depth + 1));
    for part in 0..PARTS * PARTS {
        let offset = UVec2::new(part % PARTS, part / PARTS) * side;
        test_part(map, index, corner, grid + offset, depth + 1);
    }
}

/// Makes a cell's word of its marks.
pub fn write_cell<T: Texels>(map: &mut LoadMap<'_, T>, index: u32) {
    let marks = map.cells[index as usize];
    if marks == 0 {
        return;
    }
    let of = index / MAP_CELLS;
    let coarsest = map.stack.levels[0].level;
    let levels = marks >> MARK_LEVELS;
    let mut word = if marks & MARK_AHEAD != 0 { AHEAD } else { 0 };
    if marks & MARK_BLENDED != 0 {
        word |= BLENDED;
    }
    if levels != 0 {
        let mut visible = 1;
        if of == map.stack.pattern_map
            && let Some(corner) = cell_place(map, of, place_of(index))
        {
            let cell = corner >> UVec2::splat(map.cell_bits(of));
            let shift = 31 - map.stack.levels[of as usize].level;
            let [column, row] = map.world.view.grid_place.map(|units| units >> shift);
            visible = u32::from(pattern_of_cell(column + cell.x, row + cell.y, map.stack.scene_seed));
        }
        let mut smallest = coarsest + levels.trailing_zeros();
        let mut largest = coarsest + levels.ilog2();
        let coarser = (marks & MARKS_COARSER) >> MARK_COARSER;
        if coarser != 0 {
            smallest -= coarser.ilog2().min(smallest);
            if levels == 1 {
                largest -= coarser.trailing_zeros().min(largest);
            }
        }
        let radial = ((marks & MARK_RADIAL) | 8).trailing_zeros();
        word |=
            visible | (255 - smallest) << SMALLEST_SHIFT | largest << LARGEST_SHIFT | radial << RADIAL_SHIFT;
        if marks & MARK_WANTED != 0 {
            word |= WANTED;
        }
    }
    map.cells[index as usize] = word;
}
