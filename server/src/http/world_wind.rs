//! The native tiles of World Wind .NET: `?T=layer&L=level&X=column&Y=row`, counted from the south-west.
//!
//! Level 0 has tiles of 20° for heights and of 36° for pictures, as that client's own data sets have them; `D=` says
//! another width and `S=` another number of samples along a side.

use crate::http::answer::{self, refusal, status_of};
use crate::http::layers::{has_layer, layer_names};
use crate::http::order::{Order, geographic_grid};
use crate::http::query::{Parameters, number};
use crate::recipe::Format;
use crate::state::AppState;
use crate::user_error::suggestion;
use axum::extract::{RawQuery, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use treeline_core::layer::Layer;
use treeline_core::tile::GeographicBox;

/// Width of a tile of level 0 of heights and of pictures, degrees.
const DEGREES: [f64; 2] = [20.0, 36.0];
/// Samples along a side of a tile of heights and of pictures.
const SAMPLES: [u32; 2] = [150, 512];
/// Deepest level: a tile of metres.
const DEEPEST: u32 = 22;

/// Whether a query is such a tile's rather than a WMS's.
pub fn is_native(parameters: &Parameters) -> bool {
    parameters.get("T").is_some() && parameters.get("REQUEST").is_none()
}

/// Answers `/world-wind`.
pub async fn world_wind(
    State(app): State<AppState>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Response {
    match Parameters::parse(&query.unwrap_or_default()) {
        Ok(parameters) => answer(&app, &parameters, &headers).await,
        Err(line) => refusal(StatusCode::BAD_REQUEST, line),
    }
}

/// Answers a native request, on whichever path it came.
pub async fn answer(app: &AppState, parameters: &Parameters, headers: &HeaderMap) -> Response {
    let order = match order(app, parameters) {
        Ok(order) => order,
        Err(line) => return refusal(StatusCode::BAD_REQUEST, line),
    };
    answer::tile(app, order, parameters.get("REVISION"), headers)
        .await
        .unwrap_or_else(|error| refusal(status_of(&error), error.to_string()))
}

fn order(app: &AppState, parameters: &Parameters) -> Result<Order, String> {
    let name = parameters.require("T", "elevation")?;
    let layer = Layer::from_name(name).filter(|&layer| has_layer(&app.scene, layer)).ok_or_else(|| {
        let names = layer_names(&app.scene);
        let near = suggestion(name, names.iter().copied());
        format!("T is \"{name}\"; this scene has the layers {}{near}", names.join(", "))
    })?;
    let kind = usize::from(!layer.is_elevation());
    let whole = |name: &str| {
        let text = parameters.require(name, "0")?;
        let digits = text.bytes().all(|byte| byte.is_ascii_digit());
        text.parse::<u32>()
            .ok()
            .filter(|_| digits)
            .ok_or_else(|| format!("{name} is \"{text}\"; it must be a whole number from 0"))
    };
    let level = whole("L")?;
    if level > DEEPEST {
        return Err(format!("L is {level}; the deepest level is {DEEPEST}"));
    }
    let degrees = parameters.get("D").map_or(Ok(DEGREES[kind]), |text| number("D", text))?;
    if !(0.01..=180.0).contains(&degrees) {
        return Err(format!("D is {degrees}; tiles of level 0 are 0.01 to 180 degrees wide"));
    }
    let limit = app.limits.maximum_width.min(app.limits.maximum_height);
    let samples = parameters.get("S").map_or(Ok(SAMPLES[kind]), |_| whole("S"))?;
    if !(1..=limit).contains(&samples) {
        return Err(format!("S is {samples}; a tile has 1 to {limit} samples along a side"));
    }
    let span = degrees / f64::from(1_u32 << level);
    let index = |name: &str, turn: f64| {
        let value = whole(name)?;
        let count = (turn / span).ceil();
        if f64::from(value) < count {
            return Ok(f64::from(value));
        }
        Err(format!("{name} is {value}; level {level} has 0 to {}", count - 1.0))
    };
    let west = -180.0 + span * index("X", 360.0)?;
    let south = -90.0 + span * index("Y", 180.0)?;
    let bounds = GeographicBox { west, south, east: west + span, north: south + span };
    let format = match parameters.get("F") {
        None if layer.is_elevation() => Format::Bil16,
        None if layer == Layer::Texture => Format::Jpeg,
        None => Format::Png,
        Some(text) => {
            Format::from_media_type(layer, text).filter(|format| *format != Format::Own).ok_or_else(|| {
                format!("F is \"{text}\"; the layer {name} comes as {}", layer.row().formats.join(", "))
            })?
        }
    };
    Ok(Order::new(layer, geographic_grid(layer, &bounds, samples, samples), format).gaps(true, [255; 3]))
}
