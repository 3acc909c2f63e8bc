//! From a grid to the windows of a raster that it needs: bounded in memory, block by block.

use super::SourceError;
use super::geotiff::Raster;
use super::geotiff::image::Rect;
use super::placement::Placement;
use super::projector::Projector;

/// Pixels of a raster that are held at once as a window.
const WINDOW_PIXELS: i64 = 4 << 20;
/// Samples along a block's side.
const BLOCK: u32 = 256;

/// Some samples of a grid, and the window of the raster that they need.
pub struct Block<'a> {
    /// First column and row of the block in the grid.
    pub origin: (u32, u32),
    /// Columns and rows.
    pub size: (u32, u32),
    pixels: &'a [(f64, f64)],
    stride: usize,
    offset: usize,
    /// First column and row of the window; −1 and `width` are columns beyond the raster's edge.
    pub window_origin: (i64, i64),
    /// Columns and rows of the window; zero where no sample lies in the raster.
    pub window_size: (u32, u32),
}

impl Block<'_> {
    /// Pixel coordinates of a row of the block.
    pub fn row(&self, row: u32) -> &[(f64, f64)] {
        let start = self.offset + row as usize * self.stride;
        &self.pixels[start..start + self.size.0 as usize]
    }

    /// Whether no sample lies in the raster.
    pub fn is_outside(&self) -> bool {
        self.window_size.0 == 0
    }
}

/// One image of a raster, seen by pixel coordinates of its own.
pub struct View<'a> {
    /// Place of the full image.
    placement: &'a Placement,
    /// Columns and rows of the image.
    size: (u32, u32),
    /// Columns and rows that are read together.
    chunk_size: (u32, u32),
}

impl<'a> View<'a> {
    /// Image `index` of a raster: 0, or that of an overview.
    pub fn of(raster: &Raster, placement: &'a Placement, index: usize) -> Self {
        let layout = &raster.images[index].layout;
        let (size, chunk_size) = ((layout.width, layout.height), (layout.chunk_width, layout.chunk_height));
        Self { placement, size, chunk_size }
    }

    /// Pixels that are all at hand.
    pub fn of_placement(placement: &'a Placement) -> Self {
        Self { placement, size: placement.size(), chunk_size: (1, 1) }
    }

    /// Pixels of this image in one of the full image, along rows and columns.
    fn scale(&self) -> (f64, f64) {
        let full = self.placement.size();
        (f64::from(self.size.0) / f64::from(full.0), f64::from(self.size.1) / f64::from(full.1))
    }

