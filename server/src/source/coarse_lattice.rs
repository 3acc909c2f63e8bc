//! The coarse levels of a raster, without reading it again for each of them.
//!
//! Samples of the matrix in blocks: those of the finest kept level are made from the raster, every
//! other block from the four below it. Each is made once, by one thread, and kept as long as there
//! is room, so that a raster without overviews is read once for all its coarse levels. Rows of
//! blocks are made from north to south, so that each strip or tile of the file is decoded once.

use super::SourceError;
use super::geotiff::cache::{MakerCache, Weigh};
use super::placement::Placement;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::tile::{self, GeographicBox};

/// Samples along a block's side.
pub const SIDE: i64 = 32;
/// Bytes of blocks that are kept of each level. What a raster has on a coarser level weighs a quarter,
/// so that all levels together weigh little more than those that do not fit.
const LEVEL_BYTES: usize = 32 << 20;
/// Threads that make blocks for one request.
const THREADS: usize = 4;
/// When making blocks is expected to take longer than this, a line in the log says so.
const LONG: Duration = Duration::from_secs(10);

/// What stands at a sample.
pub trait Sample: Copy + Send + Sync {
    /// Where there are no data.
    const NOTHING: Self;

    /// Whether there are no data.
    fn is_nothing(self) -> bool;

    /// The sample of the next coarser level from the four of this one: north-west, north-east,
    /// south-west, south-east. For nodes the north-western is at the same place.
    fn of_four(four: [Self; 4]) -> Self;
}

/// Row-major samples; none where there are no data at all.
struct Block<T>(Vec<T>);

impl<T> Weigh for Block<T> {
    fn bytes(&self) -> usize {
        // With the cache's own bookkeeping.
        self.0.len() * size_of::<T>() + 256
    }
}

/// Column and row of a block on its level.
type Key = (i64, i64);
type Level<T> = MakerCache<Key, Block<T>, SourceError>;

/// Makes the samples of a window of the finest kept level.
pub type Make<'a, T> = &'a (dyn Fn(&LatticeWindow, &mut [T]) -> Result<(), SourceError> + Sync);

/// Blocks of one image of a raster.
pub struct CoarseLattice<T> {
    registration: Registration,
    finest: u8,
    /// From the finest to level 0.
    levels: Vec<Level<T>>,
    /// Blocks of the finest level made so far, and the nanoseconds that took.
    made: AtomicI64,
    spent: AtomicU64,
    warned: AtomicBool,
}

impl<T: Sample> CoarseLattice<T> {
    /// Levels 0 to `finest`, nothing made yet.
    pub fn new(registration: Registration, finest: u8) -> Self {
        let levels = (0..=finest).map(|_| Level::new(LEVEL_BYTES)).collect();
        let (made, spent, warned) = (AtomicI64::new(0), AtomicU64::new(0), AtomicBool::new(false));
        Self { registration, finest, levels, made, spent, warned }
    }

    /// The finest level that is kept.
    pub fn finest(&self) -> u8 {
        self.finest
    }

    /// Fills `out` with the samples of a window of level [`Self::finest`] or coarser.
    ///
    /// # Errors
    /// What `make` says.
    pub fn fill(
        &self,
        placement: &Placement,
        path: &str,
        window: &LatticeWindow,
        make: Make<'_, T>,
        out: &mut [T],
    ) -> Result<(), SourceError> {
        out.fill(T::NOTHING);
        let job = Job { lattice: self, placement, path, make };
        let level = window.level;
        let (turn, height) = turn_and_height(level);
        let turn_blocks = turn / SIDE;
        let last_row = height - 1 + i64::from(self.registration == Registration::Node);
        // Rows beyond a pole are those of the far side of the Earth.
        let folded = |row: i64| match self.registration {
            Registration::Cell if row < 0 => (-1 - row, turn / 2),
            Registration::Cell if row > last_row => (2 * height - 1 - row, turn / 2),
            Registration::Node if row < 0 => (-row, turn / 2),
            Registration::Node if row > last_row => (2 * height - row, turn / 2),
            _ => (row, 0),
        };
        let (west, east) = (window.first_column, window.first_column + i64::from(window.width) - 1);
        let rows: Vec<(i64, i64)> =
            (0..i64::from(window.height)).map(|row| folded(window.first_row + row)).collect();
        let mut made = Vec::new();
        for &(row, shift) in &rows {
            let place = (row.div_euclid(SIDE), shift);
            if made.last() != Some(&place) && !made.contains(&place) {
                made.push(place);
                let columns = (west + shift).div_euclid(SIDE)..(east + shift).div_euclid(SIDE) + 1;
                job.make_row(level, place.0, columns)?;
            }
        }
        let mut held: Vec<(Key, Arc<Block<T>>)> = Vec::new();
        for (line, &(row, shift)) in out.chunks_exact_mut(window.width as usize).zip(&rows) {
            let mut column = west;
            while column <= east {
                let block_column = (column + shift).div_euclid(SIDE);
                let within = (column + shift).rem_euclid(SIDE);
                let count = (SIDE - within).min(east - column + 1);
                let key = (block_column.rem_euclid(turn_blocks), row.div_euclid(SIDE));
                let block = match held.iter().find(|(other, _)| *other == key) {
                    Some((_, block)) => Arc::clone(block),
                    None => {
                        // A row of blocks at a time is enough: the next one begins anew.
                        held.retain(|((_, other), _)| *other == key.1);
                        let block = job.block(level, key.0, key.1)?;
                        held.push((key, Arc::clone(&block)));
                        block
                    }
                };
                if !block.0.is_empty() {
                    let first = (row.rem_euclid(SIDE) * SIDE + within) as usize;
                    let target = (column - west) as usize;
                    line[target..target + count as usize]
                        .copy_from_slice(&block.0[first..first + count as usize]);
                }
                column += count;
            }
        }
        Ok(())
    }
}

