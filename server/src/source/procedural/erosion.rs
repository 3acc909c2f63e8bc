//! Rivers carve: flow routing over a height grid and implicit stream-power erosion.
//!
//! Every cell drains to the grid's border. Cells are visited from the border upwards with a bucket
//! queue (a priority flood of linear cost); a cell's receiver was visited before it, so the order
//! of the visits is also the order in which the implicit scheme solves (Braun & Willett 2013).

use super::random::{hash, unit};

/// Buckets of the queue: heights are sorted to range / BUCKETS, which is all that routing needs.
const BUCKETS: usize = 4096;
/// Least rise from cell to cell across a filled hollow, metres.
const FILL_RISE: f32 = 0.02;
/// √2, the length of a diagonal step in cells.
const DIAGONAL: f32 = std::f32::consts::SQRT_2;
/// Steps to the eight neighbours: column, row, length in cells.
const NEIGHBOURS: [(isize, isize, f32); 8] = [
    (1, 0, 1.0),
    (0, 1, 1.0),
    (-1, 0, 1.0),
    (0, -1, 1.0),
    (1, 1, DIAGONAL),
    (-1, 1, DIAGONAL),
    (-1, -1, DIAGONAL),
    (1, -1, DIAGONAL),
];

/// Which way water runs.
pub(super) struct Flow {
    /// Cells, each after its receiver.
    pub order: Vec<u32>,
    /// Where a cell's water goes; border cells receive their own.
    pub receiver: Vec<u32>,
    /// Distance to the receiver in cells.
    pub step: Vec<f32>,
    /// Drained area in cells, the cell itself included.
    pub area: Vec<f32>,
}

/// Routes water over a square grid. `wander` (0…1) lets a cell prefer a way that is not quite the
/// steepest, by chance, which keeps rivers from following the grid's eight directions.
pub(super) fn route(heights: &[f32], side: usize, wander: f32, seed: u32) -> Flow {
    const NONE: u32 = u32::MAX;
    let count = side * side;
    let (low, high) = heights.iter().fold((f32::MAX, f32::MIN), |(a, b), &h| (a.min(h), b.max(h)));
    let scale = (BUCKETS - 1) as f32 / (high - low).max(1.0);
    let bucket = |height: f32| (((height - low) * scale) as usize).min(BUCKETS - 1);
    let mut heads = vec![NONE; BUCKETS];
    let mut next = vec![NONE; count];
    let mut filled = vec![0.0_f32; count];
    // 0: not seen, 1: queued, 2: visited.
    let mut state = vec![0_u8; count];
    let mut receiver = vec![NONE; count];
    let mut step = vec![1.0_f32; count];
    let mut order = Vec::with_capacity(count);
    for index in 0..count {
        let (x, y) = (index % side, index / side);
        if x == 0 || y == 0 || x == side - 1 || y == side - 1 {
            filled[index] = heights[index];
            state[index] = 1;
            receiver[index] = index as u32;
            let at = bucket(heights[index]);
            next[index] = heads[at];
            heads[at] = index as u32;
        }
    }
    let mut at = 0;
    while at < BUCKETS {
        let cell = heads[at];
        if cell == NONE {
            at += 1;
            continue;
        }
        let index = cell as usize;
        heads[at] = next[index];
        state[index] = 2;
        order.push(cell);
        let (x, y) = (index % side, index / side);
        let border = x == 0 || y == 0 || x == side - 1 || y == side - 1;
        let mut steepest = 0.0;
        for (turn, &(dx, dy, length)) in NEIGHBOURS.iter().enumerate() {
            let (nx, ny) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            if nx >= side || ny >= side {
                continue;
            }
            let other = ny * side + nx;
            match state[other] {
                0 => {
                    let level = heights[other].max(filled[index] + FILL_RISE);
                    filled[other] = level;
                    state[other] = 1;
                    receiver[other] = cell;
                    step[other] = length;
                    let place = bucket(level).max(at);
                    next[other] = heads[place];
                    heads[place] = other as u32;
                }
                2 if !border => {
                    let chance = unit(hash(cell, turn as u32, seed));
                    let slope = (filled[index] - filled[other]) / length * (1.0 - wander * chance);
                    if slope > steepest {
                        steepest = slope;
                        receiver[index] = other as u32;
                        step[index] = length;
                    }
                }
                _ => {}
            }
        }
    }
    let mut area = vec![1.0_f32; count];
    for &cell in order.iter().rev() {
        let to = receiver[cell as usize];
        if to != cell {
            area[to as usize] += area[cell as usize];
        }
    }
    Flow { order, receiver, step, area }
}

