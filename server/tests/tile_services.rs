//! Tiles as others ask for them: WMTS, OGC API – Tiles, World Wind .NET.

mod common;

use axum::body::Body;
use axum::http::{Request, StatusCode};
use common::{ask, full, get, height_at};
use treeline_core::tile::TileAddress;

fn heights_16(body: &[u8]) -> Vec<i16> {
    body.chunks_exact(2).map(|pair| i16::from_le_bytes([pair[0], pair[1]])).collect()
}

#[tokio::test]
async fn a_wmts_tile_is_the_tile_of_its_address() {
    let router = full();
    let tile = TileAddress::at(9, 10.5, 46.5);
    let TileAddress { level, row, column } = tile;
    let by_address =
        get(&router, &format!("/tiles/texture/WorldCRS84Quad/{level}/{row}/{column}?f=png")).await;
    for url in [
        format!(
            "/wmts?SERVICE=WMTS&REQUEST=GetTile&VERSION=1.0.0&LAYER=texture&STYLE=default&TILEMATRIXSET=WorldCRS84Quad&TILEMATRIX={level}&TILEROW={row}&TILECOL={column}&FORMAT=image/png"
        ),
        format!(
            "/wmts?tilecol={column}&tilerow={row}&tilematrix={level}&tilematrixset=WorldCRS84Quad&format=image/png&layer=texture&request=gettile"
        ),
        format!("/wmts/1.0.0/texture/default/WorldCRS84Quad/{level}/{row}/{column}.png"),
    ] {
        let answer = get(&router, &url).await;
        assert_eq!((answer.status, answer.header("content-type")), (StatusCode::OK, "image/png"), "{url}");
        assert_eq!(answer.body, by_address.body, "{url}");
    }
}

#[tokio::test]
async fn wmts_refuses_in_its_own_words() {
    let router = full();
    let good = "/wmts?SERVICE=WMTS&REQUEST=GetTile&VERSION=1.0.0&LAYER=texture&STYLE=default&TILEMATRIXSET=WorldCRS84Quad&TILEMATRIX=9&TILEROW=0&TILECOL=0&FORMAT=image/png";
    for (from, to, code) in [
        ("&LAYER=texture", "", "MissingParameterValue"),
        ("LAYER=texture", "LAYER=nothing", "InvalidParameterValue"),
        ("STYLE=default", "STYLE=bright", "InvalidParameterValue"),
        ("TILEROW=0", "TILEROW=512", "TileOutOfRange"),
        ("TILEROW=0", "TILEROW=-1", "InvalidParameterValue"),
        ("FORMAT=image/png", "FORMAT=image/gif", "InvalidParameterValue"),
        ("GetTile", "GetFeatureInfo", "OperationNotSupported"),
        ("SERVICE=WMTS", "SERVICE=WMS", "InvalidParameterValue"),
    ] {
        let answer = get(&router, &good.replace(from, to)).await;
        assert_eq!((answer.status, answer.header("content-type")), (StatusCode::BAD_REQUEST, "text/xml"));
        assert!(
            answer.text().contains(&format!("exceptionCode=\"{code}\"")),
            "{from} → {to}: {}",
            answer.text()
        );
    }
}

#[tokio::test]
async fn wmts_capabilities_name_tiles_that_are_there() {
    let router = full();
    let by_path = get(&router, "/wmts/1.0.0/WMTSCapabilities.xml").await;
    let text = get(&router, "/wmts?SERVICE=WMTS&REQUEST=GetCapabilities").await.text();
    assert_eq!(by_path.text(), text);
    assert!(
        text.contains("<ScaleDenominator>559082264.0287178</ScaleDenominator>"),
        "Web Mercator's level 0"
    );
    assert!(text.contains("<ScaleDenominator>279541132.0143589</ScaleDenominator>"), "WorldCRS84Quad's");
    // Every layer's first template, at the first tile that its limits name.
    for layer in text.split("<Layer>").skip(1) {
        let after = |text: &str, tag: &str| {
            text.split(&format!("<{tag}>")).nth(1).unwrap().split('<').next().unwrap().to_owned()
        };
        let set = layer.split("<TileMatrixSetLink>").nth(1).unwrap();
        let template = layer.split("template=\"").nth(1).unwrap().split('"').next().unwrap();
        let url = template
            .replace("http://test.example:8080", "")
            .replace("{Style}", "default")
            .replace("{TileMatrixSet}", &after(set, "TileMatrixSet"))
            .replace("{TileMatrix}", &after(set, "TileMatrix"))
            .replace("{TileRow}", &after(set, "MinTileRow"))
            .replace("{TileCol}", &after(set, "MinTileCol"));
        let answer = get(&router, &url).await;
        assert_eq!(answer.status, StatusCode::OK, "{url}: {}", answer.text());
        let picture = image::load_from_memory(&answer.body).unwrap().to_rgba8();
        assert!(picture.pixels().any(|pixel| pixel[3] > 0), "{url} shows nothing");
    }
}

