use super::*;
use crate::seeds::Species;
use crate::sun::unix_seconds_from_rfc3339;
use proptest::prelude::*;

fn at(date: &str, latitude: f64) -> Option<YearDay> {
    YearDay::at(unix_seconds_from_rfc3339(&format!("{date}T12:00:00Z")).unwrap(), latitude)
}

fn year_of(name: &str) -> SpeciesSeason {
    let table = Species::built_in();
    let species = table.iter().find(|species| species.definition.name.contains(name)).unwrap();
    SpeciesSeason::of(&species.definition)
}

#[test]
fn the_alps_through_the_year() {
    let on = |date: &str| at(date, 46.5).unwrap();
    let larch = year_of("larch");
    let golden = larch.foliage(&on("2026-10-18"), 1_700.0);
    assert!(golden.turned > 0.9 && golden.leaves > 0.85, "{golden:?}");
    assert!(larch.foliage(&on("2026-09-20"), 1_700.0).turned < 0.1);
    for name in ["larch", "beech", "oak", "birch", "willow", "Shrub"] {
        let year = year_of(name);
        assert!(year.foliage(&on("2026-12-20"), 900.0).leaves < 0.02, "{name}");
        assert!(year.foliage(&on("2026-02-20"), 900.0).leaves < 0.02, "{name}");
        let young = year.foliage(&on("2026-06-05"), 900.0);
        assert!(young.leaves > 0.95 && young.turned == 0.0, "{name} {young:?}");
    }
    for name in ["spruce", "fir", "stone pine", "Rock"] {
        assert_eq!(year_of(name).foliage(&on("2026-01-10"), 1_500.0), Foliage::GROWN, "{name}");
    }
    // Higher is later in spring, earlier in autumn.
    let beech = year_of("beech");
    let leaves = |date: &str, height| beech.foliage(&on(date), height).leaves;
    assert!(leaves("2026-05-08", 500.0) > leaves("2026-05-08", 1_300.0) + 0.2);
    assert!(leaves("2026-11-05", 500.0) > leaves("2026-11-05", 1_300.0) + 0.2);
}

#[test]
fn snow_follows_day_and_latitude() {
    let line = |date: &str, latitude| at(date, latitude).map_or(f32::MAX, |day| day.snow_line);
    let (winter, spring, autumn) =
        (line("2026-01-25", 47.0), line("2026-05-10", 47.0), line("2026-10-15", 47.0));
    assert!((300.0..900.0).contains(&winter), "{winter}");
    assert!((1_500.0..2_200.0).contains(&spring), "{spring}");
    assert!((2_200.0..3_000.0).contains(&autumn), "{autumn}");
    assert!(line("2026-01-25", 60.0) < 0.0 && line("2026-01-25", 22.3) > 3_500.0);
    let day = at("2026-01-25", 47.0).unwrap();
    assert_eq!((day.snow(0.0), day.snow(2_000.0)), (0.0, 1.0));
    // In the south it is the other half of the year.
    assert!(line("2026-07-25", -47.0) < 900.0);
    assert_eq!(at("2026-01-25", -44.0), None);
}

#[test]
fn summer_and_the_tropics_are_as_without_seasons() {
    for date in ["2026-07-08", "2026-07-15", "2026-08-30"] {
        assert_eq!(at(date, 46.5), None, "{date}");
    }
    assert!(at("2026-10-18", 46.5).is_some());
    assert_eq!(at("2026-01-15", 5.0), None);
}

#[test]
fn a_named_season_is_near_and_at_the_same_time_of_day() {
    let now = unix_seconds_from_rfc3339("2026-07-15T13:30:00Z").unwrap();
    for (name, season, middle) in NamedSeason::ALL {
        assert_eq!(NamedSeason::from_name(name), Some(season));
        for latitude in [46.5, -46.5] {
            let then = season.near(now, latitude);
            assert_eq!((then - now) % 86_400.0, 0.0);
            assert!((then - now).abs() < 184.0 * 86_400.0);
            let off = (northern_day(then, latitude) - middle).abs();
            assert!(!(2.0..=363.0).contains(&off), "{name} at {latitude}: {off}");
        }
    }
    let summer = NamedSeason::Summer.near(now, 46.5);
    assert!((summer - now).abs() < 1.5 * 86_400.0);
    assert_eq!(NamedSeason::from_name("noon"), None);
}

#[test]
fn codes_beyond_the_table_are_evergreens() {
    let built_in = Species::built_in();
    let species = built_in.iter().map(|species| (species.code + 40, &species.definition));
    assert!(table(species)[..GROUND].iter().all(|row| row.fall.is_none()));
    assert!(table([]).last().is_some_and(|herbs| herbs.fall.is_some()));
}

proptest! {
    /// No day, place or height shows a summer that is not whole, or anything that jumps.
    #[test]
    fn the_year_has_no_seam(latitude in -85.0..85.0_f64, height in -100.0..4_500.0_f32, hour in 0.0..8_766.0_f64, row in 0_usize..6) {
        let year = KNOWN[row].1;
        let seconds = |hour: f64| 1.7e9 + 3_600.0 * hour;
        let foliage = |hour: f64| {
            YearDay::at(seconds(hour), latitude).map_or(Foliage::GROWN, |day| year.foliage(&day, height))
        };
        let (now, then) = (foliage(hour), foliage(hour + 1.0));
        for share in [now.leaves, now.turned, now.fresh] {
            prop_assert!((0.0..=1.0).contains(&share));
        }
        prop_assert!((now.leaves - then.leaves).abs() < 0.01, "{now:?} {then:?}");
        // Leaves that turn or are young while there are none may change at once.
        prop_assert!((now.leaves * now.turned - then.leaves * then.turned).abs() < 0.01, "{now:?} {then:?}");
        prop_assert!((now.leaves * now.fresh - then.leaves * then.fresh).abs() < 0.01, "{now:?} {then:?}");
    }
}
