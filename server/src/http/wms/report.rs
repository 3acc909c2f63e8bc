//! EXCEPTIONS: how a map's errors are told.

use super::exception::ServiceException;
use super::get_map;
use super::reference_system::size;
use super::version::Version;
use crate::http::query::Parameters;
use crate::limits::Limits;
use crate::recipe::legend::drawing;
use crate::recipe::lettering::{Canvas, LETTER, lines};
use crate::recipe::{Format, encode_pixels};
use crate::state::AppState;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use treeline_core::layer::Layer;

/// Pixels around the text, and between its lines.
const MARGIN: u32 = 6;
const LEADING: u32 = LETTER + 4;
const INK: [u8; 4] = [168, 24, 24, 255];

/// The values of EXCEPTIONS as 1.3.0 spells them; 1.1.1 spells them as media types.
const NAMES: [(&str, &str, Report); 3] = [
    ("XML", "application/vnd.ogc.se_xml", Report::Xml),
    ("INIMAGE", "application/vnd.ogc.se_inimage", Report::InImage),
    ("BLANK", "application/vnd.ogc.se_blank", Report::Blank),
];

/// How errors are told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Report {
    /// As a document, with the status of an error.
    Xml,
    /// As text in a picture of the size and format asked for, with status 200: many clients show nothing else.
    InImage,
    /// As a picture with nothing in it.
    Blank,
}

impl Report {
    /// Its names in a version's capabilities.
    pub fn names(version: Version) -> [&'static str; 3] {
        NAMES.map(|(short, media_type, _)| if version == Version::V1_3_0 { short } else { media_type })
    }

    /// Understands EXCEPTIONS, in the spelling of either version.
    pub fn of_request(parameters: &Parameters) -> Result<Self, ServiceException> {
        let Some(text) = parameters.get("EXCEPTIONS") else { return Ok(Self::Xml) };
        NAMES
            .iter()
            .find(|(short, media_type, _)| {
                text.eq_ignore_ascii_case(short)
                    || text.eq_ignore_ascii_case(media_type)
                    || matches!(text.to_ascii_lowercase().as_str(), "text/xml" | "application/xml")
            })
            .map(|(.., report)| *report)
            .ok_or_else(|| {
                let names = NAMES.map(|(short, ..)| short).join(", ");
                ServiceException::invalid(format!("EXCEPTIONS is \"{text}\"; there are {names}"))
            })
    }
}

/// The picture that tells an error; `None` where the request does not ask for one, or not for one that can be, or where
/// the server has too much to do.
pub async fn picture(
    app: &AppState,
    exception: &ServiceException,
    parameters: &Parameters,
) -> Option<Response> {
    let wanted = Wanted::of_request(parameters, &app.limits)?;
    let content_type = wanted.format.content_type(Layer::Texture);
    let line = exception.line().to_owned();
    // As large as a map: for a worker, like all that takes time and memory.
    let bytes = app.cache.workers().run(move || wanted.draw(&line)).await.ok()??;
    let headers = [(header::CONTENT_TYPE, content_type), (header::CACHE_CONTROL, "no-store")];
    Some((StatusCode::OK, headers, bytes).into_response())
}

/// What a picture of an error is to look like.
struct Wanted {
    report: Report,
    format: Format,
    width: u32,
    height: u32,
    transparent: bool,
    background: [u8; 3],
}

impl Wanted {
    fn of_request(parameters: &Parameters, limits: &Limits) -> Option<Self> {
        let report = Report::of_request(parameters).ok().filter(|report| *report != Report::Xml)?;
        let request = parameters.get("REQUEST")?;
        if !request.eq_ignore_ascii_case("GetMap") && !request.eq_ignore_ascii_case("map") {
            return None;
        }
        let (width, height) = size(parameters, limits).ok()?;
        let asked = parameters.get("FORMAT")?;
        let format = Format::ALL.into_iter().find(|format| {
            format.is_picture() && format.media_type(Layer::Texture).eq_ignore_ascii_case(asked)
        })?;
        let transparent = get_map::transparent(parameters).unwrap_or(false);
        let background = get_map::background(parameters).unwrap_or([255; 3]);
        Some(Self { report, format, width, height, transparent, background })
    }

    fn draw(&self, line: &str) -> Option<Vec<u8>> {
        let [red, green, blue] = self.background;
        let alpha = if self.transparent && self.format != Format::Jpeg { 0 } else { 255 };
        let mut canvas = Canvas::new(self.width, self.height, [red, green, blue, alpha]);
        if self.report == Report::InImage {
            let letters = (self.width.saturating_sub(2 * MARGIN) / LETTER) as usize;
            let lines = lines(line, letters);
            // Readable whatever lies below.
            let bottom = 2 * MARGIN + lines.len() as u32 * LEADING;
            canvas.fill([0, 0, self.width, bottom], [255, 255, 255, 255]);
            for (index, line) in lines.iter().enumerate() {
                canvas.write(MARGIN, MARGIN + index as u32 * LEADING, line, INK);
            }
        }
        let mut drawing = drawing(Layer::Texture, self.format, self.width, self.height);
        drawing.transparent = self.transparent;
        encode_pixels(&drawing, canvas.pixels).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn either_spelling_is_understood() {
        let of = |text: &str| Report::of_request(&Parameters::parse(text).unwrap());
        assert_eq!(of("").unwrap(), Report::Xml);
        assert_eq!(of("EXCEPTIONS=inimage").unwrap(), Report::InImage);
        assert_eq!(of("EXCEPTIONS=application/vnd.ogc.se_blank").unwrap(), Report::Blank);
        assert_eq!(of("EXCEPTIONS=text/xml").unwrap(), Report::Xml);
        assert!(of("EXCEPTIONS=JSON").is_err());
    }
}
