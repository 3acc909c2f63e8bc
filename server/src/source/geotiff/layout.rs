//! How the samples of one image lie in the file: checked once, trusted afterwards.

use super::bytes::FileBytes;
use super::directory::{Directory, tag};

/// Bytes of one decoded chunk that we are ready to hold.
pub const MAXIMUM_CHUNK_BYTES: u64 = 128 << 20;
/// Uncompressed strips longer than this are read in pieces.
const PIECE_BYTES: u64 = 1 << 20;

/// What stands in the file for a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleKind {
    /// Whole, not negative.
    Unsigned,
    /// Whole, two's complement.
    Signed,
    /// IEEE floating point.
    Float,
}

/// Compression by its TIFF number.
pub mod compression {
    #![allow(missing_docs, reason = "the names are the specification's")]
    pub const NONE: u16 = 1;
    pub const LZW: u16 = 5;
    pub const JPEG: u16 = 7;
    pub const DEFLATE: u16 = 8;
    pub const OLD_DEFLATE: u16 = 32946;
    pub const PACKBITS: u16 = 32773;
    pub const ZSTD: u16 = 50000;
}

/// Photometric interpretation by its TIFF number.
pub mod photometric {
    #![allow(missing_docs, reason = "the names are the specification's")]
    pub const WHITE_IS_ZERO: u16 = 0;
    pub const BLACK_IS_ZERO: u16 = 1;
    pub const RGB: u16 = 2;
    pub const PALETTE: u16 = 3;
    pub const MASK: u16 = 4;
    pub const CMYK: u16 = 5;
    pub const YCBCR: u16 = 6;
}

/// One image's layout.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples of a pixel.
    pub samples: u16,
    /// Bits of a sample.
    pub bits: u16,
    /// Kind of a sample.
    pub kind: SampleKind,
    /// Whether each band has chunks of its own.
    pub planar: bool,
    /// TIFF number.
    pub compression: u16,
    /// TIFF number: 1 none, 2 horizontal, 3 floating point.
    pub predictor: u16,
    /// TIFF number.
    pub photometric: u16,
    /// What the samples beyond the photometric ones are: 1 associated alpha, 2 unassociated alpha, 0 unknown.
    pub extra_samples: Vec<u16>,
    /// Colours of a palette.
    pub palette: Option<Vec<[u8; 3]>>,
    /// Tables that all JPEG chunks share.
    pub jpeg_tables: Option<Vec<u8>>,
    /// Bits of NewSubfileType: 1 reduced resolution, 4 mask.
    pub subfile: u64,
    /// Whether chunks are tiles (padded to full size) and not strips.
    pub tiled: bool,
    /// Columns of a chunk.
    pub chunk_width: u32,
    /// Rows of a chunk.
    pub chunk_height: u32,
    offsets: Vec<u64>,
    counts: Vec<u64>,
}

/// A refusal: what is wrong and what mends it; `FILE` stands for the file's name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What is wrong.
    pub problem: String,
    /// What the user can do.
    pub mend: String,
}

impl Refusal {
    /// With a mend.
    pub fn new(problem: impl Into<String>, mend: impl Into<String>) -> Self {
        Self { problem: problem.into(), mend: mend.into() }
    }

    fn damaged(problem: impl Into<String>) -> Self {
        Self::new(problem, "it is damaged or was not copied whole: fetch it again")
    }
}

/// Name of a compression, for people.
pub fn compression_name(number: u16) -> String {
    let name = match number {
        compression::NONE => "uncompressed",
        2..=4 => "CCITT fax",
        compression::LZW => "LZW",
        6 => "old-style JPEG",
        compression::JPEG => "JPEG",
        compression::DEFLATE | compression::OLD_DEFLATE => "deflate",
        compression::PACKBITS => "PackBits",
        33003 | 33005 | 34712 => "JPEG 2000",
        34887 => "LERC",
        34925 => "LZMA",
        compression::ZSTD => "zstd",
        50001 => "WebP",
        50002 | 52546 => "JPEG XL",
        _ => return format!("compression {number}"),
    };
    name.to_owned()
}

