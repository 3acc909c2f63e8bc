//! Mouse, touch and keyboard into camera motion: a plain state machine without a browser, a clock
//! or a GPU. `web` feeds it [`Input`]s and steps it once a frame.

pub mod address;
pub mod ground;
pub mod input;
mod pinch;
pub mod pose;
pub mod resolution;

pub use ground::Ground;
pub use input::{Grip, Input, Key};

use crate::controls::input::Keys;
use glam::{DVec2, DVec3};
use pinch::Pinch;
use treeline_core::camera::GeographicCamera;
use treeline_core::geodesy;

/// The eye stays at least this far above the drawn surface, metres.
pub const CLEARANCE_METRES: f64 = 2.0;
/// Keys move the eye by this share of its height above the ground in a second.
const SPEED_PER_SECOND: f64 = 0.8;
/// The height that counts where the eye is lower, metres: walking pace does not go to nothing.
const LEAST_SPEED_HEIGHT_METRES: f64 = 25.0;
/// How much faster with [`Key::Fast`].
const FAST: f64 = 4.0;
/// Degrees a second of turning and tilting by keys.
const TURN_DEGREES_PER_SECOND: f64 = 50.0;
/// Natural logarithm of the distance a second of zooming by keys.
const ZOOM_PER_SECOND: f64 = 1.2;
/// Natural logarithm of the distance a pixel of the wheel.
const ZOOM_PER_PIXEL: f64 = 0.0022;
/// Time in which motion by keys comes to 63 % of its speed, seconds.
const KEY_RESPONSE_SECONDS: f64 = 0.12;
/// Time in which a thrown landscape loses 63 % of its speed, seconds.
const GLIDE_SECONDS: f64 = 0.3;
/// Time in which the wheel's zoom does 63 % of its way, seconds.
const ZOOM_SECONDS: f64 = 0.08;
/// Degrees that a turn across the whole height of the picture makes.
const TURN_DEGREES_PER_PICTURE: f64 = 180.0;
/// Longest step that is taken at once, seconds: after a pause the landscape does not leap.
const LONGEST_STEP_SECONDS: f64 = 0.1;
/// Motion slower than this share of the clearance a second is rest.
const REST: f64 = 2e-3;

/// Speeds that go on by themselves.
#[derive(Clone, Copy, Debug, Default)]
struct Velocity {
    /// To the right and ahead, metres a second.
    level: DVec2,
    /// Up, metres a second.
    up: f64,
    /// Clockwise, degrees a second.
    turn: f64,
    /// Upward, degrees a second.
    tilt: f64,
    /// Logarithm of the distance to the middle of the picture, a second; negative comes nearer.
    zoom: f64,
}

/// A pointer that is down.
#[derive(Clone, Copy, Debug)]
struct Pointer {
    id: i32,
    grip: Grip,
    /// CSS pixels.
    place: DVec2,
}

/// What the pointers that are down do together.
#[derive(Clone, Copy, Debug)]
enum Gesture {
    /// Holds a point of the ground (ECEF metres), or where there was only sky, nothing.
    Grab(Option<DVec3>),
    /// Turns about a point, or on the spot.
    Turn(Option<DVec3>),
    /// Two fingers.
    Pinch(Pinch),
}

/// A zoom by wheel that is under way.
#[derive(Clone, Copy, Debug)]
struct WheelZoom {
    /// Point that stays under the pointer, ECEF metres.
    target: DVec3,
    /// Logarithm of the factor that is still to do.
    remaining: f64,
}

/// The camera and all that moves it.
#[derive(Clone, Debug)]
pub struct Controls {
    camera: GeographicCamera,
    home: GeographicCamera,
    /// CSS pixels.
    size: DVec2,
    keys: Keys,
    pointers: Vec<Pointer>,
    gesture: Option<Gesture>,
    velocity: Velocity,
    /// Eye at the last step, while the ground is held: how fast it is thrown.
    drag: Option<(DVec3, DVec2)>,
    wheel: Option<WheelZoom>,
    reduced_motion: bool,
}

impl Controls {
    /// Starts at a view; [`Key::Home`] comes back to `home`. With `reduced_motion` nothing glides.
    pub fn new(camera: GeographicCamera, home: GeographicCamera, reduced_motion: bool) -> Self {
        Self {
            camera,
            home,
            size: DVec2::new(640.0, 360.0),
            keys: Keys::default(),
            pointers: Vec::new(),
            gesture: None,
            velocity: Velocity::default(),
            drag: None,
            wheel: None,
            reduced_motion,
        }
    }

