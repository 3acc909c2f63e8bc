//! Sky, shadow and photo pages on the GPU against their twins, by a kernel that calls the shader's own functions.

use glam::{UVec2, Vec2, Vec3};
use treeline_shaders::layout::{EMPTY, LEAF_BIT, Leaf, ROOT_BITS, TexturePage, View};
use treeline_shaders::twin::shadow::{Ground, MapPlace};
use treeline_shaders::twin::{Texels, World, photo, shadow, sky};
use treeline_shaders::{FRAME_BINDINGS, LAYOUT, PHOTO, SHADOW, SKY};
use treeline_tests::gpu::software_gpu;
use wgpu::util::DeviceExt as _;

/// What the kernel is asked: a direction (sky, and towards the sun), a place, and what the functions need beside.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Question {
    direction: [f32; 3],
    dither: f32,
    unit: [u32; 2],
    leaf: u32,
    height: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct Answer {
    sky: [f32; 3],
    sun_visibility: f32,
    beam: [f32; 3],
    sky_visibility: f32,
    pages: [u32; 4],
}

const KERNEL: &str = r"
struct Question { direction: vec3<f32>, dither: f32, unit: vec2<u32>, leaf: u32, height: f32 }
struct Answer { sky: vec3<f32>, sun_visibility: f32, beam: vec3<f32>, sky_visibility: f32, pages: vec4<u32> }
@group(1) @binding(0) var<storage, read> questions: array<Question>;
@group(1) @binding(1) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&questions) {
        return;
    }
    let question = questions[id.x];
    let units = vec2<f32>(10000.0);
    let ground = Ground(MapPlace(question.unit, vec2<f32>(0.0)), question.leaf, question.height, units, 0.5, 0.0);
    let toward = vec3<f32>(question.direction.xy, abs(question.direction.z));
    let pages = photo_pages(question.unit, 12u);
    answers[id.x] = Answer(
        sky(question.direction),
        sun_visibility(ground, toward, question.dither),
        sun_transmittance(question.height, question.direction.z),
        sky_visibility(ground, 20.0, 200.0),
        vec4<u32>(pages.fine.slot, pages.fine.level, pages.coarse.slot, pages.coarse.level),
    );
}
";

const UNITS_PER_METRE: f32 = 10_000.0;
const SIDE: usize = 515;

/// Hills, the same on both sides of the leaves' shared edges; two levels: one root's quarter and the next root.
struct Hills {
    heights: Vec<Vec<f32>>,
}

impl Texels for Hills {
    fn height(&self, slot: u32, x: i32, y: i32) -> f32 {
        self.heights[slot as usize][y as usize * SIDE + x as usize]
    }

    fn maximum(&self, _: u32, _: u32, _: i32, _: i32) -> f32 {
        unreachable!("not asked for by these functions")
    }

    fn minimum(&self, _: u32, _: u32, _: i32, _: i32) -> f32 {
        unreachable!("not asked for by these functions")
    }

    fn levels(&self) -> u32 {
        9
    }
}

fn hill(x: f32, y: f32) -> f32 {
    let fold = |wave: f32, height: f32| {
        height * ((x / wave).sin() * (y / wave * 1.3).cos() + (x / wave * 0.7 + y / wave).sin())
    };
    700.0 + fold(900.0, 250.0) + fold(170.0, 40.0) + fold(23.0, 4.0)
}

fn leaf(slot: u32, x: u32, y: u32, side: u32) -> Leaf {
    Leaf {
        cells: [512, 512],
        grid_origin: [x, y],
        grid_side: side,
        slot,
        cell_metres: [side as f32 / UNITS_PER_METRE / 512.0; 2],
        h_cross_maximum_fade: [0.0, 0.0, 1_400.0, 1.0],
        ..Leaf::default()
    }
}

