//! Heights from a raster: bilinear between pixel centres, a void never blended into data.

use super::coarse_lattice::{CoarseLattice, Sample, samples_in};
use super::geotiff::Raster;
use super::geotiff::image::{Rect, ValueRule};
use super::placement::Placement;
use super::projector::Projector;
use super::summary::Summary;
use super::window::{Block, View, choose_image};
use super::{Description, FieldExtent, HeightField, SampleGrid, SourceError};
use std::sync::{Arc, OnceLock};
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::tile::{self, CELLS, GeographicBox};

/// Heights beyond this, metres, are no heights of the Earth.
pub const BELIEVABLE_METRES: f64 = 1e6;
/// Windows up to this many pixels are read at full resolution, so that a height is the place's own
/// whatever the level; beyond, an overview is read where there is one.
const FULL_WINDOW_PIXELS: f64 = 64.0 * 1024.0 * 1024.0;
/// Rasters up to this many pixels are read at full resolution for the nodes of every level: a second or
/// two, once.
const FULL_RASTER_PIXELS: u64 = 256 << 20;
/// Levels from a raster's own to the finest whose nodes are kept: they lie 16 to 32 pixels apart.
const KEPT_BELOW: u8 = 4;
/// Boxes up to this many pixels have their maxima from the pixels themselves.
const EXACT_MAXIMA_PIXELS: u64 = 1 << 20;
/// A neighbour of less weight than this, in pixels, is not a neighbour: a sample that stands at a
/// pixel, but for rounding, is that pixel though its neighbours be void.
const NEGLIGIBLE_WEIGHT: f32 = 1e-5;

/// Heights of a raster's first band.
pub struct RasterHeight {
    raster: Arc<Raster>,
    placement: Placement,
    rule: ValueRule,
    extent: FieldExtent,
    summary: OnceLock<Summary>,
    /// The full image's heights on the nodes of levels far coarser than its own.
    coarse: OnceLock<CoarseLattice<f32>>,
}

impl Sample for f32 {
    const NOTHING: Self = Self::NAN;

    fn is_nothing(self) -> bool {
        self.is_nan()
    }

    /// Heights are those of places: the node at the same place.
    fn of_four([north_west, ..]: [Self; 4]) -> Self {
        north_west
    }
}

impl RasterHeight {
    /// Heights of an open raster; `rule` makes metres of what is stored.
    ///
    /// # Errors
    /// Where its coordinates make no sense in its reference system.
    pub fn new(raster: Arc<Raster>, rule: ValueRule) -> Result<Self, SourceError> {
        let placement = Placement::of(&raster)?;
        let extent = field_extent(&placement);
        Ok(Self { raster, placement, rule, extent, summary: OnceLock::new(), coarse: OnceLock::new() })
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
        Description::of(&self.raster, &self.placement, self.rule.nodata)
    }

    fn summary(&self) -> &Summary {
        self.summary.get_or_init(|| Summary::build(&self.raster, 0, &self.rule))
    }

    /// The finest level whose nodes are kept; far fewer than there are pixels, however little square those
    /// may be.
    fn finest_kept_level(&self) -> Option<u8> {
        let own = tile::level_for_cell_metres(self.extent.resolution_metres);
        let (width, height) = self.raster.size();
        let most = f64::from(width) * f64::from(height) / 16.0 + 1.0e5;
        (0..=own.checked_sub(KEPT_BELOW)?).rev().find(|&level| samples_in(&self.extent.bounds, level) <= most)
    }

    /// The image to read.
    fn image(&self, projector: &Projector<'_>, grid: &SampleGrid) -> usize {
        let step = projector.pixels_per_sample();
        // For a lattice by the level alone, not by the window: neighbours must read the same image.
        let (width, height) = self.raster.size();
        if is_of_nodes(grid) && u64::from(width) * u64::from(height) <= FULL_RASTER_PIXELS {
            return 0;
        }
        let samples = match grid {
            SampleGrid::Lattice(_) => f64::from(CELLS + 3).powi(2),
            SampleGrid::Box { .. } => grid.len() as f64,
        };
        choose_image(&self.raster, step, samples * step.0 * step.1, FULL_WINDOW_PIXELS, 1.0)
    }

    /// Heights of a grid of so many columns and rows, bilinear in an image.
    fn interpolate(
        &self,
        projector: &Projector<'_>,
        size: (u32, u32),
        image: usize,
        out: &mut [f32],
    ) -> Result<(), SourceError> {
        let view = View::of(&self.raster, &self.placement, image);
        let source = &self.raster.images[image];
        view.visit(projector, size, &mut |block| {
            let window = if block.is_outside() {
                Vec::new()
            } else {
                view.fetch(block, |rect| {
                    source.read_values(0, rect, &self.rule).map_err(|problem| self.raster.read_error(problem))
                })?
            };
            for row in 0..block.size.1 {
                let start = (block.origin.1 + row) as usize * size.0 as usize + block.origin.0 as usize;
                let line = &mut out[start..start + block.size.0 as usize];
                if block.is_outside() {
                    line.fill(f32::NAN);
                } else {
                    sample_row(block, row, &window, line);
                }
            }
            Ok(())
        })
    }

