//! A moraine dams the great valley, and a lake fills it to its brim.

use super::erosion::Flow;
use super::massif::{CELL, CELL_SQUARE_KILOMETRES, SIDE, place_of};
use super::random::smoothstep;

/// The lake: water stands at `level` wherever `mask` (bilinear) exceeds ½ and the ground is lower.
pub(super) struct Lake {
    /// Height of the surface, metres.
    pub level: f32,
    /// 1 in and around the basin, 0 elsewhere (on the massif's grid).
    pub mask: Vec<f32>,
    /// Grid cell of the outlet.
    pub outlet: usize,
}

/// Area that the search prefers, km².
const WANTED_AREA: f32 = 9.0;
/// Largest area that it accepts, km².
const LARGEST_AREA: f32 = 16.0;
/// The moraine's crest above the water, metres.
const FREEBOARD: f32 = 9.0;

/// Finds the best place, raises the moraine in `heights` and returns the lake behind it.
pub(super) fn dam(heights: &mut [f32], flow: &Flow) -> Lake {
    let mut best = (f32::MIN, 0_usize, 0.0_f32);
    for (i, &cells) in flow.area.iter().enumerate() {
        let area = cells * CELL_SQUARE_KILOMETRES;
        let (x, y) = place_of(i);
        let from_centre = (x * x + y * y).sqrt();
        if !(40.0..400.0).contains(&area) || from_centre > 9_000.0 || i % 3 != 0 {
            continue;
        }
        for rise in [60.0, 90.0, 125.0, 165.0] {
            let level = heights[i] + rise;
            let flooded = basin(heights, flow, i, level);
            let size = flooded.len() as f32 * CELL_SQUARE_KILOMETRES;
            if flooded.is_empty() || size > LARGEST_AREA {
                continue;
            }
            let moraine = ridge(heights, flow, i, level);
            let volume: f32 = moraine.iter().map(|&(j, top)| (top - heights[j]).max(0.0)).sum();
            let score = -(size - WANTED_AREA).abs() - 0.0002 * volume - from_centre * 0.0005;
            if score > best.0 {
                best = (score, i, level);
            }
        }
    }
    let (_, outlet, level) = best;
    for (j, top) in ridge(heights, flow, outlet, level) {
        heights[j] = heights[j].max(top);
    }
    let flooded = basin(heights, flow, outlet, level);
    let mut mask = vec![0.0_f32; SIDE * SIDE];
    for &i in flooded.iter().chain([&outlet]) {
        // Two cells beyond the water, so that the fine shoreline lies wholly inside.
        for dy in 0..5 {
            for dx in 0..5 {
                mask[(i / SIDE + dy - 2) * SIDE + i % SIDE + dx - 2] = 1.0;
            }
        }
    }
    // The far side of the moraine is no lake bed.
    let (ox, oy) = place_of(outlet);
    let (ax, ay) = downstream(flow, outlet);
    for (i, value) in mask.iter_mut().enumerate() {
        let (x, y) = place_of(i);
        let (dx, dy) = (x - ox, y - oy);
        if dx * dx + dy * dy < 2_500.0 * 2_500.0 && dx * ax + dy * ay > 1.2 * CELL {
            *value = 0.0;
        }
    }
    Lake { level, mask, outlet }
}

/// Unit vector down the valley at a cell: towards the tenth cell that its water reaches.
fn downstream(flow: &Flow, cell: usize) -> (f32, f32) {
    let mut end = cell;
    for _ in 0..10 {
        end = flow.receiver[end] as usize;
    }
    let ((x, y), (ex, ey)) = (place_of(cell), place_of(end));
    let length = ((ex - x) * (ex - x) + (ey - y) * (ey - y)).sqrt().max(1.0);
    ((ex - x) / length, (ey - y) / length)
}

/// The moraine across the valley at `cell`: cells and the height of its top there, metres.
fn ridge(heights: &[f32], flow: &Flow, cell: usize, level: f32) -> Vec<(usize, f32)> {
    const REACH: isize = 24;
    let (ax, ay) = downstream(flow, cell);
    let (cx, cy) = place_of(cell);
    let mut out = Vec::new();
    for dy in -REACH..=REACH {
        for dx in -REACH..=REACH {
            let (x, y) = ((cell % SIDE).wrapping_add_signed(dx), (cell / SIDE).wrapping_add_signed(dy));
            if x >= SIDE || y >= SIDE {
                continue;
            }
            let index = y * SIDE + x;
            let (px, py) = place_of(index);
            let along = (px - cx) * ax + (py - cy) * ay;
            let across = -(px - cx) * ay + (py - cy) * ax;
            // Bowed: the glacier's tongue pushed its middle down the valley.
            let bowed = along - 120.0 + across * across * (1.0 / 6_000.0);
            let flank = if bowed > 0.0 { 0.20 } else { 0.30 };
            let fade = 1.0 - smoothstep(1_200.0, 1_900.0, across.abs());
            let top = level + FREEBOARD * (1.0 + 0.0006 * across.abs()) - flank * bowed.abs();
            if fade > 0.0 && top > heights[index] {
                out.push((index, heights[index] + (top - heights[index]) * fade));
            }
        }
    }
    out
}

/// Cells that water at `level` covers behind `outlet`: connected, lower than the level, and draining
/// through the outlet. Empty where it comes near the grid's border or is larger than any use.
fn basin(heights: &[f32], flow: &Flow, outlet: usize, level: f32) -> Vec<usize> {
    let (ax, ay) = downstream(flow, outlet);
    let (ox, oy) = place_of(outlet);
    let limit = (1.3 * LARGEST_AREA / CELL_SQUARE_KILOMETRES) as usize;
    let mut seen = std::collections::HashSet::from([outlet]);
    let mut found = vec![outlet];
    let mut next = 0;
    while let Some(&cell) = found.get(next) {
        next += 1;
        let (x, y) = (cell % SIDE, cell / SIDE);
        if x < 8 || y < 8 || x > SIDE - 9 || y > SIDE - 9 || found.len() > limit {
            return Vec::new();
        }
        for other in [cell - 1, cell + 1, cell - SIDE, cell + SIDE] {
            let (px, py) = place_of(other);
            let beyond = (px - ox) * ax + (py - oy) * ay > 0.5 * CELL;
            let near = (px - ox) * (px - ox) + (py - oy) * (py - oy) < 2_500.0 * 2_500.0;
            if heights[other] < level && !(beyond && near) && seen.insert(other) {
                found.push(other);
            }
        }
    }
    found
}
