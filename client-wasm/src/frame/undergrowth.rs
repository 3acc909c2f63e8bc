//! The undergrowth of a frame: its passes, made when first needed, and what they counted.

use super::MAPS_IN_FLIGHT;
use crate::gpu::GpuContext;
use crate::gpu::plant_models::PlantModels;
use crate::gpu::read_back_belt::Belt;
use crate::passes::select_trees::SelectVariant;
use crate::passes::select_undergrowth::SelectUndergrowth;
use crate::passes::timing::PassTimer;
use crate::passes::trees::TreesVariant;
use crate::passes::undergrowth::Undergrowth;
use crate::stats::UndergrowthStats;
use crate::stream::undergrowth::UndergrowthBlocks;
use treeline_shaders::undergrowth::{BINS, UndergrowthDraws};

/// Places of the passes in [`super::PASSES`].
const SELECT_TIME: usize = 6;
const DRAW_TIME: usize = 7;
/// Share of the trees' range up to which the canopy of the heights has wholly given way (`canopy_below.wgsl`).
const CANOPY_GONE: f32 = 0.62;

/// The passes; nothing is there before the first frame that has any.
#[derive(Debug, Default)]
pub struct FrameUndergrowth {
    models: Option<PlantModels>,
    select: Option<SelectUndergrowth>,
    draw: Option<Undergrowth>,
    belt: Option<Belt<()>>,
    stats: Option<UndergrowthStats>,
}

impl FrameUndergrowth {
    /// Makes what a frame with any needs.
    pub fn prepare(
        &mut self,
        gpu: &GpuContext,
        frame_layout: &wgpu::BindGroupLayout,
        view_layout: &wgpu::BindGroupLayout,
        select: SelectVariant,
        draw: TreesVariant,
    ) {
        let (device, queue) = (&gpu.device, &gpu.queue);
        let models = self.models.get_or_insert_with(|| PlantModels::new(device, queue));
        if self.select.as_ref().is_none_or(|pass| pass.variant != select) {
            self.select = Some(SelectUndergrowth::new(device, queue, frame_layout, select, models));
            // Its buffers are new ones.
            self.draw = None;
        }
        if self.draw.as_ref().is_none_or(|pass| pass.variant != draw) {
            self.draw = Some(Undergrowth::new(device, view_layout, draw));
        }
        let bytes = size_of::<UndergrowthDraws>() as u64;
        self.belt.get_or_insert_with(|| Belt::new(device, bytes, MAPS_IN_FLIGHT));
    }

    /// None is drawn in a frame.
    pub fn rest(&mut self) {
        self.stats = None;
    }

    /// Records the selection. `tree_range`: up to which distance trees are drawn, 0 where none are.
    pub fn record_selection(
        &mut self,
        gpu: &GpuContext,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::BindGroup,
        seen: &UndergrowthBlocks,
        tree_range: f32,
        timer: Option<&PassTimer>,
    ) {
        let Some(pass) = &mut self.select else { return };
        let times = timer.and_then(|timer| timer.compute_writes(SELECT_TIME));
        let (device, queue) = (&gpu.device, &gpu.queue);
        pass.record(device, queue, encoder, frame, seen, CANOPY_GONE * tree_range, times);
        if let Some(belt) = &mut self.belt {
            // Where too many are on their way back, this frame is not counted.
            belt.schedule(encoder, &[pass.draws()], ());
        }
    }

    /// Records the drawing. `trees_follow`: the depths are wanted once more.
    #[allow(clippy::too_many_arguments, reason = "what a pass is given")]
    pub fn record_drawing(
        &mut self,
        gpu: &GpuContext,
        encoder: &mut wgpu::CommandEncoder,
        view: &wgpu::BindGroup,
        picture: &wgpu::TextureView,
        depth: &wgpu::TextureView,
        trees_follow: bool,
        timer: Option<&PassTimer>,
    ) {
        let (Some(pass), Some(selected), Some(models)) = (&mut self.draw, &self.select, &self.models) else {
            return;
        };
        let times = timer.and_then(|timer| timer.writes(DRAW_TIME));
        pass.record(&gpu.device, encoder, view, selected, models, picture, depth, trees_follow, times);
        self.stats.get_or_insert_default().draw_calls = BINS;
    }

    /// After the frame has been submitted.
    pub fn submitted(&mut self) {
        if let Some(belt) = &mut self.belt {
            belt.submitted();
        }
    }

    /// What the last frame had, as far as its counts have come back; `None` where it had none.
    pub fn stats(&mut self, gpu: &GpuContext) -> Option<UndergrowthStats> {
        if let Some(belt) = &mut self.belt {
            let counted = belt.poll(&gpu.device, |(), bytes| {
                let UndergrowthDraws { draws, .. } = bytemuck::pod_read_unaligned(bytes);
                let count = |bin: usize| u64::from(draws[bin].instance_count);
                (count(BINS as usize), (0..BINS as usize).map(count).sum())
            });
            if let (Some((metaseeds, plants)), Some(stats)) = (counted, &mut self.stats) {
                *stats = UndergrowthStats { metaseeds, plants, ..*stats };
            }
        }
        let bytes = self.select.as_ref().map_or(0, SelectUndergrowth::bytes)
            + self.models.as_ref().map_or(0, PlantModels::bytes);
        self.stats.map(|stats| UndergrowthStats { bytes, ..stats })
    }

    /// The pass that selects plants, if any were ever looked at.
    pub fn selection(&self) -> Option<&SelectUndergrowth> {
        self.select.as_ref()
    }

    /// Whether the pass that draws has been compiled.
    pub fn is_compiled(&self) -> bool {
        self.draw.is_some()
    }
}
