//! The stack of nested maps of a view: which level each stands for, where it lies, and at which
//! distances its level is wanted. Worked out in f64; what the shader gets is relative to the eye.

use crate::stream::root_grid::RootGrid;
use crate::stream::view::ViewGeometry;
use glam::DVec3;
use treeline_core::geodesy;
use treeline_core::seeds::pattern;
use treeline_core::tile::{self, MAXIMUM_LEVEL, TileAddress};
use treeline_shaders::load_map::{LoadMapFrame, LoadMapLevel, MAPS, RADIAL_METRES, SIDE};

/// What a distance is that nothing reaches.
const ENDLESS: f32 = 3.0e38;
/// No surface is nearer to the eye than this, metres.
const NEAREST_METRES: f64 = 0.5;

/// What is asked of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StackOptions {
    /// Deepest level that any layer has.
    pub deepest: u8,
    /// Deepest level that the elevation has.
    pub elevation: u8,
    /// A texel may fill this many pixels.
    pub texel_pixels: f64,
    /// Bounds of the scene's heights, metres.
    pub heights: (f64, f64),
    /// The scene's seed, where it has vegetation.
    pub vegetation: Option<u32>,
    /// Where the eye will be when what is asked for now has come, metres from the eye (east-north-up).
    pub look_ahead: Option<DVec3>,
}

/// The stack of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    /// What the shader gets.
    pub frame: LoadMapFrame,
    grid: RootGrid,
}

impl Stack {
    /// Of a view over a root grid.
    pub fn new(view: &ViewGeometry, grid: &RootGrid, options: &StackOptions) -> Self {
        let texel_angle = options.texel_pixels * view.pixel_angle;
        let nearest = (view.eye.height - options.heights.1).max(NEAREST_METRES);
        let deepest = options.deepest.min(MAXIMUM_LEVEL).max(grid.level);
        let wanted = level_at(nearest, texel_angle, deepest).max(grid.level);
        let reach = f64::from(RADIAL_METRES[2]);
        let seed = options.vegetation.filter(|_| nearest < reach && grid.level <= pattern::LEVEL);
        let finest = if seed.is_some() { wanted.max(pattern::LEVEL) } else { wanted };
        let coarsest = grid.level.max(finest.saturating_sub(MAPS as u8 - 1));
        let mut frame = LoadMapFrame {
            eye: [
                view.eye.latitude.to_radians().sin() as f32,
                view.eye.latitude.to_radians().cos() as f32,
                view.eye.height as f32,
                geodesy::prime_vertical_radius(view.eye.latitude) as f32,
            ],
            look_ahead: options
                .look_ahead
                .map_or([0.0; 4], |offset| [offset.x as f32, offset.y as f32, offset.z as f32, 1.0]),
            heights: [options.heights.0 as f32, options.heights.1 as f32],
            maps: u32::from(finest - coarsest) + 1,
            pattern_map: seed.map_or(u32::MAX, |_| u32::from(pattern::LEVEL.wrapping_sub(coarsest))),
            scene_seed: seed.unwrap_or(0),
            texel_angle: texel_angle as f32,
            elevation_level: u32::from(options.elevation),
            coarser_from: match coarsest {
                0 => ENDLESS,
                _ => (tile::cell_metres(coarsest - 1) / texel_angle) as f32,
            },
            ..LoadMapFrame::default()
        };
        for (map, level) in frame.levels.iter_mut().zip(coarsest..=finest) {
            *map = place(view, grid, level);
            map.band = band(level, coarsest, wanted, texel_angle);
        }
        Self { frame, grid: *grid }
    }

    /// Maps in use.
    pub fn maps(&self) -> usize {
        self.frame.maps as usize
    }

    /// Matrix level of a map.
    pub fn level(&self, map: usize) -> u8 {
        self.frame.levels[map].level as u8
    }

