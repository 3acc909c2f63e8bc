//! Trees drawn one by one: those of the map, where the map has them, the same whatever came first, and none where
//! nothing grows.

use glam::Vec4;
use std::collections::{HashMap, HashSet};
use std::sync::Mutex;
use treeline_client::engine::{Engine, EngineOptions, ViewRequest, Weather};
use treeline_client::headless::trees::instances;
use treeline_client::headless::{self, AdapterChoice, Capture, Fetched, SelectedTree, Session, TileFetcher};
use treeline_client::stream::StreamOptions;
use treeline_client::stream::requests::FetchFailure;
use treeline_client::stream::tile_choice::TileChoice;
use treeline_core::camera::GeographicCamera;
use treeline_core::codec::land_cover::LandCoverTile;
use treeline_core::geodesy::EQUATOR_METRES;
use treeline_core::layer::Layer;
use treeline_core::query::get_map_query;
use treeline_core::seeds::{Species, Stand, pattern};
use treeline_core::tile::TileAddress;
use treeline_shaders::layout::{EMPTY, Leaf};
use treeline_shaders::trees::{PRIMARY, SeedCell};
use treeline_shaders::twin::select_trees::{SeedTexels, SeedWorld, Selected, placed_tree, select_trees};
use treeline_tests::router_tiles::RouterTiles;

const SIZE: [u32; 2] = [192, 144];
/// Metres of a degree of latitude.
const DEGREE_METRES: f64 = EQUATOR_METRES / 360.0;

fn view(camera: GeographicCamera) -> ViewRequest {
    ViewRequest {
        camera,
        width: SIZE[0],
        height: SIZE[1],
        sun_unix_seconds: None,
        shadow_steps: 0,
        weather: Weather::default(),
    }
}

/// Over the built-in landscape's forest.
fn camera(height: f64, pitch_deg: f64) -> GeographicCamera {
    GeographicCamera { lon: 10.5, lat: 46.5, height, heading_deg: 40.0, pitch_deg, fov_y_deg: 50.0 }
}

fn session(tiles: &RouterTiles, tree_metres: f64, tile_choice: TileChoice) -> Session {
    let gpu = headless::open(AdapterChoice::Software).unwrap();
    let options = EngineOptions {
        stream: StreamOptions { fade_seconds: 0.0, tile_choice, ..StreamOptions::default() },
        tree_metres: Some(tree_metres),
        uploads_per_step: usize::MAX,
        ..EngineOptions::default()
    };
    Session::new(Engine::new(gpu, tiles.scene().unwrap(), options).unwrap(), SIZE[0], SIZE[1], 2).unwrap()
}

fn trees(tiles: &RouterTiles, camera: GeographicCamera, metres: f64) -> Vec<SelectedTree> {
    let mut session = session(tiles, metres, TileChoice::LoadMap);
    session.settle(&view(camera), tiles).unwrap();
    session.trees().unwrap()
}

/// Heights in a box, samples row by row from the north-west.
fn heights(tiles: &RouterTiles, layer: &str, bounds: [f64; 4], side: u32) -> Vec<f32> {
    let [west, south, east, north] = bounds;
    let url = format!(
        "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS={layer}&STYLES=&CRS=CRS:84&BBOX={west},{south},{east},{north}&WIDTH={side}&HEIGHT={side}&FORMAT=application/bil32"
    );
    bytemuck::pod_collect_to_vec(&tiles.get(&url).unwrap())
}

/// What the ground under a place is by the map: the largest crown of a list there, or nothing.
fn crown_over(
    trees: &[SelectedTree],
    species: &[Species],
    longitude: f64,
    latitude: f64,
    but: Option<usize>,
) -> f64 {
    let unit_x = DEGREE_METRES * latitude.to_radians().cos();
    let mut highest = f64::NEG_INFINITY;
    for (index, tree) in trees.iter().enumerate() {
        if but == Some(index) {
            continue;
        }
        let (dx, dy) = ((tree.longitude - longitude) * unit_x, (tree.latitude - latitude) * DEGREE_METRES);
        if dx.abs().max(dy.abs()) > 20.0 {
            continue;
        }
        let kind = &species[usize::from(tree.species) - 1];
        let surface = kind.crown_surface(tree.height_metres as f32, dx.hypot(dy) as f32);
        if let Some(surface) = surface {
            highest = highest.max(tree.ground_metres + f64::from(surface));
        }
    }
    highest
}

