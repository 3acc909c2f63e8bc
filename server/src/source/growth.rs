//! From what a source says of a forest ("conifers", "larch with spruce") to the species at each place.
//!
//! Sources name *growths* where [`Cover`] has a species; [`GrownCover`] on top of them all decides. A growth is a
//! species, or a rule (a group of species, of which height, slope and moisture leave some), or shares of two.
//! Which of them grows at a place is decided by a hash of the place, in patches of some 40 m with frayed edges, in
//! integers, so that a place has one species whatever window it is seen in.

use super::patches::{Places, patch_hash};
use super::{Cover, CoverField, FieldExtent, HeightField, SampleGrid, SourceError};
use std::sync::Arc;
use treeline_core::geodesy;
use treeline_core::seeds::species::Group;
use treeline_core::seeds::{CrownShape, Species};

/// Belts of vegetation sink by this for each degree toward the pole, metres.
const METRES_PER_DEGREE: f32 = 110.0;
/// Latitude of the species table's belts; toward the equator they rise no more beyond the second.
const LATITUDE: f32 = 47.0;
const TROPIC: f32 = 25.0;
/// Belts fade out over this, metres.
const FADE_METRES: i32 = 150;
/// Distance over which the shape of the ground is taken, metres, and how many samples that may be.
const SHAPE_METRES: f32 = 30.0;
const MOST_STEPS: u32 = 32;
/// A hollow as deep as this under its surroundings is wet, metres at [`SHAPE_METRES`].
const HOLLOW_METRES: f32 = 4.0;

/// The height above the sea at 47° whose climate a height at a latitude has.
pub fn altitude_at_47_degrees(height: f32, latitude: f64) -> f32 {
    height + METRES_PER_DEGREE * ((latitude.abs() as f32).max(TROPIC) - LATITUDE)
}

/// The growths that stand for all that a source may say without naming species.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Growth {
    /// Conifers.
    pub conifer: u8,
    /// Broadleaves.
    pub broadleaf: u8,
    /// Either.
    pub mixed: u8,
}

/// What a growth is.
#[derive(Clone, Debug, PartialEq)]
enum Mix {
    /// The species of these codes, where they thrive.
    Rule(Vec<u8>),
    /// A primary species, and another with a share of 65536.
    Shares { primary: u8, secondary: u8, share: u32 },
}

/// The growths of a scene: codes 1 and up are its species, then rules, then mixtures.
#[derive(Clone, Debug)]
pub struct Growths {
    species: Vec<Niche>,
    mixes: Vec<Mix>,
}

/// Where a species thrives, in integers.
#[derive(Clone, Debug, PartialEq)]
struct Niche {
    code: u8,
    group: Group,
    commonness: i64,
    /// Metres.
    altitude: (i32, i32),
    /// Rise over run, of 256.
    steepest: i32,
    /// 0 … 255.
    moisture: i32,
}

impl Niche {
    fn of(species: &Species) -> Self {
        let definition = &species.definition;
        let steepest = definition.steepest_degrees.min(89.0).to_radians().tan() * 256.0;
        Self {
            code: species.code,
            group: definition.group,
            commonness: (definition.commonness * 256.0).round() as i64,
            altitude: (definition.altitude_metres[0] as i32, definition.altitude_metres[1] as i32),
            steepest: steepest as i32,
            moisture: (definition.moisture * 255.0).round() as i32,
        }
    }

    /// Metres from its belt.
    fn off(&self, altitude: i32) -> i32 {
        (self.altitude.0 - altitude).max(altitude - self.altitude.1).max(0)
    }

    /// How well a site suits it: 0 not at all.
    fn suits(&self, site: &Site) -> i64 {
        let belt = i64::from((FADE_METRES - self.off(site.altitude)).max(0));
        let steep = if site.slope > self.steepest { 1 } else { 16 };
        let thirst = i64::from((256 - 2 * (self.moisture - site.moisture).abs()).max(24));
        self.commonness * belt * steep * thirst
    }
}

/// What is known of a place, in integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Site {
    /// At 47°, metres.
    altitude: i32,
    /// Rise over run, of 256.
    slope: i32,
    /// 0 … 255.
    moisture: i32,
}

