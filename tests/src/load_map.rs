//! The Tile Load Map of a [`TileWorld`] by the twin, and the truth about the tiles that a picture shows.

use crate::tile_world::{Frame, TileWorld, alpine_height, sampled};
use glam::{DVec3, UVec2};
use std::collections::BTreeSet;
use treeline_client::stream::load_map::stack::{Stack, StackOptions};
use treeline_client::stream::root_grid::RootGrid;
use treeline_client::stream::view::ViewGeometry;
use treeline_core::camera::GeographicCamera;
use treeline_core::grid::LatticeWindow;
use treeline_core::tile::TileAddress;
use treeline_shaders::twin::load_map::LoadMap as Twin;

/// Deepest level of the photo: two more than the tiles of the world.
pub const DEEPEST: u8 = 15;

/// 2 × 2 tiles of level 11 about a place, finer about their middle.
pub fn world_about(lon: f64, lat: f64, samples: &dyn Fn(&LatticeWindow) -> Vec<f32>) -> TileWorld {
    let root = TileAddress::at(11, lon, lat);
    let middle = TileAddress { level: 11, row: root.row + 1, column: root.column + 1 }.bounds();
    let split = |square: TileAddress| {
        let (lon, lat) = square.bounds().centre();
        let away = (lon - middle.west).hypot(lat - middle.north);
        square.level < 13 && away < f64::from(14 - square.level) * 0.022
    };
    TileWorld::sampled(root, [2, 2], samples, &split, &|_| false, &|_| 1.0)
}

/// Hills by a formula.
pub fn analytic_world() -> TileWorld {
    world_about(11.0, 47.0, &|window| sampled(window, &alpine_height))
}

/// Height of a world's surface at a place.
pub fn ground(world: &TileWorld, lon: f64, lat: f64) -> f64 {
    let (tile, place) = world.tile_at(lon, lat).expect("a place of the world");
    tile.surface(place).expect("no void")
}

/// A view of a world, with the stack of maps that the client makes for it.
pub struct Scene<'a> {
    /// The world.
    pub world: &'a TileWorld,
    /// Its frame.
    pub frame: Frame,
    /// Its maps.
    pub stack: Stack,
    /// Who looks.
    pub camera: GeographicCamera,
}

impl<'a> Scene<'a> {
    /// Of a camera; textures are there down to the level `deepest`, `vegetation` has a seed.
    pub fn new(
        world: &'a TileWorld,
        camera: GeographicCamera,
        size: [u32; 2],
        deepest: u8,
        vegetation: Option<u32>,
        look_ahead: Option<DVec3>,
    ) -> Self {
        let (root, [columns, rows]) = world.roots();
        let grid =
            RootGrid { level: root.level, first_column: root.column, first_row: root.row, columns, rows };
        let view = ViewGeometry::new(&camera, size[0], size[1]);
        let options = StackOptions {
            deepest,
            elevation: 0,
            texel_pixels: 1.42,
            heights: world.range(),
            vegetation,
            look_ahead,
        };
        let mut frame = world.frame(&camera, size);
        frame.view.grid_place = grid.place();
        Self { world, frame, stack: Stack::new(&view, &grid, &options), camera }
    }

    /// By the twin, of what the GPU saw.
    pub fn by_twin<'b>(&'b self, distances: &[f32], hits: &[[u32; 4]]) -> Twin<'b, TileWorld> {
        Twin::of_picture(self.world.bound(&self.frame), &self.stack.frame, distances, hits)
    }

    /// What the twin of the terrain pass sees in a picture of `finer` × `finer` rays a pixel.
    pub fn picture(&self, finer: u32) -> (Vec<f32>, Vec<[u32; 4]>) {
        let size = self.frame.view.size.map(|side| side * finer);
        let frame = self.world.frame(&self.camera, size);
        (0..size[0] * size[1])
            .map(|index| {
                let hit = self.world.by_twin(&frame, UVec2::new(index % size[0], index / size[0]));
                let [u, v] = hit.place.to_array().map(f32::to_bits);
                (hit.distance, [hit.leaf, u, v, hit.fetches])
            })
            .unzip()
    }

    /// The tiles that the rays of a picture hit, each on the level that its distance wants.
    pub fn tiles_of(&self, distances: &[f32], hits: &[[u32; 4]]) -> BTreeSet<TileAddress> {
        let mut tiles = BTreeSet::new();
        for (&distance, hit) in distances.iter().zip(hits) {
            if distance < 0.0 {
                continue;
            }
            let tile = self.world.tile_of(hit[0]).address;
            let place = [hit[1], hit[2]].map(|bits| f64::from(f32::from_bits(bits)) / 512.0);
            let level = self.stack.wanted_level(distance);
            let bounds = tile.bounds();
            let side = bounds.east - bounds.west;
            let at = |x: f64| x.clamp(0.0, 1.0 - 1e-12) * side;
            tiles.insert(TileAddress::at(level, bounds.west + at(place[0]), bounds.north - at(place[1])));
        }
        tiles
    }

    /// The tiles of the cells whose word (or count) satisfies.
    pub fn named(&self, words: &[u32], is: impl Fn(u32) -> bool) -> BTreeSet<TileAddress> {
        words
            .iter()
            .enumerate()
            .filter(|&(_, &word)| is(word))
            .map(|(cell, _)| self.stack.address(cell).expect("nothing is named outside the grid"))
            .collect()
    }
}
