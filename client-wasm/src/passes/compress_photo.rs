//! Photo tiles as compressed blocks, made on the GPU when a tile is uploaded.

use crate::stream::decode::TEXTURE_SIDE;
use serde::Serialize;
use treeline_shaders::{Pass, source};

/// Blocks along a work group's side.
const GROUP: u32 = 8;
/// Texels along a block's side.
const BLOCK_SIDE: u32 = 4;
/// Bytes of a block in either format.
const BLOCK_BYTES: u32 = 16;
/// Blocks along a tile's side.
const BLOCKS: u32 = TEXTURE_SIDE / BLOCK_SIDE;
const _: () = assert!(TEXTURE_SIDE.is_multiple_of(BLOCK_SIDE), "a tile is whole blocks");
/// Bytes from a row of blocks to the next one: what a copy to a texture asks for.
const ROW_BYTES: u32 = (BLOCKS * BLOCK_BYTES).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);

/// Whether photo tiles are compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PhotoCompression {
    /// Where the adapter has a format for it, unless it draws on the processor: there decoding costs more than
    /// it saves, and the memory is the same as any other.
    Automatic,
    /// Never: the default, for a strongly coloured photo is not at equal sight (docs/decisions/0012).
    #[default]
    Plain,
    /// Wherever the adapter has a format for it.
    Compressed,
}

/// How the GPU holds photo tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PhotoFormat {
    /// Four bytes a texel.
    #[default]
    Rgba8,
    /// One byte a texel: BC7, of desktop adapters.
    Bc7,
    /// One byte a texel: ASTC 4 × 4, of mobile adapters.
    Astc,
}

impl PhotoFormat {
    /// The features that formats need; a device is opened with those that its adapter has.
    pub const FEATURES: wgpu::Features =
        wgpu::Features::TEXTURE_COMPRESSION_BC.union(wgpu::Features::TEXTURE_COMPRESSION_ASTC);

    /// What a device with those features has for the wish; `on_processor`: it is no real GPU.
    pub fn choose(wish: PhotoCompression, features: wgpu::Features, on_processor: bool) -> Self {
        let compresses = match wish {
            PhotoCompression::Automatic => !on_processor,
            PhotoCompression::Plain => false,
            PhotoCompression::Compressed => true,
        };
        if !compresses {
            Self::Rgba8
        } else if features.contains(wgpu::Features::TEXTURE_COMPRESSION_BC) {
            Self::Bc7
        } else if features.contains(wgpu::Features::TEXTURE_COMPRESSION_ASTC) {
            Self::Astc
        } else {
            Self::Rgba8
        }
    }

    /// The texture array's format.
    pub fn texture_format(self) -> wgpu::TextureFormat {
        match self {
            Self::Rgba8 => wgpu::TextureFormat::Rgba8UnormSrgb,
            Self::Bc7 => wgpu::TextureFormat::Bc7RgbaUnormSrgb,
            Self::Astc => wgpu::TextureFormat::Astc {
                block: wgpu::AstcBlock::B4x4,
                channel: wgpu::AstcChannel::UnormSrgb,
            },
        }
    }

    /// Bytes of a tile on the GPU.
    pub fn tile_bytes(self) -> u64 {
        match self {
            Self::Rgba8 => 4 * u64::from(TEXTURE_SIDE).pow(2),
            Self::Bc7 | Self::Astc => u64::from(BLOCK_BYTES) * u64::from(BLOCKS).pow(2),
        }
    }

    fn pass(self) -> Option<Pass> {
        match self {
            Self::Rgba8 => None,
            Self::Bc7 => Some(Pass::CompressPhotoBc7),
            Self::Astc => Some(Pass::CompressPhotoAstc),
        }
    }
}

/// The pass, with the tile that it reads and the blocks that it writes: tiles go through one after the other.
#[derive(Debug)]
pub struct CompressPhoto {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    tile: wgpu::Texture,
    blocks: wgpu::Buffer,
}

