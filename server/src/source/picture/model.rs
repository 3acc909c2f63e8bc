//! What the kinds of ground look like in one photo: the constants, adapted to it.
//!
//! From patches spread over the photo: haze from its darkest, the sun from how the brightness of slopes follows
//! their aspect, exposure as what makes the photo likeliest, then clusters by expectation and maximisation, held
//! to the constants by as many imagined cells.

use super::Patch;
use super::features::{Features, Light, clear, rise};
use super::number::{exp, ln};
use super::photo::{ground_scores, weighted_texture};
use super::statistics::{CLUSTERS, DARKEST, KINDS, LN_SHADOW, LN_SHADOW_SHARE, LN_SUNLIT};

/// Cells that teach, at most.
const STUDENTS: usize = 8192;
/// Rounds of expectation and maximisation.
const ROUNDS: usize = 6;
/// Imagined cells of each cluster that look as the constants say, of those that teach.
const FAITH: f32 = 0.2;
/// How far means may move from the constants, and deviations shrink or grow, in standard deviations.
const REACH: f32 = 1.5;
const LEAST_DEVIATION: f32 = 0.6;
/// Cells less likely than this teach nothing: ln.
const OUTLIER: f32 = -14.0;
/// Exposures that are tried, in ln of brightness.
const EXPOSURES: std::ops::RangeInclusive<i32> = -6..=6;
const EXPOSURE_STEP: f32 = 0.15;
/// Share of the darkest cells from which haze is read.
const DARK_SHARE: f32 = 0.005;
/// Haze is no brighter than this, of 255.
const MOST_HAZE: f32 = 40.0;
/// Deviation of ln(brightness) in shadows beside that of the cluster.
const SHADOW_DEVIATION: f32 = 0.15;

/// A cluster as it is in a photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapted {
    /// Index of its [`Kind`](super::statistics::Kind).
    pub kind: usize,
    /// Means, as in the constants.
    pub mean: [f32; 3],
    /// Variances.
    pub variance: [f32; 3],
    /// ln of its commonness.
    pub weight: f32,
}

impl Adapted {
    /// ln of the likelihood of a cell's colour, commonness included.
    #[inline(always)]
    pub fn score(&self, colour: [f32; 3], noise: [f32; 2]) -> f32 {
        let green = self.variance[0] + noise[0];
        let blue = self.variance[1] + noise[1];
        let lit = self.variance[2] + 0.3 * noise[0];
        let shaded = lit + SHADOW_DEVIATION * SHADOW_DEVIATION;
        let off = [colour[0] - self.mean[0], colour[1] - self.mean[1], colour[2] - self.mean[2]];
        let hue = off[0] * off[0] / green + off[1] * off[1] / blue;
        let below = off[2] - LN_SHADOW;
        // Sunlit, or in a cast shadow, which is rarer.
        let sunlit = off[2] * off[2] / lit + ln(lit) - 2.0 * LN_SUNLIT;
        let shadow = below * below / shaded + ln(shaded) - 2.0 * LN_SHADOW_SHARE;
        self.weight - 0.5 * (hue + ln(green * blue) + sunlit.min(shadow))
    }
}

/// A photo's light and clusters.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Haze and sun.
    pub light: Light,
    /// Clusters, in the constants' order.
    pub clusters: Vec<Adapted>,
}

/// A cell that teaches.
struct Student {
    colour: [f32; 3],
    noise: [f32; 2],
    /// What slope, height and texture say of each kind.
    ground: [f32; KINDS],
}

impl Model {
    /// Learns from patches; without any it is the constants.
    pub fn learn(patches: &[Patch]) -> Self {
        let haze = haze(patches);
        let light = Light { haze, sun: sun(patches, &haze) };
        let students = students(patches, &light);
        let mut clusters = constants();
        let exposure = exposure(&students, &clusters);
        for cluster in &mut clusters {
            cluster.mean[2] += exposure;
        }
        if !students.is_empty() {
            let begin = clusters.clone();
            for _ in 0..ROUNDS {
                adapt(&students, &begin, &mut clusters);
            }
        }
        Self { light, clusters }
    }
}

