//! The parameters of a request, as WMS reads them: names in any case, each once.

use percent_encoding::percent_decode_str;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Parameters by upper-case name; thousands take no longer each than a few do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parameters(BTreeMap<String, String>);

impl Parameters {
    /// Parses a query string. A parameter given twice with different values is an error: which one
    /// is meant cannot be known.
    pub fn parse(query: &str) -> Result<Self, String> {
        let mut found = BTreeMap::new();
        for pair in query.split(['&']).filter(|pair| !pair.is_empty()) {
            let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
            let value = decode(value)?;
            let mut name = decode(name)?;
            if name.is_ascii() {
                name.make_ascii_uppercase();
            } else {
                name = name.to_uppercase();
            }
            match found.entry(name) {
                Entry::Vacant(free) => {
                    free.insert(value);
                }
                Entry::Occupied(taken) if *taken.get() != value => {
                    let (name, first) = (taken.key(), taken.get());
                    return Err(format!(
                        "{name} is given twice, as \"{first}\" and as \"{value}\"; give it once"
                    ));
                }
                Entry::Occupied(_) => {}
            }
        }
        Ok(Self(found))
    }

    /// A parameter's value; an empty one counts as absent.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(String::as_str).filter(|value| !value.is_empty())
    }

    /// Whether the parameter is there, even if empty.
    pub fn has(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// The value of a parameter that must be there.
    pub fn require(&self, name: &str, example: &str) -> Result<&str, String> {
        self.get(name).ok_or_else(|| format!("{name} is missing; add for example {name}={example}"))
    }
}

/// Undoes percent encoding; a plus sign stays one, as in `1e+05` and `image/svg+xml`.
fn decode(text: &str) -> Result<String, String> {
    if !text.contains('%') {
        return Ok(text.to_owned());
    }
    percent_decode_str(text)
        .decode_utf8()
        .map(|text| text.into_owned())
        .map_err(|_| format!("\"{text}\" is no UTF-8 once its percent signs are undone; encode it as UTF-8"))
}

/// A finite number.
pub fn number(name: &str, text: &str) -> Result<f64, String> {
    // A client that encodes spaces as plus signs may also have trimmed nothing.
    let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    value
        .map(|value| value + 0.0)
        .ok_or_else(|| format!("{name}: \"{text}\" is no finite number; write for example -12.5"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_any_case_values_as_they_are() {
        let parameters = Parameters::parse("Service=WMS&bbox=1%2C2&STYLES=&flag&x=1e+05&&x=1e+05").unwrap();
        assert_eq!(parameters.get("SERVICE"), Some("WMS"));
        assert_eq!(parameters.get("BBOX"), Some("1,2"));
        assert_eq!(parameters.get("X"), Some("1e+05"));
        assert_eq!(parameters.get("STYLES"), None);
        assert!(parameters.has("STYLES") && parameters.has("FLAG") && !parameters.has("Y"));
        assert_eq!(
            parameters.require("CRS", "CRS:84").unwrap_err(),
            "CRS is missing; add for example CRS=CRS:84"
        );
    }

    #[test]
    fn twice_is_an_error_and_so_is_broken_utf_8() {
        assert!(Parameters::parse("a=1&A=2").unwrap_err().starts_with("A is given twice"));
        assert!(Parameters::parse("a=%ff").unwrap_err().contains("UTF-8"));
    }

    #[test]
    fn only_finite_numbers() {
        assert_eq!(number("N", " -1.5e2 "), Ok(-150.0));
        assert!(number("N", "-0").unwrap().is_sign_positive());
        for wrong in ["nan", "inf", "-infinity", "", "1,2", "0x10", "1e999"] {
            assert!(number("N", wrong).is_err(), "{wrong}");
        }
    }
}
