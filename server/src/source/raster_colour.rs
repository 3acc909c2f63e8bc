//! Colours from a raster: bilinear at its own level, and the mean of the four samples of the level
//! below on coarser ones.

use super::geotiff::Raster;
use super::geotiff::colour::ColourRule;
use super::placement::Placement;
use super::projector::Projector;
use super::raster_height::field_extent;
use super::window::{Block, View, choose_image};
use super::{ColourField, Description, FieldExtent, SampleGrid, SourceError};
use std::sync::Arc;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::tile::{self, CELLS};

/// Windows up to this many pixels are averaged from the full image; beyond, from an overview.
const FULL_WINDOW_PIXELS: f64 = 32.0 * 1024.0 * 1024.0;
/// Samples along a side that are averaged at most. A raster that is coarser seen still, and has no
/// overview, is thinned to that: its pixels are then not all looked at.
const MAXIMUM_SAMPLES: u32 = 16;
/// Sums are whole numbers of this part, so that they do not depend on the order of summation.
const PARTS: f32 = 256.0;

/// A photo.
pub struct RasterColour {
    raster: Arc<Raster>,
    placement: Placement,
    rule: ColourRule,
    extent: FieldExtent,
}

impl RasterColour {
    /// Colours of an open raster, `nodata` in place of what it declares.
    ///
    /// # Errors
    /// Where its coordinates or its colours make no sense here.
    pub fn new(raster: Arc<Raster>, nodata: Option<f64>) -> Result<Self, SourceError> {
        let placement = Placement::of(&raster)?;
        let rule =
            ColourRule::of(&raster, nodata).map_err(|(problem, mend)| raster.unusable(&problem, &mend))?;
        let extent = field_extent(&placement);
        Ok(Self { raster, placement, rule, extent })
    }

    /// The file.
    pub fn raster(&self) -> &Raster {
        &self.raster
    }

    /// Its place.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// What there is to say about it.
    pub fn describe(&self) -> Description {
        Description::of(&self.raster, &self.placement, self.rule.nodata())
    }

    /// The image to read, and the grid of finer samples of which each sample is the mean of n × n.
    fn plan(&self, grid: &SampleGrid) -> (usize, SampleGrid, u32) {
        let step = Projector::new(&self.placement, grid).pixels_per_sample();
        let samples = match grid {
            SampleGrid::Lattice(_) => f64::from(CELLS + 8).powi(2),
            SampleGrid::Box { .. } => grid.len() as f64,
        };
        let index = choose_image(&self.raster, step, samples * step.0 * step.1, FULL_WINDOW_PIXELS, 2.0);
        let reduction = f64::from(self.raster.size().0) / f64::from(self.raster.images[index].layout.width);
        match grid {
            SampleGrid::Lattice(window) if window.registration == Registration::Cell => {
                let own = tile::level_for_cell_metres(self.placement.resolution_metres() * reduction);
                let finer = own.saturating_sub(window.level).min(MAXIMUM_SAMPLES.ilog2() as u8);
                let n = 1_u32 << finer;
                let finer = LatticeWindow {
                    level: window.level + finer,
                    first_column: window.first_column * i64::from(n),
                    first_row: window.first_row * i64::from(n),
                    width: window.width * n,
                    height: window.height * n,
                    ..*window
                };
                (index, SampleGrid::Lattice(finer), n)
            }
            SampleGrid::Lattice(window) => {
                // Nodes have no children whose mean they could be: the footprint of each as a pixel.
                let bounds = window.pixel_box();
                let pixels = SampleGrid::Box {
                    crs: super::RequestCrs::Geographic,
                    west: bounds.west,
                    south: bounds.south,
                    east: bounds.east,
                    north: bounds.north,
                    width: window.width,
                    height: window.height,
                };
                self.plan(&pixels)
            }
            SampleGrid::Box { crs, west, south, east, north, width, height } => {
                // 1.05: a photo shown at its own scale stays a single bilinear sample.
                let n = (step.0.max(step.1) / reduction / 1.05).ceil().clamp(1.0, f64::from(MAXIMUM_SAMPLES))
                    as u32;
                let finer = SampleGrid::Box {
                    crs: crs.clone(),
                    west: *west,
                    south: *south,
                    east: *east,
                    north: *north,
                    width: width * n,
                    height: height * n,
                };
                (index, finer, n)
            }
        }
    }
}

