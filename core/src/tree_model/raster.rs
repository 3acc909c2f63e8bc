//! A small rasteriser: quads into samples with depth. The pictures of billboard clouds are drawn
//! with it, and the pictures that compare them with the full model.

use super::atlas::Atlas;
use super::quad::Quad;
use glam::{Vec2, Vec3};

/// What a sample shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fragment {
    /// Depth, larger is nearer.
    pub depth: f32,
    /// Colour of the atlas, sRGB, 0 … 255.
    pub colour: Vec3,
    /// Normal, not of length 1.
    pub normal: Vec3,
    /// Place in the crown, 0 … 1.
    pub shade: f32,
    /// Foliage 1, wood 0.
    pub foliage: f32,
}

/// Samples of a picture.
#[derive(Clone, Debug)]
pub struct Raster {
    /// Samples along a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row-major from the upper left.
    pub samples: Vec<Option<Fragment>>,
}

impl Raster {
    /// A picture of nothing.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, samples: vec![None; width * height] }
    }

    /// Draws a quad whose corners lie at `places`: x and y in samples from the upper left, z the
    /// depth, larger nearer. Texels without [`Atlas::ALPHA_TEST`] coverage let see through.
    pub fn draw(&mut self, quad: &Quad, places: [Vec3; 4], atlas: &Atlas) {
        let mip = mip_for(quad, &places, atlas);
        self.triangle(quad, &places, [0, 1, 2], atlas, mip);
        self.triangle(quad, &places, [0, 2, 3], atlas, mip);
    }

    fn triangle(&mut self, quad: &Quad, places: &[Vec3; 4], order: [usize; 3], atlas: &Atlas, mip: usize) {
        let [a, b, c] = order.map(|index| Vec2::new(places[index].x, places[index].y));
        let area = (b - a).perp_dot(c - a);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let inverse = area.recip();
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let columns = range(low.x, high.x, self.width);
        for row in range(low.y, high.y, self.height) {
            for column in columns.clone() {
                let at = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                let first = (c - b).perp_dot(at - b) * inverse;
                let second = (a - c).perp_dot(at - c) * inverse;
                let third = (b - a).perp_dot(at - a) * inverse;
                if first < 0.0 || second < 0.0 || third < 0.0 {
                    continue;
                }
                let weights = [first, second, third];
                let depth = mix(weights, order.map(|index| places[index].z));
                let sample = &mut self.samples[row * self.width + column];
                if sample.is_some_and(|nearer| nearer.depth >= depth) {
                    continue;
                }
                let corners = order.map(|index| &quad.corners[index]);
                let uv = [0, 1].map(|axis| mix(weights, corners.map(|corner| corner.uv[axis])));
                let Some(colour) = texel(atlas, uv, mip) else { continue };
                let normal = [0, 1, 2].map(|axis| mix(weights, corners.map(|corner| corner.normal[axis])));
                *sample = Some(Fragment {
                    depth,
                    colour,
                    normal: normal.into(),
                    shade: mix(weights, corners.map(|corner| corner.shade)),
                    foliage: mix(weights, corners.map(|corner| corner.foliage)),
                });
            }
        }
    }
}

fn mix(weights: [f32; 3], values: [f32; 3]) -> f32 {
    weights[0] * values[0] + weights[1] * values[1] + weights[2] * values[2]
}

/// Samples whose centres lie between two places.
fn range(low: f32, high: f32, count: usize) -> std::ops::Range<usize> {
    let first = (low - 0.5).ceil().max(0.0) as usize;
    first..((high - 0.5).floor() + 1.0).clamp(0.0, count as f32) as usize
}

/// The mip of which a texel is about as large as a sample.
fn mip_for(quad: &Quad, places: &[Vec3; 4], atlas: &Atlas) -> usize {
    let across = |corners: [Vec2; 4]| 0.5 * (corners[2] - corners[0]).perp_dot(corners[3] - corners[1]).abs();
    let samples = across(places.map(|place| Vec2::new(place.x, place.y)));
    let texels = across(quad.corners.map(|corner| Vec2::from(corner.uv) * atlas.side as f32));
    let level = 0.5 * (texels / samples.max(1e-3)).max(1.0).log2();
    (level.round() as usize).min(atlas.mips.len() - 1)
}

fn texel(atlas: &Atlas, uv: [f32; 2], mip: usize) -> Option<Vec3> {
    let side = (atlas.side >> mip) as usize;
    let [column, row] = uv.map(|value| ((value * side as f32) as usize).min(side - 1));
    let texel = &atlas.mips[mip][(row * side + column) * 4..][..4];
    (texel[3] >= Atlas::ALPHA_TEST).then(|| Vec3::new(texel[0].into(), texel[1].into(), texel[2].into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_model::quad::Corner;

    #[test]
    fn the_nearer_quad_is_seen_and_edges_have_no_seam() {
        let atlas = Atlas::new(16, vec![200; 16 * 16 * 4], Vec::new());
        let quad = Quad { corners: [Corner { shade: 0.5, ..Corner::default() }; 4] };
        let mut raster = Raster::new(8, 8);
        let square = |low: f32, high: f32, depth: f32| {
            [(low, low), (high, low), (high, high), (low, high)].map(|(x, y)| Vec3::new(x, y, depth))
        };
        raster.draw(&quad, square(0.0, 8.0, 1.0), &atlas);
        raster.draw(&quad, square(2.0, 6.0, 2.0), &atlas);
        raster.draw(&quad, square(0.0, 8.0, 0.0), &atlas);
        for (index, sample) in raster.samples.iter().enumerate() {
            let inner = (2..6).contains(&(index % 8)) && (2..6).contains(&(index / 8));
            let sample = sample.expect("covered");
            assert_eq!(sample.depth, if inner { 2.0 } else { 1.0 }, "{index}");
            assert!((sample.shade - 0.5).abs() < 1e-5);
        }
    }

    #[test]
    fn a_quad_without_area_draws_nothing() {
        let atlas = Atlas::new(16, vec![255; 16 * 16 * 4], Vec::new());
        let mut raster = Raster::new(4, 4);
        raster.draw(&Quad::default(), [Vec3::ONE; 4], &atlas);
        raster.draw(&Quad::default(), [Vec3::NAN; 4], &atlas);
        assert!(raster.samples.iter().all(Option::is_none));
    }
}
