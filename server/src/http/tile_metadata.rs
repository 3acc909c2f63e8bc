//! What `/tiles` has, as OGC API – Tiles – Part 1 (OGC 20-057) and the Tile Matrix Set standard (OGC 17-083r4) write it:
//! `/tiles`, `/tiles/{layer}`, `/tiles/{layer}/{matrix set}`, `/tileMatrixSets`, `/tileMatrixSets/{id}`, `/conformance`.

use crate::http::answer::{document, refusal};
use crate::http::base_url::base_url;
use crate::http::layers::{extent, has_layer, layer_names, layers, maximum_level, minimum_level};
use crate::http::matrix_set::{MATRIX_SETS, MatrixSet};
use crate::http::tiles::short_name;
use crate::recipe::Format;
use crate::scene::Scene;
use crate::state::AppState;
use crate::user_error::suggestion;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use serde_json::{Value, json};
use treeline_core::layer::{Layer, LayerRow};

const JSON: &str = "application/json";
const TILING_SCHEME: &str = "http://www.opengis.net/def/rel/ogc/1.0/tiling-scheme";

/// Answers `/conformance`.
pub async fn conformance(State(app): State<AppState>, headers: HeaderMap) -> Response {
    let classes = [
        "http://www.opengis.net/spec/ogcapi-common-1/1.0/conf/core",
        "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/core",
        "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/tileset",
        "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/tilesets-list",
        "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/png",
        "http://www.opengis.net/spec/ogcapi-tiles-1/1.0/conf/jpeg",
        "http://www.opengis.net/spec/tms/2.0/conf/tilematrixset",
        "http://www.opengis.net/spec/tms/2.0/conf/json-tilematrixset",
    ];
    write(&app, &json!({ "conformsTo": classes }), &headers)
}

/// Answers `/tiles`: every layer in every set.
pub async fn all(State(app): State<AppState>, headers: HeaderMap) -> Response {
    let base = base_url(app.public_url.as_deref(), &headers);
    let sets: Vec<Value> =
        layers(&app.scene).flat_map(|row| MATRIX_SETS.map(|(_, set)| summary(row, set, &base))).collect();
    let links = json!([link("self", JSON, &format!("{base}/tiles"), "All tiles")]);
    write(&app, &json!({ "links": links, "tilesets": sets }), &headers)
}

/// Answers `/tiles/{layer}`: a layer in every set.
pub async fn of_layer(
    State(app): State<AppState>,
    Path(layer): Path<String>,
    headers: HeaderMap,
) -> Response {
    let row = match row(&app.scene, &layer) {
        Ok(row) => row,
        Err(line) => return refusal(StatusCode::NOT_FOUND, line),
    };
    let base = base_url(app.public_url.as_deref(), &headers);
    let sets: Vec<Value> = MATRIX_SETS.iter().map(|(_, set)| summary(row, *set, &base)).collect();
    let links = json!([link("self", JSON, &format!("{base}/tiles/{layer}"), row.title)]);
    write(&app, &json!({ "links": links, "tilesets": sets }), &headers)
}

/// Answers `/tiles/{layer}/{matrix set}`: where a layer's tiles are, and which of them have data.
pub async fn of_set(
    State(app): State<AppState>,
    Path((layer, set)): Path<(String, String)>,
    headers: HeaderMap,
) -> Response {
    let found = row(&app.scene, &layer).and_then(|row| Ok((row, matrix_set(&set)?)));
    let (row, set) = match found {
        Ok(found) => found,
        Err(line) => return refusal(StatusCode::NOT_FOUND, line),
    };
    let base = base_url(app.public_url.as_deref(), &headers);
    write(&app, &tile_set(&app.scene, row, set, &base), &headers)
}

/// Answers `/tileMatrixSets`.
pub async fn matrix_sets(State(app): State<AppState>, headers: HeaderMap) -> Response {
    let base = base_url(app.public_url.as_deref(), &headers);
    let sets: Vec<Value> = MATRIX_SETS
        .iter()
        .map(|(id, set)| {
            let mut value = json!({
                "id": id,
                "links": [link("self", JSON, &format!("{base}/tileMatrixSets/{id}"), id)],
            });
            if let Some(uri) = set.uri() {
                value["uri"] = uri.into();
            }
            value
        })
        .collect();
    write(&app, &json!({ "tileMatrixSets": sets }), &headers)
}

