//! What lies: stones and dead wood.

use super::{Corner, Mesh, Part};
use crate::tree_model::Random;
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// Quads along a side of the cube that a stone is made from.
const STONE_PIECES: usize = 3;

fn plain(position: Vec3, normal: Vec3, tone: f32, shade: f32) -> Corner {
    let tone = Vec3::splat(tone);
    Corner { position, side: 0.0, lateral: 0.0, normal, tone, shade, part: Part::Own, near: false }
}

/// A stone with faces and edges: a ball cut by planes, the lower part in the ground.
pub fn stone(random: &mut Random) -> Mesh {
    let cuts: Vec<(Vec3, f32)> = (0..11)
        .map(|_| {
            let way = Vec3::new(random.around(1.0), random.around(1.0), random.around(1.0));
            (way.normalize_or(Vec3::Z), random.between(0.55, 0.9))
        })
        .collect();
    let (long, flat) = (random.between(0.7, 1.0), random.between(0.55, 0.85));
    let place = |way: Vec3| {
        let cut = cuts.iter().fold(1.0_f32, |reach, &(normal, distance)| {
            let facing = way.dot(normal);
            if facing > 0.0 { reach.min(distance / facing) } else { reach }
        });
        let place = way * cut * Vec3::new(0.5, 0.5 * long, 0.5 * flat) + Vec3::Z * 0.16;
        place.with_z(place.z.max(-0.12))
    };
    let mut mesh = Mesh::default();
    for face in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y] {
        let side = if face.z.abs() > 0.5 { Vec3::X } else { Vec3::Z };
        let other = face.cross(side);
        let point = |i: usize, j: usize| {
            let at = Vec2::new(i as f32, j as f32) / STONE_PIECES as f32 * 2.0 - 1.0;
            (face + side * at.x + other * at.y).normalize()
        };
        for (i, j) in (0..STONE_PIECES).flat_map(|i| (0..STONE_PIECES).map(move |j| (i, j))) {
            let ways = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
            let places = ways.map(place);
            let across = (places[2] - places[0]).cross(places[3] - places[1]).normalize_or(ways[0]);
            let across = if across.dot(ways[0]) < 0.0 { -across } else { across };
            let tone = random.between(0.88, 1.12);
            let corners = [0, 1, 2, 3].map(|index| {
                // A little rounder than its faces.
                let normal = (across + 0.35 * ways[index]).normalize();
                let shade = (0.35 + 2.2 * places[index].z).clamp(0.0, 1.0);
                mesh.corner(plain(places[index], normal, tone, shade))
            });
            mesh.triangle([corners[0], corners[1], corners[2]]);
            mesh.triangle([corners[0], corners[2], corners[3]]);
        }
    }
    mesh
}

/// A fallen bough: a bent, tapering log with stubs.
pub fn wood(random: &mut Random) -> Mesh {
    const RINGS: usize = 5;
    const SIDES: usize = 7;
    let mut mesh = Mesh::default();
    let (thick, thin) = (random.between(0.038, 0.06), random.between(0.018, 0.03));
    let bend = random.around(0.09);
    let middle = |share: f32| {
        let radius = thick + (thin - thick) * share;
        let z = radius * 0.75 + 0.03 * share * share;
        (Vec3::new(share - 0.5, bend * (1.0 - (2.0 * share - 1.0).powi(2)), z), radius)
    };
    let mut rings: Vec<Vec<u32>> = Vec::new();
    for ring in 0..RINGS {
        let (centre, radius) = middle(ring as f32 / (RINGS - 1) as f32);
        let corners = (0..SIDES).map(|side| {
            let turn = side as f32 / SIDES as f32 * TAU;
            let out = Vec3::new(0.0, turn.cos(), turn.sin());
            let bark = random.between(0.8, 1.2);
            let shade = (0.55 + 0.45 * out.z).clamp(0.1, 1.0);
            mesh.corner(plain(centre + out * radius, out, bark, shade))
        });
        rings.push(corners.collect());
    }
    for pair in rings.windows(2) {
        for side in 0..SIDES {
            let next = (side + 1) % SIDES;
            mesh.triangle([pair[0][side], pair[1][side], pair[1][next]]);
            mesh.triangle([pair[0][side], pair[1][next], pair[0][next]]);
        }
    }
    // Sawn or broken ends are pale.
    for (end, way) in [(0.0, Vec3::NEG_X), (1.0, Vec3::X)] {
        let (centre, radius) = middle(end);
        let heart = mesh.corner(plain(centre, way, 1.7, 0.8));
        let rim: Vec<u32> = (0..SIDES)
            .map(|side| {
                let turn = side as f32 / SIDES as f32 * TAU;
                mesh.corner(plain(centre + Vec3::new(0.0, turn.cos(), turn.sin()) * radius, way, 1.4, 0.7))
            })
            .collect();
        for side in 0..SIDES {
            mesh.triangle([heart, rim[side], rim[(side + 1) % SIDES]]);
        }
    }
    for number in 0..3 {
        let (foot, radius) = middle(0.25 + 0.22 * number as f32 + random.around(0.06));
        let turn = random.between(0.08, 0.42) * TAU;
        let way = Vec3::new(random.between(0.2, 0.7), turn.cos(), turn.sin().abs()).normalize();
        let tip = foot + way * random.between(0.07, 0.16);
        let across = way.cross(Vec3::X).normalize_or(Vec3::Y);
        let other = way.cross(across);
        let corners: Vec<u32> = (0..3)
            .map(|side| {
                let turn = side as f32 / 3.0 * TAU;
                let out = across * turn.cos() + other * turn.sin();
                mesh.corner(plain(foot + out * radius * 0.45, out, 0.95, 0.7))
            })
            .collect();
        let tip = mesh.corner(plain(tip, way, 1.15, 0.9));
        for side in 0..3 {
            mesh.triangle([corners[side], corners[(side + 1) % 3], tip]);
        }
    }
    mesh
}
