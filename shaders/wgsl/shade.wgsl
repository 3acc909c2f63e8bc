// shade: from distance and hit to the picture. Full-screen; group 0 is the frame's.
//
// What a scene does not have is compiled away by the overrides: no photo, no forest, no water, no shadow
// costs nothing.

override WITH_PHOTO: bool = true;
override WITH_CANOPY: bool = true;
override WITH_WATER: bool = true;
override WITH_SHADOWS: bool = true;
override WITH_SEASON: bool = false;
override WITH_WIND: bool = false;
override WITH_CLOUDS: bool = false;
// Set where the target's format does not encode sRGB itself.
override ENCODE_SRGB: bool = false;

// Nearer than this the ground has the grain that undergrowth stands on, metres; 0 where there is none.
var<private> turf_metres: f32 = 0.0;

@group(1) @binding(0) var distance_texture: texture_2d<f32>;
@group(1) @binding(1) var hit_texture: texture_2d<u32>;

// The unit direction of the ray through a pixel's centre, east-north-up at the eye.
fn pixel_direction(position: vec2<f32>) -> vec3<f32> {
    let screen = (2.0 * position / vec2<f32>(view.size) - 1.0) * vec2<f32>(1.0, -1.0);
    return normalize(view.forward.xyz + screen.x * view.right.xyz + screen.y * view.up.xyz);
}

// A second-order form's gradient: linear part, diagonal and (xx, yy, zz, xy) with xz, yz.
fn gradient_at(linear: vec3<f32>, second: vec4<f32>, cross: vec2<f32>, x: vec3<f32>) -> vec3<f32> {
    return linear + vec3<f32>(
        2.0 * second.x * x.x + second.w * x.y + cross.x * x.z,
        2.0 * second.y * x.y + second.w * x.x + cross.y * x.z,
        2.0 * second.z * x.z + cross.x * x.x + cross.y * x.y,
    );
}

// The frame of a leaf's tile at a point: gradients of u, v (cells per metre) and of height.
struct TileFrame {
    u: vec3<f32>,
    v: vec3<f32>,
    h: vec3<f32>,
}

fn tile_frame(index: u32, x: vec3<f32>) -> TileFrame {
    let uv_cross = leaves[index].uv_cross;
    return TileFrame(
        gradient_at(leaves[index].u_gradient.xyz, leaves[index].u_second, uv_cross.xy, x),
        gradient_at(leaves[index].v_gradient.xyz, leaves[index].v_second, uv_cross.zw, x),
        gradient_at(leaves[index].h_gradient.xyz, leaves[index].h_second, leaves[index].h_cross_maximum_fade.xy, x),
    );
}

// Slope between two nodes `reach` cells away on either side along an axis, metres per cell; voids count as level.
fn node_slope(node: vec2<i32>, along: vec2<i32>, slot: u32) -> f32 {
    let before = clamp(node - along, vec2<i32>(-1), vec2<i32>(513));
    let after = clamp(node + along, vec2<i32>(-1), vec2<i32>(513));
    let low = node_height(before, slot);
    let high = node_height(after, slot);
    let cells = f32(after.x - before.x + after.y - before.y);
    return select((high - low) / max(cells, 1.0), 0.0, min(low, high) <= VOID_HEIGHT);
}

// Slope of the heights at a cell coordinate, metres per cell along u and v, over differences of `reach`
// nodes: smooth between nodes where cells show, the nearest node's where they do not.
fn slope_at(cell: vec2<f32>, slot: u32, reach: i32) -> vec2<f32> {
    let across = vec2<i32>(reach, 0);
    let down = vec2<i32>(0, reach);
    if reach > 1 {
        let node = vec2<i32>(round(cell));
        return vec2<f32>(node_slope(node, across, slot), node_slope(node, down, slot));
    }
    let base = clamp(vec2<i32>(floor(cell)), vec2<i32>(0), vec2<i32>(511));
    let part = saturate(cell - vec2<f32>(base));
    var slope = vec2<f32>(0.0);
    for (var corner = 0; corner < 4; corner++) {
        let offset = vec2<i32>(corner & 1, corner >> 1);
        let weights = select(vec2<f32>(1.0) - part, part, offset == vec2<i32>(1));
        let node = base + offset;
        slope += weights.x * weights.y * vec2<f32>(node_slope(node, across, slot), node_slope(node, down, slot));
    }
    return slope;
}