impl Growths {
    /// The species of a scene and the rules for them.
    pub fn new(species: &[Species]) -> Self {
        let niches: Vec<Niche> = species.iter().map(Niche::of).collect();
        let group = |wanted: &dyn Fn(&Niche) -> bool| -> Vec<u8> {
            let common = niches.iter().filter(|niche| niche.commonness > 0 && wanted(niche));
            common.map(|niche| niche.code).collect()
        };
        let mut rules = [
            group(&|niche| niche.group == Group::Conifer),
            group(&|niche| niche.group == Group::Broadleaf),
            group(&|niche| niche.group != Group::Other),
        ];
        // Tables that say nothing of groups: by the crown.
        let dome = |code: &u8| species[usize::from(*code) - 1].definition.crown == CrownShape::Dome;
        let all: Vec<u8> = niches.iter().map(|niche| niche.code).collect();
        for (rule, domes) in rules.iter_mut().zip([Some(false), Some(true), None]) {
            if rule.is_empty() {
                *rule = all
                    .iter()
                    .copied()
                    .filter(|code| domes.is_none_or(|wanted| dome(code) == wanted))
                    .collect();
            }
            if rule.is_empty() {
                rule.clone_from(&all);
            }
        }
        Self { species: niches, mixes: rules.map(Mix::Rule).to_vec() }
    }

    /// The rules.
    pub fn rules(&self) -> Growth {
        let first = self.species.len() as u8 + 1;
        if self.species.is_empty() {
            return Growth { conifer: 0, broadleaf: 0, mixed: 0 };
        }
        Growth { conifer: first, broadleaf: first + 1, mixed: first + 2 }
    }

    /// The growth of two species, the second with a share of 0 … 1.
    ///
    /// # Errors
    /// Where a scene has no codes left.
    pub fn mixture(&mut self, primary: u8, secondary: u8, share: f64) -> Result<u8, String> {
        let mix = Mix::Shares { primary, secondary, share: (share * 65_536.0).round() as u32 };
        let index = self.mixes.iter().position(|known| *known == mix).unwrap_or(self.mixes.len());
        let code = u8::try_from(self.species.len() + index + 1).map_err(|_| {
            "there are more mixtures of species than codes are left; give classes the same secondary_share".to_owned()
        })?;
        if index == self.mixes.len() {
            self.mixes.push(mix);
        }
        Ok(code)
    }

    fn mix(&self, growth: u8) -> Option<&Mix> {
        usize::from(growth).checked_sub(self.species.len() + 1).and_then(|index| self.mixes.get(index))
    }

    /// The species that growths may become, by code, ascending.
    pub fn species_of(&self, growths: &[u8]) -> Vec<u8> {
        let mut codes: Vec<u8> = growths
            .iter()
            .flat_map(|&growth| match self.mix(growth) {
                None => vec![growth],
                Some(Mix::Rule(codes)) => codes.clone(),
                Some(Mix::Shares { primary, secondary, .. }) => vec![*primary, *secondary],
            })
            .filter(|&code| code != 0)
            .collect();
        codes.sort_unstable();
        codes.dedup();
        codes
    }

    /// The species of a growth at a site; `chance` is the patch's, 0 … 65535.
    fn choose(&self, mix: &Mix, site: &Site, chance: u32) -> u8 {
        match mix {
            Mix::Shares { primary, secondary, share } => {
                if chance < *share {
                    *secondary
                } else {
                    *primary
                }
            }
            Mix::Rule(codes) => {
                let niches = || codes.iter().map(|code| &self.species[usize::from(*code) - 1]);
                let total: i64 = niches().map(|niche| niche.suits(site)).sum();
                if total == 0 {
                    // Beyond all belts: whoever is nearest.
                    return niches()
                        .min_by_key(|niche| niche.off(site.altitude))
                        .map_or(0, |niche| niche.code);
                }
                let mut left = ((i128::from(total) * i128::from(chance)) >> 16) as i64;
                for niche in niches() {
                    left -= niche.suits(site);
                    if left < 0 {
                        return niche.code;
                    }
                }
                codes.last().copied().unwrap_or(0)
            }
        }
    }
}

