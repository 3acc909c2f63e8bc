//! The state machine against simulated networks: slow, lossy, with a camera that moves.

use super::decode::ElevationSummary;
use super::requests::{FetchFailure, RequestId, TileKey};
use super::tile_choice::TileChoice;
use super::view::ViewGeometry;
use super::{Stream, StreamOptions};
use std::collections::{BTreeMap, HashSet};
use treeline_core::camera::GeographicCamera;
use treeline_core::grid::Registration;
use treeline_core::layer::Layer;
use treeline_core::scene::{SceneDescription, SceneLayer, Sun};
use treeline_core::tile::{GeographicBox, TileAddress};
use treeline_shaders::layout::{EMPTY, LEAF_BIT};

const EXTENT: GeographicBox = GeographicBox { west: 10.9, south: 46.9, east: 11.4, north: 47.25 };

pub fn scene() -> SceneDescription {
    let row = |name: Layer, maximum_level| SceneLayer {
        name,
        title: name.row().title.into(),
        minimum_level: 0,
        maximum_level,
        registration: name.row().registration,
        border: name.row().border,
        client_format: name.row().client_format.into(),
        formats: vec![],
        extent: EXTENT,
    };
    assert_eq!(Layer::Texture.row().registration, Registration::Cell);
    SceneDescription {
        name: "simulated".into(),
        revision: "1".into(),
        wms: "/wms?".into(),
        attribution: vec![],
        extent: EXTENT,
        minimum_height: 400.0,
        maximum_height: 3_000.0,
        layers: vec![row(Layer::Elevation, 14), row(Layer::CombinedElevation, 16), row(Layer::Texture, 16)],
        vegetation: true,
        land_cover: None,
        species: vec![],
        trees: None,
        seed: 1,
        sun: Sun { time: "2026-07-15T09:00:00Z".into() },
        camera: camera(0.0),
        places: vec![],
    }
}

/// Without a GPU the quadtree chooses.
fn options() -> StreamOptions {
    StreamOptions { tile_choice: TileChoice::Cpu, ..StreamOptions::default() }
}

fn camera(path: f64) -> GeographicCamera {
    GeographicCamera {
        lon: 11.1 + 0.1 * path,
        lat: 46.95 + 0.1 * path,
        height: 3_400.0 - 1_000.0 * path,
        heading_deg: 20.0 + 300.0 * path,
        pitch_deg: -20.0,
        fov_y_deg: 50.0,
    }
}

struct Link {
    bytes_per_second: f64,
    latency: f64,
    fails_one_in: u64,
    /// When the link is free again.
    busy_until: f64,
    under_way: Vec<(f64, RequestId, TileKey)>,
    asked: u64,
}

impl Link {
    fn new(bytes_per_second: f64, latency: f64, fails_one_in: u64) -> Self {
        Self { bytes_per_second, latency, fails_one_in, busy_until: 0.0, under_way: Vec::new(), asked: 0 }
    }

    fn ask(&mut self, now: f64, id: RequestId, key: TileKey) {
        let bytes = if key.layer == Layer::Texture { 56_000.0 } else { 90_000.0 };
        self.busy_until = self.busy_until.max(now) + bytes / self.bytes_per_second;
        self.under_way.push((self.busy_until + self.latency, id, key));
        self.asked += 1;
    }

    fn arrivals(&mut self, now: f64) -> Vec<(RequestId, TileKey, bool)> {
        let (done, left) = self.under_way.drain(..).partition(|(at, _, _)| *at <= now);
        self.under_way = left;
        let one_in = self.fails_one_in;
        let done: Vec<(f64, RequestId, TileKey)> = done;
        done.into_iter().map(|(_, id, key)| (id, key, one_in > 0 && id.0 % one_in == one_in / 2)).collect()
    }
}

/// What a frame draws where, free of slot numbers and order.
type Picture = BTreeMap<(u32, u32, u32), (Option<TileAddress>, bool)>;

struct Simulation {
    stream: Stream,
    link: Link,
    now: f64,
    ready_frames: u32,
    pending: HashSet<TileKey>,
}

impl Simulation {
    fn new(link: Link, options: &StreamOptions) -> Self {
        Self {
            stream: Stream::new(&scene(), options).unwrap(),
            link,
            now: 0.0,
            ready_frames: 0,
            pending: HashSet::new(),
        }
    }

