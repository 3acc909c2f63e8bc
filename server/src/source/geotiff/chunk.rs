//! One strip or tile from its bytes in the file to samples.
//!
//! Decompression, prediction and byte order are the `tiff` crate's: each chunk is handed to it as a
//! TIFF of one strip, made in memory. So palettes, bands in planes, sparse tiles, alpha and masks,
//! which that crate refuses or reads in part, are decoded by the same code as plain heights, and
//! chunks decode on many threads without sharing a reader.

use super::layout::{Layout, MAXIMUM_CHUNK_BYTES, SampleKind, compression};
use std::io::{Cursor, ErrorKind, Read, Seek, SeekFrom};
use std::panic::AssertUnwindSafe;
use tiff::TiffError;
use tiff::decoder::{Decoder, DecodingResult, Limits};

const CUT_OFF: &str = "its data are cut off";

/// Decoded samples, row-major, interleaved by pixel.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the names say it")]
pub enum Samples {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Vec<u32>),
    I32(Vec<i32>),
    U64(Vec<u64>),
    I64(Vec<i64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
    /// A chunk that was never written: all nodata.
    Sparse,
}

impl Samples {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        match self {
            Self::U8(values) => values.len(),
            Self::I8(values) => values.len(),
            Self::U16(values) => 2 * values.len(),
            Self::I16(values) => 2 * values.len(),
            Self::U32(values) => 4 * values.len(),
            Self::I32(values) => 4 * values.len(),
            Self::F32(values) => 4 * values.len(),
            Self::U64(values) => 8 * values.len(),
            Self::I64(values) => 8 * values.len(),
            Self::F64(values) => 8 * values.len(),
            Self::Sparse => 64,
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::U8(values) => values.len(),
            Self::I8(values) => values.len(),
            Self::U16(values) => values.len(),
            Self::I16(values) => values.len(),
            Self::U32(values) => values.len(),
            Self::I32(values) => values.len(),
            Self::F32(values) => values.len(),
            Self::U64(values) => values.len(),
            Self::I64(values) => values.len(),
            Self::F64(values) => values.len(),
            Self::Sparse => 0,
        }
    }
}

/// Decodes a chunk of `rows` rows from its bytes.
///
/// # Errors
/// What is wrong with the bytes, in a few words.
pub fn decode(layout: &Layout, big_endian: bool, rows: u32, data: Vec<u8>) -> Result<Samples, String> {
    if layout.compression == compression::JPEG {
        check_jpeg(&data, layout, rows)?;
    }
    let expected = layout.chunk_width as usize * rows as usize * usize::from(layout.chunk_samples());
    let reader = OneStrip::new(layout, big_endian, rows, data)?;
    // The decoders below are other people's code on bytes that may be hostile; a panic in them is
    // this chunk's fault and nobody else's. Nothing that outlives the call is borrowed mutably.
    let result = std::panic::catch_unwind(AssertUnwindSafe(|| {
        let mut limits = Limits::default();
        limits.decoding_buffer_size = MAXIMUM_CHUNK_BYTES as usize;
        limits.intermediate_buffer_size = 2 * MAXIMUM_CHUNK_BYTES as usize;
        let mut decoder = Decoder::new(reader)?.with_limits(limits);
        decoder.read_image()
    }))
    .map_err(|_| "its data are damaged".to_owned())?
    .map_err(in_words)?;
    let samples = match result {
        DecodingResult::U8(values) if layout.bits < 8 => {
            Samples::U8(unpack(&values, layout.chunk_width, rows, layout.bits))
        }
        DecodingResult::U8(values) => Samples::U8(values),
        DecodingResult::I8(values) => Samples::I8(values),
        DecodingResult::U16(values) => Samples::U16(values),
        DecodingResult::I16(values) => Samples::I16(values),
        DecodingResult::U32(values) => Samples::U32(values),
        DecodingResult::I32(values) => Samples::I32(values),
        DecodingResult::U64(values) => Samples::U64(values),
        DecodingResult::I64(values) => Samples::I64(values),
        DecodingResult::F16(values) => Samples::F32(values.into_iter().map(|value| value.to_f32()).collect()),
        DecodingResult::F32(values) => Samples::F32(values),
        DecodingResult::F64(values) => Samples::F64(values),
    };
    if samples.len() < expected {
        return Err(CUT_OFF.to_owned());
    }
    Ok(samples)
}

/// What the decoder says; where it only ran out of bytes, in plainer words.
fn in_words(error: TiffError) -> String {
    match error {
        TiffError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => CUT_OFF.to_owned(),
        error => error.to_string(),
    }
}

/// Bits (1, 2 or 4 a sample, rows padded to bytes) to bytes.
fn unpack(packed: &[u8], width: u32, rows: u32, bits: u16) -> Vec<u8> {
    let stride = (width as usize * usize::from(bits)).div_ceil(8);
    let per_byte = 8 / usize::from(bits);
    let mask = (1_u8 << bits) - 1;
    let mut samples = Vec::with_capacity(width as usize * rows as usize);
    for row in packed.chunks_exact(stride).take(rows as usize) {
        for column in 0..width as usize {
            let shift = 8 - usize::from(bits) * (column % per_byte + 1);
            samples.push(row[column / per_byte] >> shift & mask);
        }
    }
    samples
}

