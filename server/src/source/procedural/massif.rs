//! The massif's broad shape, computed once: uplift against rivers, then ice, then a lake.
//!
//! Stream-power erosion runs on 128², 256² and 512² cells in turn (the coarse grids settle the
//! great valleys cheaply), glaciers widen the valleys to troughs, and a moraine dams one of them.

use super::erosion::{self, Flow, StreamPower};
use super::lake::{self, Lake};
use super::random::{hash, mix, signed, smoothstep, unit};
use super::river::Rivers;

/// Cells along the grid's side.
pub(super) const SIDE: usize = 512;
/// Cell size, metres.
pub(super) const CELL: f32 = 80.0;
/// x and y of the grid's first column and row, metres (rows go north).
pub(super) const ORIGIN: f64 = -0.5 * (SIDE as f64 - 1.0) * CELL as f64;
/// Height of the highest peak of the grid, metres.
const SUMMIT: f32 = 3_680.0;
/// Height of the plain that the rivers leave by, metres.
const PLAIN: f32 = 640.0;
/// Area of a cell, km².
pub(super) const CELL_SQUARE_KILOMETRES: f32 = CELL * CELL * 1e-6;

/// What is known of the massif on the grid, row-major from the south-west.
pub(super) struct Massif {
    /// Control values of the ground's spline, metres.
    pub heights: Vec<f32>,
    /// Height above the nearest stream's bed, metres.
    pub above_stream: Vec<f32>,
    /// How much lower the ground is than its surroundings at 240 m, metres.
    pub hollow: Vec<f32>,
    /// The lake.
    pub lake: Lake,
    /// The rivers.
    pub rivers: Rivers,
}

/// Place of a grid cell on the plane, metres east and north.
pub(super) fn place_of(index: usize) -> (f32, f32) {
    let origin = ORIGIN as f32;
    ((index % SIDE) as f32 * CELL + origin, (index / SIDE) as f32 * CELL + origin)
}

/// Smooth value noise of one octave in −1…1.
fn swell(x: f32, y: f32, wavelength: f32, seed: u32) -> f32 {
    let (u, v) = (x / wavelength + 1000.0, y / wavelength + 1000.0);
    let (i, j) = (u.floor(), v.floor());
    let (fu, fv) = (smoothstep(0.0, 1.0, u - i), smoothstep(0.0, 1.0, v - j));
    let at = |di: f32, dj: f32| signed(hash((i + di) as u32, (j + dj) as u32, seed));
    mix(mix(at(0.0, 0.0), at(1.0, 0.0), fu), mix(at(0.0, 1.0), at(1.0, 1.0), fu), fv)
}

/// Uplift (0…1) and erodibility (about 1) at a place.
fn tectonics(x: f32, y: f32, seed: u32) -> (f32, f32) {
    let bend_x = 2600.0 * swell(x, y, 9000.0, seed ^ 1) + 900.0 * swell(x, y, 3100.0, seed ^ 2);
    let bend_y = 2600.0 * swell(x, y, 9000.0, seed ^ 3) + 900.0 * swell(x, y, 3100.0, seed ^ 4);
    let (u, v) = (x + bend_x, y + bend_y);
    let radius = ((u / 20_500.0) * (u / 20_500.0) + (v / 19_000.0) * (v / 19_000.0)).sqrt();
    let dome = 1.0 - smoothstep(0.45, 1.12, radius);
    let relief = 0.82 + 0.30 * swell(u, v, 7000.0, seed ^ 5) + 0.16 * swell(u, v, 2600.0, seed ^ 6);
    // The great valley: a weak, less lifted band from the west to the north-east.
    let axis = (v - 0.28 * u + 1200.0) / 2600.0;
    let band = 1.0 / (1.0 + axis * axis * axis * axis);
    let uplift = (dome * relief * (1.0 - 0.45 * band)).max(0.0) + 0.075;
    let erodibility = 1.0 + 0.5 * band + 0.22 * swell(u, v, 1400.0, seed ^ 7);
    (uplift, erodibility)
}

/// One resolution of the erosion.
struct Stage {
    side: usize,
    rounds: u32,
    /// Time step (uplift of 1 a unit of time raises a cell by this many metres).
    step: f32,
}

/// Slope × √(drained area) at which rivers balance an uplift of 1, metres.
const STEEPNESS: f32 = 430.0;

