//! TIFF's skeleton: header, chain of image file directories, and their entries, all bounded by the
//! size of the file. What the entries mean is [`super::layout`]'s and [`super::georeference`]'s matter.

use super::bytes::FileBytes;
use std::collections::{BTreeMap, HashSet};

/// Directories that are followed; more is no image pyramid but an attack or a movie.
const MAXIMUM_DIRECTORIES: usize = 256;
/// Entries of one directory that are read.
const MAXIMUM_ENTRIES: u64 = 4096;
/// Bytes of one entry's values that are read: 16 million 8-byte chunk offsets.
const MAXIMUM_VALUE_BYTES: u64 = 128 << 20;

/// Numbers of the tags that we read.
pub mod tag {
    #![allow(missing_docs, reason = "the names are the specification's")]
    pub const NEW_SUBFILE_TYPE: u16 = 254;
    pub const IMAGE_WIDTH: u16 = 256;
    pub const IMAGE_LENGTH: u16 = 257;
    pub const BITS_PER_SAMPLE: u16 = 258;
    pub const COMPRESSION: u16 = 259;
    pub const PHOTOMETRIC_INTERPRETATION: u16 = 262;
    pub const FILL_ORDER: u16 = 266;
    pub const STRIP_OFFSETS: u16 = 273;
    pub const SAMPLES_PER_PIXEL: u16 = 277;
    pub const ROWS_PER_STRIP: u16 = 278;
    pub const STRIP_BYTE_COUNTS: u16 = 279;
    pub const PLANAR_CONFIGURATION: u16 = 284;
    pub const PREDICTOR: u16 = 317;
    pub const COLOR_MAP: u16 = 320;
    pub const TILE_WIDTH: u16 = 322;
    pub const TILE_LENGTH: u16 = 323;
    pub const TILE_OFFSETS: u16 = 324;
    pub const TILE_BYTE_COUNTS: u16 = 325;
    pub const SUB_IFDS: u16 = 330;
    pub const EXTRA_SAMPLES: u16 = 338;
    pub const SAMPLE_FORMAT: u16 = 339;
    pub const JPEG_TABLES: u16 = 347;
    pub const YCBCR_SUBSAMPLING: u16 = 530;
    pub const MODEL_PIXEL_SCALE: u16 = 33550;
    pub const MODEL_TIEPOINT: u16 = 33922;
    pub const MODEL_TRANSFORMATION: u16 = 34264;
    pub const GEO_KEY_DIRECTORY: u16 = 34735;
    pub const GEO_DOUBLE_PARAMETERS: u16 = 34736;
    pub const GEO_ASCII_PARAMETERS: u16 = 34737;
    pub const GDAL_METADATA: u16 = 42112;
    pub const GDAL_NODATA: u16 = 42113;
}

/// The whole skeleton.
#[derive(Debug)]
pub struct Skeleton {
    /// Whether numbers stand most significant byte first.
    pub big_endian: bool,
    /// Whether it is a BigTIFF.
    pub big_tiff: bool,
    /// The directories in the order of the chain, each followed by its sub-directories.
    pub directories: Vec<Directory>,
}

/// One image file directory.
#[derive(Debug)]
pub struct Directory {
    entries: BTreeMap<u16, Entry>,
    big_endian: bool,
}

#[derive(Debug)]
struct Entry {
    kind: u16,
    count: u64,
    /// Place of the values in the file.
    offset: u64,
}

fn size_of_kind(kind: u16) -> Option<u64> {
    Some(match kind {
        1 | 2 | 6 | 7 => 1,
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16 | 17 | 18 => 8,
        _ => return None,
    })
}

fn unsigned(bytes: &[u8], big_endian: bool) -> u64 {
    let fold = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
    if big_endian { bytes.iter().fold(0, fold) } else { bytes.iter().rev().fold(0, fold) }
}

/// Reads the skeleton.
///
/// # Errors
/// One sentence on what is wrong.
pub fn read(bytes: &FileBytes) -> Result<Skeleton, String> {
    let header = bytes.read(0, bytes.length().min(16)).map_err(|error| error.to_string())?;
    let big_endian = match header.get(..2) {
        Some(b"II") => false,
        Some(b"MM") => true,
        _ => return Err("it does not begin as a TIFF does".to_owned()),
    };
    let magic = header.get(2..4).map(|magic| unsigned(magic, big_endian));
    let big_tiff = match magic {
        Some(42) => false,
        Some(43) => true,
        _ => return Err("it does not begin as a TIFF does".to_owned()),
    };
    let first = if big_tiff { header.get(8..16) } else { header.get(4..8) };
    let first = unsigned(first.ok_or("it ends within its header")?, big_endian);
    let mut directories = Vec::new();
    let mut seen = HashSet::new();
    // Sub-directories go on top of the stack, so that they follow their parent.
    let mut waiting = vec![first];
    while let Some(offset) = waiting.pop() {
        if offset == 0 || !seen.insert(offset) || directories.len() >= MAXIMUM_DIRECTORIES {
            continue;
        }
        match read_directory(bytes, offset, big_endian, big_tiff) {
            Ok((directory, next)) => {
                waiting.push(next);
                let mut below = directory.unsigned_values(bytes, tag::SUB_IFDS).unwrap_or_default();
                below.reverse();
                waiting.extend(below.into_iter().take(MAXIMUM_DIRECTORIES));
                directories.push(directory);
            }
            // A damaged overview or mask must not cost us the image before it.
            Err(problem) if directories.is_empty() => return Err(problem),
            Err(_) => {}
        }
    }
    if directories.is_empty() {
        return Err("it holds no image".to_owned());
    }
    Ok(Skeleton { big_endian, big_tiff, directories })
}

