//! Depths of height fields against the exact reference, on the GPU and on the twin: the stiff cases.

use treeline_tests::height_field::{check, mountains};
use treeline_tests::reference::{Camera, Ground};

const SIZE: [u32; 2] = [160, 128];

fn flat(height: f64) -> Ground {
    Ground::from_function(129, 129, 10.0, |_, _| height)
}

fn alps() -> Ground {
    Ground::from_function(129, 129, 10.0, |x, y| mountains(x as f64, y as f64, 60.0, 500.0, 7))
}

fn alps_height(x: f64, y: f64) -> f64 {
    alps().height(x, y).expect("inside")
}

#[test]
fn mountains_seen_obliquely() {
    check("oblique", &alps(), &Camera::new([640.0, -200.0, 900.0], [640.0, 640.0, 200.0], 50.0), SIZE);
}

#[test]
fn needles_one_texel_wide() {
    let needles = Ground::from_function(129, 129, 10.0, |x, y| {
        if x % 9 == 4 && y % 7 == 3 { 50.0 + ((x * 31 + y * 17) % 29) as f64 * 50.0 } else { 0.0 }
    });
    check("needles", &needles, &Camera::new([640.0, -300.0, 700.0], [640.0, 640.0, 100.0], 50.0), SIZE);
    check(
        "needles from the ground",
        &needles,
        &Camera::new([33.0, 35.0, 3.0], [1200.0, 1100.0, 40.0], 60.0),
        SIZE,
    );
}

#[test]
fn a_wall_of_2000_m_in_one_texel() {
    let wall = Ground::from_function(129, 129, 1.7, |x, _| if x >= 64 { 2000.0 } else { 0.0 });
    check("wall, frontal", &wall, &Camera::new([20.0, 108.0, 900.0], [109.0, 108.0, 900.0], 50.0), SIZE);
    check("wall, from its foot", &wall, &Camera::new([100.0, 108.0, 1.7], [108.0, 108.0, 30.0], 80.0), SIZE);
    check("wall, grazed", &wall, &Camera::new([107.4, -30.0, 1000.0], [108.4, 217.0, 980.0], 50.0), SIZE);
    check(
        "wall, within its slope",
        &wall,
        &Camera::new([107.9, 3.0, 990.0], [107.95, 217.0, 985.0], 50.0),
        SIZE,
    );
    let ridge = Ground::from_function(129, 129, 10.0, |x, _| if x == 64 { 2000.0 } else { 0.0 });
    check("ridge, grazed", &ridge, &Camera::new([640.0, -50.0, 2000.5], [640.0, 900.0, 1000.0], 50.0), SIZE);
}

#[test]
fn a_checkerboard_of_0_and_1000_m() {
    let board = Ground::from_function(129, 129, 10.0, |x, y| ((x + y) % 2) as f64 * 1000.0);
    check("checkerboard", &board, &Camera::new([640.0, -150.0, 1500.0], [640.0, 640.0, 300.0], 50.0), SIZE);
    check(
        "checkerboard, within",
        &board,
        &Camera::new([644.3, 641.7, 700.0], [1000.0, 1100.0, 690.0], 50.0),
        SIZE,
    );
}

#[test]
fn a_plain_at_a_hundredth_of_a_degree() {
    let camera = Camera::new([5.0, 640.0, 0.4], [2291.8, 640.0, 0.0], 50.0);
    check("plain, grazed", &flat(0.0), &camera, SIZE);
    let camera = Camera::new([5.0, 640.0, 1234.5 + 0.2], [1151.0, 640.3, 1234.5], 0.5);
    check("plain, grazed, telescope", &flat(1234.5), &camera, SIZE);
}

#[test]
fn a_knife_ridge() {
    let knife = Ground::from_function(129, 129, 10.0, |x, _| -30.0 * (x as f64 - 64.0).abs());
    check("knife, along", &knife, &Camera::new([640.0, -50.0, 5.0], [640.0, 1000.0, -10.0], 50.0), SIZE);
    check("knife, on it", &knife, &Camera::new([640.0, 20.0, 0.01], [640.0, 1000.0, 0.0], 50.0), SIZE);
    check("knife, across", &knife, &Camera::new([100.0, 600.0, -400.0], [640.0, 640.0, 0.0], 20.0), SIZE);
}

#[test]
fn slits() {
    let slits = Ground::from_function(129, 129, 10.0, |x, _| if x % 4 == 0 { -500.0 } else { 0.0 });
    check("slits", &slits, &Camera::new([640.0, -100.0, 300.0], [640.0, 640.0, 0.0], 50.0), SIZE);
    check("slits, across", &slits, &Camera::new([-100.0, 640.0, 60.0], [640.0, 640.0, 0.0], 50.0), SIZE);
    let down = Camera::new([640.0, 640.0, 900.0], [640.0, 640.0, 0.0], 50.0).with_up([0.0, 1.0, 0.0]);
    check("slits, from above", &slits, &down, SIZE);
}

