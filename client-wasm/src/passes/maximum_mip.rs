//! The pyramid of maxima of a tile, derived on the GPU when the tile is uploaded.

use super::flag;
use crate::gpu::tile_arrays::TileArray;
use treeline_shaders::{Pass, source};

/// Texels along a work group's side.
const GROUP: u32 = 8;

/// The pass.
#[derive(Debug)]
pub struct MaximumMip {
    layout: wgpu::BindGroupLayout,
    from_cells: wgpu::ComputePipeline,
    from_mip: wgpu::ComputePipeline,
}

impl MaximumMip {
    /// Compiles the pass that derives maxima.
    pub fn new(device: &wgpu::Device) -> Self {
        Self::deriving(device, false)
    }

    /// Compiles the pass that derives minima: record it with the minima in the place of the maxima.
    pub fn of_minima(device: &wgpu::Device) -> Self {
        Self::deriving(device, true)
    }

    fn deriving(device: &wgpu::Device, minimum: bool) -> Self {
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty,
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("maximum_mip"),
            entries: &[
                entry(
                    0,
                    wgpu::BindingType::Texture {
                        sample_type: wgpu::TextureSampleType::Float { filterable: false },
                        view_dimension: wgpu::TextureViewDimension::D2,
                        multisampled: false,
                    },
                ),
                entry(
                    1,
                    wgpu::BindingType::StorageTexture {
                        access: wgpu::StorageTextureAccess::WriteOnly,
                        format: wgpu::TextureFormat::R32Float,
                        view_dimension: wgpu::TextureViewDimension::D2,
                    },
                ),
            ],
        });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("maximum_mip"),
            source: wgpu::ShaderSource::Wgsl(source(Pass::MaximumMip).into()),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("maximum_mip"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = |entry: &str| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &[flag("MINIMUM", minimum)],
                    ..Default::default()
                },
                cache: None,
            })
        };
        Self { from_cells: pipeline("cells_to_mip"), from_mip: pipeline("mip_to_mip"), layout }
    }

    /// Records the derivation of a slot's pyramid.
    pub fn record(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        heights: &TileArray,
        maxima: &TileArray,
        slot: u32,
    ) {
        for mip in 0..maxima.mips() {
            let source = if mip == 0 { heights.layer_mip(slot, 0) } else { maxima.layer_mip(slot, mip - 1) };
            let target = maxima.layer_mip(slot, mip);
            let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("maximum_mip"),
                layout: &self.layout,
                entries: &[
                    wgpu::BindGroupEntry {
                        binding: 0,
                        resource: wgpu::BindingResource::TextureView(&source),
                    },
                    wgpu::BindGroupEntry {
                        binding: 1,
                        resource: wgpu::BindingResource::TextureView(&target),
                    },
                ],
            });
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("maximum_mip"),
                timestamp_writes: None,
            });
            pass.set_pipeline(if mip == 0 { &self.from_cells } else { &self.from_mip });
            pass.set_bind_group(0, &group, &[]);
            let groups = (maxima.side() >> mip).max(1).div_ceil(GROUP);
            pass.dispatch_workgroups(groups, groups, 1);
        }
    }
}