fn questions(leaves: &[Leaf]) -> Vec<Question> {
    // A low-discrepancy sequence: no two alike, every region met.
    let at = |index: usize, base: f64| ((index as f64 + 0.5) * base).fract();
    (0..1024)
        .map(|index| {
            let turn = at(index, 0.618_033_988_749_895) * std::f64::consts::TAU;
            let rise = at(index, 0.414_213_562_373_095).powi(2) * 1.6 - 0.6;
            let flat = (1.0 - rise * rise).sqrt();
            let leaf_index = index % leaves.len();
            let leaf = &leaves[leaf_index];
            let cell = [at(index, 0.754_877_666_246_693), at(index, 0.569_840_290_998_053)]
                .map(|share| (share * 512.0).floor() as u32);
            let units_per_cell = leaf.grid_side / 512;
            Question {
                direction: Vec3::new((flat * turn.cos()) as f32, (flat * turn.sin()) as f32, rise as f32)
                    .into(),
                dither: at(index, 0.236_067_977_499_79) as f32,
                unit: [0, 1].map(|axis| leaf.grid_origin[axis] + cell[axis] * units_per_cell),
                leaf: leaf_index as u32,
                height: hill(
                    leaf.grid_origin[0] as f32 / UNITS_PER_METRE + cell[0] as f32 * leaf.cell_metres[0],
                    leaf.grid_origin[1] as f32 / UNITS_PER_METRE + cell[1] as f32 * leaf.cell_metres[1],
                ),
            }
        })
        .collect()
}

fn twin_answer(world: &World<'_, Hills>, pages: &[TexturePage], question: &Question) -> Answer {
    let direction = Vec3::from(question.direction);
    let ground = Ground {
        place: MapPlace { unit: UVec2::from(question.unit), fraction: Vec2::ZERO },
        leaf: question.leaf,
        height: question.height,
        units_per_metre: Vec2::splat(UNITS_PER_METRE),
        cell_over_footprint: 0.5,
        node_error: 0.0,
    };
    let toward = Vec3::new(direction.x, direction.y, direction.z.abs());
    let found = photo::photo_pages(world.view, pages, UVec2::from(question.unit), 12);
    Answer {
        sky: sky::sky(world.view, direction).into(),
        sun_visibility: shadow::sun_visibility(world, &ground, toward, question.dither),
        beam: sky::sun_transmittance(world.view, question.height, direction.z).into(),
        sky_visibility: shadow::sky_visibility(world, &ground, 20.0, 200.0),
        pages: [found.fine.slot, found.fine.level, found.coarse.slot, found.coarse.level],
    }
}

fn gpu_answers(
    view: &View,
    nodes: &[u32],
    leaves: &[Leaf],
    hills: &Hills,
    pages: &[TexturePage],
    questions: &[Question],
) -> Vec<Answer> {
    let (device, queue) = software_gpu();
    let text = [LAYOUT, FRAME_BINDINGS, SKY, PHOTO, SHADOW, KERNEL].concat();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("shading"),
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("shading"),
        layout: None,
        module: &module,
        entry_point: Some("ask"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let buffer = |bytes: &[u8], usage| {
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents: bytes, usage })
    };
    let view = buffer(bytemuck::bytes_of(view), wgpu::BufferUsages::UNIFORM);
    let nodes = buffer(bytemuck::cast_slice(nodes), wgpu::BufferUsages::STORAGE);
    let leaf_buffer = buffer(bytemuck::cast_slice(leaves), wgpu::BufferUsages::STORAGE);
    let pages = buffer(bytemuck::cast_slice(pages), wgpu::BufferUsages::STORAGE);
    let asked = buffer(bytemuck::cast_slice(questions), wgpu::BufferUsages::STORAGE);
    let size = size_of_val(questions) / size_of::<Question>() * size_of::<Answer>();
    let answered = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: size as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let read_back = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: size as u64,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let heights = device.create_texture_with_data(
        queue,
        &wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d {
                width: SIDE as u32,
                height: SIDE as u32,
                depth_or_array_layers: hills.heights.len() as u32,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        bytemuck::cast_slice(&hills.heights.concat()),
    );
    let heights = heights.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    });
    let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
    let frame = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            entry(0, view.as_entire_binding()),
            entry(1, nodes.as_entire_binding()),
            entry(2, leaf_buffer.as_entire_binding()),
            entry(3, wgpu::BindingResource::TextureView(&heights)),
            entry(6, pages.as_entire_binding()),
        ],
    });
    let own = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(1),
        entries: &[entry(0, asked.as_entire_binding()), entry(1, answered.as_entire_binding())],
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &frame, &[]);
        pass.set_bind_group(1, &own, &[]);
        pass.dispatch_workgroups((questions.len() as u32).div_ceil(64), 1, 1);
    }
    encoder.copy_buffer_to_buffer(&answered, 0, &read_back, 0, size as u64);
    queue.submit([encoder.finish()]);
    read_back.slice(..).map_async(wgpu::MapMode::Read, |result| result.expect("the answers can be mapped"));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
    let bytes = read_back.slice(..).get_mapped_range().expect("the answers are mapped");
    bytemuck::cast_slice(&bytes).to_vec()
}