#[test]
fn rays_along_an_axis_and_through_corners() {
    // Odd sizes: the middle row and column of rays have exact zeros in their directions.
    let size = [161, 129];
    let alps = alps();
    for (name, target) in [
        ("east", [1280.0, 640.0, 300.0]),
        ("west", [0.0, 640.0, 300.0]),
        ("north", [640.0, 1280.0, 300.0]),
        ("south", [640.0, 0.0, 300.0]),
    ] {
        check(name, &alps, &Camera::new([640.0, 640.0, 300.0], target, 50.0), size);
    }
    check("diagonal", &alps, &Camera::new([640.0, 640.0, 600.0], [1280.0, 1280.0, 100.0], 50.0), size);
    check("other diagonal", &alps, &Camera::new([0.0, 1280.0, 600.0], [1280.0, 0.0, 100.0], 50.0), size);
}

#[test]
fn straight_down() {
    let camera = Camera::new([640.0, 640.0, 1900.0], [640.0, 640.0, 0.0], 40.0).with_up([0.0, 1.0, 0.0]);
    check("nadir", &alps(), &camera, [129, 129]);
    let camera = Camera::new([643.21, 637.9, 900.0], [643.21, 637.9, 0.0], 150.0).with_up([1.0, 1.0, 0.0]);
    check("nadir, wide", &alps(), &camera, SIZE);
}

#[test]
fn an_eye_a_millimetre_over_the_ground() {
    for (cell, x, y) in [(1.7, 91.37, 112.9), (30.0, 1234.5, 2001.3), (30.0, 1230.0, 2010.0)] {
        let ground = Ground::from_function(129, 129, cell, |x, y| {
            1500.0 + mountains(x as f64, y as f64, 50.0, 30.0 * cell, 3)
        });
        for over in [0.001, 1.0] {
            let z = ground.height(x, y).expect("inside") + over;
            let name = format!("eye {over} m over cells of {cell} m");
            check(&name, &ground, &Camera::new([x, y, z], [x + 40.0, y + 33.0, z - 1.0], 50.0), SIZE);
            let down = Camera::new([x, y, z], [x, y, z - 1.0], 50.0).with_up([0.0, 1.0, 0.0]);
            check(&format!("{name}, down"), &ground, &down, SIZE);
        }
    }
}

#[test]
fn an_eye_under_the_ground() {
    for under in [0.001, 5.0, 400.0] {
        let z = alps_height(633.3, 641.2) - under;
        let name = format!("{under} m under the ground");
        check(&name, &alps(), &Camera::new([633.3, 641.2, z], [1000.0, 900.0, z + 20.0], 60.0), SIZE);
        check(&name, &alps(), &Camera::new([633.3, 641.2, z], [633.4, 641.2, z + 9.0], 60.0), SIZE);
    }
    check(
        "from below and beside",
        &alps(),
        &Camera::new([-900.0, -700.0, -2500.0], [640.0, 640.0, 0.0], 50.0),
        SIZE,
    );
}

#[test]
fn an_eye_500_km_and_10000_km_up() {
    let alps = alps();
    let down = Camera::new([640.0, 640.0, 5.0e5], [640.0, 640.3, 0.0], 0.2).with_up([0.0, 1.0, 0.0]);
    check("500 km up", &alps, &down, SIZE);
    check("500 km up, wide", &alps, &Camera { fov_y_degrees: 1.0, ..down }, SIZE);
    let far = Camera::new([640.0, -2.0e6, 1.0e7], [640.0, 640.0, 200.0], 0.01);
    check("10,000 km up", &alps, &far, SIZE);
    let grazing = Camera::new([-9.0e6, 640.0, 1.0e6], [640.0, 640.0, 200.0], 0.01);
    check("10,000 km away, oblique", &alps, &grazing, SIZE);
}

#[test]
fn an_eye_outside_the_map() {
    check("outside", &alps(), &Camera::new([-9000.0, -7000.0, 2500.0], [640.0, 640.0, 200.0], 12.0), SIZE);
    check("outside, low", &alps(), &Camera::new([-900.0, 640.0, 100.0], [640.0, 640.0, 200.0], 50.0), SIZE);
    let away = Camera::new([-900.0, 640.0, 100.0], [-2000.0, 640.0, 200.0], 50.0);
    assert_eq!(check("looking away", &alps(), &away, SIZE).hits, 0);
}

#[test]
fn from_the_deepest_sea_to_the_highest_summit() {
    let everything = Ground::from_function(129, 129, 100.0, |x, y| {
        -11_000.0 + mountains(x as f64, y as f64, 40.0, 22_000.0, 11).min(19_800.0)
    });
    check(
        "−11 km to 8.8 km",
        &everything,
        &Camera::new([6400.0, -3000.0, 12_000.0], [6400.0, 6400.0, -4000.0], 55.0),
        SIZE,
    );
    let z = everything.height(6432.0, 6311.0).expect("inside") + 2.0;
    check(
        "−11 km to 8.8 km, from the ground",
        &everything,
        &Camera::new([6432.0, 6311.0, z], [9000.0, 9000.0, z], 60.0),
        SIZE,
    );
}

