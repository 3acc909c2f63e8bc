//! How well land cover is told, against a truth: shared by the test and the benchmark.
//!
//! Fixed before the classifier was written, so that it could not be bent towards it: the classes, what
//! counts as forest, the picture that the built-in landscape gives ([`photograph`]), its halves, and the
//! places that were labelled by eye ([`labels`]).
#![allow(dead_code, reason = "the test and the benchmark each use their part")]

pub mod confusion;
pub mod labels;
pub mod photograph;

use treeline_core::layer::SurfaceType;
use treeline_server::source::Cover;

/// Share of the ground under crowns from which a place of the truth counts as forest, of 255: 30 %.
pub const FOREST_CLOSURE: u8 = 77;

/// What a place is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Closed or open forest.
    Forest,
    /// Meadows, pastures, fields.
    Grass,
    /// Rock, scree, gravel, and what people have built.
    Bare,
    /// Snow and ice.
    Snow,
    /// Water.
    Water,
}

impl Class {
    /// All, in the order of a [`confusion::Confusion`].
    pub const ALL: [Self; 5] = [Self::Forest, Self::Grass, Self::Bare, Self::Snow, Self::Water];
    /// Their names.
    pub const NAMES: [&'static str; 5] = ["forest", "grass", "bare", "snow", "water"];

    /// The class of a cover; `least_closure` of 255 makes forest of what grows.
    pub fn of(cover: Cover, least_closure: u8) -> Self {
        if cover.species != 0 && cover.closure >= least_closure {
            return Self::Forest;
        }
        match cover.surface() {
            SurfaceType::Water => Self::Water,
            SurfaceType::Snow => Self::Snow,
            SurfaceType::Grass => Self::Grass,
            SurfaceType::Rock | SurfaceType::Plain | SurfaceType::Canopy => Self::Bare,
        }
    }
}
