//! The full model of a variant: stems as prisms, foliage as cards, in the tree frame.

use super::atlas::Region;
use super::clumps::Clumps;
use super::envelope::Envelope;
use super::growth::{Foliage, GrowthForm};
use super::quad::{Corner, Quad};
use super::random::Random;
use super::skeleton::{self, Stem};
use glam::{Quat, Vec2, Vec3};

/// The pictures that a model's quads carry.
#[derive(Clone, Debug)]
pub struct Pictures {
    /// Twigs.
    pub twigs: Vec<Region>,
    /// Bark, or stone.
    pub bark: Region,
    /// Texels along the atlas's side.
    pub side: u32,
}

/// A place in a region, 0 … 1 from its upper left, as a place in the atlas; half a texel stays at the edges.
pub fn uv_in(region: &Region, side: u32, u: f32, v: f32) -> [f32; 2] {
    let along = |start: u16, length: u16, share: f32| {
        (f32::from(start) + 0.5 + share * (f32::from(length) - 1.0)) / side as f32
    };
    [along(region.x, region.width, u), along(region.y, region.height, v)]
}

/// Width of a clump of leaves, in radii of the crown.
const CLUMP_WIDTH: f32 = 0.55;

/// Grows a plant. Foliage reaches the top of the crown, and nothing of it leaves the crown.
pub fn plant(form: &GrowthForm, envelope: &Envelope, pictures: &Pictures, random: &mut Random) -> Vec<Quad> {
    let stems = skeleton::grow(form, envelope, random);
    let mut quads = Vec::new();
    for stem in &stems {
        wood(stem, envelope, pictures, &mut quads);
    }
    let clumps = match form.foliage {
        // A conifer's boughs are seen as they are.
        Foliage::Sheets { .. } => None,
        Foliage::Cards { .. } => {
            Some(Clumps::new((random.unit() * 65_536.0) as u32, CLUMP_WIDTH * envelope.radius))
        }
    };
    let mut builder = Builder { envelope, pictures, clumps, quads };
    for stem in stems.iter().filter(|stem| stem.bears) {
        match form.foliage {
            Foliage::Sheets { width, fold, curtain } => builder.sheets(stem, width, fold, curtain, random),
            Foliage::Cards { count, size, hang } => builder.cards(stem, count, size, hang, random),
        }
    }
    let crest = match form.foliage {
        Foliage::Sheets { .. } => 0.045,
        Foliage::Cards { size, .. } => size,
    };
    builder.crest(crest, random);
    builder.quads
}

/// A stem as a prism without ends; one that foliage hides as a ribbon on edge.
fn wood(stem: &Stem, envelope: &Envelope, pictures: &Pictures, quads: &mut Vec<Quad>) {
    let sides = match (stem.order, stem.bears) {
        (0, _) => 6,
        (1, false) => 3,
        _ => 1,
    };
    let ring = |index: usize| -> Vec<(Vec3, Vec3)> {
        let last = stem.points.len() - 1;
        let (before, after) = (stem.points[index.saturating_sub(1)], stem.points[(index + 1).min(last)]);
        let axis = (after - before).normalize_or(Vec3::Z);
        let across = if axis.z.abs() > 0.9 { Vec3::X } else { Vec3::Z };
        let side = (across - axis * axis.dot(across)).normalize_or(Vec3::X);
        let other = axis.cross(side);
        let count = if sides == 1 { 2 } else { sides };
        (0..count)
            .map(|corner| {
                let (sine, cosine) = (corner as f32 / count as f32 * std::f32::consts::TAU).sin_cos();
                let out = side * cosine + other * sine;
                (stem.points[index] + out * stem.radii[index], out)
            })
            .collect()
    };
    for piece in 0..stem.points.len() - 1 {
        let (lower, upper) = (ring(piece), ring(piece + 1));
        for side in 0..sides {
            let next = (side + 1) % lower.len();
            let (u0, u1) = (side as f32 / sides as f32, (side + 1) as f32 / sides as f32);
            // The picture upright, then upside down, so that pieces join.
            let (v0, v1) = if piece % 2 == 0 { (1.0, 0.0) } else { (0.0, 1.0) };
            let corner = |(place, out): (Vec3, Vec3), u: f32, v: f32| Corner {
                position: place.to_array(),
                uv: uv_in(&pictures.bark, pictures.side, u, v),
                normal: out.to_array(),
                // Wood within the crown stands in the shade of its leaves.
                shade: if place.z < envelope.bottom { 0.75 } else { 0.2 * shade(envelope, place) },
                foliage: 0.0,
            };
            quads.push(Quad {
                corners: [
                    corner(lower[side], u0, v0),
                    corner(lower[next], u1, v0),
                    corner(upper[next], u1, v1),
                    corner(upper[side], u0, v1),
                ],
            });
        }
    }
}

