//! What the year does to trees, herbs and snow, by the day, the latitude and the height above the sea.
//!
//! One truth for the trees near by and the canopy far away: a table of a few days and colours a species, which the
//! shaders read (`season.wgsl`) and [`SpeciesSeason::foliage`] states. Days are counted in the northern half's
//! year, at 47° and 600 m. Spring comes 3 days later for each degree toward the pole and for each 100 m of height,
//! autumn 2 days and 1.5 days earlier (the laws of A. D. Hopkins, *Bioclimatics*, 1938, with the slower autumn that
//! Alpine records have). In high summer nothing differs from a picture without seasons.

use super::species::{Season, SpeciesDefinition};

/// Codes that have a row of their own; a species beyond them is taken for an evergreen.
pub const MOST_SPECIES: usize = 30;
/// Row of the herbs of the ground.
pub const GROUND: usize = MOST_SPECIES + 1;
/// Rows of a table.
pub const ROWS: usize = MOST_SPECIES + 2;

/// Seconds of a mean year of the calendar, and days.
const YEAR_DAYS: f64 = 365.2425;
const DAY_SECONDS: f64 = 86_400.0;
/// Where the days of the table hold: latitude, degrees, and height, metres.
const LATITUDE: f64 = 47.0;
const HEIGHT: f32 = 600.0;
/// Days by which spring is later and autumn earlier, per degree of latitude and per metre of height.
const LATER_SPRING: [f32; 2] = [3.0, 0.03];
const EARLIER_AUTUMN: [f32; 2] = [2.0, 0.015];
/// However high: leaves are out on the one day, and none turns before the other.
const LEAVES_OUT: f32 = 160.0;
const FIRST_TURN: f32 = 245.0;
/// Young leaves stay light for so many days.
const FRESH_DAYS: f32 = 25.0;
/// Between these days nothing differs from a picture without seasons.
const HIGH_SUMMER: std::ops::RangeInclusive<f64> = 185.0..=245.0;
/// Latitudes between which a year begins to have seasons.
const SEASONS_BEGIN: [f64; 2] = [15.0, 30.0];
/// Lower ends of the snow in high winter, every ten degrees of latitude, metres; and what is added in summer.
const WINTER_SNOW: [f64; 10] =
    [4_900.0, 4_900.0, 4_700.0, 3_300.0, 1_600.0, 250.0, -300.0, -400.0, -500.0, -500.0];
const SUMMER_RISE: f64 = 2_400.0;
/// A height that no snow reaches, metres.
const NO_SNOW: f32 = 1.0e6;
/// From the first patches of snow to a whole cover, metres below and above the line.
const SNOW_EDGE: [f32; 2] = [-120.0, 260.0];

/// A species' year.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeciesSeason {
    /// First and last day of leaf-out.
    pub leaf_out: [f32; 2],
    /// Days between which the leaves turn.
    pub turn: [f32; 2],
    /// Days between which they fall; an evergreen's never do.
    pub fall: Option<[f32; 2]>,
    /// Reflectance (linear) of turned leaves, and of what is left without any.
    pub colours: [[f32; 3]; 2],
}

/// Leaves of a species on a day.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foliage {
    /// Share of the leaves that are there.
    pub leaves: f32,
    /// Share of them that have turned.
    pub turned: f32,
    /// How young they are: 1 light, 0 grown.
    pub fresh: f32,
}

impl Foliage {
    /// As in high summer.
    pub const GROWN: Self = Self { leaves: 1.0, turned: 0.0, fresh: 0.0 };
}

const EVERGREEN: SpeciesSeason = SpeciesSeason {
    leaf_out: [0.0, 1.0],
    turn: [400.0, 401.0],
    fall: None,
    colours: [[0.05, 0.06, 0.025], [0.1, 0.085, 0.075]],
};

