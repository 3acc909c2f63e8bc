//! When the server counts as gone, and when it is back: a plain state machine without a network or a
//! clock. On a bad link requests fail now and then; that alone is no outage and nobody is bothered.

/// Failed tiles in a row after which the server itself is asked.
const FAILURES_TO_ASK: u32 = 3;
/// Failed tiles in a row after which the person is told, though the server answers.
const FAILURES_TO_TELL: u32 = 6;
/// Questions in a row without an answer after which the person is told.
const SILENCES_TO_TELL: u32 = 2;
/// Wait after the first question without an answer, seconds; each further one doubles it.
const FIRST_WAIT_SECONDS: f64 = 0.5;
/// Longest wait between two questions, seconds.
const LONGEST_WAIT_SECONDS: f64 = 4.0;

/// What the person is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The server does not answer at all.
    Gone,
    /// It answers, but one tile after the other fails.
    Failing,
}

/// What has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Begin to ask the server whether it is there.
    Ask,
    /// Tell the person.
    Tell(Trouble),
    /// It is over. What failed may be asked for at once.
    Over,
}

/// What is known of the server.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outage {
    failures: u32,
    silences: u32,
    asking: bool,
    told: Option<Trouble>,
}

impl Outage {
    /// A tile has come.
    pub fn tile_came(&mut self) -> Option<Change> {
        self.failures = 0;
        self.told.take().map(|_| Change::Over)
    }

    /// A tile has not come, though it may another time.
    pub fn tile_failed(&mut self) -> Option<Change> {
        self.failures += 1;
        if self.asking || !self.failures.is_multiple_of(FAILURES_TO_ASK) {
            return None;
        }
        self.asking = true;
        Some(Change::Ask)
    }

    /// The server has answered the question: asking is over.
    pub fn answered(&mut self) -> Option<Change> {
        (self.asking, self.silences) = (false, 0);
        match self.told {
            Some(Trouble::Gone) => {
                (self.told, self.failures) = (None, 0);
                Some(Change::Over)
            }
            None if self.failures >= FAILURES_TO_TELL => self.tell(Trouble::Failing),
            _ => None,
        }
    }

    /// The server has not answered the question.
    pub fn silent(&mut self) -> Option<Change> {
        self.silences += 1;
        let gone = self.silences >= SILENCES_TO_TELL && self.told != Some(Trouble::Gone);
        if gone { self.tell(Trouble::Gone) } else { None }
    }

    /// Seconds until it is asked again.
    pub fn wait_seconds(&self) -> f64 {
        let doublings = f64::from(self.silences.saturating_sub(1).min(16));
        (FIRST_WAIT_SECONDS * doublings.exp2()).min(LONGEST_WAIT_SECONDS)
    }

    fn tell(&mut self, trouble: Trouble) -> Option<Change> {
        self.told = Some(trouble);
        Some(Change::Tell(trouble))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fail(outage: &mut Outage, times: u32) -> Vec<Change> {
        (0..times).filter_map(|_| outage.tile_failed()).collect()
    }

    #[test]
    fn a_bad_link_bothers_nobody() {
        let mut outage = Outage::default();
        for _ in 0..100 {
            assert_eq!(fail(&mut outage, 2), []);
            assert_eq!(outage.tile_came(), None);
        }
        assert_eq!(fail(&mut outage, 3), [Change::Ask]);
        assert_eq!(outage.silent(), None, "one question may be lost, too");
        assert_eq!(outage.answered(), None);
    }

    #[test]
    fn a_server_that_is_gone_is_told_once_and_asked_until_it_is_back() {
        let mut outage = Outage::default();
        assert_eq!(fail(&mut outage, 8), [Change::Ask]);
        let silences: Vec<_> = (0..10).filter_map(|_| outage.silent()).collect();
        assert_eq!(silences, [Change::Tell(Trouble::Gone)]);
        assert_eq!(outage.wait_seconds(), LONGEST_WAIT_SECONDS);
        assert_eq!(outage.answered(), Some(Change::Over));
        assert_eq!(fail(&mut outage, 3), [Change::Ask], "the next outage begins anew");
        assert_eq!(outage.wait_seconds(), FIRST_WAIT_SECONDS);
    }

    #[test]
    fn a_tile_that_comes_ends_it_too() {
        let mut outage = Outage::default();
        fail(&mut outage, 3);
        outage.silent();
        outage.silent();
        assert_eq!(outage.tile_came(), Some(Change::Over));
        assert_eq!(outage.answered(), None, "told once is enough");
    }

    #[test]
    fn a_server_that_answers_and_fails_is_told_of_otherwise() {
        let mut outage = Outage::default();
        assert_eq!(fail(&mut outage, 3), [Change::Ask]);
        assert_eq!(outage.answered(), None);
        assert_eq!(fail(&mut outage, 3), [Change::Ask]);
        assert_eq!(outage.answered(), Some(Change::Tell(Trouble::Failing)));
        assert_eq!(outage.tile_came(), Some(Change::Over));
    }
}
