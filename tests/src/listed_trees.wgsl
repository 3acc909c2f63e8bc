// Trees of the selection's list, one a quad as in `naive_seeds.wgsl`.

@group(1) @binding(0) var<storage, read> instances: array<TreeInstance>;
@group(1) @binding(1) var<storage, read> counts: array<u32>;
// Word of `counts` at which the bin begins.
@group(1) @binding(2) var<uniform> bin_word: vec4<u32>;

@vertex
fn listed_tree(@builtin(vertex_index) vertex: u32, @builtin(instance_index) index: u32) -> @builtin(position) vec4<f32> {
    let foot_height = instances[counts[bin_word.x] + index].foot_height;
    return upright(foot_height.xyz, foot_height.w, vertex);
}
