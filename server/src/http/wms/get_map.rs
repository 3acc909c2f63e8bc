//! GetMap.

use super::exception::ServiceException;
use super::reference_system::{ReferenceSystem, RequestBox, size};
use super::version::Version;
use crate::http::answer;
use crate::http::layers::{has_layer, layer_names};
use crate::http::order::Order;
use crate::http::query::{Parameters, number};
use crate::recipe::Format;
use crate::source::SampleGrid;
use crate::state::AppState;
use crate::user_error::suggestion;
use axum::http::HeaderMap;
use axum::response::Response;
use treeline_core::layer::Layer;
use treeline_core::query::FILLED_STYLE;

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
    let layer = layer(app, parameters, "LAYERS")?;
    let filled = filled(parameters, layer)?;
    let system = ReferenceSystem::of_request(&app.scene, parameters, version)?;
    let request = RequestBox::of_request(parameters, &system)?;
    let (width, height) = size(parameters, &app.limits)?;
    let format = format(parameters, layer)?;
    let grid = request.grid(layer, &system, width, height);
    if format == Format::Own && !is_tile(&grid) {
        let row = layer.row();
        return Err(ServiceException::invalid(format!(
            "FORMAT={} is for tiles of the matrix only, with or without their border, in CRS:84 or EPSG:4326; take {} for other boxes",
            row.client_format, row.formats[0]
        )));
    }
    Ok(Order::new(layer, grid, format)
        .filled(filled)
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

/// The one layer that the parameter names.
pub fn layer(app: &AppState, parameters: &Parameters, name: &str) -> Result<Layer, ServiceException> {
    let text = parameters.require(name, "elevation")?;
    let names = layer_names(&app.scene);
    if text.contains(',') {
        return Err(ServiceException::new(
            Some("LayerNotDefined"),
            format!(
                "{name} is \"{text}\"; this server draws one layer a map: ask for each of them by itself"
            ),
        ));
    }
    Layer::from_name(text).filter(|&layer| has_layer(&app.scene, layer)).ok_or_else(|| {
        let near = suggestion(text, names.iter().copied());
        ServiceException::new(
            Some("LayerNotDefined"),
            format!("{name} is \"{text}\"; this scene has the layers {}{near}", names.join(", ")),
        )
    })
}

/// Whether STYLES asks for the filled photo.
fn filled(parameters: &Parameters, layer: Layer) -> Result<bool, ServiceException> {
    match parameters.get("STYLES") {
        None | Some("default") => Ok(false),
        Some(FILLED_STYLE) if layer == Layer::Texture => Ok(true),
        Some(style) => Err(ServiceException::new(
            Some("StyleNotDefined"),
            format!(
                "STYLES is \"{style}\"; the layer {} has the style \"default\"{} (or leave it empty: STYLES=)",
                layer.name(),
                if layer == Layer::Texture { " and \"filled\"" } else { "" }
            ),
        )),
    }
}

/// The media type of the layer's table that FORMAT names.
fn format(parameters: &Parameters, layer: Layer) -> Result<Format, ServiceException> {
    let formats = layer.row().formats;
    let text = parameters.require("FORMAT", formats[0])?;
    // Spaces (or the plus signs that stand for them) after the semicolon mean nothing.
    let plain = |text: &str| text.to_ascii_lowercase().replace([' ', '+'], "");
    let asked = plain(text);
    let known = formats.iter().find(|format| plain(format) == asked);
    known.and_then(|format| Format::from_media_type(layer, format)).ok_or_else(|| {
        ServiceException::new(
            Some("InvalidFormat"),
            format!("FORMAT is \"{text}\"; the layer {} comes as {}", layer.name(), formats.join(", ")),
        )
    })
}

fn transparent(parameters: &Parameters) -> Result<bool, ServiceException> {
    match parameters.get("TRANSPARENT") {
        None => Ok(false),
        Some(text) if text.eq_ignore_ascii_case("FALSE") => Ok(false),
        Some(text) if text.eq_ignore_ascii_case("TRUE") => Ok(true),
        Some(text) => {
            Err(ServiceException::invalid(format!("TRANSPARENT is \"{text}\"; it must be TRUE or FALSE")))
        }
    }
}

fn background(parameters: &Parameters) -> Result<[u8; 3], ServiceException> {
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