/// Threads to make blocks with. Asking the system reads files, and there are many rows.
fn threads() -> usize {
    static COUNT: OnceLock<usize> = OnceLock::new();
    *COUNT.get_or_init(|| std::thread::available_parallelism().map_or(1, |count| count.get().min(THREADS)))
}

/// Samples of a level in a raster's box.
pub fn samples_in(bounds: &GeographicBox, level: u8) -> f64 {
    let step = tile::span_degrees(level) / f64::from(tile::CELLS);
    (bounds.east - bounds.west) / step * ((bounds.north - bounds.south) / step)
}

/// Columns round the Earth and rows from pole to pole, in cells.
fn turn_and_height(level: u8) -> (i64, i64) {
    let cells = i64::from(tile::CELLS);
    (cells * i64::from(tile::columns(level)), cells * i64::from(tile::rows(level)))
}

/// What a request brings along.
struct Job<'a, T> {
    lattice: &'a CoarseLattice<T>,
    placement: &'a Placement,
    path: &'a str,
    make: Make<'a, T>,
}

impl<T: Sample> Job<'_, T> {
    fn window(&self, level: u8, column: i64, row: i64) -> LatticeWindow {
        LatticeWindow {
            level,
            registration: self.lattice.registration,
            first_column: column * SIDE,
            first_row: row * SIDE,
            width: SIDE as u32,
            height: SIDE as u32,
        }
    }

    fn cache(&self, level: u8) -> &Level<T> {
        &self.lattice.levels[usize::from(self.lattice.finest - level)]
    }

    fn may_touch(&self, level: u8, column: i64, row: i64) -> bool {
        let GeographicBox { west, south, east, north } = self.window(level, column, row).pixel_box();
        self.placement.may_touch(west, south.clamp(-90.0, 90.0), east, north.clamp(-90.0, 90.0))
    }

    /// Whether a small window surely lies beside the raster. The raster's box in degrees may be far larger
    /// than the raster: a strip across it, or a projection that does not reach all of it.
    fn lies_outside(&self, window: &LatticeWindow) -> bool {
        const POINTS: u32 = 5;
        let bounds = window.pixel_box();
        let (mut least, mut most) = ((f64::INFINITY, f64::INFINITY), (f64::NEG_INFINITY, f64::NEG_INFINITY));
        for index in 0..POINTS * POINTS {
            let share = |index: u32| f64::from(index) / f64::from(POINTS - 1);
            let longitude = bounds.west + share(index % POINTS) * (bounds.east - bounds.west);
            let latitude = bounds.north + share(index / POINTS) * (bounds.south - bounds.north);
            let Ok((u, v)) = self.placement.exact_pixel(longitude, latitude) else { return false };
            least = (least.0.min(u), least.1.min(v));
            most = (most.0.max(u), most.1.max(v));
        }
        // What bulges between the points.
        let spare = (0.05 * (most.0 - least.0) + 2.0, 0.05 * (most.1 - least.1) + 2.0);
        let (width, height) = self.placement.size();
        most.0 < -spare.0
            || most.1 < -spare.1
            || least.0 > f64::from(width) + spare.0
            || least.1 > f64::from(height) + spare.1
    }

    /// Columns of a row's blocks that may hold data and are not held yet, wrapped.
    fn missing(&self, level: u8, row: i64, columns: Range<i64>) -> Vec<i64> {
        let turn_blocks = turn_and_height(level).0 / SIDE;
        let mut missing: Vec<i64> = columns
            .map(|column| column.rem_euclid(turn_blocks))
            .filter(|&column| self.may_touch(level, column, row) && !self.cache(level).holds(&(column, row)))
            .collect();
        missing.sort_unstable();
        missing.dedup();
        missing
    }

    /// Makes a row of blocks: those below it first, row by row, so that what they share of the file is
    /// still at hand. The finest are made by several threads.
    fn make_row(&self, level: u8, row: i64, columns: Range<i64>) -> Result<(), SourceError> {
        let missing = self.missing(level, row, columns);
        if level < self.lattice.finest {
            for below in [2 * row, 2 * row + 1] {
                for run in missing.chunk_by(|a, b| a + 1 == *b) {
                    self.make_row(level + 1, below, 2 * run[0]..2 * (run[0] + run.len() as i64))?;
                }
            }
            return missing.iter().try_for_each(|&column| self.block(level, column, row).map(drop));
        }
        if missing.is_empty() {
            return Ok(());
        }
        let start = Instant::now();
        let next = AtomicI64::new(0);
        let failed = Mutex::new(None);
        let work = || {
            while let Some(&column) = missing.get(next.fetch_add(1, Ordering::Relaxed) as usize) {
                if let Err(error) = self.block(level, column, row) {
                    next.store(missing.len() as i64, Ordering::Relaxed);
                    *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                }
            }
        };
        let threads = threads();
        // Threads of our own: see `Summary::build`.
        std::thread::scope(|scope| {
            for _ in 1..threads.min(missing.len()) {
                scope.spawn(work);
            }
            work();
        });
        self.tell_if_long(missing.len() as i64, start.elapsed());
        failed.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
    }

    /// One line, once, when all of the finest level would take long at the pace so far.
    fn tell_if_long(&self, blocks: i64, time: Duration) {
        let lattice = self.lattice;
        let made = lattice.made.fetch_add(blocks, Ordering::Relaxed) + blocks;
        let nanoseconds = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        let spent =
            Duration::from_nanos(lattice.spent.fetch_add(nanoseconds, Ordering::Relaxed) + nanoseconds);
        if spent < Duration::from_secs(1) || lattice.warned.load(Ordering::Relaxed) {
            return;
        }
        let all = spent.mul_f64((self.blocks_of_the_finest_level() / made as f64).max(1.0));
        if all > LONG && !lattice.warned.swap(true, Ordering::Relaxed) {
            tracing::warn!(
                "{}: it lacks overviews: to make its coarse views from all of it takes some {} s, after \
                 every start; gdaladdo -r average {} 2 4 8 16 32 64 ends that",
                self.path,
                all.as_secs(),
                self.path
            );
        }
    }

    fn blocks_of_the_finest_level(&self) -> f64 {
        let bounds = self.placement.bounds();
        let block = self.window(self.lattice.finest, 0, 0).step_degrees() * SIDE as f64;
        (bounds.east - bounds.west) / block * ((bounds.north - bounds.south) / block)
    }

    /// A block, wrapped; made from the raster on the finest level, else from the four below it.
    fn block(&self, level: u8, column: i64, row: i64) -> Result<Arc<Block<T>>, SourceError> {
        if !self.may_touch(level, column, row) {
            return Ok(Arc::new(Block(Vec::new())));
        }
        self.cache(level).get((column, row), || {
            let mut samples = Vec::new();
            if level == self.lattice.finest {
                let window = self.window(level, column, row);
                if !self.lies_outside(&window) {
                    samples.resize((SIDE * SIDE) as usize, T::NOTHING);
                    (self.make)(&window, &mut samples)?;
                }
            } else {
                for (quarter, (x, y)) in [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().enumerate() {
                    let below = self.block(level + 1, 2 * column + x, 2 * row + y)?;
                    if !below.0.is_empty() {
                        samples.resize((SIDE * SIDE) as usize, T::NOTHING);
                        shrink(&below.0, quarter, &mut samples);
                    }
                }
            }
            if samples.iter().all(|sample| sample.is_nothing()) {
                samples = Vec::new();
            }
            Ok(Block(samples))
        })
    }
}

