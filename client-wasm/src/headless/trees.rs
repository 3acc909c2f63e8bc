//! The trees of the last frame, read back: for `treeline-shot --trees` and for tests. Places, anchors and heights are
//! the integers that decided them.

use super::HeadlessError;
use super::capture::{read_texture, wait};
use crate::engine::Engine;
use crate::gpu::GpuContext;
use crate::passes::select_trees::SelectTrees;
use treeline_core::codec::elevation::quantum_metres;
use treeline_core::seeds::pattern::{CELL_UNITS, CellRow, candidate, pattern_of_cell};
use treeline_core::seeds::place::{latitude_from_y, longitude_from_x};
use treeline_core::seeds::species::HEIGHT_UNITS;
use treeline_shaders::trees::{Draw, LEVELS, PRIMARY, TreeInstance};

/// What a depth of 1 stands for, metres (`trees.wgsl`).
const NEAR_METRES: f32 = 0.1;

/// A tree that is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct SelectedTree {
    /// Degrees.
    pub longitude: f64,
    /// Degrees.
    pub latitude: f64,
    /// Height of the ground under it, metres.
    pub ground_metres: f64,
    /// Its own, metres.
    pub height_metres: f64,
    /// Code of its species in land cover.
    pub species: u8,
    /// Level of detail, 0 the finest; of two between which it fades the finer.
    pub level: u8,
}

/// The arguments of a selection's draws, read back: one a bin, and one that counts every tree once.
pub fn draws(gpu: &GpuContext, pass: &SelectTrees) -> Result<Vec<Draw>, HeadlessError> {
    read_buffer(gpu, pass.draws())
}

/// The instances of each bin, species by species and level by level.
pub fn instances(engine: &Engine) -> Result<Vec<Vec<TreeInstance>>, HeadlessError> {
    let (Some(pass), Some(seeds)) = (engine.select_trees(), engine.drawn_seeds()) else {
        return Ok(Vec::new());
    };
    let draws = draws(engine.gpu(), pass)?;
    let counts: Vec<u32> = read_buffer(engine.gpu(), pass.counts())?;
    let all: Vec<TreeInstance> = read_buffer(engine.gpu(), pass.instances())?;
    let blocks = (seeds.frame.cells * seeds.frame.blocks) as usize;
    let bins = (0..pass.bins() as usize).map(|bin| {
        let first = counts[bin * blocks] as usize;
        all[first..first + draws[bin].instance_count as usize].to_vec()
    });
    Ok(bins.collect())
}

/// The trees of the last frame: by species, level, cell and seed, each once.
pub fn selected_trees(engine: &Engine) -> Result<Vec<SelectedTree>, HeadlessError> {
    let (Some(field), Some(seeds)) = (engine.tree_field(), engine.drawn_seeds()) else {
        return Ok(Vec::new());
    };
    let quantum = quantum_metres(field.anchor_level());
    let scene_seed = engine.scene().seed;
    let mut trees = Vec::new();
    for (bin, instances) in (0_u32..).zip(instances(engine)?) {
        for tree in instances.iter().filter(|tree| tree.height_units & PRIMARY != 0) {
            let Some(cell) = seeds.cells.get((tree.seed >> 10) as usize) else { continue };
            let [column, row] = cell.cell;
            let pattern = pattern_of_cell(column, row, scene_seed);
            let columns = CellRow::new(row).columns;
            let place = candidate(pattern, columns, tree.seed >> 5 & 31, tree.seed & 31);
            let units = |cell: u32, within: u32| f64::from(cell * CELL_UNITS + within);
            trees.push(SelectedTree {
                longitude: longitude_from_x(units(column, place.x)),
                latitude: latitude_from_y(units(row, place.y)),
                ground_metres: f64::from(tree.ground) * quantum,
                height_metres: f64::from(tree.height_units & (PRIMARY - 1)) / f64::from(HEIGHT_UNITS),
                species: field.species[(bin / LEVELS) as usize].code,
                level: (bin % LEVELS) as u8,
            });
        }
    }
    Ok(trees)
}

/// Distance of what the last frame's picture shows where trees are drawn, metres along the view axis, infinite for
/// the sky; `None` where none were drawn. A canopy that trees stand in is written 10 m farther
/// (`shade_trees.wgsl`).
pub fn drawn_depths(engine: &Engine) -> Result<Option<Vec<f32>>, HeadlessError> {
    let drawn = engine.drawn_seeds().is_some_and(|seeds| seeds.frame.cells > 0);
    let depth = engine.targets().and_then(|targets| targets.depth.as_ref());
    let Some(depth) = depth.filter(|_| drawn) else { return Ok(None) };
    let words: Vec<f32> = bytemuck::pod_collect_to_vec(&read_texture(engine.gpu(), depth)?);
    Ok(Some(words.into_iter().map(|depth| NEAR_METRES / depth).collect()))
}

/// All of a buffer. Waits for the GPU.
pub(super) fn read_buffer<T: bytemuck::Pod>(
    gpu: &GpuContext,
    source: &wgpu::Buffer,
) -> Result<Vec<T>, HeadlessError> {
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: source.size(),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(source, 0, &staging, 0, source.size());
    gpu.queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |_| {});
    wait(gpu)?;
    let range = staging.get_mapped_range(..).map_err(|error| HeadlessError::Gpu(error.to_string()))?;
    Ok(bytemuck::pod_collect_to_vec(&range))
}
