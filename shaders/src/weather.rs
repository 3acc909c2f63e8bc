//! Wind and clouds of a frame: where their lumps have drifted to.

use crate::layout::View;
use treeline_core::geodesy::EQUATOR_METRES;

/// Set in [`View::flags`] where the wind blows.
pub const FLAG_WIND: u32 = 4;
/// Set in [`View::flags`] where clouds throw shadows.
pub const FLAG_CLOUDS: u32 = 8;
/// The strongest wind, m/s: a gale.
pub const STRONGEST_WIND: f64 = 20.0;

/// Seconds after which leaves and stems move again as they did.
pub const SWAY_PERIOD_SECONDS: f64 = 256.0;
/// Clouds are driven faster than the gusts below them.
const CLOUDS_FASTER: f64 = 1.7;
/// Width of a gust and of a cloud, metres.
const GUST_METRES: f64 = 85.0;
const CLOUD_METRES: f64 = 1_700.0;
/// Where the wind blows to, clockwise from north, degrees: westerly winds.
const TOWARD_DEGREES: f64 = 105.0;

/// What the weather is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weather {
    /// Speed of the wind, m/s; 0 for none.
    pub wind: f64,
    /// For how long it has blown, seconds.
    pub seconds: f64,
    /// Share of the sky under clouds, 0 … 1; 0 for none.
    pub clouds: f64,
}

impl Weather {
    /// Whether there is any.
    pub fn is_fair(&self) -> bool {
        self.wind <= 0.0 && self.clouds <= 0.0
    }

    /// Writes the weather over an eye (degrees) into a view. `latitude`: one for the whole scene, along which the
    /// lumps lie in metres.
    pub fn write(&self, view: &mut View, eye: [f64; 2], latitude: f64) {
        view.flags |= if self.wind > 0.0 { FLAG_WIND } else { 0 };
        view.flags |= if self.clouds > 0.0 { FLAG_CLOUDS } else { 0 };
        if self.is_fair() {
            return;
        }
        let toward = TOWARD_DEGREES.to_radians();
        let (east, north) = toward.sin_cos();
        let degree = EQUATOR_METRES / 360.0;
        let place = [degree * latitude.to_radians().cos() * eye[0], degree * eye[1]];
        let drifted = |width: f64, faster: f64| {
            let way = self.wind * faster * self.seconds;
            split([(place[0] - way * east) / width, (place[1] - way * north) / width])
        };
        (view.gust_cell, view.gust_part) = drifted(GUST_METRES, 1.0);
        (view.cloud_cell, view.cloud_part) = drifted(CLOUD_METRES, CLOUDS_FASTER);
        let turn = self.seconds.rem_euclid(SWAY_PERIOD_SECONDS) / SWAY_PERIOD_SECONDS;
        view.wind = [east as f32, north as f32, self.wind as f32, turn as f32];
        view.clouds = self.clouds as f32;
    }
}

/// Whole parts and the rest.
fn split(place: [f64; 2]) -> ([i32; 2], [f32; 2]) {
    (place.map(|value| value.floor() as i32), place.map(|value| (value - value.floor()) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::weather::{cloud_light, gust_at};
    use glam::{Vec2, Vec3};

    fn view(weather: Weather, eye: [f64; 2]) -> View {
        let mut view = View { sun: [0.4, -0.3, 0.866, 6.37e6], ..View::default() };
        weather.write(&mut view, eye, 46.9);
        view
    }

    #[test]
    fn fair_weather_leaves_a_view_as_it_is() {
        let fair = Weather { seconds: 12.0, ..Weather::default() };
        assert_eq!(view(fair, [11.0, 46.9]), View { sun: [0.4, -0.3, 0.866, 6.37e6], ..View::default() });
    }

    #[test]
    fn lumps_stand_on_the_land_and_drift_with_the_wind() {
        let degree = EQUATOR_METRES / 360.0;
        let (metres_east, metres_north) = (degree * 46.9_f64.to_radians().cos(), degree);
        let weather = Weather { wind: 6.0, seconds: 40.0, clouds: 0.5 };
        let here = view(weather, [11.0, 46.9]);
        // An eye 300 m farther east and 200 m north sees the same lumps where they are.
        let there = view(weather, [11.0 + 300.0 / metres_east, 46.9 + 200.0 / metres_north]);
        // As long after as the wind needs for 120 m they are 120 m farther.
        let later = view(Weather { seconds: 60.0, ..weather }, [11.0, 46.9]);
        let way = 120.0 * Vec2::new(here.wind[0], here.wind[1]);
        for step in 0..200 {
            let place = Vec2::new(37.0 * step as f32 - 3_000.0, 11.0 * step as f32);
            let gust = gust_at(&here, place);
            assert!((gust - gust_at(&there, place - Vec2::new(300.0, 200.0))).abs() < 2e-3);
            assert!((gust - gust_at(&later, place + way)).abs() < 2e-3);
            let light = |view: &View, place: Vec2| cloud_light(view, place.extend(0.0), 1_200.0);
            let moved = light(&later, place + CLOUDS_FASTER as f32 * way);
            assert!((light(&here, place) - moved).abs() < 5e-3);
        }
    }

    #[test]
    fn as_much_of_the_land_is_in_shadow_as_is_asked_for() {
        let mut last = 0.0;
        for clouds in [0.1, 0.3, 0.5, 0.7, 0.9] {
            let view = view(Weather { clouds, ..Weather::default() }, [11.0, 46.9]);
            let shaded = (0..4_000)
                .filter(|step| {
                    let place = Vec3::new(911.0 * (step % 63) as f32, 877.0 * (step / 63) as f32, 0.0);
                    cloud_light(&view, place, 1_000.0) < 0.6
                })
                .count();
            let share = shaded as f64 / 4_000.0;
            assert!(share > last && (share - clouds).abs() < 0.17, "{clouds}: {share}");
            last = share;
        }
    }
}
