//! Greedy choice of planes in Hough space.
//!
//! A plane is a direction (its normal) and a height over the origin along it. A piece votes for
//! all planes that pass within ε of its corners, with the area that it shows to them; the plane with
//! the most votes wins, the pieces that it takes withdraw theirs, and so on until no piece is left
//! (X. Décoret, F. Durand, F. Sillion, J. Dorsey, *Billboard Clouds for Extreme Model
//! Simplification*, SIGGRAPH 2003). For plants: planes that lie flat count less, for they vanish
//! for who stands on the ground, and so do planes that nearly repeat one that there is.

use super::pieces::{Piece, Pieces};
use glam::{Quat, Vec3};

/// A plane: the places x with normal·x = offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal.
    pub normal: Vec3,
    /// Height over the origin.
    pub offset: f32,
}

impl Plane {
    /// Distance of a place.
    pub fn distance(&self, place: Vec3) -> f32 {
        (self.normal.dot(place) - self.offset).abs()
    }
}

/// Share of its votes that a plane loses for lying flat.
const FLAT_PENALTY: f32 = 0.75;
/// Votes of a piece seen on edge, of one seen flat: leaves turn every way.
const EDGE_VOTE: f32 = 0.25;
/// Bins of heights over the model's width.
const BINS: usize = 128;
/// Bins where one normal is looked at alone.
const FINE_BINS: usize = 400;
/// Rings of normals, degrees over the horizon, and the number of normals on a full circle.
const RINGS: [(f32, usize); 6] = [(0.0, 36), (14.0, 32), (30.0, 28), (48.0, 20), (68.0, 10), (90.0, 1)];

/// What a choice of planes may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Planes at most.
    pub planes: usize,
    /// Least angle between the normals of two planes, radians.
    pub least_angle: f32,
}

impl Rules {
    /// Rules for a number of planes. Were all upright, 180° over their number would lie between two:
    /// somewhat less than half of that keeps them from running parallel, and leaves a choice. Two cross.
    pub fn for_planes(planes: usize) -> Self {
        let degrees = if planes <= 2 { 60.0 } else { 80.0 / planes as f32 };
        Self { planes, least_angle: f32::to_radians(degrees) }
    }
}

/// Planes that pass within `epsilon` of all corners of every piece; `None` where the rules do not
/// allow for as many as that needs.
pub fn choose(pieces: &Pieces, epsilon: f32, rules: &Rules) -> Option<Vec<Plane>> {
    let mut space = Space::new(pieces, epsilon);
    let mut left: Vec<bool> = vec![true; pieces.list.len()];
    let mut count = left.len();
    let mut planes: Vec<Plane> = Vec::new();
    while count > 0 {
        if planes.len() == rules.planes {
            return None;
        }
        let first = space.best(&planes, rules)?;
        let plane = refined(pieces, &left, first, epsilon, &planes, rules);
        let distances = pieces.distances(&plane);
        let taken: Vec<usize> =
            (0..left.len()).filter(|&index| left[index] && distances[index] <= epsilon).collect();
        for &index in &taken {
            left[index] = false;
        }
        if taken.is_empty() {
            return None;
        }
        count -= taken.len();
        space.vote(pieces, &taken, -1.0);
        planes.push(plane);
    }
    Some(planes)
}

/// Adds planes, up to a number, that show the most area within `epsilon` which no plane yet shows as well.
pub fn add_showing(pieces: &Pieces, epsilon: f32, count: usize, planes: &mut Vec<Plane>) {
    let normals = normals();
    let mut shown = vec![0.0_f32; pieces.list.len()];
    let note = |plane: &Plane, shown: &mut [f32]| {
        for (index, distance) in pieces.distances(plane).into_iter().enumerate() {
            if distance <= epsilon {
                shown[index] = shown[index].max(plane.normal.dot(pieces.list[index].normal).abs());
            }
        }
    };
    for plane in planes.iter() {
        note(plane, &mut shown);
    }
    while planes.len() < count {
        let mut best = (0.0, None);
        for &normal in &normals {
            let gain = |index: usize| {
                let piece = &pieces.list[index];
                (normal.dot(piece.normal).abs() - shown[index]).max(0.0) * piece.area
            };
            let (votes, offset) = best_offset(pieces, normal, epsilon, gain);
            if votes > best.0 {
                best = (votes, Some(Plane { normal, offset }));
            }
        }
        let Some(plane) = best.1 else { return };
        note(&plane, &mut shown);
        planes.push(plane);
    }
}

/// Votes by normal and height.
struct Space {
    normals: Vec<Vec3>,
    heights: Vec<Vec<f32>>,
    axes: Vec<Axis>,
    epsilon: f32,
    /// Changes along the heights, so that a range of votes is two numbers.
    changes: Vec<[f64; BINS + 1]>,
}

impl Space {
    fn new(pieces: &Pieces, epsilon: f32) -> Self {
        let normals = normals();
        let heights: Vec<Vec<f32>> = normals.iter().map(|&normal| pieces.heights(normal)).collect();
        let axes = heights.iter().map(|heights| Axis::round(heights, epsilon, BINS)).collect();
        let changes = vec![[0.0; BINS + 1]; normals.len()];
        let mut space = Self { normals, heights, axes, epsilon, changes };
        let all: Vec<usize> = (0..pieces.list.len()).collect();
        space.vote(pieces, &all, 1.0);
        space
    }

    /// Adds or takes back the votes of pieces.
    fn vote(&mut self, pieces: &Pieces, indices: &[usize], sign: f64) {
        for (direction, changes) in self.changes.iter_mut().enumerate() {
            let (normal, heights) = (self.normals[direction], &self.heights[direction]);
            for &index in indices {
                let weight = sign * f64::from(vote(&pieces.list[index], normal));
                self.axes[direction].vote(pieces.span(index, heights), self.epsilon, weight, changes);
            }
        }
    }

