//! Reading textures back.

use super::HeadlessError;
use crate::gpu::GpuContext;

/// A frame, read back.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// sRGB, alpha 255, row-major from the top left.
    pub rgba: Vec<u8>,
    /// Metres from the eye, −1 for a miss.
    pub distance: Vec<f32>,
    /// Leaf, bits of u, bits of v, texel fetches.
    pub hit: Vec<[u32; 4]>,
}

/// The bytes of a texture's first mip, rows without padding. Waits for the GPU.
pub fn read_texture(gpu: &GpuContext, texture: &wgpu::Texture) -> Result<Vec<u8>, HeadlessError> {
    let (width, height) = (texture.width(), texture.height());
    let texel = texture.format().block_copy_size(None).unwrap_or(4);
    let row = width * texel;
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: u64::from(padded) * u64::from(height),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: Some(height),
            },
        },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
    gpu.queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |_| {});
    wait(gpu)?;
    let range = buffer.get_mapped_range(..).map_err(|error| HeadlessError::Gpu(error.to_string()))?;
    let mut bytes = Vec::with_capacity((row * height) as usize);
    for line in range.chunks_exact(padded as usize) {
        bytes.extend_from_slice(&line[..row as usize]);
    }
    Ok(bytes)
}

/// Waits until the GPU has done all that was submitted, and answers what went wrong, if anything did.
pub fn wait(gpu: &GpuContext) -> Result<(), HeadlessError> {
    let polled = gpu.device.poll(wgpu::PollType::wait_indefinitely());
    if let Some(problem) = gpu.error().or_else(|| gpu.lost()) {
        return Err(HeadlessError::Gpu(problem.lines().map(str::trim).collect::<Vec<_>>().join(" ")));
    }
    polled.map(|_| ()).map_err(|error| HeadlessError::Gpu(error.to_string()))
}
