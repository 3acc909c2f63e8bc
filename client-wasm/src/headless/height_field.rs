//! The height-field pass: the picture of a plain grid of heights, for comparison with exact references.
//!
//! It is the scene's ray caster around one leaf without a page table. Natively only: it waits for the GPU.

use crate::gpu::targets::{DISTANCE_FORMAT, HIT_FORMAT, Targets};
use crate::passes::full_screen_pipeline;
use std::time::Instant;
use treeline_shaders::height_field::{HeightField, InputError, PlaneCamera, Prepared};
use treeline_shaders::{Pass, source};

/// How a height field is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightFieldOptions {
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// With it the surface at the horizontal distance d from the eye lies d²/2R lower, metres.
    pub earth_radius: Option<f64>,
    /// How often the picture is drawn (at least once), for the times.
    pub repeat: u32,
}

/// What was drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightFieldFrame {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Row-major from the top: metres from the eye along the ray through the pixel's centre, +∞ where
    /// the ray meets nothing.
    pub distance: Vec<f32>,
    /// Texel fetches of each pixel's ray: node loads and gathers of four.
    pub fetches: Vec<u16>,
    /// Milliseconds of each drawing, the wait for the GPU included.
    pub milliseconds: Vec<f64>,
    /// Rays that the exact twin hits and the pass does not.
    pub missed_rays: u64,
}

/// Why a height field was not drawn, in one line.
#[derive(Debug, thiserror::Error)]
pub enum HeightFieldError {
    /// The grid, the camera or an option makes no sense.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The grid or the picture is larger than the adapter's textures.
    #[error(
        "{what} is {columns} × {rows}; this adapter's textures hold at most {limit} × {limit}: cut it, or choose another --adapter"
    )]
    TooLarge {
        /// The grid or the picture.
        what: &'static str,
        /// Its columns.
        columns: u32,
        /// Its rows.
        rows: u32,
        /// The adapter's limit.
        limit: u32,
    },
    /// The GPU failed.
    #[error("the GPU failed to draw the height field: {0}")]
    Gpu(String),
}

/// Draws a height field and reads the picture back. Heights are handed to the GPU relative to the
/// eye, so that an eye a millimetre over the ground is exact.
///
/// # Errors
/// Where the input makes no sense, the grid exceeds the adapter's textures, or the GPU fails.
pub fn render_height_field(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    field: &HeightField,
    camera: &PlaneCamera,
    options: &HeightFieldOptions,
) -> Result<HeightFieldFrame, HeightFieldError> {
    let limit = device.limits().max_texture_dimension_2d;
    for (what, [columns, rows]) in [("the height field", field.size()), ("the picture", options.size)] {
        if columns.max(rows) > limit {
            return Err(HeightFieldError::TooLarge { what, columns, rows, limit });
        }
    }
    let pixels = options.size[0] as usize * options.size[1] as usize;
    let Some(prepared) = Prepared::new(field, camera, options.size, options.earth_radius)? else {
        return Ok(HeightFieldFrame {
            size: options.size,
            distance: vec![f32::INFINITY; pixels],
            fetches: vec![0; pixels],
            milliseconds: vec![0.0; options.repeat.max(1) as usize],
            missed_rays: 0,
        });
    };

    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let drawn = draw(device, queue, &prepared, options);
    let errors = [pollster::block_on(memory.pop()), pollster::block_on(scope.pop())];
    if let Some(error) = errors.into_iter().flatten().next() {
        let text = error.to_string();
        return Err(HeightFieldError::Gpu(text.lines().map(str::trim).collect::<Vec<_>>().join(" ")));
    }
    let (parameters, hits, milliseconds) = drawn?;

    let [width, height] = options.size;
    let mut frame = HeightFieldFrame {
        size: options.size,
        distance: Vec::with_capacity(pixels),
        fetches: Vec::with_capacity(pixels),
        milliseconds,
        missed_rays: 0,
    };
    for row in 0..height {
        for column in 0..width {
            let index = (row * width + column) as usize;
            let distance = prepared.distance(column, row, f32::from_bits(parameters[index]));
            if distance.is_infinite() && prepared.by_twin(column, row).0.is_finite() {
                frame.missed_rays += 1;
            }
            frame.distance.push(distance);
            frame.fetches.push(u16::try_from(hits[4 * index + 3]).unwrap_or(u16::MAX));
        }
    }
    Ok(frame)
}

type Drawn = (Vec<u32>, Vec<u32>, Vec<f64>);