fn normal_of(frame: TileFrame, slope: vec2<f32>) -> vec3<f32> {
    // The surface is h(x) − H(u(x), v(x)) = 0: its gradient is the normal.
    return normalize(frame.h - slope.x * frame.u - slope.y * frame.v);
}

// Interleaved gradient noise (J. Jimenez): 0…1, even over every small block of pixels.
fn pixel_dither(position: vec2<f32>) -> f32 {
    let shifted = position + 5.588238 * f32(view.frame & 63u);
    return fract(52.9829189 * fract(dot(shifted, vec2<f32>(0.06711056, 0.00583715))));
}

// Light and dark of what is too small to be grown: stalks, leaves and earth, a hand wide and smaller.
fn turf_grain(ground: Ground, footprint: f32, distance: f32) -> f32 {
    let fades = 1.0 - smoothstep(0.4, 1.0, distance / turf_metres);
    let grain = (0.20 * metric_noise(ground, 0.35, footprint, 21u)) + (0.26 * metric_noise(ground, 0.11, footprint, 22u))
        + (0.24 * metric_noise(ground, 0.04, footprint, 23u));
    return 1.0 + (fades * grain);
}

fn shaded_ground(direction: vec3<f32>, distance: f32, hit: vec4<u32>, dither: f32) -> vec3<f32> {
    let index = hit.x;
    let cell = vec2<f32>(bitcast<f32>(hit.y), bitcast<f32>(hit.z));
    let slot = leaves[index].slot;
    let point = direction * distance;
    let frame = tile_frame(index, point);
    let up = normalize(frame.h);
    let footprint = max(distance * view.right.w, 1e-4);
    let cell_metres = leaves[index].cell_metres;
    let cells_per_footprint = footprint / cell_metres.y;

    let reach = select(1, i32(clamp(round(cells_per_footprint), 2.0, 8.0)), cells_per_footprint > 1.5);
    let slope = slope_at(cell, slot, reach);
    var normal = normal_of(frame, slope);

    let units_per_cell = f32(leaves[index].grid_side) / vec2<f32>(leaves[index].cells);
    let offset = clamp(cell - vec2<f32>(leaves[index].first_cell), vec2<f32>(0.0), vec2<f32>(leaves[index].cells)) * units_per_cell;
    let place = moved(MapPlace(leaves[index].grid_origin, vec2<f32>(0.0)), offset);
    let height = height_at(cell, slot, true);
    let ground = Ground(place, index, height, units_per_cell / cell_metres, 1.0 / cells_per_footprint, 0.5 * (abs(slope.x) + abs(slope.y)));

    let cover = cover_at(cell, slot);
    let facing = max(dot(normal, -direction), 0.05);
    let steepness = 1.0 - dot(normal, up);
    var base = neutral_colour(cover, steepness);
    if WITH_PHOTO {
        // The footprint lies along the line of sight over the ground, 1 / cos of the angle to the normal long.
        let elongation = min(1.0 / facing, 16.0);
        let along = vec2<f32>(dot(direction, frame.u), dot(direction, frame.v));
        let level_along = along / max(length(along * cell_metres), 1e-6);
        let sample = photo_colour(place.unit, place.fraction, footprint, level_along * units_per_cell * footprint * elongation, elongation);
        base = mix(base, reflectance_of_photo(sample.rgb / max(sample.a, 1e-3)), sample.a);
    }

    let summer = base;
    if WITH_SEASON {
        base = seasonal_ground(base, height);
    }
    // Detail below the photo's and the heights' own, where the eye is near enough to miss it.
    let fine = metric_noise(ground, 0.6, footprint, 11u) + metric_noise(ground, 2.4, footprint, 12u);
    let coarse = metric_noise(ground, 9.0, footprint, 13u);
    let detail = 1.0 + 0.10 * fine + 0.07 * coarse;
    base *= detail;
    if distance < turf_metres {
        base *= turf_grain(ground, footprint, distance);
    }

    let sun_cosine = dot(up, view.sun.xyz);
    var lit = Lit(normal, up, direction, vec3<f32>(0.0), sky_ambient(sun_cosine), 0.0, 1.0);
    lit.sun = sun_transmittance(height, sun_cosine);
    // Towards the sun over the tile's own east, south and up.
    let toward = vec3<f32>(dot(view.sun.xyz, frame.u) * cell_metres.x, dot(view.sun.xyz, frame.v) * cell_metres.y, sun_cosine);
    lit.sun_visible = smoothstep(-0.012, 0.006, sun_cosine);
    if WITH_CLOUDS {
        lit.sun_visible *= cloud_light(point, height);
    }
    if WITH_SHADOWS {
        let lights = dot(normal, view.sun.xyz) > select(0.0, -0.3, cover.canopy > 0.0);
        if lights && sun_cosine > -0.01 {
            lit.sun_visible *= sun_visibility(ground, toward, dither);
        }
        lit.sky_visible = sky_visibility(ground, max(12.0, 2.0 * footprint), max(160.0, 8.0 * footprint));
    }

    var radiance = bare_radiance(lit, base);
    if cover.snow > 0.0 {
        // Only what the photo shows bright is made whiter: a classifier takes much for snow.
        let white = mix(base, vec3<f32>(0.86, 0.88, 0.91), 0.6 * smoothstep(0.15, 0.6, luminance(base)));
        radiance = mix(radiance, snow_radiance(lit, white), cover.snow);
    }
    if WITH_SEASON {
        let patches = 60.0 * metric_noise(ground, 90.0, footprint, 51u) + 35.0 * metric_noise(ground, 13.0, footprint, 52u);
        let snow = snow_on(height - cover.canopy_height + patches, normal, up);
        radiance = mix(radiance, snow_radiance(lit, SNOW_WHITE * (1.0 + 0.03 * fine)), snow);
    }
    if WITH_CANOPY {
        let forest = max(cover.canopy, smoothstep(0.5, 3.0, cover.canopy_height));
        // Where cells are long, single trees raise their mean by little, and still are seen.
        let grows = select(forest, cover.canopy_height - 0.06, cell_metres.y > CROWN_CELLS);
        if max(forest, grows) > 0.0 {
            let radius = clamp(round(3.0 / cell_metres.y), 1.0, 4.0);
            let wide = normal_of(frame, slope_at(cell, slot, max(reach, i32(radius) + 1)));
            let point = ForestPoint(
                cell, slot, footprint, cell_metres, cover.canopy_height, forest, slope / cell_metres,
                vec3<f32>(dot(direction, frame.u) * cell_metres.x, dot(direction, frame.v) * cell_metres.y, dot(direction, frame.h)),
                toward, normalize(frame.u), normalize(frame.v), normal, wide,
            );
            var colour = summer * detail;
            if WITH_WIND {
                // Gusts are lost where many of them are one pixel.
                let shown = saturate(1.6 - footprint / 24.0);
                colour *= mix(1.0, leaf_shimmer(gust_at(direction.xy * distance)), shown);
            }
            let seen = forest_radiance(point, ground, lit, colour);
            radiance = mix(radiance, seen.rgb, seen.a);
        }
    }
    if WITH_WATER {
        if cover.water > 0.0 {
            let ripple_size = 0.022 * saturate(1.5 - footprint / 6.0) + 0.004;
            let ripple = vec3<f32>(metric_noise(ground, 3.0, 0.25 * footprint, 31u), metric_noise(ground, 3.0, 0.25 * footprint, 32u), 0.0) * ripple_size;
            let body = mix(min(base * 0.5, vec3<f32>(0.06)), vec3<f32>(0.008, 0.026, 0.034), 0.6);
            radiance = mix(radiance, water_radiance(lit, body, ripple), smoothstep(0.3, 0.7, cover.water));
        }
    }
    let steps = select(5u, 9u, view.up.w > 30000.0);
    let air = air_along(direction, 0.0, distance, steps);
    return radiance * air.transmittance + air.inscatter;
}

// Radiance as the target holds it.
fn picture_colour(radiance: vec3<f32>, dither: f32) -> vec4<f32> {
    let display = tone_mapped(radiance * exposure());
    // Half a step of an 8-bit target, so that the sky shows no bands.
    let noise = (dither - 0.5) / 255.0;
    if ENCODE_SRGB {
        return vec4<f32>(srgb_encoded(display) + noise, 1.0);
    }
    return vec4<f32>(display + noise * 2.2 * pow(max(display, vec3<f32>(1e-4)), vec3<f32>(0.55)), 1.0);
}

@fragment
fn shade(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let direction = pixel_direction(position.xy);
    let distance = textureLoad(distance_texture, pixel, 0).x;
    let hit = textureLoad(hit_texture, pixel, 0);
    let dither = pixel_dither(position.xy);
    var radiance: vec3<f32>;
    if distance < 0.0 || hit.x == EMPTY {
        radiance = sky(direction);
    } else {
        radiance = shaded_ground(direction, distance, hit, dither);
    }
    return picture_colour(radiance, dither);
}
