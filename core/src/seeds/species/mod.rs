//! What a species' trees look like, and where they grow.

pub mod built_in;

use super::expected;
use super::pattern::CANDIDATES_PER_KM2;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Unit of tree heights: 1/1024 m.
pub const HEIGHT_UNITS: u32 = 1024;

/// Silhouette of a crown, from its rim at the crown's base to the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CrownShape {
    /// Straight flanks: spruce, fir.
    Cone,
    /// Between the two: pine, larch.
    Paraboloid,
    /// Half an ellipsoid: beech, oak.
    Dome,
}

impl CrownShape {
    /// Height of the crown's surface above its base, as a share of the crown's length, at a square
    /// of the distance from the axis given as a share of the radius's square, 0 … 1.
    pub fn surface(self, squared: f32) -> f32 {
        match self {
            Self::Cone => 1.0 - squared.sqrt(),
            Self::Paraboloid => 1.0 - squared,
            Self::Dome => (1.0 - squared).max(0.0).sqrt(),
        }
    }

    /// Share of the crown's disc over which its surface is higher than a share of its length: the
    /// inverse of [`Self::surface`].
    pub fn share_above(self, height: f64) -> f64 {
        let height = height.clamp(0.0, 1.0);
        match self {
            Self::Cone => (1.0 - height) * (1.0 - height),
            Self::Paraboloid => 1.0 - height,
            Self::Dome => 1.0 - height * height,
        }
    }
}

/// What a species is among: sources that tell no more than "conifer" choose from all conifers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Group {
    /// Spruce, fir, larch, pines.
    Conifer,
    /// Beech, oak, birch, willow.
    Broadleaf,
    /// What only grows where it is named: shrubs, stones.
    #[default]
    Other,
}

/// What the year does to a species.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Season {
    /// Always the same.
    #[default]
    Evergreen,
    /// Turns gold in autumn, then is bare: larch, birch.
    Gold,
    /// Turns brown and red in autumn, then is bare: beech, oak.
    Sheds,
    /// Does not live: stones.
    Still,
}

/// A species as a person states it; lengths in metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeciesDefinition {
    /// Name.
    pub name: String,
    /// Height of the smallest tree of a stand of its own height, metres.
    pub lowest_metres: f64,
    /// Height of the tallest tree of such a stand, metres, below 64.
    pub highest_metres: f64,
    /// No tree of the species is taller than this, whatever the land cover says, metres, below 64.
    pub tallest_metres: f64,
    /// Radius of the crown over the height of the tree.
    pub crown_radius_ratio: f64,
    /// Height of the crown's rim over the height of the tree.
    pub crown_base_ratio: f64,
    /// Silhouette.
    pub crown: CrownShape,
    /// Trees per square kilometre of closed forest of its own height.
    pub trees_per_km2: f64,
    /// Colour in maps of land cover, sRGB.
    pub colour: [u8; 3],
    /// What it is chosen among.
    #[serde(default)]
    pub group: Group,
    /// How common it is among its group where all conditions suit it; 0: only where it is named.
    #[serde(default)]
    pub commonness: f64,
    /// Heights above the sea between which it thrives at 47° north or south, metres; elsewhere the belts lie
    /// higher toward the equator and lower toward the poles.
    #[serde(default = "anywhere")]
    pub altitude_metres: [f64; 2],
    /// No steeper ground is chosen for it, degrees.
    #[serde(default = "steepest")]
    pub steepest_degrees: f64,
    /// Moisture of the ground that it likes best: 0 ridges and steep slopes, 1 hollows and valley floors.
    #[serde(default = "half")]
    pub moisture: f64,
    /// What the year does to it.
    #[serde(default)]
    pub season: Season,
}

fn anywhere() -> [f64; 2] {
    [-500.0, 9000.0]
}

fn steepest() -> f64 {
    60.0
}

fn half() -> f64 {
    0.5
}

/// A species of a scene: its definition, and the integers and the table made from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Species {
    /// Code in land cover, 1 and up.
    pub code: u8,
    /// As stated.
    pub definition: SpeciesDefinition,
    /// Height of the smallest tree of its own stand, 1/1024 m.
    pub lowest: u32,
    /// Height of the tallest, 1/1024 m.
    pub highest: u32,
    /// Bound of all heights, 1/1024 m.
    pub tallest: u32,
    /// Share of the candidates that live in closed forest of its own height, of 65536.
    pub share: u32,
    expected: Arc<expected::Table>,
}

impl Species {
    /// Checks a definition and prepares it; the error names the field and what it may be.
    pub fn new(code: u8, definition: SpeciesDefinition) -> Result<Self, String> {
        let d = &definition;
        let checks = [
            ("lowest_metres", d.lowest_metres, 0.5, d.highest_metres),
            ("highest_metres", d.highest_metres, 0.5, 63.9),
            ("tallest_metres", d.tallest_metres, d.highest_metres, 63.9),
            ("crown_radius_ratio", d.crown_radius_ratio, 0.02, 0.5),
            ("crown_base_ratio", d.crown_base_ratio, 0.0, 0.95),
            ("trees_per_km2", d.trees_per_km2, 1.0, CANDIDATES_PER_KM2.floor()),
            ("commonness", d.commonness, 0.0, 1000.0),
            ("altitude_metres", d.altitude_metres[0], -500.0, d.altitude_metres[1]),
            ("altitude_metres", d.altitude_metres[1], d.altitude_metres[0], 9000.0),
            ("steepest_degrees", d.steepest_degrees, 0.0, 90.0),
            ("moisture", d.moisture, 0.0, 1.0),
        ];
        for (field, value, least, most) in checks {
            if !(least..=most).contains(&value) {
                return Err(format!(
                    "species {:?}: {field} is {value}; it must lie in {least} to {most}",
                    d.name
                ));
            }
        }
        if code == 0 {
            return Err(format!("species {:?}: code 0 stands for no trees; codes begin with 1", d.name));
        }
        let units = |metres: f64| (metres * f64::from(HEIGHT_UNITS)).round() as u32;
        let mut species = Self {
            code,
            lowest: units(d.lowest_metres),
            highest: units(d.highest_metres),
            tallest: units(d.tallest_metres),
            share: (d.trees_per_km2 / CANDIDATES_PER_KM2 * 65_536.0).round() as u32,
            expected: Arc::default(),
            definition,
        };
        species.expected = Arc::new(expected::Table::new(&species));
        Ok(species)
    }