/// Heights of a finer grid from a coarser over the same square.
fn refined(coarse: &[f32], from: usize, to: usize) -> Vec<f32> {
    let ratio = (from - 1) as f32 / (to - 1) as f32;
    let mut out = Vec::with_capacity(to * to);
    for y in 0..to {
        let v = y as f32 * ratio;
        let j = (v as usize).min(from - 2);
        let fv = v - j as f32;
        for x in 0..to {
            let u = x as f32 * ratio;
            let i = (u as usize).min(from - 2);
            let fu = u - i as f32;
            let at = |di: usize, dj: usize| coarse[(j + dj) * from + i + di];
            out.push(mix(mix(at(0, 0), at(1, 0), fu), mix(at(0, 1), at(1, 1), fu), fv));
        }
    }
    out
}

/// Uplift against erosion on successively finer grids.
fn eroded(seed: u32) -> Vec<f32> {
    let stages = [
        Stage { side: 128, rounds: 42, step: 260.0 },
        Stage { side: 256, rounds: 9, step: 170.0 },
        Stage { side: SIDE, rounds: 3, step: 110.0 },
    ];
    let extent = (SIDE - 1) as f32 * CELL;
    let mut heights: Vec<f32> = Vec::new();
    let mut side_before = 0;
    for stage in &stages {
        let side = stage.side;
        let cell = extent / (side - 1) as f32;
        let place = |i: usize| {
            let (x, y) = ((i % side) as f32 * cell - 0.5 * extent, (i / side) as f32 * cell - 0.5 * extent);
            (x, y)
        };
        let (uplift, erodibility): (Vec<f32>, Vec<f32>) = (0..side * side)
            .map(|i| {
                let (x, y) = place(i);
                let (uplift, erodibility) = tectonics(x, y, seed);
                (uplift * stage.step, erodibility)
            })
            .unzip();
        heights = if heights.is_empty() {
            (0..side * side)
                .map(|i| {
                    let (x, y) = place(i);
                    PLAIN + 90.0 * swell(x, y, 6000.0, seed ^ 8) + 25.0 * unit(hash(i as u32, 1, seed))
                })
                .collect()
        } else {
            let mut finer = refined(&heights, side_before, side);
            for (i, height) in finer.iter_mut().enumerate() {
                *height += 0.06 * cell * signed(hash(i as u32, side as u32, seed));
            }
            finer
        };
        let how = StreamPower { cell, strength: stage.step / STEEPNESS, steepest: 0.72 };
        let mut flow = None;
        for round in 0..stage.rounds {
            if round % 2 == 0 || flow.is_none() {
                flow = Some(erosion::route(&heights, side, 0.45, seed ^ round));
            }
            if let Some(flow) = &flow {
                erosion::erode(&mut heights, flow, &uplift, &erodibility, &how);
            }
            erosion::diffuse(&mut heights, side, 0.02);
        }
        side_before = side;
    }
    let highest = heights.iter().copied().fold(0.0, f32::max);
    let scale = (SUMMIT - PLAIN) / (highest - PLAIN);
    for height in &mut heights {
        *height = PLAIN + (*height - PLAIN) * scale;
    }
    heights
}

/// The grid bent a little everywhere, so that no valley keeps to the eight directions in which water
/// was routed.
fn bent(heights: &[f32], seed: u32) -> Vec<f32> {
    (0..SIDE * SIDE)
        .map(|i| {
            let (x, y) = place_of(i);
            let by =
                |k: u32| 260.0 * swell(x, y, 2900.0, seed ^ k) + 85.0 * swell(x, y, 1050.0, seed ^ k ^ 0x10);
            let u = ((i % SIDE) as f32 + by(0x21) / CELL).clamp(0.0, SIDE as f32 - 1.001);
            let v = ((i / SIDE) as f32 + by(0x22) / CELL).clamp(0.0, SIDE as f32 - 1.001);
            let (column, row) = (u as usize, v as usize);
            let (fu, fv) = (u - column as f32, v - row as f32);
            let at = |di: usize, dj: usize| heights[(row + dj) * SIDE + column + di];
            mix(mix(at(0, 0), at(1, 0), fu), mix(at(0, 1), at(1, 1), fu), fv)
        })
        .collect()
}

