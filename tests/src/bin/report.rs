//! Error against run time of ray casting: `cargo xtask report`.
//!
//! Draws height fields of several sizes from several views on the software adapter, holds every
//! picture against the exact reference, and writes what it finds as JSON, CSV and a table. Counts
//! (fetches, misses) are the same on every machine; milliseconds are this one's.

use anyhow::Context;
use serde_json::json;
use std::fmt::Write as _;
use std::path::Path;
use treeline_tests::height_field::{by_gpu, forest, mountains};
use treeline_tests::reference::measure::{Errors, truth};
use treeline_tests::reference::{Camera, Ground};

/// Sides of the maps, samples.
const SIDES: [usize; 3] = [512, 1024, 2048];
/// Distance of samples, metres.
const CELL_METRES: f64 = 1.7;
/// Picture, pixels: the reference walks every cell along every ray.
const SIZE: [u32; 2] = [320, 256];

/// One picture's figures.
struct Row {
    scene: &'static str,
    view: &'static str,
    side: usize,
    errors: Errors,
    mean_fetches: f64,
    p99_fetches: u16,
    largest_fetches: u16,
    milliseconds: f64,
}

/// A view over a map: name, height over the ground in metres, pitch in degrees.
const VIEWS: [(&str, f64, f64); 3] =
    [("panorama", 150.0, -3.0), ("oblique", 600.0, -30.0), ("grazing", 30.0, -1.0)];

fn main() -> anyhow::Result<()> {
    let folder = std::env::args().nth(1).context("usage: report FOLDER")?;
    let mut rows = Vec::new();
    for side in SIDES {
        let scenes = [
            (
                "alps",
                Ground::from_function(side, side, CELL_METRES, |x, y| {
                    mountains(x as f64, y as f64, 700.0, 1200.0, 7)
                }),
            ),
            ("forest", Ground::from_function(side, side, CELL_METRES, |x, y| forest(x as f64, y as f64, 3))),
        ];
        for (scene, ground) in scenes {
            for (view, height, pitch) in VIEWS {
                let row = measure(scene, &ground, view, height, pitch, side)?;
                println!("{}", line(&row));
                rows.push(row);
            }
        }
    }
    write(Path::new(&folder), &rows)
}

fn measure(
    scene: &'static str,
    ground: &Ground,
    view: &'static str,
    height: f64,
    pitch: f64,
    side: usize,
) -> anyhow::Result<Row> {
    let place = 0.1 * (side - 1) as f64 * CELL_METRES;
    let z = ground.height(place, place).context("the view stands on the map")? + height;
    let far = 1000.0;
    let camera = Camera::new(
        [place, place, z],
        [place + 0.7 * far, place + 0.7 * far, z + far * pitch.to_radians().tan()],
        50.0,
    );
    let frame = by_gpu(ground, &camera, SIZE);
    let errors = Errors::of(&truth(ground, &camera, SIZE), &frame.distance, SIZE[0]);
    let mut fetches = frame.fetches;
    fetches.sort_unstable();
    let mean_fetches = fetches.iter().map(|&count| f64::from(count)).sum::<f64>() / fetches.len() as f64;
    Ok(Row {
        scene,
        view,
        side,
        errors,
        mean_fetches,
        p99_fetches: fetches[fetches.len() * 99 / 100],
        largest_fetches: fetches[fetches.len() - 1],
        milliseconds: frame.milliseconds.iter().copied().fold(f64::INFINITY, f64::min),
    })
}

/// A row of the table.
fn line(row: &Row) -> String {
    format!(
        "| {} | {} | {}² | {} | {} | {:.3} | {:.3} | {:.1} | {} | {} | {:.0} |",
        row.scene,
        row.view,
        row.side,
        row.errors.missed,
        row.errors.false_hits,
        100.0 * row.errors.within,
        row.errors.worst,
        row.mean_fetches,
        row.p99_fetches,
        row.largest_fetches,
        row.milliseconds
    )
}

fn write(folder: &Path, rows: &[Row]) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let mut table = format!(
        "# Ray casting: error against run time\n\nMaximum mip with the exact patch, {} × {} rays over maps of {CELL_METRES} m, against the exact f64 \
         reference. Written by `cargo xtask report`. Milliseconds are those of the software adapter of the \
         machine that ran it; all other columns are the same on every machine.\n\n\
         | scene | view | map | missed | false hits | within 0.05 px, % | worst, px | fetches, mean | p99 | largest | ms |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
        SIZE[0], SIZE[1]
    );
    let mut csv = String::from(
        "scene,view,side,missed,false_hits,within,worst_px,fetches_mean,fetches_p99,fetches_largest,milliseconds\n",
    );
    for row in rows {
        writeln!(table, "{}", line(row))?;
        writeln!(
            csv,
            "{},{},{},{},{},{},{},{},{},{},{}",
            row.scene,
            row.view,
            row.side,
            row.errors.missed,
            row.errors.false_hits,
            row.errors.within,
            row.errors.worst,
            row.mean_fetches,
            row.p99_fetches,
            row.largest_fetches,
            row.milliseconds
        )?;
    }
    let json: Vec<_> = rows
        .iter()
        .map(|row| {
            json!({
                "scene": row.scene, "view": row.view, "side": row.side, "intersector": "max-mip",
                "missed": row.errors.missed, "false_hits": row.errors.false_hits,
                "within": row.errors.within, "worst_px": row.errors.worst,
                "fetches": { "mean": row.mean_fetches, "p99": row.p99_fetches, "max": row.largest_fetches },
                "milliseconds": row.milliseconds,
            })
        })
        .collect();
    let json = serde_json::to_string_pretty(&json)? + "\n";
    for (name, text) in [("ray-casting.md", table), ("ray-casting.csv", csv), ("ray-casting.json", json)] {
        let path = folder.join(name);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}
