// A box of the ground: a rectangle of a map between two heights, as the eye sees it.

// East-north-up at the eye, metres from it; conservative by `pad`.
struct GroundBox {
    corners: array<vec3<f32>, 8>,
    // How far the ground may bulge beyond the corners' hull, and what f32 may lose, metres.
    pad: f32,
}

// Least and greatest of something; least > greatest: nothing.
const NO_RANGE: vec2<f32> = vec2<f32>(3.0e38, -3.0e38);
// What f32 loses, of the metres at hand.
const ROUNDING: f32 = 1.0e-6;
// Metres by which the ground's radius of curvature is at least so long.
const LEAST_RADIUS: f32 = 6.33e6;
const GREATEST_RADIUS: f32 = 6.41e6;

// Between two heights over a rectangle of a map, in cells from the map's corner.
fn ground_box(map: u32, low: vec2<f32>, high: vec2<f32>, range: vec2<f32>) -> GroundBox {
    var box: GroundBox;
    let span = stack.levels[map].span;
    let start = (low - stack.levels[map].eye) * span;
    let end = (high - stack.levels[map].eye) * span;
    for (var corner = 0u; corner < 8u; corner++) {
        let east = select(start.x, end.x, (corner & 1u) != 0u);
        let south = select(start.y, end.y, (corner & 2u) != 0u);
        box.corners[corner] = enu_from_place(stack.eye, east, -south, select(range.x, range.y, (corner & 4u) != 0u));
    }
    // An arc of angle δ and radius r rises by less than r·δ²/8 over its chord: along the meridian and the parallel.
    let side = end - start;
    let cosine = min(stack.eye.y + max(abs(start.y), abs(end.y)), 1.0);
    let bulge = 0.125 * GREATEST_RADIUS * ((side.y * side.y) + (cosine * side.x * side.x));
    // The eye's place in the map is rounded to some 4e-6 cells.
    box.pad = bulge + (span * LEAST_RADIUS * 4.0e-6) + (ROUNDING * length(box.corners[0])) + 0.01;
    return box;
}

// Least and greatest distance from a point (metres, in the box's axes).
fn distance_range(box: GroundBox, origin: vec3<f32>) -> vec2<f32> {
    var low = vec3<f32>(ENDLESS);
    var high = vec3<f32>(-ENDLESS);
    var far = 0.0;
    for (var corner = 0u; corner < 8u; corner++) {
        let place = box.corners[corner] - origin;
        low = min(low, place);
        high = max(high, place);
        far = max(far, length(place));
    }
    let outside = max(max(low, -high), vec3<f32>(0.0));
    return vec2<f32>(max(length(outside) - box.pad, 0.0), far + box.pad);
}

// Whether a box is quite outside one of the picture's four sides as seen from a point, each side's tangent
// larger by `widening`.
fn outside_picture(box: GroundBox, origin: vec3<f32>, widening: f32) -> bool {
    let right = length(view.right.xyz);
    let up = length(view.up.xyz);
    let forward = view.forward.xyz * widening;
    let sides = array<vec3<f32>, 4>(
        normalize((forward * right) + (view.right.xyz / right)),
        normalize((forward * right) - (view.right.xyz / right)),
        normalize((forward * up) + (view.up.xyz / up)),
        normalize((forward * up) - (view.up.xyz / up)),
    );
    var most = vec4<f32>(-ENDLESS);
    for (var corner = 0u; corner < 8u; corner++) {
        let place = box.corners[corner] - origin;
        most = max(most, vec4<f32>(
            dot(sides[0], place),
            dot(sides[1], place),
            dot(sides[2], place),
            dot(sides[3], place),
        ));
    }
    return any(most < vec4<f32>(-box.pad));
}

// What is before this plane counts, of the metres to the box's far end.
const NEAR_PLANE: f32 = 1.0e-4;

