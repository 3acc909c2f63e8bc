//! The ground at any place: the massif's spline, gullies, rivers, the lake, and roughness down to 1 m.
//!
//! Everything is a function of the place alone (and of a footprint below which detail is left out,
//! for the photo). Rows are evaluated at once; each sample goes through the same operations in the
//! same order in whatever window it is computed, so its bits are the same.

use super::gullies::{self, OCTAVES, Phases};
use super::massif::{CELL, Massif, ORIGIN, SIDE};
use super::noise_tile::{Layout, Noise, NoiseTile, spline_slopes, spline_weights};
use super::random::{mix, smoothstep};
use super::river::NearRiver;

/// Seed of the whole landscape.
const SEED: u32 = 0x7ee1_1e05;
/// Boulders and tufts: waves of 48 m … 1.5 m.
const FINE: Layout = Layout::new(0.75, 0.8, 0.6);
/// Humps and ledges: waves of 220 m … 7 m.
const MIDDLE: Layout = Layout::new(3.45, 0.28, -0.96);
/// Patches of vegetation, snow fields: waves of 1.6 km … 50 m.
const BROAD: Layout = Layout::new(25.0, 0.6, 0.8);
/// Roughness is at most this, up or down, metres.
const ROUGHNESS_BOUND: f32 = 9.0;

/// The landscape, computed once.
pub(super) struct Landscape {
    /// Broad shape, lake, rivers.
    pub massif: Massif,
    noise: NoiseTile,
    phases: Phases,
}

impl Landscape {
    /// Computes it (a fifth of a second in release).
    pub(super) fn new() -> Self {
        let (massif, noise) = rayon::join(|| Massif::new(SEED), || NoiseTile::new(SEED ^ 0x0f0f));
        Self { massif, noise, phases: Phases::new(SEED ^ 0x00aa) }
    }

    /// For the grid cells first..=last (columns, then rows), an upper bound of the ground there, metres.
    pub(super) fn bound(&self, columns: (usize, usize), rows: (usize, usize)) -> f32 {
        let mut highest = f32::MIN;
        for row in rows.0.saturating_sub(1)..=(rows.1 + 2).min(SIDE - 1) {
            let line = &self.massif.heights[row * SIDE..(row + 1) * SIDE];
            let part = &line[columns.0.saturating_sub(1)..=(columns.1 + 2).min(SIDE - 1)];
            highest = part.iter().copied().fold(highest, f32::max);
        }
        highest += gullies::bound() + ROUGHNESS_BOUND;
        for row in rows.0..=rows.1.min(SIDE - 1) {
            for column in columns.0..=columns.1.min(SIDE - 1) {
                let cell = row * SIDE + column;
                if let Some(level) = self.massif.rivers.highest(cell) {
                    highest = highest.max(level + 1.0);
                }
            }
        }
        highest.max(self.massif.lake.level)
    }

    /// A lower bound of all ground, metres.
    pub(super) fn lower_bound(&self) -> f32 {
        let lowest = self.massif.heights.iter().copied().fold(f32::MAX, f32::min);
        lowest.min(self.massif.rivers.lowest()) - gullies::bound() - ROUGHNESS_BOUND
    }
}

/// Grid cell of a coordinate on the plane, and the fraction within it.
pub(super) fn cell_of(coordinate: f64) -> (usize, f32) {
    let u = (coordinate - ORIGIN) * (1.0 / f64::from(CELL));
    let cell = u.floor().clamp(1.0, SIDE as f64 - 3.0);
    (cell as usize, (u - cell) as f32)
}

/// What is needed of a column, worked out once.
struct Column {
    x: f32,
    cell: usize,
    fraction: f32,
    weights: [f32; 4],
    slopes: [f32; 4],
    gullies: [[u32; 2]; 3],
    fine: [u32; 2],
    middle: [u32; 2],
    broad: [u32; 2],
}