fn table(tiles: &RouterTiles) -> Vec<Species> {
    let scene = tiles.scene().unwrap();
    scene
        .species
        .iter()
        .map(|species| Species::new(species.code, species.definition.clone()).unwrap())
        .collect()
}

/// Every tree's top is what the combined map has at its stem, but under a higher crown; and all that the map has over
/// the ground in the middle of the picture is the crown of a tree in the list.
#[test]
fn the_list_and_the_map_are_one_forest() {
    let tiles = RouterTiles::built_in().unwrap();
    let species = table(&tiles);
    // Straight down on a wood.
    let camera = GeographicCamera { pitch_deg: -90.0, heading_deg: 0.0, ..forest_camera(&tiles, 180.0) };
    let trees = trees(&tiles, camera, 400.0);
    assert!(trees.len() > 300, "{} trees", trees.len());
    let (mut near, mut alone, mut alone_near) = (0, 0, 0);
    let asked: Vec<usize> = (0..trees.len()).step_by((trees.len() / 150).max(1)).collect();
    for &index in &asked {
        let tree = &trees[index];
        // A pixel a tenth of a metre wide, the stem at its centre.
        let half = 0.05 / DEGREE_METRES;
        let bounds =
            [tree.longitude - half, tree.latitude - half, tree.longitude + half, tree.latitude + half];
        let map = f64::from(heights(&tiles, "combined-elevation", bounds, 1)[0]);
        let top = tree.ground_metres + tree.height_metres;
        assert!(map >= top - 0.25, "the map is at {map} m where a tree reaches {top} m");
        let is_near = (map - top).abs() <= 0.25;
        near += usize::from(is_near);
        if crown_over(&trees, &species, tree.longitude, tree.latitude, Some(index)) <= top {
            alone += 1;
            alone_near += usize::from(is_near);
        }
    }
    println!("{near} of {} tops within 0.25 m; {alone_near} of {alone} under no other crown", asked.len());
    assert_eq!(alone_near, alone);
    assert!(100 * near >= 95 * asked.len());

    let half = 40.0 / DEGREE_METRES;
    let half_x = half / camera.lat.to_radians().cos();
    let bounds = [camera.lon - half_x, camera.lat - half, camera.lon + half_x, camera.lat + half];
    let side = 100;
    let combined = heights(&tiles, "combined-elevation", bounds, side);
    let ground = heights(&tiles, "elevation", bounds, side);
    let mut crowns = 0;
    for (index, (&map, &ground)) in combined.iter().zip(&ground).enumerate() {
        let (column, row) = (index as u32 % side, index as u32 / side);
        let share = |pixel: u32| (f64::from(pixel) + 0.5) / f64::from(side);
        let longitude = bounds[0] + share(column) * (bounds[2] - bounds[0]);
        let latitude = bounds[3] - share(row) * (bounds[3] - bounds[1]);
        let crown = crown_over(&trees, &species, longitude, latitude, None);
        let expected = crown.max(f64::from(ground));
        crowns += usize::from(map > ground + 0.5);
        assert!(
            (f64::from(map) - expected).abs() < 0.05,
            "the map has {map} m at {longitude}, {latitude}, the trees {expected} m"
        );
    }
    assert!(crowns > combined.len() / 3, "{crowns} of {} samples show a crown", combined.len());
}

/// A place in the wood, so many metres above the crowns.
fn forest_camera(tiles: &RouterTiles, above: f64) -> GeographicCamera {
    // The first cell of a coarse grid over the landscape's middle with trees all round.
    for step in 0..400 {
        let (lon, lat) = (10.86 + 0.01 * f64::from(step % 20), 46.86 + 0.006 * f64::from(step / 20));
        let half = 60.0 / DEGREE_METRES;
        let bounds = [lon - 1.4 * half, lat - half, lon + 1.4 * half, lat + half];
        let combined = heights(tiles, "combined-elevation", bounds, 80);
        let ground = heights(tiles, "elevation", bounds, 80);
        let wooded = combined.iter().zip(&ground).filter(|(map, ground)| **map > **ground + 5.0).count();
        if wooded > combined.len() / 2 {
            let top = combined.iter().fold(f32::MIN, |top, &map| top.max(map));
            return GeographicCamera { lon, lat, ..camera(f64::from(top) + above, -30.0) };
        }
    }
    panic!("the built-in landscape has no wood");
}

