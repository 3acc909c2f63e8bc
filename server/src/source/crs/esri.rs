//! Reference systems as ESRI's software spells them out: `PROJCS["…",GEOGCS[…],PROJECTION[…],…]`.
//!
//! GeoTIFFs carry this text where the GeoKeys have no words for the system (and where they do, but
//! the writer came from ESRI's world: web Mercator is one of these).

use super::{Crs, CrsError};

/// Deepest nesting that is read; real texts have four levels.
const MAXIMUM_DEPTH: usize = 16;

/// `KEYWORD[value, value, …]`.
#[derive(Debug, PartialEq)]
struct Node {
    keyword: String,
    values: Vec<Value>,
}

#[derive(Debug, PartialEq)]
enum Value {
    Text(String),
    Number(f64),
    Node(Node),
}

impl Node {
    fn parse(text: &str) -> Option<Self> {
        let mut rest = text.trim_start();
        let Value::Node(node) = value(&mut rest, 0)? else { return None };
        Some(node)
    }

    fn name(&self) -> &str {
        self.values
            .iter()
            .find_map(|value| if let Value::Text(text) = value { Some(text) } else { None })
            .map_or("", String::as_str)
    }

    fn number(&self, index: usize) -> Option<f64> {
        let mut numbers = self
            .values
            .iter()
            .filter_map(|value| if let Value::Number(number) = value { Some(*number) } else { None });
        numbers.nth(index).filter(|number| number.is_finite())
    }

    fn children<'a>(&'a self, keyword: &'a str) -> impl Iterator<Item = &'a Self> {
        self.values.iter().filter_map(move |value| match value {
            Value::Node(node) if node.keyword.eq_ignore_ascii_case(keyword) => Some(node),
            _ => None,
        })
    }

    fn child<'a>(&'a self, keyword: &'a str) -> Option<&'a Self> {
        self.children(keyword).next()
    }

    /// A parameter of the projection, by its name in any case.
    fn parameter(&self, name: &str) -> Option<f64> {
        self.children("PARAMETER").find(|node| node.name().eq_ignore_ascii_case(name))?.number(0)
    }
}

fn value(rest: &mut &str, depth: usize) -> Option<Value> {
    if depth > MAXIMUM_DEPTH {
        return None;
    }
    if let Some(quoted) = rest.strip_prefix('"') {
        let (text, after) = quoted.split_once('"')?;
        *rest = after.trim_start();
        return Some(Value::Text(text.to_owned()));
    }
    let end = rest.find([',', '[', ']', '(', ')'])?;
    let word = rest[..end].trim();
    *rest = &rest[end..];
    let Some(mut inner) = rest.strip_prefix(['[', '(']) else {
        // A bare word (an axis' direction) is a text.
        return Some(word.parse().map_or_else(|_| Value::Text(word.to_owned()), Value::Number));
    };
    let mut values = Vec::new();
    loop {
        inner = inner.trim_start();
        values.push(value(&mut inner, depth + 1)?);
        inner = inner.trim_start();
        if let Some(after) = inner.strip_prefix(',') {
            inner = after;
        } else {
            *rest = inner.strip_prefix([']', ')'])?.trim_start();
            return Some(Value::Node(Node { keyword: word.to_owned(), values }));
        }
    }
}

/// The system of a text, and the semi-major axis of its body in metres; `None` where the text is none of these.
pub fn system_and_major_axis(text: &str) -> Option<(Result<Crs, CrsError>, f64)> {
    let root = Node::parse(text)?;
    let geographic = match root.keyword.to_ascii_uppercase().as_str() {
        "PROJCS" => root.child("GEOGCS")?,
        "GEOGCS" => &root,
        _ => return None,
    };
    let major = geographic.child("DATUM")?.child("SPHEROID")?.number(0)?;
    let name = root.name().replace('_', " ");
    let system = definition(&root, geographic)
        .map_err(|detail| CrsError::Unsupported { name: name.clone(), detail })
        .and_then(|definition| match definition {
            Definition::WebMercator => Crs::from_epsg(3857),
            Definition::Words(words) => Crs::from_definition(&words, name, None),
        });
    Some((system, major))
}

enum Definition {
    WebMercator,
    Words(String),
}

