// A corner of a quad that stands on a foot, a fifth as wide as tall.
fn upright(foot: vec3<f32>, height: f32, vertex: u32) -> vec4<f32> {
    let corner = (0x320210u >> (4u * (vertex % 6u))) & 3u;
    let across = select(-0.1, 0.1, corner == 1u || corner == 2u) * height;
    let point = foot + vec3<f32>(across, 0.0, select(0.0, height, corner >= 2u));
    let right = view.right.xyz / dot(view.right.xyz, view.right.xyz);
    let above = view.up.xyz / dot(view.up.xyz, view.up.xyz);
    return vec4<f32>(dot(point, right), dot(point, above), 0.1, dot(point, view.forward.xyz));
}

@fragment
fn plain() -> @location(0) vec4<f32> {
    return vec4<f32>(0.1, 0.3, 0.1, 1.0);
}
