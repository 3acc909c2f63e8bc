// Crowns where the heights are too coarse to hold them: a ray that has met the smooth mean of the canopy is
// followed through the trees that stand there, the same ones as near the eye. Twin: `twin/crowns.rs`.
//
// Which species grows and how densely only the land cover says, which is not read here. Assumed are the
// scene's typical crown, and from the canopy's mean height a stand that is lower and thinner at once where the ground is
// forest, and hardly lower but far thinner where single trees stand on open ground.

// Rows of sub-cells that a ray is followed through at most.
const CROWN_ROWS: i32 = 8;
// The canopy's mean height in closed forest, over the height of its trees.
const CLOSED_CANOPY: f32 = 0.37;
// Height of the crown's rim, of the smallest and of the tallest tree of a stand, over the trees' mean height.
const CROWN_BASE: f32 = 0.2;
const LOWEST_TREE: f32 = 0.7;
const TALLEST_TREE: f32 = 1.3;
// Share of the candidates that live in closed forest of typical height, of 65536.
const CLOSED_SHARE: f32 = 52000.0;
// Length of a unit of place along a meridian, metres.
const PLACE_UNIT: f32 = 0.0093306;

// The trees about a point.
struct Stand {
    // Mean height of the trees, metres.
    height: f32,
    // Radius of a crown at its rim over the tree's height.
    crown_radius: f32,
    // Ranks below this live.
    share: u32,
    // Area under all crowns' discs over the ground's, their overlaps counted twice.
    cover: f32,
}

// A ray over the ground about the point where it has met the canopy's mean.
struct CanopyRay {
    // Place of the point, units of `core::seeds::place`.
    place: vec2<u32>,
    // The point's height over the ground, metres.
    height: f32,
    // Unit direction, east and south.
    along: vec2<f32>,
    // Metres that the ray falls towards the ground per metre along.
    fall: f32,
    // Metres per unit of place, east and south.
    unit_metres: vec2<f32>,
}

struct CrownHit {
    found: bool,
    // Nothing was found because the ray was not followed to the ground.
    cut_short: bool,
    // From the tree's axis to the point: unit vector, east and south.
    outward: vec2<f32>,
    // The crown's slope there, rise per metre towards the axis.
    steepness: f32,
    // Height over the ground in mean heights of the stand's trees.
    height: f32,
    // The tree's own, 0…1, alike for all sizes.
    tone: f32,
}

// The stand of a mean canopy height, metres. `closed`: share of the ground that is forest rather than open.
fn stand_of(canopy_height: f32, closed: f32) -> Stand {
    let typical = view.tree_size.x;
    let share_of_closed = max(canopy_height / (CLOSED_CANOPY * typical), 1e-3);
    let lower = mix(0.15, 0.35, closed);
    let height = typical * clamp(pow(share_of_closed, lower), 0.3, 1.6);
    let closure = min(pow(share_of_closed, 1.0 - lower), 1.0);
    // Lower stands are denser, as their crowns are narrower.
    let share = min(CLOSED_SHARE * closure * typical / height, 65536.0);
    let radius = view.tree_size.y * height;
    let sub_cell = PLACE_UNIT * f32(1u << SEED_CELL_BITS) / f32(SEED_ROWS);
    let cover = share / 65536.0 * PI * radius * radius / (sub_cell * sub_cell);
    return Stand(height, view.tree_size.y, u32(share), cover);
}

// Place of a point of the grid.
fn place_of_grid(unit: vec2<u32>) -> vec2<u32> {
    // A unit of place is 2^(root level − 5) units of the grid.
    if view.root_level >= 5u {
        return view.grid_place + (unit >> vec2<u32>(view.root_level - 5u));
    }
    return view.grid_place + (unit << vec2<u32>(5u - view.root_level));
}

// The height at which half of the rays of a fall have met a crown, in mean heights of the trees.
fn crown_meeting_height(fall: f32) -> f32 {
    return 0.70 - 0.085 * clamp(log2(fall), -4.0, 2.0);
}

