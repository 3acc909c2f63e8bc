// Four mips of the pyramid of distances from the one before them; `mark_pixels` makes the first four itself.

// The mip to read.
override FROM: u32 = 3u;

var<workgroup> joined: array<vec4<f32>, 64>;

@compute @workgroup_size(8, 8)
fn distance_pyramid(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    let first = 2u * id.xy;
    let north = join_distances(load_distances(FROM, first), load_distances(FROM, first + vec2<u32>(1u, 0u)));
    let south = join_distances(
        load_distances(FROM, first + vec2<u32>(0u, 1u)),
        load_distances(FROM, first + vec2<u32>(1u, 1u)),
    );
    joined[index] = join_distances(north, south);
    store_distances(FROM + 1u, id.xy, joined[index]);
    for (var step = 1u; step <= 3u; step++) {
        workgroupBarrier();
        let stride = 1u << step;
        if all((local.xy & vec2<u32>(stride - 1u)) == vec2<u32>(0u)) {
            let half = stride >> 1u;
            let east = join_distances(joined[index], joined[index + half]);
            let below = index + (8u * half);
            joined[index] = join_distances(east, join_distances(joined[below], joined[below + half]));
            store_distances(FROM + 1u + step, id.xy >> vec2<u32>(step), joined[index]);
        }
    }
}
