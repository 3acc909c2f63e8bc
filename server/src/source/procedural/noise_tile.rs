//! A periodic tile of noise, with mips: all fine structure of ground, cover and photo is read from it
//! at several scales and turns.
//!
//! Reading a table costs a tenth of evaluating octaves, and a coarser mip is the tile without what
//! a footprint would alias. Coordinates are 32-bit fixed point, one turn of the integer a period:
//! they wrap by themselves and are the same wherever they are computed.

use super::random::{hash, mix, signed, unit};

/// log2 of the texels along the tile's side.
const SIDE_BITS: u32 = 9;
/// Texels along the tile's side.
pub(super) const SIDE: usize = 1 << SIDE_BITS;
/// Mips: SIDE … 4 texels.
const MIPS: usize = SIDE_BITS as usize - 1;

/// What the tile holds, each in −1…1 (domes: 0…1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Noise {
    /// Smooth hummocks: fractional Brownian motion.
    pub soft: f32,
    /// Creased: ridged octaves, as in rock.
    pub creased: f32,
    /// Smooth, unrelated to the first.
    pub other: f32,
    /// Round domes about eight texels apart, as crowns or boulders: 1 on top, 0 between.
    pub domes: f32,
}

/// The tile.
pub(super) struct NoiseTile {
    mips: Vec<Vec<Texel>>,
}

/// A texel's four values, in the order of [`Noise`], loaded at once.
#[repr(align(16))]
#[derive(Clone, Copy, Debug)]
struct Texel([f32; 4]);

/// A scale and turn at which the tile is laid over the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// Fixed-point units per metre along u: of x, of y.
    u: [f64; 2],
    /// Fixed-point units per metre along v: of x, of y.
    v: [f64; 2],
    /// Metres per texel.
    texel: f64,
}

impl Layout {
    /// The tile with texels of `texel` metres, turned so that its u axis runs along (cosine, sine)
    /// (a unit vector).
    pub(super) const fn new(texel: f64, cosine: f64, sine: f64) -> Self {
        let units = 4_294_967_296.0 / (SIDE as f64 * texel);
        Self { u: [units * cosine, units * sine], v: [-units * sine, units * cosine], texel }
    }

    /// Fixed-point (u, v) contributed by x.
    pub(super) fn of_x(&self, x: f64) -> [u32; 2] {
        [fixed(self.u[0] * x), fixed(self.v[0] * x)]
    }

    /// Fixed-point (u, v) contributed by y; the sum (wrapping) with that of x is the place.
    pub(super) fn of_y(&self, y: f64) -> [u32; 2] {
        [fixed(self.u[1] * y), fixed(self.v[1] * y)]
    }

    /// The mip whose texel is as long as the footprint (metres), at least the finest.
    pub(super) fn mip(&self, footprint: f32) -> usize {
        let mut mip = 0;
        let mut texel = self.texel as f32;
        while mip + 1 < MIPS && texel * 1.5 < footprint {
            texel *= 2.0;
            mip += 1;
        }
        mip
    }
}

fn fixed(value: f64) -> u32 {
    // Through i64, so that it wraps instead of saturating.
    (value.round() as i64) as u32
}

impl NoiseTile {
    /// Makes the tile.
    pub(super) fn new(seed: u32) -> Self {
        let channels = [
            octaves(seed, 0.62, |v| v),
            octaves(seed ^ 0x51, 0.6, |v| 1.0 - 3.2 * v.abs()),
            octaves(seed ^ 0xa7, 0.5, |v| v),
            domes(seed ^ 0x33),
        ];
        let texels: Vec<Texel> =
            (0..SIDE * SIDE).map(|i| Texel(std::array::from_fn(|k| channels[k][i]))).collect();
        let mut mips = vec![texels];
        while mips.len() < MIPS {
            let side = SIDE >> mips.len();
            let finer = &mips[mips.len() - 1];
            let mean = |i: usize| {
                let at = 4 * side * (i / side) + 2 * (i % side);
                let four = [at, at + 1, at + 2 * side, at + 2 * side + 1].map(|at| finer[at].0);
                Texel(std::array::from_fn(|k| 0.25 * (four[0][k] + four[1][k] + four[2][k] + four[3][k])))
            };
            let coarser = (0..side * side).map(mean).collect();
            mips.push(coarser);
        }
        Self { mips }
    }

