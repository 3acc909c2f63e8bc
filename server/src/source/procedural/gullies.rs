//! Gullies and ribs that run down every steep slope, at any place without neighbours' help.
//!
//! A wave across the fall line, on a lattice of random phases blended from cell to cell: its crests
//! are ribs, its troughs gullies. Each octave follows the slope that the coarser ones have made, so
//! that small gullies join larger ones, as running water would have it.

use super::lanes::{LANES, Lanes};
use super::random::{hash, unit};

/// Lattice cells in one turn of the 32-bit fixed-point coordinates.
const TURN_CELLS: f64 = 1024.0;
/// Bits of a fixed-point coordinate below the cell.
const FRACTION_BITS: u32 = 22;
/// log2 of the side of the table of phases.
const TABLE_BITS: u32 = 7;
/// Amplitude of the waves where they are strongest, per metre of wavelength.
const AMPLITUDE: f32 = 0.115;
/// Cells are this many wavelengths long.
const CELL_WAVES: f32 = 1.2;
/// Share of the sharp-crested form in a wave; the rest is a cosine.
const SHARPNESS: f32 = 0.65;

/// One octave.
#[derive(Clone, Copy, Debug)]
pub(super) struct Octave {
    /// Wavelength, metres.
    pub wavelength: f32,
    /// The lattice is turned by this angle's cosine and sine, so that no two octaves line up.
    cosine: f64,
    sine: f64,
}

/// The octaves, coarse to fine.
pub(super) const OCTAVES: [Octave; 3] = [
    Octave { wavelength: 230.0, cosine: 0.8, sine: 0.6 },
    Octave { wavelength: 97.0, cosine: 0.28, sine: 0.96 },
    Octave { wavelength: 41.0, cosine: -0.352, sine: 0.936 },
];

/// No octave raises or lowers the ground by more than this, all together, metres.
pub(super) fn bound() -> f32 {
    OCTAVES.iter().map(|octave| octave.wavelength * AMPLITUDE).sum()
}

impl Octave {
    fn units(&self) -> f64 {
        4_294_967_296.0 / (TURN_CELLS * f64::from(self.wavelength) * f64::from(CELL_WAVES))
    }

    /// Fixed-point lattice coordinates contributed by x.
    pub(super) fn of_x(&self, x: f64) -> [u32; 2] {
        [fixed(self.units() * self.cosine * x), fixed(-self.units() * self.sine * x)]
    }

    /// Fixed-point lattice coordinates contributed by y.
    pub(super) fn of_y(&self, y: f64) -> [u32; 2] {
        [fixed(self.units() * self.sine * y), fixed(self.units() * self.cosine * y)]
    }
}

fn fixed(value: f64) -> u32 {
    // Through i64, so that it wraps instead of saturating.
    (value.round() as i64) as u32
}

/// Random phases, in turns.
pub(super) struct Phases(Vec<f32>);

/// What an octave does at four places.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waves {
    /// −1 in a gully … 1 on a rib.
    pub value: Lanes,
    /// Height that it adds, metres.
    pub rise: Lanes,
    /// Slope that it adds, eastward.
    pub dx: Lanes,
    /// Slope that it adds, northward.
    pub dy: Lanes,
}

/// Sine of a number of turns within ±¾, to a thousandth (two parabolas): arithmetic alone, so that it
/// is the same on every machine and several are computed at once.
#[inline(always)]
fn sine_of_turns(turns: Lanes) -> Lanes {
    let y = turns * (Lanes::all(8.0) - turns.abs() * 16.0);
    (y * y.abs() - y) * 0.225 + y
}

/// Fraction of a turn in −½…½. Adding and taking away 1.5·2²³ rounds to the nearest whole number.
#[inline(always)]
fn wrapped(turns: Lanes) -> Lanes {
    const ROUND: f32 = 12_582_912.0;
    turns - ((turns + ROUND) + -ROUND)
}

impl Phases {
    /// A table of phases.
    pub(super) fn new(seed: u32) -> Self {
        let side = 1_u32 << TABLE_BITS;
        Self((0..side * side).map(|i| unit(hash(i % side, i / side, seed))).collect())
    }

