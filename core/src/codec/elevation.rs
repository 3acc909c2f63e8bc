//! Elevation tiles: heights on a lattice, conservative maxima, and for the combined map the surface
//! type and the canopy's height.
//!
//! Layout: `TLEV`, version u8, level u8, quantum exponent i8, flags u8 (1 voids, 2 surface and
//! canopy), side u16, maxima side u16, offset i32, planes of heights u8, planes of maxima u8,
//! 2 zero bytes; then void bits, heights, maxima' void bits, maxima, surface types, canopy heights, and where
//! flags have 4 the species of the canopy.

use super::{DecodeError, planes};

const MAGIC: [u8; 4] = *b"TLEV";
const VERSION: u8 = 1;
const HEADER: usize = 20;
const FLAG_VOIDS: u8 = 1;
const FLAG_SURFACE: u8 = 2;
const FLAG_SPECIES: u8 = 4;
/// Tiles have 513 nodes and a border; nothing a server of ours sends is larger than this.
const MAXIMUM_SIDE: usize = 2048;

/// A lattice value that stands for "no data".
pub const VOID: i32 = i32::MIN;

/// Unit of canopy heights on the wire, metres: a byte reaches 63.75 m at half this error.
pub const CANOPY_QUANTUM_METRES: f32 = 0.25;

/// The conservative maxima stand for blocks of this many cells a side: 64 × 64 blocks a tile.
pub const MAXIMA_BLOCK_CELLS: u32 = 8;

/// Exponent of the height lattice of a level: its quantum is 2^exponent metres.
///
/// 1/8 m down to cells of 9.6 m, then about a 64th of the cell, so that quantised slopes stay
/// within 1 %; 1/128 m at the deepest.
pub fn quantum_exponent(level: u8) -> i8 {
    match level {
        0..=12 => -3,
        13 => -4,
        14 => -5,
        15 | 16 => -6,
        _ => -7,
    }
}

/// Quantum of the height lattice of a level, metres.
pub fn quantum_metres(level: u8) -> f64 {
    f64::from(quantum_exponent(level)).exp2()
}

/// A height in metres on the lattice of a level: nearest, ties away from zero; not finite: [`VOID`].
pub fn lattice_from_metres(metres: f64, level: u8) -> i32 {
    if metres.is_finite() { (metres / quantum_metres(level)).round() as i32 } else { VOID }
}

/// The same, rounded up: for conservative maxima.
pub fn lattice_above_metres(metres: f64, level: u8) -> i32 {
    if metres.is_finite() { (metres / quantum_metres(level)).ceil() as i32 } else { VOID }
}

/// A decoded (or not yet encoded) elevation tile.
#[derive(Clone, Debug, PartialEq)]
pub struct ElevationTile {
    /// Matrix level: gives the lattice.
    pub level: u8,
    /// Nodes along a side, border included.
    pub side: u32,
    /// side × side heights in quanta, row-major from the north-west, [`VOID`] for no data.
    pub heights: Vec<i32>,
    /// Blocks along a side (a tile of 512 cells: 64).
    pub maxima_side: u32,
    /// maxima_side² bounds in quanta of everything below the block, on every deeper level, canopy
    /// included; [`VOID`] where there is nothing at all.
    pub maxima: Vec<i32>,
    /// Per node: [`crate::layer::SurfaceType`] code and canopy height in [`CANOPY_QUANTUM_METRES`];
    /// absent for bare terrain.
    pub surface: Option<Surface>,
}

/// What only the combined elevation map carries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Surface {
    /// side² surface type codes.
    pub types: Vec<u8>,
    /// side² canopy heights in quanta: combined elevation minus terrain, rounded to nearest.
    pub canopy: Vec<u8>,
    /// side² codes of the species whose canopy it is, 0 where there is none; absent where nothing grows.
    pub species: Option<Vec<u8>>,
}

impl ElevationTile {
    /// Height of a node in metres, NaN for no data.
    pub fn metres(&self, column: u32, row: u32) -> f64 {
        metres(self.heights[(row * self.side + column) as usize], self.level)
    }