    /// Where the camera is.
    pub fn camera(&self) -> GeographicCamera {
        self.camera
    }

    /// Puts the camera somewhere else; everything that moved stops.
    pub fn set_camera(&mut self, camera: GeographicCamera) {
        self.camera = camera;
        self.velocity = Velocity::default();
        self.wheel = None;
        self.gesture = None;
        self.pointers.clear();
        self.drag = None;
    }

    /// Whether the next step may move the camera, or a pointer holds it.
    pub fn is_active(&self) -> bool {
        !self.pointers.is_empty() || self.keys.move_something() || self.glides() || self.wheel.is_some()
    }

    fn glides(&self) -> bool {
        let Velocity { level, up, turn, tilt, zoom } = self.velocity;
        level != DVec2::ZERO || [up, turn, tilt, zoom].iter().any(|&speed| speed != 0.0)
    }

    /// Takes an event. Motion by pointers happens here, all other in [`Self::step`].
    pub fn input(&mut self, input: Input, ground: &dyn Ground) {
        match input {
            Input::Resize { width, height } => self.size = DVec2::new(width.max(1.0), height.max(1.0)),
            Input::Press { id, grip, x, y } => {
                self.press(Pointer { id, grip, place: DVec2::new(x, y) }, ground)
            }
            Input::Drag { id, x, y } => self.drag(id, DVec2::new(x, y), ground),
            Input::Release { id } => self.release(id, ground),
            Input::Wheel { x, y, pixels } => self.wheel(DVec2::new(x, y), pixels, ground),
            Input::KeyDown(Key::Home) => self.set_camera(self.home),
            Input::KeyDown(key) => self.keys.set(key, true),
            Input::KeyUp(key) => self.keys.set(key, false),
            Input::Blur => self.keys = Keys::default(),
        }
    }

    /// Moves on by `seconds`; gives whether the camera is another one now.
    pub fn step(&mut self, seconds: f64, ground: &dyn Ground) -> bool {
        let seconds = seconds.clamp(0.0, LONGEST_STEP_SECONDS);
        let before = self.camera;
        self.follow_keys(seconds, ground);
        self.glide(seconds, ground);
        self.zoom(seconds);
        self.measure_throw(seconds);
        self.stay_above(ground);
        self.camera != before
    }

    /// Width over height of the picture.
    fn aspect(&self) -> f64 {
        self.size.x / self.size.y
    }

    /// −1 … 1 in the picture, y up, of CSS pixels.
    fn picture_point(&self, place: DVec2) -> DVec2 {
        let unit = place / self.size;
        DVec2::new(2.0 * unit.x - 1.0, 1.0 - 2.0 * unit.y)
    }

    /// The ground under a picture point, ECEF metres.
    fn pick(&self, point: DVec2, ground: &dyn Ground) -> Option<DVec3> {
        let direction = pose::ray_direction(&self.camera, self.aspect(), point);
        ground::pick(ground, self.camera.eye_ecef(), direction)
    }

    /// Metres of the eye above the ground (above the ellipsoid where there is none).
    fn clearance(&self, ground: &dyn Ground) -> f64 {
        let surface = ground.height(self.camera.lon, self.camera.lat).unwrap_or(0.0);
        (self.camera.height - surface).max(LEAST_SPEED_HEIGHT_METRES)
    }

    fn press(&mut self, pointer: Pointer, ground: &dyn Ground) {
        self.velocity = Velocity::default();
        self.wheel = None;
        self.pointers.retain(|other| other.id != pointer.id);
        self.pointers.push(pointer);
        self.begin_gesture(ground);
    }

    /// What the pointers that are down now mean.
    fn begin_gesture(&mut self, ground: &dyn Ground) {
        self.drag = None;
        self.gesture = match self.pointers.as_slice() {
            [] => None,
            [Pointer { grip: Grip::Turn, .. }] => {
                // About what stands in the middle: what is looked at stays in the picture.
                Some(Gesture::Turn(self.pick(DVec2::ZERO, ground)))
            }
            [only] => {
                self.drag = Some((self.camera.eye_ecef(), DVec2::ZERO));
                Some(Gesture::Grab(self.pick(self.picture_point(only.place), ground)))
            }
            [first, second, ..] => {
                let centre = self.picture_point(0.5 * (first.place + second.place));
                Some(Gesture::Pinch(Pinch::new(first.place, second.place, self.pick(centre, ground))))
            }
        };
    }

