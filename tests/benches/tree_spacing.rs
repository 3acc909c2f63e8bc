//! Trees per km² of closed forest, and how far each is from its nearest neighbour: Treeline's beside tops found in
//! canopies that LIDAR saw. Tops are local maxima of the canopy's height over 3 m × 3 m and 5 m × 5 m, at least 5 m
//! high, in plots of 20 m × 20 m that are covered to 60 %. Figures as JSON lines; distributions as a picture and a table in
//! docs/report.

use anyhow::Context as _;
use std::fmt::Write as _;
use treeline_core::hash::hash;
use treeline_core::seeds::{Species, Stand};
use treeline_tests::data::{self, workspace};
use treeline_tests::tree_tops::{Canopy, Spacing};

/// Canopies that LIDAR saw, by file, with the length of a cell, metres.
const REAL: [(&str, &str, f64); 5] = [
    ("Fort Valley, ponderosa pine", "canopy_fortvalley/FtValleyClipCHM.tif", 1.0),
    ("Valais 2585/1098, conifers", "canopy_swiss_valais/treeheight_2585_1098.tif", 1.0),
    ("Valais 2586/1123, mixed", "canopy_swiss_valais/treeheight_2586_1123.tif", 1.0),
    ("Coromandel, native forest", "canopy_coromandel/chm_0.5m.tif", 0.5),
    ("Oregon coast, conifers", "canopy_misc_small/oregon_coast_chm.tif", 0.5),
];
/// Side of the grown forests, metres.
const SIDE: usize = 1_000;
/// Windows of local maxima, metres.
const WINDOWS: [f64; 2] = [3.0, 5.0];
/// Step of the distributions, metres, and how many.
const STEP: f64 = 1.0;
const STEPS: usize = 13;

fn print(name: &str, spacing: &Spacing) {
    let say = |what: &str, value: f64, unit: &str| {
        println!(
            "{}",
            serde_json::json!({ "name": format!("{name}: {what}"), "value": value, "unit": unit })
        );
    };
    say("closed forest", spacing.area_km2, "km²");
    say("trees", spacing.per_km2, "per km²");
    say("nearest neighbour, mean", spacing.mean(), "m");
    for share in [0.1, 0.5, 0.9] {
        say(&format!("nearest neighbour, {} %", 100.0 * share), spacing.quantile(share), "m");
    }
    say("Clark-Evans index", spacing.clark_evans(), "");
}

fn main() -> anyhow::Result<()> {
    let mut found: Vec<(String, Spacing)> = Vec::new();
    let species = Species::built_in();
    let code = |name: &str| {
        species
            .iter()
            .find(|species| species.definition.name == name)
            .map(|species| species.code)
            .context("a species")
    };
    let [spruce, fir, beech] = [code("Norway spruce")?, code("Silver fir")?, code("European beech")?];
    let closed = |species: u8| Stand { species, closure: 255, height: 0 };
    // In patches, as rules place species.
    let mixed = |x: f64, y: f64| {
        let patch = hash((x / 38.0) as u32, (y / 38.0) as u32, 5);
        closed([spruce, fir, beech][(patch % 3) as usize])
    };
    let grown = [
        ("Treeline, spruce", Canopy::grown(SIDE, 1, |_, _| closed(spruce))),
        ("Treeline, beech", Canopy::grown(SIDE, 1, |_, _| closed(beech))),
        ("Treeline, mixed", Canopy::grown(SIDE, 1, mixed)),
    ];
    for (name, (canopy, stems)) in &grown {
        found.push((format!("{name}, stems"), canopy.spacing(stems)));
        for window in WINDOWS {
            found.push((format!("{name}, tops over {window} m"), canopy.spacing(&canopy.tops(window))));
        }
    }
    for (name, file, cell) in REAL {
        let Some(path) = data::find(file) else { continue };
        let canopy = Canopy::read(&path, cell)?;
        for window in WINDOWS {
            found.push((format!("{name}, tops over {window} m"), canopy.spacing(&canopy.tops(window))));
        }
    }
    for (name, spacing) in &found {
        print(name, spacing);
    }
    let folder = workspace().join("docs/report");
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("tree-spacing.csv"), table(&found)?)
        .context("docs/report/tree-spacing.csv")?;
    let of_three: Vec<_> = found.iter().filter(|(name, _)| name.ends_with("over 3 m")).collect();
    std::fs::write(folder.join("tree-spacing.svg"), picture(&of_three)?)
        .context("docs/report/tree-spacing.svg")?;
    println!("distributions in {}", folder.join("tree-spacing.svg").display());
    Ok(())
}

