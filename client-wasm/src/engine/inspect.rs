//! What a host may ask the engine: places in the picture, tiles, counters.

use super::Engine;
use crate::gpu::targets::Targets;
use crate::stats::Stats;
use crate::stream::ground_tiles::GroundTile;
use crate::stream::load_map::Analysis;
use crate::stream::memory::MemoryStats;
use crate::stream::page_table::Tables;
use crate::stream::requests::{Failure, TileKey};
use crate::stream::view::ViewGeometry;
use crate::survey::SurveyStats;
use crate::twin_world;
use treeline_core::geodesy::Geodetic;
use treeline_core::layer::Layer;
use treeline_core::tile::TileAddress;

impl Engine {
    /// Height of the ground (canopy included, where it is drawn) at a place from the finest resident
    /// tile, metres; `None` outside the scene, in a void or before anything has come.
    pub fn ground_height(&self, longitude: f64, latitude: f64) -> Option<f64> {
        self.stream.ground_height(longitude, latitude)
    }

    /// The place that the last frame shows at a picture position (pixels from the top left); `None` for
    /// the sky, or before a frame.
    pub fn pick(&self, x: f64, y: f64) -> Option<Geodetic> {
        let drawn = self.drawn.as_ref()?;
        let direction = drawn.geometry.direction(x, y);
        let hit = twin_world::cast(&self.stream, &drawn.view, &drawn.tables, direction)?;
        Some(drawn.geometry.geodetic(direction * hit))
    }

    /// Of the last frame, by the twin: for each pixel whether the twin hits. Slow: for statistics.
    pub fn twin_hits(&self) -> Vec<bool> {
        self.drawn
            .as_ref()
            .map_or_else(Vec::new, |drawn| twin_world::hits(&self.stream, &drawn.view, &drawn.tables))
    }

    /// The geometry of the last frame.
    pub fn drawn_geometry(&self) -> Option<&ViewGeometry> {
        self.drawn.as_ref().map(|drawn| &drawn.geometry)
    }

    /// What the last frame's terrain pass wrote.
    pub fn targets(&self) -> Option<&Targets> {
        self.renderer.targets()
    }

    /// The tiles that the view wants of each layer, ancestors included.
    pub fn wanted(&self) -> Vec<(Layer, Vec<TileAddress>)> {
        self.stream.wanted()
    }

    /// The tiles of the ground in sight by the last map, each on the level that it wants; empty where the
    /// quadtree chooses.
    pub fn visible(&self) -> &[TileAddress] {
        self.stream.visible()
    }

    /// Whether a tile has come: it stands in a slot, waits for one, or is known to hold nothing.
    pub fn has(&self, key: &TileKey) -> bool {
        self.stream.has(key)
    }

    /// The tiles of a layer that stand in slots.
    pub fn resident_tiles(&self, layer: Layer) -> impl Iterator<Item = TileAddress> + '_ {
        self.stream.resident_tiles(layer)
    }

    /// How many times coarser than asked for tiles are wanted, so that all in sight find a slot; `None` where
    /// the quadtree chooses.
    pub fn threshold(&self) -> Option<f64> {
        self.stream.threshold()
    }

    /// The page tables of the last frame.
    pub fn drawn_tables(&self) -> Option<&Tables> {
        self.drawn.as_ref().map(|drawn| &drawn.tables)
    }

    /// The tiles of the ground (of the photo, or of the elevation where there is none) that are in sight,
    /// wanted or resident; coarsest first.
    pub fn ground_tiles(&self) -> Vec<GroundTile> {
        self.stream.ground_tiles()
    }

    /// The lists read from the last map; `None` where the quadtree chooses.
    pub fn analysis(&self) -> Option<&Analysis> {
        self.stream.analysis()
    }

    /// Tiles that are wanted and have failed.
    pub fn failures(&self) -> impl Iterator<Item = (TileKey, &Failure)> {
        self.stream.failures()
    }

    /// Forgets the times of passes so far.
    pub fn clear_times(&mut self) {
        self.renderer.clear_times();
    }

    fn survey_stats(&self) -> Option<SurveyStats> {
        let threshold = self.stream.threshold()?;
        Some(SurveyStats { threshold, ..self.survey.stats() })
    }

    /// Counters since the engine was made.
    pub fn stats(&mut self) -> Stats {
        let mut requests = self.counters;
        requests.in_flight = self.stream.requests().in_flight();
        let mut pipelines = self.renderer.pipelines();
        if self.arrays.compress_photo().is_some() {
            pipelines.push("compress_photo");
        }
        Stats {
            adapter: self.gpu.adapter_name(),
            passes: self.renderer.pass_milliseconds().into_iter().collect(),
            pipelines,
            tiles: self.tiles.clone(),
            bytes: self.bytes.clone(),
            resident: self.stream.residents(),
            requests,
            frames: self.frames,
            survey: self.survey_stats(),
            seeds: self.renderer.seed_stats(&self.gpu),
            undergrowth: self.renderer.undergrowth_stats(&self.gpu),
            memory: MemoryStats {
                budget_bytes: self.stream.slots().budget_bytes,
                used_bytes: self.stream.used_bytes(),
                allocated_bytes: self.arrays.bytes(),
                photo_format: self.arrays.photo_format(),
            },
            limited: self.stream.is_limited(),
        }
    }
}
