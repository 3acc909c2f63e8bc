//! How long a cold tile takes on one core, beyond reading its source: what the fields take is
//! measured apart and taken off. One JSON object a line, medians in milliseconds. `-- NAME` measures only what has
//! that in its name.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;
use treeline_core::camera::GeographicCamera;
use treeline_core::codec::land_cover::CodeBits;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::layer::{Layer, SurfaceType};
use treeline_core::seeds::Species;
use treeline_core::tile::{GeographicBox, TileAddress};
use treeline_server::recipe::{Format, TileRequest, make};
use treeline_server::scene::Scene;
use treeline_server::source::growth::{GrownCover, Growths};
use treeline_server::source::open;
use treeline_server::source::{
    ColourField, Cover, CoverField, FieldExtent, HeightField, RequestCrs, SampleGrid, SourceError, procedural,
};

const ROUNDS: usize = 15;

/// Nanoseconds spent in fields.
static READING: AtomicU64 = AtomicU64::new(0);

fn reading<T>(work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    READING.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
    result
}

/// A landscape that is nowhere flat, all of it forest.
struct World {
    extent: FieldExtent,
    /// The least closure of its stands, of 255; the greatest is 31 more.
    least_closure: i32,
}

impl World {
    fn fill<T>(&self, grid: &SampleGrid, out: &mut [T], value: impl Fn(f32, f32) -> T) {
        let (bounds, width) = match grid {
            SampleGrid::Lattice(window) => (window.pixel_box(), window.width),
            SampleGrid::Box { west, south, east, north, width, .. } => {
                (GeographicBox { west: *west, south: *south, east: *east, north: *north }, *width)
            }
        };
        reading(|| {
            let step = (bounds.east - bounds.west) / f64::from(width);
            for (row, line) in out.chunks_mut(width as usize).enumerate() {
                let y = ((bounds.north - row as f64 * step) * 111_320.0) as f32;
                for (column, out) in line.iter_mut().enumerate() {
                    *out = value(((bounds.west + column as f64 * step) * 77_000.0) as f32, y);
                }
            }
        });
    }
}

impl HeightField for World {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [f32]) -> Result<(), SourceError> {
        self.fill(grid, out, |x, y| {
            1_500.0 + 400.0 * (x / 900.0).sin() * (y / 700.0).cos() + (x / 7.0).sin()
        });
        Ok(())
    }

    fn maxima(&self, _: &GeographicBox, columns: u32, rows: u32) -> Result<Vec<f32>, SourceError> {
        Ok(reading(|| vec![1_902.0; (columns * rows) as usize]))
    }

    fn range(&self) -> (f32, f32) {
        (1_000.0, 2_000.0)
    }
}

impl CoverField for World {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        self.fill(grid, out, |x, y| Cover {
            species: 1 + (((x / 60.0) as i32 + (y / 60.0) as i32) & 1) as u8,
            closure: (self.least_closure + (x as i32 & 31)).min(255) as u8,
            height: 0,
            surface: SurfaceType::Grass as u8,
        });
        Ok(())
    }
}

impl ColourField for World {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [[u8; 4]]) -> Result<(), SourceError> {
        self.fill(grid, out, |x, y| {
            let noise = ((x * 12.98 + y * 78.2).sin() * 40.0) as i32;
            [(90 + noise / 2) as u8, (110 + noise) as u8, 70, 255]
        });
        Ok(())
    }
}

fn scene(photo: bool, least_closure: i32) -> Scene {
    let world = Arc::new(World {
        extent: FieldExtent {
            bounds: GeographicBox { west: 10.0, south: 46.0, east: 11.0, north: 47.0 },
            resolution_metres: 1.0,
            projected_epsg: None,
        },
        least_closure,
    });
    Scene {
        name: "Benchmark".into(),
        revision: "1".into(),
        height: world.clone(),
        colour: photo.then(|| world.clone() as Arc<dyn ColourField>),
        cover: Some(world),
        species: Species::built_in(),
        growing: vec![1, 2],
        code_bits: CodeBits::default(),
        seed: 1,
        attribution: Vec::new(),
        sun_time: "2026-07-15T09:00:00Z".into(),
        camera: GeographicCamera {
            lon: 10.5,
            lat: 46.5,
            height: 3_000.0,
            heading_deg: 0.0,
            pitch_deg: -20.0,
            fov_y_deg: 50.0,
        },
        places: Vec::new(),
    }
}

fn measure(name: &str, scene: &Scene, request: &TileRequest) {
    time(name, || make(scene, request).map(|bytes| drop(std::hint::black_box(bytes))));
}

/// Prints the median of some rounds of work, less what the benchmark's own fields took of it.
fn time<E: std::fmt::Debug>(name: &str, mut work: impl FnMut() -> Result<(), E>) {
    let asked = std::env::args().skip(1).find(|argument| !argument.starts_with('-'));
    if asked.is_some_and(|asked| !name.contains(&asked)) {
        return;
    }
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let before = READING.load(Ordering::Relaxed);
            let start = Instant::now();
            work().expect("it works");
            let total = start.elapsed().as_nanos() as f64;
            (total - (READING.load(Ordering::Relaxed) - before) as f64) / 1.0e6
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("{{\"name\": \"{name}\", \"value\": {:.3}, \"unit\": \"ms\"}}", times[ROUNDS / 2]);
}