    /// Packs the tile.
    pub fn encode(&self) -> Vec<u8> {
        let side = self.side as usize;
        let has_voids = self.heights.contains(&VOID);
        let offset = self.heights.iter().copied().filter(|&value| value != VOID).min().unwrap_or(0);
        let heights = planes::residuals(&without_voids(&self.heights, side, offset), side);
        let maxima = planes::residuals(
            &without_voids(&self.maxima, self.maxima_side.max(1) as usize, offset),
            self.maxima_side.max(1) as usize,
        );
        let height_planes = planes::plane_count(&heights);
        let maxima_planes = planes::plane_count(&maxima);
        let species = self.surface.as_ref().and_then(|surface| surface.species.as_ref());
        let flags = if has_voids { FLAG_VOIDS } else { 0 }
            | if self.surface.is_some() { FLAG_SURFACE } else { 0 }
            | if species.is_some() { FLAG_SPECIES } else { 0 };
        let mut out = Vec::with_capacity(HEADER + 5 * heights.len());
        out.extend(MAGIC);
        out.extend([VERSION, self.level, quantum_exponent(self.level) as u8, flags]);
        out.extend((self.side as u16).to_le_bytes());
        out.extend((self.maxima_side as u16).to_le_bytes());
        out.extend(offset.to_le_bytes());
        out.extend([height_planes, maxima_planes, 0, 0]);
        debug_assert_eq!(out.len(), HEADER);
        if has_voids {
            planes::write_bits(self.heights.iter().map(|&value| value == VOID), &mut out);
        }
        planes::write_planes(&heights, height_planes, &mut out);
        planes::write_bits(self.maxima.iter().map(|&value| value == VOID), &mut out);
        planes::write_planes(&maxima, maxima_planes, &mut out);
        if let Some(surface) = &self.surface {
            out.extend(&surface.types);
            out.extend(&surface.canopy);
            out.extend(surface.species.iter().flatten());
        }
        out
    }

    /// Unpacks a tile; never panics, whatever the bytes, and allocates no more than the header's
    /// checked sizes.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let Some((header, mut rest)) = bytes.split_at_checked(HEADER) else {
            return Err(DecodeError::Length { expected: HEADER, actual: bytes.len() });
        };
        if header[..4] != MAGIC {
            return Err(DecodeError::Magic([header[0], header[1], header[2], header[3]]));
        }
        let (version, level, exponent, flags) = (header[4], header[5], header[6] as i8, header[7]);
        if version != VERSION {
            return Err(DecodeError::Version(version, VERSION));
        }
        if level > crate::tile::MAXIMUM_LEVEL || exponent != quantum_exponent(level) {
            return Err(DecodeError::Header("level and quantum do not belong together"));
        }
        let side = usize::from(u16::from_le_bytes([header[8], header[9]]));
        let maxima_side = usize::from(u16::from_le_bytes([header[10], header[11]]));
        let offset = i32::from_le_bytes([header[12], header[13], header[14], header[15]]);
        let (height_planes, maxima_planes) = (header[16], header[17]);
        if side == 0 || side > MAXIMUM_SIDE || maxima_side > MAXIMUM_SIDE {
            return Err(DecodeError::Header("side out of range"));
        }
        if !(1..=4).contains(&height_planes) || !(1..=4).contains(&maxima_planes) {
            return Err(DecodeError::Header("number of byte planes out of range"));
        }
        let (nodes, blocks) = (side * side, maxima_side * maxima_side);
        let void_bytes = if flags & FLAG_VOIDS != 0 { nodes.div_ceil(8) } else { 0 };
        let has_species = flags & FLAG_SPECIES != 0;
        let surface_planes = if flags & FLAG_SURFACE != 0 { 2 + usize::from(has_species) } else { 0 };
        let lengths = [
            void_bytes,
            nodes * usize::from(height_planes),
            blocks.div_ceil(8),
            blocks * usize::from(maxima_planes),
            surface_planes * nodes,
        ];
        let expected = HEADER + lengths.iter().sum::<usize>();
        if bytes.len() != expected {
            return Err(DecodeError::Length { expected, actual: bytes.len() });
        }
        let mut take = |length: usize| {
            let (part, left) = rest.split_at(length);
            rest = left;
            part
        };
        let (voids, heights, maxima_voids, maxima, surface) =
            (take(lengths[0]), take(lengths[1]), take(lengths[2]), take(lengths[3]), take(lengths[4]));
        let mut heights = planes::values(&planes::read_planes(heights, height_planes), side);
        for (index, value) in heights.iter_mut().enumerate() {
            let void = void_bytes > 0 && planes::bit(voids, index);
            *value = if void { VOID } else { value.wrapping_add(offset) };
        }
        let mut maxima = planes::values(&planes::read_planes(maxima, maxima_planes), maxima_side.max(1));
        for (index, value) in maxima.iter_mut().enumerate() {
            *value = if planes::bit(maxima_voids, index) { VOID } else { value.wrapping_add(offset) };
        }
        let surface = (flags & FLAG_SURFACE != 0).then(|| Surface {
            types: surface[..nodes].to_vec(),
            canopy: surface[nodes..2 * nodes].to_vec(),
            species: has_species.then(|| surface[2 * nodes..].to_vec()),
        });
        Ok(Self { level, side: side as u32, heights, maxima_side: maxima_side as u32, maxima, surface })
    }
}

