//! The trees that are drawn one by one: decided from the seeds, tested, sorted by species and level
//! (`treeline_shaders::trees` says what comes out). Nothing is read back but counts, for the display.

use super::flag;
use crate::gpu::targets::Targets;
use crate::gpu::tile_arrays::TileArrays;
use crate::stream::tree_field::SeedFrameCells;
use treeline_shaders::trees::{Draw, LEVELS, MOST_SPECIES, SeedCell, SeedFrame, SeedSpecies, TreeInstance};
use treeline_shaders::{Pass, source};

/// What the pass is specialised for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SelectVariant {
    /// The scene has a photo, whose colours trees take.
    pub photo: bool,
    /// Shadows are marched.
    pub shadows: bool,
    /// The day differs from high summer.
    pub season: bool,
    /// Clouds throw shadows.
    pub clouds: bool,
}

/// The pass with its buffers.
#[derive(Debug)]
pub struct SelectTrees {
    /// What it was compiled for.
    pub variant: SelectVariant,
    layout: wgpu::BindGroupLayout,
    draws_group: wgpu::BindGroup,
    decide: wgpu::ComputePipeline,
    scan: wgpu::ComputePipeline,
    scatter: wgpu::ComputePipeline,
    frame: wgpu::Buffer,
    species: wgpu::Buffer,
    cells: wgpu::Buffer,
    decided: wgpu::Buffer,
    counts: wgpu::Buffer,
    instances: wgpu::Buffer,
    draws: wgpu::Buffer,
    bins: u32,
    group: Option<Group>,
    /// Counts replaced buffers.
    pub generation: u64,
}

/// Bind group 1, and what it was made for.
#[derive(Debug)]
struct Group {
    made_for: (u64, u64, wgpu::Texture),
    group: wgpu::BindGroup,
}