#[tokio::test]
async fn ogc_api_tiles_lead_from_the_list_to_a_tile() {
    let router = full();
    let json = |body: &[u8]| serde_json::from_slice::<serde_json::Value>(body).unwrap();
    let path =
        |link: &serde_json::Value| link["href"].as_str().unwrap().replace("http://test.example:8080", "");
    let list = json(&get(&router, "/tiles").await.body);
    let sets = list["tilesets"].as_array().unwrap();
    assert_eq!(sets.len(), 12, "four layers in three sets");
    assert_eq!(json(&get(&router, "/tiles/lcc").await.body)["tilesets"].as_array().unwrap().len(), 3);
    for set in sets {
        let links = set["links"].as_array().unwrap();
        let of_rel = |rel: &str| links.iter().find(|link| link["rel"].as_str() == Some(rel)).unwrap();
        let scheme = json(
            &get(&router, &path(of_rel("http://www.opengis.net/def/rel/ogc/1.0/tiling-scheme"))).await.body,
        );
        let first = &scheme["tileMatrices"][0];
        assert_eq!((first["id"].as_str(), first["cornerOfOrigin"].as_str()), (Some("0"), Some("topLeft")));
        let full = json(&get(&router, &path(of_rel("self"))).await.body);
        let item = full["links"].as_array().unwrap().iter().find(|link| link["rel"] == "item").unwrap();
        assert_eq!((item["templated"].as_bool(), item["type"].as_str()), (Some(true), Some("image/png")));
        let limits = full["tileMatrixSetLimits"].as_array().unwrap().last().unwrap();
        let url = path(item)
            .replace("{tileMatrix}", limits["tileMatrix"].as_str().unwrap())
            .replace("{tileRow}", &limits["maxTileRow"].to_string())
            .replace("{tileCol}", &limits["maxTileCol"].to_string());
        let answer = get(&router, &url).await;
        assert_eq!((answer.status, answer.header("content-type")), (StatusCode::OK, "image/png"), "{url}");
    }
    assert_eq!(get(&router, "/tiles/nothing").await.status, StatusCode::NOT_FOUND);
    assert_eq!(get(&router, "/tiles/lcc/nothing").await.status, StatusCode::NOT_FOUND);
    assert_eq!(get(&router, "/tileMatrixSets/nothing").await.status, StatusCode::NOT_FOUND);
    let conforms = json(&get(&router, "/conformance").await.body);
    assert!(conforms["conformsTo"].to_string().contains("ogcapi-tiles-1/1.0/conf/core"));
}