/// Words of names, and the years of their species.
const KNOWN: [(&str, SpeciesSeason); 6] = [
    (
        "larch",
        year([105.0, 130.0], [284.0, 304.0], [312.0, 332.0], [0.36, 0.205, 0.03], [0.115, 0.088, 0.062]),
    ),
    (
        "birch",
        year([98.0, 118.0], [266.0, 292.0], [292.0, 315.0], [0.37, 0.265, 0.035], [0.115, 0.092, 0.088]),
    ),
    (
        "beech",
        year([112.0, 130.0], [274.0, 300.0], [300.0, 324.0], [0.20, 0.112, 0.036], [0.105, 0.092, 0.084]),
    ),
    ("oak", year([118.0, 138.0], [282.0, 308.0], [312.0, 342.0], [0.19, 0.115, 0.035], [0.1, 0.086, 0.072])),
    (
        "willow",
        year([90.0, 110.0], [270.0, 298.0], [302.0, 325.0], [0.22, 0.195, 0.045], [0.135, 0.11, 0.06]),
    ),
    (
        "shrub",
        year([100.0, 125.0], [258.0, 282.0], [288.0, 312.0], [0.22, 0.085, 0.035], [0.1, 0.082, 0.066]),
    ),
];

/// Herbs: they dry to straw, and are flat in winter.
const HERBS: SpeciesSeason =
    year([85.0, 132.0], [252.0, 305.0], [290.0, 335.0], [0.215, 0.175, 0.08], [0.175, 0.148, 0.092]);

const fn year(
    leaf_out: [f32; 2],
    turn: [f32; 2],
    fall: [f32; 2],
    turned: [f32; 3],
    bare: [f32; 3],
) -> SpeciesSeason {
    SpeciesSeason { leaf_out, turn, fall: Some(fall), colours: [turned, bare] }
}

/// The years of a scene's species by code, and of the herbs; [`ROWS`] of them.
pub fn table<'a>(species: impl IntoIterator<Item = (u8, &'a SpeciesDefinition)>) -> [SpeciesSeason; ROWS] {
    let mut rows = [EVERGREEN; ROWS];
    rows[GROUND] = HERBS;
    for (code, definition) in species {
        if let Some(row) = rows[..=MOST_SPECIES].get_mut(usize::from(code)) {
            *row = SpeciesSeason::of(definition);
        }
    }
    rows
}

impl SpeciesSeason {
    /// By the species' name where it is a known one, else by what its definition says of the year.
    pub fn of(definition: &SpeciesDefinition) -> Self {
        let kind = match definition.season {
            Season::Evergreen | Season::Still => return EVERGREEN,
            Season::Gold => "larch",
            Season::Sheds => "beech",
        };
        let name = definition.name.to_lowercase();
        let row = |word: &str| KNOWN.iter().find(|(known, _)| *known == word).map(|(_, year)| *year);
        let known = KNOWN.iter().find(|(word, _)| name.contains(word)).map(|(_, year)| *year);
        known.or_else(|| row(kind)).unwrap_or(EVERGREEN)
    }

    /// The leaves at a height (metres) on a day of a year.
    pub fn foliage(&self, day: &YearDay, height: f32) -> Foliage {
        let Some(fall) = self.fall else { return Foliage::GROWN };
        let rise = height - HEIGHT;
        let spring = LATER_SPRING[0] * day.north + LATER_SPRING[1] * rise;
        let spring = spring.min(LEAVES_OUT - self.leaf_out[1]);
        let autumn = EARLIER_AUTUMN[0] * day.north + EARLIER_AUTUMN[1] * rise;
        let autumn = autumn.min(self.turn[0] - FIRST_TURN);
        let out = smoothstep(self.leaf_out[0] + spring, self.leaf_out[1] + spring, day.day);
        let kept = 1.0 - smoothstep(fall[0] - autumn, fall[1] - autumn, day.day);
        let grown = self.leaf_out[1] + spring;
        Foliage {
            leaves: 1.0 - day.strength * (1.0 - out * kept),
            turned: day.strength * smoothstep(self.turn[0] - autumn, self.turn[1] - autumn, day.day),
            fresh: day.strength * (1.0 - smoothstep(grown, grown + FRESH_DAYS, day.day)),
        }
    }
}

