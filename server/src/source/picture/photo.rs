//! What grows, from a photo alone: likelihoods of colour, texture, slope and height by kind of ground, smoothed over
//! neighbours.

use super::features::{Features, TEXTURE_REACH, box_mean};
use super::model::{Adapted, Model};
use super::smoothing::{SWEEPS, probabilities};
use super::statistics::{BROADLEAVES, CONIFERS, KINDS, Kind, TEXTURE};
use super::{Judge, Patch, Picture};
use crate::source::growth::Growth;
use crate::source::wide::wide;
use crate::source::{Cover, SourceError};
use std::sync::{Arc, Mutex, PoisonError};
use treeline_core::layer::SurfaceType;

/// Cells around each over which the share of forest is taken, and whether it is of conifers.
const EDGE_REACH: usize = 1;
const STAND_REACH: usize = 2;
/// No kind is less likely than the likeliest by more than this, in ln: neighbours may overrule.
const FLOOR: f32 = 8.0;
/// Forest before all else, in ln of odds: thin forest looks half like the grass below it (found on the western half
/// of the built-in landscape).
const FOREST_ODDS: f32 = 0.35;
/// Height at 47° above which forest grows less likely, metres.
const TREE_LINE_METRES: f32 = 2150.0;
/// What slope and height, and texture, count beside colour.
const GROUND_WEIGHT: f32 = 0.7;
const TEXTURE_WEIGHT: f32 = 0.3;
/// Closure in the middle of forest and at its edge, of 255.
const EDGE_CLOSURE: f32 = 110.0;
const FULL_CLOSURE: f32 = 235.0;
/// A stand is of conifers, or of broadleaves, where that is likelier by this, in ln.
const SURE_STAND: f32 = 1.0;
/// Bare ground steeper than this is rock, metres per metre; so is all of it higher than this at 47°, metres.
const ROCK_SLOPE: f32 = 0.5;
const ROCK_METRES: f32 = 1900.0;

/// The judge of photos.
pub struct PhotoJudge {
    growth: Growth,
    /// Learnt from the photo when it is first asked for.
    model: Mutex<Option<Arc<Model>>>,
}

impl PhotoJudge {
    /// A judge whose forests are of these growths.
    pub fn new(growth: Growth) -> Self {
        Self { growth, model: Mutex::new(None) }
    }

    fn model(&self, picture: &Picture) -> Result<Arc<Model>, SourceError> {
        // A panic elsewhere leaves it whole: it is written in one step.
        let mut held = self.model.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(model) = &*held {
            return Ok(Arc::clone(model));
        }
        let model = Arc::new(Model::learn(&picture.probes()?));
        *held = Some(Arc::clone(&model));
        Ok(model)
    }
}

/// What slope and height say of each kind, ln: water is flat, cliffs are bare, forest ends and snow lies high.
pub fn ground_scores(patch: &Patch, index: usize, slope: f32) -> [f32; KINDS] {
    let height = patch.heights[index];
    let mut scores = [0.0; KINDS];
    scores[Kind::Forest as usize] = FOREST_ODDS / GROUND_WEIGHT - 4.0 * (slope - 1.2).max(0.0);
    scores[Kind::Grass as usize] = -3.0 * (slope - 0.9).max(0.0);
    scores[Kind::Bare as usize] = (2.0 * (slope - 0.7)).clamp(0.0, 1.5);
    if !height.is_nan() {
        let altitude = patch.altitude(index / patch.width(), height);
        scores[Kind::Forest as usize] -= ((altitude - TREE_LINE_METRES) / 100.0).clamp(0.0, 5.0);
        scores[Kind::Snow as usize] = -((1600.0 - altitude) / 150.0).clamp(0.0, 8.0);
        let flat = slope / 0.08;
        scores[Kind::Water as usize] = -(0.5 * flat * flat).min(14.0);
        if height <= 0.5 && slope < 0.02 {
            scores[Kind::Water as usize] = 3.0;
        }
    }
    scores.map(|score| score * GROUND_WEIGHT)
}

/// Adds what the texture says of each kind.
pub fn weighted_texture(texture: f32, scores: &mut [f32; KINDS]) {
    for (score, [mean, deviation, ln_deviation]) in scores.iter_mut().zip(TEXTURE) {
        let off = (texture - mean) / deviation;
        *score -= TEXTURE_WEIGHT * (0.5 * off * off + ln_deviation);
    }
}

/// Scores by kind of every cell of a patch, and by how much conifers are likelier than broadleaves.
struct Scores {
    kinds: [Vec<f32>; KINDS],
    conifers: Vec<f32>,
}