impl Layout {
    /// Of pictures in red, green, blue and alpha, in tiles of `side` pixels a side that come one by one.
    pub fn of_pictures(width: u32, height: u32, side: u32) -> Self {
        Self {
            width,
            height,
            samples: 4,
            bits: 8,
            kind: SampleKind::Unsigned,
            planar: false,
            compression: compression::NONE,
            predictor: 1,
            photometric: photometric::RGB,
            extra_samples: vec![2],
            palette: None,
            jpeg_tables: None,
            subfile: 0,
            tiled: true,
            chunk_width: side,
            chunk_height: side,
            offsets: Vec::new(),
            counts: Vec::new(),
        }
    }

    /// Of heights in 32-bit floating point, in tiles of `side` samples a side that come one by one.
    pub fn of_heights(width: u32, height: u32, side: u32) -> Self {
        Self {
            samples: 1,
            bits: 32,
            kind: SampleKind::Float,
            photometric: photometric::BLACK_IS_ZERO,
            extra_samples: Vec::new(),
            ..Self::of_pictures(width, height, side)
        }
    }

    /// Reads and checks the layout of a directory.
    ///
    /// # Errors
    /// What is wrong, or not supported, and the mend.
    pub fn read(bytes: &FileBytes, directory: &Directory) -> Result<Self, Refusal> {
        let value = |number| directory.unsigned_value(bytes, number);
        let small = |number, default: u16| {
            value(number).map_or(Ok(default), |found| {
                u16::try_from(found).map_err(|_| Refusal::damaged(format!("its tag {number} holds {found}")))
            })
        };
        let side = |number, name: &str| match value(number).map(u32::try_from) {
            Some(Ok(found @ 1..=0x7fff_ffff)) => Ok(found),
            _ => Err(Refusal::damaged(format!("its {name} is missing or absurd"))),
        };
        let width = side(tag::IMAGE_WIDTH, "width")?;
        let height = side(tag::IMAGE_LENGTH, "height")?;
        let samples = small(tag::SAMPLES_PER_PIXEL, 1)?;
        if samples == 0 || samples > 4096 {
            return Err(Refusal::damaged(format!("it claims {samples} bands")));
        }
        let bits = directory.unsigned_values(bytes, tag::BITS_PER_SAMPLE).unwrap_or_else(|| vec![1]);
        let formats = directory.unsigned_values(bytes, tag::SAMPLE_FORMAT).unwrap_or_else(|| vec![1]);
        let same = |values: &[u64]| values.windows(2).all(|pair| pair[0] == pair[1]);
        if bits.is_empty() || formats.is_empty() || !same(&bits) || !same(&formats) {
            return Err(Refusal::new(
                "its bands are of different types",
                "gdal_translate -b 1 FILE one_band.tif",
            ));
        }
        let kind = match formats[0] {
            1 | 4 => SampleKind::Unsigned,
            2 => SampleKind::Signed,
            3 => SampleKind::Float,
            5 | 6 => {
                return Err(Refusal::new(
                    "its samples are complex numbers",
                    "gdal_translate -ot Float32 FILE real.tif",
                ));
            }
            other => {
                return Err(Refusal::damaged(format!(
                    "its samples are of a kind, {other}, that is not known"
                )));
            }
        };
        let supported = match kind {
            SampleKind::Float => matches!(bits[0], 16 | 32 | 64),
            SampleKind::Signed => matches!(bits[0], 8 | 16 | 32 | 64),
            SampleKind::Unsigned => {
                matches!(bits[0], 8 | 16 | 32 | 64) || samples == 1 && matches!(bits[0], 1 | 2 | 4)
            }
        };
        if !supported {
            return Err(Refusal::new(
                format!(
                    "samples of {} bit{} are not supported",
                    bits[0],
                    if bits[0] == 1 { "" } else { "s" }
                ),
                "gdal_translate -ot UInt16 (or Float32) FILE whole_bytes.tif",
            ));
        }
        let planar = match small(tag::PLANAR_CONFIGURATION, 1)? {
            1 => false,
            2 => samples > 1,
            other => return Err(Refusal::damaged(format!("its planar configuration is {other}"))),
        };
        let mut layout = Self {
            width,
            height,
            samples,
            bits: bits[0] as u16,
            kind,
            planar,
            compression: small(tag::COMPRESSION, 1)?,
            predictor: small(tag::PREDICTOR, 1)?,
            photometric: small(tag::PHOTOMETRIC_INTERPRETATION, photometric::BLACK_IS_ZERO)?,
            extra_samples: directory
                .unsigned_values(bytes, tag::EXTRA_SAMPLES)
                .unwrap_or_default()
                .iter()
                .map(|&extra| extra as u16)
                .collect(),
            palette: None,
            jpeg_tables: None,
            subfile: value(tag::NEW_SUBFILE_TYPE).unwrap_or(0),
            tiled: directory.has(tag::TILE_OFFSETS) || directory.has(tag::TILE_WIDTH),
            chunk_width: width,
            chunk_height: height,
            offsets: Vec::new(),
            counts: Vec::new(),
        };
        layout.check_encoding(bytes, directory)?;
        layout.read_palette(bytes, directory)?;
        layout.read_chunks(bytes, directory)?;
        Ok(layout)
    }

