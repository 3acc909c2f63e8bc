// Trees without a selection, for comparison: every seed is drawn, and holes are thrown out of the picture by each of
// their vertices. Appended to the `select_trees` pass.

struct SeedVertex {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) colour: vec3<f32>,
}

@vertex
fn every_seed(@builtin(vertex_index) vertex: u32, @builtin(instance_index) index: u32) -> SeedVertex {
    let block = index / BLOCK_SEEDS;
    let group = vec3<u32>(block % seed_frame.blocks, block / seed_frame.blocks, 0u);
    let seed = seed_of(group, index % BLOCK_SEEDS);
    let cell = seed_cells[seed.cell];
    let word = decide_seed(cell, seed.sub_cell);
    if word == 0u {
        return SeedVertex(vec4<f32>(2.0, 2.0, 2.0, 1.0), vec3<f32>(0.0));
    }
    let tree = tree_of_seed(cell, seed.sub_cell);
    let placed = placed_tree(cell, tree);
    return SeedVertex(upright(placed.foot, placed.height, vertex), vec3<f32>(0.1, 0.3, 0.1));
}
