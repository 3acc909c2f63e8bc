//! What is gone when a device is lost: graphics, engine, and the requests under way.

use super::failure::Failure;
use super::graphics::Graphics;
use crate::controls::Ground;
use crate::engine::{
    DEFAULT_SHADOW_STEPS, Engine, EngineError, EngineOptions, FrameReport, ViewRequest, Weather,
};
use crate::stream::requests::RequestId;
use crate::stream::tile_choice::TileChoice;
use crate::stream::tree_field::FARTHEST_METRES;
use crate::stream::undergrowth::FARTHEST_UNDERGROWTH_METRES;
use std::collections::HashMap;
use treeline_core::camera::GeographicCamera;
use treeline_core::scene::SceneDescription;
use treeline_shaders::weather::STRONGEST_WIND;
use web_sys::AbortController;

/// A device with an engine on it.
pub struct Session {
    /// Device and surface.
    pub graphics: Graphics,
    /// The engine.
    pub engine: Engine,
    /// Requests under way.
    pub fetches: HashMap<RequestId, AbortController>,
    /// Tells this session's answers from an earlier one's.
    pub number: u32,
}

impl Session {
    /// An engine for a scene on the canvas's device.
    pub fn new(graphics: Graphics, scene: &SceneDescription, number: u32) -> Result<Self, Failure> {
        let mut options = EngineOptions::default();
        options.stream.tile_choice = tile_choice();
        options.tree_metres = metres("trees", FARTHEST_METRES);
        options.undergrowth_metres = metres("undergrowth", FARTHEST_UNDERGROWTH_METRES);
        if graphics.is_software() {
            // Fading in would be ten more frames, each of them slow.
            options.stream.fade_seconds = 0.0;
        }
        let engine = Engine::new(graphics.context.clone(), scene.clone(), options).map_err(|error| {
            let kind = if matches!(error, EngineError::Stream(_)) { "empty-scene" } else { "failed" };
            Failure::new(kind, error.to_string())
        })?;
        Ok(Self { graphics, engine, fetches: HashMap::new(), number })
    }

    /// Frames that may be under way on the GPU: `requestAnimationFrame` gives no back-pressure.
    pub fn frames_in_flight(&self) -> u32 {
        if self.graphics.is_software() { 1 } else { 2 }
    }

    /// One step with a picture of `size`, and tiles as for one of `full_size`; draws into the canvas where there is something new to draw. Gives the report, and
    /// whether another step has something to do at once.
    pub fn step(
        &mut self,
        now: f64,
        camera: GeographicCamera,
        size: (u32, u32),
        full_size: (u32, u32),
        sun_unix_seconds: Option<f64>,
        weather: Weather,
    ) -> (FrameReport, bool) {
        if self.graphics.resize(size.0, size.1) {
            self.engine.invalidate();
        }
        self.engine.choose_for([full_size.0, full_size.1]);
        let request = ViewRequest {
            camera,
            width: size.0,
            height: size.1,
            sun_unix_seconds,
            shadow_steps: DEFAULT_SHADOW_STEPS,
            weather,
        };
        let picture = if self.engine.wants_frame(&request) { self.graphics.next() } else { None };
        let target = picture.as_ref().map(super::graphics::Picture::target);
        let report = self.engine.step(now, &request, target.as_ref());
        if let Some(picture) = picture {
            picture.present(&self.graphics);
        }
        (report, self.engine.wants_step(&request))
    }

    /// Aborts what is under way.
    pub fn abort(&mut self) {
        for (_, controller) in self.fetches.drain() {
            controller.abort();
        }
    }
}

/// A parameter of the page's address.
pub(super) fn parameter(name: &str) -> Option<String> {
    let search = web_sys::window().and_then(|window| window.location().search().ok()).unwrap_or_default();
    let mut pairs = search.trim_start_matches('?').split('&').filter_map(|pair| pair.split_once('='));
    pairs.find(|(known, _)| *known == name).map(|(_, value)| value.to_owned())
}

/// A length in the page's address, metres, 0 for none: of trees that are drawn one by one, or of undergrowth.
fn metres(name: &str, most: f64) -> Option<f64> {
    let text = parameter(name)?;
    let metres = text.parse::<f64>().ok().filter(|metres| (0.0..=most).contains(metres));
    if metres.is_none() {
        let line = format!("?{name}={text}: it must be a length in metres, 0 to {most}");
        web_sys::console::warn_1(&line.into());
    }
    metres
}

/// The weather of the page's address: `?wind=` in m/s and `?clouds=`, a share of the sky.
pub(super) fn weather() -> Weather {
    let number = |name: &str, most: f64| {
        let text = parameter(name)?;
        let number = text.parse::<f64>().ok().filter(|number| (0.0..=most).contains(number));
        if number.is_none() {
            web_sys::console::warn_1(&format!("?{name}={text}: it must be a number, 0 to {most}").into());
        }
        number
    };
    Weather {
        wind: number("wind", STRONGEST_WIND).unwrap_or(0.0),
        seconds: 0.0,
        clouds: number("clouds", 1.0).unwrap_or(0.0),
    }
}

/// Who chooses the tiles: `?tiles=cpu` is the quadtree, for comparison.
fn tile_choice() -> TileChoice {
    match parameter("tiles").as_deref() {
        None | Some("load-map") => TileChoice::LoadMap,
        Some("cpu") => TileChoice::Cpu,
        Some(other) => {
            let line = format!("?tiles={other}: there is no such choice; write load-map or cpu");
            web_sys::console::warn_1(&line.into());
            TileChoice::LoadMap
        }
    }
}

/// The engine's landscape, as the controls ask for it.
pub struct EngineGround<'a>(pub &'a Engine);

impl Ground for EngineGround<'_> {
    fn height(&self, longitude: f64, latitude: f64) -> Option<f64> {
        self.0.ground_height(longitude, latitude)
    }

    fn greatest_height(&self) -> f64 {
        self.0.scene().maximum_height
    }
}
