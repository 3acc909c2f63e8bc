//! What lives on the GPU: the device, the tiles' slots, the frame's buffers and targets.

pub mod context;
pub mod frame_buffers;
pub mod plant_models;
pub mod read_back_belt;
pub mod targets;
pub mod tile_arrays;
pub mod tree_models;

pub use context::GpuContext;