#[test]
fn holes_and_void_borders() {
    let holes = Ground::from_function(129, 129, 10.0, |x, y| {
        let far = (x as f64 - 64.0).hypot(y as f64 - 64.0);
        if far > 62.0 || (x * 7 + y * 13) % 23 == 0 || ((20..30).contains(&x) && y > 40) {
            f64::NAN
        } else {
            mountains(x as f64, y as f64, 60.0, 500.0, 7)
        }
    });
    check("holes", &holes, &Camera::new([640.0, -200.0, 900.0], [640.0, 640.0, 200.0], 50.0), SIZE);
    check(
        "holes, from within",
        &holes,
        &Camera::new([640.0, 400.0, 330.0], [300.0, 1000.0, 250.0], 70.0),
        SIZE,
    );
    check(
        "holes, from below",
        &holes,
        &Camera::new([640.0, 400.0, -300.0], [300.0, 1000.0, 250.0], 70.0),
        SIZE,
    );
    // A step behind a trench without data: no wall.
    let trench = Ground::from_function(65, 65, 10.0, |x, _| match x {
        0..30 => 0.0,
        30..33 => f64::INFINITY,
        _ => 100.0,
    });
    check(
        "a step behind a trench",
        &trench,
        &Camera::new([50.0, 320.0, 40.0], [640.0, 330.0, 60.0], 50.0),
        SIZE,
    );
    let nothing = Ground::from_function(9, 9, 10.0, |_, _| f64::NAN);
    let camera = Camera::new([-50.0, 20.0, 40.0], [40.0, 30.0, 0.0], 50.0);
    assert_eq!(check("nothing but voids", &nothing, &camera, SIZE).hits, 0);
    let chessboard =
        Ground::from_function(65, 65, 10.0, |x, y| if (x / 2 + y / 2) % 2 == 0 { 20.0 } else { f64::NAN });
    check(
        "a chessboard of voids",
        &chessboard,
        &Camera::new([-50.0, 20.0, 140.0], [300.0, 330.0, 0.0], 50.0),
        SIZE,
    );
}

#[test]
fn coordinates_far_from_the_origin() {
    let mut alps = alps();
    alps.origin = [6.4e6 + 0.37, -5.3e6 - 0.11];
    let shifted = |x: f64, y: f64, z: f64| [alps.origin[0] + x, alps.origin[1] + y, z];
    check(
        "6.4e6 m away",
        &alps,
        &Camera::new(shifted(640.0, -200.0, 900.0), shifted(640.0, 640.0, 200.0), 50.0),
        SIZE,
    );
    let z = alps_height(633.3, 641.2) + 0.001;
    check(
        "6.4e6 m away, a millimetre up",
        &alps,
        &Camera::new(shifted(633.3, 641.2, z), shifted(900.0, 900.0, z), 50.0),
        SIZE,
    );
}

#[test]
fn curvature() {
    let mut sea = Ground::from_function(129, 129, 2000.0, |x, y| {
        if (x / 8 + y / 8) % 2 == 0 { mountains(x as f64, y as f64, 30.0, 4000.0, 5) } else { 0.0 }
    });
    sea.bend = 0.5 / 6.371e6;
    check(
        "curvature, from a mountain",
        &sea,
        &Camera::new([20_000.0, 20_000.0, 5000.0], [2.0e5, 1.9e5, 0.0], 40.0),
        SIZE,
    );
    check(
        "curvature, from the air",
        &sea,
        &Camera::new([1.28e5, -3.0e5, 2.0e5], [1.28e5, 1.28e5, 0.0], 50.0),
        SIZE,
    );
    check(
        "curvature, from space",
        &sea,
        &Camera::new([1.28e5, -6.0e6, 8.0e6], [1.28e5, 1.28e5, -3.0e6], 2.0),
        SIZE,
    );
    let mut small = alps();
    small.bend = 0.5 / 300.0;
    check("a small planet", &small, &Camera::new([640.0, 640.0, 600.0], [900.0, 900.0, 200.0], 80.0), SIZE);
}

#[test]
fn grids_that_are_hardly_any() {
    let camera = Camera::new([-50.0, 20.0, 40.0], [40.0, 30.0, 0.0], 50.0);
    for (columns, rows) in [(1, 1), (1, 7), (7, 1)] {
        let grid = Ground::from_function(columns, rows, 10.0, |_, _| 5.0);
        assert_eq!(check("no cell", &grid, &camera, SIZE).hits, 0);
    }
    for (columns, rows) in [(2, 2), (2, 100), (100, 2), (3, 5)] {
        let grid = Ground::from_function(columns, rows, 10.0, |x, y| ((x * 3 + y * 5) % 7) as f64);
        assert!(check("few cells", &grid, &camera, SIZE).hits > 0);
    }
    check("constant", &flat(-3.25), &camera, SIZE);
}
