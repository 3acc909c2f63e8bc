//! Greedy choice of planes in Hough space.
//!
//! A plane is a direction (its normal) and a height over the origin along it. A piece votes for
//! all planes that pass within ε of its corners, with the area that it shows to them; the plane with
//! the most votes wins, the pieces that it takes withdraw theirs, and so on until no piece is left
//! (X. Décoret, F. Durand, F. Sillion, J. Dorsey, *Billboard Clouds for Extreme Model
//! Simplification*, SIGGRAPH 2003). For plants: planes that lie flat count less, for they vanish
//! for who stands on the ground, and so do planes that nearly repeat one that there is.

use super::pieces::Pieces;
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
        let heights = pieces.heights(plane.normal);
        let before = count;
        for (index, left) in left.iter_mut().enumerate() {
            if !*left {
                continue;
            }
            let [low, high] = pieces.span(index, &heights);
            if plane.offset - low <= epsilon && high - plane.offset <= epsilon {
                *left = false;
                count -= 1;
                space.vote(pieces, index, -1.0);
            }
        }
        if before == count {
            return None;
        }
        planes.push(plane);
    }
    Some(planes)
}

/// Votes by normal and height.
struct Space {
    normals: Vec<Vec3>,
    heights: Vec<Vec<f32>>,
    low: f32,
    bin: f32,
    epsilon: f32,
    /// Differences along the heights, so that a range is two numbers.
    votes: Vec<f64>,
}

impl Space {
    fn new(pieces: &Pieces, epsilon: f32) -> Self {
        let normals = normals();
        let heights: Vec<Vec<f32>> = normals.iter().map(|&normal| pieces.heights(normal)).collect();
        let all = || heights.iter().flatten();
        let low = all().fold(f32::INFINITY, |low, &height| low.min(height)) - epsilon;
        let high = all().fold(f32::NEG_INFINITY, |high, &height| high.max(height)) + epsilon;
        let votes = vec![0.0; normals.len() * (BINS + 1)];
        let bin = ((high - low) / BINS as f32).max(1e-9);
        let mut space = Self { normals, heights, low, bin, epsilon, votes };
        for index in 0..pieces.list.len() {
            space.vote(pieces, index, 1.0);
        }
        space
    }

    /// Adds or takes back a piece's votes.
    fn vote(&mut self, pieces: &Pieces, index: usize, sign: f64) {
        let piece = &pieces.list[index];
        for (direction, normal) in self.normals.iter().enumerate() {
            let [low, high] = pieces.span(index, &self.heights[direction]);
            // Heights of planes within ε of both; a bin's plane is its middle.
            let bin = |height: f32| (height - self.low) / self.bin - 0.5;
            let first = bin(high - self.epsilon).ceil().max(0.0);
            let last = bin(low + self.epsilon).floor();
            if last < first {
                continue;
            }
            let facing = EDGE_VOTE + (1.0 - EDGE_VOTE) * normal.dot(piece.normal).abs();
            // Pieces without area want a plane, too.
            let weight = sign * f64::from((piece.area * facing).max(1e-9));
            let row = direction * (BINS + 1);
            self.votes[row + first as usize] += weight;
            self.votes[row + (last as usize + 1).min(BINS)] -= weight;
        }
    }

    /// The plane with the most votes.
    fn best(&self, chosen: &[Plane], rules: &Rules) -> Option<Plane> {
        let mut best = (0.0, None);
        for (direction, &normal) in self.normals.iter().enumerate() {
            let worth = worth(normal, chosen, rules);
            if worth == 0.0 {
                continue;
            }
            let mut votes = 0.0;
            for (index, change) in self.votes[direction * (BINS + 1)..][..BINS].iter().enumerate() {
                votes += change;
                if votes * worth > best.0 {
                    let offset = self.low + (index as f32 + 0.5) * self.bin;
                    best = (votes * worth, Some(Plane { normal, offset }));
                }
            }
        }
        best.1
    }
}

/// What a vote for a plane with a normal counts: 0 where the rules forbid it.
fn worth(normal: Vec3, chosen: &[Plane], rules: &Rules) -> f64 {
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
        if worth == 0.0 { (0.0, 0.0) } else { best_offset(pieces, left, normal, epsilon, worth) }
    };
    let (mut best, offset) = gain(first.normal);
    let mut plane = Plane { normal: first.normal, offset };
    for degrees in [4.0_f32, 2.0, 1.0] {
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

/// Votes of the best plane with a normal, and its height: exact, by sorting where votes begin and end.
fn best_offset(pieces: &Pieces, left: &[bool], normal: Vec3, epsilon: f32, worth: f64) -> (f64, f32) {
    let heights = pieces.heights(normal);
    let mut events: Vec<(f32, f64)> = Vec::new();
    for (index, _) in left.iter().enumerate().filter(|(_, left)| **left) {
        let [low, high] = pieces.span(index, &heights);
        if high - low <= 2.0 * epsilon {
            let piece = &pieces.list[index];
            let facing = EDGE_VOTE + (1.0 - EDGE_VOTE) * normal.dot(piece.normal).abs();
            let weight = f64::from((piece.area * facing).max(1e-9)) * worth;
            events.push((high - epsilon, weight));
            events.push((low + epsilon, -weight));
        }
    }
    // Beginnings before ends at one height.
    events.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
    let (mut votes, mut best) = (0.0, (0.0, 0.0));
    for (index, &(height, weight)) in events.iter().enumerate() {
        votes += weight;
        if votes > best.0 {
            // The middle of the range over which these votes hold.
            let end = events.get(index + 1).map_or(height, |next| next.0);
            best = (votes, 0.5 * (height + end));
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
