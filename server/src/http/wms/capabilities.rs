//! GetCapabilities.

use super::feature_info;
use super::reference_system::own_systems;
use super::report::Report;
use super::version::Version;
use super::xml::escape;
use crate::http::answer;
use crate::http::layers::{extent, layers};
use crate::http::query::Parameters;
use crate::recipe::{legend, tallest_tree_metres};
use crate::scene::Scene;
use crate::source::crs::{self, Crs};
use crate::state::App;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::Response;
use std::fmt::Write as _;
use treeline_core::geodesy::web_mercator_from_geographic;
use treeline_core::layer::{Layer, LayerRow};
use treeline_core::tile::GeographicBox;

/// Answers a GetCapabilities request; `base` is how links start.
///
/// There is no update sequence: revisions of the data have no order, and the ETag does its work.
pub fn answer(app: &App, parameters: &Parameters, base: &str, headers: &HeaderMap) -> Response {
    let link = format!("{base}/wms?");
    let extremes = asks_for_extremes(headers).then(|| app.scene.height.range());
    let mut response = match Version::of_capabilities(parameters) {
        Version::V1_3_0 => answer::document(app, "text/xml", document_1_3_0(app, &link, extremes), headers),
        Version::V1_1_1 => answer::document(
            app,
            "application/vnd.ogc.wms_xml",
            document_1_1_1(app, &link, extremes),
            headers,
        ),
    };
    response.headers_mut().append(header::VARY, HeaderValue::from_static("user-agent"));
    response
}

/// Whether a client may be World Wind Java, which reads a layer's `ExtremeElevations`. No schema has that element: only
/// such a client finds it, and everybody else a valid document.
fn asks_for_extremes(headers: &HeaderMap) -> bool {
    let agent = headers.get(header::USER_AGENT).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let agent = agent.to_ascii_lowercase().replace(' ', "");
    agent.starts_with("java/") || agent.contains("worldwind")
}

/// Least and greatest height, where they are asked for and the layer is made of heights.
fn extreme_elevations(extremes: Option<(f32, f32)>, layer: Layer, tallest: f64) -> String {
    match extremes {
        Some((least, greatest)) if layer.is_elevation() && least <= greatest => {
            let above = if layer == Layer::CombinedElevation { tallest } else { 0.0 };
            format!(
                "        <ExtremeElevations min=\"{}\" max=\"{}\"/>\n",
                least.floor(),
                (f64::from(greatest) + above).ceil()
            )
        }
        _ => String::new(),
    }
}

/// All media types of maps, each once, image/png first.
fn map_formats(scene: &Scene) -> Vec<&'static str> {
    let mut formats = vec!["image/png"];
    for format in layers(scene).flat_map(|row| row.formats) {
        if !formats.contains(format) {
            formats.push(format);
        }
    }
    formats
}

fn format_elements(formats: &[&str]) -> String {
    formats.iter().map(|format| format!("<Format>{}</Format>", escape(format))).collect()
}

fn operation(name: &str, formats: &[&str], link: &str) -> String {
    format!(
        "      <{name}>{}<DCPType><HTTP><Get><OnlineResource xmlns:xlink=\"http://www.w3.org/1999/xlink\" xlink:type=\"simple\" xlink:href=\"{}\"/></Get></HTTP></DCPType></{name}>\n",
        format_elements(formats),
        escape(link)
    )
}

/// Name, title and abstract of a layer's styles.
fn styles(layer: Layer) -> &'static [(&'static str, &'static str)] {
    match layer {
        Layer::Texture => &[
            ("default", "The photo alone"),
            ("filled", "The photo, and the relief's colours where it has nothing"),
        ],
        Layer::Lcc => &[("default", "Colours of the classes")],
        Layer::Elevation | Layer::CombinedElevation => &[("default", "Shaded relief")],
    }
}

fn attribution(scene: &Scene) -> String {
    if scene.attribution.is_empty() {
        return String::new();
    }
    format!("      <Attribution><Title>{}</Title></Attribution>\n", escape(&scene.attribution.join("; ")))
}

fn style_elements(scene: &Scene, layer: Layer, link: &str) -> String {
    styles(layer)
        .iter()
        .map(|(name, title)| {
            format!(
                "        <Style><Name>{name}</Name><Title>{title}</Title>{}</Style>\n",
                legend_url(scene, layer, name, link)
            )
        })
        .collect()
}

