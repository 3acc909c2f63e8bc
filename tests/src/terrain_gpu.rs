//! The terrain pass on the software adapter, over a [`TileWorld`]: only what the shader itself needs.

use crate::gpu::software_gpu;
use crate::tile_world::{Frame, SIDE, TileWorld};
use treeline_shaders::{Pass, source};

/// The picture: distance (negative: a miss), and the four words of the hit, of each pixel. `use_minima`: as for an eye
/// below the surface.
pub fn terrain_by_gpu(world: &TileWorld, frame: &Frame, use_minima: bool) -> (Vec<f32>, Vec<[u32; 4]>) {
    let (device, queue) = software_gpu();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("terrain"),
        source: wgpu::ShaderSource::Wgsl(source(Pass::Terrain).into()),
    });
    let formats = [wgpu::TextureFormat::R32Float, wgpu::TextureFormat::Rgba32Uint];
    let targets = formats.map(|format| Some(wgpu::ColorTargetState::from(format)));
    // The layout is the shader's own: it says which bindings the pass really uses.
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("terrain"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("full_screen"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("terrain"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &[("USE_MINIMA", f64::from(u8::from(use_minima)))],
                ..Default::default()
            },
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    });
    let layers = world.tiles.len();
    let heights = array(&[SIDE], layers, |layer, _| &world.tiles[layer].heights);
    let sides: Vec<u32> = world.tiles[0].maxima.mips.iter().map(|mip| mip.0).collect();
    let maxima = array(&sides, layers, |layer, mip| &world.tiles[layer].maxima.mips[mip].2);
    let minima = array(&sides, layers, |layer, mip| &world.tiles[layer].minima.mips[mip].2);
    let buffer = |bytes: &[u8], usage| {
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        queue.write_buffer(&buffer, 0, bytes);
        buffer
    };
    let view = buffer(bytemuck::bytes_of(&frame.view), wgpu::BufferUsages::UNIFORM);
    let nodes = buffer(bytemuck::cast_slice(&world.nodes), wgpu::BufferUsages::STORAGE);
    let leaves = buffer(bytemuck::cast_slice(&frame.leaves), wgpu::BufferUsages::STORAGE);
    let bindings = [
        (0, view.as_entire_binding()),
        (1, nodes.as_entire_binding()),
        (2, leaves.as_entire_binding()),
        (3, wgpu::BindingResource::TextureView(&heights)),
        (4, wgpu::BindingResource::TextureView(&maxima)),
        (9, wgpu::BindingResource::TextureView(&minima)),
    ];
    let entries = bindings.map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    let [width, height] = frame.view.size;
    let pictures = formats.map(|format| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    });
    let views =
        pictures.each_ref().map(|picture| picture.create_view(&wgpu::TextureViewDescriptor::default()));
    let attachments = views.each_ref().map(|view| {
        Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                store: wgpu::StoreOp::Store,
            },
        })
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: None,
            color_attachments: &attachments,
            ..Default::default()
        });
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
    }
    queue.submit([encoder.finish()]);
    let distances = read_back(&pictures[0], 4).into_iter().map(f32::from_bits).collect();
    let hits = read_back(&pictures[1], 16).chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]).collect();
    (distances, hits)
}

/// A texture array with its mips, R32Float: sides of the mips, texels of a layer's mip.
pub(crate) fn array<'a>(
    sides: &[u32],
    layers: usize,
    texels: impl Fn(usize, usize) -> &'a Vec<f32>,
) -> wgpu::TextureView {
    let (device, queue) = software_gpu();
    let extent = |side: u32, layers: usize| wgpu::Extent3d {
        width: side,
        height: side,
        depth_or_array_layers: layers as u32,
    };
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: extent(sides[0], layers),
        mip_level_count: sides.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    for (mip, &side) in sides.iter().enumerate() {
        for layer in 0..layers {
            queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    texture: &texture,
                    mip_level: mip as u32,
                    origin: wgpu::Origin3d { x: 0, y: 0, z: layer as u32 },
                    aspect: wgpu::TextureAspect::All,
                },
                bytemuck::cast_slice(texels(layer, mip)),
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(4 * side),
                    rows_per_image: None,
                },
                extent(side, 1),
            );
        }
    }
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

/// The 32-bit words of a texture.
pub(crate) fn read_back(texture: &wgpu::Texture, texel_bytes: u32) -> Vec<u32> {
    let (device, queue) = software_gpu();
    let row = texel_bytes * texture.width();
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(padded * texture.height()),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: None,
            },
        },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |result| result.expect("the buffer is mapped"));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the GPU answers");
    let range = buffer.get_mapped_range(..).expect("the buffer is mapped");
    let rows = range.chunks_exact(padded as usize).map(|padded| &padded[..row as usize]);
    rows.flat_map(|row| {
        row.chunks_exact(4).map(|word| u32::from_ne_bytes([word[0], word[1], word[2], word[3]]))
    })
    .collect()
}
