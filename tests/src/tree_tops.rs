//! Tree tops in canopy-height maps, and how they stand to each other: real forests beside Treeline's.

use std::collections::HashMap;
use std::path::Path;
use treeline_core::seeds::place::{POLE_TO_POLE, UNIT_METRES};
use treeline_core::seeds::{Species, Stand, Window, for_each_tree};
use treeline_server::source::geotiff::Raster;
use treeline_server::source::geotiff::image::ValueRule;

/// Nothing lower is a tree's top, metres.
const LEAST_TOP: f32 = 5.0;
/// What is higher is covered, metres.
const COVERED: f32 = 2.0;
/// Plots of closed forest are so wide, metres, and covered to this share.
const PLOT_METRES: f64 = 20.0;
const CLOSED: f64 = 0.6;

/// Heights over the ground, row by row.
#[derive(Clone, Debug)]
pub struct Canopy {
    width: usize,
    /// Metres; voids are 0.
    heights: Vec<f32>,
    /// Length of a cell, metres.
    cell: f64,
}

/// How the tops of a canopy's closed forest stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Spacing {
    /// Closed forest, km².
    pub area_km2: f64,
    /// Tops per km² of it.
    pub per_km2: f64,
    /// Distances from each to its nearest neighbour, metres, ascending.
    pub nearest: Vec<f64>,
}

impl Spacing {
    /// Mean distance to the nearest neighbour, metres.
    pub fn mean(&self) -> f64 {
        self.nearest.iter().sum::<f64>() / self.nearest.len().max(1) as f64
    }

    /// The mean over that of as many points strewn at random (P. J. Clark and F. C. Evans, 1954): 1 at random, up to
    /// 2.15 in a triangular grid.
    pub fn clark_evans(&self) -> f64 {
        2.0 * self.mean() * (self.per_km2 / 1e6).sqrt()
    }

    /// The distance that a share of all does not exceed, metres.
    pub fn quantile(&self, share: f64) -> f64 {
        let last = self.nearest.len().saturating_sub(1);
        self.nearest.get((share * last as f64).round() as usize).copied().unwrap_or(0.0)
    }

    /// Shares of the distances in steps of a width, metres.
    pub fn histogram(&self, step: f64, steps: usize) -> Vec<f64> {
        let mut shares = vec![0.0; steps];
        for distance in &self.nearest {
            if let Some(share) = shares.get_mut((distance / step) as usize) {
                *share += 1.0 / self.nearest.len() as f64;
            }
        }
        shares
    }
}

impl Canopy {
    /// The first band of a GeoTIFF of heights in metres.
    pub fn read(path: &Path, cell: f64) -> anyhow::Result<Self> {
        // Only distances matter: any metric reference system will do, where the file's own is not known.
        let raster = Raster::open(path, Some("EPSG:32633")).map_err(|error| anyhow::anyhow!("{error}"))?;
        let rectangle = raster.full().rect();
        let read = raster.full().read_values(0, rectangle, &ValueRule::RAW);
        let heights = read.map_err(|problem| anyhow::anyhow!("{}: {problem}", path.display()))?;
        let known = |height: &f32| if (-10.0..100.0).contains(height) { *height } else { 0.0 };
        Ok(Self { width: rectangle.width as usize, heights: heights.iter().map(known).collect(), cell })
    }

    /// Closed forest as Treeline grows it, a square of so many metres at 47° north on level ground; and its stems,
    /// as [`Self::tops`] gives tops. `stand` by place in metres.
    pub fn grown(side: usize, seed: u32, stand: impl Fn(f64, f64) -> Stand) -> (Self, Vec<[f64; 2]>) {
        let table = Species::built_in();
        let latitude = 47.0_f64;
        let unit_x = UNIT_METRES * latitude.to_radians().cos();
        let north = ((90.0 - latitude) / 180.0 * POLE_TO_POLE as f64) as i64;
        let window = Window {
            west: 1_000_000_000,
            north,
            east: 1_000_000_000 + (side as f64 / unit_x) as i64,
            south: north + (side as f64 / UNIT_METRES) as i64,
        };
        let place =
            |x: i64, y: i64| [(x - window.west) as f64 * unit_x, (y - window.north) as f64 * UNIT_METRES];
        let mut heights = vec![0.0_f32; side * side];
        let mut stems = Vec::new();
        let stand_at = |x: i64, y: i64| {
            let [x, y] = place(x, y);
            stand(x, y)
        };
        for_each_tree(&window, seed, &table, stand_at, |tree| {
            let [x, y] = place(tree.x, tree.y);
            let (species, height) = (&table[tree.species], tree.height_metres());
            stems.push([x, y]);
            let reach = f64::from(species.crown_radius(height));
            let cells =
                |at: f64| (at - reach).floor().max(0.0) as usize..((at + reach).ceil() as usize).min(side);
            for row in cells(y) {
                for column in cells(x) {
                    let apart = (column as f64 + 0.5 - x).hypot(row as f64 + 0.5 - y) as f32;
                    let cell = &mut heights[row * side + column];
                    *cell = cell.max(species.crown_surface(height, apart).unwrap_or(0.0));
                }
            }
        });
        (Self { width: side, heights, cell: 1.0 }, stems)
    }

    fn rows(&self) -> usize {
        self.heights.len() / self.width
    }

