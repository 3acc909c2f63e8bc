// The exact bilinear patch of one cell.

// Nodes are north-west, north-east, south-west, south-east; place is 0…1 along u and v. Weights rather than
// differences: on an edge the value depends, bit for bit, on that edge's two nodes alone.
fn patch_height(nodes: vec4<f32>, place: vec2<f32>) -> f32 {
    let far = 1.0 - place;
    return far.y * (far.x * nodes.x + place.x * nodes.y) + place.y * (far.x * nodes.z + place.x * nodes.w);
}

// Height of the ray above the patch from `place` on, as constant, r, r².
fn ray_minus_patch(
    nodes: vec4<f32>,
    place: vec2<f32>,
    slope: vec2<f32>,
    height: f32,
    rise: f32,
    curvature: f32,
) -> vec3<f32> {
    let east_north = nodes.y - nodes.x;
    let south_west = nodes.z - nodes.x;
    let twist = (nodes.w - nodes.z) - east_north;
    return vec3<f32>(
        height - patch_height(nodes, place),
        rise - ((east_north + twist * place.y) * slope.x + (south_west + twist * place.x) * slope.y),
        curvature - twist * slope.x * slope.y,
    );
}

// The first r in 0…length at which f, not negative at 0, becomes negative; −1 where it does not.
// Stable: no difference of nearly equal numbers but the discriminant's own; no division that can overflow.
fn first_crossing(f: vec3<f32>, length: f32) -> f32 {
    let c = f.x;
    let b = f.y;
    let a = f.z;
    let discriminant = b * b - 4.0 * a * c;
    if discriminant >= 0.0 {
        let root = sqrt(discriminant);
        if b < 0.0 {
            let q = 0.5 * (root - b);
            if c <= q * length {
                return min(c / q, length);
            }
        } else if a < 0.0 {
            let q = 0.5 * (b + root);
            if q <= -a * length {
                return min(q / -a, length);
            }
        }
    }
    // A change of sign is a crossing even where rounding loses the root.
    return select(-1.0, length, c + length * (b + length * a) < 0.0);
}
