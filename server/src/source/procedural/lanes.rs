//! Eight numbers at once, in plain arithmetic that compilers turn into vector instructions: of eight numbers
//! where a function is compiled for AVX2 as well ([`wide!`](crate::source::wide)), of four elsewhere.
//!
//! Each lane goes through exactly the operations of a scalar: the same bits, in a third of the time.

use std::ops::{Add, Div, Mul, Sub};

/// Lanes.
pub(super) const LANES: usize = 8;

/// Eight numbers.
#[repr(align(32))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lanes(pub [f32; LANES]);

impl Lanes {
    /// The same number eight times.
    #[inline(always)]
    pub(super) fn all(value: f32) -> Self {
        Self([value; LANES])
    }

    /// The first eight of a slice.
    #[inline(always)]
    pub(super) fn from(slice: &[f32]) -> Self {
        let slice = &slice[..LANES];
        Self(std::array::from_fn(|k| slice[k]))
    }

    /// Into the first eight of a slice.
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

    /// The greater of each two.
    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| if self.0[k] > other.0[k] { self.0[k] } else { other.0[k] }))
    }

    /// The lesser of each two.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| if self.0[k] < other.0[k] { self.0[k] } else { other.0[k] }))
    }

    /// Nothing below `low`, nothing above `high`.
    #[inline(always)]
    pub(super) fn clamp(self, low: f32, high: f32) -> Self {
        self.max(Self::all(low)).min(Self::all(high))
    }

    /// 1 − each.
    #[inline(always)]
    pub(super) fn complement(self) -> Self {
        self * -1.0 + 1.0
    }

    /// [`super::random::smoothstep`] of each.
    #[inline(always)]
    pub(super) fn smoothstep(self, low: f32, high: f32) -> Self {
        let t = ((self - Self::all(low)) * (1.0 / (high - low))).clamp(0.0, 1.0);
        t * t * (t * -2.0 + 3.0)
    }

    /// [`super::random::mix`] by each.
    #[inline(always)]
    pub(super) fn mix(self, a: f32, b: f32) -> Self {
        self * (b - a) + a
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

impl Div for Lanes {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] / other.0[k]))
    }
}
