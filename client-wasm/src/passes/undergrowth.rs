//! The undergrowth pass: one indexed indirect draw a kind (two of grass), over the depths of ground and trees.

use super::flag;
use super::select_undergrowth::SelectUndergrowth;
use super::trees::{DEPTH_FORMAT, KEEPS_DEPTHS, TreesVariant};
use crate::gpu::plant_models::PlantModels;
use treeline_shaders::undergrowth::{BINS, IndexedDraw, PlantDraw};
use treeline_shaders::{Pass, source};

/// The pass.
#[derive(Debug)]
pub struct Undergrowth {
    /// What it was compiled for.
    pub variant: TreesVariant,
    layout: wgpu::BindGroupLayout,
    draw_layout: wgpu::BindGroupLayout,
    pipeline: wgpu::RenderPipeline,
    groups: Option<Groups>,
}

#[derive(Debug)]
struct Groups {
    /// Generation of the selection's buffers.
    made_for: u64,
    plants: wgpu::BindGroup,
    draw: wgpu::BindGroup,
}

fn layouts(device: &wgpu::Device) -> [wgpu::BindGroupLayout; 2] {
    use wgpu::{BufferBindingType as Kind, ShaderStages as Stages};
    let entry = |binding, visibility, ty, has_dynamic_offset| wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: None },
        count: None,
    };
    let storage = Kind::Storage { read_only: true };
    let plants = [
        entry(0, Stages::VERTEX, Kind::Uniform, false),
        entry(1, Stages::VERTEX, storage, false),
        entry(2, Stages::VERTEX, storage, false),
        entry(3, Stages::VERTEX, storage, false),
        entry(4, Stages::FRAGMENT, storage, false),
    ];
    let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
    };
    [layout("undergrowth", &plants), layout("plant draw", &[entry(0, Stages::VERTEX, Kind::Uniform, true)])]
}

impl Undergrowth {
    /// Compiles the pass. `view_layout` is group 0: the view alone.
    pub fn new(device: &wgpu::Device, view_layout: &wgpu::BindGroupLayout, variant: TreesVariant) -> Self {
        let format = variant.format;
        let [layout, draw_layout] = layouts(device);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("undergrowth"),
            source: wgpu::ShaderSource::Wgsl(source(Pass::Undergrowth).into()),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("undergrowth"),
            bind_group_layouts: &[Some(view_layout), Some(&layout), Some(&draw_layout)],
            immediate_size: 0,
        });
        let of_fragments = [flag("ENCODE_SRGB", !format.is_srgb()), flag("WITH_SEASON", variant.season)];
        let of_vertices = [flag("WITH_WIND", variant.wind)];
        let options = |constants| wgpu::PipelineCompilationOptions { constants, ..Default::default() };
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("undergrowth"),
            layout: Some(&pipeline_layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("plant_vertex"),
                compilation_options: options(&of_vertices),
                buffers: &[],
            },
            // Leaves are seen from both sides.
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("plant_fragment"),
                compilation_options: options(&of_fragments),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { variant, layout, draw_layout, pipeline, groups: None }
    }

    /// Records the pass over a picture and its depths. `view` is bind group 0. `keep`: the depths are wanted after it.
    #[allow(clippy::too_many_arguments, reason = "what a pass is given")]
    pub fn record(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        view: &wgpu::BindGroup,
        selected: &SelectUndergrowth,
        models: &PlantModels,
        picture: &wgpu::TextureView,
        depth: &wgpu::TextureView,
        keep: bool,
        timestamps: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) {
        if self.groups.as_ref().is_none_or(|groups| groups.made_for != selected.generation) {
            self.groups = Some(self.bind(device, selected, models));
        }
        let Some(groups) = &self.groups else { return };
        let store = if keep { wgpu::StoreOp::Store } else { KEEPS_DEPTHS };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("undergrowth"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: picture,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Load, store }),
                stencil_ops: None,
            }),
            timestamp_writes: timestamps,
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_index_buffer(models.indices().slice(..), wgpu::IndexFormat::Uint32);
        pass.set_bind_group(0, view, &[]);
        pass.set_bind_group(1, &groups.plants, &[]);
        for bin in 0..BINS {
            pass.set_bind_group(2, &groups.draw, &[bin * PlantModels::DRAW_STRIDE]);
            pass.draw_indexed_indirect(selected.draws(), u64::from(bin) * size_of::<IndexedDraw>() as u64);
        }
    }

    fn bind(&self, device: &wgpu::Device, selected: &SelectUndergrowth, models: &PlantModels) -> Groups {
        let buffers =
            [selected.frame(), selected.counts(), selected.plants(), models.corners(), selected.draws()];
        let entries: Vec<_> = (0..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let plants = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("undergrowth"),
            layout: &self.layout,
            entries: &entries,
        });
        let draw = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: models.draws(),
            offset: 0,
            size: wgpu::BufferSize::new(size_of::<PlantDraw>() as u64),
        });
        let draw = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("plant draw"),
            layout: &self.draw_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: draw }],
        });
        Groups { made_for: selected.generation, plants, draw }
    }
}
