//! Compressed photo tiles by the GPU: the same blocks as the twin's, bit for bit, and the texture holds what was
//! uploaded.

use treeline_client::gpu::GpuContext;
use treeline_client::headless::{self, AdapterChoice};
use treeline_client::passes::compress_photo::{CompressPhoto, PhotoFormat};
use treeline_client::stream::decode::TEXTURE_SIDE;
use treeline_shaders::twin::compress_photo_astc::Astc;
use treeline_shaders::twin::compress_photo_bc7::Bc7;
use treeline_shaders::twin::photo_block;
use treeline_tests::height_field::noise;

const SIDE: usize = TEXTURE_SIDE as usize;

/// A landscape of smooth colours with grain, hard edges, flat blocks, blocks of anything at all, and a part where
/// there is no photo, its edge soft.
fn tile() -> Vec<u8> {
    (0..SIDE * SIDE)
        .flat_map(|index| {
            let (x, y) = (index % SIDE, index / SIDE);
            let random = |seed: u32| noise(x as i64, y as i64, seed);
            let smooth = ((x as f64 / 37.0).sin() + (y as f64 / 23.0).cos()) * 50.0 + 120.0;
            let grain = 24.0 * (random(1) - 0.5);
            let mut colour = match (x / 65, y / 65) {
                (1, _) => [200.0, 40.0, if (x + y) % 7 < 3 { 10.0 } else { 250.0 }],
                (2, _) => [90.0, 110.0, 60.0],
                (3, _) => [1, 2, 3].map(|seed| 255.0 * random(seed)),
                _ => [smooth + grain, 0.9 * smooth + grain + 10.0, 0.6 * smooth + 0.5 * grain],
            };
            let alpha = (x as f64 + y as f64 - 800.0).clamp(-2.0, 2.0);
            let alpha = 255.0 * (0.5 - 0.25 * alpha);
            if alpha == 0.0 {
                colour = [0.0; 3];
            }
            [colour[0], colour[1], colour[2], alpha].map(|value| value.round().clamp(0.0, 255.0) as u8)
        })
        .collect()
}

fn read(
    gpu: &GpuContext,
    copy: impl FnOnce(&mut wgpu::CommandEncoder, &wgpu::Buffer),
    bytes: u64,
) -> Vec<u8> {
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: bytes,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    copy(&mut encoder, &buffer);
    gpu.queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |result| result.expect("the buffer is mapped"));
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the GPU answers");
    buffer.get_mapped_range(..).expect("the buffer is mapped").to_vec()
}

/// The tile as the GPU decodes it: the array's layer drawn texel by texel.
fn decoded(gpu: &GpuContext, texture: &wgpu::Texture) -> Vec<u8> {
    const SHADER: &str = "
        @group(0) @binding(0) var tile: texture_2d<f32>;
        @vertex fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
            return vec4<f32>(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
        }
        @fragment fn texel(@builtin(position) place: vec4<f32>) -> @location(0) vec4<f32> {
            return textureLoad(tile, vec2<u32>(place.xy), 0);
        }";
    let device = &gpu.device;
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(SHADER.into()),
    });
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: None,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(wgpu::TextureFormat::Rgba8UnormSrgb.into())],
        }),
        multiview_mask: None,
        cache: None,
    });
    let picture = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: TEXTURE_SIDE, height: TEXTURE_SIDE, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8UnormSrgb,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) }],
    });
    let target = picture.create_view(&wgpu::TextureViewDescriptor::default());
    let row = (4 * TEXTURE_SIDE).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let bytes = read(
        gpu,
        |encoder, buffer| {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: None,
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..3, 0..1);
            drop(pass);
            encoder.copy_texture_to_buffer(
                picture.as_image_copy(),
                wgpu::TexelCopyBufferInfo {
                    buffer,
                    layout: wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: Some(row),
                        rows_per_image: None,
                    },
                },
                picture.size(),
            );
        },
        u64::from(row * TEXTURE_SIDE),
    );
    bytes.chunks_exact(row as usize).flat_map(|row| &row[..4 * SIDE]).copied().collect()
}

/// Peak signal-to-noise ratio decibels.
fn quality(one: &[u8], other: &[u8]) -> f64 {
    let squares: f64 =
        one.iter().zip(other).map(|(one, other)| (f64::from(*one) - f64::from(*other)).powi(2)).sum();
    10.0 * (255.0_f64.powi(2) * one.len() as f64 / squares.max(1e-9)).log10()
}

fn check(format: PhotoFormat, expected: &[[u32; 4]], rgba: &[u8]) {
    let gpu = headless::open(AdapterChoice::Software).expect("the software adapter");
    let pass = CompressPhoto::new(&gpu.device, format).expect("a compressed format");
    gpu.queue.write_texture(
        pass.tile().as_image_copy(),
        rgba,
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(4 * TEXTURE_SIDE),
            rows_per_image: None,
        },
        pass.tile().size(),
    );
    let (blocks, row_bytes) = pass.blocks();
    let bytes = read(
        &gpu,
        |encoder, buffer| {
            pass.record_blocks(encoder);
            encoder.copy_buffer_to_buffer(blocks, 0, buffer, 0, blocks.size());
        },
        blocks.size(),
    );
    let in_row = SIDE / 4;
    for (index, twin) in expected.iter().enumerate() {
        let at = (index / in_row) * row_bytes as usize + 16 * (index % in_row);
        let found: [u32; 4] = std::array::from_fn(|word| {
            let first = at + 4 * word;
            u32::from_le_bytes([bytes[first], bytes[first + 1], bytes[first + 2], bytes[first + 3]])
        });
        assert_eq!(found, *twin, "{format:?}: block {} of row {}", index % in_row, index / in_row);
    }
    assert_eq!(gpu.error(), None);
    if !gpu.device.features().contains(format.texture_format().required_features()) {
        println!("{format:?}: blocks compared; the adapter has no such textures");
        return;
    }
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: TEXTURE_SIDE, height: TEXTURE_SIDE, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: format.texture_format(),
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    pass.record(&mut encoder, texture.as_image_copy());
    gpu.queue.submit([encoder.finish()]);
    let decoded = decoded(&gpu, &texture);
    assert_eq!(gpu.error(), None);
    // Where colours lie near a line, as a photo's do.
    let smooth = |bytes: &[u8]| -> Vec<u8> {
        let texels = bytes.chunks_exact(4).enumerate();
        texels
            .filter(|(texel, _)| texel % SIDE >= 4 * 65)
            .flat_map(|(_, texel)| texel[..3].to_vec())
            .collect()
    };
    let quality = quality(&smooth(&decoded), &smooth(rgba));
    println!("{format:?}: {quality:.1} dB");
    assert!(quality > 38.0, "{format:?}: {quality:.1} dB");
    // No photo stays no photo, and a photo stays opaque: to a step.
    for (texel, (found, uploaded)) in decoded.chunks_exact(4).zip(rgba.chunks_exact(4)).enumerate() {
        let (x, y) = (texel % SIDE, texel / SIDE);
        if x + y < 790 || x + y > 810 {
            assert!(found[3].abs_diff(uploaded[3]) <= 1, "{format:?}: alpha {} at {x}, {y}", found[3]);
        }
    }
}

#[test]
fn blocks_of_bc7_are_the_twins() {
    let rgba = tile();
    check(PhotoFormat::Bc7, &photo_block::tile::<Bc7>(&rgba, SIDE), &rgba);
}

#[test]
fn blocks_of_astc_are_the_twins() {
    let rgba = tile();
    check(PhotoFormat::Astc, &photo_block::tile::<Astc>(&rgba, SIDE), &rgba);
}