    /// Calls `visit` with every block of the grid.
    ///
    /// # Errors
    /// What `visit` says.
    pub fn visit(
        &self,
        projector: &Projector<'_>,
        grid_size: (u32, u32),
        visit: &mut dyn FnMut(&Block<'_>) -> Result<(), SourceError>,
    ) -> Result<(), SourceError> {
        bands(grid_size.1).iter().try_for_each(|&band| self.visit_band(projector, grid_size.0, band, visit))
    }

    /// Calls `visit` with every block of a band of rows, from its first row and of its height; [`bands`] says which.
    ///
    /// # Errors
    /// What `visit` says.
    pub fn visit_band(
        &self,
        projector: &Projector<'_>,
        grid_width: u32,
        (y, height): (u32, u32),
        visit: &mut dyn FnMut(&Block<'_>) -> Result<(), SourceError>,
    ) -> Result<(), SourceError> {
        for &(x, width) in &even_parts(grid_width) {
            let mut pixels = projector.project(x, y, width, height);
            self.to_own_pixels(&mut pixels);
            let block = Block {
                origin: (x, y),
                size: (width, height),
                pixels: &pixels,
                stride: width as usize,
                offset: 0,
                window_origin: (0, 0),
                window_size: (0, 0),
            };
            self.visit_block(block, visit)?;
        }
        Ok(())
    }

    /// Full-image pixel coordinates to this image's; those outside the raster become NaN.
    fn to_own_pixels(&self, pixels: &mut [(f64, f64)]) {
        let (sx, sy) = self.scale();
        let whole = self.size == self.placement.size();
        for pixel in pixels {
            if !self.placement.contains_pixel(pixel.0, pixel.1) {
                *pixel = (f64::NAN, f64::NAN);
            } else if !whole {
                *pixel = ((pixel.0 + 0.5) * sx - 0.5, (pixel.1 + 0.5) * sy - 0.5);
            }
        }
    }

    fn visit_block(
        &self,
        mut block: Block<'_>,
        visit: &mut dyn FnMut(&Block<'_>) -> Result<(), SourceError>,
    ) -> Result<(), SourceError> {
        let mut least = (f64::INFINITY, f64::INFINITY);
        let mut most = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        for row in 0..block.size.1 {
            for &(u, v) in block.row(row) {
                // Minimum and maximum pass over NaN.
                least = (least.0.min(u), least.1.min(v));
                most = (most.0.max(u), most.1.max(v));
            }
        }
        if least.0 > most.0 {
            return visit(&block);
        }
        block.window_origin = (least.0.floor() as i64, least.1.floor() as i64);
        // One more on the far side: bilinear reads it, with weight or without.
        let wide = most.0.floor() as i64 + 2 - block.window_origin.0;
        let high = most.1.floor() as i64 + 2 - block.window_origin.1;
        if wide * high <= WINDOW_PIXELS || block.size == (1, 1) {
            block.window_size = (wide as u32, high as u32);
            return visit(&block);
        }
        // Halve across whatever reaches over more chunks, so that few chunks are needed twice.
        let chunks_wide = wide as f64 / f64::from(self.chunk_size.0);
        let chunks_high = high as f64 / f64::from(self.chunk_size.1);
        let split_columns = block.size.1 == 1 || block.size.0 > 1 && chunks_wide > chunks_high;
        let part = |x: u32, y: u32, width: u32, height: u32| Block {
            origin: (block.origin.0 + x, block.origin.1 + y),
            size: (width, height),
            pixels: block.pixels,
            stride: block.stride,
            offset: block.offset + y as usize * block.stride + x as usize,
            window_origin: (0, 0),
            window_size: (0, 0),
        };
        let (width, height) = block.size;
        let parts = if split_columns {
            let half = width / 2;
            [part(0, 0, half, height), part(half, 0, width - half, height)]
        } else {
            let half = height / 2;
            [part(0, 0, width, half), part(0, half, width, height - half)]
        };
        for part in parts {
            self.visit_block(part, visit)?;
        }
        Ok(())
    }

    /// Fills a window that may reach a pixel beyond the raster's edge: there the edge is repeated, or
    /// the far side joins on where the raster goes round the Earth.
    ///
    /// # Errors
    /// What `read` says.
    pub fn fetch<T: Copy>(
        &self,
        block: &Block<'_>,
        read: impl Fn(Rect) -> Result<Vec<T>, SourceError>,
    ) -> Result<Vec<T>, SourceError> {
        let (width, height) = self.size;
        let (wide, high) = (block.window_size.0 as usize, block.window_size.1 as usize);
        let clamp = |value: i64, size: u32| value.clamp(0, i64::from(size) - 1);
        let (left, top) = block.window_origin;
        let (right, bottom) = (left + wide as i64 - 1, top + high as i64 - 1);
        let inner = Rect {
            x: clamp(left, width) as u32,
            y: clamp(top, height) as u32,
            width: (clamp(right, width) - clamp(left, width) + 1) as u32,
            height: (clamp(bottom, height) - clamp(top, height) + 1) as u32,
        };
        let core = read(inner)?;
        if (inner.width as usize, inner.height as usize) == (wide, high) {
            return Ok(core);
        }
        let wraps = self.placement.wraps();
        // Columns beyond the edge of a raster that joins are its other edge's.
        let far_column =
            |column: u32| -> Result<Vec<T>, SourceError> { read(Rect { x: column, width: 1, ..inner }) };
        let west = if wraps && left < 0 { Some(far_column(width - 1)?) } else { None };
        let east = if wraps && right >= i64::from(width) { Some(far_column(0)?) } else { None };
        let mut out = Vec::with_capacity(wide * high);
        for y in 0..high as i64 {
            let row = (clamp(top + y, height) - i64::from(inner.y)) as usize;
            for x in 0..wide as i64 {
                let column = left + x;
                out.push(match (&west, &east) {
                    (Some(west), _) if column < 0 => west[row],
                    (_, Some(east)) if column >= i64::from(width) => east[row],
                    _ => {
                        let inner_column = (clamp(column, width) - i64::from(inner.x)) as usize;
                        core[row * inner.width as usize + inner_column]
                    }
                });
            }
        }
        Ok(out)
    }
}

/// The bands of rows, first row and height, in which a grid is visited, from the top.
pub fn bands(rows: u32) -> Vec<(u32, u32)> {
    even_parts(rows)
}

/// `count` samples in parts of at most [`BLOCK`], as equal as can be: (first, length).
fn even_parts(count: u32) -> Vec<(u32, u32)> {
    let parts = count.div_ceil(BLOCK).max(1);
    let bound = |part: u32| (u64::from(count) * u64::from(part) / u64::from(parts)) as u32;
    (0..parts).map(|part| (bound(part), bound(part + 1) - bound(part))).filter(|part| part.1 > 0).collect()
}

/// The image to read for a grid whose samples lie `step` full-image pixels apart (along rows, along
/// columns) and whose window holds about `window_pixels` of them: the full one as long as
/// `window_pixels` is at most `bound`, else the smallest overview with at least `per_sample` pixels
/// a sample; the full one where there is none.
pub fn choose_image(
    raster: &Raster,
    step: (f64, f64),
    window_pixels: f64,
    bound: f64,
    per_sample: f64,
) -> usize {
    let full = raster.size();
    let all = f64::from(full.0) * f64::from(full.1);
    if window_pixels.min(all) <= bound {
        return 0;
    }
    let reduction = step.0.min(step.1) / per_sample;
    (1..raster.images.len())
        .rev()
        .find(|&index| f64::from(full.0) / f64::from(raster.images[index].layout.width) <= reduction)
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_the_count_once() {
        for count in [1, 2, 255, 256, 257, 515, 520, 2048, 4097] {
            let parts = even_parts(count);
            assert_eq!(parts.iter().map(|part| part.1).sum::<u32>(), count);
            assert!(parts.iter().all(|part| part.1 <= BLOCK));
            assert!(parts.windows(2).all(|pair| pair[0].0 + pair[0].1 == pair[1].0));
        }
    }
}
