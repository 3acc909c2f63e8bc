//! Billboard clouds of six species beside their full models: planes, ε, bytes, time, and how alike
//! they look from where ε is one pixel; the pictures go into docs/report/trees.

use anyhow::Context;
use image::RgbImage;
use image::imageops::{FilterType, replace, resize};
use std::path::Path;
use std::time::Instant;
use treeline_core::seeds::species::HEIGHT_UNITS;
use treeline_core::tree_model::TreeSpecies;
use treeline_tests::data::workspace;
use treeline_tests::tree_pictures::{View, picture, similarity, six_species};

/// Height of the screen on which ε is one pixel.
const SCREEN_PIXELS: f64 = 1024.0;
/// Its field of view, degrees.
const FIELD_OF_VIEW_DEG: f64 = 50.0;
/// Pixels per height of the tree in the large pictures.
const LARGE: f32 = 420.0;
/// Directions from which trees are compared: round about, level and from above.
const AZIMUTHS: usize = 8;
const DOWN_DEG: [f32; 2] = [3.0, 30.0];

fn say(name: &str, what: &str, value: f64, unit: &str) {
    println!("{}", serde_json::json!({ "name": format!("{name}: {what}"), "value": value, "unit": unit }));
}

fn main() -> anyhow::Result<()> {
    let folder = workspace().join("docs/report/trees");
    std::fs::create_dir_all(&folder)?;
    for species in six_species() {
        let name = species.definition.name.as_str();
        let metres = f64::from(species.mean_height()) / f64::from(HEIGHT_UNITS);
        let start = Instant::now();
        let model = TreeSpecies::grow(&species);
        say(name, "time", start.elapsed().as_secs_f64() * 1e3, "ms");
        let bytes = model.encode();
        say(name, "bytes", bytes.len() as f64, "B");
        let packed = zstd::bulk::compress(&bytes, 3).context("zstd")?;
        say(name, "bytes, zstd", packed.len() as f64, "B");
        say(name, "full model", model.levels[0].quads() as f64, "quads");
        for level in 1..model.levels.len() {
            let epsilon = f64::from(model.levels[level].epsilon);
            let radius = f64::from(model.crown_radius);
            let half_screen = (0.5 * FIELD_OF_VIEW_DEG.to_radians()).tan();
            let distance = epsilon * metres * SCREEN_PIXELS / (2.0 * half_screen);
            let pixels = (1.0 / epsilon) as f32;
            let what = |what: &str| format!("level {level}, {what}");
            say(name, &what("planes"), model.levels[level].quads() as f64, "quads");
            say(name, &what("epsilon"), 100.0 * epsilon / radius, "% of the crown's radius");
            say(name, &what("distance"), distance, "m");
            let (mean, least) = compare(&model, level, pixels);
            say(name, &what("SSIM, mean"), mean, "");
            say(name, &what("SSIM, least"), least, "");
        }
        side_by_side(&model, &folder.join(format!("{}.png", name.to_lowercase().replace(' ', "-"))))?;
    }
    println!("pictures in {}", folder.display());
    Ok(())
}

/// Mean and least similarity to the full model over all directions and variants.
fn compare(model: &TreeSpecies, level: usize, pixels: f32) -> (f64, f64) {
    let mut found = Vec::new();
    for variant in 0..model.levels[level].variants.len() {
        for direction in 0..AZIMUTHS {
            for down_deg in DOWN_DEG {
                let azimuth_deg = direction as f32 * 360.0 / AZIMUTHS as f32 + 10.0;
                let view = View { azimuth_deg, down_deg, pixels };
                found.push(similarity(
                    &picture(model, 0, variant, &view),
                    &picture(model, level, variant, &view),
                ));
            }
        }
    }
    let mean = found.iter().sum::<f64>() / found.len() as f64;
    (mean, found.iter().copied().fold(1.0, f64::min))
}

/// All levels beside one another, large; below them full model and cloud from where ε is one pixel, enlarged.
fn side_by_side(model: &TreeSpecies, path: &Path) -> anyhow::Result<()> {
    let levels = model.levels.len();
    let large = |level: usize, down_deg: f32| {
        picture(model, level, 0, &View { azimuth_deg: 20.0, down_deg, pixels: LARGE })
    };
    let cell = large(0, 3.0).dimensions();
    let mut sheet = RgbImage::from_pixel(cell.0 * levels as u32, cell.1 * 5 / 2, image::Rgb([255; 3]));
    for level in 0..levels {
        let x = i64::from(cell.0) * level as i64;
        replace(&mut sheet, &large(level, 3.0), x, 0);
        replace(&mut sheet, &large(level, 30.0), x, i64::from(cell.1));
        if level > 0 {
            let pixels = 1.0 / model.levels[level].epsilon;
            let view = View { azimuth_deg: 20.0, down_deg: 3.0, pixels };
            for (side, shown) in [0, level].into_iter().enumerate() {
                let small = picture(model, shown, 0, &view);
                let enlarged = resize(&small, cell.0 / 2, cell.1 / 2, FilterType::Nearest);
                replace(
                    &mut sheet,
                    &enlarged,
                    x + side as i64 * i64::from(cell.0 / 2),
                    2 * i64::from(cell.1),
                );
            }
        }
    }
    sheet.save(path).with_context(|| path.display().to_string())
}
