//! GetMap.

use super::exception::ServiceException;
use super::reference_system::{ReferenceSystem, RequestBox, size};
use super::shown;
use super::version::Version;
use crate::http::answer;
use crate::http::order::Order;
use crate::http::query::{Parameters, number};
use crate::recipe::Format;
use crate::source::SampleGrid;
use crate::state::AppState;
use axum::http::HeaderMap;
use axum::response::Response;
use treeline_core::layer::Layer;

/// Answers a GetMap request.
pub async fn answer(
    app: &AppState,
    parameters: &Parameters,
    version: Version,
    headers: &HeaderMap,
) -> Result<Response, ServiceException> {
    let order = order(app, parameters, version)?;
    Ok(answer::tile(app, order, parameters.get("REVISION"), headers).await?)
}

/// What the map's parameters come down to; GetFeatureInfo reads the same part.
pub fn order(app: &AppState, parameters: &Parameters, version: Version) -> Result<Order, ServiceException> {
    let drawn = shown::drawn(app, parameters)?;
    let layers: Vec<Layer> = drawn.iter().map(|drawn| drawn.layer).collect();
    let Some((&lowest, above)) = drawn.split_first() else {
        return Err(parameters.require("LAYERS", "elevation").err().unwrap_or_default().into());
    };
    let layer = lowest.layer;
    let system = ReferenceSystem::of_request(&app.scene, parameters, version)?;
    let request = RequestBox::of_request(parameters, &system)?;
    let (width, height) = size(parameters, &app.limits)?;
    let format = format(parameters, &layers)?;
    let grid = request.grid(layer, &system, width, height);
    if format == Format::Own && !is_tile(&grid) {
        let row = layer.row();
        return Err(ServiceException::invalid(format!(
            "FORMAT={} is for tiles of the matrix only, with or without their border, in CRS:84 or EPSG:4326; take {} for other boxes",
            row.client_format, row.formats[0]
        )));
    }
    Ok(Order::new(layer, grid, format)
        .filled(lowest.filled)
        .above(above.to_vec())
        .gaps(transparent(parameters)?, background(parameters)?)
        .nodata(nodata(parameters, format)?))
}

/// The number that NODATA asks for, which the format's samples must be able to hold.
fn nodata(parameters: &Parameters, format: Format) -> Result<f64, ServiceException> {
    let Some(text) = parameters.get("NODATA") else { return Ok(0.0) };
    let value = number("NODATA", text)?;
    let (least, greatest) = match format {
        Format::Bil16 => (f64::from(i16::MIN), f64::from(i16::MAX)),
        _ => (f64::from(f32::MIN), f64::from(f32::MAX)),
    };
    if (least..=greatest).contains(&value) {
        return Ok(value);
    }
    Err(ServiceException::invalid(format!(
        "NODATA is \"{text}\"; samples of this format hold {least:e} to {greatest:e}"
    )))
}

fn is_tile(grid: &SampleGrid) -> bool {
    matches!(grid, SampleGrid::Lattice(window) if window.as_tile().is_some())
}

/// The media type of the layers' table that FORMAT names. Layers one over the other are a picture, in any format of
/// pictures that one of them has.
fn format(parameters: &Parameters, layers: &[Layer]) -> Result<Format, ServiceException> {
    let text = parameters.require("FORMAT", "image/png")?;
    let single = layers.len() == 1;
    // As it is spelt in the table, mostly.
    if let &[layer] = layers
        && layer.row().formats.contains(&text)
        && let Some(format) = Format::from_media_type(layer, text)
    {
        return Ok(format);
    }
    let mut formats: Vec<(Format, &str)> = Vec::new();
    for &layer in layers {
        for &name in layer.row().formats {
            if let Some(format) = Format::from_media_type(layer, name)
                && (single || format.is_picture())
                && !formats.contains(&(format, name))
            {
                formats.push((format, name));
            }
        }
    }
    // Spaces (or the plus signs that stand for them) after the semicolon mean nothing.
    let plain = |text: &str| text.to_ascii_lowercase().replace([' ', '+'], "");
    let asked = plain(text);
    formats.iter().find(|(_, name)| plain(name) == asked).map(|(format, _)| *format).ok_or_else(|| {
        let names: Vec<&str> = formats.iter().map(|(_, name)| *name).collect();
        let what = match layers {
            [layer] => format!("the layer {} comes", layer.name()),
            _ => "several layers in one map come".to_owned(),
        };
        ServiceException::new(
            Some("InvalidFormat"),
            format!("FORMAT is \"{text}\"; {what} as {}", names.join(", ")),
        )
    })
}

/// TRANSPARENT.
pub fn transparent(parameters: &Parameters) -> Result<bool, ServiceException> {
    match parameters.get("TRANSPARENT") {
        None => Ok(false),
        Some(text) if text.eq_ignore_ascii_case("FALSE") => Ok(false),
        Some(text) if text.eq_ignore_ascii_case("TRUE") => Ok(true),
        Some(text) => {
            Err(ServiceException::invalid(format!("TRANSPARENT is \"{text}\"; it must be TRUE or FALSE")))
        }
    }
}

/// BGCOLOR: red, green, blue.
pub fn background(parameters: &Parameters) -> Result<[u8; 3], ServiceException> {
    let Some(text) = parameters.get("BGCOLOR") else { return Ok([255; 3]) };
    text.strip_prefix("0x")
        .or_else(|| text.strip_prefix("0X"))
        .or_else(|| text.strip_prefix('#'))
        .filter(|digits| digits.len() == 6 && digits.bytes().all(|byte| byte.is_ascii_hexdigit()))
        .and_then(|digits| u32::from_str_radix(digits, 16).ok())
        .map(|rgb| [(rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8])
        .ok_or_else(|| {
            ServiceException::invalid(format!("BGCOLOR is \"{text}\"; write red, green and blue as 0xRRGGBB"))
        })
}