    /// The plane with the most votes.
    fn best(&self, chosen: &[Plane], rules: &Rules) -> Option<Plane> {
        let mut best = (0.0, None);
        for (direction, &normal) in self.normals.iter().enumerate() {
            let (votes, bin) = most(&self.changes[direction]);
            let votes = votes * worth(normal, chosen, rules);
            if votes > best.0 {
                best = (votes, Some(Plane { normal, offset: self.axes[direction].height(bin) }));
            }
        }
        best.1
    }
}

/// What a piece gives to a plane that takes it: pieces without area want one, too.
fn vote(piece: &Piece, normal: Vec3) -> f32 {
    let facing = EDGE_VOTE + (1.0 - EDGE_VOTE) * normal.dot(piece.normal).abs();
    (piece.area * facing).max(1e-9)
}

/// What a vote for a plane with a normal counts: 0 where the rules forbid it.
pub(super) fn worth(normal: Vec3, chosen: &[Plane], rules: &Rules) -> f64 {
    let nearest = chosen.iter().map(|plane| plane.normal.dot(normal).abs()).fold(0.0, f32::max);
    if nearest > rules.least_angle.cos() {
        return 0.0;
    }
    f64::from(1.0 - FLAT_PENALTY * normal.z * normal.z)
}

/// Turns and shifts a plane a little while the pieces left that it takes show more area.
fn refined(
    pieces: &Pieces,
    left: &[bool],
    first: Plane,
    epsilon: f32,
    chosen: &[Plane],
    rules: &Rules,
) -> Plane {
    let gain = |normal: Vec3| {
        let worth = worth(normal, chosen, rules);
        if worth == 0.0 {
            return (0.0, 0.0);
        }
        let weight = |index: usize| if left[index] { vote(&pieces.list[index], normal) } else { 0.0 };
        let (votes, offset) = best_offset(pieces, normal, epsilon, weight);
        (votes * worth, offset)
    };
    let (mut best, offset) = gain(first.normal);
    let mut plane = Plane { normal: first.normal, offset };
    for degrees in [4.0_f32, 1.5] {
        let side = plane.normal.any_orthonormal_vector();
        let other = plane.normal.cross(side);
        for axis in [side, -side, other, -other] {
            let normal = Quat::from_axis_angle(axis, degrees.to_radians()) * plane.normal;
            let (votes, offset) = gain(normal);
            if votes > best {
                (best, plane) = (votes, Plane { normal, offset });
            }
        }
    }
    plane
}

/// Votes of the best plane with a normal, and its height.
fn best_offset(pieces: &Pieces, normal: Vec3, epsilon: f32, weight: impl Fn(usize) -> f32) -> (f64, f32) {
    let heights = pieces.heights(normal);
    let axis = Axis::round(&heights, epsilon, FINE_BINS);
    let mut changes = vec![0.0; FINE_BINS + 1];
    for index in 0..pieces.list.len() {
        let weight = weight(index);
        if weight > 0.0 {
            axis.vote(pieces.span(index, &heights), epsilon, f64::from(weight), &mut changes);
        }
    }
    let (votes, bin) = most(&changes);
    (votes, axis.height(bin))
}

/// Heights over the origin along a normal, in bins; a bin's plane is its middle.
#[derive(Clone, Copy, Debug)]
struct Axis {
    low: f32,
    bin: f32,
}

impl Axis {
    fn round(heights: &[f32], epsilon: f32, bins: usize) -> Self {
        let low = heights.iter().fold(f32::INFINITY, |low, &height| low.min(height)) - epsilon;
        let high = heights.iter().fold(f32::NEG_INFINITY, |high, &height| high.max(height)) + epsilon;
        Self { low, bin: ((high - low) / bins as f32).max(1e-9) }
    }

    fn height(&self, bin: usize) -> f32 {
        self.low + (bin as f32 + 0.5) * self.bin
    }

    /// Votes for the planes within ε of a span of heights: where the votes begin and where they end.
    fn vote(&self, [low, high]: [f32; 2], epsilon: f32, weight: f64, changes: &mut [f64]) {
        let bin = |height: f32| (height - self.low) / self.bin - 0.5;
        let first = bin(high - epsilon).ceil().max(0.0) as usize;
        let last = bin(low + epsilon).floor();
        if last >= first as f32 {
            changes[first] += weight;
            changes[(last as usize + 1).min(changes.len() - 1)] -= weight;
        }
    }
}

/// The most votes, and their bin.
fn most(changes: &[f64]) -> (f64, usize) {
    let (mut votes, mut best) = (0.0, (0.0, 0));
    for (bin, change) in changes.iter().enumerate() {
        votes += change;
        if votes > best.0 {
            best = (votes, bin);
        }
    }
    best
}

/// Half a sphere of normals.
fn normals() -> Vec<Vec3> {
    let mut normals = Vec::new();
    for (ring, (degrees, around)) in RINGS.iter().enumerate() {
        // A normal and its opposite are one plane: on the horizon half a circle is all.
        let count = if ring == 0 { around / 2 } else { *around };
        let (sine, cosine) = degrees.to_radians().sin_cos();
        for index in 0..count {
            let turn = (index as f32 + 0.5 * (ring % 2) as f32) / *around as f32 * std::f32::consts::TAU;
            normals.push(Vec3::new(cosine * turn.cos(), cosine * turn.sin(), sine).normalize());
        }
    }
    normals
}
