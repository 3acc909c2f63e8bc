//! `/wms`: OGC WMS 1.1.1 and 1.3.0.

mod capabilities;
mod exception;
mod feature_info;
mod get_map;
mod reference_system;
mod version;
mod xml;

use crate::http::base_url::base_url;
use crate::http::query::Parameters;
use crate::state::AppState;
use axum::extract::{RawQuery, State};
use axum::http::HeaderMap;
use axum::response::Response;
use exception::ServiceException;
use version::Version;

/// Answers a request to `/wms`.
pub async fn wms(State(app): State<AppState>, RawQuery(query): RawQuery, headers: HeaderMap) -> Response {
    let parameters = match Parameters::parse(&query.unwrap_or_default()) {
        Ok(parameters) => parameters,
        Err(line) => return ServiceException::invalid(line).response(Version::V1_3_0),
    };
    let version = Version::of_request(&parameters);
    answer(&app, &parameters, version.as_ref().ok().copied(), &headers)
        .await
        .unwrap_or_else(|exception| exception.response(version.unwrap_or(Version::V1_3_0)))
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
            capabilities::answer(app, parameters, &base_url(app.public_url.as_deref(), headers), headers)
        }
        "getmap" | "map" => get_map::answer(app, parameters, spoken()?, headers).await,
        "getfeatureinfo" | "feature_info" => feature_info::answer(app, parameters, spoken()?).await,
        _ => Err(ServiceException::new(
            Some("OperationNotSupported"),
            format!("REQUEST is \"{request}\"; there are GetCapabilities, GetMap and GetFeatureInfo"),
        )),
    }
}