    /// Pixels that a part of a box may touch: (left, top, right, bottom), whole numbers at centres.
    /// `None` where the projection does not reach all of it.
    fn pixel_box(&self, part: &GeographicBox) -> Option<(f64, f64, f64, f64)> {
        let mut found = (f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY);
        for j in 0..=4 {
            for i in 0..=4 {
                let longitude = part.west + f64::from(i) / 4.0 * (part.east - part.west);
                let latitude =
                    (part.north + f64::from(j) / 4.0 * (part.south - part.north)).clamp(-90.0, 90.0);
                let (u, v) = self.placement.exact_pixel(longitude, latitude).ok()?;
                found = (found.0.min(u), found.1.min(v), found.2.max(u), found.3.max(v));
            }
        }
        // What bulges between the points, and the pixels that bilinear interpolation reaches.
        let spare = (0.05 * (found.2 - found.0) + 1.0, 0.05 * (found.3 - found.1) + 1.0);
        Some((found.0 - spare.0, found.1 - spare.1, found.2 + spare.0, found.3 + spare.1))
    }
}

fn is_of_nodes(grid: &SampleGrid) -> bool {
    matches!(grid, SampleGrid::Lattice(window) if window.registration == Registration::Node)
}

/// The extent that a field tells.
pub fn field_extent(placement: &Placement) -> FieldExtent {
    let crs = placement.crs();
    FieldExtent {
        bounds: placement.bounds(),
        resolution_metres: placement.resolution_metres(),
        projected_epsg: crs.epsg().filter(|&code| {
            let geographic = crs.is_plain_geographic() && code != 4326;
            geographic || !crs.is_geographic() && !crs.is_web_mercator()
        }),
    }
}

impl HeightField for RasterHeight {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    /// Fills `out` with heights, bilinear in the full image, as long as that is not too large: then a
    /// parent's node is its child's. It holds on every level of a raster of up to 256 megapixels, and of
    /// every raster without overviews; of larger ones with overviews down from the level on which a tile's
    /// window has 64 megapixels (coarser levels, and boxes, are bilinear in an overview, and are what that is).
    fn sample(&self, grid: &SampleGrid, out: &mut [f32]) -> Result<(), SourceError> {
        let projector = Projector::new(&self.placement, grid);
        let image = self.image(&projector, grid);
        if let SampleGrid::Lattice(window) = grid
            && let Some(finest) = self.finest_kept_level()
            && is_of_nodes(grid)
            && image == 0
            && window.level <= finest
        {
            let lattice = self.coarse.get_or_init(|| CoarseLattice::new(Registration::Node, finest));
            let make = |window: &LatticeWindow, out: &mut [f32]| {
                let grid = SampleGrid::Lattice(*window);
                self.interpolate(&Projector::new(&self.placement, &grid), grid.size(), 0, out)
            };
            return lattice.fill(&self.placement, &self.raster.path, window, &make, out);
        }
        self.interpolate(&projector, grid.size(), image, out)
    }

    fn maxima(&self, bounds: &GeographicBox, columns: u32, rows: u32) -> Result<Vec<f32>, SourceError> {
        let mut found = vec![f32::NAN; columns as usize * rows as usize];
        let (width, height) = self.placement.size();
        let all = (-0.5, -0.5, f64::from(width) - 0.5, f64::from(height) - 0.5);
        let clip = |b: (f64, f64, f64, f64)| (b.0.max(all.0), b.1.max(all.1), b.2.min(all.2), b.3.min(all.3));
        let exact = self.exact_window(bounds, clip)?;
        for row in 0..rows {
            for column in 0..columns {
                let longitude =
                    |i: u32| bounds.west + (bounds.east - bounds.west) * f64::from(i) / f64::from(columns);
                let latitude =
                    |j: u32| bounds.north - (bounds.north - bounds.south) * f64::from(j) / f64::from(rows);
                let part = GeographicBox {
                    west: longitude(column),
                    south: latitude(row + 1),
                    east: longitude(column + 1),
                    north: latitude(row),
                };
                if !self.placement.may_touch(part.west, part.south, part.east, part.north) {
                    continue;
                }
                let pixels = self.pixel_box(&part).map_or(all, clip);
                if pixels.0 > pixels.2 || pixels.1 > pixels.3 {
                    continue;
                }
                found[(row * columns + column) as usize] = match &exact {
                    Some((rect, values)) => greatest(values, *rect, pixels),
                    None => self.summary().within(pixels.0, pixels.1, pixels.2, pixels.3).1,
                };
            }
        }
        Ok(found)
    }