    fn drag(&mut self, id: i32, place: DVec2, ground: &dyn Ground) {
        let Some(index) = self.pointers.iter().position(|pointer| pointer.id == id) else { return };
        let moved = place - self.pointers[index].place;
        self.pointers[index].place = place;
        match self.gesture {
            Some(Gesture::Grab(anchor)) => self.grab(anchor, place, moved, ground),
            Some(Gesture::Turn(pivot)) => {
                let degrees = moved * (TURN_DEGREES_PER_PICTURE / self.size.y);
                self.turn(pivot, degrees.x, -degrees.y);
            }
            Some(Gesture::Pinch(mut pinch)) if self.pointers.len() >= 2 => {
                let change = pinch.moved(self.pointers[0].place, self.pointers[1].place);
                self.gesture = Some(Gesture::Pinch(pinch));
                if let Some(anchor) = pinch.anchor {
                    self.camera = pose::zoomed(&self.camera, anchor, change.distance_factor);
                }
                let tilt = change.tilt_pixels * TURN_DEGREES_PER_PICTURE / self.size.y;
                self.turn(pinch.anchor, change.turn_degrees, tilt);
                if !pinch.tilts() {
                    self.grab(pinch.anchor, change.centre, change.centre_moved, ground);
                }
            }
            _ => {}
        }
        self.stay_above(ground);
    }

    /// Brings the held point back under the pointer.
    fn grab(&mut self, anchor: Option<DVec3>, place: DVec2, moved: DVec2, ground: &dyn Ground) {
        let point = self.picture_point(place);
        let held = anchor.and_then(|anchor| pose::grabbed(&self.camera, self.aspect(), anchor, point));
        self.camera = held.unwrap_or_else(|| {
            // The sky, or ground seen at a grazing angle: go as far as a point at such a distance would.
            let distance = anchor.map_or_else(
                || 4.0 * self.clearance(ground),
                |anchor| (anchor - self.camera.eye_ecef()).length(),
            );
            let metres = moved * (distance * self.camera.fov_y_deg.to_radians() / self.size.y);
            pose::advanced(&self.camera, -metres.x, metres.y)
        });
    }

    fn turn(&mut self, pivot: Option<DVec3>, yaw: f64, tilt: f64) {
        self.camera = match pivot {
            Some(pivot) => pose::orbited(&self.camera, pivot, yaw, tilt),
            None => pose::looked(&self.camera, yaw, tilt),
        };
    }

    fn release(&mut self, id: i32, ground: &dyn Ground) {
        let before = self.pointers.len();
        self.pointers.retain(|pointer| pointer.id != id);
        if self.pointers.len() == before {
            return;
        }
        let thrown = self.drag.take();
        if let (true, Some((_, speed)), false) = (self.pointers.is_empty(), thrown, self.reduced_motion) {
            self.velocity.level = speed;
        }
        self.begin_gesture(ground);
    }

    fn wheel(&mut self, place: DVec2, pixels: f64, ground: &dyn Ground) {
        let point = self.picture_point(place);
        let target = self.pick(point, ground).unwrap_or_else(|| {
            // Toward the sky: as if something stood a few heights away.
            let direction = pose::ray_direction(&self.camera, self.aspect(), point);
            self.camera.eye_ecef() + direction * (4.0 * self.clearance(ground))
        });
        let remaining = self.wheel.map_or(0.0, |wheel| wheel.remaining);
        // One notch is some hundred pixels; a free-wheeling one must not go through the planet at once.
        let remaining = (remaining + pixels.clamp(-600.0, 600.0) * ZOOM_PER_PIXEL).clamp(-4.0, 4.0);
        self.wheel = Some(WheelZoom { target, remaining });
    }

