//! Crowns: the trees of `core::seeds` on the terrain, and the highest of them at each sample.
//!
//! A crown's height depends on the tree and the sample's place alone, in operations that round the
//! same everywhere, so that two tiles that share a sample share its bits.

use super::RecipeError;
use super::encode::own;
use super::stands::Stands;
use crate::scene::Scene;
use crate::source::SampleGrid;
use treeline_core::codec::elevation::{VOID, lattice_from_metres};
use treeline_core::codec::land_cover::AnchorNodes;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::seeds::anchor;
use treeline_core::seeds::place::{UNIT_METRES, latitude_from_y};
use treeline_core::seeds::species::widest_crown_metres;
use treeline_core::seeds::{CrownShape, Tree, Window, for_each_tree};

/// Nothing grows beyond this latitude; keeps the reach of crowns in units of longitude finite.
const BARE_LATITUDE: f64 = 86.5;

/// Terrain on the nodes of the anchor level.
pub struct Anchors {
    window: LatticeWindow,
    /// As sampled, metres.
    metres: Vec<f32>,
}

impl Anchors {
    /// The window of nodes that the trees of a window of places stand on.
    pub fn window(level: u8, places: &Window) -> LatticeWindow {
        anchor::window(level, places)
    }

    /// Samples the terrain on a window of nodes.
    pub fn read(scene: &Scene, window: LatticeWindow) -> Result<Self, RecipeError> {
        let mut metres = vec![f32::NAN; window.len()];
        scene.height.sample(&SampleGrid::Lattice(window), &mut metres)?;
        Ok(Self { window, metres })
    }

    /// Height of the ground under a place, metres: on the patch of the four nodes around it. `None` beside a void.
    pub fn height(&self, x: i64, y: i64) -> Option<f32> {
        let bits = anchor::cell_bits(self.window.level);
        let cell = 1_i64 << bits;
        let column = ((x >> bits) - self.window.first_column) as usize;
        let row = ((y >> bits) - self.window.first_row) as usize;
        let width = self.window.width as usize;
        let first = row * width + column;
        let nodes = [first, first + 1, first + width, first + width + 1]
            .map(|index| lattice_from_metres(f64::from(self.metres[index]), self.window.level));
        let ground = anchor::between(nodes, [(x & (cell - 1)) as u32, (y & (cell - 1)) as u32], bits);
        (ground != VOID).then(|| anchor::metres(ground, self.window.level))
    }

    /// The nodes on their level's lattice.
    pub fn into_nodes(self) -> AnchorNodes {
        let LatticeWindow { level, width, height, .. } = self.window;
        AnchorNodes { level, width, height, quanta: own::lattice(&self.metres, level) }
    }

    /// The samples of a window of nodes of the same level that lies within.
    pub fn crop(&self, inner: &LatticeWindow) -> Option<Vec<f32>> {
        let column = usize::try_from(inner.first_column - self.window.first_column).ok()?;
        let row = usize::try_from(inner.first_row - self.window.first_row).ok()?;
        let (width, height) = (self.window.width as usize, self.window.height as usize);
        let same = inner.level == self.window.level && inner.registration == Registration::Node;
        let fits = column + inner.width as usize <= width && row + inner.height as usize <= height;
        (same && fits).then(|| {
            self.metres
                .chunks_exact(width)
                .skip(row)
                .take(inner.height as usize)
                .flat_map(|line| &line[column..column + inner.width as usize])
                .copied()
                .collect()
        })
    }
}

/// The places whose trees may reach a rectangle of samples, given in units ([`UNIT_METRES`]).
pub fn window_of_trees(scene: &Scene, west: f64, north: f64, east: f64, south: f64) -> Window {
    let reach = f64::from(widest_crown_metres(&scene.species)) / UNIT_METRES + 1.0;
    let latitude = latitude_from_y(north).abs().max(latitude_from_y(south).abs()).min(BARE_LATITUDE);
    let reach_x = reach / latitude.to_radians().cos();
    Window {
        west: (west - reach_x).floor() as i64,
        north: (north - reach).floor() as i64,
        east: (east + reach_x).ceil() as i64 + 1,
        south: (south + reach).ceil() as i64 + 1,
    }
}

/// A tree on its anchor.
#[derive(Clone, Copy, Debug)]
pub struct Crown {
    /// Place, units, x as its window counts it.
    x: i64,
    y: i64,
    /// Metres per unit eastward at the tree.
    metres_per_unit_x: f32,
    radius: f32,
    height: f32,
    /// Height of the crown's rim above the anchor.
    base: f32,
    anchor: f32,
    shape: CrownShape,
    /// Code of its species.
    species: u8,
}

impl Crown {
    /// Height of the crown's surface at a square of the distance over the radius's, metres.
    fn surface(&self, squared: f32) -> f32 {
        self.anchor + (self.base + (self.height - self.base) * self.shape.surface(squared))
    }
}

