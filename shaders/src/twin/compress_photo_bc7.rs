//! Twin of `compress_photo_bc7.wgsl`: BC7 in its mode 6, one line of 16 colours with alpha a block.

use super::photo_block::{BlockFormat, Line, Texels, put};
use glam::IVec4;

/// BC7, mode 6.
#[derive(Clone, Copy, Debug)]
pub struct Bc7;

impl BlockFormat for Bc7 {
    fn last_index(_: &Texels) -> i32 {
        15
    }

    fn weight(index: i32, _: i32) -> i32 {
        (64 * index + 7) / 15
    }

    /// All channels of an end share their lowest bit: the one that is nearer.
    fn quantised(end: IVec4) -> IVec4 {
        let even = 2 * ((end + 16) / 32).clamp(IVec4::ZERO, IVec4::splat(127));
        let odd = 2 * (end / 32).clamp(IVec4::ZERO, IVec4::splat(127)) + 1;
        let even_off = 16 * even - end;
        let odd_off = 16 * odd - end;
        if even_off.dot(even_off) < odd_off.dot(odd_off) { even } else { odd }
    }

    fn packed(line: &Line, _: i32) -> [u32; 4] {
        // The first texel's highest bit is not written: its index must be among the lower half.
        let turned = line.indices[0] >= 8;
        let (first, second) =
            if turned { (line.ends[1], line.ends[0]) } else { (line.ends[0], line.ends[1]) };
        let mut bits = [64, 0, 0, 0];
        for channel in 0..4_u32 {
            let at = 7 + 14 * channel;
            put(&mut bits, at, 7, (first[channel as usize] >> 1).cast_unsigned());
            put(&mut bits, at + 7, 7, (second[channel as usize] >> 1).cast_unsigned());
        }
        put(&mut bits, 63, 1, (first.x & 1).cast_unsigned());
        put(&mut bits, 64, 1, (second.x & 1).cast_unsigned());
        for texel in 0..16_u32 {
            let index = line.indices[texel as usize];
            let index = if turned { 15 - index } else { index };
            if texel == 0 {
                put(&mut bits, 65, 3, index.cast_unsigned());
            } else {
                put(&mut bits, 64 + 4 * texel, 4, index.cast_unsigned());
            }
        }
        bits
    }
}
