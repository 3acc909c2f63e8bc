//! The running page: state, frame loop, and what the outside may ask of it.
//!
//! The loop sleeps when nothing moves, nothing has arrived and nothing fades: events, answers and
//! the GPU wake it.

use super::device::Losses;
use super::events;
use super::failure::{Failure, text_of};
use super::fetch;
use super::graphics::Graphics;
use super::session::{EngineGround, Session, parameter, weather};
use super::wire::WireLog;
use crate::controls::Controls;
use crate::controls::address::Address;
use crate::controls::resolution::Resolution;
use crate::engine::{FrameReport, TileRequest, Weather};
use crate::outage::Outage;
use crate::stats::Stats;
use crate::stream::requests::{FetchFailure, RequestId};
use js_sys::Function;
use std::cell::{Cell, RefCell};
use std::rc::{Rc, Weak};
use treeline_core::scene::SceneDescription;
use treeline_core::sun::unix_seconds_from_rfc3339;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::spawn_local;
use web_sys::{AbortController, HtmlCanvasElement, Window};

thread_local! {
    /// For callbacks of the GPU, which may not hold anything themselves.
    static RUNNING: RefCell<Weak<App>> = const { RefCell::new(Weak::new()) };
}

/// The page's app, for whatever may not hold it itself.
pub(super) fn running() -> Option<Rc<App>> {
    RUNNING.with(|running| running.borrow().upgrade())
}

/// However long a frame took, the wind goes on by no more than this, seconds.
const LONGEST_STIR_SECONDS: f64 = 0.1;

/// What `requestAnimationFrame` calls.
type FrameCallback = Closure<dyn FnMut(f64)>;

/// The page.
pub struct App {
    pub(super) window: Window,
    pub(super) canvas: HtmlCanvasElement,
    report: Function,
    pub(super) state: RefCell<State>,
    wire: WireLog,
    frame: RefCell<Option<FrameCallback>>,
    scheduled: Cell<bool>,
    timer: Cell<Option<i32>>,
}

/// What changes.
pub(super) struct State {
    pub(super) scene: SceneDescription,
    pub(super) session: Option<Session>,
    pub(super) controls: Controls,
    pub(super) resolution: Resolution,
    pub(super) address: Address,
    pub(super) sun_unix_seconds: Option<f64>,
    pub(super) weather: Weather,
    /// The person wants little to move.
    reduced_motion: bool,
    /// CSS pixels of the canvas, and device pixels.
    pub(super) css_size: (f64, f64),
    pub(super) size: (u32, u32),
    /// Set by hand: the window's size does not count.
    pub(super) fixed_size: bool,
    pub(super) paused: bool,
    pub(super) settled: bool,
    pub(super) last_step: Option<f64>,
    pub(super) in_flight: u32,
    pub(super) submitted_at: f64,
    /// Scale of the last frame drawn.
    pub(super) scale: f64,
    pub(super) progress: (usize, usize),
    pub(super) outage: Outage,
    pub(super) losses: Losses,
    /// What engines counted whose device was lost.
    pub(super) earlier: Stats,
    /// Whether the page has said that there is nothing to show.
    told_empty: bool,
    pub(super) counters: Counters,
    pub(super) waiting_for_settled: Vec<Function>,
    pub(super) waiting_for_frame: Vec<Function>,
}

/// What the page counts, beside the engine.
#[derive(Clone, Copy, Default)]
pub(super) struct Counters {
    pub(super) frames_drawn: u64,
    pub(super) frame_milliseconds: f64,
    pub(super) first_textured_milliseconds: f64,
    pub(super) sessions: u32,
}