    /// Brings the speeds toward what the keys ask for.
    fn follow_keys(&mut self, seconds: f64, ground: &dyn Ground) {
        let keys = self.keys;
        if !keys.move_something() && !self.glides() {
            return;
        }
        let fast = if keys.has(Key::Fast) { FAST } else { 1.0 };
        let speed = self.clearance(ground) * SPEED_PER_SECOND * fast;
        let mut level =
            DVec2::new(keys.axis(Key::Right, Key::Left), keys.axis(Key::Forward, Key::Back)) * speed;
        if level.x != 0.0 && level.y != 0.0 {
            level *= std::f64::consts::FRAC_1_SQRT_2;
        }
        let response = if self.reduced_motion { 1.0 } else { 1.0 - (-seconds / KEY_RESPONSE_SECONDS).exp() };
        let glide = if self.reduced_motion { 1.0 } else { 1.0 - (-seconds / GLIDE_SECONDS).exp() };
        let velocity = &mut self.velocity;
        // Without a key the landscape glides out, whether keys or a throw set it moving.
        velocity.level += (level - velocity.level) * if level == DVec2::ZERO { glide } else { response };
        velocity.up += (keys.axis(Key::Up, Key::Down) * speed - velocity.up) * response;
        let turn = TURN_DEGREES_PER_SECOND;
        velocity.turn += (keys.axis(Key::TurnRight, Key::TurnLeft) * turn - velocity.turn) * response;
        velocity.tilt += (keys.axis(Key::TiltUp, Key::TiltDown) * turn - velocity.tilt) * response;
        let zoom = ZOOM_PER_SECOND * fast;
        velocity.zoom += (keys.axis(Key::ZoomOut, Key::ZoomIn) * zoom - velocity.zoom) * response;
        if !keys.move_something() {
            let rest = REST * speed;
            let slow = |value: f64, rest: f64| if value.abs() < rest { 0.0 } else { value };
            if velocity.level.length() < rest {
                velocity.level = DVec2::ZERO;
            }
            velocity.up = slow(velocity.up, rest);
            velocity.turn = slow(velocity.turn, 0.1);
            velocity.tilt = slow(velocity.tilt, 0.1);
            velocity.zoom = slow(velocity.zoom, 0.005);
        }
    }

    /// Moves by the speeds.
    fn glide(&mut self, seconds: f64, ground: &dyn Ground) {
        let velocity = self.velocity;
        if velocity.level != DVec2::ZERO {
            let metres = velocity.level * seconds;
            self.camera = pose::advanced(&self.camera, metres.x, metres.y);
        }
        self.camera.height = (self.camera.height + velocity.up * seconds).min(pose::GREATEST_HEIGHT_METRES);
        if velocity.turn != 0.0 || velocity.tilt != 0.0 {
            self.camera = pose::looked(&self.camera, velocity.turn * seconds, velocity.tilt * seconds);
        }
        if velocity.zoom != 0.0 {
            let factor = (velocity.zoom * seconds).exp();
            let ahead = pose::ray_direction(&self.camera, 1.0, DVec2::ZERO);
            let target = self
                .pick(DVec2::ZERO, ground)
                .unwrap_or_else(|| self.camera.eye_ecef() + ahead * (4.0 * self.clearance(ground)));
            self.camera = self.zoomed_within_bounds(target, factor);
        }
    }

    /// Does a part of the wheel's zoom.
    fn zoom(&mut self, seconds: f64) {
        let Some(wheel) = &mut self.wheel else { return };
        let share = if self.reduced_motion { 1.0 } else { 1.0 - (-seconds / ZOOM_SECONDS).exp() };
        let part = if wheel.remaining.abs() < 2e-3 { wheel.remaining } else { wheel.remaining * share };
        wheel.remaining -= part;
        let target = wheel.target;
        if wheel.remaining == 0.0 {
            self.wheel = None;
        }
        self.camera = self.zoomed_within_bounds(target, part.exp());
    }

    /// Zooms, but neither into the target nor out of sight of the Earth.
    fn zoomed_within_bounds(&self, target: DVec3, factor: f64) -> GeographicCamera {
        let distance = (target - self.camera.eye_ecef()).length();
        if factor < 1.0 && distance * factor < CLEARANCE_METRES {
            return self.camera;
        }
        let zoomed = pose::zoomed(&self.camera, target, factor);
        if factor > 1.0 && zoomed.height >= pose::GREATEST_HEIGHT_METRES { self.camera } else { zoomed }
    }

    /// While the ground is held: how fast it goes, for when it is let go.
    fn measure_throw(&mut self, seconds: f64) {
        let Some((last_eye, speed)) = &mut self.drag else { return };
        if seconds <= 0.0 {
            return;
        }
        let eye = self.camera.eye_ecef();
        let view = pose::ecef_from_view(&self.camera);
        let up = geodesy::ecef_from_enu(self.camera.lon, self.camera.lat).z_axis;
        let ahead = up.cross(view.x_axis);
        let moved = eye - *last_eye;
        let now = DVec2::new(moved.dot(view.x_axis), moved.dot(ahead)) / seconds;
        *speed = speed.lerp(now, 1.0 - (-seconds / 0.05).exp());
        *last_eye = eye;
    }

    /// Lifts the eye out of the ground.
    fn stay_above(&mut self, ground: &dyn Ground) {
        if let Some(surface) = ground.height(self.camera.lon, self.camera.lat) {
            self.camera.height = self.camera.height.max(surface + CLEARANCE_METRES);
        }
    }
}

#[cfg(test)]
mod tests;