fn buffer(device: &wgpu::Device, label: &str, bytes: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn entry(binding: u32, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

fn layouts(device: &wgpu::Device) -> [wgpu::BindGroupLayout; 2] {
    use wgpu::{BufferBindingType as Kind, TextureSampleType as Sample, TextureViewDimension as Dimension};
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let storage = |read_only| buffer(Kind::Storage { read_only });
    let texture = |sample_type, view_dimension| wgpu::BindingType::Texture {
        sample_type,
        view_dimension,
        multisampled: false,
    };
    let of_seeds = [
        buffer(Kind::Uniform),
        buffer(Kind::Uniform),
        storage(true),
        storage(false),
        storage(false),
        storage(false),
        texture(Sample::Uint, Dimension::D2Array),
        texture(Sample::Sint, Dimension::D2Array),
        texture(Sample::Float { filterable: false }, Dimension::D2),
        texture(Sample::Uint, Dimension::D2),
    ];
    let entries: Vec<_> = (0..).zip(of_seeds).map(|(binding, ty)| entry(binding, ty)).collect();
    let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
    };
    [layout("select_trees", &entries), layout("tree draws", &[entry(0, storage(false))])]
}

impl SelectTrees {
    /// Compiles the pass for a scene's species.
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        frame_layout: &wgpu::BindGroupLayout,
        variant: SelectVariant,
        table: &[SeedSpecies],
    ) -> Self {
        use wgpu::BufferUsages as Usage;
        let [layout, draws_layout] = layouts(device);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("select_trees"),
            source: wgpu::ShaderSource::Wgsl(source(Pass::SelectTrees).into()),
        });
        let constants = [
            flag("WITH_PHOTO", variant.photo),
            flag("WITH_SHADOWS", variant.shadows),
            flag("WITH_SEASON", variant.season),
            flag("WITH_CLOUDS", variant.clouds),
        ];
        let pipeline = |name: &str, groups: &[Option<&wgpu::BindGroupLayout>]| {
            let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(name),
                bind_group_layouts: groups,
                immediate_size: 0,
            });
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(name),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: if name == "scatter" { &constants } else { &[] },
                    ..Default::default()
                },
                cache: None,
            })
        };
        let of_seeds = [Some(frame_layout), Some(&layout)];
        let bins = table.len().min(MOST_SPECIES) as u32 * LEVELS;
        let draws = buffer(
            device,
            "tree draws",
            u64::from(bins + 1) * size_of::<Draw>() as u64,
            Usage::STORAGE | Usage::INDIRECT | Usage::COPY_SRC,
        );
        let species =
            buffer(device, "seed species", (MOST_SPECIES * size_of::<SeedSpecies>()) as u64, Usage::UNIFORM);
        let known = &table[..table.len().min(MOST_SPECIES)];
        queue.write_buffer(&species, 0, bytemuck::cast_slice(known));
        let draws_entry = wgpu::BindGroupEntry { binding: 0, resource: draws.as_entire_binding() };
        Self {
            variant,
            draws_group: device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("tree draws"),
                layout: &draws_layout,
                entries: &[draws_entry],
            }),
            decide: pipeline("decide", &of_seeds),
            scan: pipeline("scan", &[Some(frame_layout), Some(&layout), Some(&draws_layout)]),
            scatter: pipeline("scatter", &of_seeds),
            layout,
            frame: buffer(device, "seed frame", size_of::<SeedFrame>() as u64, Usage::UNIFORM),
            species,
            cells: buffer(device, "seed cells", 4 << 10, Usage::STORAGE),
            decided: buffer(device, "seeds decided", 64 << 10, Usage::STORAGE),
            counts: buffer(device, "seed counts", 16 << 10, Usage::STORAGE | Usage::COPY_SRC),
            instances: buffer(device, "trees", 256 << 10, Usage::STORAGE | Usage::COPY_SRC),
            draws,
            bins,
            group: None,
            generation: 0,
        }
    }

    /// Arguments of the draws, one a bin (species by species, level by level); a last one counts every tree once.
    pub fn draws(&self) -> &wgpu::Buffer {
        &self.draws
    }

    /// The trees, bin after bin.
    pub fn instances(&self) -> &wgpu::Buffer {
        &self.instances
    }

    /// Where bins begin: the word at bin × cells × blocks.
    pub fn counts(&self) -> &wgpu::Buffer {
        &self.counts
    }

    /// What the pass was told of the frame.
    pub fn frame(&self) -> &wgpu::Buffer {
        &self.frame
    }

    /// Bins that are drawn.
    pub fn bins(&self) -> u32 {
        self.bins
    }

    /// Says how many vertices each bin's model has.
    pub fn write_vertex_counts(&self, queue: &wgpu::Queue, vertex_counts: &[u32]) {
        let draws: Vec<Draw> = (0..=self.bins as usize)
            .map(|bin| Draw { vertex_count: vertex_counts.get(bin).copied().unwrap_or(0), ..Draw::default() })
            .collect();
        queue.write_buffer(&self.draws, 0, bytemuck::cast_slice(&draws));
    }

    fn make_room(&mut self, device: &wgpu::Device, seeds: &SeedFrameCells) {
        let frame = &seeds.frame;
        // Every candidate may be a tree, between two levels; of very many, most are not.
        let limits = device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let sizes = [
            seeds.cells.len() as u64 * size_of::<SeedCell>() as u64,
            4 * u64::from(frame.candidates()),
            4 * u64::from(frame.counts()),
            2 * u64::from(frame.candidates()) * size_of::<TreeInstance>() as u64,
        ];
        let buffers = [&mut self.cells, &mut self.decided, &mut self.counts, &mut self.instances];
        let labels = ["seed cells", "seeds decided", "seed counts", "trees"];
        for ((old, size), label) in buffers.into_iter().zip(sizes).zip(labels) {
            let size = size.next_power_of_two().min(most);
            if size > old.size() {
                *old = buffer(device, label, size, old.usage());
                self.generation += 1;
            }
        }
    }

    /// Records the pass. `frame` is bind group 0, `generation` says when its buffers were replaced.
    #[allow(clippy::too_many_arguments, reason = "what a pass is given")]
    pub fn record(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::BindGroup,
        targets: &Targets,
        arrays: &TileArrays,
        seeds: &SeedFrameCells,
        timestamps: Option<wgpu::ComputePassTimestampWrites<'_>>,
    ) {
        let Some(land_cover) = &arrays.land_cover else { return };
        self.make_room(device, seeds);
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&seeds.frame));
        queue.write_buffer(&self.cells, 0, bytemuck::cast_slice(&seeds.cells));
        let made_for = (self.generation, arrays.generation, targets.distance.clone());
        if self.group.as_ref().is_none_or(|group| group.made_for != made_for) {
            let texture = wgpu::BindingResource::TextureView;
            let resources = [
                self.frame.as_entire_binding(),
                self.species.as_entire_binding(),
                self.cells.as_entire_binding(),
                self.decided.as_entire_binding(),
                self.counts.as_entire_binding(),
                self.instances.as_entire_binding(),
                texture(land_cover.stands.view()),
                texture(land_cover.anchors.view()),
                texture(&targets.distance_view),
                texture(&targets.hit_view),
            ];
            let entries: Vec<_> = (0..)
                .zip(resources)
                .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("select_trees"),
                layout: &self.layout,
                entries: &entries,
            });
            self.group = Some(Group { made_for, group });
        }
        let Some(Group { group, .. }) = &self.group else { return };
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("select_trees"),
            timestamp_writes: timestamps,
        });
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, group, &[]);
        pass.set_pipeline(&self.decide);
        pass.dispatch_workgroups(seeds.frame.blocks, seeds.frame.cells, 1);
        pass.set_bind_group(2, &self.draws_group, &[]);
        pass.set_pipeline(&self.scan);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(&self.scatter);
        pass.dispatch_workgroups(seeds.frame.blocks, seeds.frame.cells, 1);
    }
}
