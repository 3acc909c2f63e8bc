//! Flights of the real engine on the software adapter, over the analytic landscape of [`crate::flight_world`], on a
//! virtual clock and a simulated connection. Every frame is drawn, and every frame is judged.

use crate::flight_link::{Link, LinkQuality};
use crate::flight_world as world;
use std::collections::{BTreeSet, HashMap, HashSet, VecDeque};
use treeline_client::engine::{Engine, EngineOptions, FrameReport, Resource, ViewRequest, Weather};
use treeline_client::frame::FrameTarget;
use treeline_client::headless::capture::{read_texture, wait};
use treeline_client::headless::{self, AdapterChoice};
use treeline_client::stream::requests::{FetchFailure, TileKey};
use treeline_client::stream::root_grid::RootGrid;
use treeline_client::stream::view::ViewGeometry;
use treeline_core::camera::GeographicCamera;
use treeline_core::layer::Layer;
use treeline_core::tile::{self, TileAddress};
use treeline_shaders::layout::{EMPTY, LEAF_BIT};

/// A tile that failed is not asked for again before this, seconds: the least of the first delay.
const LEAST_DELAY_SECONDS: f64 = 0.37;
/// From a map's submission to its lists: it is taken in by the next frame.
const MAP_LATENCY_FRAMES: u64 = 1;

const LAYERS: [Layer; 2] = [Layer::CombinedElevation, Layer::Texture];

/// What was found in the frames so far. All but the counts of frames and requests should be 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Steps.
    pub steps: u64,
    /// Frames drawn.
    pub frames: u64,
    /// Frames with a pixel that misses where the truth hits.
    pub frames_with_hole: u64,
    /// Squares of the page table with nothing, where there is land.
    pub open_squares: u64,
    /// Requests for a tile that was here, was under way, had failed just now, or is known to be absent.
    pub needless_requests: u64,
    /// Requests for a tile that had come before, and had given up its slot since.
    pub requests_again: u64,
    /// Steps after which the tiles took more GPU memory than the budget.
    pub over_budget: u64,
    /// Tiles that a frame showed, and the next one would have shown had they not given up their slot.
    pub evicted_in_sight: u64,
    /// Tiles that the pixels of frames need, each counted in each frame.
    pub needed: u64,
    /// Of these: named in the frame itself.
    pub named_in_time: u64,
    /// Of these: not named within the latency and one frame.
    pub never_named: u64,
}

impl Tally {
    /// Share of the needed tiles that were named in the frame that needed them.
    pub fn recall(&self) -> f64 {
        self.named_in_time as f64 / self.needed.max(1) as f64
    }
}

/// An engine in flight.
pub struct Flight {
    /// The engine.
    pub engine: Engine,
    /// The connection.
    pub link: Link,
    /// What was found.
    pub tally: Tally,
    /// Virtual time, seconds.
    pub now: f64,
    /// Virtual time between frames, seconds.
    pub frame_seconds: f64,
    /// Whether frames are read back and judged pixel by pixel.
    pub judges_pixels: bool,
    size: [u32; 2],
    picture: wgpu::Texture,
    under_way: HashSet<TileKey>,
    came: HashSet<TileKey>,
    failed_at: HashMap<TileKey, f64>,
    /// Tiles needed and not named yet, by the frame in which they must be at the latest.
    awaited: VecDeque<(u64, TileAddress)>,
    /// By layer: the tiles that the last frame showed.
    shown: [HashSet<TileAddress>; 2],
}

/// What a frame's pixels say.
struct Sight {
    view: ViewGeometry,
    distances: Vec<f32>,
    /// The photo tiles that the distances of the pixels want.
    needed: BTreeSet<TileAddress>,
}

/// The finest of some tiles that covers another one; not one below it.
fn finest(tiles: &HashSet<TileAddress>, wanted: TileAddress) -> Option<TileAddress> {
    (0..=wanted.level).rev().filter_map(|level| wanted.ancestor(level)).find(|tile| tiles.contains(tile))
}

impl Flight {
    /// Opens an engine over the landscape.
    pub fn new(options: EngineOptions, quality: LinkQuality, size: [u32; 2]) -> anyhow::Result<Self> {
        let engine = Engine::new(headless::open(AdapterChoice::Software)?, world::scene(), options)?;
        let picture = engine.gpu().device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8UnormSrgb,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        Ok(Self {
            engine,
            link: Link::new(quality),
            tally: Tally::default(),
            now: 0.0,
            frame_seconds: 0.1,
            judges_pixels: true,
            size,
            picture,
            under_way: HashSet::new(),
            came: HashSet::new(),
            failed_at: HashMap::new(),
            awaited: VecDeque::new(),
            shown: [HashSet::new(), HashSet::new()],
        })
    }

