//! Models of trees: what an instance looks like, on every level of detail.
//!
//! A model is grown for a species by a published procedural way ([`growth`], [`skeleton`]), with no
//! assets: twigs and bark are painted by rule ([`sprite`]). It is made for a tree of height 1 and fills the
//! crown that the canopy map draws for the species ([`envelope`]), so that the tree in the map
//! and the instance that takes its place are the same tree: its top is at z = 1, and no leaf is outside.
//!
//! | level | what | ε, a bound for all corners of level 0 |
//! | --- | --- | --- |
//! | 0 | the full model, 300 to 2,500 quads | 0 |
//! | 1 | billboard cloud ([`cloud`]) of at most 15 planes of foliage and 2 of wood | [`TreeLevel::epsilon`] |
//! | 2 | the same of 6 and 2 | |
//! | 3 | 2 planes that cross, and the trunk on 2 | |
//!
//! Everything on every level is quads with one layout ([`quad`]), and all variants of a level have
//! equally many, so that one indirect draw per species and level serves all instances.
//! Colours are reflectances in a middling summer; season and ground are the drawing side's.

pub mod atlas;
pub mod cloud;
pub mod codec;
pub mod envelope;
pub mod quad;
pub mod raster;

mod boulder;
mod clumps;
mod geometry;
mod growth;
mod packing;
mod random;
mod skeleton;
mod sprite;

pub use atlas::{Atlas, Region};
pub use codec::MEDIA_TYPE;
pub use quad::{Corner, PackedCorner, Quad};

use crate::seeds::Species;
use cloud::{BUDGETS, Cover};
use envelope::Envelope;
use geometry::Pictures;
use glam::Vec3;
use growth::Form;
use packing::Packer;
pub(crate) use random::Random;
use sprite::Picture;

/// Different trees of a species: no two neighbours need be twins.
pub const VARIANTS: u32 = 3;
/// Texels along the side of every species' atlas: all are layers of one texture array.
pub const ATLAS_SIDE: u32 = 1024;
/// Texels per height of the tree in the pictures of levels 1, 2 and 3; less where an atlas would be too small.
const TEXELS: [f32; 3] = [208.0, 128.0, 104.0];

/// Share of the direction to the eye in the normals of levels 1, 2 and 3: their corners do not know
/// from which side they are seen.
pub const TOWARDS_EYE: f32 = 0.45;

/// A level of detail of a species.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeLevel {
    /// Quads of every variant, equally many: the last may be padding without area.
    pub variants: Vec<Vec<Quad>>,
    /// No corner of the full model lies farther from the planes that show it, as a share of the
    /// tree's height; over [`TreeSpecies::crown_radius`] it is the share of the crown's radius.
    pub epsilon: f32,
}

impl TreeLevel {
    /// Quads of a variant, padding included.
    pub fn quads(&self) -> usize {
        self.variants.first().map_or(0, Vec::len)
    }

    /// All corners as the GPU reads them: corner c of quad q of variant v at
    /// (v · quads + q) · 4 + c, four words each.
    pub fn words(&self) -> Vec<u32> {
        let quads = self.variants.iter().flatten();
        quads.flat_map(|quad| quad.corners).flat_map(|corner| PackedCorner::from(corner).words).collect()
    }

    /// Snaps to the wire's steps and pads all variants to the most quads that one has.
    fn new(variants: Vec<Vec<Quad>>, epsilon: f32) -> Self {
        let most = variants.iter().map(Vec::len).max().unwrap_or(0);
        let padded = |quads: Vec<Quad>| {
            let mut quads: Vec<Quad> = quads.iter().map(Quad::snapped).collect();
            quads.resize(most, Quad::default().snapped());
            quads
        };
        Self { variants: variants.into_iter().map(padded).collect(), epsilon }
    }
}

/// All levels of a species, and its pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeSpecies {
    /// Code in land cover.
    pub code: u8,
    /// Radius of the crown over the height of the tree.
    pub crown_radius: f32,
    /// Levels of detail, the finest first.
    pub levels: Vec<TreeLevel>,
    /// Pictures of all levels.
    pub atlas: Atlas,
}

/// How bright a place of the crown is by its `shade` ([`Corner::shade`]), 1 at the outside. The
/// pictures of billboard clouds hold what is brighter or darker than their corners by this measure.
pub fn brightness(shade: f32) -> f32 {
    0.35 + 0.65 * shade
}

impl TreeSpecies {
    /// Grows a species: the same for the same definition, whatever its code.
    pub fn grow(species: &Species) -> Self {
        let form = Form::of(&species.definition);
        let name = species.definition.name.as_str();
        let mut packer = Packer::new(ATLAS_SIDE);
        let mut canvas = vec![0; (ATLAS_SIDE * ATLAS_SIDE * 4) as usize];
        let (pictures, mut regions) = paint(&form, name, &mut packer, &mut canvas);
        let sprites = Atlas::new(ATLAS_SIDE, canvas.clone(), regions.clone());
        let models: Vec<Vec<Quad>> = (0..VARIANTS)
            .map(|variant| model(&form, species, &pictures, &mut Random::new(name, variant, 1)))
            .collect();
        let covers: Vec<Vec<Cover>> = BUDGETS
            .iter()
            .map(|&budget| models.iter().map(|model| cloud::cover(model, budget)).collect())
            .collect();
        let mut levels = vec![TreeLevel::new(models.clone(), 0.0)];
        levels.extend(draw(&models, &covers, &sprites, &packer, &mut canvas, &mut regions));
        Self {
            code: species.code,
            crown_radius: species.definition.crown_radius_ratio as f32,
            levels,
            atlas: Atlas::new(ATLAS_SIDE, canvas, regions),
        }
    }
}