/// The system as PROJ words; the error says what is not known of it.
fn definition(root: &Node, geographic: &Node) -> Result<Definition, String> {
    let spheroid = geographic.child("DATUM").and_then(|datum| datum.child("SPHEROID"));
    let (Some(major), Some(inverse)) =
        (spheroid.and_then(|node| node.number(0)), spheroid.and_then(|node| node.number(1)))
    else {
        return Err("its ellipsoid has no size".to_owned());
    };
    let mut earth =
        if inverse > 1.0 { format!("+a={major} +rf={inverse}") } else { format!("+a={major} +b={major}") };
    if let Some(meridian) = geographic.child("PRIMEM").and_then(|node| node.number(0)).filter(|&m| m != 0.0) {
        earth = format!("{earth} +pm={meridian}");
    }
    let degree = geographic.child("UNIT").and_then(|node| node.number(0)).unwrap_or(1_f64.to_radians());
    if (degree - 1_f64.to_radians()).abs() > 1e-9 {
        return Err("its angles are no degrees".to_owned());
    }
    let Some(projection) = root.child("PROJECTION") else {
        return Ok(Definition::Words(format!("+proj=longlat {earth} +no_defs")));
    };
    let unit = root.child("UNIT").and_then(|node| node.number(0)).filter(|&unit| unit > 0.0).unwrap_or(1.0);
    let method = projection.name().to_ascii_lowercase();
    if method == "mercator_auxiliary_sphere" {
        let plain = [
            "False_Easting",
            "False_Northing",
            "Central_Meridian",
            "Standard_Parallel_1",
            "Auxiliary_Sphere_Type",
        ]
        .iter()
        .all(|name| root.parameter(name).unwrap_or(0.0) == 0.0);
        let same = plain && unit == 1.0 && (major - 6_378_137.0).abs() < 1e-3;
        return if same {
            Ok(Definition::WebMercator)
        } else {
            Err("it is a web Mercator with parameters of its own".to_owned())
        };
    }
    let words = projection_words(root, &method, unit)
        .ok_or_else(|| format!("the projection {} is not known here", projection.name()))?;
    Ok(Definition::Words(format!("{words} {earth} +to_meter={unit} +no_defs")))
}

