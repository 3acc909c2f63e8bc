// From what the ground is and the light that falls on it to radiance, and from radiance to a picture.

// A lit point of the ground.
struct Lit {
    // Unit normal, east-north-up at the eye.
    normal: vec3<f32>,
    // Unit vertical there.
    up: vec3<f32>,
    // Unit direction from the eye to it.
    direction: vec3<f32>,
    // Sunlight before shadow and angle.
    sun: vec3<f32>,
    // Light of the open sky over π.
    ambient: vec3<f32>,
    // Share of the sun's disc that is seen.
    sun_visible: f32,
    // Share of the sky that is seen.
    sky_visible: f32,
}

fn luminance(colour: vec3<f32>) -> f32 {
    return dot(colour, vec3<f32>(0.2126, 0.7152, 0.0722));
}

// A photo's colour as reflectance: its own light and shade are drawn half-way to its middle.
fn reflectance_of_photo(colour: vec3<f32>) -> vec3<f32> {
    let grey = max(luminance(colour), 1e-4);
    let lifted = 0.13 * pow(grey / 0.13, 0.82);
    return min(colour * (lifted / grey), vec3<f32>(0.9));
}

// Leaves behind a photo's forest colour: photos of crowns hold their shadows too, and a camera's green
// is more vivid than a wood is.
fn forest_reflectance(colour: vec3<f32>) -> vec3<f32> {
    let grey = luminance(colour);
    let calm = mix(vec3<f32>(grey) * vec3<f32>(0.98, 1.06, 0.62), colour, 0.7);
    return calm * (2.1 / (1.0 + 7.0 * grey));
}

// Light from the sky and from the ground around, over π. What the surroundings hide of the sky they
// give back as their own light.
fn surrounding_light(lit: Lit, albedo: vec3<f32>) -> vec3<f32> {
    let upward = 0.5 + 0.5 * dot(lit.normal, lit.up);
    let sky = lit.ambient * upward * lit.sky_visible;
    let ground_light = lit.sun * max(dot(lit.up, view.sun.xyz), 0.0) * (0.35 + 0.65 * lit.sun_visible) + lit.ambient;
    let seen_ground = (1.0 - upward) + upward * (1.0 - lit.sky_visible);
    return sky + mix(vec3<f32>(0.14), albedo, 0.5) * ground_light * seen_ground * 0.6;
}

// Bare ground: a rough surface. The photo has its own shading, so the sun's angle counts a little less.
fn bare_radiance(lit: Lit, albedo: vec3<f32>) -> vec3<f32> {
    let facing = max(dot(lit.normal, view.sun.xyz), 0.0);
    return albedo * (lit.sun * facing * lit.sun_visible + surrounding_light(lit, albedo));
}

// Snow: bright, and light comes round through it.
fn snow_radiance(lit: Lit, albedo: vec3<f32>) -> vec3<f32> {
    let facing = max((dot(lit.normal, view.sun.xyz) + 0.12) / 1.12, 0.0);
    return albedo * (lit.sun * facing * lit.sun_visible + surrounding_light(lit, albedo));
}

// What the crowns leave of the light that falls on them.
struct CrownLight {
    // Of the sun's: angle, and the darkness between crowns.
    direct: f32,
    // Of what comes through leaves against the sun.
    through: f32,
    // Of the light from all round.
    ambient: f32,
}

// Crowns are lit round their sides and dark between. `place`: 0 between crowns, 1 at their tops.
fn crown_light(lit: Lit, place: f32) -> CrownLight {
    let facing = saturate((dot(lit.normal, view.sun.xyz) + 0.3) / 1.3);
    let depth = mix(0.3, 1.0, place);
    return CrownLight(facing * depth, place, mix(0.45, 1.0, depth));
}

// Forest: it glows against the sun, and is bright with it behind the eye (no shadow between crowns is seen
// from there).
fn canopy_radiance(lit: Lit, albedo: vec3<f32>, crown: CrownLight) -> vec3<f32> {
    let away = dot(lit.direction, view.sun.xyz);
    let behind = pow(saturate(-away), 6.0);
    let through = pow(saturate(away), 4.0) * crown.through;
    let leaf_light = albedo * vec3<f32>(1.25, 1.25, 0.55);
    let sun = lit.sun * lit.sun_visible;
    let direct = albedo * sun * crown.direct * (1.0 + 0.35 * behind);
    return direct + 0.22 * leaf_light * sun * through + albedo * surrounding_light(lit, albedo) * crown.ambient;
}

// Water: the sky's mirror, dark below, with the sun's glitter. `ripple` tilts the surface.
fn water_radiance(lit: Lit, body: vec3<f32>, ripple: vec3<f32>) -> vec3<f32> {
    let normal = normalize(lit.up + ripple);
    let facing = max(dot(-lit.direction, normal), 0.02);
    let mirror = 0.02 + 0.98 * pow(1.0 - facing, 5.0) * 0.85;
    var reflected = reflect(lit.direction, normal);
    // A ripple never mirrors what lies under the water.
    reflected = normalize(reflected + lit.up * max(0.02 - dot(reflected, lit.up), 0.0));
    let sky_light = air_along(reflected, 0.0, 1e9, 6u).inscatter * mix(0.55, 1.0, lit.sky_visible);
    let half_way = normalize(view.sun.xyz - lit.direction);
    let glitter = pow(max(dot(normal, half_way), 0.0), 900.0) * 40.0;
    let below = body * (lit.sun * max(dot(lit.up, view.sun.xyz), 0.0) * (0.4 + 0.6 * lit.sun_visible) + lit.ambient);
    return below * (1.0 - mirror) + mirror * (sky_light + lit.sun * lit.sun_visible * glitter);
}

// How long the picture is exposed: eyes and cameras follow the light, but not all the way.
fn exposure() -> f32 {
    let cosine = view.sun.z;
    let level_ground = sun_transmittance(min(view.up.w, 20000.0), cosine) * max(cosine, 0.0) + sky_ambient(cosine);
    return 1.55 * pow(luminance(level_ground) + 0.012, -0.5);
}

// Radiance to display-linear 0…1: a curve straight in the middle of its logarithm, with a toe and a long
// shoulder, that keeps 0.18 where it is; bright colours pale as film's do.
fn tone_mapped(radiance: vec3<f32>) -> vec3<f32> {
    let exposed = max(radiance, vec3<f32>(0.0));
    let grey = luminance(exposed);
    // Channels lean on each other before the curve, or saturated light would clip to a pure hue.
    let joined = mix(exposed, vec3<f32>(grey), 0.03 + 0.10 * smoothstep(0.4, 4.0, grey));
    let contrast = 1.32;
    let powered = pow(joined, vec3<f32>(contrast));
    let pivot = pow(0.18, contrast) * (1.0 - 0.18) / 0.18;
    let mapped = powered / (powered + pivot);
    let mapped_grey = luminance(mapped);
    return saturate(mix(vec3<f32>(mapped_grey), mapped, 1.10));
}

// Display-linear to sRGB-encoded.
fn srgb_encoded(linear: vec3<f32>) -> vec3<f32> {
    return select(1.055 * pow(linear, vec3<f32>(1.0 / 2.4)) - 0.055, 12.92 * linear, linear <= vec3<f32>(0.0031308));
}
