//! The pass that selects trees, over a made-up wood of any size, beside the way without it: every seed drawn, holes
//! thrown away by their vertices.

use glam::DVec3;
use std::time::Instant;
use treeline_client::gpu::GpuContext;
use treeline_client::gpu::targets::Targets;
use treeline_client::gpu::tile_arrays::TileArrays;
use treeline_client::headless::HeadlessError;
use treeline_client::headless::capture::wait;
use treeline_client::passes::compress_photo::PhotoFormat;
use treeline_client::passes::frame_layout;
use treeline_client::passes::select_trees::{SelectTrees, SelectVariant};
use treeline_client::stream::decode::LandCoverPixels;
use treeline_client::stream::tree_field::SeedFrameCells;
use treeline_client::stream::view::ViewGeometry;
use treeline_core::camera::GeographicCamera;
use treeline_core::geodesy;
use treeline_core::seeds::Species;
use treeline_core::seeds::pattern::{CELL_UNITS, CellRow, ROWS};
use treeline_core::seeds::place::{UNIT_LEVEL, x_from_longitude, y_from_latitude};
use treeline_core::tile::CELLS;
use treeline_shaders::layout::{EMPTY, Leaf, TexturePage, View};
use treeline_shaders::trees::{BLOCK_COLUMNS, SeedCell, SeedFrame, SeedSpecies};
use treeline_shaders::{FRAME_BINDINGS, LAYOUT, Pass, TREE_LAYOUT, source};

/// Levels of the made-up land cover and of its anchors.
const COVER_LEVEL: u8 = 14;
const ANCHOR_LEVEL: u8 = 13;
/// Two triangles.
const QUAD_VERTICES: u32 = 6;
const UPRIGHT: &str = include_str!("upright_quad.wgsl");

/// A wood of two species seen from above, and all that the passes need.
pub struct Wood {
    gpu: GpuContext,
    /// Cells looked at, and what the pass is told.
    pub seeds: SeedFrameCells,
    table: Vec<SeedSpecies>,
    view: wgpu::Buffer,
    frame: wgpu::BindGroup,
    leaves: wgpu::Buffer,
    arrays: TileArrays,
    targets: Targets,
    layout: wgpu::BindGroupLayout,
    picture: wgpu::TextureView,
}

/// What a way of drawing took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taken {
    /// Median milliseconds, the wait for the GPU included.
    pub milliseconds: f64,
    /// Vertices shaded.
    pub vertices: u64,
    /// Draw calls.
    pub draws: u32,
}

fn buffer(gpu: &GpuContext, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
    let made = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: bytes.len() as u64,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&made, 0, bytes);
    made
}

/// The cells about a place, so many on each side, and what the pass is told of them.
fn seeds(view: &ViewGeometry, half: i64, species: u32, range: f32) -> SeedFrameCells {
    let side = i64::from(CELL_UNITS);
    let (eye_x, eye_y) = (x_from_longitude(view.eye.longitude), y_from_latitude(view.eye.latitude));
    let (whole_x, whole_y) = (eye_x.floor() as i64, eye_y.floor() as i64);
    let (column, row) = (whole_x.div_euclid(side), whole_y.div_euclid(side));
    let cells: Vec<SeedCell> = (row - half..=row + half)
        .flat_map(|row| (column - half..=column + half).map(move |column| (column, row)))
        .map(|(column, row)| SeedCell {
            cell: [column as u32, row as u32],
            offset: [(column * side - whole_x) as i32, (row * side - whole_y) as i32],
            ..SeedCell::default()
        })
        .collect();
    let latitude = view.eye.latitude.to_radians();
    let unit = |normal: &DVec3| {
        let unit = normal.normalize().as_vec3();
        [unit.x, unit.y, unit.z, 0.0]
    };
    let cover_bits = u32::from(UNIT_LEVEL - COVER_LEVEL);
    let frame = SeedFrame {
        eye: [
            latitude.sin() as f32,
            latitude.cos() as f32,
            view.eye.height as f32,
            geodesy::prime_vertical_radius(view.eye.latitude) as f32,
        ],
        sides: view.side_normals().each_ref().map(unit),
        level_pixels: [130.0, 50.0, 18.0, 0.0],
        eye_fraction: [(eye_x - whole_x as f64) as f32, (eye_y - whole_y as f64) as f32],
        range,
        anchor_quantum: 1.0 / 64.0,
        cells: cells.len() as u32,
        blocks: CellRow::new(row as u32).columns.div_ceil(BLOCK_COLUMNS),
        species,
        cover_bits,
        tile_bits: cover_bits + CELLS.ilog2(),
        anchor_bits: u32::from(UNIT_LEVEL - ANCHOR_LEVEL),
        padding: [0; 2],
    };
    SeedFrameCells { frame, cells, eye_cell: [column as u32, row as u32] }
}

