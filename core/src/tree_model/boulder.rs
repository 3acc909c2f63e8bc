//! A boulder: a cube's faces blown up into the envelope, with dents.

use super::envelope::Envelope;
use super::geometry::{Pictures, uv_in};
use super::quad::{Corner, Quad};
use super::random::Random;
use glam::{Vec2, Vec3};

/// Quads along a face's side.
const PIECES: usize = 6;

/// A boulder that touches the top and stays within the envelope, which reaches to the ground here.
pub fn boulder(envelope: &Envelope, pictures: &Pictures, random: &mut Random) -> Vec<Quad> {
    let dents: Vec<(Vec3, f32)> = (0..14)
        .map(|_| {
            let way = Vec3::new(random.around(1.0), random.around(1.0), random.around(1.0));
            (way.normalize_or(Vec3::Z), random.between(0.62, 0.95))
        })
        .collect();
    // Cut by planes at random: a rock has faces and edges.
    let cut = |way: Vec3| {
        dents.iter().fold(1.0_f32, |reach, &(normal, distance)| {
            let facing = way.dot(normal);
            if facing > 0.0 { reach.min(distance / facing) } else { reach }
        })
    };
    let middle = Vec3::new(0.0, 0.0, 0.4);
    let place = |way: Vec3| {
        let raw =
            middle + Vec3::new(way.x * envelope.radius, way.y * envelope.radius, 0.6 * way.z) * cut(way);
        // What lies in the ground stands upright there.
        if raw.z > 0.0 { envelope.pull_in(raw) } else { Vec3::new(raw.x, raw.y, raw.z.max(-0.05)) }
    };
    let faces = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
    let mut quads = Vec::new();
    for face in faces {
        let side = if face.z.abs() > 0.5 { Vec3::X } else { Vec3::Z };
        let other = face.cross(side);
        let point = |i: usize, j: usize| {
            let at = Vec2::new(i as f32, j as f32) / PIECES as f32 * 2.0 - 1.0;
            (face + side * at.x + other * at.y).normalize()
        };
        for i in 0..PIECES {
            for j in 0..PIECES {
                let ways = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
                let places = ways.map(place);
                let flat = (places[2] - places[0]).cross(places[3] - places[1]).normalize_or(ways[0]);
                let normal = if flat.dot(ways[0]) < 0.0 { -flat } else { flat };
                let mut corners = [Corner::default(); 4];
                for (index, corner) in corners.iter_mut().enumerate() {
                    let (u, v) = ([i, i + 1, i + 1, i][index], [j, j, j + 1, j + 1][index]);
                    *corner = Corner {
                        position: places[index].to_array(),
                        uv: uv_in(
                            &pictures.bark,
                            pictures.side,
                            u as f32 / PIECES as f32,
                            v as f32 / PIECES as f32,
                        ),
                        normal: normal.to_array(),
                        shade: (0.35 + 0.65 * places[index].z).clamp(0.0, 1.0),
                        foliage: 0.0,
                    };
                }
                quads.push(Quad { corners });
            }
        }
    }
    // The highest place becomes the top.
    let top = super::geometry::top(&quads).max(1e-3);
    for corner in quads.iter_mut().flat_map(|quad| &mut quad.corners) {
        let place = Vec3::from(corner.position);
        if place.z >= top {
            corner.position = Vec3::Z.to_array();
        } else if place.z > 0.0 {
            corner.position = envelope.pull_in(Vec3::new(place.x, place.y, place.z / top)).to_array();
        }
    }
    quads
}
