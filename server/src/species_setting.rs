//! Species as `scene.toml` has them: the built-in ones, some of them otherwise, and more.

use crate::scene_file::ClassSetting;
use crate::source::growth::Growths;
use crate::user_error::suggestion;
use serde::{Deserialize, Serialize};
use treeline_core::seeds::species::{Group, Season, built_in};
use treeline_core::seeds::{CrownShape, Species, SpeciesDefinition};

/// Most species that a scene may have: the codes beyond stand for mixtures.
const MOST_SPECIES: usize = 191;
/// Share of a second species where none is given.
const USUAL_SHARE: f64 = 0.3;

/// `[[species]]`: what is left out is as in the built-in species of that name, or as in that of `like`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SpeciesSetting {
    /// Name; that of a built-in species changes it.
    pub name: String,
    /// A species before it in the table, for all that is left out of a new one.
    pub like: Option<String>,
    /// As in [`SpeciesDefinition`].
    pub lowest_metres: Option<f64>,
    /// As in [`SpeciesDefinition`].
    pub highest_metres: Option<f64>,
    /// As in [`SpeciesDefinition`].
    pub tallest_metres: Option<f64>,
    /// As in [`SpeciesDefinition`].
    pub crown_radius_ratio: Option<f64>,
    /// As in [`SpeciesDefinition`].
    pub crown_base_ratio: Option<f64>,
    /// As in [`SpeciesDefinition`].
    pub crown: Option<CrownShape>,
    /// As in [`SpeciesDefinition`].
    pub trees_per_km2: Option<f64>,
    /// As in [`SpeciesDefinition`].
    pub colour: Option<[u8; 3]>,
    /// As in [`SpeciesDefinition`].
    pub group: Option<Group>,
    /// As in [`SpeciesDefinition`].
    pub commonness: Option<f64>,
    /// As in [`SpeciesDefinition`].
    pub altitude_metres: Option<[f64; 2]>,
    /// As in [`SpeciesDefinition`].
    pub steepest_degrees: Option<f64>,
    /// As in [`SpeciesDefinition`].
    pub moisture: Option<f64>,
    /// As in [`SpeciesDefinition`].
    pub season: Option<Season>,
}

impl SpeciesSetting {
    /// The definition over what is left out; none where a key is missing.
    fn over(&self, base: Option<&SpeciesDefinition>) -> Result<SpeciesDefinition, String> {
        let missing = |key: &str| {
            format!(
                "species {:?}: {key} is missing; give it, or like = \"Norway spruce\" for all that is left out",
                self.name
            )
        };
        macro_rules! or_base {
            ($key:ident) => {
                self.$key.or(base.map(|base| base.$key)).ok_or_else(|| missing(stringify!($key)))?
            };
        }
        Ok(SpeciesDefinition {
            name: self.name.clone(),
            lowest_metres: or_base!(lowest_metres),
            highest_metres: or_base!(highest_metres),
            tallest_metres: or_base!(tallest_metres),
            crown_radius_ratio: or_base!(crown_radius_ratio),
            crown_base_ratio: or_base!(crown_base_ratio),
            crown: or_base!(crown),
            trees_per_km2: or_base!(trees_per_km2),
            colour: or_base!(colour),
            group: self.group.or(base.map(|base| base.group)).unwrap_or_default(),
            commonness: self.commonness.or(base.map(|base| base.commonness)).unwrap_or(0.0),
            altitude_metres: self
                .altitude_metres
                .or(base.map(|base| base.altitude_metres))
                .unwrap_or([-500.0, 9000.0]),
            steepest_degrees: self
                .steepest_degrees
                .or(base.map(|base| base.steepest_degrees))
                .unwrap_or(60.0),
            moisture: self.moisture.or(base.map(|base| base.moisture)).unwrap_or(0.5),
            season: self.season.or(base.map(|base| base.season)).unwrap_or_default(),
        })
    }
}

/// The built-in species with the settings over them. The error names the species and its key.
pub fn table(settings: &[SpeciesSetting]) -> Result<Vec<Species>, String> {
    if settings.is_empty() {
        return Ok(Species::built_in());
    }
    let mut definitions = built_in::definitions();
    for setting in settings {
        if setting.name.trim().is_empty() {
            return Err("a species has no name; give it a name = \"…\"".to_owned());
        }
        let found = |name: &str| index_named(&definitions, name);
        let own = found(&setting.name).ok();
        let like = setting
            .like
            .as_ref()
            .map(|like| found(like).map_err(|error| format!("species {:?}: like {error}", setting.name)));
        let base = like.transpose()?.or(own).map(|index| &definitions[index]);
        let mut definition = setting.over(base)?;
        match own {
            Some(index) => {
                definition.name.clone_from(&definitions[index].name);
                definitions[index] = definition;
            }
            None => definitions.push(definition),
        }
    }
    if definitions.len() > MOST_SPECIES {
        return Err(format!(
            "there are {} species with the built-in ones; a scene holds {MOST_SPECIES}",
            definitions.len()
        ));
    }
    definitions.into_iter().zip(1..).map(|(definition, code)| Species::new(code, definition)).collect()
}