    fn range(&self) -> (f32, f32) {
        let (least, greatest) = self.summary().whole();
        if least.is_nan() { (0.0, 0.0) } else { (least, greatest) }
    }
}

impl RasterHeight {
    /// The values under a small box, padded by a few pixels.
    fn exact_window(
        &self,
        bounds: &GeographicBox,
        clip: impl Fn((f64, f64, f64, f64)) -> (f64, f64, f64, f64),
    ) -> Result<Option<(Rect, Vec<f32>)>, SourceError> {
        if self.placement.wraps() {
            // A box over the seam would name all pixels between its two ends.
            return Ok(None);
        }
        let Some(pixels) = self.pixel_box(bounds).map(clip) else { return Ok(None) };
        if pixels.0 > pixels.2 || pixels.1 > pixels.3 {
            return Ok(None);
        }
        let (width, height) = self.placement.size();
        let first = |value: f64| (value.floor() - 2.0).max(0.0) as u32;
        let last = |value: f64, size: u32| ((value.ceil() + 2.0) as u32).min(size - 1);
        let (x, y) = (first(pixels.0), first(pixels.1));
        let rect =
            Rect { x, y, width: last(pixels.2, width) - x + 1, height: last(pixels.3, height) - y + 1 };
        if u64::from(rect.width) * u64::from(rect.height) > EXACT_MAXIMA_PIXELS {
            return Ok(None);
        }
        let values = self.raster.full().read_values(0, rect, &self.rule);
        values.map(|values| Some((rect, values))).map_err(|problem| self.raster.read_error(problem))
    }
}

/// Greatest value of the pixels that a box touches or reaches by interpolation.
fn greatest(values: &[f32], rect: Rect, pixels: (f64, f64, f64, f64)) -> f32 {
    let low = |value: f64, first: u32| (value.floor() - f64::from(first)).max(0.0) as usize;
    let high = |value: f64, first: u32, size: u32| {
        ((value.ceil() - f64::from(first)) as usize).min(size as usize - 1)
    };
    let mut found = f32::NAN;
    for row in low(pixels.1, rect.y)..=high(pixels.3, rect.y, rect.height) {
        let start = row * rect.width as usize;
        let columns = low(pixels.0, rect.x)..=high(pixels.2, rect.x, rect.width);
        for value in &values[start + columns.start()..=start + columns.end()] {
            found = found.max(*value);
        }
    }
    found
}

fn sample_row(block: &Block<'_>, row: u32, window: &[f32], line: &mut [f32]) {
    let width = block.window_size.0 as usize;
    let (left, top) = (block.window_origin.0 as f64, block.window_origin.1 as f64);
    for (target, &(u, v)) in line.iter_mut().zip(block.row(row)) {
        if u.is_nan() {
            *target = f32::NAN;
            continue;
        }
        let (column, line) = (u.floor(), v.floor());
        let at = (line - top) as usize * width + (column - left) as usize;
        let (fx, fy) = ((u - column) as f32, (v - line) as f32);
        let corners = [window[at], window[at + 1], window[at + width], window[at + width + 1]];
        *target = bilinear(corners, fx, fy);
    }
}

fn bilinear([a, b, c, d]: [f32; 4], fx: f32, fy: f32) -> f32 {
    let upper = a + fx * (b - a);
    let lower = c + fx * (d - c);
    let value = upper + fy * (lower - upper);
    if value.is_nan() { beside_a_void([a, b, c, d], fx, fy) } else { value }
}

/// The value where a neighbour is void: NaN, unless the void has no weight.
#[cold]
fn beside_a_void([a, b, c, d]: [f32; 4], fx: f32, fy: f32) -> f32 {
    let snap = |fraction: f32| {
        if fraction < NEGLIGIBLE_WEIGHT {
            0.0
        } else if fraction > 1.0 - NEGLIGIBLE_WEIGHT {
            1.0
        } else {
            fraction
        }
    };
    let mix = |a: f32, b: f32, fraction: f32| {
        if fraction == 0.0 {
            a
        } else if fraction == 1.0 {
            b
        } else {
            a + fraction * (b - a)
        }
    };
    let (fx, fy) = (snap(fx), snap(fy));
    mix(mix(a, b, fx), mix(c, d, fx), fy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_void_never_blends() {
        let void = f32::NAN;
        assert_eq!(bilinear([1.0, 3.0, 5.0, 7.0], 0.5, 0.5), 4.0);
        assert!(bilinear([1.0, void, 5.0, 7.0], 0.5, 0.0).is_nan());
        assert_eq!(bilinear([1.0, void, void, void], 0.0, 0.0), 1.0);
        assert_eq!(bilinear([1.0, 3.0, void, void], 0.5, 0.0), 2.0);
        assert_eq!(bilinear([void, 3.0, void, 7.0], 0.999_999_9, 0.5), 5.0);
        assert!(bilinear([void, 3.0, void, 7.0], 0.99, 0.5).is_nan());
    }
}
