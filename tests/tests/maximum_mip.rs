//! The pyramid of maxima by the GPU, bit for bit against its twin: tiles, grids of any size, voids, minima.

use treeline_shaders::layout::VOID_HEIGHT;
use treeline_shaders::twin::maximum_mip::Pyramid;
use treeline_shaders::{Pass, source};
use treeline_tests::gpu::software_gpu;
use treeline_tests::height_field::noise;

fn texture(size: [u32; 2], mips: u32, usage: wgpu::TextureUsages) -> wgpu::Texture {
    software_gpu().0.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
        mip_level_count: mips,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R32Float,
        usage,
        view_formats: &[],
    })
}

fn mip_view(texture: &wgpu::Texture, mip: u32) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        base_mip_level: mip,
        mip_level_count: Some(1),
        ..Default::default()
    })
}

fn check(width: u32, height: u32, border: u32, minimum: bool) {
    let (device, queue) = software_gpu();
    let heights: Vec<f32> = (0..width * height)
        .map(|index| {
            let value = noise(i64::from(index % width), i64::from(index / width), 5) as f32;
            if value < 0.03 { VOID_HEIGHT } else { value * 4000.0 - 500.0 }
        })
        .collect();
    let expected = Pyramid::new(&heights, width, height, border, minimum);
    let mips = expected.mips.len() as u32;
    let source_texture =
        texture([width, height], 1, wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST);
    let extent = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
    let rows =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * width), rows_per_image: None };
    queue.write_texture(source_texture.as_image_copy(), bytemuck::cast_slice(&heights), rows, extent);
    let size = [expected.mips[0].0, expected.mips[0].1];
    let usage = wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    let target = texture(size, mips, usage);

    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(source(Pass::MaximumMip).into()),
    });
    let constants = [("BORDER", f64::from(border)), ("MINIMUM", f64::from(u8::from(minimum)))];
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    for mip in 0..mips {
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: Some(if mip == 0 { "cells_to_mip" } else { "mip_to_mip" }),
            compilation_options: wgpu::PipelineCompilationOptions {
                // A constant that an entry point does not use is no error.
                constants: &constants,
                ..Default::default()
            },
            cache: None,
        });
        let from = if mip == 0 { mip_view(&source_texture, 0) } else { mip_view(&target, mip - 1) };
        let to = mip_view(&target, mip);
        let entries = [from, to];
        let entries: Vec<_> = entries
            .iter()
            .enumerate()
            .map(|(binding, view)| wgpu::BindGroupEntry {
                binding: binding as u32,
                resource: wgpu::BindingResource::TextureView(view),
            })
            .collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        let (columns, rows, _) = expected.mips[mip as usize];
        pass.dispatch_workgroups(columns.div_ceil(8), rows.div_ceil(8), 1);
    }
    queue.submit([encoder.finish()]);
    for (mip, (columns, rows, texels)) in expected.mips.iter().enumerate() {
        let found = read_back(&target, mip as u32, *columns, *rows);
        assert_eq!(&found, texels, "mip {mip} of {width} × {height}, border {border}, minimum {minimum}");
    }
}

fn read_back(texture: &wgpu::Texture, mip_level: u32, columns: u32, rows: u32) -> Vec<f32> {
    let (device, queue) = software_gpu();
    let padded = (4 * columns).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(padded * rows),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        wgpu::TexelCopyTextureInfo { mip_level, ..texture.as_image_copy() },
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: None,
            },
        },
        wgpu::Extent3d { width: columns, height: rows, depth_or_array_layers: 1 },
    );
    queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |result| result.expect("the buffer is mapped"));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the GPU answers");
    let range = buffer.get_mapped_range(..).expect("the buffer is mapped");
    range
        .chunks_exact(padded as usize)
        .flat_map(|row| row[..4 * columns as usize].chunks_exact(4))
        .map(|word| f32::from_ne_bytes([word[0], word[1], word[2], word[3]]))
        .collect()
}

#[test]
fn a_tile() {
    check(515, 515, 1, false);
}

#[test]
fn grids_of_any_size() {
    for (width, height) in [(2, 2), (2, 37), (37, 2), (33, 100), (65, 65), (130, 71)] {
        for minimum in [false, true] {
            check(width, height, 0, minimum);
        }
    }
}
