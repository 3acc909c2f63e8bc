//! Treeline's test harness: real data and where it lies, the real programs, a real browser, a bad
//! connection, the comparison of pictures, and the exact reference of ray-cast height fields.

pub mod approach;
pub mod browser;
pub mod client_packages;
pub mod data;
pub mod faulty_link;
pub mod flight_link;
pub mod flight_path;
pub mod flight_simulation;
pub mod flight_world;
pub mod flights;
pub mod geotiff;
pub mod gpu;
pub mod height_field;
pub mod http_tiles;
pub mod kernel;
pub mod load_map;
pub mod load_map_gpu;
pub mod mapserver;
pub mod measure;
pub mod picture;
pub mod popping;
pub mod program;
pub mod raw_http;
pub mod recall;
pub mod reference;
pub mod router_tiles;
pub mod seed_pass;
pub mod static_files;
pub mod terrain_gpu;
pub mod tile_world;
pub mod tree_pictures;
pub mod tree_tops;
