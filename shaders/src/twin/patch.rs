//! Twin of `patch.wgsl`: the exact bilinear patch of one cell.

use glam::{Vec2, Vec3, Vec4};

/// Height of the patch; nodes are north-west, north-east, south-west, south-east, place is 0…1.
pub fn patch_height(nodes: Vec4, place: Vec2) -> f32 {
    let far = 1.0 - place;
    far.y * (far.x * nodes.x + place.x * nodes.y) + place.y * (far.x * nodes.z + place.x * nodes.w)
}

/// Height of the ray above the patch from `place` on, as constant, r, r².
pub fn ray_minus_patch(
    nodes: Vec4,
    place: Vec2,
    slope: Vec2,
    height: f32,
    rise: f32,
    curvature: f32,
) -> Vec3 {
    let east_north = nodes.y - nodes.x;
    let south_west = nodes.z - nodes.x;
    let twist = (nodes.w - nodes.z) - east_north;
    Vec3::new(
        height - patch_height(nodes, place),
        rise - ((east_north + twist * place.y) * slope.x + (south_west + twist * place.x) * slope.y),
        curvature - twist * slope.x * slope.y,
    )
}

/// The first r in 0…length at which f, not negative at 0, becomes negative; −1 where it does not.
pub fn first_crossing(f: Vec3, length: f32) -> f32 {
    let [c, b, a] = f.to_array();
    let discriminant = b * b - 4.0 * a * c;
    if discriminant >= 0.0 {
        let root = discriminant.sqrt();
        if b < 0.0 {
            let q = 0.5 * (root - b);
            if c <= q * length {
                return (c / q).min(length);
            }
        } else if a < 0.0 {
            let q = 0.5 * (b + root);
            if q <= -a * length {
                return (q / -a).min(length);
            }
        }
    }
    if c + length * (b + length * a) < 0.0 { length } else { -1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_crossing_is_where_f64_finds_it(c in 0.0..10.0_f32, b in -10.0..10.0_f32, a in -10.0..10.0_f32) {
            let found = first_crossing(Vec3::new(c, b, a), 1.0);
            let f = |r: f64| f64::from(c) + r * (f64::from(b) + r * f64::from(a));
            // Brute force: the first of many places at which the sign has changed.
            let steps = 4096;
            let first = (1..=steps).map(|k| f64::from(k) / f64::from(steps)).find(|&r| f(r) < 0.0);
            match first {
                Some(r) => {
                    prop_assert!(found >= 0.0, "lost at {r}");
                    prop_assert!(f64::from(found) <= r + 1e-5, "{found} behind {r}");
                    prop_assert!(f(f64::from(found)).abs() < 2e-5, "not on the surface: {}", f(f64::from(found)));
                }
                None => prop_assert!(found < 0.0 || f(f64::from(found)).abs() < 2e-5),
            }
        }

        #[test]
        fn a_shared_edge_has_one_height(nodes in prop::array::uniform4(-9000.0..9000.0_f32), others in prop::array::uniform2(-9000.0..9000.0_f32), y in 0.0..=1.0_f32) {
            let west = Vec4::from_array(nodes);
            let east = Vec4::new(nodes[1], others[0], nodes[3], others[1]);
            prop_assert_eq!(patch_height(west, Vec2::new(1.0, y)), patch_height(east, Vec2::new(0.0, y)));
        }
    }

    #[test]
    fn leaving_the_surface_is_no_crossing() {
        assert_eq!(first_crossing(Vec3::new(0.0, 1.0, 0.0), 1.0), -1.0);
        assert_eq!(first_crossing(Vec3::new(0.0, 1.0, -2.0), 1.0), 0.5);
        assert_eq!(first_crossing(Vec3::new(0.0, -1.0, 0.0), 1.0), 0.0);
        assert_eq!(first_crossing(Vec3::new(1.0, -1e-30, 0.0), 1.0), -1.0);
    }
}