impl App {
    /// Loads the scene, opens the device and starts.
    pub async fn open(canvas: HtmlCanvasElement, report: Function) -> Result<Rc<Self>, Failure> {
        let window = web_sys::window().ok_or_else(|| Failure::new("failed", "there is no window"))?;
        // Both take their time: side by side.
        let graphics = Graphics::open(&canvas);
        let scene = fetch::scene(&window);
        let (graphics, scene) = join(graphics, scene).await;
        let (scene, graphics) = (scene?, graphics?);
        let fragment = window.location().hash().unwrap_or_default();
        let address = Address::from_fragment(&fragment);
        let reduced = window
            .match_media("(prefers-reduced-motion: reduce)")
            .ok()
            .flatten()
            .is_some_and(|query| query.matches());
        let controls = Controls::new(address.camera.unwrap_or(scene.camera), scene.camera, reduced);
        let resolution =
            if graphics.is_software() { Resolution::for_slow_adapter() } else { Resolution::default() };
        let sun_unix_seconds = address.time.as_deref().and_then(|time| unix_seconds_from_rfc3339(time).ok());
        // A date in the link says more than a season does.
        let season = parameter("season").filter(|_| sun_unix_seconds.is_none());
        let session = Session::new(graphics, &scene, 1)?;
        let app = Rc::new(Self {
            window: window.clone(),
            canvas: canvas.clone(),
            report,
            state: RefCell::new(State {
                scene,
                session: Some(session),
                controls,
                resolution,
                address,
                sun_unix_seconds,
                weather: weather(),
                reduced_motion: reduced,
                css_size: (1.0, 1.0),
                size: (1, 1),
                fixed_size: false,
                paused: false,
                settled: false,
                last_step: None,
                in_flight: 0,
                submitted_at: 0.0,
                scale: 1.0,
                progress: (0, 0),
                outage: Outage::default(),
                losses: Losses::default(),
                earlier: Stats::default(),
                told_empty: false,
                counters: Counters { sessions: 1, ..Counters::default() },
                waiting_for_settled: Vec::new(),
                waiting_for_frame: Vec::new(),
            }),
            wire: WireLog::open(),
            frame: RefCell::new(None),
            scheduled: Cell::new(false),
            timer: Cell::new(None),
        });
        RUNNING.with(|running| *running.borrow_mut() = Rc::downgrade(&app));
        let weak = Rc::downgrade(&app);
        *app.frame.borrow_mut() = Some(Closure::new(move |_| {
            if let Some(app) = weak.upgrade() {
                app.scheduled.set(false);
                app.run();
            }
        }));
        events::listen(&app, &canvas, &window).map_err(|error| Failure::new("failed", text_of(&error)))?;
        app.watch_device();
        app.tell_of_address();
        if let Some(Err(problem)) = season.map(|name| app.set_season(&name)) {
            web_sys::console::warn_1(&format!("?season=: {problem}").into());
        }
        app.canvas_resized();
        Ok(app)
    }

    /// Seconds since the page was opened.
    pub(super) fn now(&self) -> f64 {
        self.window.performance().map_or(0.0, |clock| clock.now() / 1000.0)
    }

    /// Whether nobody can see the page.
    fn is_hidden(&self) -> bool {
        self.window.document().is_some_and(|document| document.hidden())
    }

    /// Asks for a frame.
    pub fn wake(&self) {
        if self.scheduled.get() || self.state.borrow().paused {
            return;
        }
        if let Some(frame) = &*self.frame.borrow()
            && self.window.request_animation_frame(frame.as_ref().unchecked_ref()).is_ok()
        {
            self.scheduled.set(true);
        }
    }

    /// One turn of the loop.
    fn run(&self) {
        self.check_device();
        let now = self.now();
        let Some((report, goes_on)) = self.advance(now, false) else { return };
        self.after_step(&report, now);
        if goes_on {
            self.wake();
        }
    }

