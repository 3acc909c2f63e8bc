//! Compressed photo blocks against decoders written from the formats' definitions: what is in the bits is
//! what the encoder meant, for any texels.

use proptest::prelude::*;
use treeline_shaders::twin::compress_photo_astc::Astc;
use treeline_shaders::twin::compress_photo_bc7::Bc7;
use treeline_shaders::twin::photo_block::{Texels, block, tile};

/// So many bits of a block from one on.
fn field(block: u128, first: u32, count: u32) -> u32 {
    ((block >> first) & ((1 << count) - 1)) as u32
}

fn whole(words: [u32; 4]) -> u128 {
    words.iter().rev().fold(0, |bits, &word| (bits << 32) | u128::from(word))
}

fn mixed(ends: [[u32; 4]; 2], weight: u32) -> [u8; 4] {
    std::array::from_fn(|channel| {
        ((ends[0][channel] * (64 - weight) + ends[1][channel] * weight + 32) / 64) as u8
    })
}

/// BC7: only blocks of mode 6 are known here.
fn decoded_bc7(words: [u32; 4]) -> [[u8; 4]; 16] {
    const WEIGHTS: [u32; 16] = [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64];
    let bits = whole(words);
    assert_eq!(bits.trailing_zeros(), 6, "the block's mode");
    let ends = [0, 1].map(|end| {
        std::array::from_fn(|channel| {
            2 * field(bits, 7 + 14 * channel as u32 + 7 * end, 7) + field(bits, 63 + end, 1)
        })
    });
    let mut at = 65;
    std::array::from_fn(|texel| {
        let count = if texel == 0 { 3 } else { 4 };
        let index = field(bits, at, count);
        at += count;
        mixed(ends, WEIGHTS[index as usize])
    })
}

/// The five trits in eight bits, by the format's table of cases.
fn trits(packed: u32) -> [u32; 5] {
    let bit = |place: u32| (packed >> place) & 1;
    let (low, t3, t4) = if packed & 0b11100 == 0b11100 {
        (((packed >> 5) << 2) | (packed & 3), 2, 2)
    } else if packed & 0b110_0000 == 0b110_0000 {
        (packed & 31, bit(7), 2)
    } else {
        (packed & 31, (packed >> 5) & 3, bit(7))
    };
    let (c, d) = (|place: u32| (low >> place) & 1, |place: u32| 1 - ((low >> place) & 1));
    if low & 3 == 3 {
        [(c(3) << 1) | (c(2) & d(3)), c(4), 2, t3, t4]
    } else if low & 12 == 12 {
        [low & 3, 2, 2, t3, t4]
    } else {
        [(c(1) << 1) | (c(0) & d(1)), (low >> 2) & 3, c(4), t3, t4]
    }
}

/// A colour value stored as six bits and a trit.
fn unquantised_192(bits: u32, trit: u32) -> u32 {
    let spread = if bits & 1 == 1 { 0x1ff } else { 0 };
    let (f, fedcb) = (bits >> 5, bits >> 1);
    let value = (trit * 5 + ((fedcb << 4) | f)) ^ spread;
    (spread & 0x80) | (value >> 2)
}

/// ASTC: only 4 × 4 blocks of one partition, with 8 or 16 weights and direct colours, are known here.
fn decoded_astc(words: [u32; 4]) -> [[u8; 4]; 16] {
    let bits = whole(words);
    assert_eq!(field(bits, 11, 2), 0, "one partition");
    let (weight_bits, values) = match (field(bits, 0, 11), field(bits, 13, 4)) {
        (0x242, 8) => (4, 6),
        (0x053, 12) => (3, 8),
        other => panic!("block mode and end points {other:x?}"),
    };
    let mut colours = [255; 8];
    let mut at = 17;
    for group in (0..values).step_by(5) {
        let (mut low, mut packed, mut read) = ([0; 5], 0, 0);
        for place in 0..(values - group).min(5) {
            low[place] = field(bits, at, 6);
            let count = [2, 2, 1, 2, 1][place];
            packed |= field(bits, at + 6, count) << read;
            read += count;
            at += 6 + count;
        }
        let trits = trits(packed);
        for place in 0..(values - group).min(5) {
            colours[group + place] = unquantised_192(low[place], trits[place]);
        }
    }
    assert!(at <= 128 - 16 * weight_bits, "colours and weights overlap");
    let ends = [0, 1].map(|end| std::array::from_fn(|channel| colours[2 * channel + end]));
    let brightness = |end: [u32; 4]| end[..3].iter().sum::<u32>();
    assert!(brightness(ends[1]) >= brightness(ends[0]), "the ends would be read as contracted to blue");
    let turned = bits.reverse_bits();
    std::array::from_fn(|texel| {
        let weight = field(turned, texel as u32 * weight_bits, weight_bits);
        let weight = if weight_bits == 4 { weight * 4 + weight / 4 } else { weight * 9 };
        mixed(ends, if weight > 32 { weight + 1 } else { weight })
    })
}

