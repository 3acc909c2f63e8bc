//! The last frame as the CPU twins see it: for the place under the pointer, and for the count of rays
//! that the pass missed.

use crate::stream::Stream;
use crate::stream::decode::ELEVATION_SIDE;
use crate::stream::page_table::Tables;
use glam::{DVec3, UVec2};
use std::cell::OnceCell;
use std::sync::Arc;
use treeline_core::tile::CELLS;
use treeline_shaders::layout::{EMPTY, EYE_BELOW, VOID_HEIGHT, View};
use treeline_shaders::twin::maximum_mip::Pyramid;
use treeline_shaders::twin::ray::Ray;
use treeline_shaders::twin::terrain::{cast_ray, pixel_share, view_ray};
use treeline_shaders::twin::{Texels, World};

/// A resident tile: its heights, and its pyramid once it is needed.
struct Tile {
    heights: Arc<[f32]>,
    /// Of the maxima and of the minima.
    pyramids: [OnceCell<Pyramid>; 2],
}

impl Tile {
    fn pyramid(&self, minimum: bool) -> &Pyramid {
        self.pyramids[usize::from(minimum)]
            .get_or_init(|| Pyramid::new(&self.heights, ELEVATION_SIDE, ELEVATION_SIDE, 1, minimum))
    }
}

/// The tiles of a frame by slot.
struct Slots(Vec<Option<Tile>>);

impl Slots {
    fn of(stream: &Stream, tables: &Tables) -> Self {
        let mut slots: Vec<Option<Tile>> = Vec::new();
        for (leaf, tile) in tables.leaves.iter().zip(&tables.leaf_tiles) {
            let Some(summary) = tile.and_then(|tile| stream.summary(&tile)) else { continue };
            if leaf.slot == EMPTY {
                continue;
            }
            let slot = leaf.slot as usize;
            if slots.len() <= slot {
                slots.resize_with(slot + 1, || None);
            }
            slots[slot].get_or_insert_with(|| Tile {
                heights: Arc::clone(&summary.heights),
                pyramids: Default::default(),
            });
        }
        Self(slots)
    }

    fn tile(&self, slot: u32) -> Option<&Tile> {
        self.0.get(slot as usize)?.as_ref()
    }
}

impl Texels for Slots {
    fn height(&self, slot: u32, x: i32, y: i32) -> f32 {
        let side = ELEVATION_SIDE as i32;
        if !(0..side).contains(&x) || !(0..side).contains(&y) {
            return VOID_HEIGHT;
        }
        self.tile(slot).map_or(VOID_HEIGHT, |tile| tile.heights[(y * side + x) as usize])
    }

    fn maximum(&self, slot: u32, mip: u32, x: i32, y: i32) -> f32 {
        self.tile(slot).map_or(VOID_HEIGHT, |tile| tile.pyramid(false).at(mip, x, y))
    }

    fn minimum(&self, slot: u32, mip: u32, x: i32, y: i32) -> f32 {
        self.tile(slot).map_or(VOID_HEIGHT, |tile| tile.pyramid(true).at(mip, x, y))
    }

    fn levels(&self) -> u32 {
        CELLS.ilog2()
    }
}

fn world<'a>(view: &'a View, tables: &'a Tables, texels: &'a Slots) -> World<'a, Slots> {
    let use_minima = view.flags & EYE_BELOW != 0;
    World { view, nodes: &tables.nodes, leaves: &tables.leaves, texels, sheet: None, use_minima }
}

/// Distance in metres to the first hit along a direction (unit, east-north-up at the eye).
pub fn cast(stream: &Stream, view: &View, tables: &Tables, direction: DVec3) -> Option<f64> {
    let slots = Slots::of(stream, tables);
    let ray = Ray { origin: glam::Vec3::ZERO, direction: direction.as_vec3() };
    // Where two leaves fade into each other the coarser one answers: it is complete.
    let hit = cast_ray(&world(view, tables, &slots), &ray, 1.0);
    (hit.distance >= 0.0).then(|| f64::from(hit.distance))
}

/// Whether the twin hits, for each pixel, row-major from the top left.
pub fn hits(stream: &Stream, view: &View, tables: &Tables) -> Vec<bool> {
    let slots = Slots::of(stream, tables);
    let world = world(view, tables, &slots);
    let [width, height] = view.size;
    (0..height)
        .flat_map(|y| (0..width).map(move |x| UVec2::new(x, y)))
        .map(|pixel| cast_ray(&world, &view_ray(view, pixel), pixel_share(pixel)).distance >= 0.0)
        .collect()
}
