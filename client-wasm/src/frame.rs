//! A frame: the order of its passes, in one screenful.

mod groups;
mod undergrowth;

use crate::gpu::GpuContext;
use crate::gpu::frame_buffers::FrameBuffers;
use crate::gpu::read_back_belt::Belt;
use crate::gpu::targets::Targets;
use crate::gpu::tile_arrays::TileArrays;
use crate::gpu::tree_models::TreeModels;
use crate::passes::load_map::LoadMap;
use crate::passes::maximum_mip::MaximumMip;
use crate::passes::select_trees::SelectTrees;
use crate::passes::select_undergrowth::SelectUndergrowth;
use crate::passes::shade::{Shade, ShadeVariant, hits_layout};
use crate::passes::terrain::Terrain;
use crate::passes::timing::PassTimer;
use crate::passes::trees::{DEPTH_FORMAT, Trees, TreesVariant};
use crate::passes::view_layout;
use crate::stats::{SeedStats, UndergrowthStats};
use crate::stream::page_table::Tables;
use crate::stream::tree_field::SeedFrameCells;
use crate::stream::undergrowth::UndergrowthBlocks;
use crate::survey::Ticket;
use groups::{bind, goes_below, has, hits_group, select_variant, shade_variant};
use treeline_core::seeds::Species;
use treeline_core::seeds::pattern::{CellRow, ROWS};
use treeline_core::seeds::season::ROWS as ROWS_OF_SEASONS;
use treeline_core::tree_model::TreeSpecies;
use treeline_shaders::layout::View;
use treeline_shaders::season::{FLAG_SEASON, SeasonRow};
use treeline_shaders::trees::{Draw, SeedSpecies, TreeCells};
use treeline_shaders::weather::FLAG_WIND;
use undergrowth::FrameUndergrowth;

/// The passes of a frame, in order; timed under these names.
pub const PASSES: &[&str] = &[
    "terrain",
    "shade",
    "distance_pyramid",
    "load_map",
    "select_trees",
    "trees",
    "select_undergrowth",
    "undergrowth",
];

/// What grows in a frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct FramePlants<'a> {
    /// Trees that are drawn one by one.
    pub trees: Option<FrameTrees<'a>>,
    /// Undergrowth near the eye.
    pub undergrowth: Option<&'a UndergrowthBlocks>,
}

/// Trees of a frame: what to select from, and the species' table.
#[derive(Clone, Copy, Debug)]
pub struct FrameTrees<'a> {
    /// The cells.
    pub seeds: &'a SeedFrameCells,
    /// The table.
    pub species: &'a [Species],
    /// The cells, as the shade pass looks them up.
    pub window: TreeCells,
}

/// Maps on their way back at most.
const MAPS_IN_FLIGHT: usize = 3;

/// Where a picture is drawn.
#[derive(Clone, Copy, Debug)]
pub struct FrameTarget<'a> {
    /// The picture, of the size that the view asks for.
    pub view: &'a wgpu::TextureView,
    /// The view's format.
    pub format: wgpu::TextureFormat,
}

/// Everything that draws.
#[derive(Debug)]
pub struct FrameRenderer {
    frame_layout: wgpu::BindGroupLayout,
    hits_layout: wgpu::BindGroupLayout,
    /// Of the shade pass that gives way to trees, once there are any.
    tree_hits_layout: Option<wgpu::BindGroupLayout>,
    view_layout: Option<wgpu::BindGroupLayout>,
    tree_cells: Option<wgpu::Buffer>,
    tree_groups: Option<TreeGroups>,
    sampler: wgpu::Sampler,
    no_minima: wgpu::TextureView,
    buffers: FrameBuffers,
    targets: Option<Targets>,
    groups: Option<Groups>,
    maximum_mip: Option<MaximumMip>,
    minimum_mip: Option<MaximumMip>,
    terrain: Option<Terrain>,
    /// The same for an eye below the surface, once there has been one.
    terrain_below: Option<Terrain>,
    shade: Option<Shade>,
    shade_trees: Option<Shade>,
    trees: Option<Trees>,
    tree_models: Option<TreeModels>,
    timer: Option<PassTimer>,
    select_trees: Option<SelectTrees>,
    seed_belt: Option<Belt<u64>>,
    seed_stats: Option<SeedStats>,
    /// Draws of the last frame's trees.
    tree_draws: u32,
    undergrowth: FrameUndergrowth,
    load_map: Option<LoadMap>,
    belt: Option<Belt<Ticket>>,
    /// The words of the map being taken in.
    words: Vec<u32>,
    count_fetches: bool,
}

