//! The server is gone, or back.

use super::app::{App, running};
use super::fetch;
use crate::outage::{Change, Trouble};
use crate::stream::requests::FetchFailure;
use treeline_core::scene::SceneDescription;
use wasm_bindgen_futures::spawn_local;

impl App {
    /// Does what a change of the server's state asks for.
    pub(super) fn follow_outage(&self, change: Change) {
        match change {
            Change::Ask => spawn_local(ask()),
            Change::Tell(Trouble::Gone) => {
                let line = if self.window.navigator().on_line() {
                    "The server does not answer. What is loaded stays; the rest comes when it is back."
                } else {
                    "No network. What is loaded stays; the rest comes when it is back."
                };
                self.notice("server", line, false);
            }
            Change::Tell(Trouble::Failing) => {
                let line = "The server cannot make some of the tiles. What is loaded stays; the rest is tried again.";
                self.notice("server", line, false);
            }
            Change::Over => {
                self.notice("server", "", false);
                let now = self.now();
                if let Some(session) = &mut self.state.borrow_mut().session {
                    session.engine.retry_failed(now);
                }
                self.wake();
            }
        }
    }

    /// The server has answered the question whether it is there.
    fn server_answered(&self, scene: &SceneDescription) {
        let (change, other) = {
            let mut state = self.state.borrow_mut();
            (state.outage.answered(), state.scene.revision != scene.revision)
        };
        if let Some(change) = change {
            self.follow_outage(change);
        }
        if other {
            // Tiles of two versions side by side would not fit.
            self.notice("version", "The server has another landscape now. Reload the page to see it.", false);
        }
    }
}

/// Asks the server, until it answers, whether it is there.
async fn ask() {
    loop {
        let Some(app) = running() else { return };
        let window = app.window.clone();
        let answer = fetch::scene_once(&window).await;
        let wait = match &answer {
            Ok(scene) => return app.server_answered(scene),
            // Something else answers in its place (a proxy, a captive portal): as good as gone.
            Err(FetchFailure::Permanent(_) | FetchFailure::Temporary(_)) => {
                let (change, wait) = {
                    let mut state = app.state.borrow_mut();
                    (state.outage.silent(), state.outage.wait_seconds())
                };
                if let Some(change) = change {
                    app.follow_outage(change);
                }
                wait
            }
        };
        drop(app);
        fetch::sleep(&window, (1000.0 * wait) as i32).await;
    }
}
