use super::*;
use crate::seeds::pattern::{CANDIDATES_PER_KM2, LEVEL};
use crate::seeds::place::{UNIT_METRES, x_from_longitude, y_from_latitude};
use crate::seeds::species::widest_crown_metres;
use proptest::prelude::*;

/// A square of `metres` a side with its centre at 10° E and a latitude, and metres per unit of x.
fn square(latitude: f64, metres: f64) -> (Window, f64) {
    let across = UNIT_METRES * latitude.to_radians().cos();
    let (x, y) = (x_from_longitude(10.0), y_from_latitude(latitude));
    let window = Window {
        west: (x - 0.5 * metres / across) as i64,
        east: (x + 0.5 * metres / across) as i64,
        north: (y - 0.5 * metres / UNIT_METRES) as i64,
        south: (y + 0.5 * metres / UNIT_METRES) as i64,
    };
    (window, across)
}

fn trees(window: &Window, seed: u32, stand: Stand) -> Vec<Tree> {
    let mut found = Vec::new();
    for_each_tree(window, seed, &Species::built_in(), |_, _| stand, |tree| found.push(tree));
    found
}

/// Clark–Evans index (mean distance to the nearest neighbour over that of points strewn at random)
/// and least distance, metres, of the trees in the middle of a square.
fn spacing(trees: &[Tree], across: f64, window: &Window, metres: f64) -> (f64, f64) {
    let places: Vec<(f64, f64)> = trees
        .iter()
        .map(|tree| ((tree.x - window.west) as f64 * across, (tree.y - window.north) as f64 * UNIT_METRES))
        .collect();
    let border = 40.0;
    let inside = |value: f64| value > border && value < metres - border;
    let (mut sum, mut count, mut least) = (0.0, 0_u32, f64::MAX);
    // Trees come cell by cell; sorting by y bounds the search.
    let mut sorted = places.clone();
    sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
    for (index, &(x, y)) in sorted.iter().enumerate() {
        if !inside(x) || !inside(y) {
            continue;
        }
        let mut nearest = f64::MAX;
        for &(a, b) in sorted[index + 1..].iter().take_while(|place| place.1 - y < border) {
            nearest = nearest.min((a - x).hypot(b - y));
        }
        for &(a, b) in sorted[..index].iter().rev().take_while(|place| y - place.1 < border) {
            nearest = nearest.min((a - x).hypot(b - y));
        }
        sum += nearest;
        count += 1;
        least = least.min(nearest);
    }
    let side = metres - 2.0 * border;
    let density = f64::from(count) / (side * side);
    (sum / f64::from(count) * 2.0 * density.sqrt(), least)
}

/// A stand so low that, at full closure, every candidate lives.
const EVERY: Stand = Stand { species: 1, closure: 255, height: 60 };

#[test]
fn trees_keep_their_distance_at_every_latitude() {
    for latitude in [0.0, 47.0, 60.0, -60.0, 80.0] {
        let (window, across) = square(latitude, 900.0);
        let (index, least) = spacing(&trees(&window, 1, EVERY), across, &window, 900.0);
        println!("latitude {latitude}: every candidate: Clark-Evans {index:.3}, least distance {least:.2} m");
        assert!(index > 1.36, "{latitude}: {index}");
        // A quarter of a sub-cell's lesser side.
        assert!(least > 1.3, "{latitude}: {least}");
    }
}

#[test]
fn a_thinned_forest_stays_evenly_spaced() {
    for closure in [255_u8, 191, 128, 64, 26] {
        let (window, across) = square(47.0, 1_200.0);
        let stand = Stand { species: 1, closure, height: 0 };
        let (index, _) = spacing(&trees(&window, 1, stand), across, &window, 1_200.0);
        println!("closure {closure}: Clark-Evans {index:.3}");
        assert!(index > 1.2, "closure {closure}: {index}");
    }
}

