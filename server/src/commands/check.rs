//! `treeline check`.

use crate::cli::ServeArguments;
use crate::http;
use crate::opening::{Opened, built_in, open_file};
use crate::source::geotiff::Raster;
use crate::source::upstream::pictures;
use crate::state::App;
use crate::user_error::UserError;
use std::io::Write as _;
use std::sync::Arc;

/// Opens everything that `serve` would, and prints what it is.
pub fn check(arguments: &ServeArguments) -> Result<(), UserError> {
    let config = super::config(arguments)?;
    let Opened { scene, facts } = match arguments.scene.scene_file()? {
        Some(file) => {
            let opened = open_file(&file)?;
            // A service of maps was asked for some when it was opened.
            for path in file.paths().filter(|path| !pictures::is_service(path)) {
                // Where it lies was found out above; what matters here is whether its data can be read.
                Raster::open(path, Some("EPSG:4326"))?.verify()?;
            }
            opened
        }
        None => Opened {
            scene: built_in()?,
            facts: vec![("scene", "built-in, made on demand; no files".to_owned())],
        },
    };
    let (low, high) = scene.height.range();
    let mut lines: Vec<String> = facts.iter().map(|(role, text)| format!("{role}: {text}")).collect();
    lines.push(format!("scene: {}", scene.name));
    lines.push(format!("  heights     {low:.1} … {high:.1} m"));
    let cover = match (
        &scene.cover,
        facts.iter().any(|(role, _)| matches!(*role, "land cover" | "canopy height" | "topographic map")),
    ) {
        (None, _) => "none: nothing says where trees are",
        (Some(_), true) => "from the sources above",
        (Some(_), false) if facts.iter().any(|(role, _)| *role == "photo") => "judged from the photo",
        (Some(_), false) => "made with the landscape",
    };
    lines.push(format!("  forest      {cover}"));
    for row in http::layers(&scene) {
        let bounds = http::extent(&scene, row.layer).bounds;
        let deepest = http::maximum_level(&scene, row.layer);
        let coarsest = http::minimum_level(&bounds).min(deepest);
        lines.push(format!("  layer       {}: levels {coarsest} to {deepest}", row.name));
    }
    // Last, what only the server itself finds out: folders, threads, addresses.
    App::new(Arc::new(scene), &config)?;
    let _ = writeln!(std::io::stdout(), "{}", lines.join("\n"));
    Ok(())
}
