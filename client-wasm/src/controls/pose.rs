//! Moving a camera over the ellipsoid: pure functions from one pose to the next.
//!
//! A pose is an eye in ECEF metres with a heading and a pitch; there is no roll. What turns about
//! the Earth's centre or about a pivot takes the camera's right axis with it, so that a heading
//! stays meaningful across meridians and at the nadir.

use glam::{DMat3, DQuat, DVec2, DVec3};
use treeline_core::camera::GeographicCamera;
use treeline_core::geodesy;

/// Steepest look upward that the controls reach, degrees.
pub const GREATEST_PITCH_DEGREES: f64 = 60.0;
/// Steepest look downward, degrees.
pub const LEAST_PITCH_DEGREES: f64 = -90.0;
/// Highest eye that the controls reach, metres above the ellipsoid.
pub const GREATEST_HEIGHT_METRES: f64 = 3.0e7;

/// Rotation whose columns are the camera's right, up and backward axes in ECEF.
pub fn ecef_from_view(camera: &GeographicCamera) -> DMat3 {
    geodesy::ecef_from_enu(camera.lon, camera.lat) * camera.enu_from_view()
}

/// Unit direction, in ECEF, of the ray through a point of the picture: x −1 (left) … 1, y −1 (bottom) … 1.
pub fn ray_direction(camera: &GeographicCamera, aspect: f64, point: DVec2) -> DVec3 {
    let half = (0.5 * camera.fov_y_deg).to_radians().tan();
    let view = DVec3::new(point.x * half * aspect, point.y * half, -1.0);
    (ecef_from_view(camera) * view).normalize()
}

/// The camera with another eye (ECEF metres) and another right axis (ECEF); the pitch stays.
fn with_eye(camera: &GeographicCamera, eye: DVec3, right: DVec3) -> GeographicCamera {
    let place = geodesy::geodetic_from_ecef(eye);
    let right_enu = geodesy::ecef_from_enu(place.longitude, place.latitude).transpose() * right;
    GeographicCamera {
        lon: place.longitude,
        lat: place.latitude,
        height: place.height.min(GREATEST_HEIGHT_METRES),
        heading_deg: normal_heading((-right_enu.y).atan2(right_enu.x).to_degrees()),
        ..*camera
    }
}

/// A heading in 0…360 degrees.
pub fn normal_heading(degrees: f64) -> f64 {
    let heading = degrees.rem_euclid(360.0);
    if heading >= 360.0 { 0.0 } else { heading }
}

/// Turns the camera about the Earth's centre; its height stays exactly.
fn turned_about_earth(camera: &GeographicCamera, turn: DQuat) -> GeographicCamera {
    let turned = with_eye(camera, turn * camera.eye_ecef(), turn * ecef_from_view(camera).x_axis);
    GeographicCamera { height: camera.height, ..turned }
}

/// Goes level over the ellipsoid: metres to the camera's right and metres ahead.
pub fn advanced(camera: &GeographicCamera, right_metres: f64, ahead_metres: f64) -> GeographicCamera {
    let distance = right_metres.hypot(ahead_metres);
    if distance == 0.0 {
        return *camera;
    }
    let heading = camera.heading_deg.to_radians();
    let (sine, cosine) = heading.sin_cos();
    let enu = DVec3::new(
        right_metres * cosine + ahead_metres * sine,
        ahead_metres * cosine - right_metres * sine,
        0.0,
    ) / distance;
    let direction = geodesy::ecef_from_enu(camera.lon, camera.lat) * enu;
    let eye = camera.eye_ecef();
    let Some(axis) = eye.cross(direction).try_normalize() else { return *camera };
    turned_about_earth(camera, DQuat::from_axis_angle(axis, distance / eye.length()))
}

