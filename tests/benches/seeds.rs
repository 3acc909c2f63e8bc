//! A million seeds: what selecting trees takes beside drawing every seed, one after the other on the software adapter.
//! Figures as JSON lines.

use anyhow::ensure;
use treeline_client::headless::trees::draws;
use treeline_client::headless::{self, AdapterChoice};
use treeline_tests::seed_pass::{Taken, Wood};

/// Cells on each side of the eye.
const HALF: i64 = 23;
/// The eye looks down from so high, metres.
const HEIGHT: f64 = 1_800.0;
const SIZE: [u32; 2] = [1280, 1024];
const ROUNDS: usize = 9;

fn print(name: &str, value: f64, unit: &str) {
    println!("{}", serde_json::json!({ "name": format!("seeds: {name}"), "value": value, "unit": unit }));
}

fn drawn(name: &str, taken: &Taken) {
    print(&format!("{name}, time"), taken.milliseconds, "ms");
    print(&format!("{name}, vertices"), taken.vertices as f64, "");
    print(&format!("{name}, draw calls"), f64::from(taken.draws), "");
}

fn main() -> anyhow::Result<()> {
    let gpu = headless::open(AdapterChoice::Software)?;
    println!("{}", gpu.adapter_name());
    let wood = Wood::new(gpu.clone(), HALF, HEIGHT, SIZE);
    let mut pass = wood.pass();
    let select = wood.select(&mut pass, ROUNDS)?;
    let selected = u64::from(draws(&gpu, &pass)?.last().map_or(0, |draw| draw.instance_count));
    print("checked", wood.checked() as f64, "");
    print("selected", selected as f64, "");
    print("selection, time", select, "ms");
    for (name, bytes) in ["words of candidates", "counts", "instances"].into_iter().zip(wood.bytes(&pass)) {
        print(&format!("selection, {name}"), bytes as f64, "B");
    }
    drawn("drawing the list", &wood.draw_listed(&pass, selected, ROUNDS)?);
    drawn("every seed a vertex, holes discarded", &wood.draw_every_seed(false, ROUNDS)?);
    drawn("every seed a quad, holes discarded", &wood.draw_every_seed(true, ROUNDS)?);
    ensure!(wood.checked() >= 1_000_000 && selected >= 100_000, "a smaller wood");
    Ok(())
}