#[tokio::test]
async fn world_wind_net_counts_from_the_south_west() {
    let router = full();
    // 20°/2⁵ = 0.625° from 10° E, 46.25° N: column 304, row 218.
    let answer = get(&router, "/world-wind?T=elevation&L=5&X=304&Y=218").await;
    assert_eq!((answer.status, answer.header("content-type")), (StatusCode::OK, "application/bil16"));
    let heights = heights_16(&answer.body);
    assert_eq!(heights.len(), 150 * 150);
    let step = 0.625 / 150.0;
    for (index, &height) in heights.iter().enumerate().step_by(77) {
        let (row, column) = (index / 150, index % 150);
        let longitude = 10.0 + (column as f64 + 0.5) * step;
        let latitude = 46.875 - (row as f64 + 0.5) * step;
        assert!((f32::from(height) - height_at(longitude, latitude)).abs() <= 0.51, "{row}, {column}");
    }
    // The same query on the path of its other maps, in any case; a picture of 36° tiles.
    assert_eq!(get(&router, "/wms?t=elevation&l=5&x=304&y=218").await.body, answer.body);
    let picture = get(&router, "/wms?T=texture&L=4&X=84&Y=60").await;
    assert_eq!((picture.status, picture.header("content-type")), (StatusCode::OK, "image/jpeg"));
    let small = get(&router, "/world-wind?T=lcc&L=3&X=33&Y=24&D=45&S=64&F=image/png").await;
    assert_eq!(image::load_from_memory(&small.body).unwrap().width(), 64);
    for (query, named) in [
        ("T=nothing&L=0&X=0&Y=0", "T is \"nothing\""),
        ("T=elevation&X=0&Y=0", "L is missing"),
        ("T=elevation&L=0&X=18&Y=0", "X is 18; level 0 has 0 to 17"),
        ("T=elevation&L=0&X=0&Y=9", "Y is 9; level 0 has 0 to 8"),
        ("T=elevation&L=0&X=-1&Y=0", "X is \"-1\""),
        ("T=elevation&L=99&X=0&Y=0", "the deepest level is 22"),
        ("T=elevation&L=0&X=0&Y=0&D=0", "D is 0"),
        ("T=elevation&L=0&X=0&Y=0&S=99999", "S is 99999"),
        ("T=elevation&L=0&X=0&Y=0&F=image/gif", "F is \"image/gif\""),
    ] {
        let answer = get(&router, &format!("/world-wind?{query}")).await;
        assert_eq!(answer.status, StatusCode::BAD_REQUEST);
        assert!(answer.text().contains(named), "{query}: {}", answer.text());
    }
}

#[tokio::test]
async fn a_date_will_do_where_there_is_no_tag() {
    let router = full();
    let url = "/tiles/texture/WorldCRS84Quad/9/123/541?f=png";
    let first = get(&router, url).await;
    let date = first.header("last-modified").to_owned();
    assert!(date.ends_with(" GMT"), "{date}");
    let with = |name: &'static str, value: String| {
        Request::get(url).header(name, value).body(Body::empty()).unwrap()
    };
    let unchanged = ask(&router, with("if-modified-since", date.clone())).await;
    assert_eq!(
        (unchanged.status, unchanged.header("etag"), unchanged.body.len()),
        (StatusCode::NOT_MODIFIED, first.header("etag"), 0)
    );
    let old = "Sun, 06 Nov 1994 08:49:37 GMT".to_owned();
    assert_eq!(ask(&router, with("if-modified-since", old)).await.status, StatusCode::OK);
    assert_eq!(ask(&router, with("if-modified-since", "yesterday".to_owned())).await.status, StatusCode::OK);
    // A tag goes before a date.
    let both = Request::get(url)
        .header("if-modified-since", date)
        .header("if-none-match", "\"other\"")
        .body(Body::empty())
        .unwrap();
    assert_eq!(ask(&router, both).await.status, StatusCode::OK);
    for tags in
        ["*".to_owned(), format!("\"a\", {}", first.header("etag")), first.header("etag")[2..].to_owned()]
    {
        assert_eq!(ask(&router, with("if-none-match", tags)).await.status, StatusCode::NOT_MODIFIED);
    }
}

#[tokio::test]
async fn every_variant_says_that_there_are_others() {
    let router = full();
    let url = "/tiles/elevation/WorldCRS84Quad/9/123/541?f=bil32";
    let mut bodies = Vec::new();
    for (accepts, encoding) in [
        ("identity", ""),
        ("zstd", "zstd"),
        ("br", "br"),
        ("gzip", "gzip"),
        ("gzip;q=1, br;q=0.5, zstd;q=0", "gzip"),
        ("gzip;q=0.2, br;q=0.9", "br"),
        ("*;q=0, identity", ""),
    ] {
        let request = Request::get(url).header("accept-encoding", accepts).body(Body::empty()).unwrap();
        let answer = ask(&router, request).await;
        assert_eq!(
            answer.headers.get("content-encoding").map_or("", |value| value.to_str().unwrap()),
            encoding,
            "{accepts}"
        );
        assert!(answer.header("vary").to_ascii_lowercase().contains("accept-encoding"), "{accepts}");
        bodies.push(answer.body.len());
    }
    assert!(bodies[1] < bodies[0] / 2, "{bodies:?}");
    let tag = get(&router, url).await.header("etag").to_owned();
    let request = Request::get(url).header("if-none-match", tag).body(Body::empty()).unwrap();
    let unchanged = ask(&router, request).await;
    assert_eq!((unchanged.status, unchanged.header("vary")), (StatusCode::NOT_MODIFIED, "accept-encoding"));
}
