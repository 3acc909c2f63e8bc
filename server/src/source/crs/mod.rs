//! Coordinate reference systems: from a source's coordinates to longitude and latitude on WGS84
//! and back, in f64.
//!
//! EPSG:4326 and EPSG:3857 are computed here exactly; all others by PROJ strings. Heights are not
//! touched (the design applies no geoid), so every transform is horizontal.

mod axis;
mod datum;
pub mod esri;

pub use axis::northing_first;
pub use datum::Datum;

use proj4rs::Proj;
use treeline_core::geodesy;

/// What is wrong with a reference system.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CrsError {
    /// The text is no `EPSG:N`.
    #[error("\"{0}\" is no coordinate reference system; write EPSG: and the code, for example EPSG:32632")]
    Spelling(String),
    /// Nobody knows the code.
    #[error("EPSG:{0} is not known")]
    UnknownCode(u32),
    /// The datum's shift to WGS84 is not known well enough.
    #[error("the datum of {0} has no shift to WGS84 that is known well enough")]
    UnknownDatum(String),
    /// The projection library does not know the method or its parameters.
    #[error("{name} cannot be projected ({detail})")]
    Unsupported {
        /// Name of the system.
        name: String,
        /// What the projection library says.
        detail: String,
    },
}

/// A coordinate outside what the projection can map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("outside the projection's domain")]
pub struct OutOfDomain;

/// A horizontal reference system.
#[derive(Clone)]
pub struct Crs {
    method: Method,
    epsg: Option<u32>,
    name: String,
    definition: String,
    datum: Datum,
}

#[derive(Clone)]
enum Method {
    /// Longitude and latitude in degrees on WGS84 or a datum that is taken for it.
    Geographic,
    /// EPSG:3857.
    WebMercator,
    /// Anything else, through the projection library. Angles there are radians.
    Library { own: Box<Proj>, wgs84: Box<Proj>, degrees: bool },
}

impl std::fmt::Debug for Crs {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Crs")
            .field("name", &self.name)
            .field("epsg", &self.epsg)
            .finish_non_exhaustive()
    }
}

impl std::fmt::Display for Crs {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.epsg {
            Some(code) => write!(formatter, "{} (EPSG:{code})", self.name),
            None => formatter.write_str(&self.name),
        }
    }
}

/// Whether the code names a geographic system (latitude and longitude).
pub fn is_geographic_code(epsg: u32) -> bool {
    definition_of(epsg).is_some_and(|definition| definition.wkt.starts_with("GEOGCS"))
}

fn definition_of(epsg: u32) -> Option<crs_definitions::Def> {
    crs_definitions::from_code(u16::try_from(epsg).ok()?)
}

/// Reads `EPSG:N`, in any case.
///
/// # Errors
/// [`CrsError::Spelling`] for anything else.
pub fn parse_epsg(text: &str) -> Result<u32, CrsError> {
    let spelling = || CrsError::Spelling(text.to_owned());
    let (authority, code) = text.trim().split_once(':').ok_or_else(spelling)?;
    if !authority.eq_ignore_ascii_case("EPSG")
        || code.is_empty()
        || !code.bytes().all(|byte| byte.is_ascii_digit())
    {
        return Err(spelling());
    }
    code.parse().map_err(|_| spelling())
}

impl Crs {
    /// Longitude and latitude on WGS84, degrees.
    pub fn wgs84() -> Self {
        Self {
            method: Method::Geographic,
            epsg: Some(4326),
            name: "WGS 84".to_owned(),
            definition: "+proj=longlat +datum=WGS84 +no_defs".to_owned(),
            datum: Datum::Wgs84,
        }
    }

    /// The system of an EPSG code.
    ///
    /// # Errors
    /// Where the code is unknown, its datum has no known shift, or its projection is not supported.
    pub fn from_epsg(code: u32) -> Result<Self, CrsError> {
        match code {
            4326 => return Ok(Self::wgs84()),
            3857 => {
                return Ok(Self {
                    method: Method::WebMercator,
                    epsg: Some(3857),
                    name: "WGS 84 / Pseudo-Mercator".to_owned(),
                    definition: "+proj=webmerc +datum=WGS84 +no_defs".to_owned(),
                    datum: Datum::Wgs84,
                });
            }
            _ => {}
        }
        let found = definition_of(code).ok_or(CrsError::UnknownCode(code))?;
        let name = found.wkt.split('"').nth(1).unwrap_or_default().to_owned();
        if !found.wkt.starts_with("GEOGCS") && !found.wkt.starts_with("PROJCS") {
            let detail = "it is neither geographic nor projected".to_owned();
            return Err(CrsError::Unsupported { name: format!("EPSG:{code}"), detail });
        }
        Self::from_definition(found.proj4, name, Some(code))
    }