    /// The built-in table ([`built_in`]), by code.
    pub fn built_in() -> Vec<Self> {
        built_in::definitions()
            .into_iter()
            .zip(1..)
            .map(|(definition, code)| Self::new(code, definition).expect("the built-in species are valid"))
            .collect()
    }

    /// Mean height of the trees of its own stand, 1/1024 m.
    pub fn mean_height(&self) -> u32 {
        (self.lowest + self.highest) / 2
    }

    /// Height of a tree, 1/1024 m: `size` 0 … 255 within its stand, whose mean height is
    /// `stand_height` in quarter metres, or the species' own where that is 0.
    pub fn tree_height(&self, size: u8, stand_height: u8) -> u32 {
        let own = self.lowest + (self.highest - self.lowest) * u32::from(size) / 255;
        if stand_height == 0 {
            return own.min(self.tallest);
        }
        // Both factors are below 2¹⁶.
        (own * (u32::from(stand_height) * (HEIGHT_UNITS / 4)) / self.mean_height()).min(self.tallest)
    }

    /// Radius of the crown of a tree of a height, metres.
    pub fn crown_radius(&self, height_metres: f32) -> f32 {
        self.definition.crown_radius_ratio as f32 * height_metres
    }

    /// Height of the crown's surface above the anchor at a horizontal distance from the trunk, both in
    /// metres, for a tree of a height; `None` beyond the crown. Never above the height.
    pub fn crown_surface(&self, height_metres: f32, distance_metres: f32) -> Option<f32> {
        let share = distance_metres / self.crown_radius(height_metres);
        let base = self.definition.crown_base_ratio as f32;
        (share <= 1.0)
            .then(|| height_metres * (base + (1.0 - base) * self.definition.crown.surface(share * share)))
    }

    /// Mean height of the canopy over ground with a closure (0 … 255) and a stand height (quarter
    /// metres, 0: its own), gaps between crowns counting as 0, metres. See [`expected`].
    pub fn expected_canopy(&self, closure: u8, stand_height: u8) -> f32 {
        self.expected.canopy(closure, stand_height)
    }
}

/// A bound of the height of every tree of the table, metres.
pub fn tallest_metres(species: &[Species]) -> f32 {
    species.iter().map(|species| species.tallest).max().unwrap_or(0) as f32 / HEIGHT_UNITS as f32
}

/// A bound of the radius of every crown of the table, metres.
pub fn widest_crown_metres(species: &[Species]) -> f32 {
    species
        .iter()
        .map(|species| species.crown_radius(species.tallest as f32 / HEIGHT_UNITS as f32))
        .fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn crowns_are_below_the_top_and_within_the_radius(
            index in 0_usize..12, size: u8, stand: u8, distance in 0.0..20.0_f32,
        ) {
            let table = Species::built_in();
            let species = &table[index];
            let height = species.tree_height(size, stand) as f32 / HEIGHT_UNITS as f32;
            prop_assert!(height <= tallest_metres(&table));
            match species.crown_surface(height, distance) {
                Some(surface) => {
                    prop_assert!(surface <= height && surface >= 0.99 * height * species.definition.crown_base_ratio as f32);
                    prop_assert!(distance <= widest_crown_metres(&table));
                }
                None => prop_assert!(distance > 0.99 * species.crown_radius(height)),
            }
        }
    }

    #[test]
    fn a_stand_has_the_mean_height_that_it_is_said_to_have() {
        for species in Species::built_in() {
            for stand in [20_u8, 60, 100] {
                // No tree of a stand may be cut at the tallest.
                if species.highest * u32::from(stand) * (HEIGHT_UNITS / 4)
                    > species.tallest * species.mean_height()
                {
                    continue;
                }
                let sum: u32 = (0..=255).map(|size| species.tree_height(size, stand)).sum();
                let mean = f64::from(sum) / 256.0 / f64::from(HEIGHT_UNITS);
                assert!((mean - f64::from(stand) / 4.0).abs() < 0.01, "{mean}");
            }
        }
    }

    #[test]
    fn a_bad_definition_names_its_field() {
        let mut definition = Species::built_in()[0].definition.clone();
        definition.crown_radius_ratio = 3.0;
        assert!(Species::new(1, definition.clone()).unwrap_err().contains("crown_radius_ratio is 3"));
        definition.crown_radius_ratio = f64::NAN;
        assert!(Species::new(1, definition).is_err());
        assert!(Species::new(0, Species::built_in()[0].definition.clone()).unwrap_err().contains("code 0"));
    }
}