impl Wood {
    /// Cells on each side of the eye, which looks down from a height (metres) over closed forest on level ground.
    pub fn new(gpu: GpuContext, half: i64, height: f64, size: [u32; 2]) -> Self {
        let camera = GeographicCamera {
            lon: 10.0,
            lat: 0.3,
            height,
            heading_deg: 0.0,
            pitch_deg: -90.0,
            fov_y_deg: 80.0,
        };
        let geometry = ViewGeometry::new(&camera, size[0], size[1]);
        let species = &Species::built_in()[..2];
        let table: Vec<SeedSpecies> = species.iter().map(SeedSpecies::from).collect();
        let seeds = seeds(&geometry, half, table.len() as u32, 3.0 * height as f32);
        let axis = |axis: DVec3, last: f64| [axis.x as f32, axis.y as f32, axis.z as f32, last as f32];
        let view = View {
            right: axis(geometry.right * geometry.tangent_x, geometry.pixel_angle),
            up: axis(geometry.up * geometry.tangent_y, height),
            forward: axis(geometry.forward, 100.0),
            sun: [0.4, 0.3, 0.87, geodesy::gaussian_radius(camera.lat) as f32],
            size,
            scene_seed: 1,
            ..View::default()
        };
        let device = &gpu.device;
        let mut arrays = TileArrays::new(device, 1, 0, false, PhotoFormat::Rgba8);
        let stand = |cell: u32| [1 + (cell / 40 % 2) as u8, 255, 0, 0];
        let anchor_side = (CELLS >> (COVER_LEVEL - ANCHOR_LEVEL)) + 1;
        let pixels = LandCoverPixels {
            stands: (0..CELLS * CELLS).flat_map(stand).collect(),
            anchors: vec![0; (anchor_side * anchor_side) as usize],
            anchor_side,
            species: vec![1, 2],
        };
        arrays.upload_land_cover(device, &gpu.queue, (0, 1), &pixels);
        let storage = |bytes: &[u8]| buffer(&gpu, bytes, wgpu::BufferUsages::STORAGE);
        let view = buffer(&gpu, bytemuck::bytes_of(&view), wgpu::BufferUsages::UNIFORM);
        let leaves = storage(bytemuck::bytes_of(&Leaf::default()));
        let layout = frame_layout(device);
        let nodes = storage(bytemuck::bytes_of(&EMPTY));
        let pages =
            storage(bytemuck::bytes_of(&TexturePage { slot: EMPTY, children: EMPTY, fade: 0, padding: 0 }));
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let texture = wgpu::BindingResource::TextureView;
        let resources = [
            view.as_entire_binding(),
            nodes.as_entire_binding(),
            leaves.as_entire_binding(),
            texture(arrays.heights.view()),
            texture(arrays.maxima.view()),
            texture(arrays.surface.view()),
            pages.as_entire_binding(),
            texture(arrays.photo.view()),
            wgpu::BindingResource::Sampler(&sampler),
            texture(arrays.heights.view()),
        ];
        let frame = bind(device, &layout, (0..).zip(resources));
        let targets = Targets::new(device, size[0], size[1]);
        let picture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8UnormSrgb,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        });
        let picture = picture.create_view(&wgpu::TextureViewDescriptor::default());
        Self { seeds, table, view, frame, leaves, arrays, targets, layout, picture, gpu }
    }

    /// Candidates looked at.
    pub fn checked(&self) -> u64 {
        self.seeds.cells.iter().map(|cell| u64::from(CellRow::new(cell.cell[1]).columns * ROWS)).sum()
    }

    /// The pass that selects trees.
    pub fn pass(&self) -> SelectTrees {
        let variant = SelectVariant { photo: false, shadows: false, season: false, clouds: false };
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        let pass = SelectTrees::new(device, queue, &self.layout, variant, &self.table);
        pass.write_vertex_counts(queue, &vec![QUAD_VERTICES; pass.bins() as usize]);
        pass
    }

    /// Bytes of what the selection writes: words of candidates, counts, instances.
    pub fn bytes(&self, pass: &SelectTrees) -> [u64; 3] {
        [4 * u64::from(self.seeds.frame.candidates()), pass.counts().size(), pass.instances().size()]
    }

    fn pipeline(&self, text: String, entry: &str, topology: wgpu::PrimitiveTopology) -> wgpu::RenderPipeline {
        let device = &self.gpu.device;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(entry),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(entry),
            // The layout is the shader's own.
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState { topology, ..Default::default() },
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("plain"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(wgpu::TextureFormat::Rgba8UnormSrgb.into())],
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    /// Median milliseconds of so many submissions, after one for the compiler.
    fn median(
        &self,
        rounds: usize,
        mut record: impl FnMut(&mut wgpu::CommandEncoder),
    ) -> Result<f64, HeadlessError> {
        let mut times = Vec::new();
        for _ in 0..=rounds {
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            record(&mut encoder);
            let start = Instant::now();
            self.gpu.queue.submit([encoder.finish()]);
            wait(&self.gpu)?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        times.remove(0);
        times.sort_by(f64::total_cmp);
        Ok(times[times.len() / 2])
    }

    /// The selection alone: median milliseconds.
    pub fn select(&self, pass: &mut SelectTrees, rounds: usize) -> Result<f64, HeadlessError> {
        // The surface is a miss everywhere, so that nothing is hidden.
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let load = wgpu::LoadOp::Clear(wgpu::Color { r: -1.0, ..wgpu::Color::BLACK });
        render(&mut encoder, &self.targets.distance_view, load, |_| ());
        self.gpu.queue.submit([encoder.finish()]);
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        let (frame, targets, arrays, seeds) = (&self.frame, &self.targets, &self.arrays, &self.seeds);
        self.median(rounds, |encoder| {
            pass.record(device, queue, encoder, frame, targets, arrays, seeds, None);
        })
    }

    /// Draws the list that was selected last, a quad a tree.
    pub fn draw_listed(
        &self,
        selection: &SelectTrees,
        selected: u64,
        rounds: usize,
    ) -> Result<Taken, HeadlessError> {
        let text = [LAYOUT, FRAME_BINDINGS, TREE_LAYOUT, UPRIGHT, include_str!("listed_trees.wgsl")].concat();
        let pipeline = self.pipeline(text, "listed_tree", wgpu::PrimitiveTopology::TriangleList);
        let device = &self.gpu.device;
        let view = bind(device, &pipeline.get_bind_group_layout(0), [(0, self.view.as_entire_binding())]);
        let blocks = self.seeds.frame.cells * self.seeds.frame.blocks;
        let bins: Vec<wgpu::BindGroup> = (0..selection.bins())
            .map(|bin| {
                let word = [bin * blocks, 0, 0, 0];
                let word = buffer(&self.gpu, bytemuck::bytes_of(&word), wgpu::BufferUsages::UNIFORM);
                let resources = [
                    (0, selection.instances().as_entire_binding()),
                    (1, selection.counts().as_entire_binding()),
                    (2, word.as_entire_binding()),
                ];
                bind(device, &pipeline.get_bind_group_layout(1), resources)
            })
            .collect();
        let milliseconds = self.median(rounds, |encoder| {
            render(encoder, &self.picture, wgpu::LoadOp::Clear(wgpu::Color::BLACK), |pass| {
                pass.set_pipeline(&pipeline);
                pass.set_bind_group(0, &view, &[]);
                for (bin, group) in (0..).zip(&bins) {
                    pass.set_bind_group(1, group, &[]);
                    pass.draw_indirect(selection.draws(), 16 * bin);
                }
            });
        })?;
        Ok(Taken { milliseconds, vertices: u64::from(QUAD_VERTICES) * selected, draws: selection.bins() })
    }

    /// Draws every candidate: as a point (one vertex), or as a quad.
    pub fn draw_every_seed(&self, quads: bool, rounds: usize) -> Result<Taken, HeadlessError> {
        let text = source(Pass::SelectTrees) + UPRIGHT + include_str!("naive_seeds.wgsl");
        let (topology, vertices) = if quads {
            (wgpu::PrimitiveTopology::TriangleList, QUAD_VERTICES)
        } else {
            (wgpu::PrimitiveTopology::PointList, 1)
        };
        let pipeline = self.pipeline(text, "every_seed", topology);
        let device = &self.gpu.device;
        let of_frame = [(0, self.view.as_entire_binding()), (2, self.leaves.as_entire_binding())];
        let frame = bind(device, &pipeline.get_bind_group_layout(0), of_frame);
        let uniform = wgpu::BufferUsages::UNIFORM;
        let seed_frame = buffer(&self.gpu, bytemuck::bytes_of(&self.seeds.frame), uniform);
        let mut table = self.table.clone();
        table.resize(255, SeedSpecies::default());
        let table = buffer(&self.gpu, bytemuck::cast_slice(&table), uniform);
        let cells = buffer(&self.gpu, bytemuck::cast_slice(&self.seeds.cells), wgpu::BufferUsages::STORAGE);
        let Some(land_cover) = &self.arrays.land_cover else {
            return Err(HeadlessError::Gpu("no land cover".into()));
        };
        let texture = wgpu::BindingResource::TextureView;
        let of_seeds = [
            (0, seed_frame.as_entire_binding()),
            (1, table.as_entire_binding()),
            (2, cells.as_entire_binding()),
            (6, texture(land_cover.stands.view())),
            (7, texture(land_cover.anchors.view())),
            (8, texture(&self.targets.distance_view)),
            (9, texture(&self.targets.hit_view)),
        ];
        let group = bind(device, &pipeline.get_bind_group_layout(1), of_seeds);
        let candidates = self.seeds.frame.candidates();
        let milliseconds = self.median(rounds, |encoder| {
            render(encoder, &self.picture, wgpu::LoadOp::Clear(wgpu::Color::BLACK), |pass| {
                pass.set_pipeline(&pipeline);
                pass.set_bind_group(0, &frame, &[]);
                pass.set_bind_group(1, &group, &[]);
                pass.draw(0..vertices, 0..candidates);
            });
        })?;
        Ok(Taken { milliseconds, vertices: u64::from(vertices) * u64::from(candidates), draws: 1 })
    }
}

fn bind<'a>(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    resources: impl IntoIterator<Item = (u32, wgpu::BindingResource<'a>)>,
) -> wgpu::BindGroup {
    let entries: Vec<_> =
        resources.into_iter().map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

fn render(
    encoder: &mut wgpu::CommandEncoder,
    picture: &wgpu::TextureView,
    load: wgpu::LoadOp<wgpu::Color>,
    record: impl FnOnce(&mut wgpu::RenderPass<'_>),
) {
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: None,
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: picture,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
        })],
        ..Default::default()
    });
    record(&mut pass);
}
