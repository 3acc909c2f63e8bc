//! Billboard clouds: a model as a few planes with pictures.
//!
//! Made for plants. Foliage and wood apart: foliage (and the branches among it) gets planes that stand
//! like a pinwheel round the trunk, turned until the farthest corner is nearer ([`mod@polish`]), or those that [`mod@hough`]
//! chooses greedily, where they are clearly nearer; one more is chosen for who looks down. Wood is a
//! *cardboard* of two upright planes that cross in the trunk. A piece of the model is drawn on
//! **all** planes that pass within ε of it, not only on the nearest, so that no gap opens where
//! planes share a crown. The pictures are drawn by [`super::raster`] into the smallest rectangle round
//! what they show. Nothing farther is drawn: it was tried, and the clouds looked less like the trees.

pub mod hough;
mod picture;
pub mod pieces;
mod polish;

pub use picture::{Drawn, Layout};

use super::quad::Quad;
use glam::Vec3;
use hough::{Plane, Rules};
use pieces::Pieces;
use polish::polish;

/// The planes of a level of one variant.
#[derive(Clone, Debug, PartialEq)]
pub struct Cover {
    /// Planes of foliage; branches near one are drawn on it, too.
    pub foliage: Vec<Plane>,
    /// Planes of wood, which show all of it, or the trunk.
    pub wood: Vec<Plane>,
    /// The greatest distance of any corner of the model to the nearest plane that shows it.
    pub epsilon: f32,
    /// The greatest distance of any corner from the axis.
    pub radius: f32,
}

/// How many planes a level has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Planes for foliage.
    pub foliage: usize,
    /// Cardboard planes for wood.
    pub wood: usize,
}

/// Budgets of the levels 1, 2 and 3.
pub const BUDGETS: [Budget; 3] =
    [Budget { foliage: 15, wood: 2 }, Budget { foliage: 6, wood: 2 }, Budget { foliage: 2, wood: 2 }];

/// Greedy planes lie this way and that, and stand out of a crown where they end: they are taken
/// where their ε is at most this share of the pinwheel's.
const WORTH_IT: f32 = 0.8;

/// Where there are more planes than this, one is there to be seen from above.
const MANY: usize = 6;

/// No ε less than this is looked for: 3 cm of a tree of 30 m.
const LEAST: f32 = 0.001;

/// Chooses planes: those with the least ε that the budget allows.
pub fn cover(model: &[Quad], budget: Budget) -> Cover {
    let (leaves, wood): (Vec<Quad>, Vec<Quad>) = model.iter().partition(|quad| quad.corners[0].foliage > 0.5);
    // A rock is all wood: it is covered as foliage is.
    let solid = if leaves.is_empty() { wood.clone() } else { leaves };
    let foliage = planes(&solid, budget.foliage);
    let wood_planes = if solid.len() == model.len() { Vec::new() } else { cardboard(&wood, budget.wood) };
    let radius =
        model.iter().flat_map(Quad::places).map(|place| place.truncate().length()).fold(0.0, f32::max);
    let mut cover = Cover { foliage, wood: wood_planes, epsilon: 0.0, radius };
    cover.epsilon = cover.reached(model);
    cover
}

/// Covers with no more planes of foliage than this show all foliage on each, and the trunk alone of the wood,
const FEW: usize = 2;
/// which stands within this share of the model's radius.
const TRUNK: f32 = 0.15;

impl Cover {
    /// Whether each of its planes of foliage shows all of it.
    pub fn shows_all(&self) -> bool {
        self.foliage.len() <= FEW
    }

    /// Whether its planes of wood show wood at a place: where there are few planes, twigs are thinner
    /// than texels, and only the trunk is drawn.
    pub fn shows_wood(&self, place: Vec3) -> bool {
        !self.shows_all() || place.truncate().length() <= TRUNK * self.radius
    }

    /// The greatest distance of any corner of a model to the nearest plane that shows it.
    pub fn reached(&self, model: &[Quad]) -> f32 {
        let from_planes = |place: Vec3, is_wood: bool| {
            let foliage = nearest(&self.foliage, place);
            if is_wood && self.shows_wood(place) { foliage.min(nearest(&self.wood, place)) } else { foliage }
        };
        let of_quad = |quad: &Quad| {
            let is_wood = quad.corners[0].foliage <= 0.5;
            quad.places().map(|place| from_planes(place, is_wood)).into_iter().fold(0.0, f32::max)
        };
        let greatest = model.iter().map(of_quad).fold(0.0, f32::max);
        if greatest.is_finite() { greatest } else { 0.0 }
    }
}

