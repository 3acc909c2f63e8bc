//! A frame: the order of its passes, in one screenful.

use crate::gpu::GpuContext;
use crate::gpu::frame_buffers::FrameBuffers;
use crate::gpu::read_back_belt::Belt;
use crate::gpu::targets::Targets;
use crate::gpu::tile_arrays::TileArrays;
use crate::passes::load_map::LoadMap;
use crate::passes::maximum_mip::MaximumMip;
use crate::passes::shade::{Shade, ShadeVariant, hits_layout};
use crate::passes::terrain::Terrain;
use crate::passes::timing::PassTimer;
use crate::stream::page_table::Tables;
use crate::survey::Ticket;
use treeline_shaders::layout::View;

/// The passes of a frame, in order; timed under these names.
pub const PASSES: &[&str] = &["terrain", "shade", "distance_pyramid", "load_map"];

/// Maps on their way back at most.
const MAPS_IN_FLIGHT: usize = 3;

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
    minimum_mip: Option<MaximumMip>,
    terrain: Option<Terrain>,
    shade: Option<Shade>,
    timer: Option<PassTimer>,
    load_map: Option<LoadMap>,
    belt: Option<Belt<Ticket>>,
    /// The words of the map being taken in.
    words: Vec<u32>,
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
            minimum_mip: None,
            terrain: None,
            shade: None,
            timer: gpu.has_timestamps().then(|| PassTimer::new(device, &gpu.queue, PASSES)),
            load_map: None,
            belt: None,
            words: Vec::new(),
            count_fetches,
        }
    }

    /// Derives the pyramids of elevation tiles just uploaded.
    pub fn derive_maxima(&mut self, gpu: &GpuContext, arrays: &TileArrays, slots: &[u32]) {
        if slots.is_empty() {
            return;
        }
        let maxima = self.maximum_mip.get_or_insert_with(|| MaximumMip::new(&gpu.device));
        let minima = arrays.minima.as_ref().map(|minima| {
            (self.minimum_mip.get_or_insert_with(|| MaximumMip::of_minima(&gpu.device)), minima)
        });
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for &slot in slots {
            maxima.record(&gpu.device, &mut encoder, &arrays.heights, &arrays.maxima, slot);
            if let Some((pass, minima)) = &minima {
                pass.record(&gpu.device, &mut encoder, &arrays.heights, minima, slot);
            }
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Draws a frame: terrain, shade, and, with a ticket, the load map of what the terrain pass saw.
    /// Answers whether the map asked for was made: it is not while too many are on their way back.
    pub fn draw(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        target: &FrameTarget<'_>,
        ticket: Option<Ticket>,
    ) -> bool {
        self.render(gpu, arrays, view, tables, Some(target), ticket)
    }

    /// Makes a load map without a picture.
    pub fn survey(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        ticket: Ticket,
    ) -> bool {
        self.render(gpu, arrays, view, tables, None, Some(ticket))
    }

    fn render(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        target: Option<&FrameTarget<'_>>,
        ticket: Option<Ticket>,
    ) -> bool {
        self.buffers.write(&gpu.device, &gpu.queue, view, tables);
        self.prepare(gpu, arrays, view, tables, target.map(|target| target.format), ticket.is_some());
        let (Some(targets), Some(groups), Some(terrain)) = (&self.targets, &self.groups, &self.terrain)
        else {
            return false;
        };
        if let Some(timer) = &mut self.timer {
            timer.begin();
        }
        let timer = self.timer.as_ref();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        terrain.record(&mut encoder, &groups.frame, targets, timer.and_then(|timer| timer.writes(0)));
        if let (Some(target), Some(shade)) = (target, &self.shade) {
            let timestamps = timer.and_then(|timer| timer.writes(1));
            shade.record(&mut encoder, &groups.frame, &groups.hits, target.view, timestamps);
        }
        let mut made = true;
        if let (Some(ticket), Some(map), Some(belt)) = (ticket, &mut self.load_map, &mut self.belt) {
            made = belt.in_flight() < MAPS_IN_FLIGHT;
            if made {
                let times = [2, 3].map(|pass| timer.and_then(|timer| timer.compute_writes(pass)));
                let (device, queue, stack) = (&gpu.device, &gpu.queue, &ticket.stack.frame);
                map.record(device, queue, &mut encoder, &groups.frame, targets, stack, times);
                made = belt.schedule(&mut encoder, &[map.cells(), map.pixels()], ticket);
            }
        }
        if let Some(timer) = timer {
            timer.resolve(&mut encoder);
        }
        gpu.queue.submit([encoder.finish()]);
        if let Some(timer) = &mut self.timer {
            timer.submitted();
        }
        if let Some(belt) = &mut self.belt {
            belt.submitted();
        }
        made
    }

    /// Hands out the newest map that has come back, with its cells and pixels. Never waits.
    pub fn poll_map(&mut self, gpu: &GpuContext, take: impl FnOnce(Ticket, &[u32], &[u32])) {
        let (Some(belt), words) = (&mut self.belt, &mut self.words) else { return };
        belt.poll(&gpu.device, |ticket, bytes| {
            words.clear();
            words.extend(bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)));
            let (cells, pixels) = words.split_at(words.len() / 2);
            take(ticket, cells, pixels);
        });
    }

    /// Whether a map is on its way back, or waits to be taken in.
    pub fn has_map(&self) -> bool {
        self.belt.as_ref().is_some_and(|belt| belt.in_flight() > 0)
    }

    /// Makes whatever the frame needs and is not there yet.
    fn prepare(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        format: Option<wgpu::TextureFormat>,
        with_map: bool,
    ) {
        let device = &gpu.device;
        if self.targets.as_ref().is_none_or(|targets| targets.size() != view.size) {
            self.targets = Some(Targets::new(device, view.size[0], view.size[1]));
        }
        if self.terrain.is_none() {
            self.terrain = Some(Terrain::new(device, &self.frame_layout, self.count_fetches));
        }
        if let Some(format) = format {
            let variant = ShadeVariant {
                format,
                photo: !tables.pages.is_empty(),
                surface: arrays.surface.side() > 1,
                shadows: view.shadow_steps > 0,
            };
            if self.shade.as_ref().is_none_or(|shade| shade.variant != variant) {
                self.shade = Some(Shade::new(device, &self.frame_layout, &self.hits_layout, variant));
            }
        }
        if with_map && self.load_map.is_none() {
            let map = LoadMap::new(device, &self.frame_layout);
            self.belt = Some(Belt::new(device, map.cells().size() + map.pixels().size(), MAPS_IN_FLIGHT));
            self.load_map = Some(map);
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
            texture(arrays.minima.as_ref().map_or(&self.no_minima, |minima| minima.view())),
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
            ("distance_pyramid", self.load_map.is_some()),
            ("load_map", self.load_map.is_some()),
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
