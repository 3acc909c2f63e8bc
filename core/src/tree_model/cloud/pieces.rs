//! A model cut into pieces small enough for planes to share.

use super::hough::Plane;
use crate::tree_model::quad::{Corner, Quad};
use glam::Vec3;
use std::collections::HashMap;

/// A part of a quad of the model.
#[derive(Clone, Debug)]
pub struct Piece {
    /// The part, with its own corners' attributes.
    pub quad: Quad,
    /// Area.
    pub area: f32,
    /// Unit normal, zero where it has none.
    pub normal: Vec3,
}

/// Pieces with welded vertices.
#[derive(Clone, Debug, Default)]
pub struct Pieces {
    /// All different places, corners of the model's quads first seen and of the cuts.
    pub vertices: Vec<Vec3>,
    /// The pieces.
    pub list: Vec<Piece>,
    /// Every piece's corners in `vertices`, apart from the rest: they are read most.
    pub corners: Vec<[u32; 4]>,
}

/// Quads are cut into at most this many parts along a side.
const MOST_CUTS: f32 = 12.0;

impl Pieces {
    /// Cuts quads until no side is longer than `longest`, and welds corners nearer than `weld` to
    /// one another: neighbours share a vertex, which then is tested once, and moves with both. A
    /// welded vertex stands where the first of its corners does, at most √3·`weld` from the others.
    pub fn new(quads: &[Quad], longest: f32, weld: f32) -> Self {
        let mut pieces = Self::default();
        let mut known: HashMap<[i32; 3], u32> = HashMap::new();
        for quad in quads {
            let [a, b, c, d] = quad.places();
            let cuts = |length: f32| (length / longest).ceil().clamp(1.0, MOST_CUTS) as usize;
            let (columns, rows) =
                (cuts(a.distance(b).max(c.distance(d))), cuts(b.distance(c).max(a.distance(d))));
            for row in 0..rows {
                for column in 0..columns {
                    let at =
                        |i: usize, j: usize| mixed(quad, i as f32 / columns as f32, j as f32 / rows as f32);
                    let part = Quad {
                        corners: [
                            at(column, row),
                            at(column + 1, row),
                            at(column + 1, row + 1),
                            at(column, row + 1),
                        ],
                    };
                    let places = part.places();
                    let corners = places.map(|place| {
                        let key = (place / weld).round().to_array().map(|value| value as i32);
                        *known.entry(key).or_insert_with(|| {
                            pieces.vertices.push(place);
                            pieces.vertices.len() as u32 - 1
                        })
                    });
                    let cross = 0.5 * (places[2] - places[0]).cross(places[3] - places[1]);
                    pieces.corners.push(corners);
                    pieces.list.push(Piece {
                        quad: part,
                        area: cross.length(),
                        normal: cross.normalize_or_zero(),
                    });
                }
            }
        }
        pieces
    }

    /// Heights of all vertices over a plane through the origin.
    pub fn heights(&self, normal: Vec3) -> Vec<f32> {
        self.vertices.iter().map(|&place| place.dot(normal)).collect()
    }

    /// How far the farthest corner of each piece lies from a plane.
    pub fn distances(&self, plane: &Plane) -> Vec<f32> {
        let heights = self.heights(plane.normal);
        let of_piece = |piece: usize| {
            let [low, high] = self.span(piece, &heights);
            (plane.offset - low).max(high - plane.offset)
        };
        (0..self.list.len()).map(of_piece).collect()
    }

    /// Least and greatest height of a piece's corners, from [`Self::heights`].
    pub fn span(&self, piece: usize, heights: &[f32]) -> [f32; 2] {
        let corners = self.corners[piece].map(|corner| heights[corner as usize]);
        let [low, high] =
            [f32::min, f32::max].map(|pick| corners[1..].iter().fold(corners[0], |sum, &h| pick(sum, h)));
        [low, high]
    }
}

/// A quad's corner between its corners: u from 0 to 1, v from 1 to 2 (and 0 to 3).
fn mixed(quad: &Quad, u: f32, v: f32) -> Corner {
    let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v];
    let mix = |value: &dyn Fn(&Corner) -> f32| -> f32 {
        quad.corners.iter().zip(weights).map(|(corner, weight)| value(corner) * weight).sum()
    };
    Corner {
        position: [0, 1, 2].map(|axis| mix(&|corner| corner.position[axis])),
        uv: [0, 1].map(|axis| mix(&|corner| corner.uv[axis])),
        normal: [0, 1, 2].map(|axis| mix(&|corner| corner.normal[axis])),
        shade: mix(&|corner| corner.shade),
        foliage: mix(&|corner| corner.foliage),
    }
}
