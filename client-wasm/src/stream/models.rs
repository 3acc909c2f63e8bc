//! Models of a scene's species: each is asked for once, when its first stand comes near. A plain state machine.

use super::requests::{Failure, FetchFailure, RequestId};
use treeline_core::scene::SceneDescription;
use treeline_core::tree_model::TreeSpecies;

/// Delay after the first failure, seconds; each further one doubles it.
const FIRST_DELAY_SECONDS: f64 = 0.5;
/// Longest delay, seconds; at once that of a refusal.
const LONGEST_DELAY_SECONDS: f64 = 30.0;

/// What there is of a species' model.
#[derive(Debug)]
enum State {
    /// None of its trees has come near.
    Unwanted,
    /// Not asked for, or failed.
    Missing(Option<Failure>),
    /// Under way; how often it has failed before.
    Asked(RequestId, u32),
    /// It has come.
    Here(Box<TreeSpecies>),
}

/// The models.
#[derive(Debug)]
pub struct Models {
    /// What a code follows; `None` where the server has no models.
    base: Option<String>,
    revision: String,
    /// By code, with those between that grow nowhere.
    species: Vec<(u8, State)>,
    /// Something has come since the models were last looked at.
    changed: bool,
}

impl Models {
    /// Of a scene's species.
    pub fn new(scene: &SceneDescription) -> Self {
        Self {
            base: scene.trees.clone().filter(|_| !scene.species.is_empty()),
            revision: scene.revision.clone(),
            species: (1..=scene.species.iter().map(|species| species.code).max().unwrap_or(0))
                .map(|code| (code, State::Unwanted))
                .collect(),
            changed: false,
        }
    }

    /// A stand of the species of a code has come near.
    pub fn want(&mut self, code: u8) {
        if self.base.is_none() {
            return;
        }
        for (_, state) in self.species.iter_mut().filter(|(known, _)| *known == code) {
            if matches!(state, State::Unwanted) {
                *state = State::Missing(None);
            }
        }
    }

    /// Whether nothing is to come now.
    pub fn are_here(&self) -> bool {
        self.species.iter().all(|(_, state)| matches!(state, State::Unwanted | State::Here(_)))
    }

    /// What to ask for now: species and addresses, under ids of `next_id`.
    pub fn plan(&mut self, now: f64, mut next_id: impl FnMut() -> RequestId) -> Vec<(RequestId, u8, String)> {
        let Some(base) = &self.base else { return Vec::new() };
        let mut start = Vec::new();
        for (code, state) in &mut self.species {
            let State::Missing(failure) = state else { continue };
            if failure.as_ref().is_some_and(|failure| failure.not_before > now) {
                continue;
            }
            let attempts = failure.as_ref().map_or(0, |failure| failure.attempts);
            let id = next_id();
            start.push((id, *code, format!("{base}{code}?revision={}", self.revision)));
            *state = State::Asked(id, attempts);
        }
        start
    }

    /// Whether a request is one of these, and under way.
    pub fn is_asked(&self, id: RequestId) -> bool {
        self.species.iter().any(|(_, state)| matches!(state, State::Asked(known, _) if *known == id))
    }

    /// Takes an answer; says whether it was good.
    pub fn deliver(&mut self, now: f64, id: RequestId, answer: Result<Vec<u8>, FetchFailure>) -> bool {
        let asked = |state: &State| matches!(state, State::Asked(known, _) if *known == id);
        let Some((code, state)) = self.species.iter_mut().find(|(_, state)| asked(state)) else {
            return false;
        };
        let State::Asked(_, attempts) = *state else { return false };
        let decoded = answer.and_then(|bytes| {
            TreeSpecies::decode(&bytes).map_err(|error| FetchFailure::Temporary(error.to_string()))
        });
        let decoded = decoded.and_then(|model| {
            let other =
                || FetchFailure::Permanent(format!("the model of species {} came for {code}", model.code));
            if model.code == *code { Ok(model) } else { Err(other()) }
        });
        *state = match decoded {
            Ok(model) => State::Here(Box::new(model)),
            Err(last) => {
                let doubled = FIRST_DELAY_SECONDS * f64::from(attempts.min(10)).exp2();
                let delay = match last {
                    FetchFailure::Permanent(_) => LONGEST_DELAY_SECONDS,
                    FetchFailure::Temporary(_) => doubled.min(LONGEST_DELAY_SECONDS),
                };
                State::Missing(Some(Failure { attempts: attempts + 1, not_before: now + delay, last }))
            }
        };
        let is_here = matches!(state, State::Here(_));
        self.changed |= is_here;
        is_here
    }

