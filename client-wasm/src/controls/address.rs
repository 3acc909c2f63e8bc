//! The camera in the address bar: `#camera=lon,lat,height,heading_deg,pitch_deg&time=…`.
//!
//! Parameters that are not known here are kept as they are, so that a link made by a later version
//! does not lose them on the way through this one.

use treeline_core::camera::{DEFAULT_FIELD_OF_VIEW_DEGREES, GeographicCamera};
use treeline_core::sun::unix_seconds_from_rfc3339;

/// What an address says of the view.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Address {
    /// The camera, where there is a valid one.
    pub camera: Option<GeographicCamera>,
    /// Date and time of the sun, RFC 3339, as written.
    pub time: Option<String>,
    /// All other parameters, undecoded.
    pub others: Vec<String>,
    /// One line about what is there and cannot be read, for the person who followed the link.
    pub problem: Option<String>,
}

impl Address {
    /// Reads the part after `#`. What cannot be read is left out, with a word in `problem`: an address is
    /// not worth an error page.
    pub fn from_fragment(fragment: &str) -> Self {
        let mut address = Self::default();
        let mut field_of_view = DEFAULT_FIELD_OF_VIEW_DEGREES;
        let fragment = fragment.strip_prefix('#').unwrap_or(fragment);
        for parameter in fragment.split('&').filter(|parameter| !parameter.is_empty()) {
            let (name, value) = parameter.split_once('=').unwrap_or((parameter, ""));
            match name {
                "camera" => match camera_from_list(value) {
                    Ok(camera) => address.camera = Some(camera),
                    Err(problem) => address.add_problem(&problem),
                },
                "time" => {
                    let time = value.replace("%3A", ":").replace("%3a", ":");
                    match unix_seconds_from_rfc3339(&time) {
                        Ok(_) => address.time = Some(time),
                        Err(problem) => address.add_problem(&format!("The link's time: {problem}.")),
                    }
                }
                "fov" => field_of_view = value.parse().unwrap_or(field_of_view),
                _ => address.others.push(parameter.to_owned()),
            }
        }
        if let Some(mut camera) = address.camera.take() {
            camera.fov_y_deg = field_of_view;
            match camera.check() {
                Ok(()) => address.camera = Some(camera),
                Err(problem) => address.add_problem(&camera_problem(&problem)),
            }
        }
        address
    }

    fn add_problem(&mut self, line: &str) {
        self.problem = Some(match self.problem.take() {
            Some(before) => format!("{before} {line}"),
            None => line.to_owned(),
        });
    }

    /// The part after `#`. Degrees to 1e-8 (a millimetre), metres to the millimetre, angles to 1e-4.
    pub fn to_fragment(&self) -> String {
        let mut parameters = Vec::new();
        if let Some(camera) = &self.camera {
            parameters.push(format!(
                "camera={},{},{},{},{}",
                decimal(camera.lon, 8),
                decimal(camera.lat, 8),
                decimal(camera.height, 3),
                decimal(camera.heading_deg, 4),
                decimal(camera.pitch_deg, 4)
            ));
            if camera.fov_y_deg != DEFAULT_FIELD_OF_VIEW_DEGREES {
                parameters.push(format!("fov={}", decimal(camera.fov_y_deg, 4)));
            }
        }
        parameters.extend(self.time.iter().map(|time| format!("time={time}")));
        parameters.extend(self.others.iter().cloned());
        parameters.join("&")
    }
}

