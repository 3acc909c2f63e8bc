//! Models of the undergrowth on the GPU: corners and indices of all kinds, each in one buffer.

use treeline_core::plant_model::{VARIANTS, model};
use treeline_core::seeds::metaseed::Kind;
use treeline_shaders::undergrowth::{BINS, FAR_GRASS, IndexedDraw, PlantDraw, UndergrowthDraws};

/// The models of all kinds.
#[derive(Debug)]
pub struct PlantModels {
    corners: wgpu::Buffer,
    indices: wgpu::Buffer,
    draws: wgpu::Buffer,
    arguments: UndergrowthDraws,
}

impl PlantModels {
    /// Bytes from one draw's [`PlantDraw`] to the next: what every adapter can offset a uniform by.
    pub const DRAW_STRIDE: u32 = 256;

    /// Grows and uploads them.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        let mut words: Vec<[u32; 4]> = Vec::new();
        let mut indices: Vec<u32> = Vec::new();
        let mut draws = vec![0_u8; (BINS * Self::DRAW_STRIDE) as usize];
        let mut arguments = UndergrowthDraws::default();
        for kind in Kind::ALL {
            let model = model(kind);
            let mut bin = |bin: u32, index_count: usize| {
                let draw = PlantDraw { model: [bin, words.len() as u32, model.variant_corners, VARIANTS] };
                let place = (bin * Self::DRAW_STRIDE) as usize;
                draws[place..place + size_of::<PlantDraw>()].copy_from_slice(bytemuck::bytes_of(&draw));
                arguments.draws[bin as usize] = IndexedDraw {
                    index_count: index_count as u32,
                    first_index: indices.len() as u32,
                    ..IndexedDraw::default()
                };
            };
            bin(kind as u32, model.indices.len());
            if kind == Kind::Grass {
                bin(FAR_GRASS, model.far_indices as usize);
            }
            words.extend(model.corners.iter().map(|corner| corner.words()));
            indices.extend(&model.indices);
        }
        let buffer = |label, contents: &[u8], usage| {
            let buffer = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: contents.len() as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            queue.write_buffer(&buffer, 0, contents);
            buffer
        };
        Self {
            corners: buffer("plant corners", bytemuck::cast_slice(&words), wgpu::BufferUsages::STORAGE),
            indices: buffer("plant indices", bytemuck::cast_slice(&indices), wgpu::BufferUsages::INDEX),
            draws: buffer("plant models", &draws, wgpu::BufferUsages::UNIFORM),
            arguments,
        }
    }

    /// Corners of all models, four words each.
    pub fn corners(&self) -> &wgpu::Buffer {
        &self.corners
    }

    /// Their triangles: 32-bit indices.
    pub fn indices(&self) -> &wgpu::Buffer {
        &self.indices
    }

    /// A [`PlantDraw`] a bin, [`Self::DRAW_STRIDE`] apart.
    pub fn draws(&self) -> &wgpu::Buffer {
        &self.draws
    }

    /// Arguments of the draws without their instances.
    pub fn arguments(&self) -> &UndergrowthDraws {
        &self.arguments
    }

    /// GPU memory, bytes.
    pub fn bytes(&self) -> u64 {
        self.corners.size() + self.indices.size() + self.draws.size()
    }
}
