//! The massif's photo, whose every texel is the mean of its four children.
//!
//! Texels of one level are coloured at once from the fields (level 10: 38 m); coarser levels are
//! their means. Finer levels go down from there, only in the window that is wanted: children are
//! coloured from the fields at their own footprint, then corrected so that the mean of each four is
//! their parent's colour ([`super::settle`]). Colours are carried in f32; rounding costs at most ½.

use super::geography::{BOUNDS, Places, east_from_longitude, north_from_latitude};
use super::ground::{Ground, Landscape, Survey};
use super::material::for_each_place;
use super::palette;
use super::settle::{self, Colour, MARGIN, mean};
use crate::source::wide::wide;
use crate::source::{ColourField, FieldExtent, SampleGrid, SourceError};
use rayon::prelude::*;
use std::sync::LazyLock;
use treeline_core::geodesy;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::tile;

/// Level that is coloured at once.
const BASE_LEVEL: u8 = 10;
/// Level of the finest texels, 0.6 m from north to south.
const DEEPEST_LEVEL: u8 = 16;
/// The extent's first column and row on level 1, whose texels fit it exactly, and its size there.
const LEVEL_1: Window = Window { column: 1085, row: 244, width: 3, height: 2 };

/// A rectangle of a level's texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Window {
    column: i64,
    row: i64,
    width: usize,
    height: usize,
}

impl Window {
    /// The extent on a level from 1 down.
    fn extent(level: u8) -> Self {
        let shift = level - 1;
        Self {
            column: LEVEL_1.column << shift,
            row: LEVEL_1.row << shift,
            width: LEVEL_1.width << shift,
            height: LEVEL_1.height << shift,
        }
    }

    /// The common part, if there is any.
    fn clipped(self, other: Self) -> Option<Self> {
        let column = self.column.max(other.column);
        let row = self.row.max(other.row);
        let east = (self.column + self.width as i64).min(other.column + other.width as i64);
        let south = (self.row + self.height as i64).min(other.row + other.height as i64);
        (east > column && south > row).then(|| Self {
            column,
            row,
            width: (east - column) as usize,
            height: (south - row) as usize,
        })
    }

    /// With `margin` more texels on every side.
    fn widened(self, margin: usize) -> Self {
        Self {
            column: self.column - margin as i64,
            row: self.row - margin as i64,
            width: self.width + 2 * margin,
            height: self.height + 2 * margin,
        }
    }

    /// The parents of its texels.
    fn parents(self) -> Self {
        let (column, row) = (self.column >> 1, self.row >> 1);
        let last_column = (self.column + self.width as i64 - 1) >> 1;
        let last_row = (self.row + self.height as i64 - 1) >> 1;
        Self {
            column,
            row,
            width: (last_column - column + 1) as usize,
            height: (last_row - row + 1) as usize,
        }
    }
}

/// The base level and the means above it, coarsest first: levels 1 … [`BASE_LEVEL`].
pub(super) struct Pyramid {
    levels: Vec<Vec<Colour>>,
}

impl Pyramid {
    /// Colours the base level (in parallel) and takes the means.
    pub(super) fn new(land: &Landscape) -> Self {
        let extent = Window::extent(BASE_LEVEL);
        let mut base = vec![[0.0; 3]; extent.width * extent.height];
        base.par_chunks_mut(extent.width * 16).enumerate().for_each(|(chunk, out)| {
            let row = extent.row + 16 * chunk as i64;
            paint(land, BASE_LEVEL, Window { row, height: out.len() / extent.width, ..extent }, out);
        });
        let mut levels = vec![base];
        for level in (1..BASE_LEVEL).rev() {
            let size = Window::extent(level);
            let finer = &levels[levels.len() - 1];
            let stride = 2 * size.width;
            let coarser = (0..size.width * size.height)
                .map(|i| {
                    let at = 2 * (i / size.width) * stride + 2 * (i % size.width);
                    mean([finer[at], finer[at + 1], finer[at + stride], finer[at + stride + 1]])
                })
                .collect();
            levels.push(coarser);
        }
        levels.reverse();
        Self { levels }
    }
}

/// Colours along a row.
#[inline(always)]
fn paint_row(ground: &[Ground], footprint: f32, line: &mut [Colour]) {
    for_each_place(ground, footprint, |k, ground, here| {
        line[k] = palette::colour(ground, here, footprint);
    });
}

