//! Where the sun stands: date, time and place → direction.
//!
//! Low-precision solar coordinates (Meeus, *Astronomical Algorithms*, chapters 25 and 28; the method
//! of NOAA's calculator): better than 0.02° from 1900 to 2100. Positions are geometric: no refraction
//! (0.5° at the horizon, 0.02° at 45°) and no parallax (0.0024°).

use glam::DVec3;

/// Julian day of 1970-01-01T00:00Z.
const UNIX_EPOCH_JULIAN_DAY: f64 = 2_440_587.5;
/// Julian day of the epoch J2000.0.
const J2000_JULIAN_DAY: f64 = 2_451_545.0;
/// Terrestrial time minus UTC, seconds, today; its drift within a century moves the sun by less than 0.001°.
const TERRESTRIAL_MINUS_UTC_SECONDS: f64 = 69.2;
const SECONDS_PER_DAY: f64 = 86_400.0;

/// Why a text is no time.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is no time: {problem}; write it as in 2026-07-15T09:00:00Z")]
pub struct TimeError {
    /// What was given.
    pub text: String,
    /// What is wrong with it.
    pub problem: &'static str,
}

/// Seconds since 1970-01-01T00:00Z of an RFC 3339 time, e.g. `2026-07-15T09:00:00Z` or
/// `2026-07-15T11:00:00.5+02:00`. A leap second counts as the first second of the next minute.
pub fn unix_seconds_from_rfc3339(text: &str) -> Result<f64, TimeError> {
    parse(text.trim()).map_err(|problem| TimeError { text: text.to_owned(), problem })
}

fn parse(text: &str) -> Result<f64, &'static str> {
    let bytes = text.as_bytes();
    // Only digits and separators, so that byte positions are character positions.
    if !text.is_ascii() || bytes.len() < 20 {
        return Err("it is too short for a date, a time and a zone");
    }
    if bytes[4] != b'-' || bytes[7] != b'-' {
        return Err("the date is not YYYY-MM-DD");
    }
    if !matches!(bytes[10], b'T' | b't' | b' ') {
        return Err("no T stands between date and time");
    }
    if bytes[13] != b':' || bytes[16] != b':' {
        return Err("the time is not HH:MM:SS");
    }
    let year = digits(&bytes[0..4])?;
    let month = digits(&bytes[5..7])?;
    let day = digits(&bytes[8..10])?;
    if !(1..=12).contains(&month) || !(1..=days_in_month(year, month)).contains(&day) {
        return Err("the calendar has no such day");
    }
    let (hour, minute, second) = (digits(&bytes[11..13])?, digits(&bytes[14..16])?, digits(&bytes[17..19])?);
    if hour > 23 || minute > 59 || second > 60 {
        return Err("the day has no such time");
    }
    let mut rest = &bytes[19..];
    let mut fraction = 0.0;
    if rest.first() == Some(&b'.') {
        let length = rest[1..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        if length == 0 {
            return Err("no digit follows the decimal point");
        }
        let mut unit = 1.0;
        for byte in &rest[1..=length] {
            unit /= 10.0;
            fraction += f64::from(byte - b'0') * unit;
        }
        rest = &rest[1 + length..];
    }
    let offset_minutes = match rest {
        [b'Z' | b'z'] => 0,
        [sign @ (b'+' | b'-'), zone @ ..] if zone.len() == 5 && zone[2] == b':' => {
            let (hours, minutes) = (digits(&zone[0..2])?, digits(&zone[3..5])?);
            if hours > 23 || minutes > 59 {
                return Err("the day has no such offset from UTC");
            }
            let minutes = 60 * hours + minutes;
            if *sign == b'-' { -minutes } else { minutes }
        }
        _ => return Err("it ends in no zone (Z or ±HH:MM)"),
    };
    let seconds = days_from_civil(year, month, day) * 86_400 + hour * 3_600 + (minute - offset_minutes) * 60;
    Ok((seconds + second) as f64 + fraction)
}

fn digits(bytes: &[u8]) -> Result<i64, &'static str> {
    bytes.iter().try_fold(0, |value, byte| {
        if byte.is_ascii_digit() {
            Ok(10 * value + i64::from(byte - b'0'))
        } else {
            Err("a digit is missing")
        }
    })
}

fn days_in_month(year: i64, month: i64) -> i64 {
    match month {
        4 | 6 | 9 | 11 => 30,
        2 if year % 4 == 0 && (year % 100 != 0 || year % 400 == 0) => 29,
        2 => 28,
        _ => 31,
    }
}

