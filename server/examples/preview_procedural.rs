//! A picture of the built-in scene without a GPU: from above, or as a camera sees it.
//!
//! `cargo run --release -p treeline-server --example preview_procedural -- OUT.png [LON,LAT,HEIGHT,HEADING,PITCH]`
//!
//! It marches rays over a grid of 10 m: enough to judge the landscape and to choose views, no
//! measure for the renderer.

use anyhow::{Context, Result, bail};
use rayon::prelude::*;
use treeline_core::camera::GeographicCamera;
use treeline_server::source::procedural;
use treeline_server::source::{ColourField, Cover, CoverField, HeightField, RequestCrs, SampleGrid};

/// Columns and rows of the grid over the whole extent.
const GRID: (usize, usize) = (4000, 3900);
/// Size of a camera's picture.
const PICTURE: (usize, usize) = (1600, 900);
/// Direction to the sun: east, north, up.
const SUN: [f32; 3] = [-0.62, -0.38, 0.686];

/// The scene on a grid, rows from the north.
struct Model {
    heights: Vec<f32>,
    colours: Vec<[u8; 4]>,
    /// Metres between columns and rows.
    cell: (f32, f32),
    west: f64,
    north: f64,
    step: (f64, f64),
}

impl Model {
    fn new() -> Result<Self> {
        let (height, colour, cover) = (procedural::height(), procedural::colour(), procedural::cover());
        let bounds = height.extent().bounds;
        let step =
            ((bounds.east - bounds.west) / GRID.0 as f64, (bounds.north - bounds.south) / GRID.1 as f64);
        let mut heights = vec![0.0_f32; GRID.0 * GRID.1];
        let mut colours = vec![[0_u8; 4]; GRID.0 * GRID.1];
        let strip = 100;
        heights
            .par_chunks_mut(strip * GRID.0)
            .zip(colours.par_chunks_mut(strip * GRID.0))
            .enumerate()
            .try_for_each(|(k, (heights, colours))| -> Result<()> {
                let rows = heights.len() / GRID.0;
                let north = bounds.north - (k * strip) as f64 * step.1;
                let grid = SampleGrid::Box {
                    crs: RequestCrs::Geographic,
                    west: bounds.west,
                    south: north - rows as f64 * step.1,
                    east: bounds.east,
                    north,
                    width: GRID.0 as u32,
                    height: rows as u32,
                };
                height.sample(&grid, heights)?;
                colour.sample(&grid, colours)?;
                let mut covers = vec![Cover::default(); heights.len()];
                cover.sample(&grid, &mut covers)?;
                for (i, (height, cover)) in heights.iter_mut().zip(&covers).enumerate() {
                    // Crowns and gaps by a cheap hash of the place.
                    let chance = ((i + k * strip * GRID.0) as u32).wrapping_mul(0x9e37_79b1) >> 24;
                    if cover.species > 0 && chance < u32::from(cover.closure) {
                        *height += 0.25 * f32::from(cover.height) * (0.55 + chance as f32 / 600.0);
                    }
                }
                Ok(())
            })?;
        let cell = ((step.0 * 76_150.0) as f32, (step.1 * 111_170.0) as f32);
        Ok(Self { heights, colours, cell, west: bounds.west, north: bounds.north, step })
    }

    /// Grid coordinates of a place, whole numbers at samples.
    fn at(&self, longitude: f64, latitude: f64) -> (f32, f32) {
        (
            ((longitude - self.west) / self.step.0 - 0.5) as f32,
            ((self.north - latitude) / self.step.1 - 0.5) as f32,
        )
    }

    fn height(&self, u: f32, v: f32) -> Option<f32> {
        if !(u >= 0.0 && v >= 0.0 && u < (GRID.0 - 1) as f32 && v < (GRID.1 - 1) as f32) {
            return None;
        }
        let (i, j) = (u as usize, v as usize);
        let (fu, fv) = (u - i as f32, v - j as f32);
        let at = |di: usize, dj: usize| self.heights[(j + dj) * GRID.0 + i + di];
        let top = at(0, 0) + (at(1, 0) - at(0, 0)) * fu;
        let bottom = at(0, 1) + (at(1, 1) - at(0, 1)) * fu;
        Some(top + (bottom - top) * fv)
    }

    /// Share of sunlight at a place, shadows included.
    fn light(&self, u: f32, v: f32, height: f32) -> f32 {
        let slope = |du: f32, dv: f32| {
            self.height(u + du, v + dv).unwrap_or(height) - self.height(u - du, v - dv).unwrap_or(height)
        };
        let dx = slope(1.0, 0.0) / (2.0 * self.cell.0);
        let dy = -slope(0.0, 1.0) / (2.0 * self.cell.1);
        let facing = (SUN[2] - dx * SUN[0] - dy * SUN[1]) / (1.0 + dx * dx + dy * dy).sqrt();
        let mut open = 1.0_f32;
        let mut away = 15.0_f32;
        while away < 6_000.0 {
            let (pu, pv) = (u + SUN[0] * away / self.cell.0, v - SUN[1] * away / self.cell.1);
            let Some(ground) = self.height(pu, pv) else { break };
            let clear = height + 3.0 + SUN[2] * away - ground;
            open = open.min((0.5 + clear * 12.0 / away).clamp(0.0, 1.0));
            away *= 1.12;
        }
        facing.max(0.0) * open
    }