/// Whether the JPEG's frame is as large as its chunk: a small file may claim 4 gigapixels, and a
/// narrower frame would shear the image.
fn check_jpeg(data: &[u8], layout: &Layout, rows: u32) -> Result<(), String> {
    let damaged = || "its JPEG data are damaged".to_owned();
    let mut at = 2;
    loop {
        let marker = data.get(at..at + 4).ok_or_else(damaged)?;
        if marker[0] != 0xff {
            return Err(damaged());
        }
        if marker[1] == 0xff {
            at += 1;
            continue;
        }
        let length = usize::from(u16::from_be_bytes([marker[2], marker[3]]));
        if matches!(marker[1], 0xc0..=0xcf) && !matches!(marker[1], 0xc4 | 0xc8 | 0xcc) {
            let frame = data.get(at + 4..at + 10).ok_or_else(damaged)?;
            let height = u32::from(u16::from_be_bytes([frame[1], frame[2]]));
            let width = u32::from(u16::from_be_bytes([frame[3], frame[4]]));
            let fits = width == layout.chunk_width
                && (rows..=layout.chunk_height).contains(&height)
                && u16::from(frame[5]) == layout.chunk_samples()
                && frame[0] == 8;
            return if fits { Ok(()) } else { Err("its JPEG frame is not of its tile's size".to_owned()) };
        }
        at += 2 + length.max(2);
    }
}

/// A TIFF of one strip: a header of ours, then the chunk's bytes, without copying them.
struct OneStrip {
    header: Cursor<Vec<u8>>,
    data: Cursor<Vec<u8>>,
}

impl OneStrip {
    fn new(layout: &Layout, big_endian: bool, rows: u32, data: Vec<u8>) -> Result<Self, String> {
        let kind = match layout.kind {
            SampleKind::Unsigned => 1,
            SampleKind::Signed => 2,
            SampleKind::Float => 3,
        };
        let tables = layout.jpeg_tables.as_deref().unwrap_or_default();
        let count = if tables.is_empty() { 12 } else { 13 };
        let directory_end = 8 + 2 + 12 * count + 4;
        let data_start = directory_end + tables.len() as u32;
        let length = u32::try_from(data.len()).map_err(|_| "it is too long".to_owned())?;
        let mut header = Vec::with_capacity(data_start as usize);
        let short = |value: u16| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
        let long = |value: u32| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
        header.extend_from_slice(if big_endian { b"MM" } else { b"II" });
        header.extend_from_slice(&short(42));
        header.extend_from_slice(&long(8));
        header.extend_from_slice(&short(count as u16));
        let mut entry = |number: u16, value: u32| {
            header.extend_from_slice(&short(number));
            header.extend_from_slice(&short(4));
            header.extend_from_slice(&long(1));
            header.extend_from_slice(&long(value));
        };
        entry(256, layout.chunk_width);
        entry(257, rows);
        entry(258, u32::from(layout.bits));
        entry(259, u32::from(layout.compression));
        // Several samples of black-is-zero are plain bands to the decoder, whatever they mean to us.
        entry(262, 1);
        entry(273, data_start);
        entry(277, u32::from(layout.chunk_samples()));
        entry(278, rows);
        entry(279, length);
        entry(284, 1);
        entry(317, u32::from(layout.predictor));
        entry(339, kind);
        if !tables.is_empty() {
            header.extend_from_slice(&short(347));
            header.extend_from_slice(&short(7));
            header.extend_from_slice(&long(tables.len() as u32));
            header.extend_from_slice(&long(directory_end));
        }
        header.extend_from_slice(&long(0));
        header.extend_from_slice(tables);
        Ok(Self { header: Cursor::new(header), data: Cursor::new(data) })
    }

    fn header_length(&self) -> u64 {
        self.header.get_ref().len() as u64
    }
}

impl Read for OneStrip {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.header.position() < self.header_length() {
            return self.header.read(buffer);
        }
        self.data.read(buffer)
    }
}

impl Seek for OneStrip {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        let header = self.header_length();
        let position = match to {
            SeekFrom::Start(position) => position,
            SeekFrom::Current(by) => {
                let now = if self.header.position() < header {
                    self.header.position()
                } else {
                    header + self.data.position()
                };
                now.checked_add_signed(by).ok_or(ErrorKind::InvalidInput)?
            }
            SeekFrom::End(by) => (header + self.data.get_ref().len() as u64)
                .checked_add_signed(by)
                .ok_or(ErrorKind::InvalidInput)?,
        };
        self.header.set_position(position.min(header));
        self.data.set_position(position.saturating_sub(header));
        Ok(position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_unpack_by_row() {
        assert_eq!(unpack(&[0b1010_0000, 0b0110_0000], 3, 2, 1), [1, 0, 1, 0, 1, 1]);
        assert_eq!(unpack(&[0x12, 0x30], 3, 1, 4), [1, 2, 3]);
        assert_eq!(unpack(&[0b0001_1011], 4, 1, 2), [0, 1, 2, 3]);
    }
}
