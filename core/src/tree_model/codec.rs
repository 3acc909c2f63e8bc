//! Packed tree models: `GET /trees/{code}`.
//!
//! Layout, little-endian: `TLTM`, version u8, code u8, levels u8, zero byte, atlas side u16, regions
//! u16; crown radius f32; per level ε f32, variants u16, quads of a variant u16; the corners of all levels,
//! variants and quads ([`PackedCorner`]) in 16 byte planes; the regions (x, y, width, height u16);
//! alpha of the atlas's first mip, then red, green and blue of its texels with alpha, each less its
//! predecessor's. Mips and the colours under no coverage are derived ([`Atlas::new`]).

use super::atlas::{Atlas, Region};
use super::quad::{PackedCorner, Quad};
use super::{TreeLevel, TreeSpecies};
use crate::codec::DecodeError;

/// Media type of an encoded species.
pub const MEDIA_TYPE: &str = "application/vnd.treeline.trees";

const MAGIC: [u8; 4] = *b"TLTM";
const VERSION: u8 = 1;
const HEADER: usize = 16;
const LEVEL_BYTES: usize = 8;
const CORNER_BYTES: usize = 16;
const REGION_BYTES: usize = 8;
const MAXIMUM_LEVELS: u8 = 8;
const MAXIMUM_VARIANTS: u16 = 64;

impl TreeSpecies {
    /// Packs the species. Levels, variants, quads and regions beyond what the header counts (8, 64,
    /// 65,535, 65,535) are never grown.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER + self.atlas.mips[0].len());
        out.extend(MAGIC);
        out.extend([VERSION, self.code, self.levels.len() as u8, 0]);
        out.extend((self.atlas.side as u16).to_le_bytes());
        out.extend((self.atlas.regions.len() as u16).to_le_bytes());
        out.extend(self.crown_radius.to_le_bytes());
        for level in &self.levels {
            out.extend(level.epsilon.to_le_bytes());
            out.extend((level.variants.len() as u16).to_le_bytes());
            out.extend((level.quads() as u16).to_le_bytes());
        }
        let corners: Vec<[u8; CORNER_BYTES]> = self
            .levels
            .iter()
            .flat_map(|level| level.variants.iter().flatten())
            .flat_map(|quad| quad.corners)
            .map(|corner| {
                let mut bytes = [0; CORNER_BYTES];
                for (four, word) in
                    bytes.as_chunks_mut::<4>().0.iter_mut().zip(PackedCorner::from(corner).words)
                {
                    *four = word.to_le_bytes();
                }
                bytes
            })
            .collect();
        for plane in 0..CORNER_BYTES {
            out.extend(corners.iter().map(|bytes| bytes[plane]));
        }
        for region in &self.atlas.regions {
            out.extend(
                [region.x, region.y, region.width, region.height].map(u16::to_le_bytes).as_flattened(),
            );
        }
        let texels = self.atlas.mips[0].as_chunks::<4>().0;
        out.extend(texels.iter().map(|texel| texel[3]));
        for channel in 0..3 {
            let mut last = 0_u8;
            for texel in texels.iter().filter(|texel| texel[3] > 0) {
                out.push(texel[channel].wrapping_sub(last));
                last = texel[channel];
            }
        }
        out
    }

    /// Unpacks a species; never panics, whatever the bytes, and allocates no more than a few times
    /// their number.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let Some((header, rest)) = bytes.split_at_checked(HEADER) else {
            return Err(DecodeError::Length { expected: HEADER, actual: bytes.len() });
        };
        if header[..4] != MAGIC {
            return Err(DecodeError::Magic([header[0], header[1], header[2], header[3]]));
        }
        let [_, _, _, _, version, code, level_count, _, ..] = *header else {
            return Err(DecodeError::Header("cut short"));
        };
        if version != VERSION {
            return Err(DecodeError::Version(version, VERSION));
        }
        if level_count == 0 || level_count > MAXIMUM_LEVELS {
            return Err(DecodeError::Header("number of levels out of range"));
        }
        let side = u32::from(u16_at(header, 8));
        if !side.is_power_of_two() || side > Atlas::MAXIMUM_SIDE {
            return Err(DecodeError::Header("side of the atlas is no power of two up to 4096"));
        }
        let crown_radius = f32_at(header, 12);
        if !(0.0..=1.0).contains(&crown_radius) {
            return Err(DecodeError::Header("crown radius out of range"));
        }
        let region_count = usize::from(u16_at(header, 10));
        let level_bytes = usize::from(level_count) * LEVEL_BYTES;
        let too_short = |expected: usize| DecodeError::Length { expected, actual: bytes.len() };
        let (level_rows, rest) =
            rest.split_at_checked(level_bytes).ok_or_else(|| too_short(HEADER + level_bytes))?;
        let mut corner_count = 0_usize;
        for row in level_rows.chunks_exact(LEVEL_BYTES) {
            if !(0.0..=2.0).contains(&f32_at(row, 0)) {
                return Err(DecodeError::Header("a level's displacement is out of range"));
            }
            let variants = u16_at(row, 4);
            if variants == 0 || variants > MAXIMUM_VARIANTS {
                return Err(DecodeError::Header("number of variants out of range"));
            }
            corner_count += usize::from(variants) * usize::from(u16_at(row, 6)) * 4;
        }
        let texels = (side * side) as usize;
        let fixed = corner_count * CORNER_BYTES + region_count * REGION_BYTES + texels;
        let (fixed, colours) =
            rest.split_at_checked(fixed).ok_or_else(|| too_short(HEADER + level_bytes + fixed))?;
        let (corners, fixed) = fixed.split_at(corner_count * CORNER_BYTES);
        let (regions, alphas) = fixed.split_at(region_count * REGION_BYTES);
        let covered = alphas.iter().filter(|&&alpha| alpha > 0).count();
        if colours.len() != 3 * covered {
            return Err(too_short(bytes.len() - colours.len() + 3 * covered));
        }
        let regions = regions
            .chunks_exact(REGION_BYTES)
            .map(|row| {
                let [x, y, width, height] = [0, 2, 4, 6].map(|place| u16_at(row, place));
                let fits = |start: u16, length: u16| u32::from(start) + u32::from(length) <= side;
                (fits(x, width) && fits(y, height))
                    .then_some(Region { x, y, width, height })
                    .ok_or(DecodeError::Header("a picture reaches beyond the atlas"))
            })
            .collect::<Result<_, _>>()?;
        Ok(Self {
            code,
            crown_radius,
            levels: read_levels(level_rows, corners, corner_count),
            atlas: Atlas::new(side, read_texels(alphas, colours, covered), regions),
        })
    }
}

