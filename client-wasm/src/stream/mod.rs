//! Streaming: which tiles a view wants, which are asked for, which slots they stand in, and what is
//! drawn meanwhile. A plain state machine: no GPU, no browser, no clock (time is passed in).
//!
//! Follow a frame: [`tile_choice`] cuts the quadtree, [`requests`] asks for what is missing,
//! [`decode`] unpacks what comes, [`residency`] finds it a slot, [`page_table`] draws.

pub mod decode;
pub mod page_table;
pub mod requests;
pub mod residency;
pub mod root_grid;
pub mod tile_choice;
pub mod view;

#[cfg(test)]
pub(crate) mod simulation;

use decode::ElevationSummary;
use page_table::{ElevationInput, FitCache, Tables};
use requests::{Failure, FetchFailure, Plan, Requests, TileKey, Wish};
use residency::{Placement, Pool};
use root_grid::RootGrid;
use std::collections::{HashMap, HashSet};
use tile_choice::Cut;
use tile_choice::cpu::{self, HeightRange, Limits};
use treeline_core::layer::Layer;
use treeline_core::scene::SceneDescription;
use treeline_core::tile::{GeographicBox, TileAddress};
use view::{ViewGeometry, Volume};

/// Which elevation is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SurfaceChoice {
    /// Terrain and canopy, where anything grows.
    #[default]
    Combined,
    /// Bare terrain.
    Elevation,
}

/// How much to stream, and how fine.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamOptions {
    /// Which elevation.
    pub surface: SurfaceChoice,
    /// Slots for elevation tiles.
    pub elevation_slots: u32,
    /// Slots for photo tiles.
    pub texture_slots: u32,
    /// Largest size of a cell of the elevation map in the picture, pixels.
    pub cell_pixels: f64,
    /// Largest size of a photo texel in the picture, pixels, looked at squarely.
    pub texel_pixels: f64,
    /// Requests under way at most.
    pub requests_in_flight: usize,
    /// How long a tile fades in, seconds; 0 for not at all.
    pub fade_seconds: f64,
}

impl Default for StreamOptions {
    fn default() -> Self {
        Self {
            surface: SurfaceChoice::Combined,
            elevation_slots: 96,
            texture_slots: 160,
            cell_pixels: 1.42,
            texel_pixels: 1.42,
            requests_in_flight: 8,
            fade_seconds: 0.3,
        }
    }
}

/// A base tile that has failed this often no longer keeps the rest of the scene from being drawn.
const BASE_ATTEMPTS: u32 = 6;
/// With more roots than this (a planet), only those in view are wanted of the photo.
const PINNED_TEXTURES: usize = 16;

/// One layer's tiles.
#[derive(Debug)]
struct LayerStream {
    layer: Layer,
    base: Vec<TileAddress>,
    maximum_level: u8,
    extent: GeographicBox,
    cell_pixels: f64,
    pool: Pool,
    cut: Cut,
}

/// The state machine.
#[derive(Debug)]
pub struct Stream {
    /// Where the page tables begin.
    pub grid: RootGrid,
    heights: (f64, f64),
    elevation: LayerStream,
    texture: Option<LayerStream>,
    summaries: HashMap<TileAddress, ElevationSummary>,
    requests: Requests,
    arrived: HashSet<TileKey>,
    wishes: Vec<Wish>,
    fits: FitCache,
    fade_seconds: f64,
    fading: bool,
    drawn_ready: bool,
}

/// Why a scene cannot be streamed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StreamError {
    /// There is no elevation layer.
    #[error("the scene has no elevation layer; the server must offer elevation or combined-elevation")]
    NoElevation,
    /// The extent is not a box.
    #[error("the scene's extent is empty or not finite; check the server's sources with treeline check")]
    NoExtent,
}

