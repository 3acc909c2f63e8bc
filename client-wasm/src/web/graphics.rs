//! The device, and the canvas as its surface.

use super::failure::Failure;
use crate::frame::FrameTarget;
use crate::gpu::GpuContext;
use web_sys::HtmlCanvasElement;

/// A canvas that is drawn on.
pub struct Graphics {
    /// The device.
    pub context: GpuContext,
    surface: wgpu::Surface<'static>,
    configuration: wgpu::SurfaceConfiguration,
    /// The surface's format with sRGB encoding: canvases themselves have none.
    view_format: wgpu::TextureFormat,
}

impl Graphics {
    /// Opens the best adapter for the canvas.
    pub async fn open(canvas: &HtmlCanvasElement) -> Result<Self, Failure> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let surface = instance
            .create_surface(wgpu::SurfaceTarget::Canvas(canvas.clone()))
            .map_err(|error| Failure::new("no-adapter", error.to_string()))?;
        let adapter = instance
            .request_adapter(&wgpu::RequestAdapterOptions {
                power_preference: wgpu::PowerPreference::HighPerformance,
                compatible_surface: Some(&surface),
                ..Default::default()
            })
            .await
            .map_err(|error| Failure::new("no-adapter", error.to_string()))?;
        let context = GpuContext::open(&adapter)
            .await
            .map_err(|error| Failure::new("no-adapter", error.to_string()))?;
        let mut configuration = surface
            .get_default_config(&adapter, 1, 1)
            .ok_or_else(|| Failure::new("no-adapter", "the adapter cannot draw on a canvas"))?;
        configuration.alpha_mode = wgpu::CompositeAlphaMode::Opaque;
        let view_format = configuration.format.add_srgb_suffix();
        configuration.view_formats = vec![view_format];
        let graphics = Self { context, surface, configuration, view_format };
        graphics.configure();
        Ok(graphics)
    }

    fn configure(&self) {
        self.surface.configure(&self.context.device, &self.configuration);
    }

    /// Whether the adapter draws on the processor.
    pub fn is_software(&self) -> bool {
        self.context.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Size of the picture, pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.configuration.width, self.configuration.height)
    }

    /// Changes the picture's size; its content is gone then.
    pub fn resize(&mut self, width: u32, height: u32) -> bool {
        if self.size() == (width, height) {
            return false;
        }
        (self.configuration.width, self.configuration.height) = (width, height);
        self.configure();
        true
    }

    /// The canvas's next picture. To be asked for only where it will be drawn: the browser shows it
    /// either way. `None` where there is none just now.
    pub fn next(&self) -> Option<Picture> {
        match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(texture)
            | wgpu::CurrentSurfaceTexture::Suboptimal(texture) => {
                let view = texture.texture.create_view(&wgpu::TextureViewDescriptor {
                    format: Some(self.view_format),
                    ..Default::default()
                });
                Some(Picture { texture, view, format: self.view_format })
            }
            wgpu::CurrentSurfaceTexture::Outdated | wgpu::CurrentSurfaceTexture::Lost => {
                self.configure();
                None
            }
            _ => None,
        }
    }
}

/// A picture of the canvas that is being drawn.
pub struct Picture {
    texture: wgpu::SurfaceTexture,
    view: wgpu::TextureView,
    format: wgpu::TextureFormat,
}

impl Picture {
    /// As the engine takes it.
    pub fn target(&self) -> FrameTarget<'_> {
        FrameTarget { view: &self.view, format: self.format }
    }

    /// Shows it.
    pub fn present(self, graphics: &Graphics) {
        graphics.context.queue.present(self.texture);
    }
}
