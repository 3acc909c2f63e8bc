//! Twin of `maximum_mip.wgsl`: the pyramid of extremes over a tile's cells.

use crate::layout::VOID_HEIGHT;

/// Mips of extremes, finest first; mip k has a texel for 2^(k+1) × 2^(k+1) cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Pyramid {
    /// Each mip's columns, rows and texels, row-major.
    pub mips: Vec<(u32, u32, Vec<f32>)>,
}

/// Columns and rows of mip 0 for so many cells: powers of two, so that each mip is half of the last.
pub fn base_size(cells: [u32; 2]) -> [u32; 2] {
    cells.map(|count| count.div_ceil(2).max(1).next_power_of_two())
}

/// Number of mips down to 1 × 1.
pub fn level_count(cells: [u32; 2]) -> u32 {
    let [columns, rows] = base_size(cells);
    columns.max(rows).ilog2() + 1
}

impl Pyramid {
    /// Builds the maxima (or minima) of a tile of `width` samples a row with `border` samples round its nodes.
    pub fn new(heights: &[f32], width: u32, height: u32, border: u32, minimum: bool) -> Self {
        let greater = |a: f32, b: f32| if minimum { a.min(b) } else { a.max(b) };
        let nothing = if minimum { -VOID_HEIGHT } else { VOID_HEIGHT };
        let cells = [width, height].map(|side| side.saturating_sub(2 * border + 1));
        let cell_extreme = |x: u32, y: u32| {
            if x >= cells[0] || y >= cells[1] {
                return nothing;
            }
            let first = ((y + border) * width + x + border) as usize;
            let below = first + width as usize;
            let nodes = [heights[first], heights[first + 1], heights[below], heights[below + 1]];
            if nodes.iter().any(|&node| node <= VOID_HEIGHT) {
                return nothing;
            }
            greater(greater(nodes[0], nodes[1]), greater(nodes[2], nodes[3]))
        };
        let [columns, rows] = base_size(cells);
        let mut base = Vec::with_capacity((columns * rows) as usize);
        for y in 0..rows {
            for x in 0..columns {
                let north = greater(cell_extreme(2 * x, 2 * y), cell_extreme(2 * x + 1, 2 * y));
                let south = greater(cell_extreme(2 * x, 2 * y + 1), cell_extreme(2 * x + 1, 2 * y + 1));
                base.push(greater(north, south));
            }
        }
        let mut mips = vec![(columns, rows, base)];
        while let Some((columns, rows, last)) = mips.last()
            && columns.max(rows) > &1
        {
            let size = [(columns / 2).max(1), (rows / 2).max(1)];
            let at = |x: u32, y: u32| last[(y.min(rows - 1) * columns + x.min(columns - 1)) as usize];
            let mut texels = Vec::with_capacity((size[0] * size[1]) as usize);
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let north = greater(at(2 * x, 2 * y), at(2 * x + 1, 2 * y));
                    let south = greater(at(2 * x, 2 * y + 1), at(2 * x + 1, 2 * y + 1));
                    texels.push(greater(north, south));
                }
            }
            mips.push((size[0], size[1], texels));
        }
        Self { mips }
    }

    /// A texel.
    pub fn at(&self, mip: u32, x: i32, y: i32) -> f32 {
        let (columns, rows, texels) = &self.mips[mip as usize];
        assert!(
            (0..*columns as i32).contains(&x) && (0..*rows as i32).contains(&y),
            "mip {mip} has no {x}, {y}"
        );
        texels[(y as u32 * columns + x as u32) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_mip_bounds_the_cells_below_it(
            columns in 1_u32..40, rows in 1_u32..40, border in 0_u32..2, minimum in proptest::bool::ANY, seed in 0_u32..1000,
        ) {
            let (width, height) = (columns + 1 + 2 * border, rows + 1 + 2 * border);
            let value = |index: u32| {
                let x = (index + seed).wrapping_mul(2_654_435_761) >> 8;
                if x.is_multiple_of(11) { VOID_HEIGHT } else { (x % 1000) as f32 }
            };
            let heights: Vec<f32> = (0..width * height).map(value).collect();
            let pyramid = Pyramid::new(&heights, width, height, border, minimum);
            prop_assert_eq!(pyramid.mips.len() as u32, level_count([columns, rows]));
            for (mip, (mip_columns, mip_rows, _)) in pyramid.mips.iter().enumerate() {
                for y in 0..*mip_rows {
                    for x in 0..*mip_columns {
                        let side = 2_u32 << mip;
                        let mut extreme = if minimum { -VOID_HEIGHT } else { VOID_HEIGHT };
                        for v in y * side..((y + 1) * side).min(rows) {
                            for u in x * side..((x + 1) * side).min(columns) {
                                let nodes = [(0, 0), (1, 0), (0, 1), (1, 1)]
                                    .map(|(a, b)| heights[((v + b + border) * width + u + a + border) as usize]);
                                if nodes.iter().all(|&node| node > VOID_HEIGHT) {
                                    extreme = nodes.into_iter().fold(extreme, if minimum { f32::min } else { f32::max });
                                }
                            }
                        }
                        prop_assert_eq!(pyramid.at(mip as u32, x as i32, y as i32), extreme);
                    }
                }
            }
        }
    }
}