    /// The colour of a hit, lit and hazed.
    fn shade(&self, u: f32, v: f32, height: f32, distance: f32) -> [f32; 3] {
        let light = self.light(u, v, height);
        let (i, j) = ((u + 0.5) as usize, (v + 0.5) as usize);
        let photo = self.colours[j.min(GRID.1 - 1) * GRID.0 + i.min(GRID.0 - 1)];
        let haze = 1.0 - (-distance / 42_000.0).exp();
        let ambient = [0.30, 0.36, 0.44];
        let sun = [1.12, 1.04, 0.92];
        let air = [0.60, 0.70, 0.82];
        std::array::from_fn(|k| {
            let albedo = (f32::from(photo[k]) / 255.0).powf(2.2) * 1.7;
            let lit = albedo * (ambient[k] + sun[k] * light);
            lit + (air[k] - lit) * haze
        })
    }
}

fn sky(up: f32) -> [f32; 3] {
    let t = up.clamp(0.0, 1.0).sqrt();
    [0.66 - 0.46 * t, 0.77 - 0.40 * t, 0.88 - 0.26 * t]
}

fn encoded(colour: [f32; 3]) -> [u8; 3] {
    colour.map(|v| {
        let toned = v / (1.0 + 0.25 * v);
        (toned.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0 + 0.5) as u8
    })
}

fn perspective(model: &Model, camera: &GeographicCamera) -> Vec<u8> {
    let (width, height) = PICTURE;
    let enu = camera.enu_from_view();
    let half = (0.5 * camera.fov_y_deg).to_radians().tan();
    let (u0, v0) = model.at(camera.lon, camera.lat);
    (0..width * height)
        .into_par_iter()
        .flat_map_iter(|pixel| {
            let x = (2.0 * ((pixel % width) as f64 + 0.5) / width as f64 - 1.0) * half * width as f64
                / height as f64;
            let y = (1.0 - 2.0 * ((pixel / width) as f64 + 0.5) / height as f64) * half;
            let ray = (enu.x_axis * x + enu.y_axis * y - enu.z_axis).normalize().as_vec3();
            let mut distance = 20.0_f32;
            let mut before = distance;
            let mut colour = sky(ray.z);
            while distance < 60_000.0 {
                let place = |s: f32| (u0 + ray.x * s / model.cell.0, v0 - ray.y * s / model.cell.1);
                let z =
                    |s: f32| camera.height as f32 + ray.z * s + s * s * (1.0 - ray.z * ray.z) / 12_760_000.0;
                let (u, v) = place(distance);
                let ground = model.height(u, v);
                if ground.is_some_and(|ground| z(distance) < ground) {
                    let (mut low, mut high) = (before, distance);
                    for _ in 0..12 {
                        let middle = 0.5 * (low + high);
                        let (u, v) = place(middle);
                        if model.height(u, v).is_some_and(|ground| z(middle) < ground) {
                            high = middle
                        } else {
                            low = middle
                        }
                    }
                    let (u, v) = place(high);
                    colour = model.shade(u, v, model.height(u, v).unwrap_or(0.0), high);
                    break;
                }
                before = distance;
                let clear = ground.map_or(200.0, |ground| z(distance) - ground);
                distance += (0.35 * clear).clamp(4.0 + distance * 0.0006, 400.0);
            }
            encoded(colour)
        })
        .collect()
}

fn from_above(model: &Model) -> (Vec<u8>, (usize, usize)) {
    let size = (GRID.0 / 3, GRID.1 / 3);
    let pixels = (0..size.0 * size.1)
        .into_par_iter()
        .flat_map_iter(|i| {
            let (u, v) = ((i % size.0) as f32 * 3.0 + 1.0, (i / size.0) as f32 * 3.0 + 1.0);
            encoded(model.shade(u, v, model.height(u, v).unwrap_or(0.0), 0.0))
        })
        .collect();
    (pixels, size)
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some(out) = arguments.first() else {
        bail!("usage: preview_procedural OUT.png [LON,LAT,HEIGHT,HEADING,PITCH]…")
    };
    let model = Model::new()?;
    if arguments.len() == 1 {
        let (pixels, size) = from_above(&model);
        image::save_buffer(out, &pixels, size.0 as u32, size.1 as u32, image::ColorType::Rgb8)?;
        return Ok(());
    }
    for (k, text) in arguments[1..].iter().enumerate() {
        let numbers: Vec<f64> = text
            .split(',')
            .map(|n| n.parse().with_context(|| format!("camera {text}: {n} is no number")))
            .collect::<Result<_>>()?;
        let [lon, lat, height, heading_deg, pitch_deg] = numbers[..] else {
            bail!("camera {text} needs five numbers: LON,LAT,HEIGHT,HEADING,PITCH");
        };
        let camera = GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 45.0 };
        camera.check().map_err(anyhow::Error::msg)?;
        let path = if k == 0 { out.clone() } else { out.replace(".png", &format!("-{k}.png")) };
        image::save_buffer(
            &path,
            &perspective(&model, &camera),
            PICTURE.0 as u32,
            PICTURE.1 as u32,
            image::ColorType::Rgb8,
        )?;
    }
    Ok(())
}
