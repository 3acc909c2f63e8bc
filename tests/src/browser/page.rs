//! A tab with the map in it.

use super::connection::Connection;
use anyhow::{Context, bail};
use base64::Engine;
use image::RgbaImage;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// A mouse button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pointer {
    /// Holds the ground.
    Left,
    /// Turns and tilts.
    Right,
}

/// A tab. What its console says and what it requests is kept.
pub struct Page {
    connection: Connection,
    complaints: Vec<String>,
    requests: Vec<String>,
}

impl Page {
    pub(super) fn open(
        mut connection: Connection,
        script: &str,
        url: &str,
        width: u32,
        height: u32,
    ) -> anyhow::Result<Self> {
        connection.attach_to_new_tab()?;
        for domain in ["Runtime", "Log", "Network", "Page"] {
            connection.send(&format!("{domain}.enable"), json!({}))?;
        }
        connection.send(
            "Emulation.setDeviceMetricsOverride",
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false }),
        )?;
        connection
            .send("Emulation.setTouchEmulationEnabled", json!({ "enabled": true, "maxTouchPoints": 5 }))?;
        connection.send("Page.addScriptToEvaluateOnNewDocument", json!({ "source": script }))?;
        connection.send("Page.navigate", json!({ "url": url }))?;
        Ok(Self { connection, complaints: Vec::new(), requests: Vec::new() })
    }

    /// Goes to another address in the same tab.
    pub fn navigate(&mut self, url: &str) -> anyhow::Result<()> {
        self.connection.send("Page.navigate", json!({ "url": url }))?;
        Ok(())
    }

    /// Value of an expression; a promise is waited for.
    pub fn evaluate(&mut self, expression: &str) -> anyhow::Result<Value> {
        let answer = self.connection.send(
            "Runtime.evaluate",
            json!({ "expression": expression, "awaitPromise": true, "returnByValue": true }),
        )?;
        if let Some(exception) = answer.get("exceptionDetails") {
            let text = exception["exception"]["description"].as_str().or(exception["text"].as_str());
            bail!("{expression}: {}", text.unwrap_or("an exception"));
        }
        Ok(answer["result"]["value"].clone())
    }

    /// Waits until an expression is true.
    pub fn wait_for(&mut self, expression: &str, patience: Duration) -> anyhow::Result<()> {
        let start = Instant::now();
        while start.elapsed() < patience {
            // While a page is being replaced there may be nothing to ask.
            if self.evaluate(expression).is_ok_and(|value| value == json!(true)) {
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let says = self.evaluate("document.body?.innerText").unwrap_or_default();
        let complaints = self.complaints().unwrap_or_default();
        bail!(
            "not true after {} s: {expression}; the page says {says}, its console {complaints:?}",
            patience.as_secs()
        )
    }

    /// Waits until the map is there (its engine runs), then until all that the view wants is drawn.
    pub fn settle(&mut self) -> anyhow::Result<()> {
        self.wait_for("Boolean(window.treeline)", Duration::from_secs(60))?;
        self.evaluate("window.treeline.settled().then(() => true)")?;
        Ok(())
    }

    /// The camera that the page reports.
    pub fn camera(&mut self) -> anyhow::Result<treeline_core::camera::GeographicCamera> {
        let camera = self.evaluate("window.treeline.camera()")?;
        serde_json::from_value(camera.clone()).with_context(|| format!("a camera, not {camera}"))
    }

    /// What the page shows.
    pub fn screenshot(&mut self) -> anyhow::Result<RgbaImage> {
        let answer = self.connection.send("Page.captureScreenshot", json!({ "format": "png" }))?;
        let text = answer["data"].as_str().context("a screenshot")?;
        let png = base64::engine::general_purpose::STANDARD.decode(text).context("base64")?;
        Ok(image::load_from_memory(&png)?.to_rgba8())
    }

    /// The picture alone, in full resolution: hides what lies over it, and pauses, so that the screenshot
    /// comes soon.
    pub fn picture(&mut self) -> anyhow::Result<RgbaImage> {
        self.evaluate(
            "for (const id of ['bar', 'panel', 'attribution', 'notice', 'progress']) \
             document.getElementById(id).style.visibility = 'hidden'; \
             document.activeElement.blur(); \
             window.treeline.pause(); window.treeline.step().then(() => true)",
        )?;
        self.screenshot()
    }

    /// Ends the browser's process for graphics, as a crash of a driver does.
    pub fn crash_graphics(&mut self) -> anyhow::Result<()> {
        self.connection.send_to_browser("Browser.crashGpuProcess", json!({}))?;
        Ok(())
    }

    /// Fingers touch, move or are lifted (`touchStart`, `touchMove`, `touchEnd`); places in CSS pixels.
    fn touch(&mut self, kind: &str, fingers: &[(f64, f64)]) -> anyhow::Result<()> {
        let points: Vec<Value> =
            fingers.iter().enumerate().map(|(id, (x, y))| json!({ "x": x, "y": y, "id": id })).collect();
        self.connection.send("Input.dispatchTouchEvent", json!({ "type": kind, "touchPoints": points }))?;
        Ok(())
    }

    /// Moves fingers over the picture, CSS pixels, in several moves, and lifts them.
    pub fn swipe(&mut self, from: &[(f64, f64)], to: &[(f64, f64)]) -> anyhow::Result<()> {
        self.touch("touchStart", from)?;
        for step in 1..=10 {
            let share = f64::from(step) / 10.0;
            let between =
                |(a, b): (&(f64, f64), &(f64, f64))| (a.0 + (b.0 - a.0) * share, a.1 + (b.1 - a.1) * share);
            let places: Vec<(f64, f64)> = from.iter().zip(to).map(between).collect();
            self.touch("touchMove", &places)?;
        }
        self.touch("touchEnd", &[])
    }

    /// Holds a key for a while. `code` is its place (`KeyW`), `key` what it writes (`w`).
    pub fn hold_key(&mut self, code: &str, key: &str, time: Duration) -> anyhow::Result<()> {
        self.key(code, key, true)?;
        std::thread::sleep(time);
        self.key(code, key, false)
    }

    /// Drags from one place to another, CSS pixels, in several moves.
    pub fn drag(&mut self, button: Pointer, from: (f64, f64), to: (f64, f64)) -> anyhow::Result<()> {
        let (name, buttons) = match button {
            Pointer::Left => ("left", 1),
            Pointer::Right => ("right", 2),
        };
        let mut event = |kind: &str, (x, y): (f64, f64)| {
            let pressed = if kind == "mouseReleased" { 0 } else { buttons };
            self.connection.send(
                "Input.dispatchMouseEvent",
                json!({ "type": kind, "x": x, "y": y, "button": name, "buttons": pressed, "clickCount": 1 }),
            )
        };
        event("mousePressed", from)?;
        for step in 1..=8 {
            let share = f64::from(step) / 8.0;
            let place = (from.0 + (to.0 - from.0) * share, from.1 + (to.1 - from.1) * share);
            event("mouseMoved", place)?;
        }
        event("mouseReleased", to)?;
        Ok(())
    }

    /// Turns the wheel over a place; positive goes away.
    pub fn wheel(&mut self, (x, y): (f64, f64), pixels: f64) -> anyhow::Result<()> {
        self.connection.send(
            "Input.dispatchMouseEvent",
            json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": pixels }),
        )?;
        Ok(())
    }

    /// Presses a key, or lets it go.
    pub fn key(&mut self, code: &str, key: &str, down: bool) -> anyhow::Result<()> {
        let kind = if down { "keyDown" } else { "keyUp" };
        self.connection.send("Input.dispatchKeyEvent", json!({ "type": kind, "code": code, "key": key }))?;
        Ok(())
    }

    /// Errors and warnings on the console, exceptions and failed loads, since the page was opened.
    pub fn complaints(&mut self) -> anyhow::Result<Vec<String>> {
        self.collect()?;
        Ok(self.complaints.clone())
    }

    /// Addresses that were requested since the page was opened.
    pub fn requests(&mut self) -> anyhow::Result<Vec<String>> {
        self.collect()?;
        Ok(self.requests.clone())
    }

    fn collect(&mut self) -> anyhow::Result<()> {
        for event in self.connection.take_events()? {
            let parameters = &event["params"];
            match event["method"].as_str().unwrap_or_default() {
                "Network.requestWillBeSent" => {
                    self.requests.extend(parameters["request"]["url"].as_str().map(str::to_owned));
                }
                "Runtime.exceptionThrown" => {
                    self.complaints.push(parameters["exceptionDetails"].to_string());
                }
                "Log.entryAdded" if parameters["entry"]["level"] == "error" => {
                    self.complaints.push(format!(
                        "{} ({})",
                        parameters["entry"]["text"].as_str().unwrap_or_default(),
                        parameters["entry"]["url"].as_str().unwrap_or_default()
                    ));
                }
                "Runtime.consoleAPICalled"
                    if parameters["type"] == "error" || parameters["type"] == "warning" =>
                {
                    self.complaints.push(parameters["args"].to_string());
                }
                "Inspector.targetCrashed" => self.complaints.push("the tab crashed".to_owned()),
                _ => {}
            }
        }
        Ok(())
    }
}
