//! Everything but WMS: tiles by address, scene.json, health, refusals, headers on all of it.

mod common;

use axum::body::Body;
use axum::http::{Method, Request, StatusCode};
use common::{Answer, Kind, app_with, ask, floats, full, get, height_at};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use treeline_core::scene::SceneDescription;
use treeline_core::tile::TileAddress;
use treeline_core::tree_model::TreeSpecies;
use treeline_server::config::Config;
use treeline_server::http::router;
use treeline_server::limits::Limits;
use treeline_server::metrics::{Outcome, Product};

fn path(set: &str, tile: TileAddress, f: &str) -> String {
    format!("/tiles/elevation/{set}/{}/{}/{}?f={f}", tile.level, tile.row, tile.column)
}

#[tokio::test]
async fn a_tile_by_address_is_the_wms_map_of_its_box() {
    let (app, plane) = app_with(Kind::default(), &Config::default());
    let router = router(app);
    let tile = TileAddress::at(9, 10.5, 46.5);
    let by_address = get(&router, &path("TreelineGeographic", tile, "bil32")).await;
    assert_eq!((by_address.status, by_address.header("content-type")), (StatusCode::OK, "application/bil32"));
    let b = tile.bounds();
    let wms = format!(
        "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=elevation&STYLES=&CRS=EPSG:4326&BBOX={},{},{},{}&WIDTH=512&HEIGHT=512&FORMAT=application/bil32",
        b.south, b.west, b.north, b.east
    );
    assert_eq!(get(&router, &wms).await.body, by_address.body);
    assert_eq!(plane.samples.load(Relaxed), 1, "one tile, one make");
    let own = get(&router, &path("TreelineGeographic", tile, "treeline")).await;
    assert_eq!(own.header("content-type"), "application/vnd.treeline.elevation");
}

#[tokio::test]
async fn standard_matrix_sets() {
    let router = full();
    // A sample stands for its pixel's centre.
    let tile = TileAddress::at(9, 10.5, 46.5);
    let heights = floats(&get(&router, &path("WorldCRS84Quad", tile, "bil32")).await.body);
    assert_eq!(heights.len(), 256 * 256);
    let step = 180.0 / 512.0 / 256.0;
    let b = tile.bounds();
    assert!((heights[0] - height_at(b.west + 0.5 * step, b.north - 0.5 * step)).abs() < 0.01);
    // Web Mercator: longitude is linear in the column.
    let (x, y) = treeline_core::geodesy::web_mercator_from_geographic(10.5, 46.5);
    let half = 20_037_508.342_789_244;
    let span = 2.0 * half / 1024.0;
    let (column, row) = (((x + half) / span) as u32, ((half - y) / span) as u32);
    let heights = floats(
        &get(&router, &format!("/tiles/elevation/WebMercatorQuad/10/{row}/{column}?f=bil32")).await.body,
    );
    let west = f64::from(column) * 360.0 / 1024.0 - 180.0;
    let (_, north) = treeline_core::geodesy::geographic_from_web_mercator(
        0.0,
        half - span * (f64::from(row) + 0.5 / 256.0),
    );
    assert!((heights[0] - height_at(west + 360.0 / 1024.0 / 512.0, north)).abs() < 0.05);
}

#[tokio::test]
async fn wrong_addresses_and_formats() {
    let router = full();
    for (uri, status, named) in [
        ("/tiles/elevatio/TreelineGeographic/0/0/0", StatusCode::NOT_FOUND, "did you mean \"elevation\""),
        (
            "/tiles/elevation/Treeline/0/0/0",
            StatusCode::NOT_FOUND,
            "TreelineGeographic, WorldCRS84Quad, WebMercatorQuad",
        ),
        ("/tiles/elevation/WebMercatorQuad/0/0/1", StatusCode::NOT_FOUND, "the row comes first"),
        ("/tiles/elevation/WebMercatorQuad/40/0/0", StatusCode::NOT_FOUND, "no level 40"),
        ("/tiles/elevation/WebMercatorQuad/300/0/0", StatusCode::NOT_FOUND, "no level 300"),
        ("/tiles/elevation/WebMercatorQuad/0/-1/0", StatusCode::BAD_REQUEST, "the row \"-1\""),
        ("/tiles/elevation/WebMercatorQuad/0/0/x", StatusCode::BAD_REQUEST, "the column \"x\""),
        ("/tiles/elevation/WebMercatorQuad/0/0/0?f=gif", StatusCode::BAD_REQUEST, "f is \"gif\""),
        (
            "/tiles/elevation/WebMercatorQuad/0/0/0?f=treeline",
            StatusCode::BAD_REQUEST,
            "TreelineGeographic only",
        ),
        ("/favicon.png", StatusCode::NOT_FOUND, "nothing at /favicon.png"),
    ] {
        let answer = get(&router, uri).await;
        assert_eq!(answer.status, status, "{uri}");
        assert!(answer.text().contains(named), "{uri}: {}", answer.text());
        assert_eq!(answer.text().lines().count(), 1, "{uri}");
        assert_eq!(answer.header("access-control-allow-origin"), "*");
        assert_eq!(answer.header("timing-allow-origin"), "*");
    }
    let request = Request::get("/tiles/elevation/WebMercatorQuad/0/0/0")
        .header("accept", "video/mp4")
        .body(Body::empty())
        .unwrap();
    assert_eq!(ask(&router, request).await.status, StatusCode::NOT_ACCEPTABLE);
}

