//! Treeline's tile server: `http` asks `cache`, which asks `recipe`, which asks `source`.

pub mod source;
