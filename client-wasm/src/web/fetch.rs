//! Scene and tiles over the network.

use super::failure::{Failure, text_of};
use crate::engine::{Payload, PhotoPixels, TileRequest};
use crate::stream::requests::FetchFailure;
use js_sys::{ArrayBuffer, Promise, Uint8Array};
use treeline_core::scene::SceneDescription;
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::JsFuture;
use web_sys::{
    AbortSignal, Blob, ColorSpaceConversion, ImageBitmap, ImageBitmapOptions, PremultiplyAlpha, RequestInit,
    Response, Window,
};

/// How often the scene is asked for before the server counts as gone.
const SCENE_ATTEMPTS: u32 = 5;
/// Wait after the first failure, milliseconds; each further one doubles it.
const SCENE_WAIT_MILLISECONDS: i32 = 300;

/// The scene, with patience: a server may be starting.
pub async fn scene(window: &Window) -> Result<SceneDescription, Failure> {
    let mut last = String::new();
    for attempt in 0..SCENE_ATTEMPTS {
        if attempt > 0 {
            sleep(window, SCENE_WAIT_MILLISECONDS << (attempt - 1)).await;
        }
        match scene_once(window).await {
            Ok(scene) => return Ok(scene),
            Err(FetchFailure::Permanent(problem)) => return Err(Failure::new("failed", problem)),
            Err(FetchFailure::Temporary(problem)) => last = problem,
        }
    }
    Err(Failure::new("server-gone", last))
}

/// The scene, asked for once. It is permanent only where what answers is no Treeline server.
pub async fn scene_once(window: &Window) -> Result<SceneDescription, FetchFailure> {
    let text =
        text(window, "scene.json").await.map_err(|problem| FetchFailure::Temporary(problem.to_string()))?;
    serde_json::from_str(&text).map_err(|error| FetchFailure::Permanent(format!("scene.json: {error}")))
}

/// A tile's answer.
pub struct Tile {
    /// Decoded as far as the browser does it.
    pub payload: Payload,
    /// Its body was at most so many bytes on the wire: its Content-Length, else what it is without
    /// Content-Encoding.
    pub wire_bound: u64,
}

/// Asks for a tile.
pub async fn tile(
    window: &Window,
    request: &TileRequest,
    signal: &AbortSignal,
) -> Result<Tile, FetchFailure> {
    let response = get(window, &request.url, Some(signal)).await?;
    let stated = response.headers().get("content-length").ok().flatten();
    let stated = stated.and_then(|length| length.parse::<u64>().ok());
    let (payload, length) = if request.resource.is_photo() {
        photo(window, &response).await?
    } else {
        let buffer: ArrayBuffer = body(response.array_buffer()).await?;
        let bytes = Uint8Array::new(&buffer).to_vec();
        let length = bytes.len() as u64;
        (Payload::Bytes(bytes), length)
    };
    Ok(Tile { payload, wire_bound: stated.unwrap_or(length) })
}

/// Decodes off the main thread, and colours as they are: the GPU converts, and nothing else may.
///
/// Gives the file's length, bytes, too.
async fn photo(window: &Window, response: &Response) -> Result<(Payload, u64), FetchFailure> {
    let blob: Blob = body(response.blob()).await?;
    let options = ImageBitmapOptions::new();
    options.set_color_space_conversion(ColorSpaceConversion::None);
    options.set_premultiply_alpha(PremultiplyAlpha::None);
    let bitmap: ImageBitmap =
        body(window.create_image_bitmap_with_blob_and_image_bitmap_options(&blob, &options)).await?;
    let (width, height) = (bitmap.width(), bitmap.height());
    Ok((Payload::Photo { width, height, pixels: PhotoPixels::Bitmap(bitmap) }, blob.size() as u64))
}

async fn text(window: &Window, url: &str) -> Result<String, FetchFailure> {
    let response = get(window, url, None).await?;
    let text = JsFuture::from(response.text().map_err(temporary)?).await.map_err(temporary)?;
    text.as_string().ok_or_else(|| FetchFailure::Temporary(format!("{url}: no text")))
}

/// A good answer. What the server refuses stays refused; all else may be better next time.
async fn get(window: &Window, url: &str, signal: Option<&AbortSignal>) -> Result<Response, FetchFailure> {
    let options = RequestInit::new();
    options.set_signal(signal);
    let response: Response = body(Ok(window.fetch_with_str_and_init(url, &options))).await?;
    let status = response.status();
    if response.ok() {
        return Ok(response);
    }
    let problem = format!("{url}: status {status}");
    let refused = (400..500).contains(&status) && status != 408 && status != 429;
    Err(if refused { FetchFailure::Permanent(problem) } else { FetchFailure::Temporary(problem) })
}

/// Waits for a promise of a known kind.
async fn body<T: JsCast>(promise: Result<Promise, JsValue>) -> Result<T, FetchFailure> {
    JsFuture::from(promise.map_err(temporary)?)
        .await
        .map_err(temporary)?
        .dyn_into()
        .map_err(|_| FetchFailure::Temporary("an answer of an unexpected kind".to_owned()))
}

fn temporary(error: JsValue) -> FetchFailure {
    FetchFailure::Temporary(text_of(&error))
}

/// Waits.
pub async fn sleep(window: &Window, milliseconds: i32) {
    let promise = Promise::new(&mut |resolve, _| {
        // A browser that refuses a timer is one that does not wait.
        let _ = window.set_timeout_with_callback_and_timeout_and_arguments_0(&resolve, milliseconds);
    });
    let _ = JsFuture::from(promise).await;
}
