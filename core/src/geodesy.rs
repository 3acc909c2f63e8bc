//! The WGS84 ellipsoid in f64: geodetic ↔ Earth-centred (ECEF) ↔ local east-north-up (ENU).
//!
//! Heights are metres above the ellipsoid in the sense of the design: whatever the source's heights
//! are taken to be (no geoid is applied). Angles are degrees at the interfaces.

use glam::{DMat3, DVec3};

/// Semi-major axis, metres (NIMA TR8350.2).
pub const SEMI_MAJOR_METRES: f64 = 6_378_137.0;
/// Flattening (NIMA TR8350.2).
pub const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// First eccentricity squared.
pub const ECCENTRICITY_SQUARED: f64 = FLATTENING * (2.0 - FLATTENING);
/// Length of the equator, metres.
pub const EQUATOR_METRES: f64 = 2.0 * std::f64::consts::PI * SEMI_MAJOR_METRES;
/// The largest latitude of Web Mercator's square, degrees.
pub const WEB_MERCATOR_LATITUDE: f64 = 85.051_128_779_806_6;

/// A place on or above the ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geodetic {
    /// Degrees east.
    pub longitude: f64,
    /// Degrees north.
    pub latitude: f64,
    /// Metres above the ellipsoid.
    pub height: f64,
}

/// Radius of curvature in the prime vertical, N, metres, at a latitude in degrees.
pub fn prime_vertical_radius(latitude: f64) -> f64 {
    let sine = latitude.to_radians().sin();
    SEMI_MAJOR_METRES / (1.0 - ECCENTRICITY_SQUARED * sine * sine).sqrt()
}

/// Radius of curvature in the meridian, M, metres, at a latitude in degrees.
pub fn meridian_radius(latitude: f64) -> f64 {
    let sine = latitude.to_radians().sin();
    let w = 1.0 - ECCENTRICITY_SQUARED * sine * sine;
    SEMI_MAJOR_METRES * (1.0 - ECCENTRICITY_SQUARED) / (w * w.sqrt())
}

/// R = √(M·N), metres: the radius by which the ellipsoid bends away, d²/2R.
pub fn gaussian_radius(latitude: f64) -> f64 {
    (prime_vertical_radius(latitude) * meridian_radius(latitude)).sqrt()
}

/// ECEF position, metres.
pub fn ecef_from_geodetic(place: Geodetic) -> DVec3 {
    let (sine, cosine) = place.latitude.to_radians().sin_cos();
    let (sine_longitude, cosine_longitude) = place.longitude.to_radians().sin_cos();
    let n = prime_vertical_radius(place.latitude);
    let across = (n + place.height) * cosine;
    DVec3::new(
        across * cosine_longitude,
        across * sine_longitude,
        (n * (1.0 - ECCENTRICITY_SQUARED) + place.height) * sine,
    )
}

/// Geodetic position of an ECEF point, by fixed-point iteration on the latitude, below 1e-9 m from
/// 5,000 km under the surface to any height. At the axis the longitude is 0; the Earth's centre
/// answers the north pole.
pub fn geodetic_from_ecef(point: DVec3) -> Geodetic {
    let across = point.x.hypot(point.y);
    let longitude = if across == 0.0 { 0.0 } else { point.y.atan2(point.x).to_degrees() };
    if across == 0.0 && point.z == 0.0 {
        let polar = SEMI_MAJOR_METRES * (1.0 - FLATTENING);
        return Geodetic { longitude: 0.0, latitude: 90.0, height: -polar };
    }
    let mut latitude = point.z.atan2(across * (1.0 - ECCENTRICITY_SQUARED));
    for _ in 0..12 {
        let sine = latitude.sin();
        let n = SEMI_MAJOR_METRES / (1.0 - ECCENTRICITY_SQUARED * sine * sine).sqrt();
        let next = (point.z + ECCENTRICITY_SQUARED * n * sine).atan2(across);
        let change = (next - latitude).abs();
        latitude = next;
        if change < 1e-16 {
            break;
        }
    }
    let (sine, cosine) = latitude.sin_cos();
    let n = SEMI_MAJOR_METRES / (1.0 - ECCENTRICITY_SQUARED * sine * sine).sqrt();
    // Stable from the equator to the poles: project on the ellipsoid's normal.
    let height = across * cosine + point.z * sine - SEMI_MAJOR_METRES * SEMI_MAJOR_METRES / n;
    Geodetic { longitude, latitude: latitude.to_degrees(), height }
}

/// Rotation whose columns are east, north and up at the place, in ECEF: `ecef_from_enu`.
pub fn ecef_from_enu(longitude: f64, latitude: f64) -> DMat3 {
    let (sine, cosine) = latitude.to_radians().sin_cos();
    let (sine_longitude, cosine_longitude) = longitude.to_radians().sin_cos();
    DMat3::from_cols(
        DVec3::new(-sine_longitude, cosine_longitude, 0.0),
        DVec3::new(-sine * cosine_longitude, -sine * sine_longitude, cosine),
        DVec3::new(cosine * cosine_longitude, cosine * sine_longitude, sine),
    )
}

/// Spherical Web Mercator (EPSG:3857), metres; the latitude is clamped to its square.
pub fn web_mercator_from_geographic(longitude: f64, latitude: f64) -> (f64, f64) {
    let latitude = latitude.clamp(-WEB_MERCATOR_LATITUDE, WEB_MERCATOR_LATITUDE).to_radians();
    (SEMI_MAJOR_METRES * longitude.to_radians(), SEMI_MAJOR_METRES * latitude.sin().atanh())
}

/// Longitude and latitude in degrees of a Web Mercator point in metres.
pub fn geographic_from_web_mercator(x: f64, y: f64) -> (f64, f64) {
    ((x / SEMI_MAJOR_METRES).to_degrees(), (y / SEMI_MAJOR_METRES).tanh().asin().to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn known_points() {
        let equator = ecef_from_geodetic(Geodetic { longitude: 0.0, latitude: 0.0, height: 0.0 });
        assert!((equator - DVec3::new(6_378_137.0, 0.0, 0.0)).length() < 1e-9);
        let pole = ecef_from_geodetic(Geodetic { longitude: 12.0, latitude: 90.0, height: 10.0 });
        assert!((pole.z - 6_356_762.314_245_179).abs() < 1e-6);
    }

    proptest! {
        #[test]
        fn ecef_round_trip(longitude in -180.0..180.0_f64, latitude in -90.0..=90.0_f64, height in -11_000.0..1.0e7_f64) {
            let place = Geodetic { longitude, latitude, height };
            let back = geodetic_from_ecef(ecef_from_geodetic(place));
            let error = ecef_from_geodetic(back) - ecef_from_geodetic(place);
            prop_assert!(error.length() < 2e-8, "{error}");
            prop_assert!((back.height - height).abs() < 2e-8);
        }

        #[test]
        fn web_mercator_round_trip(longitude in -180.0..180.0_f64, latitude in -85.0..85.0_f64) {
            let (x, y) = web_mercator_from_geographic(longitude, latitude);
            let (a, b) = geographic_from_web_mercator(x, y);
            prop_assert!((a - longitude).abs() < 1e-12 && (b - latitude).abs() < 1e-12);
        }

        #[test]
        fn enu_is_a_rotation(longitude in -180.0..180.0_f64, latitude in -90.0..=90.0_f64) {
            let rotation = ecef_from_enu(longitude, latitude);
            prop_assert!((rotation.determinant() - 1.0).abs() < 1e-12);
            prop_assert!((rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array().iter().all(|x| x.abs() < 1e-12));
        }
    }
}