/// The constants as they are.
fn constants() -> Vec<Adapted> {
    let total: f32 = CLUSTERS.iter().map(|cluster| cluster.weight).sum();
    CLUSTERS
        .iter()
        .map(|cluster| Adapted {
            kind: cluster.kind as usize,
            mean: cluster.mean,
            variance: cluster.deviation.map(|deviation| deviation * deviation),
            weight: ln(cluster.weight / total),
        })
        .collect()
}

fn visible(patches: &[Patch]) -> impl Iterator<Item = (&Patch, usize)> {
    patches.iter().flat_map(|patch| {
        (0..patch.colours.len())
            .filter(|&index| patch.colours[index][3] == 255)
            .map(move |index| (patch, index))
    })
}

/// What the air adds: what the darkest have beyond what crowns in shadow reflect.
fn haze(patches: &[Patch]) -> [f32; 3] {
    std::array::from_fn(|channel| {
        let mut counts = [0_usize; 256];
        let mut total = 0;
        for (patch, index) in visible(patches) {
            counts[usize::from(patch.colours[index][channel])] += 1;
            total += 1;
        }
        let wanted = (DARK_SHARE * total as f32) as usize;
        let mut below = 0;
        let dark = counts.iter().position(|&count| {
            below += count;
            below > wanted
        });
        (dark.unwrap_or(0) as f32 - DARKEST[channel]).clamp(0.0, MOST_HAZE)
    })
}