    /// One frame: what has come is handed over, the engine steps, its requests go out, the picture is judged.
    pub fn frame(&mut self, camera: GeographicCamera) -> anyhow::Result<FrameReport> {
        self.hand_over();
        let before = LAYERS.map(|layer| self.resident(layer));
        let request = ViewRequest {
            camera,
            width: self.size[0],
            height: self.size[1],
            sun_unix_seconds: None,
            shadow_steps: 0,
            weather: Weather::default(),
        };
        let target = self.picture.create_view(&wgpu::TextureViewDescriptor::default());
        let target = FrameTarget { view: &target, format: self.picture.format() };
        let report = self.engine.step(self.now, &request, Some(&target));
        wait(self.engine.gpu())?;
        self.tally.steps += 1;
        for id in &report.cancelled {
            if let Some(key) = self.link.cancel(*id) {
                self.under_way.remove(&key);
            }
        }
        for asked in &report.requests {
            // Nothing grows there, so that only tiles are asked for.
            if let Resource::Tile(key) = asked.resource {
                self.ask(asked.id, key);
            }
        }
        let memory = self.engine.stats().memory;
        self.tally.over_budget +=
            u64::from(memory.allocated_bytes.max(memory.used_bytes) > memory.budget_bytes);
        if report.drawn {
            self.tally.frames += 1;
            self.tally.open_squares += self.open_squares();
            if self.judges_pixels {
                let sight = self.sight()?;
                if let Some([x, y]) = self.hole(&sight) {
                    println!("hole at {x}, {y} of {camera:?}");
                    self.tally.frames_with_hole += 1;
                }
                self.judge_recall(&sight);
                self.judge_evictions(&sight, &before);
            }
        }
        self.now += self.frame_seconds;
        Ok(report)
    }

    /// Frames until everything that the view wants is drawn; fails after so many virtual seconds.
    pub fn settle(&mut self, camera: GeographicCamera, seconds: f64) -> anyhow::Result<()> {
        let until = self.now + seconds;
        loop {
            let report = self.frame(camera)?;
            if report.settled {
                return Ok(());
            }
            anyhow::ensure!(self.now < until, "not settled after {seconds} s: {:?}", report.progress);
        }
    }

    /// The last frame drawn.
    pub fn picture(&self) -> anyhow::Result<image::RgbaImage> {
        let rgba = read_texture(self.engine.gpu(), &self.picture)?;
        image::RgbaImage::from_raw(self.size[0], self.size[1], rgba)
            .ok_or_else(|| anyhow::anyhow!("a picture of another size"))
    }

    fn resident(&self, layer: Layer) -> HashSet<TileAddress> {
        self.engine.resident_tiles(layer).collect()
    }

    fn hand_over(&mut self) {
        for (id, key, good) in self.link.arrivals(self.now) {
            self.under_way.remove(&key);
            let answer = if good {
                self.came.insert(key);
                self.failed_at.remove(&key);
                Ok(world::payload(key))
            } else {
                self.failed_at.insert(key, self.now);
                Err(FetchFailure::Temporary("the link broke".into()))
            };
            self.engine.deliver(self.now, id, answer);
        }
    }

    fn ask(&mut self, id: treeline_client::stream::requests::RequestId, key: TileKey) {
        let too_soon = self.failed_at.get(&key).is_some_and(|at| self.now - at < LEAST_DELAY_SECONDS);
        let needless =
            !self.under_way.insert(key) || self.engine.has(&key) || too_soon || self.is_known_absent(key);
        self.tally.needless_requests += u64::from(needless);
        self.tally.requests_again += u64::from(self.came.contains(&key));
        self.link.ask(self.now, id, key);
    }

    /// Whether the client can know that there is no such tile: the layer ends above it, or a tile above it has come
    /// and holds nothing.
    fn is_known_absent(&self, key: TileKey) -> bool {
        let elevation = key.layer.is_elevation();
        let empty_above = (0..=key.address.level)
            .filter_map(|level| key.address.ancestor(level))
            .any(|above| world::is_empty(&above) && self.came.contains(&TileKey { address: above, ..key }));
        key.address.level > world::DEEPEST[usize::from(!elevation)]
            || !world::EXTENT.intersects(&key.address.bounds())
            || (elevation && empty_above)
    }