/// Moves the camera level so that `anchor` (ECEF metres) lies on the ray through `point`; `None`
/// where no such move is near: the ray looks over the anchor's height, or nearly along the ground.
pub fn grabbed(
    camera: &GeographicCamera,
    aspect: f64,
    anchor: DVec3,
    point: DVec2,
) -> Option<GeographicCamera> {
    let eye = camera.eye_ecef();
    let radius = anchor.length();
    if eye.length() <= radius * (1.0 + 1e-9) {
        return None;
    }
    // First meeting of the ray with the sphere through the anchor.
    let direction = ray_direction(camera, aspect, point);
    let along = eye.dot(direction);
    let discriminant = along * along - (eye.length_squared() - radius * radius);
    if discriminant <= 0.0 || along >= 0.0 {
        return None;
    }
    let under_pointer = eye + direction * (-along - discriminant.sqrt());
    // At a grazing ray a pixel is a kilometre: such a step is no grab any more.
    let distance = (anchor - eye).length();
    if (under_pointer - anchor).length() > 2.0 * distance {
        return None;
    }
    let turn = DQuat::from_rotation_arc(under_pointer.normalize(), anchor.normalize());
    Some(turned_about_earth(camera, turn))
}

/// Turns about a pivot (ECEF metres): `yaw` degrees clockwise as seen from above for the picture's
/// heading, `tilt` degrees upward for its pitch. The pivot stays where it is in the picture.
pub fn orbited(
    camera: &GeographicCamera,
    pivot: DVec3,
    yaw_degrees: f64,
    tilt_degrees: f64,
) -> GeographicCamera {
    let place = geodesy::geodetic_from_ecef(pivot);
    let up = geodesy::ecef_from_enu(place.longitude, place.latitude).z_axis;
    let yaw = DQuat::from_axis_angle(up, -yaw_degrees.to_radians());
    let right = yaw * ecef_from_view(camera).x_axis;
    let pitch = (camera.pitch_deg + tilt_degrees).clamp(LEAST_PITCH_DEGREES, GREATEST_PITCH_DEGREES);
    let tilt = DQuat::from_axis_angle(right, (pitch - camera.pitch_deg).to_radians());
    let eye = pivot + tilt * (yaw * (camera.eye_ecef() - pivot));
    GeographicCamera { pitch_deg: pitch, ..with_eye(camera, eye, right) }
}

/// Turns on the spot.
pub fn looked(camera: &GeographicCamera, yaw_degrees: f64, tilt_degrees: f64) -> GeographicCamera {
    GeographicCamera {
        heading_deg: normal_heading(camera.heading_deg + yaw_degrees),
        pitch_deg: (camera.pitch_deg + tilt_degrees).clamp(LEAST_PITCH_DEGREES, GREATEST_PITCH_DEGREES),
        ..*camera
    }
}

