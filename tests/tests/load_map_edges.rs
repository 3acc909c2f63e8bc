//! The Tile Load Map where the matrix ends: across the antimeridian and over a pole, with the real server's tiles.

use std::path::Path;
use treeline_core::camera::GeographicCamera;
use treeline_tests::geotiff::{self, Placement};
use treeline_tests::program::Server;
use treeline_tests::recall::{SIZE, Surveyor, Tally};

/// Hills of a few hundred metres; `metres`: those of a degree along each axis.
fn hills(longitude: f64, latitude: f64, metres: [f64; 2]) -> f32 {
    let (x, y) = (longitude * metres[0], latitude * metres[1]);
    (900.0 + 350.0 * (x / 700.0).sin() * (y / 900.0).cos() + 40.0 * ((x + y) / 130.0).sin()) as f32
}

fn serve(folder: &Path, placement: &Placement, height: impl Fn(f64, f64) -> f32) -> Server {
    let dem = folder.join("dem.tif");
    geotiff::write_heights(&dem, placement, height).unwrap();
    Server::start(&["--dem", dem.to_str().unwrap()]).unwrap()
}

fn camera(lon: f64, lat: f64, height: f64, heading_deg: f64, pitch_deg: f64) -> GeographicCamera {
    GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 50.0 }
}

#[test]
fn across_the_antimeridian_the_map_names_what_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    // 22 km on either side, 45° north, cells of some 22 m by 31 m.
    let placement = Placement { west: 179.72, north: 45.15, step: [2.8e-4; 2], columns: 2_000, rows: 1_072 };
    let metres = [78_800.0, 111_100.0];
    let server = serve(folder.path(), &placement, |longitude, latitude| {
        // One land, whichever way its longitudes are counted.
        hills(longitude - 180.0, latitude, metres)
    });
    let mut surveyor = Surveyor::new(&server.url("")).unwrap();
    let mut tally = Tally::default();
    for view in [
        camera(179.93, 45.0, 1_900.0, 90.0, -30.0),
        camera(-179.95, 45.02, 1_700.0, 265.0, -32.0),
        camera(-180.0, 45.0, 4_000.0, 0.0, -90.0),
        camera(179.98, 45.0, 1_350.0, 100.0, -5.0),
    ] {
        let sight = surveyor.look(view).unwrap();
        println!(
            "{view:?}: {} needed, {} named, {} misses",
            sight.needed.len(),
            sight.named.len(),
            sight.misses
        );
        assert!(view.pitch_deg > -20.0 || sight.misses == 0, "{view:?}: {} rays meet nothing", sight.misses);
        let (west, east): (Vec<u32>, Vec<u32>) =
            sight.needed.iter().map(|tile| tile.column).partition(|&column| column < 64);
        assert!(!west.is_empty() && !east.is_empty(), "{view:?} shows both sides");
        tally.add(&sight);
    }
    println!("{tally:?}");
    assert_eq!(tally.recall_of_centres(), 1.0);
    assert!(tally.recall() >= 0.999 && tally.precision() >= 0.9, "{tally:?}");
}

#[test]
fn over_a_pole_a_view_settles_without_a_hole() {
    let folder = tempfile::tempdir().unwrap();
    // All around the South Pole, 44 km.
    let placement = Placement { west: -180.0, north: -89.6, step: [0.3, 5.0e-4], columns: 1_200, rows: 800 };
    let server = serve(folder.path(), &placement, |longitude, latitude| {
        // The same hills on a plane that touches the pole: no seam where longitudes end.
        let (sine, cosine) = longitude.to_radians().sin_cos();
        let metres = (latitude + 90.0) * 111_700.0;
        hills(metres * sine, metres * cosine, [1.0, 1.0])
    });
    let mut surveyor = Surveyor::new(&server.url("")).unwrap();
    // One after the other: what stands in the slots from the last view must not keep the next from settling.
    for view in [
        camera(-179.99, -89.97, 2_600.0, 180.0, -35.0),
        camera(10.0, -89.995, 3_500.0, 45.0, -50.0),
        // On the axis itself, looking down it.
        camera(-100.0, -90.0, 5_700.0, 90.0, -90.0),
    ] {
        let sight = surveyor.look(view).unwrap();
        println!(
            "{view:?}: {} needed, {} named, threshold {}, {} misses",
            sight.needed.len(),
            sight.named.len(),
            sight.threshold,
            sight.misses
        );
        // Only rays that pass within some metres of the axis, through more columns than a ray is followed through.
        let rays = 16 * SIZE[0] * SIZE[1];
        assert!(sight.misses as f64 <= 2e-4 * f64::from(rays), "{view:?}: {} holes", sight.misses);
        // On level L all 2^(L+1) columns meet there, more than any map or memory holds: near the eye tiles are named
        // as they are wanted, elsewhere coarser ones, or those that stand in.
        assert!(sight.named.len() >= 16, "{} tiles", sight.named.len());
    }
}

/// The tile of the coarsest map holds the nearer part of a far ridge, which shows only between pixels, and its farther part,
/// which wants a level coarser and which pixels hit.
#[test]
fn on_the_coarsest_map_every_level_in_sight_is_named() {
    let server = Server::start(&[]).unwrap();
    let mut surveyor = Surveyor::new(&server.url("")).unwrap();
    let view = camera(11.043_460_399_727_337, 46.991_962_968_371_81, 3_216.289, 47.523, -3.977);
    let sight = surveyor.look(view).unwrap();
    let mut tally = Tally::default();
    tally.add(&sight);
    println!("{tally:?}, {sight:?}");
    assert_eq!(tally.recall(), 1.0);
    assert!(tally.precision() >= 0.7, "{tally:?}");
}
