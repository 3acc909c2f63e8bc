//! `/tiles/{layer}/{matrix set}/{z}/{row}/{col}`: the same tiles by address.

use crate::http::answer::{self, refusal, status_of};
use crate::http::layers::{has_layer, layer_names};
use crate::http::matrix_set::{MATRIX_SETS, MatrixSet, OWN_MATRIX_SET};
use crate::http::order::Order;
use crate::http::query::Parameters;
use crate::recipe::Format;
use crate::state::AppState;
use crate::user_error::suggestion;
use axum::extract::{Path, RawQuery, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::Response;
use treeline_core::layer::{Layer, LayerRow};

/// Answers a tile's address.
pub async fn tile(
    State(app): State<AppState>,
    Path((layer, set, level, row, column)): Path<(String, String, String, String, String)>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Response {
    let parameters = match Parameters::parse(&query.unwrap_or_default()) {
        Ok(parameters) => parameters,
        Err(line) => return refusal(StatusCode::BAD_REQUEST, line),
    };
    let address = [&*layer, &*set, &*level, &*row, &*column];
    let order = match order(&app, address, parameters.get("F"), &headers) {
        Ok(order) => order,
        Err((status, line)) => return refusal(status, line),
    };
    let mut response = answer::tile(&app, order, parameters.get("REVISION"), &headers)
        .await
        .unwrap_or_else(|error| refusal(status_of(&error), error.to_string()));
    if parameters.get("F").is_none() {
        response.headers_mut().append(header::VARY, header::HeaderValue::from_static("accept"));
    }
    response
}

/// What a tile's address comes down to: layer, matrix set, level, row, column; `f` is the format, else Accept says it.
pub fn order(
    app: &AppState,
    [layer, set, level, row, column]: [&str; 5],
    f: Option<&str>,
    headers: &HeaderMap,
) -> Result<Order, (StatusCode, String)> {
    let missing = |line: String| (StatusCode::NOT_FOUND, line);
    let layer = Layer::from_name(layer).filter(|&layer| has_layer(&app.scene, layer)).ok_or_else(|| {
        let names = layer_names(&app.scene);
        let near = suggestion(layer, names.iter().copied());
        missing(format!("no layer \"{layer}\"; this scene has {}{near}", names.join(", ")))
    })?;
    let names = MATRIX_SETS.map(|(name, _)| name);
    let set = MatrixSet::from_id(set).ok_or_else(|| {
        let near = suggestion(set, names);
        missing(format!("no tile matrix set \"{set}\"; there are {}{near}", names.join(", ")))
    })?;
    let number = |name: &str, text: &str| {
        let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        digits.then(|| text.parse::<u32>().ok()).flatten().ok_or_else(|| {
            (StatusCode::BAD_REQUEST, format!("the {name} \"{text}\" is no whole number; an address is /tiles/layer/matrix set/level/row/column"))
        })
    };
    let (level, row, column) = (number("level", level)?, number("row", row)?, number("column", column)?);
    let Some((depth, (rows, columns))) =
        u8::try_from(level).ok().and_then(|depth| Some((depth, set.size(depth)?)))
    else {
        return Err(missing(format!("the matrix set has no level {level}")));
    };
    if row >= rows || column >= columns {
        return Err(missing(format!(
            "level {level} has rows 0 to {} and columns 0 to {}; row {row}, column {column} is not among them (the row comes first)",
            rows - 1,
            columns - 1
        )));
    }
    let format = format(layer.row(), f, headers)?;
    if format == Format::Own && set != MatrixSet::Own {
        return Err((
            StatusCode::BAD_REQUEST,
            format!("{} is for the matrix set {OWN_MATRIX_SET} only", layer.row().client_format),
        ));
    }
    Ok(Order::new(layer, set.grid(layer.row(), format, depth, row, column), format).gaps(true, [255; 3]))
}

/// Short names for `?f=`; full media types are understood as well.
pub fn short_name(format: Format) -> &'static str {
    match format {
        Format::Png => "png",
        Format::Jpeg => "jpeg",
        Format::WebP => "webp",
        Format::Bil16 => "bil16",
        Format::Bil32 => "bil32",
        Format::XBil32 => "x-bil",
        Format::GeoTiff => "tiff",
        Format::Own => "treeline",
    }
}

/// The format that `?f=` names, else the one of the layer's that Accept likes best; the layer's
/// order decides between equals.
fn format(row: &LayerRow, f: Option<&str>, headers: &HeaderMap) -> Result<Format, (StatusCode, String)> {
    let formats = || row.formats.iter().filter_map(|name| Format::from_media_type(row.layer, name));
    let known = || {
        let names: Vec<String> = formats()
            .map(|format| format!("{} ({})", short_name(format), format.media_type(row.layer)))
            .collect();
        names.join(", ")
    };
    if let Some(f) = f {
        let asked = if f.eq_ignore_ascii_case("jpg") { "jpeg".to_owned() } else { f.to_ascii_lowercase() };
        return formats()
            .find(|&format| asked == short_name(format) || asked == format.media_type(row.layer))
            .ok_or_else(|| {
                let line = format!("f is \"{f}\"; the layer {} comes as {}", row.name, known());
                (StatusCode::BAD_REQUEST, line)
            });
    }
    let accept: Vec<&str> =
        headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok()).collect();
    let accept = accept.join(",");
    let mut best: Option<(f32, Format)> = None;
    for format in formats() {
        let quality =
            if accept.trim().is_empty() { 1.0 } else { acceptance(&accept, format.media_type(row.layer)) };
        if quality > best.map_or(0.0, |(quality, _)| quality) {
            best = Some((quality, format));
        }
    }
    best.map(|(_, format)| format).ok_or_else(|| {
        let line = format!("Accept asks for \"{accept}\"; the layer {} comes as {}", row.name, known());
        (StatusCode::NOT_ACCEPTABLE, line)
    })
}

