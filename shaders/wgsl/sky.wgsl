// The atmosphere: what the sun's light loses on its way, what the air adds to a view ray, and the sky.
//
// Single scattering by air (Rayleigh) and haze (Mie), integrated along the ray in a few segments, with
// an isotropic share for all further scattering. Heights and lengths in metres; radiances in units in
// which a white surface that faces an unattenuated sun has radiance 1. Twin: `twin/sky.rs`.

// Scattering by air at sea level, per metre, for red, green and blue.
const RAYLEIGH_SCATTERING: vec3<f32> = vec3<f32>(5.8e-6, 13.5e-6, 33.1e-6);
const RAYLEIGH_SCALE_HEIGHT: f32 = 8000.0;
// What ozone takes, spread over the air's own profile; only the sun's long path through it shows.
const OZONE_ABSORPTION: vec3<f32> = vec3<f32>(1.2e-6, 3.5e-6, 0.2e-6);
// Haze at sea level, per metre: a clear day, with a visual range near 100 km.
const MIE_SCATTERING: f32 = 1.5e-5;
const MIE_EXTINCTION: f32 = 1.7e-5;
const MIE_SCALE_HEIGHT: f32 = 1400.0;
// Asymmetry of haze: 0 scatters alike everywhere, 1 straight on.
const MIE_ASYMMETRY: f32 = 0.76;
// Above this the air no longer shows, metres.
const ATMOSPHERE_TOP: f32 = 70000.0;
const PI: f32 = 3.14159265;
// Cosine of the sun's angular radius, 0.267°.
const SUN_COSINE: f32 = 0.99998914;

// What the air does to a ray: the radiance it adds, and the share of what lies behind that it lets through.
struct Air {
    inscatter: vec3<f32>,
    transmittance: vec3<f32>,
}

// The Chapman function: length of the path out of an atmosphere in scale heights, relative to the
// vertical one, times exp(-height in scale heights); `x` is the distance to the Earth's centre in scale
// heights, `cosine` that of the zenith angle (C. Schüler's approximation, GPU Pro 3).
fn chapman_times_density(x: f32, cosine: f32, height: f32) -> f32 {
    let c = sqrt(0.5 * PI * x);
    let upward = c / ((c - 1.0) * abs(cosine) + 1.0);
    if cosine >= 0.0 {
        return upward * exp(-height);
    }
    // The ray first falls to its lowest point, then rises: twice the path from there, less the part behind.
    let lowest = sqrt(max(1.0 - cosine * cosine, 0.0)) * x;
    return 2.0 * sqrt(0.5 * PI * lowest) * exp(min(x - lowest - height, 40.0)) - upward * exp(-height);
}

// Share of the sun's light that reaches a height, `cosine` being that of the sun's zenith angle there.
fn sun_transmittance(height: f32, cosine: f32) -> vec3<f32> {
    let above = max(height, 0.0);
    let radius = view.sun.w + above;
    let air = RAYLEIGH_SCALE_HEIGHT * chapman_times_density(radius / RAYLEIGH_SCALE_HEIGHT, cosine, above / RAYLEIGH_SCALE_HEIGHT);
    let haze = MIE_SCALE_HEIGHT * chapman_times_density(radius / MIE_SCALE_HEIGHT, cosine, above / MIE_SCALE_HEIGHT);
    return exp(-min((RAYLEIGH_SCATTERING + OZONE_ABSORPTION) * air + MIE_EXTINCTION * haze, vec3<f32>(80.0)));
}

// Light from the whole sky on a horizontal surface over π, `cosine` being that of the sun's zenith angle:
// what the air takes from the beam and half of which comes down, a share of haze, and twilight.
fn sky_ambient(cosine: f32) -> vec3<f32> {
    let path = 1.0 / (max(cosine, 0.0) + 0.06);
    let vertical = RAYLEIGH_SCATTERING * RAYLEIGH_SCALE_HEIGHT;
    let air = 0.55 * (vec3<f32>(1.0) - exp(-vertical * path));
    let haze = vec3<f32>(0.055) * exp(-vertical * path * 0.6);
    return 1.25 * (air + haze) * (max(cosine, 0.0) + 0.07 * smoothstep(-0.02, 0.2, cosine)) + vec3<f32>(0.010, 0.014, 0.024) * smoothstep(-0.25, 0.08, cosine);
}

// Share of light that air turns by an angle of that cosine, per steradian.
fn rayleigh_phase(cosine: f32) -> f32 {
    return 3.0 / (16.0 * PI) * (1.0 + cosine * cosine);
}

// The same for haze (Cornette and Shanks).
fn mie_phase(cosine: f32) -> f32 {
    let g2 = MIE_ASYMMETRY * MIE_ASYMMETRY;
    let base = max(1.0 + g2 - 2.0 * MIE_ASYMMETRY * cosine, 1e-4);
    return 3.0 / (8.0 * PI) * (1.0 - g2) * (1.0 + cosine * cosine) / ((2.0 + g2) * base * sqrt(base));
}

// Height of the point at distance `s` along a ray from the eye whose zenith cosine there is `rise`.
fn height_along(rise: f32, s: f32) -> f32 {
    let eye = view.up.w;
    let radius = view.sun.w;
    // (r² - R²) / (r + R): no difference of large numbers is taken where the ray is low and near.
    let excess = eye * (2.0 * radius + eye) + s * (2.0 * (radius + eye) * rise + s);
    return excess / (sqrt(max(excess + radius * radius, 0.0)) + radius);
}

