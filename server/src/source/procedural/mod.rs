//! The built-in scene: an invented massif of the Central Alps, some 40 km across, without a file.
//!
//! Follow it from the large to the small: [`massif`] raises it and lets rivers ([`erosion`],
//! [`river`]), ice and a moraine ([`lake`]) shape it, once, on a grid of 80 m; [`ground`] gives the
//! ground at any place, with [`gullies`] and the roughness of a [`noise_tile`]; [`material`] says what
//! lies and grows there, and [`palette`] what colour that has from the air. [`mod@height`], [`mod@colour`] and
//! [`mod@cover`] answer for grids of places ([`geography`]).
//!
//! Everything comes from integer hashes through additions, multiplications, divisions and square
//! roots of IEEE numbers, in an order fixed for each place: no mathematical library is asked, so every
//! machine and every window gives the same bits.

use colour::Pyramid;
use ground::Landscape;
use std::sync::LazyLock;

mod colour;
mod cover;
mod defaults;
mod erosion;
mod geography;
mod ground;
mod gullies;
mod height;
mod lake;
mod lanes;
mod massif;
mod material;
mod noise_tile;
mod palette;
mod random;
mod river;
mod settle;

pub use colour::ProceduralColour;
pub use cover::{ProceduralCover, SPECIES};
pub use defaults::{SceneDefaults, scene_defaults};
pub use height::ProceduralHeight;

/// Changes whenever any height, colour or cover of the scene does: part of its data version.
pub const REVISION: &str = "valdrosa-1";

static LAND: LazyLock<Landscape> = LazyLock::new(Landscape::new);
static PYRAMID: LazyLock<Pyramid> = LazyLock::new(|| Pyramid::new(&LAND));

/// The terrain of the built-in scene. Nothing is computed before the first sample is asked for.
pub fn height() -> ProceduralHeight {
    ProceduralHeight::new(&LAND)
}

/// The photo of the built-in scene. Nothing is computed before the first sample is asked for.
pub fn colour() -> ProceduralColour {
    ProceduralColour::new(&LAND, &PYRAMID)
}

/// The land cover of the built-in scene. Nothing is computed before the first sample is asked for.
pub fn cover() -> ProceduralCover {
    ProceduralCover::new(&LAND)
}

#[cfg(test)]
mod tests;
