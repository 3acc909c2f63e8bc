//! The running page: state, frame loop, and what the outside may ask of it.
//!
//! The loop sleeps when nothing moves, nothing has arrived and nothing fades: events, answers and
//! the GPU wake it.

use super::events;
use super::failure::{Failure, text_of};
use super::fetch;
use super::graphics::Graphics;
use super::session::{EngineGround, Session};
use crate::controls::address::Address;
use crate::controls::resolution::Resolution;
use crate::controls::{Controls, Input};
use crate::engine::{FrameReport, Payload, TileRequest};
use crate::stream::requests::{FetchFailure, RequestId};
use js_sys::{Function, Promise};
use std::cell::{Cell, RefCell};
use std::rc::{Rc, Weak};
use treeline_core::camera::GeographicCamera;
use treeline_core::scene::SceneDescription;
use treeline_core::sun::unix_seconds_from_rfc3339;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::spawn_local;
use web_sys::{AbortController, HtmlCanvasElement, Window};

/// Largest picture, pixels: beyond it sharpness is not worth its time.
const LARGEST_PICTURE: f64 = 3840.0 * 2160.0;
/// Device pixels for a CSS pixel at most.
const LARGEST_PIXEL_RATIO: f64 = 2.0;
/// Failed requests in a row after which the person is told.
const FAILURES_TO_TELL: u32 = 6;
/// Milliseconds between looks for a lost device while the loop sleeps.
const WATCH_MILLISECONDS: i32 = 1000;

thread_local! {
    /// For callbacks of the GPU, which may not hold anything themselves.
    static RUNNING: RefCell<Weak<App>> = const { RefCell::new(Weak::new()) };
}

/// What `requestAnimationFrame` calls.
type FrameCallback = Closure<dyn FnMut(f64)>;

/// The page.
pub struct App {
    window: Window,
    canvas: HtmlCanvasElement,
    report: Function,
    state: RefCell<State>,
    frame: RefCell<Option<FrameCallback>>,
    scheduled: Cell<bool>,
    timer: Cell<Option<i32>>,
}

/// What changes.
struct State {
    scene: SceneDescription,
    session: Option<Session>,
    controls: Controls,
    resolution: Resolution,
    address: Address,
    sun_unix_seconds: Option<f64>,
    /// CSS pixels of the canvas, and device pixels.
    css_size: (f64, f64),
    size: (u32, u32),
    /// Set by hand: the window's size does not count.
    fixed_size: bool,
    paused: bool,
    settled: bool,
    last_step: Option<f64>,
    in_flight: u32,
    submitted_at: f64,
    /// Scale of the last frame drawn.
    scale: f64,
    progress: (usize, usize),
    failures_in_row: u32,
    lost: bool,
    counters: Counters,
    waiting_for_settled: Vec<Function>,
    waiting_for_frame: Vec<Function>,
}

