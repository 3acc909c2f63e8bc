//! The engine: what a host calls. It never blocks and reads no clock.
//!
//! A host calls [`Engine::step`] with the time and the view, fetches what the report asks for, and
//! hands the answers to [`Engine::deliver`] whenever they come.

mod exchange;
mod inspect;
mod trees;

pub use exchange::{
    DEFAULT_SHADOW_STEPS, DEFAULT_TREE_METRES, DEFAULT_UNDERGROWTH_METRES, EngineError, EngineOptions,
    FrameReport, HandOver, Payload, PhotoPixels, Resource, TileRequest, ViewRequest, Weather,
};

use crate::frame::{FramePlants, FrameRenderer, FrameTarget, FrameTrees};
use crate::gpu::GpuContext;
use crate::gpu::tile_arrays::TileArrays;
use crate::passes::compress_photo::PhotoFormat;
use crate::stats::RequestStats;
use crate::stream::Stream;
use crate::stream::decode::{self, ElevationPixels, LandCoverPixels, TEXTURE_SIDE};
use crate::stream::load_map::Reading;
use crate::stream::models::Models;
use crate::stream::page_table::Tables;
use crate::stream::requests::{FetchFailure, RequestId, TileKey};
use crate::stream::tile_choice::TileChoice;
use crate::stream::tree_field::SeedFrameCells;
use crate::stream::undergrowth::UndergrowthBlocks;
use crate::stream::view::ViewGeometry;
use crate::survey::{Survey, Ticket};
use std::collections::{BTreeMap, HashMap, HashSet};
use treeline_core::geodesy::{self};
use treeline_core::layer::Layer;
use treeline_core::query::get_map_query;
use treeline_core::scene::{SceneDescription, SceneSpecies};
use treeline_core::seeds::season::{self, YearDay};
use treeline_core::sun::{SunPosition, unix_seconds_from_rfc3339};
use treeline_shaders::layout::{EYE_BELOW, HARD_SWITCH, View};
use treeline_shaders::season::{FLAG_SEASON, rows as season_rows, season_of_view};
use treeline_shaders::trees::TreeCells;

/// A tile that came and waits for its upload.
#[derive(Debug)]
enum Arrived {
    Elevation(TileKey, ElevationPixels),
    LandCover(TileKey, LandCoverPixels),
    Photo(TileKey, PhotoPixels),
}

impl Arrived {
    fn key(&self) -> &TileKey {
        match self {
            Self::Elevation(key, _) | Self::LandCover(key, _) | Self::Photo(key, _) => key,
        }
    }
}

/// The engine.
#[derive(Debug)]
pub struct Engine {
    gpu: GpuContext,
    scene: SceneDescription,
    sun_unix_seconds: f64,
    options: EngineOptions,
    stream: Stream,
    arrays: TileArrays,
    renderer: FrameRenderer,
    models: Models,
    /// Slots of elevation tiles with any canopy.
    wooded: HashSet<u32>,
    arrived: Vec<Arrived>,
    survey: Survey,
    /// Whether the landscape has been drawn with its photo, where it has one.
    has_shown: bool,
    /// Rays that the last map was made with.
    surveyed: Option<[u32; 2]>,
    /// When requests under way were started, seconds.
    started: HashMap<RequestId, f64>,
    /// The view of the last choice of tiles.
    chosen: Option<ViewGeometry>,
    /// Size that tiles are chosen for; the picture's own where `None`.
    choice_size: Option<[u32; 2]>,
    /// The last frame drawn.
    drawn: Option<Drawn>,
    stale: bool,
    counters: RequestStats,
    tiles: BTreeMap<&'static str, u64>,
    bytes: BTreeMap<&'static str, u64>,
    frames: u64,
}

/// The last frame.
#[derive(Debug)]
struct Drawn {
    request: ViewRequest,
    geometry: ViewGeometry,
    view: View,
    tables: Tables,
    seeds: Option<SeedFrameCells>,
    undergrowth: Option<UndergrowthBlocks>,
}