impl ColourField for RasterColour {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [[u8; 4]]) -> Result<(), SourceError> {
        let (index, finer, n) = self.plan(grid);
        let projector = Projector::new(&self.placement, &finer);
        let view = View { raster: &self.raster, placement: &self.placement, index };
        let width = grid.size().0 as usize;
        let mut sums = vec![[0_u32; 4]; out.len()];
        view.visit(&projector, finer.size(), &mut |block| {
            if block.is_outside() {
                return Ok(());
            }
            let window = view.fetch(block, |image, rect| self.rule.read(image, rect))?;
            let opaque = window.iter().all(|pixel| pixel[3] == 255);
            for row in 0..block.size.1 {
                let line = (block.origin.1 + row) / n;
                let line = &mut sums[line as usize * width..(line as usize + 1) * width];
                if opaque {
                    add_row(block, row, &window, n, line, opaque_sample);
                } else {
                    add_row(block, row, &window, n, line, sample);
                }
            }
            Ok(())
        })?;
        for (target, sum) in out.iter_mut().zip(&sums) {
            *target = mean(*sum, n * n);
        }
        Ok(())
    }
}

/// Colour from sums of colour times coverage and of coverage, over `count` samples.
fn mean(sum: [u32; 4], count: u32) -> [u8; 4] {
    let full = 255.0 * PARTS * count as f32;
    let alpha = (sum[3] as f32 / full * 255.0).round() as u8;
    if alpha == 0 {
        return [0; 4];
    }
    let colour = |channel: u32| (channel as f32 / sum[3] as f32 * 255.0).round().min(255.0) as u8;
    [colour(sum[0]), colour(sum[1]), colour(sum[2]), alpha]
}

fn add_row(
    block: &Block<'_>,
    row: u32,
    window: &[[u8; 4]],
    n: u32,
    sums: &mut [[u32; 4]],
    sample: impl Fn([[u8; 4]; 4], f32, f32) -> [f32; 4],
) {
    let width = block.window_size.0 as usize;
    let (left, top) = (block.window_origin.0 as f64, block.window_origin.1 as f64);
    let mut column = block.origin.0 / n;
    let mut left_in_column = n - block.origin.0 % n;
    for &(u, v) in block.row(row) {
        if !u.is_nan() {
            let (x, y) = (u.floor(), v.floor());
            let at = (y - top) as usize * width + (x - left) as usize;
            let corners = [window[at], window[at + 1], window[at + width], window[at + width + 1]];
            let value = sample(corners, (u - x) as f32, (v - y) as f32);
            let sum = &mut sums[column as usize];
            for (part, value) in sum.iter_mut().zip(value) {
                *part += (value * PARTS + 0.5) as u32;
            }
        }
        left_in_column -= 1;
        if left_in_column == 0 {
            column += 1;
            left_in_column = n;
        }
    }
}

/// Bilinear between opaque pixels: colour, and 255.
fn opaque_sample(corners: [[u8; 4]; 4], fx: f32, fy: f32) -> [f32; 4] {
    let [a, b, c, d] = corners.map(|pixel| pixel.map(f32::from));
    let mut out = [255.0; 4];
    for channel in 0..3 {
        let upper = a[channel] + fx * (b[channel] - a[channel]);
        let lower = c[channel] + fx * (d[channel] - c[channel]);
        out[channel] = upper + fy * (lower - upper);
    }
    out
}

/// Bilinear weighted by alpha: colour times alpha, and alpha, both 0 … 255.
fn sample(corners: [[u8; 4]; 4], fx: f32, fy: f32) -> [f32; 4] {
    let weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
    let mut out = [0.0; 4];
    for (pixel, weight) in corners.into_iter().zip(weights) {
        let coverage = weight * f32::from(pixel[3]);
        for channel in 0..3 {
            out[channel] += coverage * f32::from(pixel[channel]) / 255.0;
        }
        out[3] += coverage;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_weighs_and_leaves_no_dark_fringe() {
        let (red, void) = ([200, 10, 0, 255], [0; 4]);
        let [r, g, b, a] = sample([red, void, red, void], 0.75, 0.5);
        let parts = [r, g, b, a].map(|value| (value * PARTS + 0.5) as u32);
        assert_eq!(mean(parts, 1), [200, 10, 0, 64]);
        assert_eq!(mean([0; 4], 4), [0; 4]);
        let opaque = opaque_sample([red; 4], 0.3, 0.4).map(|value| (4.0 * value * PARTS + 0.5) as u32);
        assert_eq!(mean(opaque, 4), [200, 10, 0, 255]);
    }
}
