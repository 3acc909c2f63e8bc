//! What the built-in scene promises to whoever reads it, on random places of all levels.

use super::geography::{BOUNDS, METRES_PER_DEGREE_EAST, METRES_PER_DEGREE_NORTH};
use super::massif::{Massif, place_of};
use super::*;
use crate::source::{ColourField, Cover, CoverField, HeightField, RequestCrs, SampleGrid};
use proptest::prelude::*;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::layer::SurfaceType;
use treeline_core::tile::{GeographicBox, TileAddress};

fn window(
    level: u8,
    registration: Registration,
    column: i64,
    row: i64,
    width: u32,
    height: u32,
) -> LatticeWindow {
    LatticeWindow { level, registration, first_column: column, first_row: row, width, height }
}

fn heights(window: LatticeWindow) -> Vec<f32> {
    let grid = SampleGrid::Lattice(window);
    let mut out = vec![0.0; grid.len()];
    height().sample(&grid, &mut out).unwrap();
    out
}

fn colours(window: LatticeWindow) -> Vec<[u8; 4]> {
    let grid = SampleGrid::Lattice(window);
    let mut out = vec![[1; 4]; grid.len()];
    colour().sample(&grid, &mut out).unwrap();
    out
}

fn covers(window: LatticeWindow) -> Vec<Cover> {
    let grid = SampleGrid::Lattice(window);
    let mut out = vec![Cover::default(); grid.len()];
    cover().sample(&grid, &mut out).unwrap();
    out
}

/// Global index of the sample nearest to a place given as shares of the extent.
fn index_at(level: u8, across: f64, down: f64) -> (i64, i64) {
    let step = 180.0 / (512.0 * (1_u64 << level) as f64);
    let longitude = BOUNDS.west + (BOUNDS.east - BOUNDS.west) * across;
    let latitude = BOUNDS.north - (BOUNDS.north - BOUNDS.south) * down;
    (((longitude + 180.0) / step) as i64, ((90.0 - latitude) / step) as i64)
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_sample_is_the_same_in_every_window(
        level in 4_u8..=18, across in -0.02..1.02_f64, down in -0.02..1.02_f64, left in 0_i64..9, above in 0_i64..9,
    ) {
        let (column, row) = index_at(level, across, down);
        let small = heights(window(level, Registration::Node, column, row, 3, 3));
        let large = heights(window(level, Registration::Node, column - left, row - above, 13, 12));
        for j in 0..3 {
            for i in 0..3 {
                let at = (j + above as usize) * 13 + i + left as usize;
                prop_assert_eq!(small[j * 3 + i].to_bits(), large[at].to_bits());
            }
        }
        let small = covers(window(level, Registration::Cell, column, row, 3, 3));
        let large = covers(window(level, Registration::Cell, column - left, row - above, 13, 12));
        for j in 0..3 {
            for i in 0..3 {
                prop_assert_eq!(small[j * 3 + i], large[(j + above as usize) * 13 + i + left as usize]);
            }
        }
    }

    #[test]
    fn a_node_of_a_parent_is_its_child(level in 4_u8..=18, across in 0.0..1.0_f64, down in 0.0..1.0_f64) {
        let (column, row) = index_at(level, across, down);
        let parent = heights(window(level, Registration::Node, column, row, 4, 4));
        let child = heights(window(level + 1, Registration::Node, 2 * column, 2 * row, 7, 7));
        for j in 0..4 {
            for i in 0..4 {
                prop_assert_eq!(parent[j * 4 + i].to_bits(), child[2 * j * 7 + 2 * i].to_bits());
            }
        }
    }

    #[test]
    fn a_texel_is_the_mean_of_its_children(level in 0_u8..16, across in -0.02..1.02_f64, down in -0.02..1.02_f64) {
        let (column, row) = index_at(level, across, down);
        let parents = colours(window(level, Registration::Cell, column - 2, row - 2, 5, 5));
        let children = colours(window(level + 1, Registration::Cell, 2 * column - 4, 2 * row - 4, 10, 10));
        for j in 0..5 {
            for i in 0..5 {
                let at = 2 * j * 10 + 2 * i;
                let four = [at, at + 1, at + 10, at + 11].map(|at| children[at]);
                let parent = parents[j * 5 + i];
                let weight: f64 = four.iter().map(|c| f64::from(c[3])).sum();
                prop_assert!((f64::from(parent[3]) - weight / 4.0).abs() <= 1.0, "{parent:?} {four:?}");
                for k in 0..3 {
                    let sum: f64 = four.iter().map(|c| f64::from(c[k]) * f64::from(c[3])).sum();
                    let mean = if weight > 0.0 { sum / weight } else { 0.0 };
                    prop_assert!((f64::from(parent[k]) - mean).abs() <= 1.0, "{parent:?} {four:?}");
                }
            }
        }
    }

    #[test]
    fn a_texel_is_the_same_in_every_window(
        level in 1_u8..=16, across in 0.0..1.0_f64, down in 0.0..1.0_f64, left in 0_i64..9, above in 0_i64..9,
    ) {
        let (column, row) = index_at(level, across, down);
        let small = colours(window(level, Registration::Cell, column, row, 2, 2));
        let large = colours(window(level, Registration::Cell, column - left, row - above, 12, 12));
        for j in 0..2 {
            for i in 0..2 {
                prop_assert_eq!(small[j * 2 + i], large[(j + above as usize) * 12 + i + left as usize]);
            }
        }
    }

    #[test]
    fn maxima_are_bounds(level in 8_u8..=17, across in 0.0..1.0_f64, down in 0.0..1.0_f64) {
        let (column, row) = index_at(level, across, down);
        let window = window(level, Registration::Node, column, row, 33, 33);
        let step = window.step_degrees();
        let west = window.longitude(column);
        let north = window.latitude(row);
        let bounds = GeographicBox { west, south: north - 32.0 * step, east: west + 32.0 * step, north };
        let maxima = height().maxima(&bounds, 4, 4).unwrap();
        let (least, greatest) = height().range();
        for (k, &value) in heights(window).iter().enumerate() {
            if value.is_nan() {
                continue;
            }
            prop_assert!((least..=greatest).contains(&value));
            // Nodes between two parts belong to both.
            let (i, j) = (k % 33, k / 33);
            for part in [(i.saturating_sub(1) / 8, j.saturating_sub(1) / 8), ((i / 8).min(3), (j / 8).min(3))] {
                let bound = maxima[part.1 * 4 + part.0];
                prop_assert!(value <= bound, "{value} above {bound}");
                prop_assert!(bound - value < 3000.0);
            }
        }
    }
}

