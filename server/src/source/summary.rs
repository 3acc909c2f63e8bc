//! Least and greatest values of a raster by blocks: bounds for whatever lies in a box, without
//! reading the box.

use super::geotiff::Raster;
use super::geotiff::image::{Rect, ValueRule};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

/// Pixels along a block's side.
pub const BLOCK: u32 = 32;
/// Rasters larger than this are summarised from an overview, where there is one.
const FULL_PIXELS: u64 = 256 << 20;
/// Pixels that one thread reads at once.
const BAND_PIXELS: u64 = 4 << 20;

/// Bounds by blocks, and by ever larger blocks up to the whole raster.
#[derive(Debug)]
pub struct Summary {
    levels: Vec<Level>,
    /// Full-image pixels along a side of the finest block.
    side: (f64, f64),
}

#[derive(Debug)]
struct Level {
    columns: u32,
    rows: u32,
    /// Least and greatest; NaN where there is no data.
    bounds: Vec<(f32, f32)>,
}

fn merge(a: (f32, f32), b: (f32, f32)) -> (f32, f32) {
    // Minimum and maximum pass over NaN.
    (a.0.min(b.0), a.1.max(b.1))
}

const NONE: (f32, f32) = (f32::NAN, f32::NAN);

impl Summary {
    /// Reads the raster once, on a few threads. A part of the file that cannot be read counts as
    /// empty: nothing is ever drawn from it.
    ///
    /// Up to 256 megapixels, and wherever there are no overviews, the bounds are those of the pixels.
    /// Beyond that they are those of the largest overview of at most 256 megapixels (or the smallest
    /// that there is), widened by the
    /// greatest difference between neighbours in a block: what an overview smooths away is taken to
    /// be no steeper than what it shows.
    pub fn build(raster: &Raster, band: u16, rule: &ValueRule) -> Self {
        let pixels = |index: usize| {
            let layout = &raster.images[index].layout;
            u64::from(layout.width) * u64::from(layout.height)
        };
        let index = (0..raster.images.len())
            .find(|&index| pixels(index) <= FULL_PIXELS)
            .unwrap_or(raster.images.len() - 1);
        let image = &raster.images[index];
        let (width, height) = (image.layout.width, image.layout.height);
        let (columns, rows) = (width.div_ceil(BLOCK), height.div_ceil(BLOCK));
        let bounds = Mutex::new(vec![NONE; columns as usize * rows as usize]);
        // Bands of whole chunk rows, so that every chunk is decoded once.
        let chunk_rows = image.layout.chunk_height.next_multiple_of(BLOCK);
        let fitting = (BAND_PIXELS / u64::from(width)) as u32 / chunk_rows * chunk_rows;
        let band_rows = fitting.max(if chunk_rows > 4096 { 4096 } else { chunk_rows });
        let next = AtomicU32::new(0);
        let work = || {
            loop {
                let top = next.fetch_add(1, Ordering::Relaxed).saturating_mul(band_rows);
                if top >= height {
                    return;
                }
                let across = ((BAND_PIXELS / u64::from(band_rows)) as u32).max(BLOCK);
                let across =
                    across.next_multiple_of(image.layout.chunk_width.min(4096).next_multiple_of(BLOCK));
                let mut left = 0;
                while left < width {
                    let rect = Rect {
                        x: left,
                        y: top,
                        width: across.min(width - left),
                        height: band_rows.min(height - top),
                    };
                    if let Ok(values) = image.read_values(band, rect, rule) {
                        let found = block_bounds(&values, rect, index > 0);
                        let mut all = bounds.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                        for (slot, value) in found {
                            let slot = slot.1 as usize * columns as usize + slot.0 as usize;
                            all[slot] = merge(all[slot], value);
                        }
                    }
                    left += across;
                }
            }
        };
        // Threads of our own: a pool's worker that waited for others here might be handed a task that
        // waits for this very summary.
        let threads = std::thread::available_parallelism().map_or(1, |count| count.get().min(4));
        std::thread::scope(|scope| {
            for _ in 1..threads {
                scope.spawn(work);
            }
            work();
        });
        let bounds = bounds.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        let mut levels = vec![Level { columns, rows, bounds }];
        while let Some(last) = levels.last().filter(|last| last.columns > 1 || last.rows > 1) {
            levels.push(last.halved());
        }
        let full = raster.size();
        let scale = |full: u32, own: u32| f64::from(full) / f64::from(own) * f64::from(BLOCK);
        Self { levels, side: (scale(full.0, width), scale(full.1, height)) }
    }

