//! Surveys: when a Tile Load Map is made, what it was made for, and how long it took to come back.
//!
//! A plain state machine beside the read-back belt. A camera that rests over tiles that have all come needs
//! no survey; one that moves looks ahead by as long as an answer takes.

use crate::stream::load_map::stack::Stack;
use crate::stream::view::ViewGeometry;
use glam::DVec3;
use serde::Serialize;

/// Share of a new measurement in the smoothed latencies.
const SMOOTHING: f64 = 0.2;
/// The eye is not looked for farther ahead than this, seconds.
const LONGEST_LOOK_AHEAD_SECONDS: f64 = 2.0;
/// A view older than this, seconds, says nothing of the camera's speed.
const STALE_VIEW_SECONDS: f64 = 0.5;

/// A map on its way back.
#[derive(Clone, Debug)]
pub struct Ticket {
    /// What it was made for.
    pub stack: Stack,
    /// Who looked.
    pub view: ViewGeometry,
    /// Whether the camera had moved since the one before.
    pub moves: bool,
    state: u64,
    scheduled: f64,
    frame: u64,
}

/// What the panel and the stats show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SurveyStats {
    /// Maps made.
    pub made: u64,
    /// Maps read back.
    pub read: u64,
    /// From the submission of a map to its analysis, milliseconds, smoothed.
    pub latency_milliseconds: f64,
    /// The same in frames.
    pub latency_frames: f64,
    /// How many times coarser than asked for, so that everything in sight has a slot.
    pub threshold: f64,
}

/// The state.
#[derive(Debug, Default)]
pub struct Survey {
    /// Counts everything that changes what a map would say.
    state: u64,
    /// State of the last map taken in.
    known: Option<u64>,
    /// State of the last map made.
    made: Option<u64>,
    last_made: Option<ViewGeometry>,
    seen: Option<(ViewGeometry, f64)>,
    /// Of the eye, metres a second in ECEF.
    velocity: DVec3,
    /// From asking for a tile to having it, seconds, smoothed.
    fetch_seconds: f64,
    stats: SurveyStats,
}

impl Survey {
    /// What is drawn has changed: the next map may say something else.
    pub fn changed(&mut self) {
        self.state += 1;
    }

    /// Whether the last map taken in still holds.
    pub fn is_known(&self) -> bool {
        self.known == Some(self.state)
    }

    /// Whether a map has to be made.
    pub fn is_due(&self) -> bool {
        self.made != Some(self.state)
    }

    /// Notes the view at `now` seconds.
    pub fn sees(&mut self, view: &ViewGeometry, now: f64) {
        match &self.seen {
            Some((last, at)) if now > *at && now - at < STALE_VIEW_SECONDS => {
                self.velocity = (view.eye_ecef - last.eye_ecef) / (now - at);
            }
            Some((last, at)) if now == *at && last == view => return,
            _ => self.velocity = DVec3::ZERO,
        }
        self.seen = Some((view.clone(), now));
    }

    /// Notes how long a tile took to come, seconds.
    pub fn fetched(&mut self, seconds: f64) {
        smooth(&mut self.fetch_seconds, seconds);
    }

    /// Where the eye will be when what is asked for now has come: metres from it, east-north-up; `None`
    /// where it rests.
    pub fn look_ahead(&self, view: &ViewGeometry) -> Option<DVec3> {
        let seconds = 1e-3 * self.stats.latency_milliseconds + self.fetch_seconds;
        let offset = self.velocity * seconds.min(LONGEST_LOOK_AHEAD_SECONDS);
        // Less than this is no motion but rounding.
        (offset.length() > 1e-3).then(|| view.enu_from_ecef * offset)
    }

    /// A map is made for the state as it is.
    pub fn made(&mut self, stack: Stack, view: ViewGeometry, now: f64, frame: u64) -> Ticket {
        let moves = self.last_made.as_ref().is_some_and(|last| *last != view);
        self.made = Some(self.state);
        self.last_made = Some(view.clone());
        self.stats.made += 1;
        Ticket { stack, view, moves, state: self.state, scheduled: now, frame }
    }

    /// A map could not be made after all.
    pub fn not_made(&mut self) {
        self.made = None;
    }

    /// A map has come back; what it says is taken in by the caller.
    pub fn read(&mut self, ticket: &Ticket, now: f64, frame: u64) {
        self.known = self.known.max(Some(ticket.state));
        self.stats.read += 1;
        smooth(&mut self.stats.latency_milliseconds, 1e3 * (now - ticket.scheduled).max(0.0));
        smooth(&mut self.stats.latency_frames, (frame - ticket.frame) as f64);
    }

    /// For the panel.
    pub fn stats(&self) -> SurveyStats {
        self.stats
    }
}

fn smooth(value: &mut f64, measured: f64) {
    *value = if *value == 0.0 { measured } else { (1.0 - SMOOTHING) * *value + SMOOTHING * measured };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::load_map::stack::StackOptions;
    use crate::stream::root_grid::RootGrid;
    use treeline_core::camera::GeographicCamera;
    use treeline_core::tile::GeographicBox;

    fn view(lat: f64) -> ViewGeometry {
        let camera = GeographicCamera {
            lon: 10.5,
            lat,
            height: 2_000.0,
            heading_deg: 0.0,
            pitch_deg: -10.0,
            fov_y_deg: 50.0,
        };
        ViewGeometry::new(&camera, 64, 48)
    }

    fn stack(view: &ViewGeometry) -> Stack {
        let grid = RootGrid::covering(&GeographicBox { west: 10.0, south: 46.0, east: 11.0, north: 47.0 }, 8);
        let options = StackOptions {
            deepest: 15,
            elevation: 15,
            texel_pixels: 1.42,
            heights: (0.0, 1_000.0),
            vegetation: None,
            look_ahead: None,
        };
        Stack::new(view, &grid, &options)
    }

    #[test]
    fn a_map_is_made_once_for_each_state() {
        let mut survey = Survey::default();
        assert!(survey.is_due() && !survey.is_known());
        let ticket = survey.made(stack(&view(46.5)), view(46.5), 0.0, 1);
        assert!(!survey.is_due() && !survey.is_known());
        survey.changed();
        survey.read(&ticket, 0.05, 3);
        assert!(survey.is_due() && !survey.is_known(), "it was of an earlier state");
        let ticket = survey.made(stack(&view(46.5)), view(46.5), 0.1, 3);
        survey.read(&ticket, 0.15, 5);
        assert!(survey.is_known() && !survey.is_due() && !ticket.moves);
        assert!((survey.stats().latency_milliseconds - 50.0).abs() < 1e-6);
        assert_eq!((survey.stats().made, survey.stats().read), (2, 2));
    }

    #[test]
    fn a_moving_eye_is_met_where_it_will_be() {
        let mut survey = Survey::default();
        assert_eq!(survey.look_ahead(&view(46.5)), None);
        let ticket = survey.made(stack(&view(46.5)), view(46.5), 0.0, 1);
        survey.read(&ticket, 0.1, 2);
        survey.fetched(0.4);
        // 0.001° of latitude are 111.2 m.
        for step in 0..3 {
            survey.sees(&view(46.5 + 0.001 * f64::from(step)), 0.1 * f64::from(step));
        }
        let ahead = survey.look_ahead(&view(46.502)).unwrap();
        assert!((ahead.y - 556.0).abs() < 3.0 && ahead.x.abs() < 1.0, "{ahead}");
        survey.sees(&view(46.502), 0.3);
        assert_eq!(survey.look_ahead(&view(46.502)), None, "it has come to rest");
    }
}
