//! Colours from a raster: bilinear at its own level, and the mean of the four samples of the level
//! below on coarser ones.

use super::coarse_lattice::{CoarseLattice, Sample, samples_in};
use super::crs::Crs;
use super::geotiff::Raster;
use super::geotiff::colour::ColourRule;
use super::geotiff::georeference::Affine;
use super::geotiff::image::Rect;
use super::placement::Placement;
use super::projector::Projector;
use super::raster_height::field_extent;
use super::wide::wide;
use super::window::{Block, View, bands, choose_image};
use super::{ColourField, Description, FieldExtent, SampleGrid, SourceError};
use std::sync::{Arc, OnceLock};
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::tile::{self, CELLS};

/// Windows up to this many pixels are averaged from the full image; beyond, from an overview where
/// there is one.
const FULL_WINDOW_PIXELS: f64 = 32.0 * 1024.0 * 1024.0;
/// Samples along a side that are averaged at most for a pixel of a box; coarser ones are averaged from
/// the coarse lattice.
const MAXIMUM_SAMPLES: f64 = 16.0;
/// The same in levels.
const MOST_LEVELS: u8 = 4;
/// Levels from an image's own to the finest that is kept: a kept sample is the mean of 4 × 4 of its own.
const KEPT_BELOW: u8 = 2;
/// Samples of one level that a coarse lattice looks at, at most (a minute's work). Of larger rasters
/// without overviews the coarse levels are means of part of the pixels.
const MAXIMUM_LATTICE_SAMPLES: f64 = 4.0e9;
/// And for each of its pixels: more are samples of a raster whose pixels are far from square.
const MAXIMUM_SAMPLES_PER_PIXEL: f64 = 16.0;
/// Sums are whole numbers of this part, so that they do not depend on the order of summation.
const PARTS: f32 = 256.0;
/// A float of this magnitude has no fraction bits: adding it rounds to a whole number, found in its bits.
const WHOLE: f32 = 12_582_912.0;

/// A photo.
pub struct RasterColour {
    raster: Arc<Raster>,
    placement: Placement,
    rule: ColourRule,
    extent: FieldExtent,
    /// By image: what it is on levels far coarser than its own.
    coarse: Vec<OnceLock<CoarseLattice<[u8; 4]>>>,
}

impl Sample for [u8; 4] {
    const NOTHING: Self = [0; 4];

    fn is_nothing(self) -> bool {
        self[3] == 0
    }

    fn of_four(four: [Self; 4]) -> Self {
        let mut sum = [0_u32; 4];
        for pixel in four {
            let alpha = u32::from(pixel[3]);
            for channel in 0..3 {
                sum[channel] += u32::from(pixel[channel]) * alpha;
            }
            sum[3] += alpha;
        }
        let alpha = (sum[3] + 2) / 4;
        if alpha == 0 {
            return Self::NOTHING;
        }
        let colour = |channel: usize| ((sum[channel] + sum[3] / 2) / sum[3]) as u8;
        [colour(0), colour(1), colour(2), alpha as u8]
    }
}

/// How the samples of a grid are found.
enum Plan {
    /// Each the mean of n × n samples, on a finer grid, of an image.
    Direct { image: usize, finer: SampleGrid, n: u32 },
    /// From an image's coarse lattice, as they are.
    Kept { image: usize, window: LatticeWindow },
    /// Pixels of a box, each the mean of n × n bilinear samples of a level of the coarse lattice.
    FromKept { image: usize, level: u8, finer: SampleGrid, n: u32 },
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
        let coarse = raster.images.iter().map(|_| OnceLock::new()).collect();
        Ok(Self { raster, placement, rule, extent, coarse })
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

    /// Pixels of the full image in one of an image.
    fn reduction(&self, image: usize) -> f64 {
        f64::from(self.raster.size().0) / f64::from(self.raster.images[image].layout.width)
    }

    /// The level on which an image is sampled bilinearly.
    fn own_level(&self, image: usize) -> u8 {
        tile::level_for_cell_metres(self.placement.resolution_metres() * self.reduction(image))
    }

    /// The level whose samples the coarse lattice of an image averages: its own, or of an image of very
    /// many pixels a coarser one.
    fn averaged_level(&self, image: usize) -> u8 {
        let bounds = self.placement.bounds();
        let layout = &self.raster.images[image].layout;
        let pixels = f64::from(layout.width) * f64::from(layout.height);
        let most = MAXIMUM_LATTICE_SAMPLES.min(MAXIMUM_SAMPLES_PER_PIXEL * pixels + 1.0e6);
        (0..=self.own_level(image)).rev().find(|&level| samples_in(&bounds, level) <= most).unwrap_or(0)
    }