/// A row a step, a column a forest.
fn table(found: &[(String, Spacing)]) -> anyhow::Result<String> {
    let mut text = String::from("metres");
    for (name, _) in found {
        write!(text, ",\"{name}\"")?;
    }
    let histograms: Vec<Vec<f64>> = found.iter().map(|(_, spacing)| spacing.histogram(STEP, STEPS)).collect();
    for step in 0..STEPS {
        write!(text, "\n{}", (step as f64 + 0.5) * STEP)?;
        for shares in &histograms {
            write!(text, ",{:.4}", shares[step])?;
        }
    }
    Ok(text + "\n")
}

/// The distributions as lines: Treeline's whole, real forests' dashed.
fn picture(found: &[&(String, Spacing)]) -> anyhow::Result<String> {
    const SIZE: [f64; 2] = [860.0, 460.0];
    const LEFT: f64 = 60.0;
    const BOTTOM: f64 = 400.0;
    const COLOURS: [&str; 8] =
        ["#1b7837", "#5aae61", "#a6dba0", "#762a83", "#d6604d", "#f4a582", "#4393c3", "#808080"];
    let (across, up) = (480.0 / (STEPS as f64 * STEP), 360.0 / 0.6);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{LEFT}\" y=\"24\" font-size=\"16\">Distance to the nearest neighbour: tops over 3 m in closed forest</text>\n\
         <line x1=\"{LEFT}\" y1=\"{BOTTOM}\" x2=\"{}\" y2=\"{BOTTOM}\" stroke=\"black\"/>\n\
         <text x=\"{}\" y=\"{}\">metres</text>\n",
        SIZE[0],
        SIZE[1],
        LEFT + 480.0,
        LEFT + 210.0,
        BOTTOM + 40.0
    );
    for metres in (0..=12).step_by(2) {
        let x = LEFT + f64::from(metres) * across;
        writeln!(svg, "<text x=\"{x}\" y=\"{}\" text-anchor=\"middle\">{metres}</text>", BOTTOM + 18.0)?;
    }
    for percent in [10, 20, 30, 40, 50] {
        let y = BOTTOM - f64::from(percent) / 100.0 * up;
        writeln!(
            svg,
            "<line x1=\"{LEFT}\" y1=\"{y}\" x2=\"{}\" y2=\"{y}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{}\" text-anchor=\"end\">{percent} %</text>",
            LEFT + 480.0,
            LEFT - 6.0,
            y + 4.0
        )?;
    }
    for (index, (name, spacing)) in found.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let dashes = if name.starts_with("Treeline") { "" } else { " stroke-dasharray=\"6 3\"" };
        let points: Vec<String> = (0..STEPS)
            .zip(spacing.histogram(STEP, STEPS))
            .map(|(step, share)| {
                format!("{:.1},{:.1}", LEFT + (step as f64 + 0.5) * STEP * across, BOTTOM - share * up)
            })
            .collect();
        writeln!(
            svg,
            "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"{dashes} points=\"{}\"/>",
            points.join(" ")
        )?;
        let y = 60.0 + 42.0 * index as f64;
        let short = name.trim_end_matches(", tops over 3 m");
        writeln!(
            svg,
            "<line x1=\"560\" y1=\"{y}\" x2=\"590\" y2=\"{y}\" stroke=\"{colour}\" stroke-width=\"3\"{dashes}/>\
             <text x=\"598\" y=\"{}\">{short}</text><text x=\"598\" y=\"{}\" fill=\"#555\" font-size=\"11\">{:.0} per km², index {:.2}</text>",
            y + 4.0,
            y + 19.0,
            spacing.per_km2,
            spacing.clark_evans()
        )?;
    }
    Ok(svg + "</svg>\n")
}
