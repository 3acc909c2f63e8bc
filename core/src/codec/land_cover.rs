//! Land-cover tiles: class codes of a quadtree of three levels, and on its middle one what decides
//! the trees.
//!
//! *Level 1* has one class per code, 0 for none. *Level 0*, one matrix level deeper, repeats each of
//! them on its four children. *Level 2*, one matrix level coarser, packs four neighbours into one
//! code, a quarter of its bits each, least significant first, x then y: [[1, 2], [0, 3]] is 201 in 8
//! bits. Codes are never filtered and never compressed lossily.
//!
//! The tile of level 1 carries the ground under its trees too: the elevation nodes of the scene's anchor level
//! that cover it, as integers on that level's lattice ([`crate::seeds::anchor`]).
//!
//! Layout: `TLLC`, version u8, level u8, step u8 (0, 1, 2), bits u8 (8, 16, 32), side u16, flags u8
//! (1 stands, 2 anchors, 4 anchors with voids), level of the anchors u8; then the codes in byte planes, lowest
//! first (one plane on steps 0 and 1, bits/8 on step 2), then closures and stand heights, a byte each; then of the
//! anchors: columns u16, rows u16, offset i32, planes u8, void bits where there are voids, and the residuals
//! of their heights over the offset in byte planes. Which nodes they are follows from the tile's address.

use super::elevation::VOID;
use super::{DecodeError, planes};

const MAGIC: [u8; 4] = *b"TLLC";
const VERSION: u8 = 2;
const HEADER: usize = 12;
const FLAG_STANDS: u8 = 1;
const FLAG_ANCHORS: u8 = 2;
const FLAG_VOIDS: u8 = 4;
const ANCHOR_HEADER: usize = 9;
const MAXIMUM_SIDE: usize = 2048;

/// Bits of a packed code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum CodeBits {
    /// 3 species.
    Eight = 8,
    /// 15 species.
    #[default]
    Sixteen = 16,
    /// 255 species.
    ThirtyTwo = 32,
}

/// A class that does not fit the codes of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("land-cover class {class} does not fit {bits}-bit codes, which hold classes up to {largest}")]
pub struct ClassOverflow {
    /// The class.
    pub class: u8,
    /// Bits of a code.
    pub bits: u8,
    /// The largest class that fits.
    pub largest: u8,
}

impl CodeBits {
    /// The code of a number of bits, `None` for one that there is not.
    pub fn new(bits: u8) -> Option<Self> {
        [Self::Eight, Self::Sixteen, Self::ThirtyTwo].into_iter().find(|&known| known as u8 == bits)
    }

    /// Sixteen bits, or more where the classes need it.
    pub fn for_classes(largest_class: u8) -> Self {
        if largest_class <= Self::Sixteen.largest_class() { Self::Sixteen } else { Self::ThirtyTwo }
    }

    /// The largest class that fits: 3, 15 or 255.
    pub fn largest_class(self) -> u8 {
        u8::MAX >> (8 - self.bits_of_class())
    }

    fn bits_of_class(self) -> u32 {
        self as u32 / 4
    }

    /// The class, or the error where it does not fit.
    pub fn check(self, class: u8) -> Result<u8, ClassOverflow> {
        let largest = self.largest_class();
        if class <= largest { Ok(class) } else { Err(ClassOverflow { class, bits: self as u8, largest }) }
    }

    /// The level-2 code of four level-1 neighbours, given as [[north-west, north-east],
    /// [south-west, south-east]].
    pub fn pack(self, classes: [[u8; 2]; 2]) -> Result<u32, ClassOverflow> {
        classes.as_flattened().iter().zip(0..).try_fold(0, |code, (&class, place)| {
            Ok(code | u32::from(self.check(class)?) << (place * self.bits_of_class()))
        })
    }