/// Answers late and out of order: which tiles come first must not matter.
struct Reordered<'a> {
    tiles: &'a RouterTiles,
    count: Mutex<u32>,
}

impl TileFetcher for Reordered<'_> {
    fn fetch(&self, url: &str) -> Result<Fetched, FetchFailure> {
        let mut count = self.count.lock().unwrap();
        *count += 1;
        // Every third answer fails at first.
        if *count % 3 == 1 && *count < 40 {
            return Err(FetchFailure::Temporary("503".into()));
        }
        drop(count);
        self.tiles.fetch(url)
    }
}

#[test]
fn the_list_is_the_same_twice_and_whatever_came_first() {
    let tiles = RouterTiles::built_in().unwrap();
    let camera = GeographicCamera { pitch_deg: -12.0, ..forest_camera(&tiles, 40.0) };
    let first = trees(&tiles, camera, 400.0);
    assert!(first.len() > 200, "{} trees", first.len());
    assert!(tiles.asked("LAYERS=lcc") > 0);
    let mut again = session(&tiles, 400.0, TileChoice::LoadMap);
    again.settle(&view(camera), &Reordered { tiles: &tiles, count: Mutex::default() }).unwrap();
    assert_eq!(again.trees().unwrap(), first);
    let stats = again.engine.stats();
    // One draw a species and level at most, and models of those species alone that are near.
    assert!(stats.pipelines.contains(&"trees"));
    assert_eq!(instances(&again.engine).unwrap().len(), 4 * table(&tiles).len());
    let asked = tiles.asked("/trees/");
    assert!(asked > 0 && asked <= 4 * table(&tiles).len(), "{asked} models");
    let seeds = stats.seeds.unwrap();
    assert_eq!(seeds.selected as usize, first.len());
    assert!(seeds.checked > seeds.selected, "{seeds:?}");
    let drawn: HashSet<(u8, u8)> = first.iter().map(|tree| (tree.species, tree.level)).collect();
    assert!(seeds.draw_calls as usize >= drawn.len(), "{seeds:?}");
    assert!(seeds.draw_calls as usize <= 4 * table(&tiles).len(), "{seeds:?}");
    assert!(first.iter().all(|tree| tree.level < 4 && tree.height_metres > 0.5));
    // Chosen by the quadtree the same trees are there: nothing that the map hides is seen.
    let mut by_quadtree = session(&tiles, 400.0, TileChoice::Cpu);
    by_quadtree.settle(&view(camera), &tiles).unwrap();
    let others = by_quadtree.trees().unwrap();
    let missing = first.iter().filter(|tree| !others.contains(tree)).count();
    assert!(missing * 200 <= first.len(), "{missing} of {} are missing", first.len());
}

#[test]
fn where_no_trees_are_wanted_or_near_nothing_is_asked_for_or_compiled() {
    let tiles = RouterTiles::built_in().unwrap();
    let near = forest_camera(&tiles, 40.0);
    let far = GeographicCamera { height: near.height + 5_000.0, ..near };
    for (camera, metres) in [(near, 0.0), (far, 400.0)] {
        let mut session = session(&tiles, metres, TileChoice::LoadMap);
        session.settle(&view(camera), &tiles).unwrap();
        assert!(session.trees().unwrap().is_empty());
        let stats = session.engine.stats();
        assert_eq!(stats.seeds, None);
        assert!(!stats.pipelines.contains(&"select_trees") && !stats.pipelines.contains(&"trees"));
        assert!(!stats.tiles.contains_key("lcc"), "{:?}", stats.tiles);
    }
    assert_eq!((tiles.asked("LAYERS=lcc"), tiles.asked("/trees/")), (0, 0));
}

/// What the selection had bound, read from the router and from the frame.
struct Bound<'a> {
    /// By slot.
    tiles: HashMap<u32, LandCoverTile>,
    capture: &'a Capture,
    leaves: &'a [Leaf],
}