    /// The models by code, of code 1 first, those that have come: where one has come since this was last asked, and
    /// none is awaited.
    pub fn take(&mut self) -> Option<Vec<Option<&TreeSpecies>>> {
        if !self.changed || !self.are_here() {
            return None;
        }
        self.changed = false;
        let last = self.species.iter().map(|(code, _)| usize::from(*code)).max().unwrap_or(0);
        let mut models = vec![None; last];
        for (code, state) in &self.species {
            if let (State::Here(model), Some(place)) = (state, usize::from(*code).checked_sub(1)) {
                models[place] = Some(&**model);
            }
        }
        Some(models)
    }

    /// A model that has failed: its address, and how.
    pub fn failure(&self) -> Option<(String, &Failure)> {
        let base = self.base.as_ref()?;
        self.species.iter().find_map(|(code, state)| match state {
            State::Missing(Some(failure)) => Some((format!("{base}{code}"), failure)),
            _ => None,
        })
    }

    /// The way to the server is open again: what failed is asked for at once.
    pub fn retry_now(&mut self, now: f64) {
        for (_, state) in &mut self.species {
            if let State::Missing(Some(failure)) = state {
                failure.not_before = now;
            }
        }
    }

    /// When a model that failed may be asked for again, seconds.
    pub fn next_retry(&self) -> Option<f64> {
        let waiting = self.species.iter().filter_map(|(_, state)| match state {
            State::Missing(Some(failure)) => Some(failure.not_before),
            _ => None,
        });
        waiting.min_by(f64::total_cmp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::simulation::scene;
    use treeline_core::scene::SceneSpecies;
    use treeline_core::seeds::Species;

    fn models() -> Models {
        let species: Vec<SceneSpecies> = Species::built_in()
            .into_iter()
            .map(|species| SceneSpecies {
                code: species.code,
                name: species.definition.name.clone(),
                height: 20.0,
                crown_radius_ratio: species.definition.crown_radius_ratio,
                definition: species.definition,
            })
            .collect();
        Models::new(&SceneDescription { species, trees: Some("/trees/".into()), ..scene() })
    }

    #[test]
    fn each_is_asked_for_once_and_again_when_it_failed() {
        let mut models = models();
        let mut count = 0;
        let mut next = || {
            count += 1;
            RequestId(count)
        };
        assert!(models.are_here() && models.plan(0.0, &mut next).is_empty(), "none of their trees is near");
        [1, 2, 1].into_iter().for_each(|code| models.want(code));
        let asked = models.plan(0.0, &mut next);
        assert_eq!(asked.len(), 2);
        assert_eq!(asked[0].2, format!("/trees/1?revision={}", scene().revision));
        assert!(models.plan(0.0, &mut next).is_empty());
        assert!(models.is_asked(asked[0].0));
        assert!(!models.deliver(0.0, asked[0].0, Err(FetchFailure::Temporary("503".into()))));
        assert!(!models.is_asked(asked[0].0), "it is no longer under way");
        assert!(!models.deliver(0.0, asked[1].0, Ok(b"nonsense".to_vec())));
        assert_eq!(models.next_retry(), Some(0.5));
        assert!(models.plan(0.4, &mut next).is_empty() && models.take().is_none());
        let again = models.plan(0.6, &mut next);
        assert_eq!(again.len(), 2);
        models.deliver(1.0, again[1].0, Err(FetchFailure::Permanent("404".into())));
        assert_eq!(models.failure().unwrap().1.attempts, 2);
        assert_eq!(models.next_retry(), Some(31.0));
        assert!(!models.are_here());
    }

    #[test]
    fn a_model_stands_at_the_place_of_its_code() {
        let species = &Species::built_in()[4];
        let grown = SceneSpecies {
            code: species.code,
            name: species.definition.name.clone(),
            height: 20.0,
            crown_radius_ratio: species.definition.crown_radius_ratio,
            definition: species.definition.clone(),
        };
        let scene = SceneDescription { species: vec![grown], trees: Some("/trees/".into()), ..scene() };
        let mut models = Models::new(&scene);
        models.want(5);
        let asked = models.plan(0.0, || RequestId(7));
        assert!(models.deliver(0.1, asked[0].0, Ok(TreeSpecies::grow(species).encode())));
        let table = models.take().unwrap();
        assert_eq!(table.len(), 5);
        assert!(table[..4].iter().all(Option::is_none) && table[4].is_some_and(|model| model.code == 5));
    }

    #[test]
    fn a_server_without_models_is_not_asked() {
        let mut models = Models::new(&scene());
        models.want(1);
        assert!(models.are_here() && models.plan(0.0, || RequestId(0)).is_empty());
    }
}