#[test]
fn the_landscape_is_computed_alike_every_time() {
    let (a, b) = (Massif::new(11), Massif::new(11));
    assert_eq!(bits(&a.heights), bits(&b.heights));
    let other = Massif::new(12);
    assert_ne!(bits(&a.heights), bits(&other.heights));
}

#[test]
fn beyond_the_extent_there_is_nothing() {
    let (column, row) = index_at(9, -3.0, 0.5);
    assert!(heights(window(9, Registration::Node, column, row, 8, 8)).iter().all(|v| v.is_nan()));
    assert!(colours(window(9, Registration::Cell, column, row, 8, 8)).iter().all(|c| *c == [0; 4]));
    assert!(covers(window(9, Registration::Cell, column, row, 8, 8)).iter().all(|c| *c == Cover::default()));
    let bounds = GeographicBox { west: -10.0, south: 10.0, east: -9.0, north: 11.0 };
    assert!(height().maxima(&bounds, 2, 2).unwrap().iter().all(|v| v.is_nan()));
}

/// The box of `metres` around a place on the plane.
fn around(x: f64, y: f64, metres: f64, side: u32) -> SampleGrid {
    let (longitude, latitude) = (
        geography::CENTRE_LONGITUDE + x / METRES_PER_DEGREE_EAST,
        geography::CENTRE_LATITUDE + y / METRES_PER_DEGREE_NORTH,
    );
    let (dx, dy) = (0.5 * metres / METRES_PER_DEGREE_EAST, 0.5 * metres / METRES_PER_DEGREE_NORTH);
    SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: longitude - dx,
        south: latitude - dy,
        east: longitude + dx,
        north: latitude + dy,
        width: side,
        height: side,
    }
}

#[test]
fn the_lake_is_level_and_is_where_water_is() {
    let lake = &LAND.massif.lake;
    let (x, y) = place_of(lake.outlet);
    let grid = around(f64::from(x), f64::from(y), 9_000.0, 600);
    let (mut heights, mut covers) = (vec![0.0; grid.len()], vec![Cover::default(); grid.len()]);
    height().sample(&grid, &mut heights).unwrap();
    cover().sample(&grid, &mut covers).unwrap();
    let level: Vec<bool> = heights.iter().map(|&h| h == lake.level).collect();
    let area = level.iter().filter(|&&l| l).count() as f64 * (9_000.0 / 600.0_f64).powi(2) * 1e-6;
    assert!((3.0..20.0).contains(&area), "{area} km²");
    for (level, cover) in level.iter().zip(&covers) {
        if *level {
            assert_eq!(cover.surface(), SurfaceType::Water);
            assert_eq!(cover.species, 0, "no trees in the water");
        }
    }
}

