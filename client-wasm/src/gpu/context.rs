//! The device, and what went wrong with it.

use crate::passes::compress_photo::PhotoFormat;
use std::sync::{Arc, Mutex, PoisonError};

/// A device with its queue. Cheap to clone.
#[derive(Clone, Debug)]
pub struct GpuContext {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Which adapter it is.
    pub info: wgpu::AdapterInfo,
    faults: Arc<Mutex<Faults>>,
}

#[derive(Debug, Default)]
struct Faults {
    lost: Option<String>,
    error: Option<String>,
}

/// Optional features that are used where an adapter has them.
pub fn wanted_features(adapter: &wgpu::Adapter) -> wgpu::Features {
    adapter.features() & (wgpu::Features::TIMESTAMP_QUERY | PhotoFormat::FEATURES)
}

/// What every adapter must offer: WebGPU's own defaults.
pub fn required_limits() -> wgpu::Limits {
    wgpu::Limits::default()
}

impl GpuContext {
    /// Opens a device of an adapter.
    pub async fn open(adapter: &wgpu::Adapter) -> Result<Self, wgpu::RequestDeviceError> {
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("treeline"),
            required_features: wanted_features(adapter),
            required_limits: required_limits(),
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = adapter.request_device(&descriptor).await?;
        Ok(Self::new(device, queue, adapter.get_info()))
    }

    /// Takes over a device: from now on its loss and its errors are recorded here.
    pub fn new(device: wgpu::Device, queue: wgpu::Queue, info: wgpu::AdapterInfo) -> Self {
        let faults = Arc::new(Mutex::new(Faults::default()));
        let for_loss = Arc::clone(&faults);
        device.set_device_lost_callback(move |reason, text| {
            // A device that was destroyed is as lost to whoever still holds this.
            lock(&for_loss).lost.get_or_insert_with(|| format!("{reason:?}: {text}"));
        });
        let for_errors = Arc::clone(&faults);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            lock(&for_errors).error.get_or_insert_with(|| error.to_string());
        }));
        Self { device, queue, info, faults }
    }

    /// Why the device was lost, if it was.
    pub fn lost(&self) -> Option<String> {
        lock(&self.faults).lost.clone()
    }

    /// The first error that no one caught: a defect of this program or of the driver.
    pub fn error(&self) -> Option<String> {
        lock(&self.faults).error.clone()
    }

    /// Name of the adapter, or its kind where it has no name.
    pub fn adapter_name(&self) -> String {
        if self.info.name.is_empty() {
            format!("{:?}", self.info.device_type)
        } else {
            self.info.name.clone()
        }
    }

    /// Whether passes can be timed.
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }
}

fn lock(faults: &Mutex<Faults>) -> std::sync::MutexGuard<'_, Faults> {
    faults.lock().unwrap_or_else(PoisonError::into_inner)
}
