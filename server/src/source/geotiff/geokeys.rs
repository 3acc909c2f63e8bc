//! GeoKeys: which reference system a GeoTIFF names, or spells out by parameters.

use super::bytes::FileBytes;
use super::directory::{Directory, tag};
use crate::source::crs::{Crs, CrsError, esri};
use std::collections::BTreeMap;

/// Value by which a key says "user-defined".
const USER_DEFINED: u32 = 32767;
/// Ellipsoids whose semi-major axis lies here are the Earth's, metres.
const EARTH_MAJOR_METRES: std::ops::RangeInclusive<f64> = 6_350_000.0..=6_400_000.0;

mod key {
    pub const MODEL_TYPE: u16 = 1024;
    pub const RASTER_TYPE: u16 = 1025;
    pub const CITATION: u16 = 1026;
    pub const GEODETIC_CRS: u16 = 2048;
    pub const GEODETIC_CITATION: u16 = 2049;
    pub const GEODETIC_DATUM: u16 = 2050;
    pub const ANGULAR_UNITS: u16 = 2054;
    pub const ANGULAR_UNIT_SIZE: u16 = 2055;
    pub const ELLIPSOID: u16 = 2056;
    pub const SEMI_MAJOR: u16 = 2057;
    pub const SEMI_MINOR: u16 = 2058;
    pub const INVERSE_FLATTENING: u16 = 2059;
    pub const PRIME_MERIDIAN_LONGITUDE: u16 = 2061;
    pub const TO_WGS84: u16 = 2062;
    pub const PROJECTED_CRS: u16 = 3072;
    pub const PROJECTED_CITATION: u16 = 3073;
    pub const CONVERSION: u16 = 3074;
    pub const METHOD: u16 = 3075;
    pub const LINEAR_UNITS: u16 = 3076;
    pub const LINEAR_UNIT_SIZE: u16 = 3077;
    pub const STANDARD_PARALLEL_1: u16 = 3078;
    pub const STANDARD_PARALLEL_2: u16 = 3079;
    pub const ORIGIN_LONGITUDE: u16 = 3080;
    pub const ORIGIN_LATITUDE: u16 = 3081;
    pub const FALSE_EASTING: u16 = 3082;
    pub const FALSE_NORTHING: u16 = 3083;
    pub const FALSE_ORIGIN_LONGITUDE: u16 = 3084;
    pub const FALSE_ORIGIN_LATITUDE: u16 = 3085;
    pub const FALSE_ORIGIN_EASTING: u16 = 3086;
    pub const FALSE_ORIGIN_NORTHING: u16 = 3087;
    pub const CENTRE_LONGITUDE: u16 = 3088;
    pub const CENTRE_LATITUDE: u16 = 3089;
    pub const CENTRE_EASTING: u16 = 3090;
    pub const CENTRE_NORTHING: u16 = 3091;
    pub const SCALE_AT_ORIGIN: u16 = 3092;
    pub const SCALE_AT_CENTRE: u16 = 3093;
    pub const AZIMUTH: u16 = 3094;
    pub const STRAIGHT_POLE_LONGITUDE: u16 = 3095;
    pub const RECTIFIED_ANGLE: u16 = 3096;
    pub const VERTICAL_CRS: u16 = 4096;
    pub const VERTICAL_CITATION: u16 = 4097;
    pub const VERTICAL_UNITS: u16 = 4099;
}

/// The keys of a file.
#[derive(Debug, Default)]
pub struct GeoKeys {
    shorts: BTreeMap<u16, u32>,
    doubles: BTreeMap<u16, Vec<f64>>,
    texts: BTreeMap<u16, String>,
}

/// What a file says of its reference system.
#[derive(Debug)]
pub enum Stated {
    /// Nothing usable.
    Nothing,
    /// A body that is not the Earth.
    OtherBody(String),
    /// A system that we have, or cannot have.
    System(Result<Crs, CrsError>),
}

