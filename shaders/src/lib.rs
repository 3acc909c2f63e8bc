//! WGSL passes, their GPU struct layouts and their CPU twins.

pub mod layout;