fn error(texels: &Texels, decoded: &[[u8; 4]; 16]) -> f64 {
    let squares = texels.iter().zip(decoded).flat_map(|(texel, found)| {
        (0..4).map(move |channel| f64::from(texel[channel] - i32::from(found[channel])).powi(2))
    });
    squares.sum::<f64>() / 64.0
}

/// Both formats' mean square errors of a block.
fn errors(texels: &Texels) -> [f64; 2] {
    [error(texels, &decoded_bc7(block::<Bc7>(texels))), error(texels, &decoded_astc(block::<Astc>(texels)))]
}

fn texels_of(bytes: &[u8]) -> Texels {
    std::array::from_fn(|texel| {
        glam::IVec4::from_array(std::array::from_fn(|channel| i32::from(bytes[4 * texel + channel])))
    })
}

#[test]
fn one_colour_is_that_colour() {
    for value in 0..=255_u8 {
        for alpha in [0, 128, 255] {
            let colour = [value, 255 - value, value / 2, alpha];
            let bytes: Vec<u8> = colour.into_iter().cycle().take(64).collect();
            let texels = texels_of(&bytes);
            for found in [decoded_bc7(block::<Bc7>(&texels)), decoded_astc(block::<Astc>(&texels))] {
                let worst = found.iter().flatten().zip(&bytes).map(|(a, b)| a.abs_diff(*b)).max();
                assert!(worst <= Some(1), "{colour:?} became {:?}", found[0]);
            }
        }
    }
}

#[test]
fn what_has_no_photo_stays_without_and_what_has_one_stays_opaque() {
    let mut bytes = [0; 64];
    assert_eq!(decoded_bc7(block::<Bc7>(&texels_of(&bytes))), [[0; 4]; 16]);
    assert_eq!(decoded_astc(block::<Astc>(&texels_of(&bytes))), [[0; 4]; 16]);
    for (place, byte) in bytes.iter_mut().enumerate() {
        *byte = if place % 4 == 3 { 255 } else { (place * 37 % 100) as u8 };
    }
    let texels = texels_of(&bytes);
    assert!(decoded_astc(block::<Astc>(&texels)).iter().all(|texel| texel[3] == 255));
    assert!(decoded_bc7(block::<Bc7>(&texels)).iter().all(|texel| texel[3] >= 254));
}

#[test]
fn a_ramp_is_kept() {
    let bytes: Vec<u8> =
        (0..16).flat_map(|texel: u8| [40 + 8 * texel, 60 + 6 * texel, 30 + 5 * texel, 255]).collect();
    let [bc7, astc] = errors(&texels_of(&bytes));
    assert!(bc7 < 1.0 && astc < 1.5, "mean square errors {bc7} and {astc}");
}

#[test]
fn a_tile_is_its_blocks() {
    let side = 12;
    let rgba: Vec<u8> = (0..4 * side * side).map(|place| (place * 89 % 251) as u8).collect();
    let blocks = tile::<Bc7>(&rgba, side);
    assert_eq!(blocks.len(), 9);
    let middle: Vec<u8> =
        (4..8).flat_map(|row| rgba[4 * (row * side + 4)..4 * (row * side + 8)].iter().copied()).collect();
    assert_eq!(blocks[4], block::<Bc7>(&texels_of(&middle)));
}

proptest! {
    #[test]
    fn any_block_is_no_worse_than_its_mean(
        bytes in proptest::collection::vec(any::<u8>(), 64),
        contrast in 0_u32..=8,
        opaque: bool,
    ) {
        let mut bytes: Vec<u8> = bytes.into_iter().map(|byte| (128 + ((i32::from(byte) - 128) >> contrast)) as u8).collect();
        if opaque {
            bytes.iter_mut().skip(3).step_by(4).for_each(|alpha| *alpha = 255);
        }
        let texels = texels_of(&bytes);
        let sum: glam::IVec4 = texels.iter().sum();
        let mean = std::array::from_fn(|channel| ((sum[channel] + 8) / 16) as u8);
        let bound = error(&texels, &[mean; 16]) + 1.5;
        let found = errors(&texels);
        prop_assert!(found[0] <= bound && found[1] <= bound, "{found:?} of {bound}");
    }
}
