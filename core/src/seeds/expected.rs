//! The canopy's mean height where single crowns are smaller than a sample.
//!
//! The mean over an area of the highest crown is ∫ (1 − P₀(t)) dt, where P₀(t) is the share of the
//! area over which no crown reaches above t. With E(t) = trees per area × mean area over which one
//! crown is higher than t, trees strewn at random would give P₀ = e^(−E). Ours keep their distance,
//! so that crowns overlap less: P₀ = e^(−E − kE²) with k = 0.44 + 0.16·(share of candidates that
//! live)⁴ fits the patterns' own void probabilities within 0.02 for every share and radius, and the
//! mean canopy height within 0.4 m of the exact envelope's mean (the tests measure it).

use super::pattern::CANDIDATES_PER_KM2;
use super::species::{HEIGHT_UNITS, Species};
use super::tree::LEAST_STAND_HEIGHT;

/// Steps of the table between closure 0 and 255, and between stand height 0 and 255.
const CLOSURES: usize = 32;
const STANDS: usize = 64;
/// Sizes of trees, and heights in a stand, at which the integral is taken (midpoints).
const SIZES: usize = 4;
const HEIGHTS: usize = 24;

/// Mean canopy heights of a species by closure and stand height.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// (STANDS + 1) rows of CLOSURES + 1, metres.
    metres: Vec<f32>,
    /// For a stand of the species' own height: CLOSURES + 1.
    own: Vec<f32>,
}

impl Table {
    pub(super) fn new(species: &Species) -> Self {
        let row = |stand_metres: Option<f64>| {
            (0..=CLOSURES).map(move |step| mean_canopy(species, step as f64 / CLOSURES as f64, stand_metres))
        };
        // Quarter metres in a byte: the last row is 63.75 m.
        let metres =
            (0..=STANDS).flat_map(|step| row(Some(63.75 * step.max(1) as f64 / STANDS as f64))).collect();
        Self { metres, own: row(None).collect() }
    }

    /// Mean canopy height, metres: linear between the table's entries.
    pub fn canopy(&self, closure: u8, stand_height: u8) -> f32 {
        if closure == 0 || (1..LEAST_STAND_HEIGHT).contains(&stand_height) || self.own.is_empty() {
            return 0.0;
        }
        let x = f32::from(closure) * (CLOSURES as f32 / 255.0);
        let along = |row: &[f32]| {
            let first = (x as usize).min(CLOSURES - 1);
            row[first] + (x - first as f32) * (row[first + 1] - row[first])
        };
        if stand_height == 0 {
            return along(&self.own);
        }
        let y = f32::from(stand_height) * (STANDS as f32 / 255.0);
        let first = (y as usize).min(STANDS - 1);
        let row = |index: usize| along(&self.metres[index * (CLOSURES + 1)..(index + 1) * (CLOSURES + 1)]);
        let (low, high) = (row(first), row(first + 1));
        low + (y - first as f32) * (high - low)
    }
}

/// The integral, for a closure 0 … 1 and a stand's mean height in metres (none: the species' own).
fn mean_canopy(species: &Species, closure: f64, stand_metres: Option<f64>) -> f32 {
    let metres = |units: u32| f64::from(units) / f64::from(HEIGHT_UNITS);
    let scale = stand_metres.map_or(1.0, |stand| stand / metres(species.mean_height()));
    let tallest = metres(species.tallest);
    let share = (closure * f64::from(species.share) / 65_536.0 / scale).min(1.0);
    let per_square_metre = share * CANDIDATES_PER_KM2 / 1.0e6;
    let crowding = 0.44 + 0.16 * share.powi(4);
    let trees: [(f64, f64); SIZES] = std::array::from_fn(|index| {
        let size = (index as f64 + 0.5) / SIZES as f64;
        let own = metres(species.lowest) + size * (metres(species.highest) - metres(species.lowest));
        let height = (own * scale).min(tallest);
        let radius = species.definition.crown_radius_ratio * height;
        (height, std::f64::consts::PI * radius * radius)
    });
    let top = (metres(species.highest) * scale).min(tallest);
    let base = species.definition.crown_base_ratio;
    let step = top / HEIGHTS as f64;
    let sum: f64 = (0..HEIGHTS)
        .map(|index| {
            let height = (index as f64 + 0.5) * step;
            let area: f64 = trees
                .iter()
                .map(|&(tall, disc)| {
                    if height >= tall {
                        return 0.0;
                    }
                    disc * species.definition.crown.share_above((height / tall - base) / (1.0 - base))
                })
                .sum();
            let expected = per_square_metre * area / SIZES as f64;
            1.0 - (-expected * (1.0 + crowding * expected)).exp()
        })
        .sum();
    (sum * step) as f32
}
