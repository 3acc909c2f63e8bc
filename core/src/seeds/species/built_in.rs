//! The built-in species: codes 1 to 12, for ever in this order.
//!
//! Heights, spacing and belts as forestry handbooks of the Alps give them for grown stands, rounded; spruce and
//! beech are set beside the tops counted on LIDAR canopies. The spread from the lowest to the highest tree of a
//! stand is that of its ages. No crown is wider or tree taller than those of spruce and beech, so that a longer
//! table costs no wider search.

use super::{CrownShape, Group, Season, SpeciesDefinition};

struct Row {
    name: &'static str,
    /// Lowest and highest of a stand, tallest of all, metres.
    heights: [f64; 3],
    /// Crown's radius and base, of the height.
    crown: (f64, f64, CrownShape),
    trees_per_km2: f64,
    colour: [u8; 3],
    place: Place,
    season: Season,
}

struct Place {
    group: Group,
    commonness: f64,
    altitude: [f64; 2],
    steepest: f64,
    moisture: f64,
}

const fn place(group: Group, commonness: f64, altitude: [f64; 2], steepest: f64, moisture: f64) -> Place {
    Place { group, commonness, altitude, steepest, moisture }
}

use CrownShape::{Cone, Dome, Paraboloid};
use Group::{Broadleaf, Conifer, Other};

const ROWS: [Row; 12] = [
    Row {
        name: "Norway spruce",
        heights: [18.0, 34.0, 50.0],
        crown: (0.145, 0.18, Cone),
        trees_per_km2: 21_000.0,
        colour: [28, 84, 56],
        place: place(Conifer, 6.0, [300.0, 1750.0], 50.0, 0.55),
        season: Season::Evergreen,
    },
    Row {
        name: "European beech",
        heights: [17.0, 30.0, 45.0],
        crown: (0.2, 0.42, Dome),
        trees_per_km2: 15_000.0,
        colour: [92, 140, 58],
        place: place(Broadleaf, 5.0, [150.0, 1350.0], 45.0, 0.5),
        season: Season::Sheds,
    },
    Row {
        name: "Silver fir",
        heights: [20.0, 37.0, 50.0],
        crown: (0.135, 0.25, Cone),
        trees_per_km2: 18_000.0,
        colour: [22, 70, 60],
        place: place(Conifer, 2.0, [300.0, 1350.0], 45.0, 0.75),
        season: Season::Evergreen,
    },
    Row {
        name: "European larch",
        heights: [15.0, 29.0, 45.0],
        crown: (0.15, 0.3, Paraboloid),
        trees_per_km2: 13_000.0,
        colour: [122, 152, 62],
        place: place(Conifer, 2.0, [900.0, 2200.0], 55.0, 0.35),
        season: Season::Gold,
    },
    Row {
        name: "Scots pine",
        heights: [12.0, 25.0, 40.0],
        crown: (0.16, 0.5, Paraboloid),
        trees_per_km2: 16_000.0,
        colour: [70, 104, 72],
        place: place(Conifer, 1.5, [0.0, 1500.0], 55.0, 0.1),
        season: Season::Evergreen,
    },
    Row {
        name: "Swiss stone pine",
        heights: [9.0, 20.0, 30.0],
        crown: (0.17, 0.15, Paraboloid),
        trees_per_km2: 10_000.0,
        colour: [40, 92, 84],
        place: place(Conifer, 2.5, [1650.0, 2350.0], 50.0, 0.45),
        season: Season::Evergreen,
    },
    Row {
        name: "Sessile oak",
        heights: [14.0, 27.0, 40.0],
        crown: (0.22, 0.35, Dome),
        trees_per_km2: 12_000.0,
        colour: [112, 132, 48],
        place: place(Broadleaf, 2.5, [-100.0, 750.0], 45.0, 0.3),
        season: Season::Sheds,
    },
    Row {
        name: "Silver birch",
        heights: [10.0, 20.0, 30.0],
        crown: (0.16, 0.35, Paraboloid),
        trees_per_km2: 16_000.0,
        colour: [150, 172, 84],
        place: place(Broadleaf, 1.0, [0.0, 1700.0], 50.0, 0.4),
        season: Season::Gold,
    },
    Row {
        name: "White willow",
        heights: [7.0, 16.0, 28.0],
        crown: (0.26, 0.15, Dome),
        trees_per_km2: 13_000.0,
        colour: [158, 178, 120],
        place: place(Broadleaf, 1.0, [-100.0, 1100.0], 12.0, 0.95),
        season: Season::Gold,
    },
    Row {
        name: "Shrub",
        heights: [1.0, 3.0, 6.0],
        crown: (0.5, 0.0, Dome),
        trees_per_km2: 20_000.0,
        colour: [128, 146, 96],
        place: place(Other, 0.0, [-100.0, 2200.0], 60.0, 0.4),
        season: Season::Sheds,
    },
    Row {
        name: "Dwarf mountain pine",
        heights: [1.0, 3.0, 5.0],
        crown: (0.5, 0.0, Dome),
        trees_per_km2: 20_000.0,
        colour: [52, 96, 58],
        place: place(Conifer, 3.0, [2150.0, 2600.0], 60.0, 0.4),
        season: Season::Evergreen,
    },
    Row {
        name: "Rock",
        heights: [0.5, 1.6, 4.0],
        crown: (0.5, 0.0, Dome),
        trees_per_km2: 4_000.0,
        colour: [150, 146, 140],
        place: place(Other, 0.0, [-500.0, 9000.0], 90.0, 0.5),
        season: Season::Still,
    },
];

