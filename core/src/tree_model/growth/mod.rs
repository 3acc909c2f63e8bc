//! How each kind of tree grows: the parameters of the model, by the species' name.
//!
//! They are a part of those of J. Weber and J. Penn, *Creation and Rendering of Realistic Trees*
//! (SIGGRAPH 1995): per level of branches a number, a down angle with its change along the parent, a
//! curve, a length and their variations; a ratio of radii; attraction upwards. Their pruning
//! envelope is the crown of the canopy map, and it alone ends the first branches.

mod forms;

use crate::seeds::{CrownShape, SpeciesDefinition};
use forms::{BEECH, BIRCH, DWARF_PINE, FIR, LARCH, OAK, PINE, SHRUB, SPRUCE, STONE_PINE, WILLOW};

/// A picture of a twig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Twig {
    /// Needles on a flat fan of shoots; needles per texel of shoot.
    Spray {
        /// Needles per texel of a shoot's length.
        density: f32,
    },
    /// Bundles of long needles.
    Tufts {
        /// Length of a needle over the picture's side.
        needle: f32,
    },
    /// Leaves.
    Leaves {
        /// Length of a leaf over the picture's side.
        length: f32,
        /// Its width.
        width: f32,
        /// Depth of its lobes, 0 … 1.
        lobes: f32,
        /// Narrow twigs that hang.
        hanging: bool,
    },
}

/// A bark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bark {
    /// sRGB, 0 … 1.
    pub colour: [f32; 3],
    /// Depth of its streaks, 0 … 1.
    pub contrast: f32,
    /// Streaks across in place of along.
    pub bands: bool,
}

/// A level of branches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Branches {
    /// Number on a parent.
    pub count: u32,
    /// Branches that begin together; 1: each alone.
    pub whorl: u32,
    /// Where along the parent they begin and end, shares of its length (limbs: of the way from the
    /// crown's bottom to its top).
    pub range: [f32; 2],
    /// Angle to the parent's direction at the beginning and at the end of the range, degrees.
    pub down: [f32; 2],
    /// Its variation, degrees.
    pub down_variation: f32,
    /// Bend along the branch, degrees, upwards positive: of its first half and of its second.
    pub curve: [f32; 2],
    /// Variation of the bend, degrees.
    pub curve_variation: f32,
    /// Length over the parent's; limbs end at the crown's surface.
    pub length: f32,
    /// Least share of the way to the crown's surface that a limb takes.
    pub least_reach: f32,
    /// Pieces of a branch.
    pub segments: usize,
}

/// How foliage sits on the last branches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Foliage {
    /// A folded sheet along the whole branch, and one that hangs from it.
    Sheets {
        /// Width over length.
        width: f32,
        /// Slope of the two halves of the fold, degrees downwards.
        fold: f32,
        /// Depth of the hanging sheet over the branch's length.
        curtain: f32,
    },
    /// Cards along the branch and at its tip.
    Cards {
        /// Cards on a branch.
        count: u32,
        /// Side of a card over the tree's height.
        size: f32,
        /// How far cards turn downwards, 0 … 1.
        hang: f32,
    },
}

/// A growth form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrowthForm {
    /// Stems from one foot.
    pub stems: u32,
    /// How far stems lean outwards, degrees.
    pub lean: f32,
    /// Radius of the trunk at its foot.
    pub trunk_radius: f32,
    /// Height where the trunk's wood ends.
    pub trunk_top: f32,
    /// Wander of the trunk, degrees a segment.
    pub trunk_bend: f32,
    /// Foliage below the crown's rim, as a share of the crown's length.
    pub hanging: f32,
    /// First branches.
    pub limbs: Branches,
    /// How much closer they stand towards the top: 1 is evenly.
    pub crowding: f32,
    /// Branches on those, where there are any.
    pub twigs: Option<Branches>,
    /// Pull on a twig's direction, upwards positive.
    pub attraction: f32,
    /// Foliage.
    pub foliage: Foliage,
    /// Its picture.
    pub twig: Twig,
    /// Its colour, sRGB, 0 … 1.
    pub colour: [f32; 3],
    /// Bark.
    pub bark: Bark,
}

