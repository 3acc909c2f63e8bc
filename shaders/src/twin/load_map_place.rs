//! Twin of `load_map_place.wgsl`: places in metres from the eye, without cancellation.

use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, PI};

/// WGS84: semi-major axis, metres.
const SEMI_MAJOR: f32 = 6_378_137.0;
/// WGS84: first eccentricity squared.
const ECCENTRICITY_SQUARED: f32 = 0.006_694_38;

/// Sine of −π…π, right to 2e-7.
pub fn sine(angle: f32) -> f32 {
    let mut x = angle;
    if x > FRAC_PI_2 {
        x = PI - x;
    } else if x < -FRAC_PI_2 {
        x = -PI - x;
    }
    let y = x * x;
    let tail = y * (1.0 / 362_880.0 - y * (1.0 / 39_916_800.0));
    x - x * y * (1.0 / 6.0 - y * (1.0 / 120.0 - y * (1.0 / 5_040.0 - tail)))
}

/// From the eye (sine and cosine of its latitude, height in metres, prime vertical radius) to a place so many radians farther east and north, at a height in metres: east, north and up at
/// the eye, metres.
pub fn enu_from_place(eye: [f32; 4], east: f32, north: f32, height: f32) -> Vec3 {
    let [sine_eye, cosine_eye, height_eye, normal_eye] = eye;
    let rise = height - height_eye;
    let half_sine = sine(0.5 * north);
    let quarter_sine = sine(0.25 * north);
    let half_cosine = 1.0 - 2.0 * quarter_sine * quarter_sine;
    let sine_change = 2.0 * half_sine * (cosine_eye * half_cosine - sine_eye * half_sine);
    let cosine_change = -2.0 * half_sine * (sine_eye * half_cosine + cosine_eye * half_sine);
    let sine_there = sine_eye + sine_change;
    let there = (1.0 - ECCENTRICITY_SQUARED * sine_there * sine_there).sqrt();
    let here = (1.0 - ECCENTRICITY_SQUARED * sine_eye * sine_eye).sqrt();
    let square_change = sine_change * (sine_eye + sine_there);
    let normal_change = SEMI_MAJOR * ECCENTRICITY_SQUARED * square_change / (there * here * (there + here));
    let normal_there = normal_eye + normal_change;
    let flat = 1.0 - ECCENTRICITY_SQUARED;
    let axis_change = (normal_there + height) * cosine_change + cosine_eye * (normal_change + rise);
    let polar_change =
        (normal_there * flat + height) * sine_change + sine_eye * (normal_change * flat + rise);
    let turn = east - 2.0 * PI * (east / (2.0 * PI)).round_ties_even();
    let axis = (normal_eye + height_eye) * cosine_eye + axis_change;
    let half_turn = sine(0.5 * turn);
    let outward = axis_change - 2.0 * axis * half_turn * half_turn;
    Vec3::new(
        axis * sine(turn),
        cosine_eye * polar_change - sine_eye * outward,
        cosine_eye * outward + sine_eye * polar_change,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use treeline_core::geodesy::{self, Geodetic};
    use treeline_core::ray_frame::EyeFrame;

    const POLE: f64 = std::f64::consts::FRAC_PI_2;

    proptest! {
        #[test]
        fn the_sine_is_right_to_2e_7(angle in -PI..PI) {
            prop_assert!((f64::from(sine(angle)) - f64::from(angle).sin()).abs() < 2e-7);
        }

        /// To a millionth of the distance, from a metre to the other side of the Earth, at any latitude; and to the
        /// roundings of the angles and heights that it is given.
        #[test]
        fn places_are_those_of_the_exact_conversion(
            latitude in -90.0..=90.0_f64, eye_height in -100.0..1.0e5_f64, height in -500.0..9.0e3_f64,
            exponent in -7.0..0.3_f64, direction in 0.0..6.3_f64,
        ) {
            let away = 10.0_f64.powf(exponent);
            let there = (latitude.to_radians() + away * direction.sin()).clamp(-POLE, POLE);
            let east = (away * direction.cos()) as f32;
            let north = (there - latitude.to_radians()) as f32;
            let (sine, cosine) = latitude.to_radians().sin_cos();
            let frame =
                [sine as f32, cosine as f32, eye_height as f32, geodesy::prime_vertical_radius(latitude) as f32];
            let found = enu_from_place(frame, east, north, height as f32).as_dvec3();
            let eye = EyeFrame::at(Geodetic { longitude: 0.0, latitude, height: f64::from(frame[2]) });
            let place = Geodetic {
                longitude: f64::from(east).to_degrees(),
                latitude: latitude + f64::from(north).to_degrees(),
                height: f64::from(height as f32),
            };
            let exact = eye.ecef_from_enu.transpose() * (geodesy::ecef_from_geodetic(place) - eye.ecef);
            let error = (found - exact).length();
            prop_assert!(error < 1e-6 * exact.length() + 1e-6 * eye_height.abs().max(height.abs()) + 1e-3, "{error} m of {}", exact.length());
        }
    }
}
