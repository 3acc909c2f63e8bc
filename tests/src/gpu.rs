//! The software adapter on which GPU code is tested: one for all tests of a program.

use std::sync::OnceLock;

/// Device and queue of the software adapter (lavapipe). Panics where there is none: a test that silently
/// skips the GPU proves nothing.
pub fn software_gpu() -> &'static (wgpu::Device, wgpu::Queue) {
    static GPU: OnceLock<(wgpu::Device, wgpu::Queue)> = OnceLock::new();
    GPU.get_or_init(|| pollster::block_on(open()))
}

async fn open() -> (wgpu::Device, wgpu::Queue) {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::VULKAN,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapters = instance.enumerate_adapters(wgpu::Backends::VULKAN).await;
    let adapter = adapters
        .into_iter()
        .find(|adapter| adapter.get_info().device_type == wgpu::DeviceType::Cpu)
        .expect("no software Vulkan adapter: install lavapipe (Debian, Ubuntu: apt-get install mesa-vulkan-drivers)");
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("tests"),
        required_limits: wgpu::Limits::default().using_resolution(adapter.limits()),
        ..wgpu::DeviceDescriptor::default()
    };
    adapter.request_device(&descriptor).await.expect("the software adapter opens a device")
}