impl CompressPhoto {
    /// Compiles the pass; `None` for a format that is not compressed.
    pub fn new(device: &wgpu::Device, format: PhotoFormat) -> Option<Self> {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("compress_photo"),
            source: wgpu::ShaderSource::Wgsl(source(format.pass()?).into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("compress_photo"),
            layout: None,
            module: &module,
            entry_point: Some("compress_photo"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &[("BLOCKS_IN_ROW", f64::from(ROW_BYTES / BLOCK_BYTES))],
                ..Default::default()
            },
            cache: None,
        });
        let tile = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("photo to compress"),
            size: wgpu::Extent3d { width: TEXTURE_SIDE, height: TEXTURE_SIDE, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            // Not sRGB: blocks hold the encoded values.
            format: wgpu::TextureFormat::Rgba8Unorm,
            // The browser copies decoded images by drawing them.
            usage: wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_DST
                | wgpu::TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        });
        let blocks = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("photo blocks"),
            size: u64::from(ROW_BYTES) * u64::from(BLOCKS),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let view = tile.create_view(&wgpu::TextureViewDescriptor::default());
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("compress_photo"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
                wgpu::BindGroupEntry { binding: 1, resource: blocks.as_entire_binding() },
            ],
        });
        Some(Self { pipeline, group, tile, blocks })
    }

    /// Where the tile to compress goes: sRGB values as they are.
    pub fn tile(&self) -> &wgpu::Texture {
        &self.tile
    }

    /// The blocks of the last tile, for statistics and tests, and the bytes from one row of them to the next.
    pub fn blocks(&self) -> (&wgpu::Buffer, u32) {
        (&self.blocks, ROW_BYTES)
    }

    /// Records the compression of [`Self::tile`] into [`Self::blocks`]; needs no feature of the device.
    pub fn record_blocks(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("compress_photo"),
            timestamp_writes: None,
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        let groups = BLOCKS.div_ceil(GROUP);
        pass.dispatch_workgroups(groups, groups, 1);
    }

    /// Records the compression of [`Self::tile`] into a layer of a texture array of the format.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, target: wgpu::TexelCopyTextureInfo<'_>) {
        self.record_blocks(encoder);
        encoder.copy_buffer_to_texture(
            wgpu::TexelCopyBufferInfo {
                buffer: &self.blocks,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(ROW_BYTES),
                    rows_per_image: Some(BLOCKS),
                },
            },
            target,
            wgpu::Extent3d { width: TEXTURE_SIDE, height: TEXTURE_SIDE, depth_or_array_layers: 1 },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::Features;

    #[test]
    fn the_adapter_and_the_wish_decide() {
        use PhotoCompression::{Automatic, Compressed, Plain};
        let (bc, astc) = (Features::TEXTURE_COMPRESSION_BC, Features::TEXTURE_COMPRESSION_ASTC);
        for (wish, features, on_processor, format) in [
            (Automatic, bc | astc, false, PhotoFormat::Bc7),
            (Automatic, astc, false, PhotoFormat::Astc),
            (Automatic, bc, true, PhotoFormat::Rgba8),
            (Automatic, Features::empty(), false, PhotoFormat::Rgba8),
            (Plain, bc | astc, false, PhotoFormat::Rgba8),
            (Compressed, astc, true, PhotoFormat::Astc),
            (Compressed, Features::empty(), false, PhotoFormat::Rgba8),
        ] {
            assert_eq!(PhotoFormat::choose(wish, features, on_processor), format, "{wish:?} {features:?}");
        }
    }

    #[test]
    fn a_compressed_tile_takes_a_quarter() {
        assert_eq!(PhotoFormat::Rgba8.tile_bytes(), 1_081_600);
        assert_eq!(PhotoFormat::Bc7.tile_bytes(), 270_400);
        assert_eq!(PhotoFormat::Astc.tile_bytes(), 270_400);
    }
}