/// The ground at one place.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ground {
    /// Metres east on the plane.
    pub x: f32,
    /// Metres north on the plane.
    pub y: f32,
    /// Metres; the water's surface where there is water.
    pub height: f32,
    /// Ground above the lake's level, metres, near the lake: negative under water. Large elsewhere.
    pub above_lake: f32,
    /// Slope eastward (rise over run), gullies included, roughness not.
    pub dx: f32,
    /// Slope northward.
    pub dy: f32,
    /// Sum of the gullies' waves, −1…1: negative in gullies.
    pub rib: f32,
    /// Metres above the nearest stream's bed.
    pub above_stream: f32,
    /// Metres by which the surroundings are higher.
    pub hollow: f32,
    /// The nearest river, if it is near.
    pub river: Option<NearRiver>,
    /// Noise at three scales.
    pub fine: Noise,
    /// See `fine`.
    pub middle: Noise,
    /// See `fine`; zero where it was not asked for.
    pub broad: Noise,
}

/// Evaluates rows of the ground over fixed columns.
pub(super) struct Survey<'a> {
    land: &'a Landscape,
    columns: Vec<Column>,
    /// First and last grid column touched.
    span: (usize, usize),
    /// Share of each gully octave that the footprint lets through.
    shares: [f32; 3],
    mips: [usize; 3],
    with_broad: bool,
    /// Vertical sums over the span: height, slope northward, stream, hollow, lake.
    lines: [Vec<f32>; 5],
}

impl<'a> Survey<'a> {
    /// Columns at `x` (metres east). Detail shorter than twice the footprint (metres) is left out;
    /// 0 keeps all. `with_broad` also reads the broad noise.
    pub(super) fn new(land: &'a Landscape, x: &[f64], footprint: f32, with_broad: bool) -> Self {
        let columns: Vec<Column> = x
            .iter()
            .map(|&x| {
                let (cell, fraction) = cell_of(x);
                Column {
                    x: x as f32,
                    cell,
                    fraction,
                    weights: spline_weights(fraction),
                    slopes: spline_slopes(fraction).map(|w| w * (1.0 / CELL)),
                    gullies: OCTAVES.map(|octave| octave.of_x(x)),
                    fine: FINE.of_x(x),
                    middle: MIDDLE.of_x(x),
                    broad: BROAD.of_x(x),
                }
            })
            .collect();
        let first = columns.iter().map(|c| c.cell).min().unwrap_or(1) - 1;
        let last = columns.iter().map(|c| c.cell).max().unwrap_or(1) + 2;
        Self {
            land,
            columns,
            span: (first, last),
            shares: OCTAVES.map(|o| 1.0 - smoothstep(0.25 * o.wavelength, 0.6 * o.wavelength, footprint)),
            mips: [FINE.mip(footprint), MIDDLE.mip(footprint), BROAD.mip(footprint)],
            with_broad,
            lines: std::array::from_fn(|_| vec![0.0; last - first + 1]),
        }
    }

    /// Columns.
    pub(super) fn width(&self) -> usize {
        self.columns.len()
    }

    /// Fills `out` (one a column) with the ground along the parallel at `y` (metres north).
    pub(super) fn row(&mut self, y: f64, out: &mut [Ground]) {
        let (row, fraction) = cell_of(y);
        self.vertical_sums(row, fraction);
        let gullies = OCTAVES.map(|octave| octave.of_y(y));
        let (fine, middle, broad) = (FINE.of_y(y), MIDDLE.of_y(y), BROAD.of_y(y));
        let massif = &self.land.massif;
        let lake_level = massif.lake.level;
        let y = y as f32;
        for (column, out) in self.columns.iter().zip(out.iter_mut()) {
            let at = column.cell - self.span.0;
            let spline = |line: &[f32], w: &[f32; 4]| {
                w[0] * line[at - 1] + w[1] * line[at] + w[2] * line[at + 1] + w[3] * line[at + 2]
            };
            let linear = |line: &[f32]| mix(line[at], line[at + 1], column.fraction);
            let base = spline(&self.lines[0], &column.weights);
            let mut dx = spline(&self.lines[0], &column.slopes);
            let mut dy = spline(&self.lines[1], &column.weights);
            let steep = (dx * dx + dy * dy).sqrt();
            let alpine = smoothstep(1500.0, 2500.0, base);
            let noise = |mip: usize, a: [u32; 2], b: [u32; 2]| {
                self.land.noise.at(mip, a[0].wrapping_add(b[0]), a[1].wrapping_add(b[1]))
            };
            let middle_noise = noise(self.mips[1], column.middle, middle);
            // Some faces are furrowed deeply, others hardly.
            let furrowed = 0.7 + 0.3 * (middle_noise.other + middle_noise.soft).clamp(-1.0, 1.0);
            let strength = smoothstep(0.16, 0.8, steep) * (0.5 + 0.5 * alpine) * furrowed;
            let (mut relief, mut rib) = (base, 0.0);
            if strength > 0.0 {
                for k in 0..OCTAVES.len() {
                    if self.shares[k] == 0.0 {
                        continue;
                    }
                    let place = &column.gullies[k];
                    let (u, v) = (place[0].wrapping_add(gullies[k][0]), place[1].wrapping_add(gullies[k][1]));
                    let strength = strength * self.shares[k];
                    let wave = self.land.phases.wave(&OCTAVES[k], u, v, dx, dy, strength);
                    relief += wave.rise;
                    dx += wave.dx;
                    dy += wave.dy;
                    rib += strength * wave.value * [0.5, 0.3, 0.2][k];
                }
            }
            let mut ground = Ground {
                x: column.x,
                y,
                dx,
                dy,
                rib,
                above_stream: linear(&self.lines[2]),
                hollow: linear(&self.lines[3]),
                above_lake: f32::MAX,
                fine: noise(self.mips[0], column.fine, fine),
                middle: middle_noise,
                ..Ground::default()
            };
            if self.with_broad {
                ground.broad = noise(self.mips[2], column.broad, broad);
            }
            let mut height = relief + roughness(relief, &ground);
            let cell = row * SIDE + column.cell;
            if massif.rivers.touches(cell) {
                ground.river = massif.rivers.near(cell, column.x, y);
                if let Some(river) = ground.river {
                    height = banked(height, &river);
                }
            }
            if linear(&self.lines[4]) > 0.5 {
                ground.above_lake = height - lake_level;
                height = height.max(lake_level);
            }
            ground.height = height;
            *out = ground;
        }
    }