    fn plan(&self, grid: &SampleGrid) -> Plan {
        let step = Projector::new(&self.placement, grid).pixels_per_sample();
        let samples = match grid {
            SampleGrid::Lattice(_) => f64::from(CELLS + 8).powi(2),
            SampleGrid::Box { .. } => grid.len() as f64,
        };
        let image = choose_image(&self.raster, step, samples * step.0 * step.1, FULL_WINDOW_PIXELS, 2.0);
        match grid {
            SampleGrid::Lattice(window) if window.registration == Registration::Cell => {
                if window.level + KEPT_BELOW <= self.averaged_level(image) {
                    return Plan::Kept { image, window: *window };
                }
                let levels = self.own_level(image).saturating_sub(window.level).min(MOST_LEVELS);
                let (finer, n) = finer_lattice(window, levels);
                Plan::Direct { image, finer: SampleGrid::Lattice(finer), n }
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
            SampleGrid::Box { .. } => {
                let (finest, averaged) = (step.0.max(step.1), self.averaged_level(image));
                // 1.05: a photo shown at its own scale stays a single bilinear sample.
                let n = (finest / self.reduction(image) / 1.05).ceil().max(1.0);
                if n <= MAXIMUM_SAMPLES || averaged < KEPT_BELOW {
                    let n = n.min(MAXIMUM_SAMPLES) as u32;
                    return Plan::Direct { image, finer: finer_box(grid, n), n };
                }
                // The coarsest level with at least two samples for a pixel either way.
                let degrees = (step.0 / self.placement.pixels_per_degree().0)
                    .min(step.1 / self.placement.pixels_per_degree().1);
                let level = (0..=averaged - KEPT_BELOW)
                    .find(|&level| 2.0 * tile::span_degrees(level) / f64::from(CELLS) <= degrees)
                    .unwrap_or(averaged - KEPT_BELOW);
                let texel =
                    tile::span_degrees(level) / f64::from(CELLS) * self.placement.pixels_per_degree().0;
                let n = (finest / texel / 1.05).ceil().clamp(1.0, MAXIMUM_SAMPLES) as u32;
                Plan::FromKept { image, level, finer: finer_box(grid, n), n }
            }
        }
    }

    /// Sums the samples of an image on a grid, n × n each, from the image itself.
    fn average(
        &self,
        image: usize,
        finer: &SampleGrid,
        n: u32,
        out: &mut [[u8; 4]],
    ) -> Result<(), SourceError> {
        let projector = Projector::new(&self.placement, finer);
        let view = View::of(&self.raster, &self.placement, image);
        let source = &self.raster.images[image];
        let read =
            |rect: Rect| self.rule.read(source, rect).map_err(|problem| self.raster.read_error(problem));
        average(&view, &projector, finer, n, &read, out)
    }

    /// A window of an image's coarse lattice.
    fn kept(&self, image: usize, window: &LatticeWindow, out: &mut [[u8; 4]]) -> Result<(), SourceError> {
        // What claims to be large and cannot be read is told before any work on it: its middle is needed anyway.
        let source = &self.raster.images[image];
        let middle = Rect { x: source.layout.width / 2, y: source.layout.height / 2, width: 1, height: 1 };
        self.rule.read(source, middle).map_err(|problem| self.raster.read_error(problem))?;
        let averaged = self.averaged_level(image);
        let lattice = self.coarse[image]
            .get_or_init(|| CoarseLattice::new(Registration::Cell, averaged.saturating_sub(KEPT_BELOW)));
        let make = |window: &LatticeWindow, out: &mut [[u8; 4]]| {
            let (finer, n) = finer_lattice(window, averaged - window.level);
            self.average(image, &SampleGrid::Lattice(finer), n, out)
        };
        lattice.fill(&self.placement, &self.raster.path, window, &make, out)
    }

    /// Pixels of a box from a level of an image's coarse lattice, as if that were a photo of its own.
    fn average_kept(
        &self,
        image: usize,
        level: u8,
        (finer, n): (&SampleGrid, u32),
        out: &mut [[u8; 4]],
    ) -> Result<(), SourceError> {
        let bounds = self.placement.bounds();
        let step = tile::span_degrees(level) / f64::from(CELLS);
        let (column, row) = (((bounds.west + 180.0) / step).floor(), ((90.0 - bounds.north) / step).floor());
        let width = ((bounds.east + 180.0) / step).ceil() - column;
        let height = ((90.0 - bounds.south) / step).ceil() - row;
        let affine = Affine { x: (column * step - 180.0, step, 0.0), y: (90.0 - row * step, 0.0, -step) };
        // A plain geographic box has a place wherever the raster has one.
        let Ok(placement) = Placement::new(Crs::wgs84(), affine, width as u32, height as u32) else {
            return Ok(());
        };
        let read = |rect: Rect| {
            let window = LatticeWindow {
                level,
                registration: Registration::Cell,
                first_column: column as i64 + i64::from(rect.x),
                first_row: row as i64 + i64::from(rect.y),
                width: rect.width,
                height: rect.height,
            };
            let mut colours = vec![[0; 4]; rect.len()];
            self.kept(image, &window, &mut colours).map(|()| colours)
        };
        let projector = Projector::new(&placement, finer);
        average(&View::of_placement(&placement), &projector, finer, n, &read, out)
    }
}

impl ColourField for RasterColour {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [[u8; 4]]) -> Result<(), SourceError> {
        match self.plan(grid) {
            Plan::Direct { image, finer, n } => self.average(image, &finer, n, out),
            Plan::Kept { image, window } => self.kept(image, &window, out),
            Plan::FromKept { image, level, finer, n } => self.average_kept(image, level, (&finer, n), out),
        }
    }
}

