//! Density, spacing and likeness of metaseeds and their clusters, and values to check other implementations by.

use super::*;
use crate::seeds::pattern::LEVEL;
use crate::seeds::place::{x_from_longitude, y_from_latitude};
use proptest::prelude::*;

/// The cell at a place, degrees.
fn cell_at(longitude: f64, latitude: f64) -> [u32; 2] {
    [x_from_longitude(longitude), y_from_latitude(latitude)].map(|units| units as u32 / CELL_UNITS)
}

/// Every metaseed of a square of cells: place in metres from its north-west corner, and the seed.
fn metaseeds(cell: [u32; 2], side: u32) -> Vec<([f64; 2], Metaseed)> {
    let latitude = 90.0 - 180.0 * (f64::from(cell[1]) + 0.5) / f64::from(1_u32 << LEVEL);
    let across = UNIT_METRES * latitude.to_radians().cos();
    let mut found = Vec::new();
    for (south, east) in (0..side).flat_map(|south| (0..side).map(move |east| (south, east))) {
        let address = [cell[0] + east, cell[1] + south];
        for i in 0..columns(&CellRow::new(address[1])) {
            for j in 0..ROWS {
                let seed = metaseed(address, [i, j], 1);
                let x = f64::from(east * CELL_UNITS + seed.x) * across;
                let y = f64::from(south * CELL_UNITS + seed.y) * UNIT_METRES;
                found.push(([x, y], seed));
            }
        }
    }
    found
}

#[test]
fn density_and_spacing_hold_at_every_latitude() {
    for latitude in [0.0_f64, 23.0, -46.9, 61.0, 75.0, -82.0] {
        let seeds = metaseeds(cell_at(10.9, latitude), 2);
        let cell = f64::from(CELL_UNITS) * UNIT_METRES;
        let area = 4.0 * cell * cell * latitude.to_radians().cos();
        let density = seeds.len() as f64 / area;
        let expected = 1.0 / (SPACING_METRES * SPACING_METRES);
        // Whole columns: within half a column of what the cosine says.
        let off = 0.02 + 0.55 / (24.0 * latitude.to_radians().cos());
        assert!((density / expected - 1.0).abs() < off, "{latitude}: {density} {expected}");
        let nearest = |place: &[f64; 2]| {
            let distance = |other: &[f64; 2]| (other[0] - place[0]).hypot(other[1] - place[1]);
            let others = seeds.iter().map(|(other, _)| distance(other)).filter(|&away| away > 0.0);
            others.fold(f64::INFINITY, f64::min)
        };
        // A sample of those that lie well inside.
        let inner = |place: &[f64; 2]| place[1] > 20.0 && place[1] < 2.0 * cell - 20.0;
        let asked: Vec<f64> = seeds
            .iter()
            .step_by(53)
            .filter(|(place, _)| inner(place))
            .map(|(place, _)| nearest(place))
            .collect();
        let mean = asked.iter().sum::<f64>() / asked.len() as f64;
        let least = asked.iter().copied().fold(f64::INFINITY, f64::min);
        // Of the same number at random the mean would be half of 1/√density, without any bound below.
        let random = 0.5 / density.sqrt();
        println!("{latitude}: {:.2} m apart, least {least:.2}, index {:.2}", mean, mean / random);
        assert!(mean / random > 1.3, "{latitude}: {mean} {random}");
        assert!(least > 0.2 * SPACING_METRES, "{latitude}: {least}");
    }
}

#[test]
fn clusters_are_as_wide_in_metres_at_every_latitude() {
    for latitude in [0.0_f64, 46.9, 70.0, -82.0] {
        let cell = cell_at(-71.0, latitude);
        let across = latitude.to_radians().cos();
        let mut farthest = [0.0_f64; 2];
        for i in 0..columns(&CellRow::new(cell[1])) {
            let seed = metaseed(cell, [i, 7], 1);
            let Some(cluster) = cluster(&seed, Community::Meadow) else { panic!("a meadow is closed") };
            assert!((8..=MOST_MEMBERS).contains(&cluster.members));
            for number in 0..cluster.members {
                let member = member(&seed, &cluster, number);
                let apart =
                    [f64::from(member.x - seed.x as i32) * across, f64::from(member.y - seed.y as i32)];
                farthest = [0, 1].map(|axis| farthest[axis].max(apart[axis].abs()));
            }
        }
        for reach in farthest {
            let reach = reach / f64::from(REACH_UNITS);
            assert!((0.93..1.02).contains(&reach), "{latitude}: {reach}");
        }
    }
}

#[test]
fn neighbours_differ_and_another_seed_grows_others() {
    let cell = cell_at(10.9, 46.9);
    let (mut equal, mut all, mut kept) = (0, 0, 0);
    for i in 0..40 {
        for j in 0..ROWS - 1 {
            let [one, south] = [[i, j], [i, j + 1]].map(|place| metaseed(cell, place, 1));
            let other = metaseed(cell, [i, j], 2);
            kept += u32::from((other.x, other.y) == (one.x, one.y));
            let grow = |seed: &Metaseed| {
                let cluster = cluster(seed, Community::Meadow).unwrap();
                let member = member(seed, &cluster, 0);
                (cluster.members, member.kind, member.size, member.rotation, member.x - seed.x as i32)
            };
            equal += u32::from(grow(&one) == grow(&south)) + u32::from(grow(&one) == grow(&other));
            all += 1;
        }
    }
    assert!(equal * 1_000 < all && kept * 100 < all, "{equal} {kept} of {all}");
}

