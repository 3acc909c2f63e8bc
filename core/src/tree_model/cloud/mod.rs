//! Billboard clouds: a model as a few planes with pictures.
//!
//! Made for plants. Foliage and wood apart: foliage (and the branches among it) gets the planes
//! that [`hough`] chooses; wood is a *cardboard* of two upright planes that cross in the trunk. A
//! piece of the model is drawn on **all** planes that pass within ε of it, not only on the one that
//! took it, so that no gap opens where two planes share a crown. The pictures are drawn by
//! [`super::raster`] into the smallest rectangle round what they show.

pub mod hough;
mod picture;
pub mod pieces;

pub use picture::{Drawn, draw};

use super::quad::Quad;
use glam::Vec3;
use hough::{Plane, Rules};
use pieces::Pieces;

/// The planes of a level of one variant.
#[derive(Clone, Debug, PartialEq)]
pub struct Cover {
    /// Planes of foliage; branches near one are drawn on it, too.
    pub foliage: Vec<Plane>,
    /// Planes of wood, which show all of it.
    pub wood: Vec<Plane>,
    /// The greatest distance of any corner of the model to the nearest plane that shows it.
    pub epsilon: f32,
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

/// Steps of the search for the least ε.
const SEARCH_STEPS: usize = 7;

/// Chooses planes: those with the least ε that the budget allows.
pub fn cover(model: &[Quad], budget: Budget) -> Cover {
    let (leaves, wood): (Vec<Quad>, Vec<Quad>) = model.iter().partition(|quad| quad.corners[0].foliage > 0.5);
    // A rock is all wood: it is covered as foliage is.
    let solid = if leaves.is_empty() { wood.clone() } else { leaves };
    let foliage = least(&solid, budget.foliage);
    let wood_planes = if solid.len() == model.len() { Vec::new() } else { cardboard(&wood, budget.wood) };
    let mut cover = Cover { foliage, wood: wood_planes, epsilon: 0.0 };
    cover.epsilon = cover.reached(model);
    cover
}

impl Cover {
    /// The greatest distance of any corner of a model to the nearest plane that shows it.
    pub fn reached(&self, model: &[Quad]) -> f32 {
        let nearest = |place: Vec3, is_wood: bool| {
            let wood = self.wood.iter().filter(|_| is_wood);
            self.foliage.iter().chain(wood).map(|plane| plane.distance(place)).fold(f32::INFINITY, f32::min)
        };
        let of_quad = |quad: &Quad| {
            let is_wood = quad.corners[0].foliage <= 0.5;
            quad.places().map(|place| nearest(place, is_wood)).into_iter().fold(0.0, f32::max)
        };
        let greatest = model.iter().map(of_quad).fold(0.0, f32::max);
        if greatest.is_finite() { greatest } else { 0.0 }
    }
}

/// Planes for quads, at most as many as given, with about the least ε.
fn least(quads: &[Quad], planes: usize) -> Vec<Plane> {
    let places = || quads.iter().flat_map(Quad::places);
    let low = places().fold(Vec3::INFINITY, Vec3::min);
    let high = places().fold(Vec3::NEG_INFINITY, Vec3::max);
    if quads.is_empty() || planes == 0 {
        return Vec::new();
    }
    let size = (high - low).max_element().max(1e-3);
    // Normals spread over about 180°/planes where all planes stand upright; half of that keeps them
    // from running parallel, and leaves a choice. Two planes cross.
    let least_angle = if planes <= 2 { 60.0 } else { 80.0 / planes as f32 };
    let rules = Rules { planes, least_angle: least_angle.to_radians() };
    let width = (high - low).truncate().max_element().max(0.02 * size);
    let (mut enough, mut too_little) = (0.75 * width.max(0.3 * size), 0.0);
    let mut best = Vec::new();
    for _ in 0..SEARCH_STEPS + 6 {
        let epsilon = if best.is_empty() { enough } else { 0.5 * (enough + too_little) };
        // Pieces are smaller than the slab that must hold them.
        let pieces = Pieces::new(quads, 0.9 * epsilon, 0.02 * epsilon);
        match hough::choose(&pieces, 0.96 * epsilon, &rules) {
            Some(planes) => (best, enough) = (planes, epsilon),
            None if best.is_empty() => enough *= 1.6,
            None => too_little = epsilon,
        }
        if !best.is_empty() && enough - too_little < 0.03 * enough {
            break;
        }
    }
    best
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
    (0..planes)
        .map(|index| {
            let turn = first + index as f32 * std::f32::consts::PI / planes as f32;
            let normal = Vec3::new(turn.cos(), turn.sin(), 0.0);
            Plane { normal, offset: normal.dot(middle) }
        })
        .collect()
}