// The first crown along a ray. Rays are followed from the tops down, row by row of sub-cells, and of every
// row the two trees nearest to the ray are tried.
fn first_crown(ray: CanopyRay, stand: Stand) -> CrownHit {
    var hit = CrownHit(false, false, vec2<f32>(0.0), 0.0, 0.0, 0.5);
    let cell = ray.place >> vec2<u32>(SEED_CELL_BITS);
    let own_row = seed_row(cell.y);
    if own_row.columns == 0u {
        return hit;
    }
    // In sub-cells of the point's cell, counted from its north-west corner.
    let counts = vec2<f32>(f32(own_row.columns), f32(SEED_ROWS));
    let cell_units = f32(1u << SEED_CELL_BITS);
    let within = vec2<f32>(ray.place & vec2<u32>((1u << SEED_CELL_BITS) - 1u));
    let start = within * (counts / cell_units);
    let metres = ray.unit_metres * (cell_units / counts);
    let rate = ray.along / metres;
    let by_columns = abs(rate.x) > abs(rate.y);
    let major = select(vec2<f32>(0.0, 1.0), vec2<f32>(1.0, 0.0), by_columns);
    let minor = vec2<f32>(1.0) - major;
    let speed = dot(rate, major);
    let ahead = sign(speed);

    // From the tallest tops to where hardly any ray comes; a flat ray only about where most meet a crown.
    let fall = ray.fall;
    let bottom = (ray.height - 0.5 * CROWN_BASE * stand.height) / fall;
    let reach = (f32(CROWN_ROWS) - 1.5) / abs(speed);
    let meets = stand.height * crown_meeting_height(fall);
    let flat_first = (ray.height - meets) / fall - 0.35 * reach;
    let first = max((ray.height - TALLEST_TREE * stand.height) / fall, min(flat_first, bottom - reach));
    let origin = dot(start, major);
    let nearest_row = i32(floor(origin + speed * first - 0.3 * ahead));
    let last_row = i32(floor(origin + speed * bottom + 0.3 * ahead));
    let all_rows = abs(last_row - nearest_row) + 1;
    let rows = min(all_rows, CROWN_ROWS);
    hit.cut_short = all_rows > CROWN_ROWS;

    // Width of a crown at a metre below its top.
    let taper = stand.crown_radius / (1.0 - CROWN_BASE);
    let steep = taper * fall;
    let squared = 1.0 - steep * steep;
    var pattern_cell = vec2<u32>(EMPTY);
    var pattern: SeedPattern;
    var row = own_row;
    var nearest = 1e9;
    for (var step = 0; step < rows; step++) {
        let line = nearest_row + step * i32(ahead);
        let at = clamp((f32(line) + 0.5 - origin) / speed, first, bottom);
        let beside = i32(floor(dot(start + rate * at, minor) - 0.5));
        for (var side = 0; side < 2; side++) {
            // The sub-cell, and the cell that it belongs to.
            var sub_cell = vec2<i32>(beside + side, line);
            if by_columns {
                sub_cell = sub_cell.yx;
            }
            let rows_off = i32(floor(f32(sub_cell.y) / f32(SEED_ROWS)));
            let columns_off = i32(floor((f32(sub_cell.x) + 0.5) / counts.x));
            let its_cell = vec2<u32>(vec2<i32>(cell) + vec2<i32>(columns_off, rows_off));
            if any(its_cell != pattern_cell) {
                pattern_cell = its_cell;
                pattern = seed_pattern(pattern_of_cell(its_cell, view.scene_seed));
                row = seed_row(its_cell.y);
            }
            let inside = vec2<u32>(
                // A row of cells may have a column more or less than its neighbour.
                min(u32(sub_cell.x - columns_off * i32(own_row.columns)), max(row.columns, 1u) - 1u),
                u32(sub_cell.y - rows_off * i32(SEED_ROWS)),
            );
            let candidate = seed_candidate(pattern, inside);
            if candidate.rank >= stand.share {
                continue;
            }
            let corner = vec2<f32>(f32(columns_off) * counts.x, f32(rows_off) * counts.y);
            let foot = (corner + vec2<f32>(candidate.place) / 4096.0 - start) * metres;
            let size = f32(candidate.size) / 255.0;
            let height = stand.height * mix(LOWEST_TREE, TALLEST_TREE, size);
            // The cone's surface is `taper` × (height − z) from its axis: where the ray first comes so near.
            let closest = dot(ray.along, foot);
            let off = dot(foot, foot) - closest * closest;
            let below_top = height - ray.height + fall * closest;
            let root = taper * taper * below_top * below_top - squared * off;
            if below_top <= 0.0 || root <= 0.0 {
                continue;
            }
            let t = closest + (steep * taper * below_top - sqrt(root)) / squared;
            let z = ray.height - fall * t;
            if t < nearest && z >= CROWN_BASE * height {
                nearest = t;
                let from_axis = ray.along * t - foot;
                hit = CrownHit(
                    true,
                    false,
                    from_axis / max(length(from_axis), 1e-3),
                    1.0 / taper,
                    z / stand.height,
                    f32(candidate.rotation) / 255.0,
                );
            }
        }
        if hit.found {
            break;
        }
    }
    return hit;
}
