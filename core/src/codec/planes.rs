//! Prediction and byte planes: what makes heights compress (half of a plain zstd, a third less than PNG).

/// The planar predictor a + b − c on a grid of integers, in place of values: residuals, zigzag coded.
/// Arithmetic wraps, so every i32 round-trips.
pub fn residuals(values: &[i32], width: usize) -> Vec<u32> {
    (0..values.len())
        .map(|index| {
            let delta = values[index].wrapping_sub(prediction(values, index, width));
            ((delta << 1) ^ (delta >> 31)) as u32
        })
        .collect()
}

/// The inverse of [`residuals`].
pub fn values(residuals: &[u32], width: usize) -> Vec<i32> {
    let mut values = Vec::with_capacity(residuals.len());
    for (index, &residual) in residuals.iter().enumerate() {
        let delta = (residual >> 1) as i32 ^ -((residual & 1) as i32);
        let value = prediction(&values, index, width).wrapping_add(delta);
        values.push(value);
    }
    values
}

fn prediction(values: &[i32], index: usize, width: usize) -> i32 {
    match (index % width, index / width) {
        (0, 0) => 0,
        (_, 0) => values[index - 1],
        (0, _) => values[index - width],
        _ => values[index - 1].wrapping_add(values[index - width]).wrapping_sub(values[index - width - 1]),
    }
}

/// Bytes needed for the largest of the residuals, 1 to 4.
pub fn plane_count(residuals: &[u32]) -> u8 {
    let largest = residuals.iter().fold(0, |bits, &value| bits | value);
    (4 - largest.leading_zeros() / 8).max(1) as u8
}

/// Appends `count` byte planes, lowest first.
pub fn write_planes(residuals: &[u32], count: u8, out: &mut Vec<u8>) {
    for plane in 0..count {
        out.extend(residuals.iter().map(|value| (value >> (8 * plane)) as u8));
    }
}

/// Reads planes written by [`write_planes`]; `bytes` holds `count` × n of them.
pub fn read_planes(bytes: &[u8], count: u8) -> Vec<u32> {
    let length = bytes.len() / usize::from(count);
    let mut residuals = vec![0_u32; length];
    for (plane, bytes) in bytes.chunks_exact(length.max(1)).enumerate() {
        for (value, &byte) in residuals.iter_mut().zip(bytes) {
            *value |= u32::from(byte) << (8 * plane);
        }
    }
    residuals
}

/// One bit per flag, least significant first, padded to a byte.
pub fn write_bits(flags: impl ExactSizeIterator<Item = bool>, out: &mut Vec<u8>) {
    let start = out.len();
    out.resize(start + flags.len().div_ceil(8), 0);
    for (index, flag) in flags.enumerate() {
        out[start + index / 8] |= u8::from(flag) << (index % 8);
    }
}

/// The flag of a place written by [`write_bits`].
pub fn bit(bytes: &[u8], index: usize) -> bool {
    bytes[index / 8] >> (index % 8) & 1 == 1
}
