//! Where trees are drawn one by one: the cells of the seeds' pattern about the eye, and the land cover that they need.

use super::view::ViewGeometry;
use glam::DVec3;
use std::collections::HashSet;
use treeline_core::codec::elevation::quantum_metres;
use treeline_core::geodesy;
use treeline_core::layer::Layer;
use treeline_core::scene::{LandCoverLevels, SceneDescription};
use treeline_core::seeds::pattern::{CELL_UNITS, CellRow, LEVEL};
use treeline_core::seeds::place::{UNIT_METRES, x_from_longitude, y_from_latitude};
use treeline_core::seeds::species::{tallest_metres, widest_crown_metres};
use treeline_core::seeds::{Species, anchor};
use treeline_core::tile::{CELLS, GeographicBox, TileAddress, columns, rows, span_degrees};
use treeline_shaders::trees::{BLOCK_COLUMNS, SeedCell, SeedFrame, TreeCells};

/// Trees are drawn no farther than this, whatever is asked for: farther there is no land cover of theirs.
pub const FARTHEST_METRES: f64 = 1_400.0;
/// Cells looked at in a frame at most, nearest first.
const MOST_CELLS: usize = 1_024;
/// Slots for land cover at most.
const MOST_SLOTS: f64 = 24.0;
/// Pixels from foot to top from which on a tree is drawn on the first, second and third level.
const LEVEL_PIXELS: [f32; 4] = [130.0, 50.0, 18.0, 0.0];
/// What the cells' flat boxes and the trees' own size may be off, metres.
const MARGIN_METRES: f64 = 3.0;

/// A scene's trees, as far as they are drawn.
#[derive(Clone, Debug)]
pub struct TreeField {
    /// The table that decides them, by code: the first has code 1.
    pub species: Vec<Species>,
    levels: LandCoverLevels,
    /// Trees are drawn up to this distance, metres.
    range: f64,
    /// Where there is land cover.
    pub extent: GeographicBox,
}

/// The cells of a frame.
#[derive(Clone, Debug, Default)]
pub struct SeedFrameCells {
    /// What the pass is told.
    pub frame: SeedFrame,
    /// The cells, row by row.
    pub cells: Vec<SeedCell>,
    /// The cell that the eye is over.
    pub eye_cell: [u32; 2],
}

impl SeedFrameCells {
    /// The cells as the shade pass looks them up.
    pub fn window(&self) -> TreeCells {
        TreeCells::new(&self.cells, self.eye_cell, self.frame.range)
    }
}

impl TreeField {
    /// Of a scene, with trees up to a distance (metres); `None` where nothing grows, none are wanted, or the
    /// scene's species are not ones that this program can grow.
    pub fn new(scene: &SceneDescription, range: f64) -> Option<Self> {
        let levels = scene.land_cover.filter(|_| scene.vegetation && range > 0.0)?;
        let extent = scene.layer(Layer::Lcc)?.extent;
        if levels.l1 > LEVEL || !(anchor::COARSEST_LEVEL..=anchor::FINEST_LEVEL).contains(&levels.anchor) {
            return None;
        }
        Some(Self { species: table(scene)?, levels, range: range.min(FARTHEST_METRES), extent })
    }

    /// Level of the land-cover tiles that decide trees.
    pub fn level(&self) -> u8 {
        self.levels.l1
    }

    /// Level of the anchors' nodes.
    pub fn anchor_level(&self) -> u8 {
        self.levels.anchor
    }

    /// Up to which distance trees are drawn, metres.
    pub fn range(&self) -> f64 {
        self.range
    }

    /// Nodes along the longer side of a tile's anchors.
    pub fn anchor_side(&self) -> u32 {
        let down = i32::from(self.levels.anchor) - i32::from(self.levels.l1);
        let cells = f64::from(CELLS) * f64::from(down).exp2();
        cells.ceil() as u32 + 1
    }

    /// GPU memory of a tile, bytes.
    pub fn slot_bytes(&self) -> u64 {
        4 * u64::from(CELLS).pow(2) + 4 * u64::from(self.anchor_side()).pow(2)
    }

    /// Slots for what an eye at the equator may have about it; narrower tiles elsewhere come and go.
    pub fn slots(&self) -> u32 {
        let side = span_degrees(self.levels.l1) / 360.0 * geodesy::EQUATOR_METRES;
        (2.0 * self.range / side + 2.0).powi(2).min(MOST_SLOTS) as u32
    }

