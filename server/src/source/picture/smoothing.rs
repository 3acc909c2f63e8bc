//! Neighbours are likely to be alike: a Markov random field on the cells, by a fixed number of mean-field sweeps.
//!
//! After k sweeps a cell has heard of those within k cells only, so that a patch with a margin of k gives what
//! the whole picture would.

use super::number::exp;
use super::statistics::KINDS;
use crate::source::wide::wide;

/// Sweeps; a cell hears of as many cells around it.
pub const SWEEPS: usize = 4;
/// How much an agreeing neighbour is worth, in ln of odds.
const COUPLING: f32 = 0.6;
/// Weights along an axis: squared 1.43, of the sides 1, of the corners 0.7.
const BESIDE: f32 = 0.837;
const MIDDLE: f32 = 1.195;

/// Turns scores (ln of odds, by kind, then by cell; in place) into probabilities.
pub fn probabilities(scores: &[Vec<f32>; KINDS], width: usize) -> [Vec<f32>; KINDS] {
    let count = scores[0].len();
    let mut beliefs: [Vec<f32>; KINDS] = std::array::from_fn(|_| vec![0.0; count]);
    let mut heard: [Vec<f32>; KINDS] = std::array::from_fn(|_| vec![0.0; count]);
    for sweep in 0..=SWEEPS {
        if sweep > 0 {
            for (heard, beliefs) in heard.iter_mut().zip(&beliefs) {
                wide!(hear(beliefs: &[f32] = beliefs, width: usize = width, heard: &mut [f32] = heard));
            }
        }
        wide!(believe(
            scores: &[Vec<f32>; KINDS] = scores,
            heard: &[Vec<f32>; KINDS] = &heard,
            beliefs: &mut [Vec<f32>; KINDS] = &mut beliefs,
        ));
    }
    beliefs
}

/// The weighted sum of the eight around each cell; beyond the edge there is nobody.
#[inline(always)]
fn hear(beliefs: &[f32], width: usize, heard: &mut [f32]) {
    let height = beliefs.len() / width;
    let mut rows = vec![0.0; beliefs.len()];
    for (line, out) in beliefs.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for column in 1..width - 1 {
            out[column] = BESIDE * (line[column - 1] + line[column + 1]) + MIDDLE * line[column];
        }
        out[0] = BESIDE * line[1] + MIDDLE * line[0];
        out[width - 1] = BESIDE * line[width - 2] + MIDDLE * line[width - 1];
    }
    for row in 0..height {
        let at = row * width;
        let (above, below) =
            (if row > 0 { at - width } else { at }, if row + 1 < height { at + width } else { at });
        for column in 0..width {
            heard[at + column] = BESIDE * (rows[above + column] + rows[below + column])
                + MIDDLE * rows[at + column]
                - MIDDLE * MIDDLE * beliefs[at + column];
        }
    }
}

/// Probabilities from scores and from what was heard.
#[inline(always)]
fn believe(scores: &[Vec<f32>; KINDS], heard: &[Vec<f32>; KINDS], beliefs: &mut [Vec<f32>; KINDS]) {
    const LANES: usize = 8;
    let count = scores[0].len();
    let whole = count / LANES * LANES;
    for first in (0..whole).step_by(LANES) {
        believe_at::<LANES>(scores, heard, beliefs, first);
    }
    for first in whole..count {
        believe_at::<1>(scores, heard, beliefs, first);
    }
}

/// The same for N cells from the first.
#[inline(always)]
fn believe_at<const N: usize>(
    scores: &[Vec<f32>; KINDS],
    heard: &[Vec<f32>; KINDS],
    beliefs: &mut [Vec<f32>; KINDS],
    first: usize,
) {
    let mut sums = [[0.0_f32; N]; KINDS];
    let mut most = [-1.0e30_f32; N];
    for (sums, (score, heard)) in sums.iter_mut().zip(scores.iter().zip(heard)) {
        let (score, heard) = (&score[first..first + N], &heard[first..first + N]);
        for lane in 0..N {
            sums[lane] = score[lane] + COUPLING * heard[lane];
            most[lane] = most[lane].max(sums[lane]);
        }
    }
    let mut total = [0.0_f32; N];
    for sums in &mut sums {
        for lane in 0..N {
            sums[lane] = exp((sums[lane] - most[lane]).max(-30.0));
            total[lane] += sums[lane];
        }
    }
    for (beliefs, sums) in beliefs.iter_mut().zip(&sums) {
        let beliefs = &mut beliefs[first..first + N];
        for lane in 0..N {
            beliefs[lane] = sums[lane] / total[lane];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scores that favour the first kind everywhere but at one cell.
    fn scores(side: usize, doubt: f32) -> [Vec<f32>; KINDS] {
        std::array::from_fn(|kind| {
            let mut values = vec![if kind == 0 { 1.0 } else { 0.0 }; side * side];
            if kind == 1 {
                values[side / 2 * side + side / 2] = doubt;
            }
            values
        })
    }

    #[test]
    fn a_lone_doubt_is_overruled_and_a_firm_one_is_not() {
        let side = 15;
        let middle = side / 2 * side + side / 2;
        let soft = probabilities(&scores(side, 2.5), side);
        assert!(soft[0][middle] > 0.8, "{}", soft[0][middle]);
        let firm = probabilities(&scores(side, 9.0), side);
        assert!(firm[1][middle] > 0.9, "{}", firm[1][middle]);
        let total: f32 = soft.iter().map(|kind| kind[middle]).sum();
        assert!((total - 1.0).abs() < 1e-5);
    }

    #[test]
    fn no_cell_hears_beyond_its_sweeps() {
        let side = 31;
        let (calm, stirred) = (scores(side, 0.0), scores(side, 9.0));
        let (a, b) = (probabilities(&calm, side), probabilities(&stirred, side));
        for row in 0..side {
            for column in 0..side {
                let apart = row.abs_diff(side / 2).max(column.abs_diff(side / 2));
                let index = row * side + column;
                assert_eq!(apart > SWEEPS, a[0][index].to_bits() == b[0][index].to_bits(), "{row} {column}");
            }
        }
    }
}