/// Days since 1970-01-01 of a date of the proleptic Gregorian calendar.
fn days_from_civil(year: i64, month: i64, day: i64) -> i64 {
    // Years that begin in March, so that the leap day is the last one.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let day_of_year = (153 * month + 2) / 5 + day - 1;
    365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400) + day_of_year - 719_468
}

/// Where the sun stands in someone's sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunPosition {
    /// Clockwise from north, degrees, 0 ≤ azimuth < 360.
    pub azimuth_degrees: f64,
    /// Above the horizontal, degrees, without refraction.
    pub elevation_degrees: f64,
}

/// The sun's apparent place among the stars.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SolarCoordinates {
    declination: f64,
    right_ascension: f64,
}

/// Meeus, chapter 25, lower accuracy; radians. `centuries` of terrestrial time since J2000.0.
fn solar_coordinates(centuries: f64) -> SolarCoordinates {
    let t = centuries;
    let mean_longitude = 280.466_46 + t * (36_000.769_83 + t * 0.000_303_2);
    let mean_anomaly = (357.529_11 + t * (35_999.050_29 - t * 0.000_153_7)).to_radians();
    let equation_of_centre = (1.914_602 - t * (0.004_817 + t * 0.000_014)) * mean_anomaly.sin()
        + (0.019_993 - t * 0.000_101) * (2.0 * mean_anomaly).sin()
        + 0.000_289 * (3.0 * mean_anomaly).sin();
    // Nutation and aberration, by the longitude of the Moon's ascending node.
    let node = (125.04 - 1_934.136 * t).to_radians();
    let longitude = (mean_longitude + equation_of_centre - 0.005_69 - 0.004_78 * node.sin()).to_radians();
    let mean_obliquity = 23.439_291_1 - t * (0.013_004_2 + t * (1.64e-7 - t * 5.04e-7));
    let obliquity = (mean_obliquity + 0.002_56 * node.cos()).to_radians();
    SolarCoordinates {
        declination: (obliquity.sin() * longitude.sin()).asin(),
        right_ascension: (obliquity.cos() * longitude.sin()).atan2(longitude.cos()),
    }
}

impl SunPosition {
    /// The sun at a time (seconds since 1970-01-01T00:00Z) over a place (degrees east and north).
    pub fn at(unix_seconds: f64, longitude: f64, latitude: f64) -> Self {
        let days = UNIX_EPOCH_JULIAN_DAY - J2000_JULIAN_DAY + unix_seconds / SECONDS_PER_DAY;
        let centuries = (days + TERRESTRIAL_MINUS_UTC_SECONDS / SECONDS_PER_DAY) / 36_525.0;
        let sun = solar_coordinates(centuries);
        // Greenwich mean sidereal time (Meeus 12.4), from UTC taken as UT1 (0.9 s, 0.004°).
        let sidereal = 280.460_618_37
            + 360.985_647_366_29 * days
            + (days / 36_525.0).powi(2) * (0.000_387_933 - days / 36_525.0 / 38_710_000.0);
        let hour_angle = (sidereal + longitude).rem_euclid(360.0).to_radians() - sun.right_ascension;
        let (sine_latitude, cosine_latitude) = latitude.to_radians().sin_cos();
        let (sine_declination, cosine_declination) = sun.declination.sin_cos();
        let east = -cosine_declination * hour_angle.sin();
        let north =
            cosine_latitude * sine_declination - sine_latitude * cosine_declination * hour_angle.cos();
        let up = sine_latitude * sine_declination + cosine_latitude * cosine_declination * hour_angle.cos();
        Self {
            // rem_euclid of a tiny negative number rounds to 360 itself.
            azimuth_degrees: east.atan2(north).to_degrees().rem_euclid(360.0) % 360.0,
            elevation_degrees: up.clamp(-1.0, 1.0).asin().to_degrees(),
        }
    }

