// Light and colour of the undergrowth: light once a metaseed, colour once a plant.

// What each kind is coloured by itself, and how much of that is left beside the ground's colour.
const KIND_COLOURS: array<vec4<f32>, 6> = array<vec4<f32>, 6>(
    vec4<f32>(0.092, 0.132, 0.040, 0.36),
    vec4<f32>(0.082, 0.125, 0.034, 0.5),
    vec4<f32>(0.070, 0.125, 0.028, 0.75),
    vec4<f32>(0.060, 0.088, 0.026, 0.6),
    vec4<f32>(0.200, 0.190, 0.170, 0.65),
    vec4<f32>(0.125, 0.100, 0.075, 0.8),
);
const MOSS: vec3<f32> = vec3<f32>(0.060, 0.085, 0.022);
// Bracken and bilberries in autumn.
const RUST: vec3<f32> = vec3<f32>(0.190, 0.105, 0.036);
const BERRY_RED: vec3<f32> = vec3<f32>(0.150, 0.045, 0.028);
const LITTER: vec3<f32> = vec3<f32>(0.085, 0.070, 0.042);
// Width of ground whose photo says what colour a plant has, metres.
const PLANT_PHOTO_METRES: f32 = 0.7;
// Under a canopy, as `shade_trees` has it: shares of sky and sun that are left at least.
const WOOD_SKY: f32 = 0.35;
const WOOD_SUN: f32 = 0.16;

struct SiteLight {
    normal: vec3<f32>,
    // Shares of the sun, but for what the ground hides, and of the sky.
    sun: f32,
    sky: f32,
    // How much of a wood it stands in, 0…1.
    wooded: f32,
    // Snow on what looks up.
    snow: f32,
}

// As the marches over the ground want it.
fn ground_at(leaf: u32, unit: vec2<u32>, height: f32) -> Ground {
    let units = f32(leaves[leaf].grid_side) / vec2<f32>(leaves[leaf].cells);
    return Ground(MapPlace(unit, vec2<f32>(0.5)), leaf, height + 0.25, units / leaves[leaf].cell_metres, 4.0, 0.5);
}

// Share of the sun's disc that a plant sees.
fn plant_sun(member: Member, placed: Placed, light: SiteLight) -> f32 {
    var sun = light.sun;
    if WITH_SHADOWS {
        if sun > 0.0 {
            let dither = f32(member.bits & 0xffu) / 255.0;
            sun *= sun_visibility(ground_at(placed.leaf, placed.unit, placed.height), vec3<f32>(view.sun.x, -view.sun.y, view.sun.z), dither);
        }
    }
    // Under a canopy specks of sun wander over the ground.
    let speck = f32((member.bits >> 4u) & 0xffu) / 255.0;
    let specks = WOOD_SUN * light.wooded * light.sun * (0.6 + (3.0 * smoothstep(0.7, 0.95, speck)));
    return max(sun, specks);
}

fn site_light(block: UndergrowthBlock, site: Site, normal: vec3<f32>) -> SiteLight {
    let unit = unit_of(block, vec2<i32>(site.seed.place));
    var light: SiteLight;
    light.normal = normal;
    light.wooded = saturate(1.5 * f32(site.crowns) / 9.0);
    let height = drawn_ground(site.leaf, unit).x;
    light.sun = smoothstep(-0.012, 0.006, view.sun.z);
    light.sky = 1.0;
    light.snow = 0.0;
    if WITH_SHADOWS {
        light.sky = sky_visibility(ground_at(site.leaf, unit, height), 8.0, 60.0);
    }
    if WITH_CLOUDS {
        light.sun *= cloud_light(site.foot, height);
    }
    light.sky = max(light.sky, WOOD_SKY * light.wooded);
    if WITH_SEASON {
        light.snow = snow_on(height, light.normal, vec3<f32>(0.0, 0.0, 1.0));
    }
    return light;
}

fn plant_colour(site: Site, member: Member, placed: Placed, light: SiteLight) -> vec3<f32> {
    var colours = KIND_COLOURS;
    var base = vec3<f32>(0.105, 0.115, 0.062);
    if WITH_PHOTO {
        let footprint = max(placed.away * view.right.w, PLANT_PHOTO_METRES);
        let sample = photo_colour(placed.unit, vec2<f32>(0.5), footprint, vec2<f32>(0.0), 1.0);
        base = mix(base, reflectance_of_photo(sample.rgb / max(sample.a, 1e-3)), sample.a);
    }
    base = mix(base, LITTER, 0.3 * light.wooded);
    var own = colours[member.kind];
    let tone = f32((member.bits >> 24u) & 0xffu) / 255.0;
    // Green leaves are as bright as the ground about them: a dry meadow has pale ones.
    let bright = clamp(luminance(base) / 0.1, 0.6, 1.6);
    var colour = own.rgb;
    if member.kind <= KIND_SHRUB {
        colour *= mix(1.0, bright, 0.5);
    }
    if member.kind >= KIND_STONE {
        let moss = light.wooded * (0.25 + (0.65 * tone));
        colour = mix(colour, MOSS, moss);
    }
    if WITH_SEASON {
        let herbs = foliage_at(GROUND_SEASON, placed.height);
        let withered = max(herbs.turned, 1.0 - herbs.leaves);
        if member.kind == KIND_FERN {
            colour = mix(colour, RUST * (0.8 + (0.4 * tone)), withered);
        } else if member.kind == KIND_SHRUB {
            colour = mix(colour, mix(RUST, BERRY_RED, tone), 0.85 * withered);
        } else if member.kind <= KIND_FLOWER {
            colour = seasonal_ground(colour, placed.height);
        }
        base = seasonal_ground(base, placed.height);
    }
    return mix(base, colour, own.a) * (0.84 + (0.32 * tone));
}

fn plant_of(site: Site, member: Member, placed: Placed, light: SiteLight, seed: u32) -> Plant {
    let size = f32(member.size) * SIZE_METRES;
    let colour = plant_colour(site, member, placed, light);
    let sun = plant_sun(member, placed, light);
    let petal = select(site.seed.theme, (member.bits >> 13u) & 7u, (member.bits & 3u) == 3u);
    var plant: Plant;
    plant.foot_size = vec4<f32>(placed.foot, size * placed.grown);
    plant.look = member.rotation | ((member.bits >> 16u) & 0xff00u) | (member.kind << 16u) | (site.cluster.community << 24u) | (petal << 28u);
    plant.seed = seed;
    let place = vec2<u32>(member.place + vec2<i32>(8192));
    plant.place = place.x | (place.y << 16u);
    plant.size = member.size | (u32(round(255.0 * placed.grown)) << 16u) | (u32(round(255.0 * light.snow)) << 24u);
    plant.colour = pack4x8unorm(vec4<f32>(sqrt(colour), sun));
    plant.ground = pack4x8snorm(vec4<f32>(light.normal, light.sky));
    plant.padding = vec2<u32>(0u);
    return plant;
}