fn smoothstep(low: f32, high: f32, value: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A day of the year somewhere, as pictures need it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YearDay {
    /// Days since the year began, of the northern half's year wherever it is.
    pub day: f32,
    /// Degrees of latitude beyond 47, either way from the equator.
    pub north: f32,
    /// How much of a year there is: 0 in the tropics, 1 from 30° on.
    pub strength: f32,
    /// Where the snow of the season begins, metres above the sea; what lies all the year the photo shows.
    pub snow_line: f32,
}

impl YearDay {
    /// At a time (seconds since 1970-01-01T00:00Z) at a latitude (degrees). `None` where nothing differs from a
    /// picture without seasons: in high summer and in the tropics.
    pub fn at(unix_seconds: f64, latitude: f64) -> Option<Self> {
        let day = northern_day(unix_seconds, latitude);
        let strength = smoothstep(SEASONS_BEGIN[0] as f32, SEASONS_BEGIN[1] as f32, latitude.abs() as f32);
        if HIGH_SUMMER.contains(&day) || strength <= 0.0 {
            return None;
        }
        let north = (latitude.abs() - LATITUDE).clamp(-25.0, 20.0) as f32;
        Some(Self { day: day as f32, north, strength, snow_line: snow_line(day, latitude.abs()) })
    }

    /// Share of the ground that snow covers at a height, metres.
    pub fn snow(&self, height: f32) -> f32 {
        smoothstep(self.snow_line + SNOW_EDGE[0], self.snow_line + SNOW_EDGE[1], height)
    }
}

/// Days since the year began, in the south half a year on.
fn northern_day(unix_seconds: f64, latitude: f64) -> f64 {
    let days = unix_seconds / DAY_SECONDS + if latitude < 0.0 { 0.5 * YEAR_DAYS } else { 0.0 };
    days.rem_euclid(YEAR_DAYS)
}

/// Where snow begins: lowest in early February, highest in August.
fn snow_line(day: f64, latitude: f64) -> f32 {
    let turn = std::f64::consts::TAU * (day - 38.0) / YEAR_DAYS;
    let winter = f64::from(smoothstep(-0.8, 0.75, turn.cos() as f32));
    if winter <= 0.0 {
        return NO_SNOW;
    }
    let place = (latitude / 10.0).clamp(0.0, 8.999);
    let row = place as usize;
    let lowest = WINTER_SNOW[row] + place.fract() * (WINTER_SNOW[row + 1] - WINTER_SNOW[row]);
    (lowest + (1.0 - winter) * SUMMER_RISE) as f32
}

/// A season by name, for who does not think in dates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NamedSeason {
    /// Young leaves, snow on the heights.
    Spring,
    /// As photos mostly are.
    Summer,
    /// Turned leaves.
    Autumn,
    /// Bare, and snow.
    Winter,
}

impl NamedSeason {
    /// All, by name, with their middle days.
    pub const ALL: [(&'static str, Self, f64); 4] = [
        ("spring", Self::Spring, 136.0),
        ("summer", Self::Summer, 196.0),
        ("autumn", Self::Autumn, 288.0),
        ("winter", Self::Winter, 20.0),
    ];

    /// The season of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(known, ..)| *known == name).map(|(_, season, _)| *season)
    }

    /// The time nearest to another (seconds since 1970-01-01T00:00Z), at the same time of day, at which it is this season at a
    /// latitude (degrees).
    pub fn near(self, unix_seconds: f64, latitude: f64) -> f64 {
        let middle = Self::ALL.iter().find(|(_, season, _)| *season == self).map_or(196.0, |(.., day)| *day);
        let apart = (middle - northern_day(unix_seconds, latitude)).round();
        let apart = (apart + 0.5 * YEAR_DAYS).rem_euclid(YEAR_DAYS) - 0.5 * YEAR_DAYS;
        unix_seconds + DAY_SECONDS * apart.round()
    }
}

#[cfg(test)]
#[path = "season_tests.rs"]
mod tests;
