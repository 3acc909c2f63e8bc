//! One image of a file, and windows of its samples: only the chunks that a window touches are read.

use super::bytes::FileBytes;
use super::cache::ChunkCache;
use super::chunk::{self, Samples};
use super::layout::Layout;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Decoded bytes after which trying an image ends.
const TRIED_BYTES: usize = 512 << 20;

/// What images are read from.
#[derive(Debug)]
pub struct SourceFile {
    contents: Contents,
    id: u64,
}

#[derive(Debug)]
enum Contents {
    /// A file; whether its numbers stand most significant byte first.
    File {
        bytes: FileBytes,
        big_endian: bool,
    },
    Service(Arc<dyn ChunkService>),
}

/// Something that gives chunks one by one.
pub trait ChunkService: std::fmt::Debug + Send + Sync {
    /// The samples of a chunk of an image.
    ///
    /// # Errors
    /// What went wrong, in a few words.
    fn chunk(&self, image: u32, column: u32, row: u32) -> Result<Samples, String>;
}

impl SourceFile {
    /// Takes an open file.
    pub fn new(bytes: FileBytes, big_endian: bool) -> Self {
        Self::with(Contents::File { bytes, big_endian })
    }

    /// Chunks of a service.
    pub fn of_service(service: Arc<dyn ChunkService>) -> Self {
        Self::with(Contents::Service(service))
    }

    fn with(contents: Contents) -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Self { contents, id: NEXT.fetch_add(1, Ordering::Relaxed) }
    }
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Rect {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.width == 0 || self.height == 0
    }
}

/// How stored numbers become values: nodata and what is beyond belief become NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueRule {
    /// The stored number that stands for no data.
    pub nodata: Option<f64>,
    /// value = stored · scale + offset.
    pub scale: f64,
    /// See `scale`.
    pub offset: f64,
    /// Values whose magnitude is greater are no data.
    pub limit: f64,
}

impl ValueRule {
    /// Numbers as they are stored.
    pub const RAW: Self = Self { nodata: None, scale: 1.0, offset: 0.0, limit: f64::INFINITY };

    fn apply(&self, stored: f64, nodata: Option<f64>) -> f32 {
        let value = stored * self.scale + self.offset;
        if nodata == Some(stored) || value.is_nan() || value.abs() > self.limit {
            f32::NAN
        } else {
            value as f32
        }
    }
}

/// An image: the full one, an overview, or a mask.
#[derive(Debug)]
pub struct Image {
    file: Arc<SourceFile>,
    index: u32,
    /// Its layout.
    pub layout: Layout,
    /// Its validity mask: 0 where there is no data.
    pub mask: Option<Box<Image>>,
}

impl Image {
    /// An image of a file; `index` tells the file's images apart.
    pub fn new(file: Arc<SourceFile>, index: u32, layout: Layout) -> Self {
        Self { file, index, layout, mask: None }
    }

    /// The whole image.
    pub fn rect(&self) -> Rect {
        Rect { x: 0, y: 0, width: self.layout.width, height: self.layout.height }
    }

    fn chunk(&self, plane: u32, column: u32, row: u32) -> Result<Arc<Samples>, String> {
        let layout = &self.layout;
        let chunk = plane * layout.chunks_per_plane() + row * layout.chunks_across() + column;
        ChunkCache::shared().get((self.file.id, self.index, chunk), || {
            let (bytes, big_endian) = match &self.file.contents {
                Contents::Service(service) => return service.chunk(self.index, column, row),
                Contents::File { bytes, big_endian } => (bytes, *big_endian),
            };
            let Some((offset, count)) = layout.chunk_place(chunk) else { return Ok(Samples::Sparse) };
            let place = || {
                format!("the {} at column {column}, row {row}", if layout.tiled { "tile" } else { "strip" })
            };
            let data = bytes.read(offset, count).map_err(|error| match error.kind() {
                std::io::ErrorKind::UnexpectedEof => {
                    format!("{} lies beyond the end of the file: it was cut off", place())
                }
                _ => format!("{} cannot be read: {error}", place()),
            })?;
            chunk::decode(layout, big_endian, layout.stored_rows(chunk), data)
                .map_err(|problem| format!("{} cannot be decoded: {problem}", place()))
        })
    }

