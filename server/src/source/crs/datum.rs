//! Which datums we may use: those that are WGS84 to within their own accuracy, and those whose
//! shift to it is known. For all others a shift would be quietly wrong by metres, so they are refused.

/// How a system's datum relates to WGS84.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Datum {
    /// The same to within a metre or so of plate motion and realisation: no shift is applied.
    Wgs84,
    /// A shift by known parameters, good to about so many metres.
    Shifted {
        /// Accuracy of the shift, metres.
        accuracy_metres: f64,
    },
    /// A shift that is not known well enough.
    Unknown,
}

/// Seven-parameter shifts (and PROJ's datum names) that agree with PROJ's own choice of operation
/// to 0.1 m, and the accuracy that the EPSG registry states for them in metres.
const KNOWN_SHIFTS: [(&str, f64); 14] = [
    ("hermannskogel", 1.5),
    ("577.326,90.129,463.919,5.137,1.474,5.297,2.4232", 1.5),
    ("674.374,15.056,405.346,0,0,0,0", 1.0),
    ("565.2369,50.0087,465.658,-0.406857,0.350733,-1.87035,4.0812", 1.0),
    ("OSGB36", 2.0),
    ("446.448,-125.157,542.06,0.15,0.247,0.842,-20.489", 2.0),
    ("ire65", 1.0),
    ("-106.8686,52.2978,-103.7239,0.3366,-0.457,1.8422,-1.2747", 0.2),
    ("414.1,41.3,603.1,-0.855,2.141,-7.023,0", 1.0),
    ("-96.062,-82.428,-121.753,4.801,0.345,-1.376,1.496", 1.0),
    ("-162.619,-276.959,-161.764,0.067753,-2.243649,-1.158827,-1.094246", 1.0),
    ("-189.6806,18.3463,-42.7695,-0.33746,-3.09264,2.53861,0.4598", 1.0),
    ("GGRS87", 1.0),
    ("0,0,4.5,0,0,0.554,0.2263", 2.0),
];

/// Greatest shift, metres or arc seconds, that counts as none.
const NEGLIGIBLE: f64 = 1.0;

/// Judges a PROJ string.
pub fn judge(definition: &str) -> Datum {
    let value = |key: &str| {
        definition
            .split_whitespace()
            .find_map(|word| word.strip_prefix('+')?.strip_prefix(key)?.strip_prefix('='))
    };
    if let Some(datum) = value("datum") {
        return match datum {
            "WGS84" | "NAD83" => Datum::Wgs84,
            name => known(name),
        };
    }
    if let Some(grids) = value("nadgrids") {
        return if grids == "@null" { Datum::Wgs84 } else { Datum::Unknown };
    }
    if let Some(shift) = value("towgs84") {
        let parameters: Vec<f64> = shift.split(',').filter_map(|number| number.parse().ok()).collect();
        let negligible = parameters.iter().all(|parameter| parameter.abs() < NEGLIGIBLE);
        return if negligible && is_modern_ellipsoid(&value) { Datum::Wgs84 } else { known(shift) };
    }
    if is_modern_ellipsoid(&value) { Datum::Wgs84 } else { Datum::Unknown }
}

fn known(shift: &str) -> Datum {
    KNOWN_SHIFTS
        .iter()
        .find(|(name, _)| *name == shift)
        .map_or(Datum::Unknown, |&(_, accuracy_metres)| Datum::Shifted { accuracy_metres })
}

/// Whether the ellipsoid is that of a geocentric datum (GRS80, WGS84), or a sphere of the Earth's
/// size, on which latitudes are taken as they are.
fn is_modern_ellipsoid<'a>(value: &impl Fn(&str) -> Option<&'a str>) -> bool {
    if let Some(name) = value("ellps") {
        return matches!(name, "GRS80" | "WGS84");
    }
    let number = |key: &str| value(key).and_then(|text| text.parse::<f64>().ok());
    if let Some(radius) = number("R") {
        return (6_350_000.0..6_390_000.0).contains(&radius);
    }
    let Some(major) = number("a") else { return false };
    let minor = number("b").or_else(|| number("rf").map(|inverse| major * (1.0 - 1.0 / inverse)));
    minor.is_some_and(|minor| {
        let geocentric = (major - 6_378_137.0).abs() < 0.5 && (minor - 6_356_752.3).abs() < 0.5;
        let sphere = (major - minor).abs() < 0.5 && (6_350_000.0..6_390_000.0).contains(&major);
        geocentric || sphere
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_code(code: u16) -> Datum {
        judge(crs_definitions::from_code(code).unwrap().proj4)
    }

    #[test]
    fn datums_of_known_codes() {
        for code in
            [4326, 4269, 4258, 32632, 25832, 2193, 3035, 2180, 5070, 3031, 28355, 7855, 6669, 3857, 4490]
        {
            assert_eq!(of_code(code), Datum::Wgs84, "EPSG:{code}");
        }
        for code in [2056, 21781, 31287, 28992, 27700, 31370, 2326, 29902] {
            assert!(matches!(of_code(code), Datum::Shifted { .. }), "EPSG:{code}");
        }
        for code in [23030, 4230, 5514, 31467, 4267, 26711, 27572, 3844, 21897] {
            assert_eq!(of_code(code), Datum::Unknown, "EPSG:{code}");
        }
    }
}
