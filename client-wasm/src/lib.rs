//! Treeline's client: one engine, three hosts (browser, `treeline-shot`, tests).
//!
//! Follow a tile: [`stream`] chooses it, asks for it, unpacks it and finds it a slot, [`gpu`] holds
//! the slots, [`passes`] draw from them in the order of [`frame`], and [`engine`] is what a host
//! calls: `step(now, view) → FrameReport`. `headless` and `web` are the only platform code.

pub mod controls;
pub mod engine;
pub mod frame;
pub mod gpu;
#[cfg(feature = "headless")]
pub mod headless;
pub mod outage;
pub mod passes;
pub mod stats;
pub mod stream;
pub mod survey;
mod twin_world;
#[cfg(target_arch = "wasm32")]
pub mod web;
pub mod wire_bytes;