/// Goes toward `target` (ECEF metres) until only `factor` of the distance is left; more than 1 goes away.
pub fn zoomed(camera: &GeographicCamera, target: DVec3, factor: f64) -> GeographicCamera {
    let eye = camera.eye_ecef();
    with_eye(camera, target + (eye - target) * factor, ecef_from_view(camera).x_axis)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(crate) fn camera(
        lon: f64,
        lat: f64,
        height: f64,
        heading_deg: f64,
        pitch_deg: f64,
    ) -> GeographicCamera {
        GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 50.0 }
    }

    fn on_picture(camera: &GeographicCamera, aspect: f64, point: DVec3) -> DVec2 {
        let view = ecef_from_view(camera).transpose() * (point - camera.eye_ecef());
        let half = (0.5 * camera.fov_y_deg).to_radians().tan();
        DVec2::new(view.x / (-view.z * half * aspect), view.y / (-view.z * half))
    }

    #[test]
    fn ahead_is_where_the_heading_points() {
        let start = camera(10.0, 45.0, 3000.0, 90.0, -30.0);
        let east = advanced(&start, 0.0, 1000.0);
        assert!((east.lon - 10.0 - 1000.0 / 78_885.0).abs() < 2e-5, "{east:?}");
        assert!((east.lat - 45.0).abs() < 1e-5);
        assert_eq!(east.height, 3000.0);
        let south = advanced(&start, 1000.0, 0.0);
        assert!(south.lat < 45.0 - 0.0089 && (south.lon - 10.0).abs() < 1e-6, "{south:?}");
    }

    #[test]
    fn the_heading_of_a_look_straight_down_is_kept() {
        let start = camera(10.0, 45.0, 3000.0, 123.0, -90.0);
        assert!((advanced(&start, 0.0, 0.001).heading_deg - 123.0).abs() < 1e-3);
    }

    #[test]
    fn over_the_pole_and_back() {
        let start = camera(0.0, 89.99, 1000.0, 0.0, -30.0);
        let beyond = advanced(&start, 0.0, 3000.0);
        assert!((beyond.lon.abs() - 180.0).abs() < 1e-3, "{beyond:?}");
        assert!((beyond.heading_deg - 180.0).abs() < 1e-3, "{beyond:?}");
        let back = advanced(&beyond, 0.0, -3000.0);
        assert!((back.lat - start.lat).abs() < 1e-4, "{back:?}");
    }

    proptest! {
        #[test]
        fn a_grabbed_point_follows_the_pointer(
            lat in -70.0..70.0_f64,
            heading in 0.0..360.0_f64,
            pitch in -90.0..-25.0_f64,
            height in 500.0..20_000.0_f64,
            from in (-0.8..0.8_f64, -0.8..0.5_f64),
            to in (-0.8..0.8_f64, -0.8..0.5_f64),
        ) {
            let start = camera(7.0, lat, height, heading, pitch);
            let aspect = 1.5;
            let eye = start.eye_ecef();
            let ray = ray_direction(&start, aspect, DVec2::new(from.0, from.1));
            let up = geodesy::ecef_from_enu(start.lon, start.lat).z_axis;
            prop_assume!(ray.dot(up) < -0.1);
            let anchor = eye + ray * (height - 100.0) / -ray.dot(up);
            let to = DVec2::new(to.0, to.1);
            if let Some(first) = grabbed(&start, aspect, anchor, to) {
                // Levelling leaves a little, which the next event of the same drag takes away.
                let moved = grabbed(&first, aspect, anchor, to).unwrap();
                prop_assert!((on_picture(&moved, aspect, anchor) - to).length() < 0.02);
                prop_assert_eq!(moved.height, start.height);
            }
        }

        #[test]
        fn the_pivot_stays_in_the_picture(
            heading in 0.0..360.0_f64,
            pitch in -80.0..-20.0_f64,
            yaw in -170.0..170.0_f64,
            tilt in -10.0..10.0_f64,
        ) {
            let start = camera(7.0, 46.0, 4000.0, heading, pitch);
            let pivot = start.eye_ecef() + ray_direction(&start, 1.0, DVec2::new(0.2, -0.1)) * 3000.0;
            let turned = orbited(&start, pivot, yaw, tilt);
            prop_assert!((on_picture(&turned, 1.0, pivot) - DVec2::new(0.2, -0.1)).length() < 2e-3);
            let expected = normal_heading(heading + yaw);
            let difference = (turned.heading_deg - expected + 180.0).rem_euclid(360.0) - 180.0;
            prop_assert!(difference.abs() < 0.1, "{difference}");
        }

        #[test]
        fn zooming_in_and_out_comes_back(factor in 0.05..0.95_f64, heading in 0.0..360.0_f64) {
            let start = camera(-120.0, 38.0, 5000.0, heading, -40.0);
            let target = start.eye_ecef() + ray_direction(&start, 1.0, DVec2::ZERO) * 6000.0;
            let near = zoomed(&start, target, factor);
            prop_assert!(((near.eye_ecef() - target).length() - 6000.0 * factor).abs() < 1e-6);
            let back = zoomed(&near, target, 1.0 / factor);
            prop_assert!((back.eye_ecef() - start.eye_ecef()).length() < 1e-5);
        }
    }
}