    /// The tile of a cell of the stack; `None` for a map not in use and outside the grid.
    pub fn address(&self, cell: usize) -> Option<TileAddress> {
        let side = SIDE as usize;
        let map = cell / (side * side);
        if map >= self.maps() {
            return None;
        }
        let level = &self.frame.levels[map];
        let down = level.level - u32::from(self.grid.level);
        let (columns, rows) = (self.grid.columns << down, self.grid.rows << down);
        let mut column = i64::from(level.first[0]) + (cell % side) as i64;
        let row = i64::from(level.first[1]) + (cell / side % side) as i64;
        if self.grid.wraps() && columns > SIDE {
            column = column.rem_euclid(i64::from(columns));
        }
        if !(0..i64::from(columns)).contains(&column) || !(0..i64::from(rows)).contains(&row) {
            return None;
        }
        Some(TileAddress {
            level: level.level as u8,
            row: (self.grid.first_row << down) + row as u32,
            column: ((self.grid.first_column << down) + column as u32) % tile::columns(level.level as u8),
        })
    }

    /// The level that a point at a distance (metres) wants.
    pub fn wanted_level(&self, distance: f32) -> u8 {
        let maps = &self.frame.levels[..self.maps()];
        let map = maps.iter().position(|map| distance >= map.band[0]).unwrap_or(0);
        maps[map].level as u8
    }
}

/// The coarsest level whose texel fills no more than the angle at a distance; `deepest` at most.
fn level_at(distance: f64, texel_angle: f64, deepest: u8) -> u8 {
    (0..deepest).find(|&level| tile::cell_metres(level) <= texel_angle * distance).unwrap_or(deepest)
}

/// Distances at which a level is wanted, where `wanted` is the deepest that anything can want.
fn band(level: u8, coarsest: u8, wanted: u8, texel_angle: f64) -> [f32; 2] {
    if level > wanted {
        return [ENDLESS, ENDLESS];
    }
    let from = |level: u8| (tile::cell_metres(level) / texel_angle) as f32;
    [
        if level == wanted { 0.0 } else { from(level) },
        if level == coarsest { ENDLESS } else { from(level - 1) },
    ]
}