/// What a species is made as.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// Grown.
    Plant(&'static GrowthForm),
    /// A boulder of a colour, sRGB, 0 … 1.
    Boulder([f32; 3]),
}

/// Words of names, and what grows under them; the first that fits counts.
const BY_NAME: &[(&[&str], Form)] = &[
    (&["rock", "boulder", "stone block"], Form::Boulder([0.52, 0.51, 0.48])),
    (&["dwarf pine", "mountain pine", "mugo", "krummholz"], Form::Plant(&DWARF_PINE)),
    (&["stone pine", "cembra", "arolla", "swiss pine"], Form::Plant(&STONE_PINE)),
    (&["spruce", "picea", "hemlock", "tsuga"], Form::Plant(&SPRUCE)),
    (&["fir", "abies", "douglas", "cedar", "thuja", "juniper", "cypress"], Form::Plant(&FIR)),
    (&["larch", "larix", "tamarack"], Form::Plant(&LARCH)),
    (&["shrub", "bush", "heath", "alder", "hazel", "scrub"], Form::Plant(&SHRUB)),
    (&["pine", "pinus"], Form::Plant(&PINE)),
    (&["oak", "quercus", "chestnut", "walnut"], Form::Plant(&OAK)),
    (&["birch", "betula", "aspen", "poplar", "populus", "cottonwood"], Form::Plant(&BIRCH)),
    (&["willow", "salix"], Form::Plant(&WILLOW)),
    (&["beech", "fagus", "maple", "acer", "ash", "lime", "linden", "elm", "hornbeam"], Form::Plant(&BEECH)),
];

/// Trees that stay lower than this and have no name that is known are shrubs, metres.
const SHRUB_METRES: f64 = 5.0;

impl Form {
    /// The form of a species: by its name, else by its height and the shape of its crown.
    pub fn of(definition: &SpeciesDefinition) -> Self {
        let name = definition.name.to_lowercase();
        let known = BY_NAME.iter().find(|(words, _)| words.iter().any(|word| has_word(&name, word)));
        if let Some((_, form)) = known {
            return *form;
        }
        if definition.tallest_metres < SHRUB_METRES {
            return Self::Plant(&SHRUB);
        }
        Self::Plant(match definition.crown {
            CrownShape::Cone => &SPRUCE,
            CrownShape::Paraboloid => &PINE,
            CrownShape::Dome => &BEECH,
        })
    }
}

/// Whether the words stand in a name, not within a longer word (plurals aside).
fn has_word(name: &str, words: &str) -> bool {
    name.match_indices(words).any(|(start, _)| {
        let before = name[..start].chars().next_back();
        let after =
            name[start + words.len()..].trim_start_matches("es").trim_start_matches('s').chars().next();
        !before.is_some_and(char::is_alphabetic) && !after.is_some_and(char::is_alphabetic)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seeds::Species;

    #[test]
    fn every_name_grows_something_like_it() {
        let like = |name: &str, crown: CrownShape, tallest: f64| {
            let mut definition = Species::built_in()[0].definition.clone();
            (definition.name, definition.crown, definition.tallest_metres) =
                (name.to_owned(), crown, tallest);
            Form::of(&definition)
        };
        let cone = |name: &str| like(name, CrownShape::Cone, 30.0);
        assert_eq!(cone("Norway spruce"), Form::Plant(&SPRUCE));
        assert_eq!(cone("Swiss stone pine"), Form::Plant(&STONE_PINE));
        assert_eq!(cone("Scots pine"), Form::Plant(&PINE));
        assert_eq!(cone("Pinus mugo"), Form::Plant(&DWARF_PINE));
        assert_eq!(cone("Silver fir"), Form::Plant(&FIR));
        assert_eq!(cone("Firs"), Form::Plant(&FIR));
        assert_eq!(cone("European beech"), Form::Plant(&BEECH));
        assert!(matches!(cone("Rock"), Form::Boulder(_)));
        assert_eq!(cone("Wollemia"), Form::Plant(&SPRUCE), "by its crown");
        assert_eq!(like("Firmament", CrownShape::Dome, 30.0), Form::Plant(&BEECH));
        assert_eq!(like("Rockrose", CrownShape::Dome, 2.0), Form::Plant(&SHRUB), "by its height");
    }
}
