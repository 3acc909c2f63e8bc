//! Ten minutes of random flight (virtual time) over a poor connection: memory on the GPU, the heap, requests, holes.
//! Figures as JSON lines. What must be 0 is checked, too.

use anyhow::ensure;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};
use treeline_client::engine::EngineOptions;
use treeline_client::stream::StreamOptions;
use treeline_tests::flight_link::LinkQuality;
use treeline_tests::flight_path::RandomFlight;
use treeline_tests::flight_simulation::Flight;

/// Counts the bytes that are alive.
struct Live(AtomicUsize);

// SAFETY: every call is handed on to the system's allocator as it came; counting touches no memory of it.
unsafe impl GlobalAlloc for Live {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        self.0.fetch_add(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are the system's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        self.0.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the same.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static HEAP: Live = Live(AtomicUsize::new(0));

const SIZE: [u32; 2] = [96, 72];
const FRAME_SECONDS: f64 = 1.0;
const MINUTES: f64 = 10.0;
/// Too little for many of the views.
const BUDGET_BYTES: u64 = 80_000_000;
const QUALITY: LinkQuality =
    LinkQuality { bytes_per_second: 2e6, latency_seconds: 0.1, fails_one_in: 10, disorder_seconds: 0.5 };

fn print(name: &str, value: f64, unit: &str) {
    println!(
        "{}",
        serde_json::json!({ "name": format!("random flight: {name}"), "value": value, "unit": unit })
    );
}

fn main() -> anyhow::Result<()> {
    let stream = StreamOptions { memory_budget_bytes: BUDGET_BYTES, ..StreamOptions::default() };
    let mut flight = Flight::new(EngineOptions { stream, ..EngineOptions::default() }, QUALITY, SIZE)?;
    flight.frame_seconds = FRAME_SECONDS;
    let steps = (60.0 * MINUTES / FRAME_SECONDS) as usize;
    let (mut heap, mut gpu) = ([0_usize; 4], 0);
    for (step, camera) in RandomFlight::new(1).take(steps).enumerate() {
        flight.frame(camera)?;
        let quarter = &mut heap[4 * step / steps];
        *quarter = (*quarter).max(HEAP.0.load(Ordering::Relaxed));
        gpu = gpu.max(flight.engine.stats().memory.allocated_bytes);
    }
    let tally = flight.tally;
    print("frames", tally.frames as f64, "");
    print("frames with a hole", tally.frames_with_hole as f64, "");
    print("open squares", tally.open_squares as f64, "");
    print("requests", flight.link.asked as f64, "");
    print("needless requests", tally.needless_requests as f64, "");
    print("requests for what had given up its slot", tally.requests_again as f64, "");
    print("steps over the budget", tally.over_budget as f64, "");
    print("most GPU memory over the budget's", gpu as f64 / BUDGET_BYTES as f64, "ratio");
    print("tiles evicted in sight", tally.evicted_in_sight as f64, "");
    print("recall in the frame", tally.recall(), "ratio");
    for (quarter, bytes) in heap.into_iter().enumerate() {
        print(&format!("most heap in quarter {}", quarter + 1), bytes as f64 / 1e6, "MB");
    }
    ensure!(tally.frames_with_hole + tally.open_squares + tally.needless_requests == 0, "{tally:?}");
    ensure!(tally.over_budget + tally.evicted_in_sight == 0, "{tally:?}");
    ensure!(heap[3] as f64 <= 1.05 * heap[1] as f64, "the heap grows: {heap:?}");
    Ok(())
}