    /// Moves the camera and steps the engine; `full`: in full resolution, whatever moves. Gives the
    /// report and whether the loop has to go on. `None` where it cannot be done now.
    pub(super) fn advance(&self, now: f64, full: bool) -> Option<(FrameReport, bool)> {
        let mut guard = self.state.borrow_mut();
        let state = &mut *guard;
        let session = state.session.as_mut()?;
        let seconds = state.last_step.map_or(0.0, |last| now - last);
        state.last_step = Some(now);
        let moved = state.controls.step(seconds, &EngineGround(&session.engine));
        if moved {
            state.resolution.moved(now);
            state.settled = false;
        }
        let active = state.controls.is_active();
        if !full && state.in_flight >= session.frames_in_flight() {
            // The GPU wakes the loop when it is done.
            return None;
        }
        // Frames in the wind may be drawn with fewer pixels, as those of a camera that moves. Who waits for a settled
        // view is given one: the wind holds its breath.
        let stirs = !full
            && !state.reduced_motion
            && state.waiting_for_settled.is_empty()
            && !self.is_hidden()
            && (active || !session.graphics.is_software())
            && session.engine.stirs(&state.weather);
        if stirs {
            state.weather.seconds += seconds.min(LONGEST_STIR_SECONDS);
            state.resolution.moved(now);
        }
        let scale = if full { 1.0 } else { state.resolution.scale(now) };
        let size = scaled(state.size, scale);
        if full {
            session.engine.invalidate();
        }
        let (report, more) = session.step(
            now,
            state.controls.camera(),
            size,
            state.size,
            state.sun_unix_seconds,
            state.weather,
        );
        if report.drawn {
            state.in_flight += 1;
            state.scale = scale;
            state.submitted_at = state.submitted_at.max(now);
            state.counters.frames_drawn += 1;
            let number = session.number;
            session.graphics.context.queue.on_submitted_work_done(move || {
                if let Some(app) = running() {
                    app.frame_done(number);
                }
            });
        }
        let still = full || state.resolution.is_still(now);
        // The picture is complete where it shows all, at full size, of a camera that rests.
        state.settled = report.settled && scale == 1.0 && !active;
        if !active && !moved && !stirs {
            // The next step begins where something moves again, not where the last one ended.
            state.last_step = None;
        }
        Some((report, active || stirs || !still || more))
    }

    /// Requests, aborts, progress, and whoever waits.
    pub(super) fn after_step(&self, report: &FrameReport, now: f64) {
        for id in &report.cancelled {
            let controller =
                self.state.borrow_mut().session.as_mut().and_then(|session| session.fetches.remove(id));
            if let Some(controller) = controller {
                controller.abort();
            }
        }
        for request in &report.requests {
            self.fetch(request.clone());
        }
        let changed = {
            let mut state = self.state.borrow_mut();
            std::mem::replace(&mut state.progress, report.progress) != report.progress
        };
        if changed {
            let (wanted, resident) = report.progress;
            self.tell("progress", &[resident.into(), wanted.into()]);
        }
        self.tell_if_empty();
        self.wake_at(report.retry_at, now);
        self.finish_waiting();
    }

    /// Says once that all there is has come and is empty: else the page would show a sky and no word.
    fn tell_if_empty(&self) {
        {
            let mut state = self.state.borrow_mut();
            let empty = state.session.as_ref().is_some_and(|session| session.engine.is_empty());
            if !empty || std::mem::replace(&mut state.told_empty, true) {
                return;
            }
        }
        self.tell("empty-scene", &["every sample of the terrain is marked as missing".into()]);
    }

    /// Wakes the loop when a failed tile may be asked for again.
    fn wake_at(&self, time: Option<f64>, now: f64) {
        if let Some(timer) = self.timer.take() {
            self.window.clear_timeout_with_handle(timer);
        }
        let Some(time) = time else { return };
        let milliseconds = ((time - now).max(0.0) * 1000.0).min(60_000.0) as i32 + 1;
        let wake = Closure::once_into_js(|| {
            if let Some(app) = running() {
                app.timer.set(None);
                app.wake();
            }
        });
        let timer = self
            .window
            .set_timeout_with_callback_and_timeout_and_arguments_0(wake.unchecked_ref(), milliseconds);
        self.timer.set(timer.ok());
    }

    /// The GPU has finished a frame.
    fn frame_done(&self, session: u32) {
        let now = self.now();
        let waiting = {
            let mut state = self.state.borrow_mut();
            if state.session.as_ref().is_none_or(|current| current.number != session) {
                return;
            }
            state.in_flight = state.in_flight.saturating_sub(1);
            let milliseconds = 1000.0 * (now - state.submitted_at);
            // The next one began at the latest now.
            state.submitted_at = now;
            state.counters.frame_milliseconds = milliseconds;
            let scale = state.scale;
            state.resolution.measured(scale, milliseconds);
            if state.counters.first_textured_milliseconds == 0.0 && state.shows_texture() {
                state.counters.first_textured_milliseconds = 1000.0 * now;
                state.resolution.opened();
            }
            std::mem::take(&mut state.waiting_for_frame)
        };
        resolve(waiting);
        self.finish_waiting();
        self.wake();
    }

    /// Resolves promises of a settled view once its last frame is done, and writes the address.
    pub(super) fn finish_waiting(&self) {
        let waiting = {
            let mut state = self.state.borrow_mut();
            if !state.settled || state.in_flight > 0 {
                return;
            }
            std::mem::take(&mut state.waiting_for_settled)
        };
        self.write_address();
        resolve(waiting);
    }

