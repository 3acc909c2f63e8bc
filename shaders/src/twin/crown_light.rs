//! Twin of `wgsl/crown_light.wgsl` and of `crown_light` in `wgsl/lighting.wgsl`: how light falls among crowns.

use super::crowns::{CROWN_BASE, Stand, TALLEST_TREE};
use glam::Vec3;
use std::f32::consts::PI;

const CROWN_SKY: [f32; 2] = [0.5, 0.86];

/// What the crowns leave of the light that falls on them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrownLight {
    /// Of the sun's: angle, and the darkness between crowns.
    pub direct: f32,
    /// Of what comes through leaves against the sun.
    pub through: f32,
    /// Of the light from all round.
    pub ambient: f32,
}

fn mix(from: f32, to: f32, share: f32) -> f32 {
    from + share * (to - from)
}

/// Light on a crown with a unit normal. `place`: 0 between crowns, 1 at their tops.
pub fn crown_light(normal: Vec3, sun: Vec3, place: f32) -> CrownLight {
    let facing = ((normal.dot(sun) + 0.3) / 1.3).clamp(0.0, 1.0);
    let depth = mix(0.3, 1.0, place);
    CrownLight { direct: facing * depth, through: place, ambient: mix(0.45, 1.0, depth) }
}

/// How much shade lies on the way from the sun down to a height (in mean heights of the trees): a depth
/// whose exponential the light falls by.
pub fn shade_in_canopy(stand: &Stand, height: f32, sun_rise: f32) -> f32 {
    let top = TALLEST_TREE - 0.1;
    let depth = ((top - height) / (top - CROWN_BASE)).clamp(0.0, 1.0);
    let slanting = 1.2 * stand.cover * (1.0 - CROWN_BASE) / (PI * stand.crown_radius);
    slanting * depth * depth / sun_rise.max(0.6)
}

/// Share of sunlight that comes down to a height.
pub fn light_into_canopy(stand: &Stand, height: f32, sun_rise: f32, sun_behind: f32) -> f32 {
    mix((-shade_in_canopy(stand, height, sun_rise)).exp(), 1.0, sun_behind.powi(4))
}

/// Height at which rays of a fall meet crowns in the mean, in mean heights of the trees.
pub fn mean_crown_height(stand: &Stand, fall: f32) -> f32 {
    (0.65 - 0.085 * fall.log2() + 0.11 * stand.cover.log2()).clamp(0.3, 1.05)
}

/// The mean of the crowns' normals, not of unit length. `away`: level, from the eye.
pub fn mean_crown_normal(away: Vec3, fall: f32, up: Vec3) -> Vec3 {
    (0.107 * fall.log2().clamp(0.0, 2.0) - 0.473) * away + 0.665 * up
}

/// The mean of [`crown_light`] over the crowns that a ray may meet, `normal` being theirs.
pub fn mean_crown_light(
    normal: Vec3,
    sun: Vec3,
    stand: &Stand,
    height: f32,
    sun_rise: f32,
    sun_behind: f32,
) -> CrownLight {
    let facing = (normal.dot(sun) + 0.276) / 1.3;
    let lit_side = (0.5 * (facing + (facing * facing + 0.0082).sqrt())).min(1.0);
    let shade = 0.79 * shade_in_canopy(stand, height, sun_rise);
    let sunlit = mix((1.0 + shade).powf(-1.47), 1.0, sun_behind.powi(4));
    let place = height.clamp(0.0, 1.0);
    let depth = mix(0.3, 1.0, place);
    CrownLight {
        direct: 1.05 * lit_side * depth * sunlit,
        through: place * sunlit,
        ambient: mix(0.45, 1.0, depth) * crown_sky(height),
    }
}

