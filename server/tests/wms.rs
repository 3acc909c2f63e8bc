//! WMS over the analytic scene: axes, formats, refusals, capabilities.

mod common;

use axum::http::StatusCode;
use common::{Kind, app_with, ask, floats, full, get, height_at};
use treeline_core::codec::elevation::ElevationTile;
use treeline_core::grid::LatticeWindow;
use treeline_core::layer::Layer;
use treeline_core::query::get_map_query;
use treeline_core::tile::TileAddress;
use treeline_server::config::Config;
use treeline_server::http::router;

const BIL32: &str = "FORMAT=image/x-bil;bits%3D32";

fn map(version: &str, rest: &str) -> String {
    format!("/wms?SERVICE=WMS&VERSION={version}&REQUEST=GetMap&STYLES=&{rest}")
}

/// Rows and columns of a 4 × 2 map of the analytic scene's box 10.2…10.6 E, 46.1…46.3 N.
fn expected() -> Vec<f32> {
    (0..2)
        .flat_map(|row| (0..4).map(move |column| (row, column)))
        .map(|(row, column)| {
            height_at(10.2 + (f64::from(column) + 0.5) * 0.1, 46.3 - (f64::from(row) + 0.5) * 0.1)
        })
        .collect()
}

fn assert_close(found: &[f32], wanted: &[f32], tolerance: f32) {
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((found - wanted).abs() <= tolerance, "{found} is not {wanted}");
    }
}

#[tokio::test]
async fn axes_of_every_version() {
    let router = full();
    for query in [
        map(
            "1.3.0",
            &format!("LAYERS=elevation&CRS=CRS:84&BBOX=10.2,46.1,10.6,46.3&WIDTH=4&HEIGHT=2&{BIL32}"),
        ),
        map(
            "1.3.0",
            &format!("LAYERS=elevation&CRS=EPSG:4326&BBOX=46.1,10.2,46.3,10.6&WIDTH=4&HEIGHT=2&{BIL32}"),
        ),
        map(
            "1.1.1",
            &format!("LAYERS=elevation&SRS=EPSG:4326&BBOX=10.2,46.1,10.6,46.3&WIDTH=4&HEIGHT=2&{BIL32}"),
        ),
        // Names in any case, decimals in any spelling.
        "/wms?service=wms&version=1.3.0&request=GETMAP&layers=elevation&styles=default&crs=crs:84&bbox=1.02e1,46.10,1.06e+01,46.3&width=4&height=2&format=image/x-bil;%20bits=32".to_owned(),
    ] {
        let answer = get(&router, &query).await;
        assert_eq!(
            (answer.status, answer.header("content-type")),
            (StatusCode::OK, "image/x-bil"),
            "{}",
            answer.text()
        );
        assert_close(&floats(&answer.body), &expected(), 1e-3);
    }
}

#[tokio::test]
async fn web_mercator_and_the_scenes_own_crs() {
    let router = full();
    let (west, south) = treeline_core::geodesy::web_mercator_from_geographic(10.2, 46.1);
    let (east, north) = treeline_core::geodesy::web_mercator_from_geographic(10.6, 46.3);
    let query = map(
        "1.3.0",
        &format!(
            "LAYERS=elevation&CRS=EPSG:3857&BBOX={west},{south},{east},{north}&WIDTH=2&HEIGHT=2&{BIL32}"
        ),
    );
    let found = floats(&get(&router, &query).await.body);
    // Columns are linear in longitude in both; rows are not in latitude.
    assert!((found[1] - found[0] - 20.0).abs() < 0.01 && found[0] > found[2], "{found:?}");

    // MGI / Austria Lambert is a northing-first system.
    let crs = treeline_server::source::crs::Crs::from_epsg(31287).unwrap();
    assert!(treeline_server::source::crs::northing_first(31287));
    let (x, y) = crs.from_geographic(10.5, 46.5).unwrap();
    let (a, b, c, d) = (x - 500.0, y - 500.0, x + 500.0, y + 500.0);
    let wanted = height_at(10.5, 46.5);
    for query in [
        map(
            "1.3.0",
            &format!("LAYERS=elevation&CRS=EPSG:31287&BBOX={b},{a},{d},{c}&WIDTH=1&HEIGHT=1&{BIL32}"),
        ),
        map(
            "1.1.1",
            &format!("LAYERS=elevation&SRS=EPSG:31287&BBOX={a},{b},{c},{d}&WIDTH=1&HEIGHT=1&{BIL32}"),
        ),
    ] {
        assert_close(&floats(&get(&router, &query).await.body), &[wanted], 0.1);
    }
}

