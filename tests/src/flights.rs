//! Recorded flights over the built-in landscape: views one after the other, as a visitor would see them.

use treeline_core::camera::GeographicCamera;

/// A flight.
#[derive(Clone, Copy, Debug)]
pub struct Flight {
    /// What it is called.
    pub name: &'static str,
    /// First and last view; between them every number goes evenly.
    ends: [[f64; 5]; 2],
}

/// The flights: along a valley, round a summit, down from ten kilometres.
pub const FLIGHTS: [Flight; 3] = [
    Flight {
        name: "valley",
        ends: [[11.194, 47.0813, 850.0, 200.0, -5.0], [11.1962, 47.0463, 900.0, 250.0, -5.0]],
    },
    Flight {
        name: "summit panorama",
        ends: [[10.93875, 46.98875, 3_600.0, 0.0, -6.0], [10.93875, 46.98875, 3_600.0, 180.0, -6.0]],
    },
    Flight {
        name: "dive from 10 km",
        ends: [[11.0, 46.9, 10_000.0, 10.0, -60.0], [11.02, 46.93, 2_200.0, 30.0, -20.0]],
    },
];

impl Flight {
    /// So many views of it, first and last included.
    pub fn views(&self, count: usize) -> Vec<GeographicCamera> {
        let last = count.max(2) - 1;
        (0..=last)
            .map(|index| {
                let share = index as f64 / last as f64;
                let at =
                    |field: usize| self.ends[0][field] + share * (self.ends[1][field] - self.ends[0][field]);
                GeographicCamera {
                    lon: at(0),
                    lat: at(1),
                    // Heights shrink evenly in proportion: a dive slows down near the ground.
                    height: self.ends[0][2] * (self.ends[1][2] / self.ends[0][2]).powf(share),
                    heading_deg: at(3),
                    pitch_deg: at(4),
                    fov_y_deg: 50.0,
                }
            })
            .collect()
    }
}
