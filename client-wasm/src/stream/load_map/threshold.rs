//! How many times coarser than asked for tiles are wanted, so that all that is in sight finds a slot.
//!
//! The horizon from a summit names more tiles than any budget holds. Rather than leave some of them out, all are
//! wanted a little coarser. A camera at rest ends at the finest threshold that fits, whichever way it came: the same
//! view gives the same picture.

/// A step of the threshold.
const STEP: f64 = 1.25;
/// Steps at most: one tile for the whole scene.
const MOST_STEPS: i32 = 37;
/// Of the slots: above this share of wanted tiles the threshold grows.
const CROWDED: f64 = 0.95;
/// Below this share it shrinks while the camera moves. A step finer names up to 1.25² times as many tiles:
/// what has just shrunk does not grow again at once.
const ROOMY: f64 = 0.5;

/// The threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Threshold {
    steps: i32,
    /// The last step was one down, at rest, to see whether it fits.
    tries: bool,
    /// Steps at which a try at rest did not fit; not tried again before the camera moves.
    too_fine: Option<i32>,
}

impl Threshold {
    /// Texels may be so many times larger.
    pub fn factor(self) -> f64 {
        STEP.powi(self.steps)
    }

    /// Tiles take turns in the same slots at rest: what each map names depends on which of them is drawn. This
    /// threshold is too fine, and is not tried again before the camera moves.
    pub fn takes_turns(&mut self) {
        self.too_fine = Some(self.steps);
        self.tries = false;
        self.steps = (self.steps + 1).min(MOST_STEPS);
    }

    /// Judges a map that was made with this threshold. `crowding`: tiles wanted over slots; `moves`: the camera
    /// moves; `complete`: all that is wanted has come.
    pub fn judge(&mut self, crowding: f64, moves: bool, complete: bool) {
        if moves {
            self.tries = false;
            self.too_fine = None;
        }
        if crowding > CROWDED {
            if self.tries {
                self.too_fine = Some(self.steps);
                self.tries = false;
            }
            self.steps = (self.steps + 1).min(MOST_STEPS);
            return;
        }
        let finer = self.steps - 1;
        let shrinks = if moves { crowding < ROOMY } else { complete && self.too_fine != Some(finer) };
        if finer >= 0 && shrinks {
            self.steps = finer;
            self.tries = !moves;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Wherever it starts, at rest it ends at the finest threshold that fits, and stays.
        #[test]
        fn at_rest_the_finest_that_fits(start in 0..=MOST_STEPS, first in 0.1..40.0_f64, shrinks in proptest::collection::vec(0.4..1.0_f64, 38)) {
            let crowding: Vec<f64> = shrinks.iter().scan(first, |share, factor| { *share *= factor; Some(*share) }).collect();
            let mut threshold = Threshold { steps: start, ..Threshold::default() };
            for _ in 0..2 * MOST_STEPS {
                threshold.judge(crowding[threshold.steps as usize], false, true);
            }
            let fits = crowding.iter().position(|&share| share <= CROWDED).map_or(MOST_STEPS, |steps| steps as i32);
            prop_assert_eq!(threshold.steps, fits.min(MOST_STEPS));
            let before = threshold;
            threshold.judge(crowding[threshold.steps as usize], false, true);
            prop_assert_eq!(threshold.steps, before.steps);
        }
    }

    #[test]
    fn in_motion_it_follows_without_flicker() {
        let mut threshold = Threshold::default();
        // As many tiles as the square of the fineness: 3 times the slots.
        let crowding = |threshold: Threshold| 3.0 / threshold.factor().powi(2);
        let mut last = Vec::new();
        for _ in 0..40 {
            threshold.judge(crowding(threshold), true, false);
            last.push(threshold.steps);
        }
        assert!(last[10..].windows(2).all(|pair| pair[0] == pair[1]), "{last:?}");
        for _ in 0..40 {
            threshold.judge(0.1, true, false);
        }
        assert_eq!(threshold.factor(), 1.0);
    }

    #[test]
    fn what_took_turns_is_not_tried_again_before_the_camera_moves() {
        let mut threshold = Threshold { steps: 3, ..Threshold::default() };
        threshold.takes_turns();
        threshold.judge(0.4, false, true);
        assert_eq!(threshold.steps, 4);
        threshold.judge(0.4, true, true);
        assert_eq!(threshold.steps, 3);
    }

    #[test]
    fn nothing_finer_is_tried_before_all_has_come() {
        let mut threshold = Threshold { steps: 4, ..Threshold::default() };
        threshold.judge(0.7, false, false);
        assert_eq!(threshold.steps, 4);
        threshold.judge(0.7, false, true);
        assert_eq!(threshold.steps, 3);
    }
}