#[tokio::test]
async fn a_geographic_crs_of_the_scenes_own_has_latitude_first_in_1_3_0() {
    let kind = Kind { epsg: Some(4258), ..Kind::default() };
    let router = router(app_with(kind, &Config::default()).0);
    let wanted = height_at(10.5, 46.2);
    for query in [
        map(
            "1.3.0",
            &format!("LAYERS=elevation&CRS=EPSG:4258&BBOX=46.1,10.4,46.3,10.6&WIDTH=1&HEIGHT=1&{BIL32}"),
        ),
        map(
            "1.1.1",
            &format!("LAYERS=elevation&SRS=EPSG:4258&BBOX=10.4,46.1,10.6,46.3&WIDTH=1&HEIGHT=1&{BIL32}"),
        ),
    ] {
        assert_close(&floats(&get(&router, &query).await.body), &[wanted], 0.1);
    }
    let text = get(&router, "/wms?SERVICE=WMS&REQUEST=GetCapabilities").await.text();
    assert!(
        text.contains("<BoundingBox CRS=\"EPSG:4258\" minx=\"46\" miny=\"10\" maxx=\"47\" maxy=\"11\"/>")
    );
    for text in ["1e39", "-3.5e38"] {
        let query = format!(
            "LAYERS=elevation&CRS=CRS:84&BBOX=10.4,46.1,10.6,46.3&WIDTH=1&HEIGHT=1&{BIL32}&NODATA={text}"
        );
        let answer = get(&router, &map("1.3.0", &query)).await;
        assert!(
            answer.status == StatusCode::BAD_REQUEST && answer.text().contains(text),
            "{}",
            answer.text()
        );
    }
}

#[tokio::test]
async fn every_layer_in_every_format() {
    let router = full();
    for row in &treeline_core::layer::LAYERS {
        for format in row.formats {
            let window = LatticeWindow::of_tile(TileAddress::at(9, 10.5, 46.5), row.registration, row.border);
            let b = window.pixel_box();
            let query = map(
                "1.3.0",
                &format!(
                    "LAYERS={}&CRS=CRS:84&BBOX={},{},{},{}&WIDTH={}&HEIGHT={}&FORMAT={format}",
                    row.name, b.west, b.south, b.east, b.north, window.width, window.height
                ),
            );
            let answer = get(&router, &query).await;
            let bare = format.split(';').next().unwrap();
            assert_eq!(
                (answer.status, answer.header("content-type")),
                (StatusCode::OK, bare),
                "{} {format}: {}",
                row.name,
                answer.text()
            );
            let samples = window.len();
            match *format {
                "application/bil16" => assert_eq!(answer.body.len(), 2 * samples),
                "application/bil32" | "image/x-bil;bits=32" => assert_eq!(answer.body.len(), 4 * samples),
                "image/png" => assert!(answer.body.starts_with(b"\x89PNG")),
                "image/jpeg" => assert!(answer.body.starts_with(b"\xff\xd8\xff")),
                "image/webp" => assert!(answer.body.starts_with(b"RIFF")),
                "image/tiff" => {
                    assert!(answer.body.starts_with(b"II*\0") || answer.body.starts_with(b"MM\0*"))
                }
                _ => assert!(!answer.body.is_empty()),
            }
        }
    }
}

#[tokio::test]
async fn no_data_is_zero_or_what_the_request_says_and_200() {
    let router = full();
    let outside = "LAYERS=elevation&CRS=CRS:84&BBOX=20,10,21,11&WIDTH=2&HEIGHT=1";
    let answer = get(&router, &map("1.3.0", &format!("{outside}&{BIL32}"))).await;
    assert_eq!((answer.status, floats(&answer.body)), (StatusCode::OK, vec![0.0, 0.0]));
    let answer = get(&router, &map("1.3.0", &format!("{outside}&{BIL32}&NODATA=-9999"))).await;
    assert_eq!(floats(&answer.body), [-9999.0, -9999.0]);
    let answer =
        get(&router, &map("1.3.0", &format!("{outside}&FORMAT=application/bil16&NODATA=-32768"))).await;
    assert_eq!(answer.body, [0x00, 0x80, 0x00, 0x80]);
}

