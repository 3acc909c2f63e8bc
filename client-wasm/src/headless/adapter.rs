//! Opening a device.

use super::HeadlessError;
use crate::gpu::GpuContext;

/// Which adapter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AdapterChoice {
    /// One that runs on the CPU (lavapipe): the same picture on every machine.
    Software,
    /// The fastest that there is.
    #[default]
    Any,
}

/// Opens a Vulkan device.
pub fn open(choice: AdapterChoice) -> Result<GpuContext, HeadlessError> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    let instance = wgpu::Instance::new(descriptor);
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    adapters.retain(|adapter| match choice {
        AdapterChoice::Software => adapter.get_info().device_type == wgpu::DeviceType::Cpu,
        AdapterChoice::Any => true,
    });
    adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    let name = if choice == AdapterChoice::Software { "software" } else { "usable" };
    let adapter = adapters.first().ok_or(HeadlessError::NoAdapter(name))?;
    pollster::block_on(GpuContext::open(adapter)).map_err(|error| HeadlessError::NoDevice {
        adapter: adapter.get_info().name,
        problem: error.to_string(),
    })
}
