//! A camera in flight over a landscape of which everything comes at once, with the load maps that a GPU would make
//! of it; and an allocator that counts. For the bench and for the test that nothing is allocated.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};
use treeline_client::stream::decode::{self, ElevationSummary};
use treeline_client::stream::load_map::stack::Stack;
use treeline_client::stream::load_map::{Analysis, Reading};
use treeline_client::stream::view::ViewGeometry;
use treeline_client::stream::{Stream, StreamOptions};
use treeline_core::camera::GeographicCamera;
use treeline_core::codec::elevation::{ElevationTile, lattice_from_metres};
use treeline_core::layer::Layer;
use treeline_core::scene::{SceneDescription, SceneLayer, Sun};
use treeline_core::tile::{CELLS, GeographicBox, TileAddress};
use treeline_shaders::load_map::{CELLS as MAP_CELLS, WANTED};

/// Height of the plain, metres.
const PLAIN: f64 = 500.0;
/// Half the angle of the sector in sight, radians.
const HALF_ANGLE: f64 = 0.65;

/// Counts what is allocated.
pub struct Counting {
    count: AtomicU64,
}

impl Counting {
    /// Nothing yet.
    pub const fn new() -> Self {
        Self { count: AtomicU64::new(0) }
    }

    /// Allocations so far, growths included.
    pub fn count(&self) -> u64 {
        self.count.load(Ordering::Relaxed)
    }
}

// SAFETY: every call is handed on to the system's allocator as it came; counting touches no memory of it.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        self.count.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promises are the system's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the same.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        self.count.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the same.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// A map as it was read back.
pub struct Map {
    view: ViewGeometry,
    stack: Stack,
    cells: Vec<u32>,
    pixels: Vec<u32>,
}

impl Map {
    /// Cells with a word.
    #[allow(dead_code, reason = "the test does not ask")]
    pub fn used(&self) -> usize {
        self.cells.iter().filter(|word| **word != 0).count()
    }
}

/// A stream, and where it is in its flight.
pub struct Flight {
    /// The state machine.
    pub stream: Stream,
    now: f64,
}

fn scene() -> SceneDescription {
    let extent = GeographicBox { west: 10.5, south: 46.5, east: 11.5, north: 47.5 };
    let row = |name: Layer, maximum_level| SceneLayer {
        name,
        title: name.row().title.into(),
        minimum_level: 0,
        maximum_level,
        registration: name.row().registration,
        border: name.row().border,
        client_format: name.row().client_format.into(),
        formats: vec![],
        extent,
    };
    SceneDescription {
        name: "plain".into(),
        revision: "1".into(),
        wms: "/wms?".into(),
        attribution: vec![],
        extent,
        minimum_height: PLAIN,
        maximum_height: PLAIN,
        layers: vec![row(Layer::Elevation, 16), row(Layer::Texture, 18)],
        vegetation: false,
        land_cover: None,
        species: vec![],
        trees: None,
        seed: 1,
        sun: Sun { time: "2026-07-15T09:00:00Z".into() },
        camera: camera(0.0),
        places: vec![],
    }
}

/// The camera after so many metres.
fn camera(metres: f64) -> GeographicCamera {
    GeographicCamera {
        lon: 11.0,
        lat: 47.0 + metres / 111_000.0,
        height: PLAIN + 120.0,
        heading_deg: 0.0,
        pitch_deg: -8.0,
        fov_y_deg: 50.0,
    }
}

/// The plain as a tile's summary.
fn plain(address: TileAddress) -> ElevationSummary {
    let side = decode::ELEVATION_SIDE;
    let height = lattice_from_metres(PLAIN, address.level);
    let maxima_side = CELLS / 8;
    let tile = ElevationTile {
        level: address.level,
        side,
        heights: vec![height; (side * side) as usize],
        maxima_side,
        maxima: vec![height; (maxima_side * maxima_side) as usize],
        surface: None,
    };
    decode::elevation(&tile.encode(), address).expect("a tile of our own").summary
}

impl Flight {
    /// At its start, with the memory that it gets by default.
    pub fn new() -> Self {
        let stream = Stream::new(&scene(), &StreamOptions::default()).expect("a scene of our own");
        Self { stream, now: 0.0 }
    }

    /// The map of the place so many metres on, as the GPU would make it of a picture of 1920 × 1080 pixels:
    /// in sight is a sector ahead, each tile on the level of its distance.
    pub fn map(&self, metres: f64) -> Map {
        let view = ViewGeometry::new(&camera(metres), 1920, 1080);
        let stack = self.stream.stack(&view, None).expect("maps choose the tiles");
        let (mut cells, mut pixels) = (vec![0; MAP_CELLS as usize], vec![0; MAP_CELLS as usize]);
        for cell in 0..MAP_CELLS as usize {
            let Some(address) = stack.address(cell) else { continue };
            let (longitude, latitude) = address.bounds().centre();
            let east = (longitude - view.eye.longitude) * 75_900.0;
            let north = (latitude - view.eye.latitude) * 111_200.0;
            let distance = east.hypot(north).max(120.0);
            if east.atan2(north).abs() > HALF_ANGLE || distance > 40_000.0 {
                continue;
            }
            // Seen are cells of the next levels, too.
            let wanted = stack.wanted_level(distance as f32);
            if wanted.abs_diff(address.level) > 1 {
                continue;
            }
            cells[cell] = 1;
            if wanted == address.level {
                cells[cell] |= WANTED;
                pixels[cell] = (1.0e8 / (distance * distance)) as u32 + 1;
            }
        }
        Map { view, stack, cells, pixels }
    }

    /// Takes a map in.
    pub fn read(&mut self, map: &Map) {
        let reading = Reading { cells: &map.cells, pixels: &map.pixels };
        self.stream.read_map(self.now, &map.view, &map.stack, reading, true);
    }

    /// Reads a map into lists alone.
    #[allow(dead_code, reason = "the test does not ask")]
    pub fn analyse(&mut self, analysis: &mut Analysis, map: &Map) {
        let reading = Reading { cells: &map.cells, pixels: &map.pixels };
        let here: &dyn Fn(&TileAddress) -> bool = &|_| true;
        self.now += 1.0 / 60.0;
        analysis.read(self.now, &map.stack, reading, true, [here; 2]);
    }

    /// Plans the network; answers how many requests there are.
    pub fn plan(&mut self) -> usize {
        self.now += 1.0 / 60.0;
        self.stream.plan(self.now, true).start.len()
    }

    /// Makes the page tables of a frame.
    pub fn draw(&mut self, map: &Map) {
        self.stream.tables(&map.view, self.now);
    }

    /// Everything that the map wants comes at once.
    pub fn fill(&mut self, map: &Map) {
        loop {
            self.read(map);
            self.now += 1.0 / 60.0;
            let plan = self.stream.plan(self.now, true);
            if plan.start.is_empty() {
                return;
            }
            for (id, key) in plan.start {
                let found = self.stream.requests().finish(id);
                assert_eq!(found, Some(key));
                self.stream.mark_arrived(key);
                if key.layer == Layer::Texture {
                    self.stream.place_texture(key);
                } else {
                    self.stream.place_elevation(key, plain(key.address));
                }
            }
        }
    }
}
