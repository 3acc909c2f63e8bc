//! Twin of `compress_photo_astc.wgsl`: ASTC of 4 × 4 texels, one line a block; without alpha 16 colours along
//! it, with alpha 8.
//!
//! Ends are stored with 192 steps, as six bits and a trit, five trits in eight bits; such a step v is 4x + t or, with the
//! lowest of its bits set, 255 − (4x + t), where x is the other five bits and t the trit.

use super::photo_block::{BlockFormat, Line, Texels, put};
use glam::IVec4;

/// ASTC 4 × 4, low dynamic range.
#[derive(Clone, Copy, Debug)]
pub struct Astc;

/// The nearest of the steps that an end's channel can have; `value` in sixteenths.
fn step(value: i32) -> i32 {
    let mirrored = value > 2040;
    let inner = if mirrored { 4080 - value } else { value };
    let mut fours = inner / 64;
    let rest = inner - 64 * fours;
    let mut trit = ((rest + 8) / 16).min(2);
    if rest >= 48 && fours < 31 {
        fours += 1;
        trit = 0;
    }
    let found = 4 * fours + trit;
    if mirrored { 255 - found } else { found }
}

/// Six bits and the trit of a step.
fn bits_and_trit(value: i32) -> (u32, u32) {
    let mirrored = value > 127;
    let inner = if mirrored { 255 - value } else { value };
    (((inner / 4) * 2 + i32::from(mirrored)).cast_unsigned(), (inner & 3).cast_unsigned())
}

/// Five trits in eight bits.
fn packed_trits(trits: [u32; 5]) -> u32 {
    let low = if trits[2] == 2 && trits[1] == 2 {
        12 | trits[0]
    } else if trits[2] == 2 {
        (trits[1] << 4) | (trits[0] << 2) | 3
    } else {
        (trits[2] << 4) | (trits[1] << 2) | trits[0]
    };
    if trits[4] == 2 && trits[3] == 2 {
        ((low >> 2) << 5) | 28 | (low & 3)
    } else if trits[4] == 2 {
        (trits[3] << 7) | 96 | low
    } else {
        (trits[4] << 7) | (trits[3] << 5) | low
    }
}

/// Writes up to five values, beginning with value `from` of `count`, at bit `at`.
fn put_values(bits: &mut [u32; 4], at: u32, values: &[i32; 8], from: usize, count: usize) {
    let mut trits = [0; 5];
    for place in 0..5 {
        if from + place < count {
            trits[place] = bits_and_trit(values[from + place]).1;
        }
    }
    let together = packed_trits(trits);
    let mut at = at;
    let mut taken = 0;
    for place in 0..5 {
        if from + place >= count {
            break;
        }
        put(bits, at, 6, bits_and_trit(values[from + place]).0);
        // Bits of the trits stand between the values: two, two, one, two, one.
        let width = if place == 2 || place == 4 { 1 } else { 2 };
        put(bits, at + 6, width, (together >> taken) & ((1 << width) - 1));
        at += 6 + width;
        taken += width;
    }
}

impl BlockFormat for Astc {
    fn last_index(texels: &Texels) -> i32 {
        if texels.iter().all(|texel| texel.w == 255) { 15 } else { 7 }
    }

    fn weight(index: i32, last: i32) -> i32 {
        let spread = if last == 15 { (index << 2) | (index >> 2) } else { (index << 3) | index };
        if spread > 32 { spread + 1 } else { spread }
    }

    fn quantised(end: IVec4) -> IVec4 {
        IVec4::new(step(end.x), step(end.y), step(end.z), step(end.w))
    }

    fn packed(line: &Line, last: i32) -> [u32; 4] {
        // A decoder takes ends in falling order for another encoding of them.
        let brightness = line.ends.map(|end| end.x + end.y + end.z);
        let turned = brightness[1] < brightness[0];
        let (first, second) =
            if turned { (line.ends[1], line.ends[0]) } else { (line.ends[0], line.ends[1]) };
        let values = [first.x, second.x, first.y, second.y, first.z, second.z, first.w, second.w];
        // Weights of 4 × 4, sixteen or eight of them; the ends' mode.
        let opaque = last == 15;
        let mut bits = if opaque { [0x242 | (8 << 13), 0, 0, 0] } else { [0x53 | (12 << 13), 0, 0, 0] };
        let count = if opaque { 6 } else { 8 };
        put_values(&mut bits, 17, &values, 0, count);
        put_values(&mut bits, 55, &values, 5, count);
        // From the block's other end, each mirrored.
        let width = if opaque { 4 } else { 3 };
        for texel in 0..16_u32 {
            let index = line.indices[texel as usize];
            let index = if turned { last - index } else { index };
            put(
                &mut bits,
                128 - (texel + 1) * width,
                width,
                index.cast_unsigned().reverse_bits() >> (32 - width),
            );
        }
        bits
    }
}
