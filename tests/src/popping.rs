//! How much a picture jumps between two frames of a flight, motion taken out.
//!
//! Each pixel of a frame is followed to the point of the height map's surface that it shows, and from there into the
//! frame before; where both see that point, colours are compared, the earlier ones between their four pixels. Single
//! pixels of a wood change all the time, as leaves smaller than they come and go under their centres; so what counts
//! is the mean change of blocks, signed before it is summed: what a tree that appears, or a stand that turns darker,
//! changes, and what shimmers does not.

use crate::approach::{Ground, Shown, direction};
use glam::DVec3;

/// Pixels along a side of the blocks whose colours are compared: half as long as a tree is tall where it comes out of
/// the canopy, as long, and twice as long.
pub const BLOCKS: [usize; 3] = [16, 32, 64];
/// Pixels along a side of the regions whose canopy is compared.
pub const REGION: usize = 64;
/// Two frames see the same point where its distance is the same but for this share, and metres: the surface may be of
/// another level of the matrix.
const SAME_POINT: (f64, f64) = (0.02, 12.0);

/// The difference of two frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jump {
    /// Mean over pixels and channels of the absolute difference, of 255: mostly shimmer.
    pub pixels: f64,
    /// The mean change of the block that changes most, of 255, by the size of blocks.
    pub blocks: [f64; BLOCKS.len()],
    /// The change of the mean height over the ground of what is drawn, metres, in the region where it is largest.
    pub canopy: f64,
    /// Share of the pixels that are compared.
    pub compared: f64,
}

impl Jump {
    /// The larger of each number.
    pub fn worst(self, other: Self) -> Self {
        Self {
            pixels: self.pixels.max(other.pixels),
            blocks: std::array::from_fn(|size| self.blocks[size].max(other.blocks[size])),
            canopy: self.canopy.max(other.canopy),
            compared: self.compared.min(other.compared),
        }
    }
}

/// What pixels of a block sum up to.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    values: DVec3,
    pixels: f64,
}

/// Sums by block.
struct Blocks {
    side: usize,
    columns: usize,
    sums: Vec<Sum>,
}

impl Blocks {
    fn new(side: usize, size: [usize; 2]) -> Self {
        let columns = size[0].div_ceil(side);
        Self { side, columns, sums: vec![Sum::default(); columns * size[1].div_ceil(side)] }
    }

    fn add(&mut self, column: usize, row: usize, values: DVec3) {
        let sum = &mut self.sums[row / self.side * self.columns + column / self.side];
        sum.values += values;
        sum.pixels += 1.0;
    }

    /// The largest mean over the channels of a block's mean change. A block that is mostly beside the other frame
    /// says little.
    fn most(&self) -> f64 {
        let whole = self.sums.iter().filter(|sum| 2.0 * sum.pixels >= (self.side * self.side) as f64);
        whole.map(|sum| (sum.values / sum.pixels).abs().element_sum() / 3.0).fold(0.0, f64::max)
    }
}

/// The place of a point in a frame: pixels from the centre of the first, and the distance from the eye.
fn place_in(frame: &Shown, point: DVec3) -> Option<(f64, f64, f64)> {
    let view = &frame.view;
    let offset = view.enu_from_ecef * (point - view.eye_ecef);
    let depth = offset.dot(view.forward);
    if depth <= 0.0 {
        return None;
    }
    let [width, height] = view.size.map(f64::from);
    let x = 0.5 * (offset.dot(view.right) / depth / view.tangent_x + 1.0) * width - 0.5;
    let y = 0.5 * (1.0 - offset.dot(view.up) / depth / view.tangent_y) * height - 0.5;
    let inside = x >= 0.0 && y >= 0.0 && x <= width - 1.0 && y <= height - 1.0;
    inside.then(|| (x, y, offset.length()))
}

