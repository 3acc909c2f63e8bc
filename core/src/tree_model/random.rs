//! Random numbers of a model: the same on every machine and in every run.

use crate::hash::{MINIMAL_STANDARD_MODULUS, hash, minimal_standard, uniform};

/// Park and Miller's generator, started from a hashed key.
#[derive(Clone, Debug)]
pub struct Random(u32);

impl Random {
    /// A sequence of its own for a name, a number within it and a purpose.
    pub fn new(name: &str, number: u32, purpose: u32) -> Self {
        let name = name.bytes().fold(0, |sum, byte| hash(sum, u32::from(byte), 11));
        Self(hash(name, number, purpose) % (MINIMAL_STANDARD_MODULUS - 1) + 1)
    }

    /// Within 0 … 1, 1 excluded.
    pub fn unit(&mut self) -> f32 {
        self.0 = minimal_standard(self.0);
        uniform(self.0)
    }

    /// Within a range.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Within ± a variation.
    pub fn around(&mut self, variation: f32) -> f32 {
        self.between(-variation, variation)
    }
}
