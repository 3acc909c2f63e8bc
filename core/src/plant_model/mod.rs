//! Models of the plants and stones of the undergrowth ([`crate::seeds::metaseed`]), grown by rule: some dozens of
//! triangles each, in a few variants, without pictures.
//!
//! A model stands on the origin, z up, for a member of size 1: what stands is as high, what lies is as long. Blades are
//! kept as their middle line and their width beside it, so that who draws can widen those that are thinner than a
//! pixel.

mod herbs;
mod lying;

use crate::seeds::metaseed::Kind;
use crate::tree_model::Random;
use glam::{Vec2, Vec3};

/// Variants of a kind.
pub const VARIANTS: u32 = 4;
/// Positions are ± this many sizes.
pub const EXTENT: f32 = 3.0;
/// Half widths of blades are ± this many sizes.
pub const WIDEST: f32 = 0.125;
/// Tones are up to this.
pub const BRIGHTEST: f32 = 2.0;

/// What colour a corner has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Part {
    /// The member's own, times the tone.
    Own = 0,
    /// The blossom's, times the tone.
    Petal = 1,
    /// The tone itself.
    Plain = 2,
}

/// A corner of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Sizes of the member; of a blade its middle line.
    pub position: Vec3,
    /// Half width of a blade to this side, sizes; 0 of all else.
    pub side: f32,
    /// Which way a blade is wide: turns from the x axis, 0…1.
    pub lateral: f32,
    /// Unit.
    pub normal: Vec3,
    /// Reflectance, or a factor of it.
    pub tone: Vec3,
    /// Light that the plant itself leaves to the place: 0 among its feet, 1 at its tips.
    pub shade: f32,
    /// Whose colour.
    pub part: Part,
    /// Part of what a far member is drawn without.
    pub near: bool,
}

/// In the last word of a corner that is [`Corner::near`].
pub const NEAR_BIT: u32 = 1 << 31;

impl Corner {
    /// Four words: position (x and y, then z, 16 bits each, over [`EXTENT`]), side (signed byte over [`WIDEST`]) and
    /// shade (byte); normal (signed bytes) and lateral (byte); tone (bytes over [`BRIGHTEST`]) and part.
    pub fn words(&self) -> [u32; 4] {
        let signed = |value: f32, most: f32| (value.clamp(-1.0, 1.0) * most).round() as i32 as u32;
        let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u32;
        let [x, y, z] = (self.position / EXTENT).to_array().map(|value| signed(value, 32_767.0) & 0xffff);
        let normal = self.normal.to_array().map(|value| signed(value, 127.0) & 0xff);
        let tone = (self.tone / BRIGHTEST).to_array().map(byte);
        [
            x | y << 16,
            z | (signed(self.side / WIDEST, 127.0) & 0xff) << 16 | byte(self.shade) << 24,
            normal[0] | normal[1] << 8 | normal[2] << 16 | byte(self.lateral) << 24,
            tone[0]
                | tone[1] << 8
                | tone[2] << 16
                | (self.part as u32) << 24
                | if self.near { NEAR_BIT } else { 0 },
        ]
    }
}

/// Triangles of one variant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Its corners.
    pub corners: Vec<Corner>,
    /// Three a triangle.
    pub indices: Vec<u32>,
}

impl Mesh {
    fn triangle(&mut self, corners: [u32; 3]) {
        self.indices.extend(corners);
    }

    fn corner(&mut self, corner: Corner) -> u32 {
        self.corners.push(corner);
        self.corners.len() as u32 - 1
    }
}

/// A kind's variants: their corners one after the other, as many of each, and the triangles that they share.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Corners of all variants.
    pub corners: Vec<Corner>,
    /// Corners of a variant.
    pub variant_corners: u32,
    /// Three a triangle, of a variant.
    pub indices: Vec<u32>,
    /// Of these, how many are drawn of a far member, the first ones.
    pub far_indices: u32,
}

