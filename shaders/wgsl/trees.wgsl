// Trees one by one: quads pulled from storage buffers, one indirect draw a species and level. What is the same for a
// whole tree comes with its instance (`select_trees`).

override ENCODE_SRGB: bool = false;
override WITH_SEASON: bool = false;
override WITH_WIND: bool = false;

// Distance that a depth of 1 stands for, metres: depths are this over the distance along the view axis.
const NEAR_METRES: f32 = 0.1;
// Texels with at least this alpha are there.
const ALPHA_TEST: f32 = 0.5;
// How far a hash moves that limit where texels are smaller than pixels.
const ALPHA_HASH: f32 = 0.45;
// How much of a tree's green is the ground's around it, the rest its species' own.
const GROUND_TINT: f32 = 0.95;
// Leaves shade each other within what a model can show of them: share of their light that is left.
const LEAF_LIGHT: f32 = 0.78;
// Share of a bare crown's leafy texels that stand for twigs.
const BARE_TWIGS: f32 = 0.22;
// How often a tree of 10 m swings in the period of what sways, and a twig at least.
const STEM_SWINGS: f32 = 150.0;
const TWIG_SWINGS: f32 = 360.0;
// How far wind of 1 m/s bends a stem, of its height, and twigs, of their distance from the axis; both at most.
const STEM_BEND: f32 = 0.00042;
const MOST_STEM_BEND: f32 = 0.06;
const TWIG_BEND: f32 = 0.0055;
const MOST_TWIG_BEND: f32 = 0.06;
const SNOW_WHITE: vec3<f32> = vec3<f32>(0.80, 0.83, 0.88);

// What a draw knows of its model.
struct TreeDraw {
    // Bin, first corner of the level, quads of a variant, variants.
    model: vec4<u32>,
    // Mean reflectance of its foliage; w: layer of the atlas.
    foliage: vec4<f32>,
}

@group(1) @binding(0) var<uniform> seed_frame: SeedFrame;
@group(1) @binding(1) var<storage, read> counts: array<u32>;
@group(1) @binding(2) var<storage, read> instances: array<TreeInstance>;
// Four words a corner (`core::tree_model`).
@group(1) @binding(3) var<storage, read> corners: array<vec4<u32>>;
@group(1) @binding(4) var atlas: texture_2d_array<f32>;
@group(1) @binding(5) var atlas_sampler: sampler;
@group(2) @binding(0) var<uniform> tree_draw: TreeDraw;

struct TreeVertex {
    @builtin(position) position: vec4<f32>,
    @location(0) uv: vec2<f32>,
    @location(1) normal: vec3<f32>,
    // Place in the crown, share of foliage, and what the wind makes of its light.
    @location(2) shade: vec3<f32>,
    @location(3) point: vec3<f32>,
    // Shares of the pixels between which it is drawn, of 255; hash; instance.
    @location(4) @interpolate(flat) look: vec4<u32>,
}

// Where the wind moves a point of a tree, in heights of the tree: `offset` is the point, `own` the tree's hash (0…1),
// `twigs` whether its quads are twigs rather than whole parts of the crown.
fn swayed(offset: vec3<f32>, height: f32, gust: f32, own: f32, quad: u32, twigs: bool) -> vec3<f32> {
    let push = view.wind.z * mix(0.3, 1.0, gust);
    // Whole swings in a period, so that it has no seam; tall trees swing slowly.
    let swings = round(STEM_SWINGS * pow(10.0 / max(height, 1.0), 0.6));
    let turn = 6.2831853 * fract((view.wind.w * swings) + own);
    let across = 6.2831853 * fract((view.wind.w * (swings + 17.0)) + (own * 7.0));
    let rise = saturate(offset.z);
    let bend = min(STEM_BEND * push * push, MOST_STEM_BEND) * rise * rise;
    let along = view.wind.xy;
    var moved = bend * (((0.55 + (0.45 * sin(turn))) * along) + (0.28 * sin(across) * vec2<f32>(-along.y, along.x)));
    var lift = 0.0;
    if twigs {
        let hash = fract((f32(quad) * 0.61803399) + own);
        let flutter = sin(6.2831853 * fract((view.wind.w * (TWIG_SWINGS + floor(240.0 * hash))) + (hash * 13.0)));
        let reach = length(offset.xy) * min(TWIG_BEND * push, MOST_TWIG_BEND);
        moved += reach * flutter * along;
        lift = 0.6 * reach * flutter;
    }
    return vec3<f32>(moved, lift);
}

fn turned(v: vec2<f32>, turn: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(v.x * turn.x - v.y * turn.y, v.x * turn.y + v.y * turn.x);
}

