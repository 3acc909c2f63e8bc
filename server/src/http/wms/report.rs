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

/// The picture that tells an error; `None` where the request does not ask for one, or not for one that can be.
pub fn picture(exception: &ServiceException, parameters: &Parameters, limits: &Limits) -> Option<Response> {
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
    let [red, green, blue] = get_map::background(parameters).unwrap_or([255; 3]);
    let alpha = if transparent && format != Format::Jpeg { 0 } else { 255 };
    let mut canvas = Canvas::new(width, height, [red, green, blue, alpha]);
    if report == Report::InImage {
        let letters = (width.saturating_sub(2 * MARGIN) / LETTER) as usize;
        let lines = lines(exception.line(), letters);
        // Readable whatever lies below.
        canvas.fill([0, 0, width, 2 * MARGIN + lines.len() as u32 * LEADING], [255, 255, 255, 255]);
        for (index, line) in lines.iter().enumerate() {
            canvas.write(MARGIN, MARGIN + index as u32 * LEADING, line, INK);
        }
    }
    let mut drawing = drawing(Layer::Texture, format, width, height);
    drawing.transparent = transparent;
    let bytes = encode_pixels(&drawing, canvas.pixels).ok()?;
    let headers =
        [(header::CONTENT_TYPE, format.content_type(Layer::Texture)), (header::CACHE_CONTROL, "no-store")];
    Some((StatusCode::OK, headers, bytes).into_response())
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
