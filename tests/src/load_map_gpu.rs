//! The Tile Load Map of a scene by the client's own passes, on the software adapter.

use crate::gpu::software_gpu;
use crate::load_map::Scene;
use crate::terrain_gpu::{array, read_back};
use crate::tile_world::SIDE;
use std::time::Instant;
use treeline_client::gpu::read_back_belt::Belt;
use treeline_client::gpu::targets::Targets;
use treeline_client::passes::frame_layout;
use treeline_client::passes::load_map::LoadMap;
use treeline_client::passes::terrain::Terrain;
use treeline_core::seeds::season;
use treeline_shaders::layout::{EMPTY, TexturePage};
use treeline_shaders::load_map::CELLS;

/// What the passes answer, and what they saw.
pub struct Answer {
    /// Metres, −1 for a miss.
    pub distances: Vec<f32>,
    /// The terrain pass's other words.
    pub hits: Vec<[u32; 4]>,
    /// A word a cell.
    pub cells: Vec<u32>,
    /// Pixels of a cell.
    pub pixels: Vec<u32>,
    /// Seconds of the pass and its read-back, after the rays; pipelines were there before.
    pub seconds: f64,
}

impl Scene<'_> {
    /// By the passes, on the software adapter.
    pub fn by_gpu(&self) -> Answer {
        let (device, queue) = software_gpu();
        let [width, height] = self.frame.view.size;
        let layout = frame_layout(device);
        let group = self.frame_group(&layout);
        let targets = Targets::new(device, width, height);
        let mut map = LoadMap::new(device, &layout);
        let mut belt = Belt::new(device, 8 * u64::from(CELLS), 1);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        Terrain::new(device, &layout, false, false).record(&mut encoder, &group, &targets, None);
        queue.submit([encoder.finish()]);
        device.poll(wgpu::PollType::wait_indefinitely()).expect("the rays are cast");
        let start = Instant::now();
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        map.record(device, queue, &mut encoder, &group, &targets, &self.stack.frame, [None, None]);
        assert!(belt.schedule(&mut encoder, &[map.cells(), map.pixels()], ()), "the belt is free");
        queue.submit([encoder.finish()]);
        belt.submitted();
        let (cells, pixels) = loop {
            if let Some(words) = belt.poll(device, |(), bytes| bytemuck::pod_collect_to_vec::<u8, u32>(bytes))
            {
                let (cells, pixels) = words.split_at(CELLS as usize);
                break (cells.to_vec(), pixels.to_vec());
            }
            std::thread::yield_now();
        };
        let seconds = start.elapsed().as_secs_f64();
        let distances = read_back(&targets.distance, 4).into_iter().map(f32::from_bits).collect();
        let hits = read_back(&targets.hit, 16).chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]).collect();
        Answer { distances, hits, cells, pixels, seconds }
    }

    fn frame_group(&self, layout: &wgpu::BindGroupLayout) -> wgpu::BindGroup {
        let (device, queue) = software_gpu();
        let tiles = &self.world.tiles;
        let heights = array(&[SIDE], tiles.len(), |layer, _| &tiles[layer].heights);
        let sides: Vec<u32> = tiles[0].maxima.mips.iter().map(|mip| mip.0).collect();
        let maxima = array(&sides, tiles.len(), |layer, mip| &tiles[layer].maxima.mips[mip].2);
        let minima = array(&sides, tiles.len(), |layer, mip| &tiles[layer].minima.mips[mip].2);
        let buffer = |bytes: &[u8], usage| {
            let buffer = device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: bytes.len() as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let texel = |format| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..Default::default()
            })
        };
        let surface = texel(wgpu::TextureFormat::Rg8Uint);
        let photo = texel(wgpu::TextureFormat::Rgba8UnormSrgb);
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let view = buffer(bytemuck::bytes_of(&self.frame.view), wgpu::BufferUsages::UNIFORM);
        let nodes = buffer(bytemuck::cast_slice(&self.world.nodes), wgpu::BufferUsages::STORAGE);
        let leaves = buffer(bytemuck::cast_slice(&self.frame.leaves), wgpu::BufferUsages::STORAGE);
        let page = TexturePage { slot: EMPTY, children: EMPTY, ..TexturePage::default() };
        let pages = buffer(bytemuck::bytes_of(&page), wgpu::BufferUsages::STORAGE);
        // No pass of these looks at it.
        let seasons = buffer(&[0; 64 * season::ROWS], wgpu::BufferUsages::UNIFORM);
        let texture = wgpu::BindingResource::TextureView;
        let resources = [
            view.as_entire_binding(),
            nodes.as_entire_binding(),
            leaves.as_entire_binding(),
            texture(&heights),
            texture(&maxima),
            texture(&surface),
            pages.as_entire_binding(),
            texture(&photo),
            wgpu::BindingResource::Sampler(&sampler),
            texture(&minima),
            seasons.as_entire_binding(),
        ];
        let entries: Vec<_> = resources
            .into_iter()
            .zip(0..)
            .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    }
}
