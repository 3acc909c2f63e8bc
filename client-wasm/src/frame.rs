//! A frame: the order of its passes, in one screenful.

use crate::gpu::GpuContext;
use crate::gpu::frame_buffers::FrameBuffers;
use crate::gpu::targets::Targets;
use crate::gpu::tile_arrays::TileArrays;
use crate::passes::maximum_mip::MaximumMip;
use crate::passes::shade::{Shade, ShadeVariant, hits_layout};
use crate::passes::terrain::Terrain;
use crate::passes::timing::PassTimer;
use crate::stream::page_table::Tables;
use treeline_shaders::layout::View;

/// The passes of a frame, in order; timed under these names.
pub const PASSES: &[&str] = &["terrain", "shade"];

/// Where a picture is drawn.
#[derive(Clone, Copy, Debug)]
pub struct FrameTarget<'a> {
    /// The picture, of the size that the view asks for.
    pub view: &'a wgpu::TextureView,
    /// The view's format.
    pub format: wgpu::TextureFormat,
}

/// Everything that draws.
#[derive(Debug)]
pub struct FrameRenderer {
    frame_layout: wgpu::BindGroupLayout,
    hits_layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    no_minima: wgpu::TextureView,
    buffers: FrameBuffers,
    targets: Option<Targets>,
    groups: Option<Groups>,
    maximum_mip: Option<MaximumMip>,
    terrain: Option<Terrain>,
    shade: Option<Shade>,
    timer: Option<PassTimer>,
    count_fetches: bool,
}

/// Bind groups, and what they were made for.
#[derive(Debug)]
struct Groups {
    generation: (u64, u64, [u32; 2]),
    frame: wgpu::BindGroup,
    hits: wgpu::BindGroup,
}

impl FrameRenderer {
    /// Nothing is compiled yet. `count_fetches`: write texel fetches beside each hit.
    pub fn new(gpu: &GpuContext, count_fetches: bool) -> Self {
        let device = &gpu.device;
        let no_minima = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("no minima"),
            size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        Self {
            frame_layout: crate::passes::frame_layout(device),
            hits_layout: hits_layout(device),
            sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("photo"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
            no_minima: no_minima.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..Default::default()
            }),
            buffers: FrameBuffers::new(device),
            targets: None,
            groups: None,
            maximum_mip: None,
            terrain: None,
            shade: None,
            timer: gpu.has_timestamps().then(|| PassTimer::new(device, &gpu.queue, PASSES)),
            count_fetches,
        }
    }

    /// Derives the pyramids of elevation tiles just uploaded.
    pub fn derive_maxima(&mut self, gpu: &GpuContext, arrays: &TileArrays, slots: &[u32]) {
        if slots.is_empty() {
            return;
        }
        let pass = self.maximum_mip.get_or_insert_with(|| MaximumMip::new(&gpu.device));
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for &slot in slots {
            pass.record(&gpu.device, &mut encoder, &arrays.heights, &arrays.maxima, slot);
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Draws a frame: terrain, then shade.
    pub fn draw(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        target: &FrameTarget<'_>,
    ) {
        self.buffers.write(&gpu.device, &gpu.queue, view, tables);
        self.prepare(gpu, arrays, view, tables, target.format);
        let (Some(targets), Some(groups)) = (&self.targets, &self.groups) else { return };
        let (Some(terrain), Some(shade)) = (&self.terrain, &self.shade) else { return };
        if let Some(timer) = &mut self.timer {
            timer.begin();
        }
        let timer = self.timer.as_ref();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        terrain.record(&mut encoder, &groups.frame, targets, timer.and_then(|timer| timer.writes(0)));
        let timestamps = timer.and_then(|timer| timer.writes(1));
        shade.record(&mut encoder, &groups.frame, &groups.hits, target.view, timestamps);
        if let Some(timer) = timer {
            timer.resolve(&mut encoder);
        }
        gpu.queue.submit([encoder.finish()]);
        if let Some(timer) = &mut self.timer {
            timer.submitted();
        }
    }

    /// Makes whatever the frame needs and is not there yet.
    fn prepare(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        format: wgpu::TextureFormat,
    ) {
        let device = &gpu.device;
        if self.targets.as_ref().is_none_or(|targets| targets.size() != view.size) {
            self.targets = Some(Targets::new(device, view.size[0], view.size[1]));
        }
        if self.terrain.is_none() {
            self.terrain = Some(Terrain::new(device, &self.frame_layout, self.count_fetches));
        }
        let variant = ShadeVariant {
            format,
            photo: !tables.pages.is_empty(),
            surface: arrays.surface.side() > 1,
            shadows: view.shadow_steps > 0,
        };
        if self.shade.as_ref().is_none_or(|shade| shade.variant != variant) {
            self.shade = Some(Shade::new(device, &self.frame_layout, &self.hits_layout, variant));
        }
        let generation = (arrays.generation, self.buffers.generation, view.size);
        if self.groups.as_ref().is_none_or(|groups| groups.generation != generation)
            && let Some(targets) = &self.targets
        {
            let frame = self.frame_group(device, arrays);
            let hits = hits_group(device, &self.hits_layout, targets);
            self.groups = Some(Groups { generation, frame, hits });
        }
    }

    fn frame_group(&self, device: &wgpu::Device, arrays: &TileArrays) -> wgpu::BindGroup {
        let texture = wgpu::BindingResource::TextureView;
        let resources = [
            self.buffers.view.as_entire_binding(),
            self.buffers.nodes.as_entire_binding(),
            self.buffers.leaves.as_entire_binding(),
            texture(arrays.heights.view()),
            texture(arrays.maxima.view()),
            texture(arrays.surface.view()),
            self.buffers.pages.as_entire_binding(),
            texture(arrays.photo.view()),
            wgpu::BindingResource::Sampler(&self.sampler),
            texture(&self.no_minima),
        ];
        bind(device, "frame", &self.frame_layout, resources)
    }

    /// What the last frame's terrain pass wrote.
    pub fn targets(&self) -> Option<&Targets> {
        self.targets.as_ref()
    }

    /// Names of the pipelines that were compiled.
    pub fn pipelines(&self) -> Vec<&'static str> {
        let compiled = [
            ("maximum_mip", self.maximum_mip.is_some()),
            ("terrain", self.terrain.is_some()),
            ("shade", self.shade.is_some()),
        ];
        compiled.into_iter().filter_map(|(name, is)| is.then_some(name)).collect()
    }

    /// Median milliseconds by pass, where the adapter can time them.
    pub fn pass_milliseconds(&mut self) -> Vec<(&'static str, f64)> {
        self.timer.as_mut().map(PassTimer::medians).unwrap_or_default()
    }

    /// Forgets the times so far.
    pub fn clear_times(&mut self) {
        if let Some(timer) = &mut self.timer {
            timer.clear();
        }
    }
}

fn hits_group(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, targets: &Targets) -> wgpu::BindGroup {
    let views = [&targets.distance_view, &targets.hit_view];
    bind(device, "hits", layout, views.map(wgpu::BindingResource::TextureView))
}

fn bind<const N: usize>(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    resources: [wgpu::BindingResource<'_>; N],
) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry<'_>> = resources
        .into_iter()
        .enumerate()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: binding as u32, resource })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}
