//! Two fingers: apart and together zoom, round turns, both up or down tilts.

use glam::{DVec2, DVec3};

/// Pixels that both fingers go before it is decided what they do.
const DECISION_PIXELS: f64 = 12.0;

/// What two fingers do until one is lifted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Not decided yet.
    Open,
    /// Zoom, turn and move.
    Hold,
    /// Tilt.
    Tilt,
}

/// Two fingers that are down.
#[derive(Clone, Copy, Debug)]
pub struct Pinch {
    /// The ground between the fingers, ECEF metres.
    pub anchor: Option<DVec3>,
    start: [DVec2; 2],
    last: [DVec2; 2],
    kind: Kind,
}

/// What a move of two fingers asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// What the distance to the anchor is multiplied by.
    pub distance_factor: f64,
    /// Clockwise, for the heading, degrees.
    pub turn_degrees: f64,
    /// Upward, for the pitch, pixels.
    pub tilt_pixels: f64,
    /// Middle of the fingers, pixels.
    pub centre: DVec2,
    /// How far the middle moved, pixels.
    pub centre_moved: DVec2,
}

impl Pinch {
    /// Two fingers at two places (CSS pixels).
    pub fn new(first: DVec2, second: DVec2, anchor: Option<DVec3>) -> Self {
        Self { anchor, start: [first, second], last: [first, second], kind: Kind::Open }
    }

    /// Whether the fingers tilt.
    pub fn tilts(&self) -> bool {
        self.kind == Kind::Tilt
    }

    /// The fingers are at two other places now.
    pub fn moved(&mut self, first: DVec2, second: DVec2) -> Change {
        let now = [first, second];
        let before = std::mem::replace(&mut self.last, now);
        if self.kind == Kind::Open {
            self.kind = self.decide();
        }
        let centre = 0.5 * (now[0] + now[1]);
        let centre_moved = centre - 0.5 * (before[0] + before[1]);
        let mut change =
            Change { distance_factor: 1.0, turn_degrees: 0.0, tilt_pixels: 0.0, centre, centre_moved };
        let (from, to) = (before[1] - before[0], now[1] - now[0]);
        match self.kind {
            Kind::Open => {}
            Kind::Tilt => change.tilt_pixels = -centre_moved.y,
            Kind::Hold => {
                // Fingers on one spot have no direction.
                change.distance_factor = (from.length().max(8.0) / to.length().max(8.0)).clamp(0.2, 5.0);
                if from.length() > 8.0 && to.length() > 8.0 {
                    // Pixels count downward, so a positive angle is clockwise; the landscape follows the
                    // fingers, and the heading goes the other way.
                    change.turn_degrees = -from.angle_to(to).to_degrees();
                }
            }
        }
        change
    }

    /// Side by side and both the same way up or down is a tilt; anything else holds the ground.
    fn decide(&self) -> Kind {
        let [first, second] = [self.last[0] - self.start[0], self.last[1] - self.start[1]];
        let apart = (self.last[1] - self.last[0]).length() - (self.start[1] - self.start[0]).length();
        if apart.abs() > DECISION_PIXELS {
            return Kind::Hold;
        }
        if first.length().min(second.length()) < DECISION_PIXELS {
            let one = first.length().max(second.length()) > 3.0 * DECISION_PIXELS;
            return if one { Kind::Hold } else { Kind::Open };
        }
        let upright = |moved: DVec2| moved.y.abs() > 2.0 * moved.x.abs();
        let side_by_side = {
            let between = self.start[1] - self.start[0];
            between.x.abs() > between.y.abs()
        };
        if upright(first) && upright(second) && first.y * second.y > 0.0 && side_by_side {
            Kind::Tilt
        } else {
            Kind::Hold
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drag(pinch: &mut Pinch, first: (f64, f64), second: (f64, f64)) -> Vec<Change> {
        let (from, to) = (pinch.last, [DVec2::from(first), DVec2::from(second)]);
        (1..=20)
            .map(|step| {
                let share = f64::from(step) / 20.0;
                pinch.moved(from[0].lerp(to[0], share), from[1].lerp(to[1], share))
            })
            .collect()
    }

    #[test]
    fn apart_comes_nearer() {
        let mut pinch = Pinch::new(DVec2::new(100.0, 100.0), DVec2::new(200.0, 100.0), None);
        let factor: f64 = drag(&mut pinch, (50.0, 100.0), (250.0, 100.0))
            .iter()
            .map(|change| change.distance_factor)
            .product();
        assert!((0.5..0.62).contains(&factor), "{factor}");
        assert!(!pinch.tilts());
    }

    #[test]
    fn both_up_tilts_and_nothing_else() {
        let mut pinch = Pinch::new(DVec2::new(100.0, 300.0), DVec2::new(200.0, 300.0), None);
        let changes = drag(&mut pinch, (102.0, 200.0), (202.0, 200.0));
        let tilt: f64 = changes.iter().map(|change| change.tilt_pixels).sum();
        assert!(pinch.tilts() && tilt > 80.0, "{tilt}");
        assert!(changes.iter().all(|change| change.distance_factor == 1.0 && change.turn_degrees == 0.0));
    }

    #[test]
    fn round_turns_against_the_fingers() {
        let mut pinch = Pinch::new(DVec2::new(100.0, 100.0), DVec2::new(200.0, 100.0), None);
        // A quarter turn clockwise on the screen.
        let centre = DVec2::new(150.0, 100.0);
        let mut turned = 0.0;
        for degrees in 1..=90 {
            let arm = DVec2::from_angle(f64::from(degrees).to_radians()) * 50.0;
            turned += pinch.moved(centre - arm, centre + arm).turn_degrees;
        }
        assert!((-90.0..-60.0).contains(&turned), "{turned}");
    }
}