#[test]
fn density_follows_the_cover_at_every_latitude() {
    for latitude in [0.0, 30.0, 47.0, 60.0, 70.0, 80.0, 85.0] {
        let (window, _) = square(latitude, 1_000.0);
        for (species, dense) in [(1, 21_000.0), (2, 15_000.0)] {
            for closure in [255_u8, 128, 26] {
                let count = trees(&window, 3, Stand { species, closure, height: 0 }).len() as f64;
                let wanted = dense * f64::from(closure) / 255.0;
                let error = count / wanted - 1.0;
                // 1.5 % of it is the count's own chance at the sparsest; near the pole a sub-cell is
                // too wide for its columns to keep enough where nearly all live.
                let limit = if latitude > 82.0 { 0.08 } else { 0.025 };
                assert!(error.abs() < limit, "{latitude}°, closure {closure}: {count} of {wanted}");
            }
        }
    }
    let every = trees(&square(0.0, 1_000.0).0, 1, EVERY).len() as f64;
    assert!((every / CANDIDATES_PER_KM2 - 1.0).abs() < 0.01, "{every}");
}

#[test]
fn cells_do_not_repeat() {
    // Places within the cell, of many cells in a row: a repetition would show as equal lists.
    let stand = Stand { species: 1, closure: 255, height: 0 };
    let side = i64::from(CELL_UNITS);
    let (window, _) = square(47.0, 10.0);
    let (column, row) = (window.west / side, window.north / side);
    let lists: Vec<Vec<(i64, i64)>> = (0..64)
        .map(|cell| {
            let west = (column + cell) * side;
            let window = Window { west, east: west + side, north: row * side, south: (row + 1) * side };
            trees(&window, 1, stand).iter().map(|tree| (tree.x - west, tree.y)).collect()
        })
        .collect();
    for (index, list) in lists.iter().enumerate() {
        assert!(list.len() > 250);
        for other in &lists[index + 1..(index + 9).min(lists.len())] {
            // Nearby cells may draw the same pattern, once in 255 times.
            let equal = list.iter().filter(|place| other.contains(place)).count();
            assert!(equal < 3 || list == other, "{equal}");
        }
        if index > 0 {
            assert_ne!(list, &lists[index - 1]);
        }
    }
}

#[test]
fn another_seed_grows_another_forest() {
    let (window, _) = square(47.0, 300.0);
    let (first, second) = (trees(&window, 1, EVERY), trees(&window, 2, EVERY));
    assert!(first.iter().filter(|tree| second.contains(tree)).count() < first.len() / 20);
}

#[test]
fn poles_void_stands_and_empty_windows_have_no_trees() {
    let turn = 1_i64 << 32;
    let polar = Window { west: 0, east: 40_000, north: -500, south: 40_000 };
    assert_eq!(trees(&polar, 1, EVERY), []);
    let south = Window { west: 0, east: 40_000, north: turn / 2 - 40_000, south: turn / 2 + 40_000 };
    assert_eq!(trees(&south, 1, EVERY), []);
    let (window, _) = square(10.0, 100.0);
    for stand in [
        Stand::default(),
        Stand { species: 1, closure: 0, height: 0 },
        Stand { species: 1, closure: 255, height: 7 },
        Stand { species: 13, closure: 255, height: 0 },
    ] {
        assert_eq!(trees(&window, 1, stand), []);
    }
    assert_eq!(trees(&Window { east: window.west, ..window }, 1, EVERY), []);
}