/// How much an Accept header likes a media type: the most specific range that matches decides.
fn acceptance(accept: &str, format: &str) -> f32 {
    let bare = format.split(';').next().unwrap_or(format);
    let family = bare.split('/').next().unwrap_or(bare);
    let mut found = (0, 0.0);
    for range in accept.split(',') {
        let mut parts = range.split(';').map(str::trim);
        let name = parts.next().unwrap_or_default().to_ascii_lowercase();
        let quality = parts
            .find_map(|part| part.strip_prefix("q=").or_else(|| part.strip_prefix("Q=")))
            .map_or(1.0, |text| text.parse::<f32>().unwrap_or(0.0).clamp(0.0, 1.0));
        let rank = match name.as_str() {
            "*/*" => 1,
            name if name.strip_suffix("/*") == Some(family) => 2,
            name if name == bare => 3,
            _ => continue,
        };
        if rank > found.0 {
            found = (rank, quality);
        }
    }
    found.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accept_prefers_the_specific_and_the_layers_order() {
        let of = |accept: &str| {
            let headers = [(header::ACCEPT, accept.parse().unwrap())].into_iter().collect();
            format(Layer::Texture.row(), None, &headers).ok()
        };
        assert_eq!(of("*/*"), Some(Format::Png));
        assert_eq!(of("image/avif,image/webp,image/*;q=0.8"), Some(Format::WebP));
        assert_eq!(of("image/*;q=0.5, image/png;q=0"), Some(Format::Jpeg));
        assert_eq!(of("application/json"), None);
        assert_eq!(of(""), Some(Format::Png));
    }

    #[test]
    fn short_names_and_media_types() {
        let of = |f: &str| format(Layer::Elevation.row(), Some(f), &HeaderMap::new()).ok();
        assert_eq!(of("png"), Some(Format::Png));
        assert_eq!(of("BIL16"), Some(Format::Bil16));
        assert_eq!(of("image/x-bil;bits=32"), Some(Format::XBil32));
        assert_eq!(of("treeline"), Some(Format::Own));
        assert_eq!(of("webp"), None);
    }
}
