//! A picture of a `.npy` height field.

use crate::arguments::Arguments;
use crate::camera_file;
use crate::error::ShotError;
use crate::npy;
use crate::output;
use crate::statistics::{self, fetch_statistics};
use serde_json::json;
use treeline_client::headless;
use treeline_client::headless::height_field::{
    HeightFieldError, HeightFieldFrame, HeightFieldOptions, render_height_field,
};
use treeline_shaders::height_field::HeightField;

/// Draws and writes.
pub fn shoot(arguments: &Arguments) -> Result<(), ShotError> {
    let (Some(path), Some(camera), Some(cell)) =
        (&arguments.heightfield, &arguments.camera, arguments.cell_size)
    else {
        return Err(ShotError::input("--heightfield needs --cell-size and --camera"));
    };
    let camera = camera_file::plane(camera)?;
    let about = |text: String| ShotError::input(format!("--heightfield {}: {text}", path.display()));
    // Looked at before it is opened: a pipe would wait for a writer, a device might never end.
    let regular =
        std::fs::metadata(path).map_err(|error| about(format!("cannot be read ({error})")))?.is_file();
    if !regular {
        return Err(about("it is no regular file; name a .npy file".into()));
    }
    let bytes = std::fs::read(path).map_err(|error| about(format!("cannot be read ({error})")))?;
    let grid = npy::read(&bytes).map_err(about)?;
    drop(bytes);
    let origin = arguments.origin.unwrap_or_default();
    let field =
        HeightField::new(grid.columns, grid.rows, grid.samples, cell, origin).map_err(ShotError::input)?;
    let options = HeightFieldOptions {
        size: arguments.size,
        earth_radius: arguments.earth_radius,
        repeat: arguments.repeat,
    };
    let gpu = headless::open(arguments.adapter.into())?;
    let frame =
        render_height_field(&gpu.device, &gpu.queue, &field, &camera, &options).map_err(
            |error| match error {
                HeightFieldError::Gpu(_) => ShotError::failure(error),
                _ => ShotError::input(error),
            },
        )?;
    write(arguments, &gpu.adapter_name(), &frame)
}

fn write(arguments: &Arguments, adapter: &str, frame: &HeightFieldFrame) -> Result<(), ShotError> {
    let [width, height] = frame.size;
    if let Some(path) = &arguments.color {
        output::picture(path, width, height, &by_distance(&frame.distance))?;
    }
    if let Some(path) = &arguments.depth {
        output::write("--depth", path, &npy::write(height, width, &frame.distance))?;
    }
    if let Some(path) = &arguments.stats {
        // The pyramids are made on the CPU, and a grid without a cell is drawn by no pass at all.
        let drawn = frame.milliseconds.iter().any(|&time| time > 0.0);
        let pipelines: &[&str] = if drawn { &["height_field"] } else { &[] };
        let document = json!({
            "adapter": adapter,
            "passes": {"height_field": statistics::median(&frame.milliseconds)},
            "pipelines": pipelines,
            "tiles": {},
            "bytes": {},
            "texel_fetches_per_ray": fetch_statistics(frame.fetches.iter().map(|&count| u32::from(count))),
            "missed_rays": frame.missed_rays,
            "size": frame.size,
        });
        output::write("--stats", path, format!("{document:#}\n").as_bytes())?;
    }
    Ok(())
}

/// A height field has no light of its own: near is light, far is dark, on a logarithmic scale; misses are blue.
fn by_distance(distance: &[f32]) -> Vec<u8> {
    let hits = || distance.iter().copied().filter(|value| value.is_finite() && *value > 0.0);
    let (near, far) =
        hits().fold((f32::INFINITY, 0.0_f32), |(low, high), value| (low.min(value), high.max(value)));
    let span = (far / near).ln().max(1e-6);
    distance
        .iter()
        .flat_map(|&value| {
            if !value.is_finite() {
                return [70, 110, 160, 255];
            }
            let share = ((value.max(near) / near).ln() / span).clamp(0.0, 1.0);
            let grey = (245.0 - 215.0 * share) as u8;
            [grey, grey, grey, 255]
        })
        .collect()
}