@vertex
fn tree_vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) index: u32) -> TreeVertex {
    let place = counts[tree_draw.model.x * seed_frame.cells * seed_frame.blocks] + index;
    let foot_height = instances[place].foot_height;
    let look = instances[place].look;
    let quad = vertex / 6u;
    // Two triangles: 0-1-2 and 0-2-3.
    let corner = (0x320210u >> (4u * (vertex % 6u))) & 3u;
    let variant = ((look >> 8u) & 0xffu) % tree_draw.model.w;
    let words = corners[tree_draw.model.y + ((variant * tree_draw.model.z + quad) * 4u) + corner];
    let angle = f32(look & 0xffu) * (6.2831853 / 256.0);
    let turn = vec2<f32>(cos(angle), sin(angle));
    let level = turned(unpack2x16snorm(words.x), turn);
    let up = normalize(vec3<f32>(foot_height.xy / view.sun.w, 1.0));
    var offset = vec3<f32>(level, 0.0) + unpack2x16snorm(words.y).x * up;
    var shimmer = 1.0;
    if WITH_WIND {
        let gust = gust_at(foot_height.xy);
        shimmer = leaf_shimmer(gust);
        let own = f32((look >> 8u) & 0xffu) / 256.0;
        // Only the first level's quads are twigs.
        let twigs = (tree_draw.model.x % TREE_LEVELS) == 0u;
        offset += swayed(vec3<f32>(level, unpack2x16snorm(words.y).x), foot_height.w, gust, own, quad, twigs);
    }
    let point = foot_height.xyz + foot_height.w * offset;
    let own_normal = unpack4x8snorm(words.w).xyz;

    var out: TreeVertex;
    let right = view.right.xyz / dot(view.right.xyz, view.right.xyz);
    let above = view.up.xyz / dot(view.up.xyz, view.up.xyz);
    out.position = vec4<f32>(dot(point, right), dot(point, above), NEAR_METRES, dot(point, view.forward.xyz));
    out.uv = unpack2x16unorm(words.z);
    out.normal = vec3<f32>(turned(own_normal.xy, turn), own_normal.z);
    out.shade = vec3<f32>(unpack4x8unorm(words.y).zw, shimmer);
    out.point = point;
    out.look = vec4<u32>((look >> 16u) & 0xffu, look >> 24u, (look >> 8u) & 0xffu, place);
    return out;
}

// Interleaved gradient noise (J. Jimenez), 0…1: the pixels that two levels of a tree share out between them.
fn pixel_share(position: vec2<f32>) -> f32 {
    return fract(52.9829189 * fract(dot(position, vec2<f32>(0.06711056, 0.00583715))));
}

// A hash of the texel at a scale, 0…1: it stands still on the tree.
fn texel_hash(texel: vec2<f32>, scale: f32, tree: u32) -> f32 {
    let cell = vec2<u32>(texel / scale);
    var bits = (cell.x * 0x9e3779b1u) ^ (cell.y * 0x85ebca77u) ^ (tree * 0xc2b2ae3du);
    bits = (bits ^ (bits >> 15u)) * 0x2c1b3c6du;
    bits = (bits ^ (bits >> 12u)) * 0x297a2d39u;
    return f32((bits ^ (bits >> 15u)) >> 8u) * 5.9604645e-8;
}

@fragment
fn tree_fragment(in: TreeVertex) -> @location(0) vec4<f32> {
    let texture = textureSample(atlas, atlas_sampler, in.uv, i32(tree_draw.foliage.w));
    let texel = in.uv * vec2<f32>(textureDimensions(atlas));
    let width = max(length(dpdx(texel)), length(dpdy(texel)));
    let share = pixel_share(in.position.xy) * 255.0;
    // Where a texel is smaller than a pixel its alpha is a share of it: a hash decides, at the scale of the pixel.
    let smaller = saturate(log2(max(width, 1e-3)) * 0.5);
    let scale = exp2(round(log2(max(width, 1.0))));
    let limit = ALPHA_TEST + ALPHA_HASH * smaller * (texel_hash(texel, scale, in.look.z) - 0.5);
    if texture.a < limit || share < f32(in.look.x) || share >= f32(in.look.y) + select(0.0, 1.0, in.look.y == 255u) {
        discard;
    }
    var leaves = 1.0;
    var snow = 0.0;
    if WITH_SEASON {
        let bits = instances[in.look.w].height_units;
        leaves = f32((bits >> 17u) & 127u) / 127.0;
        snow = f32(bits >> 24u) / 255.0;
        // Where leaves are gone, twigs are left: what is painted brown, and some of the rest.
        let woody = smoothstep(-0.01, 0.02, texture.r - texture.g);
        let kept = max(mix(BARE_TWIGS, 1.0, leaves), woody);
        if in.shade.y > 0.5 && texel_hash(texel, max(scale, 2.0), in.look.z + 7u) > kept {
            discard;
        }
    }
    let colour = instances[in.look.w].colour;
    let sun = instances[in.look.w].sun;
    let sky = instances[in.look.w].sky;
    let air = instances[in.look.w].air;
    let foot = instances[in.look.w].foot_height.xyz;
    let up = normalize(vec3<f32>(foot.xy / view.sun.w, 1.0));
    let direction = normalize(in.point);
    let lit = Lit(in.normal, up, direction, sun.rgb, sky.rgb, colour.w, sky.w);
    let tint = mix(vec3<f32>(1.0), colour.rgb / max(tree_draw.foliage.rgb, vec3<f32>(1e-3)), GROUND_TINT);
    // As the canopy of the heights has it: bright at the tops, dark between them.
    let place = in.shade.x * (0.35 + 0.65 * in.shade.x);
    var leaf_colour = LEAF_LIGHT * texture.rgb * tint * in.shade.z;
    var wood_colour = texture.rgb;
    if WITH_SEASON {
        // Snow lies on what looks up.
        let upward = dot(in.normal, up) + 0.35 * (texel_hash(texel, max(scale, 6.0), in.look.z) - 0.5);
        let lies = snow * smoothstep(0.25, 1.0, upward) * mix(0.25, 1.0, place);
        leaf_colour = mix(leaf_colour, SNOW_WHITE, lies * mix(0.35, 0.6, leaves));
        wood_colour = mix(wood_colour, SNOW_WHITE, 0.6 * lies);
    }
    let leaf = canopy_radiance(lit, leaf_colour, crown_light(lit, place));
    // Wood stands in the crown's shade.
    let wood = bare_radiance(lit, wood_colour) * mix(mix(0.2, 0.8, place), 0.9, 1.0 - leaves);
    let radiance = mix(wood, leaf, in.shade.y) * air.w + air.rgb;
    let display = tone_mapped(radiance * sun.w);
    if ENCODE_SRGB {
        return vec4<f32>(srgb_encoded(display), 1.0);
    }
    return vec4<f32>(display, 1.0);
}
