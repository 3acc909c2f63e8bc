// The line through the colours of a block of 4 × 4 texels, and where on it each texel lies. The format's own
// module gives `last_index`, `weight_of`, `quantised` and `pack`. Twin: `twin/photo_block.rs`.
//
// All arithmetic is that of 32-bit integers, so that both sides agree bit for bit. Ends of the line are kept in
// sixteenths of a colour step until they are quantised.

// The photo as it was uploaded, sRGB values as they are.
@group(0) @binding(0) var source: texture_2d<f32>;
// Blocks, row by row; a row begins BLOCKS_IN_ROW after the last one.
@group(0) @binding(1) var<storage, read_write> blocks: array<vec4<u32>>;

// Rows of a buffer that is copied to a texture are multiples of 256 bytes.
override BLOCKS_IN_ROW: u32 = 144u;

const REFINEMENTS: u32 = 2u;
const AXIS_STEPS: u32 = 4u;

// Colours at the ends, 0…255, and the sum of the squared differences of the decoded texels.
struct Line {
    first: vec4<i32>,
    second: vec4<i32>,
    error: i32,
    indices: array<i32, 16>,
}

var<private> texels: array<vec4<i32>, 16>;
var<private> last: i32;
// The block being written.
var<private> bits: array<u32, 4>;

// Rounded to the nearest whole number; `divisor` is positive.
fn divided(value: i32, divisor: i32) -> i32 {
    let half = divisor / 2;
    return (value + select(half, -half, value < 0)) / divisor;
}

fn largest_of(vector: vec4<i32>) -> i32 {
    return max(max(vector.x, vector.y), max(vector.z, vector.w));
}

// Bits that a number of 0 or more needs.
fn bits_of(value: i32) -> u32 {
    return 32u - countLeadingZeros(u32(value));
}

// Halved until no component needs more than so many bits.
fn shortened(vector: vec4<i32>, count: u32) -> vec4<i32> {
    let used = bits_of(largest_of(abs(vector)));
    return vector >> vec4<u32>(max(used, count) - count);
}

// The direction in which the colours differ most, components of at most 8 bits; zero where all are alike.
fn axis(sum: vec4<i32>) -> vec4<i32> {
    var rows = array<vec4<i32>, 4>();
    for (var index = 0u; index < 16u; index++) {
        let texel = texels[index];
        rows[0] += 16 * texel * texel.x;
        rows[1] += 16 * texel * texel.y;
        rows[2] += 16 * texel * texel.z;
        rows[3] += 16 * texel * texel.w;
    }
    rows[0] -= sum * sum.x;
    rows[1] -= sum * sum.y;
    rows[2] -= sum * sum.z;
    rows[3] -= sum * sum.w;
    let diagonal = vec4<i32>(rows[0].x, rows[1].y, rows[2].z, rows[3].w);
    let largest = largest_of(diagonal);
    let shift = vec4<u32>(max(bits_of(largest), 12u) - 12u);
    var vector = rows[0];
    for (var channel = 0u; channel < 4u; channel++) {
        rows[channel] = rows[channel] >> shift;
        if diagonal[channel] == largest {
            vector = rows[channel];
        }
    }
    for (var count = 0u; count < AXIS_STEPS; count++) {
        let shared_axis = shortened(vector, 12u);
        vector = vec4<i32>(
            dot(rows[0], shared_axis),
            dot(rows[1], shared_axis),
            dot(rows[2], shared_axis),
            dot(rows[3], shared_axis),
        );
    }
    return shortened(vector, 8u);
}

// A place along the axis as a colour, sixteenths.
fn end_at(sum: vec4<i32>, along: vec4<i32>, place: i32, length_squared: i32) -> vec4<i32> {
    let offset = along * place;
    let end = sum + vec4<i32>(
        divided(offset.x, length_squared),
        divided(offset.y, length_squared),
        divided(offset.z, length_squared),
        divided(offset.w, length_squared),
    );
    return clamp(end, vec4<i32>(0), vec4<i32>(4080));
}