/// The model of a kind.
pub fn model(kind: Kind) -> Model {
    let grown = |variant| {
        let mut random = Random::new("undergrowth", kind as u32, variant);
        match kind {
            Kind::Grass => herbs::grass(&mut random),
            Kind::Flower => herbs::flower(&mut random),
            Kind::Fern => herbs::fern(&mut random),
            Kind::Shrub => herbs::shrub(&mut random),
            Kind::Stone => lying::stone(&mut random),
            Kind::Wood => lying::wood(&mut random),
        }
    };
    let meshes: Vec<Mesh> = (0..VARIANTS).map(grown).collect();
    let far = if kind == Kind::Grass { 3 * herbs::BLADE_TRIANGLES * herbs::FAR_BLADES } else { u32::MAX };
    Model {
        far_indices: far.min(meshes[0].indices.len() as u32),
        variant_corners: meshes[0].corners.len() as u32,
        indices: meshes[0].indices.clone(),
        corners: meshes.into_iter().flat_map(|mesh| mesh.corners).collect(),
    }
}

/// A direction on the level, turns from the x axis.
fn level(turn: f32) -> Vec3 {
    Vec2::from_angle(turn * std::f32::consts::TAU).extend(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_whole_within_their_size_and_of_several_shapes() {
        for kind in Kind::ALL {
            let model = model(kind);
            let variants: Vec<&[Corner]> = model.corners.chunks(model.variant_corners as usize).collect();
            assert_eq!(variants.len(), VARIANTS as usize, "{kind:?}");
            assert_eq!(model.corners.len() as u32, VARIANTS * model.variant_corners, "{kind:?}");
            assert!(model.indices.len().is_multiple_of(3) && model.far_indices <= model.indices.len() as u32);
            // What a far member is drawn with is what is always there.
            let far = &model.indices[..model.far_indices as usize];
            assert!(far.iter().all(|&index| !model.corners[index as usize].near));
            assert!(model.indices.iter().all(|&index| index < model.variant_corners));
            println!("{kind:?}: {} corners, {} triangles", model.variant_corners, model.indices.len() / 3);
            for corners in &variants {
                let top = corners.iter().map(|corner| corner.position.z).fold(0.0, f32::max);
                let reach =
                    corners.iter().map(|corner| corner.position.truncate().length()).fold(0.0, f32::max);
                let lies = matches!(kind, Kind::Stone | Kind::Wood);
                assert!(
                    if lies { (0.04..0.6).contains(&top) } else { (0.6..1.05).contains(&top) },
                    "{kind:?} {top}"
                );
                assert!((0.2..2.6).contains(&reach), "{kind:?} {reach}");
                for corner in *corners {
                    assert!(corner.position.is_finite() && (corner.normal.length() - 1.0).abs() < 1e-3);
                    assert!(corner.side.abs() <= WIDEST && corner.tone.max_element() <= BRIGHTEST);
                    assert!(corner.position.z > -0.3, "{kind:?} {}", corner.position.z);
                }
            }
            assert_ne!(variants[0], variants[1]);
        }
    }

    #[test]
    fn words_hold_what_a_corner_is() {
        let corner = Corner {
            position: Vec3::new(1.5, -3.0, 0.75),
            side: -0.125,
            lateral: 0.5,
            normal: Vec3::NEG_Y,
            tone: Vec3::new(2.0, 1.0, 0.0),
            shade: 1.0,
            part: Part::Petal,
            near: true,
        };
        let [xy, z_side, normal, tone] = corner.words();
        assert_eq!(xy, 16_384 | (-32_767_i32 as u32 & 0xffff) << 16);
        assert_eq!(z_side, 8_192 | (-127_i32 as u32 & 0xff) << 16 | 255 << 24);
        assert_eq!(normal, (-127_i32 as u32 & 0xff) << 8 | 128 << 24);
        assert_eq!(tone, 255 | 128 << 8 | 1 << 24 | NEAR_BIT);
    }
}