#[test]
fn the_gpu_agrees_with_the_twins() {
    let root = 1_u32 << ROOT_BITS;
    let half = root / 2;
    // The western root is cut in four, of which the south-western is missing; the eastern one is whole.
    let leaves =
        [leaf(0, 0, 0, half), leaf(1, half, 0, half), leaf(2, half, half, half), leaf(3, root, 0, root)];
    let nodes = [2, LEAF_BIT | 3, LEAF_BIT, LEAF_BIT | 1, EMPTY, LEAF_BIT | 2];
    let page = |slot, children| TexturePage { slot, children, fade: 1.0_f32.to_bits(), padding: 0 };
    let pages =
        [page(0, 2), page(1, EMPTY), page(2, EMPTY), page(EMPTY, 6), page(EMPTY, EMPTY), page(3, EMPTY)]
            .into_iter()
            .chain([page(EMPTY, EMPTY), page(4, EMPTY), page(EMPTY, EMPTY), page(5, EMPTY)])
            .collect::<Vec<_>>();
    let hills = Hills {
        heights: leaves
            .iter()
            .map(|leaf| {
                (0..SIDE * SIDE)
                    .map(|index| {
                        let metres = |axis: usize, texel: usize| {
                            leaf.grid_origin[axis] as f32 / UNITS_PER_METRE
                                + (texel as f32 - 1.0) * leaf.cell_metres[axis]
                        };
                        hill(metres(0, index % SIDE), metres(1, index / SIDE))
                    })
                    .collect()
            })
            .collect(),
    };
    let questions = questions(&leaves);
    for (eye_height, sun_elevation) in [(900.0_f32, 35.0_f32), (2_500.0, 4.0), (5.0e5, 50.0)] {
        let (sine, cosine) = sun_elevation.to_radians().sin_cos();
        let view = View {
            right: [1.0, 0.0, 0.0, 1e-3],
            up: [0.0, 0.0, 1.0, eye_height],
            forward: [0.0, 1.0, 0.0, 1_400.0],
            sun: [0.6 * cosine, 0.8 * cosine, sine, 6_371_000.0],
            root_size: [2, 1],
            root_level: 8,
            shadow_steps: 30,
            ..View::default()
        };
        let world = World {
            view: &view,
            nodes: &nodes,
            leaves: &leaves,
            texels: &hills,
            sheet: None,
            use_minima: false,
        };
        let gpu = gpu_answers(&view, &nodes, &leaves, &hills, &pages, &questions);
        let close = |a: [f32; 3], b: [f32; 3]| {
            a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 4e-3 * a.abs().max(b.abs()) + 2e-5)
        };
        let (mut apart, mut dark, mut lit) = (0, 0, 0);
        for (question, answer) in questions.iter().zip(&gpu) {
            let twin = twin_answer(&world, &pages, question);
            assert_eq!(answer.pages, twin.pages, "{question:?}");
            assert!(close(answer.beam, twin.beam), "{question:?}\n{answer:?}\n{twin:?}");
            assert!(close(answer.sky, twin.sky), "{question:?}\n{answer:?}\n{twin:?}");
            assert!((answer.sky_visibility - twin.sky_visibility).abs() < 1e-3, "{answer:?}\n{twin:?}");
            // At a node's or a tile's edge rounding may choose the neighbour.
            apart += usize::from((answer.sun_visibility - twin.sun_visibility).abs() > 0.01);
            dark += usize::from(twin.sun_visibility < 0.2);
            lit += usize::from(twin.sun_visibility > 0.95);
        }
        assert!(apart * 100 <= questions.len(), "{apart} shadows differ");
        assert!(dark > 50 && lit > 50, "the hills cast shadows and leave light: {dark} {lit}");
    }
}