fn read_directory(
    bytes: &FileBytes,
    offset: u64,
    big_endian: bool,
    big_tiff: bool,
) -> Result<(Directory, u64), String> {
    let cut = |_| "it ends within its image directory: it is cut off or damaged".to_owned();
    let (head, entry_size, word) = if big_tiff { (8, 20, 8) } else { (2, 12, 4) };
    let count = unsigned(&bytes.read(offset, head).map_err(cut)?, big_endian);
    if count == 0 || count > MAXIMUM_ENTRIES {
        return Err(format!("its image directory is damaged (it claims {count} entries)"));
    }
    let start = offset + head;
    let block = bytes.read(start, count * entry_size).map_err(cut)?;
    // Some writers leave out the link after the last directory.
    let next = bytes.read(start + count * entry_size, word).map_or(0, |link| unsigned(&link, big_endian));
    let mut entries = BTreeMap::new();
    for (index, entry) in block.chunks_exact(entry_size as usize).enumerate() {
        let number = unsigned(&entry[..2], big_endian) as u16;
        let kind = unsigned(&entry[2..4], big_endian) as u16;
        let (count, inline) =
            if big_tiff { (&entry[4..12], &entry[12..]) } else { (&entry[4..8], &entry[8..]) };
        let count = unsigned(count, big_endian);
        let Some(size) = size_of_kind(kind).and_then(|size| size.checked_mul(count)) else { continue };
        let offset = if size <= word {
            start + index as u64 * entry_size + entry_size - word
        } else {
            unsigned(inline, big_endian)
        };
        entries.entry(number).or_insert(Entry { kind, count, offset });
    }
    Ok((Directory { entries, big_endian }, next))
}

impl Directory {
    /// Whether the tag stands there, readable or not.
    pub fn has(&self, number: u16) -> bool {
        self.entries.contains_key(&number)
    }

    fn raw(&self, bytes: &FileBytes, number: u16) -> Option<(u16, Vec<u8>)> {
        let entry = self.entries.get(&number)?;
        let size = size_of_kind(entry.kind)?.checked_mul(entry.count)?;
        if size > MAXIMUM_VALUE_BYTES {
            return None;
        }
        Some((entry.kind, bytes.read(entry.offset, size).ok()?))
    }

    /// Whole, not negative numbers; `None` where the tag is absent, of another kind, or unreadable.
    pub fn unsigned_values(&self, bytes: &FileBytes, number: u16) -> Option<Vec<u64>> {
        let (kind, raw) = self.raw(bytes, number)?;
        if !matches!(kind, 1 | 3 | 4 | 7 | 13 | 16 | 18) {
            return None;
        }
        let size = size_of_kind(kind)? as usize;
        Some(raw.chunks_exact(size).map(|value| unsigned(value, self.big_endian)).collect())
    }

    /// The first of the whole numbers.
    pub fn unsigned_value(&self, bytes: &FileBytes, number: u16) -> Option<u64> {
        self.unsigned_values(bytes, number)?.first().copied()
    }

    /// Floating-point numbers (or whole ones as such).
    pub fn real_values(&self, bytes: &FileBytes, number: u16) -> Option<Vec<f64>> {
        let (kind, raw) = self.raw(bytes, number)?;
        match kind {
            12 => Some(
                raw.chunks_exact(8).map(|value| f64::from_bits(unsigned(value, self.big_endian))).collect(),
            ),
            11 => Some(
                raw.chunks_exact(4)
                    .map(|value| f64::from(f32::from_bits(unsigned(value, self.big_endian) as u32)))
                    .collect(),
            ),
            _ => {
                self.unsigned_values(bytes, number).map(|all| all.iter().map(|&value| value as f64).collect())
            }
        }
    }

    /// Text, without trailing zeros; bytes that are no UTF-8 are replaced.
    pub fn text(&self, bytes: &FileBytes, number: u16) -> Option<String> {
        let (kind, raw) = self.raw(bytes, number)?;
        matches!(kind, 1 | 2 | 7).then(|| String::from_utf8_lossy(&raw).trim_end_matches('\0').to_owned())
    }

    /// Bytes as they are.
    pub fn blob(&self, bytes: &FileBytes, number: u16) -> Option<Vec<u8>> {
        self.raw(bytes, number).map(|(_, raw)| raw)
    }
}