impl GeoKeys {
    /// Reads the keys. A damaged key directory reads as far as it makes sense.
    pub fn read(bytes: &FileBytes, directory: &Directory) -> Self {
        let mut keys = Self::default();
        let Some(table) = directory.unsigned_values(bytes, tag::GEO_KEY_DIRECTORY) else { return keys };
        let doubles = directory.real_values(bytes, tag::GEO_DOUBLE_PARAMETERS).unwrap_or_default();
        let text = directory.text(bytes, tag::GEO_ASCII_PARAMETERS).unwrap_or_default();
        if table.len() < 4 || table[0] != 1 {
            return keys;
        }
        for entry in table[4..].chunks_exact(4).take(table[3] as usize) {
            let (number, place, count, value) =
                (entry[0] as u16, entry[1] as u16, entry[2] as usize, entry[3]);
            let at = value as usize;
            match place {
                0 if count <= 1 => {
                    keys.shorts.insert(number, value as u32);
                }
                tag::GEO_DOUBLE_PARAMETERS => {
                    if let Some(values) = doubles.get(at..at.saturating_add(count)) {
                        keys.doubles.insert(number, values.to_vec());
                    }
                }
                tag::GEO_ASCII_PARAMETERS => {
                    // Offsets count bytes; a citation that is not ASCII is cut at a whole character.
                    let part = text.as_bytes().get(at..at.saturating_add(count).min(text.len()));
                    if let Some(part) = part {
                        let part = String::from_utf8_lossy(part);
                        keys.texts.insert(number, part.trim_end_matches(['|', '\0', ' ']).to_owned());
                    }
                }
                _ => {}
            }
        }
        keys
    }

    /// Whether a sample stands at its tie point and not at the middle of an area that begins there.
    pub fn pixel_is_point(&self) -> bool {
        self.short(key::RASTER_TYPE) == Some(2)
    }

    fn short(&self, number: u16) -> Option<u32> {
        self.shorts.get(&number).copied().filter(|&value| value != 0)
    }

    fn code(&self, number: u16) -> Option<u32> {
        self.short(number).filter(|&code| code != USER_DEFINED)
    }

    fn real(&self, number: u16) -> Option<f64> {
        self.doubles.get(&number)?.first().copied().filter(|value| value.is_finite())
    }

    fn first_real(&self, numbers: &[u16]) -> f64 {
        numbers.iter().find_map(|&number| self.real(number)).unwrap_or(0.0)
    }

    fn citation(&self) -> String {
        let text =
            self.texts.get(&key::PROJECTED_CITATION).or_else(|| self.texts.get(&key::GEODETIC_CITATION));
        let text = text.map(String::as_str).unwrap_or_default();
        // Some writers pack fields: "PCS Name = X|GCS Name = Y"; the first name is the system's.
        let first = text.split('|').next().unwrap_or_default();
        let name = first.rsplit(" = ").next().unwrap_or_default().trim();
        let unnamed = ["", "unknown", "unnamed"].iter().any(|none| name.eq_ignore_ascii_case(none));
        if unnamed { "a system without a name".to_owned() } else { name.to_owned() }
    }

    /// The system that ESRI's text in a citation spells out, where there is one.
    fn spelt_out(&self) -> Option<Stated> {
        let text = [key::PROJECTED_CITATION, key::GEODETIC_CITATION, key::CITATION]
            .iter()
            .find_map(|number| self.texts.get(number)?.strip_prefix("ESRI PE String = "))?;
        let (system, major) = esri::system_and_major_axis(text)?;
        Some(if EARTH_MAJOR_METRES.contains(&major) {
            Stated::System(system)
        } else {
            let name = text.split('"').nth(1).unwrap_or_default();
            Stated::OtherBody(format!("{name}, semi-major axis {:.0} km", major / 1000.0))
        })
    }