    /// The inverse of [`Self::pack`].
    pub fn unpack(self, code: u32) -> [[u8; 2]; 2] {
        let class = |place: u32| (code >> (place * self.bits_of_class())) as u8 & self.largest_class();
        [[class(0), class(1)], [class(2), class(3)]]
    }
}

/// Which level of the quadtree a tile is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Step {
    /// Classes of level 1, repeated.
    Repeated = 0,
    /// One class per code.
    Classes = 1,
    /// Four classes per code.
    Packed = 2,
}

/// A decoded (or not yet encoded) land-cover tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LandCoverTile {
    /// Matrix level.
    pub level: u8,
    /// Cells along a side.
    pub side: u32,
    /// Level of the quadtree.
    pub step: Step,
    /// Bits of a packed code.
    pub bits: CodeBits,
    /// side² codes, row-major from the north-west.
    pub codes: Vec<u32>,
    /// What decides the trees: on level 1.
    pub stands: Option<Stands>,
    /// What the trees stand on: on level 1.
    pub anchors: Option<AnchorNodes>,
}

/// Per cell: closure and height of what stands there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stands {
    /// Share of the ground under trees, 0 … 255.
    pub closures: Vec<u8>,
    /// Mean height of the trees in quarter metres, 0 for the species' own.
    pub heights: Vec<u8>,
}

/// Elevation nodes of the anchor level that cover a tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AnchorNodes {
    /// Matrix level of the nodes: gives the lattice.
    pub level: u8,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Heights in quanta, row-major from the north-west, [`VOID`] for no data.
    pub quanta: Vec<i32>,
}

impl AnchorNodes {
    fn encode(&self, out: &mut Vec<u8>) {
        let offset = self.quanta.iter().copied().filter(|&value| value != VOID).min().unwrap_or(0);
        let residuals = planes::residuals(&self.without_voids(offset), self.width.max(1) as usize);
        let count = planes::plane_count(&residuals);
        out.extend((self.width as u16).to_le_bytes());
        out.extend((self.height as u16).to_le_bytes());
        out.extend(offset.to_le_bytes());
        out.push(count);
        if self.quanta.contains(&VOID) {
            planes::write_bits(self.quanta.iter().map(|&value| value == VOID), out);
        }
        planes::write_planes(&residuals, count, out);
    }

    /// Heights over the offset; a void repeats the node before it, so that it costs nothing.
    fn without_voids(&self, offset: i32) -> Vec<i32> {
        let mut last = 0;
        let fill = |&value: &i32| {
            if value != VOID {
                last = value.wrapping_sub(offset);
            }
            last
        };
        self.quanta.iter().map(fill).collect()
    }

    fn decode(bytes: &[u8], level: u8, has_voids: bool) -> Result<Self, DecodeError> {
        let Some((header, rest)) = bytes.split_first_chunk::<ANCHOR_HEADER>() else {
            return Err(DecodeError::Length { expected: ANCHOR_HEADER, actual: bytes.len() });
        };
        let width = usize::from(u16::from_le_bytes([header[0], header[1]]));
        let height = usize::from(u16::from_le_bytes([header[2], header[3]]));
        let offset = i32::from_le_bytes([header[4], header[5], header[6], header[7]]);
        let count = header[8];
        if level > crate::tile::MAXIMUM_LEVEL || !(2..=MAXIMUM_SIDE).contains(&width.min(height)) {
            return Err(DecodeError::Header("anchors out of range"));
        }
        if width.max(height) > MAXIMUM_SIDE || !(1..=4).contains(&count) {
            return Err(DecodeError::Header("anchors out of range"));
        }
        let nodes = width * height;
        let void_bytes = if has_voids { nodes.div_ceil(8) } else { 0 };
        let expected = void_bytes + nodes * usize::from(count);
        if rest.len() != expected {
            return Err(DecodeError::Length { expected, actual: rest.len() });
        }
        let (voids, residuals) = rest.split_at(void_bytes);
        let mut quanta = planes::values(&planes::read_planes(residuals, count), width);
        for (index, value) in quanta.iter_mut().enumerate() {
            *value = if has_voids && planes::bit(voids, index) { VOID } else { value.wrapping_add(offset) };
        }
        Ok(Self { level, width: width as u32, height: height as u32, quanta })
    }
}

