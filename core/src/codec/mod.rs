//! Treeline's own tile formats: lossless, small after a general compressor, quick to decode in wasm.
//!
//! The formats themselves are not compressed: HTTP's Content-Encoding is (zstd, brotli, gzip), which
//! browsers undo natively, so that the page carries no decompressor. Integers are little-endian.

pub mod elevation;
pub mod land_cover;
mod planes;

/// Why bytes are not a tile.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// The first four bytes are not the format's.
    #[error("not a Treeline tile: it begins with {0:02x?}")]
    Magic([u8; 4]),
    /// A version that this program does not know.
    #[error("tile format version {0}: this program reads version {1}")]
    Version(u8, u8),
    /// Shorter or longer than its header says.
    #[error("tile of {actual} bytes where its header says {expected}")]
    Length {
        /// From the header.
        expected: usize,
        /// As received.
        actual: usize,
    },
    /// A field that no encoder writes.
    #[error("tile header: {0}")]
    Header(&'static str),
}
