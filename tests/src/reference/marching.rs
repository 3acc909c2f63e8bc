//! The first hit of a ray by brute force: small steps, and a look at the sign.

use super::Ground;
use glam::DVec3;

/// Height of a ray's point above the surface, `None` where there is none.
fn above(ground: &Ground, eye: DVec3, direction: DVec3, t: f64) -> Option<f64> {
    let point = eye + t * direction;
    let across = (point - eye).truncate();
    ground.height(point.x, point.y).map(|height| point.z - height + ground.bend * across.length_squared())
}

/// The first step, of so many cells' length, in which the ray changes sides over one unbroken surface, up
/// to the distance `far`.
pub fn first_hit(
    ground: &Ground,
    eye: DVec3,
    direction: DVec3,
    step_cells: f64,
    far: f64,
) -> Option<[f64; 2]> {
    let step = step_cells * ground.cell;
    let mut before = above(ground, eye, direction, 0.0);
    let mut k = 0.0;
    while k * step < far {
        let after = above(ground, eye, direction, (k + 1.0) * step);
        let middle = above(ground, eye, direction, (k + 0.5) * step);
        if let (Some(a), Some(b)) = (before, after)
            && middle.is_some()
            && a * b <= 0.0
        {
            return Some([k * step, (k + 1.0) * step]);
        }
        before = after;
        k += 1.0;
    }
    None
}

/// Whether the ray's point at t lies on the surface, as well as f64 can tell.
pub fn on_surface(ground: &Ground, eye: DVec3, direction: DVec3, t: f64) -> bool {
    // On the border of a void only the inner side has a height.
    let near = 1e-9 * (1.0 + t);
    [0.0, -near, near]
        .into_iter()
        .filter_map(|offset| above(ground, eye, direction, t + offset))
        .any(|height| height.abs() < 1e-5)
}
