//! Every frame that a page draws, as the ray caster left it: the distance of each pixel.

use super::Page;
use anyhow::Context;
use base64::Engine;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use treeline_core::camera::GeographicCamera;

/// A script to run before the page's own ([`super::Browser::open_after`]): it notes each frame that the page
/// draws, with the camera it was drawn for. It reads the texture of distances that the frame's
/// shading reads, right after the frame was submitted and before anything else can be.
pub const FRAME_RECORDER: &str = r#"(() => {
  const recorder = (window.frameRecorder = { frames: [], pending: 0, failures: [] });
  let distance = null;
  let device = null;
  const createTexture = GPUDevice.prototype.createTexture;
  GPUDevice.prototype.createTexture = function (descriptor) {
    const texture = createTexture.call(this, descriptor);
    if (descriptor.label === "distance") [distance, device] = [texture, this];
    return texture;
  };
  async function record() {
    if (!distance) return;
    const { width, height } = distance;
    const bytesPerRow = Math.ceil((4 * width) / 256) * 256;
    const usage = GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST;
    const buffer = device.createBuffer({ size: bytesPerRow * height, usage });
    const encoder = device.createCommandEncoder();
    encoder.copyTextureToBuffer({ texture: distance }, { buffer, bytesPerRow }, [width, height]);
    device.queue.submit([encoder.finish()]);
    const frame = { width, height, camera: window.treeline?.camera() ?? null };
    recorder.frames.push(frame);
    await buffer.mapAsync(GPUMapMode.READ);
    const bytes = new Uint8Array(buffer.getMappedRange());
    let text = "";
    for (let row = 0; row < height; row++) {
      text += String.fromCharCode(...bytes.subarray(row * bytesPerRow, row * bytesPerRow + 4 * width));
    }
    buffer.destroy();
    frame.distances = btoa(text);
  }
  const getCurrentTexture = GPUCanvasContext.prototype.getCurrentTexture;
  GPUCanvasContext.prototype.getCurrentTexture = function () {
    recorder.pending += 1;
    // Once the page's turn, which draws and submits, is over.
    queueMicrotask(() =>
      record().catch((error) => recorder.failures.push(String(error))).finally(() => (recorder.pending -= 1)));
    return getCurrentTexture.call(this);
  };
})();"#;

/// Frames fetched from the page at once.
const AT_ONCE: usize = 32;

/// A frame that was drawn.
#[derive(Clone, Debug)]
pub struct RecordedFrame {
    /// The camera; `None` for frames before the page could say it.
    pub camera: Option<GeographicCamera>,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Metres from the eye by pixel, row by row from the top left; negative where the ray met nothing.
    pub distances: Vec<f32>,
}

impl Page {
    /// The frames that were drawn since the page was opened, or since this was last asked; the page must run
    /// [`FRAME_RECORDER`].
    pub fn recorded_frames(&mut self) -> anyhow::Result<Vec<RecordedFrame>> {
        let start = Instant::now();
        self.wait_for("window.frameRecorder.pending === 0", Duration::from_secs(60))
            .with_context(|| format!("frames are still read back after {:?}", start.elapsed()))?;
        let failures = self.evaluate("window.frameRecorder.failures")?;
        anyhow::ensure!(failures == json!([]), "frames that could not be read: {failures}");
        let mut frames = Vec::new();
        loop {
            let batch = self.evaluate(&format!("window.frameRecorder.frames.splice(0, {AT_ONCE})"))?;
            let batch = batch.as_array().context("frames")?;
            if batch.is_empty() {
                return Ok(frames);
            }
            for frame in batch {
                frames.push(parsed(frame)?);
            }
        }
    }
}

fn parsed(frame: &Value) -> anyhow::Result<RecordedFrame> {
    let side = |name: &str| frame[name].as_u64().map(|side| side as u32).context("a size");
    let text = frame["distances"].as_str().context("distances")?;
    let bytes = base64::engine::general_purpose::STANDARD.decode(text)?;
    let (width, height) = (side("width")?, side("height")?);
    let distances: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
    anyhow::ensure!(distances.len() == width as usize * height as usize, "a whole frame");
    Ok(RecordedFrame { camera: serde_json::from_value(frame["camera"].clone())?, width, height, distances })
}
