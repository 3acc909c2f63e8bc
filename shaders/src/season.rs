//! Layout of the table of seasons: bind group 0, binding 10.

use bytemuck::{Pod, Zeroable};
use treeline_core::seeds::season::{ROWS, SpeciesSeason, YearDay};

/// Set in [`crate::layout::View::flags`] where the day differs from high summer.
pub const FLAG_SEASON: u32 = 2;
/// Bits of a surface type in the surface texture; the code of the canopy's species is above them.
pub const SPECIES_SHIFT: u32 = 3;
/// From this bit of [`crate::trees::TreeInstance::height_units`] on: leaves of the tree, of 127.
pub const LEAVES_SHIFT: u32 = 17;
/// From this bit on: snow on the tree, of 255.
pub const SNOW_SHIFT: u32 = 24;

/// A species' year.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SeasonRow {
    /// First and last day of leaf-out, days between which the leaves turn.
    pub out_turn: [f32; 4],
    /// Days between which they fall; 1 where they do; 0.
    pub fall: [f32; 4],
    /// Reflectance (linear) of turned leaves; 0.
    pub turned: [f32; 4],
    /// Reflectance of what is left without any; 0.
    pub bare: [f32; 4],
}

impl From<&SpeciesSeason> for SeasonRow {
    fn from(season: &SpeciesSeason) -> Self {
        let [out, out_end] = season.leaf_out;
        let [turn, turn_end] = season.turn;
        let [fall, fall_end] = season.fall.unwrap_or_default();
        let colour = |[red, green, blue]: [f32; 3]| [red, green, blue, 0.0];
        Self {
            out_turn: [out, out_end, turn, turn_end],
            fall: [fall, fall_end, f32::from(u8::from(season.fall.is_some())), 0.0],
            turned: colour(season.colours[0]),
            bare: colour(season.colours[1]),
        }
    }
}

/// A table as the GPU reads it.
pub fn rows(table: &[SpeciesSeason; ROWS]) -> [SeasonRow; ROWS] {
    table.each_ref().map(SeasonRow::from)
}

/// [`crate::layout::View::season`] of a day at a latitude (degrees).
pub fn season_of_view(day: &YearDay, latitude: f64) -> [f32; 4] {
    let strength = if latitude < 0.0 { -day.strength } else { day.strength };
    [day.day, day.north, strength, day.snow_line]
}