/// A cover of species on one of growths.
pub struct GrownCover {
    below: Arc<dyn CoverField>,
    growths: Growths,
    height: Arc<dyn HeightField>,
    /// Decides which patch is what.
    seed: u32,
}

impl GrownCover {
    /// Decides the growths of `below`.
    pub fn new(
        below: Arc<dyn CoverField>,
        growths: Growths,
        height: Arc<dyn HeightField>,
        seed: u32,
    ) -> Self {
        Self { below, growths, height, seed }
    }
}

impl CoverField for GrownCover {
    fn extent(&self) -> &FieldExtent {
        self.below.extent()
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        self.below.sample(grid, out)?;
        let mut any = false;
        let mut ruled = false;
        for cover in out.iter() {
            if let Some(mix) = self.growths.mix(cover.species) {
                any = true;
                ruled |= matches!(mix, Mix::Rule(_));
            }
        }
        if !any {
            return Ok(());
        }
        let places = Places::of(grid);
        let sites = if ruled { Some(Sites::of(grid, &places, self.height.as_ref())?) } else { None };
        let width = grid.size().0 as usize;
        for (index, cover) in out.iter_mut().enumerate() {
            let Some(mix) = self.growths.mix(cover.species) else { continue };
            let (column, row) = (index % width, index / width);
            let site = sites
                .as_ref()
                .map_or(Site { altitude: 0, slope: 0, moisture: 128 }, |sites| sites.at(column, row));
            let (x, y) = places.units(column, row);
            cover.species = self.growths.choose(mix, &site, patch_hash(x, y, self.seed) >> 16);
        }
        Ok(())
    }
}

/// The ground's height and shape at the samples of a grid.
struct Sites<'a> {
    places: &'a Places,
    heights: Vec<f32>,
    stride: usize,
    margin: usize,
    step_metres: (f64, f64),
}

impl<'a> Sites<'a> {
    fn of(grid: &SampleGrid, places: &'a Places, height: &dyn HeightField) -> Result<Self, SourceError> {
        let step_metres = places.step_metres();
        let margin = ((SHAPE_METRES / step_metres.1 as f32).round() as u32).clamp(1, MOST_STEPS);
        let wide = super::patches::with_margin(grid, margin);
        let mut heights = vec![f32::NAN; wide.len()];
        height.sample(&wide, &mut heights)?;
        Ok(Self { places, heights, stride: wide.size().0 as usize, margin: margin as usize, step_metres })
    }

    fn at(&self, column: usize, row: usize) -> Site {
        let (margin, stride) = (self.margin, self.stride);
        let here = (row + margin) * stride + column + margin;
        let middle = self.heights[here];
        let latitude = self.places.latitude(column, row);
        let shrink = latitude.to_radians().cos().abs().max(0.01);
        let reach = (
            (self.step_metres.0 * shrink * margin as f64) as f32,
            (self.step_metres.1 * margin as f64) as f32,
        );
        let (west, east) = (self.heights[here - margin], self.heights[here + margin]);
        let (north, south) = (self.heights[here - margin * stride], self.heights[here + margin * stride]);
        let slope = ((east - west) / (2.0 * reach.0)).hypot((north - south) / (2.0 * reach.1));
        // Scaled to the distance for which it is meant: the ground's bend grows with its square.
        let bend = SHAPE_METRES / reach.1;
        let hollow = ((west + east + north + south) / 4.0 - middle) * bend * bend;
        // A NaN becomes 0: unknown ground is level and at the sea.
        Site {
            // No belt lies below the sea: in the tropics the lowest has the hills as well.
            altitude: altitude_at_47_degrees(middle, latitude).max(0.0) as i32,
            slope: (slope * 256.0) as i32,
            moisture: ((0.5 + 0.5 * hollow / HOLLOW_METRES - 0.4 * slope) * 255.0).clamp(0.0, 255.0) as i32,
        }
    }
}

/// Degrees of a step along a meridian, in metres.
pub fn metres_of_degrees(degrees: f64) -> f64 {
    degrees * geodesy::EQUATOR_METRES / 360.0
}

#[cfg(test)]
#[path = "growth_tests.rs"]
mod tests;
