//! Models of a scene's species on the GPU: the corners of all levels in one buffer, atlases in one texture array.

use treeline_core::tree_model::{Atlas, TreeSpecies};
use treeline_shaders::trees::{LEVELS, TreeDraw};

/// The models of all species of a scene.
#[derive(Debug)]
pub struct TreeModels {
    corners: wgpu::Buffer,
    draws: wgpu::Buffer,
    atlas: wgpu::TextureView,
    bytes: u64,
    vertex_counts: Vec<u32>,
}

impl TreeModels {
    /// Bytes from one draw's [`TreeDraw`] to the next: what every adapter can offset a uniform by.
    pub const DRAW_STRIDE: u32 = 256;

    /// Uploads the models that have come, in the order of the species' table; `None` where there is none, or the
    /// atlases differ in size.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, table: &[Option<&TreeSpecies>]) -> Option<Self> {
        let species: Vec<&TreeSpecies> = table.iter().flatten().copied().collect();
        let first = *species.first()?;
        let mips = first.atlas.mips.len() as u32;
        if species.iter().any(|model| model.atlas.side != first.atlas.side || model.levels.is_empty()) {
            return None;
        }
        let mut words: Vec<u32> = Vec::new();
        let mut draws = vec![0_u8; table.len() * (LEVELS * Self::DRAW_STRIDE) as usize];
        let mut vertex_counts = Vec::new();
        let mut next_layer = 0;
        for model in table {
            let Some(model) = model else {
                // Nothing of it is drawn.
                vertex_counts.extend([0; LEVELS as usize]);
                continue;
            };
            let layer = next_layer;
            next_layer += 1;
            let [red, green, blue] = mean_foliage(&model.atlas);
            for level in 0..LEVELS as usize {
                // A model with fewer levels repeats its last.
                let shown = &model.levels[level.min(model.levels.len() - 1)];
                let quads = shown.quads() as u32;
                let bin = vertex_counts.len();
                let draw = TreeDraw {
                    model: [bin as u32, words.len() as u32 / 4, quads, shown.variants.len().max(1) as u32],
                    foliage: [red, green, blue, layer as f32],
                };
                let place = bin * Self::DRAW_STRIDE as usize;
                draws[place..place + size_of::<TreeDraw>()].copy_from_slice(bytemuck::bytes_of(&draw));
                words.extend(shown.words());
                vertex_counts.push(6 * quads);
            }
        }
        // A buffer of no bytes cannot be bound.
        words.resize(words.len().max(4), 0);
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
        let size = wgpu::Extent3d {
            width: first.atlas.side,
            height: first.atlas.side,
            depth_or_array_layers: species.len() as u32,
        };
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("tree atlases"),
            size,
            mip_level_count: mips,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8UnormSrgb,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        for (layer, model) in (0..).zip(&species) {
            for (mip, texels) in (0..).zip(&model.atlas.mips) {
                write_mip(queue, &texture, layer, mip, model.atlas.side >> mip, texels);
            }
        }
        let atlas_bytes: usize = species.iter().flat_map(|model| &model.atlas.mips).map(Vec::len).sum();
        Some(Self {
            bytes: 4 * words.len() as u64 + draws.len() as u64 + atlas_bytes as u64,
            corners: buffer("tree corners", bytemuck::cast_slice(&words), wgpu::BufferUsages::STORAGE),
            draws: buffer("tree models", &draws, wgpu::BufferUsages::UNIFORM),
            atlas: texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..Default::default()
            }),
            vertex_counts,
        })
    }

    /// Vertices of each bin's model.
    pub fn vertex_counts(&self) -> &[u32] {
        &self.vertex_counts
    }

    /// Bins that have anything to draw.
    pub fn drawn_bins(&self) -> impl Iterator<Item = u32> + '_ {
        (0..).zip(&self.vertex_counts).filter(|(_, count)| **count > 0).map(|(bin, _)| bin)
    }

    /// Corners of all models, four words each.
    pub fn corners(&self) -> &wgpu::Buffer {
        &self.corners
    }

    /// A [`TreeDraw`] a bin, [`Self::DRAW_STRIDE`] apart.
    pub fn draws(&self) -> &wgpu::Buffer {
        &self.draws
    }

    /// Atlases, a layer a species.
    pub fn atlas(&self) -> &wgpu::TextureView {
        &self.atlas
    }

    /// GPU memory, bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

fn write_mip(queue: &wgpu::Queue, texture: &wgpu::Texture, layer: u32, mip: u32, side: u32, texels: &[u8]) {
    queue.write_texture(
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: mip,
            origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
            aspect: wgpu::TextureAspect::All,
        },
        texels,
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * side), rows_per_image: None },
        wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 },
    );
}

/// Mean reflectance (linear) of an atlas where it has coverage.
fn mean_foliage(atlas: &Atlas) -> [f32; 3] {
    let texels = atlas.mips.get(2).or(atlas.mips.last()).map_or(&[][..], Vec::as_slice);
    let mut sum = [0.0_f64; 3];
    let mut weight = 0.0;
    for texel in texels.as_chunks::<4>().0.iter().filter(|texel| texel[3] >= Atlas::ALPHA_TEST) {
        for (sum, &channel) in sum.iter_mut().zip(texel) {
            *sum += (f64::from(channel) / 255.0).powf(2.2);
        }
        weight += 1.0;
    }
    sum.map(|sum| (sum / f64::max(weight, 1.0)) as f32)
}
