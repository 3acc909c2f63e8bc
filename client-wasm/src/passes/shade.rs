//! The shade pass: from distance and hit to the picture.

use super::full_screen_pipeline_with_depth;
use super::trees::DEPTH_FORMAT;
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
    /// The day differs from high summer.
    pub season: bool,
    /// The wind blows.
    pub wind: bool,
    /// Clouds throw shadows.
    pub clouds: bool,
    /// Trees are drawn one by one over the picture: the canopy gives way to them, and depths are written.
    pub trees: bool,
}

/// The pass, for one variant.
#[derive(Debug)]
pub struct Shade {
    /// What it was compiled for.
    pub variant: ShadeVariant,
    pipeline: wgpu::RenderPipeline,
}

/// Bind group 1: what the terrain pass wrote; `with_trees`: and where trees are drawn one by one.
pub fn hits_layout(device: &wgpu::Device, with_trees: bool) -> wgpu::BindGroupLayout {
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
    let entries = [
        texture(0, wgpu::TextureSampleType::Float { filterable: false }),
        texture(1, wgpu::TextureSampleType::Uint),
        wgpu::BindGroupLayoutEntry {
            binding: 2,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        },
    ];
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("hits"),
        entries: &entries[..if with_trees { 3 } else { 2 }],
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
            season: variant.season,
            wind: variant.wind,
            clouds: variant.clouds,
            encode_srgb: !variant.format.is_srgb(),
        }
        .constants();
        let (pass, entry, depth) = if variant.trees {
            (Pass::ShadeTrees, lighting::SHADE_TREES_FRAGMENT, Some(DEPTH_FORMAT))
        } else {
            (Pass::Shade, lighting::SHADE_FRAGMENT, None)
        };
        let pipeline = full_screen_pipeline_with_depth(
            device,
            "shade",
            source(pass),
            &[Some(frame), Some(hits)],
            entry,
            &constants,
            &[variant.format],
            depth,
        );
        Self { variant, pipeline }
    }

    /// Records the pass; with trees it writes `depth` too.
    #[allow(clippy::too_many_arguments, reason = "what a pass is given")]
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::BindGroup,
        hits: &wgpu::BindGroup,
        picture: &wgpu::TextureView,
        depth: Option<&wgpu::TextureView>,
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
            depth_stencil_attachment: depth.map(|view| wgpu::RenderPassDepthStencilAttachment {
                view,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: timestamps,
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, hits, &[]);
        pass.draw(0..3, 0..1);
    }
}
