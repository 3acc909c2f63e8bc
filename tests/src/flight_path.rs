//! Where flights go.

use crate::flight_world as world;
use treeline_core::camera::GeographicCamera;
use treeline_core::hash::hash;

/// Metres of a degree of latitude; of longitude at 47° N.
const METRES: [f64; 2] = [75_900.0, 111_200.0];

/// The camera, so many metres farther the way it looks, at the same height.
pub fn ahead(camera: GeographicCamera, metres: f64) -> GeographicCamera {
    let (sine, cosine) = camera.heading_deg.to_radians().sin_cos();
    GeographicCamera {
        lon: camera.lon + metres * sine / METRES[0],
        lat: camera.lat + metres * cosine / METRES[1],
        ..camera
    }
}

/// An endless flight over the analytic landscape: it turns, climbs, rests and jumps, the same for the same seed.
#[derive(Clone, Debug)]
pub struct RandomFlight {
    seed: u32,
    count: u32,
    camera: GeographicCamera,
    /// Metres, degrees of heading, of pitch, and the factor of the height above ground, a frame.
    motion: [f64; 4],
    above: f64,
    left: u32,
}

impl RandomFlight {
    /// One of many.
    pub fn new(seed: u32) -> Self {
        Self { seed, count: 0, camera: world::scene().camera, motion: [0.0; 4], above: 800.0, left: 0 }
    }

    /// The next number between two.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.count += 1;
        low + (high - low) * f64::from(hash(self.seed, self.count, 77)) / f64::from(u32::MAX)
    }

    fn jump(&mut self) {
        self.camera.lon = self.between(10.85, 11.28);
        self.camera.lat = self.between(46.85, 47.25);
        self.camera.heading_deg = self.between(0.0, 360.0);
        self.camera.pitch_deg = self.between(-80.0, 5.0);
        // From 20 m to 6 km, as often low as high.
        self.above = 20.0 * self.between(0.0, 300.0_f64.ln()).exp();
    }
}

impl Iterator for RandomFlight {
    type Item = GeographicCamera;

    fn next(&mut self) -> Option<GeographicCamera> {
        if self.left == 0 {
            self.left = self.between(5.0, 60.0) as u32;
            let kind = self.between(0.0, 1.0);
            self.motion = if kind < 0.15 {
                [0.0; 4]
            } else {
                [
                    self.between(0.0, 30.0),
                    self.between(-6.0, 6.0),
                    self.between(-1.0, 1.0),
                    self.between(0.97, 1.03),
                ]
            };
            let inside =
                (10.85..11.28).contains(&self.camera.lon) && (46.85..47.25).contains(&self.camera.lat);
            if kind > 0.8 || !inside {
                self.jump();
            }
        }
        self.left -= 1;
        let [metres, heading, pitch, climb] = self.motion;
        let mut camera = ahead(self.camera, metres);
        camera.heading_deg = (camera.heading_deg + heading).rem_euclid(360.0);
        camera.pitch_deg = (camera.pitch_deg + pitch).clamp(-89.0, 20.0);
        self.above = (self.above * climb).clamp(15.0, 8_000.0);
        let ground = world::height(camera.lon, camera.lat);
        camera.height = if ground.is_finite() { ground } else { world::highest() } + self.above;
        self.camera = camera;
        Some(camera)
    }
}
