// The height-field pass: one leaf, a plane, rays that start on the sheet's base plane.

// Write the number of texel fetches.
override COUNT_FETCHES: bool = true;

// A ray that starts inside the field's box begins low: near an eye on the ground, high nodes are in the way.
const LOW_LEVEL: u32 = 2u;

struct Targets {
    // Ray parameter from the base plane, in units of the forward axis; negative: a miss.
    @location(0) parameter: f32,
    @location(1) hit: vec4<u32>,
}

@fragment
fn height_field(@builtin(position) position: vec4<f32>) -> Targets {
    let place = picture_place(vec2<u32>(position.xy));
    let across = place.x * view.right.xyz + place.y * view.up.xyz;
    let ray = Ray(sheet.base * across, view.forward.xyz + across);
    let leaf = leaves[0];
    let segment = segment_of(along_leaf(leaf, ray), 0.0, leaf.distance_range.y, leaf);

    // Where the ray is over the cells.
    let forward = segment.slope > vec2<f32>(0.0);
    let near = crossings(segment, select(segment.end, segment.first, forward));
    let far = crossings(segment, select(segment.first, segment.end, forward));
    let low = vec2<f32>(segment.first - segment.cell) - segment.place;
    let high = vec2<f32>(segment.end - segment.cell) - segment.place;
    let stands = segment.slope == vec2<f32>(0.0);
    let beside = stands & ((low > vec2<f32>(0.0)) | (high < vec2<f32>(0.0)));
    let begins = select(near, vec2<f32>(0.0), stands);
    let start = max(max(begins.x, begins.y), 0.0);
    var carried = Carried(select(SIDE_UNKNOWN, SIDE_AT_EYE, start == 0.0), 0u);
    var crossing = Crossing(false, 0.0, vec2<i32>(0));
    if !any(beside) && start <= min(min(far.x, far.y), segment.length) {
        let entered = select(vec2<i32>(0), direction_of(forward), (begins == vec2<f32>(start)) & (begins > vec2<f32>(0.0)));
        let top = textureNumLevels(maxima);
        let level = select(top, min(LOW_LEVEL, top), start == 0.0);
        crossing = max_mip(segment, leaf.slot, top, level, start, entered, &carried);
    }
    let fetches = select(0u, min(carried.fetches, 0xffffu), COUNT_FETCHES);
    if !crossing.hit {
        return Targets(-1.0, vec4<u32>(EMPTY, 0u, 0u, fetches));
    }
    let at = vec2<f32>(segment.cell) + segment.place + crossing.r * segment.slope;
    return Targets(crossing.r, vec4<u32>(0u, bitcast<vec2<u32>>(at), fetches));
}