#[tokio::test]
async fn the_description_says_what_there_is() {
    let answer = get(&full(), "/scene.json").await;
    let full_scene: SceneDescription = serde_json::from_slice(&answer.body).unwrap();
    assert_eq!(full_scene.wms, "http://test.example:8080/wms?");
    assert_eq!((full_scene.layers.len(), full_scene.vegetation, full_scene.species.len()), (4, true, 2));
    assert!(full_scene.land_cover.is_some() && full_scene.maximum_height > 1100.0);
    assert!(full_scene.layers.iter().all(|layer| layer.minimum_level <= layer.maximum_level));
    let bare = router(
        app_with(
            Kind::default(),
            &Config { public_url: Some("https://x.org/y/".to_owned()), ..Config::default() },
        )
        .0,
    );
    let bare: SceneDescription = serde_json::from_slice(&get(&bare, "/scene.json").await.body).unwrap();
    assert_eq!(bare.wms, "https://x.org/y/wms?");
    assert_eq!((bare.layers.len(), bare.vegetation, bare.species.len()), (3, false, 0));
    assert!(bare.land_cover.is_none());
}

#[tokio::test]
async fn compression_of_what_it_pays_for() {
    let router = full();
    let tile = TileAddress::at(9, 10.5, 46.5);
    for (f, encoding, welcome) in
        [("treeline", "zstd", "gzip, br, zstd"), ("bil32", "gzip", "gzip"), ("png", "", "gzip, br, zstd")]
    {
        let request = Request::get(path("TreelineGeographic", tile, f))
            .header("accept-encoding", welcome)
            .body(Body::empty())
            .unwrap();
        let answer = ask(&router, request).await;
        assert_eq!((answer.status, answer.header("content-encoding")), (StatusCode::OK, encoding), "{f}");
    }
}

#[tokio::test]
async fn methods() {
    let router = full();
    let ask = async |method: Method, uri: &str| -> Answer {
        let request = Request::builder()
            .method(method)
            .uri(uri)
            .header("origin", "https://other.example")
            .body(Body::empty())
            .unwrap();
        ask(&router, request).await
    };
    for uri in
        ["/wms?REQUEST=GetCapabilities", "/scene.json", "/healthz", "/tiles/elevation/WebMercatorQuad/0/0/0"]
    {
        let head = ask(Method::HEAD, uri).await;
        assert_eq!((head.status, head.body.len()), (StatusCode::OK, 0), "{uri}");
        let post = ask(Method::POST, uri).await;
        assert_eq!(
            (post.status, post.header("allow")),
            (StatusCode::METHOD_NOT_ALLOWED, "GET, HEAD, OPTIONS"),
            "{uri}"
        );
        assert_eq!(post.text().lines().count(), 1);
        let options = ask(Method::OPTIONS, uri).await;
        assert_eq!(
            (options.status, options.header("access-control-allow-origin")),
            (StatusCode::OK, "*"),
            "{uri}"
        );
    }
    assert_eq!(ask(Method::POST, "/nowhere").await.status, StatusCode::METHOD_NOT_ALLOWED);
}

