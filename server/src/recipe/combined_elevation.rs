//! Terrain and canopy: the larger of the terrain and the highest crown where samples are close, else
//! the terrain and the canopy's mean.

use super::canopy::{Anchors, Crown, CrownIndex, Rows, crowns, raise_blocks, trees, window_of_trees};
use super::elevation::{self, BLOCKS, tile_box};
use super::encode::{self, own};
use super::grid_places::{Places, band, coarsest_spacing, is_node_registered, places};
use super::levels::{ENVELOPE_METRES, anchor_level, land_cover_levels, shows_crowns, tallest_tree_metres};
use super::stands::{Stands, cover_of_cells};
use super::{Format, RecipeError, TileRequest, shaded_relief};
use crate::scene::Scene;
use crate::source::{Cover, SampleGrid};
use treeline_core::codec::elevation::ElevationTile;
use treeline_core::geodesy;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::layer::SurfaceType;
use treeline_core::scene::LandCoverLevels;
use treeline_core::seeds::place::{x_from_longitude, y_from_latitude};
use treeline_core::seeds::species::widest_crown_metres;
use treeline_core::tile::GeographicBox;

/// Samples whose crowns are grown at a time: bounds the memory of large maps.
const BAND_SAMPLES: usize = 1 << 19;
/// From this closure on, a coarse sample is shaded as canopy: a quarter of the ground under trees.
const CANOPY_CLOSURE: u32 = 64;

/// The tile in the format asked for.
pub fn make(scene: &Scene, request: &TileRequest) -> Result<Vec<u8>, RecipeError> {
    match request.format {
        Format::Own => Ok(tile(scene, &own::tile_window(request)?)?.encode()),
        _ => encode::heights(request, &heights(scene, &request.grid)?),
    }
}

/// The map as a picture: shaded relief, crowns green.
pub fn pixels(scene: &Scene, grid: &SampleGrid) -> Result<Vec<[u8; 4]>, RecipeError> {
    shaded_relief::pixels(grid, |grid| {
        let combined = Combined::sample(scene, grid)?;
        Ok((combined.heights, combined.types))
    })
}

/// The combined map's heights alone, metres, NaN for no data: the [`Combined::heights`] of a grid.
pub(super) fn heights(scene: &Scene, grid: &SampleGrid) -> Result<Vec<f32>, RecipeError> {
    let Some(levels) = land_cover_levels(scene).filter(|_| !grid.is_empty()) else {
        return elevation::sample(scene, grid);
    };
    if !holds_crowns(grid) {
        return Ok(Combined::mean(scene, &levels, grid)?.heights);
    }
    let mut whole = Vec::with_capacity(grid.len());
    for band in bands(grid) {
        let Grown { mut terrain, over } = Grown::sample(scene, &levels, &band)?;
        if let Some(over) = over {
            for (height, &top) in terrain.iter_mut().zip(&over.tops) {
                if top > *height {
                    *height = top;
                }
            }
        }
        whole.extend_from_slice(&terrain);
    }
    Ok(whole)
}

/// Whether the samples of a grid are close enough to show every crown.
fn holds_crowns(grid: &SampleGrid) -> bool {
    match grid {
        SampleGrid::Lattice(window) => shows_crowns(window.level),
        SampleGrid::Box { .. } => coarsest_spacing(grid) <= ENVELOPE_METRES,
    }
}

/// A grid's rows, so many at a time that their crowns do not take much memory.
fn bands(grid: &SampleGrid) -> Vec<SampleGrid> {
    let (width, height) = grid.size();
    let rows = (BAND_SAMPLES / width as usize).max(1) as u32;
    if rows >= height {
        return vec![grid.clone()];
    }
    (0..height).step_by(rows as usize).map(|first| band(grid, first, rows.min(height - first))).collect()
}

/// A decoded tile: what [`make`] packs as [`Format::Own`].
pub fn tile(scene: &Scene, window: &LatticeWindow) -> Result<ElevationTile, RecipeError> {
    let combined = Combined::sample(scene, &SampleGrid::Lattice(*window))?;
    let maxima = maxima(scene, window, &combined)?;
    let species = Some(combined.species).filter(|species| !species.is_empty());
    let planes =
        combined.types.map(|types| own::CombinedPlanes { terrain: &combined.terrain, types, species });
    Ok(own::elevation_tile(window, &combined.heights, &maxima, planes))
}