fn read_levels(rows: &[u8], corners: &[u8], corner_count: usize) -> Vec<TreeLevel> {
    let mut next = 0;
    let mut corner = || {
        let byte = |plane: usize| u32::from(corners[plane * corner_count + next]);
        let word = |index: usize| {
            let plane = 4 * index;
            byte(plane) | byte(plane + 1) << 8 | byte(plane + 2) << 16 | byte(plane + 3) << 24
        };
        let packed = PackedCorner { words: [word(0), word(1), word(2), word(3)] };
        next += 1;
        packed.into()
    };
    rows.chunks_exact(LEVEL_BYTES)
        .map(|row| {
            let (variants, quads) = (u16_at(row, 4), u16_at(row, 6));
            let mut quad = || Quad { corners: [corner(), corner(), corner(), corner()] };
            let variants = (0..variants).map(|_| (0..quads).map(|_| quad()).collect()).collect();
            TreeLevel { variants, epsilon: f32_at(row, 0) }
        })
        .collect()
}

fn read_texels(alphas: &[u8], colours: &[u8], covered: usize) -> Vec<u8> {
    let mut rgba = vec![0; alphas.len() * 4];
    let texels = rgba.as_chunks_mut::<4>().0;
    for (texel, &alpha) in texels.iter_mut().zip(alphas) {
        texel[3] = alpha;
    }
    for channel in 0..3 {
        let mut last = 0_u8;
        let deltas = &colours[channel * covered..(channel + 1) * covered];
        for (texel, &delta) in texels.iter_mut().filter(|texel| texel[3] > 0).zip(deltas) {
            last = last.wrapping_add(delta);
            texel[channel] = last;
        }
    }
    rgba
}

