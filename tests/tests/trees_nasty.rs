//! Trees where drawing them is awkward: on a cliff, at the map's edge, near a pole; species of no height; models of
//! one triangle.

use treeline_client::engine::{Engine, EngineOptions, ViewRequest};
use treeline_client::headless::{self, AdapterChoice, Fetched, SelectedTree, Session, TileFetcher};
use treeline_client::stream::StreamOptions;
use treeline_client::stream::requests::FetchFailure;
use treeline_core::camera::GeographicCamera;
use treeline_core::geodesy::EQUATOR_METRES;
use treeline_core::scene::SceneDescription;
use treeline_core::seeds::pattern::{self, CellRow};
use treeline_core::tree_model::{Quad, TreeSpecies};
use treeline_server::cli::SceneArguments;
use treeline_server::opening;
use treeline_tests::approach::heights;
use treeline_tests::geotiff::{Placement, write_heights};
use treeline_tests::picture::contrast;
use treeline_tests::router_tiles::RouterTiles;

const SIZE: [u32; 2] = [160, 120];
const DEGREE_METRES: f64 = EQUATOR_METRES / 360.0;
/// Side of the maps made here, degrees of latitude: some 1.2 km.
const SIDE: f64 = 0.011;

/// A map with forest of 20 m everywhere, its north-western corner at a place; `height` by metres east and south.
fn wood(west: f64, north: f64, height: impl Fn(f64, f64) -> f32) -> RouterTiles {
    let folder = tempfile::tempdir().unwrap();
    let [dem, canopy] = ["dem.tif", "canopy.tif"].map(|name| folder.path().join(name));
    let shrink = (north - 0.5 * SIDE).to_radians().cos();
    let samples = 240;
    let step = SIDE / f64::from(samples);
    let placement = Placement { west, north, step: [step / shrink, step], columns: samples, rows: samples };
    let metres = |longitude: f64, latitude: f64| {
        ((longitude - west) * shrink * DEGREE_METRES, (north - latitude) * DEGREE_METRES)
    };
    write_heights(&dem, &placement, |longitude, latitude| {
        let (east, south) = metres(longitude, latitude);
        height(east, south)
    })
    .unwrap();
    write_heights(&canopy, &placement, |_, _| 20.0).unwrap();
    let arguments =
        SceneArguments { dem: Some(dem), canopy_height: Some(canopy), ..SceneArguments::default() };
    let scene = opening::open(&arguments).map_err(|error| error.to_string()).unwrap();
    // The files stay open; they may go.
    RouterTiles::of(scene).unwrap()
}

/// What is to be seen from a place: the trees, and the picture's contrast. Fails on any error of the device.
fn look(
    scene: SceneDescription,
    tiles: &dyn TileFetcher,
    camera: GeographicCamera,
    metres: f64,
) -> (Vec<SelectedTree>, f64) {
    let options = EngineOptions {
        stream: StreamOptions { fade_seconds: 0.0, ..StreamOptions::default() },
        tree_metres: Some(metres),
        uploads_per_step: usize::MAX,
        ..EngineOptions::default()
    };
    let engine = Engine::new(headless::open(AdapterChoice::Software).unwrap(), scene, options).unwrap();
    let mut session = Session::new(engine, SIZE[0], SIZE[1], 2).unwrap();
    let view = ViewRequest {
        camera,
        width: SIZE[0],
        height: SIZE[1],
        sun_unix_seconds: None,
        shadow_steps: 8,
        weather: treeline_client::engine::Weather::default(),
    };
    session.settle(&view, tiles).unwrap();
    assert_eq!(session.engine.gpu().error(), None);
    let capture = session.capture().unwrap();
    let picture = image::RgbaImage::from_raw(SIZE[0], SIZE[1], capture.rgba).unwrap();
    (session.trees().unwrap(), contrast(&picture))
}

fn camera(lon: f64, lat: f64, height: f64, heading_deg: f64, pitch_deg: f64) -> GeographicCamera {
    GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 60.0 }
}

