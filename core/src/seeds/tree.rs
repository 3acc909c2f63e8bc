//! Trees: candidates that the land cover lets live.

use super::pattern::{CELL_UNITS, CellRow, ROWS, candidate, pattern_of_cell};
use super::species::{HEIGHT_UNITS, Species};

/// What grows at a place, as the land cover's level 1 has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Stand {
    /// Species code, 0 for none.
    pub species: u8,
    /// Share of the ground under trees, 0 … 255: the density of trees follows it.
    pub closure: u8,
    /// Mean height of the trees in quarter metres, 0 for the species' own.
    pub height: u8,
}

/// Stands lower than this (2 m) are the ground's texture, not trees. Quarter metres.
pub const LEAST_STAND_HEIGHT: u8 = 8;

impl Stand {
    /// The stand's species, where any tree grows.
    pub fn species<'a>(&self, table: &'a [Species]) -> Option<&'a Species> {
        let index = usize::from(self.species).checked_sub(1)?;
        let grows = self.closure > 0 && (self.height == 0 || self.height >= LEAST_STAND_HEIGHT);
        table.get(index).filter(|_| grows)
    }

    /// Share of the candidates that live, of 65536. Lower stands are denser: as crowns shrink with the
    /// height, trees stand closer in proportion, until every candidate lives.
    pub fn share(&self, species: &Species) -> u32 {
        let share = (species.share * u32::from(self.closure) / 255).min(65_535);
        if self.height == 0 {
            return share;
        }
        // Both factors are below 2¹⁶.
        (share * species.mean_height() / (u32::from(self.height) * (HEIGHT_UNITS / 4))).min(65_536)
    }
}

/// A tree. Its anchor's height is the terrain's at its place, on the scene's anchor level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tree {
    /// Units east of 180° W ([`super::place`]); goes on past the antimeridian as its window does.
    pub x: i64,
    /// Units south of the north pole.
    pub y: i64,
    /// Index in the species table.
    pub species: usize,
    /// Height, 1/1024 m.
    pub height: u32,
    /// Turn about its axis, 1/256 of a turn.
    pub rotation: u8,
}

impl Tree {
    /// Height, metres (exact).
    pub fn height_metres(&self) -> f32 {
        self.height as f32 / HEIGHT_UNITS as f32
    }
}

/// A rectangle of places, units ([`super::place`]); x may run past the antimeridian either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Western edge.
    pub west: i64,
    /// Northern edge.
    pub north: i64,
    /// Eastern edge, excluded.
    pub east: i64,
    /// Southern edge, excluded.
    pub south: i64,
}

impl Window {
    /// Whether a place lies in it.
    pub fn contains(&self, x: i64, y: i64) -> bool {
        (self.west..self.east).contains(&x) && (self.north..self.south).contains(&y)
    }
}

/// Calls `visit` for every tree whose foot lies in the window, cell by cell. `stand_at` gives the
/// land cover at a place in the window (x unwrapped, as in [`Tree`]).
pub fn for_each_tree(
    window: &Window,
    scene_seed: u32,
    table: &[Species],
    mut stand_at: impl FnMut(i64, i64) -> Stand,
    mut visit: impl FnMut(Tree),
) {
    if window.east <= window.west || window.south <= window.north || table.is_empty() {
        return;
    }
    let side = i64::from(CELL_UNITS);
    let rows = window.north.max(0).div_euclid(side)..=(window.south - 1).div_euclid(side);
    for row in rows {
        let Ok(cell_row) = u32::try_from(row).map(CellRow::new) else { break };
        if cell_row.columns == 0 {
            continue;
        }
        let north = row * side;
        // Sub-rows of this cell that the window touches.
        let sub_rows = clipped(window.north - north, window.south - north, ROWS);
        for column in window.west.div_euclid(side)..=(window.east - 1).div_euclid(side) {
            let west = column * side;
            let sub_columns = clipped(window.west - west, window.east - west, cell_row.columns);
            let pattern = pattern_of_cell(column.rem_euclid(1 << 32) as u32, cell_row.row, scene_seed);
            for j in sub_rows.clone() {
                for i in sub_columns.clone() {
                    let place = candidate(pattern, cell_row.columns, i, j);
                    let (x, y) = (west + i64::from(place.x), north + i64::from(place.y));
                    if !window.contains(x, y) {
                        continue;
                    }
                    let stand = stand_at(x, y);
                    let Some(species) = stand.species(table) else { continue };
                    // Shares are per area, candidates per sub-cell: a wider sub-cell keeps more.
                    if place.rank >= (stand.share(species) * cell_row.aspect) >> 14 {
                        continue;
                    }
                    visit(Tree {
                        x,
                        y,
                        species: usize::from(stand.species) - 1,
                        height: species.tree_height(place.size, stand.height),
                        rotation: place.rotation,
                    });
                }
            }
        }
    }
}

/// The sub-cells of a cell, of `count` along its side, that units `from` to `to` of it may touch.
fn clipped(from: i64, to: i64, count: u32) -> std::ops::Range<u32> {
    let side = i64::from(CELL_UNITS);
    let first = from.clamp(0, side) * i64::from(count) / side;
    let last = (to.clamp(0, side) * i64::from(count) + side - 1) / side;
    // Candidates' places are rounded down: one may stand on its sub-cell's western edge less a unit.
    first as u32..(last as u32 + 1).min(count)
}

#[cfg(test)]
#[path = "tree_tests.rs"]
mod tests;