/// The combined map on a grid.
pub(super) struct Combined {
    /// Bare terrain, metres, NaN for no data.
    terrain: Vec<f32>,
    /// Terrain and canopy.
    pub heights: Vec<f32>,
    /// Surface types, where the scene knows of any cover there.
    types: Option<Vec<u8>>,
    /// Codes of the species whose canopy it is, 0 for none; empty where nothing grows.
    species: Vec<u8>,
    /// Every crown that reaches the grid, where it shows them.
    crowns: Vec<Crown>,
}

impl Combined {
    pub fn sample(scene: &Scene, grid: &SampleGrid) -> Result<Self, RecipeError> {
        let Some(levels) = land_cover_levels(scene).filter(|_| !grid.is_empty()) else {
            return Ok(Self::bare(elevation::sample(scene, grid)?));
        };
        if !holds_crowns(grid) {
            return Self::mean(scene, &levels, grid);
        }
        let bands = bands(grid);
        if let [whole] = &bands[..] {
            return Self::envelope(scene, &levels, whole);
        }
        let mut whole = Self::bare(Vec::with_capacity(grid.len()));
        let mut types = Vec::with_capacity(grid.len());
        for band in bands {
            let part = Self::envelope(scene, &levels, &band)?;
            types.extend(part.types.unwrap_or_else(|| vec![SurfaceType::Plain as u8; part.terrain.len()]));
            whole.terrain.extend(part.terrain);
            whole.heights.extend(part.heights);
            whole.species.extend(part.species);
            // A part where nothing grows has none.
            whole.species.resize(whole.terrain.len(), 0);
            whole.crowns.extend(part.crowns);
        }
        whole.types = Some(types);
        Ok(whole)
    }

    fn bare(terrain: Vec<f32>) -> Self {
        Self { heights: terrain.clone(), terrain, types: None, species: Vec::new(), crowns: Vec::new() }
    }

    /// Terrain and the canopy's mean over a sample's footprint: of the four cells around a node, or
    /// of the sample's own cell.
    fn mean(scene: &Scene, levels: &LandCoverLevels, grid: &SampleGrid) -> Result<Self, RecipeError> {
        let terrain = elevation::sample(scene, grid)?;
        let width = grid.size().0 as usize;
        let mut canopies = ExpectedCanopies { scene, last: (Cover::default(), 0.0) };
        let mut heights = terrain.clone();
        let mut types = vec![SurfaceType::Plain as u8; terrain.len()];
        let mut species = vec![0; terrain.len()];
        if let SampleGrid::Lattice(window) = grid
            && is_node_registered(grid)
        {
            let cells = LatticeWindow {
                registration: Registration::Cell,
                first_column: window.first_column - 1,
                first_row: window.first_row - 1,
                width: window.width + 1,
                height: window.height + 1,
                ..*window
            };
            let covers = cover_of_cells(scene, levels, &cells)?;
            if covers.iter().all(|cover| *cover == Cover::default()) {
                return Ok(Self::bare(terrain));
            }
            let expected: Vec<f32> = covers.iter().map(|&cover| canopies.metres(cover)).collect();
            let (mut above, mut below) = (0, width + 1);
            let rows = heights.chunks_exact_mut(width).zip(types.chunks_exact_mut(width));
            for ((heights, types), species) in rows.zip(species.chunks_exact_mut(width)) {
                let nodes = heights.iter_mut().zip(types).zip(species);
                for (column, ((height, kind), species)) in nodes.enumerate() {
                    let four = [above + column, above + column + 1, below + column, below + column + 1];
                    let canopy: f32 = four.iter().map(|&cell| expected[cell]).sum();
                    let closure: u32 = four.iter().map(|&cell| u32::from(wooded_closure(covers[cell]))).sum();
                    *height += 0.25 * canopy;
                    *kind = coarse_type(closure, covers[four[3]]);
                    *species = four
                        .iter()
                        .rev()
                        .map(|&cell| covers[cell].species)
                        .find(|&code| code != 0)
                        .unwrap_or(0);
                }
                above = below;
                below += width + 1;
            }
        } else {
            let mut covers = vec![Cover::default(); grid.len()];
            match (grid, &scene.cover) {
                (SampleGrid::Lattice(window), _) => covers = cover_of_cells(scene, levels, window)?,
                (_, Some(cover)) => cover.sample(grid, &mut covers)?,
                (_, None) => {}
            }
            let nodes = heights.iter_mut().zip(&mut types).zip(&mut species);
            for (((height, kind), species), &cover) in nodes.zip(&covers) {
                *height += canopies.metres(cover);
                *species = cover.species;
                *kind = coarse_type(4 * u32::from(wooded_closure(cover)), cover);
            }
        }
        Ok(Self { terrain, heights, types: Some(types), species, crowns: Vec::new() })
    }

