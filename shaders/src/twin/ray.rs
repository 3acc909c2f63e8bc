//! Twin of `ray.wgsl`: view rays, and what a leaf makes of them.

use crate::layout::{Leaf, View};
use glam::{BVec2, IVec2, UVec2, Vec2, Vec3, Vec4, Vec4Swizzles};

/// x(s) = origin + s·direction, metres, east-north-up at the eye.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where s is 0.
    pub origin: Vec3,
    /// Unit vector in a scene; in a height field as long as makes its forward part 1.
    pub direction: Vec3,
}

/// u and v in cells from the leaf's `eye_cell`, h in metres; each constant, s, s².
#[derive(Clone, Copy, Debug)]
pub struct LeafRay {
    /// Along the tile's rows.
    pub u: Vec3,
    /// Along its columns.
    pub v: Vec3,
    /// Height.
    pub h: Vec3,
}

/// A stretch of a ray that is straight in u and v, from r = 0 to `length`.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// u and v are measured from this cell of the tile.
    pub cell: IVec2,
    /// u and v at r = 0.
    pub place: Vec2,
    /// Cells per unit of r; exactly 0 where the ray never crosses that axis.
    pub slope: Vec2,
    /// 1 / slope, 0 where that is 0.
    pub inverse: Vec2,
    /// h: constant, r, r².
    pub height: Vec3,
    /// Its end.
    pub length: f32,
    /// No height in the leaf is greater.
    pub ceiling: f32,
    /// The leaf's cells: first ≤ cell < end.
    pub first: IVec2,
    /// Past the last of them.
    pub end: IVec2,
}

/// Slopes below this cross no cell within any distance there is.
pub const LEAST_SLOPE: f32 = 1.0e-18;
/// A segment is never longer, metres.
pub const LONGEST: f32 = 2.0e7;

/// Cells are counted no farther than this from the eye's, nor the eye's from the tile: sums of two fit 32 bits.
pub const FARTHEST_CELL: Vec2 = Vec2::splat(1.0e9);

/// Place of a pixel's centre in the picture, −1…1, right and up.
pub fn picture_place(view: &View, pixel: UVec2) -> Vec2 {
    let place = (pixel.as_vec2() + 0.5) * 2.0 / UVec2::from_array(view.size).as_vec2() - 1.0;
    Vec2::new(place.x, -place.y)
}

fn quadratic_along(gradient: Vec4, second: Vec4, cross: Vec2, ray: &Ray, solid: bool) -> Vec3 {
    let d = ray.direction;
    let bent = Vec3::new(
        second.x * d.x + 0.5 * (second.w * d.y + cross.x * d.z),
        second.y * d.y + 0.5 * (second.w * d.x + cross.y * d.z),
        second.z * d.z + 0.5 * (cross.x * d.x + cross.y * d.y),
    );
    if solid {
        return Vec3::new(gradient.w, gradient.xyz().dot(d), d.dot(bent));
    }
    let o = ray.origin;
    let half_value = Vec3::new(
        second.x * o.x + 0.5 * (second.w * o.y + cross.x * o.z),
        second.y * o.y + 0.5 * (second.w * o.x + cross.y * o.z),
        second.z * o.z + 0.5 * (cross.x * o.x + cross.y * o.y),
    );
    Vec3::new(
        gradient.w + gradient.xyz().dot(o) + o.dot(half_value),
        gradient.xyz().dot(d) + 2.0 * o.dot(bent),
        d.dot(bent),
    )
}

/// The leaf's coordinates along a ray.
pub fn along_leaf(leaf: &Leaf, ray: &Ray, solid: bool) -> LeafRay {
    let vector = Vec4::from_array;
    let cross = vector(leaf.uv_cross);
    let h_cross = vector(leaf.h_cross_maximum_fade);
    LeafRay {
        u: quadratic_along(vector(leaf.u_gradient), vector(leaf.u_second), cross.xy(), ray, solid),
        v: quadratic_along(vector(leaf.v_gradient), vector(leaf.v_second), cross.zw(), ray, solid),
        h: quadratic_along(vector(leaf.h_gradient), vector(leaf.h_second), h_cross.xy(), ray, solid),
    }
}

/// Value at s.
pub fn quadratic_at(q: Vec3, s: f32) -> f32 {
    q.x + s * (q.y + s * q.z)
}

/// The longest stretch whose chord is nowhere more than 1/16 cell off.
pub fn straight_length(along: &LeafRay) -> f32 {
    let bend = along.u.z.abs().max(along.v.z.abs());
    (0.5 / bend.max(1.0e-20).sqrt()).min(LONGEST)
}

/// The chord from s to s + length. Neighbouring segments share their ends; h stays exact.
pub fn segment_of(along: &LeafRay, s: f32, length: f32, leaf: &Leaf) -> Segment {
    let place = Vec2::new(quadratic_at(along.u, s), quadratic_at(along.v, s));
    let whole = place.floor().clamp(-FARTHEST_CELL, FARTHEST_CELL);
    let ends = 2.0 * s + length;
    let slope = Vec2::new(along.u.y + along.u.z * ends, along.v.y + along.v.z * ends);
    let crosses = slope.abs().cmpgt(Vec2::splat(LEAST_SLOPE));
    Segment {
        cell: IVec2::from_array(leaf.eye_cell) + whole.as_ivec2(),
        place: place - whole,
        slope: Vec2::select(crosses, slope, Vec2::ZERO),
        inverse: Vec2::select(crosses, 1.0 / Vec2::select(crosses, slope, Vec2::ONE), Vec2::ZERO),
        height: Vec3::new(quadratic_at(along.h, s), along.h.y + 2.0 * along.h.z * s, along.h.z),
        length,
        ceiling: leaf.h_cross_maximum_fade[2],
        first: UVec2::from_array(leaf.first_cell).as_ivec2(),
        end: (UVec2::from_array(leaf.first_cell) + UVec2::from_array(leaf.cells)).as_ivec2(),
    }
}

/// Where the ray crosses integer lines of the tile, along u and along v; `length` where it never does.
pub fn crossings(segment: &Segment, lines: IVec2) -> Vec2 {
    let r = ((lines - segment.cell).as_vec2() - segment.place) * segment.inverse;
    Vec2::select(stands(segment), Vec2::splat(segment.length), r)
}

/// The cell at r: the clamped floor, low ≤ cell < high.
pub fn cell_at(segment: &Segment, r: f32, low: IVec2, high: IVec2) -> IVec2 {
    let least = (low - segment.cell).as_vec2();
    let greatest = (high - 1 - segment.cell).as_vec2();
    let place = (segment.place + r * segment.slope).floor().clamp(least, greatest);
    (segment.cell + place.as_ivec2()).clamp(low, high - 1)
}

/// Along which axes the ray never crosses a line.
pub fn stands(segment: &Segment) -> BVec2 {
    segment.slope.cmpeq(Vec2::ZERO)
}
