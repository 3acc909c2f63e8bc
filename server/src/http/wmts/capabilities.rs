//! The WMTS capabilities document.

use crate::http::answer;
use crate::http::layers::{extent, layers};
use crate::http::matrix_set::{MATRIX_SETS, MatrixSet};
use crate::http::tile_metadata::levels;
use crate::http::tiles::short_name;
use crate::http::wms::{DEFAULT_STYLE, escape};
use crate::recipe::Format;
use crate::scene::Scene;
use crate::state::App;
use axum::http::HeaderMap;
use axum::response::Response;
use std::fmt::Write as _;
use treeline_core::layer::LayerRow;

/// Answers with the document; `base` is how links start.
pub fn answer(app: &App, base: &str, headers: &HeaderMap) -> Response {
    answer::document(app, "text/xml", document(&app.scene, base), headers)
}

fn document(scene: &Scene, base: &str) -> String {
    let base = escape(base);
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Capabilities xmlns=\"http://www.opengis.net/wmts/1.0\" xmlns:ows=\"http://www.opengis.net/ows/1.1\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" xsi:schemaLocation=\"http://www.opengis.net/wmts/1.0 http://schemas.opengis.net/wmts/1.0/wmtsGetCapabilities_response.xsd\" version=\"1.0.0\">\n  <ows:ServiceIdentification>\n    <ows:Title>{}</ows:Title>\n    <ows:ServiceType>OGC WMTS</ows:ServiceType>\n    <ows:ServiceTypeVersion>1.0.0</ows:ServiceTypeVersion>\n  </ows:ServiceIdentification>\n  <ows:OperationsMetadata>\n",
        escape(&scene.name)
    );
    for operation in ["GetCapabilities", "GetTile"] {
        let _ = writeln!(
            out,
            "    <ows:Operation name=\"{operation}\"><ows:DCP><ows:HTTP><ows:Get xlink:href=\"{base}/wmts?\"><ows:Constraint name=\"GetEncoding\"><ows:AllowedValues><ows:Value>KVP</ows:Value></ows:AllowedValues></ows:Constraint></ows:Get></ows:HTTP></ows:DCP></ows:Operation>"
        );
    }
    out += "  </ows:OperationsMetadata>\n  <Contents>\n";
    for row in layers(scene) {
        layer(scene, row, &base, &mut out);
    }
    for (_, set) in MATRIX_SETS {
        matrix_set(set, &mut out);
    }
    let _ = write!(
        out,
        "  </Contents>\n  <ServiceMetadataURL xlink:href=\"{base}/wmts/1.0.0/WMTSCapabilities.xml\"/>\n</Capabilities>\n"
    );
    out
}

/// The formats of a layer that its tiles of the standard sets have, too.
fn formats(row: &LayerRow) -> impl Iterator<Item = (Format, &'static str)> + '_ {
    row.formats.iter().filter_map(|name| {
        let format = Format::from_media_type(row.layer, name)?;
        (format != Format::Own).then_some((format, *name))
    })
}

fn layer(scene: &Scene, row: &LayerRow, base: &str, out: &mut String) {
    let bounds = extent(scene, row.layer).bounds;
    // The standard wants a box within one turn.
    let (west, east) = if bounds.west < -180.0 || bounds.east > 180.0 {
        (-180.0, 180.0)
    } else {
        (bounds.west, bounds.east)
    };
    let _ = write!(
        out,
        "    <Layer>\n      <ows:Title>{}</ows:Title>\n      <ows:WGS84BoundingBox><ows:LowerCorner>{west} {}</ows:LowerCorner><ows:UpperCorner>{east} {}</ows:UpperCorner></ows:WGS84BoundingBox>\n      <ows:Identifier>{}</ows:Identifier>\n      <Style isDefault=\"true\"><ows:Identifier>{DEFAULT_STYLE}</ows:Identifier></Style>\n",
        escape(row.title),
        bounds.south,
        bounds.north,
        row.name
    );
    for (_, name) in formats(row) {
        let _ = writeln!(out, "      <Format>{}</Format>", escape(name));
    }
    for (id, set) in MATRIX_SETS {
        let _ = writeln!(
            out,
            "      <TileMatrixSetLink><TileMatrixSet>{id}</TileMatrixSet><TileMatrixSetLimits>"
        );
        for level in levels(scene, row, set) {
            let Some([first_row, last_row, first_column, last_column]) = set.reach(level, &bounds) else {
                continue;
            };
            let _ = writeln!(
                out,
                "        <TileMatrixLimits><TileMatrix>{level}</TileMatrix><MinTileRow>{first_row}</MinTileRow><MaxTileRow>{last_row}</MaxTileRow><MinTileCol>{first_column}</MinTileCol><MaxTileCol>{last_column}</MaxTileCol></TileMatrixLimits>"
            );
        }
        out.push_str("      </TileMatrixSetLimits></TileMatrixSetLink>\n");
    }
    for (format, name) in formats(row) {
        let _ = writeln!(
            out,
            "      <ResourceURL format=\"{}\" resourceType=\"tile\" template=\"{base}/wmts/1.0.0/{}/{{Style}}/{{TileMatrixSet}}/{{TileMatrix}}/{{TileRow}}/{{TileCol}}.{}\"/>",
            escape(name),
            row.name,
            short_name(format)
        );
    }
    out.push_str("    </Layer>\n");
}

fn matrix_set(set: MatrixSet, out: &mut String) {
    let _ = write!(
        out,
        "    <TileMatrixSet>\n      <ows:Identifier>{}</ows:Identifier>\n      <ows:SupportedCRS>{}</ows:SupportedCRS>\n",
        set.id(),
        set.crs_urn()
    );
    // The geographic quadtree's scales are in no well-known set.
    if set == MatrixSet::WebMercatorQuad {
        out.push_str(
            "      <WellKnownScaleSet>urn:ogc:def:wkss:OGC:1.0:GoogleMapsCompatible</WellKnownScaleSet>\n",
        );
    }
    let [left, top] = set.corner();
    for level in 0..=set.deepest() {
        let Some((rows, columns)) = set.size(level) else { continue };
        let _ = writeln!(
            out,
            "      <TileMatrix><ows:Identifier>{level}</ows:Identifier><ScaleDenominator>{}</ScaleDenominator><TopLeftCorner>{left} {top}</TopLeftCorner><TileWidth>{side}</TileWidth><TileHeight>{side}</TileHeight><MatrixWidth>{columns}</MatrixWidth><MatrixHeight>{rows}</MatrixHeight></TileMatrix>",
            set.scale_denominator(level),
            side = set.side()
        );
    }
    out.push_str("    </TileMatrixSet>\n");
}