impl LandCoverTile {
    fn code_bytes(step: Step, bits: CodeBits) -> u8 {
        if step == Step::Packed { bits as u8 / 8 } else { 1 }
    }

    /// Packs the tile. Every class must fit, which [`CodeBits::check`] and [`CodeBits::pack`] see to.
    pub fn encode(&self) -> Vec<u8> {
        let code_bytes = Self::code_bytes(self.step, self.bits);
        let mut out = Vec::with_capacity(HEADER + self.codes.len() * (usize::from(code_bytes) + 2));
        out.extend(MAGIC);
        out.extend([VERSION, self.level, self.step as u8, self.bits as u8]);
        out.extend((self.side as u16).to_le_bytes());
        let mut flags = if self.stands.is_some() { FLAG_STANDS } else { 0 };
        if let Some(anchors) = &self.anchors {
            flags |= FLAG_ANCHORS | if anchors.quanta.contains(&VOID) { FLAG_VOIDS } else { 0 };
        }
        out.extend([flags, self.anchors.as_ref().map_or(0, |anchors| anchors.level)]);
        planes::write_planes(&self.codes, code_bytes, &mut out);
        if let Some(stands) = &self.stands {
            out.extend(&stands.closures);
            out.extend(&stands.heights);
        }
        if let Some(anchors) = &self.anchors {
            anchors.encode(&mut out);
        }
        out
    }

