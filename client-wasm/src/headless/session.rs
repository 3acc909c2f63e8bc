//! An engine with somewhere to draw: settle a view, then draw it.

use super::HeadlessError;
use super::capture::{Capture, read_texture, wait};
use super::fetch::{FetchedTile, TileFetcher, fetch_tile};
use super::trees::{SelectedTree, selected_trees};
use crate::engine::{Engine, FrameReport, Resource, TileRequest, ViewRequest};
use crate::frame::FrameTarget;
use crate::stream::requests::{FetchFailure, RequestId};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The picture's format: the shade pass's output is encoded by the texture.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// Seconds of virtual time between steps.
const STEP_SECONDS: f64 = 0.1;
/// A tile that fails this often will not come.
const ATTEMPTS: u32 = 5;
/// Real time for which the virtual clock stops when only tiles that failed are left: a server that is
/// busy gets a little time.
const RETRY_PAUSE: Duration = Duration::from_millis(200);

/// An engine and its picture. Time is virtual: a settled view does not depend on how fast anything was.
#[derive(Debug)]
pub struct Session {
    /// The engine; made with fades of no length, or settling takes frames.
    pub engine: Engine,
    picture: wgpu::Texture,
    now: f64,
    workers: usize,
}

type Answer = (TileRequest, Result<FetchedTile, FetchFailure>);

impl Session {
    /// With a picture of so many pixels; `workers` threads fetch and decode.
    pub fn new(engine: Engine, width: u32, height: u32, workers: usize) -> Result<Self, HeadlessError> {
        let picture = picture(&engine, width, height)?;
        Ok(Self { engine, picture, now: 0.0, workers: workers.max(1) })
    }

    /// Fetches until every tile that the view wants is resident, then draws it once.
    pub fn settle(
        &mut self,
        view: &ViewRequest,
        fetcher: &dyn TileFetcher,
    ) -> Result<FrameReport, HeadlessError> {
        let (ask, asked) = mpsc::channel::<TileRequest>();
        let (answer, answers) = mpsc::channel::<Answer>();
        let asked = Mutex::new(asked);
        std::thread::scope(|scope| {
            for _ in 0..self.workers {
                let (asked, answer) = (&asked, answer.clone());
                scope.spawn(move || {
                    loop {
                        let next = asked.lock().unwrap_or_else(PoisonError::into_inner).recv();
                        let Ok(request) = next else { return };
                        // A panic must not leave the request unanswered, and the loop waiting for ever.
                        let fetch = AssertUnwindSafe(|| fetch_tile(fetcher, &request.resource, &request.url));
                        let fetched = catch_unwind(fetch)
                            .unwrap_or_else(|_| Err(FetchFailure::Permanent("the fetcher panicked".into())));
                        if answer.send((request, fetched)).is_err() {
                            return;
                        }
                    }
                });
            }
            // Moved in, so that the workers end with it.
            let ask = ask;
            self.stream_in(view, &ask, &answers)
        })?;
        self.draw(view)
    }

