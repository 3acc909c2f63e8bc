//! The state machine as a whole, over a plain.

use super::ground::tests::Plain;
use super::*;

const GROUND: Plain = Plain(1000.0);

fn start() -> GeographicCamera {
    GeographicCamera {
        lon: 8.0,
        lat: 46.5,
        height: 4000.0,
        heading_deg: 0.0,
        pitch_deg: -35.0,
        fov_y_deg: 50.0,
    }
}

fn controls() -> Controls {
    let mut controls = Controls::new(start(), start(), false);
    controls.input(Input::Resize { width: 600.0, height: 400.0 }, &GROUND);
    controls
}

fn run(controls: &mut Controls, seconds: f64) {
    for _ in 0..(seconds * 60.0) as usize {
        controls.step(1.0 / 60.0, &GROUND);
    }
}

#[test]
fn nothing_moves_by_itself() {
    let mut controls = controls();
    assert!(!controls.is_active());
    assert!(!controls.step(0.016, &GROUND));
    assert_eq!(controls.camera(), start());
}

#[test]
fn a_key_flies_ahead_and_comes_to_rest() {
    let mut controls = controls();
    controls.input(Input::KeyDown(Key::Forward), &GROUND);
    run(&mut controls, 1.0);
    let held = controls.camera();
    assert!(held.lat > start().lat + 0.01 && (held.lon - 8.0).abs() < 1e-9, "{held:?}");
    assert_eq!(held.height, start().height);
    controls.input(Input::KeyUp(Key::Forward), &GROUND);
    run(&mut controls, 4.0);
    assert!(!controls.is_active(), "{controls:?}");
    let rest = controls.camera();
    assert!(rest.lat > held.lat, "it glides out");
    run(&mut controls, 1.0);
    assert_eq!(controls.camera(), rest);
}

#[test]
fn the_same_way_at_any_frame_rate() {
    let mut fine = controls();
    let mut coarse = controls();
    for controls in [&mut fine, &mut coarse] {
        controls.input(Input::KeyDown(Key::Forward), &GROUND);
    }
    for _ in 0..240 {
        fine.step(1.0 / 120.0, &GROUND);
    }
    for _ in 0..40 {
        coarse.step(1.0 / 20.0, &GROUND);
    }
    let (fine, coarse) = (fine.camera().lat - start().lat, coarse.camera().lat - start().lat);
    assert!((fine / coarse - 1.0).abs() < 0.05, "{fine} {coarse}");
}

#[test]
fn keys_that_were_down_when_the_page_lost_them_are_up() {
    let mut controls = controls();
    controls.input(Input::KeyDown(Key::TurnRight), &GROUND);
    controls.input(Input::Blur, &GROUND);
    run(&mut controls, 2.0);
    assert!(!controls.is_active());
}

#[test]
fn a_drag_takes_the_ground_along_and_a_throw_glides() {
    let mut controls = controls();
    controls.input(Input::Press { id: 1, grip: Grip::Ground, x: 300.0, y: 250.0 }, &GROUND);
    let held = controls.pick(controls.picture_point(DVec2::new(300.0, 250.0)), &GROUND).unwrap();
    for step in 1..=12 {
        controls.input(Input::Drag { id: 1, x: 300.0, y: 250.0 + 8.0 * f64::from(step) }, &GROUND);
        controls.step(1.0 / 60.0, &GROUND);
    }
    let under = controls.pick(controls.picture_point(DVec2::new(300.0, 346.0)), &GROUND).unwrap();
    assert!((under - held).length() < 10.0, "{}", (under - held).length());
    assert!(controls.camera().lat > start().lat, "ground pulled toward one is a flight ahead");
    controls.input(Input::Release { id: 1 }, &GROUND);
    let released = controls.camera();
    run(&mut controls, 5.0);
    assert!(controls.camera().lat > released.lat && !controls.is_active());
}

#[test]
fn reduced_motion_does_not_glide() {
    let mut controls = Controls::new(start(), start(), true);
    controls.input(Input::Press { id: 1, grip: Grip::Ground, x: 300.0, y: 200.0 }, &GROUND);
    controls.input(Input::Drag { id: 1, x: 300.0, y: 260.0 }, &GROUND);
    controls.step(0.016, &GROUND);
    controls.input(Input::Release { id: 1 }, &GROUND);
    assert!(!controls.is_active());
}