/// Colours texels of a window inside the extent from the fields.
fn paint(land: &Landscape, level: u8, window: Window, out: &mut [Colour]) {
    let lattice = LatticeWindow {
        level,
        registration: Registration::Cell,
        first_column: window.column,
        first_row: window.row,
        width: window.width as u32,
        height: window.height as u32,
    };
    let x: Vec<f64> =
        (0..window.width as i64).map(|i| east_from_longitude(lattice.longitude(window.column + i))).collect();
    let footprint = tile::cell_metres(level) as f32;
    let mut survey = Survey::new(land, &x, footprint, true);
    let mut ground = vec![Ground::default(); window.width];
    for (j, line) in out.chunks_exact_mut(window.width).enumerate() {
        survey.row(north_from_latitude(lattice.latitude(window.row + j as i64)), &mut ground);
        wide!(paint_row(ground: &[Ground] = &ground, footprint: f32 = footprint, line: &mut [Colour] = line));
    }
}

/// The photo of the built-in massif.
pub struct ProceduralColour {
    land: &'static LazyLock<Landscape>,
    pyramid: &'static LazyLock<Pyramid>,
    extent: FieldExtent,
}

impl ProceduralColour {
    pub(super) fn new(land: &'static LazyLock<Landscape>, pyramid: &'static LazyLock<Pyramid>) -> Self {
        let extent = FieldExtent { bounds: BOUNDS, resolution_metres: 0.6, projected_epsg: None };
        Self { land, pyramid, extent }
    }

    /// Colours of a window inside the extent, level 1 … [`DEEPEST_LEVEL`].
    fn window(&self, level: u8, window: Window) -> Vec<Colour> {
        if level <= BASE_LEVEL {
            let extent = Window::extent(level);
            let texels = &self.pyramid.levels[usize::from(level) - 1];
            let mut out = Vec::with_capacity(window.width * window.height);
            for j in 0..window.height {
                let row = (window.row - extent.row) as usize + j;
                let start = row * extent.width + (window.column - extent.column) as usize;
                out.extend_from_slice(&texels[start..start + window.width]);
            }
            return out;
        }
        // Corrections spread to neighbours, so a margin is coloured too; at the extent's edge there is none.
        let Some(above) = window.parents().widened(MARGIN).clipped(Window::extent(level - 1)) else {
            return Vec::new();
        };
        let parents = self.window(level - 1, above);
        let wide = Window {
            column: 2 * above.column,
            row: 2 * above.row,
            width: 2 * above.width,
            height: 2 * above.height,
        };
        let mut children = vec![[0.0; 3]; wide.width * wide.height];
        paint(self.land, level, wide, &mut children);
        settle::settle(&mut children, &parents, above.width);
        let skip_columns = (window.column - wide.column) as usize;
        let skip_rows = (window.row - wide.row) as usize;
        (0..window.height)
            .flat_map(|j| {
                let start = (j + skip_rows) * wide.width + skip_columns;
                &children[start..start + window.width]
            })
            .copied()
            .collect()
    }

    /// A lattice window of level 1 … [`DEEPEST_LEVEL`], texel by texel.
    fn lattice(&self, wanted: &LatticeWindow, out: &mut [[u8; 4]]) {
        let turn = 512_i64 << (wanted.level + 1);
        let extent = Window::extent(wanted.level);
        for turns in -2..=2 {
            let place = Window {
                column: wanted.first_column + turns * turn,
                row: wanted.first_row,
                width: wanted.width as usize,
                height: wanted.height as usize,
            };
            let Some(part) = place.clipped(extent) else { continue };
            let colours = self.window(wanted.level, part);
            let (skip_columns, skip_rows) =
                ((part.column - place.column) as usize, (part.row - place.row) as usize);
            for (j, line) in colours.chunks_exact(part.width).enumerate() {
                let start = (j + skip_rows) * place.width + skip_columns;
                for (out, colour) in out[start..start + part.width].iter_mut().zip(line) {
                    *out = rounded(*colour, 255);
                }
            }
        }
    }

    /// Level 0: a texel is the mean of the four of level 1, as far as there are any.
    fn whole_world(&self, wanted: &LatticeWindow, out: &mut [[u8; 4]]) {
        let texels = &self.pyramid.levels[0];
        for j in 0..i64::from(wanted.height) {
            for i in 0..i64::from(wanted.width) {
                let column = (wanted.first_column + i).rem_euclid(1024);
                let row = wanted.first_row + j;
                let (mut sum, mut count) = ([0.0_f32; 3], 0_u16);
                for child in 0..4_i64 {
                    let x = 2 * column + (child & 1) - LEVEL_1.column;
                    let y = 2 * row + (child >> 1) - LEVEL_1.row;
                    if (0..LEVEL_1.width as i64).contains(&x) && (0..LEVEL_1.height as i64).contains(&y) {
                        let texel = texels[y as usize * LEVEL_1.width + x as usize];
                        sum = std::array::from_fn(|k| sum[k] + texel[k]);
                        count += 1;
                    }
                }
                if count > 0 {
                    let colour = sum.map(|v| v / f32::from(count));
                    out[j as usize * wanted.width as usize + i as usize] =
                        rounded(colour, (64 * count - 1) as u8);
                }
            }
        }
    }