    /// Bounds of all values; NaN where there are none.
    pub fn whole(&self) -> (f32, f32) {
        self.levels.last().map_or(NONE, |level| level.bounds[0])
    }

    /// Bounds of the values in the full image's pixels left … right and top … bottom (coordinates with
    /// whole numbers at pixel centres); generous by up to a block.
    pub fn within(&self, left: f64, top: f64, right: f64, bottom: f64) -> (f32, f32) {
        let mut side = self.side;
        let mut level = 0;
        // At most eight blocks either way: enough to be tight, few enough to be fast.
        while level + 1 < self.levels.len()
            && ((right - left) / side.0 > 8.0 || (bottom - top) / side.1 > 8.0)
        {
            level += 1;
            side = (2.0 * side.0, 2.0 * side.1);
        }
        let level = &self.levels[level];
        let index = |pixel: f64, side: f64, count: u32| {
            ((pixel + 0.5) / side).floor().clamp(0.0, f64::from(count - 1)) as u32
        };
        let mut found = NONE;
        for row in index(top, side.1, level.rows)..=index(bottom, side.1, level.rows) {
            for column in index(left, side.0, level.columns)..=index(right, side.0, level.columns) {
                found = merge(found, level.bounds[(row * level.columns + column) as usize]);
            }
        }
        found
    }
}

impl Level {
    fn halved(&self) -> Self {
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let mut bounds = vec![NONE; columns as usize * rows as usize];
        for row in 0..self.rows {
            for column in 0..self.columns {
                let slot = ((row / 2) * columns + column / 2) as usize;
                bounds[slot] = merge(bounds[slot], self.bounds[(row * self.columns + column) as usize]);
            }
        }
        Self { columns, rows, bounds }
    }
}

/// Bounds by block of a window: ((block column, block row), bounds).
fn block_bounds(values: &[f32], rect: Rect, widen: bool) -> Vec<((u32, u32), (f32, f32))> {
    let width = rect.width as usize;
    let mut found = Vec::new();
    for block_row in rect.y / BLOCK..=(rect.y + rect.height - 1) / BLOCK {
        for block_column in rect.x / BLOCK..=(rect.x + rect.width - 1) / BLOCK {
            let columns =
                (block_column * BLOCK).max(rect.x)..((block_column + 1) * BLOCK).min(rect.x + rect.width);
            let rows = (block_row * BLOCK).max(rect.y)..((block_row + 1) * BLOCK).min(rect.y + rect.height);
            let mut bounds = NONE;
            let mut difference = 0.0_f32;
            for row in rows {
                let start = (row - rect.y) as usize * width;
                let line = &values
                    [start + (columns.start - rect.x) as usize..start + (columns.end - rect.x) as usize];
                for (index, &value) in line.iter().enumerate() {
                    bounds = merge(bounds, (value, value));
                    if widen {
                        let at = start + (columns.start - rect.x) as usize + index;
                        let right = if index + 1 < line.len() { values[at + 1] } else { f32::NAN };
                        let below =
                            if row + 1 < rect.y + rect.height { values[at + width] } else { f32::NAN };
                        difference = difference.max((right - value).abs()).max((below - value).abs());
                    }
                }
            }
            found.push(((block_column, block_row), (bounds.0 - difference, bounds.1 + difference)));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_of_a_window_that_starts_within_one() {
        let rect = Rect { x: 30, y: 0, width: 4, height: 2 };
        let found = block_bounds(&[1.0, 2.0, 3.0, f32::NAN, 5.0, 6.0, 7.0, 8.0], rect, false);
        assert_eq!(found, [((0, 0), (1.0, 6.0)), ((1, 0), (3.0, 8.0))]);
        let widened = block_bounds(&[1.0, 2.0, 3.0, f32::NAN, 5.0, 6.0, 7.0, 8.0], rect, true);
        assert_eq!(widened[0].1, (-3.0, 10.0));
    }

    #[test]
    fn halving_keeps_bounds() {
        let level = Level { columns: 3, rows: 1, bounds: vec![(1.0, 2.0), NONE, (-4.0, 0.0)] };
        let half = level.halved();
        assert_eq!((half.columns, half.rows), (2, 1));
        assert_eq!(half.bounds, [(1.0, 2.0), (-4.0, 0.0)]);
        assert_eq!(half.halved().bounds, [(-4.0, 2.0)]);
    }
}