/// The trees whose feet lie in a window.
pub fn trees(scene: &Scene, window: &Window, stands: &Stands) -> Vec<Tree> {
    let mut trees = Vec::new();
    if stands.any_species() {
        let stand_at = |x, y| stands.stand(x, y);
        for_each_tree(window, scene.seed, &scene.species, stand_at, |tree| trees.push(tree));
    }
    trees
}

/// Puts trees on the ground; one beside a void has none to stand on and is left out.
pub fn crowns(scene: &Scene, trees: &[Tree], anchors: &Anchors) -> Vec<Crown> {
    trees
        .iter()
        .filter_map(|tree| {
            let species = &scene.species[tree.species];
            let height = tree.height_metres();
            let latitude = latitude_from_y(tree.y as f64).to_radians();
            Some(Crown {
                x: tree.x,
                y: tree.y,
                metres_per_unit_x: (UNIT_METRES * latitude.cos()) as f32,
                radius: species.crown_radius(height),
                height,
                base: species.definition.crown_base_ratio as f32 * height,
                anchor: anchors.height(tree.x, tree.y)?,
                shape: species.definition.crown,
                species: species.code,
            })
        })
        .collect()
}

/// Samples in rows and columns, as crowns see them: units from a whole origin, exact in f32 for a
/// lattice, so that differences are the same from every window.
pub struct Rows {
    origin_x: i64,
    origin_y: i64,
    xs: Vec<f32>,
    ys: Vec<f32>,
}

impl Rows {
    /// From units, both ascending.
    pub fn new(xs: &[f64], ys: &[f64]) -> Self {
        let origin = |values: &[f64]| values.first().map_or(0, |value| value.floor() as i64);
        let (origin_x, origin_y) = (origin(xs), origin(ys));
        let relative =
            |values: &[f64], origin: i64| values.iter().map(|value| (value - origin as f64) as f32).collect();
        Self { origin_x, origin_y, xs: relative(xs, origin_x), ys: relative(ys, origin_y) }
    }

    /// Raises `out` (row-major) to the crowns' surfaces, and notes in `kinds` the species of the highest: as wide
    /// as a height, so that both are chosen by one comparison.
    pub fn splat(&self, crowns: &[Crown], out: &mut [f32], kinds: &mut [u32]) {
        for crown in crowns {
            match crown.shape {
                CrownShape::Cone => self.splat_one(crown, out, kinds, |q| 1.0 - q.sqrt()),
                CrownShape::Paraboloid => self.splat_one(crown, out, kinds, |q| 1.0 - q),
                CrownShape::Dome => self.splat_one(crown, out, kinds, |q| (1.0 - q).max(0.0).sqrt()),
            }
        }
    }

    /// One crown; `surface` is [`CrownShape::surface`] of its shape, known to the compiler.
    #[inline(always)]
    fn splat_one(&self, crown: &Crown, out: &mut [f32], kinds: &mut [u32], surface: impl Fn(f32) -> f32) {
        let unit_y = UNIT_METRES as f32;
        let unit_x = crown.metres_per_unit_x;
        let (x, y) = ((crown.x - self.origin_x) as f32, (crown.y - self.origin_y) as f32);
        let within = |values: &[f32], at: f32, reach: f32| {
            values.partition_point(|&value| value < at - reach)
                ..values.partition_point(|&value| value <= at + reach)
        };
        // A little more than the radius: the exact test is on the squares below.
        let columns = within(&self.xs, x, crown.radius / unit_x * 1.001);
        let rows = within(&self.ys, y, crown.radius / unit_y * 1.001);
        let inverse = 1.0 / (crown.radius * crown.radius);
        let length = crown.height - crown.base;
        let xs = &self.xs[columns.clone()];
        for row in rows {
            let dy = (self.ys[row] - y) * unit_y;
            let dy_squared = dy * dy;
            let first = row * self.xs.len() + columns.start;
            let nodes = out[first..first + xs.len()].iter_mut().zip(&mut kinds[first..first + xs.len()]);
            for ((node, kind), &node_x) in nodes.zip(xs) {
                let dx = (node_x - x) * unit_x;
                let q = (dx * dx + dy_squared) * inverse;
                let height = crown.anchor + (crown.base + length * surface(q));
                let height = if q <= 1.0 { height } else { f32::NEG_INFINITY };
                let higher = height > *node;
                *node = if higher { height } else { *node };
                *kind = if higher { u32::from(crown.species) } else { *kind };
            }
        }
    }
}

