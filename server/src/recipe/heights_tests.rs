//! The heights alone, made without what a tile carries beside them.

use super::*;
use crate::recipe::point;
use crate::recipe::test_fields::scene;
use crate::source::RequestCrs;
use proptest::prelude::*;

fn grid(west: f64, south: f64, metres: f64, width: u32, height: u32) -> SampleGrid {
    let degrees = metres * 360.0 / geodesy::EQUATOR_METRES;
    SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west,
        south,
        east: west + degrees * f64::from(width) / south.to_radians().cos(),
        north: south + degrees * f64::from(height),
        width,
        height,
    }
}

/// Bits, so that voids compare, too.
fn bits(heights: &[f32]) -> Vec<u32> {
    heights.iter().map(|height| height.to_bits()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_heights_alone_are_those_of_the_whole_map_and_of_each_place(
        west in 9.99..10.9_f64, south in 46.0..46.9_f64, metres in 0.3..1.9_f64, width in 1_u32..60, height in 1_u32..60,
    ) {
        let scene = scene();
        let grid = grid(west, south, metres, width, height);
        let alone = heights(&scene, &grid).unwrap();
        prop_assert_eq!(bits(&alone), bits(&Combined::sample(&scene, &grid).unwrap().heights));
        let Places::Separable { longitudes, latitudes } = places(&grid).unwrap() else { unreachable!() };
        let (mut asked, mut apart) = (0, 0);
        for index in (0..alone.len()).step_by(7) {
            let column = index % width as usize;
            let place = point(&scene, longitudes[column], latitudes[index / width as usize]).unwrap();
            let Some(terrain) = place.terrain else {
                prop_assert!(alone[index].is_nan());
                continue;
            };
            asked += 1;
            let expected = terrain + place.canopy.unwrap_or(0.0);
            // At a crown's very rim rounding decides whether it is met.
            apart += usize::from((f64::from(alone[index]) - expected).abs() > 0.02);
        }
        prop_assert!(100 * apart <= asked + 99, "{apart} of {asked}");
    }
}

#[test]
fn a_map_made_in_bands_is_the_same_as_its_parts() {
    let scene = scene();
    let (width, rows) = (2_048_u32, (BAND_SAMPLES / 2_048) as u32);
    let whole = grid(10.3, 46.4, 0.9, width, 2 * rows + 5);
    assert_eq!(bands(&whole).len(), 3);
    let made = heights(&scene, &whole).unwrap();
    assert_eq!(bits(&made), bits(&Combined::sample(&scene, &whole).unwrap().heights));
    let parts: Vec<f32> = bands(&whole).iter().flat_map(|band| heights(&scene, band).unwrap()).collect();
    assert_eq!(bits(&made), bits(&parts));
}