impl Engine {
    /// For a scene as the server describes it. Nothing is compiled or allocated that only a frame needs.
    pub fn new(
        gpu: GpuContext,
        scene: SceneDescription,
        mut options: EngineOptions,
    ) -> Result<Self, EngineError> {
        let on_processor = gpu.info.device_type == wgpu::DeviceType::Cpu;
        let photo = PhotoFormat::choose(options.photo_compression, gpu.device.features(), on_processor);
        options.stream.texture_slot_bytes = photo.tile_bytes();
        options.stream.tree_range_metres =
            options.tree_metres.unwrap_or(DEFAULT_TREE_METRES[usize::from(on_processor)]);
        options.stream.undergrowth_metres =
            options.undergrowth_metres.unwrap_or(DEFAULT_UNDERGROWTH_METRES[usize::from(on_processor)]);
        let stream = Stream::new(&scene, &options.stream)?;
        let sun_unix_seconds = unix_seconds_from_rfc3339(&scene.sun.time)?;
        let slots = stream.slots();
        let mut arrays =
            TileArrays::new(&gpu.device, slots.elevation, slots.texture, slots.parts.surface, photo);
        if slots.parts.minima {
            arrays = arrays.with_minima(&gpu.device);
        }
        let renderer = FrameRenderer::new(&gpu, options.count_fetches);
        let years = season::table(scene.species.iter().map(|species| (species.code, &species.definition)));
        renderer.write_seasons(&gpu, &season_rows(&years));
        let models = Models::new(&scene);
        Ok(Self {
            gpu,
            scene,
            sun_unix_seconds,
            options,
            stream,
            arrays,
            renderer,
            models,
            wooded: HashSet::new(),
            arrived: Vec::new(),
            survey: Survey::default(),
            has_shown: false,
            surveyed: None,
            started: HashMap::new(),
            chosen: None,
            choice_size: None,
            drawn: None,
            stale: true,
            counters: RequestStats::default(),
            tiles: BTreeMap::new(),
            bytes: BTreeMap::new(),
            frames: 0,
        })
    }

    /// The scene.
    pub fn scene(&self) -> &SceneDescription {
        &self.scene
    }

    /// The device.
    pub fn gpu(&self) -> &GpuContext {
        &self.gpu
    }

    /// One step at `now` seconds (any clock that does not go back). Draws into the target when something
    /// changed, or not at all.
    pub fn step(&mut self, now: f64, request: &ViewRequest, target: Option<&FrameTarget<'_>>) -> FrameReport {
        let geometry = ViewGeometry::new(&request.camera, request.width, request.height);
        let choice = self.choice_view(request);
        self.survey.sees(&choice, now);
        self.read_maps(now);
        let arrived = self.upload();
        // What has come says more about what lies below it.
        if arrived || self.chosen.as_ref() != Some(&choice) {
            self.stream.choose(&choice);
            self.survey.changed();
            self.chosen = Some(choice);
        }
        self.stale |= arrived;
        let map_holds = self.survey.is_known() && self.arrived.is_empty();
        let plan = self.stream.plan(now, map_holds);
        self.counters.started += plan.start.len() as u64;
        self.counters.cancelled += plan.cancel.len() as u64;
        self.started.extend(plan.start.iter().map(|(id, _)| (*id, now)));
        for id in &plan.cancel {
            self.started.remove(id);
        }
        let ready = self.stream.is_ready();
        let drawn = match target {
            Some(target) if ready && self.is_outdated(request) => {
                self.draw(now, request, geometry, target);
                true
            }
            _ => {
                self.make_map_apart(now, request, geometry);
                false
            }
        };
        let mut requests: Vec<TileRequest> =
            plan.start.into_iter().map(|(id, key)| self.request(id, key)).collect();
        requests.extend(self.model_requests(now));
        let complete =
            self.arrived.is_empty() && self.stream.has_all() && !self.awaits_map() && self.has_models();
        FrameReport {
            drawn,
            complete,
            settled: ready
                && complete
                && self.drawn.as_ref().is_some_and(|drawn| drawn.request == *request)
                && !self.stale
                && !self.stream.is_fading(),
            requests,
            cancelled: plan.cancel,
            progress: self.stream.progress(),
            ready,
            fading: self.stream.is_fading(),
            retry_at: [self.stream.next_retry(), self.models.next_retry()]
                .into_iter()
                .flatten()
                .min_by(f64::total_cmp),
        }
    }

    /// The view that tiles are chosen for.
    fn choice_view(&self, request: &ViewRequest) -> ViewGeometry {
        let [width, height] = self.choice_size.unwrap_or([request.width, request.height]);
        ViewGeometry::new(&request.camera, width, height)
    }