    /// The cells that may have a tree in the picture, nearest first, with their distance (metres). `heights` bounds
    /// the surface over a cell, canopy included; `None` where there is nothing. `seen`: of the map last read, if it
    /// is to choose.
    pub fn cells_in_sight(
        &self,
        view: &ViewGeometry,
        seen: Option<&HashSet<TileAddress>>,
        heights: impl Fn(TileAddress) -> Option<(f64, f64)>,
    ) -> Vec<(f64, TileAddress)> {
        let side = f64::from(CELL_UNITS);
        let (eye_x, eye_y) = (x_from_longitude(view.eye.longitude), y_from_latitude(view.eye.latitude));
        let cosine = view.eye.latitude.to_radians().cos();
        let metres = [UNIT_METRES * cosine, UNIT_METRES];
        let reach = self.range + f64::from(widest_crown_metres(&self.species));
        let half_columns = (reach / (side * metres[0])).ceil().min(f64::from(columns(LEVEL) / 2 - 1)) as i64;
        let half_rows = (reach / (side * metres[1])).ceil() as i64;
        let (column, row) = ((eye_x / side).floor() as i64, (eye_y / side).floor() as i64);
        let mut found = Vec::new();
        for row in (row - half_rows).max(0)..=(row + half_rows).min(i64::from(rows(LEVEL)) - 1) {
            if CellRow::new(row as u32).columns == 0 {
                continue;
            }
            let south = [row as f64 * side - eye_y, (row + 1) as f64 * side - eye_y].map(|y| y * metres[1]);
            for column in column - half_columns..=column + half_columns {
                let east =
                    [column as f64 * side - eye_x, (column + 1) as f64 * side - eye_x].map(|x| x * metres[0]);
                let apart = |range: [f64; 2]| range[0].max(-range[1]).max(0.0);
                let level_distance = apart(east).hypot(apart(south));
                if level_distance > reach {
                    continue;
                }
                let wrapped = column.rem_euclid(i64::from(columns(LEVEL))) as u32;
                let address = TileAddress { level: LEVEL, row: row as u32, column: wrapped };
                if seen.is_some_and(|seen| !seen.contains(&address))
                    || !self.extent.intersects(&address.bounds())
                {
                    continue;
                }
                let Some((low, high)) = heights(address) else { continue };
                let up = [low - view.eye.height, high - view.eye.height];
                let distance = level_distance.hypot(apart(up));
                if distance > reach || self.is_beside(view, east, south, up) {
                    continue;
                }
                found.push((distance, address));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        found.truncate(MOST_CELLS);
        found
    }

    /// Whether a box (metres from the eye: east, south, up), with the trees that hang over it, lies outside the
    /// picture.
    fn is_beside(&self, view: &ViewGeometry, east: [f64; 2], south: [f64; 2], up: [f64; 2]) -> bool {
        let tallest = f64::from(tallest_metres(&self.species));
        let margin = MARGIN_METRES + f64::from(widest_crown_metres(&self.species));
        // The surface's bound holds the crowns; a coarse one may not hold them all.
        let up = [up[0] - margin, up[1] + tallest];
        view.side_normals().iter().any(|normal| {
            let farthest = |range: [f64; 2], along: f64| (range[0] * along).max(range[1] * along);
            let reach = farthest(east, normal.x) + farthest(south, -normal.y) + farthest(up, normal.z);
            reach < -margin * normal.length()
        })
    }

    /// The tiles of land cover that cells need, with the distance of the nearest, nearest first.
    pub fn tiles_of(&self, cells: &[(f64, TileAddress)]) -> Vec<(f64, TileAddress)> {
        let mut known = HashSet::new();
        cells
            .iter()
            .filter_map(|&(distance, cell)| Some((distance, cell.ancestor(self.levels.l1)?)))
            .filter(|&(_, tile)| known.insert(tile))
            .collect()
    }

    /// What the pass is told, for cells in sight whose land cover stands in a slot.
    pub fn seed_frame(
        &self,
        view: &ViewGeometry,
        cells: &[(f64, TileAddress)],
        slot: impl Fn(TileAddress) -> Option<u32>,
    ) -> SeedFrameCells {
        let (eye_x, eye_y) = (x_from_longitude(view.eye.longitude), y_from_latitude(view.eye.latitude));
        let (whole_x, whole_y) = (eye_x.floor(), eye_y.floor());
        let all = i64::from(columns(LEVEL));
        let mut blocks = 0;
        let mut out: Vec<SeedCell> = cells
            .iter()
            .filter_map(|&(_, cell)| {
                let slot = slot(cell.ancestor(self.levels.l1)?)?;
                let side = i64::from(CELL_UNITS);
                // The nearer way round the Earth.
                let apart = i64::from(cell.column) - (whole_x as i64).div_euclid(side);
                let column = (apart + all / 2).rem_euclid(all) - all / 2 + (whole_x as i64).div_euclid(side);
                blocks = blocks.max(CellRow::new(cell.row).columns.div_ceil(BLOCK_COLUMNS));
                Some(SeedCell {
                    cell: [cell.column, cell.row],
                    offset: [
                        (column * side - whole_x as i64) as i32,
                        (i64::from(cell.row) * side - whole_y as i64) as i32,
                    ],
                    slot,
                    padding: 0,
                })
            })
            .collect();
        // The same order whatever came first.
        out.sort_unstable_by_key(|cell| (cell.cell[1], cell.cell[0]));
        let latitude = view.eye.latitude.to_radians();
        let side = |normal: &DVec3| {
            let unit = normal.normalize();
            [unit.x as f32, unit.y as f32, unit.z as f32, 0.0]
        };
        let cover_bits = u32::from(treeline_core::seeds::place::UNIT_LEVEL - self.levels.l1);
        let frame = SeedFrame {
            eye: [
                latitude.sin() as f32,
                latitude.cos() as f32,
                view.eye.height as f32,
                geodesy::prime_vertical_radius(view.eye.latitude) as f32,
            ],
            sides: view.side_normals().each_ref().map(side),
            level_pixels: LEVEL_PIXELS,
            eye_fraction: [(eye_x - whole_x) as f32, (eye_y - whole_y) as f32],
            range: self.range as f32,
            anchor_quantum: quantum_metres(self.levels.anchor) as f32,
            cells: out.len() as u32,
            blocks,
            species: self.species.len() as u32,
            cover_bits,
            tile_bits: cover_bits + CELLS.ilog2(),
            anchor_bits: anchor::cell_bits(self.levels.anchor),
            padding: [0; 2],
        };
        let cell_of = |whole: f64| (whole as i64).div_euclid(i64::from(CELL_UNITS));
        let eye_cell = [cell_of(whole_x).rem_euclid(all) as u32, cell_of(whole_y) as u32];
        SeedFrameCells { frame, cells: out, eye_cell }
    }
}

/// A scene's species by code, which is their place in the table. A scene names those alone that grow in it; in the
/// place of any other stands one that never lives. `None` where there are none, or one is not what this program can
/// grow.
fn table(scene: &SceneDescription) -> Option<Vec<Species>> {
    let mut named: Vec<Option<Species>> = Vec::new();
    for species in &scene.species {
        let made = Species::new(species.code, species.definition.clone()).ok()?;
        let place = usize::from(made.code) - 1;
        named.resize_with(named.len().max(place + 1), || None);
        named[place] = Some(made);
    }
    let any = named.iter().flatten().next()?.clone();
    let absent = |code| {
        let mut species = any.clone();
        (species.code, species.share) = (code, 0);
        species
    };
    Some((1..=u8::MAX).zip(named).map(|(code, species)| species.unwrap_or_else(|| absent(code))).collect())
}

/// Cells with those around them: a tree stands in one cell and hangs over into the next.
pub fn with_neighbours(cells: impl Iterator<Item = TileAddress>) -> HashSet<TileAddress> {
    let mut all = HashSet::new();
    for cell in cells {
        for (south, east) in (-1..=1).flat_map(|south| (-1..=1).map(move |east| (south, east))) {
            let column = (i64::from(cell.column) + east).rem_euclid(i64::from(columns(cell.level))) as u32;
            let row = i64::from(cell.row) + south;
            if (0..i64::from(rows(cell.level))).contains(&row) {
                all.insert(TileAddress { level: cell.level, row: row as u32, column });
            }
        }
    }
    all
}