#[test]
fn the_antimeridian_is_no_seam() {
    let turn = 1_i64 << 32;
    let north = y_from_latitude(-17.0) as i64;
    let window = Window { west: turn - 30_000, east: turn + 30_000, north, south: north + 30_000 };
    let found = trees(&window, 5, EVERY);
    let east = trees(&Window { west: 0, east: 30_000, ..window }, 5, EVERY);
    let wrapped: Vec<Tree> =
        found.iter().filter(|tree| tree.x >= turn).map(|tree| Tree { x: tree.x - turn, ..*tree }).collect();
    assert!(!east.is_empty());
    let sorted = |mut trees: Vec<Tree>| {
        trees.sort_by_key(|tree| (tree.y, tree.x));
        trees
    };
    assert_eq!(sorted(wrapped), sorted(east));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// A tree does not depend on the window through which it is seen.
    #[test]
    fn windows_agree(latitude in -88.0..88.0_f64, split_x in 0.0..1.0_f64, split_y in 0.0..1.0_f64, closure: u8) {
        let (window, _) = square(latitude, 260.0);
        let stand = Stand { species: 2, closure, height: 0 };
        let middle_x = window.west + ((window.east - window.west) as f64 * split_x) as i64;
        let middle_y = window.north + ((window.south - window.north) as f64 * split_y) as i64;
        let mut parts = Vec::new();
        for part in [
            Window { east: middle_x, south: middle_y, ..window },
            Window { west: middle_x, south: middle_y, ..window },
            Window { east: middle_x, north: middle_y, ..window },
            Window { west: middle_x, north: middle_y, ..window },
        ] {
            parts.extend(trees(&part, 9, stand));
        }
        let mut whole = trees(&window, 9, stand);
        whole.sort_by_key(|tree| (tree.y, tree.x));
        parts.sort_by_key(|tree| (tree.y, tree.x));
        prop_assert_eq!(whole, parts);
    }
}

/// Mean of the exact envelope over a square, flat ground, by sampling, and the share under crowns.
fn envelope_mean(stand: Stand) -> (f64, f64) {
    let table = Species::built_in();
    let metres = 400.0;
    let (window, across) = square(47.0, metres);
    let step = 0.75;
    let side = (metres / step) as usize;
    let mut heights = vec![0.0_f32; side * side];
    let reach = f64::from(widest_crown_metres(&table));
    for tree in trees(&window, 11, stand) {
        let x = (tree.x - window.west) as f64 * across;
        let y = (tree.y - window.north) as f64 * UNIT_METRES;
        let range =
            |at: f64| ((at - reach) / step).max(0.0) as usize..(((at + reach) / step) as usize + 1).min(side);
        for row in range(y) {
            for column in range(x) {
                let distance = (column as f64 * step - x).hypot(row as f64 * step - y) as f32;
                if let Some(height) = table[tree.species].crown_surface(tree.height_metres(), distance) {
                    let node = &mut heights[row * side + column];
                    *node = node.max(height);
                }
            }
        }
    }
    let border = (reach / step) as usize + 1;
    let inner = border..side - border;
    let (mut sum, mut under, mut count) = (0.0, 0.0, 0.0);
    for row in inner.clone() {
        for column in inner.clone() {
            let height = f64::from(heights[row * side + column]);
            sum += height;
            under += f64::from(u8::from(height > 0.0));
            count += 1.0;
        }
    }
    (sum / count, under / count)
}

#[test]
fn the_expected_canopy_is_the_mean_of_the_envelope() {
    let table = Species::built_in();
    let mut worst = 0.0_f64;
    for species in [1_u8, 2] {
        for height in [0_u8, 40, 80, 120] {
            for closure in [26_u8, 64, 128, 191, 255] {
                let stand = Stand { species, closure, height };
                let (mean, under) = envelope_mean(stand);
                let expected = f64::from(table[usize::from(species) - 1].expected_canopy(closure, height));
                println!(
                    "species {species} height {height} closure {closure}: mean {mean:.2} expected {expected:.2} m, {:.0} % under crowns",
                    100.0 * under
                );
                worst = worst.max((mean - expected).abs());
            }
        }
    }
    println!("largest error {worst:.2} m");
    assert!(worst < 0.5, "{worst}");
    assert_eq!(table[0].expected_canopy(0, 0), 0.0);
    assert_eq!(table[0].expected_canopy(255, LEAST_STAND_HEIGHT - 1), 0.0);
}

#[test]
fn cells_are_tiles_of_the_pattern_level() {
    assert_eq!(
        f64::from(CELL_UNITS),
        crate::seeds::place::units_of_cell(LEVEL) * f64::from(crate::tile::CELLS)
    );
}
