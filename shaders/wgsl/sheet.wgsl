// A height field is a sheet: hit from either side, with holes where there is no data, without walls.

const SOLID: bool = false;
const BORDER: i32 = 0;

@group(0) @binding(10) var<uniform> sheet: Sheet;

fn eye_patch_known() -> bool {
    return sheet.eye_patch_known == 1u;
}

// As `ray_minus_patch`, for the eye's own cell and from the eye, with coefficients from the CPU.
fn ray_minus_eye_patch(slope: vec2<f32>, rise: f32, curvature: f32) -> vec3<f32> {
    let p = sheet.eye_patch;
    return vec3<f32>(
        p.x,
        rise - (p.y * slope.x + p.z * slope.y),
        curvature - p.w * slope.x * slope.y,
    );
}
