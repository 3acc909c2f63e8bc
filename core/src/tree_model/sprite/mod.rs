//! Pictures of twigs and bark, painted by rule: a model's cards carry them.
//!
//! Colours are reflectances of a middling summer: the drawing side multiplies them by the season's and
//! the ground's colour. A twig grows from the middle of its picture's lower edge upwards.

mod canvas;
mod twigs;

pub use canvas::Picture;
pub use twigs::{bark, stone, twig};
