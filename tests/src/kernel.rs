//! A kernel that calls a shader's own functions, on the software adapter.

use crate::gpu::software_gpu;
use wgpu::util::DeviceExt as _;

/// Runs a kernel `ask` (64 threads a work group) over `questions`, which are binding 0 of group 1; answers are its
/// binding 1. `uniforms` are bindings of group 0, which the kernel must all look at.
pub fn ask<Question: bytemuck::Pod, Answer: bytemuck::Pod>(
    text: &str,
    uniforms: &[(u32, &[u8])],
    questions: &[Question],
) -> Vec<Answer> {
    let (device, queue) = software_gpu();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("kernel"),
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("kernel"),
        layout: None,
        module: &module,
        entry_point: Some("ask"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let buffer = |contents: &[u8], usage| {
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents, usage })
    };
    let size = (questions.len() * size_of::<Answer>()) as u64;
    let empty = |usage| {
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    };
    let uniforms: Vec<(u32, wgpu::Buffer)> = uniforms
        .iter()
        .map(|(binding, bytes)| (*binding, buffer(bytes, wgpu::BufferUsages::UNIFORM)))
        .collect();
    let asked = buffer(bytemuck::cast_slice(questions), wgpu::BufferUsages::STORAGE);
    let answered = empty(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
    let read_back = empty(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
    let group = |index, buffers: &[(u32, &wgpu::Buffer)]| {
        let entries: Vec<_> = buffers
            .iter()
            .map(|&(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(index),
            entries: &entries,
        })
    };
    let of_frame: Vec<(u32, &wgpu::Buffer)> =
        uniforms.iter().map(|(binding, buffer)| (*binding, buffer)).collect();
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group(0, &of_frame), &[]);
        pass.set_bind_group(1, &group(1, &[(0, &asked), (1, &answered)]), &[]);
        pass.dispatch_workgroups((questions.len() as u32).div_ceil(64), 1, 1);
    }
    encoder.copy_buffer_to_buffer(&answered, 0, &read_back, 0, size);
    queue.submit([encoder.finish()]);
    read_back.slice(..).map_async(wgpu::MapMode::Read, |result| result.expect("the answers can be mapped"));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
    let bytes = read_back.slice(..).get_mapped_range().expect("the answers are mapped");
    bytemuck::cast_slice(&bytes).to_vec()
}