#[test]
fn trees_on_a_cliff_stand_where_the_map_has_them() {
    // 400 m within one sample, right across the map.
    let (west, north) = (8.0, 47.0);
    let tiles = wood(west, north, |east, _| if east < 600.0 { 900.0 } else { 500.0 });
    let middle = west + 0.5 * SIDE / 47.0_f64.to_radians().cos();
    // From over the lower side toward the cliff, at half its height.
    let east = middle + 250.0 / (DEGREE_METRES * 47.0_f64.to_radians().cos());
    let view = camera(east, north - 0.5 * SIDE, 700.0, 270.0, -10.0);
    let (trees, contrast) = look(tiles.scene().unwrap(), &tiles, view, 500.0);
    assert!(trees.len() > 100 && contrast > 5.0, "{} trees, contrast {contrast}", trees.len());
    let on =
        |low: f64, high: f64| trees.iter().filter(|tree| (low..high).contains(&tree.ground_metres)).count();
    assert_eq!(on(499.0, 901.0), trees.len());
    // Some stand in the cliff itself.
    let between = on(505.0, 895.0);
    println!("{} trees, {between} of them in the cliff", trees.len());
    assert!(between > 0);
    for tree in trees.iter().step_by((trees.len() / 40).max(1)) {
        let half = 0.05 / DEGREE_METRES;
        let (lon, lat) = (tree.longitude, tree.latitude);
        let map = heights(&tiles, "combined-elevation", [lon - half, lat - half, lon + half, lat + half], 1);
        let top = tree.ground_metres + tree.height_metres;
        assert!(f64::from(map.unwrap()[0]) >= top - 0.25, "the map has less than a top at {top} m");
    }
}

#[test]
fn trees_end_with_the_map() {
    let (west, north) = (8.0, 47.0);
    let tiles = wood(west, north, |east, south| 600.0 + 20.0 * ((east + south) / 90.0).sin() as f32);
    // Over the north-western corner, straight down: three quarters of the picture lie beside the map.
    let view = camera(west, north, 780.0, 0.0, -90.0);
    let (trees, contrast) = look(tiles.scene().unwrap(), &tiles, view, 400.0);
    assert!(trees.len() > 50 && contrast > 5.0, "{} trees, contrast {contrast}", trees.len());
    let shrink = 47.0_f64.to_radians().cos();
    let inward = |tree: &SelectedTree| {
        [(tree.longitude - west) * shrink, north - tree.latitude].map(|degrees| degrees * DEGREE_METRES)
    };
    // The outermost sample's place is half a sample, 2.5 m, within.
    assert!(trees.iter().all(|tree| inward(tree).iter().all(|&metres| metres > -1.0)));
    for side in 0..2 {
        assert!(trees.iter().any(|tree| inward(tree)[side] < 12.0), "none stands near the edge");
    }
}

#[test]
fn near_a_pole_trees_stand_up_to_where_none_grow() {
    // The seeds' pattern ends where a cell has no room for two trees side by side, at about 86.42°: in this map.
    let (west, north) = (20.0, 86.424);
    let tiles = wood(west, north, |_, _| 300.0);
    let eye = (west + 0.5 * SIDE / 86.4_f64.to_radians().cos(), north - 0.8 * SIDE);
    let (trees, contrast) =
        look(tiles.scene().unwrap(), &tiles, camera(eye.0, eye.1, 360.0, 0.0, -15.0), 600.0);
    assert!(contrast > 2.0 && trees.len() > 20, "{} trees, contrast {contrast}", trees.len());
    let northernmost = trees.iter().map(|tree| tree.latitude).fold(0.0, f64::max);
    let columns = |latitude: f64| {
        CellRow::new(((90.0 - latitude) / 180.0 * f64::from(1_u32 << pattern::LEVEL)) as u32).columns
    };
    println!("{} trees up to {northernmost}°", trees.len());
    assert_eq!((columns(northernmost), columns(north)), (2, 0));
    assert!(northernmost < north - 0.2 * SIDE, "bare ground is left over");
    assert!(trees.iter().all(|tree| tree.longitude.is_finite()));
    let tiles = wood(west, 86.2, |_, _| 300.0);
    let view = camera(eye.0, 86.2 - 0.8 * SIDE, 360.0, 0.0, -15.0);
    let (south, _) = look(tiles.scene().unwrap(), &tiles, view, 600.0);
    assert!(south.len() > 50, "{} trees at 86.2°", south.len());
    // Around the pole itself nothing grows, and nothing is drawn one by one.
    let pole = wood(-180.0, 90.0, |_, _| 300.0);
    let (none, _) = look(pole.scene().unwrap(), &pole, camera(0.0, 89.9995, 400.0, 0.0, -30.0), 600.0);
    assert_eq!(none, Vec::new());
}