fn u16_at(bytes: &[u8], place: usize) -> u16 {
    u16::from_le_bytes([bytes[place], bytes[place + 1]])
}

fn f32_at(bytes: &[u8], place: usize) -> f32 {
    f32::from_le_bytes([bytes[place], bytes[place + 1], bytes[place + 2], bytes[place + 3]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_model::quad::Corner;
    use proptest::prelude::*;

    fn quad() -> impl Strategy<Value = Quad> {
        let corner = any::<[u32; 4]>().prop_map(|mut words| {
            words[3] &= 0x00ff_ffff;
            // What no encoder writes: the second code of −1.
            let corner = Corner::from(PackedCorner { words });
            Corner::from(PackedCorner::from(corner))
        });
        proptest::array::uniform4(corner).prop_map(|corners| Quad { corners })
    }

    fn species() -> impl Strategy<Value = TreeSpecies> {
        let level = (0.0..2.0_f32, 1..4_usize, 0..5_usize).prop_flat_map(|(epsilon, variants, quads)| {
            let variant = proptest::collection::vec(quad(), quads);
            proptest::collection::vec(variant, variants)
                .prop_map(move |variants| TreeLevel { variants, epsilon })
        });
        let texels = proptest::collection::vec(any::<u8>(), 32 * 32 * 4);
        let levels = proptest::collection::vec(level, 1..5);
        (any::<u8>(), 0.0..1.0_f32, levels, texels, 0..20_u16).prop_map(
            |(code, crown_radius, levels, texels, x)| {
                let regions = vec![Region { x, y: 4, width: 12, height: 28 }];
                TreeSpecies { code, crown_radius, levels, atlas: Atlas::new(32, texels, regions) }
            },
        )
    }

    proptest! {
        #[test]
        fn species_round_trip(species in species(), cut in 0.0..1.0_f64) {
            let bytes = species.encode();
            prop_assert_eq!(TreeSpecies::decode(&bytes), Ok(species));
            let cut = (bytes.len() as f64 * cut) as usize;
            prop_assert!(TreeSpecies::decode(&bytes[..cut]).is_err());
            let mut longer = bytes;
            longer.push(0);
            let refused = matches!(TreeSpecies::decode(&longer), Err(DecodeError::Length { .. }));
            prop_assert!(refused);
        }

        #[test]
        fn no_bytes_make_it_panic(species in species(), changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
            let mut bytes = species.encode();
            let header = bytes.len().min(64);
            for (place, value) in changes {
                bytes[place.index(header)] = value;
            }
            if let Ok(species) = TreeSpecies::decode(&bytes) {
                prop_assert_eq!(TreeSpecies::decode(&species.encode()), Ok(species));
            }
        }

        #[test]
        fn noise_is_refused(mut bytes in proptest::collection::vec(any::<u8>(), 0..300), keep in any::<bool>()) {
            if keep && bytes.len() >= 12 {
                bytes[..12].copy_from_slice(&[b'T', b'L', b'T', b'M', 1, 3, 2, 0, 16, 0, 1, 0]);
            }
            let _ = TreeSpecies::decode(&bytes);
        }
    }

    #[test]
    fn a_header_that_promises_too_much_allocates_nothing() {
        let mut bytes = b"TLTM".to_vec();
        bytes.extend([VERSION, 1, 8, 0]);
        bytes.extend(4096_u16.to_le_bytes());
        bytes.extend(u16::MAX.to_le_bytes());
        bytes.extend(0.1_f32.to_le_bytes());
        for _ in 0..8 {
            bytes.extend(0.0_f32.to_le_bytes());
            bytes.extend(MAXIMUM_VARIANTS.to_le_bytes());
            bytes.extend(u16::MAX.to_le_bytes());
        }
        assert!(matches!(TreeSpecies::decode(&bytes), Err(DecodeError::Length { .. })));
    }
}