    /// Unit vector to the sun in the place's east-north-up axes.
    pub fn direction_enu(&self) -> DVec3 {
        let (sine, cosine) = self.elevation_degrees.to_radians().sin_cos();
        let (east, north) = self.azimuth_degrees.to_radians().sin_cos();
        DVec3::new(cosine * east, cosine * north, sine)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(time: &str, longitude: f64, latitude: f64) -> SunPosition {
        SunPosition::at(unix_seconds_from_rfc3339(time).unwrap(), longitude, latitude)
    }

    #[test]
    fn times() {
        assert_eq!(unix_seconds_from_rfc3339("1970-01-01T00:00:00Z"), Ok(0.0));
        assert_eq!(unix_seconds_from_rfc3339("2026-07-15T09:00:00Z"), Ok(1_784_106_000.0));
        assert_eq!(unix_seconds_from_rfc3339("2026-07-15t11:00:00.25+02:00"), Ok(1_784_106_000.25));
        assert_eq!(unix_seconds_from_rfc3339("2000-02-29T23:59:60-00:30"), Ok(951_870_600.0));
        assert_eq!(unix_seconds_from_rfc3339("1969-12-31 23:59:59Z"), Ok(-1.0));
    }

    #[test]
    fn what_is_no_time_is_refused_in_one_line() {
        for text in [
            "",
            "noon",
            "2026-07-15",
            "2026-07-15T09:00:00",
            "2026-02-29T09:00:00Z",
            "2026-13-01T09:00:00Z",
            "2026-07-15T24:00:00Z",
            "2026-07-15T09:00:00.Z",
            "2026-07-15T09:00:00+2:00",
            "2026-07-15T09:00:00+25:00",
            "2026-07-1５T09:00:00Z",
            "2026-07-15T09:0a:00Z",
        ] {
            let error = unix_seconds_from_rfc3339(text).expect_err(text).to_string();
            assert!(error.contains("write it as in") && !error.contains('\n'), "{error}");
        }
    }

    /// Reda and Andreas, NREL/TP-560-34302, appendix A.5: Golden, Colorado.
    #[test]
    fn agrees_with_the_solar_position_algorithm() {
        let sun = at("2003-10-17T12:30:30-07:00", -105.1786, 39.742_476);
        assert!((sun.azimuth_degrees - 194.340_241).abs() < 0.01, "{sun:?}");
        // Their 39.872 046° before refraction includes the parallax, 0.0018° here.
        assert!((sun.elevation_degrees - 39.872_046).abs() < 0.01, "{sun:?}");
    }

    /// Meeus, example 25.a: 1992 October 13, 0h terrestrial time.
    #[test]
    fn agrees_with_meeus() {
        let sun = solar_coordinates(-0.072_183_436);
        assert!((sun.declination.to_degrees() - -7.785_07).abs() < 1e-4, "{sun:?}");
        assert!((sun.right_ascension.to_degrees().rem_euclid(360.0) - 198.380_83).abs() < 1e-4, "{sun:?}");
    }

    #[test]
    fn solstice_and_equinox() {
        // 2024: solstice June 20 20:51 UTC, equinox March 20 03:06 UTC (U.S. Naval Observatory).
        let declination = |time: &str| {
            let seconds = unix_seconds_from_rfc3339(time).unwrap();
            solar_coordinates((seconds / SECONDS_PER_DAY + 2_440_587.5 - 2_451_545.0) / 36_525.0)
                .declination
                .to_degrees()
        };
        assert!((declination("2024-06-20T20:51:00Z") - 23.44).abs() < 0.005);
        assert!(declination("2024-03-20T03:06:00Z").abs() < 0.005);
        // At the north pole the elevation is the declination, all day.
        let pole = at("2024-06-20T03:00:00Z", 77.0, 90.0);
        assert!((pole.elevation_degrees - 23.43).abs() < 0.02, "{pole:?}");
    }

    proptest! {
        #[test]
        fn the_direction_says_the_same_as_the_angles(
            seconds in -2.2e9..4.1e9_f64, longitude in -180.0..180.0_f64, latitude in -90.0..=90.0_f64,
        ) {
            let sun = SunPosition::at(seconds, longitude, latitude);
            prop_assert!((0.0..360.0).contains(&sun.azimuth_degrees));
            prop_assert!((-90.0..=90.0).contains(&sun.elevation_degrees));
            let direction = sun.direction_enu();
            prop_assert!((direction.length() - 1.0).abs() < 1e-12);
            prop_assert!((direction.z - sun.elevation_degrees.to_radians().sin()).abs() < 1e-9);
        }

        #[test]
        fn the_antipodes_see_the_opposite_sun(
            seconds in -2.2e9..4.1e9_f64, longitude in -180.0..180.0_f64, latitude in -89.0..89.0_f64,
        ) {
            let here = SunPosition::at(seconds, longitude, latitude).elevation_degrees;
            let there = SunPosition::at(seconds, longitude + 180.0, -latitude).elevation_degrees;
            prop_assert!((here + there).abs() < 1e-6);
        }
    }
}
