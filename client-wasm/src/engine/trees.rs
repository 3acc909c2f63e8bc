//! The engine's trees: models of species, and what the last frame's trees were selected from.

use super::{Engine, Payload, Resource, TileRequest, Weather};
use crate::passes::select_trees::SelectTrees;
use crate::passes::select_undergrowth::SelectUndergrowth;
use crate::stream::requests::{Failure, FetchFailure, RequestId};
use crate::stream::tree_field::{SeedFrameCells, TreeField};
use crate::stream::undergrowth::UndergrowthBlocks;
use treeline_shaders::layout::View;

impl Engine {
    /// The models of species, once trees are near.
    pub(super) fn model_requests(&mut self, now: f64) -> Vec<TileRequest> {
        if !self.stream.wants_trees() {
            return Vec::new();
        }
        let stream = &mut self.stream;
        let asked = self.models.plan(now, || stream.requests().next_id());
        self.counters.started += asked.len() as u64;
        asked
            .into_iter()
            .map(|(id, code, url)| TileRequest { id, resource: Resource::TreeModel(code), url })
            .collect()
    }

    /// Whether the models that the view wants have come.
    pub(super) fn has_models(&self) -> bool {
        self.models.are_here() || !self.stream.wants_trees()
    }

    /// A model that has failed: its address, and how.
    pub fn model_failure(&self) -> Option<(String, &Failure)> {
        self.models.failure()
    }

    /// A model's answer.
    pub(super) fn deliver_model(&mut self, now: f64, id: RequestId, answer: Result<Payload, FetchFailure>) {
        let bytes = answer.and_then(|payload| match payload {
            Payload::Bytes(bytes) => Ok(bytes),
            Payload::Photo { .. } => {
                Err(FetchFailure::Permanent("a photo where a model was asked for".into()))
            }
        });
        if self.models.deliver(now, id, bytes) {
            self.counters.succeeded += 1;
        } else {
            self.counters.failed += 1;
        }
        if let Some(species) = self.models.take() {
            self.renderer.take_tree_models(&self.gpu, &species);
            self.stale = true;
        }
    }

    /// What grows about the eye, where trees are drawn one by one.
    pub fn tree_field(&self) -> Option<&TreeField> {
        self.stream.tree_field()
    }

    /// What the last frame's trees were selected from; `None` where there were none.
    pub fn drawn_seeds(&self) -> Option<&SeedFrameCells> {
        self.drawn.as_ref().and_then(|drawn| drawn.seeds.as_ref())
    }

    /// What the last frame's passes knew of it.
    pub fn drawn_view(&self) -> Option<&View> {
        self.drawn.as_ref().map(|drawn| &drawn.view)
    }

    /// Whether the last frame's picture changes by itself under a weather: the wind blows, and there is forest in sight
    /// or a cloud's shadow to drift. Where not, nothing has to be drawn again.
    pub fn stirs(&self, weather: &Weather) -> bool {
        let Some(drawn) = self.drawn.as_ref().filter(|_| weather.wind > 0.0) else { return false };
        let leaves = &drawn.tables.leaves;
        drawn.undergrowth.is_some()
            || leaves.iter().any(|leaf| weather.clouds > 0.0 || self.wooded.contains(&leaf.slot))
    }

    /// What the last frame's undergrowth was selected from; `None` where there was none.
    pub fn drawn_undergrowth(&self) -> Option<&UndergrowthBlocks> {
        self.drawn.as_ref().and_then(|drawn| drawn.undergrowth.as_ref())
    }

    /// The pass that selects undergrowth, if there ever was any.
    pub fn select_undergrowth(&self) -> Option<&SelectUndergrowth> {
        self.renderer.select_undergrowth()
    }

    /// The pass that selects trees, if any were ever looked at.
    pub fn select_trees(&self) -> Option<&SelectTrees> {
        self.renderer.select_trees()
    }
}