/// A lattice value in metres, NaN for [`VOID`].
pub fn metres(value: i32, level: u8) -> f64 {
    if value == VOID { f64::NAN } else { f64::from(value) * quantum_metres(level) }
}

/// Values less the offset, voids replaced by what the predictor expects there (their left or upper
/// neighbour), so that they cost nothing.
fn without_voids(values: &[i32], width: usize, offset: i32) -> Vec<i32> {
    let mut filled: Vec<i32> = Vec::with_capacity(values.len());
    for (index, &value) in values.iter().enumerate() {
        let value = if value != VOID {
            value.wrapping_sub(offset)
        } else if index % width > 0 {
            filled[index - 1]
        } else if index >= width {
            filled[index - width]
        } else {
            0
        };
        filled.push(value);
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tile(level: u8, side: u32, heights: Vec<i32>) -> ElevationTile {
        let nodes = (side * side) as usize;
        ElevationTile {
            level,
            side,
            heights,
            maxima_side: 2,
            maxima: vec![5, VOID, -7, 1 << 20],
            surface: level.is_multiple_of(2).then(|| Surface {
                types: (0..nodes).map(|i| (i % 6) as u8).collect(),
                canopy: vec![7; nodes],
                species: level.is_multiple_of(4).then(|| vec![3; nodes]),
            }),
        }
    }

    proptest! {
        #[test]
        fn round_trip(level in 0_u8..=20, heights in proptest::collection::vec(prop_oneof![4 => -90_000_i32..70_000, 1 => Just(VOID), 1 => any::<i32>()], 25)) {
            let tile = tile(level, 5, heights);
            prop_assert_eq!(ElevationTile::decode(&tile.encode()), Ok(tile));
        }

        #[test]
        fn no_bytes_make_it_panic(mut bytes in proptest::collection::vec(any::<u8>(), 0..400), keep_header in any::<bool>()) {
            if keep_header && bytes.len() >= 8 {
                let flags = bytes[7];
                bytes[..8].copy_from_slice(&[b'T', b'L', b'E', b'V', 1, 3, (-3_i8) as u8, flags]);
            }
            let _ = ElevationTile::decode(&bytes);
        }

        #[test]
        fn truncated_tiles_are_refused(cut in 1_usize..100) {
            let bytes = tile(4, 5, (0..25).collect()).encode();
            let cut = cut.min(bytes.len());
            let refused = matches!(ElevationTile::decode(&bytes[..bytes.len() - cut]), Err(DecodeError::Length { .. }));
            prop_assert!(refused);
        }
    }

    #[test]
    fn heights_of_the_whole_earth_fit_and_are_within_half_a_quantum() {
        for level in 0..=20 {
            for metres in [-11_000.0, -0.01, 0.0, 432.1, 8_848.86] {
                let value = lattice_from_metres(metres, level);
                assert!((self::metres(value, level) - metres).abs() <= quantum_metres(level) / 2.0);
                assert!(self::metres(lattice_above_metres(metres, level), level) >= metres);
                // Exact as f32 too: the GPU sees the same number.
                assert!(value.abs() < 1 << 24);
            }
        }
        assert_eq!(lattice_from_metres(f64::NAN, 3), VOID);
        assert_eq!(lattice_from_metres(f64::INFINITY, 3), VOID);
    }
}