#[test]
fn a_right_drag_turns_about_what_is_looked_at() {
    let mut controls = controls();
    let middle = controls.pick(DVec2::ZERO, &GROUND).unwrap();
    controls.input(Input::Press { id: 1, grip: Grip::Turn, x: 300.0, y: 200.0 }, &GROUND);
    controls.input(Input::Drag { id: 1, x: 400.0, y: 220.0 }, &GROUND);
    let camera = controls.camera();
    assert!((camera.heading_deg - 45.0).abs() < 0.1 && (camera.pitch_deg + 44.0).abs() < 0.1, "{camera:?}");
    let now = controls.pick(DVec2::ZERO, &GROUND).unwrap();
    assert!((now - middle).length() < 20.0, "{}", (now - middle).length());
}

#[test]
fn the_wheel_comes_nearer_to_what_is_under_the_pointer() {
    let mut controls = controls();
    let place = DVec2::new(450.0, 300.0);
    let target = controls.pick(controls.picture_point(place), &GROUND).unwrap();
    let distance = (target - controls.camera().eye_ecef()).length();
    controls.input(Input::Wheel { x: 450.0, y: 300.0, pixels: -300.0 }, &GROUND);
    run(&mut controls, 2.0);
    assert!(!controls.is_active());
    let near = (target - controls.camera().eye_ecef()).length();
    assert!((near / distance - (-0.66_f64).exp()).abs() < 0.01, "{near} of {distance}");
    let under = controls.pick(controls.picture_point(place), &GROUND).unwrap();
    assert!((under - target).length() < 0.01 * near, "{}", (under - target).length());
}

#[test]
fn never_under_the_ground() {
    let mut controls = controls();
    controls.input(Input::KeyDown(Key::Down), &GROUND);
    controls.input(Input::KeyDown(Key::Fast), &GROUND);
    run(&mut controls, 20.0);
    assert_eq!(controls.camera().height, 1000.0 + CLEARANCE_METRES);
    // A view from an address that is under it.
    controls.input(Input::Blur, &GROUND);
    controls.set_camera(GeographicCamera { height: -500.0, ..start() });
    controls.step(0.0, &GROUND);
    assert_eq!(controls.camera().height, 1000.0 + CLEARANCE_METRES);
}

#[test]
fn out_into_space_and_home() {
    let mut controls = controls();
    controls.input(Input::KeyDown(Key::ZoomOut), &GROUND);
    run(&mut controls, 60.0);
    let far = controls.camera();
    assert!(far.height <= pose::GREATEST_HEIGHT_METRES && far.height > 1.0e6, "{far:?}");
    assert!(far.check().is_ok());
    controls.input(Input::Blur, &GROUND);
    controls.input(Input::KeyDown(Key::Home), &GROUND);
    assert_eq!(controls.camera(), start());
}

#[test]
fn two_fingers_zoom_and_one_that_stays_holds_the_ground() {
    let mut controls = controls();
    controls.input(Input::Press { id: 1, grip: Grip::Finger, x: 250.0, y: 200.0 }, &GROUND);
    controls.input(Input::Press { id: 2, grip: Grip::Finger, x: 350.0, y: 200.0 }, &GROUND);
    for step in 1..=10 {
        let apart = 5.0 * f64::from(step);
        controls.input(Input::Drag { id: 1, x: 250.0 - apart, y: 200.0 }, &GROUND);
        controls.input(Input::Drag { id: 2, x: 350.0 + apart, y: 200.0 }, &GROUND);
    }
    let near = controls.camera();
    assert!(near.height < 3000.0, "{near:?}");
    controls.input(Input::Release { id: 1 }, &GROUND);
    assert!(controls.is_active());
    controls.input(Input::Drag { id: 2, x: 400.0, y: 260.0 }, &GROUND);
    assert!(controls.camera().lat > near.lat);
    controls.input(Input::Release { id: 2 }, &GROUND);
    controls.input(Input::Release { id: 2 }, &GROUND);
}