    fn check_encoding(&mut self, bytes: &FileBytes, directory: &Directory) -> Result<(), Refusal> {
        let known = [
            compression::NONE,
            compression::LZW,
            compression::JPEG,
            compression::DEFLATE,
            compression::OLD_DEFLATE,
            compression::PACKBITS,
            compression::ZSTD,
        ];
        let again = "gdal_translate -co COMPRESS=DEFLATE -co TILED=YES FILE readable.tif";
        if !known.contains(&self.compression) {
            let name = compression_name(self.compression);
            return Err(Refusal::new(format!("its encoding ({name}) is not supported"), again));
        }
        let predictable = match self.predictor {
            1 => true,
            2 => self.bits >= 8,
            3 => self.kind == SampleKind::Float,
            _ => false,
        };
        if !predictable {
            let problem = format!("predictor {} does not go with {}-bit samples", self.predictor, self.bits);
            return Err(Refusal::new(problem, again));
        }
        if self.bits < 8 && directory.unsigned_value(bytes, tag::FILL_ORDER) == Some(2) {
            return Err(Refusal::new("its bits stand in reversed order", again));
        }
        if self.compression == compression::JPEG {
            if self.bits != 8 || self.kind != SampleKind::Unsigned {
                return Err(Refusal::new(format!("JPEG of {} bits is not supported", self.bits), again));
            }
            self.jpeg_tables = directory.blob(bytes, tag::JPEG_TABLES).filter(|tables| tables.len() >= 4);
        } else if self.photometric == photometric::YCBCR {
            let subsampling =
                directory.unsigned_values(bytes, tag::YCBCR_SUBSAMPLING).unwrap_or_else(|| vec![2, 2]);
            if subsampling != [1, 1] {
                return Err(Refusal::new(
                    "subsampled YCbCr without JPEG is not supported",
                    "gdal_translate -co PHOTOMETRIC=RGB -co COMPRESS=DEFLATE FILE readable.tif",
                ));
            }
        }
        Ok(())
    }

    fn read_palette(&mut self, bytes: &FileBytes, directory: &Directory) -> Result<(), Refusal> {
        if self.photometric != photometric::PALETTE {
            return Ok(());
        }
        let mend = "gdal_translate -expand rgb FILE rgb.tif";
        if self.bits > 8 || self.samples != 1 || self.kind != SampleKind::Unsigned {
            return Err(Refusal::new("a palette with more than 8 bits or one band is not supported", mend));
        }
        let map = directory.unsigned_values(bytes, tag::COLOR_MAP).unwrap_or_default();
        let count = 1_usize << self.bits;
        if map.len() < 3 * count {
            return Err(Refusal::damaged("its palette is missing or too short"));
        }
        // The specification says 16 bits; writers that fill 8 are recognised by their small numbers.
        let shift = if map.iter().all(|&value| value < 256) { 0 } else { 8 };
        let channel = |band: usize, index: usize| (map[band * count + index] >> shift).min(255) as u8;
        self.palette = Some((0..count).map(|index| [0, 1, 2].map(|band| channel(band, index))).collect());
        Ok(())
    }

