//! Clumps: a crown of leaves is no smooth dome. Where boughs end it swells and is light, between them it is dark.

use crate::hash::hash;
use glam::{IVec3, Vec3};

/// How far foliage between clumps stays behind the crown's surface, as a share of the way from its centre.
const DEPTH: f32 = 0.17;
/// Brightness that is left between clumps.
const DARK: f32 = 0.34;

/// The clumps of a variant, by smooth noise.
#[derive(Clone, Copy, Debug)]
pub struct Clumps {
    seed: u32,
    size: f32,
}

impl Clumps {
    /// Of a seed; `size` is their width in heights of the tree.
    pub fn new(seed: u32, size: f32) -> Self {
        Self { seed, size: size.max(1e-3) }
    }

    /// 0 between clumps, 1 on one.
    pub fn at(&self, place: Vec3) -> f32 {
        let value = 0.7 * self.noise(place / self.size) + 0.3 * self.noise(place / (0.45 * self.size) + 7.3);
        let share = ((value - 0.3) / 0.4).clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    }

    /// Share of the way from the crown's centre at which foliage stands that would reach its surface.
    pub fn reach(clump: f32) -> f32 {
        1.0 - DEPTH * (1.0 - clump)
    }

    /// Brightness of foliage.
    pub fn light(clump: f32) -> f32 {
        DARK + (1.0 - DARK) * clump
    }

    /// Value noise, 0 … 1, lumps one wide.
    fn noise(&self, place: Vec3) -> f32 {
        let corner = place.floor();
        let part = place - corner;
        let smooth = part * part * (3.0 - 2.0 * part);
        let at = |x: i32, y: i32, z: i32| {
            let point = corner.as_ivec3() + IVec3::new(x, y, z);
            let bits = hash(hash(point.x as u32, point.y as u32, self.seed), point.z as u32, self.seed);
            (bits >> 8) as f32 / (1 << 24) as f32
        };
        let along = |y: i32, z: i32| at(0, y, z) + smooth.x * (at(1, y, z) - at(0, y, z));
        let plane = |z: i32| along(0, z) + smooth.y * (along(1, z) - along(0, z));
        plane(0) + smooth.z * (plane(1) - plane(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clumps_are_smooth_and_half_of_the_crown() {
        let clumps = Clumps::new(5, 0.1);
        let mut sum = 0.0;
        for index in 0..1_000 {
            let place = Vec3::new(0.013 * index as f32, 0.4 - 0.007 * index as f32, 0.003 * index as f32);
            let here = clumps.at(place);
            assert!((0.0..=1.0).contains(&here));
            assert!((clumps.at(place + 1e-5) - here).abs() < 5e-3, "a step at {place}");
            sum += here;
        }
        assert!((0.35..0.65).contains(&(sum / 1_000.0)), "{sum}");
        assert!(Clumps::new(6, 0.1).at(Vec3::ONE) != clumps.at(Vec3::ONE));
    }
}