// The picture's rectangle that a box covers, −1…1 right and up: least x, y, greatest x, y; least > greatest where it
// is behind the eye.
fn picture_rectangle(box: GroundBox, far: f32) -> vec4<f32> {
    let right = view.right.xyz / dot(view.right.xyz, view.right.xyz);
    let up = view.up.xyz / dot(view.up.xyz, view.up.xyz);
    let pad = box.pad * vec2<f32>(length(right), length(up));
    let near = NEAR_PLANE * far;
    var seen: array<vec3<f32>, 8>;
    for (var corner = 0u; corner < 8u; corner++) {
        let place = box.corners[corner];
        // The padded box's nearest: where it is cut by the plane, the cut is on its far side.
        seen[corner] = vec3<f32>(dot(right, place), dot(up, place), dot(view.forward.xyz, place) + box.pad);
    }
    var low = vec2<f32>(ENDLESS);
    var high = vec2<f32>(-ENDLESS);
    for (var corner = 0u; corner < 8u; corner++) {
        let a = seen[corner];
        if a.z >= near {
            let depths = vec2<f32>(max(a.z - (2.0 * box.pad), near), a.z);
            low = min(low, min((a.xy - pad) / depths.x, (a.xy - pad) / depths.y));
            high = max(high, max((a.xy + pad) / depths.x, (a.xy + pad) / depths.y));
        }
        // The three edges that lead to corners of a higher index.
        for (var axis = 1u; axis <= 4u; axis <<= 1u) {
            if (corner & axis) == 0u {
                let b = seen[corner | axis];
                if (a.z >= near) != (b.z >= near) {
                    let share = (near - a.z) / (b.z - a.z);
                    let cut = mix(a.xy, b.xy, vec2<f32>(share));
                    low = min(low, (cut - pad) / near);
                    high = max(high, (cut + pad) / near);
                }
            }
        }
    }
    return vec4<f32>(low, high);
}

// The same in texels of the pyramid's mip 0, inclusive; x > z where none of it is in the picture. `slack` in pixels.
fn pyramid_rectangle(rectangle: vec4<f32>, slack: f32) -> vec4<i32> {
    let size = vec2<f32>(view.size);
    let clamped = clamp(rectangle, vec4<f32>(-2.0), vec4<f32>(2.0));
    // Rows go down; a quad begins half a pixel before a pixel's corner.
    let west_north = (vec2<f32>(clamped.x, -clamped.w) + 1.0) * 0.5 * size;
    let east_south = (vec2<f32>(clamped.z, -clamped.y) + 1.0) * 0.5 * size;
    let first = vec2<i32>(floor((west_north + (0.5 - slack)) * 0.5));
    let last = vec2<i32>(floor((east_south + (0.5 + slack)) * 0.5));
    let end = vec2<i32>(mip_size(0u)) - 1;
    let beside = any(rectangle.xy > rectangle.zw) || any(last < vec2<i32>(0)) || any(first > end);
    if beside {
        return vec4<i32>(1, 1, 0, 0);
    }
    return vec4<i32>(max(first, vec2<i32>(0)), min(last, end));
}

// Texels that a search may look at; one that has not ended by then has found something, to be safe.
const SEARCH_LIMIT: u32 = 512u;

// Whether distances from `range.x` to `range.y` show in a rectangle of the pyramid: in its gaps, or anywhere.
// From the mip on which the rectangle is one texel down, in order of quadrants, back up by their bits.
fn shows(rectangle: vec4<i32>, range: vec2<f32>, gaps: bool) -> bool {
    let low = vec2<u32>(rectangle.xy);
    let high = vec2<u32>(rectangle.zw);
    let apart = (low.x ^ high.x) | (low.y ^ high.y);
    var mip = 0u;
    if apart != 0u {
        mip = firstLeadingBit(apart) + 1u;
    }
    let top = mip;
    var texel = low >> vec2<u32>(mip);
    for (var count = 0u; count < SEARCH_LIMIT; count++) {
        let first = texel << vec2<u32>(mip);
        let last = first + ((1u << mip) - 1u);
        if all(first <= high) && all(last >= low) {
            let distances = load_distances(mip, texel);
            let found = select(distances.zw, distances.xy, gaps);
            if found.x <= range.y && found.y >= range.x {
                if mip == 0u {
                    return true;
                }
                mip -= 1u;
                texel *= 2u;
                continue;
            }
        }
        while mip < top && all((texel & vec2<u32>(1u)) == vec2<u32>(1u)) {
            mip += 1u;
            texel >>= vec2<u32>(1u);
        }
        if mip == top {
            return false;
        }
        if (texel.x & 1u) == 0u {
            texel.x += 1u;
        } else {
            texel = vec2<u32>(texel.x - 1u, texel.y + 1u);
        }
    }
    return true;
}