/// The growth that a class names; 0 where it names none.
///
/// # Errors
/// A key of the class and what is wrong with it.
pub fn growth_of(growths: &mut Growths, species: &[Species], class: &ClassSetting) -> Result<u8, String> {
    let Some(name) = &class.species else { return Ok(0) };
    let rules = growths.rules();
    let group = [("conifer", rules.conifer), ("broadleaf", rules.broadleaf), ("mixed", rules.mixed)]
        .into_iter()
        .find(|(group, _)| group.eq_ignore_ascii_case(name));
    let Some(secondary) = &class.secondary else {
        return match group {
            Some((_, growth)) => Ok(growth),
            None => species_named(species, name).map(|species| species.code),
        };
    };
    if let Some((group, _)) = group {
        return Err(format!(
            "secondary is given, but species is the group \"{group}\"; name the species that prevails"
        ));
    }
    let primary = species_named(species, name)?.code;
    let secondary =
        species_named(species, secondary).map_err(|error| error.replacen("species", "secondary", 1))?.code;
    growths.mixture(primary, secondary, class.secondary_share.unwrap_or(USUAL_SHARE))
}

/// Finds the species that a class names, by its whole name, one word of it ("spruce" for "Norway spruce") or some
/// ("stone pine"). The error names the near ones.
fn species_named<'a>(table: &'a [Species], wanted: &str) -> Result<&'a Species, String> {
    let definitions: Vec<SpeciesDefinition> =
        table.iter().map(|species| species.definition.clone()).collect();
    index_named(&definitions, wanted).map(|index| &table[index]).map_err(|error| format!("species {error}"))
}

fn index_named(definitions: &[SpeciesDefinition], wanted: &str) -> Result<usize, String> {
    let named = |definition: &SpeciesDefinition| definition.name.eq_ignore_ascii_case(wanted);
    let has_word = |definition: &SpeciesDefinition| {
        definition.name.split_whitespace().any(|word| word.eq_ignore_ascii_case(wanted))
    };
    let lower = wanted.to_lowercase();
    let has_words = |definition: &SpeciesDefinition| {
        lower.contains(' ') && definition.name.to_lowercase().contains(&lower)
    };
    let found = definitions
        .iter()
        .position(named)
        .or_else(|| definitions.iter().position(has_word))
        .or_else(|| definitions.iter().position(has_words));
    found.ok_or_else(|| {
        let names: Vec<&str> = definitions.iter().map(|definition| definition.name.as_str()).collect();
        format!(
            "is \"{wanted}\"{}; there are {}",
            suggestion(wanted, names.iter().copied()),
            names.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(text: &str) -> Result<Vec<Species>, String> {
        #[derive(Deserialize)]
        struct File {
            species: Vec<SpeciesSetting>,
        }
        table(&toml::from_str::<File>(text).map_err(|error| error.to_string())?.species)
    }

    #[test]
    fn a_built_in_species_is_changed_and_keeps_its_code() {
        let table = settings("[[species]]\nname = 'larch'\nhighest_metres = 40").unwrap();
        assert_eq!(table.len(), 12);
        assert_eq!((table[3].code, table[3].definition.highest_metres), (4, 40.0));
        assert_eq!(table[3].definition.name, "European larch");
        assert_eq!(table[3].definition.lowest_metres, Species::built_in()[3].definition.lowest_metres);
    }

    #[test]
    fn a_new_species_has_the_next_code() {
        let table = settings(
            "[[species]]\nname = 'Douglas fir'\nlike = 'Silver fir'\ntallest_metres = 60\nhighest_metres = 50",
        )
        .unwrap();
        assert_eq!((table.len(), table[12].code), (13, 13));
        assert_eq!(table[12].definition.group, Group::Conifer);
    }

    #[test]
    fn mistakes_are_named() {
        for (text, named) in [
            ("[[species]]\nname = 'Ginkgo'", "lowest_metres is missing"),
            ("[[species]]\nname = 'Ginkgo'\nlike = 'spruse'", "like is \"spruse\""),
            ("[[species]]\nname = 'beech'\ncrown_radius_ratio = 3", "crown_radius_ratio is 3"),
            ("[[species]]\nname = 'beech'\naltitude_metres = [900, 100]", "altitude_metres is 900"),
            ("[[species]]\nlike = 'beech'", "no name"),
            ("[[species]]\nname = 'beech'\nseason = 'spring'", "spring"),
        ] {
            let error = settings(text).unwrap_err();
            assert!(error.contains(named), "{text}: {error}");
        }
    }

    #[test]
    fn classes_name_species_groups_and_mixtures() {
        let species = Species::built_in();
        let mut growths = Growths::new(&species);
        let mut of = |text: &str| growth_of(&mut growths, &species, &toml::from_str(text).unwrap());
        assert_eq!(of("").unwrap(), 0);
        assert_eq!(of("species = 'larch'").unwrap(), 4);
        let rules = (of("species = 'conifer'").unwrap(), of("species = 'Broadleaf'").unwrap());
        assert_eq!(rules, (13, 14));
        let mixture = of("species = 'larch'\nsecondary = 'spruce'").unwrap();
        assert_eq!(mixture, 16);
        assert_eq!(of("species = 'larch'\nsecondary = 'spruce'\nsecondary_share = 0.3").unwrap(), mixture);
        assert!(
            of("species = 'larch'\nsecondary = 'sprucce'")
                .unwrap_err()
                .starts_with("secondary is \"sprucce\"")
        );
        assert!(
            of("species = 'mixed'\nsecondary = 'spruce'")
                .unwrap_err()
                .contains("name the species that prevails")
        );
    }
}
