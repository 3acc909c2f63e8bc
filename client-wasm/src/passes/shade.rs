//! The shade pass: from distance and hit to the picture.

use super::full_screen_pipeline;
use treeline_shaders::{Pass, lighting, source};

/// What the pipeline is specialised for: what a scene does not have costs nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShadeVariant {
    /// Format of the picture.
    pub format: wgpu::TextureFormat,
    /// The scene has a photo.
    pub photo: bool,
    /// The elevation layer carries surface types and canopy.
    pub surface: bool,
    /// Shadows are marched.
    pub shadows: bool,
}

/// The pass, for one variant.
#[derive(Debug)]
pub struct Shade {
    /// What it was compiled for.
    pub variant: ShadeVariant,
    pipeline: wgpu::RenderPipeline,
}

/// Bind group 1: what the terrain pass wrote.
pub fn hits_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let texture = |binding, sample_type| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty: wgpu::BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        count: None,
    };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("hits"),
        entries: &[
            texture(0, wgpu::TextureSampleType::Float { filterable: false }),
            texture(1, wgpu::TextureSampleType::Uint),
        ],
    })
}

impl Shade {
    /// Compiles the pass.
    pub fn new(
        device: &wgpu::Device,
        frame: &wgpu::BindGroupLayout,
        hits: &wgpu::BindGroupLayout,
        variant: ShadeVariant,
    ) -> Self {
        let constants = lighting::ShadeVariant {
            photo: variant.photo,
            canopy: variant.surface,
            water: variant.surface,
            shadows: variant.shadows,
            encode_srgb: !variant.format.is_srgb(),
        }
        .constants();
        let pipeline = full_screen_pipeline(
            device,
            "shade",
            source(Pass::Shade),
            &[Some(frame), Some(hits)],
            lighting::SHADE_FRAGMENT,
            &constants,
            &[variant.format],
        );
        Self { variant, pipeline }
    }

    /// Records the pass.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::BindGroup,
        hits: &wgpu::BindGroup,
        picture: &wgpu::TextureView,
        timestamps: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shade"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: picture,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            timestamp_writes: timestamps,
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, hits, &[]);
        pass.draw(0..3, 0..1);
    }
}
