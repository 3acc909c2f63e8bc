// The undergrowth: models pulled from storage buffers, one indexed indirect draw a kind of member, two of grass. Light and colour
// come with the plants (`select_undergrowth`).

override ENCODE_SRGB: bool = false;
override WITH_SEASON: bool = false;
override WITH_WIND: bool = false;

// Distance that a depth of 1 stands for, metres, as in `trees.wgsl`.
const NEAR_METRES: f32 = 0.1;
// As `core::plant_model` has them.
const EXTENT: f32 = 3.0;
const WIDEST: f32 = 0.125;
const BRIGHTEST: f32 = 2.0;
const PART_PETAL: u32 = 1u;
const PART_PLAIN: u32 = 2u;
const KIND_STONE: u32 = 4u;
const KIND_WOOD: u32 = 5u;
const NEAR_BIT: u32 = 0x80000000u;
// Blades narrower than this many pixels to either side are widened, up to so many times.
const LEAST_HALF_PIXELS: f32 = 0.55;
const MOST_WIDENING: f32 = 4.0;
// How far wind of 1 m/s bends what stands, of its size, and at most; swings in the period of what sways.
const HERB_BEND: f32 = 0.028;
const MOST_HERB_BEND: f32 = 0.3;
const HERB_SWINGS: f32 = 290.0;
const SNOW_WHITE: vec3<f32> = vec3<f32>(0.80, 0.83, 0.88);
const PETALS: array<vec3<f32>, 8> = array<vec3<f32>, 8>(
    vec3<f32>(0.72, 0.71, 0.66), vec3<f32>(0.70, 0.50, 0.04), vec3<f32>(0.26, 0.13, 0.46), vec3<f32>(0.62, 0.60, 0.42),
    vec3<f32>(0.50, 0.13, 0.28), vec3<f32>(0.14, 0.19, 0.50), vec3<f32>(0.74, 0.56, 0.08), vec3<f32>(0.70, 0.70, 0.68),
);

// What a draw knows of its model.
struct PlantDraw {
    // Bin, first corner in the list of all, corners of a variant, variants.
    model: vec4<u32>,
}

@group(1) @binding(0) var<uniform> undergrowth: UndergrowthFrame;
@group(1) @binding(1) var<storage, read> counts: array<u32>;
@group(1) @binding(2) var<storage, read> plants: array<Plant>;
// Four words a corner (`core::plant_model`).
@group(1) @binding(3) var<storage, read> corners: array<vec4<u32>>;
@group(1) @binding(4) var<storage, read> drawn: UndergrowthDraws;
@group(2) @binding(0) var<uniform> plant_draw: PlantDraw;

struct PlantVertex {
    @builtin(position) position: vec4<f32>,
    @location(0) colour: vec3<f32>,
    @location(1) normal: vec3<f32>,
    // Light that the plant leaves; shares of the sun and of the sky.
    @location(2) light: vec3<f32>,
    @location(3) point: vec3<f32>,
    // Share of it that is leaf; snow; what the wind makes of its light.
    @location(4) matter: vec3<f32>,
    @location(5) ground: vec3<f32>,
}

fn turned(v: vec2<f32>, turn: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(v.x * turn.x - v.y * turn.y, v.x * turn.y + v.y * turn.x);
}

