//! The Tile Load Map: which tiles the picture just drawn shows, and which it may show where no pixel's centre
//! lies (`treeline_shaders::load_map` says what comes out).

use super::distance_pyramid::{self, DistancePyramid};
use crate::gpu::targets::Targets;
use treeline_shaders::load_map::{CELLS, LoadMapFrame, MAPS, SIDE};
use treeline_shaders::{Pass, source};

/// The passes that can be timed, in order: what pixels say with the pyramid of distances, and the cells' boxes.
pub const PASSES: [&str; 2] = ["distance_pyramid", "load_map"];
/// Quads along the side of a work group of `mark_pixels`.
const QUADS: u32 = 16;
/// Cells of a work group of `choose_cells` and `write_cells`.
const GROUP: u32 = 64;
/// Work groups of `test_sub_cells` before any candidate is found.
const NO_CANDIDATES: [u32; 3] = [0, 1, 1];

/// The pass with its buffers.
#[derive(Debug)]
pub struct LoadMap {
    pixels_layout: wgpu::BindGroupLayout,
    cells_layout: wgpu::BindGroupLayout,
    dispatch_group: wgpu::BindGroup,
    mark_pixels: wgpu::ComputePipeline,
    distance_pyramid: DistancePyramid,
    choose_cells: wgpu::ComputePipeline,
    test_sub_cells: wgpu::ComputePipeline,
    write_cells: wgpu::ComputePipeline,
    stack: wgpu::Buffer,
    cells: wgpu::Buffer,
    pixels: wgpu::Buffer,
    candidates: wgpu::Buffer,
    dispatch: wgpu::Buffer,
    no_candidates: wgpu::Buffer,
    picture: Option<Picture>,
}

/// What depends on the picture.
#[derive(Debug)]
struct Picture {
    distance: wgpu::Texture,
    pixels: wgpu::BindGroup,
    cells: wgpu::BindGroup,
}

fn layout_of(
    device: &wgpu::Device,
    label: &str,
    entries: &[(u32, wgpu::BindingType)],
) -> wgpu::BindGroupLayout {
    let entries: Vec<wgpu::BindGroupLayoutEntry> = entries
        .iter()
        .map(|&(binding, ty)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty,
            count: None,
        })
        .collect();
    device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

fn bind(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    entries: &[wgpu::BindGroupEntry<'_>],
) -> wgpu::BindGroup {
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries })
}