fn legend_url(scene: &Scene, layer: Layer, style: &str, link: &str) -> String {
    if !legend::has_legend(scene, layer) {
        return String::new();
    }
    let [width, height] = legend::size(scene, layer);
    let query = format!(
        "SERVICE=WMS&VERSION=1.3.0&REQUEST=GetLegendGraphic&LAYER={}&STYLE={style}&FORMAT=image/png",
        layer.name()
    );
    format!(
        "<LegendURL width=\"{width}\" height=\"{height}\"><Format>image/png</Format><OnlineResource xmlns:xlink=\"http://www.w3.org/1999/xlink\" xlink:type=\"simple\" xlink:href=\"{}\"/></LegendURL>",
        escape(&format!("{link}{query}"))
    )
}

fn exception_element(version: Version) -> String {
    format!("    <Exception>{}</Exception>\n", format_elements(&Report::names(version)))
}

fn document_1_3_0(app: &App, link: &str, extremes: Option<(f32, f32)>) -> String {
    let scene = &app.scene;
    let mut out = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<WMS_Capabilities version=\"1.3.0\" xmlns=\"http://www.opengis.net/wms\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" xsi:schemaLocation=\"http://www.opengis.net/wms http://schemas.opengis.net/wms/1.3.0/capabilities_1_3_0.xsd\">\n",
    );
    let title = escape(&scene.name);
    let _ = write!(
        out,
        "  <Service>\n    <Name>WMS</Name>\n    <Title>{title}</Title>\n    <OnlineResource xlink:type=\"simple\" xlink:href=\"{}\"/>\n    <LayerLimit>{}</LayerLimit>\n    <MaxWidth>{}</MaxWidth>\n    <MaxHeight>{}</MaxHeight>\n  </Service>\n  <Capability>\n    <Request>\n",
        escape(link),
        app.limits.maximum_layers,
        app.limits.maximum_width,
        app.limits.maximum_height
    );
    out += &operation("GetCapabilities", &["text/xml"], link);
    out += &operation("GetMap", &map_formats(scene), link);
    out += &operation("GetFeatureInfo", feature_info::formats(), link);
    let _ = write!(
        out,
        "    </Request>\n{}    <Layer>\n      <Title>{title}</Title>\n",
        exception_element(Version::V1_3_0)
    );
    for name in super::reference_system::ReferenceSystem::names(scene) {
        let _ = writeln!(out, "      <CRS>{name}</CRS>");
    }
    out += &boxes_1_3_0(scene, &scene.height.extent().bounds);
    out += &attribution(scene);
    for row in layers(scene) {
        let _ = write!(
            out,
            "      <Layer queryable=\"1\">\n        <Name>{}</Name>\n        <Title>{}</Title>\n{}{}{}      </Layer>\n",
            row.name,
            escape(row.title),
            boxes_1_3_0(scene, &layer_bounds(scene, row)),
            style_elements(scene, row.layer, link),
            extreme_elevations(extremes, row.layer, tallest_tree_metres(scene))
        );
    }
    out += "    </Layer>\n  </Capability>\n</WMS_Capabilities>\n";
    out
}

fn document_1_1_1(app: &App, link: &str, extremes: Option<(f32, f32)>) -> String {
    let scene = &app.scene;
    let title = escape(&scene.name);
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!DOCTYPE WMT_MS_Capabilities SYSTEM \"http://schemas.opengis.net/wms/1.1.1/capabilities_1_1_1.dtd\">\n<WMT_MS_Capabilities version=\"1.1.1\">\n  <Service>\n    <Name>OGC:WMS</Name>\n    <Title>{title}</Title>\n    <OnlineResource xmlns:xlink=\"http://www.w3.org/1999/xlink\" xlink:type=\"simple\" xlink:href=\"{}\"/>\n  </Service>\n  <Capability>\n    <Request>\n",
        escape(link)
    );
    out += &operation("GetCapabilities", &["application/vnd.ogc.wms_xml"], link);
    out += &operation("GetMap", &map_formats(scene), link);
    out += &operation("GetFeatureInfo", feature_info::formats(), link);
    out += &operation("GetLegendGraphic", &["image/png"], link);
    let _ = write!(
        out,
        "    </Request>\n{}    <Layer>\n      <Title>{title}</Title>\n",
        exception_element(Version::V1_1_1)
    );
    // CRS:84 is a name of 1.3.0; here EPSG:4326 has longitude first anyway.
    for name in super::reference_system::ReferenceSystem::names(scene).iter().skip(1) {
        let _ = writeln!(out, "      <SRS>{name}</SRS>");
    }
    out += &boxes_1_1_1(scene, &scene.height.extent().bounds);
    out += &attribution(scene);
    for row in layers(scene) {
        let _ = write!(
            out,
            "      <Layer queryable=\"1\">\n        <Name>{}</Name>\n        <Title>{}</Title>\n{}{}{}      </Layer>\n",
            row.name,
            escape(row.title),
            boxes_1_1_1(scene, &layer_bounds(scene, row)),
            style_elements(scene, row.layer, link),
            extreme_elevations(extremes, row.layer, tallest_tree_metres(scene))
        );
    }
    out += "    </Layer>\n  </Capability>\n</WMT_MS_Capabilities>\n";
    out
}