    /// The waves of an octave at four places: lattice coordinates `u`, `v`, where the ground slopes by
    /// (dx, dy). `strength` (0…1) scales the amplitude.
    #[inline(always)]
    pub(super) fn waves(
        &self,
        octave: &Octave,
        (u, v): ([u32; LANES], [u32; LANES]),
        (dx, dy): (Lanes, Lanes),
        strength: Lanes,
    ) -> Waves {
        let scale = 1.0 / (1 << FRACTION_BITS) as f32;
        let mask = (1_u32 << FRACTION_BITS) - 1;
        // Through i32, which every vector unit converts.
        let fraction = |a: [u32; LANES]| Lanes(a.map(|a| (a & mask) as i32 as f32 * scale));
        let (fu, fv) = (fraction(u), fraction(v));
        // Across the fall line, in the lattice's axes.
        let inverse = (dx * dx + dy * dy + 1e-6).sqrt().divide(1.0);
        let (ax, ay) = (dy * inverse * -1.0, dx * inverse);
        let (cosine, sine) = (octave.cosine as f32, octave.sine as f32);
        let (au, av) = (ax * cosine + ay * sine, ay * cosine - ax * sine);
        let smooth = |f: Lanes| f * f * (f * -2.0 + 3.0);
        let (wu, wv) = (smooth(fu), smooth(fv));
        let (nu, nv) = (wu * -1.0 + 1.0, wv * -1.0 + 1.0);
        let base = (au * fu + av * fv) * CELL_WAVES;
        let (right, up) = (au * CELL_WAVES, av * CELL_WAVES);
        let side_mask = (1_u32 << TABLE_BITS) - 1;
        let phase = |di: u32, dj: u32| {
            Lanes(std::array::from_fn(|k| {
                let column = ((u[k] >> FRACTION_BITS) + di) & side_mask;
                let row = ((v[k] >> FRACTION_BITS) + dj) & side_mask;
                self.0[((row << TABLE_BITS) | column) as usize]
            }))
        };
        let (mut real, mut imaginary) = (Lanes::all(0.0), Lanes::all(0.0));
        for (turns, weight) in [
            (base + phase(0, 0), nu * nv),
            (base - right + phase(1, 0), wu * nv),
            (base - up + phase(0, 1), nu * wv),
            (base - right - up + phase(1, 1), wu * wv),
        ] {
            real = real + weight * sine_of_turns(wrapped(turns + 0.25));
            imaginary = imaginary + weight * sine_of_turns(wrapped(turns));
        }
        // Where neighbours' phases cancel, the wave is brought back to nearly its full height.
        let inverse = (real * real + imaginary * imaginary + 0.06).sqrt().divide(1.0);
        let (c, s) = (real * inverse, imaginary * inverse);
        // Sharp crests, round troughs: 1 − 2|sin(phase/2)|, its crest rounded a little.
        let root = (c * -0.5 + 0.504).sqrt();
        let value = c * (1.0 - SHARPNESS) + (root * -2.0 + 1.0) * SHARPNESS;
        let by_cosine = root.divide(0.5 * SHARPNESS) + (1.0 - SHARPNESS);
        let rise = value * (strength * (octave.wavelength * AMPLITUDE));
        let slope = s * by_cosine * (strength * (-std::f32::consts::TAU * AMPLITUDE));
        Waves { value, rise, dx: slope * ax, dy: slope * ay }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sine_is_a_sine() {
        for k in -500_i16..=500 {
            let turns = f32::from(k) / 1000.0;
            let truth = (turns * std::f32::consts::TAU).sin();
            assert!((sine_of_turns(Lanes::all(turns)).0[2] - truth).abs() < 1.2e-3, "{turns}");
            let back = wrapped(Lanes::all(turns + 7.0)).0[1];
            assert!((back - turns).abs() < 1e-5 || turns.abs() > 0.4999);
        }
    }

    #[test]
    fn a_wave_stays_within_its_bound_and_its_slope_is_its_derivative() {
        let phases = Phases::new(3);
        let octave = &OCTAVES[1];
        let at = |x: f64, y: f64| {
            let (a, b) = (octave.of_x(x), octave.of_y(y));
            let (u, v) = ([a[0].wrapping_add(b[0]); LANES], [a[1].wrapping_add(b[1]); LANES]);
            let waves = phases.waves(octave, (u, v), (Lanes::all(0.4), Lanes::all(-0.7)), Lanes::all(1.0));
            (waves.value.0[3], waves.rise.0[3], waves.dx.0[3])
        };
        let (mut error, mut steep) = (0.0_f32, 0.0_f32);
        for k in 0..2000_i32 {
            let (x, y) = (f64::from(k) * 13.7 - 9000.0, f64::from(k % 97) * 31.3);
            let here = at(x, y);
            assert!(here.0.abs() <= 1.0);
            let step = 0.25;
            let dx = (at(x + step, y).1 - at(x - step, y).1) / (2.0 * step as f32);
            error += (dx - here.2).abs();
            steep += dx.abs();
        }
        // The blend of phases from cell to cell has a slope of its own, which is left out.
        assert!(error < 0.5 * steep, "{error} of {steep}");
    }
}