/// The window of a level finer by `levels`, and its samples along the side of one.
fn finer_lattice(window: &LatticeWindow, levels: u8) -> (LatticeWindow, u32) {
    let n = 1_u32 << levels;
    let finer = LatticeWindow {
        level: window.level + levels,
        first_column: window.first_column * i64::from(n),
        first_row: window.first_row * i64::from(n),
        width: window.width * n,
        height: window.height * n,
        ..*window
    };
    (finer, n)
}

/// A box with n × n as many samples.
fn finer_box(grid: &SampleGrid, n: u32) -> SampleGrid {
    let mut finer = grid.clone();
    if let SampleGrid::Box { width, height, .. } = &mut finer {
        *width *= n;
        *height *= n;
    }
    finer
}

/// Means of n × n bilinear samples each; `read` gives the colours of a window of the view's pixels.
fn average(
    view: &View<'_>,
    projector: &Projector<'_>,
    finer: &SampleGrid,
    n: u32,
    read: &dyn Fn(Rect) -> Result<Vec<[u8; 4]>, SourceError>,
    out: &mut [[u8; 4]],
) -> Result<(), SourceError> {
    let width = (finer.size().0 / n) as usize;
    // Sums are four times what comes of them: those of a band of rows at a time, and of the line that it shares with
    // the next.
    let mut sums: Vec<[u32; 4]> = Vec::new();
    let mut out = out.chunks_mut(width.max(1));
    for (first_row, rows) in bands(finer.size().1) {
        let first_line = first_row / n;
        let end = first_row + rows;
        sums.resize((end.div_ceil(n) - first_line) as usize * width, [0; 4]);
        view.visit_band(projector, finer.size().0, (first_row, rows), &mut |block| {
            if block.is_outside() {
                return Ok(());
            }
            let window = view.fetch(block, read)?;
            if window.iter().all(|pixel| pixel.is_nothing()) {
                return Ok(());
            }
            wide!(add_block(
                block: &Block<'_> = block,
                window: &[[u8; 4]] = &window,
                n: u32 = n,
                first_line: u32 = first_line,
                width: usize = width,
                sums: &mut [[u32; 4]] = &mut sums,
            ));
            Ok(())
        })?;
        let complete = (end / n - first_line) as usize * width;
        for (sums, line) in sums[..complete].chunks(width.max(1)).zip(&mut out) {
            wide!(means(sums: &[[u32; 4]] = sums, count: u32 = n * n, out: &mut [[u8; 4]] = line));
        }
        sums.drain(..complete);
    }
    Ok(())
}

#[inline(always)]
fn means(sums: &[[u32; 4]], count: u32, out: &mut [[u8; 4]]) {
    for (target, sum) in out.iter_mut().zip(sums) {
        *target = mean(*sum, count);
    }
}