/// The definitions, by code less one.
pub fn definitions() -> Vec<SpeciesDefinition> {
    ROWS.iter()
        .map(|row| SpeciesDefinition {
            name: row.name.to_owned(),
            lowest_metres: row.heights[0],
            highest_metres: row.heights[1],
            tallest_metres: row.heights[2],
            crown_radius_ratio: row.crown.0,
            crown_base_ratio: row.crown.1,
            crown: row.crown.2,
            trees_per_km2: row.trees_per_km2,
            colour: row.colour,
            group: row.place.group,
            commonness: row.place.commonness,
            altitude_metres: row.place.altitude,
            steepest_degrees: row.place.steepest,
            moisture: row.place.moisture,
            season: row.season,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::land_cover::CodeBits;
    use crate::seeds::Species;
    use crate::seeds::species::{tallest_metres, widest_crown_metres};

    #[test]
    fn codes_are_stable_and_sixteen_bits_hold_them_with_three_to_spare() {
        let words = [
            "spruce", "beech", "fir", "larch", "pine", "stone", "oak", "birch", "willow", "Shrub", "Dwarf",
            "Rock",
        ];
        let table = Species::built_in();
        assert_eq!(table.len(), words.len());
        for (species, (word, code)) in table.iter().zip(words.into_iter().zip(1..)) {
            assert_eq!(species.code, code);
            assert!(species.definition.name.contains(word), "{}", species.definition.name);
        }
        assert!(table.len() + 3 <= usize::from(CodeBits::Sixteen.largest_class()));
    }

    #[test]
    fn no_species_widens_the_search_for_crowns() {
        let table = Species::built_in();
        assert_eq!(tallest_metres(&table), tallest_metres(&table[..2]));
        assert_eq!(widest_crown_metres(&table), widest_crown_metres(&table[..2]));
    }

    #[test]
    fn every_altitude_up_to_the_tree_line_has_a_conifer_and_a_broadleaf() {
        for (group, top) in [(Conifer, 2600.0), (Broadleaf, 1700.0)] {
            let mut altitude = 0.0;
            while altitude <= top {
                let lives = |row: &Row| {
                    row.place.group == group
                        && (row.place.altitude[0]..=row.place.altitude[1]).contains(&altitude)
                };
                assert!(ROWS.iter().any(lives), "{group:?} at {altitude} m");
                altitude += 50.0;
            }
        }
    }
}