/// Answers `/tileMatrixSets/{id}`.
pub async fn matrix_set_by_id(
    State(app): State<AppState>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Response {
    match matrix_set(&id) {
        Ok(set) => write(&app, &definition(set), &headers),
        Err(line) => refusal(StatusCode::NOT_FOUND, line),
    }
}

fn write(app: &AppState, value: &Value, headers: &HeaderMap) -> Response {
    document(app, JSON, value.to_string(), headers)
}

fn row(scene: &Scene, layer: &str) -> Result<&'static LayerRow, String> {
    Layer::from_name(layer).filter(|&layer| has_layer(scene, layer)).map(Layer::row).ok_or_else(|| {
        let names = layer_names(scene);
        let near = suggestion(layer, names.iter().copied());
        format!("no layer \"{layer}\"; this scene has {}{near}", names.join(", "))
    })
}

fn matrix_set(id: &str) -> Result<MatrixSet, String> {
    MatrixSet::from_id(id).ok_or_else(|| {
        let names = MATRIX_SETS.map(|(name, _)| name);
        format!("no tile matrix set \"{id}\"; there are {}{}", names.join(", "), suggestion(id, names))
    })
}

fn link(rel: &str, media_type: &str, href: &str, title: &str) -> Value {
    json!({ "rel": rel, "type": media_type, "href": href, "title": title })
}

/// Heights are a coverage, all else is a map.
fn data_type(row: &LayerRow) -> &'static str {
    if row.layer.is_elevation() { "coverage" } else { "map" }
}

/// What lists say of a layer in a set.
fn summary(row: &LayerRow, set: MatrixSet, base: &str) -> Value {
    let mut value = json!({
        "title": format!("{} ({})", row.title, set.id()),
        "dataType": data_type(row),
        "crs": set.crs_uri(),
        "links": [
            link("self", JSON, &format!("{base}/tiles/{}/{}", row.name, set.id()), row.title),
            link(TILING_SCHEME, JSON, &format!("{base}/tileMatrixSets/{}", set.id()), set.id()),
        ],
    });
    if let Some(uri) = set.uri() {
        value["tileMatrixSetURI"] = uri.into();
    }
    value
}

fn tile_set(scene: &Scene, row: &LayerRow, set: MatrixSet, base: &str) -> Value {
    let mut value = summary(row, set, base);
    let bounds = extent(scene, row.layer).bounds;
    let items = row.formats.iter().filter_map(|name| {
        let format = Format::from_media_type(row.layer, name)?;
        (format != Format::Own || set == MatrixSet::Own).then(|| {
            let path = format!(
                "{base}/tiles/{}/{}/{{tileMatrix}}/{{tileRow}}/{{tileCol}}?f={}",
                row.name,
                set.id(),
                short_name(format)
            );
            json!({ "rel": "item", "type": name, "href": path, "templated": true, "title": row.title })
        })
    });
    if let Some(links) = value["links"].as_array_mut() {
        links.extend(items);
    }
    value["boundingBox"] = json!({
        "lowerLeft": [bounds.west, bounds.south],
        "upperRight": [bounds.east, bounds.north],
        "crs": "http://www.opengis.net/def/crs/OGC/1.3/CRS84",
    });
    value["tileMatrixSetLimits"] = levels(scene, row, set)
        .filter_map(|level| {
            let [first_row, last_row, first_column, last_column] = set.reach(level, &bounds)?;
            Some(json!({
                "tileMatrix": level.to_string(),
                "minTileRow": first_row,
                "maxTileRow": last_row,
                "minTileCol": first_column,
                "maxTileCol": last_column,
            }))
        })
        .collect();
    value
}

/// The levels of a set on which a layer shows something, from a speck to its source's last detail.
pub fn levels(scene: &Scene, row: &LayerRow, set: MatrixSet) -> std::ops::RangeInclusive<u8> {
    let least = minimum_level(&extent(scene, row.layer).bounds);
    let greatest = maximum_level(scene, row.layer).max(least);
    set.level_like(least).min(set.deepest())..=set.level_like(greatest).min(set.deepest())
}

fn definition(set: MatrixSet) -> Value {
    let matrices: Vec<Value> = (0..=set.deepest())
        .filter_map(|level| {
            let (rows, columns) = set.size(level)?;
            Some(json!({
                "id": level.to_string(),
                "scaleDenominator": set.scale_denominator(level),
                "cellSize": set.cell(level),
                "cornerOfOrigin": "topLeft",
                "pointOfOrigin": set.corner(),
                "tileWidth": set.side(),
                "tileHeight": set.side(),
                "matrixWidth": columns,
                "matrixHeight": rows,
            }))
        })
        .collect();
    let axes = if set == MatrixSet::WebMercatorQuad { ["E", "N"] } else { ["Lon", "Lat"] };
    let mut value = json!({
        "id": set.id(),
        "title": set.id(),
        "crs": set.crs_uri(),
        "orderedAxes": axes,
        "tileMatrices": matrices,
    });
    if let Some(uri) = set.uri() {
        value["uri"] = uri.into();
    }
    value
}