/// The full model of a variant.
fn model(form: &Form, species: &Species, pictures: &Pictures, random: &mut Random) -> Vec<Quad> {
    match form {
        Form::Plant(plant) => {
            let envelope = Envelope::new(&species.definition, plant.hanging);
            geometry::plant(plant, &envelope, pictures, random)
        }
        Form::Boulder(_) => {
            // A rock has no trunk under its rim.
            let envelope = Envelope::new(&species.definition, 1.0);
            boulder::boulder(&envelope, pictures, random)
        }
    }
}

/// Paints twigs and bark into the atlas.
fn paint(form: &Form, name: &str, packer: &mut Packer, canvas: &mut [u8]) -> (Pictures, Vec<Region>) {
    let mut random = Random::new(name, 0, 2);
    let (twigs, bark) = match form {
        Form::Plant(plant) => {
            let colour = Vec3::from(plant.colour);
            let twigs = (0..3).map(|_| sprite::twig(plant.twig, colour, &mut random)).collect();
            (twigs, sprite::bark(plant.bark, &mut random))
        }
        Form::Boulder(colour) => (Vec::new(), sprite::stone(Vec3::from(*colour), &mut random)),
    };
    let twigs: Vec<Region> = twigs.iter().filter_map(|picture| put(picture, packer, canvas)).collect();
    let bark = put(&bark, packer, canvas).unwrap_or_default();
    let regions = twigs.iter().copied().chain([bark]).collect();
    (Pictures { twigs, bark, side: ATLAS_SIDE }, regions)
}

fn put(picture: &Picture, packer: &mut Packer, canvas: &mut [u8]) -> Option<Region> {
    let region = packer.place(picture.width as u32, picture.height as u32)?;
    copy(&picture.rgba, &region, canvas);
    Some(region)
}

/// Puts a picture where it belongs. Colours are cut to 32 steps of red and blue and 64 of green, which
/// nobody sees in foliage, and which a compressor does.
fn copy(rgba: &[u8], region: &Region, canvas: &mut [u8]) {
    let row_bytes = usize::from(region.width) * 4;
    for (row, texels) in rgba.chunks_exact(row_bytes).enumerate() {
        let first = ((usize::from(region.y) + row) * ATLAS_SIDE as usize + usize::from(region.x)) * 4;
        let row = canvas[first..first + row_bytes].as_chunks_mut::<4>().0;
        for (texel, &[red, green, blue, alpha]) in row.iter_mut().zip(texels.as_chunks::<4>().0) {
            *texel = [red & 0xf8 | red >> 5, green & 0xfc | green >> 6, blue & 0xf8 | blue >> 5, alpha];
        }
    }
}

/// Draws the clouds of all levels and variants, as large as the atlas has room for.
fn draw(
    models: &[Vec<Quad>],
    covers: &[Vec<Cover>],
    sprites: &Atlas,
    packer: &Packer,
    canvas: &mut [u8],
    regions: &mut Vec<Region>,
) -> Vec<TreeLevel> {
    let layouts: Vec<Vec<cloud::Layout>> = covers
        .iter()
        .map(|covers| {
            models.iter().zip(covers).map(|(model, cover)| cloud::Layout::new(model, cover)).collect()
        })
        .collect();
    let sizes = |scale: f32| -> Vec<[u32; 2]> {
        let levels = layouts.iter().zip(TEXELS);
        levels
            .flat_map(|(variants, texels)| {
                variants.iter().flat_map(move |layout| layout.sizes(texels * scale))
            })
            .collect()
    };
    // Pictures of four texels a side always fit: the way down ends.
    let (scale, places) = std::iter::successors(Some(1.0_f32), |scale| Some(scale * 0.95))
        .find_map(|scale| Some((scale, packer.clone().place_all(&sizes(scale))?)))
        .unwrap_or_default();
    let mut next = places.iter();
    let mut placed = |picture: &cloud::Drawn| {
        let region = next.next().copied().unwrap_or_default();
        copy(&picture.rgba, &region, canvas);
        let mut quad = picture.quad;
        for corner in &mut quad.corners {
            corner.uv = geometry::uv_in(&region, ATLAS_SIDE, corner.uv[0], corner.uv[1]);
        }
        quad
    };
    let levels = layouts
        .iter()
        .zip(covers)
        .zip(TEXELS)
        .map(|((variants, covers), texels)| {
            let epsilon = covers.iter().map(|cover| cover.epsilon).fold(0.0, f32::max);
            let draw = |layout: &cloud::Layout| {
                layout.draw(sprites, texels * scale).iter().map(&mut placed).collect()
            };
            TreeLevel::new(variants.iter().map(draw).collect(), epsilon)
        })
        .collect();
    regions.extend(&places);
    levels
}

#[cfg(test)]
mod tests;
