//! The frame's uniform and storage buffers: written anew each frame, grown by doubling.

use crate::stream::page_table::Tables;
use bytemuck::Zeroable;
use treeline_core::seeds::season::ROWS;
use treeline_shaders::layout::{EMPTY, Leaf, TexturePage, View};
use treeline_shaders::season::SeasonRow;

/// The buffers of bind group 0.
#[derive(Debug)]
pub struct FrameBuffers {
    /// Binding 0.
    pub view: wgpu::Buffer,
    /// Binding 1.
    pub nodes: wgpu::Buffer,
    /// Binding 2.
    pub leaves: wgpu::Buffer,
    /// Binding 6.
    pub pages: wgpu::Buffer,
    /// Binding 10: written once a scene.
    pub seasons: wgpu::Buffer,
    /// Counts replaced buffers: bind groups of another generation are stale.
    pub generation: u64,
}

fn storage(device: &wgpu::Device, label: &str, bytes: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

impl FrameBuffers {
    /// Small ones.
    pub fn new(device: &wgpu::Device) -> Self {
        Self {
            view: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("view"),
                size: size_of::<View>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            nodes: storage(device, "nodes", 1 << 10),
            leaves: storage(device, "leaves", 16 << 10),
            pages: storage(device, "texture pages", 4 << 10),
            seasons: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("seasons"),
                size: (ROWS * size_of::<SeasonRow>()) as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            generation: 0,
        }
    }

    /// Writes a frame's data. It lands before the whole of the next submission.
    pub fn write(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, view: &View, tables: &Tables) {
        queue.write_buffer(&self.view, 0, bytemuck::bytes_of(view));
        let mut write = |buffer: &mut wgpu::Buffer, label: &str, data: &[u8]| {
            if data.len() as u64 > buffer.size() {
                *buffer = storage(device, label, (data.len() as u64).next_power_of_two());
                self.generation += 1;
            }
            queue.write_buffer(buffer, 0, data);
        };
        write(&mut self.nodes, "nodes", bytemuck::cast_slice(&tables.nodes));
        write(&mut self.leaves, "leaves", bytemuck::cast_slice::<Leaf, u8>(&tables.leaves));
        // Without a photo every root still has its entry, which says so.
        let none = TexturePage { slot: EMPTY, children: EMPTY, ..TexturePage::zeroed() };
        let empty =
            vec![
                none;
                if tables.pages.is_empty() { (view.root_size[0] * view.root_size[1]) as usize } else { 0 }
            ];
        let pages = if tables.pages.is_empty() { &empty } else { &tables.pages };
        write(&mut self.pages, "texture pages", bytemuck::cast_slice(pages));
    }
}
