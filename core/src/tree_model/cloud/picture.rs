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

/// Planes nearer to a rock's middle than this share of its radius go through its inside.
const INSIDE: f32 = 0.35;
/// What places in the tree frame are rounded by: a piece lies in its own plane.
const ROUNDING: f32 = 1e-5;

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

/// What is drawn on a plane, and where.
struct Sheet {
    frame: Frame,
    shown: Vec<usize>,
    foliage: bool,
}

/// The planes of a cover, laid out: how large their pictures are is known before they are drawn.
pub struct Layout {
    pieces: Pieces,
    sheets: Vec<Sheet>,
}

impl Layout {
    /// Finds out what each plane of a cover of a model shows.
    pub fn new(model: &[Quad], cover: &Cover) -> Self {
        let longest = (0.9 * cover.epsilon).max(0.01);
        let pieces = Pieces::new(model, longest, 0.02 * longest);
        let all = 0..pieces.list.len();
        let is_wood = |index: usize| pieces.list[index].quad.corners[0].foliage <= 0.5;
        let has_leaves = all.clone().any(|index| !is_wood(index));
        let middle = pieces.vertices.iter().sum::<Vec3>() / pieces.vertices.len().max(1) as f32;
        // How far each piece's farthest corner lies from each plane.
        let distances: Vec<Vec<f32>> = cover.foliage.iter().map(|plane| pieces.distances(plane)).collect();
        let nearest: Vec<f32> = all
            .clone()
            .map(|index| distances.iter().map(|of_plane| of_plane[index]).fold(f32::INFINITY, f32::min))
            .collect();
        let mut sheets = Vec::new();
        for (plane, distances) in cover.foliage.iter().zip(&distances) {
            // A piece between two planes that is within ε of neither is drawn on the nearer.
            // A rock is solid: a plane through its inside shows all of it.
            let is_inside = plane.distance(middle) < INSIDE * cover.radius;
            let reach = |index: usize| match (has_leaves, is_wood(index)) {
                (true, true) => cover.epsilon,
                _ if cover.shows_all() => f32::INFINITY,
                (false, _) if is_inside => f32::INFINITY,
                _ => nearest[index].max(cover.epsilon),
            };
            let is_shown = |&index: &usize| distances[index] <= reach(index) + ROUNDING;
            let shown: Vec<usize> = all.clone().filter(is_shown).collect();
            // Branches do not make a picture larger: the cardboard shows them, too.
            let framed = || shown.iter().copied().filter(|&index| !has_leaves || !is_wood(index));
            if let Some(frame) = Frame::round(&pieces, plane, framed) {
                sheets.push(Sheet { frame, shown, foliage: has_leaves });
            }
        }
        let is_cardboard = |&index: &usize| {
            let places = pieces.list[index].quad.places();
            is_wood(index) && places.into_iter().all(|place| cover.shows_wood(place))
        };
        let wood: Vec<usize> = all.filter(is_cardboard).collect();
        for plane in &cover.wood {
            if let Some(frame) = Frame::round(&pieces, plane, || wood.iter().copied()) {
                sheets.push(Sheet { frame, shown: wood.clone(), foliage: false });
            }
        }
        Self { pieces, sheets }
    }

    /// Width and height of all pictures at `texels` per height of the tree.
    pub fn sizes(&self, texels: f32) -> Vec<[u32; 2]> {
        self.sheets.iter().map(|sheet| sheet.frame.texels(texels).map(|length| length as u32)).collect()
    }

    /// Draws all planes at `texels` per height of the tree.
    pub fn draw(&self, sprites: &Atlas, texels: f32) -> Vec<Drawn> {
        self.sheets.iter().map(|sheet| draw_sheet(&self.pieces, sheet, sprites, texels)).collect()
    }
}