// The stretch of a ray below a height: distances of entry and exit, or (0, -1) where it stays above.
fn stretch_below(rise: f32, top: f32) -> vec2<f32> {
    let centre = view.sun.w + view.up.w;
    let closest = -centre * rise;
    // Squared half chord: (R + top)² less the squared distance of the ray from the centre.
    let half = (top - view.up.w) * (2.0 * view.sun.w + top + view.up.w) + closest * closest;
    if half <= 0.0 {
        return vec2<f32>(0.0, -1.0);
    }
    let root = sqrt(half);
    // The smaller root by Vieta's rule, so that it keeps its digits near the eye.
    let far = closest + select(-root, root, closest >= 0.0);
    let product = (view.up.w - top) * (2.0 * view.sun.w + top + view.up.w);
    let near = product / select(far, 1e-6, abs(far) < 1e-6);
    return vec2<f32>(max(min(near, far), 0.0), max(near, far));
}

// The air along a ray from the eye, between two distances, in `steps` segments.
fn air_along(direction: vec3<f32>, start: f32, end: f32, steps: u32) -> Air {
    var air = Air(vec3<f32>(0.0), vec3<f32>(1.0));
    let inside = stretch_below(direction.z, ATMOSPHERE_TOP);
    let first = max(start, inside.x);
    let last = min(end, inside.y);
    if last <= first {
        return air;
    }
    let turn = dot(direction, view.sun.xyz);
    let rayleigh = RAYLEIGH_SCATTERING * rayleigh_phase(turn) * PI;
    let mie = vec3<f32>(MIE_SCATTERING * mie_phase(turn) * PI);
    // From within the air the near part counts most, from space the lowest: even segments then.
    let even = smoothstep(20000.0, 60000.0, view.up.w);
    var from_distance = first;
    for (var step = 0u; step < steps; step++) {
        let share = f32(step + 1u) / f32(steps);
        let to_distance = first + (last - first) * mix(share * share, share, even);
        let length = to_distance - from_distance;
        let middle = 0.5 * (from_distance + to_distance);
        from_distance = to_distance;
        let height = height_along(direction.z, middle);
        // The sun's zenith distance turns with the place: (up at the eye + ray) · sun.
        let centre = view.sun.w + view.up.w;
        let cosine = (centre * view.sun.z + middle * turn) / (view.sun.w + height);
        let density = vec2<f32>(exp(-max(height, 0.0) / RAYLEIGH_SCALE_HEIGHT), exp(-max(height, 0.0) / MIE_SCALE_HEIGHT));
        let extinction = RAYLEIGH_SCATTERING * density.x + vec3<f32>(MIE_EXTINCTION * density.y);
        let sun = sun_transmittance(height, cosine);
        let scattering = RAYLEIGH_SCATTERING * density.x + vec3<f32>(MIE_SCATTERING * density.y);
        let again = scattering * vec3<f32>(0.24, 0.28, 0.33) * smoothstep(-0.15, 0.35, cosine);
        let source = sun * (rayleigh * density.x + mie * density.y) + again;
        let through = exp(-extinction * length);
        // The segment's own light, dimmed on its way to the segment's near end.
        air.inscatter += air.transmittance * source * (vec3<f32>(1.0) - through) / max(extinction, vec3<f32>(1e-12));
        air.transmittance *= through;
    }
    return air;
}

// What a ray sees that meets no data: sky, sun, the Earth's limb; below the horizon a dim globe, half
// veiled by a haze that thins as the eye leaves the air, so that the data's edge is no cliff of light.
fn sky(direction: vec3<f32>) -> vec3<f32> {
    let globe = stretch_below(direction.z, 0.0);
    let meets_globe = globe.y > 0.0 && (direction.z < 0.0 || view.up.w < 0.0);
    if !meets_globe {
        let air = air_along(direction, 0.0, 1e9, 14u);
        return air.inscatter + air.transmittance * sun_disc(direction);
    }
    let air = air_along(direction, 0.0, globe.x, 10u);
    // In a veil of haze the light comes from everywhere: the horizon's colour in that direction.
    let level = normalize(vec3<f32>(direction.xy + vec2<f32>(1e-6, 0.0), 0.0));
    let haze = air_along(level, 0.0, 1e9, 8u).inscatter;
    let up = normalize(vec3<f32>(0.0, 0.0, view.sun.w + view.up.w) + globe.x * direction);
    let cosine = dot(up, view.sun.xyz);
    let face = vec3<f32>(0.022, 0.045, 0.075) * (sun_transmittance(0.0, cosine) * max(cosine, 0.0) + sky_ambient(cosine));
    let veil = mix(1.0, 0.4, smoothstep(0.0, 0.05, -dot(up, direction))) * (1.0 - smoothstep(6000.0, 60000.0, view.up.w));
    return air.inscatter + air.transmittance * mix(face, haze, veil);
}

// Radiance of the sun's disc, darker toward its rim; far less than the truth, or its mirror images would be all noise.
fn sun_disc(direction: vec3<f32>) -> vec3<f32> {
    let cosine = dot(direction, view.sun.xyz);
    let softness = max(0.5 * (1.0 - SUN_COSINE), 0.01 * view.right.w);
    return vec3<f32>(120.0, 112.0, 100.0) * smoothstep(SUN_COSINE - softness, SUN_COSINE + softness, cosine);
}
