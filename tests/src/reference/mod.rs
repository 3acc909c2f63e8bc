//! What a picture of a height field must show, worked out in f64 without any of the code under test:
//! [`exact`] goes from cell to cell and solves each patch, [`marching`] goes by brute force and judges
//! [`exact`], and [`measure`] says how far a picture is from the truth, in pixels.

pub mod exact;
pub mod marching;
pub mod measure;

use glam::{DVec2, DVec3};

/// A height field as the reference sees it: a function of the sample indices.
#[derive(Clone, Debug)]
pub struct Ground {
    /// Samples a row.
    pub columns: usize,
    /// Rows of samples, from the north.
    pub rows: usize,
    /// Row-major heights, metres; not finite: no data.
    pub heights: Vec<f64>,
    /// Distance between samples, metres.
    pub cell: f64,
    /// Place of the south-west sample.
    pub origin: [f64; 2],
    /// 1/2R: by how much of the squared horizontal distance from the eye the surface lies lower.
    pub bend: f64,
}

impl Ground {
    /// A flat ground from a function of column and row.
    pub fn from_function(
        columns: usize,
        rows: usize,
        cell: f64,
        height: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let heights = (0..columns * rows).map(|index| height(index % columns, index / columns)).collect();
        Self { columns, rows, heights, cell, origin: [0.0, 0.0], bend: 0.0 }
    }

    /// Columns from the west and rows from the north of a place.
    pub fn grid_place(&self, x: f64, y: f64) -> DVec2 {
        let north = self.origin[1] + (self.rows - 1) as f64 * self.cell;
        DVec2::new((x - self.origin[0]) / self.cell, (north - y) / self.cell)
    }

    /// Place of a sample.
    pub fn place_of(&self, column: f64, row: f64) -> DVec2 {
        DVec2::new(
            self.origin[0] + column * self.cell,
            self.origin[1] + ((self.rows - 1) as f64 - row) * self.cell,
        )
    }

    /// Corners of a cell (north-west, north-east, south-west, south-east), `None` where one is void.
    pub fn patch(&self, column: usize, row: usize) -> Option<[f64; 4]> {
        let at = |x: usize, y: usize| self.heights[(row + y) * self.columns + column + x];
        let corners = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
        corners.iter().all(|height| height.is_finite()).then_some(corners)
    }

    /// Height of the surface at a place, before it bends away; `None` where there is none.
    pub fn height(&self, x: f64, y: f64) -> Option<f64> {
        let place = self.grid_place(x, y);
        let last = DVec2::new(self.columns as f64 - 1.0, self.rows as f64 - 1.0);
        if self.columns < 2 || self.rows < 2 || place.cmplt(DVec2::ZERO).any() || place.cmpgt(last).any() {
            return None;
        }
        let column = (place.x as usize).min(self.columns - 2);
        let row = (place.y as usize).min(self.rows - 2);
        let [nw, ne, sw, se] = self.patch(column, row)?;
        let (a, b) = (place.x - column as f64, place.y - row as f64);
        Some((1.0 - b) * ((1.0 - a) * nw + a * ne) + b * ((1.0 - a) * sw + a * se))
    }
}

/// A camera of `camera.json`.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Metres.
    pub eye: DVec3,
    /// Where it looks.
    pub target: DVec3,
    /// Up in the picture.
    pub up: DVec3,
    /// Vertical field of view, degrees.
    pub fov_y_degrees: f64,
}

impl Camera {
    /// Looks from one place to another.
    pub fn new(eye: [f64; 3], target: [f64; 3], fov_y_degrees: f64) -> Self {
        Self { eye: eye.into(), target: target.into(), up: DVec3::Z, fov_y_degrees }
    }

    /// The same camera with another direction upward.
    pub fn with_up(self, up: [f64; 3]) -> Self {
        Self { up: up.into(), ..self }
    }

    /// Unit direction of the ray through a place of the picture, in pixels from its north-west corner.
    pub fn direction(&self, size: [u32; 2], pixel: DVec2) -> DVec3 {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        let up = right.cross(forward);
        let half = (0.5 * self.fov_y_degrees.to_radians()).tan();
        let [width, height] = size.map(f64::from);
        let x = (2.0 * pixel.x / width - 1.0) * half * width / height;
        let y = (1.0 - 2.0 * pixel.y / height) * half;
        (forward + x * right + y * up).normalize()
    }

    /// Angle of a pixel, radians.
    pub fn pixel_angle(&self, size: [u32; 2]) -> f64 {
        self.fov_y_degrees.to_radians() / f64::from(size[1])
    }
}
