//! What server, client and shaders of Treeline agree on.
//!
//! Pure code for native and wasm: no I/O, no async, no clock, no thread, no GPU.
//! Follow one tile through the modules: [`tile`] names it, [`grid`] says where its samples
//! stand, [`geodesy`] puts them on the ellipsoid, [`layer`] says what a layer's tile looks like,
//! [`query`] spells its URL, [`codec`] packs it, [`hash`] and [`seeds`] grow its trees, [`tree_model`] says what they look like near by, [`plant_model`] the undergrowth,
//! [`scene`] describes all of it to a client, [`camera`] says who looks and [`sun`] by which light.

pub mod camera;
pub mod codec;
pub mod geodesy;
pub mod grid;
pub mod hash;
pub mod layer;
pub mod plant_model;
pub mod query;
pub mod ray_frame;
pub mod scene;
pub mod seeds;
pub mod sun;
pub mod tile;
pub mod tree_model;
