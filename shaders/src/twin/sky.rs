//! Twin of `wgsl/sky.wgsl`: the atmosphere.

use crate::layout::View;
use glam::{Vec2, Vec3, Vec4Swizzles};
use std::f32::consts::PI;

/// Scattering by air at sea level, per metre, for red, green and blue.
pub const RAYLEIGH_SCATTERING: Vec3 = Vec3::new(5.8e-6, 13.5e-6, 33.1e-6);
/// Height over which air thins to 1/e, metres.
pub const RAYLEIGH_SCALE_HEIGHT: f32 = 8000.0;
const OZONE_ABSORPTION: Vec3 = Vec3::new(1.2e-6, 3.5e-6, 0.2e-6);
const MIE_SCATTERING: f32 = 1.5e-5;
const MIE_EXTINCTION: f32 = 1.7e-5;
const MIE_SCALE_HEIGHT: f32 = 1400.0;
const MIE_ASYMMETRY: f32 = 0.76;
/// Above this the air no longer shows, metres.
pub const ATMOSPHERE_TOP: f32 = 70_000.0;
const SUN_COSINE: f32 = 0.999_989_14;

/// What the air does to a ray: the radiance it adds, and the share of what lies behind that it lets through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Radiance added, in units of a white surface that faces an unattenuated sun.
    pub inscatter: Vec3,
    /// Share let through, 0…1.
    pub transmittance: Vec3,
}

fn exp(value: Vec3) -> Vec3 {
    Vec3::new(value.x.exp(), value.y.exp(), value.z.exp())
}

fn mix(a: f32, b: f32, share: f32) -> f32 {
    a * (1.0 - share) + b * share
}