    /// The system of a text such as `EPSG:32632`.
    ///
    /// # Errors
    /// As [`parse_epsg`] and [`Crs::from_epsg`].
    pub fn parse(text: &str) -> Result<Self, CrsError> {
        Self::from_epsg(parse_epsg(text)?)
    }

    /// The system of a PROJ string.
    ///
    /// # Errors
    /// Where its datum has no known shift or its projection is not supported.
    pub fn from_definition(definition: &str, name: String, epsg: Option<u32>) -> Result<Self, CrsError> {
        let shown = epsg.map_or_else(|| name.clone(), |code| format!("EPSG:{code} ({name})"));
        let datum = datum::judge(definition);
        if datum == Datum::Unknown {
            return Err(CrsError::UnknownDatum(shown));
        }
        let degrees =
            definition.split_whitespace().any(|word| matches!(word, "+proj=longlat" | "+proj=latlong"));
        let greenwich = !definition.contains("+pm=");
        let method = if degrees && greenwich && datum == Datum::Wgs84 {
            Method::Geographic
        } else {
            let unsupported = |error: proj4rs::errors::Error| CrsError::Unsupported {
                name: shown.clone(),
                detail: error.to_string(),
            };
            // The exact series for transverse Mercator: the short one is metres off some degrees
            // from the central meridian.
            let exact = definition.replace("+proj=tmerc", "+proj=etmerc");
            let own = Proj::from_proj_string(&exact)
                .or_else(|_| Proj::from_proj_string(definition))
                .map_err(unsupported)?;
            let wgs84 = Proj::from_proj_string("+proj=longlat +datum=WGS84 +no_defs").map_err(unsupported)?;
            Method::Library { own: Box::new(own), wgs84: Box::new(wgs84), degrees }
        };
        Ok(Self { method, epsg, name, definition: definition.to_owned(), datum })
    }

    /// EPSG code, where there is one.
    pub fn epsg(&self) -> Option<u32> {
        self.epsg
    }

    /// Name for people.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The PROJ string that stands for it.
    pub fn definition(&self) -> &str {
        &self.definition
    }

    /// How its datum relates to WGS84.
    pub fn datum(&self) -> Datum {
        self.datum
    }

    /// Whether its coordinates are degrees.
    pub fn is_geographic(&self) -> bool {
        match &self.method {
            Method::Geographic => true,
            Method::WebMercator => false,
            Method::Library { degrees, .. } => *degrees,
        }
    }

    /// Whether its coordinates are longitude and latitude on WGS84 as they stand.
    pub fn is_plain_geographic(&self) -> bool {
        matches!(self.method, Method::Geographic)
    }

    /// Whether it is EPSG:3857.
    pub fn is_web_mercator(&self) -> bool {
        matches!(self.method, Method::WebMercator)
    }

    /// Length of one unit of its coordinates, metres; of a degree of latitude where they are degrees.
    pub fn metres_per_unit(&self) -> f64 {
        match &self.method {
            Method::Geographic => geodesy::EQUATOR_METRES / 360.0,
            Method::WebMercator => 1.0,
            Method::Library { degrees: true, .. } => geodesy::EQUATOR_METRES / 360.0,
            Method::Library { own, .. } => own.to_meter(),
        }
    }

    /// Longitude and latitude in degrees of a place in this system.
    ///
    /// # Errors
    /// [`OutOfDomain`] where the projection has no inverse there.
    pub fn to_geographic(&self, x: f64, y: f64) -> Result<(f64, f64), OutOfDomain> {
        if !x.is_finite() || !y.is_finite() {
            return Err(OutOfDomain);
        }
        match &self.method {
            Method::Geographic if y.abs() <= 90.0 + 1e-9 => Ok((x, y)),
            Method::Geographic => Err(OutOfDomain),
            Method::WebMercator => Ok(geodesy::geographic_from_web_mercator(x, y)),
            Method::Library { own, wgs84, degrees } => {
                let mut point = if *degrees { (x.to_radians(), y.to_radians(), 0.0) } else { (x, y, 0.0) };
                proj4rs::transform::transform(own, wgs84, &mut point).map_err(|_| OutOfDomain)?;
                finite(point.0.to_degrees(), point.1.to_degrees())
            }
        }
    }

    /// Coordinates in this system of a longitude and latitude in degrees.
    ///
    /// # Errors
    /// [`OutOfDomain`] where the projection does not reach.
    pub fn from_geographic(&self, longitude: f64, latitude: f64) -> Result<(f64, f64), OutOfDomain> {
        if !longitude.is_finite() || latitude.is_nan() || latitude.abs() > 90.0 + 1e-9 {
            return Err(OutOfDomain);
        }
        match &self.method {
            Method::Geographic => Ok((longitude, latitude)),
            Method::WebMercator if latitude.abs() > geodesy::WEB_MERCATOR_LATITUDE + 1e-9 => Err(OutOfDomain),
            Method::WebMercator => Ok(geodesy::web_mercator_from_geographic(longitude, latitude)),
            Method::Library { own, wgs84, degrees } => {
                let latitude = latitude.clamp(-90.0, 90.0);
                let longitude = longitude - 360.0 * (longitude / 360.0).round();
                let mut point = (longitude.to_radians(), latitude.to_radians(), 0.0);
                proj4rs::transform::transform(wgs84, own, &mut point).map_err(|_| OutOfDomain)?;
                if *degrees {
                    finite(point.0.to_degrees(), point.1.to_degrees())
                } else {
                    finite(point.0, point.1)
                }
            }
        }
    }
}

