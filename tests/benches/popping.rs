//! Popping on the way to a forest slope: how much of the picture jumps from frame to frame where trees, their levels
//! and the canopy hand over to each other by fading, beside the same flight with hard switches. Figures as JSON lines,
//! every frame's in docs/report/popping.csv.
//!
//! `FRAMES=600` in the environment for the whole approach, from 5 km to 20 m; otherwise the frames in which something
//! hands over, from 1.7 km to 180 m.

use anyhow::Context as _;
use std::fmt::Write as _;
use treeline_client::engine::HandOver;
use treeline_tests::approach::{Approach, FRAMES, Flyer};
use treeline_tests::data::workspace;
use treeline_tests::popping::{BLOCKS, Jump, jump};
use treeline_tests::router_tiles::RouterTiles;

/// The frames in which something hands over.
const SHORT: std::ops::Range<usize> = 120..361;

fn print(name: &str, value: f64, unit: &str) {
    println!("{}", serde_json::json!({ "name": format!("approach: {name}"), "value": value, "unit": unit }));
}

fn main() -> anyhow::Result<()> {
    let whole = std::env::var("FRAMES").is_ok_and(|frames| frames == FRAMES.to_string());
    let frames = if whole { 0..FRAMES } else { SHORT };
    let tiles = RouterTiles::built_in()?;
    let approach = Approach::new(&tiles)?;
    let ground = approach.ground(&tiles)?;
    let mut csv = String::from(
        "flight,frame,metres,trees,pixels,blocks_16,blocks_32,blocks_64,canopy_metres,compared\n",
    );
    let mut worst = Vec::new();
    for hand_over in [HandOver::Faded, HandOver::Hard] {
        let mut flyer = Flyer::new(&tiles, hand_over)?;
        let mut before = None;
        let mut most = Jump { compared: 1.0, ..Jump::default() };
        for frame in frames.clone() {
            let metres = Approach::distance(frame);
            let now = flyer.frame(approach.camera(metres))?;
            if let Some(before) = &before {
                let found = jump(before, &now, &ground);
                most = most.worst(found);
                let Jump { pixels, blocks: [a, b, c], canopy, compared } = found;
                let trees = now.trees;
                writeln!(
                    csv,
                    "{hand_over:?},{frame},{metres:.2},{trees},{pixels:.4},{a:.4},{b:.4},{c:.4},{canopy:.4},{compared:.4}"
                )?;
            }
            before = Some(now);
        }
        worst.push(most);
    }
    let folder = workspace().join("docs/report");
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("popping.csv"), csv).context("docs/report/popping.csv")?;
    let [faded, hard] = worst[..] else { anyhow::bail!("two flights") };
    print("frames", (frames.len() - 1) as f64, "");
    print("least share of pixels compared", faded.compared.min(hard.compared), "");
    for (size, side) in BLOCKS.into_iter().enumerate() {
        let name = format!("worst frame, blocks of {side} pixels");
        print(&format!("{name}, faded"), faded.blocks[size], "of 255");
        print(&format!("{name}, hard switch"), hard.blocks[size], "of 255");
        print(&format!("{name}, ratio"), faded.blocks[size] / hard.blocks[size], "ratio");
    }
    for (name, found) in [("faded", faded), ("hard switch", hard)] {
        print(&format!("worst frame, single pixels, {name}"), found.pixels, "of 255");
        print(&format!("largest change of a region's mean canopy height, {name}"), found.canopy, "m");
    }
    Ok(())
}
