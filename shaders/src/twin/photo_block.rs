//! Twin of `photo_block.wgsl`: the line through the colours of a block of 4 × 4 texels, and where on it each
//! texel lies. What a format can hold of that is the format's own ([`BlockFormat`]).
//!
//! All arithmetic is that of 32-bit integers, so that both sides agree bit for bit. Ends of the line are kept in
//! sixteenths of a colour step until they are quantised.

use glam::IVec4;

/// Texels of a block: red, green, blue, alpha, 0…255, row by row.
pub type Texels = [IVec4; 16];

/// What a block says: the colours at the ends of its line, and each texel's index between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    /// Colours, 0…255, that the format can hold.
    pub ends: [IVec4; 2],
    /// From 0 at the first end to the last index at the other.
    pub indices: [i32; 16],
    /// Sum of the squared differences of the decoded texels.
    pub error: i32,
}

/// What a compressed format can hold.
pub trait BlockFormat {
    /// The last index that a texel can have.
    fn last_index(texels: &Texels) -> i32;
    /// The second end's share in a texel's colour, of 64.
    fn weight(index: i32, last: i32) -> i32;
    /// The nearest colour that an end can have; `end` in sixteenths, 0…4080.
    fn quantised(end: IVec4) -> IVec4;
    /// The block's 128 bits, lowest first.
    fn packed(line: &Line, last: i32) -> [u32; 4];
}

/// Ends of the line are improved so many times.
const REFINEMENTS: u32 = 2;
/// Steps toward the direction in which the colours differ most.
const AXIS_STEPS: u32 = 4;

/// Rounded to the nearest whole number; `divisor` is positive.
fn divided(value: i32, divisor: i32) -> i32 {
    let half = if value < 0 { -(divisor / 2) } else { divisor / 2 };
    (value + half) / divisor
}

/// Halved until no component needs more than so many bits.
fn shortened(vector: IVec4, bits: u32) -> IVec4 {
    let used = 32 - vector.abs().max_element().cast_unsigned().leading_zeros();
    vector >> used.saturating_sub(bits)
}

/// The direction in which the colours differ most, components of at most 8 bits; zero where all are alike.
fn axis(texels: &Texels, sum: IVec4) -> IVec4 {
    let mut rows = [IVec4::ZERO; 4];
    for texel in texels {
        for (channel, row) in rows.iter_mut().enumerate() {
            *row += 16 * *texel * texel[channel];
        }
    }
    for (channel, row) in rows.iter_mut().enumerate() {
        *row -= sum * sum[channel];
    }
    let diagonal = IVec4::new(rows[0].x, rows[1].y, rows[2].z, rows[3].w);
    let largest = diagonal.max_element();
    let used = 32 - largest.cast_unsigned().leading_zeros();
    let mut vector = rows[0];
    for (channel, row) in rows.iter_mut().enumerate() {
        *row >>= used.saturating_sub(12);
        if diagonal[channel] == largest {
            vector = *row;
        }
    }
    for _ in 0..AXIS_STEPS {
        let shared = shortened(vector, 12);
        vector =
            IVec4::new(rows[0].dot(shared), rows[1].dot(shared), rows[2].dot(shared), rows[3].dot(shared));
    }
    shortened(vector, 8)
}

/// Ends of the line along the axis, sixteenths.
fn first_ends(texels: &Texels) -> [IVec4; 2] {
    let sum: IVec4 = texels.iter().sum();
    let along = axis(texels, sum);
    let length = along.dot(along);
    if length == 0 {
        return [sum; 2];
    }
    let mut least = 0;
    let mut greatest = 0;
    for texel in texels {
        let place = along.dot(16 * *texel - sum);
        least = least.min(place);
        greatest = greatest.max(place);
    }
    [least, greatest].map(|place| {
        let offset = along * place;
        let end = sum
            + IVec4::new(
                divided(offset.x, length),
                divided(offset.y, length),
                divided(offset.z, length),
                divided(offset.w, length),
            );
        end.clamp(IVec4::ZERO, IVec4::splat(4080))
    })
}

