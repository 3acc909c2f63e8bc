//! The browser: canvas, device, network, events and the frame loop. What JavaScript sees is
//! [`open`] and the [`Landscape`] that it gives.

mod app;
mod device;
mod events;
mod failure;
mod fetch;
mod graphics;
mod outage;
mod outside;
mod session;
mod wire;

pub use web_sys::ImageBitmap;

use app::App;
use failure::Failure;
use js_sys::{Function, Promise};
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use web_sys::HtmlCanvasElement;

/// Opens the map on a canvas. `report(kind, …)` is called with `("progress", resident, wanted)`,
/// `("notice", about, text, passing)` (a line over the picture; an empty text takes the line about the same
/// away), and, where the picture cannot go on, with the kind of failure and a text.
///
/// # Errors
/// `{kind, message}`: `server-gone`, `empty-scene`, `no-adapter` or `failed`.
#[wasm_bindgen]
pub async fn open(canvas: HtmlCanvasElement, report: Function) -> Result<Landscape, JsValue> {
    // A panic aborts: what happened must at least be on the console.
    std::panic::set_hook(Box::new(|panic| web_sys::console::error_1(&panic.to_string().into())));
    let app = App::open(canvas, report).await.map_err(Failure::into_js)?;
    Ok(Landscape { app })
}

/// The running map, as `window.treeline` offers it.
#[wasm_bindgen]
pub struct Landscape {
    app: Rc<App>,
}

#[wasm_bindgen]
impl Landscape {
    /// `{lon, lat, height, heading_deg, pitch_deg, fov_y_deg}`.
    pub fn camera(&self) -> Result<JsValue, JsValue> {
        js_sys::JSON::parse(&self.app.camera_json())
    }

    /// Puts the camera somewhere else; fields that are left out stay as they are.
    ///
    /// # Errors
    /// A line that names the field that is unknown or out of range.
    pub fn set_camera(&self, camera: &JsValue) -> Result<(), JsValue> {
        let text = js_sys::JSON::stringify(camera)?.as_string().unwrap_or_default();
        self.app.set_camera_json(&text).map_err(|problem| js_sys::Error::new(&problem).into())
    }

    /// Resolves once every tile that the view wants is drawn.
    pub fn settled(&self) -> Promise {
        self.app.settled()
    }

    /// Counters since the start.
    pub fn stats(&self) -> Result<JsValue, JsValue> {
        js_sys::JSON::parse(&self.app.stats_json())
    }

    /// The tiles of the ground: `[{level, row, column, visible, wanted, resident}]`, coarsest first.
    pub fn load_map(&self) -> Result<JsValue, JsValue> {
        js_sys::JSON::parse(&self.app.load_map_json())
    }

    /// Draws nothing until [`Self::resume`] or [`Self::step`].
    pub fn pause(&self) {
        self.app.pause();
    }

    /// Goes on drawing.
    pub fn resume(&self) {
        self.app.resume();
    }

    /// Draws one frame in full resolution, paused or not; resolves once the GPU has done it.
    pub fn step(&self) -> Promise {
        self.app.step()
    }

    /// Size of the picture, pixels; from now on it does not follow the window.
    pub fn set_size(&self, width: f64, height: f64) -> Result<(), JsValue> {
        self.app.set_size(width, height).map_err(|problem| js_sys::Error::new(&problem).into())
    }

    /// Date and time of the sun, RFC 3339, UTC.
    pub fn time(&self) -> String {
        self.app.time()
    }

    /// Sets date and time of the sun.
    ///
    /// # Errors
    /// A line that says how a time is written.
    pub fn set_time(&self, time: &str) -> Result<(), JsValue> {
        self.app.set_time(time).map_err(|problem| js_sys::Error::new(&problem).into())
    }

    /// Moves the date to a season: `spring`, `summer`, `autumn` or `winter`.
    ///
    /// # Errors
    /// A line that says which there are.
    pub fn set_season(&self, name: &str) -> Result<(), JsValue> {
        self.app.set_season(name).map_err(|problem| js_sys::Error::new(&problem).into())
    }

    /// Speed of the wind, m/s.
    pub fn wind(&self) -> f64 {
        self.app.weather().wind
    }

    /// Share of the sky under clouds.
    pub fn clouds(&self) -> f64 {
        self.app.weather().clouds
    }

    /// Sets the wind (m/s) and the share of the sky under clouds (0 to 1).
    ///
    /// # Errors
    /// A line that names what is out of range.
    pub fn set_weather(&self, wind: f64, clouds: f64) -> Result<(), JsValue> {
        self.app.set_weather(wind, clouds).map_err(|problem| js_sys::Error::new(&problem).into())
    }

    /// The scene's description, as `/scene.json` has it.
    pub fn scene(&self) -> Result<JsValue, JsValue> {
        js_sys::JSON::parse(&self.app.scene_json())
    }
}