fn finite(x: f64, y: f64) -> Result<(f64, f64), OutOfDomain> {
    if x.is_finite() && y.is_finite() { Ok((x, y)) } else { Err(OutOfDomain) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn spelling() {
        assert_eq!(parse_epsg("EPSG:32632"), Ok(32632));
        assert_eq!(parse_epsg(" epsg:4326"), Ok(4326));
        for wrong in ["32632", "EPSG:", "EPSG:-1", "EPSG:4326x", "ESRI:54030", "EPSG:99999999999"] {
            assert!(matches!(parse_epsg(wrong), Err(CrsError::Spelling(_))), "{wrong}");
        }
        assert_eq!(Crs::parse("EPSG:1").unwrap_err(), CrsError::UnknownCode(1));
    }

    /// PROJ 9.1.1 (cs2cs, always longitude first), to two centimetres.
    #[test]
    fn places_agree_with_proj() {
        let cases = [
            (32632, 8.3127, 61.6364, 463_573.294_4, 6_833_868.080_2),
            (32650, 114.1234, 22.3964, 203_818.285_3, 2_479_538.432_6),
            (2193, 175.5, -39.3, 1_815_575.922_0, 5_646_951.311_4),
            (3031, 77.9, -68.5, 2_310_230.483_4, 495_270.501_4),
            (5070, -114.5, 46.7, -1_411_052.103_6, 2_772_256.265_8),
            (3035, 8.3, 61.6, 4_230_433.430_6, 4_278_753.310_9),
            (31287, 13.0, 47.5, 374_949.690_1, 400_112.319_6),
            (2056, 8.0, 46.9, 2_642_774.882_8, 1_194_473.732_5),
            (28992, 5.4, 52.1, 155_876.813_9, 456_861.618_3),
            (27700, -3.0, 54.4, 335_177.411_0, 500_964.416_7),
            (31370, 4.5, 50.6, 159_291.989_6, 143_265.622_3),
            (2326, 114.15, 22.3, 833_498.769_6, 817_895.984_4),
            (2154, 2.0, 47.0, 624_015.535_5, 6_656_012.009_7),
            (28355, 145.0, -37.0, 322_037.810_2, 5_903_257.940_8),
        ];
        for (code, longitude, latitude, x, y) in cases {
            let crs = Crs::from_epsg(code).unwrap();
            let (found_x, found_y) = crs.from_geographic(longitude, latitude).unwrap();
            assert!((found_x - x).hypot(found_y - y) < 0.02, "EPSG:{code}: {found_x} {found_y}");
        }
    }

    #[test]
    fn refusals_name_the_system() {
        let error = Crs::from_epsg(23030).unwrap_err().to_string();
        assert!(error.contains("EPSG:23030") && error.contains("ED50"), "{error}");
        assert!(matches!(Crs::from_epsg(5773), Err(CrsError::UnknownCode(_) | CrsError::Unsupported { .. })));
    }

    #[test]
    fn outside_the_domain_is_an_error_and_no_panic() {
        let utm = Crs::from_epsg(32632).unwrap();
        assert_eq!(utm.from_geographic(f64::NAN, 0.0), Err(OutOfDomain));
        assert_eq!(utm.from_geographic(9.0, 91.0), Err(OutOfDomain));
        let mercator = Crs::from_epsg(3857).unwrap();
        assert_eq!(mercator.from_geographic(0.0, 89.0), Err(OutOfDomain));
        for code in [32632_u32, 3031, 2193, 5070, 31287] {
            let crs = Crs::from_epsg(code).unwrap();
            for value in [1e9, -1e9, 1e300] {
                let _ = crs.to_geographic(value, value);
            }
        }
    }

    proptest! {
        #[test]
        fn round_trip(longitude in 6.0..12.0_f64, latitude in 45.0..65.0_f64) {
            for code in [4326_u32, 3857, 4258, 32632, 25832, 3035, 31287, 2056] {
                let crs = Crs::from_epsg(code).unwrap();
                let (x, y) = crs.from_geographic(longitude, latitude).unwrap();
                let (back_longitude, back_latitude) = crs.to_geographic(x, y).unwrap();
                // 1e-8 degrees is a millimetre.
                prop_assert!((back_longitude - longitude).abs() < 1e-7 && (back_latitude - latitude).abs() < 1e-7,
                    "EPSG:{}: {} {}", code, back_longitude, back_latitude);
            }
        }
    }
}
