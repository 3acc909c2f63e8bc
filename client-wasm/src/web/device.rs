//! A lost device: noticed, and opened again.

use super::app::{App, running};
use super::failure::Failure;
use super::fetch::sleep;
use super::graphics::Graphics;
use super::session::Session;
use std::rc::Rc;
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::spawn_local;

/// Milliseconds between looks for a lost device while the loop sleeps.
const WATCH_MILLISECONDS: i32 = 1000;
/// Seconds within which a device may not be lost [`LOSSES_TO_GIVE_UP`] times.
const LOSSES_WITHIN_SECONDS: f64 = 60.0;
/// A device lost so often in a short time is lost for good: each new one costs all tiles again.
const LOSSES_TO_GIVE_UP: usize = 3;
/// How often a new device is asked for: a driver, or the browser's own process, may be starting again.
const ATTEMPTS: u32 = 6;
/// Wait before the second attempt, milliseconds; each further one doubles it.
const ATTEMPT_MILLISECONDS: i32 = 250;

/// When devices were lost, and what was said of it.
#[derive(Default)]
pub(super) struct Losses {
    /// Seconds, the last few.
    times: Vec<f64>,
    /// Whether an error that no one caught was told of.
    told_error: bool,
}

impl Losses {
    /// One more, at `now` seconds; gives whether it is worth trying again.
    fn another(&mut self, now: f64) -> bool {
        self.times.retain(|time| now - time < LOSSES_WITHIN_SECONDS);
        self.times.push(now);
        self.times.len() < LOSSES_TO_GIVE_UP
    }
}

impl App {
    /// Looks from time to time whether the device is still there: while the loop sleeps no one would notice.
    pub(super) fn watch_device(self: &Rc<Self>) {
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

    /// Opens a new device where the old one is lost. Camera, sun and address stay; the tiles come again,
    /// mostly from the browser's cache.
    pub(super) fn check_device(&self) {
        let now = self.now();
        let (reason, again, number) = {
            let mut guard = self.state.borrow_mut();
            let state = &mut *guard;
            let Some(session) = &mut state.session else { return };
            if let Some(error) = session.graphics.context.error().filter(|_| !state.losses.told_error) {
                state.losses.told_error = true;
                web_sys::console::error_1(&format!("graphics: {error}").into());
            }
            let Some(reason) = session.graphics.context.lost() else { return };
            session.abort();
            state.earlier.add_earlier(&session.engine.stats());
            state.session = None;
            state.settled = false;
            state.in_flight = 0;
            state.counters.sessions += 1;
            (reason, state.losses.another(now), state.counters.sessions)
        };
        web_sys::console::warn_1(&format!("the graphics device was lost: {reason}").into());
        if again {
            self.notice("device", "The graphics device was lost. Opening it again …", false);
            spawn_local(reopen(number, reason));
        } else {
            self.device_is_gone(&reason);
        }
    }

    fn device_is_gone(&self, reason: &str) {
        self.notice("device", "", false);
        self.tell("device-lost", &[reason.into()]);
    }
}

/// Opens a device again, with patience.
async fn reopen(number: u32, reason: String) {
    for attempt in 0..ATTEMPTS {
        let Some(app) = running() else { return };
        let (window, canvas) = (app.window.clone(), app.canvas.clone());
        drop(app);
        if attempt > 0 {
            sleep(&window, ATTEMPT_MILLISECONDS << (attempt - 1)).await;
        }
        let graphics = Graphics::open(&canvas).await;
        let Some(app) = running() else { return };
        match graphics.and_then(|graphics| app.session(graphics, number)) {
            Ok(session) => {
                app.state.borrow_mut().session = Some(session);
                app.notice("device", "", false);
                app.wake();
                return;
            }
            Err(Failure { message, .. }) => {
                web_sys::console::warn_1(&format!("no new graphics device yet: {message}").into());
            }
        }
    }
    if let Some(app) = running() {
        app.device_is_gone(&reason);
    }
}

impl App {
    /// A session of a number for the scene.
    fn session(&self, graphics: Graphics, number: u32) -> Result<Session, Failure> {
        Session::new(graphics, &self.state.borrow().scene, number)
    }
}