/// For each cell the nearest stream cell, by two sweeps (eight-neighbour propagation of offsets).
fn nearest_streams(flow: &Flow, least_area: f32) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    let mut nearest: Vec<u32> =
        (0..SIDE * SIDE).map(|i| if flow.area[i] >= least_area { i as u32 } else { NONE }).collect();
    let squared = |a: usize, b: u32| {
        let dx = (a % SIDE) as f32 - (b as usize % SIDE) as f32;
        let dy = (a / SIDE) as f32 - (b as usize / SIDE) as f32;
        dx * dx + dy * dy
    };
    let mut look = |i: usize, other: usize| {
        let candidate = nearest[other];
        if candidate != NONE && (nearest[i] == NONE || squared(i, candidate) < squared(i, nearest[i])) {
            nearest[i] = candidate;
        }
    };
    for _ in 0..2 {
        for y in 1..SIDE {
            for x in 1..SIDE - 1 {
                let i = y * SIDE + x;
                for other in [i - 1, i - SIDE - 1, i - SIDE, i - SIDE + 1] {
                    look(i, other);
                }
            }
            for x in (0..SIDE - 1).rev() {
                look(y * SIDE + x, y * SIDE + x + 1);
            }
        }
        for y in (0..SIDE - 1).rev() {
            for x in (1..SIDE - 1).rev() {
                let i = y * SIDE + x;
                for other in [i + 1, i + SIDE + 1, i + SIDE, i + SIDE - 1] {
                    look(i, other);
                }
            }
            for x in 1..SIDE {
                look(y * SIDE + x, y * SIDE + x - 1);
            }
        }
    }
    nearest
}

/// Distance of two cells, metres.
fn distance(a: usize, b: usize) -> f32 {
    let ((ax, ay), (bx, by)) = (place_of(a), place_of(b));
    ((ax - bx) * (ax - bx) + (ay - by) * (ay - by)).sqrt()
}

/// Glaciers widen valleys to troughs and leave flat floors of gravel.
fn glaciate(heights: &mut [f32], flow: &Flow, nearest: &[u32]) {
    let bed: Vec<f32> = heights.to_vec();
    for (i, height) in heights.iter_mut().enumerate() {
        let Some(&stream) = bed.get(nearest[i] as usize) else { continue };
        let area = flow.area[nearest[i] as usize] * CELL_SQUARE_KILOMETRES;
        let size = area.sqrt();
        let half_width = (42.0 * size).min(430.0);
        let fill = (4.5 * size).min(48.0);
        let away = distance(i, nearest[i] as usize);
        let wall = stream + fill + 0.025 * away + 1.15 * (away - half_width).max(0.0);
        let floor = stream + fill + 0.025 * away;
        *height = height.min(wall).max(floor.min(bed[i] + fill));
    }
}

impl Massif {
    /// Computes the massif.
    pub(super) fn new(seed: u32) -> Self {
        let mut heights = bent(&eroded(seed), seed);
        let flow = erosion::route(&heights, SIDE, 0.15, seed);
        let nearest = nearest_streams(&flow, 1.5 / CELL_SQUARE_KILOMETRES);
        glaciate(&mut heights, &flow, &nearest);
        erosion::diffuse(&mut heights, SIDE, 0.08);
        let lake = lake::dam(&mut heights, &flow);
        let rivers = Rivers::new(&heights, &flow, &lake, seed);
        let above_stream = (0..SIDE * SIDE)
            .map(|i| heights.get(nearest[i] as usize).map_or(500.0, |bed| heights[i] - bed))
            .collect();
        let hollow = hollows(&heights);
        Self { heights, above_stream, hollow, lake, rivers }
    }
}

/// Mean of eight cells 240 m around, less the cell's own height, metres.
fn hollows(heights: &[f32]) -> Vec<f32> {
    const REACH: usize = 3;
    let mut out = vec![0.0; SIDE * SIDE];
    for y in REACH..SIDE - REACH {
        for x in REACH..SIDE - REACH {
            let i = y * SIDE + x;
            let straight = heights[i - REACH]
                + heights[i + REACH]
                + heights[i - REACH * SIDE]
                + heights[i + REACH * SIDE];
            let across = 2 * SIDE;
            let diagonal = heights[i - across - 2]
                + heights[i - across + 2]
                + heights[i + across - 2]
                + heights[i + across + 2];
            out[i] = 0.125 * (straight + diagonal) - heights[i];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_stream_is_nearly_the_nearest() {
        let mut area = vec![1.0; SIDE * SIDE];
        let streams: Vec<usize> = (0..60_u32).map(|k| hash(k, 3, 9) as usize % (SIDE * SIDE)).collect();
        for &stream in &streams {
            area[stream] = 100.0;
        }
        let flow = Flow { order: vec![], receiver: vec![], step: vec![], area };
        let nearest = nearest_streams(&flow, 50.0);
        for k in 0..400_u32 {
            let i = hash(k, 4, 9) as usize % (SIDE * SIDE);
            let truth = streams.iter().map(|&s| distance(i, s)).fold(f32::MAX, f32::min);
            let found = distance(i, nearest[i] as usize);
            assert!(found <= truth * 1.02 + 1.0, "{found} {truth}");
        }
    }
}
