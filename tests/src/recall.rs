//! How much of what a picture shows the Tile Load Map names, and how much of what it names is shown: the real engine
//! with a running server's tiles, against 16 rays a pixel.

use crate::http_tiles::HttpTiles;
use anyhow::Context;
use std::collections::BTreeSet;
use treeline_client::engine::{Engine, EngineOptions, ViewRequest, Weather};
use treeline_client::headless::{self, AdapterChoice, Capture, Session, TileFetcher};
use treeline_client::stream::StreamOptions;
use treeline_client::stream::view::ViewGeometry;
use treeline_core::camera::GeographicCamera;
use treeline_core::layer::Layer;
use treeline_core::scene::SceneLayer;
use treeline_core::tile::{self, TileAddress};

/// The picture whose tiles are named.
pub const SIZE: [u32; 2] = [160, 128];
/// Rays along a pixel's side, for the truth.
const RAYS: u32 = 4;

/// What a picture needs, and what the map named for it.
#[derive(Clone, Debug, Default)]
pub struct Sight {
    /// The tiles that the rays of 16 a pixel hit, each on the level that its distance wants.
    pub needed: BTreeSet<TileAddress>,
    /// Of these, those that a pixel's centre hits.
    pub centres: BTreeSet<TileAddress>,
    /// The tiles that the map named.
    pub named: BTreeSet<TileAddress>,
    /// Rays, of 16 a pixel, that hit nothing.
    pub misses: usize,
    /// How many times coarser than asked for tiles were wanted, so that all found a slot.
    pub threshold: f64,
}

/// Counts over many views.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    needed: usize,
    named: usize,
    found: usize,
    centres: usize,
    centres_found: usize,
}

impl Tally {
    /// Counts a view.
    pub fn add(&mut self, sight: &Sight) {
        self.needed += sight.needed.len();
        self.named += sight.named.len();
        self.found += sight.needed.intersection(&sight.named).count();
        self.centres += sight.centres.len();
        self.centres_found += sight.centres.intersection(&sight.named).count();
    }

    /// Share of the tiles under pixels' centres that were named.
    pub fn recall_of_centres(&self) -> f64 {
        share(self.centres_found, self.centres)
    }

    /// Share of the tiles under one of 16 rays a pixel that were named.
    pub fn recall(&self) -> f64 {
        share(self.found, self.needed)
    }

    /// Share of the named tiles that are under one of those rays.
    pub fn precision(&self) -> f64 {
        share(self.found, self.named)
    }
}

/// So near to a tile's edge, in texels, a place is on it: what filters the photo reads texels of both tiles there.
const EDGE_TEXELS: f64 = 1.0 / 16.0;

fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole.max(1) as f64
}

/// An engine with a server's tiles.
pub struct Surveyor {
    session: Session,
    tiles: HttpTiles,
    ground: SceneLayer,
    texel_pixels: f64,
}

impl Surveyor {
    /// Of the server at an address without a slash at the end.
    pub fn new(base: &str) -> anyhow::Result<Self> {
        let tiles = HttpTiles::new(base);
        let scene = tiles.scene()?;
        let ground =
            scene.layer(Layer::Texture).or(scene.layer(Layer::Elevation)).context("a layer")?.clone();
        let stream = StreamOptions { fade_seconds: 0.0, ..StreamOptions::default() };
        let texel_pixels = stream.texel_pixels;
        let options = EngineOptions { stream, uploads_per_step: usize::MAX, ..EngineOptions::default() };
        let engine = Engine::new(headless::open(AdapterChoice::Software)?, scene, options)?;
        let mut session = Session::new(engine, SIZE[0] * RAYS, SIZE[1] * RAYS, 2)?;
        session.engine.choose_for(SIZE);
        Ok(Self { session, tiles, ground, texel_pixels })
    }

    /// The layer whose tiles are named: the photo, or the elevation where there is none.
    pub fn ground(&self) -> &SceneLayer {
        &self.ground
    }

    /// Height of the surface at a place (degrees), metres; 0 where there are no data.
    pub fn height(&self, longitude: f64, latitude: f64) -> anyhow::Result<f64> {
        let (west, south) = (longitude - 1e-4, latitude - 1e-4);
        let url = format!(
            "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=combined-elevation&STYLES=&CRS=CRS:84\
             &BBOX={west},{south},{},{}&WIDTH=1&HEIGHT=1&FORMAT=application/bil32",
            west + 2e-4,
            south + 2e-4
        );
        let body = self.tiles.fetch(&url)?.body;
        let bytes: [u8; 4] = body[..].try_into().context("one sample")?;
        Ok(f64::from(f32::from_le_bytes(bytes)))
    }

    /// Settles a view and compares what the map named with what 16 rays a pixel hit.
    pub fn look(&mut self, camera: GeographicCamera) -> anyhow::Result<Sight> {
        let view = |size: [u32; 2]| ViewRequest {
            camera,
            width: size[0],
            height: size[1],
            sun_unix_seconds: None,
            shadow_steps: 0,
            weather: Weather::default(),
        };
        self.session.settle(&view(SIZE), &self.tiles)?;
        let engine = &self.session.engine;
        let named: BTreeSet<TileAddress> = engine.visible().iter().copied().collect();
        let threshold = engine.threshold().unwrap_or(1.0);
        let seen = ViewGeometry::new(&camera, SIZE[0], SIZE[1]);
        let texel_angle = self.texel_pixels * threshold * seen.pixel_angle;
        let centres = self.hit(&self.session.capture()?, &seen, texel_angle, &named);
        let size = SIZE.map(|side| side * RAYS);
        self.session.draw(&view(size))?;
        let fine = ViewGeometry::new(&camera, size[0], size[1]);
        let capture = self.session.capture()?;
        let needed = self.hit(&capture, &fine, texel_angle, &named);
        let misses = capture.distance.iter().filter(|distance| **distance < 0.0).count();
        Ok(Sight { needed, centres, named, misses, threshold })
    }

    /// The tiles that a picture's rays hit, each on the level whose texel fills no more than an angle there. Where that is a
    /// tile's edge, to a part of a texel, either tile will do: the other one is taken if it is named.
    fn hit(
        &self,
        capture: &Capture,
        view: &ViewGeometry,
        texel_angle: f64,
        named: &BTreeSet<TileAddress>,
    ) -> BTreeSet<TileAddress> {
        let width = view.size[0] as usize;
        let deepest = self.ground.maximum_level;
        let rays = capture.distance.iter().enumerate().filter(|(_, distance)| **distance >= 0.0);
        rays.map(|(index, &distance)| {
            let (x, y) = ((index % width) as f64, (index / width) as f64);
            let distance = f64::from(distance);
            let place = view.geodetic(view.direction(x + 0.5, y + 0.5) * distance);
            let longest = texel_angle * distance;
            let level = (0..deepest).find(|&level| tile::cell_metres(level) <= longest).unwrap_or(deepest);
            let tile = TileAddress::at(level, place.longitude, place.latitude);
            if named.contains(&tile) {
                return tile;
            }
            let off = EDGE_TEXELS * tile::span_degrees(level) / f64::from(tile::CELLS);
            let beside = [(off, 0.0), (-off, 0.0), (0.0, off), (0.0, -off)].map(|(east, north)| {
                TileAddress::at(level, place.longitude + east, (place.latitude + north).clamp(-90.0, 90.0))
            });
            beside.into_iter().find(|other| named.contains(other)).unwrap_or(tile)
        })
        .collect()
    }
}