/// Colour from sums of colour times coverage and of coverage, over `count` samples.
#[inline(always)]
fn mean(sum: [u32; 4], count: u32) -> [u8; 4] {
    // Sums of a few hundred samples at most: as signed numbers, which processors convert at once.
    let [red, green, blue, alpha] = sum.map(|value| value as i32 as f32);
    let nearest = |part: f32| (255.0 * part + 0.5) as i32 as u8;
    let coverage = nearest(alpha / (255.0 * PARTS * count as f32));
    if coverage == 0 {
        return [0; 4];
    }
    let colour = |channel: f32| nearest((channel / alpha).min(1.0));
    [colour(red), colour(green), colour(blue), coverage]
}

/// Adds the samples of a block to the sums of the lines of a grid of `width` columns, from `first_line` on.
#[inline(always)]
fn add_block(
    block: &Block<'_>,
    window: &[[u8; 4]],
    n: u32,
    first_line: u32,
    width: usize,
    sums: &mut [[u32; 4]],
) {
    let opaque = window.iter().all(|pixel| pixel[3] == 255);
    for row in 0..block.size.1 {
        let line = ((block.origin.1 + row) / n - first_line) as usize;
        let line = &mut sums[line * width..(line + 1) * width];
        if opaque {
            add_row(block, row, window, n, line, opaque_sample);
        } else {
            add_row(block, row, window, n, line, sample);
        }
    }
}

#[inline(always)]
fn add_row(
    block: &Block<'_>,
    row: u32,
    window: &[[u8; 4]],
    n: u32,
    sums: &mut [[u32; 4]],
    sample: impl Fn([[u8; 4]; 4], f32, f32) -> [f32; 4],
) {
    let width = block.window_size.0 as usize;
    let (left, top) = (block.window_origin.0 as i32, block.window_origin.1 as i32);
    let samples = block.row(row);
    let mut column = (block.origin.0 / n) as usize;
    let mut next = 0;
    // Up to the end of the first sample's column, then column by column.
    let mut count = (n - block.origin.0 % n) as usize;
    while next < samples.len() {
        let end = (next + count).min(samples.len());
        let mut sum = [0_u32; 4];
        for &(u, v) in &samples[next..end] {
            if u.is_nan() {
                continue;
            }
            let (x, y) = (floor(u), floor(v));
            let at = (y - top) as usize * width + (x - left) as usize;
            let (north, south) = (&window[at..at + 2], &window[at + width..at + width + 2]);
            let corners = [north[0], north[1], south[0], south[1]];
            let value = sample(corners, (u - f64::from(x)) as f32, (v - f64::from(y)) as f32);
            let part = |value: f32| (value * PARTS + WHOLE).to_bits() - WHOLE.to_bits();
            let [r, g, b, a] = value;
            let [red, green, blue, alpha] = sum;
            sum = [red + part(r), green + part(g), blue + part(b), alpha + part(a)];
        }
        for (total, part) in sums[column].iter_mut().zip(sum) {
            *total += part;
        }
        (next, count, column) = (end, n as usize, column + 1);
    }
}

/// The whole number below (numbers are pixels of a raster, from −1).
#[inline(always)]
fn floor(value: f64) -> i32 {
    value as i32 - i32::from(value < 0.0)
}

/// Bilinear between opaque pixels: colour, and 255.
#[inline(always)]
fn opaque_sample([a, b, c, d]: [[u8; 4]; 4], fx: f32, fy: f32) -> [f32; 4] {
    let upper = between(floats(a), floats(b), fx);
    let lower = between(floats(c), floats(d), fx);
    between(upper, lower, fy)
}

// Spelt out, so that compilers make one vector instruction of four.
#[inline(always)]
fn floats([r, g, b, a]: [u8; 4]) -> [f32; 4] {
    [f32::from(r), f32::from(g), f32::from(b), f32::from(a)]
}

#[inline(always)]
fn between(a: [f32; 4], b: [f32; 4], t: f32) -> [f32; 4] {
    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2]), a[3] + t * (b[3] - a[3])]
}

/// Bilinear weighted by alpha: colour times alpha, and alpha, both 0 … 255.
#[inline(always)]
fn sample(corners: [[u8; 4]; 4], fx: f32, fy: f32) -> [f32; 4] {
    let weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
    let mut out = [0.0; 4];
    for (pixel, weight) in corners.into_iter().zip(weights) {
        let coverage = weight * f32::from(pixel[3]);
        let share = coverage / 255.0;
        for channel in 0..3 {
            out[channel] += share * f32::from(pixel[channel]);
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