    /// The loop of [`Self::settle`], without drawing.
    fn stream_in(
        &mut self,
        view: &ViewRequest,
        ask: &mpsc::Sender<TileRequest>,
        answers: &mpsc::Receiver<Answer>,
    ) -> Result<(), HeadlessError> {
        let mut under_way: HashMap<RequestId, String> = HashMap::new();
        let mut urls: HashMap<_, String> = HashMap::new();
        loop {
            let report = self.engine.step(self.now, view, None);
            self.now += STEP_SECONDS;
            for request in report.requests {
                under_way.insert(request.id, request.url.clone());
                urls.insert(request.resource, request.url.clone());
                // The workers outlive this loop.
                let _ = ask.send(request);
            }
            if report.complete {
                return wait(self.engine.gpu());
            }
            let lost = self.engine.failures().find(|(_, failure)| {
                failure.attempts >= ATTEMPTS || matches!(failure.last, FetchFailure::Permanent(_))
            });
            if let Some((key, failure)) = lost {
                let url = urls.get(&Resource::Tile(key)).cloned().unwrap_or_else(|| key.to_string());
                return Err(HeadlessError::Tile { url, problem: failure.last.to_string() });
            }
            let lost = self.engine.model_failure().filter(|(_, failure)| {
                failure.attempts >= ATTEMPTS || matches!(failure.last, FetchFailure::Permanent(_))
            });
            if let Some((url, failure)) = lost {
                return Err(HeadlessError::Tile { url, problem: failure.last.to_string() });
            }
            if under_way.is_empty() {
                match report.retry_at.filter(|&at| at > self.now) {
                    Some(at) => {
                        std::thread::sleep(RETRY_PAUSE);
                        self.now = at;
                    }
                    // A load map is on its way back.
                    None => wait(self.engine.gpu())?,
                }
                continue;
            }
            let first = answers.recv().ok();
            for (request, fetched) in first.into_iter().chain(std::iter::from_fn(|| answers.try_recv().ok()))
            {
                under_way.remove(&request.id);
                self.deliver(&request, fetched);
            }
        }
    }

    /// Hands an answer to the engine, and counts it.
    fn deliver(&mut self, request: &TileRequest, fetched: Result<FetchedTile, FetchFailure>) {
        let payload = fetched.map(|FetchedTile { payload, wire_bytes }| {
            self.engine.count_wire_bytes(&request.resource, wire_bytes);
            payload
        });
        self.engine.deliver(self.now, request.id, payload);
    }

    /// Draws the view from what is resident, and waits for it.
    pub fn draw(&mut self, view: &ViewRequest) -> Result<FrameReport, HeadlessError> {
        if [self.picture.width(), self.picture.height()] != [view.width, view.height] {
            // The depth that trees are drawn with is of the view's size.
            self.picture = picture(&self.engine, view.width, view.height)?;
        }
        let target_view = self.picture.create_view(&Default::default());
        let target = FrameTarget { view: &target_view, format: FORMAT };
        self.engine.invalidate();
        let report = self.engine.step(self.now, view, Some(&target));
        self.now += STEP_SECONDS;
        wait(self.engine.gpu())?;
        Ok(report)
    }

    /// Draws again so many times; answers the wall-clock milliseconds of each frame.
    pub fn repeat(&mut self, view: &ViewRequest, times: usize) -> Result<Vec<f64>, HeadlessError> {
        self.engine.clear_times();
        (0..times)
            .map(|_| {
                let start = Instant::now();
                self.draw(view)?;
                Ok(start.elapsed().as_secs_f64() * 1e3)
            })
            .collect()
    }

    /// The trees that the last frame selected, by species, level, cell and seed.
    pub fn trees(&self) -> Result<Vec<SelectedTree>, HeadlessError> {
        selected_trees(&self.engine)
    }

    /// Reads the last frame back.
    pub fn capture(&self) -> Result<Capture, HeadlessError> {
        let gpu = self.engine.gpu();
        let rgba = read_texture(gpu, &self.picture)?;
        let (width, height) = (self.picture.width(), self.picture.height());
        let Some(targets) = self.engine.targets() else {
            return Err(HeadlessError::Gpu("nothing has been drawn".into()));
        };
        let distance = read_texture(gpu, &targets.distance)?;
        let hit = read_texture(gpu, &targets.hit)?;
        Ok(Capture {
            width,
            height,
            rgba,
            distance: bytemuck::pod_collect_to_vec(&distance),
            hit: bytemuck::pod_collect_to_vec(&hit),
        })
    }
}

/// A picture to draw into.
fn picture(engine: &Engine, width: u32, height: u32) -> Result<wgpu::Texture, HeadlessError> {
    let largest = engine.gpu().device.limits().max_texture_dimension_2d;
    if width.max(height) > largest || width.min(height) == 0 {
        return Err(HeadlessError::TooLarge(width, height, largest));
    }
    Ok(engine.gpu().device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    }))
}