/// `lon,lat,height,heading_deg,pitch_deg`; a sixth and later number is for a later version.
fn camera_from_list(list: &str) -> Result<GeographicCamera, String> {
    // Some programs encode the commas of a link that they pass on.
    let list = list.replace("%2C", ",").replace("%2c", ",");
    let numbers: Result<Vec<f64>, String> = list
        .split(',')
        .take(5)
        .map(|number| {
            number
                .parse()
                .map_err(|_| camera_problem(&format!("\u{201c}{}\u{201d} is no number", start_of(number))))
        })
        .collect();
    let &[lon, lat, height, heading_deg, pitch_deg] = &numbers?[..] else {
        return Err(camera_problem("five numbers are needed: longitude, latitude, height, heading, pitch"));
    };
    Ok(GeographicCamera {
        lon,
        lat,
        height,
        heading_deg,
        pitch_deg,
        fov_y_deg: DEFAULT_FIELD_OF_VIEW_DEGREES,
    })
}

/// A line about a camera that cannot be.
fn camera_problem(problem: &str) -> String {
    format!("The view in the link cannot be read ({problem}); this is the first view instead.")
}

/// The beginning of a text that may be long: a line is read, not scrolled.
fn start_of(text: &str) -> String {
    let mut start: String = text.chars().take(24).collect();
    if start.len() < text.len() {
        start.push('…');
    }
    start
}

/// At most so many decimals, without zeros at the end, and no negative zero.
fn decimal(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_link() {
        let fragment = "#camera=8.5,46.25,3200,12.5,-30&time=2026-07-15T09:00:00Z&layer=texture";
        let address = Address::from_fragment(fragment);
        let camera = address.camera.unwrap();
        assert_eq!((camera.lon, camera.height, camera.pitch_deg), (8.5, 3200.0, -30.0));
        assert_eq!(address.time.as_deref(), Some("2026-07-15T09:00:00Z"));
        assert_eq!(format!("#{}", address.to_fragment()), fragment);
    }

    #[test]
    fn what_cannot_be_read_is_left_out() {
        for fragment in [
            "",
            "#",
            "#camera=",
            "#camera=1,2",
            "#camera=1,91,3,4,5",
            "#camera=NaN,0,0,0,0",
            "#camera=a,b,c,d,e",
        ] {
            let address = Address::from_fragment(fragment);
            assert_eq!(address.camera, None, "{fragment}");
            assert_eq!(address.problem.is_some(), fragment.contains('='), "{fragment}: {address:?}");
        }
        let problem = |fragment: &str| Address::from_fragment(fragment).problem.unwrap();
        assert!(problem("camera=1,91,3,4,5").contains("lat"));
        assert!(problem("camera=1,x,3,4,5").contains("\u{201c}x\u{201d}"));
        assert!(problem(&format!("camera={}", "9x".repeat(4_000))).len() < 200);
        assert!(problem("camera=1&time=noon").contains("time"));
        assert_eq!(Address::from_fragment("camera=8%2C46%2C3000%2C0%2C-30").camera.unwrap().lat, 46.0);
        assert_eq!(
            Address::from_fragment("time=2026-07-15T09%3A00%3A00Z").time.unwrap(),
            "2026-07-15T09:00:00Z"
        );
    }

    #[test]
    fn zeros() {
        assert_eq!(decimal(-0.000_000_001, 8), "0");
        assert_eq!(decimal(100.0, 3), "100");
        assert_eq!(decimal(1234.5, 0), "1234");
    }

    proptest! {
        #[test]
        fn a_written_address_reads_back(
            lon in -180.0..180.0_f64,
            lat in -90.0..90.0_f64,
            height in -100.0..1e7_f64,
            heading_deg in 0.0..360.0_f64,
            pitch_deg in -90.0..60.0_f64,
        ) {
            let camera = GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 50.0 };
            let address = Address { camera: Some(camera), ..Address::default() };
            let once = Address::from_fragment(&address.to_fragment());
            let back = once.camera.unwrap();
            prop_assert!((back.lon - lon).abs() < 1e-8 && (back.lat - lat).abs() < 1e-8);
            prop_assert!((back.height - height).abs() < 1e-3);
            prop_assert!((back.heading_deg - heading_deg).abs() < 1e-4);
            prop_assert_eq!(once.to_fragment(), address.to_fragment());
        }
    }
}