impl Scores {
    fn of(patch: &Patch, features: &Features, model: &Model) -> Self {
        let count = patch.colours.len();
        let mut scores = Self {
            kinds: std::array::from_fn(|_| vec![f32::NEG_INFINITY; count]),
            conifers: vec![0.0; count],
        };
        for (index, cluster) in model.clusters.iter().enumerate() {
            let leaves = match index {
                CONIFERS => 1.0,
                BROADLEAVES => -1.0,
                _ => 0.0,
            };
            let best = &mut scores.kinds[cluster.kind];
            let conifers = &mut scores.conifers;
            wide!(raise(
                cluster: &Adapted = cluster,
                features: &Features = features,
                best: &mut [f32] = best,
                leaves: f32 = leaves,
                conifers: &mut [f32] = conifers,
            ));
        }
        for index in 0..count {
            if patch.colours[index][3] == 0 {
                // Unknown: whatever the neighbours are.
                scores.kinds.iter_mut().for_each(|kind| kind[index] = 0.0);
                continue;
            }
            let mut ground = ground_scores(patch, index, features.slope[index]);
            weighted_texture(features.texture[index], &mut ground);
            let mut most = f32::NEG_INFINITY;
            for (kind, ground) in scores.kinds.iter_mut().zip(ground) {
                kind[index] += ground;
                most = most.max(kind[index]);
            }
            for kind in &mut scores.kinds {
                kind[index] = kind[index].max(most - FLOOR);
            }
        }
        scores
    }
}

/// Raises the best score of a kind to a cluster's.
#[inline(always)]
fn raise(cluster: &Adapted, features: &Features, best: &mut [f32], leaves: f32, conifers: &mut [f32]) {
    let Features { green, blue, bright, green_noise, blue_noise, .. } = features;
    let count = best.len();
    let (green, blue, bright) = (&green[..count], &blue[..count], &bright[..count]);
    let (green_noise, blue_noise) = (&green_noise[..count], &blue_noise[..count]);
    let conifers = &mut conifers[..count];
    for index in 0..count {
        let score = cluster
            .score([green[index], blue[index], bright[index]], [green_noise[index], blue_noise[index]]);
        best[index] = best[index].max(score);
        conifers[index] += leaves * score;
    }
}

impl Judge for PhotoJudge {
    fn margin(&self) -> u32 {
        (TEXTURE_REACH + SWEEPS + EDGE_REACH + 1) as u32
    }

    fn needs_terrain(&self) -> bool {
        true
    }

    fn judge(&self, picture: &Picture, patch: &Patch) -> Result<Vec<Cover>, SourceError> {
        let model = self.model(picture)?;
        let features = Features::of(patch, &model.light);
        let width = patch.width();
        let scores = Scores::of(patch, &features, &model);
        let beliefs = probabilities(&scores.kinds, width);
        let forest = box_mean(&beliefs[Kind::Forest as usize], width, EDGE_REACH);
        let conifers = box_mean(&scores.conifers, width, STAND_REACH);
        let margin = self.margin() as usize;
        let mut covers = Vec::with_capacity((width - 2 * margin) * (patch.height() - 2 * margin));
        for row in margin..patch.height() - margin {
            for column in margin..width - margin {
                let index = row * width + column;
                covers.push(if patch.colours[index][3] == 0 {
                    Cover::default()
                } else {
                    let likeliest = (0..KINDS)
                        .max_by(|&a, &b| beliefs[a][index].total_cmp(&beliefs[b][index]))
                        .unwrap_or(0);
                    self.cover(patch, index, likeliest, features.slope[index], forest[index], conifers[index])
                });
            }
        }
        Ok(covers)
    }
}

impl PhotoJudge {
    fn cover(
        &self,
        patch: &Patch,
        index: usize,
        kind: usize,
        slope: f32,
        forest: f32,
        conifers: f32,
    ) -> Cover {
        let ground = |surface: SurfaceType| Cover { surface: surface as u8, ..Cover::default() };
        if kind == Kind::Forest as usize {
            let growth = if conifers > SURE_STAND {
                self.growth.conifer
            } else if conifers < -SURE_STAND {
                self.growth.broadleaf
            } else {
                self.growth.mixed
            };
            let closure = EDGE_CLOSURE + (FULL_CLOSURE - EDGE_CLOSURE) * forest;
            return Cover { species: growth, closure: closure as u8, ..ground(SurfaceType::Plain) };
        }
        if kind == Kind::Bare as usize {
            // An unknown height is no reason for rock: the comparison is false.
            let high = patch.altitude(index / patch.width(), patch.heights[index]) > ROCK_METRES;
            return ground(if slope > ROCK_SLOPE || high { SurfaceType::Rock } else { SurfaceType::Plain });
        }
        ground(match kind {
            kind if kind == Kind::Grass as usize => SurfaceType::Grass,
            kind if kind == Kind::Snow as usize => SurfaceType::Snow,
            _ => SurfaceType::Water,
        })
    }
}
