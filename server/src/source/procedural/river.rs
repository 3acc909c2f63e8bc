//! Rivers as polylines: where they run, how wide, at what height.

use super::erosion::Flow;
use super::lake::Lake;
use super::massif::{CELL, CELL_SQUARE_KILOMETRES, ORIGIN, SIDE, place_of};
use super::noise_tile::spline_weights;
use super::random::{hash, signed};

/// Least drained area of a river that is drawn, km².
const LEAST_AREA: f32 = 5.0;
/// How far from its axis a river shapes the ground, metres.
pub(super) const REACH: f32 = 110.0;

/// A straight piece of a river.
#[derive(Clone, Copy, Debug)]
struct Segment {
    x: f32,
    y: f32,
    dx: f32,
    dy: f32,
    /// 1 / (dx² + dy²).
    inverse: f32,
    /// Height of the water at the start, and its change to the end, metres.
    level: f32,
    fall: f32,
    /// Half the water's width at the start, and its change to the end, metres.
    half_width: f32,
    widening: f32,
}

/// A river near a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearRiver {
    /// Distance from the axis, metres.
    pub distance: f32,
    /// Height of the water, metres.
    pub level: f32,
    /// Half the water's width, metres.
    pub half_width: f32,
}

/// All rivers, found by grid cell.
pub(super) struct Rivers {
    segments: Vec<Segment>,
    /// For each grid cell (the square between its node and the next), where its list starts in `listed`.
    starts: Vec<u32>,
    listed: Vec<u32>,
}

/// Height of the spline through the control values at a place, metres.
fn ground(heights: &[f32], x: f32, y: f32) -> f32 {
    let (u, v) = ((x - ORIGIN as f32) / CELL, (y - ORIGIN as f32) / CELL);
    let (i, j) = ((u as usize).clamp(1, SIDE - 3), (v as usize).clamp(1, SIDE - 3));
    let (wx, wy) = (spline_weights(u - i as f32), spline_weights(v - j as f32));
    let mut sum = 0.0;
    for (b, wy) in wy.iter().enumerate() {
        for (a, wx) in wx.iter().enumerate() {
            sum += wx * wy * heights[(j + b - 1) * SIDE + i + a - 1];
        }
    }
    sum
}

impl Rivers {
    /// Follows the flow from every river cell; water falls monotonically, and stands level in the lake.
    pub(super) fn new(heights: &[f32], flow: &Flow, lake: &Lake, seed: u32) -> Self {
        let least = LEAST_AREA / CELL_SQUARE_KILOMETRES;
        let is_river = |i: usize| flow.area[i] >= least;
        // The greatest donor of each river cell, for smoothing along the stream.
        let mut upstream = vec![u32::MAX; SIDE * SIDE];
        for &cell in &flow.order {
            let (i, to) = (cell as usize, flow.receiver[cell as usize] as usize);
            let better = upstream[to] == u32::MAX || flow.area[i] > flow.area[upstream[to] as usize];
            if to != i && is_river(i) && better {
                upstream[to] = cell;
            }
        }
        let cells: Vec<usize> = flow.order.iter().map(|&c| c as usize).filter(|&i| is_river(i)).collect();
        let mut places: Vec<(f32, f32)> = (0..SIDE * SIDE)
            .map(|i| {
                let (x, y) = place_of(i);
                let jitter = |k: u32| 34.0 * signed(hash(i as u32, k, seed));
                (x + jitter(11), y + jitter(12))
            })
            .collect();
        for _ in 0..3 {
            let before = places.clone();
            for &i in &cells {
                let to = flow.receiver[i] as usize;
                if to == i || upstream[i] == u32::MAX {
                    continue;
                }
                let (a, b, c) = (before[upstream[i] as usize], before[i], before[to]);
                places[i] = (0.25 * (a.0 + c.0) + 0.5 * b.0, 0.25 * (a.1 + c.1) + 0.5 * b.1);
            }
        }
        // From the sources down (reverse order): never above the ground, never rising.
        let mut levels: Vec<f32> = vec![f32::MAX; SIDE * SIDE];
        for &i in cells.iter().rev() {
            let here = ground(heights, places[i].0, places[i].1) - 0.6;
            levels[i] = levels[i].min(here);
            if lake.mask[i] > 0.5 && levels[i] < lake.level + 1.0 {
                levels[i] = lake.level;
            }
            let to = flow.receiver[i] as usize;
            if to != i {
                levels[to] = levels[to].min(levels[i] - 0.02);
            }
        }
        // Behind the moraine the river starts at the lake's level, however high the moraine is.
        let mut cell = lake.outlet;
        let mut level = lake.level;
        loop {
            levels[cell] = levels[cell].min(level);
            level = levels[cell] - 0.02;
            let to = flow.receiver[cell] as usize;
            if to == cell {
                break;
            }
            cell = to;
        }
        let half_width = |i: usize| {
            let area = flow.area[i] * CELL_SQUARE_KILOMETRES;
            (0.9 + 0.62 * area.sqrt()).min(11.0)
        };
        let mut segments = Vec::new();
        for &i in &cells {
            let to = flow.receiver[i] as usize;
            if to == i || (lake.mask[i] > 0.5 && lake.mask[to] > 0.5 && levels[to] >= lake.level - 0.5) {
                continue;
            }
            let before = if upstream[i] == u32::MAX { i } else { upstream[i] as usize };
            let after = flow.receiver[to] as usize;
            curve(
                [places[before], places[i], places[to], places[after]],
                (levels[i], levels[to]),
                (half_width(i), half_width(to)),
                &mut segments,
            );
        }
        Self::listed(segments)
    }

