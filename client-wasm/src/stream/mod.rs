//! Streaming: which tiles a view wants, which are asked for, which slots they stand in, and what is
//! drawn meanwhile. A plain state machine: no GPU, no browser, no clock (time is passed in).
//!
//! Follow a frame: [`tile_choice`] cuts the quadtree, [`requests`] asks for what is missing,
//! [`decode`] unpacks what comes, [`residency`] finds it a slot, [`page_table`] draws.

mod choice;
pub mod decode;
pub mod ground_tiles;
mod land_cover;
pub mod load_map;
pub mod memory;
pub mod models;
pub mod page_table;
mod placing;
pub mod requests;
pub mod residency;
pub mod root_grid;
pub mod tile_choice;
pub mod tree_field;
mod turns;
pub mod undergrowth;
pub mod view;

#[cfg(test)]
pub(crate) mod simulation;

use crate::passes::compress_photo::PhotoFormat;
use choice::MapChoice;
use decode::ElevationSummary;
use load_map::threshold::Threshold;
use load_map::{Analysis, Depths};
use memory::{ElevationParts, Slots};
use page_table::{ElevationInput, FitCache, Tables};
use requests::{Failure, FetchFailure, Plan, Requests, TileKey, Wish};
use residency::Pool;
use root_grid::RootGrid;
use std::collections::{HashMap, HashSet};
use tile_choice::{Cut, TileChoice};
use tree_field::TreeField;
use treeline_core::geodesy::Geodetic;
use treeline_core::layer::Layer;
use treeline_core::scene::SceneDescription;
use treeline_core::tile::{self, GeographicBox, TileAddress};
use turns::Turns;
use undergrowth::{UndergrowthBlocks, UndergrowthField};
use view::ViewGeometry;

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
    /// Who chooses the tiles.
    pub tile_choice: TileChoice,
    /// GPU memory for all tiles together, bytes; [`memory`] says how it is shared. Less than what the coarsest
    /// tiles take counts as that.
    pub memory_budget_bytes: u64,
    /// What a photo tile takes of it, bytes; the engine says it, as its device holds them.
    pub texture_slot_bytes: u64,
    /// Largest size of a cell of the elevation map in the picture, pixels.
    pub cell_pixels: f64,
    /// Largest size of a photo texel in the picture, pixels, looked at squarely.
    pub texel_pixels: f64,
    /// Trees are drawn one by one up to this distance, metres, where any grow; 0 for none.
    pub tree_range_metres: f64,
    /// Undergrowth is drawn up to this distance, metres, where there is land cover; 0 for none.
    pub undergrowth_metres: f64,
    /// Requests under way at most.
    pub requests_in_flight: usize,
    /// How long a tile fades in, seconds; 0 for not at all.
    pub fade_seconds: f64,
}

impl Default for StreamOptions {
    fn default() -> Self {
        Self {
            surface: SurfaceChoice::Combined,
            tile_choice: TileChoice::default(),
            memory_budget_bytes: memory::DEFAULT_BUDGET_BYTES,
            texture_slot_bytes: PhotoFormat::default().tile_bytes(),
            cell_pixels: 1.42,
            texel_pixels: 1.42,
            tree_range_metres: 0.0,
            undergrowth_metres: 0.0,
            requests_in_flight: 8,
            fade_seconds: 0.3,
        }
    }
}

/// A base tile that has failed this often no longer keeps the rest of the scene from being drawn.
const BASE_ATTEMPTS: u32 = 6;
/// With more roots than this (a planet), only those in view are wanted of the photo.
const PINNED_TEXTURES: usize = 16;
/// Slots beside those of the coarsest tiles at least: less could not show a way down.
const SPARE_SLOTS: usize = 12;
/// An eye with a crown so near, metres, and higher than it, is among the trees.
const AMONG_TREES_METRES: f64 = 8.0;

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
    /// Base tiles that are wanted whatever the map says.
    pinned: usize,
}