#[test]
fn the_ground_says_what_grows() {
    let of = |surface: SurfaceType, crowns, bits| Community::of(surface as u32, crowns, bits);
    assert_eq!(of(SurfaceType::Water, 9, 0), Community::Nothing);
    assert_eq!(of(SurfaceType::Snow, 0, 0), Community::Nothing);
    assert_eq!(of(SurfaceType::Rock, 0, 0), Community::Rock);
    assert_eq!(of(SurfaceType::Grass, 0, 0), Community::Meadow);
    assert_eq!(of(SurfaceType::Plain, 0, 0), Community::Open);
    // Under a crown, and everywhere in a closed wood; at its edge here and there.
    assert_eq!(of(SurfaceType::Canopy, 0, u32::MAX), Community::Wood);
    assert_eq!(of(SurfaceType::Plain, CLOSED, u32::MAX), Community::Wood);
    assert_eq!(of(SurfaceType::Grass, 1, u32::MAX), Community::Meadow);
    assert_eq!(of(SurfaceType::Grass, 1, 0), Community::Wood);
    let seed = metaseed(cell_at(10.9, 46.9), [3, 4], 1);
    assert_eq!(cluster(&seed, Community::Nothing), None);
}

/// Every kind has its place, and nothing but stones and grass and low herbs grows on rock.
#[test]
fn communities_have_their_kinds() {
    let cell = cell_at(10.9, 46.9);
    let counted = |community| {
        let mut counts = [0_u32; KINDS];
        for (i, j) in (0..48).flat_map(|i| (0..ROWS).map(move |j| (i, j))) {
            let seed = metaseed(cell, [i, j], 1);
            let Some(cluster) = cluster(&seed, community) else { continue };
            assert!((8..=MOST_MEMBERS).contains(&cluster.members));
            for number in 0..cluster.members {
                let member = member(&seed, &cluster, number);
                counts[member.kind as usize] += 1;
                assert!((50..3_200).contains(&member.size), "{member:?}");
            }
        }
        counts.map(|count| f64::from(count) / f64::from(counts.iter().sum::<u32>()))
    };
    let [grass, flowers, ferns, shrubs, stones, wood] = counted(Community::Wood);
    println!("a wood: {grass:.2} {flowers:.2} {ferns:.2} {shrubs:.2} {stones:.2} {wood:.2}");
    assert!(ferns > 0.1 && shrubs > 0.1 && wood > 0.02 && stones > 0.02 && flowers < 0.05);
    let [grass, flowers, ferns, _, stones, wood] = counted(Community::Meadow);
    assert!(grass > 0.7 && flowers > 0.05 && stones < 0.03 && ferns + wood == 0.0);
    let [_, _, ferns, _, stones, wood] = counted(Community::Rock);
    assert!(stones > 0.6 && ferns + wood == 0.0);
}

/// Anyone who grows metaseeds elsewhere can hold theirs to these.
#[test]
fn check_values() {
    let cell = [139_035, 31_373];
    let seed = metaseed(cell, [5, 11], 1);
    let cluster = cluster(&seed, Community::Wood).unwrap();
    let members = [0, 4, 8, 12].map(|number| member(&seed, &cluster, number));
    assert_eq!((seed.x, seed.y, seed.rank, seed.bits, seed.theme, seed.stretch), SEED);
    assert_eq!((cluster.members, cluster.vigour), CLUSTER);
    let words =
        |member: &Member| (member.kind, member.x, member.y, member.size, member.rotation, member.bits);
    assert_eq!(members.each_ref().map(words), MEMBERS);
}

type Words = (Kind, i32, i32, u32, u8, u32);

const SEED: (u32, u32, u32, u32, u32, u32) = (1_923, 2_687, 51_332, 3_971_200_362, 0, 374);
const CLUSTER: (u32, u32) = (28, 181);
const MEMBERS: [Words; 4] = [
    (Kind::Grass, 2_059, 2_877, 216, 250, 2_963_543_258),
    (Kind::Shrub, 2_077, 2_589, 299, 102, 2_095_945_638),
    (Kind::Fern, 2_079, 2_691, 727, 248, 2_808_992_704),
    (Kind::Stone, 2_099, 2_806, 300, 157, 3_917_010_719),
];

proptest! {
    #[test]
    fn metaseeds_stay_in_their_cells(column: u32, row in 3_000_u32..128_000, i in 0_u32..72, j in 0..ROWS, scene_seed: u32) {
        let column = column & ((2 << LEVEL) - 1);
        let count = columns(&CellRow::new(row));
        let seed = metaseed([column, row], [i % count, j], scene_seed);
        prop_assert!(seed.x < CELL_UNITS && seed.y < CELL_UNITS && seed.rank < 1 << 16 && seed.theme < 8);
    }
}
