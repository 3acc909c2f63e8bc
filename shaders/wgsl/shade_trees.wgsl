// The shade pass where trees are drawn one by one: the canopy of the heights gives way to the ground below it, and
// the depth of what is shown is written for the trees.

// Distance that a depth of 1 stands for, metres, as in `trees.wgsl`.
const NEAR_METRES: f32 = 0.1;

// Shares of the sky's and the sun's light that a canopy leaves to the ground under it.
const CANOPY_SKY: f32 = 0.35;
const CANOPY_SUN: f32 = 0.16;
// What is higher over the ground is canopy, metres: the walls at the rims of crowns, too.
const CANOPY_FOOT: f32 = 0.05;

struct ShadedWithDepth {
    @location(0) colour: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

// How much of a wood is about a point of its ground, and how much of that is bare: crowns some metres away count, so
// that a tree's foot is not cut out with its crown's outline.
fn wood_about(cell: vec2<f32>, slot: u32, height: f32, reach: vec2<f32>) -> vec2<f32> {
    var wood = vec2<f32>(0.0);
    for (var tap = 0; tap < 9; tap++) {
        let offset = vec2<f32>(f32(tap % 3), f32(tap / 3)) - 1.0;
        let node = node_surface(vec2<i32>(round(cell + (offset * reach))), slot);
        let share = smoothstep(0.5, 3.0, f32(node.y) * CANOPY_UNIT);
        var bare = 0.0;
        if WITH_SEASON {
            bare = 1.0 - foliage_at(season_row(node.x >> SPECIES_SHIFT), height).leaves;
        }
        wood += share * vec2<f32>(1.0, bare);
    }
    return vec2<f32>(saturate(1.5 * wood.x / 9.0), wood.y / max(wood.x, 1e-3));
}

// Nearer than this the march to the sun is taken this often from the floor of a wood: it begins among crowns, a step from
// their rims, and what one dithered march makes of them shows as a pattern, metres.
const FINE_SHADOW: f32 = 40.0;
const FINE_SHADOWS: u32 = 4u;

fn floor_sun(ground: Ground, toward: vec3<f32>, dither: f32, distance: f32) -> f32 {
    let count = select(1u, FINE_SHADOWS, distance < FINE_SHADOW);
    var sum = 0.0;
    for (var part = 0u; part < count; part++) {
        sum += sun_visibility(ground, toward, fract(dither + (f32(part) / f32(FINE_SHADOWS))));
    }
    return sum / f32(count);
}

// The ground under a wood: its own light is what the crowns above leave of it.
fn forest_floor(direction: vec3<f32>, below: Below, dither: f32) -> vec3<f32> {
    let index = below.leaf;
    let slot = leaves[index].slot;
    let frame = tile_frame(index, direction * below.distance);
    let up = normalize(frame.h);
    let footprint = max(below.distance * view.right.w, 1e-4);
    let cell_metres = leaves[index].cell_metres;
    let units_per_cell = f32(leaves[index].grid_side) / vec2<f32>(leaves[index].cells);
    // Canopy heights are rounded: slopes over some cells.
    let reach = 3.0;
    let east = ground_height_at(below.cell + vec2<f32>(reach, 0.0), slot) - ground_height_at(below.cell - vec2<f32>(reach, 0.0), slot);
    let south = ground_height_at(below.cell + vec2<f32>(0.0, reach), slot) - ground_height_at(below.cell - vec2<f32>(0.0, reach), slot);
    let slope = clamp(vec2<f32>(east, south) / (2.0 * reach * cell_metres), vec2<f32>(-3.0), vec2<f32>(3.0)) * cell_metres;
    let normal = normal_of(frame, slope);
    let height = ground_height_at(below.cell, slot);
    let ground = Ground(below.place, index, height, units_per_cell / cell_metres, footprint / cell_metres.y, 0.5);
    let cover = cover_at(below.cell, slot);
    var base = neutral_colour(cover, 1.0 - dot(normal, up));
    if WITH_PHOTO {
        let sample = photo_colour(below.place.unit, below.place.fraction, max(footprint, 1.0), vec2<f32>(0.0), 1.0);
        base = mix(base, reflectance_of_photo(sample.rgb / max(sample.a, 1e-3)), sample.a);
    }
    // Litter, moss and herbs.
    let fine = metric_noise(ground, 0.5, footprint, 41u) + metric_noise(ground, 1.7, footprint, 42u);
    let patches = metric_noise(ground, 6.0, footprint, 43u);
    let wood = wood_about(below.cell, slot, height, vec2<f32>(3.5) / cell_metres);
    let wooded = wood.x;
    let litter = mix(base, vec3<f32>(0.085, 0.07, 0.042), 0.45 * wooded * (0.6 + 0.4 * patches));
    base = litter * (1.0 + 0.16 * fine + 0.1 * patches);
    if below.distance < turf_metres {
        // Needles and moss in turns, close by.
        let moss = saturate(0.5 + (0.9 * metric_noise(ground, 0.25, footprint, 44u)));
        let close_by = wooded * (1.0 - smoothstep(0.4, 1.0, below.distance / turf_metres));
        base *= mix(vec3<f32>(1.0), mix(vec3<f32>(1.18, 0.96, 0.72), vec3<f32>(0.86, 1.06, 0.8), moss), 0.7 * close_by);
        base *= turf_grain(ground, footprint, below.distance);
    }
    var bare = 0.0;
    if WITH_SEASON {
        let canopy = seasonal_canopy(below.cell, slot, height, base);
        bare = wooded * wood.y;
        let snow = snow_on(height + 50.0 * patches, normal, up);
        let floor_colour = winter_floor(canopy.rgb, 0.0) * (1.0 + 0.2 * fine + 0.15 * patches);
        base = mix(seasonal_ground(base, height), floor_colour, bare);
        // Evergreens hold back some of the snow.
        base = mix(base, SNOW_WHITE, snow * mix(0.8, 0.95, max(bare, 1.0 - wooded)));
    }
    let sun_cosine = dot(up, view.sun.xyz);
    var lit = Lit(normal, up, direction, sun_transmittance(height, sun_cosine), sky_ambient(sun_cosine), smoothstep(-0.012, 0.006, sun_cosine), 1.0);
    if WITH_CLOUDS {
        lit.sun_visible *= cloud_light(direction * below.distance, height);
    }
    if WITH_SHADOWS {
        let toward = vec3<f32>(dot(view.sun.xyz, frame.u) * cell_metres.x, dot(view.sun.xyz, frame.v) * cell_metres.y, sun_cosine);
        if sun_cosine > -0.01 {
            lit.sun_visible *= floor_sun(ground, toward, dither, below.distance);
        }
        lit.sky_visible = max(sky_visibility(ground, 8.0, 60.0), mix(CANOPY_SKY, 0.8, bare) * wooded);
        // Specks of sun come through any canopy, and leaves pass light on.
        var specks = mix(CANOPY_SUN, 0.6, bare);
        if WITH_CLOUDS {
            specks *= cloud_light(direction * below.distance, height);
        }
        lit.sun_visible = mix(lit.sun_visible, max(lit.sun_visible, specks), wooded * smoothstep(-0.012, 0.006, sun_cosine));
    }
    let radiance = bare_radiance(lit, base);
    let air = air_along(direction, 0.0, below.distance, 5u);
    return radiance * air.transmittance + air.inscatter;
}

@fragment
fn shade_with_trees(@builtin(position) position: vec4<f32>) -> ShadedWithDepth {
    turf_metres = tree_cells.turf;
    let pixel = vec2<i32>(position.xy);
    let direction = pixel_direction(position.xy);
    let distance = textureLoad(distance_texture, pixel, 0).x;
    let hit = textureLoad(hit_texture, pixel, 0);
    let dither = pixel_dither(position.xy);
    let ahead = dot(direction, view.forward.xyz);
    if tree_cells.under.x == 1u {
        let index = leaf_index_at(view.eye_grid);
        if index != EMPTY {
            let frame = tile_frame(index, vec3<f32>(0.0));
            let units_per_cell = f32(leaves[index].grid_side) / vec2<f32>(leaves[index].cells);
            let rate = vec2<f32>(dot(direction, frame.u), dot(direction, frame.v)) * units_per_cell;
            let below = ground_under_eye(index, rate, dot(direction, frame.h), dither);
            // In the open the terrain pass has met the same ground, and knows it better.
            let known = distance > 0.0 && abs(distance - below.distance) < 0.5 + (0.03 * distance);
            if below.found && !known {
                return ShadedWithDepth(picture_colour(forest_floor(direction, below, dither), dither), NEAR_METRES / max(below.distance * ahead, NEAR_METRES));
            }
        }
    }
    if distance < 0.0 || hit.x == EMPTY {
        return ShadedWithDepth(picture_colour(sky(direction), dither), 0.0);
    }
    var behind = 0.0;
    if distance < tree_cells.range {
        let index = hit.x;
        let slot = leaves[index].slot;
        let cell = vec2<f32>(bitcast<f32>(hit.y), bitcast<f32>(hit.z));
        let units_per_cell = f32(leaves[index].grid_side) / vec2<f32>(leaves[index].cells);
        let offset = clamp(cell - vec2<f32>(leaves[index].first_cell), vec2<f32>(0.0), vec2<f32>(leaves[index].cells)) * units_per_cell;
        let place = moved(MapPlace(leaves[index].grid_origin, vec2<f32>(0.0)), offset);
        let cover = cover_at(cell, slot);
        let gives_way = has_trees(place.unit) && canopy_share(distance) <= dither;
        if gives_way && cover.canopy_height <= CANOPY_FOOT && cover.water <= 0.0 {
            // In a gap between crowns: the walls that the heights have about it are not there either.
            let reach = vec2<f32>(3.5) / leaves[index].cell_metres;
            if wood_about(cell, slot, 0.0, reach).x > 0.0 {
                let gap = Below(true, distance, index, cell, place, false);
                return ShadedWithDepth(picture_colour(forest_floor(direction, gap, dither), dither), NEAR_METRES / max(distance * ahead, NEAR_METRES));
            }
        }
        if cover.canopy_height > CANOPY_FOOT && has_trees(place.unit) {
            behind = CANOPY_DEPTH;
            if gives_way {
                let frame = tile_frame(index, direction * distance);
                let rate = vec2<f32>(dot(direction, frame.u), dot(direction, frame.v)) * units_per_cell;
                let height = height_at(cell, slot, true);
                let below = ground_below(place, index, distance, height, rate, dot(direction, frame.h), dither);
                if !below.found {
                    return ShadedWithDepth(picture_colour(sky(direction), dither), 0.0);
                }
                if !below.canopy {
                    return ShadedWithDepth(picture_colour(forest_floor(direction, below, dither), dither), NEAR_METRES / max(below.distance * ahead, NEAR_METRES));
                }
                let words = vec4<u32>(below.leaf, bitcast<vec2<u32>>(below.cell), 0u);
                let radiance = shaded_ground(direction, below.distance, words, dither);
                return ShadedWithDepth(picture_colour(radiance, dither), NEAR_METRES / max((below.distance + CANOPY_DEPTH) * ahead, NEAR_METRES));
            }
        }
    }
    let radiance = shaded_ground(direction, distance, hit, dither);
    return ShadedWithDepth(picture_colour(radiance, dither), NEAR_METRES / max((distance + behind) * ahead, NEAR_METRES));
}