#[tokio::test]
async fn the_clients_url_gives_its_tile() {
    let (app, plane) = app_with(Kind { full: true, ..Kind::default() }, &Config::default());
    let router = router(app);
    let address = TileAddress::at(9, 10.5, 46.5);
    let url = format!("/wms?{}", get_map_query(Layer::Elevation, address, "r1"));
    let answer = get(&router, &url).await;
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    assert_eq!(answer.header("cache-control"), "public, max-age=31536000, immutable");
    let tile = ElevationTile::decode(&answer.body).unwrap();
    assert_eq!((tile.level, tile.side), (9, 515));
    let made = plane.samples.load(std::sync::atomic::Ordering::SeqCst);
    // The same box however it is spelt, in either CRS and version, is the same tile: nothing is made.
    let b = LatticeWindow::of_tile(address, Layer::Elevation.row().registration, 1).pixel_box();
    let format = Layer::Elevation.row().client_format;
    for query in [
        map(
            "1.3.0",
            &format!(
                "LAYERS=elevation&CRS=EPSG:4326&BBOX={:.10},{:.10},{:.10},{:.10}&WIDTH=515&HEIGHT=515&FORMAT={format}",
                b.south, b.west, b.north, b.east
            ),
        ),
        map(
            "1.1.1",
            &format!(
                "LAYERS=elevation&SRS=EPSG:4326&BBOX={},{},{},{}&WIDTH=515&HEIGHT=515&FORMAT={format}",
                b.west + 360.0,
                b.south,
                b.east + 360.0,
                b.north
            ),
        ),
    ] {
        assert_eq!(get(&router, &query).await.body, answer.body);
    }
    assert_eq!(plane.samples.load(std::sync::atomic::Ordering::SeqCst), made);
}

#[tokio::test]
async fn every_wrong_parameter_is_named() {
    let router = full();
    let good = "LAYERS=elevation&CRS=CRS:84&BBOX=10,46,11,47&WIDTH=4&HEIGHT=4&FORMAT=image/png";
    let swap = |from: &str, to: &str| map("1.3.0", &good.replace(from, to));
    for (query, code, named) in [
        (swap("LAYERS=elevation&", ""), "", "LAYERS is missing"),
        (
            swap("LAYERS=elevation", "LAYERS=elevatoin"),
            "LayerNotDefined",
            "did you mean &quot;elevation&quot;",
        ),
        (swap("LAYERS=elevation", "LAYERS=elevation,"), "LayerNotDefined", "LAYERS names &quot;&quot;"),
        (
            map("1.3.0", good).replace("STYLES=&LAYERS=elevation", "STYLES=,,&LAYERS=elevation,texture"),
            "StyleNotDefined",
            "3 styles for 2 layers",
        ),
        (
            swap("LAYERS=elevation", "LAYERS=elevation,texture").replace("image/png", "application/bil16"),
            "InvalidFormat",
            "several layers in one map come as image/png",
        ),
        (swap("STYLES=&", ""), "", "x"),
        (
            swap("CRS=CRS:84", "STYLES=bright&CRS=CRS:84").replacen("STYLES=&", "", 1),
            "StyleNotDefined",
            "the style &quot;bright&quot; is not defined",
        ),
        (swap("CRS=CRS:84&", ""), "", "CRS is missing"),
        (swap("CRS=CRS:84", "CRS=EPSG:9999"), "InvalidCRS", "CRS is &quot;EPSG:9999&quot;"),
        (swap("BBOX=10,46,11,47&", ""), "", "BBOX is missing"),
        (swap("10,46,11,47", "10,46,11"), "", "BBOX holds 3 numbers"),
        (swap("10,46,11,47", "11,46,10,47"), "", "west (11) must be less than east (10)"),
        (swap("10,46,11,47", "10,46,11,46"), "", "south (46) must be less than north (46)"),
        (swap("10,46,11,47", "10,46,nan,47"), "", "&quot;nan&quot; is no finite number"),
        (swap("10,46,11,47", "10,46,inf,47"), "", "&quot;inf&quot; is no finite number"),
        (swap("10,46,11,47", "10,46,11,1e9"), "", "far beyond the Earth"),
        (swap("WIDTH=4", "WIDTH=0"), "", "WIDTH is &quot;0&quot;"),
        (swap("WIDTH=4", "WIDTH=+4"), "", "WIDTH is &quot;+4&quot;"),
        (swap("WIDTH=4", "WIDTH=%204"), "", "WIDTH is"),
        (swap("WIDTH=4", "WIDTH=-4"), "", "WIDTH is &quot;-4&quot;"),
        (swap("WIDTH=4", "WIDTH=4097"), "", "from 1 to 4096"),
        (swap("HEIGHT=4", "HEIGHT=99999999999"), "", "HEIGHT is"),
        (swap("HEIGHT=4", "HEIGHT=4.5"), "", "HEIGHT is"),
        (swap("&FORMAT=image/png", ""), "", "FORMAT is missing"),
        (swap("FORMAT=image/png", "FORMAT=image/gif"), "InvalidFormat", "FORMAT is &quot;image/gif&quot;"),
        (
            swap("FORMAT=image/png", "FORMAT=application/vnd.treeline.elevation"),
            "",
            "for tiles of the matrix only",
        ),
        (swap("&FORMAT", "&TRANSPARENT=maybe&FORMAT"), "", "TRANSPARENT is &quot;maybe&quot;"),
        (swap("&FORMAT", "&BGCOLOR=red&FORMAT"), "", "BGCOLOR is &quot;red&quot;"),
        (swap("&FORMAT", "&NODATA=none&FORMAT"), "", "NODATA"),
        (swap("&FORMAT", "&WIDTH=5&FORMAT"), "", "WIDTH is given twice"),
        ("/wms".to_owned(), "", "REQUEST is missing"),
        ("/wms?REQUEST=GetTile".to_owned(), "OperationNotSupported", "REQUEST is &quot;GetTile&quot;"),
        ("/wms?SERVICE=WFS&REQUEST=GetCapabilities".to_owned(), "", "SERVICE is &quot;WFS&quot;"),
        (map("latest", good), "", "VERSION is &quot;latest&quot;"),
        (swap("&FORMAT", "&EXCEPTIONS=JSON&FORMAT"), "", "EXCEPTIONS is &quot;JSON&quot;"),
        (map("1.3.0", &good.replace("image/png", "image/%ff")), "", "UTF-8"),
    ] {
        // An absent STYLES is forgiven; every other line of the table is refused.
        let answer = get(&router, &query).await;
        if named == "x" {
            assert_eq!(answer.status, StatusCode::OK);
            continue;
        }
        assert_eq!(
            (answer.status, answer.header("content-type")),
            (StatusCode::BAD_REQUEST, "text/xml"),
            "{query}"
        );
        let text = answer.text();
        assert!(text.contains(named), "{query}: {text}");
        let with_code = if code.is_empty() {
            "<ServiceException>".to_owned()
        } else {
            format!("<ServiceException code=\"{code}\">")
        };
        assert!(text.contains(&with_code), "{query}: {text}");
        assert_eq!(answer.header("access-control-allow-origin"), "*");
    }
}

