// The year in the canopy of the heights, whose nodes know their species.

// Leaves of the canopy about a point, with snow on them: mean colour of crowns with and without leaves, and the share
// of the leaves that are there. `summer`: their colour in summer; `height`: the ground's, metres.
fn seasonal_canopy(cell: vec2<f32>, slot: u32, height: f32, summer: vec3<f32>) -> vec4<f32> {
    let base = floor(cell);
    let part = cell - base;
    var sum = vec4<f32>(0.0);
    var weights = 0.0;
    for (var corner = 0; corner < 4; corner++) {
        let offset = vec2<i32>(corner & 1, corner >> 1u);
        let node = node_surface(vec2<i32>(base) + offset, slot);
        let code = node.x >> SPECIES_SHIFT;
        let shares = select(vec2<f32>(1.0) - part, part, offset == vec2<i32>(1));
        let weight = (shares.x * shares.y) * select(0.0, 1.0, node.y > 0u || code != 0u);
        let row = season_row(code);
        let foliage = foliage_at(row, height);
        let leaf = seasonal_leaf(row, foliage, summer);
        sum += weight * vec4<f32>(mix(season_rows[row].bare.rgb, leaf, foliage.leaves), foliage.leaves);
        weights += weight;
    }
    if weights <= 0.0 {
        return vec4<f32>(summer, 1.0);
    }
    return sum / weights;
}

// What lies under a canopy: litter, or snow.
fn winter_floor(leaf: vec3<f32>, snow: f32) -> vec3<f32> {
    let litter = mix(vec3<f32>(0.105, 0.082, 0.052), leaf, 0.3);
    return mix(litter, SNOW_WHITE, 0.9 * snow);
}
