// Group 0 (binding 10 is `season.wgsl`'s): the frame's, the same for every pass that looks at the scene (docs/ARCHITECTURE.md).

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> nodes: array<u32>;
@group(0) @binding(2) var<storage, read> leaves: array<Leaf>;
@group(0) @binding(3) var heights: texture_2d_array<f32>;
@group(0) @binding(4) var maxima: texture_2d_array<f32>;
@group(0) @binding(5) var surface: texture_2d_array<u32>;
@group(0) @binding(6) var<storage, read> texture_pages: array<TexturePage>;
@group(0) @binding(7) var photo: texture_2d_array<f32>;
@group(0) @binding(8) var photo_sampler: sampler;
@group(0) @binding(9) var minima: texture_2d_array<f32>;
