//! Treeline's tile server: `http` asks `cache`, which asks `recipe`, which asks `source`.

pub mod cache;
pub mod cli;
pub mod commands;
pub mod config;
pub mod default_camera;
pub mod digest;
pub mod http;
pub mod limits;
pub mod metrics;
pub mod opening;
pub mod recipe;
pub mod revision;
pub mod scene;
pub mod scene_file;
pub mod small_file;
pub mod source;
pub mod species_setting;
pub mod state;
pub mod toml_file;
pub mod user_error;
pub mod watching;