/// How a grid is eroded.
pub(super) struct StreamPower {
    /// Cell size, metres.
    pub cell: f32,
    /// Erodibility × time step: per square root of drained square metres, metres.
    pub strength: f32,
    /// Steepest slope that rock holds at this cell size (rise over run).
    pub steepest: f32,
}

/// One implicit step of dz/dt = uplift − K·√A·slope, then slopes steeper than rock holds fall.
/// `uplift` is metres for this step, `erodibility` a factor on the strength; border cells stay.
pub(super) fn erode(
    heights: &mut [f32],
    flow: &Flow,
    uplift: &[f32],
    erodibility: &[f32],
    how: &StreamPower,
) {
    for &cell in &flow.order {
        let index = cell as usize;
        let to = flow.receiver[index] as usize;
        if to == index {
            continue;
        }
        let length = flow.step[index] * how.cell;
        let power = how.strength * erodibility[index] * (flow.area[index]).sqrt() * how.cell / length;
        let raised = heights[index] + uplift[index];
        let solved =
            if raised > heights[to] { (raised + power * heights[to]) / (1.0 + power) } else { raised };
        heights[index] = solved.min(heights[to] + how.steepest * (1.6 - 0.6 * erodibility[index]) * length);
    }
}

/// One explicit step of diffusion (hillslope creep): `amount` 0…0.25 of the difference to the mean of
/// the four neighbours times four; border cells stay.
pub(super) fn diffuse(heights: &mut [f32], side: usize, amount: f32) {
    let before = heights.to_vec();
    for y in 1..side - 1 {
        for x in 1..side - 1 {
            let i = y * side + x;
            let around = before[i - 1] + before[i + 1] + before[i - side] + before[i + side];
            heights[i] = before[i] + amount * (around - 4.0 * before[i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bumpy(side: usize) -> Vec<f32> {
        (0..side * side).map(|i| 100.0 * unit(hash(i as u32, 0, 3))).collect()
    }

    #[test]
    fn every_cell_drains_to_the_border_and_receivers_come_first() {
        let side = 40;
        let flow = route(&bumpy(side), side, 0.3, 1);
        assert_eq!(flow.order.len(), side * side);
        let mut seen = vec![false; side * side];
        let mut drained = 0.0;
        for &cell in &flow.order {
            let to = flow.receiver[cell as usize];
            assert!(to == cell || seen[to as usize]);
            if to == cell {
                drained += flow.area[cell as usize];
            }
            seen[cell as usize] = true;
        }
        assert_eq!(drained as usize, side * side, "all water leaves");
    }

    #[test]
    fn rivers_hold_the_uplift_and_water_runs_down() {
        let side = 40;
        let mut heights = bumpy(side);
        let ones = vec![1.0; side * side];
        let uplift = vec![10.0; side * side];
        let how = StreamPower { cell: 10.0, strength: 0.5, steepest: 1.0 };
        for _ in 0..30 {
            let flow = route(&heights, side, 0.0, 1);
            erode(&mut heights, &flow, &uplift, &ones, &how);
        }
        // Without rivers the ground would stand 300 m higher than at first.
        assert!(heights.iter().copied().fold(0.0, f32::max) < 300.0);
        let flow = route(&heights, side, 0.0, 1);
        let up_hill = flow
            .order
            .iter()
            .filter(|&&cell| heights[flow.receiver[cell as usize] as usize] > heights[cell as usize])
            .count();
        assert!(up_hill < side * side / 50, "{up_hill} cells drain uphill");
    }
}