impl Stream {
    /// For a scene.
    pub fn new(scene: &SceneDescription, options: &StreamOptions) -> Result<Self, StreamError> {
        let order = match options.surface {
            SurfaceChoice::Combined if scene.vegetation => [Layer::CombinedElevation, Layer::Elevation],
            // Without vegetation the two are the same, and the bare one is smaller.
            _ => [Layer::Elevation, Layer::CombinedElevation],
        };
        let row = order.into_iter().find_map(|layer| scene.layer(layer)).ok_or(StreamError::NoElevation)?;
        let extent = row.extent;
        let finite =
            [extent.west, extent.south, extent.east, extent.north].iter().all(|edge| edge.is_finite());
        if !finite || extent.east < extent.west || extent.north < extent.south {
            return Err(StreamError::NoExtent);
        }
        let grid = RootGrid::of_scene(&extent, row.maximum_level);
        let base = RootGrid::base_of_scene(&extent, row.maximum_level);
        let elevation = LayerStream {
            layer: row.name,
            base: base.tiles().collect(),
            maximum_level: row.maximum_level,
            extent,
            cell_pixels: options.cell_pixels,
            pool: Pool::new(options.elevation_slots.max(base.len() as u32 + 4)),
            cut: Cut::default(),
        };
        let texture = scene.layer(Layer::Texture).map(|row| LayerStream {
            layer: Layer::Texture,
            // The photo's page table begins at the roots.
            base: grid.tiles().filter(|root| row.extent.intersects(&root.bounds())).collect(),
            maximum_level: row.maximum_level,
            extent: row.extent,
            cell_pixels: options.texel_pixels,
            pool: Pool::new(options.texture_slots.max(2 * PINNED_TEXTURES as u32)),
            cut: Cut::default(),
        });
        Ok(Self {
            grid,
            heights: (scene.minimum_height, scene.maximum_height.max(scene.minimum_height)),
            elevation,
            texture,
            summaries: HashMap::new(),
            requests: Requests::new(options.requests_in_flight),
            arrived: HashSet::new(),
            wishes: Vec::new(),
            fits: FitCache::default(),
            fade_seconds: options.fade_seconds.max(0.0),
            fading: false,
            drawn_ready: false,
        })
    }

    /// The elevation layer in use.
    pub fn elevation_layer(&self) -> Layer {
        self.elevation.layer
    }

    /// Whether the scene has a photo.
    pub fn has_texture(&self) -> bool {
        self.texture.is_some()
    }

    /// Slots for elevation tiles, and for photo tiles.
    pub fn capacities(&self) -> (usize, usize) {
        (self.elevation.pool.capacity(), self.texture.as_ref().map_or(0, |texture| texture.pool.capacity()))
    }

    /// Chooses the tiles that the view wants.
    pub fn choose(&mut self, view: &ViewGeometry) {
        let lowest_height = self.heights.0;
        let cut = {
            let layer = &self.elevation;
            let limits = Limits {
                base: &layer.base,
                maximum_level: layer.maximum_level,
                cell_pixels: layer.cell_pixels,
                capacity: layer.pool.capacity(),
                lowest_height,
            };
            cpu::choose(view, &limits, |address| self.range(address, &layer.extent))
        };
        self.elevation.cut = cut;
        let Some(layer) = &self.texture else { return };
        let base =
            if layer.base.len() > PINNED_TEXTURES { self.seen(view, layer) } else { layer.base.clone() };
        let limits = Limits {
            base: &base,
            maximum_level: layer.maximum_level,
            cell_pixels: layer.cell_pixels,
            capacity: layer.pool.capacity(),
            lowest_height,
        };
        let cut = cpu::choose(view, &limits, |address| self.range(address, &layer.extent));
        if let Some(layer) = &mut self.texture {
            layer.cut = cut;
        }
    }

    /// The base tiles of a layer that may be seen, nearest first, no more than there is room for.
    fn seen(&self, view: &ViewGeometry, layer: &LayerStream) -> Vec<TileAddress> {
        let mut seen: Vec<(f64, TileAddress)> = layer
            .base
            .iter()
            .map(|&root| (Volume::new(view, &root.bounds(), self.heights.0, self.heights.1), root))
            .filter(|(volume, _)| {
                !volume.outside_frustum(view) && !volume.below_horizon(view, self.heights.0)
            })
            .map(|(volume, root)| (volume.distance(view), root))
            .collect();
        seen.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        seen.truncate(layer.pool.capacity() / 2);
        seen.into_iter().map(|(_, root)| root).collect()
    }

    /// What is known of the heights in a square.
    fn range(&self, address: TileAddress, extent: &GeographicBox) -> HeightRange {
        if !extent.intersects(&address.bounds()) {
            return HeightRange::Empty;
        }
        for level in (0..=address.level).rev() {
            let Some(tile) = address.ancestor(level) else { break };
            if self.elevation.pool.is_empty_tile(&tile) {
                return HeightRange::Empty;
            }
            let Some(summary) = self.summaries.get(&tile) else { continue };
            let Some((u, v, side)) = address.place_in_ancestor(level) else { continue };
            let maximum = f64::from(summary.deep_maximum((u, v), side));
            if maximum == f64::NEG_INFINITY {
                return HeightRange::Empty;
            }
            // Finer tiles may reach a little lower than this one's samples.
            let minimum = f64::from(summary.minimum()) - 2.0 * treeline_core::tile::cell_metres(level);
            let minimum = minimum.clamp(self.heights.0.min(maximum), maximum);
            return HeightRange::Between(minimum, maximum);
        }
        HeightRange::Between(self.heights.0, self.heights.1)
    }