@vertex
fn plant_vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) index: u32) -> PlantVertex {
    let bin = plant_draw.model.x;
    let plant = plants[counts[bin * undergrowth.blocks] + index];
    let own = (plant.look >> 8u) & 0xffu;
    let variant = own % plant_draw.model.w;
    let words = corners[plant_draw.model.y + (variant * plant_draw.model.z) + vertex];
    let size = plant.foot_size.w;
    let angle = f32(plant.look & 0xffu) * (6.2831853 / 256.0);
    let turn = vec2<f32>(cos(angle), sin(angle));
    let ground = unpack4x8snorm(plant.ground);
    let away = max(length(plant.foot_size.xyz), 0.1);

    let level = turned(unpack2x16snorm(words.x) * EXTENT, turn);
    // Blades that only near tufts have grow from the ground.
    let come = select(1.0, smoothstep(0.0, 0.5, 1.0 - (away / NEAR_GRASS)), (words.w & NEAR_BIT) != 0u);
    let rise = come * unpack2x16snorm(words.y).x * EXTENT;
    let side = come * unpack4x8snorm(words.y).z * WIDEST;
    let turns = unpack4x8unorm(words.z).w * 6.2831853;
    let across = turned(vec2<f32>(cos(turns), sin(turns)), turn);
    // Never so thin that it comes and goes.
    let least = LEAST_HALF_PIXELS * away * view.right.w / max(size, 1e-3);
    let wide = side * clamp(least / max(abs(side), 1e-4), 1.0, MOST_WIDENING);
    var offset = vec3<f32>(level + (wide * across), rise);
    // The model's level is the slope.
    let lies = bin == KIND_STONE || bin == KIND_WOOD;
    let slope = ground.xy / max(ground.z, 0.3);
    offset.z -= dot(offset.xy, slope);
    var shimmer = 1.0;
    if WITH_WIND {
        if !lies {
            let gust = gust_at(plant.foot_size.xy);
            shimmer = leaf_shimmer(gust);
            let push = view.wind.z * mix(0.3, 1.0, gust);
            let swing = sin(6.2831853 * fract((view.wind.w * (HERB_SWINGS + floor(f32(own) * 0.4))) + (f32(own) / 64.0)));
            let bend = min(HERB_BEND * push, MOST_HERB_BEND) * (0.6 + (0.4 * swing)) * rise * rise;
            offset += vec3<f32>(bend * view.wind.xy, -0.5 * bend * bend);
        }
    }
    let point = plant.foot_size.xyz + (size * offset);

    let tone = unpack4x8unorm(words.w).xyz * BRIGHTEST;
    let part = (words.w & ~NEAR_BIT) >> 24u;
    let own_colour = unpack4x8unorm(plant.colour);
    var colour = own_colour.rgb * own_colour.rgb * tone;
    var petals = PETALS;
    if part == PART_PETAL {
        colour = petals[plant.look >> 28u] * tone;
    } else if part == PART_PLAIN {
        colour = tone;
    }
    let corner_normal = unpack4x8snorm(words.z).xyz;

    var out: PlantVertex;
    let right = view.right.xyz / dot(view.right.xyz, view.right.xyz);
    let above = view.up.xyz / dot(view.up.xyz, view.up.xyz);
    out.position = vec4<f32>(dot(point, right), dot(point, above), NEAR_METRES, dot(point, view.forward.xyz));
    out.colour = colour;
    out.normal = vec3<f32>(turned(corner_normal.xy, turn), corner_normal.z);
    out.light = vec3<f32>(unpack4x8unorm(words.y).w, own_colour.w, ground.w);
    out.point = point;
    out.matter = vec3<f32>(select(1.0, 0.0, lies), f32(plant.size >> 24u) / 255.0, shimmer);
    out.ground = ground.xyz;
    return out;
}

@fragment
fn plant_fragment(in: PlantVertex) -> @location(0) vec4<f32> {
    let direction = normalize(in.point);
    let up = vec3<f32>(0.0, 0.0, 1.0);
    let ground = normalize(in.ground);
    // Leaves are seen from both sides, and lit as the meadow is that they are part of.
    var normal = normalize(in.normal);
    normal = select(normal, -normal, in.matter.x > 0.5 && dot(normal, direction) > 0.0);
    let leafy = normalize((0.7 * normal) + (1.3 * ground));
    let shade = in.light.x;
    let lit = Lit(select(normal, leafy, in.matter.x > 0.5), up, direction, drawn.light.sun.rgb, drawn.light.sky.rgb, in.light.y, in.light.z);
    var colour = in.colour * in.matter.z;
    if WITH_SEASON {
        let lies = in.matter.y * smoothstep(0.2, 0.7, dot(normal, up));
        colour = mix(colour, SNOW_WHITE, 0.9 * lies);
    }
    var radiance: vec3<f32>;
    if in.matter.x > 0.5 {
        let facing = saturate((dot(leafy, view.sun.xyz) + 0.25) / 1.25);
        let crown = CrownLight(facing * mix(0.45, 1.15, shade), shade * 1.6, mix(0.5, 1.2, shade));
        radiance = canopy_radiance(lit, colour, crown);
    } else {
        radiance = bare_radiance(lit, colour) * mix(0.45, 1.0, shade);
    }
    let far = length(in.point) * 0.01;
    radiance = (radiance * pow(drawn.light.air.w, far)) + (drawn.light.air.rgb * far);
    let display = tone_mapped(radiance * drawn.light.sun.w);
    if ENCODE_SRGB {
        return vec4<f32>(srgb_encoded(display), 1.0);
    }
    return vec4<f32>(display, 1.0);
}