#[tokio::test]
async fn health_readiness_and_counters() {
    let (app, _) = app_with(Kind::default(), &Config::default());
    let router = router(app.clone());
    assert_eq!(get(&router, "/healthz").await.text(), "ok\n");
    assert_eq!(get(&router, "/readyz").await.status, StatusCode::OK);
    let tile = path("TreelineGeographic", TileAddress::at(9, 10.5, 46.5), "png");
    for _ in 0..2 {
        assert_eq!(get(&router, &tile).await.status, StatusCode::OK);
    }
    let text = get(&router, "/metrics").await.text();
    for line in [
        "treeline_tiles_total{layer=\"elevation\",outcome=\"made\"} 1",
        "treeline_tiles_total{layer=\"elevation\",outcome=\"memory\"} 1",
        "treeline_requests_under_way 1",
        "treeline_responses_total{class=\"2xx\"} 4",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
    app.stopping.store(true, Relaxed);
    assert_eq!(get(&router, "/readyz").await.status, StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(get(&router, "/healthz").await.status, StatusCode::OK);
}

#[tokio::test]
async fn long_urls_and_crowds_are_turned_away() {
    let limits = Limits { maximum_url_bytes: 100, maximum_requests: 1, ..Limits::default() };
    let (app, _) = app_with(Kind::default(), &Config { limits, ..Config::default() });
    let router = router(app.clone());
    let long = get(&router, &format!("/wms?{}", "x".repeat(100))).await;
    assert_eq!((long.status, long.text().lines().count()), (StatusCode::URI_TOO_LONG, 1));
    let someone = app.metrics.begin();
    let crowded = get(&router, "/scene.json").await;
    assert_eq!((crowded.status, crowded.header("retry-after")), (StatusCode::SERVICE_UNAVAILABLE, "1"));
    assert_eq!(get(&router, "/healthz").await.status, StatusCode::OK, "those who watch are let in");
    drop(someone);
    assert_eq!(get(&router, "/scene.json").await.status, StatusCode::OK);
}

#[tokio::test]
async fn a_real_listener_drains() {
    let (app, _) = app_with(Kind::default(), &Config::default());
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let stop = Arc::new(tokio::sync::Notify::new());
    let stopped = stop.clone();
    let server = tokio::spawn(treeline_server::http::serve(
        listener,
        treeline_server::http::Live::new(app),
        async move { stopped.notified().await },
    ));
    let idle = tokio::net::TcpStream::connect(address).await.unwrap();
    let answer = tokio::task::spawn_blocking(move || {
        use std::io::{Read as _, Write as _};
        let mut stream = std::net::TcpStream::connect(address).unwrap();
        stream.write_all(b"GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n").unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        text
    });
    assert!(answer.await.unwrap().starts_with("HTTP/1.1 200 OK"));
    stop.notify_one();
    server.await.unwrap().unwrap();
    drop(idle);
}

#[tokio::test]
async fn models_of_a_species_are_grown_once() {
    let (app, _) = app_with(Kind { full: true, ..Kind::default() }, &Config::default());
    let router = router(app.clone());
    let scene: SceneDescription = serde_json::from_slice(&get(&router, "/scene.json").await.body).unwrap();
    assert_eq!(scene.trees.as_deref(), Some("http://test.example:8080/trees/"));
    // Two ask at once.
    let (first, second) = tokio::join!(get(&router, "/trees/1?revision=r1"), get(&router, "/trees/1"));
    assert_eq!((first.status, first.body.len()), (StatusCode::OK, second.body.len()));
    assert_eq!(first.header("content-type"), "application/vnd.treeline.trees");
    assert_eq!(first.header("cache-control"), "public, max-age=31536000, immutable");
    assert_eq!(first.header("access-control-allow-origin"), "*");
    let model = TreeSpecies::decode(&first.body).unwrap();
    assert_eq!((model.code, model.levels.len()), (1, 4));
    assert_eq!(app.metrics.count(Product::Trees, Outcome::Made), 1);
    let request =
        Request::get("/trees/1").header("if-none-match", first.header("etag")).body(Body::empty()).unwrap();
    assert_eq!(ask(&router, request).await.status, StatusCode::NOT_MODIFIED);
    let request = Request::get("/trees/1").header("accept-encoding", "zstd").body(Body::empty()).unwrap();
    let packed = ask(&router, request).await;
    assert_eq!(packed.header("content-encoding"), "zstd");
    assert!(packed.body.len() < first.body.len() / 2, "{} of {}", packed.body.len(), first.body.len());
    for (uri, named) in [
        ("/trees/0", "this scene's species are 1 (Norway spruce), 2 (European beech)"),
        ("/trees/3", "no trees \"3\""),
        ("/trees/256", "no trees \"256\""),
        ("/trees/spruce", "no trees \"spruce\""),
    ] {
        let answer = get(&router, uri).await;
        assert_eq!((answer.status, answer.text().lines().count()), (StatusCode::NOT_FOUND, 1), "{uri}");
        assert!(answer.text().contains(named), "{}", answer.text());
    }
}

#[tokio::test]
async fn where_nothing_grows_there_are_no_models() {
    let (app, _) = app_with(Kind::default(), &Config::default());
    let router = router(app);
    let text = get(&router, "/scene.json").await.text();
    assert!(!text.contains("trees"), "{text}");
    let answer = get(&router, "/trees/1").await;
    assert_eq!(answer.status, StatusCode::NOT_FOUND);
    assert!(answer.text().contains("nothing grows in this scene"));
}

#[tokio::test]
async fn every_request_has_a_name() {
    let router = full();
    let [first, second] = [get(&router, "/healthz").await, get(&router, "/nothing").await];
    assert_ne!(first.header("x-request-id"), second.header("x-request-id"));
    let named = Request::get("/healthz").header("x-request-id", "from-a-proxy").body(Body::empty()).unwrap();
    assert_eq!(ask(&router, named).await.header("x-request-id"), "from-a-proxy");
}