/// Share of the sky that the crowns around leave at a height.
pub fn crown_sky(height: f32) -> f32 {
    mix(CROWN_SKY[0], CROWN_SKY[1], height.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::super::crowns::{CanopyRay, Met, first_crown, stand_of};
    use super::*;
    use crate::layout::View;
    use glam::{UVec2, Vec2};

    const FALLS: [f32; 6] = [0.1, 0.2, 0.35, 0.6, 1.0, 2.0];
    /// Rays of a mean.
    const RAYS: u32 = 1_200;

    /// A spruce and beech forest at 47° N.
    fn view() -> View {
        View { tree_size: [24.75, 0.1725], scene_seed: 1, ..View::default() }
    }

    /// What the rays of a fall and a heading see of a stand on level ground: height and normal, where no
    /// crown is met the shade below. Rays that were not followed to the ground are left out.
    fn seen(view: &View, canopy_height: f32, fall: f32, heading: f32) -> Vec<(f32, Vec3)> {
        let stand = stand_of(view, canopy_height, 1.0);
        (0..RAYS)
            .filter_map(|index| {
                let at = |base: f64| ((f64::from(index) * base).fract() * 60_000.0) as u32;
                let ray = CanopyRay {
                    place: UVec2::new(2_200_000_000 + at(0.754_877_67), 510_000_000 + at(0.569_840_29)),
                    height: canopy_height,
                    along: Vec2::from_angle(heading),
                    fall,
                    unit_metres: Vec2::new(0.009_33 * 0.68, 0.009_33),
                };
                match first_crown(view, &ray, &stand) {
                    Met::Crown(hit) => {
                        let crown = (hit.outward * hit.steepness).extend(1.0).normalize();
                        Some((hit.height, (crown + 0.85 * Vec3::Z).normalize()))
                    }
                    Met::Gap => Some((0.3, Vec3::Z)),
                    Met::CutShort => None,
                }
            })
            .collect()
    }

    /// So that no line is seen where single crowns give way to their mean.
    #[test]
    fn the_mean_is_that_of_the_crowns() {
        let view = view();
        let (mut worst, mut sum, mut count) = (0.0_f32, 0.0, 0.0);
        for canopy_height in [6.0, 9.0, 12.0] {
            let stand = stand_of(&view, canopy_height, 1.0);
            for (fall, heading) in FALLS.into_iter().zip([0.2_f32, 1.4, 2.9, 4.1, 5.3, 0.8]) {
                let seen = seen(&view, canopy_height, fall, heading);
                assert!(seen.len() * 2 > RAYS as usize, "{} rays of fall {fall}", seen.len());
                let away = Vec2::from_angle(heading).extend(0.0);
                let along = (away - fall * Vec3::Z).normalize();
                let height = mean_crown_height(&stand, fall);
                for elevation in [20.0_f32, 40.0, 60.0] {
                    for turn in [0.0_f32, 60.0, 120.0, 180.0] {
                        let (sine, cosine) = elevation.to_radians().sin_cos();
                        let sun = (Vec2::from_angle(heading + turn.to_radians()) * cosine).extend(sine);
                        let (rise, behind) = (sine / cosine, (-along.dot(sun)).max(0.0));
                        let normal = mean_crown_normal(away, fall, Vec3::Z);
                        let mean = mean_crown_light(normal, sun, &stand, height, rise, behind);
                        let mut crowns = CrownLight { direct: 0.0, through: 0.0, ambient: 0.0 };
                        for &(height, normal) in &seen {
                            let light = crown_light(normal, sun, height.clamp(0.0, 1.0));
                            let sunlit = light_into_canopy(&stand, height, rise, behind);
                            crowns.direct += light.direct * sunlit / seen.len() as f32;
                            crowns.through += light.through * sunlit / seen.len() as f32;
                            crowns.ambient += light.ambient * crown_sky(height) / seen.len() as f32;
                        }
                        // As bright as forest is with the sun at a sky's several times.
                        let all = |light: &CrownLight| light.direct + 0.2 * light.ambient;
                        let ratio = all(&mean) / all(&crowns);
                        worst = worst.max((ratio - 1.0).abs());
                        sum += ratio;
                        count += 1.0;
                        let case = format!("{canopy_height} m, fall {fall}, sun {elevation}° at {turn}°");
                        assert!((ratio - 1.0).abs() < 0.15, "{case}: {mean:?} of {crowns:?}");
                        assert!(
                            (mean.ambient / crowns.ambient - 1.0).abs() < 0.1,
                            "{case}: {mean:?} {crowns:?}"
                        );
                        assert!((mean.through - crowns.through).abs() < 0.12, "{case}: {mean:?} {crowns:?}");
                    }
                }
            }
        }
        println!("mean over crowns: {:.3} on average, off by {worst:.3} at worst", sum / count);
        assert!((sum / count - 1.0).abs() < 0.05, "{}", sum / count);
    }

    #[test]
    fn closed_forest_hides_its_ground_and_thin_forest_does_not() {
        let view = view();
        let gaps = |canopy_height: f32| {
            let seen = seen(&view, canopy_height, 1.0, 0.7);
            seen.iter().filter(|(_, normal)| *normal == Vec3::Z).count() as f32 / seen.len() as f32
        };
        assert!(gaps(11.0) < 0.08, "{}", gaps(11.0));
        assert!(gaps(2.0) > 0.4, "{}", gaps(2.0));
    }

    #[test]
    fn an_eye_with_the_sun_behind_it_sees_no_shade() {
        let stand = stand_of(&view(), 10.0, 1.0);
        assert_eq!(light_into_canopy(&stand, 0.5, 0.8, 1.0), 1.0);
        let (low, high) =
            (light_into_canopy(&stand, 0.5, 0.2, 0.0), light_into_canopy(&stand, 0.5, 2.0, 0.0));
        assert!(low < 0.5 * high && high < 1.0, "{low} {high}");
    }
}