    /// The reference system.
    pub fn system(&self) -> Stated {
        if let Some(body) = self.other_body() {
            return Stated::OtherBody(body);
        }
        if let Some(code) = self.code(key::PROJECTED_CRS) {
            return Stated::System(Crs::from_epsg(code));
        }
        let geographic_only = self.short(key::MODEL_TYPE) == Some(2)
            || self.short(key::MODEL_TYPE).is_none() && self.short(key::PROJECTED_CRS).is_none();
        if geographic_only {
            if let Some(code) = self.code(key::GEODETIC_CRS) {
                return Stated::System(Crs::from_epsg(code));
            }
            if let Some(stated) = self.spelt_out() {
                return stated;
            }
            let Some(ellipsoid) = self.ellipsoid() else { return Stated::Nothing };
            let name = self.citation();
            return Stated::System(Crs::from_definition(
                &format!("+proj=longlat {ellipsoid} +no_defs"),
                name,
                None,
            ));
        }
        if self.short(key::MODEL_TYPE) == Some(3) {
            let detail = "its coordinates count from the Earth's middle".to_owned();
            return Stated::System(Err(CrsError::Unsupported { name: self.citation(), detail }));
        }
        self.spelt_out().unwrap_or_else(|| self.user_defined())
    }

    fn user_defined(&self) -> Stated {
        let Some(ellipsoid) = self.ellipsoid() else { return Stated::Nothing };
        let name = self.citation();
        // A conversion of the registry under a datum of its own: UTM is the one that occurs.
        if let Some(conversion) = self.code(key::CONVERSION) {
            let (zone, south) = match conversion {
                16001..=16060 => (conversion - 16000, ""),
                16101..=16160 => (conversion - 16100, " +south"),
                _ => {
                    let detail = format!("conversion {conversion} of the EPSG registry is not known here");
                    return Stated::System(Err(CrsError::Unsupported { name, detail }));
                }
            };
            let definition = format!("+proj=utm +zone={zone}{south} {ellipsoid} +units=m +no_defs");
            return Stated::System(Crs::from_definition(&definition, name, None));
        }
        let Some(method) = self.short(key::METHOD) else { return Stated::Nothing };
        let unit = match self.linear_unit() {
            Ok(unit) => unit,
            Err(detail) => return Stated::System(Err(CrsError::Unsupported { name, detail })),
        };
        match self.projection(method, unit) {
            Ok(projection) => {
                let definition = format!("{projection} {ellipsoid} +to_meter={unit} +no_defs");
                Stated::System(Crs::from_definition(&definition, name, None))
            }
            Err(detail) => Stated::System(Err(CrsError::Unsupported { name, detail })),
        }
    }

    /// Name of the body, where the ellipsoid is not of the Earth's size.
    fn other_body(&self) -> Option<String> {
        let major = self.real(key::SEMI_MAJOR)?;
        (!EARTH_MAJOR_METRES.contains(&major)).then(|| {
            let citation = self.citation();
            format!("{citation}, semi-major axis {:.0} km", major / 1000.0)
        })
    }

    /// Ellipsoid, datum shift and prime meridian as PROJ words.
    fn ellipsoid(&self) -> Option<String> {
        let mut words = if let Some(code) = self.code(key::GEODETIC_CRS) {
            datum_words(&crs_definitions::from_code(u16::try_from(code).ok()?)?)
        } else if let Some(major) = self.real(key::SEMI_MAJOR) {
            match (self.real(key::INVERSE_FLATTENING), self.real(key::SEMI_MINOR)) {
                (Some(inverse), _) if inverse > 1.0 => format!("+a={major} +rf={inverse}"),
                (_, Some(minor)) if minor > 0.0 => format!("+a={major} +b={minor}"),
                _ => format!("+a={major} +b={major}"),
            }
        } else {
            match (self.code(key::GEODETIC_DATUM), self.code(key::ELLIPSOID)) {
                (Some(6326), _) | (None, Some(7030)) => "+datum=WGS84".to_owned(),
                (Some(6269), _) => "+datum=NAD83".to_owned(),
                (Some(6258), _) | (None, Some(7019)) => "+ellps=GRS80".to_owned(),
                // Any other datum code: the geographic system of the same registry number, where there is one.
                (Some(datum @ 6001..=6999), _) => {
                    datum_words(&crs_definitions::from_code(u16::try_from(datum - 2000).ok()?)?)
                }
                _ => return None,
            }
        };
        if let Some(shift) = self.doubles.get(&key::TO_WGS84).filter(|shift| matches!(shift.len(), 3 | 7)) {
            let numbers: Vec<String> = shift.iter().map(f64::to_string).collect();
            words = format!("{words} +towgs84={}", numbers.join(","));
        }
        if let Some(meridian) = self.real(key::PRIME_MERIDIAN_LONGITUDE).filter(|&meridian| meridian != 0.0) {
            words = format!("{words} +pm={meridian}");
        }
        Some(words)
    }

