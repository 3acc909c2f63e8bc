//! The ground at any place: the massif's spline, gullies, rivers, the lake, and roughness down to 1 m.
//!
//! Everything is a function of the place alone (and of a footprint below which detail is left out,
//! for the photo). Rows are evaluated at once; each sample goes through the same operations in the
//! same order in whatever window it is computed, so its bits are the same.

use super::gullies::{self, OCTAVES, Phases};
use super::lanes::{LANES, Lanes};
use super::massif::{CELL, Massif, ORIGIN, SIDE};
use super::noise_tile::{Layout, Noise, NoiseTile, spline_slopes, spline_weights};
use super::random::{mix, smoothstep};
use super::river::NearRiver;
use crate::source::wide::wide;

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

/// One row's relief before roughness.
#[derive(Default)]
struct Shape {
    relief: Vec<f32>,
    dx: Vec<f32>,
    dy: Vec<f32>,
    rib: Vec<f32>,
    /// How strongly gullies cut, 0…1; 0 in the padding.
    strength: Vec<f32>,
    /// What roughness adds, metres.
    rough: Vec<f32>,
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
    /// Lattice coordinates of the gully octaves: u and v of every column, padded to whole lanes.
    gullies: [[Vec<u32>; 2]; 3],
    /// The broad shape and gullies of the current row, padded to whole lanes.
    shape: Shape,
    /// Noise of the current row, padded to whole lanes.
    fine: Vec<Noise>,
    /// See `fine`.
    middle: Vec<Noise>,
    /// See `fine`; zero where it was not asked for.
    broad: Vec<Noise>,
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
                    fine: FINE.of_x(x),
                    middle: MIDDLE.of_x(x),
                    broad: BROAD.of_x(x),
                }
            })
            .collect();
        let first = columns.iter().map(|c| c.cell).min().unwrap_or(1) - 1;
        let last = columns.iter().map(|c| c.cell).max().unwrap_or(1) + 2;
        let padded = columns.len().next_multiple_of(LANES);
        let line = || vec![0.0; padded];
        let gullies = OCTAVES.map(|octave| {
            let places: Vec<[u32; 2]> = x.iter().map(|&x| octave.of_x(x)).collect();
            [0, 1].map(|axis| {
                let along = places.iter().map(|place| place[axis]);
                along.chain(std::iter::repeat(0)).take(padded).collect()
            })
        });
        Self {
            land,
            gullies,
            shape: Shape {
                relief: line(),
                dx: line(),
                dy: line(),
                rib: line(),
                strength: line(),
                rough: line(),
            },
            fine: vec![Noise::default(); padded],
            middle: vec![Noise::default(); padded],
            broad: vec![Noise::default(); padded],
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
        wide!(row_of(survey: &mut Survey<'_> = self, y: f64 = y, out: &mut [Ground] = out));
    }
}

#[inline(always)]
fn row_of(survey: &mut Survey<'_>, y: f64, out: &mut [Ground]) {
    survey.fill_row(y, out);
}

impl<'a> Survey<'a> {
    #[inline(always)]
    fn fill_row(&mut self, y: f64, out: &mut [Ground]) {
        let (row, fraction) = cell_of(y);
        self.vertical_sums(row, fraction);
        self.look_up_noise(y);
        self.broad_shape();
        self.cut_gullies(y);
        self.roughen();
        let massif = &self.land.massif;
        let y = y as f32;
        for (k, (column, out)) in self.columns.iter().zip(out.iter_mut()).enumerate() {
            let at = column.cell - self.span.0;
            let linear = |line: &[f32]| mix(line[at], line[at + 1], column.fraction);
            let mut ground = Ground {
                x: column.x,
                y,
                dx: self.shape.dx[k],
                dy: self.shape.dy[k],
                rib: self.shape.rib[k],
                above_stream: linear(&self.lines[2]),
                hollow: linear(&self.lines[3]),
                above_lake: f32::MAX,
                fine: self.fine[k],
                middle: self.middle[k],
                broad: self.broad[k],
                ..Ground::default()
            };
            let mut height = self.shape.relief[k] + self.shape.rough[k];
            let cell = row * SIDE + column.cell;
            if massif.rivers.touches(cell) {
                ground.river = massif.rivers.near(cell, column.x, y);
                if let Some(river) = ground.river {
                    height = banked(height, &river);
                }
            }
            if linear(&self.lines[4]) > 0.5 {
                ground.above_lake = height - massif.lake.level;
                height = height.max(massif.lake.level);
            }
            ground.height = height;
            *out = ground;
        }
    }

    /// Reads the noise along the parallel at `y`: nothing else beside it, so that the processor waits for many
    /// places of the tables at once.
    #[inline(always)]
    fn look_up_noise(&mut self, y: f64) {
        let noise = &self.land.noise;
        let [fine_mip, middle_mip, broad_mip] = self.mips;
        let (fine, middle, broad) = (FINE.of_y(y), MIDDLE.of_y(y), BROAD.of_y(y));
        for (out, column) in self.fine.iter_mut().zip(&self.columns) {
            *out = noise.at(fine_mip, sum(column.fine, fine));
        }
        for (out, column) in self.middle.iter_mut().zip(&self.columns) {
            *out = noise.at(middle_mip, sum(column.middle, middle));
        }
        if self.with_broad {
            for (out, column) in self.broad.iter_mut().zip(&self.columns) {
                *out = noise.at(broad_mip, sum(column.broad, broad));
            }
        }
    }

    /// The spline's height and slope, and how strongly gullies cut, along the current parallel.
    #[inline(always)]
    fn broad_shape(&mut self) {
        let shape = &mut self.shape;
        for (k, column) in self.columns.iter().enumerate() {
            let at = column.cell - self.span.0;
            let spline = |line: &[f32], w: &[f32; 4]| {
                let p = &line[at - 1..at + 3];
                w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3]
            };
            shape.relief[k] = spline(&self.lines[0], &column.weights);
            shape.dx[k] = spline(&self.lines[0], &column.slopes);
            shape.dy[k] = spline(&self.lines[1], &column.weights);
            shape.rib[k] = 0.0;
        }
        for k in (0..self.columns.len()).step_by(LANES) {
            let (base, dx) = (Lanes::from(&shape.relief[k..]), Lanes::from(&shape.dx[k..]));
            let dy = Lanes::from(&shape.dy[k..]);
            let [soft, _, other, _] = transposed(&self.middle[k..]);
            let steep = (dx * dx + dy * dy).sqrt();
            let alpine = base.smoothstep(1500.0, 2500.0);
            // Some faces are furrowed deeply, others hardly.
            let furrowed = (other + soft).clamp(-1.0, 1.0) * 0.3 + 0.7;
            (steep.smoothstep(0.16, 0.8) * (alpine * 0.5 + 0.5) * furrowed).store(&mut shape.strength[k..]);
        }
    }

    /// What roughness adds to the height: ledges and blocks on rock, hummocks on grass, next to nothing on
    /// valley floors and on snow.
    #[inline(always)]
    fn roughen(&mut self) {
        let shape = &mut self.shape;
        for k in (0..self.columns.len()).step_by(LANES) {
            let (relief, dx) = (Lanes::from(&shape.relief[k..]), Lanes::from(&shape.dx[k..]));
            let dy = Lanes::from(&shape.dy[k..]);
            let [middle_soft, middle_creased, _, _] = transposed(&self.middle[k..]);
            let [fine_soft, fine_creased, _, fine_domes] = transposed(&self.fine[k..]);
            let steep = (dx * dx + dy * dy).sqrt();
            let rock = steep.smoothstep(0.5, 1.05);
            let snow = relief.smoothstep(2800.0, 3050.0) * rock.complement();
            let calm = steep.smoothstep(0.03, 0.22);
            let ledges = middle_creased * 6.5 + fine_creased * 1.7 + fine_soft * 0.5;
            let blocks = relief.smoothstep(1900.0, 2400.0) * 0.55 * (fine_domes + -0.4);
            let hummocks = (middle_soft * 1.9 + fine_soft * 0.38) * calm.mix(0.12, 1.0) + blocks * calm;
            let rough = rock * ledges + rock.complement() * (snow * -0.85 + 1.0) * hummocks;
            rough.store(&mut shape.rough[k..]);
        }
    }

    /// Adds the gullies along the parallel at `y`, some samples at a time.
    #[inline(always)]
    fn cut_gullies(&mut self, y: f64) {
        const RIB_WEIGHTS: [f32; 3] = [0.5, 0.3, 0.2];
        let shape = &mut self.shape;
        for octave in 0..OCTAVES.len() {
            if self.shares[octave] == 0.0 {
                continue;
            }
            let [row_u, row_v] = OCTAVES[octave].of_y(y);
            let [column_u, column_v] = &self.gullies[octave];
            for k in (0..shape.relief.len()).step_by(LANES) {
                let strength = Lanes::from(&shape.strength[k..]) * self.shares[octave];
                if strength == Lanes::all(0.0) {
                    continue;
                }
                let place = |column: &[u32], row: u32| -> [u32; LANES] {
                    let column = &column[k..k + LANES];
                    std::array::from_fn(|lane| column[lane].wrapping_add(row))
                };
                let (dx, dy) = (Lanes::from(&shape.dx[k..]), Lanes::from(&shape.dy[k..]));
                let at = (place(column_u, row_u), place(column_v, row_v));
                let waves = self.land.phases.waves(&OCTAVES[octave], at, (dx, dy), strength);
                (Lanes::from(&shape.relief[k..]) + waves.rise).store(&mut shape.relief[k..]);
                (dx + waves.dx).store(&mut shape.dx[k..]);
                (dy + waves.dy).store(&mut shape.dy[k..]);
                let rib = waves.value * (strength * RIB_WEIGHTS[octave]);
                (Lanes::from(&shape.rib[k..]) + rib).store(&mut shape.rib[k..]);
            }
        }
    }

    /// Sums the grid's rows for one parallel.
    #[inline(always)]
    fn vertical_sums(&mut self, row: usize, fraction: f32) {
        let massif = &self.land.massif;
        let (first, last) = self.span;
        let line = |grid: &'a [f32], row: usize| &grid[row * SIDE + first..row * SIDE + last + 1];
        let weights = spline_weights(fraction);
        let slopes = spline_slopes(fraction).map(|w| w * (1.0 / CELL));
        let [a, b, c, d]: [&[f32]; 4] = std::array::from_fn(|k| line(&massif.heights, row + k - 1));
        let weighted = |w: &[f32; 4], out: &mut [f32]| {
            for ((out, (a, b)), (c, d)) in out.iter_mut().zip(a.iter().zip(b)).zip(c.iter().zip(d)) {
                *out = w[0] * a + w[1] * b + w[2] * c + w[3] * d;
            }
        };
        weighted(&weights, &mut self.lines[0]);
        weighted(&slopes, &mut self.lines[1]);
        let grids = [&massif.above_stream, &massif.hollow, &massif.lake.mask];
        for (grid, out) in grids.into_iter().zip(&mut self.lines[2..]) {
            let (a, b) = (line(grid, row), line(grid, row + 1));
            for (out, (a, b)) in out.iter_mut().zip(a.iter().zip(b)) {
                *out = mix(*a, *b, fraction);
            }
        }
    }
}

/// Fixed-point coordinates of a place from those of its column and its row.
#[inline(always)]
fn sum(column: [u32; 2], row: [u32; 2]) -> [u32; 2] {
    [column[0].wrapping_add(row[0]), column[1].wrapping_add(row[1])]
}

/// The noise of a lane's places by kind, in the order of [`Noise`].
#[inline(always)]
fn transposed(noise: &[Noise]) -> [Lanes; 4] {
    let of = |value: fn(&Noise) -> f32| Lanes(std::array::from_fn(|k| value(&noise[k])));
    [of(|n| n.soft), of(|n| n.creased), of(|n| n.other), of(|n| n.domes)]
}

/// The ground beside a river: level with the water in its bed, and at its own height 90 m away.
#[inline(always)]
fn banked(height: f32, river: &NearRiver) -> f32 {
    let away = (river.distance - river.half_width).max(0.0);
    let bank = river.level + (0.35 * away).min(0.9);
    mix(bank, height, smoothstep(0.0, 90.0, away))
}
