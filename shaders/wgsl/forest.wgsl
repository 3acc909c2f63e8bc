// Forest: crowns as the heights hold them where cells are close, and where they are not, the crowns of the
// trees that stand there, down to where a crown is a pixel and only the light of many is left.

// Cells longer than this hold the canopy's mean, metres (the server's limit lies between two levels).
const CROWN_CELLS: f32 = 1.8;
// Pixels' footprints between which crowns give way to their mean, in widths of a crown.
const CROWN_FADE: vec2<f32> = vec2<f32>(0.4, 1.0);

// Crowns' area over the ground's between which the ground is no longer seen in the light.
const OPEN_COVER: vec2<f32> = vec2<f32>(0.3, 1.0);

// A point of a forest, and what is known of it.
struct ForestPoint {
    cell: vec2<f32>,
    slot: u32,
    // Pixel's width there, metres.
    footprint: f32,
    // Length of a cell, metres.
    cell_metres: vec2<f32>,
    // Height of the canopy over the ground, metres.
    canopy_height: f32,
    // Share of the ground that is forest, rather than open with single trees on it.
    closed: f32,
    // Rise per metre east and south of the surface drawn.
    slope: vec2<f32>,
    // The view ray's and the sun's unit direction: east, south, up.
    along: vec3<f32>,
    toward_sun: vec3<f32>,
    // Unit vectors in the view's axes: to the tile's east and south.
    east: vec3<f32>,
    south: vec3<f32>,
    // Normals of the surface drawn, close by and over a crown's width.
    normal: vec3<f32>,
    wide_normal: vec3<f32>,
}

// Radiance of a forest whose photo, where there is one, has a colour; and the share of the pixel that it fills.
fn forest_radiance(point: ForestPoint, ground: Ground, lit: Lit, colour: vec3<f32>) -> vec4<f32> {
    // No two stands are of one green.
    let stand_tint = metric_noise(ground, 30.0, point.footprint, 26u) + metric_noise(ground, 90.0, point.footprint, 27u);
    var leaf = forest_reflectance(colour);
    if !WITH_SEASON {
        return leafy_forest(point, ground, lit, leaf, stand_tint);
    }
    let height = ground.height - point.canopy_height;
    let canopy = seasonal_canopy(point.cell, point.slot, height, leaf);
    let snow = snow_at(height - 40.0);
    // Tops are white, flanks less so: the more is seen of them the steeper one looks down. Bare twigs hold little.
    let from_above = saturate(0.35 - 0.65 * dot(lit.direction, lit.up));
    let clumps = 1.0 + 0.7 * metric_noise(ground, 9.0, point.footprint, 53u);
    let held = saturate(snow * mix(0.05, 0.28, from_above) * mix(0.7, 1.0, canopy.a) * clumps);
    leaf = mix(canopy.rgb, SNOW_WHITE, held);
    let crowns = leafy_forest(point, ground, lit, leaf, stand_tint);
    let gaps = BARE_GAPS * (1.0 - canopy.a);
    if gaps <= 0.0 {
        return crowns;
    }
    var below = lit;
    below.normal = normalize(point.wide_normal + 0.3 * lit.up);
    below.sun_visible *= 0.7;
    return vec4<f32>(mix(crowns.rgb, bare_radiance(below, winter_floor(canopy.rgb, snow)), gaps), crowns.a);
}

fn leafy_forest(point: ForestPoint, ground: Ground, lit: Lit, leaf: vec3<f32>, stand_tint: f32) -> vec4<f32> {
    if point.cell_metres.y > CROWN_CELLS {
        return far_forest(point, ground, lit, leaf, stand_tint);
    }
    return vec4<f32>(near_forest(point, ground, lit, leaf * (1.0 + 0.10 * stand_tint)), point.closed);
}

