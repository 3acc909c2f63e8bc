//! Random nasty grids, by the twin against the exact reference. `PROPTEST_CASES=20000` looks longer.

use glam::DVec3;
use proptest::prelude::*;
use treeline_tests::height_field::by_twin;
use treeline_tests::reference::measure::{Errors, truth};
use treeline_tests::reference::{Camera, Ground};

const SIZE: [u32; 2] = [21, 17];

#[derive(Clone, Debug)]
struct Setting {
    columns: usize,
    rows: usize,
    cell: f64,
    origin: [f64; 2],
    heights: Vec<f64>,
    /// Eye and target in cells from the south-west, and in metres of height.
    eye: [f64; 3],
    target: [f64; 3],
    fov: f64,
    bend: f64,
}

/// Heights as they come in stiff cases, side by side.
fn height() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -20.0..20.0_f64,
        3 => Just(0.0),
        1 => Just(1000.0),
        1 => Just(-500.0),
        1 => Just(0.001),
        1 => Just(f64::NAN),
        1 => -11_000.0..8_800.0_f64,
    ]
}

/// Coordinates on lines, beside them by a hair, and anywhere.
fn coordinate(reach: f64) -> impl Strategy<Value = f64> {
    let whole = (0.0..reach).prop_map(f64::floor);
    prop_oneof![
        3 => -0.5 * reach..1.5 * reach,
        2 => whole.clone(),
        1 => whole.clone().prop_map(|x| x + 0.5),
        1 => whole.prop_map(|x| x + 1e-4),
        1 => -300.0..300.0_f64,
    ]
}

fn elevation() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -60.0..60.0_f64, 1 => Just(0.5), 1 => Just(-1.0), 1 => 100.0..2000.0_f64, 1 => -12_000.0..1.0e6_f64]
}

fn setting() -> impl Strategy<Value = Setting> {
    (2_usize..20, 2_usize..20)
        .prop_flat_map(|(columns, rows)| {
            let reach = columns.max(rows) as f64;
            (
                Just((columns, rows)),
                prop_oneof![Just(1.0), Just(1.7), Just(10.0), Just(0.001), Just(1000.0)],
                prop_oneof![3 => Just([0.0, 0.0]), 1 => Just([6.4e6 + 0.3, -4.1e6 + 0.7])],
                prop::collection::vec(height(), columns * rows),
                [coordinate(reach), coordinate(reach)],
                [coordinate(reach), coordinate(reach)],
                [elevation(), elevation()],
                prop_oneof![4 => Just(50.0), 1 => 1.0..150.0_f64],
                prop_oneof![4 => Just(0.0), 1 => Just(0.5 / 6.371e6), 1 => Just(0.5 / 2000.0)],
            )
        })
        .prop_map(|((columns, rows), cell, origin, heights, eye, target, [ez, tz], fov, bend)| Setting {
            columns,
            rows,
            cell,
            origin,
            heights,
            eye: [eye[0], eye[1], ez],
            target: [target[0], target[1], tz],
            fov,
            bend,
        })
}

fn ground_of(setting: &Setting) -> Ground {
    let mut ground = Ground::from_function(setting.columns, setting.rows, setting.cell, |x, y| {
        setting.heights[y * setting.columns + x]
    });
    ground.origin = setting.origin;
    ground.bend = setting.bend;
    ground
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, max_shrink_iters: 5000, ..ProptestConfig::default() })]

    #[test]
    fn every_picture_is_right(setting in setting()) {
        let ground = ground_of(&setting);
        let place = |[x, y, z]: [f64; 3]| {
            DVec3::new(setting.origin[0] + x * setting.cell, setting.origin[1] + y * setting.cell, z)
        };
        let (mut eye, mut target) = (place(setting.eye), place(setting.target));
        if let Some(height) = ground.height(eye.x, eye.y)
            && (eye.z - height).abs() < 1e-3
        {
            // On the surface itself, up and down are the same.
            eye.z = height + 1e-3;
        }
        prop_assume!(target != eye);
        let far = (target - eye).length();
        if far > 100.0 * setting.cell {
            // From afar a grid may be smaller than the five rays' spread: then a ray along its very border, which
            // f32 cannot place, would count.
            target += DVec3::new(1.37e-3, 0.71e-3, 0.0) * far;
        }
        let upright = (target - eye).cross(DVec3::Z).length() > 1e-6 * (target - eye).length();
        let up = if upright { DVec3::Z } else { DVec3::Y };
        let camera = Camera { eye, target, up, fov_y_degrees: setting.fov };
        let truth = truth(&ground, &camera, SIZE);
        let (depths, _) = by_twin(&ground, &camera, SIZE);
        let errors = Errors::of(&truth, &depths, SIZE[0]);
        prop_assert!(errors.missed == 0 && errors.false_hits == 0 && errors.worst <= 1.0, "{errors:?}");
    }
}