// The line with those ends, as the format has it.
fn line_of(first_end: vec4<i32>, second_end: vec4<i32>) -> Line {
    var line: Line;
    line.first = quantised(first_end);
    line.second = quantised(second_end);
    line.error = 0;
    let along = line.second - line.first;
    let length_squared = dot(along, along);
    for (var texel = 0u; texel < 16u; texel++) {
        var index = 0;
        if length_squared > 0 {
            let place = max(dot(texels[texel] - line.first, along), 0);
            index = min((place * last + length_squared / 2) / length_squared, last);
        }
        line.indices[texel] = index;
        let weight = weight_of(index);
        let decoded = (line.first * (64 - weight) + line.second * weight + 32) >> vec4<u32>(6u);
        let difference = decoded - texels[texel];
        line.error += dot(difference, difference);
    }
    return line;
}

fn first_line() -> Line {
    var sum = vec4<i32>(0);
    for (var index = 0u; index < 16u; index++) {
        sum += texels[index];
    }
    let along = axis(sum);
    let length_squared = dot(along, along);
    if length_squared == 0 {
        return line_of(sum, sum);
    }
    var least = 0;
    var greatest = 0;
    for (var index = 0u; index < 16u; index++) {
        let place = dot(along, 16 * texels[index] - sum);
        least = min(least, place);
        greatest = max(greatest, place);
    }
    return line_of(end_at(sum, along, least, length_squared), end_at(sum, along, greatest, length_squared));
}

// One channel of an end: the numerator and the divisor of its least squares, in sixteenths.
fn solved(numerator: i32, determinant: i32) -> i32 {
    let whole = numerator / determinant;
    let rest = numerator - whole * determinant;
    return clamp(whole * 16 * last + divided(rest * 16 * last, determinant), 0, 4080);
}

fn solved_end(numerator: vec4<i32>, determinant: i32) -> vec4<i32> {
    return vec4<i32>(
        solved(numerator.x, determinant),
        solved(numerator.y, determinant),
        solved(numerator.z, determinant),
        solved(numerator.w, determinant),
    );
}

// The line to which the texels, each at its index of `line`, are nearest; the same where any would do.
fn better_line(line: Line) -> Line {
    var first = 0;
    var both = 0;
    var second = 0;
    var first_sum = vec4<i32>(0);
    var second_sum = vec4<i32>(0);
    for (var texel = 0u; texel < 16u; texel++) {
        let index = line.indices[texel];
        let other = last - index;
        first += other * other;
        both += other * index;
        second += index * index;
        first_sum += texels[texel] * other;
        second_sum += texels[texel] * index;
    }
    let determinant = first * second - both * both;
    if determinant == 0 {
        return line;
    }
    return line_of(
        solved_end(first_sum * second - second_sum * both, determinant),
        solved_end(second_sum * first - first_sum * both, determinant),
    );
}

// Writes the low `count` bits of `value` from bit `first` of the block on.
fn put(first: u32, count: u32, value: u32) {
    let word = first / 32u;
    let within = first % 32u;
    bits[word] |= value << within;
    if within + count > 32u {
        bits[word + 1u] |= value >> (32u - within);
    }
}

@compute @workgroup_size(8, 8)
fn compress_photo(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(source) / 4u;
    if any(id.xy >= size) {
        return;
    }
    for (var texel = 0u; texel < 16u; texel++) {
        let colour = textureLoad(source, 4u * id.xy + vec2<u32>(texel % 4u, texel / 4u), 0);
        texels[texel] = vec4<i32>(round(255.0 * colour));
    }
    last = last_index();
    var line = first_line();
    for (var count = 0u; count < REFINEMENTS; count++) {
        let candidate = better_line(line);
        if candidate.error < line.error {
            line = candidate;
        }
    }
    pack(line);
    blocks[id.y * BLOCKS_IN_ROW + id.x] = vec4<u32>(bits[0], bits[1], bits[2], bits[3]);
}