    /// Decodes up to `most` chunks, spread evenly from the first to the last: how many could be, and what
    /// was wrong with the first that could not.
    pub fn try_chunks(&self, most: u32) -> (u32, Option<String>) {
        let layout = &self.layout;
        let per_plane = u64::from(layout.chunks_per_plane());
        let planes = if layout.planar { u64::from(layout.samples) } else { 1 };
        let last = (per_plane * planes).saturating_sub(1);
        let count = u64::from(most).min(last + 1);
        let (mut readable, mut bytes, mut problem) = (0, 0, None);
        for step in 0..count {
            let index = if count == 1 { last / 2 } else { last * step / (count - 1) };
            let (plane, chunk) = ((index / per_plane) as u32, (index % per_plane) as u32);
            let (column, row) = (chunk % layout.chunks_across(), chunk / layout.chunks_across());
            match self.chunk(plane, column, row) {
                Ok(samples) => {
                    readable += 1;
                    bytes += samples.bytes();
                }
                Err(found) => problem = problem.or(Some(found)),
            }
            if bytes > TRIED_BYTES {
                break;
            }
        }
        (readable, problem)
    }

    /// Calls `each` with every chunk of `plane` that touches the window, and the part of the window
    /// that it holds: (samples, part, the part's first pixel within the chunk).
    fn for_each_chunk(
        &self,
        plane: u32,
        rect: Rect,
        mut each: impl FnMut(&Samples, Rect, usize),
    ) -> Result<(), String> {
        if rect.is_empty() {
            return Ok(());
        }
        let layout = &self.layout;
        let (wide, high) = (layout.chunk_width, layout.chunk_height);
        for row in rect.y / high..=(rect.y + rect.height - 1) / high {
            for column in rect.x / wide..=(rect.x + rect.width - 1) / wide {
                let samples = self.chunk(plane, column, row)?;
                let (left, top) = (column * wide, row * high);
                let (x, y) = (rect.x.max(left), rect.y.max(top));
                let part = Rect {
                    x,
                    y,
                    width: (rect.x + rect.width).min(left.saturating_add(wide)) - x,
                    height: (rect.y + rect.height).min(top.saturating_add(high)) - y,
                };
                let first = (y - top) as usize * wide as usize + (x - left) as usize;
                each(&samples, part, first);
            }
        }
        Ok(())
    }

    /// Values of a band (from 0) in a window, row-major; NaN where there is no data.
    ///
    /// # Errors
    /// A chunk that cannot be read, in words.
    pub fn read_values(&self, band: u16, rect: Rect, rule: &ValueRule) -> Result<Vec<f32>, String> {
        let mut values = vec![f32::NAN; rect.len()];
        let (plane, step, lane) = if self.layout.planar {
            (u32::from(band), 1, 0)
        } else {
            (0, usize::from(self.layout.samples), usize::from(band))
        };
        let chunk_width = self.layout.chunk_width as usize;
        // A declared nodata went through decimal text; in a float band it means the nearest float.
        let single = rule.nodata.map(|nodata| f64::from(nodata as f32));
        // Writers leave out the chunks that hold nothing but nodata or, where none is declared, zeros.
        let never_written = if rule.nodata.is_some() { f32::NAN } else { rule.apply(0.0, None) };
        self.for_each_chunk(plane, rect, |samples, part, first| {
            let target = Target { values: &mut values, rect, part, first, chunk_width, step, lane };
            match samples {
                Samples::U8(stored) => target.fill(stored, |value| rule.apply(f64::from(value), rule.nodata)),
                Samples::I8(stored) => target.fill(stored, |value| rule.apply(f64::from(value), rule.nodata)),
                Samples::U16(stored) => {
                    target.fill(stored, |value| rule.apply(f64::from(value), rule.nodata))
                }
                Samples::I16(stored) => {
                    target.fill(stored, |value| rule.apply(f64::from(value), rule.nodata))
                }
                Samples::U32(stored) => {
                    target.fill(stored, |value| rule.apply(f64::from(value), rule.nodata))
                }
                Samples::I32(stored) => {
                    target.fill(stored, |value| rule.apply(f64::from(value), rule.nodata))
                }
                Samples::U64(stored) => target.fill(stored, |value| rule.apply(value as f64, rule.nodata)),
                Samples::I64(stored) => target.fill(stored, |value| rule.apply(value as f64, rule.nodata)),
                Samples::F32(stored) => target.fill(stored, |value| rule.apply(f64::from(value), single)),
                Samples::F64(stored) => target.fill(stored, |value| rule.apply(value, rule.nodata)),
                Samples::Sparse => target.all(never_written),
            }
        })?;
        if let Some(mask) = &self.mask {
            for (value, valid) in values.iter_mut().zip(mask.read_mask(rect)?) {
                if !valid {
                    *value = f32::NAN;
                }
            }
        }
        Ok(values)
    }