    fn read_chunks(&mut self, bytes: &FileBytes, directory: &Directory) -> Result<(), Refusal> {
        let (offsets_tag, counts_tag) = if self.tiled {
            (tag::TILE_OFFSETS, tag::TILE_BYTE_COUNTS)
        } else {
            (tag::STRIP_OFFSETS, tag::STRIP_BYTE_COUNTS)
        };
        let lost = || Refusal::damaged("the table of its strips or tiles is missing or cut off");
        self.offsets = directory.unsigned_values(bytes, offsets_tag).ok_or_else(lost)?;
        let planes = if self.planar { usize::from(self.samples) } else { 1 };
        if self.tiled {
            let side = |number| {
                directory
                    .unsigned_value(bytes, number)
                    .and_then(|found| u32::try_from(found).ok())
                    .filter(|&found| found > 0 && found <= 1 << 20)
                    .ok_or_else(|| Refusal::damaged("its tile size is missing or absurd"))
            };
            self.chunk_width = side(tag::TILE_WIDTH)?;
            self.chunk_height = side(tag::TILE_LENGTH)?;
        } else {
            let strips = (self.offsets.len() / planes).max(1);
            let stated = directory.unsigned_value(bytes, tag::ROWS_PER_STRIP).filter(|&rows| rows > 0);
            // Left out although there are many strips: they share the rows evenly.
            let rows = stated.unwrap_or_else(|| u64::from(self.height).div_ceil(strips as u64));
            self.chunk_height = rows.min(u64::from(self.height)) as u32;
        }
        let chunk_bytes = u64::from(self.chunk_height).saturating_mul(self.chunk_row_bytes());
        self.counts = match directory.unsigned_values(bytes, counts_tag) {
            Some(counts) => counts,
            None if self.compression == compression::NONE => (0..self.offsets.len())
                .map(|index| u64::from(self.stored_rows(index as u32)) * self.chunk_row_bytes())
                .collect(),
            None => return Err(lost()),
        };
        let expected = self.chunks_per_plane() as usize * planes;
        if self.offsets.len() < expected || self.counts.len() < expected {
            return Err(lost());
        }
        if self.compression == compression::NONE {
            self.lengthen_counts(expected);
        }
        let end = |index: usize| self.offsets[index].saturating_add(self.counts[index]);
        let beyond = (0..expected).filter(|&index| end(index) > bytes.length()).count();
        if beyond > 0 {
            let what = if self.tiled { "tiles" } else { "strips" };
            return Err(Refusal::damaged(format!("{beyond} of its {expected} {what} lie beyond its end")));
        }
        if !self.tiled && self.compression == compression::NONE && self.predictor == 1 {
            self.split_strips(planes);
        } else if chunk_bytes > MAXIMUM_CHUNK_BYTES {
            return Err(Refusal::new(
                format!("one of its strips or tiles holds {} MiB", chunk_bytes >> 20),
                "gdal_translate -co TILED=YES -co COMPRESS=DEFLATE -co BIGTIFF=IF_SAFER FILE tiled.tif",
            ));
        }
        if u64::from(self.chunk_height).saturating_mul(self.chunk_row_bytes()) > MAXIMUM_CHUNK_BYTES {
            return Err(Refusal::damaged("one row of it is longer than any real image's"));
        }
        Ok(())
    }

    /// How long an uncompressed strip or tile is follows from its rows; writers that state less are
    /// believed no more than files that lack what they promise.
    fn lengthen_counts(&mut self, expected: usize) {
        for index in 0..expected {
            if self.offsets[index] != 0 && self.counts[index] != 0 {
                let needed = u64::from(self.stored_rows(index as u32)).saturating_mul(self.chunk_row_bytes());
                self.counts[index] = self.counts[index].max(needed);
            }
        }
    }

