// Places in metres from the eye, east-north-up at the eye, without cancellation: only differences from the eye are
// ever worked with. WGSL's own sine may be 2^-11 off. Twin: `twin/load_map_place.rs`.

const HALF_TURN: f32 = 3.14159265;
const QUARTER_TURN: f32 = 1.57079633;
// WGS84: semi-major axis in metres, first eccentricity squared.
const SEMI_MAJOR: f32 = 6378137.0;
const ECCENTRICITY_SQUARED: f32 = 0.00669437999;

// Sine of −π…π, right to 2e-7.
fn sine(angle: f32) -> f32 {
    var x = angle;
    if x > QUARTER_TURN {
        x = HALF_TURN - x;
    } else if x < -QUARTER_TURN {
        x = -HALF_TURN - x;
    }
    let y = x * x;
    let tail = y * ((1.0 / 362880.0) - (y * (1.0 / 39916800.0)));
    return x - (x * y * ((1.0 / 6.0) - (y * ((1.0 / 120.0) - (y * ((1.0 / 5040.0) - tail))))));
}

// From the eye (sine and cosine of its latitude, height in metres, prime vertical radius) to a place so many radians
// farther east and north, at a height in metres.
fn enu_from_place(eye: vec4<f32>, east: f32, north: f32, height: f32) -> vec3<f32> {
    let sine_eye = eye.x;
    let cosine_eye = eye.y;
    let normal_eye = eye.w;
    let rise = height - eye.z;
    // Latitude: half the difference, and the middle.
    let half_sine = sine(0.5 * north);
    let quarter_sine = sine(0.25 * north);
    let half_cosine = 1.0 - (2.0 * quarter_sine * quarter_sine);
    let sine_change = 2.0 * half_sine * ((cosine_eye * half_cosine) - (sine_eye * half_sine));
    let cosine_change = -2.0 * half_sine * ((sine_eye * half_cosine) + (cosine_eye * half_sine));
    let sine_there = sine_eye + sine_change;
    // Prime vertical radius.
    let there = sqrt(1.0 - (ECCENTRICITY_SQUARED * sine_there * sine_there));
    let here = sqrt(1.0 - (ECCENTRICITY_SQUARED * sine_eye * sine_eye));
    let square_change = sine_change * (sine_eye + sine_there);
    let normal_change = SEMI_MAJOR * ECCENTRICITY_SQUARED * square_change / (there * here * (there + here));
    let normal_there = normal_eye + normal_change;
    let flat = 1.0 - ECCENTRICITY_SQUARED;
    let axis_change = ((normal_there + height) * cosine_change) + (cosine_eye * (normal_change + rise));
    let polar_change = (((normal_there * flat) + height) * sine_change) + (sine_eye * ((normal_change * flat) + rise));
    // Longitude.
    let turn = east - (2.0 * HALF_TURN * round(east / (2.0 * HALF_TURN)));
    let axis = ((normal_eye + eye.z) * cosine_eye) + axis_change;
    let half_turn = sine(0.5 * turn);
    let outward = axis_change - (2.0 * axis * half_turn * half_turn);
    return vec3<f32>(
        axis * sine(turn),
        (cosine_eye * polar_change) - (sine_eye * outward),
        (cosine_eye * outward) + (sine_eye * polar_change),
    );
}
