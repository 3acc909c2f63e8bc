//! The trees pass: one indirect draw a species and level, over the depth that the shade pass wrote.

use super::flag;
use super::select_trees::SelectTrees;
use crate::gpu::tree_models::TreeModels;
use treeline_shaders::trees::TreeDraw;
use treeline_shaders::{Pass, source};

/// Depths: `NEAR_METRES` of `trees.wgsl` over the distance along the view axis, 0 for the sky.
pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Hosts without a page may read the depths back; nothing else needs them any more.
pub(super) const KEEPS_DEPTHS: wgpu::StoreOp =
    if cfg!(target_arch = "wasm32") { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };

/// What the pipeline is specialised for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreesVariant {
    /// Format of the picture.
    pub format: wgpu::TextureFormat,
    /// The day differs from high summer.
    pub season: bool,
    /// The wind blows.
    pub wind: bool,
}

/// The pass.
#[derive(Debug)]
pub struct Trees {
    /// What it was compiled for.
    pub variant: TreesVariant,
    layout: wgpu::BindGroupLayout,
    draw_layout: wgpu::BindGroupLayout,
    pipeline: wgpu::RenderPipeline,
    sampler: wgpu::Sampler,
    groups: Option<Groups>,
}

#[derive(Debug)]
struct Groups {
    /// Generation of the selection's buffers.
    made_for: u64,
    trees: wgpu::BindGroup,
    draw: wgpu::BindGroup,
}

fn layouts(device: &wgpu::Device) -> [wgpu::BindGroupLayout; 2] {
    use wgpu::{BufferBindingType as Kind, ShaderStages as Stages};
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let storage = buffer(Kind::Storage { read_only: true });
    let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let atlas = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: true },
        view_dimension: wgpu::TextureViewDimension::D2Array,
        multisampled: false,
    };
    let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
    let trees = [
        entry(0, Stages::VERTEX, buffer(Kind::Uniform)),
        entry(1, Stages::VERTEX, storage),
        entry(2, Stages::VERTEX_FRAGMENT, storage),
        entry(3, Stages::VERTEX, storage),
        entry(4, Stages::FRAGMENT, atlas),
        entry(5, Stages::FRAGMENT, sampler),
    ];
    let uniform =
        wgpu::BindingType::Buffer { ty: Kind::Uniform, has_dynamic_offset: true, min_binding_size: None };
    let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
    };
    [layout("trees", &trees), layout("tree draw", &[entry(0, Stages::VERTEX_FRAGMENT, uniform)])]
}

impl Trees {
    /// Compiles the pass. `view_layout` is group 0: the view alone.
    pub fn new(device: &wgpu::Device, view_layout: &wgpu::BindGroupLayout, variant: TreesVariant) -> Self {
        let format = variant.format;
        let [layout, draw_layout] = layouts(device);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("trees"),
            source: wgpu::ShaderSource::Wgsl(source(Pass::Trees).into()),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("trees"),
            bind_group_layouts: &[Some(view_layout), Some(&layout), Some(&draw_layout)],
            immediate_size: 0,
        });
        let constants = [
            flag("ENCODE_SRGB", !format.is_srgb()),
            flag("WITH_SEASON", variant.season),
            flag("WITH_WIND", variant.wind),
        ];
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("trees"),
            layout: Some(&pipeline_layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("tree_vertex"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &constants,
                    ..Default::default()
                },
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
                entry_point: Some("tree_fragment"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &constants,
                    ..Default::default()
                },
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("tree atlas"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        });
        Self { variant, layout, draw_layout, pipeline, sampler, groups: None }
    }

    /// Records the pass over a picture and its depths, and answers how many draws it takes. `view` is bind group 0.
    #[allow(clippy::too_many_arguments, reason = "what a pass is given")]
    pub fn record(
        &mut self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        view: &wgpu::BindGroup,
        selected: &SelectTrees,
        models: &TreeModels,
        picture: &wgpu::TextureView,
        depth: &wgpu::TextureView,
        timestamps: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) -> u32 {
        let made_for = selected.generation;
        if self.groups.as_ref().is_none_or(|groups| groups.made_for != made_for) {
            self.groups = Some(self.bind(device, selected, models, made_for));
        }
        let Some(groups) = &self.groups else { return 0 };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("trees"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: picture,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: KEEPS_DEPTHS }),
                stencil_ops: None,
            }),
            timestamp_writes: timestamps,
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, view, &[]);
        pass.set_bind_group(1, &groups.trees, &[]);
        let mut draws = 0;
        for bin in models.drawn_bins() {
            pass.set_bind_group(2, &groups.draw, &[bin * TreeModels::DRAW_STRIDE]);
            pass.draw_indirect(selected.draws(), u64::from(bin) * 16);
            draws += 1;
        }
        draws
    }

    fn bind(
        &self,
        device: &wgpu::Device,
        selected: &SelectTrees,
        models: &TreeModels,
        made_for: u64,
    ) -> Groups {
        let resources = [
            selected.frame().as_entire_binding(),
            selected.counts().as_entire_binding(),
            selected.instances().as_entire_binding(),
            models.corners().as_entire_binding(),
            wgpu::BindingResource::TextureView(models.atlas()),
            wgpu::BindingResource::Sampler(&self.sampler),
        ];
        let entries: Vec<_> = (0..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let trees = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("trees"),
            layout: &self.layout,
            entries: &entries,
        });
        let one = wgpu::BufferSize::new(size_of::<TreeDraw>() as u64);
        let draw = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: models.draws(),
            offset: 0,
            size: one,
        });
        let draw = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("tree draw"),
            layout: &self.draw_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: draw }],
        });
        Groups { made_for, trees, draw }
    }
}
