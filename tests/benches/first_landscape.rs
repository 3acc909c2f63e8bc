//! How long a visitor waits: address entered → first textured landscape → settled, built-in
//! scene, software adapter, 640 × 360.

use std::time::{Duration, Instant};
use treeline_tests::browser::Browser;
use treeline_tests::program::Server;

/// Visits, each with an empty browser and a cold server.
const VISITS: usize = 3;

fn main() -> anyhow::Result<()> {
    let mut first = Vec::new();
    let mut settled = Vec::new();
    for _ in 0..VISITS {
        let server = Server::start(&[])?;
        let browser = Browser::start()?;
        let start = Instant::now();
        let mut page = browser.open(&server.url("/"), 640, 360)?;
        page.wait_for(
            "window.treeline?.stats().page.first_textured_milliseconds > 0",
            Duration::from_secs(120),
        )?;
        first.push(start.elapsed().as_secs_f64());
        page.settle()?;
        settled.push(start.elapsed().as_secs_f64());
    }
    for (name, mut seconds) in [("first textured landscape", first), ("settled", settled)] {
        seconds.sort_by(f64::total_cmp);
        let median = seconds[seconds.len() / 2];
        println!("{}", serde_json::json!({ "name": name, "value": median, "unit": "s" }));
    }
    Ok(())
}
