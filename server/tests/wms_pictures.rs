//! What WMS shows besides plain maps: layers one over the other, errors in pictures, legends, pages for people.

mod common;

use axum::body::Body;
use axum::http::{Request, StatusCode};
use common::{Answer, Kind, app_with, ask, full, get};
use treeline_server::config::Config;
use treeline_server::http::router;

const BOX: &str = "CRS=CRS:84&BBOX=10,46,11,47&WIDTH=16&HEIGHT=8";

fn map(rest: &str) -> String {
    format!("/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&{rest}")
}

fn pixels(answer: &Answer) -> image::RgbaImage {
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    image::load_from_memory(&answer.body).unwrap().to_rgba8()
}

#[tokio::test]
async fn the_leftmost_layer_lies_at_the_bottom() {
    let router = full();
    let of = |layers: &str| map(&format!("LAYERS={layers}&STYLES=&{BOX}&FORMAT=image/png"));
    let relief = pixels(&get(&router, &of("elevation")).await);
    let photo = pixels(&get(&router, &of("texture")).await);
    assert_ne!(relief, photo);
    assert_eq!(pixels(&get(&router, &of("elevation,texture")).await), photo);
    assert_eq!(pixels(&get(&router, &of("texture,elevation")).await), relief);
    // Land cover lies over the relief where there is any.
    let classes = map(&format!("LAYERS=lcc&STYLES=&{BOX}&FORMAT=image/png&TRANSPARENT=TRUE"));
    let classes = pixels(&get(&router, &classes).await);
    let both = pixels(&get(&router, &of("elevation,lcc")).await);
    for ((both, class), relief) in both.pixels().zip(classes.pixels()).zip(relief.pixels()) {
        assert_eq!(both, if class[3] == 0 { relief } else { class });
    }
}

#[tokio::test]
async fn one_layer_five_hundred_times_is_one_layer() {
    let router = full();
    let many = vec!["texture"; 500].join(",");
    let one = get(&router, &map(&format!("LAYERS=texture&STYLES=&{BOX}&FORMAT=image/jpeg"))).await;
    let answer = get(&router, &map(&format!("LAYERS={many}&STYLES=&{BOX}&FORMAT=image/jpeg"))).await;
    assert_eq!((answer.status, answer.body), (StatusCode::OK, one.body));
}

#[tokio::test]
async fn more_layers_than_the_limit_are_refused() {
    let mut config = Config::default();
    config.limits.maximum_layers = 1;
    let router = router(app_with(Kind::default(), &config).0);
    let answer =
        get(&router, &map(&format!("LAYERS=elevation,texture&STYLES=&{BOX}&FORMAT=image/png"))).await;
    assert_eq!(answer.status, StatusCode::BAD_REQUEST);
    assert!(answer.text().contains("at most 1 are drawn in one map"), "{}", answer.text());
}

#[tokio::test]
async fn an_error_is_told_in_the_picture_that_was_asked_for() {
    let router = full();
    let wrong = |exceptions: &str, rest: &str| {
        map(&format!("LAYERS=nothing&STYLES=&{BOX}&FORMAT=image/png&EXCEPTIONS={exceptions}{rest}"))
            .replace("WIDTH=16&HEIGHT=8", "WIDTH=300&HEIGHT=80")
    };
    for exceptions in ["INIMAGE", "application/vnd.ogc.se_inimage"] {
        let answer = get(&router, &wrong(exceptions, "")).await;
        assert_eq!(
            (answer.header("content-type"), answer.header("cache-control")),
            ("image/png", "no-store")
        );
        let told = pixels(&answer);
        assert_eq!(told.dimensions(), (300, 80));
        let inked = told.pixels().filter(|pixel| pixel[1] < 128).count();
        assert!((200..8_000).contains(&inked), "{inked} pixels of letters");
    }
    let blank = pixels(&get(&router, &wrong("BLANK", "&BGCOLOR=0x102030")).await);
    assert!(blank.pixels().all(|pixel| pixel.0 == [16, 32, 48, 255]));
    let clear = pixels(&get(&router, &wrong("BLANK", "&TRANSPARENT=TRUE")).await);
    assert!(clear.pixels().all(|pixel| pixel[3] == 0));
    // What is no picture is told as a document.
    let bil = get(&router, &wrong("INIMAGE", "").replace("image/png", "application/bil16")).await;
    assert_eq!((bil.status, bil.header("content-type")), (StatusCode::BAD_REQUEST, "text/xml"));
    let huge = get(&router, &wrong("INIMAGE", "").replace("WIDTH=300", "WIDTH=300000")).await;
    assert_eq!((huge.status, huge.header("content-type")), (StatusCode::BAD_REQUEST, "text/xml"));
}

#[tokio::test]
async fn legends_are_as_large_as_promised() {
    let router = full();
    let text = get(&router, "/wms?SERVICE=WMS&REQUEST=GetCapabilities").await.text();
    let mut legends = 0;
    for part in text.split("<LegendURL ").skip(1) {
        let number = |name: &str| {
            part.split(&format!("{name}=\""))
                .nth(1)
                .unwrap()
                .split('"')
                .next()
                .unwrap()
                .parse::<u32>()
                .unwrap()
        };
        let link = part.split("xlink:href=\"").nth(1).unwrap().split('"').next().unwrap();
        let link = link.replace("&amp;", "&").replace("http://test.example:8080", "");
        let legend = pixels(&get(&router, &link).await);
        assert_eq!(legend.dimensions(), (number("width"), number("height")), "{link}");
        let colours: std::collections::HashSet<_> = legend.pixels().map(|pixel| pixel.0).collect();
        assert!(colours.len() >= 4, "{link}: {} colours", colours.len());
        legends += 1;
    }
    assert_eq!(legends, 3, "heights twice and classes; a photo needs none");
    let answer = get(&router, "/wms?SERVICE=WMS&REQUEST=GetLegendGraphic&LAYER=texture").await;
    assert_eq!(answer.status, StatusCode::BAD_REQUEST);
}

#[tokio::test]
async fn feature_info_as_a_page() {
    let router = full();
    let base = format!(
        "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetFeatureInfo&LAYERS=texture,elevation&STYLES=&{BOX}&FORMAT=image/png&I=3&J=2&INFO_FORMAT=text/html"
    );
    let answer = get(&router, &format!("{base}&QUERY_LAYERS=elevation")).await;
    assert_eq!((answer.status, answer.header("content-type")), (StatusCode::OK, "text/html"));
    assert!(answer.text().contains("<th scope=\"row\">elevation</th><td>"), "{}", answer.text());
    let answer = get(&router, &format!("{base}&QUERY_LAYERS=lcc")).await;
    assert!(answer.text().contains("not among LAYERS"), "{}", answer.text());
}

#[tokio::test]
async fn world_wind_java_finds_the_extremes() {
    let router = full();
    for agent in ["Java/17.0.2", "World Wind Java 2.2"] {
        let request = Request::get("/wms?SERVICE=WMS&REQUEST=GetCapabilities")
            .header("user-agent", agent)
            .body(Body::empty())
            .unwrap();
        let text = ask(&router, request).await.text();
        assert_eq!(text.matches("<ExtremeElevations min=\"0\" max=\"").count(), 2, "{text}");
    }
}
