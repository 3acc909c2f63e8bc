//! `/wms`: OGC WMS 1.1.1 and 1.3.0.

mod capabilities;
mod exception;
mod feature_info;
mod get_map;
mod legend;
mod reference_system;
mod report;
mod shown;
mod version;
mod xml;

use crate::http::base_url::base_url;
use crate::http::query::Parameters;
use crate::http::world_wind;
use crate::state::AppState;
use axum::extract::{RawQuery, State};
use axum::http::HeaderMap;
use axum::response::Response;
use exception::ServiceException;
pub use shown::DEFAULT_STYLE;
use version::Version;
pub use xml::escape;

/// Answers a request to `/wms`.
pub async fn wms(State(app): State<AppState>, RawQuery(query): RawQuery, headers: HeaderMap) -> Response {
    let parameters = match Parameters::parse(&query.unwrap_or_default()) {
        Ok(parameters) => parameters,
        Err(line) => return ServiceException::invalid(line).response(Version::V1_3_0),
    };
    if world_wind::is_native(&parameters) {
        return world_wind::answer(&app, &parameters, &headers).await;
    }
    let version = Version::of_request(&parameters);
    match answer(&app, &parameters, version.as_ref().ok().copied(), &headers).await {
        Ok(response) => response,
        Err(exception) => report::picture(&app, &exception, &parameters)
            .await
            .unwrap_or_else(|| exception.response(version.unwrap_or(Version::V1_3_0))),
    }
}

async fn answer(
    app: &AppState,
    parameters: &Parameters,
    version: Option<Version>,
    headers: &HeaderMap,
) -> Result<Response, ServiceException> {
    let request = parameters.require("REQUEST", "GetCapabilities")?;
    if let Some(service) = parameters.get("SERVICE")
        && !service.eq_ignore_ascii_case("WMS")
    {
        return Err(ServiceException::invalid(format!(
            "SERVICE is \"{service}\"; this is a WMS: SERVICE=WMS"
        )));
    }
    // For GetMap and GetFeatureInfo the version decides about axes: it must be one that we speak.
    let spoken = || {
        version.ok_or_else(|| {
            let given = parameters.get("VERSION").unwrap_or_default();
            ServiceException::invalid(format!(
                "VERSION is \"{given}\"; ask with VERSION=1.3.0 or VERSION=1.1.1"
            ))
        })
    };
    match request.to_ascii_lowercase().as_str() {
        "getcapabilities" | "capabilities" => {
            let base = base_url(app.public_url.as_deref(), headers);
            Ok(capabilities::answer(app, parameters, &base, headers))
        }
        "getmap" | "map" => {
            report::Report::of_request(parameters)?;
            get_map::answer(app, parameters, spoken()?, headers).await
        }
        "getlegendgraphic" => legend::answer(app, parameters, headers).await,
        "getfeatureinfo" | "feature_info" => feature_info::answer(app, parameters, spoken()?).await,
        _ => Err(ServiceException::new(
            Some("OperationNotSupported"),
            format!(
                "REQUEST is \"{request}\"; there are GetCapabilities, GetMap, GetFeatureInfo and GetLegendGraphic"
            ),
        )),
    }
}