// The heights hold every crown.
fn near_forest(point: ForestPoint, ground: Ground, lit: Lit, leaf: vec3<f32>) -> vec3<f32> {
    let footprint = point.footprint;
    let radius = i32(clamp(round(3.0 / point.cell_metres.y), 1.0, 4.0));
    let crown = crown_place(point.cell, point.slot, point.canopy_height, radius);
    let crown_tint = metric_noise(ground, 7.0, footprint, 21u);
    let grain = metric_noise(ground, 4.5, footprint, 22u) * 0.1;
    // Boughs and twigs: light and dark within a crown, and a rough outline to the light.
    let bough = upright_noise(ground, 1.6, footprint, 23u);
    let twig = upright_noise(ground, 0.5, footprint, 24u);
    let rough = vec3<f32>(bough, upright_noise(ground, 1.2, footprint, 25u), twig);
    var forest_lit = lit;
    forest_lit.normal = normalize(point.normal + 0.8 * point.wide_normal + 0.15 * lit.up + 0.45 * rough);
    let tint = 0.93 * (1.0 + 0.16 * crown_tint + 0.18 * bough + 0.16 * twig);
    let place_in_crown = saturate(crown + 0.3 * grain - 0.1 * abs(grain) + 0.2 * bough);
    return canopy_radiance(forest_lit, leaf * tint, crown_light(forest_lit, place_in_crown));
}

// The heights hold the canopy's mean.
fn far_forest(point: ForestPoint, ground: Ground, lit: Lit, leaf: vec3<f32>, stand_tint: f32) -> vec4<f32> {
    let stand = stand_of(point.canopy_height, point.closed);
    // Light over the ground's own plane.
    let level_sun = length(point.toward_sun.xy);
    let sun_rise = (point.toward_sun.z - dot(point.slope, point.toward_sun.xy)) / max(level_sun, 0.05);
    let sun_behind = saturate(-dot(point.along, point.toward_sun));
    let level_ray = max(length(point.along.xy), 0.05);
    let along = point.along.xy / level_ray;
    let away = along.x * point.east + along.y * point.south;
    let fall = dot(point.slope, along) - point.along.z / level_ray;
    let taper = stand.crown_radius / (1.0 - CROWN_BASE);
    let ray_fall = clamp(fall, 0.05, 0.9 / taper);

    var forest_lit = lit;
    forest_lit.normal = mean_crown_normal(away, ray_fall, mix(lit.up, point.wide_normal, 0.5));
    let mean_height = mean_crown_height(stand, ray_fall);
    var light = mean_crown_light(forest_lit.normal, stand, mean_height, sun_rise, sun_behind);
    var tint = 1.0 + 0.10 * stand_tint;
    let width = 2.0 * stand.crown_radius * stand.height;
    // Crowns over the ground, each as long as its side shows: single trees, too, are seen before the open ground.
    let side = (1.0 - CROWN_BASE) / (PI * stand.crown_radius * ray_fall);
    // In an open stand the light reaches the ground between them.
    let gap = point.closed * smoothstep(OPEN_COVER.x, OPEN_COVER.y, stand.cover);
    var share = max(gap, 1.0 - exp(-stand.cover * max(0.5 + side, 1.0)));
    var shown = 1.0 - smoothstep(CROWN_FADE.x, CROWN_FADE.y, point.footprint / width);
    if shown > 0.0 {
        let unit_metres = exp2(f32(view.root_level) - 5.0) / ground.units_per_metre;
        let ray = CanopyRay(place_of_grid(ground.place.unit), point.canopy_height, along, ray_fall, unit_metres);
        let hit = first_crown(ray, stand);
        var crown_lit = lit;
        crown_lit.normal = normalize(point.wide_normal + 0.35 * lit.up);
        // Through a gap the shade below is seen.
        var height = 0.3;
        if hit.found {
            let outward = hit.outward.x * point.east + hit.outward.y * point.south;
            let crown_normal = normalize(outward * hit.steepness + lit.up);
            crown_lit.normal = normalize(crown_normal + 0.5 * point.wide_normal + 0.35 * lit.up);
            height = hit.height;
            tint += shown * 0.35 * (hit.tone - 0.5);
        } else if hit.cut_short {
            shown = 0.0;
        }
        share = mix(share, select(gap, 1.0, hit.found), shown);
        var seen = crown_light(crown_lit, saturate(height));
        let sunlit = light_into_canopy(stand, height, sun_rise, sun_behind);
        seen.direct *= sunlit;
        seen.through *= sunlit;
        seen.ambient *= crown_sky(height);
        light.direct = mix(light.direct, seen.direct, shown);
        light.through = mix(light.through, seen.through, shown);
        light.ambient = mix(light.ambient, seen.ambient, shown);
        forest_lit.normal = mix(forest_lit.normal, crown_lit.normal, shown);
    }
    // Where no crown is seen, groups of them still stand higher and lower: light and shade a stand wide.
    light.direct *= 1.0 + 0.3 * (1.0 - shown) * stand_tint;
    return vec4<f32>(canopy_radiance(forest_lit, leaf * tint, light), share);
}