/// Brightness by place in the crown.
fn shade(envelope: &Envelope, place: Vec3) -> f32 {
    let out = envelope.outness(place);
    let up = (place.z - envelope.bottom) / (1.0 - envelope.bottom);
    ((0.12 + 0.88 * out * out) * (0.62 + 0.38 * up.clamp(0.0, 1.0))).clamp(0.0, 1.0)
}

struct Builder<'a> {
    envelope: &'a Envelope,
    pictures: &'a Pictures,
    /// Where leaves stand in clumps.
    clumps: Option<Clumps>,
    quads: Vec<Quad>,
}

impl Builder<'_> {
    fn leaf_quad(&mut self, places: [Vec3; 4], region: &Region, uvs: [[f32; 2]; 4]) {
        let middle = places.iter().sum::<Vec3>() / 4.0;
        let clump = self.clumps.map_or(1.0, |clumps| clumps.at(middle));
        let (reach, light) = (Clumps::reach(clump), Clumps::light(clump));
        let centre = self.envelope.centre();
        let mut corners = [Corner::default(); 4];
        for (corner, (place, [u, v])) in corners.iter_mut().zip(places.into_iter().zip(uvs)) {
            let place = centre + (self.envelope.pull_in(place) - centre) * reach;
            *corner = Corner {
                position: place.to_array(),
                uv: uv_in(region, self.pictures.side, u, v),
                normal: self.envelope.soft_normal(place).to_array(),
                shade: light * shade(self.envelope, centre + (place - centre) / reach),
                foliage: 1.0,
            };
        }
        self.quads.push(Quad { corners });
    }

    fn some_twig(&self, random: &mut Random) -> Region {
        let count = self.pictures.twigs.len();
        self.pictures.twigs[((random.unit() * count as f32) as usize).min(count - 1)]
    }

    /// A folded sheet along the stem, and a curtain that hangs from it.
    fn sheets(&mut self, stem: &Stem, width: f32, fold: f32, curtain: f32, random: &mut Random) {
        let region = self.some_twig(random);
        let length = stem.length();
        let pieces = stem.points.len() - 1;
        let roll = random.around(16.0_f32).to_radians();
        let (fold, half) = (fold.to_radians(), 0.5 * width * length);
        let edges: Vec<[Vec3; 4]> = (0..=pieces)
            .map(|index| {
                let (place, axis, _) = stem.at(index as f32 / pieces as f32);
                let side = axis.cross(Vec3::Z).normalize_or(Vec3::X);
                let up = side.cross(axis);
                let turn = Quat::from_axis_angle(axis, roll);
                let left = turn * (-side * fold.cos() - up * fold.sin());
                let right = turn * (side * fold.cos() - up * fold.sin());
                let down = turn * -up;
                [place, place + left * half, place + right * half, place + down * curtain * length]
            })
            .collect();
        for (index, pair) in edges.windows(2).enumerate() {
            let v = |index: usize| 1.0 - index as f32 / pieces as f32;
            let (near, far) = (v(index), v(index + 1));
            let [[from, from_left, from_right, from_down], [to, to_left, to_right, to_down]] =
                [pair[0], pair[1]];
            self.leaf_quad(
                [from, from_left, to_left, to],
                &region,
                [[0.5, near], [0.0, near], [0.0, far], [0.5, far]],
            );
            self.leaf_quad(
                [from, from_right, to_right, to],
                &region,
                [[0.5, near], [1.0, near], [1.0, far], [0.5, far]],
            );
            self.leaf_quad(
                [from, from_down, to_down, to],
                &region,
                [[0.5, near], [1.0, near], [1.0, far], [0.5, far]],
            );
        }
    }

    /// Cards along the outer part of the stem and at its tip.
    fn cards(&mut self, stem: &Stem, count: u32, size: f32, hang: f32, random: &mut Random) {
        let mut turn = random.between(0.0, 360.0);
        for index in 0..count {
            let along = if index + 1 == count {
                1.0
            } else {
                0.25 + 0.75 * (index as f32 + random.unit()) / count as f32
            };
            let (place, axis, _) = stem.at(along);
            turn += 137.5;
            let spread = if index + 1 == count { 10.0 } else { random.between(30.0, 75.0_f32) };
            let across = if axis.z.abs() > 0.9 { Vec3::X } else { Vec3::Z };
            let side = (across - axis * axis.dot(across)).normalize_or(Vec3::X);
            let (spread, turn) = (spread.to_radians(), turn.to_radians());
            let sideways = side * turn.cos() + axis.cross(side) * turn.sin();
            let grown = axis * spread.cos() + sideways * spread.sin();
            let direction = (grown + self.envelope.soft_normal(place) * 0.45)
                .lerp(Vec3::NEG_Z, hang)
                .normalize_or(Vec3::Z);
            self.card(place, direction, size * random.between(0.8, 1.2), random);
        }
    }

    /// A square card that grows from a place in a direction, turned about it at random, rather toward
    /// the crown's outside.
    fn card(&mut self, place: Vec3, direction: Vec3, size: f32, random: &mut Random) {
        let region = self.some_twig(random);
        let outward = self.envelope.soft_normal(place);
        let flat =
            (outward - direction * direction.dot(outward)).normalize_or(direction.any_orthonormal_vector());
        let facing = Quat::from_axis_angle(direction, random.around(70.0_f32).to_radians()) * flat;
        let half = direction.cross(facing) * (0.5 * size);
        // A card begins a little behind its twig's end, which the picture's stalk covers.
        let root = place - direction * (0.12 * size);
        let tip = root + direction * size;
        self.leaf_quad(
            [root - half, root + half, tip + half, tip - half],
            &region,
            [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]],
        );
    }

    /// The top of the tree: upright cards whose upper edges meet at the top.
    fn crest(&mut self, size: f32, random: &mut Random) {
        let first = random.between(0.0, 180.0);
        for number in 0..3 {
            let side = Vec2::from_angle((first + 60.0 * number as f32).to_radians());
            let side = Vec3::new(side.x, side.y, 0.0) * (0.5 * size);
            let region = self.some_twig(random);
            let (foot, top) = (Vec3::new(0.0, 0.0, 1.0 - size), Vec3::Z);
            // The upper corners lie where the crown's surface lets them: at the top itself.
            self.leaf_quad(
                [foot - side, foot + side, top + side * 0.02, top - side * 0.02],
                &region,
                [[0.0, 1.0], [1.0, 1.0], [0.75, 0.0], [0.25, 0.0]],
            );
            if let Some(quad) = self.quads.last_mut() {
                for corner in &mut quad.corners[2..] {
                    corner.position = top.to_array();
                }
            }
        }
    }
}

/// The greatest height of any foliage or rock of a model.
pub fn top(quads: &[Quad]) -> f32 {
    quads.iter().flat_map(Quad::places).map(|place| place.z).fold(0.0, f32::max)
}