    /// The larger of the terrain and the highest crown.
    fn envelope(scene: &Scene, levels: &LandCoverLevels, grid: &SampleGrid) -> Result<Self, RecipeError> {
        let Grown { terrain, over } = Grown::sample(scene, levels, grid)?;
        let Some(Over { places, stands, crowns, tops, kinds }) = over else {
            return Ok(Self::bare(terrain));
        };
        let mut types = places.surface_types(&stands, terrain.len());
        let mut heights = tops;
        let mut species = vec![0; terrain.len()];
        let nodes = heights.iter_mut().zip(&mut types).zip(&mut species);
        for (((height, kind), species), (&ground, &code)) in nodes.zip(terrain.iter().zip(&kinds)) {
            // Where the terrain is void, so is the canopy: NaN compares as not higher.
            if *height > ground {
                *kind = SurfaceType::Canopy as u8;
                *species = code as u8;
            } else {
                *height = ground;
            }
        }
        Ok(Self { terrain, heights, types: Some(types), species, crowns })
    }
}

/// Terrain on a grid whose samples show every crown, and what stands on it.
struct Grown {
    /// Metres, NaN for no data.
    terrain: Vec<f32>,
    /// `None` where the scene knows of no cover.
    over: Option<Over>,
}

/// What stands on the terrain.
struct Over {
    places: Units,
    stands: Stands,
    /// Every crown that reaches the grid.
    crowns: Vec<Crown>,
    /// The highest crown at each sample, metres, −∞ where there is none.
    tops: Vec<f32>,
    /// Code of its species, 0 where there is none.
    kinds: Vec<u32>,
}

impl Grown {
    fn sample(scene: &Scene, levels: &LandCoverLevels, grid: &SampleGrid) -> Result<Self, RecipeError> {
        let bare = || Ok(Self { terrain: elevation::sample(scene, grid)?, over: None });
        let places = Units::new(&places(grid)?);
        let Some([west, north, east, south]) = places.bounds() else { return bare() };
        let window = window_of_trees(scene, west, north, east, south);
        let Some(stands) = Stands::read(scene, levels, &window)? else { return bare() };
        let trees = trees(scene, &window, &stands);
        let mut sampled = None;
        let mut found = Vec::new();
        if !trees.is_empty() {
            let anchors = Anchors::read(scene, Anchors::window(anchor_level(scene), &window))?;
            found = crowns(scene, &trees, &anchors);
            // On the anchor level the terrain of the tile is among what the anchors have read.
            if let SampleGrid::Lattice(window) = grid {
                sampled = anchors.crop(window);
            }
        }
        let terrain = sampled.map_or_else(|| elevation::sample(scene, grid), Ok)?;
        let mut tops = vec![f32::NEG_INFINITY; terrain.len()];
        let mut kinds = vec![0; terrain.len()];
        match &places {
            Units::Separable { xs, ys } => Rows::new(xs, ys).splat(&found, &mut tops, &mut kinds),
            Units::Scattered(places) => {
                let index = CrownIndex::new(&found, window);
                for ((top, kind), &(x, y)) in tops.iter_mut().zip(&mut kinds).zip(places) {
                    (*top, *kind) = index.highest(x, y);
                }
            }
        }
        Ok(Self { terrain, over: Some(Over { places, stands, crowns: found, tops, kinds }) })
    }
}