#[tokio::test]
async fn version_1_1_1_refuses_in_its_own_words() {
    let router = full();
    let answer = get(
        &router,
        &map("1.1.1", "LAYERS=elevation&SRS=EPSG:1&BBOX=1,2,3,4&WIDTH=1&HEIGHT=1&FORMAT=image/png"),
    )
    .await;
    assert_eq!(
        (answer.status, answer.header("content-type")),
        (StatusCode::BAD_REQUEST, "application/vnd.ogc.se_xml")
    );
    assert!(answer.text().contains("code=\"InvalidSRS\"") && answer.text().contains("exception_1_1_1.dtd"));
}

#[tokio::test]
async fn a_source_that_fails_is_500_and_not_kept() {
    let (app, plane) = app_with(Kind { fails: true, ..Kind::default() }, &Config::default());
    let router = router(app);
    let query =
        map("1.3.0", &format!("LAYERS=elevation&CRS=CRS:84&BBOX=10,46,11,47&WIDTH=4&HEIGHT=4&{BIL32}"));
    for _ in 0..2 {
        let answer = get(&router, &query).await;
        assert_eq!(answer.status, StatusCode::INTERNAL_SERVER_ERROR);
        assert!(answer.text().contains("dem.tif: cut short"), "{}", answer.text());
        assert_eq!(answer.header("cache-control"), "no-store");
    }
    assert_eq!(plane.samples.load(std::sync::atomic::Ordering::SeqCst), 2);
}

