// The terrain pass: a ray a pixel, from leaf to leaf through the page table.

// Write the number of texel fetches.
override COUNT_FETCHES: bool = true;

// Bounds that only a defect, or a ray that grazes one edge for thousands of kilometres, could reach.
const LEAF_LIMIT: u32 = 4096u;
const SEGMENT_LIMIT: u32 = 256u;
// A ray goes on by at least this, relative and in metres, from leaf to leaf: where two frames disagree about
// an edge by a hair, they cannot send it to and fro.
const LEAST_ADVANCE: vec2<f32> = vec2<f32>(2.4e-7, 1.0e-5);
// There is no ground below this, metres.
const LOWEST: f32 = -2.0e4;
// Where a ray comes into a leaf near the ground.
const LOW_LEVEL: u32 = 2u;

struct Hit {
    // Metres from the eye; negative: a miss.
    distance: f32,
    leaf: u32,
    // Cells of the leaf's tile.
    place: vec2<f32>,
    fetches: u32,
}

struct Targets {
    @location(0) distance: f32,
    @location(1) hit: vec4<u32>,
}

fn view_ray(pixel: vec2<u32>) -> Ray {
    let place = picture_place(pixel);
    let direction = view.forward.xyz + place.x * view.right.xyz + place.y * view.up.xyz;
    return Ray(vec3<f32>(0.0), normalize(direction));
}

// 0…1, of a pixel: which leaf of a fading pair it sees.
fn pixel_share(pixel: vec2<u32>) -> f32 {
    var x = (pixel.x * 0x9e3779b1u) ^ (pixel.y * 0x85ebca77u);
    x = (x ^ (x >> 15u)) * 0x2c1b3c6du;
    x = (x ^ (x >> 12u)) * 0x297a2d39u;
    return f32((x ^ (x >> 15u)) >> 8u) * 0x1p-24;
}

fn missed(fetches: u32) -> Hit {
    return Hit(-1.0, EMPTY, vec2<f32>(0.0), fetches);
}

// Where a segment leaves a box given in cells from the segment's own cell.
fn leave_box(segment: Segment, low: vec2<f32>, high: vec2<f32>) -> Crossing {
    let forward = segment.slope > vec2<f32>(0.0);
    let raw = (select(low, high, forward) - segment.place) * segment.inverse;
    let exits = select(vec2<f32>(segment.length), raw, segment.slope != vec2<f32>(0.0));
    let nearest = min(exits.x, exits.y);
    if nearest >= segment.length {
        return Crossing(false, segment.length, vec2<i32>(0));
    }
    let crossed = exits <= vec2<f32>(nearest);
    return Crossing(false, max(nearest, 0.0), select(vec2<i32>(0), direction_of(forward), crossed));
}

fn cast_ray(ray: Ray, share: f32) -> Hit {
    var s = 0.0;
    var grid = view.eye_grid;
    var carried = Carried(SIDE_AT_EYE, 0u);
    if view.eye_inside == 0u || view.up.w > view.forward.w {
        let entry = enter_grid(ray);
        if !entry.found {
            return missed(0u);
        }
        s = entry.s;
        grid = entry.grid;
        carried.side = SIDE_UNKNOWN;
    }
    for (var count = 0u; count < LEAF_LIMIT; count++) {
        let square = find_square(grid);
        let is_empty = square.entry == EMPTY;
        var index = square.entry & ~LEAF_BIT;
        if is_empty {
            index = root_index(grid);
            carried.side = SIDE_UNKNOWN;
        } else if leaves[index].stand_in != EMPTY && share >= leaves[index].h_cross_maximum_fade.w {
            index = leaves[index].stand_in;
        }
        let leaf = leaves[index];
        let along = along_leaf(leaf, ray);
        let stretch = straight_length(along);
        let top = min(firstLeadingBit(max(min(leaf.cells.x, leaf.cells.y), 1u)), textureNumLevels(maxima));
        // The square in cells of the frame's tile, from `eye_cell`.
        var low = vec2<f32>(vec2<i32>(leaf.first_cell) - leaf.eye_cell);
        var sides = vec2<f32>(leaf.cells);
        if is_empty {
            let unit = sides / f32(1u << ROOT_BITS);
            low += vec2<f32>(square.origin & vec2<u32>((1u << ROOT_BITS) - 1u)) * unit;
            sides = f32(square.side) * unit;
        }
        let came = s;
        var step = vec2<i32>(0);
        for (var part = 0u; part < SEGMENT_LIMIT; part++) {
            let rise = along.h.y + 2.0 * along.h.z * s;
            let height = quadratic_at(along.h, s);
            // Over all there is, or through a void and out below.
            if (height > view.forward.w && rise >= 0.0) || (height < LOWEST && rise < 0.0) {
                return missed(carried.fetches);
            }
            let segment = segment_of(along, s, stretch, leaf);
            var crossing: Crossing;
            if is_empty {
                let offset = vec2<f32>(segment.cell - leaf.eye_cell);
                crossing = leave_box(segment, low - offset, low + sides - offset);
            } else {
                crossing = max_mip(segment, leaf.slot, top, min(LOW_LEVEL, top), 0.0, vec2<i32>(0), &carried);
            }
            let place = vec2<f32>(segment.cell) + segment.place + crossing.r * segment.slope;
            s += crossing.r;
            if crossing.hit {
                return Hit(s, index, place, carried.fetches);
            }
            step = crossing.step;
            if any(step != vec2<i32>(0)) {
                break;
            }
        }
        if all(step == vec2<i32>(0)) {
            break;
        }
        s = max(s, came + max(came * LEAST_ADVANCE.x, LEAST_ADVANCE.y));
        let place = vec2<f32>(quadratic_at(along.u, s), quadratic_at(along.v, s));
        let next = across_edge(square, step, (place - low) / sides);
        if !next.inside {
            return missed(carried.fetches);
        }
        grid = next.grid;
    }
    // Never reached by a ray that gets on; far haze hides one that does not.
    return missed(carried.fetches);
}

@fragment
fn terrain(@builtin(position) position: vec4<f32>) -> Targets {
    let pixel = vec2<u32>(position.xy);
    let hit = cast_ray(view_ray(pixel), pixel_share(pixel));
    let fetches = select(0u, min(hit.fetches, 0xffffu), COUNT_FETCHES);
    return Targets(hit.distance, vec4<u32>(hit.leaf, bitcast<vec2<u32>>(hit.place), fetches));
}
