//! Treeline's test harness: real data and where it lies, the real programs, a real browser, a bad
//! connection, and the comparison of pictures.

pub mod browser;
pub mod data;
pub mod faulty_link;
pub mod picture;
pub mod program;