fn draw_sheet(pieces: &Pieces, sheet: &Sheet, sprites: &Atlas, texels: f32) -> Drawn {
    let Sheet { frame, shown, foliage } = sheet;
    let [width, height] = frame.texels(texels);
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
    let brightest = raster.samples.iter().flatten().map(|fragment| fragment.shade).fold(0.0, f32::max);
    let corners = attributes(&raster, frame, brightest, *foliage);
    let mut rgba = Vec::with_capacity(width * height * 4);
    for row in 0..height {
        for column in 0..width {
            let (mut sum, mut count) = (Vec3::ZERO, 0);
            for sample in 0..FINE * FINE {
                let at = (row * FINE + sample / FINE) * raster.width + column * FINE + sample % FINE;
                if let Some(fragment) = &raster.samples[at] {
                    // The picture holds light and dark within it, the corners the brightest of it.
                    sum += fragment.colour * (brightness(fragment.shade) / brightness(brightest));
                    count += 1;
                }
            }
            let mean = sum / count.max(1) as f32;
            rgba.extend(mean.to_array().map(|value| value.round().clamp(0.0, 255.0) as u8));
            rgba.push((count * 255 / (FINE * FINE)) as u8);
        }
    }
    Drawn { quad: Quad { corners }, width, height, rgba }
}

impl Frame {
    /// The rectangle round pieces on a plane, upright where it can be.
    fn round<I: Iterator<Item = usize>>(
        pieces: &Pieces,
        plane: &Plane,
        framed: impl Fn() -> I,
    ) -> Option<Self> {
        let normal = plane.normal;
        let upright = Vec3::NEG_Z + normal * normal.z;
        let down = if upright.length() > 0.05 { upright.normalize() } else { Vec3::NEG_Y };
        let down = (down - normal * normal.dot(down)).normalize();
        let right = normal.cross(down);
        // Who sees `right` to the right and `down` below looks against the normal.
        let places = || {
            framed()
                .flat_map(|index| pieces.list[index].quad.places())
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

impl Frame {
    /// Width and height of its picture at `texels` per height of the tree.
    fn texels(&self, texels: f32) -> [usize; 2] {
        self.size.map(|extent| ((extent * texels).ceil() as usize + 1).clamp(4, 1024))
    }
}

/// Corners of the plane's quad: upper left, upper right, lower right, lower left, with what the
/// mean normal near each has in the plane.
fn attributes(raster: &Raster, frame: &Frame, shade: f32, foliage: bool) -> [Corner; 4] {
    let mut sums = [(0.0_f32, Vec3::ZERO); 4];
    for (index, fragment) in raster.samples.iter().enumerate() {
        let Some(Fragment { normal, .. }) = fragment else { continue };
        let x = (index % raster.width) as f32 / raster.width as f32;
        let y = (index / raster.width) as f32 / raster.height as f32;
        let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), x * y, (1.0 - x) * y];
        for (sum, weight) in sums.iter_mut().zip(weights) {
            let weight = weight * weight;
            sum.0 += weight;
            sum.1 += normal.normalize_or_zero() * weight;
        }
    }
    let mut corners = [Corner::default(); 4];
    for (index, (corner, (weight, normal))) in corners.iter_mut().zip(sums).enumerate() {
        let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]][index];
        let place =
            frame.corner + frame.right * (uv[0] * frame.size[0]) + frame.down * (uv[1] * frame.size[1]);
        *corner = Corner {
            position: place.to_array(),
            uv,
            normal: in_plane(normal / weight.max(1e-6), frame.normal).to_array(),
            shade,
            foliage: if foliage { 1.0 } else { 0.0 },
        };
    }
    corners
}

/// The mean near a corner is less than what the corner itself should have.
const OUTWARD: f32 = 1.8;

/// What of a normal lies in a plane, a little upwards: a picture is seen from both sides, and which of
/// them is bright follows from where the eye is. One that lies flat is seen from above.
fn in_plane(normal: Vec3, plane: Vec3) -> Vec3 {
    let across = plane * normal.dot(plane) * (1.0 - plane.z.abs());
    let along = (normal - across) * OUTWARD + Vec3::new(0.0, 0.0, 0.1);
    along.clamp_length_max(1.0)
}
