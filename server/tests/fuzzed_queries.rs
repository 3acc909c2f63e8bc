//! Queries that nobody writes, thousands of them: each gets an answer that says what is wrong with it, none a 5xx, and none
//! takes the server down. What is found is the same in every run: the generator is seeded.

mod common;

use axum::http::StatusCode;
use common::{full, get};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use std::cell::RefCell;

/// Requests of a run; `TREELINE_QUERIES` in the environment for more.
const QUERIES: u32 = 4_000;

const PATHS: [&str; 12] = [
    "/wms",
    "/wms",
    "/wms",
    "/wmts",
    "/world-wind",
    "/tiles/texture/WorldCRS84Quad/9/136/542",
    "/tiles/elevation/WebMercatorQuad/9/181/271",
    "/tiles/lcc/%2e%2e/9/0/0",
    "/tiles/combined-elevation/WorldCRS84Quad/99/0/-1",
    "/wmts/1.0.0/texture/default/WorldCRS84Quad/9/136/542.png",
    "/trees/1",
    "/tiles",
];

/// Parameters of all the protocols, and one without a name.
const NAMES: &str = "SERVICE VERSION REQUEST LAYERS STYLES CRS SRS BBOX WIDTH HEIGHT FORMAT TRANSPARENT BGCOLOR EXCEPTIONS \
                     TIME ELEVATION QUERY_LAYERS INFO_FORMAT I J X Y FEATURE_COUNT LAYER TILEMATRIXSET TILEMATRIX TILEROW \
                     TILECOL T L D S f UPDATESEQUENCE SLD ";

const VALUES: [&str; 64] = [
    "WMS",
    "WMTS",
    "1.1.1",
    "1.3.0",
    "1.0.0",
    "9.9.9",
    "1..3",
    "GetMap",
    "GetCapabilities",
    "GetFeatureInfo",
    "GetTile",
    "GetLegendGraphic",
    "GetStyles",
    "texture",
    "elevation",
    "combined-elevation",
    "lcc",
    "texture,lcc",
    ",",
    ",,,,",
    "CRS:84",
    "EPSG:4326",
    "EPSG:3857",
    "EPSG:32632",
    "EPSG:999999",
    "EPSG:",
    "AUTO:42001,9001,0,0",
    "10,46,11,47",
    "46,10,47,11",
    "11,47,10,46",
    "10,46,10,46",
    "nan,nan,nan,nan",
    "inf,-inf,inf,-inf",
    "1e308,1e308,-1e308,1e309",
    "10,46,11",
    "10,46,11,47,12",
    "1e1,4.6e1,1.1e1,4.7e1",
    "-20037508.34,-20037508.34,20037508.34,20037508.34",
    "0",
    "1",
    "2",
    "64",
    "-1",
    "1.5",
    "4096",
    "99999999999999999999",
    "0x10",
    " 7 ",
    "NaN",
    "image/png",
    "image/jpeg",
    "application/bil16",
    "application/bil32",
    "image/x-bil;bits=32",
    "text/html",
    "application/json",
    "TRUE",
    "0xFFFFFF",
    "INIMAGE",
    "BLANK",
    "../../etc/passwd",
    "<script>&\"'",
    "\u{0}\u{7}\u{fffe}",
    "%",
];

/// A query that is right, of which a few parameters are then put otherwise.
const RIGHT: [(&str, &str); 10] = [
    ("SERVICE", "WMS"),
    ("VERSION", "1.3.0"),
    ("REQUEST", "GetMap"),
    ("LAYERS", "texture"),
    ("STYLES", ""),
    ("CRS", "CRS:84"),
    ("BBOX", "10.1,46.1,10.2,46.2"),
    ("WIDTH", "16"),
    ("HEIGHT", "16"),
    ("FORMAT", "image/png"),
];