    /// The noise at fixed-point (u, v), bilinear in a mip.
    #[inline(always)]
    pub(super) fn at(&self, mip: usize, [u, v]: [u32; 2]) -> Noise {
        let bits = SIDE_BITS - mip as u32;
        let texels = &self.mips[mip];
        // Texels stand at their centres in every mip, so that mips lie over one another.
        let half = 1_u32 << (31 - bits);
        let (u, v) = (u.wrapping_sub(half), v.wrapping_sub(half));
        let (i, j) = ((u >> (32 - bits)) as usize, (v >> (32 - bits)) as usize);
        let mask = (1_usize << bits) - 1;
        let fraction = |a: u32| ((a << bits) >> 8) as i32 as f32 * (1.0 / 16_777_216.0);
        let (fu, fv) = (fraction(u), fraction(v));
        let (i1, row, row1) = ((i + 1) & mask, j << bits, ((j + 1) & mask) << bits);
        let (a, b) = (&texels[row + i].0, &texels[row + i1].0);
        let (c, d) = (&texels[row1 + i].0, &texels[row1 + i1].0);
        let [soft, creased, other, domes] =
            std::array::from_fn(|k| mix(mix(a[k], b[k], fu), mix(c[k], d[k], fu), fv));
        Noise { soft, creased, other, domes }
    }
}

/// Sums octaves of periodic smooth noise (periods of 64 … 2 texels), each passed through `shape`,
/// shifted to mean 0, scaled so that three standard deviations are 1, and clamped to −1…1.
fn octaves(seed: u32, gain: f32, shape: impl Fn(f32) -> f32) -> Vec<f32> {
    let mut sum = vec![0.0_f32; SIDE * SIDE];
    let mut amplitude = 1.0;
    for octave in 0..6 {
        let cells = 8_usize << octave;
        let layer = upsampled(cells, seed.wrapping_add(octave as u32 * 0x1357));
        for (total, value) in sum.iter_mut().zip(&layer) {
            *total += amplitude * shape(*value);
        }
        amplitude *= gain;
    }
    let count = sum.len() as f32;
    let mean = sum.iter().sum::<f32>() / count;
    let variance = sum.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / count;
    let scale = 1.0 / (3.0 * variance.sqrt());
    sum.iter().map(|v| ((v - mean) * scale).clamp(-1.0, 1.0)).collect()
}

/// A periodic lattice of cells × cells random values, raised to the tile's size by cubic B-splines.
fn upsampled(cells: usize, seed: u32) -> Vec<f32> {
    let stride = SIDE / cells;
    let lattice: Vec<f32> =
        (0..cells * cells).map(|i| signed(hash((i % cells) as u32, (i / cells) as u32, seed))).collect();
    let weights: Vec<[f32; 4]> =
        (0..stride).map(|k| spline_weights((k as f32 + 0.5) / stride as f32)).collect();
    let mask = cells - 1;
    let mut wide = vec![0.0; cells * SIDE];
    for (row, line) in wide.chunks_exact_mut(SIDE).enumerate() {
        let from = &lattice[row * cells..(row + 1) * cells];
        for (cell, out) in line.chunks_exact_mut(stride).enumerate() {
            let p = [0, 1, 2, 3].map(|k| from[(cell + k) & mask]);
            for (value, w) in out.iter_mut().zip(&weights) {
                *value = w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3];
            }
        }
    }
    let mut out = vec![0.0; SIDE * SIDE];
    for (row, line) in out.chunks_exact_mut(SIDE).enumerate() {
        let (cell, w) = (row / stride, weights[row % stride]);
        let from = [0, 1, 2, 3].map(|k| &wide[((cell + k) & mask) * SIDE..][..SIDE]);
        for (i, value) in line.iter_mut().enumerate() {
            *value = w[0] * from[0][i] + w[1] * from[1][i] + w[2] * from[2][i] + w[3] * from[3][i];
        }
    }
    out
}

