//! 32, 1,000 and 10,000 clients, each with a connection of its own, ask for one cold tile at once: it is made once, and
//! all have it within the time that one takes to make and 1.5 times what as many warm answers take one after the other.
//! Wants as many open files as the largest crowd has clients, here and in the server (`ulimit -n 20000`), and leaves the
//! crowds out that do not fit. One JSON object a line; fails where a tile is made twice or an answer is wrong.

use anyhow::{Context, ensure};
use std::time::Instant;
use treeline_tests::measure::{median, print};
use treeline_tests::program::Server;
use treeline_tests::raw_http::{Connection, counter};

/// Those that the server lets in.
const CONNECTIONS: usize = 12_000;
/// For everything that is no client.
const OTHER_FILES: usize = 200;
const ROUNDS: usize = 5;
const WARM: usize = 500;

/// Maps of 512 × 512, each another.
fn path(index: usize) -> String {
    let west = 11.0 + index as f64 * 0.004;
    format!(
        "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=texture&STYLES=&CRS=CRS:84&BBOX={west},46.92,{},46.97&WIDTH=512&HEIGHT=512&FORMAT=image/jpeg",
        west + 0.05
    )
}

/// Files that this process, and so its children, may have open; `None` where nobody says.
fn open_files() -> Option<usize> {
    let text = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = text.lines().find(|line| line.starts_with("Max open files"))?;
    line.split_whitespace().nth(3)?.parse().ok()
}

fn main() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let configuration = folder.path().join("treeline.toml");
    let limits = format!(
        "[limits]\nmaximum_connections = {CONNECTIONS}\nmaximum_requests = {CONNECTIONS}\nheader_timeout_seconds = 300\n"
    );
    std::fs::write(&configuration, limits)?;
    let server = Server::start(&["--config", configuration.to_str().context("a path")?])?;
    let files = open_files().unwrap_or(1024);
    print("open files allowed", files as f64, "");
    print("connections and requests allowed", CONNECTIONS as f64, "");
    let mut alone = Connection::open(server.address())?;
    let mut fresh = 0..;
    let mut next = || path(fresh.next().unwrap_or_default());
    // What is made once for all maps is.
    alone.body(&next())?;
    for clients in [32, 1_000, 10_000] {
        if clients + OTHER_FILES > files {
            println!("skipped: {clients} clients want as many open files; {files} are allowed (ulimit -n)");
            continue;
        }
        let mut crowd =
            (0..clients).map(|_| Connection::open(server.address())).collect::<anyhow::Result<Vec<_>>>()?;
        let (mut ratios, mut totals, mut again_at_once) = (Vec::new(), Vec::new(), Vec::new());
        let (mut colds, mut warms, mut of_all_warm) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let start = Instant::now();
            let path = next();
            let right = alone.body(&path)?;
            let cold = start.elapsed().as_secs_f64();
            let mut times = Vec::with_capacity(WARM);
            for _ in 0..WARM {
                let start = Instant::now();
                alone.body(&path)?;
                times.push(start.elapsed().as_secs_f64());
            }
            let warm = median(&times);
            let path = next();
            let before = counter(server.address(), "treeline_tiles_total", "outcome=\"made\"")?;
            let start = Instant::now();
            for client in &mut crowd {
                client.ask(&path)?;
            }
            let mut lengths = Vec::with_capacity(clients);
            for client in &mut crowd {
                let answer = client.answer()?;
                ensure!(answer.status == 200, "{}", answer.head);
                lengths.push(answer.body.len());
            }
            let total = start.elapsed().as_secs_f64();
            let start = Instant::now();
            for client in &mut crowd {
                client.ask(&path)?;
            }
            for client in &mut crowd {
                client.answer()?;
            }
            let all_warm = start.elapsed().as_secs_f64();
            again_at_once.push(all_warm * 1e3);
            of_all_warm.push(total / (cold + 1.5 * all_warm));
            let made = counter(server.address(), "treeline_tiles_total", "outcome=\"made\"")? - before;
            ensure!(made == 1.0, "made {made} times for {clients} clients");
            let again = alone.body(&path)?;
            ensure!(lengths.iter().all(|&length| length == again.len()), "tiles of another length");
            ensure!(again != right, "one tile for two places");
            ratios.push(total / (cold + 1.5 * clients as f64 * warm));
            totals.push(total * 1e3);
            colds.push(cold * 1e3);
            warms.push(warm * 1e6);
        }
        let of = |what: &str| format!("{clients} clients: {what}");
        print(&of("times that the tile was made"), 1.0, "");
        print(&of("until the last has it"), median(&totals), "ms");
        print(&of("the same once it is warm"), median(&again_at_once), "ms");
        print(&of("one cold tile alone"), median(&colds), "ms");
        print(&of("one warm tile alone"), median(&warms), "us");
        print(&of("over cold + 1.5 N warm, one after the other"), median(&ratios), "ratio");
        print(&of("over cold + 1.5 times all of them warm at once"), median(&of_all_warm), "ratio");
    }
    Ok(())
}
