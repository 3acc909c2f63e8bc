//! The undergrowth near the eye: clusters of metaseeds grown, tested, sorted by kind (`treeline_shaders::undergrowth`
//! says what comes out). Nothing is read back but counts, for the display.

use super::flag;
use super::select_trees::SelectVariant;
use crate::gpu::plant_models::PlantModels;
use crate::stream::undergrowth::UndergrowthBlocks;
use treeline_core::seeds::metaseed::MOST_MEMBERS;
use treeline_shaders::undergrowth::{
    BINS, BLOCK_SEEDS, Plant, UndergrowthBlock, UndergrowthDraws, UndergrowthFrame, themes,
};
use treeline_shaders::{Pass, source};

/// Plants of a frame at most, bytes: what finds no room is not drawn.
const MOST_PLANT_BYTES: u64 = 16 << 20;

/// The pass with its buffers.
#[derive(Debug)]
pub struct SelectUndergrowth {
    /// What it was compiled for.
    pub variant: SelectVariant,
    layout: wgpu::BindGroupLayout,
    draws_group: wgpu::BindGroup,
    decide: wgpu::ComputePipeline,
    scan: wgpu::ComputePipeline,
    scatter: wgpu::ComputePipeline,
    frame: wgpu::Buffer,
    themes: wgpu::Buffer,
    blocks: wgpu::Buffer,
    chosen: wgpu::Buffer,
    counts: wgpu::Buffer,
    plants: wgpu::Buffer,
    draws: wgpu::Buffer,
    group: Option<(u64, wgpu::BindGroup)>,
    /// Counts replaced buffers.
    pub generation: u64,
}