    /// Takes in the maps that have come back; never waits for one.
    fn read_maps(&mut self, now: f64) {
        let frames = self.frames;
        let (stream, survey) = (&mut self.stream, &mut self.survey);
        let mut changes = false;
        let mut crowded = false;
        self.renderer.poll_map(&self.gpu, |ticket, cells, pixels| {
            survey.read(&ticket, now, frames);
            let reading = Reading { cells, pixels };
            changes |= stream.read_map(now, &ticket.view, &ticket.stack, reading, ticket.moves);
            // Where slots ran out the next map is made with another threshold.
            crowded |= stream
                .stack(&ticket.view, None)
                .is_some_and(|stack| stack.frame.texel_angle != ticket.stack.frame.texel_angle);
        });
        if changes || crowded {
            survey.changed();
            self.stale |= changes;
        }
    }

    /// Whether the choice of tiles still waits for a map.
    fn awaits_map(&mut self) -> bool {
        self.options.stream.tile_choice == TileChoice::LoadMap
            && self.stream.is_ready()
            && !self.survey.is_known()
    }

    /// A map for the next submission, where one is due.
    fn map_due(&mut self, now: f64, view: &ViewGeometry) -> Option<Ticket> {
        if !self.survey.is_due() {
            return None;
        }
        let stack = self.stream.stack(view, self.survey.look_ahead(view))?;
        Some(self.survey.made(stack, view.clone(), now, self.frames))
    }

    /// Makes a map without a picture: where the host draws none now, and nothing that was asked for is still
    /// to come (each tile that comes would make another one due).
    fn make_map_apart(&mut self, now: f64, request: &ViewRequest, geometry: ViewGeometry) {
        if !self.awaits_map()
            || !self.survey.is_due()
            || !self.arrived.is_empty()
            || !self.stream.has_all_sure()
        {
            return;
        }
        let choice = self.choice_view(request);
        let Some(ticket) = self.map_due(now, &choice) else { return };
        self.surveyed = Some(geometry.size);
        let tables = self.stream.tables(&geometry, now);
        let view = self.view(request, &geometry);
        if !self.renderer.survey(&self.gpu, &self.arrays, &view, &tables, ticket) {
            self.survey.not_made();
        }
        // The targets now hold this view; the picture does not.
        self.stale = true;
    }

    /// From now on tiles are chosen for a picture of this size, pixels, whatever the size of what is
    /// drawn: a host that draws fewer pixels for a while does not want coarser tiles then.
    pub fn choose_for(&mut self, size: [u32; 2]) {
        self.choice_size = Some(size);
    }

    /// Whether a step with this view would draw a frame: a host that must not ask for a target in vain
    /// asks here first.
    pub fn wants_frame(&mut self, request: &ViewRequest) -> bool {
        self.stream.is_ready() && (!self.arrived.is_empty() || self.is_outdated(request))
    }

    /// Whether a step with this view has something to do at once, without any further answer.
    pub fn wants_step(&mut self, request: &ViewRequest) -> bool {
        !self.arrived.is_empty()
            || self.wants_frame(request)
            || self.renderer.has_map()
            || (self.awaits_map() && self.survey.is_due() && self.stream.has_all_sure())
    }

    /// Whether the last frame is not what a frame of this view would show now.
    fn is_outdated(&self, request: &ViewRequest) -> bool {
        self.stale
            || self.stream.is_fading()
            || self.drawn.as_ref().is_none_or(|drawn| drawn.request != *request)
    }

    /// The next step draws even if nothing has changed (the target was resized or lost its content).
    pub fn invalidate(&mut self) {
        self.stale = true;
    }

    fn request(&self, id: RequestId, key: TileKey) -> TileRequest {
        let query = get_map_query(key.layer, key.address, &self.scene.revision);
        TileRequest { id, resource: Resource::Tile(key), url: format!("{}{query}", self.scene.wms) }
    }

