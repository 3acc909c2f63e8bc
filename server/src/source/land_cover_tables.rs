//! What the values of well-known land-cover rasters mean, and how to tell which one a raster is.

use super::Cover;
use super::growth::Growth;
use std::collections::BTreeMap;
use treeline_core::layer::SurfaceType;

/// A table that a raster may follow.
pub struct KnownTable {
    /// Name for people.
    pub name: &'static str,
    /// Its rows.
    rows: &'static [Row],
    /// Values that no other of the tables has, one of which a raster must hold to be recognised.
    telling: fn(i64) -> bool,
}

/// What grows where a class does.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stand {
    None,
    Conifer,
    Broadleaf,
    Mixed,
}

struct Row {
    first: i64,
    last: i64,
    stand: Stand,
    /// Per cent of the ground under crowns.
    closure: u8,
    surface: SurfaceType,
}

const fn row(first: i64, last: i64, stand: Stand, closure: u8, surface: SurfaceType) -> Row {
    Row { first, last, stand, closure, surface }
}

use Stand::{Broadleaf, Conifer, Mixed, None as Bare};
use SurfaceType::{Grass, Plain, Rock, Snow, Water};

/// The tables, the most telling first.
pub const KNOWN_TABLES: [KnownTable; 4] = [
    KnownTable {
        name: "LANDFIRE FBFM40",
        rows: &[
            row(91, 91, Bare, 0, Plain),
            row(92, 92, Bare, 0, Snow),
            row(93, 93, Bare, 0, Plain),
            row(98, 98, Bare, 0, Water),
            row(99, 99, Bare, 0, Rock),
            row(101, 109, Bare, 0, Grass),
            row(121, 124, Bare, 0, Grass),
            row(141, 149, Bare, 0, Plain),
            row(161, 165, Conifer, 55, Plain),
            row(181, 189, Conifer, 70, Plain),
            row(201, 204, Bare, 0, Plain),
        ],
        telling: |value| (101..=204).contains(&value),
    },
    KnownTable {
        name: "CORINE (three-digit codes)",
        rows: &[
            row(111, 142, Bare, 0, Plain),
            row(211, 223, Bare, 0, Plain),
            row(231, 231, Bare, 0, Grass),
            row(241, 243, Bare, 0, Plain),
            row(244, 244, Broadleaf, 30, Grass),
            row(311, 311, Broadleaf, 80, Plain),
            row(312, 312, Conifer, 75, Plain),
            row(313, 313, Mixed, 75, Plain),
            row(321, 321, Bare, 0, Grass),
            row(322, 323, Bare, 0, Plain),
            row(324, 324, Mixed, 35, Plain),
            row(331, 332, Bare, 0, Rock),
            row(333, 334, Bare, 0, Plain),
            row(335, 335, Bare, 0, Snow),
            row(411, 423, Bare, 0, Grass),
            row(511, 523, Bare, 0, Water),
            row(999, 999, Bare, 0, Plain),
        ],
        telling: |value| (205..=999).contains(&value),
    },
    KnownTable {
        name: "ESA WorldCover",
        rows: &[
            row(10, 10, Mixed, 75, Plain),
            row(20, 20, Bare, 0, Plain),
            row(30, 30, Bare, 0, Grass),
            row(40, 40, Bare, 0, Plain),
            row(50, 50, Bare, 0, Plain),
            row(60, 60, Bare, 0, Rock),
            row(70, 70, Bare, 0, Snow),
            row(80, 80, Bare, 0, Water),
            row(90, 90, Bare, 0, Grass),
            row(95, 95, Broadleaf, 70, Water),
            row(100, 100, Bare, 0, Grass),
        ],
        telling: |value| matches!(value, 10 | 30 | 50 | 60 | 70 | 80 | 100),
    },
    KnownTable {
        name: "NLCD",
        rows: &[
            row(11, 11, Bare, 0, Water),
            row(12, 12, Bare, 0, Snow),
            row(21, 24, Bare, 0, Plain),
            row(31, 31, Bare, 0, Rock),
            row(41, 41, Broadleaf, 75, Plain),
            row(42, 42, Conifer, 75, Plain),
            row(43, 43, Mixed, 75, Plain),
            row(51, 52, Bare, 0, Plain),
            row(71, 74, Bare, 0, Grass),
            row(81, 82, Bare, 0, Grass),
            row(90, 90, Broadleaf, 60, Plain),
            row(95, 95, Bare, 0, Grass),
        ],
        telling: |value| matches!(value, 11 | 12 | 21..=24 | 31 | 41..=43 | 52 | 71..=74 | 81 | 82),
    },
];

impl KnownTable {
    fn holds(&self, value: i64) -> bool {
        self.rows.iter().any(|row| (row.first..=row.last).contains(&value))
    }

    /// Cover by value, with a scene's growths.
    pub fn covers(&self, growth: &Growth) -> BTreeMap<i64, Cover> {
        let cover = |row: &Row| {
            let code = match row.stand {
                Bare => 0,
                Conifer => growth.conifer,
                Broadleaf => growth.broadleaf,
                Mixed => growth.mixed,
            };
            let closure = if code == 0 { 0 } else { (u32::from(row.closure) * 255 / 100) as u8 };
            Cover { species: code, closure, height: 0, surface: row.surface as u8 }
        };
        self.rows
            .iter()
            .flat_map(|row| (row.first..=row.last).map(move |value| (value, cover(row))))
            .collect()
    }
}

/// The table that a raster with these values follows: one that explains all of them (0 and values
/// that are rare being nobody's), and has values that tell it from the others.
pub fn recognise(values: &BTreeMap<i64, usize>) -> Option<&'static KnownTable> {
    let total: usize = values.iter().filter(|(value, _)| **value != 0).map(|(_, count)| count).sum();
    KNOWN_TABLES.iter().find(|table| {
        let explained: usize =
            values.iter().filter(|(value, _)| table.holds(**value)).map(|(_, count)| count).sum();
        let told = values.keys().any(|&value| (table.telling)(value) && table.holds(value));
        told && total > 0 && explained as f64 >= 0.99 * total as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recognised(values: &[i64]) -> Option<&'static str> {
        recognise(&values.iter().map(|&value| (value, 100)).collect()).map(|table| table.name)
    }

    #[test]
    fn by_their_values() {
        assert_eq!(recognised(&[10, 20, 30, 40, 50, 60, 80, 90]), Some("ESA WorldCover"));
        assert_eq!(recognised(&[11, 21, 31, 41, 42, 52, 71, 82, 90, 95]), Some("NLCD"));
        assert_eq!(recognised(&[91, 98, 99, 101, 122, 145, 165, 183]), Some("LANDFIRE FBFM40"));
        assert_eq!(recognised(&[111, 211, 243, 311, 312, 324, 512]), Some("CORINE (three-digit codes)"));
        assert_eq!(recognised(&[0, 1, 2, 3]), None);
        assert_eq!(recognised(&[0]), None);
    }

    #[test]
    fn growths_of_the_scene() {
        let growth = Growth { conifer: 13, broadleaf: 14, mixed: 15 };
        let covers = KNOWN_TABLES[2].covers(&growth);
        assert_eq!(covers[&10].species, 15);
        assert!(covers[&10].closure > 150);
        assert_eq!(covers[&80].surface(), Water);
        let nothing = Growth { conifer: 0, broadleaf: 0, mixed: 0 };
        assert_eq!(KNOWN_TABLES[2].covers(&nothing)[&10].closure, 0);
    }
}
