//! What a frame costs on the CPU: reading a load map of 256 × 256 cells and choosing the tiles; planning the
//! network; the page tables. Figures as JSON lines. A camera at 60 m/s and 60 frames a second, everything here.

mod support;

use std::time::Instant;
use support::{Counting, Flight, Map};
use treeline_client::stream::load_map::{Analysis, Depths};

#[global_allocator]
static ALLOCATOR: Counting = Counting::new();

/// Maps of the flight, one metre apart.
const MAPS: usize = 60;
/// Rounds over them; the first is not measured.
const ROUNDS: usize = 20;

fn print(name: &str, value: f64, unit: &str) {
    println!("{}", serde_json::json!({ "name": name, "value": value, "unit": unit }));
}

/// Milliseconds of each call, and allocations of all.
fn measure(maps: &[Map], mut work: impl FnMut(&Map)) -> (Vec<f64>, u64) {
    let mut times = Vec::with_capacity(MAPS * ROUNDS);
    maps.iter().for_each(&mut work);
    let before = ALLOCATOR.count();
    for map in (1..ROUNDS).flat_map(|_| maps) {
        let start = Instant::now();
        work(map);
        times.push(1e3 * start.elapsed().as_secs_f64());
    }
    let allocations = ALLOCATOR.count() - before;
    times.sort_by(f64::total_cmp);
    (times, allocations)
}

fn report(name: &str, (times, allocations): (Vec<f64>, u64)) {
    print(&format!("{name}: median"), times[times.len() / 2], "ms");
    print(&format!("{name}: 99th percentile"), times[times.len() * 99 / 100], "ms");
    print(&format!("{name}: allocations a frame"), allocations as f64 / times.len() as f64, "");
}

fn main() {
    let mut flight = Flight::new();
    let maps: Vec<Map> = (0..MAPS).map(|step| flight.map(step as f64)).collect();
    for map in &maps {
        flight.fill(map);
    }
    print("cells with a word", maps[0].used() as f64, "");
    print("tiles wanted", flight.stream.progress().0 as f64, "");
    report("read a map and choose the tiles", measure(&maps, |map| flight.read(map)));
    let mut lists =
        Analysis::new(Depths { texture: Some(18), elevation: 16, elevation_coarser: 0, land_cover: None });
    report("of this, reading", measure(&maps, |map| flight.analyse(&mut lists, map)));
    report("plan the network", measure(&maps, |_| assert_eq!(flight.plan(), 0)));
    report("page tables", measure(&maps, |map| flight.draw(map)));
}
