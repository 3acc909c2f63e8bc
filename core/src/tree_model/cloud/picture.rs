//! The picture of a plane: what is drawn on it, where, and the quad that carries it.

use super::Cover;
use super::hough::Plane;
use super::pieces::Pieces;
use crate::tree_model::atlas::Atlas;
use crate::tree_model::brightness;
use crate::tree_model::quad::{Corner, Quad};
use crate::tree_model::raster::{Fragment, Raster};
use glam::Vec3;

/// Samples along a texel's side.
const FINE: usize = 3;

/// A plane with its picture.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Its quad; texture coordinates in the picture, 0 … 1 over its outermost texels' centres.
    pub quad: Quad,
    /// Texels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// RGBA8.
    pub rgba: Vec<u8>,
}

/// A plane's rectangle: a corner and two directions.
struct Frame {
    right: Vec3,
    down: Vec3,
    normal: Vec3,
    /// Upper left corner.
    corner: Vec3,
    /// Extent along `right` and `down`.
    size: [f32; 2],
}

/// Draws all planes of a cover of a model, at `texels` per height of the tree.
pub fn draw(model: &[Quad], cover: &Cover, sprites: &Atlas, texels: f32) -> Vec<Drawn> {
    let longest = (0.9 * cover.epsilon).max(0.01);
    let pieces = Pieces::new(model, longest, 0.02 * longest);
    let is_wood = |index: usize| pieces.list[index].quad.corners[0].foliage <= 0.5;
    let has_leaves = (0..pieces.list.len()).any(|index| !is_wood(index));
    let mut drawn = Vec::new();
    for plane in &cover.foliage {
        let heights = pieces.heights(plane.normal);
        let shown: Vec<usize> = (0..pieces.list.len())
            .filter(|&index| {
                let [low, high] = pieces.span(index, &heights);
                plane.offset - low <= cover.epsilon && high - plane.offset <= cover.epsilon
            })
            .collect();
        // Branches do not make a picture larger: the cardboard shows them, too.
        let framed: Vec<usize> =
            shown.iter().copied().filter(|&index| !has_leaves || !is_wood(index)).collect();
        drawn.extend(draw_plane(&pieces, plane, &shown, &framed, has_leaves, sprites, texels));
    }
    let wood: Vec<usize> = (0..pieces.list.len()).filter(|&index| is_wood(index)).collect();
    for plane in &cover.wood {
        drawn.extend(draw_plane(&pieces, plane, &wood, &wood, false, sprites, texels));
    }
    drawn
}

fn draw_plane(
    pieces: &Pieces,
    plane: &Plane,
    shown: &[usize],
    framed: &[usize],
    foliage: bool,
    sprites: &Atlas,
    texels: f32,
) -> Option<Drawn> {
    let frame = Frame::round(pieces, plane, framed)?;
    let [width, height] = frame.size.map(|extent| ((extent * texels).ceil() as usize + 1).clamp(4, 1024));
    let mut raster = Raster::new(width * FINE, height * FINE);
    // Texel centres of the outermost texels lie on the rectangle's edges.
    let scale = [(width - 1) as f32 / frame.size[0], (height - 1) as f32 / frame.size[1]];
    for &index in shown {
        let quad = &pieces.list[index].quad;
        let places = quad.places().map(|place| {
            let way = place - frame.corner;
            let x = (way.dot(frame.right) * scale[0] + 0.5) * FINE as f32;
            let y = (way.dot(frame.down) * scale[1] + 0.5) * FINE as f32;
            Vec3::new(x, y, way.dot(frame.normal))
        });
        raster.draw(quad, places, sprites);
    }
    let corners = attributes(&raster, &frame, foliage);
    let shade = |x: f32, y: f32| {
        let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), x * y, (1.0 - x) * y];
        corners.iter().zip(weights).map(|(corner, weight)| corner.shade * weight).sum::<f32>()
    };
    let mut rgba = Vec::with_capacity(width * height * 4);
    for row in 0..height {
        for column in 0..width {
            let (x, y) = (column as f32 / (width - 1) as f32, row as f32 / (height - 1) as f32);
            let (mut sum, mut count) = (Vec3::ZERO, 0);
            for sample in 0..FINE * FINE {
                let at = (row * FINE + sample / FINE) * raster.width + column * FINE + sample % FINE;
                if let Some(fragment) = &raster.samples[at] {
                    // The picture carries what the quad's corners cannot: light and dark within it.
                    let light = brightness(fragment.shade) / brightness(shade(x, y));
                    sum += fragment.colour * light.clamp(0.4, 1.8);
                    count += 1;
                }
            }
            let mean = sum / count.max(1) as f32;
            rgba.extend(mean.to_array().map(|value| value.round().clamp(0.0, 255.0) as u8));
            rgba.push((count * 255 / (FINE * FINE)) as u8);
        }
    }
    Some(Drawn { quad: Quad { corners }, width, height, rgba })
}

impl Frame {
    /// The rectangle round pieces on a plane, upright where it can be.
    fn round(pieces: &Pieces, plane: &Plane, framed: &[usize]) -> Option<Self> {
        let normal = plane.normal;
        let upright = Vec3::NEG_Z + normal * normal.z;
        let down = if upright.length() > 0.05 { upright.normalize() } else { Vec3::NEG_Y };
        let down = (down - normal * normal.dot(down)).normalize();
        let right = normal.cross(down);
        // Who sees `right` to the right and `down` below looks against the normal.
        let places = || {
            framed
                .iter()
                .flat_map(|&index| pieces.list[index].quad.places())
                .map(|place| [place.dot(right), place.dot(down)])
        };
        let range = |axis: usize| {
            places().fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], place| {
                [low.min(place[axis]), high.max(place[axis])]
            })
        };
        let [[left, right_end], [top, bottom]] = [range(0), range(1)];
        if !(right_end - left).is_finite() {
            return None;
        }
        Some(Self {
            right,
            down,
            normal,
            corner: right * left + down * top + normal * plane.offset,
            size: [(right_end - left).max(1e-4), (bottom - top).max(1e-4)],
        })
    }
}

/// Corners of the plane's quad: upper left, upper right, lower right, lower left, with the mean
/// normal and shade of what is near each.
fn attributes(raster: &Raster, frame: &Frame, foliage: bool) -> [Corner; 4] {
    let mut sums = [(0.0_f32, Vec3::ZERO, 0.0_f32); 4];
    for (index, fragment) in raster.samples.iter().enumerate() {
        let Some(Fragment { normal, shade, .. }) = fragment else { continue };
        let x = (index % raster.width) as f32 / raster.width as f32;
        let y = (index / raster.width) as f32 / raster.height as f32;
        let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), x * y, (1.0 - x) * y];
        for (sum, weight) in sums.iter_mut().zip(weights) {
            let weight = weight * weight;
            sum.0 += weight;
            sum.1 += normal.normalize_or_zero() * weight;
            sum.2 += shade * weight;
        }
    }
    let mut corners = [Corner::default(); 4];
    for (index, (corner, (weight, normal, shade))) in corners.iter_mut().zip(sums).enumerate() {
        let [u, v] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]][index];
        let place = frame.corner + frame.right * (u * frame.size[0]) + frame.down * (v * frame.size[1]);
        *corner = Corner {
            position: place.to_array(),
            uv: [u, v],
            normal: (normal / weight.max(1e-6)).to_array(),
            shade: shade / weight.max(1e-6),
            foliage: if foliage { 1.0 } else { 0.0 },
        };
    }
    corners
}