/// The state machine.
#[derive(Debug)]
pub struct Stream {
    /// Where the page tables begin.
    pub grid: RootGrid,
    heights: (f64, f64),
    elevation: LayerStream,
    texture: Option<LayerStream>,
    /// What grows about the eye, where trees are drawn one by one.
    land_cover: Option<(TreeField, LayerStream)>,
    /// What grows on the ground near it.
    undergrowth: Option<UndergrowthField>,
    map: Option<MapChoice>,
    slots: Slots,
    summaries: HashMap<TileAddress, ElevationSummary>,
    requests: Requests,
    arrived: HashSet<TileKey>,
    wishes: Vec<Wish>,
    fits: FitCache,
    fade_seconds: f64,
    fading: bool,
    drawn_ready: bool,
    /// [`Self::signature`] of the last tables.
    drawn_signature: u64,
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
        let photo = scene.layer(Layer::Texture);
        // The photo's page table begins at the roots.
        let photo_base: Option<Vec<TileAddress>> =
            photo.map(|row| grid.tiles().filter(|root| row.extent.intersects(&root.bounds())).collect());
        let parts = ElevationParts {
            surface: row.name == Layer::CombinedElevation,
            minima: options.tile_choice == TileChoice::LoadMap,
        };
        let least = |base: usize| (base.min(PINNED_TEXTURES) + SPARE_SLOTS) as u32;
        let least = (least(base.len()), photo_base.as_ref().map(|base| least(base.len())));
        let field = TreeField::new(scene, options.tree_range_metres).filter(|_| parts.surface);
        let undergrowth = UndergrowthField::new(scene, options.undergrowth_metres).filter(|_| parts.surface);
        let cover_slots = field.as_ref().map_or((0, 0), |field| (field.slots(), field.slot_bytes()));
        let slots = Slots::of_budget(
            options.memory_budget_bytes,
            parts,
            options.texture_slot_bytes,
            cover_slots,
            least,
        );
        let elevation = LayerStream {
            layer: row.name,
            base: base.tiles().collect(),
            maximum_level: row.maximum_level,
            extent,
            cell_pixels: options.cell_pixels,
            pool: Pool::new(slots.elevation),
            cut: Cut::default(),
            pinned: base.len(),
        };
        let texture = photo.zip(photo_base).map(|(row, base)| LayerStream {
            layer: Layer::Texture,
            base,
            maximum_level: row.maximum_level,
            extent: row.extent,
            cell_pixels: options.texel_pixels,
            pool: Pool::new(slots.texture),
            cut: Cut::default(),
            pinned: 0,
        });
        let land_cover = field.map(|field| {
            let layer = LayerStream {
                layer: Layer::Lcc,
                base: Vec::new(),
                maximum_level: field.level(),
                extent: field.extent,
                cell_pixels: options.cell_pixels,
                pool: Pool::new(slots.land_cover),
                cut: Cut::default(),
                pinned: 0,
            };
            (field, layer)
        });
        let map = (options.tile_choice == TileChoice::LoadMap).then(|| {
            let depths = Depths {
                texture: texture.as_ref().map(|texture| texture.maximum_level),
                elevation: elevation.maximum_level,
                elevation_coarser: (options.cell_pixels / options.texel_pixels).max(1.0).log2() as u8,
                land_cover: scene.land_cover.filter(|_| scene.vegetation),
            };
            MapChoice {
                analysis: Analysis::new(depths),
                // Heights go by the photo's levels, some of them coarser.
                deepest: (elevation.maximum_level + depths.elevation_coarser)
                    .max(depths.texture.unwrap_or(0)),
                vegetation: depths.land_cover.map(|_| scene.seed),
                threshold: Threshold::default(),
                turns: Turns::default(),
                texel_pixels: options.texel_pixels,
                scratch: Vec::new(),
            }
        });
        Ok(Self {
            grid,
            heights: (scene.minimum_height, scene.maximum_height.max(scene.minimum_height)),
            elevation,
            texture,
            land_cover,
            undergrowth,
            map,
            slots,
            summaries: HashMap::new(),
            requests: Requests::new(options.requests_in_flight),
            arrived: HashSet::new(),
            wishes: Vec::new(),
            fits: FitCache::default(),
            fade_seconds: options.fade_seconds.max(0.0),
            fading: false,
            drawn_ready: false,
            drawn_signature: 0,
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

    /// The slots that the budget buys, and what they consist of.
    pub fn slots(&self) -> &Slots {
        &self.slots
    }

    /// GPU memory of the slots that hold a tile, bytes.
    pub fn used_bytes(&self) -> u64 {
        let texture = self.texture.as_ref().map_or(0, |texture| texture.pool.used());
        let land_cover = self.land_cover.as_ref().map_or(0, |(_, layer)| layer.pool.used());
        self.slots.bytes(self.elevation.pool.used(), texture, land_cover)
    }

    /// Whether a tile has come: it stands in a slot, waits for one, or is known to hold nothing.
    pub fn has(&self, key: &TileKey) -> bool {
        self.arrived.contains(key)
            || self.layer(key.layer).is_some_and(|layer| layer.pool.is_known(&key.address))
    }

    /// The tiles of a layer that stand in slots.
    pub fn resident_tiles(&self, layer: Layer) -> impl Iterator<Item = TileAddress> + '_ {
        let pool = self.layer(layer).map(|layer| &layer.pool);
        pool.into_iter().flat_map(|pool| pool.residents().map(|(&address, _)| address))
    }

    /// Plans the network: what to ask for and what to abort, given the last choice. `map_holds`: no newer map
    /// is to be made or on its way. Until then, and until all that is surely needed has come, tiles of which only
    /// their bounds say that they may be in sight wait: a finer surface will hide many of them.
    pub fn plan(&mut self, now: f64, map_holds: bool) -> Plan {
        self.wishes.clear();
        let land_cover = self.land_cover.as_ref().map(|(_, layer)| layer);
        for layer in std::iter::once(&self.elevation).chain(&self.texture).chain(land_cover) {
            for (&address, node) in &layer.cut.nodes {
                let key = TileKey { layer: layer.layer, address };
                if layer.pool.is_known(&address) || self.arrived.contains(&key) {
                    continue;
                }
                let base = address.level <= layer.base.first().map_or(0, |tile| tile.level);
                // Shape before colour: nothing can be drawn without the coarsest elevation.
                let first = if base && layer.layer.is_elevation() { 1e18 } else { 0.0 };
                let second = if base { 1e15 } else { 0.0 };
                let priority = first + second + node.error;
                self.wishes.push(Wish { key, priority, waits: !node.sure });
            }
        }
        let retries =
            |wish: &Wish| self.requests.failure(&wish.key).is_some_and(|failure| failure.not_before > now);
        if map_holds && !self.wishes.iter().any(|wish| !wish.waits && !retries(wish)) {
            self.wishes.iter_mut().for_each(|wish| wish.waits = false);
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
        self.layers().find(|known| known.layer == layer)
    }

    fn layers(&self) -> impl Iterator<Item = &LayerStream> {
        let land_cover = self.land_cover.as_ref().map(|(_, layer)| layer);
        std::iter::once(&self.elevation).chain(&self.texture).chain(land_cover)
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
        self.drawn_signature = self.signature();
        self.elevation.pool.begin_frame(self.elevation.cut.nodes.keys());
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
            texture.pool.begin_frame(texture.cut.nodes.keys());
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
            && self.layers().all(|layer| layer.cut.nodes.keys().all(|address| layer.pool.is_known(address)))
    }

    /// Whether every tile that is surely needed has come: a map of what there is now may say more of the others.
    pub fn has_all_sure(&self) -> bool {
        self.arrived.iter().all(|key| !self.is_wanted(key))
            && self.layers().all(|layer| {
                layer.cut.nodes.iter().all(|(address, node)| !node.sure || layer.pool.is_known(address))
            })
    }

    /// Tiles that are wanted and have failed.
    pub fn failures(&self) -> impl Iterator<Item = (TileKey, &Failure)> {
        self.wishes.iter().filter_map(|wish| Some((wish.key, self.requests.failure(&wish.key)?)))
    }

    /// Tiles wanted, of all layers, and how many of them have come.
    pub fn progress(&self) -> (usize, usize) {
        self.layers().fold((0, 0), |(wanted, here), layer| {
            let known = layer.cut.nodes.keys().filter(|address| layer.pool.is_known(address)).count();
            (wanted + layer.cut.nodes.len(), here + known)
        })
    }

    /// The tiles wanted of each layer, in order of address.
    pub fn wanted(&self) -> Vec<(Layer, Vec<TileAddress>)> {
        self.layers()
            .map(|layer| {
                let mut tiles: Vec<TileAddress> = layer.cut.nodes.keys().copied().collect();
                tiles.sort_unstable();
                (layer.layer, tiles)
            })
            .collect()
    }

    /// Whether slots ran out before every tile was as fine as allowed.
    pub fn is_limited(&self) -> bool {
        self.elevation.cut.limited
            || self.texture.as_ref().is_some_and(|texture| texture.cut.limited)
            || self.threshold().is_some_and(|threshold| threshold > 1.0)
    }

    /// What the CPU keeps of a resident elevation tile.
    pub fn summary(&self, address: &TileAddress) -> Option<&ElevationSummary> {
        self.summaries.get(address)
    }

    /// Height of the drawn surface at a place (degrees) from the finest resident tile, metres; `None`
    /// outside the scene, in a void or before anything has come.
    pub fn ground_height(&self, longitude: f64, latitude: f64) -> Option<f64> {
        self.find_ground(longitude, latitude, ElevationSummary::height)
    }

    /// Between which heights the ground below the canopy lies about a place (degrees), by the finest resident tile,
    /// metres; `None` as of [`Self::ground_height`], and where nothing grows.
    pub fn ground_between(&self, longitude: f64, latitude: f64) -> Option<[f32; 2]> {
        self.find_ground(longitude, latitude, ElevationSummary::ground_between)
    }

    /// Whether an eye is below the canopy's surface and above the ground: among the trees.
    pub fn is_under_canopy(&self, view: &ViewGeometry) -> bool {
        let eye = view.eye;
        let surface = self.ground_height(eye.longitude, eye.latitude);
        let ground = self.ground_between(eye.longitude, eye.latitude);
        surface.is_some_and(|surface| surface > eye.height)
            && ground.is_some_and(|[lowest, _]| f64::from(lowest) < eye.height)
    }

    /// Whether an eye is among trees that are drawn one by one: below their tops, with one of them within some metres. It
    /// sees between trunks what the surface of the heights hides from it, and so from the load map.
    pub fn is_among_trees(&self, view: &ViewGeometry) -> bool {
        let Geodetic { longitude, latitude, height } = view.eye;
        let over_ground =
            || self.ground_between(longitude, latitude).is_some_and(|[lowest, _]| f64::from(lowest) < height);
        let below_trees = || {
            self.known_at(longitude, latitude).find_map(|(level, summary, u, v)| {
                let reach = AMONG_TREES_METRES / tile::cell_metres(level);
                summary.has_canopy_over(height as f32, (u - reach, v - reach), 2.0 * reach)
            })
        };
        self.land_cover.is_some() && over_ground() && below_trees().unwrap_or(false)
    }

    /// What the finest resident tile that knows says of a place: it is asked in cells from its north-west node.
    fn find_ground<T>(
        &self,
        longitude: f64,
        latitude: f64,
        ask: impl Fn(&ElevationSummary, f64, f64) -> Option<T>,
    ) -> Option<T> {
        self.known_at(longitude, latitude).find_map(|(_, summary, u, v)| ask(summary, u, v))
    }

    /// The resident tiles that cover a place, finest first: level, summary, and the place in cells from its north-west node.
    fn known_at(
        &self,
        longitude: f64,
        latitude: f64,
    ) -> impl Iterator<Item = (u8, &ElevationSummary, f64, f64)> {
        (0..=self.elevation.maximum_level).rev().filter_map(move |level| {
            let tile = TileAddress::at(level, longitude, latitude);
            let summary = self.summaries.get(&tile)?;
            let bounds = tile.bounds();
            let cells = f64::from(tile::CELLS) / (bounds.east - bounds.west);
            let longitude = (longitude - bounds.west).rem_euclid(360.0);
            Some((level, summary, longitude * cells, (bounds.north - latitude) * cells))
        })
    }

    /// The undergrowth that a frame looks at; `None` where there is none near, or the eye is higher over the ground than
    /// it reaches.
    pub fn undergrowth_blocks(&self, view: &ViewGeometry) -> Option<UndergrowthBlocks> {
        let field = self.undergrowth.as_ref()?;
        let place = view.eye;
        let [_, highest] = self.ground_between(place.longitude, place.latitude)?;
        if place.height - f64::from(highest) > field.range() {
            return None;
        }
        field.blocks_in_sight(view, |longitude, latitude| self.ground_between(longitude, latitude))
    }

    /// Whether a tile of the photo is here, or the scene has none.
    pub fn shows_ground(&self) -> bool {
        self.texture.as_ref().is_none_or(|texture| texture.pool.used() > 0)
    }

    /// Tiles in slots, by layer.
    pub fn residents(&self) -> std::collections::BTreeMap<&'static str, usize> {
        self.layers().map(|layer| (layer.layer.name(), layer.pool.used())).collect()
    }

    #[cfg(test)]
    fn pools(&self) -> [&Pool; 2] {
        [&self.elevation.pool, self.texture.as_ref().map_or(&self.elevation.pool, |texture| &texture.pool)]
    }
}
