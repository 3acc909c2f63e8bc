//! The crown that the canopy map draws for a species, as the space that a model's foliage fills.

use crate::seeds::{CrownShape, SpeciesDefinition};
use glam::{Vec2, Vec3};

/// A crown in the tree frame: the height of the tree is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    /// Radius of the rim.
    pub radius: f32,
    /// Height of the rim.
    pub base: f32,
    /// Height of the lowest foliage: the map does not show what is under the rim.
    pub bottom: f32,
    shape: CrownShape,
}

impl Envelope {
    /// The crown of a species; foliage hangs below its rim by a share of the crown's length.
    pub fn new(definition: &SpeciesDefinition, hanging: f32) -> Self {
        let base = definition.crown_base_ratio as f32;
        Self {
            radius: definition.crown_radius_ratio as f32,
            base,
            bottom: (base - hanging * (1.0 - base)).max(0.0),
            shape: definition.crown,
        }
    }

    /// Height of the crown's surface at a distance from the axis, `None` beyond the rim: the same
    /// as [`crate::seeds::Species::crown_surface`] for a tree of height 1.
    pub fn surface(&self, distance: f32) -> Option<f32> {
        let share = distance / self.radius;
        (share <= 1.0).then(|| self.base + (1.0 - self.base) * self.shape.surface(share * share))
    }

    /// Distance from the axis at which foliage ends at a height: under the rim, the lower half of
    /// an ellipsoid.
    pub fn radius_at(&self, height: f32) -> f32 {
        if height >= 1.0 || height < self.bottom {
            return 0.0;
        }
        if height < self.base {
            let depth = (self.base - height) / (self.base - self.bottom);
            return self.radius * (1.0 - depth * depth).max(0.0).sqrt();
        }
        let (mut inside, mut outside) = (0.0, self.radius);
        if self.surface(outside).is_some_and(|surface| surface >= height) {
            return outside;
        }
        for _ in 0..24 {
            let middle = 0.5 * (inside + outside);
            if self.surface(middle).is_some_and(|surface| surface >= height) {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    }

    /// Whether foliage may be at a place.
    pub fn contains(&self, place: Vec3) -> bool {
        let distance = Vec2::new(place.x, place.y).length();
        if place.z < self.base {
            return place.z >= self.bottom && distance <= self.radius_at(place.z);
        }
        self.surface(distance).is_some_and(|surface| place.z <= surface)
    }

    /// A place deep in the crown.
    pub fn centre(&self) -> Vec3 {
        Vec3::new(0.0, 0.0, self.base + 0.3 * (1.0 - self.base))
    }

    /// The place itself where it is inside, else the point on the way to the centre where the crown
    /// begins.
    pub fn pull_in(&self, place: Vec3) -> Vec3 {
        self.centre() + (place - self.centre()) * self.share_inside(self.centre(), place)
    }

    /// Share of the way from a place inside to another that lies inside, at most 1.
    pub fn share_inside(&self, from: Vec3, to: Vec3) -> f32 {
        if self.contains(to) {
            return 1.0;
        }
        let (mut inside, mut outside) = (0.0, 1.0);
        for _ in 0..16 {
            let middle = 0.5 * (inside + outside);
            if self.contains(from + (to - from) * middle) {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    }

    /// How far out a place lies: 0 at the centre, 1 at the crown's surface.
    pub fn outness(&self, place: Vec3) -> f32 {
        let way = place - self.centre();
        let far = self.centre() + way.normalize_or_zero() * 2.0;
        let reach = 2.0 * self.share_inside(self.centre(), far);
        (way.length() / reach.max(1e-6)).min(1.0)
    }

    /// The crown's soft normal at a place: that of an ellipsoid about its centre, turned up a little.
    pub fn soft_normal(&self, place: Vec3) -> Vec3 {
        let way = place - self.centre();
        let tall = 0.6 * (1.0 - self.bottom);
        let scale = Vec3::new(self.radius, self.radius, tall).powf(2.0).recip();
        let outward = (way * scale).normalize_or_zero();
        (outward + Vec3::new(0.0, 0.0, 0.35)).normalize_or(Vec3::Z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seeds::Species;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_is_the_crown_of_the_canopy_map(beech in any::<bool>(), share in 0.0..1.2_f32, height in 0.0..1.1_f32) {
            let table = Species::built_in();
            let species = &table[usize::from(beech)];
            let envelope = Envelope::new(&species.definition, 0.1);
            let distance = share * envelope.radius;
            let surface = envelope.surface(distance);
            prop_assert_eq!(surface.is_some(), species.crown_surface(1.0, distance).is_some());
            if let (Some(own), Some(theirs)) = (surface, species.crown_surface(1.0, distance)) {
                prop_assert!((own - theirs).abs() < 1e-6);
            }
            let edge = envelope.radius_at(height);
            if height > envelope.bottom + 1e-3 && height < 0.999 {
                prop_assert!(envelope.contains(Vec3::new(edge * 0.999, 0.0, height)));
                prop_assert!(!envelope.contains(Vec3::new(edge * 1.001 + 1e-5, 0.0, height)));
            }
            let pulled = envelope.pull_in(Vec3::new(distance, 0.1, height));
            prop_assert!(envelope.contains(pulled));
            prop_assert!((0.0..=1.0).contains(&envelope.outness(pulled)));
        }
    }
}