    /// Places (metres east and south) of all cells that none within half a window (metres) rises above.
    pub fn tops(&self, window: f64) -> Vec<[f64; 2]> {
        let reach = (0.5 * (window / self.cell - 1.0)).round() as usize;
        let (width, rows) = (self.width, self.rows());
        let mut tops = Vec::new();
        for (index, &height) in self.heights.iter().enumerate().filter(|(_, height)| **height >= LEAST_TOP) {
            let (column, row) = (index % width, index / width);
            let near = |at: usize, count: usize| at.saturating_sub(reach)..(at + reach + 1).min(count);
            let higher = near(row, rows).any(|row| {
                near(column, width).any(|column| {
                    let other = row * width + column;
                    // Of equals the first is the top.
                    self.heights[other] > height || (self.heights[other] == height && other < index)
                })
            });
            if !higher {
                tops.push([(column as f64 + 0.5) * self.cell, (row as f64 + 0.5) * self.cell]);
            }
        }
        tops
    }

    /// How tops stand in plots of closed forest; those in a plot at the border count only as neighbours.
    pub fn spacing(&self, tops: &[[f64; 2]]) -> Spacing {
        let cells = (PLOT_METRES / self.cell).round() as usize;
        let (columns, rows) = (self.width / cells, self.rows() / cells);
        let is_closed = |column: usize, row: usize| {
            let inner = (1..columns.saturating_sub(1)).contains(&column)
                && (1..rows.saturating_sub(1)).contains(&row);
            let covered = (row * cells..(row + 1) * cells)
                .flat_map(|row| (column * cells..(column + 1) * cells).map(move |column| (row, column)))
                .filter(|&(row, column)| inner && self.heights[row * self.width + column] > COVERED);
            covered.count() as f64 >= CLOSED * (cells * cells) as f64
        };
        let closed: Vec<bool> =
            (0..columns * rows).map(|plot| is_closed(plot % columns, plot / columns)).collect();
        let side = cells as f64 * self.cell;
        let plot_of = |top: &[f64; 2]| top.map(|metres| (metres / side) as usize);
        let mut by_plot: HashMap<[usize; 2], Vec<[f64; 2]>> = HashMap::new();
        for top in tops {
            by_plot.entry(plot_of(top)).or_default().push(*top);
        }
        let mut nearest = Vec::new();
        for top in tops {
            let [column, row] = plot_of(top);
            if column >= columns || row >= rows || !closed[row * columns + column] {
                continue;
            }
            let around = (row - 1..=row + 1)
                .flat_map(|row| (column - 1..=column + 1).map(move |column| [column, row]));
            let others = around.filter_map(|plot| by_plot.get(&plot)).flatten().filter(|other| *other != top);
            let least = others
                .map(|other| (other[0] - top[0]).hypot(other[1] - top[1]))
                .fold(f64::INFINITY, f64::min);
            nearest.push(least.min(2.0 * side));
        }
        nearest.sort_by(f64::total_cmp);
        let area_km2 = closed.iter().filter(|closed| **closed).count() as f64 * side * side / 1e6;
        Spacing { area_km2, per_km2: nearest.len() as f64 / area_km2.max(1e-9), nearest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cones on a grid, so many metres apart.
    fn planted(step: usize) -> Canopy {
        let height = |x: usize, y: usize| {
            let apart = |at: usize| (at % step) as f32 - (step / 2) as f32;
            20.0 - apart(x).hypot(apart(y))
        };
        Canopy { width: 120, heights: (0..120 * 120).map(|i| height(i % 120, i / 120)).collect(), cell: 1.0 }
    }

    #[test]
    fn planted_trees_are_found_where_they_stand() {
        let canopy = planted(5);
        let tops = canopy.tops(3.0);
        assert_eq!(tops.len(), 576);
        assert!(tops.contains(&[2.5, 2.5]));
        let spacing = canopy.spacing(&tops);
        assert_eq!((spacing.per_km2, spacing.mean(), spacing.quantile(0.5)), (40_000.0, 5.0, 5.0));
        assert!((spacing.clark_evans() - 2.0).abs() < 1e-9, "the index of a square grid");
        assert!((spacing.histogram(0.5, 20)[10] - 1.0).abs() < 1e-9);
    }

    #[test]
    fn open_ground_is_no_closed_forest() {
        let mut canopy = planted(6);
        for (index, height) in canopy.heights.iter_mut().enumerate() {
            if index % 120 >= 60 {
                *height = 0.0;
            }
        }
        let tops = canopy.tops(3.0);
        let spacing = canopy.spacing(&tops);
        // Plots at the border are left out.
        assert!((spacing.area_km2 - 8.0 * 400.0 / 1e6).abs() < 1e-9, "{}", spacing.area_km2);
    }

    #[test]
    fn closed_spruce_is_as_dense_as_real_forest() {
        let (canopy, stems) = Canopy::grown(300, 1, |_, _| Stand { species: 1, closure: 255, height: 0 });
        let per_km2 = stems.len() as f64 / 0.09;
        // As dense as the densest; so small a wood may be off by some in a hundred.
        assert!((11_000.0..21_500.0).contains(&per_km2), "{per_km2}");
        let spacing = canopy.spacing(&stems);
        assert!(spacing.clark_evans() > 1.2);
        // Not every tree shows in the canopy.
        let tops = canopy.spacing(&canopy.tops(3.0));
        assert!(tops.per_km2 < spacing.per_km2 && tops.per_km2 > 0.5 * spacing.per_km2);
    }
}