/// The built-in landscape with other models of trees.
struct OtherModels<'a> {
    tiles: &'a RouterTiles,
    change: fn(&mut TreeSpecies),
}

impl TileFetcher for OtherModels<'_> {
    fn fetch(&self, url: &str) -> Result<Fetched, FetchFailure> {
        let fetched = self.tiles.fetch(url)?;
        if !url.contains("/trees/") {
            return Ok(fetched);
        }
        let mut model =
            TreeSpecies::decode(&fetched.body).map_err(|error| FetchFailure::Permanent(error.to_string()))?;
        (self.change)(&mut model);
        Ok(Fetched::plain(model.encode()))
    }
}

/// One triangle, as tall as the tree, on every level: its fourth corner is its third.
fn to_one_triangle(model: &mut TreeSpecies) {
    for level in &mut model.levels {
        let mut quad = level.variants[0].first().copied().unwrap_or_default();
        let places = [[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]];
        for (corner, place) in quad.corners.iter_mut().zip(places) {
            corner.position = place;
        }
        level.variants = vec![vec![quad.snapped()]];
    }
}

/// No area at all.
fn to_nothing(model: &mut TreeSpecies) {
    for level in &mut model.levels {
        level.variants = vec![vec![Quad::default().snapped()]];
    }
}

#[test]
fn a_model_of_one_triangle_is_drawn_and_one_without_area_is_not() {
    let tiles = wood(8.0, 47.0, |_, _| 600.0);
    let scene = tiles.scene().unwrap();
    let view = camera(8.006, 47.0 - 0.7 * SIDE, 650.0, 0.0, -20.0);
    let seen: Vec<(Vec<SelectedTree>, f64)> = [to_one_triangle, to_nothing]
        .into_iter()
        .map(|change| look(scene.clone(), &OtherModels { tiles: &tiles, change }, view, 400.0))
        .collect();
    // The same trees are selected, whatever they look like.
    assert!(seen[0].0.len() > 100 && seen[0].0 == seen[1].0);
    println!("contrast with triangles {}, without {}", seen[0].1, seen[1].1);
    assert!((seen[0].1 - seen[1].1).abs() > 0.2, "triangles show");
}

#[test]
fn a_species_of_no_height_is_refused_by_the_server_and_draws_nothing_in_the_client() {
    let tiles = wood(8.0, 47.0, |_, _| 600.0);
    let mut scene = tiles.scene().unwrap();
    let mut definition = scene.species[0].definition.clone();
    (definition.lowest_metres, definition.highest_metres, definition.tallest_metres) = (0.0, 0.0, 0.0);
    let refused = treeline_core::seeds::Species::new(1, definition.clone()).unwrap_err();
    assert!(refused.contains("lowest_metres is 0"), "{refused}");
    // A server that offers it all the same: trees are left to the canopy.
    scene.species[0].definition = definition;
    let view = camera(8.006, 47.0 - 0.7 * SIDE, 650.0, 0.0, -20.0);
    let (trees, contrast) = look(scene, &tiles, view, 400.0);
    assert!(trees.is_empty() && contrast > 2.0, "{} trees, contrast {contrast}", trees.len());
}