    /// Sums the grid's rows for one parallel.
    fn vertical_sums(&mut self, row: usize, fraction: f32) {
        let massif = &self.land.massif;
        let (first, last) = self.span;
        let line = |grid: &'a [f32], row: usize| &grid[row * SIDE + first..row * SIDE + last + 1];
        let weights = spline_weights(fraction);
        let slopes = spline_slopes(fraction).map(|w| w * (1.0 / CELL));
        let h: [&[f32]; 4] = std::array::from_fn(|k| line(&massif.heights, row + k - 1));
        for i in 0..=last - first {
            let p = [h[0][i], h[1][i], h[2][i], h[3][i]];
            let sum = |w: &[f32; 4]| w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3];
            self.lines[0][i] = sum(&weights);
            self.lines[1][i] = sum(&slopes);
        }
        let grids = [&massif.above_stream, &massif.hollow, &massif.lake.mask];
        for (grid, out) in grids.into_iter().zip(&mut self.lines[2..]) {
            let (a, b) = (line(grid, row), line(grid, row + 1));
            for (out, (a, b)) in out.iter_mut().zip(a.iter().zip(b)) {
                *out = mix(*a, *b, fraction);
            }
        }
    }
}

/// Height that roughness adds, metres: ledges and blocks on rock, hummocks on grass, next to nothing
/// on valley floors and on snow.
#[inline(always)]
fn roughness(relief: f32, ground: &Ground) -> f32 {
    let steep = (ground.dx * ground.dx + ground.dy * ground.dy).sqrt();
    let rock = smoothstep(0.5, 1.05, steep);
    let snow = smoothstep(2800.0, 3050.0, relief) * (1.0 - rock);
    let calm = smoothstep(0.03, 0.22, steep);
    let (fine, middle) = (&ground.fine, &ground.middle);
    let ledges = 6.5 * middle.creased + 1.7 * fine.creased + 0.5 * fine.soft;
    let blocks = smoothstep(1900.0, 2400.0, relief) * 0.55 * (fine.domes - 0.4);
    let hummocks = (1.9 * middle.soft + 0.38 * fine.soft) * mix(0.12, 1.0, calm) + blocks * calm;
    rock * ledges + (1.0 - rock) * (1.0 - 0.85 * snow) * hummocks
}

/// The ground beside a river: level with the water in its bed, and at its own height 90 m away.
#[inline(always)]
fn banked(height: f32, river: &NearRiver) -> f32 {
    let away = (river.distance - river.half_width).max(0.0);
    let bank = river.level + (0.35 * away).min(0.9);
    mix(bank, height, smoothstep(0.0, 90.0, away))
}