    /// Plans the network: what to ask for and what to abort, given the last choice.
    pub fn plan(&mut self, now: f64) -> Plan {
        self.wishes.clear();
        for layer in std::iter::once(&self.elevation).chain(&self.texture) {
            for (&address, node) in &layer.cut.nodes {
                let key = TileKey { layer: layer.layer, address };
                if layer.pool.is_known(&address) || self.arrived.contains(&key) {
                    continue;
                }
                let base = address.level <= layer.base.first().map_or(0, |tile| tile.level);
                // Shape before colour: nothing can be drawn without the coarsest elevation.
                let first = if base && layer.layer.is_elevation() { 1e9 } else { 0.0 };
                let second = if base { 1e6 } else { 0.0 };
                self.wishes.push(Wish { key, priority: first + second + node.error });
            }
        }
        self.requests.plan(now, &self.wishes)
    }

    /// The network.
    pub fn requests(&mut self) -> &mut Requests {
        &mut self.requests
    }

    /// When a tile that failed may be asked for again, seconds; `None` where none waits.
    pub fn next_retry(&self) -> Option<f64> {
        self.requests.next_retry(&self.wishes)
    }

    /// A tile has come and waits to be placed: it is not asked for again meanwhile.
    pub fn mark_arrived(&mut self, key: TileKey) {
        self.requests.succeeded(key);
        self.arrived.insert(key);
    }

    fn is_wanted(&self, key: &TileKey) -> bool {
        self.layer(key.layer).is_some_and(|layer| layer.cut.nodes.contains_key(&key.address))
    }

    fn layer(&self, layer: Layer) -> Option<&LayerStream> {
        if self.elevation.layer == layer {
            return Some(&self.elevation);
        }
        self.texture.as_ref().filter(|texture| texture.layer == layer)
    }

    /// Finds a slot for an elevation tile that has come; `None` where it needs none (it is empty) or has no room.
    pub fn place_elevation(&mut self, key: TileKey, summary: ElevationSummary) -> Option<u32> {
        self.arrived.remove(&key);
        if summary.is_empty() {
            self.elevation.pool.insert_empty(key.address);
            return None;
        }
        let slot = place(&mut self.elevation, key.address, &mut self.summaries)?;
        self.summaries.insert(key.address, summary);
        Some(slot)
    }

    /// Finds a slot for a photo tile that has come; `None` where there is no room.
    pub fn place_texture(&mut self, key: TileKey) -> Option<u32> {
        self.arrived.remove(&key);
        place(self.texture.as_mut()?, key.address, &mut HashMap::new())
    }

    /// Whether a tile that has come is still wanted.
    pub fn wants(&self, key: &TileKey) -> bool {
        self.is_wanted(key)
    }

    /// Whether the coarsest tiles have come (or will not): before that, drawing would leave holes.
    pub fn is_ready(&mut self) -> bool {
        if !self.drawn_ready {
            self.drawn_ready = self.elevation.base.iter().all(|&address| {
                let key = TileKey { layer: self.elevation.layer, address };
                self.elevation.pool.is_known(&address)
                    || self.requests.failure(&key).is_some_and(|failure| {
                        failure.attempts >= BASE_ATTEMPTS
                            || matches!(failure.last, FetchFailure::Permanent(_))
                    })
            });
        }
        self.drawn_ready
    }

    /// Whether all that there is has come and holds nothing: there is no terrain to show, on any level.
    pub fn is_empty(&self) -> bool {
        self.elevation.base.iter().all(|address| self.elevation.pool.is_empty_tile(address))
    }