impl LoadMap {
    /// Compiles the pass. `frame_layout` is group 0 of every pass (`passes::frame_layout`), with the pyramid
    /// of minima in its place.
    pub fn new(device: &wgpu::Device, frame_layout: &wgpu::BindGroupLayout) -> Self {
        use wgpu::BufferUsages as Usage;
        let buffer_type =
            |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let uniform = buffer_type(wgpu::BufferBindingType::Uniform);
        let storage = buffer_type(wgpu::BufferBindingType::Storage { read_only: false });
        let texture = |sample_type| wgpu::BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let pixels_layout = layout_of(
            device,
            "load map: pixels",
            &[
                (0, uniform),
                (1, storage),
                (2, storage),
                (3, storage),
                (4, texture(wgpu::TextureSampleType::Float { filterable: false })),
                (5, texture(wgpu::TextureSampleType::Uint)),
            ],
        );
        let cells_layout =
            layout_of(device, "load map: cells", &[(0, uniform), (1, storage), (2, storage), (6, storage)]);
        let dispatch_layout = layout_of(device, "load map: dispatch", &[(0, storage)]);
        let pipeline_layout = |groups: &[&wgpu::BindGroupLayout]| {
            let groups: Vec<_> = groups.iter().map(|&group| Some(group)).collect();
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("load_map"),
                bind_group_layouts: &groups,
                immediate_size: 0,
            })
        };
        let module = |pass| {
            device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("load_map"),
                source: wgpu::ShaderSource::Wgsl(source(pass).into()),
            })
        };
        let pipeline = |layout: &wgpu::PipelineLayout, module: &wgpu::ShaderModule, entry: &str| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(layout),
                module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        };
        let buffer = |label, words: u32, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: 4 * u64::from(words),
                usage,
                mapped_at_creation: false,
            })
        };
        let of_pixels = pipeline_layout(&[frame_layout, &pixels_layout]);
        let of_cells = pipeline_layout(&[frame_layout, &cells_layout]);
        let of_choice = pipeline_layout(&[frame_layout, &cells_layout, &dispatch_layout]);
        let (pixels_module, cells_module) = (module(Pass::LoadMapPixels), module(Pass::LoadMapCells));
        let answer = Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST;
        let dispatch = buffer("load map: dispatch", 3, Usage::STORAGE | Usage::INDIRECT | Usage::COPY_DST);
        let no_candidates = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("load map: no candidates"),
            size: 12,
            usage: Usage::COPY_SRC,
            mapped_at_creation: true,
        });
        if let Ok(mut range) = no_candidates.get_mapped_range_mut(..) {
            range.copy_from_slice(bytemuck::cast_slice(&NO_CANDIDATES));
        }
        no_candidates.unmap();
        let dispatch_entry = wgpu::BindGroupEntry { binding: 0, resource: dispatch.as_entire_binding() };
        Self {
            mark_pixels: pipeline(&of_pixels, &pixels_module, "mark_pixels"),
            distance_pyramid: DistancePyramid::new(device, &of_pixels),
            choose_cells: pipeline(&of_choice, &cells_module, "choose_cells"),
            test_sub_cells: pipeline(&of_cells, &cells_module, "test_sub_cells"),
            write_cells: pipeline(&of_cells, &cells_module, "write_cells"),
            dispatch_group: bind(device, "load map: dispatch", &dispatch_layout, &[dispatch_entry]),
            stack: buffer(
                "load map: stack",
                (size_of::<LoadMapFrame>() / 4) as u32,
                Usage::UNIFORM | Usage::COPY_DST,
            ),
            cells: buffer("load map: cells", CELLS, answer),
            pixels: buffer("load map: pixels", CELLS, answer),
            candidates: buffer("load map: candidates", CELLS, Usage::STORAGE),
            dispatch,
            no_candidates,
            picture: None,
            pixels_layout,
            cells_layout,
        }
    }

    /// A word a cell, once the recorded pass has run.
    pub fn cells(&self) -> &wgpu::Buffer {
        &self.cells
    }

    /// For each cell the pixels whose centre's ray hits it and wants its level.
    pub fn pixels(&self) -> &wgpu::Buffer {
        &self.pixels
    }

    /// Records the pass for the picture that the terrain pass has drawn on the same encoder. `frame` is its
    /// bind group 0. `timestamps`: those of [`PASSES`]. Once a submission: the stack is written before all of it.
    #[allow(clippy::too_many_arguments, reason = "what a pass is given")]
    pub fn record(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::BindGroup,
        targets: &Targets,
        stack: &LoadMapFrame,
        timestamps: [Option<wgpu::ComputePassTimestampWrites<'_>>; 2],
    ) {
        queue.write_buffer(&self.stack, 0, bytemuck::bytes_of(stack));
        encoder.clear_buffer(&self.cells, 0, None);
        encoder.clear_buffer(&self.pixels, 0, None);
        encoder.copy_buffer_to_buffer(&self.no_candidates, 0, &self.dispatch, 0, 12);
        if self.picture.as_ref().is_none_or(|picture| picture.distance != targets.distance) {
            self.picture = Some(self.prepare(device, targets));
        }
        let Some(picture) = &self.picture else { return };
        let [of_pixels, of_cells] = timestamps;
        let size = targets.size();
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(PASSES[0]),
                timestamp_writes: of_pixels,
            });
            pass.set_bind_group(0, frame, &[]);
            pass.set_bind_group(1, &picture.pixels, &[]);
            pass.set_pipeline(&self.mark_pixels);
            let groups = size.map(|side| (side + 1).div_ceil(QUADS));
            pass.dispatch_workgroups(groups[0], groups[1], 1);
            self.distance_pyramid.record(&mut pass, size);
        }
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(PASSES[1]),
            timestamp_writes: of_cells,
        });
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, &picture.cells, &[]);
        pass.set_bind_group(2, &self.dispatch_group, &[]);
        let groups = stack.maps.min(MAPS) * SIDE * SIDE / GROUP;
        pass.set_pipeline(&self.choose_cells);
        pass.dispatch_workgroups(groups, 1, 1);
        pass.set_pipeline(&self.test_sub_cells);
        pass.dispatch_workgroups_indirect(&self.dispatch, 0);
        pass.set_pipeline(&self.write_cells);
        pass.dispatch_workgroups(groups, 1, 1);
    }

    fn prepare(&self, device: &wgpu::Device, targets: &Targets) -> Picture {
        let pyramid = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("distance pyramid"),
            size: distance_pyramid::buffer_bytes(targets.size()),
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let common = [
            entry(0, self.stack.as_entire_binding()),
            entry(1, self.cells.as_entire_binding()),
            entry(2, pyramid.as_entire_binding()),
        ];
        let texture = wgpu::BindingResource::TextureView;
        let [stack, cells, pyramid] = common.clone();
        let of_pixels = [
            stack,
            cells,
            pyramid,
            entry(3, self.pixels.as_entire_binding()),
            entry(4, texture(&targets.distance_view)),
            entry(5, texture(&targets.hit_view)),
        ];
        let [stack, cells, pyramid] = common;
        let of_cells = [stack, cells, pyramid, entry(6, self.candidates.as_entire_binding())];
        Picture {
            distance: targets.distance.clone(),
            pixels: bind(device, "load map: pixels", &self.pixels_layout, &of_pixels),
            cells: bind(device, "load map: cells", &self.cells_layout, &of_cells),
        }
    }
}