/// Toward the sun: the direction whose product with the slopes' normals fits their brightness best, over land that
/// is neither blue nor level. Straight up where there is none.
fn sun(patches: &[Patch], haze: &[f32; 3]) -> [f32; 3] {
    const UP: [f32; 3] = [0.0, 0.0, 1.0];
    let mut slopes = Vec::new();
    for (patch, index) in visible(patches) {
        let (column, row) = (index % patch.width(), index / patch.width());
        let (east, north) = rise(patch, column, row);
        let steep = (east * east + north * north).sqrt();
        let [r, g, b] = clear(patch.colours[index], haze);
        if (0.1..1.5).contains(&steep) && b < 1.1 * g && b > 0.4 * g {
            let length = (1.0 + east * east + north * north).sqrt();
            slopes.push(([-east / length, -north / length, 1.0 / length], (r + g + b) / 3.0));
        }
    }
    if slopes.len() < 500 {
        return UP;
    }
    let mut brightness: Vec<f32> = slopes.iter().map(|slope| slope.1).collect();
    brightness.sort_unstable_by(f32::total_cmp);
    let median = brightness[brightness.len() / 2].max(1.0);
    // The normal equations of least squares, then Cramer's rule.
    let (mut a, mut y) = ([[0.0_f64; 3]; 3], [0.0_f64; 3]);
    for (normal, bright) in &slopes {
        let bright = f64::from((bright / median).min(2.5));
        for i in 0..3 {
            y[i] += f64::from(normal[i]) * bright;
            for j in 0..3 {
                a[i][j] += f64::from(normal[i]) * f64::from(normal[j]);
            }
        }
    }
    let determinant = |m: [[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let whole = determinant(a);
    if whole.abs() < 1e-9 * a[2][2].powi(3) {
        return UP;
    }
    let sun: [f32; 3] = std::array::from_fn(|i| {
        let mut part = a;
        for (row, value) in part.iter_mut().zip(y) {
            row[i] = value;
        }
        (determinant(part) / whole) as f32
    });
    if sun[2] < 0.3 { UP } else { sun }
}

/// Every so many cells, evenly, as many as may teach.
fn students(patches: &[Patch], light: &Light) -> Vec<Student> {
    let total = visible(patches).count();
    let stride = total.div_ceil(STUDENTS).max(1);
    let mut seen = 0;
    let mut students = Vec::new();
    for patch in patches {
        let features = Features::of(patch, light);
        for index in (0..patch.colours.len()).filter(|&index| patch.colours[index][3] == 255) {
            seen += 1;
            if seen % stride != 0 {
                continue;
            }
            let mut ground = ground_scores(patch, index, features.slope[index]);
            weighted_texture(features.texture[index], &mut ground);
            students.push(Student {
                colour: [features.green[index], features.blue[index], features.bright[index]],
                noise: [features.green_noise[index], features.blue_noise[index]],
                ground,
            });
        }
    }
    students
}

/// The exposure at which the photo is likeliest.
fn exposure(students: &[Student], clusters: &[Adapted]) -> f32 {
    let likelihood = |exposure: f32| -> f32 {
        students
            .iter()
            .map(|student| {
                let [green, blue, bright] = student.colour;
                let best = clusters
                    .iter()
                    .map(|cluster| {
                        cluster.score([green, blue, bright - exposure], student.noise)
                            + student.ground[cluster.kind]
                    })
                    .fold(f32::NEG_INFINITY, f32::max);
                best.max(OUTLIER)
            })
            .sum()
    };
    EXPOSURES
        .map(|step| step as f32 * EXPOSURE_STEP)
        .map(|exposure| (exposure, likelihood(exposure)))
        .fold((0.0, f32::NEG_INFINITY), |best, tried| if tried.1 > best.1 { tried } else { best })
        .0
}

/// One round: who belongs where, then what each cluster looks like.
fn adapt(students: &[Student], begin: &[Adapted], clusters: &mut [Adapted]) {
    let mut shares = vec![[0.0_f32; CLUSTERS.len()]; students.len()];
    let mut counts = [0.0_f32; CLUSTERS.len()];
    let mut sums = [[0.0_f32; 3]; CLUSTERS.len()];
    for (student, shares) in students.iter().zip(&mut shares) {
        let scores: Vec<f32> = clusters
            .iter()
            .map(|cluster| cluster.score(student.colour, student.noise) + student.ground[cluster.kind])
            .collect();
        let most = scores.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        if most < OUTLIER {
            continue;
        }
        let mut total = 0.0;
        for (share, score) in shares.iter_mut().zip(&scores) {
            *share = exp((score - most).max(-30.0));
            total += *share;
        }
        for ((share, count), sum) in shares.iter_mut().zip(&mut counts).zip(&mut sums) {
            *share /= total;
            *count += *share;
            for (sum, colour) in sum.iter_mut().zip(student.colour) {
                *sum += *share * colour;
            }
        }
    }
    let faith = FAITH * students.len() as f32;
    let all = counts.iter().sum::<f32>() + students.len() as f32;
    for (index, cluster) in clusters.iter_mut().enumerate() {
        let (count, prior) = (counts[index], &begin[index]);
        for (axis, sum) in sums[index].iter().enumerate() {
            let (known, reach) = (prior.mean[axis], REACH * prior.variance[axis].sqrt());
            let mean = (sum + faith * known) / (count + faith);
            cluster.mean[axis] = mean.clamp(known - reach, known + reach);
        }
        cluster.weight = ln((count + students.len() as f32 * exp(prior.weight)) / all);
    }
    let mut squares = [[0.0_f32; 3]; CLUSTERS.len()];
    for (student, shares) in students.iter().zip(&shares) {
        let noise = [student.noise[0], student.noise[1], 0.3 * student.noise[0]];
        for (index, share) in shares.iter().enumerate() {
            for axis in 0..3 {
                let off = student.colour[axis] - clusters[index].mean[axis];
                squares[index][axis] += share * (off * off - noise[axis]);
            }
        }
    }
    for (index, cluster) in clusters.iter_mut().enumerate() {
        for (axis, square) in squares[index].iter().enumerate() {
            let known = begin[index].variance[axis];
            let variance = (square.max(0.0) + faith * known) / (counts[index] + faith);
            cluster.variance[axis] =
                variance.clamp(LEAST_DEVIATION * LEAST_DEVIATION * known, REACH * REACH * known);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_in_logarithms() {
        assert!((LN_SHADOW.exp() - 0.35).abs() < 1e-5);
        assert!((LN_SHADOW_SHARE.exp() + LN_SUNLIT.exp() - 1.0).abs() < 1e-5);
    }

    #[test]
    fn nothing_seen_is_nothing_learnt() {
        let model = Model::learn(&[]);
        assert_eq!(model.light, Light { haze: [0.0; 3], sun: [0.0, 0.0, 1.0] });
        assert_eq!(model.clusters.len(), CLUSTERS.len());
    }
}