/// Weights of the uniform cubic B-spline at a fraction of the middle interval.
pub(super) fn spline_weights(t: f32) -> [f32; 4] {
    let s = 1.0 - t;
    let sixth = 1.0 / 6.0;
    [
        s * s * s * sixth,
        (3.0 * t * t * t - 6.0 * t * t + 4.0) * sixth,
        (3.0 * s * s * s - 6.0 * s * s + 4.0) * sixth,
        t * t * t * sixth,
    ]
}

/// Derivatives of [`spline_weights`] by the fraction.
pub(super) fn spline_slopes(t: f32) -> [f32; 4] {
    let s = 1.0 - t;
    [-0.5 * s * s, 0.5 * (3.0 * t * t - 4.0 * t), 0.5 * (4.0 * s - 3.0 * s * s), 0.5 * t * t]
}

/// Domes over jittered points, one in each 8 × 8 texels.
fn domes(seed: u32) -> Vec<f32> {
    const CELL: usize = 8;
    let cells = SIDE / CELL;
    let points: Vec<[f32; 3]> = (0..cells * cells)
        .map(|i| {
            let (x, y) = ((i % cells) as u32, (i / cells) as u32);
            let size = 0.55 + 0.3 * unit(hash(x, y, seed ^ 2));
            [unit(hash(x, y, seed)), unit(hash(x, y, seed ^ 1)), 1.0 / (size * size)]
        })
        .collect();
    (0..SIDE * SIDE)
        .map(|i| {
            let (px, py) = (i % SIDE, i / SIDE);
            let (cx, cy) = (px / CELL, py / CELL);
            let fx = ((px % CELL) as f32 + 0.5) / CELL as f32;
            let fy = ((py % CELL) as f32 + 0.5) / CELL as f32;
            let mut best = 0.0_f32;
            for dy in 0..3 {
                for dx in 0..3 {
                    let index = ((cy + cells + dy - 1) % cells) * cells + (cx + cells + dx - 1) % cells;
                    let [x, y, sharp] = points[index];
                    let (ex, ey) = (x + dx as f32 - 1.0 - fx, y + dy as f32 - 1.0 - fy);
                    best = best.max(1.0 - (ex * ex + ey * ey) * sharp);
                }
            }
            best
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stay_in_their_ranges_and_mips_keep_the_mean() {
        let tile = NoiseTile::new(5);
        let mean = |mip: usize| {
            tile.mips[mip].iter().map(|n| f64::from(n.0[0])).sum::<f64>() / tile.mips[mip].len() as f64
        };
        for texel in &tile.mips[0] {
            assert!(texel.0[..3].iter().all(|v| v.abs() <= 1.0));
            assert!((0.0..=1.0).contains(&texel.0[3]));
        }
        assert!((mean(0) - mean(MIPS - 1)).abs() < 1e-5);
    }

    #[test]
    fn it_is_continuous_across_its_period() {
        let tile = NoiseTile::new(5);
        let (a, b) = (tile.at(0, [u32::MAX, 77 << 20]), tile.at(0, [0, 77 << 20]));
        assert!((a.soft - b.soft).abs() < 1e-3 && (a.creased - b.creased).abs() < 1e-3);
    }

    #[test]
    fn spline_weights_are_a_partition_of_one_and_their_slopes_their_derivative() {
        for k in 0..=20 {
            let t = k as f32 / 20.0;
            assert!((spline_weights(t).iter().sum::<f32>() - 1.0).abs() < 1e-6);
            assert!(spline_weights(t).iter().all(|&w| w >= 0.0), "needed for bounds by control values");
            let (a, b, slope) = (spline_weights(t - 0.01), spline_weights(t + 0.01), spline_slopes(t));
            for i in 0..4 {
                assert!(((b[i] - a[i]) / 0.02 - slope[i]).abs() < 1e-3);
            }
        }
    }
}
