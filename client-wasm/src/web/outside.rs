//! What the outside asks of the running page: events, `window.treeline`, the address bar.

use super::app::{App, Counters, scaled};
use super::failure::text_of;
use super::session::EngineGround;
use crate::controls::Input;
use crate::controls::address::Address;
use crate::engine::Weather;
use js_sys::Promise;
use treeline_core::camera::GeographicCamera;
use treeline_core::seeds::season::NamedSeason;
use treeline_core::sun::unix_seconds_from_rfc3339;
use treeline_shaders::weather::STRONGEST_WIND;
use wasm_bindgen::JsValue;

/// Largest picture, pixels: beyond it sharpness is not worth its time.
const LARGEST_PICTURE: f64 = 3840.0 * 2160.0;
/// Device pixels for a CSS pixel at most.
const LARGEST_PIXEL_RATIO: f64 = 2.0;

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
        self.tell_of_address();
        match camera {
            Some(camera) => self.set_camera(camera),
            None => self.wake(),
        }
    }

    /// Says a word about what the address holds and nobody can read.
    pub(super) fn tell_of_address(&self) {
        let problem = self.state.borrow().address.problem.clone();
        self.notice("address", &problem.unwrap_or_default(), true);
    }

    /// Writes the view into the address bar without a new entry in the history.
    pub(super) fn write_address(&self) {
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

    /// `window.treeline.loadMap()`, as JSON.
    pub fn load_map_json(&self) -> String {
        let state = self.state.borrow();
        state.session.as_ref().map_or_else(|| "[]".into(), |session| json(&session.engine.ground_tiles()))
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
        let mut engine = engine.unwrap_or_default();
        engine.add_earlier(&state.earlier);
        engine.bytes = self.wire_bytes();
        let mut stats = serde_json::to_value(engine).unwrap_or_default();
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

    /// Wind (m/s) and share of the sky under clouds.
    pub fn weather(&self) -> Weather {
        self.state.borrow().weather
    }

    /// Sets both.
    pub fn set_weather(&self, wind: f64, clouds: f64) -> Result<(), String> {
        let wind = within(wind, STRONGEST_WIND, "wind, in metres a second,")?;
        let clouds = within(clouds, 1.0, "the share of clouds")?;
        {
            let mut state = self.state.borrow_mut();
            let seconds = state.weather.seconds;
            state.weather = Weather { wind, seconds, clouds };
            state.settled = false;
        }
        self.wake();
        Ok(())
    }

    /// Moves the date to a season, and keeps the time of day.
    pub fn set_season(&self, name: &str) -> Result<(), String> {
        let Some(season) = NamedSeason::from_name(name) else {
            let names = NamedSeason::ALL.map(|(name, ..)| name).join(", ");
            return Err(format!("there is no season {name:?}; they are {names}"));
        };
        let now = unix_seconds_from_rfc3339(&self.time()).map_err(|error| error.to_string())?;
        let then = season.near(now, self.state.borrow().controls.camera().lat);
        let date = js_sys::Date::new(&(1000.0 * then).into());
        // Without the milliseconds, as people write it.
        let text: String = date.to_iso_string().into();
        self.set_time(&format!("{}Z", text.split('.').next().unwrap_or(&text).trim_end_matches('Z')))
    }
}

/// A number within its range.
fn within(value: f64, most: f64, what: &str) -> Result<f64, String> {
    if (0.0..=most).contains(&value) { Ok(value) } else { Err(format!("{what} is 0 to {most}, not {value}")) }
}

fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}