/// The closure of a cover that has trees.
fn wooded_closure(cover: Cover) -> u8 {
    if cover.species == 0 { 0 } else { cover.closure }
}

fn coarse_type(closure_of_four: u32, cover: Cover) -> u8 {
    if closure_of_four >= 4 * CANOPY_CLOSURE { SurfaceType::Canopy as u8 } else { cover.surface() as u8 }
}

/// Mean canopy heights by cover; neighbours mostly have the same.
struct ExpectedCanopies<'a> {
    scene: &'a Scene,
    last: (Cover, f32),
}

impl ExpectedCanopies<'_> {
    fn metres(&mut self, cover: Cover) -> f32 {
        if cover.species == 0 {
            return 0.0;
        }
        if cover != self.last.0 {
            let species = self.scene.species.get(usize::from(cover.species) - 1);
            let metres = species.map_or(0.0, |species| species.expected_canopy(cover.closure, cover.height));
            self.last = (cover, metres);
        }
        self.last.1
    }
}

/// The places of a grid in units of `core::seeds::place`.
enum Units {
    Separable { xs: Vec<f64>, ys: Vec<f64> },
    Scattered(Vec<(f64, f64)>),
}

impl Units {
    fn new(places: &Places) -> Self {
        match places {
            Places::Separable { longitudes, latitudes } => Self::Separable {
                xs: longitudes.iter().copied().map(x_from_longitude).collect(),
                ys: latitudes.iter().copied().map(y_from_latitude).collect(),
            },
            Places::Scattered(places) => {
                // A grid over the antimeridian goes on eastward.
                let west = places.iter().map(|place| place.0).fold(f64::INFINITY, f64::min);
                let east = places.iter().map(|place| place.0).fold(f64::NEG_INFINITY, f64::max);
                let turned = east - west > 180.0;
                let unwrapped = |longitude: f64| {
                    if turned && longitude < 0.0 { longitude + 360.0 } else { longitude }
                };
                Self::Scattered(
                    places
                        .iter()
                        .map(|&(longitude, latitude)| {
                            (x_from_longitude(unwrapped(longitude)), y_from_latitude(latitude))
                        })
                        .collect(),
                )
            }
        }
    }

    /// [west, north, east, south]; `None` where no sample has a place.
    fn bounds(&self) -> Option<[f64; 4]> {
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values
                .filter(|value| value.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |range, value| {
                    (range.0.min(value), range.1.max(value))
                })
        };
        let (x, y) = match self {
            Self::Separable { xs, ys } => (range(&mut xs.iter().copied()), range(&mut ys.iter().copied())),
            Self::Scattered(places) => (
                range(&mut places.iter().map(|place| place.0)),
                range(&mut places.iter().map(|place| place.1)),
            ),
        };
        (x.0 <= x.1 && y.0 <= y.1).then_some([x.0, y.0, x.1, y.1])
    }

    /// The ground's surface type at each sample.
    fn surface_types(&self, stands: &Stands, count: usize) -> Vec<u8> {
        let mut types = Vec::with_capacity(count);
        match self {
            Self::Separable { xs, ys } => {
                let columns: Vec<usize> = xs.iter().map(|x| stands.column(x.floor() as i64)).collect();
                for y in ys {
                    let row = stands.row(y.floor() as i64);
                    types.extend(columns.iter().map(|&column| row[column].surface() as u8));
                }
            }
            Self::Scattered(places) => types.extend(places.iter().map(|&(x, y)| {
                if !x.is_finite() || !y.is_finite() {
                    return SurfaceType::Plain as u8;
                }
                stands.row(y.floor() as i64)[stands.column(x.floor() as i64)].surface() as u8
            })),
        }
        types
    }
}

