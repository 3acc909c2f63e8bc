//! Flights of the real engine: over a bad connection, at speed, at random, and with too little memory. The long
//! forms are in the bench `flight`.

use treeline_client::engine::EngineOptions;
use treeline_client::stream::StreamOptions;
use treeline_client::stream::tile_choice::TileChoice;
use treeline_core::camera::GeographicCamera;
use treeline_tests::flight_link::LinkQuality;
use treeline_tests::flight_path::{RandomFlight, ahead};
use treeline_tests::flight_simulation::{Flight, Tally};
use treeline_tests::flight_world;
use treeline_tests::picture;

const SIZE: [u32; 2] = [192, 144];

fn options(stream: StreamOptions) -> EngineOptions {
    EngineOptions { stream, ..EngineOptions::default() }
}

fn camera(above: f64, heading_deg: f64, pitch_deg: f64) -> GeographicCamera {
    let (lon, lat) = (11.03, 47.03);
    let height = flight_world::height(lon, lat) + above;
    GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 50.0 }
}

/// What must not happen in any frame, however bad the connection.
fn assert_sound(tally: &Tally, name: &str) {
    println!("{name}: {tally:?}");
    let faults = [
        tally.frames_with_hole,
        tally.open_squares,
        tally.needless_requests,
        tally.over_budget,
        tally.evicted_in_sight,
    ];
    assert_eq!(
        faults, [0; 5],
        "{name}: holes, open squares, needless requests, over budget, evicted in sight"
    );
}

#[test]
fn a_bad_connection_shows_no_hole_and_settles_to_the_same_picture() {
    let mut bad = Flight::new(options(StreamOptions::default()), LinkQuality::BAD, SIZE).unwrap();
    let start = camera(500.0, 70.0, -12.0);
    for step in 0..120 {
        bad.frame(ahead(start, 60.0 * 0.1 * f64::from(step))).unwrap();
    }
    let end = ahead(start, 720.0);
    bad.settle(end, 600.0).unwrap();
    assert_sound(&bad.tally, "bad connection");
    assert!(bad.tally.frames > 60, "{:?}", bad.tally);
    let stats = bad.engine.stats();
    assert!(stats.requests.failed > 1, "{:?}", stats.requests);
    // Everything is resident: the quadtree knows of nothing that hides, and has room for all.
    let all = StreamOptions {
        tile_choice: TileChoice::Cpu,
        memory_budget_bytes: 1 << 30,
        ..StreamOptions::default()
    };
    let mut good = Flight::new(options(all), LinkQuality::FAST, SIZE).unwrap();
    good.judges_pixels = false;
    good.settle(end, 60.0).unwrap();
    let (bad, good) = (bad.picture().unwrap(), good.picture().unwrap());
    let difference = picture::difference(&bad, &good, 24);
    println!("against everything resident: {difference:?}");
    if difference.mean >= 0.5 || difference.share_over >= 0.005 {
        picture::keep("flight-bad", &bad).unwrap();
        picture::keep("flight-good", &good).unwrap();
    }
    assert!(difference.mean < 0.5 && difference.share_over < 0.005, "{difference:?}");
}

#[test]
fn at_a_hundred_metres_a_second_what_is_in_sight_is_named() {
    let mut flight = Flight::new(options(StreamOptions::default()), LinkQuality::FAST, SIZE).unwrap();
    // Over all hills.
    let start = GeographicCamera { height: flight_world::highest() + 60.0, ..camera(0.0, 20.0, -10.0) };
    flight.settle(start, 60.0).unwrap();
    flight.tally = Tally::default();
    for step in 1..=120 {
        flight.frame(ahead(start, 100.0 * 0.1 * f64::from(step))).unwrap();
    }
    let tally = flight.tally;
    assert_sound(&tally, "100 m/s");
    let survey = flight.engine.stats().survey.unwrap();
    println!("recall {:.4}, {survey:?}", tally.recall());
    assert!(tally.recall() >= 0.98, "{} of {}", tally.named_in_time, tally.needed);
    assert_eq!(tally.never_named, 0);
}

#[test]
fn a_random_flight_with_jumps_keeps_its_promises() {
    // Too little for most of its views.
    let stream = StreamOptions { memory_budget_bytes: 60_000_000, ..StreamOptions::default() };
    let quality = LinkQuality { bytes_per_second: 2e6, fails_one_in: 10, ..LinkQuality::BAD };
    let mut flight = Flight::new(options(stream), quality, SIZE).unwrap();
    for camera in RandomFlight::new(7).take(140) {
        flight.frame(camera).unwrap();
    }
    assert_sound(&flight.tally, "random flight");
    assert!(flight.tally.frames > 100);
}

#[test]
fn a_still_camera_makes_no_map_and_asks_for_nothing() {
    let mut flight = Flight::new(options(StreamOptions::default()), LinkQuality::FAST, SIZE).unwrap();
    let still = camera(400.0, 200.0, -15.0);
    flight.settle(still, 60.0).unwrap();
    let before = flight.engine.stats();
    for _ in 0..30 {
        let report = flight.frame(still).unwrap();
        assert!(!report.drawn && report.settled && report.requests.is_empty() && report.cancelled.is_empty());
    }
    let after = flight.engine.stats();
    let made = |survey: Option<treeline_client::survey::SurveyStats>| survey.unwrap().made;
    assert_eq!(made(before.survey), made(after.survey));
    assert_eq!((before.frames, before.requests), (after.frames, after.requests));
}

#[test]
fn the_horizon_from_a_summit_fits_into_little_memory() {
    let stream = StreamOptions { memory_budget_bytes: 55_000_000, ..StreamOptions::default() };
    let mut flight = Flight::new(options(stream), LinkQuality::FAST, [256, 192]).unwrap();
    let summit = camera(250.0, 240.0, -4.0);
    flight.settle(summit, 300.0).unwrap();
    let threshold = flight.engine.threshold().unwrap();
    let first = flight.picture().unwrap();
    assert!(threshold > 1.0, "the budget is no hard case");
    for _ in 0..20 {
        assert!(flight.frame(summit).unwrap().settled, "it rests");
    }
    // By another way to the same view: the same threshold, the same picture.
    for view in [camera(3_000.0, 0.0, -60.0), camera(20.0, 100.0, 0.0), summit] {
        flight.settle(view, 300.0).unwrap();
    }
    assert_sound(&flight.tally, "summit");
    assert_eq!(flight.engine.threshold().unwrap(), threshold);
    let difference = picture::difference(&first, &flight.picture().unwrap(), 24);
    println!("threshold {threshold:.3}, {difference:?}, {:?}", flight.engine.stats().memory);
    assert!(difference.mean < 0.5 && difference.share_over < 0.005, "{difference:?}");
}