fn buffer(device: &wgpu::Device, label: &str, bytes: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn layout(device: &wgpu::Device, label: &str, kinds: &[wgpu::BufferBindingType]) -> wgpu::BindGroupLayout {
    let entry = |(binding, &ty)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let entries: Vec<_> = (0..).zip(kinds).map(entry).collect();
    device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

fn group(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}

impl SelectUndergrowth {
    /// Compiles the pass.
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        frame_layout: &wgpu::BindGroupLayout,
        variant: SelectVariant,
        models: &PlantModels,
    ) -> Self {
        use wgpu::{BufferBindingType as Kind, BufferUsages as Usage};
        let (read, write) = (Kind::Storage { read_only: true }, Kind::Storage { read_only: false });
        let own = [Kind::Uniform, Kind::Uniform, read, write, write, write];
        let own = layout(device, "select_undergrowth", &own);
        let draws_layout = layout(device, "undergrowth draws", &[write]);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("select_undergrowth"),
            source: wgpu::ShaderSource::Wgsl(source(Pass::SelectUndergrowth).into()),
        });
        let constants = [
            flag("WITH_PHOTO", variant.photo),
            flag("WITH_SHADOWS", variant.shadows),
            flag("WITH_SEASON", variant.season),
            flag("WITH_CLOUDS", variant.clouds),
        ];
        let pipeline = |name: &str, groups: &[Option<&wgpu::BindGroupLayout>], constants: &[(&str, f64)]| {
            let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(name),
                bind_group_layouts: groups,
                immediate_size: 0,
            });
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(name),
                compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
                cache: None,
            })
        };
        let groups = [Some(frame_layout), Some(&own)];
        let draws = buffer(
            device,
            "undergrowth draws",
            size_of::<UndergrowthDraws>() as u64,
            Usage::STORAGE | Usage::INDIRECT | Usage::COPY_SRC,
        );
        queue.write_buffer(&draws, 0, bytemuck::bytes_of(models.arguments()));
        let table = themes();
        let themes = buffer(device, "undergrowth themes", size_of_val(&table) as u64, Usage::UNIFORM);
        queue.write_buffer(&themes, 0, bytemuck::cast_slice(&table));
        Self {
            variant,
            draws_group: group(device, "undergrowth draws", &draws_layout, &[&draws]),
            decide: pipeline("decide_plants", &groups, &constants[2..3]),
            scan: pipeline("scan_plants", &[Some(frame_layout), Some(&own), Some(&draws_layout)], &[]),
            scatter: pipeline("scatter_plants", &groups, &constants),
            layout: own,
            frame: buffer(device, "undergrowth frame", size_of::<UndergrowthFrame>() as u64, Usage::UNIFORM),
            themes,
            blocks: buffer(device, "undergrowth blocks", 1 << 10, Usage::STORAGE),
            chosen: buffer(device, "undergrowth chosen", 16 << 10, Usage::STORAGE),
            counts: buffer(device, "undergrowth counts", 1 << 10, Usage::STORAGE | Usage::COPY_SRC),
            plants: buffer(device, "plants", 256 << 10, Usage::STORAGE | Usage::COPY_SRC),
            draws,
            group: None,
            generation: 0,
        }
    }

    /// Arguments of the draws, one a bin, and a last one that counts metaseeds; and the light.
    pub fn draws(&self) -> &wgpu::Buffer {
        &self.draws
    }

    /// The plants, bin after bin.
    pub fn plants(&self) -> &wgpu::Buffer {
        &self.plants
    }

    /// Where bins begin: the word at bin × blocks.
    pub fn counts(&self) -> &wgpu::Buffer {
        &self.counts
    }

    /// What the pass was told of the frame.
    pub fn frame(&self) -> &wgpu::Buffer {
        &self.frame
    }

    /// GPU memory, bytes.
    pub fn bytes(&self) -> u64 {
        let buffers = [&self.frame, &self.themes, &self.blocks, &self.chosen, &self.counts, &self.plants];
        buffers.into_iter().chain([&self.draws]).map(wgpu::Buffer::size).sum()
    }

    fn make_room(&mut self, device: &wgpu::Device, blocks: u64) {
        let seeds = blocks * u64::from(BLOCK_SEEDS);
        let plants = seeds * u64::from(MOST_MEMBERS) * size_of::<Plant>() as u64;
        let sizes = [
            blocks * size_of::<UndergrowthBlock>() as u64,
            8 * seeds,
            4 * u64::from(BINS + 1) * blocks,
            // Clusters are not all full, blocks not all in the picture, and far ones thin.
            (plants / 2).min(MOST_PLANT_BYTES),
        ];
        let buffers = [&mut self.blocks, &mut self.chosen, &mut self.counts, &mut self.plants];
        let labels = ["undergrowth blocks", "undergrowth chosen", "undergrowth counts", "plants"];
        for ((old, size), label) in buffers.into_iter().zip(sizes).zip(labels) {
            let size = size.next_power_of_two();
            if size > old.size() {
                *old = buffer(device, label, size, old.usage());
                self.generation += 1;
            }
        }
    }

    /// Records the pass. `frame` is bind group 0. `canopy_gone`: up to which distance the canopy gives way to trees.
    #[allow(clippy::too_many_arguments, reason = "what a pass is given")]
    pub fn record(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::BindGroup,
        seen: &UndergrowthBlocks,
        canopy_gone: f32,
        timestamps: Option<wgpu::ComputePassTimestampWrites<'_>>,
    ) {
        self.make_room(device, seen.blocks.len() as u64);
        let of_frame = UndergrowthFrame { canopy_gone, ..seen.frame };
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&of_frame));
        queue.write_buffer(&self.blocks, 0, bytemuck::cast_slice(&seen.blocks));
        if self.group.as_ref().is_none_or(|(made_for, _)| *made_for != self.generation) {
            let buffers = [&self.frame, &self.themes, &self.blocks, &self.chosen, &self.counts, &self.plants];
            self.group = Some((self.generation, group(device, "select_undergrowth", &self.layout, &buffers)));
        }
        let Some((_, group)) = &self.group else { return };
        let blocks = seen.blocks.len() as u32;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("select_undergrowth"),
            timestamp_writes: timestamps,
        });
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, group, &[]);
        pass.set_pipeline(&self.decide);
        pass.dispatch_workgroups(blocks, 1, 1);
        pass.set_bind_group(2, &self.draws_group, &[]);
        pass.set_pipeline(&self.scan);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(&self.scatter);
        pass.dispatch_workgroups(blocks, 1, 1);
    }
}