    fn draw(&mut self, now: f64, request: &ViewRequest, geometry: ViewGeometry, target: &FrameTarget<'_>) {
        let tables = self.stream.tables(&geometry, now);
        let view = self.view(request, &geometry);
        if self.surveyed != Some(geometry.size) {
            // More rays see more.
            self.survey.changed();
        }
        // The first landscape does not wait for the map's pipelines.
        let ticket = if self.has_shown { self.map_due(now, &self.choice_view(request)) } else { None };
        if ticket.is_some() {
            self.surveyed = Some(geometry.size);
        }
        let map_holds = self.survey.is_known();
        let seeds = self.stream.seed_cells(&geometry, map_holds);
        let species = self.stream.tree_field().map_or(&[][..], |field| &field.species);
        let under = [u32::from(self.stream.is_under_canopy(&geometry)), 0, 0, 0];
        let trees = seeds.as_ref().map(|seeds| {
            let window = TreeCells { under, ..seeds.window() };
            FrameTrees { seeds, species, window }
        });
        let undergrowth = self.stream.undergrowth_blocks(&geometry);
        let plants = FramePlants { trees, undergrowth: undergrowth.as_ref() };
        if !self.renderer.draw(&self.gpu, &self.arrays, &view, &tables, target, plants, ticket) {
            self.survey.not_made();
        }
        self.drawn = Some(Drawn { request: request.clone(), geometry, view, tables, seeds, undergrowth });
        self.stale = false;
        self.frames += 1;
        self.has_shown |= self.stream.shows_ground();
    }

    /// What every pass knows of the frame; from here on everything is relative to the eye.
    fn view(&self, request: &ViewRequest, geometry: &ViewGeometry) -> View {
        let eye = geometry.eye;
        let time = request.sun_unix_seconds.unwrap_or(self.sun_unix_seconds);
        let sun = SunPosition::at(time, eye.longitude, eye.latitude).direction_enu();
        let year = YearDay::at(time, eye.latitude);
        let hard = if self.options.hand_over == HandOver::Hard { HARD_SWITCH } else { 0 };
        let surface = self.stream.ground_height(eye.longitude, eye.latitude);
        let below = if surface.is_some_and(|surface| surface > eye.height) { EYE_BELOW } else { 0 };
        let axis =
            |vector: glam::DVec3, last: f64| [vector.x as f32, vector.y as f32, vector.z as f32, last as f32];
        let grid = &self.stream.grid;
        let over = grid.coordinates(eye.longitude, eye.latitude);
        let mut view = View {
            right: axis(geometry.right * geometry.tangent_x, geometry.pixel_angle),
            up: axis(geometry.up * geometry.tangent_y, eye.height),
            forward: axis(geometry.forward, self.scene.maximum_height),
            sun: axis(sun, geodesy::gaussian_radius(eye.latitude)),
            size: geometry.size,
            root_size: [grid.columns, grid.rows],
            eye_grid: over.unwrap_or_default(),
            eye_inside: u32::from(over.is_some()),
            wraps: u32::from(grid.wraps()),
            root_level: u32::from(grid.level),
            shadow_steps: request.shadow_steps,
            flags: hard | below | if year.is_some() { FLAG_SEASON } else { 0 },
            // Dithering stands still: a picture is a function of its view.
            frame: 0,
            grid_place: grid.place(),
            tree_size: typical_tree(&self.scene.species),
            scene_seed: self.scene.seed,
            season: year.map_or([0.0; 4], |day| season_of_view(&day, eye.latitude)),
            ..View::default()
        };
        let latitude = self.scene.extent.centre().1;
        request.weather.write(&mut view, [eye.longitude, eye.latitude], latitude);
        view
    }

    /// A request's answer. One that was cancelled is ignored.
    pub fn deliver(&mut self, now: f64, id: RequestId, answer: Result<Payload, FetchFailure>) {
        if self.models.is_asked(id) {
            return self.deliver_model(now, id, answer);
        }
        if let Some(start) = self.started.remove(&id)
            && answer.is_ok()
        {
            self.survey.fetched(now - start);
        }
        let Some(key) = self.stream.requests().finish(id) else { return };
        match answer.and_then(|payload| self.decode(key, payload)) {
            Ok(arrived) => {
                self.counters.succeeded += 1;
                *self.tiles.entry(key.layer.name()).or_default() += 1;
                self.stream.mark_arrived(key);
                self.arrived.push(arrived);
            }
            Err(failure) => {
                self.counters.failed += 1;
                self.stream.requests().failed(key, now, &failure);
            }
        }
    }

    /// Counts what an answer was on the wire: the engine sees bodies only after the platform has undone
    /// their compression, so the host says it ([`crate::stats::Stats::bytes`] says what counts).
    pub fn count_wire_bytes(&mut self, resource: &Resource, bytes: u64) {
        *self.bytes.entry(resource.name()).or_default() += bytes;
    }