    /// One frame; every promise of the module is checked in it.
    fn frame(&mut self, view: &ViewGeometry) -> Option<Picture> {
        self.stream.choose(view);
        for (id, key, fails) in self.link.arrivals(self.now) {
            let Some(found) = self.stream.requests().finish(id) else { continue };
            assert_eq!(found, key);
            self.pending.remove(&key);
            if fails {
                self.stream.requests().failed(key, self.now, &FetchFailure::Temporary("lost".into()));
                continue;
            }
            self.stream.mark_arrived(key);
            if key.layer == Layer::Texture {
                self.stream.place_texture(key);
            } else {
                self.stream.place_elevation(key, ElevationSummary::between(500.0, 2_500.0));
            }
        }
        self.stream.choose(view);
        let plan = self.stream.plan(self.now, true);
        for id in &plan.cancel {
            self.link.under_way.retain(|(_, other, key)| {
                if other == id {
                    self.pending.remove(key);
                }
                other != id
            });
        }
        for (id, key) in plan.start {
            assert!(self.pending.insert(key), "{key} was asked for twice");
            let layer = self.stream.layer(key.layer).unwrap();
            assert!(!layer.pool.is_known(&key.address), "{key} is here already");
            self.link.ask(self.now, id, key);
        }
        assert!(self.stream.requests().in_flight() <= 8);
        for pool in self.stream.pools() {
            assert!(pool.used() <= pool.capacity());
        }
        if !self.stream.is_ready() {
            return None;
        }
        self.ready_frames += 1;
        let tables = self.stream.tables(view, self.now);
        assert!(tables.nodes.iter().all(|&node| node != EMPTY), "a hole at {} s", self.now);
        let mut picture = Picture::new();
        for &node in tables.nodes.iter().filter(|&&node| node & LEAF_BIT != 0) {
            let leaf = &tables.leaves[(node & !LEAF_BIT) as usize];
            let tile = tables.leaf_tiles[(node & !LEAF_BIT) as usize];
            let slot = self.stream.elevation.pool.resident(&tile.unwrap()).unwrap().slot;
            assert_eq!(leaf.slot, slot);
            if leaf.stand_in != EMPTY {
                let other = &tables.leaves[leaf.stand_in as usize];
                assert_eq!((other.grid_origin, other.grid_side), (leaf.grid_origin, leaf.grid_side));
                assert!(other.level < leaf.level);
            }
            let [x, y] = leaf.grid_origin;
            picture.insert((x, y, leaf.grid_side), (tile, leaf.stand_in != EMPTY));
        }
        // The leaves tile the grid.
        let area: u64 = picture.keys().map(|&(_, _, side)| u64::from(side) * u64::from(side)).sum();
        assert_eq!(area, (self.stream.grid.len() as u64) << 52);
        Some(picture)
    }

    /// Frames until everything is there, or panics after `seconds`.
    fn settle(&mut self, view: &ViewGeometry, seconds: f64) -> Picture {
        let until = self.now + seconds;
        loop {
            let picture = self.frame(view);
            if let Some(picture) = picture
                && self.stream.has_all()
                && !self.stream.is_fading()
            {
                // As the engine does: what arrived in this frame may have changed what is wanted.
                self.stream.choose(view);
                if self.stream.has_all() {
                    return picture;
                }
            }
            self.now += 0.1;
            assert!(self.now < until, "not settled: {:?}", self.stream.progress());
        }
    }
}

fn view(path: f64) -> ViewGeometry {
    ViewGeometry::new(&camera(path), 640, 360)
}

#[test]
fn a_bad_link_settles_to_what_a_good_one_does_without_a_hole() {
    let options = options();
    let mut good = Simulation::new(Link::new(1e9, 0.0, 0), &options);
    let mut bad = Simulation::new(Link::new(125_000.0, 0.2, 10), &options);
    for path in [0.0, 0.4, 1.0] {
        let fast = good.settle(&view(path), 60.0);
        let slow = bad.settle(&view(path), 600.0);
        assert_eq!(fast, slow);
        assert!(fast.values().all(|(_, fading)| !fading));
    }
    assert!(bad.link.asked > good.link.asked, "some had to be asked for again");
    assert!(bad.ready_frames > 100);
}

#[test]
fn a_flight_over_a_slow_link_with_few_slots_never_shows_a_hole() {
    // Some 20 slots of elevation, and 35 of the photo.
    let options = StreamOptions { memory_budget_bytes: 80_000_000, ..options() };
    let mut flight = Simulation::new(Link::new(400_000.0, 0.2, 7), &options);
    for step in 0..300 {
        flight.frame(&view(f64::from(step) / 300.0));
        flight.now += 0.1;
    }
    assert!(flight.ready_frames > 200);
    let before = flight.link.asked;
    flight.settle(&view(1.0), 300.0);
    assert!(flight.stream.is_limited());
    assert!(before > 30);
}

#[test]
fn a_settled_view_asks_for_nothing_more() {
    let mut simulation = Simulation::new(Link::new(1e9, 0.0, 0), &options());
    simulation.settle(&view(0.3), 60.0);
    let asked = simulation.link.asked;
    for _ in 0..20 {
        simulation.frame(&view(0.3));
        simulation.now += 1.0;
    }
    assert_eq!(simulation.link.asked, asked);
}

#[test]
fn tiles_fade_in_over_what_stood_there() {
    let mut simulation = Simulation::new(Link::new(300_000.0, 0.05, 0), &options());
    let mut fades = 0;
    for _ in 0..200 {
        if let Some(picture) = simulation.frame(&view(0.0)) {
            fades += picture.values().filter(|(_, fading)| *fading).count();
        }
        simulation.now += 0.05;
    }
    assert!(fades > 20, "{fades}");
}

#[test]
fn bare_terrain_where_nothing_grows_or_where_it_is_asked_for() {
    let mut scene = scene();
    let layer = |scene: &SceneDescription, surface| {
        Stream::new(scene, &StreamOptions { surface, ..options() }).unwrap().elevation_layer()
    };
    assert_eq!(layer(&scene, super::SurfaceChoice::Combined), Layer::CombinedElevation);
    assert_eq!(layer(&scene, super::SurfaceChoice::Elevation), Layer::Elevation);
    scene.vegetation = false;
    assert_eq!(layer(&scene, super::SurfaceChoice::Combined), Layer::Elevation);
}