/// Crowns sorted into squares as wide as the widest, to find those around any place.
pub struct CrownIndex<'a> {
    crowns: &'a [Crown],
    window: Window,
    side_x: i64,
    side_y: i64,
    columns: usize,
    /// For each square the crowns in it, as a range of `order`.
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl<'a> CrownIndex<'a> {
    /// Sorts the crowns of a window.
    pub fn new(crowns: &'a [Crown], window: Window) -> Self {
        let widest = crowns.iter().fold(0.5_f32, |widest, crown| widest.max(crown.radius));
        let least_unit =
            crowns.iter().fold(UNIT_METRES as f32, |least, crown| least.min(crown.metres_per_unit_x));
        let side_x = (widest / least_unit).ceil() as i64 + 1;
        let side_y = (f64::from(widest) / UNIT_METRES).ceil() as i64 + 1;
        let columns = ((window.east - window.west).max(0) / side_x + 1) as usize;
        let rows = ((window.south - window.north).max(0) / side_y + 1) as usize;
        let square = |crown: &Crown| {
            let column = ((crown.x - window.west) / side_x) as usize;
            let row = ((crown.y - window.north) / side_y) as usize;
            row * columns + column
        };
        let mut starts = vec![0_u32; columns * rows + 1];
        for crown in crowns {
            starts[square(crown) + 1] += 1;
        }
        for index in 1..starts.len() {
            starts[index] += starts[index - 1];
        }
        let mut next = starts.clone();
        let mut order = vec![0_u32; crowns.len()];
        for (index, crown) in crowns.iter().enumerate() {
            let place = &mut next[square(crown)];
            order[*place as usize] = index as u32;
            *place += 1;
        }
        Self { crowns, window, side_x, side_y, columns, starts, order }
    }

    /// The highest crown at a place in units, metres, and its species; −∞ and 0 where there is none.
    pub fn highest(&self, x: f64, y: f64) -> (f32, u32) {
        let mut highest = (f32::NEG_INFINITY, 0);
        if !x.is_finite() || !y.is_finite() {
            return highest;
        }
        let column = (x.floor() as i64 - self.window.west).div_euclid(self.side_x);
        let row = (y.floor() as i64 - self.window.north).div_euclid(self.side_y);
        let rows = (self.starts.len() - 1) / self.columns;
        for row in (row - 1).max(0)..=(row + 1).min(rows as i64 - 1) {
            let first = (column - 1).max(0);
            let last = (column + 1).min(self.columns as i64 - 1);
            if first > last {
                continue;
            }
            let square = |column: i64| row as usize * self.columns + column as usize;
            let range = self.starts[square(first)] as usize..self.starts[square(last) + 1] as usize;
            for &index in &self.order[range] {
                let crown = &self.crowns[index as usize];
                let dx = (x - crown.x as f64) as f32 * crown.metres_per_unit_x;
                let dy = (y - crown.y as f64) as f32 * UNIT_METRES as f32;
                let squared = (dx * dx + dy * dy) / (crown.radius * crown.radius);
                if squared <= 1.0 {
                    let surface = crown.surface(squared);
                    if surface > highest.0 {
                        highest = (surface, u32::from(crown.species));
                    }
                }
            }
        }
        highest
    }
}

/// What rounding may add between a crown's bound and its surface as drawn, metres.
const BOUND_SLACK_METRES: f32 = 0.01;

/// Raises bounds of blocks (columns × rows equal parts of a rectangle of units) to all crowns that
/// reach into them: each by its surface where the block is nearest to the trunk, the highest it is
/// anywhere in the block.
pub fn raise_blocks(crowns: &[Crown], bounds: [f64; 4], columns: usize, rows: usize, out: &mut [f32]) {
    let [west, north, east, south] = bounds;
    let (block_x, block_y) = ((east - west) / columns as f64, (south - north) / rows as f64);
    for crown in crowns {
        let (unit_x, unit_y) = (f64::from(crown.metres_per_unit_x), UNIT_METRES);
        let radius = f64::from(crown.radius) * 1.001;
        let (x, y) = (crown.x as f64 - west, crown.y as f64 - north);
        let range = |at: f64, reach: f64, block: f64, count: usize| {
            let first = ((at - reach) / block).floor().clamp(0.0, count as f64);
            let last = (((at + reach) / block).floor() + 1.0).clamp(0.0, count as f64);
            first as usize..last as usize
        };
        // Distance from the trunk to a block along one axis.
        let apart = |at: f64, index: usize, block: f64| {
            let start = index as f64 * block;
            (start - at).max(at - (start + block)).max(0.0)
        };
        for row in range(y, radius / unit_y, block_y, rows) {
            let dy = apart(y, row, block_y) * unit_y;
            for column in range(x, radius / unit_x, block_x, columns) {
                let dx = apart(x, column, block_x) * unit_x;
                let squared = (dx * dx + dy * dy) / (radius * radius);
                if squared <= 1.0 {
                    let bound = &mut out[row * columns + column];
                    // The bound of a block without terrain is NaN, and gives way.
                    *bound = bound.max(crown.surface(squared as f32) + BOUND_SLACK_METRES);
                }
            }
        }
    }
}
