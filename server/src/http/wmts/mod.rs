//! `/wmts`: OGC WMTS 1.0.0 (OGC 07-057r7), by key-value pairs and by paths.

mod capabilities;
mod exception;

use crate::http::answer;
use crate::http::base_url::base_url;
use crate::http::query::Parameters;
use crate::http::tiles;
use crate::http::wms::DEFAULT_STYLE;
use crate::state::AppState;
use axum::extract::{Path, RawQuery, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use exception::WmtsException;

/// Answers `/wmts?SERVICE=WMTS&REQUEST=…`.
pub async fn key_value_pairs(
    State(app): State<AppState>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Response {
    let answer = match Parameters::parse(&query.unwrap_or_default()) {
        Ok(parameters) => of_parameters(&app, &parameters, &headers).await,
        Err(line) => Err(WmtsException::new("NoApplicableCode", None, line)),
    };
    answer.unwrap_or_else(|exception| exception.response())
}

/// Answers `/wmts/1.0.0/WMTSCapabilities.xml`.
pub async fn rest_capabilities(State(app): State<AppState>, headers: HeaderMap) -> Response {
    capabilities::answer(&app, &base_url(app.public_url.as_deref(), &headers), &headers)
}

/// Answers `/wmts/1.0.0/{layer}/{style}/{set}/{level}/{row}/{column}.{extension}`.
pub async fn rest_tile(
    State(app): State<AppState>,
    Path((layer, style, set, level, row, column)): Path<(String, String, String, String, String, String)>,
    headers: HeaderMap,
) -> Response {
    let (column, extension) = column.rsplit_once('.').unwrap_or((&column, "png"));
    let address = [&*layer, &*set, &*level, &*row, column];
    tile(&app, address, &style, extension, None, &headers)
        .await
        .unwrap_or_else(|exception| exception.response())
}

async fn of_parameters(
    app: &AppState,
    parameters: &Parameters,
    headers: &HeaderMap,
) -> Result<Response, WmtsException> {
    let value = |name: &'static str, example: &str| {
        parameters
            .require(name, example)
            .map_err(|line| WmtsException::new("MissingParameterValue", Some(name), line))
    };
    if let Some(service) = parameters.get("SERVICE")
        && !service.eq_ignore_ascii_case("WMTS")
    {
        let line = format!("SERVICE is \"{service}\"; this is a WMTS: SERVICE=WMTS");
        return Err(WmtsException::new("InvalidParameterValue", Some("SERVICE"), line));
    }
    let request = value("REQUEST", "GetCapabilities")?;
    match request.to_ascii_lowercase().as_str() {
        "getcapabilities" => {
            Ok(capabilities::answer(app, &base_url(app.public_url.as_deref(), headers), headers))
        }
        "gettile" => {
            let address = [
                value("LAYER", "texture")?,
                value("TILEMATRIXSET", "WebMercatorQuad")?,
                value("TILEMATRIX", "10")?,
                value("TILEROW", "0")?,
                value("TILECOL", "0")?,
            ];
            let style = parameters.get("STYLE").unwrap_or(DEFAULT_STYLE);
            let format = value("FORMAT", "image/png")?;
            tile(app, address, style, format, parameters.get("REVISION"), headers).await
        }
        _ => Err(WmtsException::new(
            "OperationNotSupported",
            Some("REQUEST"),
            format!("REQUEST is \"{request}\"; there are GetCapabilities and GetTile"),
        )),
    }
}

async fn tile(
    app: &AppState,
    address: [&str; 5],
    style: &str,
    format: &str,
    revision: Option<&str>,
    headers: &HeaderMap,
) -> Result<Response, WmtsException> {
    if style != DEFAULT_STYLE {
        let line =
            format!("the style \"{style}\" is not defined; every layer has the style \"{DEFAULT_STYLE}\"");
        return Err(WmtsException::new("InvalidParameterValue", Some("STYLE"), line));
    }
    let order = tiles::order(app, address, Some(format), headers).map_err(|(status, line)| {
        let code = if status == StatusCode::NOT_FOUND && line.starts_with("level ") {
            "TileOutOfRange"
        } else {
            "InvalidParameterValue"
        };
        WmtsException::new(code, None, line)
    })?;
    answer::tile(app, order, revision, headers).await.map_err(WmtsException::from)
}