fn layer_bounds(scene: &Scene, row: &LayerRow) -> GeographicBox {
    extent(scene, row.layer).bounds
}

/// The box with longitudes within ±180, as the standard's geographic box wants them: the whole turn
/// where it crosses the antimeridian.
fn within_a_turn(bounds: &GeographicBox) -> GeographicBox {
    let latitudes = |value: f64| value.clamp(-90.0, 90.0);
    let (south, north) = (latitudes(bounds.south), latitudes(bounds.north));
    if bounds.west >= -180.0 && bounds.east <= 180.0 {
        return GeographicBox { south, north, ..*bounds };
    }
    GeographicBox { west: -180.0, south, east: 180.0, north }
}

fn boxes_1_3_0(scene: &Scene, bounds: &GeographicBox) -> String {
    let turn = within_a_turn(bounds);
    let mut out = format!(
        "        <EX_GeographicBoundingBox><westBoundLongitude>{}</westBoundLongitude><eastBoundLongitude>{}</eastBoundLongitude><southBoundLatitude>{}</southBoundLatitude><northBoundLatitude>{}</northBoundLatitude></EX_GeographicBoundingBox>\n",
        turn.west, turn.east, turn.south, turn.north
    );
    out += &bounding_box("CRS", "CRS:84", [bounds.west, bounds.south, bounds.east, bounds.north]);
    out += &bounding_box("CRS", "EPSG:4326", [bounds.south, bounds.west, bounds.north, bounds.east]);
    out += &bounding_box("CRS", "EPSG:3857", web_mercator(bounds));
    for epsg in own_systems(scene) {
        if let Some([west, south, east, north]) = extent_in(epsg, bounds) {
            let ordered = if crs::northing_first(epsg) {
                [south, west, north, east]
            } else {
                [west, south, east, north]
            };
            out += &bounding_box("CRS", &format!("EPSG:{epsg}"), ordered);
        }
    }
    out
}

fn boxes_1_1_1(scene: &Scene, bounds: &GeographicBox) -> String {
    let turn = within_a_turn(bounds);
    let mut out = format!(
        "        <LatLonBoundingBox minx=\"{}\" miny=\"{}\" maxx=\"{}\" maxy=\"{}\"/>\n",
        turn.west, turn.south, turn.east, turn.north
    );
    out += &bounding_box("SRS", "EPSG:4326", [bounds.west, bounds.south, bounds.east, bounds.north]);
    out += &bounding_box("SRS", "EPSG:3857", web_mercator(bounds));
    for epsg in own_systems(scene) {
        if let Some(numbers) = extent_in(epsg, bounds) {
            out += &bounding_box("SRS", &format!("EPSG:{epsg}"), numbers);
        }
    }
    out
}

fn bounding_box(attribute: &str, name: &str, [a, b, c, d]: [f64; 4]) -> String {
    format!(
        "        <BoundingBox {attribute}=\"{name}\" minx=\"{a}\" miny=\"{b}\" maxx=\"{c}\" maxy=\"{d}\"/>\n"
    )
}

fn web_mercator(bounds: &GeographicBox) -> [f64; 4] {
    let (west, south) = web_mercator_from_geographic(bounds.west, bounds.south);
    let (east, north) = web_mercator_from_geographic(bounds.east, bounds.north);
    [west, south, east, north]
}

/// West, south, east and north of a geographic box in a projected system: the box round its edge,
/// taken at many points because edges bend.
fn extent_in(epsg: u32, bounds: &GeographicBox) -> Option<[f64; 4]> {
    let crs = Crs::from_epsg(epsg).ok()?;
    let steps = 32;
    let mut found: Option<[f64; 4]> = None;
    for step in 0..=steps {
        let along = f64::from(step) / f64::from(steps);
        let longitude = bounds.west + along * (bounds.east - bounds.west);
        let latitude = bounds.south + along * (bounds.north - bounds.south);
        for (longitude, latitude) in [
            (longitude, bounds.south),
            (longitude, bounds.north),
            (bounds.west, latitude),
            (bounds.east, latitude),
        ] {
            let Ok((x, y)) = crs.from_geographic(longitude, latitude) else { continue };
            if x.is_finite() && y.is_finite() {
                let [west, south, east, north] = found.unwrap_or([x, y, x, y]);
                found = Some([west.min(x), south.min(y), east.max(x), north.max(y)]);
            }
        }
    }
    found
}
