//! Integer hashes and the minimal standard generator: the same on server, CPU and GPU.
//!
//! Everything here is 32-bit unsigned arithmetic that wraps, without a table, so that WGSL states
//! the same functions in the same words.

/// Modulus of Park and Miller's generator, 2³¹ − 1, a prime.
pub const MINIMAL_STANDARD_MODULUS: u32 = 0x7fff_ffff;
/// Its multiplier, a primitive root of the modulus.
pub const MINIMAL_STANDARD_MULTIPLIER: u32 = 16_807;
/// Number of seed patterns: an index fits a byte, and 0 is left for "nothing visible here".
pub const PATTERNS: u32 = 255;

/// Spreads every bit of `x` over all of the result; a bijection with `mix(0) = 0`.
///
/// Two rounds of xor-shift and multiply, with the constants that C. Wellons found by search
/// (`lowbias32`): flipping one input bit flips each output bit with probability ½ ± 0.01.
pub const fn mix(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Hash of a place of an integer grid under a seed.
pub const fn hash(x: u32, y: u32, seed: u32) -> u32 {
    // The constant keeps (0, 0, 0) from the fixed point of `mix`.
    mix(x.wrapping_add(mix(y.wrapping_add(mix(seed ^ 0x9e37_79b9)))))
}

/// The next state of Park and Miller's minimal standard generator (a = 16807, m = 2³¹ − 1), by
/// Carta's division-free way: the product's two halves are added, and the carry once more.
///
/// States are 1 … m − 1; 0 is a fixed point and never a seed.
pub const fn minimal_standard(state: u32) -> u32 {
    let low = MINIMAL_STANDARD_MULTIPLIER * (state & 0xffff);
    let high = MINIMAL_STANDARD_MULTIPLIER * (state >> 16);
    // product = low + high·2¹⁶, and 2³¹ ≡ 1: the part of `high` above 15 bits wraps to the bottom.
    let sum = low + ((high & 0x7fff) << 16) + (high >> 15);
    if sum >= MINIMAL_STANDARD_MODULUS { sum - MINIMAL_STANDARD_MODULUS } else { sum }
}

/// A state of the generator as a number in 0 … 1, 1 excluded, exactly representable as f32.
pub fn uniform(state: u32) -> f32 {
    (state >> 7) as f32 * (1.0 / 16_777_216.0)
}

/// The seed pattern of a cell, 1 … [`PATTERNS`].
///
/// The generator is started from the cell's *hashed* address: started from the address itself,
/// neighbours would nearly always get the same pattern.
pub const fn pattern_index(x: u32, y: u32, seed: u32) -> u8 {
    let start = hash(x, y, seed) % (MINIMAL_STANDARD_MODULUS - 1) + 1;
    // 24 bits × 255 fit 32; the top eight bits of the product are 0 … 254.
    (1 + (((minimal_standard(start) >> 7) * PATTERNS) >> 24)) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_published_sequence() {
        let mut state = 1;
        let mut first = Vec::new();
        for index in 1..=10_000 {
            if index <= 5 {
                first.push(state);
            }
            state = minimal_standard(state);
        }
        assert_eq!(first, [1, 16_807, 282_475_249, 1_622_650_073, 984_943_658]);
        assert_eq!(minimal_standard(984_943_658), 1_144_108_930);
        assert_eq!(state, 1_043_618_065, "the 10,001st value");
    }

    proptest! {
        #[test]
        fn the_generator_is_the_product_modulo_the_prime(state in 1..MINIMAL_STANDARD_MODULUS) {
            let product = u64::from(state) * u64::from(MINIMAL_STANDARD_MULTIPLIER) % u64::from(MINIMAL_STANDARD_MODULUS);
            prop_assert_eq!(u64::from(minimal_standard(state)), product);
            prop_assert!((0.0..1.0).contains(&uniform(state)));
        }

        #[test]
        fn patterns_are_within_range(x: u32, y: u32, seed: u32) {
            prop_assert!(pattern_index(x, y, seed) >= 1);
        }
    }

    #[test]
    fn the_ends_of_the_generator() {
        assert_eq!(minimal_standard(MINIMAL_STANDARD_MODULUS - 1), MINIMAL_STANDARD_MODULUS - 16_807);
        assert!(uniform(MINIMAL_STANDARD_MODULUS - 1) < 1.0);
        assert_eq!(mix(0), 0);
        assert_ne!(hash(0, 0, 0), 0);
    }

    /// Each input bit flips each output bit about half the time.
    #[test]
    fn the_hash_avalanches() {
        let trials = 4_000;
        for bit in 0..64 {
            let mut flips = [0_u32; 32];
            for trial in 0..trials {
                let (x, y) = (mix(trial), mix(trial ^ 0x5555_0000));
                let (a, b) = if bit < 32 { (x ^ (1 << bit), y) } else { (x, y ^ (1 << (bit - 32))) };
                let change = hash(x, y, 7) ^ hash(a, b, 7);
                for (out, count) in flips.iter_mut().enumerate() {
                    *count += change >> out & 1;
                }
            }
            for count in flips {
                let share = f64::from(count) / f64::from(trials);
                assert!((0.45..0.55).contains(&share), "input bit {bit}: {share}");
            }
        }
    }

    /// Neighbouring cells get unrelated patterns, all patterns get their share, and the forest's seed
    /// changes them.
    #[test]
    fn patterns_do_not_repeat_between_neighbours() {
        let side = 256_u32;
        let mut counts = [0_u32; 256];
        let (mut east, mut south, mut reseeded) = (0_u32, 0_u32, 0_u32);
        for y in 0..side {
            for x in 0..side {
                let pattern = pattern_index(x, y, 1);
                counts[usize::from(pattern)] += 1;
                east += u32::from(pattern == pattern_index(x + 1, y, 1));
                south += u32::from(pattern == pattern_index(x, y + 1, 1));
                reseeded += u32::from(pattern == pattern_index(x, y, 2));
            }
        }
        // Expected 65,536 / 255 = 257 each, with a standard deviation of 16.
        for equal in [east, south, reseeded] {
            assert!((180..340).contains(&equal), "{equal}");
        }
        assert_eq!(counts[0], 0);
        assert!(counts[1..].iter().all(|count| (170..350).contains(count)));
    }
}