/// Upper bounds of terrain and crowns in a tile's blocks, on this level and all below.
fn maxima(scene: &Scene, window: &LatticeWindow, combined: &Combined) -> Result<Vec<f32>, RecipeError> {
    let bounds = tile_box(window);
    let blocks = BLOCKS as usize;
    if combined.types.is_none() && (shows_crowns(window.level) || !cover_reaches(scene, &bounds)) {
        return Ok(scene.height.maxima(&bounds, BLOCKS, BLOCKS)?);
    }
    if shows_crowns(window.level) {
        // Deeper levels show the same crowns between these samples.
        let mut maxima = scene.height.maxima(&bounds, BLOCKS, BLOCKS)?;
        let rectangle = [
            x_from_longitude(bounds.west),
            y_from_latitude(bounds.north),
            x_from_longitude(bounds.east),
            y_from_latitude(bounds.south),
        ];
        raise_blocks(&combined.crowns, rectangle, blocks, blocks, &mut maxima);
        return Ok(maxima);
    }
    // A coarse sample misses single stands: wherever there is cover there may be the tallest tree,
    // and one that stands in a neighbouring block may hang over.
    let latitude = bounds.north.abs().max(bounds.south.abs()).min(86.5);
    let degree = geodesy::EQUATOR_METRES / 360.0;
    let block_degrees = (bounds.north - bounds.south) / f64::from(BLOCKS);
    let reach = f64::from(widest_crown_metres(&scene.species));
    let ring_y = (reach / (block_degrees * degree)).ceil() as u32;
    let ring_x = (reach / (block_degrees * degree * latitude.to_radians().cos())).ceil() as u32;
    let north = if bounds.north + block_degrees * f64::from(ring_y) > 90.0 { 0 } else { ring_y };
    let south = if bounds.south - block_degrees * f64::from(ring_y) < -90.0 { 0 } else { ring_y };
    let wider = GeographicBox {
        west: bounds.west - block_degrees * f64::from(ring_x),
        east: bounds.east + block_degrees * f64::from(ring_x),
        north: bounds.north + block_degrees * f64::from(north),
        south: bounds.south - block_degrees * f64::from(south),
    };
    let (columns, rows) = (BLOCKS + 2 * ring_x, BLOCKS + north + south);
    let terrain = scene.height.maxima(&wider, columns, rows)?;
    let tallest = tallest_tree_metres(scene) as f32;
    let mut maxima = Vec::with_capacity(blocks * blocks);
    for row in 0..BLOCKS {
        for column in 0..BLOCKS {
            let mut highest = f32::NAN;
            let (first, last) = ((row + north).saturating_sub(ring_y), (row + north + ring_y).min(rows - 1));
            for near_row in first..=last {
                let line = (near_row * columns) as usize;
                for &value in &terrain[line + column as usize..=line + (column + 2 * ring_x) as usize] {
                    highest = highest.max(value);
                }
            }
            // A void stays a void: no crown is drawn where there is no terrain.
            let own = terrain[((row + north) * columns + column + ring_x) as usize];
            maxima.push(if own.is_nan() { own } else { highest + tallest });
        }
    }
    Ok(maxima)
}

/// Whether the scene knows of any cover in a box.
fn cover_reaches(scene: &Scene, bounds: &GeographicBox) -> bool {
    scene.cover.as_ref().is_some_and(|cover| cover.extent().bounds.intersects(bounds))
}

/// The combined map at one place, and the cover there: for [`super::point()`].
pub(super) fn at_place(
    scene: &Scene,
    levels: &LandCoverLevels,
    longitude: f64,
    latitude: f64,
) -> Result<(f32, Cover), RecipeError> {
    let (x, y) = (x_from_longitude(longitude), y_from_latitude(latitude));
    let window = window_of_trees(scene, x, y, x, y);
    let Some(stands) = Stands::read(scene, levels, &window)? else {
        return Ok((f32::NEG_INFINITY, Cover::default()));
    };
    let cover = stands.row(y.floor() as i64)[stands.column(x.floor() as i64)];
    let trees = trees(scene, &window, &stands);
    if trees.is_empty() {
        return Ok((f32::NEG_INFINITY, cover));
    }
    let anchors = Anchors::read(scene, Anchors::window(anchor_level(scene), &window))?;
    let found = crowns(scene, &trees, &anchors);
    Ok((CrownIndex::new(&found, window).highest(x, y).0, cover))
}

#[cfg(test)]
#[path = "heights_tests.rs"]
mod tests;