fn draw(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    prepared: &Prepared,
    options: &HeightFieldOptions,
) -> Result<Drawn, HeightFieldError> {
    let [columns, rows] = prepared.size;
    let heights = array_texture(device, queue, "heights", &[(columns, rows, prepared.heights.as_slice())]);
    let pyramid = |label, mips: &[(u32, u32, Vec<f32>)]| {
        let mips: Vec<_> =
            mips.iter().map(|(columns, rows, texels)| (*columns, *rows, texels.as_slice())).collect();
        array_texture(device, queue, label, &mips)
    };
    let maxima = pyramid("maxima", &prepared.maxima.mips);
    let minima = pyramid("minima", &prepared.minima.mips);
    let uniform = |label, bytes: &[u8], usage| {
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        queue.write_buffer(&buffer, 0, bytes);
        buffer
    };
    let view = uniform("view", bytemuck::bytes_of(&prepared.view), wgpu::BufferUsages::UNIFORM);
    let leaves = uniform("leaves", bytemuck::bytes_of(&prepared.leaf), wgpu::BufferUsages::STORAGE);
    let sheet = uniform("sheet", bytemuck::bytes_of(&prepared.sheet), wgpu::BufferUsages::UNIFORM);

    let layout = bind_group_layout(device);
    let bindings = [
        (0, view.as_entire_binding()),
        (2, leaves.as_entire_binding()),
        (3, wgpu::BindingResource::TextureView(&heights)),
        (4, wgpu::BindingResource::TextureView(&maxima)),
        (9, wgpu::BindingResource::TextureView(&minima)),
        (10, sheet.as_entire_binding()),
    ];
    let entries = bindings.map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("height_field"),
        layout: &layout,
        entries: &entries,
    });
    let pipeline = full_screen_pipeline(
        device,
        "height_field",
        source(Pass::HeightField),
        &[Some(&layout)],
        "height_field",
        &[("USE_MINIMA", 1.0), ("COUNT_FETCHES", 1.0)],
        &[DISTANCE_FORMAT, HIT_FORMAT],
    );
    let targets = Targets::new(device, options.size[0], options.size[1]);
    let mut milliseconds = Vec::new();
    for _ in 0..options.repeat.max(1) {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        record(&mut encoder, &pipeline, &group, &targets);
        let start = Instant::now();
        queue.submit([encoder.finish()]);
        wait(device)?;
        milliseconds.push(start.elapsed().as_secs_f64() * 1e3);
    }
    let parameters = read_back(device, queue, &targets.distance)?;
    let hits = read_back(device, queue, &targets.hit)?;
    Ok((parameters, hits, milliseconds))
}

fn record(
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::RenderPipeline,
    group: &wgpu::BindGroup,
    targets: &Targets,
) {
    let attachment = |view| {
        Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                store: wgpu::StoreOp::Store,
            },
        })
    };
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("height_field"),
        color_attachments: &[attachment(&targets.distance_view), attachment(&targets.hit_view)],
        ..Default::default()
    });
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group, &[]);
    pass.draw(0..3, 0..1);
}

fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let array = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: false },
        view_dimension: wgpu::TextureViewDimension::D2Array,
        multisampled: false,
    };
    let entries = [
        (0, buffer(wgpu::BufferBindingType::Uniform)),
        (2, buffer(wgpu::BufferBindingType::Storage { read_only: true })),
        (3, array),
        (4, array),
        (9, array),
        (10, buffer(wgpu::BufferBindingType::Uniform)),
    ]
    .map(|(binding, ty)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty,
        count: None,
    });
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("height_field"),
        entries: &entries,
    })
}

/// An array of one layer with these mips.
fn array_texture(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    label: &str,
    mips: &[(u32, u32, &[f32])],
) -> wgpu::TextureView {
    let extent = |(columns, rows, _): (u32, u32, &[f32])| wgpu::Extent3d {
        width: columns,
        height: rows,
        depth_or_array_layers: 1,
    };
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: extent(mips[0]),
        mip_level_count: mips.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    for (mip_level, &mip) in mips.iter().enumerate() {
        queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &texture,
                mip_level: mip_level as u32,
                origin: wgpu::Origin3d::ZERO,
                aspect: wgpu::TextureAspect::All,
            },
            bytemuck::cast_slice(mip.2),
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * mip.0), rows_per_image: None },
            extent(mip),
        );
    }
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

fn wait(device: &wgpu::Device) -> Result<(), HeightFieldError> {
    device
        .poll(wgpu::PollType::wait_indefinitely())
        .map(|_| ())
        .map_err(|error| HeightFieldError::Gpu(error.to_string()))
}

/// The 32-bit words of a texture, row-major, without padding.
fn read_back(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
) -> Result<Vec<u32>, HeightFieldError> {
    let bytes = texture.format().block_copy_size(None).unwrap_or(4) * texture.width();
    let padded = bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read-back"),
        size: u64::from(padded) * u64::from(texture.height()),
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
    // What goes wrong with the mapping shows when the range is asked for.
    buffer.map_async(wgpu::MapMode::Read, .., |_| {});
    wait(device)?;
    let range = buffer.get_mapped_range(..).map_err(|error| HeightFieldError::Gpu(error.to_string()))?;
    let words = range
        .chunks_exact(padded as usize)
        .flat_map(|row| row[..bytes as usize].chunks_exact(4))
        .map(|word| u32::from_ne_bytes([word[0], word[1], word[2], word[3]]))
        .collect();
    Ok(words)
}