/// The window of a level's map: centred on the viewer, and no farther outside the grid than it must be.
fn place(view: &ViewGeometry, grid: &RootGrid, level: u8) -> LoadMapLevel {
    let down = level - grid.level;
    let span = tile::span_degrees(level);
    let all = f64::from(tile::columns(level));
    let (columns, rows) = (grid.columns << down, grid.rows << down);
    let mut x = ((view.eye.longitude + 180.0) / span - f64::from(grid.first_column << down)).rem_euclid(all);
    if x > 0.5 * (f64::from(columns) + all) {
        // Nearer to the grid's west edge than, the other way round, to its east edge.
        x -= all;
    }
    let y = (90.0 - view.eye.latitude) / span - f64::from(grid.first_row << down);
    let half = f64::from(SIDE / 2);
    let first = |place: f64, cells: u32, wraps: bool| {
        let centred = place.floor() - half;
        if wraps {
            return centred as i32;
        }
        let slack = i64::from(cells) - i64::from(SIDE);
        (centred as i64).clamp(slack.min(0), slack.max(0)) as i32
    };
    let first = [first(x, columns, grid.wraps() && columns > SIDE), first(y, rows, false)];
    LoadMapLevel {
        first,
        eye: [(x - f64::from(first[0])) as f32, (y - f64::from(first[1])) as f32],
        span: span.to_radians() as f32,
        level: u32::from(level),
        ..LoadMapLevel::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use treeline_core::camera::GeographicCamera;
    use treeline_core::tile::GeographicBox;

    fn view(lon: f64, lat: f64, height: f64) -> ViewGeometry {
        let camera =
            GeographicCamera { lon, lat, height, heading_deg: 0.0, pitch_deg: -20.0, fov_y_deg: 50.0 };
        ViewGeometry::new(&camera, 640, 480)
    }

    fn options(deepest: u8) -> StackOptions {
        StackOptions {
            deepest,
            elevation: deepest,
            texel_pixels: 1.42,
            heights: (0.0, 3_000.0),
            vegetation: None,
            look_ahead: None,
        }
    }

    fn cell_of(stack: &Stack, map: usize, longitude: f64, latitude: f64) -> Option<usize> {
        let tile = TileAddress::at(stack.level(map), longitude, latitude);
        let side = (SIDE * SIDE) as usize;
        (map * side..(map + 1) * side).find(|&cell| stack.address(cell) == Some(tile))
    }

    proptest! {
        /// The tile under the eye, and those around it, are in every map; and the eye's place is right.
        #[test]
        fn the_viewer_is_in_the_middle(lon in 5.0..15.0_f64, lat in 44.0..50.0_f64, height in 1.0..9_000.0_f64) {
            let extent = GeographicBox { west: 5.0, south: 44.0, east: 15.0, north: 50.0 };
            let grid = RootGrid::of_scene(&extent, 18);
            let stack = Stack::new(&view(lon, lat, height), &grid, &options(18));
            for map in 0..stack.maps() {
                let cell = cell_of(&stack, map, lon, lat);
                prop_assert!(cell.is_some());
                let index = cell.unwrap() as u32 % (SIDE * SIDE);
                let level = &stack.frame.levels[map];
                prop_assert!((f64::from(level.eye[0]) - f64::from(index % SIDE)).clamp(0.0, 1.0) - (f64::from(level.eye[0]) - f64::from(index % SIDE)) < 1e-4);
                prop_assert_eq!(level.eye[1].floor() as u32, index / SIDE);
            }
        }

        /// Bands leave no gap and do not overlap; each level is the coarsest that is fine enough.
        #[test]
        fn every_distance_wants_one_level(distance in 0.6..1.0e6_f64) {
            let grid = RootGrid::covering(&GeographicBox { west: 10.0, south: 46.0, east: 11.0, north: 47.0 }, 7);
            let stack = Stack::new(&view(10.5, 46.5, 100.0), &grid, &options(19));
            let level = stack.wanted_level(distance as f32);
            let angle = f64::from(stack.frame.texel_angle);
            let fine = |level: u8| tile::cell_metres(level) <= angle * distance * (1.0 + 1e-6);
            let too_fine = |level: u8| tile::cell_metres(level) <= angle * distance * (1.0 - 1e-6);
            prop_assert!(fine(level) || level == 19);
            prop_assert!(level == 7 || !too_fine(level - 1));
            let holding = stack.frame.levels[..stack.maps()].iter().filter(|map| {
                (map.band[0]..map.band[1]).contains(&(distance as f32))
            }).count();
            prop_assert_eq!(holding, 1);
        }
    }

    #[test]
    fn a_map_goes_on_across_the_antimeridian() {
        let grid =
            RootGrid::covering(&GeographicBox { west: -180.0, south: -90.0, east: 180.0, north: 90.0 }, 2);
        let stack = Stack::new(&view(179.999, 10.0, 50.0), &grid, &options(14));
        for map in 0..stack.maps() {
            for longitude in [179.9999, -179.9999] {
                assert!(cell_of(&stack, map, longitude, 10.0).is_some(), "{map} {longitude}");
            }
        }
    }

    #[test]
    fn no_tile_stands_twice_in_a_map() {
        let world = GeographicBox { west: -180.0, south: -90.0, east: 180.0, north: 90.0 };
        let grid = RootGrid::covering(&world, 2);
        for place in [(0.0, 0.0), (-180.0, 89.99), (77.0, -90.0)] {
            let stack = Stack::new(&view(place.0, place.1, 2.0e6), &grid, &options(14));
            let mut seen = std::collections::HashSet::new();
            for cell in 0..treeline_shaders::load_map::CELLS as usize {
                if let Some(address) = stack.address(cell) {
                    assert!(address.row < tile::rows(address.level) && seen.insert(address), "{address}");
                }
            }
            assert!(seen.len() > 64);
        }
    }

    #[test]
    fn from_afar_no_deep_level_is_looked_at() {
        let grid = RootGrid::covering(&GeographicBox { west: 10.0, south: 46.0, east: 11.0, north: 47.0 }, 7);
        let near = Stack::new(&view(10.5, 46.5, 100.0), &grid, &options(19));
        let far = Stack::new(&view(10.5, 46.5, 100_000.0), &grid, &options(19));
        assert_eq!(near.level(near.maps() - 1), 19);
        assert!(far.level(far.maps() - 1) < 10);
        let forest = StackOptions { vegetation: Some(7), ..options(12) };
        let stack = Stack::new(&view(10.5, 46.5, 100.0), &grid, &forest);
        assert_eq!(stack.level(stack.frame.pattern_map as usize), pattern::LEVEL);
        assert_eq!(stack.wanted_level(0.1), 12);
        assert_eq!(Stack::new(&view(10.5, 46.5, 9_000.0), &grid, &forest).frame.pattern_map, u32::MAX);
    }
}
