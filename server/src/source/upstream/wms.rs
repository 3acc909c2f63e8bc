//! Addresses of a WMS with its layer, and what has to be added to them for a map (WMS 1.1.1, which spares us the order of
//! axes).

use std::path::Path;

/// Whether a source's path is the address of a WMS with its layer.
pub fn is_wms(path: &Path) -> bool {
    super::is_address(path) && path.to_str().is_some_and(|text| says(text, "layers"))
}

/// Whether an address has a parameter of a name, in any case.
fn says(address: &str, name: &str) -> bool {
    let pairs = address.split(['?', '&']).skip(1);
    pairs.filter_map(|pair| pair.split('=').next()).any(|said| said.eq_ignore_ascii_case(name))
}

/// The address of maps, all but their bounds and size: what it does not say for itself is added, `wanted` among that.
pub fn maps_of(address: &str, wanted: &[(&str, &str)]) -> String {
    let always = [("SERVICE", "WMS"), ("VERSION", "1.1.1"), ("REQUEST", "GetMap"), ("STYLES", "")];
    let mut text = address.trim_end_matches(['&', '?']).to_owned();
    for (name, value) in always.iter().chain(wanted) {
        if !says(address, name) {
            text += &format!("&{name}={value}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_address_does_not_say_is_added() {
        assert_eq!(
            maps_of(
                "https://a.org/wms?layers=dem&FORMAT=image/tiff&",
                &[("FORMAT", "x"), ("SRS", "EPSG:4326")]
            ),
            "https://a.org/wms?layers=dem&FORMAT=image/tiff&SERVICE=WMS&VERSION=1.1.1&REQUEST=GetMap&STYLES=&SRS=EPSG:4326"
        );
        assert!(is_wms(Path::new("https://a.org/wms?map=x&LAYERS=dem")));
        assert!(!is_wms(Path::new("https://a.org/dem.tif")) && !is_wms(Path::new("/wms?LAYERS=dem")));
    }
}