/// Compares a frame with the one before it.
pub fn jump(before: &Shown, now: &Shown, ground: &Ground) -> Jump {
    let [width, height] = now.view.size.map(|side| side as usize);
    let ecef_from_enu = now.view.enu_from_ecef.transpose();
    let mut blocks = BLOCKS.map(|side| Blocks::new(side, [width, height]));
    let mut regions = Blocks::new(REGION, [width, height]);
    let (mut sum, mut count) = (0.0, 0);
    for (index, &distance) in now.surface.iter().enumerate().filter(|(_, distance)| **distance >= 0.0) {
        let (column, row) = (index % width, index / width);
        let point = now.view.eye_ecef + ecef_from_enu * (direction(&now.view, index) * f64::from(distance));
        let Some((x, y, away)) = place_in(before, point) else { continue };
        let nearest = y.round() as usize * width + x.round() as usize;
        let seen = f64::from(before.surface[nearest]);
        if seen < 0.0 || (seen - away).abs() > SAME_POINT.0 * away + SAME_POINT.1 {
            continue;
        }
        let difference = now.colours[index].as_dvec3() - colour_at(before, x, y);
        sum += difference.abs().element_sum();
        count += 1;
        for blocks in &mut blocks {
            blocks.add(column, row, difference);
        }
        if let (Some(now), Some(before)) = (canopy(now, index, ground), canopy(before, nearest, ground)) {
            // The same in all channels.
            regions.add(column, row, DVec3::splat(now - before));
        }
    }
    Jump {
        pixels: sum / (3.0 * f64::from(count.max(1))),
        blocks: blocks.map(|blocks| blocks.most()),
        canopy: regions.most(),
        compared: f64::from(count) / (width * height) as f64,
    }
}

/// The colour between the four pixels around a place.
fn colour_at(frame: &Shown, x: f64, y: f64) -> DVec3 {
    let [width, height] = frame.view.size.map(|side| side as usize);
    let (left, top) = ((x as usize).min(width - 2), (y as usize).min(height - 2));
    let at = |dx: usize, dy: usize| frame.colours[(top + dy) * width + left + dx].as_dvec3();
    let across = x - left as f64;
    let upper = at(0, 0).lerp(at(1, 0), across);
    upper.lerp(at(0, 1).lerp(at(1, 1), across), y - top as f64)
}

/// Height over the ground of what a pixel shows, metres.
fn canopy(frame: &Shown, index: usize, ground: &Ground) -> Option<f64> {
    let distance = f64::from(frame.drawn[index]);
    if !distance.is_finite() || distance < 0.0 {
        return None;
    }
    let place = frame.view.geodetic(direction(&frame.view, index) * distance);
    Some(place.height - ground.height(place.longitude, place.latitude)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use treeline_client::stream::view::ViewGeometry;
    use treeline_core::camera::GeographicCamera;

    /// A wall of one colour, so many metres before an eye that looks level to the north; `patch`: of another colour.
    fn wall(distance: f64, patch: bool) -> Shown {
        let camera = GeographicCamera {
            lon: 10.0,
            lat: 46.0 - distance / 111_200.0,
            height: 500.0,
            heading_deg: 0.0,
            pitch_deg: 0.0,
            fov_y_deg: 20.0,
        };
        let view = ViewGeometry::new(&camera, 128, 128);
        let surface: Vec<f32> =
            (0..128 * 128).map(|i| (distance / direction(&view, i).dot(view.forward)) as f32).collect();
        let is_other = |i: usize| patch && (48..80).contains(&(i % 128)) && (48..80).contains(&(i / 128));
        let colours = (0..128 * 128).map(|i| Vec3::splat(if is_other(i) { 160.0 } else { 100.0 })).collect();
        Shown { view, colours, drawn: surface.clone(), surface, trees: 0 }
    }

    fn flat() -> Ground {
        Ground::level([9.9, 45.9, 10.1, 46.1], 480.0)
    }

    #[test]
    fn motion_alone_is_no_jump_and_a_patch_that_appears_is() {
        let (far, near) = (wall(1_000.0, false), wall(990.0, false));
        let still = jump(&far, &near, &flat());
        assert!(still.compared > 0.95 && still.pixels < 1e-3 && still.canopy < 0.3, "{still:?}");
        let popped = jump(&far, &wall(990.0, true), &flat());
        assert!(popped.blocks[0] > 55.0 && popped.blocks[2] < 20.0, "{popped:?}");
        assert!(popped.pixels > 3.0 && popped.pixels < 5.0, "{popped:?}");
    }

    #[test]
    fn what_lies_elsewhere_is_not_compared_and_a_lower_canopy_is_seen() {
        let far = wall(1_000.0, false);
        let mut near = wall(990.0, false);
        for distance in &mut near.surface {
            *distance += 60.0;
        }
        assert_eq!(jump(&far, &near, &flat()).compared, 0.0);
        // What is drawn stands 50 m before the wall, where the lower rays are higher.
        let mut near = wall(990.0, false);
        for distance in &mut near.drawn {
            *distance -= 50.0;
        }
        let lower = jump(&far, &near, &flat());
        assert!(lower.canopy > 2.0 && lower.canopy < 9.0, "{lower:?}");
    }
}
