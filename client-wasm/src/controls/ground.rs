//! What the controls ask of the landscape, and where a ray meets it.

use glam::DVec3;
use treeline_core::geodesy;

/// The landscape as the controls see it.
pub trait Ground {
    /// Height of the drawn surface, metres above the ellipsoid; `None` where there is none.
    fn height(&self, longitude: f64, latitude: f64) -> Option<f64>;

    /// A height that no surface exceeds, metres.
    fn greatest_height(&self) -> f64;
}

/// Steps of the search along a ray.
const STEPS: usize = 512;
/// Share of the clearance that a step goes: ground steeper than 1 : 2 toward the ray may be
/// overstepped by a corner, which a pointer does not notice.
const STRIDE: f64 = 0.5;

/// First meeting of a ray with the landscape, ECEF metres. Where the landscape has no data the
/// ellipsoid stands in, so that a pointer beside the data still holds something. `None` for the sky.
pub fn pick(ground: &dyn Ground, eye: DVec3, direction: DVec3) -> Option<DVec3> {
    let top = ground.greatest_height().max(0.0) + 1.0;
    let mut distance = 0.0;
    let mut before = 0.0;
    for _ in 0..STEPS {
        let point = eye + direction * distance;
        let place = geodesy::geodetic_from_ecef(point);
        let surface = ground.height(place.longitude, place.latitude).unwrap_or(0.0);
        let clearance = place.height - surface;
        if clearance <= 0.0 {
            return Some(refined(ground, eye, direction, before, distance));
        }
        if place.height > top && direction.dot(point) >= 0.0 {
            return None; // above everything, and rising
        }
        before = distance;
        // Far out the fall toward the highest ground is free; near it the clearance guides.
        let free = (place.height - top).max(0.0);
        distance += (STRIDE * clearance).max(free).max(0.5 + 1e-3 * distance);
    }
    None
}

/// Halves the interval in which the ray goes under the surface.
fn refined(ground: &dyn Ground, eye: DVec3, direction: DVec3, mut above: f64, mut below: f64) -> DVec3 {
    for _ in 0..24 {
        let middle = 0.5 * (above + below);
        let place = geodesy::geodetic_from_ecef(eye + direction * middle);
        if place.height > ground.height(place.longitude, place.latitude).unwrap_or(0.0) {
            above = middle;
        } else {
            below = middle;
        }
    }
    eye + direction * below
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::controls::pose;
    use glam::DVec2;
    use treeline_core::camera::GeographicCamera;

    /// A plain at one height everywhere.
    pub(crate) struct Plain(pub f64);

    impl Ground for Plain {
        fn height(&self, _: f64, _: f64) -> Option<f64> {
            Some(self.0)
        }

        fn greatest_height(&self) -> f64 {
            self.0
        }
    }

    fn camera(height: f64, pitch_deg: f64) -> GeographicCamera {
        GeographicCamera { lon: 8.0, lat: 46.5, height, heading_deg: 40.0, pitch_deg, fov_y_deg: 50.0 }
    }

    #[test]
    fn a_plain_is_met_at_its_height() {
        for (height, pitch) in [(1500.0, -90.0), (1500.0, -10.0), (1000.5, -3.0), (2.0e6, -70.0)] {
            let camera = camera(height, pitch);
            let ray = pose::ray_direction(&camera, 1.5, DVec2::ZERO);
            let point = pick(&Plain(1000.0), camera.eye_ecef(), ray).unwrap();
            let place = geodesy::geodetic_from_ecef(point);
            assert!((place.height - 1000.0).abs() < 0.1, "{height} {pitch}: {place:?}");
        }
    }

    #[test]
    fn the_sky_and_an_eye_under_the_ground() {
        let up = camera(1500.0, 20.0);
        let ray = pose::ray_direction(&up, 1.5, DVec2::ZERO);
        assert_eq!(pick(&Plain(1000.0), up.eye_ecef(), ray), None);
        let under = camera(500.0, 20.0);
        let ray = pose::ray_direction(&under, 1.5, DVec2::ZERO);
        assert_eq!(pick(&Plain(1000.0), under.eye_ecef(), ray), Some(under.eye_ecef()));
        // From space past the Earth's limb.
        let far = camera(1.0e7, -40.0);
        let ray = pose::ray_direction(&far, 1.5, DVec2::ZERO);
        assert_eq!(pick(&Plain(1000.0), far.eye_ecef(), ray), None);
    }
}