    /// Metres in a linear unit of the projected coordinates.
    fn linear_unit(&self) -> Result<f64, String> {
        match self.short(key::LINEAR_UNITS) {
            None | Some(9001) => Ok(1.0),
            Some(USER_DEFINED) => {
                Ok(self.real(key::LINEAR_UNIT_SIZE).filter(|&size| size > 0.0).unwrap_or(1.0))
            }
            Some(code) => unit_metres(code).ok_or_else(|| format!("linear unit {code} is not known here")),
        }
    }

    /// Degrees in an angular unit of the projection's parameters.
    fn degrees_per_angular_unit(&self) -> f64 {
        match self.short(key::ANGULAR_UNITS) {
            Some(9101) => 1.0_f64.to_degrees(),
            Some(9105 | 9106) => 0.9,
            Some(USER_DEFINED) => self.real(key::ANGULAR_UNIT_SIZE).map_or(1.0, f64::to_degrees),
            _ => 1.0,
        }
    }

    /// The projection as PROJ words, without ellipsoid and unit.
    fn projection(&self, method: u32, unit: f64) -> Result<String, String> {
        let angle = |keys: &[u16]| self.first_real(keys) * self.degrees_per_angular_unit();
        let latitude = angle(&[key::ORIGIN_LATITUDE, key::FALSE_ORIGIN_LATITUDE, key::CENTRE_LATITUDE]);
        let longitude = angle(&[key::ORIGIN_LONGITUDE, key::FALSE_ORIGIN_LONGITUDE, key::CENTRE_LONGITUDE]);
        let pole_longitude =
            angle(&[key::STRAIGHT_POLE_LONGITUDE, key::ORIGIN_LONGITUDE, key::CENTRE_LONGITUDE]);
        let parallel_1 = angle(&[key::STANDARD_PARALLEL_1]);
        let parallel_2 = angle(&[key::STANDARD_PARALLEL_2]);
        let scale = [key::SCALE_AT_ORIGIN, key::SCALE_AT_CENTRE]
            .iter()
            .find_map(|&number| self.real(number))
            .filter(|&scale| scale > 0.0)
            .unwrap_or(1.0);
        let x = unit * self.first_real(&[key::FALSE_EASTING, key::FALSE_ORIGIN_EASTING, key::CENTRE_EASTING]);
        let y =
            unit * self.first_real(&[key::FALSE_NORTHING, key::FALSE_ORIGIN_NORTHING, key::CENTRE_NORTHING]);
        let offset = format!("+x_0={x} +y_0={y}");
        let origin = format!("+lat_0={latitude} +lon_0={longitude}");
        Ok(match method {
            1 => format!("+proj=tmerc {origin} +k={scale} {offset}"),
            7 if self.real(key::STANDARD_PARALLEL_1).is_some() => {
                format!("+proj=merc +lat_ts={parallel_1} +lon_0={longitude} {offset}")
            }
            7 => format!("+proj=merc +lon_0={longitude} +k={scale} {offset}"),
            8 => format!("+proj=lcc +lat_1={parallel_1} +lat_2={parallel_2} {origin} {offset}"),
            9 => format!("+proj=lcc +lat_1={latitude} {origin} +k_0={scale} {offset}"),
            10 => format!("+proj=laea {origin} {offset}"),
            11 => format!("+proj=aea +lat_1={parallel_1} +lat_2={parallel_2} {origin} {offset}"),
            12 => format!("+proj=aeqd {origin} {offset}"),
            13 => format!("+proj=eqdc +lat_1={parallel_1} +lat_2={parallel_2} {origin} {offset}"),
            14 => format!("+proj=stere {origin} +k={scale} {offset}"),
            15 => {
                // The key is the latitude of true scale, except where it is the pole itself.
                let stated =
                    if self.real(key::STANDARD_PARALLEL_1).is_some() { parallel_1 } else { latitude };
                let pole = if stated < 0.0 { -90 } else { 90 };
                if stated.abs() >= 90.0 {
                    format!("+proj=stere +lat_0={pole} +lon_0={pole_longitude} +k={scale} {offset}")
                } else {
                    format!("+proj=stere +lat_0={pole} +lat_ts={stated} +lon_0={pole_longitude} {offset}")
                }
            }
            16 => format!("+proj=sterea {origin} +k={scale} {offset}"),
            17 => format!("+proj=eqc +lat_ts={parallel_1} {origin} {offset}"),
            18 => format!("+proj=cass {origin} {offset}"),
            22 => format!("+proj=poly {origin} {offset}"),
            24 => format!("+proj=sinu +lon_0={pole_longitude} {offset}"),
            28 => format!("+proj=cea +lat_ts={parallel_1} +lon_0={longitude} {offset}"),
            3 | 9815 => {
                let azimuth = angle(&[key::AZIMUTH]);
                // The second is the registry's number, for the variant whose offsets count from the centre.
                let from_centre = method == 9815;
                if from_centre && azimuth == 90.0 {
                    // The Swiss grid's projection: the general formula has a pole there.
                    format!("+proj=somerc {origin} +k_0={scale} {offset}")
                } else {
                    let rectified = self.real(key::RECTIFIED_ANGLE).map_or(String::new(), |a| {
                        format!(" +gamma={}", a * self.degrees_per_angular_unit())
                    });
                    let origin = if from_centre { "" } else { " +no_uoff" };
                    format!(
                        "+proj=omerc +lat_0={latitude} +lonc={longitude} +alpha={azimuth}{rectified} +k={scale}{origin} {offset}"
                    )
                }
            }
            _ => return Err(format!("projection method {method} of GeoTIFF is not known here")),
        })
    }