impl SeedTexels for Bound<'_> {
    fn stand(&self, slot: u32, column: u32, row: u32) -> Stand {
        let tile = &self.tiles[&slot];
        let index = (row * tile.side + column) as usize;
        let stands = tile.stands.as_ref().unwrap();
        Stand {
            species: tile.codes[index] as u8,
            closure: stands.closures[index],
            height: stands.heights[index],
        }
    }

    fn anchor(&self, slot: u32, column: u32, row: u32) -> i32 {
        let anchors = self.tiles[&slot].anchors.as_ref().unwrap();
        anchors.quanta[(row * anchors.width + column) as usize]
    }

    fn distance(&self, x: u32, y: u32) -> f32 {
        self.capture.distance[(y * SIZE[0] + x) as usize]
    }

    fn is_fine(&self, x: u32, y: u32) -> bool {
        let leaf = self.capture.hit[(y * SIZE[0] + x) as usize][0];
        leaf != EMPTY && self.leaves[leaf as usize].cell_metres[1] <= 1.8
    }
}

/// The GPU's list is the twin's: the same trees in the same order, on the same levels.
#[test]
fn the_twin_selects_the_same_trees_in_the_same_order() {
    let tiles = RouterTiles::built_in().unwrap();
    let scene = tiles.scene().unwrap();
    let levels = scene.land_cover.unwrap();
    for (above, pitch_deg, metres) in [(40.0, -12.0, 400.0), (3.0, -15.0, 250.0), (300.0, -60.0, 700.0)] {
        let camera = GeographicCamera { pitch_deg, ..forest_camera(&tiles, above) };
        let mut session = session(&tiles, metres, TileChoice::LoadMap);
        session.settle(&view(camera), &tiles).unwrap();
        let capture = session.capture().unwrap();
        let engine = &session.engine;
        let seeds = engine.drawn_seeds().unwrap();
        let tile_of = |cell: &SeedCell| {
            let [column, row] = cell.cell;
            TileAddress { level: pattern::LEVEL, row, column }.ancestor(levels.l1).unwrap()
        };
        let decoded = seeds.cells.iter().map(|cell| {
            let url = format!("/wms?{}", get_map_query(Layer::Lcc, tile_of(cell), &scene.revision));
            (cell.slot, url)
        });
        let decoded: HashMap<u32, String> = decoded.collect();
        let bound = Bound {
            tiles: decoded
                .into_iter()
                .map(|(slot, url)| (slot, LandCoverTile::decode(&tiles.get(&url).unwrap()).unwrap()))
                .collect(),
            capture: &capture,
            leaves: &engine.drawn_tables().unwrap().leaves,
        };
        let world = SeedWorld {
            view: engine.drawn_view().unwrap(),
            frame: &seeds.frame,
            species: &table(&tiles),
            texels: &bound,
        };
        let expected = select_trees(&world, &seeds.cells);
        let found = instances(engine).unwrap();
        assert_eq!(found.len(), expected.len());
        let (mut all, mut apart) = (0, 0);
        for (found, expected) in found.iter().zip(&expected) {
            let word = |tree: &Selected| tree.cell << 10 | tree.sub_cell[0] << 5 | tree.sub_cell[1];
            let places: HashMap<(u32, bool), &Selected> =
                expected.iter().map(|tree| ((word(tree), tree.second), tree)).collect();
            let order: Vec<u32> = found.iter().map(|tree| tree.seed).collect();
            assert!(order.is_sorted(), "by cell, column and row");
            all += expected.len();
            apart += found.len().abs_diff(expected.len());
            for tree in found {
                let second = tree.height_units & PRIMARY == 0;
                // Rounding may decide otherwise at the very edge of a test.
                let Some(twin) = places.get(&(tree.seed, second)) else {
                    apart += 1;
                    continue;
                };
                assert_eq!(tree.ground, twin.tree.ground);
                assert_eq!(tree.height_units & (PRIMARY - 1), twin.tree.height);
                assert_eq!(tree.look as u8, twin.tree.rotation);
                let cell = &seeds.cells[twin.cell as usize];
                let foot = placed_tree(&world, cell, &twin.tree).foot;
                let apart = (Vec4::from(tree.foot_height).truncate() - foot).length();
                assert!(apart < 2e-3, "{apart} m");
            }
        }
        println!("{above} m up: {all} instances, {apart} apart");
        assert!(all > 100 && apart * 500 <= all, "{apart} of {all}");
    }
}