    /// Any other places: bilinear between texels about as large as the samples.
    fn resampled(&self, grid: &SampleGrid, out: &mut [[u8; 4]]) -> Result<(), SourceError> {
        let places = Places::of(grid)?;
        let (Some(west), Some(east)) = (places.x.first(), places.x.last()) else { return Ok(()) };
        let (Some(north), Some(south)) = (places.y.first(), places.y.last()) else { return Ok(()) };
        let level = level_for(&places, grid);
        let step = tile::span_degrees(level) / f64::from(tile::CELLS);
        let extent = Window::extent(level);
        // Texel coordinates, whole numbers at centres.
        let across = |x: &f64| {
            (x / super::geography::METRES_PER_DEGREE_EAST + super::geography::CENTRE_LONGITUDE + 180.0) / step
                - 0.5
        };
        let down = |y: &f64| {
            (90.0 - super::geography::CENTRE_LATITUDE - y / super::geography::METRES_PER_DEGREE_NORTH) / step
                - 0.5
        };
        let (first_column, last_column) = (across(west).floor() as i64, across(east).floor() as i64 + 1);
        let (first_row, last_row) = (down(north).floor() as i64, down(south).floor() as i64 + 1);
        let needed = Window {
            column: first_column,
            row: first_row,
            width: (last_column - first_column + 1) as usize,
            height: (last_row - first_row + 1) as usize,
        };
        let Some(part) = needed.clipped(extent) else { return Ok(()) };
        let colours = self.window(level, part);
        let split = |at: f64, first: i64, count: usize| {
            let clamped = (at - first as f64).clamp(0.0, (count - 1) as f64);
            let low = (clamped as usize).min(count.saturating_sub(2));
            (low, (low + 1).min(count - 1), (clamped - low as f64) as f32)
        };
        let columns: Vec<_> = places.x.iter().map(|x| split(across(x), part.column, part.width)).collect();
        for (&j, y) in places.rows.iter().zip(&places.y) {
            let (above, below, fall) = split(down(y), part.row, part.height);
            for (&i, &(left, right, run)) in places.columns.iter().zip(&columns) {
                let at = |row: usize, column: usize| colours[row * part.width + column];
                let (a, b, c, d) = (at(above, left), at(above, right), at(below, left), at(below, right));
                let colour: Colour = std::array::from_fn(|k| {
                    let top = a[k] + (b[k] - a[k]) * run;
                    let bottom = c[k] + (d[k] - c[k]) * run;
                    top + (bottom - top) * fall
                });
                out[j * places.width + i] = rounded(colour, 255);
            }
        }
        Ok(())
    }
}

/// The level whose texels are about as large as the grid's samples, the coarser of the two ways
/// (an extreme shape is no reason to colour millions of texels).
fn level_for(places: &Places, grid: &SampleGrid) -> u8 {
    let spacing = |line: &[f64]| match line {
        [first, .., last] => (last - first).abs() / (line.len() - 1) as f64,
        _ => 0.0,
    };
    let (width, height) = match grid {
        SampleGrid::Box {
            crs: crate::source::RequestCrs::Geographic,
            west,
            south,
            east,
            north,
            width,
            height,
        } => (
            (east - west) / f64::from(*width) * super::geography::METRES_PER_DEGREE_EAST,
            (north - south) / f64::from(*height) * super::geography::METRES_PER_DEGREE_NORTH,
        ),
        _ => (spacing(&places.x), spacing(&places.y)),
    };
    let metres_of_degree = geodesy::EQUATOR_METRES / 360.0;
    let degrees = (width / super::geography::METRES_PER_DEGREE_EAST)
        .max(height / super::geography::METRES_PER_DEGREE_NORTH);
    tile::level_for_cell_metres(degrees * metres_of_degree * 1.2).clamp(1, DEEPEST_LEVEL)
}

fn rounded(colour: Colour, alpha: u8) -> [u8; 4] {
    let [r, g, b] = colour.map(|v| (v + 0.5) as u8);
    [r, g, b, alpha]
}

impl ColourField for ProceduralColour {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [[u8; 4]]) -> Result<(), SourceError> {
        out.fill([0; 4]);
        match grid {
            SampleGrid::Lattice(window) if window.registration == Registration::Cell => match window.level {
                0 => self.whole_world(window, out),
                1..=DEEPEST_LEVEL => self.lattice(window, out),
                _ => self.resampled(grid, out)?,
            },
            _ => self.resampled(grid, out)?,
        }
        Ok(())
    }
}