#[tokio::test]
async fn tags_and_revisions() {
    let router = full();
    let url = map("1.3.0", &format!("LAYERS=elevation&CRS=CRS:84&BBOX=10,46,11,47&WIDTH=4&HEIGHT=4&{BIL32}"));
    let first = get(&router, &url).await;
    assert_eq!(first.header("cache-control"), "public, max-age=300");
    let again = axum::http::Request::get(&url)
        .header("if-none-match", first.header("etag"))
        .body(axum::body::Body::empty())
        .unwrap();
    let again = ask(&router, again).await;
    assert_eq!(
        (again.status, again.body.len(), again.header("etag")),
        (StatusCode::NOT_MODIFIED, 0, first.header("etag"))
    );
    let other = axum::http::Request::get(&url)
        .header("if-none-match", "\"other\"")
        .body(axum::body::Body::empty())
        .unwrap();
    assert_eq!(ask(&router, other).await.status, StatusCode::OK);
    assert_eq!(get(&router, &format!("{url}&revision=old")).await.header("cache-control"), "no-cache");
}

#[tokio::test]
async fn feature_info_knows_the_place() {
    let router = full();
    let base = "SERVICE=WMS&REQUEST=GetFeatureInfo&LAYERS=elevation&QUERY_LAYERS=elevation&STYLES=&WIDTH=10&HEIGHT=10&FORMAT=image/png";
    let answer = get(
        &router,
        &format!(
            "/wms?VERSION=1.3.0&{base}&CRS=EPSG:4326&BBOX=46,10,47,11&I=7&J=2&INFO_FORMAT=application/json"
        ),
    )
    .await;
    assert_eq!(
        (answer.status, answer.header("content-type")),
        (StatusCode::OK, "application/json"),
        "{}",
        answer.text()
    );
    let found: serde_json::Value = serde_json::from_slice(&answer.body).unwrap();
    let number = |key: &str| found[key].as_f64().unwrap();
    assert!((number("longitude") - 10.75).abs() < 1e-9 && (number("latitude") - 46.75).abs() < 1e-9);
    assert!((number("elevation") - f64::from(height_at(10.75, 46.75))).abs() < 0.1);
    let answer = get(
        &router,
        &format!("/wms?VERSION=1.1.1&{base}&SRS=EPSG:4326&BBOX=10,46,11,47&X=7&Y=2&INFO_FORMAT=text/plain"),
    )
    .await;
    assert!(answer.text().contains("elevation: 825.00 m"), "{}", answer.text());
    let answer =
        get(&router, &format!("/wms?VERSION=1.3.0&{base}&CRS=CRS:84&BBOX=10,46,11,47&I=10&J=2")).await;
    assert!(
        answer.text().contains("InvalidPoint") && answer.text().contains("from 0 to 9"),
        "{}",
        answer.text()
    );
}

#[tokio::test]
async fn capabilities_of_both_versions() {
    let router = full();
    for (version, content_type, schema) in [
        ("1.3.0", "text/xml", "capabilities_1_3_0.xsd"),
        ("1.1.1", "application/vnd.ogc.wms_xml", "capabilities_1_1_1.dtd"),
    ] {
        let answer =
            get(&router, &format!("/wms?SERVICE=WMS&REQUEST=GetCapabilities&VERSION={version}")).await;
        assert_eq!((answer.status, answer.header("content-type")), (StatusCode::OK, content_type));
        let text = answer.text();
        assert!(
            text.contains(schema) && text.contains("xlink:href=\"http://test.example:8080/wms?\""),
            "{text}"
        );
        assert!(
            text.contains("A &lt;plane&gt; &amp; more") && text.contains("<Name>combined-elevation</Name>")
        );
        assert!(text.contains("EPSG:31287"));
        let get_map = text.split("<GetMap>").nth(1).unwrap();
        assert!(get_map.starts_with("<Format>image/png</Format>"));
    }
    let text = get(&router, "/wms?SERVICE=WMS&REQUEST=GetCapabilities").await.text();
    assert!(text.contains("<BoundingBox CRS=\"CRS:84\" minx=\"10\" miny=\"46\" maxx=\"11\" maxy=\"47\"/>"));
    assert!(
        text.contains("<BoundingBox CRS=\"EPSG:4326\" minx=\"46\" miny=\"10\" maxx=\"47\" maxy=\"11\"/>")
    );
    assert!(text.contains("<MaxWidth>4096</MaxWidth>"));
    assert!(!text.contains("updateSequence") && !text.contains("ExtremeElevations"));
    assert!(text.contains("<LayerLimit>16</LayerLimit>") && text.contains("<Format>INIMAGE</Format>"));
}