fn percent(text: &str, raw: bool) -> String {
    text.bytes()
        .map(|byte| match byte {
            b'a'..=b'z'
            | b'A'..=b'Z'
            | b'0'..=b'9'
            | b'.'
            | b','
            | b':'
            | b'/'
            | b'-'
            | b'_'
            | b';'
            | b'=' => (byte as char).to_string(),
            b'%' | b'&' if raw => (byte as char).to_string(),
            _ => format!("%{byte:02X}"),
        })
        .collect()
}

fn value() -> impl Strategy<Value = String> {
    prop_oneof![
        6 => prop::sample::select(&VALUES[..]).prop_map(str::to_owned),
        1 => "[ -~]{0,12}",
        1 => "\\PC{0,8}",
        1 => prop::collection::vec(any::<f64>(), 4).prop_map(|four| four.iter().map(f64::to_string).collect::<Vec<_>>().join(",")),
        1 => any::<i64>().prop_map(|number| number.to_string()),
        1 => (1_usize..400).prop_map(|count| "texture,".repeat(count)),
    ]
}

fn query() -> impl Strategy<Value = String> {
    let pair =
        (prop::sample::select(NAMES.split(' ').collect::<Vec<_>>()), value(), any::<bool>(), any::<bool>());
    let path = prop::sample::select(&PATHS[..]);
    (path, any::<[bool; 10]>(), prop::collection::vec(pair, 0..5), 0_u8..4).prop_map(
        |(path, kept, pairs, mostly)| {
            let right = RIGHT.iter().zip(kept).filter(|(_, kept)| *kept || mostly > 0);
            let mut query: Vec<String> = right.map(|((name, value), _)| format!("{name}={value}")).collect();
            for (name, value, lower, raw) in pairs {
                let name = if lower { name.to_lowercase() } else { name.to_owned() };
                // In place of the right one, or beside it: the first or the last may be meant.
                if !raw {
                    query.retain(|pair| {
                        !pair.to_lowercase().starts_with(&format!("{}=", name.to_lowercase()))
                    });
                }
                query.push(format!("{name}={}", percent(&value, raw)));
            }
            format!("{path}?{}", query.join("&"))
        },
    )
}

#[test]
fn every_query_has_an_answer_and_none_is_the_servers_fault() {
    let cases = std::env::var("TREELINE_QUERIES").map_or(QUERIES, |text| text.parse().unwrap());
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
    let router = full();
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]));
    let counts = RefCell::new(std::collections::BTreeMap::<u16, u32>::new());
    runner
        .run(&query(), |query| {
            // What is no address at all does not get past the parser of HTTP.
            prop_assume!(query.parse::<axum::http::Uri>().is_ok());
            let answer = runtime.block_on(get(&router, &query));
            *counts.borrow_mut().entry(answer.status.as_u16()).or_default() += 1;
            prop_assert!(!answer.status.is_server_error(), "{}: {}", answer.status, answer.text());
            if answer.status.is_client_error() {
                prop_assert!(
                    answer.body.len() < 20_000,
                    "{} bytes to say {}",
                    answer.body.len(),
                    answer.status
                );
                prop_assert!(!answer.body.is_empty(), "nothing is said: {}", answer.status);
                let kind = answer.header("content-type").to_owned();
                let plain = kind.starts_with("image/")
                    || kind.starts_with("text/plain") && answer.header("x-content-type-options") == "nosniff";
                prop_assert!(
                    plain || !answer.text().contains("<script"),
                    "markup comes back: {}",
                    answer.text()
                );
            }
            Ok(())
        })
        .unwrap();
    let counts = counts.into_inner();
    println!("answers by status: {counts:?}");
    // Were all refused at the door, nothing would have been tried.
    assert!(counts[&200] > cases / 20 && counts[&400] > cases / 20, "{counts:?}");
    let good = runtime.block_on(get(
        &router,
        &format!("/wms?{}", RIGHT.map(|(name, value)| format!("{name}={value}")).join("&")),
    ));
    assert_eq!(good.status, StatusCode::OK);
}