    /// The page tables of a frame at `now` seconds.
    pub fn tables(&mut self, view: &ViewGeometry, now: f64) -> Tables {
        let wanted = |layer: &LayerStream| layer.cut.nodes.keys().copied().collect::<Vec<_>>();
        let keys = wanted(&self.elevation);
        self.elevation.pool.begin_frame(keys.iter());
        let mut tables = page_table::elevation(ElevationInput {
            grid: &self.grid,
            view,
            cut: &self.elevation.cut,
            pool: &mut self.elevation.pool,
            summaries: &self.summaries,
            fits: &mut self.fits,
            heights: self.heights,
            now,
            fade_seconds: self.fade_seconds,
        });
        if let Some(texture) = &mut self.texture {
            let keys = wanted(texture);
            texture.pool.begin_frame(keys.iter());
            let (pages, fading) =
                page_table::texture(&self.grid, &texture.cut, &mut texture.pool, now, self.fade_seconds);
            tables.pages = pages;
            tables.fading |= fading;
        }
        self.fading = tables.fading;
        tables
    }

    /// Whether the last frame's tables still had a tile fading in.
    pub fn is_fading(&self) -> bool {
        self.fading
    }

    /// Whether every tile that the view wants has come (and none waits to be placed).
    pub fn has_all(&self) -> bool {
        self.arrived.iter().all(|key| !self.is_wanted(key))
            && std::iter::once(&self.elevation)
                .chain(&self.texture)
                .all(|layer| layer.cut.nodes.keys().all(|address| layer.pool.is_known(address)))
    }

    /// Tiles that are wanted and have failed.
    pub fn failures(&self) -> impl Iterator<Item = (TileKey, &Failure)> {
        self.wishes.iter().filter_map(|wish| Some((wish.key, self.requests.failure(&wish.key)?)))
    }

    /// Tiles wanted, of all layers, and how many of them have come.
    pub fn progress(&self) -> (usize, usize) {
        std::iter::once(&self.elevation).chain(&self.texture).fold((0, 0), |(wanted, here), layer| {
            let known = layer.cut.nodes.keys().filter(|address| layer.pool.is_known(address)).count();
            (wanted + layer.cut.nodes.len(), here + known)
        })
    }

    /// The tiles wanted of each layer, in order of address.
    pub fn wanted(&self) -> Vec<(Layer, Vec<TileAddress>)> {
        std::iter::once(&self.elevation)
            .chain(&self.texture)
            .map(|layer| {
                let mut tiles: Vec<TileAddress> = layer.cut.nodes.keys().copied().collect();
                tiles.sort_unstable();
                (layer.layer, tiles)
            })
            .collect()
    }

    /// Whether slots ran out before every tile was as fine as allowed.
    pub fn is_limited(&self) -> bool {
        self.elevation.cut.limited || self.texture.as_ref().is_some_and(|texture| texture.cut.limited)
    }

    /// What the CPU keeps of a resident elevation tile.
    pub fn summary(&self, address: &TileAddress) -> Option<&ElevationSummary> {
        self.summaries.get(address)
    }

    /// Height of the drawn surface at a place (degrees) from the finest resident tile, metres; `None`
    /// outside the scene, in a void or before anything has come.
    pub fn ground_height(&self, longitude: f64, latitude: f64) -> Option<f64> {
        (0..=self.elevation.maximum_level).rev().find_map(|level| {
            let tile = TileAddress::at(level, longitude, latitude);
            let summary = self.summaries.get(&tile)?;
            let bounds = tile.bounds();
            let cells = f64::from(treeline_core::tile::CELLS) / (bounds.east - bounds.west);
            let longitude = (longitude - bounds.west).rem_euclid(360.0);
            summary.height(longitude * cells, (bounds.north - latitude) * cells)
        })
    }

    /// Tiles in slots, by layer.
    pub fn residents(&self) -> std::collections::BTreeMap<&'static str, usize> {
        let layers = std::iter::once(&self.elevation).chain(&self.texture);
        layers.map(|layer| (layer.layer.name(), layer.pool.used())).collect()
    }

    #[cfg(test)]
    fn pools(&self) -> [&Pool; 2] {
        [&self.elevation.pool, self.texture.as_ref().map_or(&self.elevation.pool, |texture| &texture.pool)]
    }
}

/// Places a tile and drops what is known of the one that made room.
fn place(
    layer: &mut LayerStream,
    address: TileAddress,
    summaries: &mut HashMap<TileAddress, ElevationSummary>,
) -> Option<u32> {
    let wanted: HashSet<TileAddress> = layer.cut.nodes.keys().chain(&layer.base).copied().collect();
    let (placement, evicted) = layer.pool.place(address, &wanted);
    if let Some(evicted) = evicted {
        summaries.remove(&evicted);
    }
    match placement {
        Placement::Slot(slot) => Some(slot),
        Placement::NoRoom => None,
    }
}