    /// Squares of the page table with nothing where there is land.
    fn open_squares(&self) -> u64 {
        let Some(tables) = self.engine.drawn_tables() else { return 0 };
        let mut open: Vec<(usize, TileAddress)> = self.roots().tiles().enumerate().collect();
        let mut count = 0;
        while let Some((index, square)) = open.pop() {
            let node = tables.nodes[index];
            if node == EMPTY {
                count += u64::from(world::has_land(&square));
            } else if node & LEAF_BIT == 0 {
                let first = node as usize;
                open.extend(square.children().into_iter().enumerate().map(|(at, child)| (first + at, child)));
            }
        }
        count
    }

    fn sight(&self) -> anyhow::Result<Sight> {
        let (Some(targets), Some(view)) = (self.engine.targets(), self.engine.drawn_geometry()) else {
            anyhow::bail!("nothing has been drawn");
        };
        let distances = bytemuck::pod_collect_to_vec(&read_texture(self.engine.gpu(), &targets.distance)?);
        let needed = self.needed(view, &distances);
        Ok(Sight { view: view.clone(), distances, needed })
    }

    /// The photo tiles that pixels want by their distance. Nothing is coarser than the roots.
    fn needed(&self, view: &ViewGeometry, distances: &[f32]) -> BTreeSet<TileAddress> {
        let texel = 1.42 * self.engine.threshold().unwrap_or(1.0) * view.pixel_angle;
        let (roots, deepest) = (self.roots().level, world::DEEPEST[1]);
        let hits = (0_u32..).zip(distances).filter(|(_, distance)| **distance >= 0.0);
        hits.map(|(index, &distance)| {
            let (x, y) = (index % self.size[0], index / self.size[0]);
            let direction = view.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let place = view.geodetic(direction * f64::from(distance));
            let longest = texel * f64::from(distance);
            let level =
                (roots..deepest).find(|&level| tile::cell_metres(level) <= longest).unwrap_or(deepest);
            TileAddress::at(level, place.longitude, place.latitude)
        })
        .collect()
    }

    fn roots(&self) -> RootGrid {
        RootGrid::of_scene(&world::EXTENT, world::DEEPEST[0])
    }

    /// A pixel that misses where the truth hits.
    fn hole(&self, sight: &Sight) -> Option<[u32; 2]> {
        let missing = (0_u32..).zip(&sight.distances).filter(|(_, distance)| **distance < 0.0);
        let mut places = missing.map(|(index, _)| [index % self.size[0], index / self.size[0]]);
        places.find(|&[x, y]| world::certainly_hits(&sight.view, x, y))
    }

    /// Counts which of the tiles that the frame's pixels need are named now, and soon.
    fn judge_recall(&mut self, sight: &Sight) {
        let Some(analysis) = self.engine.analysis() else { return };
        let list = analysis.texture.current();
        let named: HashSet<TileAddress> = list.iter().map(|named| named.address).collect();
        let frame = self.tally.frames;
        self.awaited.retain(|(_, tile)| !named.contains(tile));
        while let Some(&(last, tile)) = self.awaited.front()
            && last <= frame
        {
            println!("{tile} was not named by frame {frame}");
            self.tally.never_named += 1;
            self.awaited.pop_front();
        }
        self.tally.needed += sight.needed.len() as u64;
        for &tile in &sight.needed {
            if named.contains(&tile) {
                self.tally.named_in_time += 1;
            } else {
                self.awaited.push_back((frame + MAP_LATENCY_FRAMES + 1, tile));
            }
        }
    }

    /// Counts tiles that the last frame showed, that this one would have shown, and that are gone.
    fn judge_evictions(&mut self, sight: &Sight, before: &[HashSet<TileAddress>; 2]) {
        for (index, layer) in LAYERS.into_iter().enumerate() {
            let now = self.resident(layer);
            let deepest = world::DEEPEST[index];
            let wanted = |tile: &TileAddress| tile.ancestor(tile.level.min(deepest));
            let would_show =
                sight.needed.iter().filter_map(wanted).filter_map(|tile| finest(&before[index], tile));
            // Where the budget has just made all coarser, the next frame would not have shown it either.
            let wants = |tile: &TileAddress| {
                let lists = self.engine.analysis().map(|lists| [&lists.elevation, &lists.texture][index]);
                lists.is_none_or(|list| list.current().iter().any(|named| tile.covers(&named.address)))
            };
            let gone: BTreeSet<TileAddress> = would_show
                .filter(|tile| !now.contains(tile) && self.shown[index].contains(tile) && wants(tile))
                .collect();
            self.tally.evicted_in_sight += gone.len() as u64;
            self.shown[index] =
                sight.needed.iter().filter_map(wanted).filter_map(|tile| finest(&now, tile)).collect();
        }
    }
}
