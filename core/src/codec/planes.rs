//! Prediction and byte planes: what makes heights compress (half of a plain zstd, a third less than PNG).

/// The planar predictor a + b − c on a grid of integers, in place of values: residuals, zigzag coded.
/// In the first row it is the left neighbour, in the first column the upper one, at the corner 0.
/// Arithmetic wraps, so every i32 round-trips.
pub fn residuals(values: &[i32], width: usize) -> Vec<u32> {
    let mut residuals = Vec::with_capacity(values.len());
    let mut push = |value: i32, prediction: i32| {
        let delta = value.wrapping_sub(prediction);
        residuals.push(((delta << 1) ^ (delta >> 31)) as u32);
    };
    let mut rows = values.chunks(width);
    let Some(mut above) = rows.next() else { return residuals };
    let mut left = 0;
    for &value in above {
        push(value, left);
        left = value;
    }
    for row in rows {
        // Equal at first: the prediction is then the upper neighbour.
        let (mut left, mut corner) = (above[0], above[0]);
        for (&value, &up) in row.iter().zip(above) {
            push(value, left.wrapping_add(up).wrapping_sub(corner));
            (left, corner) = (value, up);
        }
        above = row;
    }
    residuals
}

/// The inverse of [`residuals`].
pub fn values(residuals: &[u32], width: usize) -> Vec<i32> {
    let delta = |residual: u32| (residual >> 1) as i32 ^ -((residual & 1) as i32);
    let mut values = vec![0; residuals.len()];
    let first = width.min(residuals.len());
    let mut left = 0_i32;
    for (value, &residual) in values[..first].iter_mut().zip(residuals) {
        left = left.wrapping_add(delta(residual));
        *value = left;
    }
    let mut done = first;
    for residuals in residuals[first..].chunks(width) {
        let (above, row) = values.split_at_mut(done);
        let above = &above[done - width..];
        let (mut left, mut corner) = (above[0], above[0]);
        for ((value, &residual), &up) in row.iter_mut().zip(residuals).zip(above) {
            left = left.wrapping_add(up).wrapping_sub(corner).wrapping_add(delta(residual));
            corner = up;
            *value = left;
        }
        done += residuals.len();
    }
    values
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The predictor as it is defined, node by node.
    fn prediction(values: &[i32], index: usize, width: usize) -> i32 {
        match (index % width, index / width) {
            (0, 0) => 0,
            (_, 0) => values[index - 1],
            (0, _) => values[index - width],
            _ => {
                values[index - 1].wrapping_add(values[index - width]).wrapping_sub(values[index - width - 1])
            }
        }
    }

    proptest! {
        #[test]
        fn rows_predict_as_nodes_do(width in 1_usize..9, nodes in proptest::collection::vec(any::<i32>(), 0..60)) {
            let residuals = residuals(&nodes, width);
            for (index, &residual) in residuals.iter().enumerate() {
                let delta = nodes[index].wrapping_sub(prediction(&nodes, index, width));
                prop_assert_eq!(residual, ((delta << 1) ^ (delta >> 31)) as u32);
            }
            prop_assert_eq!(values(&residuals, width), nodes);
        }
    }
}