    /// Fetches a tile and hands it to the engine.
    fn fetch(&self, request: TileRequest) {
        let Ok(controller) = AbortController::new() else { return };
        let signal = controller.signal();
        let Some(number) = self.state.borrow_mut().session.as_mut().map(|session| {
            session.fetches.insert(request.id, controller);
            session.number
        }) else {
            return;
        };
        let window = self.window.clone();
        let address = self.wire.asked(&window, &request);
        spawn_local(async move {
            let answer = fetch::tile(&window, &request, &signal).await;
            if let Some(app) = running() {
                app.wire.ended(&address, answer.as_ref().ok().map(|tile| tile.wire_bound));
                app.deliver(number, request.id, answer);
            }
        });
    }

    fn deliver(&self, session: u32, id: RequestId, answer: Result<fetch::Tile, FetchFailure>) {
        let now = self.now();
        let change = {
            let mut guard = self.state.borrow_mut();
            let state = &mut *guard;
            let Some(current) = state.session.as_mut().filter(|current| current.number == session) else {
                return;
            };
            // An aborted request ends too, but tells nothing of the server.
            let expected = current.fetches.remove(&id).is_some();
            let change = match &answer {
                Ok(_) => {
                    state.resolution.arrived(now);
                    state.outage.tile_came()
                }
                Err(FetchFailure::Temporary(_)) if expected => state.outage.tile_failed(),
                Err(_) => None,
            };
            current.engine.deliver(now, id, answer.map(|tile| tile.payload));
            change
        };
        if let Some(change) = change {
            self.follow_outage(change);
        }
        self.wake();
    }

    /// Bytes of tiles by layer, as they crossed the network.
    pub(super) fn wire_bytes(&self) -> std::collections::BTreeMap<&'static str, u64> {
        self.wire.totals()
    }

    /// Puts a line over the picture, or takes it away where `text` is empty. `about` names what it is
    /// about: a later line about the same replaces it. `passing`: it goes by itself after a while.
    pub(super) fn notice(&self, about: &str, text: &str, passing: bool) {
        self.tell("notice", &[about.into(), text.into(), passing.into()]);
    }

    /// Calls the page's report.
    pub(super) fn tell(&self, kind: &str, details: &[JsValue]) {
        let arguments: js_sys::Array = std::iter::once(kind.into()).chain(details.iter().cloned()).collect();
        if let Err(error) = self.report.apply(&JsValue::NULL, &arguments) {
            web_sys::console::error_1(&error);
        }
    }
}

impl State {
    /// Whether the landscape is on screen with its photo, where the scene has one.
    fn shows_texture(&mut self) -> bool {
        let has_photo = self.scene.layer(treeline_core::layer::Layer::Texture).is_some();
        let Some(session) = &mut self.session else { return false };
        !has_photo || session.engine.stats().resident.get("texture").is_some_and(|&count| count > 0)
    }
}

/// Both, one beside the other.
async fn join<A, B>(first: impl Future<Output = A>, second: impl Future<Output = B>) -> (A, B) {
    let mut first = std::pin::pin!(first);
    let mut second = std::pin::pin!(second);
    let (mut one, mut other) = (None, None);
    std::future::poll_fn(move |context| {
        if one.is_none()
            && let std::task::Poll::Ready(value) = first.as_mut().poll(context)
        {
            one = Some(value);
        }
        if other.is_none()
            && let std::task::Poll::Ready(value) = second.as_mut().poll(context)
        {
            other = Some(value);
        }
        match (one.take(), other.take()) {
            (Some(one), Some(other)) => std::task::Poll::Ready((one, other)),
            (first, second) => {
                (one, other) = (first, second);
                std::task::Poll::Pending
            }
        }
    })
    .await
}

pub(super) fn scaled((width, height): (u32, u32), scale: f64) -> (u32, u32) {
    let side = |pixels: u32| ((f64::from(pixels) * scale).round() as u32).max(1);
    (side(width), side(height))
}

fn resolve(waiting: Vec<Function>) {
    for function in waiting {
        // The resolving function of a promise does not throw.
        let _ = function.call0(&JsValue::UNDEFINED);
    }
}
