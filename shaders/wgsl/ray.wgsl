// View rays, and what a leaf makes of them.

// x(s) = origin + s·direction, metres, east-north-up at the eye.
struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
}

// u and v in cells from the leaf's `eye_cell`, h in metres; each constant, s, s².
struct LeafRay {
    u: vec3<f32>,
    v: vec3<f32>,
    h: vec3<f32>,
}

// A stretch of a ray that is straight in u and v, from r = 0 to `length`.
struct Segment {
    // u and v are measured from this cell of the tile.
    cell: vec2<i32>,
    place: vec2<f32>,
    // Cells per unit of r; exactly 0 where the ray never crosses that axis.
    slope: vec2<f32>,
    inverse: vec2<f32>,
    // h: constant, r, r².
    height: vec3<f32>,
    length: f32,
    // No height in the leaf is greater.
    ceiling: f32,
    // The leaf's cells: first ≤ cell < end.
    first: vec2<i32>,
    end: vec2<i32>,
}

// Slopes below this cross no cell within any distance there is.
const LEAST_SLOPE: f32 = 1.0e-18;

// Cells are counted no farther than this from the eye's, nor the eye's from the tile: sums of two fit 32 bits.
const FARTHEST_CELL: f32 = 1.0e9;

// Place of a pixel's centre in the picture, −1…1, right and up.
fn picture_place(pixel: vec2<u32>) -> vec2<f32> {
    let place = (vec2<f32>(pixel) + 0.5) * 2.0 / vec2<f32>(view.size) - 1.0;
    return vec2<f32>(place.x, -place.y);
}

// second: xx, yy, zz, xy; cross: xz, yz.
fn quadratic_along(gradient: vec4<f32>, second: vec4<f32>, cross: vec2<f32>, ray: Ray) -> vec3<f32> {
    let d = ray.direction;
    let bent = vec3<f32>(
        second.x * d.x + 0.5 * (second.w * d.y + cross.x * d.z),
        second.y * d.y + 0.5 * (second.w * d.x + cross.y * d.z),
        second.z * d.z + 0.5 * (cross.x * d.x + cross.y * d.y),
    );
    if SOLID {
        return vec3<f32>(gradient.w, dot(gradient.xyz, d), dot(d, bent));
    }
    // Only height fields have rays that start beside the eye.
    let o = ray.origin;
    let half_value = vec3<f32>(
        second.x * o.x + 0.5 * (second.w * o.y + cross.x * o.z),
        second.y * o.y + 0.5 * (second.w * o.x + cross.y * o.z),
        second.z * o.z + 0.5 * (cross.x * o.x + cross.y * o.y),
    );
    return vec3<f32>(
        gradient.w + dot(gradient.xyz, o) + dot(o, half_value),
        dot(gradient.xyz, d) + 2.0 * dot(o, bent),
        dot(d, bent),
    );
}

fn along_leaf(leaf: Leaf, ray: Ray) -> LeafRay {
    return LeafRay(
        quadratic_along(leaf.u_gradient, leaf.u_second, leaf.uv_cross.xy, ray),
        quadratic_along(leaf.v_gradient, leaf.v_second, leaf.uv_cross.zw, ray),
        quadratic_along(leaf.h_gradient, leaf.h_second, leaf.h_cross_maximum_fade.xy, ray),
    );
}

fn quadratic_at(q: vec3<f32>, s: f32) -> f32 {
    return q.x + s * (q.y + s * q.z);
}

// A segment is never longer, metres: no ray has more of the ellipsoid before it.
const LONGEST: f32 = 2.0e7;

// The longest stretch whose chord is nowhere more than 1/16 cell off: a chord of length l strays by a·l²/4.
fn straight_length(along: LeafRay) -> f32 {
    let bend = max(abs(along.u.z), abs(along.v.z));
    return min(0.5 * inverseSqrt(max(bend, 1.0e-20)), LONGEST);
}

// The chord from s to s + length. Neighbouring segments share their ends; h stays exact.
fn segment_of(along: LeafRay, s: f32, length: f32, leaf: Leaf) -> Segment {
    var segment: Segment;
    let place = vec2<f32>(quadratic_at(along.u, s), quadratic_at(along.v, s));
    let whole = clamp(floor(place), vec2<f32>(-FARTHEST_CELL), vec2<f32>(FARTHEST_CELL));
    segment.cell = leaf.eye_cell + vec2<i32>(whole);
    segment.place = place - whole;
    let ends = 2.0 * s + length;
    let slope = vec2<f32>(along.u.y + along.u.z * ends, along.v.y + along.v.z * ends);
    let crosses = abs(slope) > vec2<f32>(LEAST_SLOPE);
    segment.slope = select(vec2<f32>(0.0), slope, crosses);
    segment.inverse = select(vec2<f32>(0.0), 1.0 / select(vec2<f32>(1.0), slope, crosses), crosses);
    segment.height = vec3<f32>(quadratic_at(along.h, s), along.h.y + 2.0 * along.h.z * s, along.h.z);
    segment.length = length;
    segment.ceiling = leaf.h_cross_maximum_fade.z;
    segment.first = vec2<i32>(leaf.first_cell);
    segment.end = vec2<i32>(leaf.first_cell + leaf.cells);
    return segment;
}

// The cell at r: the clamped floor, low ≤ cell < high.
fn cell_at(segment: Segment, r: f32, low: vec2<i32>, high: vec2<i32>) -> vec2<i32> {
    let least = vec2<f32>(low - segment.cell);
    let greatest = vec2<f32>(high - 1 - segment.cell);
    let place = clamp(floor(segment.place + r * segment.slope), least, greatest);
    return clamp(segment.cell + vec2<i32>(place), low, high - 1);
}

// Where the ray crosses integer lines of the tile, along u and along v; `length` where it never does.
fn crossings(segment: Segment, lines: vec2<i32>) -> vec2<f32> {
    let r = (vec2<f32>(lines - segment.cell) - segment.place) * segment.inverse;
    return select(vec2<f32>(segment.length), r, segment.slope != vec2<f32>(0.0));
}
