//! The engine without a browser: for `treeline-shot` and for tests.
//!
//! [`adapter`] opens a device, [`fetch`] gets tiles, [`session`] settles a view and draws it,
//! [`capture`] reads pictures back, [`trees`] the trees drawn one by one, [`undergrowth`] what
//! grows below them.

pub mod adapter;
pub mod capture;
pub mod fetch;
pub mod height_field;
pub mod session;
#[cfg(test)]
mod tests;
pub mod trees;
pub mod undergrowth;

pub use adapter::{AdapterChoice, open};
pub use capture::Capture;
pub use fetch::{Fetched, TileFetcher};
pub use session::Session;
pub use trees::SelectedTree;

/// What can go wrong without a browser, one line each.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HeadlessError {
    /// No adapter of the kind asked for.
    #[error("no {0} Vulkan adapter; install a driver (Debian, Ubuntu: apt-get install mesa-vulkan-drivers)")]
    NoAdapter(&'static str),
    /// The adapter gives no device.
    #[error("adapter {adapter} gives no device: {problem}")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// What the driver says.
        problem: String,
    },
    /// The device failed while drawing.
    #[error("GPU: {0}")]
    Gpu(String),
    /// The picture is larger than the adapter's textures.
    #[error("size {0}x{1} is larger than this adapter's {2} pixels a side")]
    TooLarge(u32, u32, u32),
    /// A tile that the view wants does not come.
    #[error("{url}: {problem}")]
    Tile {
        /// Where it was asked for.
        url: String,
        /// What the last attempt said.
        problem: String,
    },
}
