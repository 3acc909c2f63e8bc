//! Integer noise: the only source of chance in the landscape, the same on every machine.

/// A well mixed 32-bit hash of a lattice point: multiply–xorshift rounds, every input bit reaches
/// every output bit.
pub(super) fn hash(x: u32, y: u32, seed: u32) -> u32 {
    let mut h = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77).rotate_left(15) ^ seed;
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// A hash as a number in 0 ≤ u < 1.
pub(super) fn unit(hash: u32) -> f32 {
    (hash >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A hash as a number in −1 ≤ u < 1.
pub(super) fn signed(hash: u32) -> f32 {
    2.0 * unit(hash) - 1.0
}

/// Cubic step from 0 at `low` to 1 at `high` (`low` < `high`).
#[inline(always)]
pub(super) fn smoothstep(low: f32, high: f32, value: f32) -> f32 {
    let t = ((value - low) * (1.0 / (high - low))).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// `a` at t = 0, `b` at t = 1.
#[inline(always)]
pub(super) fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_spread_and_uncorrelated_between_neighbours() {
        let count = 256_u32;
        let (mut sum, mut product) = (0.0_f64, 0.0_f64);
        for y in 0..count {
            for x in 0..count {
                let here = f64::from(signed(hash(x, y, 7)));
                sum += here;
                product += here * f64::from(signed(hash(x + 1, y, 7)));
            }
        }
        let samples = f64::from(count * count);
        assert!((sum / samples).abs() < 0.01, "mean {}", sum / samples);
        assert!((product / samples).abs() < 0.01, "correlation {}", product / samples);
    }
}