    /// Unpacks a tile; never panics, whatever the bytes, and allocates no more than the header's
    /// checked sizes.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let Some((header, rest)) = bytes.split_at_checked(HEADER) else {
            return Err(DecodeError::Length { expected: HEADER, actual: bytes.len() });
        };
        if header[..4] != MAGIC {
            return Err(DecodeError::Magic([header[0], header[1], header[2], header[3]]));
        }
        let (version, level, step, bits) = (header[4], header[5], header[6], header[7]);
        if version != VERSION {
            return Err(DecodeError::Version(version, VERSION));
        }
        if level > crate::tile::MAXIMUM_LEVEL {
            return Err(DecodeError::Header("level out of range"));
        }
        let step = match step {
            0 => Step::Repeated,
            1 => Step::Classes,
            2 => Step::Packed,
            _ => return Err(DecodeError::Header("level of the quadtree is not 0, 1 or 2")),
        };
        let bits = CodeBits::new(bits).ok_or(DecodeError::Header("bits of a code are not 8, 16 or 32"))?;
        let side = usize::from(u16::from_le_bytes([header[8], header[9]]));
        if side == 0 || side > MAXIMUM_SIDE {
            return Err(DecodeError::Header("side out of range"));
        }
        let has_stands = header[10] & FLAG_STANDS != 0;
        let cells = side * side;
        let code_bytes = Self::code_bytes(step, bits);
        let expected = HEADER + cells * (usize::from(code_bytes) + if has_stands { 2 } else { 0 });
        let has_anchors = header[10] & FLAG_ANCHORS != 0;
        if bytes.len() < expected || (bytes.len() > expected && !has_anchors) {
            return Err(DecodeError::Length { expected, actual: bytes.len() });
        }
        let (rest, anchors) = rest.split_at(expected - HEADER);
        let (codes, stands) = rest.split_at(cells * usize::from(code_bytes));
        let codes = planes::read_planes(codes, code_bytes);
        if step != Step::Packed && codes.iter().any(|&code| code > u32::from(bits.largest_class())) {
            return Err(DecodeError::Header("a class is larger than its codes hold"));
        }
        let stands = has_stands
            .then(|| Stands { closures: stands[..cells].to_vec(), heights: stands[cells..].to_vec() });
        let anchors = has_anchors
            .then(|| AnchorNodes::decode(anchors, header[11], header[10] & FLAG_VOIDS != 0))
            .transpose()?;
        Ok(Self { level, side: side as u32, step, bits, codes, stands, anchors })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_codes_of_the_design() {
        assert_eq!(CodeBits::Eight.pack([[1, 2], [0, 3]]), Ok(201));
        assert_eq!(CodeBits::Sixteen.pack([[1, 2], [15, 3]]), Ok(16_161));
        assert_eq!(CodeBits::ThirtyTwo.pack([[1, 2], [255, 3]]), Ok(67_043_841));
        assert_eq!(CodeBits::Eight.unpack(201), [[1, 2], [0, 3]]);
        assert_eq!(CodeBits::default(), CodeBits::Sixteen);
        assert_eq!(CodeBits::for_classes(15), CodeBits::Sixteen);
        assert_eq!(CodeBits::for_classes(16), CodeBits::ThirtyTwo);
    }

    #[test]
    fn a_class_that_does_not_fit_is_refused() {
        let refused = CodeBits::Eight.pack([[1, 2], [4, 3]]).unwrap_err();
        assert_eq!(refused, ClassOverflow { class: 4, bits: 8, largest: 3 });
        assert_eq!(
            refused.to_string(),
            "land-cover class 4 does not fit 8-bit codes, which hold classes up to 3"
        );
        assert!(CodeBits::Sixteen.pack([[0, 0], [0, 16]]).is_err());
        assert!(CodeBits::ThirtyTwo.pack([[255; 2]; 2]).is_ok());
    }

    fn bits() -> impl Strategy<Value = CodeBits> {
        prop_oneof![Just(CodeBits::Eight), Just(CodeBits::Sixteen), Just(CodeBits::ThirtyTwo)]
    }

    proptest! {
        #[test]
        fn four_classes_round_trip(bits in bits(), classes: [[u8; 2]; 2]) {
            match bits.pack(classes) {
                Ok(code) => prop_assert_eq!(bits.unpack(code), classes),
                Err(_) => prop_assert!(classes.as_flattened().iter().any(|&class| class > bits.largest_class())),
            }
        }

        #[test]
        fn tiles_round_trip(
            bits in bits(), step in 0..3, codes in proptest::collection::vec(any::<u32>(), 16), stands: bool,
            anchors in proptest::option::of(proptest::collection::vec(prop_oneof![Just(VOID), -9_000..600_000_i32], 15)),
        ) {
            let (step, mask) = match step {
                0 => (Step::Repeated, u32::from(bits.largest_class())),
                1 => (Step::Classes, u32::from(bits.largest_class())),
                _ => (Step::Packed, u32::MAX >> (32 - bits as u32)),
            };
            let tile = LandCoverTile {
                level: 12,
                side: 4,
                step,
                bits,
                codes: codes.iter().map(|code| code & mask).collect(),
                stands: stands.then(|| Stands { closures: vec![3; 16], heights: (0..16).collect() }),
                anchors: anchors.map(|quanta| AnchorNodes { level: 14, width: 5, height: 3, quanta }),
            };
            prop_assert_eq!(LandCoverTile::decode(&tile.encode()), Ok(tile.clone()));
            let bytes = tile.encode();
            let refused = matches!(LandCoverTile::decode(&bytes[..bytes.len() - 1]), Err(DecodeError::Length { .. }));
            prop_assert!(refused);
        }

        #[test]
        fn no_bytes_make_it_panic(mut bytes in proptest::collection::vec(any::<u8>(), 0..300), keep_header in any::<bool>()) {
            if keep_header && bytes.len() >= 10 {
                let step = bytes[6] % 3;
                bytes[..10].copy_from_slice(&[b'T', b'L', b'L', b'C', 2, 3, step, 16, 4, 0]);
            }
            let _ = LandCoverTile::decode(&bytes);
        }
    }
}