    /// Metres in a unit of the heights, 1 where the file does not say; `None` where it names a unit
    /// that is not known.
    pub fn vertical_unit_metres(&self) -> Option<f64> {
        match self.short(key::VERTICAL_UNITS) {
            Some(USER_DEFINED) => None,
            Some(code) => unit_metres(code),
            // The registry's vertical systems in feet that occur in practice (NAVD88, NGVD29).
            None => Some(match self.code(key::VERTICAL_CRS) {
                Some(6360 | 5702) => US_SURVEY_FOOT,
                Some(8228) => 0.3048,
                _ => match self.texts.get(&key::VERTICAL_CITATION) {
                    Some(text) if text.contains("ftUS") => US_SURVEY_FOOT,
                    _ => 1.0,
                },
            }),
        }
    }
}

const US_SURVEY_FOOT: f64 = 1200.0 / 3937.0;

/// Metres in a linear unit of the EPSG registry.
fn unit_metres(code: u32) -> Option<f64> {
    Some(match code {
        9001 => 1.0,
        9002 => 0.3048,
        9003 => US_SURVEY_FOOT,
        9005 => 0.304_797_265_4,
        9014 => 1.8288,
        9030 => 1852.0,
        9036 => 1000.0,
        9037 => 3.0 * 0.304_797_265_4,
        9094 => 0.304_799_710_181_508_8,
        9096 => 0.9144,
        _ => return None,
    })
}

/// Datum, ellipsoid and prime meridian of a geographic system, as PROJ words.
fn datum_words(definition: &crs_definitions::Def) -> String {
    let wanted = ["+datum=", "+ellps=", "+towgs84=", "+a=", "+b=", "+rf=", "+pm=", "+nadgrids="];
    let words: Vec<&str> = definition
        .proj4
        .split_whitespace()
        .filter(|word| wanted.iter().any(|start| word.starts_with(start)))
        .collect();
    words.join(" ")
}