/// What the page counts, beside the engine.
#[derive(Clone, Copy, Default)]
struct Counters {
    frames_drawn: u64,
    frame_milliseconds: f64,
    first_textured_milliseconds: f64,
    sessions: u32,
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
                failures_in_row: 0,
                lost: false,
                counters: Counters { sessions: 1, ..Counters::default() },
                waiting_for_settled: Vec::new(),
                waiting_for_frame: Vec::new(),
            }),
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
        app.watch();
        app.canvas_resized();
        Ok(app)
    }

    /// Seconds since the page was opened.
    fn now(&self) -> f64 {
        self.window.performance().map_or(0.0, |clock| clock.now() / 1000.0)
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

    /// Looks from time to time whether the device is still there: while the loop sleeps no one would notice.
    fn watch(self: &Rc<Self>) {
        let weak = Rc::downgrade(self);
        let look = Closure::<dyn FnMut()>::new(move || {
            if let Some(app) = weak.upgrade() {
                app.check_device();
            }
        });
        // Without a timer the loop itself still looks.
        let _ = self.window.set_interval_with_callback_and_timeout_and_arguments_0(
            look.as_ref().unchecked_ref(),
            WATCH_MILLISECONDS,
        );
        look.forget();
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
    fn advance(&self, now: f64, full: bool) -> Option<(FrameReport, bool)> {
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
        let scale = if full { 1.0 } else { state.resolution.scale(now) };
        let size = scaled(state.size, scale);
        if full {
            session.engine.invalidate();
        }
        let (report, more) =
            session.step(now, state.controls.camera(), size, state.size, state.sun_unix_seconds);
        if report.drawn {
            state.in_flight += 1;
            state.scale = scale;
            state.submitted_at = state.submitted_at.max(now);
            state.counters.frames_drawn += 1;
            let number = session.number;
            session.graphics.context.queue.on_submitted_work_done(move || {
                if let Some(app) = RUNNING.with(|running| running.borrow().upgrade()) {
                    app.frame_done(number);
                }
            });
        }
        let still = full || state.resolution.is_still(now);
        // The picture is complete where it shows all, at full size, of a camera that rests.
        state.settled = report.settled && scale == 1.0 && !active;
        if !active && !moved {
            // The next step begins where something moves again, not where the last one ended.
            state.last_step = None;
        }
        Some((report, active || !still || more))
    }

    /// Requests, aborts, progress, and whoever waits.
    fn after_step(&self, report: &FrameReport, now: f64) {
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
        self.wake_at(report.retry_at, now);
        self.finish_waiting();
    }

    /// Wakes the loop when a failed tile may be asked for again.
    fn wake_at(&self, time: Option<f64>, now: f64) {
        if let Some(timer) = self.timer.take() {
            self.window.clear_timeout_with_handle(timer);
        }
        let Some(time) = time else { return };
        let milliseconds = ((time - now).max(0.0) * 1000.0).min(60_000.0) as i32 + 1;
        let wake = Closure::once_into_js(|| {
            if let Some(app) = RUNNING.with(|running| running.borrow().upgrade()) {
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
    fn finish_waiting(&self) {
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
        spawn_local(async move {
            let answer = fetch::tile(&window, &request, &signal).await;
            if let Some(app) = RUNNING.with(|running| running.borrow().upgrade()) {
                app.deliver(number, request.id, answer);
            }
        });
    }

    fn deliver(&self, session: u32, id: RequestId, answer: Result<Payload, FetchFailure>) {
        let now = self.now();
        let notice = {
            let mut guard = self.state.borrow_mut();
            let state = &mut *guard;
            let Some(current) = state.session.as_mut().filter(|current| current.number == session) else {
                return;
            };
            // An aborted request ends too, but tells nothing of the server.
            let expected = current.fetches.remove(&id).is_some();
            let before = state.failures_in_row;
            match (&answer, expected) {
                (Ok(_), _) => state.failures_in_row = 0,
                (Err(_), true) => state.failures_in_row += 1,
                (Err(_), false) => {}
            }
            if answer.is_ok() {
                state.resolution.arrived(now);
            }
            current.engine.deliver(now, id, answer);
            match (before >= FAILURES_TO_TELL, state.failures_in_row >= FAILURES_TO_TELL) {
                (false, true) => Some("The server does not answer. Trying again …"),
                (true, false) => Some(""),
                _ => None,
            }
        };
        if let Some(notice) = notice {
            self.tell("notice", &[notice.into()]);
        }
        self.wake();
    }

    /// Opens a new device where the old one is lost: once.
    fn check_device(&self) {
        let mut guard = self.state.borrow_mut();
        let state = &mut *guard;
        let Some(session) = &mut state.session else { return };
        if let Some(error) = session.graphics.context.error().filter(|_| !state.lost) {
            state.lost = true;
            web_sys::console::error_1(&format!("graphics: {error}").into());
        }
        let Some(reason) = session.graphics.context.lost() else { return };
        web_sys::console::warn_1(&format!("the graphics device was lost: {reason}").into());
        session.abort();
        state.session = None;
        state.settled = false;
        state.in_flight = 0;
        state.counters.sessions += 1;
        let number = state.counters.sessions;
        if number > 2 {
            drop(guard);
            self.tell("device-lost", &[reason.into()]);
            return;
        }
        let canvas = self.canvas.clone();
        spawn_local(async move {
            let graphics = Graphics::open(&canvas).await;
            let Some(app) = RUNNING.with(|running| running.borrow().upgrade()) else { return };
            let session = {
                let state = app.state.borrow();
                graphics.and_then(|graphics| Session::new(graphics, &state.scene, number))
            };
            match session {
                Ok(session) => app.state.borrow_mut().session = Some(session),
                Err(_) => return app.tell("device-lost", &[reason.into()]),
            }
            app.wake();
        });
    }

    /// Calls the page's report.
    fn tell(&self, kind: &str, details: &[JsValue]) {
        let arguments: js_sys::Array = std::iter::once(kind.into()).chain(details.iter().cloned()).collect();
        if let Err(error) = self.report.apply(&JsValue::NULL, &arguments) {
            web_sys::console::error_1(&error);
        }
    }
}

/// What the outside asks.
impl App {
    /// Takes an event.
    pub fn input(&self, input: Input) {
        {
            let mut guard = self.state.borrow_mut();
            let state = &mut *guard;
            let Some(session) = &state.session else { return };
            let before = state.controls.camera();
            state.controls.input(input, &EngineGround(&session.engine));
            if state.controls.camera() != before {
                state.resolution.moved(self.now());
                state.settled = false;
            }
            if !state.controls.is_active() && state.controls.camera() == before {
                return;
            }
        }
        self.wake();
    }

    /// The canvas has another size on the page.
    pub fn canvas_resized(&self) {
        {
            let mut state = self.state.borrow_mut();
            let css = (f64::from(self.canvas.client_width()), f64::from(self.canvas.client_height()));
            if css.0 < 1.0 || css.1 < 1.0 {
                return;
            }
            state.css_size = css;
            if !state.fixed_size {
                let ratio = self.window.device_pixel_ratio().clamp(0.5, LARGEST_PIXEL_RATIO);
                let ratio = ratio.min((LARGEST_PICTURE / (css.0 * css.1)).sqrt());
                let size = scaled((css.0 as u32, css.1 as u32), ratio);
                state.settled &= state.size == size;
                state.size = size;
            }
        }
        self.resize_controls();
        self.wake();
    }

    fn resize_controls(&self) {
        let (width, height) = self.state.borrow().css_size;
        self.input(Input::Resize { width, height });
    }

    /// `window.treeline.camera()`, as JSON.
    pub fn camera_json(&self) -> String {
        json(&self.state.borrow().controls.camera())
    }

    /// The scene, as JSON.
    pub fn scene_json(&self) -> String {
        json(&self.state.borrow().scene)
    }

    /// Puts the camera elsewhere. Fields that are left out stay.
    pub fn set_camera_json(&self, text: &str) -> Result<(), String> {
        let mut fields =
            serde_json::to_value(self.state.borrow().controls.camera()).map_err(|e| e.to_string())?;
        let given: serde_json::Map<String, serde_json::Value> = serde_json::from_str(text).map_err(|_| {
            format!("a camera is an object of lon, lat, height, heading_deg and pitch_deg, not {text}")
        })?;
        for (name, value) in given {
            fields[name] = value;
        }
        let camera: GeographicCamera = serde_json::from_value(fields).map_err(|error| error.to_string())?;
        camera.check()?;
        self.set_camera(camera);
        Ok(())
    }

    fn set_camera(&self, camera: GeographicCamera) {
        {
            let mut state = self.state.borrow_mut();
            state.controls.set_camera(camera);
            state.settled = false;
        }
        self.wake();
    }

    /// The person changed the address by hand, or followed a link within the page.
    pub fn follow_address(&self) {
        let address = Address::from_fragment(&self.window.location().hash().unwrap_or_default());
        let camera = address.camera;
        {
            let mut state = self.state.borrow_mut();
            let time = address.time.as_deref();
            state.sun_unix_seconds = time.and_then(|time| unix_seconds_from_rfc3339(time).ok());
            state.address = address;
            state.settled = false;
        }
        match camera {
            Some(camera) => self.set_camera(camera),
            None => self.wake(),
        }
    }

    /// Writes the view into the address bar without a new entry in the history.
    fn write_address(&self) {
        let fragment = {
            let mut state = self.state.borrow_mut();
            state.address.camera = Some(state.controls.camera());
            format!("#{}", state.address.to_fragment())
        };
        if self.window.location().hash().ok().as_ref() != Some(&fragment)
            && let Ok(history) = self.window.history()
        {
            // A page in a sandboxed frame may not: then its address stays as it is.
            let _ = history.replace_state_with_url(&JsValue::NULL, "", Some(&fragment));
        }
    }

    /// A promise that resolves once every tile that the view wants is drawn.
    pub fn settled(&self) -> Promise {
        let promise =
            Promise::new(&mut |resolve, _| self.state.borrow_mut().waiting_for_settled.push(resolve));
        self.finish_waiting();
        self.wake();
        promise
    }

    /// `window.treeline.stats()`, as JSON.
    pub fn stats_json(&self) -> String {
        let mut state = self.state.borrow_mut();
        let engine = state.session.as_mut().map(|session| session.engine.stats());
        let mut stats = serde_json::to_value(engine.unwrap_or_default()).unwrap_or_default();
        let (width, height) = scaled(state.size, state.scale);
        let Counters { frames_drawn, frame_milliseconds, first_textured_milliseconds, sessions } =
            state.counters;
        stats["page"] = serde_json::json!({
            "width": width,
            "height": height,
            "scale": state.scale,
            "frames_drawn": frames_drawn,
            "frame_milliseconds": frame_milliseconds,
            "first_textured_milliseconds": first_textured_milliseconds,
            "devices": sessions,
            "settled": state.settled && state.in_flight == 0,
        });
        stats.to_string()
    }

    /// Draws nothing from now on.
    pub fn pause(&self) {
        self.state.borrow_mut().paused = true;
    }

    /// Goes on.
    pub fn resume(&self) {
        {
            let mut state = self.state.borrow_mut();
            state.paused = false;
            state.last_step = None;
        }
        self.wake();
    }

    /// One frame in full resolution; resolves once it is done.
    pub fn step(&self) -> Promise {
        let now = self.now();
        let Some((report, _)) = self.advance(now, true) else { return Promise::resolve(&JsValue::UNDEFINED) };
        let promise = if report.drawn {
            Promise::new(&mut |resolve, _| self.state.borrow_mut().waiting_for_frame.push(resolve))
        } else {
            Promise::resolve(&JsValue::UNDEFINED)
        };
        self.after_step(&report, now);
        promise
    }

    /// Size of the picture, pixels.
    pub fn set_size(&self, width: f64, height: f64) -> Result<(), String> {
        let whole = |value: f64| (1.0..=8192.0).contains(&value) && value.fract() == 0.0;
        if !whole(width) || !whole(height) {
            return Err(format!("a size is two whole numbers from 1 to 8192, not {width} and {height}"));
        }
        let style = self.canvas.style();
        for (name, value) in [("width", width), ("height", height), ("inset", f64::NAN)] {
            let value = if value.is_nan() { "0 auto auto 0".to_owned() } else { format!("{value}px") };
            style.set_property(name, &value).map_err(|error| text_of(&error))?;
        }
        {
            let mut state = self.state.borrow_mut();
            state.fixed_size = true;
            state.css_size = (width, height);
            state.size = (width as u32, height as u32);
            state.settled = false;
        }
        self.resize_controls();
        self.wake();
        Ok(())
    }

    /// Date and time of the sun.
    pub fn time(&self) -> String {
        let state = self.state.borrow();
        state.address.time.clone().unwrap_or_else(|| state.scene.sun.time.clone())
    }

    /// Moves the sun.
    pub fn set_time(&self, time: &str) -> Result<(), String> {
        let seconds = unix_seconds_from_rfc3339(time).map_err(|error| error.to_string())?;
        {
            let mut state = self.state.borrow_mut();
            state.sun_unix_seconds = Some(seconds);
            state.address.time = Some(time.to_owned());
            state.settled = false;
        }
        self.wake();
        Ok(())
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

fn scaled((width, height): (u32, u32), scale: f64) -> (u32, u32) {
    let side = |pixels: u32| ((f64::from(pixels) * scale).round() as u32).max(1);
    (side(width), side(height))
}

fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

fn resolve(waiting: Vec<Function>) {
    for function in waiting {
        // The resolving function of a promise does not throw.
        let _ = function.call0(&JsValue::UNDEFINED);
    }
}
