// How light falls among crowns that the heights do not hold: on one of them, and in the mean over all that a
// ray may meet. Twin: `twin/crown_light.rs`.

// Share of the sky that the neighbours leave to the foot of a crown and to its top.
const CROWN_SKY: vec2<f32> = vec2<f32>(0.5, 0.86);

// How much shade lies on the way from the sun down to a height (in mean heights of the trees): a depth whose
// exponential the light falls by.
fn shade_in_canopy(stand: Stand, height: f32, sun_rise: f32) -> f32 {
    // Crowns taper: the cover above a height falls as its square, and what a slanting beam crosses is a
    // crown's height rather than its disc.
    let top = TALLEST_TREE - 0.1;
    let depth = saturate((top - height) / (top - CROWN_BASE));
    let slanting = 1.2 * stand.cover * (1.0 - CROWN_BASE) / (PI * stand.crown_radius);
    return slanting * depth * depth / max(sun_rise, 0.6);
}

// Share of sunlight that comes down to a height. What an eye with the sun behind it sees, the sun sees too.
fn light_into_canopy(stand: Stand, height: f32, sun_rise: f32, sun_behind: f32) -> f32 {
    let square = sun_behind * sun_behind;
    return mix(exp(-shade_in_canopy(stand, height, sun_rise)), 1.0, square * square);
}

// Height at which rays of a fall meet crowns in the mean, in mean heights of the trees. This and the light
// below are fitted to `first_crown` over falls of 0.07 to 3.5, all suns and stands (a test holds them to it).
fn mean_crown_height(stand: Stand, fall: f32) -> f32 {
    return clamp(0.65 - 0.085 * log2(fall) + 0.11 * log2(stand.cover), 0.3, 1.05);
}

// The mean of the crowns' normals, not of unit length: they look towards the eye, the less the steeper it
// looks. `away`: level, from the eye.
fn mean_crown_normal(away: vec3<f32>, fall: f32, up: vec3<f32>) -> vec3<f32> {
    return (0.107 * clamp(log2(fall), 0.0, 2.0) - 0.473) * away + 0.665 * up;
}

// The mean of `crown_light` over the crowns that a ray may meet, `normal` being theirs.
fn mean_crown_light(normal: vec3<f32>, stand: Stand, height: f32, sun_rise: f32, sun_behind: f32) -> CrownLight {
    let facing = (dot(normal, view.sun.xyz) + 0.276) / 1.3;
    let lit_side = min(0.5 * (facing + sqrt(facing * facing + 0.0082)), 1.0);
    let shade = 0.79 * shade_in_canopy(stand, height, sun_rise);
    let square = sun_behind * sun_behind;
    let sunlit = mix(pow(1.0 + shade, -1.47), 1.0, square * square);
    let place = saturate(height);
    let depth = mix(0.3, 1.0, place);
    return CrownLight(1.05 * lit_side * depth * sunlit, place * sunlit, mix(0.45, 1.0, depth) * crown_sky(height));
}

// Share of the sky that the crowns around leave at a height.
fn crown_sky(height: f32) -> f32 {
    return mix(CROWN_SKY.x, CROWN_SKY.y, saturate(height));
}
