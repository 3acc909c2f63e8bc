// What a whole tree has of colour, light and air: once an instance, not once a pixel.

// As `TreeInstance` has them.
struct TreeLights {
    colour: vec4<f32>,
    sun: vec4<f32>,
    sky: vec4<f32>,
    air: vec4<f32>,
    // Leaves from bit 17 on, of 127; snow from bit 24 on, of 255.
    season: u32,
}

// Width of ground whose photo says what colour a tree has, metres.
const TREE_PHOTO_METRES: f32 = 5.0;

fn lights_of(cell: SeedCell, tree: SeedTree, placed: PlacedTree, away: f32) -> TreeLights {
    let unit = grid_of_place((cell.cell << vec2<u32>(SEED_CELL_BITS)) + tree.units);
    let index = leaf_index_at(unit);
    var colour = vec3<f32>(0.035, 0.06, 0.022);
    let sun_cosine = dot(placed.up, view.sun.xyz);
    let top = f32(tree.ground) * seed_frame.anchor_quantum + placed.height;
    var sun_seen = smoothstep(-0.012, 0.006, sun_cosine);
    var sky_seen = 1.0;
    if WITH_PHOTO {
        let sample = photo_patch(unit, max(away * view.right.w, TREE_PHOTO_METRES));
        colour = mix(colour, reflectance_of_photo(sample.rgb / max(sample.a, 1e-3)), sample.a);
    }
    // No two trees are of one green.
    let tone = f32(tree.bits >> 24u) / 255.0;
    colour = forest_reflectance(colour) * (0.86 + 0.28 * tone);
    var season = 127u << 17u;
    if WITH_SEASON {
        let row = season_row(tree.species + 1u);
        let foot = top - placed.height;
        // No two trees keep the same days.
        let foliage = foliage_at(row, foot + 260.0 * (tone - 0.5));
        let leaf = seasonal_leaf(row, foliage, colour);
        colour = mix(season_rows[row].bare.rgb, leaf, smoothstep(0.0, 0.3, foliage.leaves));
        let snow = snow_at(foot - 40.0);
        season = (u32(round(127.0 * foliage.leaves)) << 17u) | (u32(round(255.0 * snow)) << 24u);
    }
    if WITH_SHADOWS && index != EMPTY {
        let units_per_cell = f32(leaves[index].grid_side) / vec2<f32>(leaves[index].cells);
        // From just above its own crown: what stands in the light is other than itself.
        let ground = Ground(MapPlace(unit, vec2<f32>(0.5)), index, top + 0.5, units_per_cell / leaves[index].cell_metres, 0.0, 0.5);
        if sun_seen > 0.0 {
            sun_seen *= sun_visibility(ground, vec3<f32>(view.sun.x, -view.sun.y, view.sun.z), tone);
        }
        sky_seen = sky_visibility(ground, 12.0, 160.0);
    }
    if WITH_CLOUDS {
        sun_seen *= cloud_light(placed.foot, top);
    }
    let centre = placed.foot + (0.5 * placed.height * placed.up);
    let air = air_along(centre / max(away, 1e-3), 0.0, away, 4u);
    return TreeLights(
        vec4<f32>(colour, sun_seen),
        vec4<f32>(sun_transmittance(top, sun_cosine), exposure()),
        vec4<f32>(sky_ambient(sun_cosine), sky_seen),
        vec4<f32>(air.inscatter, luminance(air.transmittance)),
        season,
    );
}