    /// Cuts long uncompressed strips into pieces that are chunks of their own: nothing forces us to
    /// read all of them.
    fn split_strips(&mut self, planes: usize) {
        let row_bytes = self.chunk_row_bytes();
        let rows = self.chunk_height;
        let target = u32::try_from((PIECE_BYTES / row_bytes).max(1)).unwrap_or(1);
        let written =
            self.offsets.iter().zip(&self.counts).any(|(&offset, &count)| offset != 0 && count != 0);
        if rows <= target || !written {
            return;
        }
        let strips = self.chunks_per_plane();
        // Several strips must split evenly, for chunks to stay a regular grid.
        let piece = if strips == 1 {
            target
        } else {
            (1..=target).rev().find(|&piece| rows.is_multiple_of(piece)).unwrap_or(1)
        };
        let (mut offsets, mut counts) = (Vec::new(), Vec::new());
        for plane in 0..planes {
            for strip in 0..strips {
                let index = plane * strips as usize + strip as usize;
                let strip_rows = rows.min(self.height - strip * rows);
                let mut row = 0;
                while row < strip_rows {
                    let start = u64::from(row) * row_bytes;
                    let piece_rows = piece.min(strip_rows - row);
                    let sparse = self.offsets[index] == 0 || self.counts[index] == 0;
                    offsets.push(if sparse { 0 } else { self.offsets[index].saturating_add(start) });
                    let left = self.counts[index].saturating_sub(start);
                    let wanted = u64::from(piece_rows) * row_bytes;
                    // A strip that is shorter than its rows must fail as cut off, not read as sparse.
                    counts.push(if sparse { 0 } else { left.min(wanted).max(1) });
                    row += piece_rows;
                }
            }
        }
        self.chunk_height = piece;
        self.offsets = offsets;
        self.counts = counts;
    }

    /// Samples of a pixel within a chunk.
    pub fn chunk_samples(&self) -> u16 {
        if self.planar { 1 } else { self.samples }
    }

    /// Bytes of a row of a decoded chunk, before bits are unpacked.
    pub fn chunk_row_bytes(&self) -> u64 {
        (u64::from(self.chunk_width) * u64::from(self.chunk_samples()) * u64::from(self.bits)).div_ceil(8)
    }

    /// Chunks side by side.
    pub fn chunks_across(&self) -> u32 {
        self.width.div_ceil(self.chunk_width)
    }

    /// Chunks of one plane.
    pub fn chunks_per_plane(&self) -> u32 {
        self.chunks_across().saturating_mul(self.height.div_ceil(self.chunk_height))
    }

    /// Rows of a chunk that lie in the image: what lies below is padding that we do not decode.
    pub fn stored_rows(&self, chunk: u32) -> u32 {
        let row = chunk % self.chunks_per_plane() / self.chunks_across() * self.chunk_height;
        self.chunk_height.min(self.height - row)
    }

    /// Place and length of a chunk in the file, `None` for one that was never written (all nodata).
    pub fn chunk_place(&self, chunk: u32) -> Option<(u64, u64)> {
        let place = (*self.offsets.get(chunk as usize)?, *self.counts.get(chunk as usize)?);
        (place.0 != 0 && place.1 != 0).then_some(place)
    }

    /// Whether it is a reduced copy of another image.
    pub fn is_reduced(&self) -> bool {
        self.subfile & 1 != 0
    }

    /// Whether it is the validity mask of another image.
    pub fn is_mask(&self) -> bool {
        self.subfile & 4 != 0 || self.photometric == photometric::MASK
    }

    /// Type of its samples, in GDAL's words.
    pub fn type_name(&self) -> String {
        match (self.kind, self.bits) {
            (SampleKind::Unsigned, 8) => "Byte".to_owned(),
            (SampleKind::Unsigned, bits) => format!("UInt{bits}"),
            (SampleKind::Signed, bits) => format!("Int{bits}"),
            (SampleKind::Float, bits) => format!("Float{bits}"),
        }
    }
}
