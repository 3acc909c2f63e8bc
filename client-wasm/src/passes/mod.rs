//! The passes: one file each, named as its shader. Pipelines are made when first needed.

pub mod compress_photo;
pub mod distance_pyramid;
pub mod load_map;
pub mod maximum_mip;
pub mod select_trees;
pub mod select_undergrowth;
pub mod shade;
pub mod terrain;
pub mod timing;
pub mod trees;
pub mod undergrowth;

/// Bind group 0 of every pass that looks at the scene (docs/ARCHITECTURE.md).
pub fn frame_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    use wgpu::{BindingType, BufferBindingType, SamplerBindingType, TextureSampleType, TextureViewDimension};
    let buffer = |ty| BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let storage = || buffer(BufferBindingType::Storage { read_only: true });
    let array = |sample_type| BindingType::Texture {
        sample_type,
        view_dimension: TextureViewDimension::D2Array,
        multisampled: false,
    };
    let loaded = || array(TextureSampleType::Float { filterable: false });
    let types = [
        buffer(BufferBindingType::Uniform),
        storage(),
        storage(),
        loaded(),
        loaded(),
        array(TextureSampleType::Uint),
        storage(),
        array(TextureSampleType::Float { filterable: true }),
        BindingType::Sampler(SamplerBindingType::Filtering),
        loaded(),
        buffer(BufferBindingType::Uniform),
    ];
    let entries: Vec<wgpu::BindGroupLayoutEntry> = types
        .into_iter()
        .enumerate()
        .map(|(binding, ty)| wgpu::BindGroupLayoutEntry {
            binding: binding as u32,
            visibility: wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::COMPUTE,
            ty,
            count: None,
        })
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("frame"),
        entries: &entries,
    })
}

/// Bind group 0 of passes that need the view alone.
pub fn view_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("view"),
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        }],
    })
}

/// Names a flag for a pipeline's overridable constants.
pub(crate) fn flag(name: &'static str, value: bool) -> (&'static str, f64) {
    (name, f64::from(u8::from(value)))
}

/// A pipeline that fills its targets with one triangle.
pub(crate) fn full_screen_pipeline(
    device: &wgpu::Device,
    label: &str,
    source: String,
    layouts: &[Option<&wgpu::BindGroupLayout>],
    entry: &str,
    constants: &[(&str, f64)],
    formats: &[wgpu::TextureFormat],
) -> wgpu::RenderPipeline {
    full_screen_pipeline_with_depth(device, label, source, layouts, entry, constants, formats, None)
}

/// The same with depths that its fragments write, of a format.
#[allow(clippy::too_many_arguments, reason = "what a pipeline is made of")]
pub(crate) fn full_screen_pipeline_with_depth(
    device: &wgpu::Device,
    label: &str,
    source: String,
    layouts: &[Option<&wgpu::BindGroupLayout>],
    entry: &str,
    constants: &[(&str, f64)],
    formats: &[wgpu::TextureFormat],
    depth: Option<wgpu::TextureFormat>,
) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: layouts,
        immediate_size: 0,
    });
    let options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    let targets: Vec<Option<wgpu::ColorTargetState>> =
        formats.iter().map(|&format| Some(format.into())).collect();
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("full_screen"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: depth.map(|format| wgpu::DepthStencilState {
            format,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Always),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(entry),
            compilation_options: options,
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}