/// Puts a block, shrunk by half, into a quarter (north-west, north-east, south-west, south-east) of the
/// block above it.
fn shrink<T: Sample>(below: &[T], quarter: usize, above: &mut [T]) {
    let (side, half) = (SIDE as usize, SIDE as usize / 2);
    let corner = quarter / 2 * half * side + quarter % 2 * half;
    for (row, two) in below.chunks_exact(2 * side).enumerate() {
        let (north, south) = two.split_at(side);
        let line = &mut above[corner + row * side..corner + row * side + half];
        for ((target, north), south) in line.iter_mut().zip(north.chunks_exact(2)).zip(south.chunks_exact(2))
        {
            *target = T::of_four([north[0], north[1], south[0], south[1]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::crs::Crs;
    use super::super::geotiff::georeference::Affine;
    use super::*;
    use std::sync::atomic::AtomicUsize;

    impl Sample for u32 {
        const NOTHING: Self = 0;
        fn is_nothing(self) -> bool {
            self == 0
        }
        fn of_four(four: [Self; 4]) -> Self {
            four.iter().sum()
        }
    }

    fn placement(west: f64, north: f64, size: f64) -> Placement {
        Placement::new(
            Crs::wgs84(),
            Affine { x: (west, 0.01, 0.0), y: (north, 0.0, -0.01) },
            (size * 100.0) as u32,
            100,
        )
        .unwrap()
    }

    /// Ones within the raster, so that a coarse sample counts its finest.
    fn ones(placement: &Placement, made: &AtomicUsize, window: &LatticeWindow, out: &mut [u32]) {
        made.fetch_add(1, Ordering::Relaxed);
        for (index, out) in out.iter_mut().enumerate() {
            let (column, row) =
                (index as i64 % i64::from(window.width), index as i64 / i64::from(window.width));
            let longitude = window.longitude(window.first_column + column);
            let latitude = window.latitude(window.first_row + row);
            let inside =
                placement.exact_pixel(longitude, latitude).is_ok_and(|(u, v)| placement.contains_pixel(u, v));
            *out = u32::from(inside);
        }
    }

    fn whole_level(level: u8) -> LatticeWindow {
        let (turn, height) = turn_and_height(level);
        let (width, height) = (turn as u32, height as u32);
        LatticeWindow {
            level,
            registration: Registration::Cell,
            first_column: 0,
            first_row: 0,
            width,
            height,
        }
    }

    #[test]
    fn every_finest_sample_is_counted_once_and_made_once() {
        let placement = placement(179.7, 47.1, 0.6);
        let made = AtomicUsize::new(0);
        let lattice = CoarseLattice::<u32>::new(Registration::Cell, 5);
        let make = |window: &LatticeWindow, out: &mut [u32]| {
            ones(&placement, &made, window, out);
            Ok(())
        };
        let sum = |level: u8, first_column: i64| {
            let window = LatticeWindow { first_column, ..whole_level(level) };
            let mut out = vec![7; window.len()];
            lattice.fill(&placement, "raster", &window, &make, &mut out).unwrap();
            out.iter().sum::<u32>()
        };
        // Samples 0.0110° apart in a box of 0.6° × 1°, over the antimeridian.
        let expected = sum(0, 0);
        assert!((4_900..5_050).contains(&expected), "{expected}");
        let first = made.load(Ordering::Relaxed);
        assert!((6..60).contains(&first), "{first}");
        assert_eq!(
            (sum(1, 0), sum(2, 0), sum(1, -700), sum(0, 333)),
            (expected, expected, expected, expected)
        );
        assert_eq!(made.load(Ordering::Relaxed), first);
    }

    #[test]
    fn rows_beyond_a_pole_are_those_of_the_far_side() {
        let placement = placement(30.0, 90.0, 1.0);
        let made = AtomicUsize::new(0);
        let lattice = CoarseLattice::<u32>::new(Registration::Cell, 4);
        let make = |window: &LatticeWindow, out: &mut [u32]| {
            ones(&placement, &made, window, out);
            Ok(())
        };
        let read = |first_column: i64, first_row: i64| {
            let window = LatticeWindow { first_column, first_row, width: 90, height: 3, ..whole_level(3) };
            let mut out = vec![0; window.len()];
            lattice.fill(&placement, "raster", &window, &make, &mut out).unwrap();
            out
        };
        let column = 4096 + (30.0 / 360.0 * 8192.0) as i64 - 20;
        let (near, far) = (read(column, 0), read(column - 4096, -3));
        assert!(near.iter().any(|&count| count > 0));
        for row in 0..3 {
            assert_eq!(near[row * 90..][..90], far[(2 - row) * 90..][..90]);
        }
    }

    #[test]
    fn a_failure_is_told_and_tried_again() {
        let placement = placement(8.0, 47.0, 1.0);
        let lattice = CoarseLattice::<u32>::new(Registration::Cell, 4);
        let fail = |_: &LatticeWindow, _: &mut [u32]| {
            Err(SourceError::Read { path: "raster".into(), problem: "damaged".into() })
        };
        let window = whole_level(0);
        let mut out = vec![0; window.len()];
        let error = lattice.fill(&placement, "raster", &window, &fail, &mut out).unwrap_err();
        assert!(error.to_string().starts_with("raster: damaged"), "{error}");
        let ones = |_: &LatticeWindow, out: &mut [u32]| {
            out.fill(1);
            Ok(())
        };
        lattice.fill(&placement, "raster", &window, &ones, &mut out).unwrap();
        assert!(out.iter().any(|&count| count > 0));
    }
}