fn main() {
    let (plain, photo) = (scene(false, 200), scene(true, 200));
    let request = |layer: Layer, level: u8, format: Format| {
        let row = layer.row();
        let window = LatticeWindow::of_tile(TileAddress::at(level, 10.4, 46.4), row.registration, row.border);
        TileRequest::new(layer, SampleGrid::Lattice(window), format)
    };
    for level in 8..=18 {
        let own = request(Layer::CombinedElevation, level, Format::Own);
        measure(&format!("combined-elevation, level {level}, own"), &plain, &own);
    }
    measure(
        "combined-elevation, level 15, bil16",
        &plain,
        &request(Layer::CombinedElevation, 15, Format::Bil16),
    );
    large_map();
    measure("elevation, level 14, own", &plain, &request(Layer::Elevation, 14, Format::Own));
    measure("elevation, level 14, png", &plain, &request(Layer::Elevation, 14, Format::Png));
    measure("elevation, level 14, tiff", &plain, &request(Layer::Elevation, 14, Format::GeoTiff));
    measure("lcc, level 15, own", &plain, &request(Layer::Lcc, 15, Format::Own));
    measure("lcc, level 14, own (packed)", &plain, &request(Layer::Lcc, 14, Format::Own));
    measure("texture, level 14, jpeg, photo", &photo, &request(Layer::Texture, 14, Format::Jpeg));
    measure("texture, level 14, jpeg, relief", &plain, &request(Layer::Texture, 14, Format::Jpeg));
    measure("texture, level 14, webp, photo", &photo, &request(Layer::Texture, 14, Format::WebP));
    photo_cover();
    built_in_fields();
}

/// A map of 2048 × 2048 samples a metre apart, all of it closed forest.
fn large_map() {
    const SIDE: u32 = 2048;
    let closed = scene(false, 255);
    let metres = f64::from(SIDE) / 111_320.0;
    let (west, south) = (10.4, 46.4);
    let grid = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west,
        south,
        east: west + metres / 46.41_f64.to_radians().cos(),
        north: south + metres,
        width: SIDE,
        height: SIDE,
    };
    for format in [Format::Bil16, Format::Bil32] {
        let request = TileRequest::new(Layer::CombinedElevation, grid.clone(), format);
        measure(
            &format!("combined-elevation, 2048 × 2048 at 1 m, closed forest, {format:?}"),
            &closed,
            &request,
        );
    }
}

/// What telling the cover of a photo takes for a tile that was never asked for, beyond reading photo and terrain.
fn photo_cover() {
    let world = scene(true, 200);
    let (colour, height) = (world.colour.expect("a photo"), world.height);
    let growths = Growths::new(&Species::built_in());
    let below = open::photo_cover(colour, height.clone(), growths.rules());
    let grown = GrownCover::new(below.clone(), growths, height, 1);
    let mut column = 0;
    let mut next = move || {
        column += 512;
        LatticeWindow {
            level: 13,
            registration: Registration::Cell,
            first_column: 4_430_000 + column % 10_000,
            first_row: 1_012_000 + column / 10_000 * 512,
            width: 516,
            height: 516,
        }
    };
    let mut out = vec![Cover::default(); 516 * 516];
    // The first one learns what the photo looks like.
    time("photo cover, 516 × 516 cells, cold", || below.sample(&SampleGrid::Lattice(next()), &mut out));
    time("photo cover and species, 516 × 516 cells, cold", || {
        grown.sample(&SampleGrid::Lattice(next()), &mut out)
    });
}

/// What the built-in scene's own fields take for a tile.
fn built_in_fields() {
    let (height, cover, colour) = (procedural::height(), procedural::cover(), procedural::colour());
    let (longitude, latitude) = height.extent().bounds.centre();
    let window = |layer: Layer, level: u8| {
        let row = layer.row();
        LatticeWindow::of_tile(TileAddress::at(level, longitude, latitude), row.registration, row.border)
    };
    for level in [11, 13, 15] {
        let heights = window(Layer::Elevation, level);
        let (grid, mut out) = (SampleGrid::Lattice(heights), vec![0.0; heights.len()]);
        time(&format!("built-in heights, level {level}"), || height.sample(&grid, &mut out));
        let cells = window(Layer::Lcc, level);
        let (grid, mut out) = (SampleGrid::Lattice(cells), vec![Cover::default(); cells.len()]);
        time(&format!("built-in cover, level {level}"), || cover.sample(&grid, &mut out));
        let texels = window(Layer::Texture, level);
        let (grid, mut out) = (SampleGrid::Lattice(texels), vec![[0; 4]; texels.len()]);
        time(&format!("built-in photo, level {level}"), || colour.sample(&grid, &mut out));
    }
}