#[test]
fn forest_thins_out_at_the_tree_line_and_each_species_has_its_belt() {
    let grid = SampleGrid::Lattice(LatticeWindow::of_tile(
        TileAddress::at(9, geography::CENTRE_LONGITUDE, geography::CENTRE_LATITUDE),
        Registration::Cell,
        0,
    ));
    let (mut heights, mut covers) = (vec![0.0; grid.len()], vec![Cover::default(); grid.len()]);
    height().sample(&grid, &mut heights).unwrap();
    cover().sample(&grid, &mut covers).unwrap();
    let share = |low: f32, high: f32, what: &dyn Fn(&Cover) -> bool| {
        let band: Vec<_> = heights.iter().zip(&covers).filter(|(h, _)| (low..high).contains(*h)).collect();
        assert!(band.len() > 300, "{} samples from {low} to {high} m", band.len());
        band.iter().filter(|(_, c)| what(c)).count() as f64 / band.len() as f64
    };
    let forest = |c: &Cover| c.species > 0;
    assert!(share(1200.0, 1600.0, &forest) > 0.4);
    let ragged = share(1850.0, 2050.0, &forest);
    assert!((0.05..0.7).contains(&ragged), "{ragged}");
    assert_eq!(share(2450.0, 4000.0, &forest), 0.0);
    let broadleaf = |c: &Cover| [2, 7, 8, 9].contains(&c.species);
    assert!(share(600.0, 900.0, &broadleaf) > 0.2);
    assert!(share(1750.0, 2000.0, &broadleaf) < 0.02);
    let of = |code: u8| move |c: &Cover| c.species == code;
    let (beech, larch, oak) = (of(2), of(4), of(7));
    assert!(share(900.0, 1300.0, &beech) > 0.02 && share(1600.0, 2000.0, &beech) < 0.01);
    assert!(share(1700.0, 1950.0, &larch) > 3.0 * share(600.0, 1000.0, &larch));
    assert!(share(600.0, 800.0, &oak) > 0.01 && share(1100.0, 1500.0, &oak) == 0.0);
    let snow = |c: &Cover| c.surface() == SurfaceType::Snow;
    assert!(share(3050.0, 4000.0, &snow) > 0.3);
    assert_eq!(share(500.0, 2000.0, &snow), 0.0);
}

#[test]
fn web_mercator_boxes_see_the_same_places() {
    use treeline_core::geodesy::web_mercator_from_geographic;
    let degrees = |metres: f64| metres / METRES_PER_DEGREE_EAST;
    let (longitude, latitude) = (10.95, 46.93);
    let (west, south) = web_mercator_from_geographic(longitude, latitude);
    let (east, north) = web_mercator_from_geographic(longitude + degrees(4.0), latitude + degrees(4.0));
    let mercator =
        SampleGrid::Box { crs: RequestCrs::WebMercator, west, south, east, north, width: 4, height: 4 };
    let geographic = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: longitude,
        south: latitude,
        east: longitude + degrees(4.0),
        north: latitude + degrees(4.0),
        width: 4,
        height: 4,
    };
    let (mut a, mut b) = (vec![0.0; 16], vec![0.0; 16]);
    height().sample(&mercator, &mut a).unwrap();
    height().sample(&geographic, &mut b).unwrap();
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 0.02), "{a:?} {b:?}");
    let (mut a, mut b) = (vec![[0; 4]; 16], vec![[0; 4]; 16]);
    colour().sample(&mercator, &mut a).unwrap();
    colour().sample(&geographic, &mut b).unwrap();
    for (a, b) in a.iter().zip(&b) {
        assert_eq!(a[3], 255);
        assert!(a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) < 12), "{a:?} {b:?}");
    }
}

#[test]
fn every_view_stands_clear_of_the_ground_and_sees_the_massif() {
    let defaults = scene_defaults();
    assert_eq!(defaults.camera, defaults.places[0].camera);
    for place in &defaults.places {
        place.camera.check().unwrap();
        let grid = SampleGrid::Box {
            crs: RequestCrs::Geographic,
            west: place.camera.lon - 1e-4,
            south: place.camera.lat - 1e-4,
            east: place.camera.lon + 1e-4,
            north: place.camera.lat + 1e-4,
            width: 1,
            height: 1,
        };
        let mut ground = [0.0];
        height().sample(&grid, &mut ground).unwrap();
        if !ground[0].is_nan() {
            let clear = place.camera.height - f64::from(ground[0]);
            assert!((30.0..12_000.0).contains(&clear), "{}: {clear} m above the ground", place.name);
        }
    }
}
