//! GetCapabilities.

use super::exception::ServiceException;
use super::feature_info;
use super::reference_system::own_systems;
use super::version::Version;
use super::xml::escape;
use crate::http::answer;
use crate::http::layers::{extent, layers};
use crate::http::query::Parameters;
use crate::scene::Scene;
use crate::source::crs::{self, Crs};
use crate::state::App;
use axum::http::HeaderMap;
use axum::response::Response;
use std::fmt::Write as _;
use treeline_core::geodesy::web_mercator_from_geographic;
use treeline_core::layer::{Layer, LayerRow};
use treeline_core::tile::GeographicBox;

/// Answers a GetCapabilities request; `base` is how links start.
pub fn answer(
    app: &App,
    parameters: &Parameters,
    base: &str,
    headers: &HeaderMap,
) -> Result<Response, ServiceException> {
    if parameters.get("UPDATESEQUENCE") == Some(&app.scene.revision) {
        return Err(ServiceException::new(
            Some("CurrentUpdateSequence"),
            "UPDATESEQUENCE is the current one: what you have is up to date",
        ));
    }
    let link = format!("{base}/wms?");
    Ok(match Version::of_capabilities(parameters) {
        Version::V1_3_0 => answer::document("text/xml", document_1_3_0(app, &link), headers),
        Version::V1_1_1 => {
            answer::document("application/vnd.ogc.wms_xml", document_1_1_1(app, &link), headers)
        }
    })
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

fn style_elements(layer: Layer) -> String {
    styles(layer)
        .iter()
        .map(|(name, title)| format!("        <Style><Name>{name}</Name><Title>{title}</Title></Style>\n"))
        .collect()
}

fn document_1_3_0(app: &App, link: &str) -> String {
    let scene = &app.scene;
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<WMS_Capabilities version=\"1.3.0\" updateSequence=\"{}\" xmlns=\"http://www.opengis.net/wms\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" xsi:schemaLocation=\"http://www.opengis.net/wms http://schemas.opengis.net/wms/1.3.0/capabilities_1_3_0.xsd\">\n",
        escape(&scene.revision)
    );
    let title = escape(&scene.name);
    let _ = write!(
        out,
        "  <Service>\n    <Name>WMS</Name>\n    <Title>{title}</Title>\n    <OnlineResource xlink:type=\"simple\" xlink:href=\"{}\"/>\n    <LayerLimit>1</LayerLimit>\n    <MaxWidth>{}</MaxWidth>\n    <MaxHeight>{}</MaxHeight>\n  </Service>\n  <Capability>\n    <Request>\n",
        escape(link),
        app.limits.maximum_width,
        app.limits.maximum_height
    );
    out += &operation("GetCapabilities", &["text/xml"], link);
    out += &operation("GetMap", &map_formats(scene), link);
    out += &operation("GetFeatureInfo", feature_info::formats(), link);
    let _ = write!(
        out,
        "    </Request>\n    <Exception><Format>XML</Format></Exception>\n    <Layer>\n      <Title>{title}</Title>\n"
    );
    for name in super::reference_system::ReferenceSystem::names(scene) {
        let _ = writeln!(out, "      <CRS>{name}</CRS>");
    }
    out += &boxes_1_3_0(scene, &scene.height.extent().bounds);
    out += &attribution(scene);
    for row in layers(scene) {
        let _ = write!(
            out,
            "      <Layer queryable=\"1\">\n        <Name>{}</Name>\n        <Title>{}</Title>\n{}{}      </Layer>\n",
            row.name,
            escape(row.title),
            boxes_1_3_0(scene, &layer_bounds(scene, row)),
            style_elements(row.layer)
        );
    }
    out += "    </Layer>\n  </Capability>\n</WMS_Capabilities>\n";
    out
}

fn document_1_1_1(app: &App, link: &str) -> String {
    let scene = &app.scene;
    let title = escape(&scene.name);
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!DOCTYPE WMT_MS_Capabilities SYSTEM \"http://schemas.opengis.net/wms/1.1.1/capabilities_1_1_1.dtd\">\n<WMT_MS_Capabilities version=\"1.1.1\" updateSequence=\"{}\">\n  <Service>\n    <Name>OGC:WMS</Name>\n    <Title>{title}</Title>\n    <OnlineResource xmlns:xlink=\"http://www.w3.org/1999/xlink\" xlink:type=\"simple\" xlink:href=\"{}\"/>\n  </Service>\n  <Capability>\n    <Request>\n",
        escape(&scene.revision),
        escape(link)
    );
    out += &operation("GetCapabilities", &["application/vnd.ogc.wms_xml"], link);
    out += &operation("GetMap", &map_formats(scene), link);
    out += &operation("GetFeatureInfo", feature_info::formats(), link);
    let _ = write!(
        out,
        "    </Request>\n    <Exception><Format>application/vnd.ogc.se_xml</Format></Exception>\n    <Layer>\n      <Title>{title}</Title>\n"
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
            "      <Layer queryable=\"1\">\n        <Name>{}</Name>\n        <Title>{}</Title>\n{}{}      </Layer>\n",
            row.name,
            escape(row.title),
            boxes_1_1_1(scene, &layer_bounds(scene, row)),
            style_elements(row.layer)
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
