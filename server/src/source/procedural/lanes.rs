//! Four numbers at once, in plain arithmetic that compilers turn into vector instructions.
//!
//! Each lane goes through exactly the operations of a scalar: the same bits, in a third of the time.

use std::ops::{Add, Mul, Sub};

/// Lanes.
pub(super) const LANES: usize = 4;

/// Four numbers.
#[repr(align(16))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lanes(pub [f32; LANES]);

impl Lanes {
    /// The same number four times.
    #[inline(always)]
    pub(super) fn all(value: f32) -> Self {
        Self([value; LANES])
    }

    /// The first four of a slice.
    #[inline(always)]
    pub(super) fn from(slice: &[f32]) -> Self {
        Self([slice[0], slice[1], slice[2], slice[3]])
    }

    /// Into the first four of a slice.
    #[inline(always)]
    pub(super) fn store(self, slice: &mut [f32]) {
        slice[..LANES].copy_from_slice(&self.0);
    }

    /// Magnitudes.
    #[inline(always)]
    pub(super) fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }

    /// Square roots.
    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    /// `numerator` divided by each.
    #[inline(always)]
    pub(super) fn divide(self, numerator: f32) -> Self {
        Self(self.0.map(|v| numerator / v))
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] + other.0[k]))
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] - other.0[k]))
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] * other.0[k]))
    }
}

impl Mul<f32> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f32) -> Self {
        Self(self.0.map(|v| v * factor))
    }
}

impl Add<f32> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, term: f32) -> Self {
        Self(self.0.map(|v| v + term))
    }
}
