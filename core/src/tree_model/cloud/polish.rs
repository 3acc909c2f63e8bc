//! Turning chosen planes until the piece that is farthest from its plane is nearer.

use super::hough::{Plane, Rules, worth};
use super::pieces::Pieces;
use glam::{Quat, Vec3};

/// Rounds of sharing pieces out and turning planes.
const ROUNDS: usize = 14;
/// Turns that are tried, degrees.
const TURNS: [f32; 4] = [5.0, 2.0, 0.8, 0.3];

/// Gives every piece to the plane that its farthest corner is nearest to, then moves every plane to
/// where the farthest of its own corners is nearest, and begins anew: the greatest distance never
/// grows. Returns it with the planes.
pub fn polish(pieces: &Pieces, mut planes: Vec<Plane>, rules: &Rules) -> (Vec<Plane>, f32) {
    let (mut own, mut greatest) = shared_out(pieces, &planes);
    for _ in 0..ROUNDS {
        let mut moved = planes.clone();
        for (index, corners) in own.iter().enumerate() {
            let others: Vec<Plane> = moved
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != index)
                .map(|(_, plane)| *plane)
                .collect();
            moved[index] = centred(pieces, corners, moved[index], &others, rules);
        }
        let (again, reached) = shared_out(pieces, &moved);
        if reached >= greatest - 1e-6 {
            break;
        }
        (planes, own, greatest) = (moved, again, reached);
    }
    (planes, greatest)
}

/// The corners of the pieces that each plane has, and the greatest distance of any.
fn shared_out(pieces: &Pieces, planes: &[Plane]) -> (Vec<Vec<u32>>, f32) {
    let mut nearest = vec![(f32::INFINITY, 0); pieces.list.len()];
    for (index, plane) in planes.iter().enumerate() {
        for (distance, nearest) in pieces.distances(plane).into_iter().zip(&mut nearest) {
            if distance < nearest.0 {
                *nearest = (distance, index);
            }
        }
    }
    let mut own = vec![Vec::new(); planes.len()];
    for (corners, &(_, plane)) in pieces.corners.iter().zip(&nearest) {
        own[plane].extend(corners);
    }
    for corners in &mut own {
        corners.sort_unstable();
        corners.dedup();
    }
    (own, nearest.iter().map(|&(distance, _)| distance).fold(0.0, f32::max))
}

/// The plane, turned a little and put in the middle of its corners.
fn centred(pieces: &Pieces, corners: &[u32], plane: Plane, others: &[Plane], rules: &Rules) -> Plane {
    let spread = |normal: Vec3| {
        let heights = corners.iter().map(|&corner| pieces.vertices[corner as usize].dot(normal));
        let [low, high] = heights.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], height| {
            [low.min(height), high.max(height)]
        });
        (high - low, 0.5 * (high + low))
    };
    if corners.is_empty() {
        return plane;
    }
    let mut normal = plane.normal;
    let (mut best, mut offset) = spread(normal);
    for degrees in TURNS {
        let side = normal.any_orthonormal_vector();
        let other = normal.cross(side);
        for axis in [side, -side, other, -other] {
            let turned = (Quat::from_axis_angle(axis, degrees.to_radians()) * normal).normalize();
            let (width, middle) = spread(turned);
            if width < best && worth(turned, others, rules) > 0.0 {
                (best, offset, normal) = (width, middle, turned);
            }
        }
    }
    Plane { normal, offset }
}