/// The projection without ellipsoid and unit; `None` for one that is not known.
fn projection_words(root: &Node, method: &str, unit: f64) -> Option<String> {
    let first = |names: &[&str]| names.iter().find_map(|name| root.parameter(name)).unwrap_or(0.0);
    let longitude = first(&["Central_Meridian", "Longitude_Of_Center", "Longitude_Of_Origin"]);
    let latitude = first(&["Latitude_Of_Origin", "Latitude_Of_Center", "Central_Parallel"]);
    let parallel_1 = first(&["Standard_Parallel_1"]);
    let parallel_2 = first(&["Standard_Parallel_2"]);
    let scale = root.parameter("Scale_Factor").unwrap_or(1.0);
    let offset =
        format!("+x_0={} +y_0={}", unit * first(&["False_Easting"]), unit * first(&["False_Northing"]));
    let origin = format!("+lat_0={latitude} +lon_0={longitude}");
    let parallels = format!("+lat_1={parallel_1} +lat_2={parallel_2}");
    Some(match method {
        "transverse_mercator" | "gauss_kruger" => format!("+proj=tmerc {origin} +k={scale} {offset}"),
        "lambert_conformal_conic" if root.parameter("Standard_Parallel_2").is_some() && scale == 1.0 => {
            format!("+proj=lcc {parallels} {origin} {offset}")
        }
        "lambert_conformal_conic" if root.parameter("Standard_Parallel_2").is_none() => {
            format!("+proj=lcc +lat_1={latitude} {origin} +k_0={scale} {offset}")
        }
        "albers" => format!("+proj=aea {parallels} {origin} {offset}"),
        "equidistant_conic" => format!("+proj=eqdc {parallels} {origin} {offset}"),
        "lambert_azimuthal_equal_area" => format!("+proj=laea {origin} {offset}"),
        "azimuthal_equidistant" => format!("+proj=aeqd {origin} {offset}"),
        "mercator" => format!("+proj=merc +lat_ts={parallel_1} +lon_0={longitude} {offset}"),
        "stereographic" => format!("+proj=stere {origin} +k={scale} {offset}"),
        "stereographic_north_pole" => {
            format!("+proj=stere +lat_0=90 +lat_ts={parallel_1} +lon_0={longitude} {offset}")
        }
        "stereographic_south_pole" => {
            format!("+proj=stere +lat_0=-90 +lat_ts={parallel_1} +lon_0={longitude} {offset}")
        }
        "double_stereographic" => format!("+proj=sterea {origin} +k={scale} {offset}"),
        "cylindrical_equal_area" => format!("+proj=cea +lat_ts={parallel_1} +lon_0={longitude} {offset}"),
        "equidistant_cylindrical" | "plate_carree" => {
            format!("+proj=eqc +lat_ts={parallel_1} +lon_0={longitude} {offset}")
        }
        "sinusoidal" => format!("+proj=sinu +lon_0={longitude} {offset}"),
        "polyconic" => format!("+proj=poly {origin} {offset}"),
        "cassini" => format!("+proj=cass {origin} {offset}"),
        "mollweide" => format!("+proj=moll +lon_0={longitude} {offset}"),
        "equal_earth" => format!("+proj=eqearth +lon_0={longitude} {offset}"),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const WGS84: &str = r#"GEOGCS["GCS_WGS_1984",DATUM["D_WGS_1984",SPHEROID["WGS_1984",6378137.0,298.257223563]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]]"#;

    fn system(text: &str) -> Result<Crs, CrsError> {
        system_and_major_axis(text).unwrap().0
    }

    #[test]
    fn web_mercator() {
        let text = format!(
            r#"PROJCS["WGS_1984_Web_Mercator_Auxiliary_Sphere",{WGS84},PROJECTION["Mercator_Auxiliary_Sphere"],PARAMETER["False_Easting",0.0],PARAMETER["Auxiliary_Sphere_Type",0.0],UNIT["Meter",1.0]]"#
        );
        assert!(system(&text).unwrap().is_web_mercator());
        let shifted = text.replace("\"False_Easting\",0.0", "\"False_Easting\",5.0");
        assert!(matches!(system(&shifted), Err(CrsError::Unsupported { .. })));
    }

    #[test]
    fn places_agree_with_the_registry_s() {
        let text = r#"PROJCS["NAD_1983_Contiguous_USA_Albers",GEOGCS["GCS_North_American_1983",DATUM["D_North_American_1983",SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],PROJECTION["Albers"],PARAMETER["False_Easting",0.0],PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",-96.0],PARAMETER["Standard_Parallel_1",29.5],PARAMETER["Standard_Parallel_2",45.5],PARAMETER["Latitude_Of_Origin",23.0],UNIT["Meter",1.0]]"#;
        let (found, registered) = (system(text).unwrap(), Crs::from_epsg(5070).unwrap());
        let (a, b) =
            (found.from_geographic(-114.5, 46.7).unwrap(), registered.from_geographic(-114.5, 46.7).unwrap());
        assert!((a.0 - b.0).hypot(a.1 - b.1) < 1e-3, "{a:?} {b:?}");
        assert_eq!(found.name(), "NAD 1983 Contiguous USA Albers");
        assert!(system(WGS84).unwrap().is_plain_geographic());
    }

    #[test]
    fn feet_of_false_origins_and_coordinates() {
        let text = format!(
            r#"PROJCS["feet",{WGS84},PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",1000.0],PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",9.0],PARAMETER["Scale_Factor",1.0],PARAMETER["Latitude_Of_Origin",0.0],UNIT["Foot_US",0.304800609601219]]"#
        );
        let (x, y) = system(&text).unwrap().from_geographic(9.0, 0.0).unwrap();
        assert!((x - 1000.0).abs() < 1e-6 && y.abs() < 1e-6, "{x} {y}");
    }

    #[test]
    fn what_is_not_known_is_refused_and_garbage_is_none() {
        let krovak = format!(r#"PROJCS["x",{WGS84},PROJECTION["Krovak"],UNIT["Meter",1.0]]"#);
        assert!(system(&krovak).unwrap_err().to_string().contains("Krovak"));
        let bessel = WGS84.replace("6378137.0,298.257223563", "6377397.155,299.1528128");
        assert!(matches!(system(&bessel), Err(CrsError::UnknownDatum(_))));
        let nested = "A[".repeat(100_000);
        for garbage in [
            "",
            "PROJCS",
            "PROJCS[",
            "PROJCS[\"",
            "PROJCS[]",
            "LOCAL_CS[\"x\",1]",
            "PROJCS[\"x\"]",
            nested.as_str(),
        ] {
            assert!(system_and_major_axis(garbage).is_none(), "{garbage:.20}");
        }
    }
}