    /// The way to the server is open again: what failed on it is asked for at once.
    pub fn retry_failed(&mut self, now: f64) {
        self.stream.requests().retry_now(now);
        self.models.retry_now(now);
    }

    /// Whether all that there is has come and holds nothing: there is no terrain to show.
    pub fn is_empty(&self) -> bool {
        self.stream.is_empty()
    }

    fn decode(&self, key: TileKey, payload: Payload) -> Result<Arrived, FetchFailure> {
        match payload {
            Payload::Bytes(bytes) if key.layer.is_elevation() => {
                Ok(Arrived::Elevation(key, decode::elevation(&bytes, key.address)?))
            }
            Payload::Bytes(bytes) if key.layer == Layer::Lcc => {
                let anchors = self
                    .stream
                    .tree_field()
                    .map(|field| (field.anchor_level(), field.anchor_side()))
                    .ok_or_else(|| FetchFailure::Permanent(format!("{key}: nothing grows")))?;
                Ok(Arrived::LandCover(key, decode::land_cover(&bytes, key.address, anchors)?))
            }
            Payload::Photo { width, height, pixels, .. } if key.layer == Layer::Texture => {
                if (width, height) != (TEXTURE_SIDE, TEXTURE_SIDE) {
                    return Err(FetchFailure::Permanent(format!(
                        "a photo tile of {width} × {height} where {TEXTURE_SIDE} × {TEXTURE_SIDE} was asked for"
                    )));
                }
                Ok(Arrived::Photo(key, pixels))
            }
            _ => Err(FetchFailure::Permanent(format!("{key}: an answer of the wrong kind"))),
        }
    }

    /// Uploads what has come, no more than a step allows; answers whether anything was placed.
    fn upload(&mut self) -> bool {
        let count = self.arrived.len().min(self.options.uploads_per_step.max(1));
        let batch: Vec<Arrived> = self.arrived.drain(..count).collect();
        let mut new_slots = Vec::new();
        for arrived in batch {
            let key = *arrived.key();
            match arrived {
                Arrived::Elevation(_, pixels) => {
                    let Some(slot) = self.stream.place_elevation(key, pixels.summary.clone()) else {
                        continue;
                    };
                    self.arrays.upload_elevation(&self.gpu.device, &self.gpu.queue, slot, &pixels);
                    new_slots.push(slot);
                    if pixels.grows() {
                        self.wooded.insert(slot);
                    } else {
                        self.wooded.remove(&slot);
                    }
                }
                Arrived::LandCover(_, pixels) => {
                    let Some(slot) = self.stream.place_land_cover(key, !pixels.species.is_empty()) else {
                        continue;
                    };
                    pixels.species.iter().for_each(|&code| self.models.want(code));
                    let slots = (slot, self.stream.slots().land_cover);
                    self.arrays.upload_land_cover(&self.gpu.device, &self.gpu.queue, slots, &pixels);
                }
                Arrived::Photo(_, pixels) => {
                    let Some(slot) = self.stream.place_texture(key) else { continue };
                    self.arrays.upload_photo(&self.gpu.device, &self.gpu.queue, slot, &pixels);
                }
            }
        }
        self.renderer.derive_maxima(&self.gpu, &self.arrays, &new_slots);
        count > 0
    }
}

/// Height in metres, and crown radius over it, of the mean of a scene's species, the common ones counting more and
/// those of shrubs left out where there are trees: a far forest is made of its tall ones.
fn typical_tree(species: &[SceneSpecies]) -> [f32; 2] {
    const LEAST_METRES: f64 = 6.0;
    let tall = |species: &&SceneSpecies| species.height >= LEAST_METRES;
    let counted: Vec<&SceneSpecies> = match species.iter().filter(tall).count() {
        0 => species.iter().collect(),
        _ => species.iter().filter(tall).collect(),
    };
    let commonness = |species: &&SceneSpecies| species.definition.commonness;
    let all_named = counted.iter().all(|species| commonness(species) <= 0.0);
    let weight = |species: &&SceneSpecies| if all_named { 1.0 } else { commonness(species) };
    let weights: f64 = counted.iter().map(weight).sum();
    let mean = |of: fn(&SceneSpecies) -> f64| {
        let sum: f64 = counted.iter().map(|species| weight(species) * of(species)).sum();
        (sum / weights.max(1e-9)) as f32
    };
    [mean(|species| species.height), mean(|species| species.crown_radius_ratio)]
}
