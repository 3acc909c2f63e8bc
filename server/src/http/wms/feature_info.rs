//! GetFeatureInfo: height, canopy and land-cover class at a pixel.

use super::exception::ServiceException;
use super::reference_system::{ReferenceSystem, RequestBox, size};
use super::shown;
use super::version::Version;
use super::xml::escape;
use crate::cache::{MakeError, Overload};
use crate::http::answer::ASK_AGAIN;
use crate::http::make::make_error;
use crate::http::query::Parameters;
use crate::recipe::{PointInfo, point};
use crate::state::AppState;
use axum::http::header;
use axum::response::{IntoResponse, Response};

const INFO_FORMATS: [&str; 3] = ["application/json", "text/plain", "text/html"];

/// Media types in which answers come; the first is the default.
pub fn formats() -> &'static [&'static str] {
    &INFO_FORMATS
}

/// Answers a GetFeatureInfo request.
pub async fn answer(
    app: &AppState,
    parameters: &Parameters,
    version: Version,
) -> Result<Response, ServiceException> {
    let asked = shown::layers(app, parameters, "QUERY_LAYERS")?;
    // The map that was pointed at; clients that name only what they ask about mean a map of that.
    if parameters.has("LAYERS") {
        let map = shown::layers(app, parameters, "LAYERS")?;
        if let Some(other) = asked.iter().find(|layer| !map.contains(layer)) {
            return Err(ServiceException::new(
                Some("LayerNotDefined"),
                format!("QUERY_LAYERS names \"{}\", which is not among LAYERS", other.name()),
            ));
        }
    }
    if let Some(count) = parameters.get("FEATURE_COUNT")
        && count.trim().parse::<u32>().is_err()
    {
        return Err(ServiceException::invalid(format!(
            "FEATURE_COUNT is \"{count}\"; it must be a whole number"
        )));
    }
    let format = match parameters.get("INFO_FORMAT") {
        None => INFO_FORMATS[0],
        Some(asked) => {
            INFO_FORMATS.into_iter().find(|format| format.eq_ignore_ascii_case(asked)).ok_or_else(|| {
                ServiceException::new(
                    Some("InvalidFormat"),
                    format!("INFO_FORMAT is \"{asked}\"; there are {}", INFO_FORMATS.join(", ")),
                )
            })?
        }
    };
    let system = ReferenceSystem::of_request(&app.scene, parameters, version)?;
    let request = RequestBox::of_request(parameters, &system)?;
    let (width, height) = size(parameters, &app.limits)?;
    let names = if version == Version::V1_3_0 { ["I", "J"] } else { ["X", "Y"] };
    let column = pixel(parameters, names[0], width)?;
    let row = pixel(parameters, names[1], height)?;
    let x = request.west + (f64::from(column) + 0.5) * (request.east - request.west) / f64::from(width);
    let y = request.north - (f64::from(row) + 0.5) * (request.north - request.south) / f64::from(height);
    let Some((longitude, latitude)) = system.geographic(x, y) else {
        return Err(ServiceException::new(
            Some("InvalidPoint"),
            format!(
                "the pixel at {}={column}, {}={row} lies outside of where the reference system holds; move BBOX",
                names[0], names[1]
            ),
        ));
    };
    let scene = app.scene.clone();
    let found = app
        .cache
        .workers()
        .run(move || point(&scene, longitude, latitude).map_err(make_error))
        .await
        .map_err(|error| match error {
            Overload::QueueFull => MakeError::Busy,
            Overload::Panicked => MakeError::Panicked,
        })??;
    let body = match format {
        "text/plain" => plain(longitude, latitude, &found),
        "text/html" => html(longitude, latitude, &found),
        _ => json(longitude, latitude, &found),
    };
    let headers = [(header::CONTENT_TYPE, format), (header::CACHE_CONTROL, ASK_AGAIN)];
    Ok((headers, body).into_response())
}

fn pixel(parameters: &Parameters, name: &str, size: u32) -> Result<u32, ServiceException> {
    let text = parameters.require(name, "0")?;
    text.trim().parse::<u32>().ok().filter(|&value| value < size).ok_or_else(|| {
        ServiceException::new(
            Some("InvalidPoint"),
            format!("{name} is \"{text}\"; it must be a whole number from 0 to {}", size - 1),
        )
    })
}

fn json(longitude: f64, latitude: f64, found: &PointInfo) -> String {
    serde_json::json!({
        "longitude": longitude,
        "latitude": latitude,
        "elevation": found.terrain,
        "canopy_height": found.canopy,
        "combined_elevation": found.terrain.map(|terrain| terrain + found.canopy.unwrap_or(0.0)),
        "land_cover": found.class,
        "species": found.species,
    })
    .to_string()
        + "\n"
}

/// Names and values for people.
fn rows(longitude: f64, latitude: f64, found: &PointInfo) -> Vec<(&'static str, String)> {
    let metres = |value: Option<f64>| value.map_or("no data".to_owned(), |value| format!("{value:.2} m"));
    let mut rows = vec![
        ("longitude", longitude.to_string()),
        ("latitude", latitude.to_string()),
        ("elevation", metres(found.terrain)),
    ];
    if let Some(class) = found.class {
        let species = found.species.as_deref().unwrap_or("no trees");
        rows.push(("canopy height", metres(found.canopy)));
        rows.push(("land cover", format!("{class} ({species})")));
    }
    rows
}

fn plain(longitude: f64, latitude: f64, found: &PointInfo) -> String {
    rows(longitude, latitude, found).iter().map(|(name, value)| format!("{name}: {value}\n")).collect()
}

fn html(longitude: f64, latitude: f64, found: &PointInfo) -> String {
    let rows: String = rows(longitude, latitude, found)
        .iter()
        .map(|(name, value)| format!("<tr><th scope=\"row\">{name}</th><td>{}</td></tr>\n", escape(value)))
        .collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head><meta charset=\"utf-8\"><title>What is here</title></head>\n<body>\n<table>\n{rows}</table>\n</body>\n</html>\n"
    )
}