/// Bind groups, and what they were made for.
#[derive(Debug)]
struct Groups {
    generation: (u64, u64, [u32; 2]),
    frame: wgpu::BindGroup,
    hits: wgpu::BindGroup,
}

/// Bind groups of the passes that draw trees, and what they were made for.
#[derive(Debug)]
struct TreeGroups {
    made_for: wgpu::Texture,
    hits: wgpu::BindGroup,
    view: wgpu::BindGroup,
}

impl FrameRenderer {
    /// Nothing is compiled yet. `count_fetches`: write texel fetches beside each hit.
    pub fn new(gpu: &GpuContext, count_fetches: bool) -> Self {
        let device = &gpu.device;
        let no_minima = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("no minima"),
            size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        Self {
            frame_layout: crate::passes::frame_layout(device),
            hits_layout: hits_layout(device, false),
            tree_hits_layout: None,
            view_layout: None,
            tree_cells: None,
            tree_groups: None,
            sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("photo"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
            no_minima: no_minima.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..Default::default()
            }),
            buffers: FrameBuffers::new(device),
            targets: None,
            groups: None,
            maximum_mip: None,
            minimum_mip: None,
            terrain: None,
            terrain_below: None,
            shade: None,
            shade_trees: None,
            trees: None,
            tree_models: None,
            timer: gpu.has_timestamps().then(|| PassTimer::new(device, &gpu.queue, PASSES)),
            select_trees: None,
            seed_belt: None,
            seed_stats: None,
            tree_draws: 0,
            undergrowth: FrameUndergrowth::default(),
            load_map: None,
            belt: None,
            words: Vec::new(),
            count_fetches,
        }
    }

    /// Says what the year does to the scene's species.
    pub fn write_seasons(&self, gpu: &GpuContext, rows: &[SeasonRow; ROWS_OF_SEASONS]) {
        gpu.queue.write_buffer(&self.buffers.seasons, 0, bytemuck::cast_slice(rows));
    }

    /// Derives the pyramids of elevation tiles just uploaded.
    pub fn derive_maxima(&mut self, gpu: &GpuContext, arrays: &TileArrays, slots: &[u32]) {
        if slots.is_empty() {
            return;
        }
        let maxima = self.maximum_mip.get_or_insert_with(|| MaximumMip::new(&gpu.device));
        let minima = arrays.minima.as_ref().map(|minima| {
            (self.minimum_mip.get_or_insert_with(|| MaximumMip::of_minima(&gpu.device)), minima)
        });
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for &slot in slots {
            maxima.record(&gpu.device, &mut encoder, &arrays.heights, &arrays.maxima, slot);
            if let Some((pass, minima)) = &minima {
                pass.record(&gpu.device, &mut encoder, &arrays.heights, minima, slot);
            }
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Draws a frame: terrain, the trees' selection, shade, and, with a ticket, the load map of what the terrain pass saw.
    /// Answers whether the map asked for was made: it is not while too many are on their way back.
    #[allow(clippy::too_many_arguments, reason = "what a frame is made of")]
    pub fn draw(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        target: &FrameTarget<'_>,
        plants: FramePlants<'_>,
        ticket: Option<Ticket>,
    ) -> bool {
        self.render(gpu, arrays, view, tables, Some((target, plants)), ticket)
    }

    /// Makes a load map without a picture.
    pub fn survey(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        ticket: Ticket,
    ) -> bool {
        self.render(gpu, arrays, view, tables, None, Some(ticket))
    }

    fn render(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        target: Option<(&FrameTarget<'_>, FramePlants<'_>)>,
        ticket: Option<Ticket>,
    ) -> bool {
        let FramePlants { trees, undergrowth } = target.map(|(_, plants)| plants).unwrap_or_default();
        let target = target.map(|(target, _)| target);
        self.buffers.write(&gpu.device, &gpu.queue, view, tables);
        self.prepare(gpu, arrays, view, tables, target.map(|target| target.format), ticket.is_some());
        self.prepare_trees(gpu, view, tables, trees);
        let drawn_trees = trees.filter(|_| self.tree_models.is_some());
        let draws_plants = self.prepare_plants(gpu, arrays, view, tables, target, drawn_trees, undergrowth);
        let terrain = if goes_below(view, arrays) { &self.terrain_below } else { &self.terrain };
        let (Some(targets), Some(groups), Some(terrain)) = (&self.targets, &self.groups, terrain) else {
            return false;
        };
        if let Some(timer) = &mut self.timer {
            timer.begin();
        }
        let timer = self.timer.as_ref();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        terrain.record(&mut encoder, &groups.frame, targets, timer.and_then(|timer| timer.writes(0)));
        if let (Some(trees), Some(pass)) = (trees, &mut self.select_trees) {
            let times = timer.and_then(|timer| timer.compute_writes(4));
            let (device, queue) = (&gpu.device, &gpu.queue);
            pass.record(device, queue, &mut encoder, &groups.frame, targets, arrays, trees.seeds, times);
            if let Some(belt) = &mut self.seed_belt {
                let checked = trees.seeds.cells.iter().map(|cell| CellRow::new(cell.cell[1]).columns * ROWS);
                // Where too many are on their way back, this frame is not counted.
                belt.schedule(&mut encoder, &[pass.draws()], checked.map(u64::from).sum());
            }
        }
        if let Some(seen) = undergrowth {
            let range = drawn_trees.map_or(0.0, |trees| trees.window.range);
            self.undergrowth.record_selection(gpu, &mut encoder, &groups.frame, seen, range, timer);
        }
        let timestamps = timer.filter(|_| target.is_some()).and_then(|timer| timer.writes(1));
        let depth = targets.depth_view.as_ref().filter(|_| draws_plants);
        match (target, &self.shade, &self.shade_trees, &self.tree_groups) {
            (Some(target), _, Some(shade), Some(tree_groups)) if draws_plants => {
                shade.record(&mut encoder, &groups.frame, &tree_groups.hits, target.view, depth, timestamps);
            }
            (Some(target), Some(shade), ..) => {
                shade.record(&mut encoder, &groups.frame, &groups.hits, target.view, None, timestamps);
            }
            _ => {}
        }
        if let (Some(target), Some(depth), Some(tree_groups), Some(_)) =
            (target, depth, &self.tree_groups, undergrowth)
        {
            let (view, picture, trees_follow) = (&tree_groups.view, target.view, drawn_trees.is_some());
            self.undergrowth.record_drawing(gpu, &mut encoder, view, picture, depth, trees_follow, timer);
        }
        if let (Some(target), Some(depth), Some(tree_groups), Some(pass), Some(selected), Some(models)) =
            (target, depth, &self.tree_groups, &mut self.trees, &self.select_trees, &self.tree_models)
            && drawn_trees.is_some()
        {
            let times = timer.and_then(|timer| timer.writes(5));
            let (device, view, picture) = (&gpu.device, &tree_groups.view, target.view);
            self.tree_draws =
                pass.record(device, &mut encoder, view, selected, models, picture, depth, times);
        }
        let mut made = true;
        if let (Some(ticket), Some(map), Some(belt)) = (ticket, &mut self.load_map, &mut self.belt) {
            made = belt.in_flight() < MAPS_IN_FLIGHT;
            if made {
                let times = [2, 3].map(|pass| timer.and_then(|timer| timer.compute_writes(pass)));
                let (device, queue, stack) = (&gpu.device, &gpu.queue, &ticket.stack.frame);
                map.record(device, queue, &mut encoder, &groups.frame, targets, stack, times);
                made = belt.schedule(&mut encoder, &[map.cells(), map.pixels()], ticket);
            }
        }
        if let Some(timer) = timer {
            timer.resolve(&mut encoder);
        }
        gpu.queue.submit([encoder.finish()]);
        if let Some(timer) = &mut self.timer {
            timer.submitted();
        }
        if let Some(belt) = &mut self.belt {
            belt.submitted();
        }
        if let Some(belt) = &mut self.seed_belt {
            belt.submitted();
        }
        self.undergrowth.submitted();
        made
    }

    /// Makes what the selection of trees needs, where there are any to select from.
    fn prepare_trees(
        &mut self,
        gpu: &GpuContext,
        view: &View,
        tables: &Tables,
        trees: Option<FrameTrees<'_>>,
    ) {
        let Some(trees) = trees else {
            // None are selected any more.
            self.tree_draws = 0;
            self.seed_stats = self.seed_stats.map(|_| SeedStats::default());
            return;
        };
        let variant = select_variant(view, tables);
        if self.select_trees.as_ref().is_some_and(|pass| pass.variant == variant) {
            return;
        }
        let table: Vec<SeedSpecies> = trees.species.iter().map(SeedSpecies::from).collect();
        let pass = SelectTrees::new(&gpu.device, &gpu.queue, &self.frame_layout, variant, &table);
        pass.write_vertex_counts(
            &gpu.queue,
            self.tree_models.as_ref().map_or(&[], |models| models.vertex_counts()),
        );
        self.seed_belt = Some(Belt::new(&gpu.device, pass.draws().size(), MAPS_IN_FLIGHT));
        self.select_trees = Some(pass);
        // Its buffers are new ones.
        self.trees = None;
    }

    /// Takes the models of the scene's species, in the order of their table. Answers whether they can be drawn.
    pub fn take_tree_models(&mut self, gpu: &GpuContext, species: &[Option<&TreeSpecies>]) -> bool {
        self.tree_models = TreeModels::new(&gpu.device, &gpu.queue, species);
        // Bind groups are of the old ones.
        self.trees = None;
        if let (Some(models), Some(pass)) = (&self.tree_models, &self.select_trees) {
            pass.write_vertex_counts(&gpu.queue, models.vertex_counts());
        }
        self.tree_models.is_some()
    }

    /// GPU memory of the models of trees, bytes.
    pub fn tree_model_bytes(&self) -> u64 {
        self.tree_models.as_ref().map_or(0, TreeModels::bytes)
    }

    /// Makes what drawing plants needs, where there are trees with models, or undergrowth; answers whether there are.
    #[allow(clippy::too_many_arguments, reason = "what a frame is made of")]
    fn prepare_plants(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        target: Option<&FrameTarget<'_>>,
        trees: Option<FrameTrees<'_>>,
        undergrowth: Option<&UndergrowthBlocks>,
    ) -> bool {
        if undergrowth.is_none() {
            self.undergrowth.rest();
        }
        let (Some(target), Some(targets)) = (target, &mut self.targets) else { return false };
        if trees.is_none() && undergrowth.is_none() {
            return false;
        }
        let device = &gpu.device;
        targets.with_depth(device, DEPTH_FORMAT);
        let format = target.format;
        let tree_hits_layout = self.tree_hits_layout.get_or_insert_with(|| hits_layout(device, true));
        let view_layout = self.view_layout.get_or_insert_with(|| view_layout(device));
        let variant = ShadeVariant { trees: true, ..shade_variant(format, arrays, view, tables) };
        if self.shade_trees.as_ref().is_none_or(|shade| shade.variant != variant) {
            self.shade_trees = Some(Shade::new(device, &self.frame_layout, tree_hits_layout, variant));
        }
        let variant = TreesVariant { format, season: has(view, FLAG_SEASON), wind: has(view, FLAG_WIND) };
        if trees.is_some() && self.trees.as_ref().is_none_or(|pass| pass.variant != variant) {
            self.trees = Some(Trees::new(device, view_layout, variant));
        }
        if undergrowth.is_some() {
            let select = select_variant(view, tables);
            self.undergrowth.prepare(gpu, &self.frame_layout, view_layout, select, variant);
        }
        let cells = self.tree_cells.get_or_insert_with(|| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("tree cells"),
                size: size_of::<TreeCells>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        });
        let mut window = trees.map_or_else(|| TreeCells::new(&[], [0; 2], 0.0), |trees| trees.window);
        window.turf = undergrowth.map_or(0.0, |seen| seen.frame.range);
        gpu.queue.write_buffer(cells, 0, bytemuck::bytes_of(&window));
        if self.tree_groups.as_ref().is_none_or(|groups| groups.made_for != targets.distance) {
            let texture = wgpu::BindingResource::TextureView;
            let hits =
                [texture(&targets.distance_view), texture(&targets.hit_view), cells.as_entire_binding()];
            let view = [self.buffers.view.as_entire_binding()];
            self.tree_groups = Some(TreeGroups {
                made_for: targets.distance.clone(),
                hits: bind(device, "hits", tree_hits_layout, hits),
                view: bind(device, "view", view_layout, view),
            });
        }
        true
    }

    /// Seeds of the last frame whose counts have come back; `None` where none were ever looked at.
    pub fn seed_stats(&mut self, gpu: &GpuContext) -> Option<SeedStats> {
        if let Some(belt) = &mut self.seed_belt {
            let counted = belt.poll(&gpu.device, |checked, bytes| {
                let draws: Vec<Draw> = bytemuck::pod_collect_to_vec(bytes);
                let selected = draws.last().map_or(0, |draw| draw.instance_count);
                SeedStats { checked, selected: u64::from(selected), draw_calls: 0 }
            });
            self.seed_stats = counted.or(self.seed_stats);
        }
        self.seed_stats.map(|stats| SeedStats { draw_calls: self.tree_draws, ..stats })
    }

    /// Undergrowth of the last frame whose counts have come back; `None` where it had none.
    pub fn undergrowth_stats(&mut self, gpu: &GpuContext) -> Option<UndergrowthStats> {
        self.undergrowth.stats(gpu)
    }

    /// The pass that selects undergrowth, if there ever was any.
    pub fn select_undergrowth(&self) -> Option<&SelectUndergrowth> {
        self.undergrowth.selection()
    }

    /// The pass that selects trees, if any were ever looked at.
    pub fn select_trees(&self) -> Option<&SelectTrees> {
        self.select_trees.as_ref()
    }

    /// Hands out the newest map that has come back, with its cells and pixels. Never waits.
    pub fn poll_map(&mut self, gpu: &GpuContext, take: impl FnOnce(Ticket, &[u32], &[u32])) {
        let (Some(belt), words) = (&mut self.belt, &mut self.words) else { return };
        belt.poll(&gpu.device, |ticket, bytes| {
            words.clear();
            words.extend(bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)));
            let (cells, pixels) = words.split_at(words.len() / 2);
            take(ticket, cells, pixels);
        });
    }

    /// Whether a map is on its way back, or waits to be taken in.
    pub fn has_map(&self) -> bool {
        self.belt.as_ref().is_some_and(|belt| belt.in_flight() > 0)
    }

    /// Makes whatever the frame needs and is not there yet.
    fn prepare(
        &mut self,
        gpu: &GpuContext,
        arrays: &TileArrays,
        view: &View,
        tables: &Tables,
        format: Option<wgpu::TextureFormat>,
        with_map: bool,
    ) {
        let device = &gpu.device;
        if self.targets.as_ref().is_none_or(|targets| targets.size() != view.size) {
            self.targets = Some(Targets::new(device, view.size[0], view.size[1]));
        }
        let below = goes_below(view, arrays);
        let terrain = if below { &mut self.terrain_below } else { &mut self.terrain };
        terrain.get_or_insert_with(|| Terrain::new(device, &self.frame_layout, self.count_fetches, below));
        if let Some(format) = format {
            let variant = shade_variant(format, arrays, view, tables);
            if self.shade.as_ref().is_none_or(|shade| shade.variant != variant) {
                self.shade = Some(Shade::new(device, &self.frame_layout, &self.hits_layout, variant));
            }
        }
        if with_map && self.load_map.is_none() {
            let map = LoadMap::new(device, &self.frame_layout);
            self.belt = Some(Belt::new(device, map.cells().size() + map.pixels().size(), MAPS_IN_FLIGHT));
            self.load_map = Some(map);
        }
        let generation = (arrays.generation, self.buffers.generation, view.size);
        if self.groups.as_ref().is_none_or(|groups| groups.generation != generation)
            && let Some(targets) = &self.targets
        {
            let frame = self.frame_group(device, arrays);
            let hits = hits_group(device, &self.hits_layout, targets);
            self.groups = Some(Groups { generation, frame, hits });
        }
    }

    fn frame_group(&self, device: &wgpu::Device, arrays: &TileArrays) -> wgpu::BindGroup {
        let texture = wgpu::BindingResource::TextureView;
        let resources = [
            self.buffers.view.as_entire_binding(),
            self.buffers.nodes.as_entire_binding(),
            self.buffers.leaves.as_entire_binding(),
            texture(arrays.heights.view()),
            texture(arrays.maxima.view()),
            texture(arrays.surface.view()),
            self.buffers.pages.as_entire_binding(),
            texture(arrays.photo.view()),
            wgpu::BindingResource::Sampler(&self.sampler),
            texture(arrays.minima.as_ref().map_or(&self.no_minima, |minima| minima.view())),
            self.buffers.seasons.as_entire_binding(),
        ];
        bind(device, "frame", &self.frame_layout, resources)
    }

    /// What the last frame's terrain pass wrote.
    pub fn targets(&self) -> Option<&Targets> {
        self.targets.as_ref()
    }

    /// Names of the pipelines that were compiled.
    pub fn pipelines(&self) -> Vec<&'static str> {
        let compiled = [
            ("maximum_mip", self.maximum_mip.is_some()),
            ("terrain", self.terrain.is_some() || self.terrain_below.is_some()),
            ("shade", self.shade.is_some()),
            ("select_trees", self.select_trees.is_some()),
            ("trees", self.trees.is_some()),
            ("select_undergrowth", self.undergrowth.selection().is_some()),
            ("undergrowth", self.undergrowth.is_compiled()),
            ("distance_pyramid", self.load_map.is_some()),
            ("load_map", self.load_map.is_some()),
        ];
        compiled.into_iter().filter_map(|(name, is)| is.then_some(name)).collect()
    }

    /// Median milliseconds by pass, where the adapter can time them.
    pub fn pass_milliseconds(&mut self) -> Vec<(&'static str, f64)> {
        self.timer.as_mut().map(PassTimer::medians).unwrap_or_default()
    }

    /// Forgets the times so far.
    pub fn clear_times(&mut self) {
        if let Some(timer) = &mut self.timer {
            timer.clear();
        }
    }
}