    /// Whether the mask says that a pixel is valid.
    ///
    /// # Errors
    /// As [`Self::read_values`].
    pub fn read_mask(&self, rect: Rect) -> Result<Vec<bool>, String> {
        let mut valid = vec![false; rect.len()];
        let chunk_width = self.layout.chunk_width as usize;
        let step = usize::from(self.layout.chunk_samples());
        self.for_each_chunk(0, rect, |samples, part, first| {
            let Samples::U8(stored) = samples else { return };
            for row in 0..part.height as usize {
                let to = (part.y - rect.y) as usize * rect.width as usize
                    + row * rect.width as usize
                    + (part.x - rect.x) as usize;
                let from = first + row * chunk_width;
                for column in 0..part.width as usize {
                    valid[to + column] = stored[(from + column) * step] != 0;
                }
            }
        })?;
        Ok(valid)
    }

    /// Pixels of a chunky 8-bit image in a window, each made of its samples by `pixel`.
    /// `None` where the image is not of that kind.
    ///
    /// # Errors
    /// As [`Self::read_values`].
    pub fn read_bytes_as(
        &self,
        rect: Rect,
        pixel: impl Fn(&[u8]) -> [u8; 4],
    ) -> Result<Option<Vec<[u8; 4]>>, String> {
        if self.layout.planar
            || self.layout.bits > 8
            || self.layout.kind != super::layout::SampleKind::Unsigned
        {
            return Ok(None);
        }
        let mut pixels = vec![[0; 4]; rect.len()];
        let chunk_width = self.layout.chunk_width as usize;
        let step = usize::from(self.layout.samples);
        self.for_each_chunk(0, rect, |samples, part, first| {
            let Samples::U8(stored) = samples else { return };
            for row in 0..part.height as usize {
                let to =
                    ((part.y - rect.y) as usize + row) * rect.width as usize + (part.x - rect.x) as usize;
                let from = (first + row * chunk_width) * step;
                let line = stored[from..from + part.width as usize * step].chunks_exact(step);
                for (target, source) in pixels[to..to + part.width as usize].iter_mut().zip(line) {
                    *target = pixel(source);
                }
            }
        })?;
        Ok(Some(pixels))
    }
}

struct Target<'a> {
    values: &'a mut [f32],
    rect: Rect,
    part: Rect,
    first: usize,
    chunk_width: usize,
    step: usize,
    lane: usize,
}

impl Target<'_> {
    fn all(self, value: f32) {
        let width = self.rect.width as usize;
        for row in 0..self.part.height as usize {
            let to =
                ((self.part.y - self.rect.y) as usize + row) * width + (self.part.x - self.rect.x) as usize;
            self.values[to..to + self.part.width as usize].fill(value);
        }
    }

    fn fill<T: Copy>(self, stored: &[T], value: impl Fn(T) -> f32) {
        let width = self.rect.width as usize;
        for row in 0..self.part.height as usize {
            let to =
                ((self.part.y - self.rect.y) as usize + row) * width + (self.part.x - self.rect.x) as usize;
            let from = (self.first + row * self.chunk_width) * self.step + self.lane;
            let line = &mut self.values[to..to + self.part.width as usize];
            for (target, &source) in line.iter_mut().zip(stored[from..].iter().step_by(self.step)) {
                *target = value(source);
            }
        }
    }
}