pub(crate) fn smoothstep(low: f32, high: f32, value: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn sun(view: &View) -> Vec3 {
    glam::Vec4::from(view.sun).xyz()
}

/// The Chapman function times the density: path out of an atmosphere of scale heights.
pub fn chapman_times_density(x: f32, cosine: f32, height: f32) -> f32 {
    let c = (0.5 * PI * x).sqrt();
    let upward = c / ((c - 1.0) * cosine.abs() + 1.0);
    if cosine >= 0.0 {
        return upward * (-height).exp();
    }
    let lowest = (1.0 - cosine * cosine).max(0.0).sqrt() * x;
    2.0 * (0.5 * PI * lowest).sqrt() * (x - lowest - height).min(40.0).exp() - upward * (-height).exp()
}

/// Share of the sun's light that reaches a height (metres), by the cosine of the sun's zenith angle there.
pub fn sun_transmittance(view: &View, height: f32, cosine: f32) -> Vec3 {
    let above = height.max(0.0);
    let radius = view.sun[3] + above;
    let path = |scale: f32| scale * chapman_times_density(radius / scale, cosine, above / scale);
    let air = path(RAYLEIGH_SCALE_HEIGHT);
    let haze = path(MIE_SCALE_HEIGHT);
    let depth = (RAYLEIGH_SCATTERING + OZONE_ABSORPTION) * air + Vec3::splat(MIE_EXTINCTION * haze);
    exp(-depth.min(Vec3::splat(80.0)))
}

/// Light from the whole sky on a horizontal surface over π, by the cosine of the sun's zenith angle.
pub fn sky_ambient(cosine: f32) -> Vec3 {
    let path = 1.0 / (cosine.max(0.0) + 0.06);
    let vertical = RAYLEIGH_SCATTERING * RAYLEIGH_SCALE_HEIGHT;
    let air = 0.55 * (Vec3::ONE - exp(-vertical * path));
    let haze = 0.055 * exp(-vertical * path * 0.6);
    1.25 * (air + haze) * (cosine.max(0.0) + 0.07 * smoothstep(-0.02, 0.2, cosine))
        + Vec3::new(0.010, 0.014, 0.024) * smoothstep(-0.25, 0.08, cosine)
}

/// Share of light that air turns by an angle of that cosine, per steradian.
pub fn rayleigh_phase(cosine: f32) -> f32 {
    3.0 / (16.0 * PI) * (1.0 + cosine * cosine)
}

/// The same for haze.
pub fn mie_phase(cosine: f32) -> f32 {
    let g2 = MIE_ASYMMETRY * MIE_ASYMMETRY;
    let base = (1.0 + g2 - 2.0 * MIE_ASYMMETRY * cosine).max(1e-4);
    3.0 / (8.0 * PI) * (1.0 - g2) * (1.0 + cosine * cosine) / ((2.0 + g2) * base * base.sqrt())
}

/// Height, metres, at distance `s` along a ray from the eye whose zenith cosine there is `rise`.
pub fn height_along(view: &View, rise: f32, s: f32) -> f32 {
    let eye = view.up[3];
    let radius = view.sun[3];
    let excess = eye * (2.0 * radius + eye) + s * (2.0 * (radius + eye) * rise + s);
    excess / ((excess + radius * radius).max(0.0).sqrt() + radius)
}

/// Distances at which a ray enters and leaves what lies below a height; (0, −1) where it stays above.
pub fn stretch_below(view: &View, rise: f32, top: f32) -> Vec2 {
    let eye = view.up[3];
    let radius = view.sun[3];
    let closest = -(radius + eye) * rise;
    let half = (top - eye) * (2.0 * radius + top + eye) + closest * closest;
    if half <= 0.0 {
        return Vec2::new(0.0, -1.0);
    }
    let root = half.sqrt();
    let far = closest + if closest >= 0.0 { root } else { -root };
    let product = (eye - top) * (2.0 * radius + top + eye);
    let near = product / if far.abs() < 1e-6 { 1e-6 } else { far };
    Vec2::new(near.min(far).max(0.0), near.max(far))
}

/// The air along a ray from the eye, between two distances, in `steps` segments.
pub fn air_along(view: &View, direction: Vec3, start: f32, end: f32, steps: u32) -> Air {
    let mut air = Air { inscatter: Vec3::ZERO, transmittance: Vec3::ONE };
    let inside = stretch_below(view, direction.z, ATMOSPHERE_TOP);
    let first = start.max(inside.x);
    let last = end.min(inside.y);
    if last <= first {
        return air;
    }
    let turn = direction.dot(sun(view));
    let rayleigh = RAYLEIGH_SCATTERING * rayleigh_phase(turn) * PI;
    let mie = Vec3::splat(MIE_SCATTERING * mie_phase(turn) * PI);
    let even = smoothstep(20_000.0, 60_000.0, view.up[3]);
    let mut from_distance = first;
    for step in 0..steps {
        let share = (step + 1) as f32 / steps as f32;
        let to_distance = first + (last - first) * mix(share * share, share, even);
        let length = to_distance - from_distance;
        let middle = 0.5 * (from_distance + to_distance);
        from_distance = to_distance;
        let height = height_along(view, direction.z, middle);
        let centre = view.sun[3] + view.up[3];
        let cosine = (centre * view.sun[2] + middle * turn) / (view.sun[3] + height);
        let air_density = (-height.max(0.0) / RAYLEIGH_SCALE_HEIGHT).exp();
        let haze_density = (-height.max(0.0) / MIE_SCALE_HEIGHT).exp();
        let extinction = RAYLEIGH_SCATTERING * air_density + Vec3::splat(MIE_EXTINCTION * haze_density);
        let light = sun_transmittance(view, height, cosine);
        let scattering = RAYLEIGH_SCATTERING * air_density + Vec3::splat(MIE_SCATTERING * haze_density);
        let again = scattering * Vec3::new(0.24, 0.28, 0.33) * smoothstep(-0.15, 0.35, cosine);
        let source = light * (rayleigh * air_density + mie * haze_density) + again;
        let through = exp(-extinction * length);
        air.inscatter +=
            air.transmittance * source * (Vec3::ONE - through) / extinction.max(Vec3::splat(1e-12));
        air.transmittance *= through;
    }
    air
}

/// What a ray sees that meets no data.
pub fn sky(view: &View, direction: Vec3) -> Vec3 {
    let globe = stretch_below(view, direction.z, 0.0);
    let meets_globe = globe.y > 0.0 && (direction.z < 0.0 || view.up[3] < 0.0);
    if !meets_globe {
        let air = air_along(view, direction, 0.0, 1e9, 14);
        return air.inscatter + air.transmittance * sun_disc(view, direction);
    }
    let air = air_along(view, direction, 0.0, globe.x, 10);
    let level = Vec3::new(direction.x + 1e-6, direction.y, 0.0).normalize();
    let haze = air_along(view, level, 0.0, 1e9, 8).inscatter;
    let up = (Vec3::new(0.0, 0.0, view.sun[3] + view.up[3]) + globe.x * direction).normalize();
    let cosine = up.dot(sun(view));
    let face = Vec3::new(0.022, 0.045, 0.075)
        * (sun_transmittance(view, 0.0, cosine) * cosine.max(0.0) + sky_ambient(cosine));
    let veil = mix(1.0, 0.4, smoothstep(0.0, 0.05, -up.dot(direction)))
        * (1.0 - smoothstep(6_000.0, 60_000.0, view.up[3]));
    air.inscatter + air.transmittance * (face * (1.0 - veil) + haze * veil)
}

/// Radiance of the sun's disc.
pub fn sun_disc(view: &View, direction: Vec3) -> Vec3 {
    let cosine = direction.dot(sun(view));
    let softness = (0.5 * (1.0 - SUN_COSINE)).max(0.01 * view.right[3]);
    Vec3::new(120.0, 112.0, 100.0) * smoothstep(SUN_COSINE - softness, SUN_COSINE + softness, cosine)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn view(height: f32, sun_elevation_degrees: f32) -> View {
        let (sine, cosine) = sun_elevation_degrees.to_radians().sin_cos();
        View {
            up: [0.0, 0.0, 1.0, height],
            right: [1.0, 0.0, 0.0, 1e-3],
            sun: [cosine, 0.0, sine, 6_371_000.0],
            ..View::default()
        }
    }

    fn grey(colour: Vec3) -> f32 {
        colour.dot(Vec3::new(0.2126, 0.7152, 0.0722))
    }

    #[test]
    fn the_chapman_function_at_its_known_ends() {
        // Straight up it is 1; along the horizon √(πx/2); through the whole limb twice that.
        assert!((chapman_times_density(800.0, 1.0, 0.0) - 1.0).abs() < 1e-5);
        let horizon = (0.5 * PI * 800.0_f32).sqrt();
        assert!((chapman_times_density(800.0, 0.0, 0.0) / horizon - 1.0).abs() < 1e-5);
        let below = chapman_times_density(800.0, -1e-6, 0.0);
        assert!((below / horizon - 1.0).abs() < 1e-3, "continuous through the horizon: {below}");
    }

    #[test]
    fn a_higher_sun_is_brighter_and_a_lower_one_redder() {
        let mut last = Vec3::ZERO;
        for elevation in 0..=90 {
            let view = view(0.0, elevation as f32);
            let cosine = view.sun[2];
            let beam = sun_transmittance(&view, 0.0, cosine);
            assert!(beam.cmpge(last).all(), "{elevation}: {beam} after {last}");
            assert!(beam.x > beam.z, "{elevation}: {beam} is not warmer than white");
            last = beam;
        }
        let low = sun_transmittance(&view(0.0, 2.0), 0.0, 2.0_f32.to_radians().sin());
        assert!(low.x / low.z > 5.0, "{low}");
        // Nearly all of the light comes through from the zenith, none from well below the horizon.
        assert!((0.75..0.95).contains(&last.y), "{last}");
        assert!(sun_transmittance(&view(0.0, -10.0), 0.0, -0.17).max_element() < 1e-6);
    }

    #[test]
    fn the_sky_gives_a_tenth_of_the_light_at_noon_and_most_of_it_at_dusk() {
        let share = |degrees: f32| {
            let view = view(0.0, degrees);
            let sky = grey(sky_ambient(view.sun[2]));
            sky / (sky + grey(sun_transmittance(&view, 0.0, view.sun[2])) * view.sun[2].max(0.0))
        };
        assert!((0.06..0.2).contains(&share(60.0)), "{}", share(60.0));
        assert!(share(3.0) > 0.45, "{}", share(3.0));
        assert!((1..90).all(|degrees| share(degrees as f32) >= share(degrees as f32 + 1.0)));
        let mut last = 0.0;
        for degrees in -20..=90 {
            let ambient = grey(sky_ambient((degrees as f32).to_radians().sin()));
            assert!(ambient >= last, "{degrees}");
            last = ambient;
        }
    }

    #[test]
    fn phases_are_shares_of_the_whole_sphere() {
        for phase in [rayleigh_phase, mie_phase] {
            let steps = 20_000;
            let sum: f64 = (0..steps)
                .map(|step| {
                    let cosine = (f64::from(step) + 0.5) / f64::from(steps) * 2.0 - 1.0;
                    f64::from(phase(cosine as f32)) * 2.0 / f64::from(steps) * std::f64::consts::TAU
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-3, "{sum}");
        }
    }

    #[test]
    fn the_day_sky_is_blue_above_and_pale_at_the_horizon() {
        let view = view(500.0, 45.0);
        let zenith = sky(&view, Vec3::Z);
        let horizon = sky(&view, Vec3::new(0.0, 0.999, 0.045).normalize());
        assert!(zenith.z > 1.8 * zenith.x, "{zenith}");
        assert!(grey(horizon) > 2.0 * grey(zenith), "{horizon} {zenith}");
        assert!(horizon.z / horizon.x < zenith.z / zenith.x);
    }

    #[test]
    fn the_horizon_has_no_edge() {
        for (height, sun_elevation) in [(2.0, 40.0), (1_500.0, 20.0), (4_000.0, 60.0), (1_500.0, 2.0)] {
            let view = view(height, sun_elevation);
            let dip = (2.0 * height / view.sun[3]).sqrt();
            let at = |angle: f32| grey(sky(&view, Vec3::new(0.0, angle.cos(), angle.sin())));
            let (below, above) = (at(-dip - 5e-4), at(-dip + 5e-4));
            assert!((below / above - 1.0).abs() < 0.08, "{height} m, sun {sun_elevation}°: {below} {above}");
        }
    }

    #[test]
    fn from_space_the_sky_is_black_and_the_limb_thin() {
        for height in [5e5, 1e7] {
            let view = view(height, 40.0);
            let limb = -(view.sun[3] / (view.sun[3] + height)).acos();
            let at = |angle: f32| grey(sky(&view, Vec3::new(0.0, angle.cos(), angle.sin())));
            assert!(at(0.3) < 1e-6, "above");
            let thickness = ATMOSPHERE_TOP / (height * (2.0 * view.sun[3] + height)).sqrt();
            assert!(at(limb + 1.2 * thickness) < 1e-6, "beyond the air at {height}");
            assert!(at(limb + 0.05 * thickness) > 0.02, "the limb shows at {height}");
            let nadir = at(-PI / 2.0);
            assert!((0.005..0.2).contains(&nadir), "the globe is seen, and not through fog: {nadir}");
        }
    }

    #[test]
    fn distance_pales_dark_ground_and_keeps_to_the_horizon() {
        let view = view(1_000.0, 30.0);
        let direction = Vec3::new(0.3, 0.95, -0.01).normalize();
        let mut last = Air { inscatter: Vec3::ZERO, transmittance: Vec3::ONE };
        for distance in [100.0, 1e3, 1e4, 3e4, 6e4] {
            let air = air_along(&view, direction, 0.0, distance, 5);
            assert!(air.transmittance.cmplt(last.transmittance).all());
            assert!(air.inscatter.cmpgt(last.inscatter).all());
            last = air;
        }
        assert!(air_along(&view, direction, 0.0, 1_000.0, 5).transmittance.min_element() > 0.9);
        // Few segments agree with many.
        let many = air_along(&view, direction, 0.0, 3e4, 200);
        let few = air_along(&view, direction, 0.0, 3e4, 5);
        assert!((few.inscatter / many.inscatter - Vec3::ONE).abs().max_element() < 0.06, "{few:?} {many:?}");
    }

    proptest! {
        #[test]
        fn heights_along_a_ray_agree_with_f64(
            eye in prop_oneof![-100.0..9_000.0_f32, 5e5..1e7_f32], rise in -1.0..1.0_f32, share in 0.0..1.0_f32,
        ) {
            let view = view(eye, 0.0);
            let s = share * 2e7;
            let radius = f64::from(view.sun[3]);
            let from_centre = radius + f64::from(eye);
            let s64 = f64::from(s);
            let exact = (from_centre * from_centre + s64 * s64 + 2.0 * from_centre * s64 * f64::from(rise)).sqrt() - radius;
            let height = f64::from(height_along(&view, rise, s));
            prop_assert!((height - exact).abs() < 4.0 + 1e-5 * exact.abs(), "{height} {exact}");
        }

        #[test]
        fn every_answer_is_finite_and_positive(
            height in prop_oneof![-11_000.0..9_000.0_f32, 9_000.0..1e7_f32], sun_elevation in -90.0..=90.0_f32,
            rise in -1.0..=1.0_f32, turn in 0.0..6.0_f32,
        ) {
            let view = view(height, sun_elevation);
            let flat = (1.0 - rise * rise).max(0.0).sqrt();
            let colour = sky(&view, Vec3::new(flat * turn.cos(), flat * turn.sin(), rise));
            prop_assert!(colour.is_finite() && colour.min_element() >= 0.0, "{colour}");
        }
    }
}