/// A colour between two ends.
pub fn between(ends: [IVec4; 2], weight: i32) -> IVec4 {
    (ends[0] * (64 - weight) + ends[1] * weight + 32) >> 6
}

/// The line with those ends, as the format has it.
fn line_of<F: BlockFormat>(texels: &Texels, ends: [IVec4; 2], last: i32) -> Line {
    let ends = ends.map(F::quantised);
    let along = ends[1] - ends[0];
    let length = along.dot(along);
    let mut line = Line { ends, indices: [0; 16], error: 0 };
    for (texel, index) in texels.iter().zip(&mut line.indices) {
        if length > 0 {
            let place = (*texel - ends[0]).dot(along).max(0);
            *index = ((place * last + length / 2) / length).min(last);
        }
        let difference = between(ends, F::weight(*index, last)) - *texel;
        line.error += difference.dot(difference);
    }
    line
}

/// One channel of an end: the numerator and the divisor of its least squares, in sixteenths.
fn solved(numerator: i32, determinant: i32, last: i32) -> i32 {
    let whole = numerator / determinant;
    let rest = numerator - whole * determinant;
    (whole * 16 * last + divided(rest * 16 * last, determinant)).clamp(0, 4080)
}

/// The ends for which the texels, each at its index, are nearest to the line; the line's own where any would do.
fn better_ends(texels: &Texels, line: &Line, last: i32) -> [IVec4; 2] {
    let (mut first, mut both, mut second) = (0, 0, 0);
    let mut first_sum = IVec4::ZERO;
    let mut second_sum = IVec4::ZERO;
    for (texel, index) in texels.iter().zip(line.indices) {
        let other = last - index;
        first += other * other;
        both += other * index;
        second += index * index;
        first_sum += *texel * other;
        second_sum += *texel * index;
    }
    let determinant = first * second - both * both;
    if determinant == 0 {
        return line.ends.map(|end| 16 * end);
    }
    let numerators = [first_sum * second - second_sum * both, second_sum * first - first_sum * both];
    numerators.map(|numerator| {
        IVec4::new(
            solved(numerator.x, determinant, last),
            solved(numerator.y, determinant, last),
            solved(numerator.z, determinant, last),
            solved(numerator.w, determinant, last),
        )
    })
}

/// The block of those texels.
pub fn block<F: BlockFormat>(texels: &Texels) -> [u32; 4] {
    let last = F::last_index(texels);
    let mut line = line_of::<F>(texels, first_ends(texels), last);
    for _ in 0..REFINEMENTS {
        let candidate = line_of::<F>(texels, better_ends(texels, &line, last), last);
        if candidate.error < line.error {
            line = candidate;
        }
    }
    F::packed(&line, last)
}

/// Writes the low `count` bits of `value` from bit `first` of a block on.
pub(crate) fn put(bits: &mut [u32; 4], first: u32, count: u32, value: u32) {
    let word = (first / 32) as usize;
    let within = first % 32;
    bits[word] |= value << within;
    if within + count > 32 {
        bits[word + 1] |= value >> (32 - within);
    }
}

/// A tile's blocks, row by row; `rgba` is `side` × `side` texels, `side` a multiple of 4.
pub fn tile<F: BlockFormat>(rgba: &[u8], side: usize) -> Vec<[u32; 4]> {
    let texel = |x: usize, y: usize| {
        let first = 4 * (y * side + x);
        IVec4::from_array([0, 1, 2, 3].map(|channel| i32::from(rgba[first + channel])))
    };
    let blocks = side / 4;
    (0..blocks * blocks)
        .map(|index| {
            let (x, y) = (4 * (index % blocks), 4 * (index / blocks));
            block::<F>(&std::array::from_fn(|place| texel(x + place % 4, y + place / 4)))
        })
        .collect()
}
