//! A hash that is the same on every machine and in every release: names of cache files, ETags,
//! data versions. FNV-1a; not for adversaries.

/// FNV-1a over 128 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest(u128);

const OFFSET_BASIS: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;

impl Default for Digest {
    fn default() -> Self {
        Self(OFFSET_BASIS)
    }
}

impl Digest {
    /// The digest of nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes in bytes.
    #[must_use]
    pub fn bytes(mut self, bytes: &[u8]) -> Self {
        for &byte in bytes {
            self.0 = (self.0 ^ u128::from(byte)).wrapping_mul(PRIME);
        }
        self
    }

    /// Takes in a text with its length, so that ("ab", "c") differs from ("a", "bc").
    #[must_use]
    pub fn text(self, text: &str) -> Self {
        self.bytes(&(text.len() as u64).to_le_bytes()).bytes(text.as_bytes())
    }

    /// All 32 hexadecimal digits.
    pub fn hex(self) -> String {
        format!("{:032x}", self.0)
    }

    /// The first 16 hexadecimal digits, after mixing in the other half.
    pub fn short_hex(self) -> String {
        format!("{:016x}", self.short())
    }

    /// 64 bits, both halves mixed.
    pub fn short(self) -> u64 {
        (self.0 >> 64) as u64 ^ self.0 as u64
    }
}

/// Checksum of a file's payload: four sums of every fourth word, which do not wait for each other, so that a tile costs
/// a few microseconds. Each step of a sum is one to one: a change in one word always shows.
pub fn checksum(bytes: &[u8]) -> u64 {
    fn mix(state: u64, word: u64) -> u64 {
        let state = (state ^ word).wrapping_mul(0xff51_afd7_ed55_8ccd);
        state ^ state >> 32
    }
    let seed = 0x9e37_79b9_7f4a_7c15_u64 ^ bytes.len() as u64;
    let mut sums = [1, 2, 3, 4].map(|sum| mix(seed, sum));
    let (blocks, rest) = bytes.as_chunks::<32>();
    for block in blocks {
        for (sum, word) in sums.iter_mut().zip(block.as_chunks::<8>().0) {
            *sum = mix(*sum, u64::from_le_bytes(*word));
        }
    }
    for part in rest.chunks(8) {
        let mut word = [0_u8; 8];
        word[..part.len()].copy_from_slice(part);
        sums[0] = mix(sums[0], u64::from_le_bytes(word));
    }
    sums.into_iter().fold(seed, mix)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_value_of_a() {
        // Test vector of the FNV reference for FNV-1a 128 of "a".
        assert_eq!(Digest::new().bytes(b"a").hex(), "d228cb696f1a8caf78912b704e4a8964");
    }

    #[test]
    fn texts_do_not_run_together() {
        assert_ne!(Digest::new().text("ab").text("c"), Digest::new().text("a").text("bc"));
    }

    #[test]
    fn any_flipped_bit_changes_the_checksum() {
        let bytes: Vec<u8> = (0..133_u8).collect();
        let truth = checksum(&bytes);
        for bit in 0..8 * bytes.len() {
            let mut other = bytes.clone();
            other[bit / 8] ^= 1 << (bit % 8);
            assert_ne!(checksum(&other), truth, "bit {bit}");
        }
        assert_ne!(checksum(&bytes[..132]), truth);
    }
}