    fn listed(segments: Vec<Segment>) -> Self {
        let cell_range = |a: f32, b: f32| {
            let low = ((a.min(b) - REACH - ORIGIN as f32) / CELL).max(0.0) as usize;
            let high = ((a.max(b) + REACH - ORIGIN as f32) / CELL).max(0.0) as usize;
            low.min(SIDE - 1)..=high.min(SIDE - 1)
        };
        let mut by_cell: Vec<(u32, u32)> = Vec::new();
        for (number, s) in segments.iter().enumerate() {
            for j in cell_range(s.y, s.y + s.dy) {
                for i in cell_range(s.x, s.x + s.dx) {
                    by_cell.push(((j * SIDE + i) as u32, number as u32));
                }
            }
        }
        by_cell.sort_unstable();
        let mut starts = vec![0_u32; SIDE * SIDE + 1];
        for &(cell, _) in &by_cell {
            starts[cell as usize + 1] += 1;
        }
        for i in 0..SIDE * SIDE {
            starts[i + 1] += starts[i];
        }
        Self { segments, starts, listed: by_cell.into_iter().map(|(_, number)| number).collect() }
    }

    /// Whether any river comes near the grid cell.
    #[inline(always)]
    pub(super) fn touches(&self, cell: usize) -> bool {
        self.starts[cell] != self.starts[cell + 1]
    }

    /// The nearest river within [`REACH`] of a place in the grid cell.
    pub(super) fn near(&self, cell: usize, x: f32, y: f32) -> Option<NearRiver> {
        let list = &self.listed[self.starts[cell] as usize..self.starts[cell + 1] as usize];
        let mut best: Option<(f32, NearRiver)> = None;
        for &number in list {
            let s = &self.segments[number as usize];
            let (px, py) = (x - s.x, y - s.y);
            let t = ((px * s.dx + py * s.dy) * s.inverse).clamp(0.0, 1.0);
            let (ex, ey) = (px - t * s.dx, py - t * s.dy);
            let distance = (ex * ex + ey * ey).sqrt();
            let half_width = s.half_width + t * s.widening;
            // Of two rivers the one whose bank is nearer.
            let bank = distance - half_width;
            if distance < REACH && best.is_none_or(|(least, _)| bank < least) {
                best = Some((bank, NearRiver { distance, level: s.level + t * s.fall, half_width }));
            }
        }
        best.map(|(_, near)| near)
    }

    /// The least height of any river's water, metres (+∞ without rivers).
    pub(super) fn lowest(&self) -> f32 {
        self.segments.iter().map(|s| s.level.min(s.level + s.fall)).fold(f32::INFINITY, f32::min)
    }

    /// The greatest height of water on the grid cell's rivers, if there are any, metres.
    pub(super) fn highest(&self, cell: usize) -> Option<f32> {
        let list = &self.listed[self.starts[cell] as usize..self.starts[cell + 1] as usize];
        list.iter().map(|&n| self.segments[n as usize].level).reduce(f32::max)
    }
}

/// A Catmull–Rom piece from the second to the third point, in four straight segments.
fn curve(points: [(f32, f32); 4], levels: (f32, f32), widths: (f32, f32), out: &mut Vec<Segment>) {
    const PIECES: u16 = 4;
    let [a, b, c, d] = points;
    let at = |t: f32| {
        let blend = |a: f32, b: f32, c: f32, d: f32| {
            0.5 * (2.0 * b
                + t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a))))
        };
        (blend(a.0, b.0, c.0, d.0), blend(a.1, b.1, c.1, d.1))
    };
    for piece in 0..PIECES {
        let (t0, t1) = (f32::from(piece) / f32::from(PIECES), f32::from(piece + 1) / f32::from(PIECES));
        let ((x, y), (ex, ey)) = (at(t0), at(t1));
        let (dx, dy) = (ex - x, ey - y);
        let between = |ends: (f32, f32), t: f32| ends.0 + t * (ends.1 - ends.0);
        out.push(Segment {
            x,
            y,
            dx,
            dy,
            inverse: 1.0 / (dx * dx + dy * dy).max(1e-6),
            level: between(levels, t0),
            fall: between(levels, t1) - between(levels, t0),
            half_width: between(widths, t0),
            widening: between(widths, t1) - between(widths, t0),
        });
    }
}
