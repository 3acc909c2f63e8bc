// A scene's ground is solid: where a void or the edge of the data lays its side open, there is a wall.

const SOLID: bool = true;
// Samples of the height arrays beyond the tile on each side.
const BORDER: i32 = 1;

fn eye_patch_known() -> bool {
    return false;
}

fn ray_minus_eye_patch(slope: vec2<f32>, rise: f32, curvature: f32) -> vec3<f32> {
    return vec3<f32>(0.0, rise, curvature);
}
