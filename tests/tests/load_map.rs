//! The Tile Load Map: the GPU against its twin, and the twin against the truth of many rays a pixel.

use std::collections::BTreeSet;
use std::sync::LazyLock;
use treeline_core::camera::GeographicCamera;
use treeline_core::tile::TileAddress;
use treeline_server::source::{HeightField, SampleGrid, procedural};
use treeline_shaders::load_map::{VISIBLE, WANTED};
use treeline_tests::load_map::{DEEPEST, Scene, analytic_world, ground, world_about};
use treeline_tests::tile_world::TileWorld;

const SIZE: [u32; 2] = [160, 128];

fn alps() -> &'static TileWorld {
    static WORLD: LazyLock<TileWorld> = LazyLock::new(analytic_world);
    &WORLD
}

/// The built-in scene's ground.
fn built_in() -> TileWorld {
    let field = procedural::height();
    let (lon, lat) = field.extent().bounds.centre();
    world_about(lon - 0.08, lat + 0.08, &|window| {
        let mut heights = vec![0.0; (window.width * window.height) as usize];
        field.sample(&SampleGrid::Lattice(*window), &mut heights).expect("the field answers everywhere");
        heights
    })
}

/// Views over the middle of a world, oblique ones and panoramas: pitch, and height above the ground.
fn views(world: &TileWorld) -> Vec<(&'static str, GeographicCamera)> {
    let (root, _) = world.roots();
    let bounds = root.bounds();
    let camera = |east: f64, north: f64, above: f64, heading_deg: f64, pitch_deg: f64| {
        let (lon, lat) = (bounds.east + east, bounds.south + north);
        let height = ground(world, lon, lat) + above;
        GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 50.0 }
    };
    vec![
        ("oblique", camera(0.0, 0.0, 900.0, 40.0, -25.0)),
        ("oblique from high", camera(-0.02, -0.03, 3_000.0, 20.0, -35.0)),
        ("low oblique", camera(0.01, 0.01, 250.0, 200.0, -15.0)),
        ("oblique from near", camera(-0.015, 0.02, 120.0, 110.0, -20.0)),
        ("panorama", camera(0.0, -0.02, 60.0, 300.0, -4.0)),
        ("panorama to the east", camera(-0.02, 0.01, 150.0, 85.0, -3.0)),
        ("panorama from the ground", camera(-0.01, 0.0, 20.0, 130.0, 2.0)),
        ("down", camera(0.0, 0.0, 1_500.0, 0.0, -90.0)),
    ]
}

#[test]
fn the_gpu_answers_as_its_twin() {
    let world = alps();
    for (name, camera) in views(world) {
        let mut scene =
            Scene::new(world, camera, SIZE, DEEPEST, Some(7), Some(glam::DVec3::new(60.0, 200.0, 5.0)));
        scene.stack.frame.elevation_level = 14;
        let answer = scene.by_gpu();
        let twin = scene.by_twin(&answer.distances, &answer.hits);
        assert_eq!(answer.pixels, twin.pixels, "{name}: pixels by cell");
        let other: Vec<usize> =
            (0..twin.cells.len()).filter(|&cell| answer.cells[cell] != twin.cells[cell]).collect();
        let named = twin.cells.iter().filter(|&&word| word != 0).count();
        println!(
            "{name}: {named} cells have a word, {} candidates, {} differ",
            twin.candidates.len(),
            other.len()
        );
        for &cell in other.iter().take(4) {
            println!(
                "  {:?}: {:08x} {:08x}",
                scene.stack.address(cell),
                answer.cells[cell],
                twin.cells[cell]
            );
        }
        // Boxes that touch a threshold may fall either way where the GPU contracts multiplication and addition.
        assert!(other.len() <= 2 + named / 100, "{name}: {} of {named} cells differ", other.len());
    }
}

/// Tiles that are there: the twin's pixels against the exact conversion of each pixel's distance.
#[test]
fn every_pixels_tile_is_named() {
    let world = alps();
    for (name, camera) in views(world) {
        let scene = Scene::new(world, camera, SIZE, DEEPEST, None, None);
        let (distances, hits) = scene.picture(1);
        let twin = scene.by_twin(&distances, &hits);
        let visible = scene.named(&twin.pixels, |count| count > 0);
        let counted: u32 = twin.pixels.iter().sum();
        assert_eq!(counted as usize, distances.iter().filter(|&&distance| distance >= 0.0).count(), "{name}");
        assert_eq!(visible, scene.tiles_of(&distances, &hits), "{name}");
    }
}

#[derive(Default)]
struct Tally {
    seen: usize,
    found: usize,
    named: usize,
    right: usize,
}

impl Tally {
    fn add(&mut self, truth: &BTreeSet<TileAddress>, named: &BTreeSet<TileAddress>) {
        let both = truth.intersection(named).count();
        self.seen += truth.len();
        self.found += both;
        self.named += named.len();
        self.right += both;
    }

    fn recall(&self) -> f64 {
        self.found as f64 / self.seen.max(1) as f64
    }

    fn precision(&self) -> f64 {
        self.right as f64 / self.named.max(1) as f64
    }
}

/// Holds what the map names of a world against sixteen rays a pixel: the tallies of oblique views and of panoramas.
fn tallies(world: &TileWorld) -> [Tally; 2] {
    let mut tallies = [Tally::default(), Tally::default()];
    for (name, camera) in views(world) {
        let scene = Scene::new(world, camera, SIZE, DEEPEST, None, None);
        let (distances, hits) = scene.picture(1);
        let twin = scene.by_twin(&distances, &hits);
        let named = scene.named(&twin.cells, |word| word & WANTED != 0);
        assert!(twin.cells.iter().all(|word| word & WANTED == 0 || word & VISIBLE == 1));
        let (distances, hits) = scene.picture(4);
        let truth = scene.tiles_of(&distances, &hits);
        let mut tally = Tally::default();
        tally.add(&truth, &named);
        println!(
            "{name}: {} tiles, {} named, recall {:.4}, precision {:.3}, {} candidates; missed {:?}",
            truth.len(),
            named.len(),
            tally.recall(),
            tally.precision(),
            twin.candidates.len(),
            truth.difference(&named).map(TileAddress::to_string).collect::<Vec<_>>()
        );
        tallies[usize::from(name.starts_with("panorama"))].add(&truth, &named);
    }
    tallies
}

fn check_tallies(name: &str, world: &TileWorld) {
    let [oblique, panorama] = tallies(world);
    for (kind, tally, least) in [("oblique", oblique, 0.9), ("panorama", panorama, 0.7)] {
        println!(
            "{name}, {kind}: {} tiles, recall {:.4}, precision {:.3}",
            tally.seen,
            tally.recall(),
            tally.precision()
        );
        assert!(tally.recall() >= 0.999, "{name}, {kind}: recall {}", tally.recall());
        assert!(tally.precision() >= least, "{name}, {kind}: precision {}", tally.precision());
    }
}

#[test]
fn named_are_the_tiles_that_sixteen_rays_a_pixel_hit() {
    check_tallies("analytic", alps());
}

#[test]
fn named_are_the_tiles_of_the_built_in_scene() {
    check_tallies("built-in", &built_in());
}