/// Planes for quads, at most as many as given: about the least ε that most of them reach, and then
/// planes that show from above what those show on edge.
fn planes(quads: &[Quad], count: usize) -> Vec<Plane> {
    let places = || quads.iter().flat_map(Quad::places);
    let low = places().fold(Vec3::INFINITY, Vec3::min);
    let high = places().fold(Vec3::NEG_INFINITY, Vec3::max);
    if quads.is_empty() || count == 0 {
        return Vec::new();
    }
    let caps = if count > MANY { 1 } else { 0 };
    let covering = count - caps;
    let rules = Rules::for_planes(covering);
    let standing = pinwheel(quads, low, high, covering);
    if covering <= FEW {
        // They cross in the middle, and each shows the whole tree.
        return standing;
    }
    let farthest = places().map(|place| nearest(&standing, place)).fold(0.0, f32::max);
    // Pieces are half as large as the slab that must hold them.
    let pieces = Pieces::new(quads, 0.5 * farthest.max(LEAST), 0.01 * farthest.max(LEAST));
    let (mut planes, mut reached) = polish(&pieces, standing, &rules);
    if let Some(greedy) = least(quads, &rules, (WORTH_IT * reached).max(LEAST)) {
        (planes, reached) = polish(&pieces, greedy, &rules);
    }
    hough::add_showing(&pieces, reached, count.min(planes.len() + caps), &mut planes);
    planes
}

/// Distance of a place from the nearest plane.
fn nearest(planes: &[Plane], place: Vec3) -> f32 {
    planes.iter().map(|plane| plane.distance(place)).fold(f32::INFINITY, f32::min)
}

/// Greedy planes with about the least ε that the rules allow, below a bound; `None` where that is not enough.
fn least(quads: &[Quad], rules: &Rules, bound: f32) -> Option<Vec<Plane>> {
    // Pieces are smaller than the slab that must hold them.
    let choose = |epsilon: f32| hough::choose(&Pieces::new(quads, epsilon, 0.02 * epsilon), epsilon, rules);
    let mut best = choose(bound)?;
    let (mut enough, mut too_little) = (bound, 0.0);
    while enough - too_little > 0.1 * enough + 0.1 * LEAST {
        let middle = 0.5 * (enough + too_little);
        match choose(middle) {
            Some(planes) => (best, enough) = (planes, middle),
            None => too_little = middle,
        }
    }
    Some(best)
}

/// Planes round an axis, which they pass at a distance at which they cut the rim's circle at equal arcs:
/// sin(90°/count) of its radius is then the distance of all points of its disc from the nearest, as
/// if there were half planes twice as many. They stand before the trunk, too, which planes through
/// the axis leave bare. They lean as the crown narrows. Fewer than six, or an odd number of
/// planes, pass through the axis.
fn pinwheel(quads: &[Quad], low: Vec3, high: Vec3, count: usize) -> Vec<Plane> {
    let middle = 0.5 * (low + high);
    if count < 6 || count % 2 == 1 {
        return upright(middle, count, 0.0);
    }
    let tall = (high.z - low.z).max(1e-6);
    let widest = |from: f32, to: f32| {
        let places = quads.iter().flat_map(Quad::places);
        let between = places.filter(|place| (from..=to).contains(&((place.z - low.z) / tall)));
        between.map(|place| (place - middle).truncate().length()).fold(0.0, f32::max)
    };
    let (lower, upper) = (widest(0.0, 0.5), widest(0.85, 1.0));
    let aside = (std::f32::consts::FRAC_PI_2 / count as f32).sin();
    // Distance from the axis at the foot and at the top of the crown.
    let (foot, top) = (aside * lower, aside * upper.min(lower) * 0.5);
    let lean = (foot - top) / tall;
    (0..count)
        .map(|index| {
            let turn = index as f32 * std::f32::consts::TAU / count as f32;
            let normal = Vec3::new(turn.cos(), turn.sin(), lean).normalize();
            let on_it = middle + Vec3::new(turn.cos(), turn.sin(), 0.0) * foot;
            Plane { normal, offset: normal.dot(Vec3::new(on_it.x, on_it.y, low.z)) }
        })
        .collect()
}

/// Upright planes through a place, spread evenly from an azimuth of the first one's normal.
fn upright(middle: Vec3, count: usize, first: f32) -> Vec<Plane> {
    (0..count)
        .map(|index| {
            let turn = first + index as f32 * std::f32::consts::PI / count as f32;
            let normal = Vec3::new(turn.cos(), turn.sin(), 0.0);
            Plane { normal, offset: normal.dot(middle) }
        })
        .collect()
}

/// Upright planes that cross in the wood's middle line.
fn cardboard(wood: &[Quad], planes: usize) -> Vec<Plane> {
    // The first shows most of what reaches far from the axis.
    let (mut sine, mut cosine) = (0.0_f64, 0.0_f64);
    let mut middle = Vec3::ZERO;
    let mut count = 0.0_f32;
    for place in wood.iter().flat_map(Quad::places) {
        let (x, y) = (f64::from(place.x), f64::from(place.y));
        sine += 2.0 * x * y;
        cosine += x * x - y * y;
        middle += place;
        count += 1.0;
    }
    middle /= count.max(1.0);
    let first = 0.5 * sine.atan2(cosine) as f32 + std::f32::consts::FRAC_PI_2;
    upright(middle, planes, first)
}
