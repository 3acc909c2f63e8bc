//! A height field in a plane and a camera beside it, made ready for the `height_field` pass or its twin.
//!
//! Row 0 of the grid is north: sample (row r, column c) stands at x = X + c·cell, y = Y + (rows − 1 − r)·cell, z up.
//! The surface is the bilinear patch of every cell with four finite corners. All that needs digits is done here in
//! f64: heights are handed on relative to the eye, the eye's cell apart from its fraction, and the rays of
//! a far eye start on a plane just before the field.

use crate::layout::{EMPTY, Leaf, LeafPlace, Sheet, VOID_HEIGHT, View, cell_and_fraction};
use crate::twin::maximum_mip::Pyramid;
use crate::twin::{Texels, World, height_field};
use glam::{DVec3, UVec2};
use treeline_core::ray_frame::{Quadratic, RayFrame};

/// Greatest height that is taken for one, metres; beyond it stand forgotten nodata values.
pub const GREATEST_HEIGHT: f64 = 1.0e9;

/// What is wrong with a height field or its camera, in one line with the mend.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputError(String);

impl std::fmt::Display for InputError {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl std::error::Error for InputError {}

fn refuse<T>(text: String) -> Result<T, InputError> {
    Err(InputError(text))
}

/// Samples of a grid, row-major from the north-west.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
}

impl Samples {
    fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
        }
    }

    fn at(&self, index: usize) -> f64 {
        match self {
            Self::F32(values) => f64::from(values[index]),
            Self::F64(values) => values[index],
        }
    }
}

/// A grid of heights, metres. Not finite: no data.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    columns: u32,
    rows: u32,
    samples: Samples,
    cell: f64,
    origin: [f64; 2],
    range: Option<(f64, f64)>,
}

impl HeightField {
    /// A grid of `columns` × `rows` samples, `cell` metres apart, whose south-west sample stands at `origin`.
    ///
    /// # Errors
    /// Where the numbers make no grid, or a finite sample is no height.
    pub fn new(
        columns: u32,
        rows: u32,
        samples: Samples,
        cell: f64,
        origin: [f64; 2],
    ) -> Result<Self, InputError> {
        if columns == 0 || rows == 0 || samples.len() != columns as usize * rows as usize {
            return refuse(format!(
                "height field: {rows} × {columns} samples were promised, {} are there; give a 2-D array with at least one",
                samples.len()
            ));
        }
        if !(cell.is_finite() && cell > 0.0) {
            return refuse(format!("cell size: {cell} is not a length; give metres, more than 0"));
        }
        if !origin.iter().all(|value| value.is_finite()) {
            return refuse(format!(
                "origin: {},{} is not a place; give two finite numbers",
                origin[0], origin[1]
            ));
        }
        let mut range: Option<(f64, f64)> = None;
        for index in 0..samples.len() {
            let value = samples.at(index);
            if !value.is_finite() {
                continue;
            }
            if value.abs() > GREATEST_HEIGHT {
                let (row, column) = (index / columns as usize, index % columns as usize);
                return refuse(format!(
                    "height field: the sample in row {row}, column {column} is {value} m; if that means no data, make it NaN"
                ));
            }
            range = Some(
                range.map_or((value, value), |(least, greatest)| (least.min(value), greatest.max(value))),
            );
        }
        Ok(Self { columns, rows, samples, cell, origin, range })
    }

    /// Columns and rows of samples.
    pub fn size(&self) -> [u32; 2] {
        [self.columns, self.rows]
    }

    /// Distance between samples, metres.
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// Place of the south-west sample.
    pub fn origin(&self) -> [f64; 2] {
        self.origin
    }

    /// Height of a sample, metres; not finite: no data.
    pub fn height(&self, column: u32, row: u32) -> f64 {
        self.samples.at(row as usize * self.columns as usize + column as usize)
    }

    /// Columns from the west and rows from the north of a place.
    fn grid_place(&self, x: f64, y: f64) -> (f64, f64) {
        let north = self.origin[1] + f64::from(self.rows - 1) * self.cell;
        ((x - self.origin[0]) / self.cell, (north - y) / self.cell)
    }
}

/// A camera over a height field: `camera.json`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneCamera {
    /// Where the eye is, metres.
    pub eye: DVec3,
    /// Where it looks.
    pub target: DVec3,
    /// What is up in the picture. Along the view (or zero), north is, and where one looks north, the zenith.
    pub up: DVec3,
    /// Vertical field of view, degrees.
    pub fov_y_degrees: f64,
}

/// A camera's rays: through the place (x, y) of the picture, −1…1 right and up, goes forward + x·right + y·up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneRays {
    /// Where they start.
    pub eye: DVec3,
    /// Unit vector along the view.
    pub forward: DVec3,
    /// Half the picture's width at unit distance.
    pub right: DVec3,
    /// Half the picture's height at unit distance.
    pub up: DVec3,
}

impl PlaneRays {
    /// The rays of a camera, for a picture of so many pixels.
    ///
    /// # Errors
    /// Where the camera looks nowhere; the text names the field.
    pub fn new(camera: &PlaneCamera, size: [u32; 2]) -> Result<Self, InputError> {
        let vectors = [("eye", camera.eye), ("target", camera.target), ("up", camera.up)];
        for (name, vector) in vectors {
            if !vector.is_finite() {
                return refuse(format!("camera: {name} is {vector}; give three finite numbers"));
            }
        }
        if !(camera.fov_y_degrees > 0.0 && camera.fov_y_degrees < 180.0) {
            return refuse(format!(
                "camera: fov_y_deg is {}; it must lie between 0 and 180",
                camera.fov_y_degrees
            ));
        }
        if size.contains(&0) {
            return refuse(format!("size: a picture of {} × {} pixels is empty", size[0], size[1]));
        }
        let Some(forward) = (camera.target - camera.eye).try_normalize() else {
            return refuse("camera: eye and target are the same place; move one of them".to_owned());
        };
        let right = [camera.up.normalize_or_zero(), DVec3::Y, DVec3::Z]
            .into_iter()
            .map(|up| forward.cross(up))
            .find(|right| right.length() > 1e-9)
            .unwrap_or(DVec3::X)
            .normalize();
        let half_height = (0.5 * camera.fov_y_degrees.to_radians()).tan();
        let half_width = half_height * f64::from(size[0]) / f64::from(size[1]);
        Ok(Self {
            eye: camera.eye,
            forward,
            right: right * half_width,
            up: right.cross(forward) * half_height,
        })
    }

    /// Direction through a place of the picture; its part along the view is 1.
    pub fn direction(&self, place: [f64; 2]) -> DVec3 {
        self.forward + place[0] * self.right + place[1] * self.up
    }
}

/// A height field and a camera, ready for the GPU or the twin.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// Group 0, binding 0.
    pub view: View,
    /// The one leaf.
    pub leaf: Leaf,
    /// Group 0, binding 10.
    pub sheet: Sheet,
    /// Columns and rows of `heights`.
    pub size: [u32; 2],
    /// Heights as the pass sees them: metres above a reference near the eye, voids at [`VOID_HEIGHT`].
    pub heights: Vec<f32>,
    /// Their greatest over each node's cells.
    pub maxima: Pyramid,
    /// Their least.
    pub minima: Pyramid,
    rays: PlaneRays,
    base: f64,
    picture: [u32; 2],
}

impl Prepared {
    /// Makes ready; `None` where no ray can meet anything: there is no cell, or all lies behind the eye.
    ///
    /// With `earth_radius` (metres) the surface at the horizontal distance d from the eye lies d²/2R lower.
    ///
    /// # Errors
    /// Where the camera or the radius makes no sense; the text names it.
    pub fn new(
        field: &HeightField,
        camera: &PlaneCamera,
        picture: [u32; 2],
        earth_radius: Option<f64>,
    ) -> Result<Option<Self>, InputError> {
        let rays = PlaneRays::new(camera, picture)?;
        if let Some(radius) = earth_radius
            && !(radius.is_finite() && radius > 0.0)
        {
            return refuse(format!("earth radius: {radius} is not a length; give metres, more than 0"));
        }
        let Some((least, greatest)) = field.range.filter(|_| field.columns > 1 && field.rows > 1) else {
            return Ok(None);
        };
        let bend = earth_radius.map_or(0.0, |radius| 0.5 / radius);
        let (nearest, farthest) = depths(field, &rays, (least, greatest), bend);
        if farthest <= 0.0 {
            return Ok(None);
        }
        // A far eye's rays start on a plane before the field: no digits are spent on the way there.
        let base = if nearest > 0.5 * (farthest - nearest) { nearest * (1.0 - 1e-9) } else { 0.0 };
        let reference = rays.eye.z.clamp(least, greatest);
        let heights: Vec<f32> = (0..field.samples.len())
            .map(|index| {
                let height = field.samples.at(index);
                if height.is_finite() { (height - reference) as f32 } else { VOID_HEIGHT }
            })
            .collect();
        let [columns, rows] = field.size();
        let maxima = Pyramid::new(&heights, columns, rows, 0, false);
        let minima = Pyramid::new(&heights, columns, rows, 0, true);
        let ceiling = maxima.mips.last().map_or(VOID_HEIGHT, |(_, _, texels)| texels[0]);
        if ceiling <= VOID_HEIGHT {
            return Ok(None);
        }

        let start = rays.eye + base * rays.forward;
        let (u, v) = field.grid_place(start.x, start.y);
        let (ahead_x, ahead_y) = (base * rays.forward.x, base * rays.forward.y);
        let quadratic = |constant: f64, gradient: DVec3| Quadratic { constant, gradient, second: [0.0; 6] };
        let height_at_start = start.z - reference + bend * (ahead_x * ahead_x + ahead_y * ahead_y);
        let frame = RayFrame {
            u: quadratic(u, DVec3::new(1.0 / field.cell, 0.0, 0.0)),
            v: quadratic(v, DVec3::new(0.0, -1.0 / field.cell, 0.0)),
            h: Quadratic {
                second: [bend, bend, 0.0, 0.0, 0.0, 0.0],
                ..quadratic(height_at_start, DVec3::new(2.0 * bend * ahead_x, 2.0 * bend * ahead_y, 1.0))
            },
            distance_range: [0.0, (farthest - base) * (1.0 + 1e-6)],
        };
        let leaf = Leaf::from_frame(
            &frame,
            &LeafPlace {
                first_cell: [0, 0],
                cells: [columns - 1, rows - 1],
                grid_origin: [0, 0],
                grid_side: 1,
                slot: 0,
                level: 0,
                stand_in: EMPTY,
                maximum: ceiling,
                fade: 1.0,
                cell_metres: [field.cell as f32; 2],
            },
        );
        let vector = |v: DVec3| [v.x as f32, v.y as f32, v.z as f32, 0.0];
        let view = View {
            right: vector(rays.right),
            up: vector(rays.up),
            forward: vector(rays.forward),
            size: picture,
            root_size: [1, 1],
            ..View::default()
        };
        let patch = if base == 0.0 { eye_patch(field, rays.eye) } else { None };
        let sheet = Sheet {
            eye_patch: patch.unwrap_or_default().map(|value| value as f32),
            base: base as f32,
            eye_patch_known: u32::from(patch.is_some()),
            padding: [0; 2],
        };
        Ok(Some(Self {
            view,
            leaf,
            sheet,
            size: [columns, rows],
            heights,
            maxima,
            minima,
            rays,
            base,
            picture,
        }))
    }

    /// Distance in metres from the eye along the ray through a pixel's centre, from the parameter that the pass found;
    /// +∞ for a miss.
    pub fn distance(&self, column: u32, row: u32, parameter: f32) -> f32 {
        if parameter < 0.0 {
            return f32::INFINITY;
        }
        let place = |index: u32, count: u32| (f64::from(index) + 0.5) * 2.0 / f64::from(count) - 1.0;
        let across = [place(column, self.picture[0]), -place(row, self.picture[1])];
        ((self.base + f64::from(parameter)) * self.rays.direction(across).length()) as f32
    }

    /// The pixel's answer by the twin: distance in metres (+∞ for a miss), and fetches.
    pub fn by_twin(&self, column: u32, row: u32) -> (f32, u32) {
        let world = World {
            view: &self.view,
            nodes: &[],
            leaves: std::slice::from_ref(&self.leaf),
            texels: self,
            sheet: Some(&self.sheet),
            use_minima: true,
        };
        let hit = height_field::height_field(&world, UVec2::new(column, row));
        (self.distance(column, row, hit.parameter), hit.fetches)
    }
}

impl Texels for Prepared {
    fn height(&self, _slot: u32, x: i32, y: i32) -> f32 {
        self.heights[(y as u32 * self.size[0] + x as u32) as usize]
    }

    fn maximum(&self, _slot: u32, mip: u32, x: i32, y: i32) -> f32 {
        self.maxima.at(mip, x, y)
    }

    fn minimum(&self, _slot: u32, mip: u32, x: i32, y: i32) -> f32 {
        self.minima.at(mip, x, y)
    }

    fn levels(&self) -> u32 {
        self.maxima.mips.len() as u32
    }
}

/// Least and greatest depth along the view of the box round the surface, curvature included.
fn depths(field: &HeightField, rays: &PlaneRays, heights: (f64, f64), bend: f64) -> (f64, f64) {
    let [width, height] = [field.columns - 1, field.rows - 1].map(|cells| f64::from(cells) * field.cell);
    let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]
        .map(|(x, y)| DVec3::new(field.origin[0] + x, field.origin[1] + y, 0.0) - rays.eye);
    let farthest_square = corners.iter().map(|c| c.x * c.x + c.y * c.y).fold(0.0, f64::max);
    let lowest = heights.0 - bend * farthest_square;
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    for corner in corners {
        for height in [lowest, heights.1] {
            let depth = (corner + DVec3::Z * height).dot(rays.forward);
            range = (range.0.min(depth), range.1.max(depth));
        }
    }
    range
}

/// The patch under the eye, about the eye: clearance, slopes a cell along u and v, twist. `None` where there is none.
fn eye_patch(field: &HeightField, eye: DVec3) -> Option<[f64; 4]> {
    let (u, v) = field.grid_place(eye.x, eye.y);
    let cells = [field.columns - 1, field.rows - 1];
    if !((0.0..=f64::from(cells[0])).contains(&u) && (0.0..=f64::from(cells[1])).contains(&v)) {
        return None;
    }
    // The cell that the pass finds, too.
    let column = (cell_and_fraction(u).0 as u32).min(cells[0] - 1);
    let row = (cell_and_fraction(v).0 as u32).min(cells[1] - 1);
    let (a, b) = (u - f64::from(column), v - f64::from(row));
    let node = |x: u32, y: u32| field.height(column + x, row + y);
    let [north_west, north_east, south_west, south_east] = [node(0, 0), node(1, 0), node(0, 1), node(1, 1)];
    let (along_u, along_v) = (north_east - north_west, south_west - north_west);
    let twist = south_east - south_west - along_u;
    let height = north_west + along_u * a + along_v * b + twist * a * b;
    height.is_finite().then_some([eye.z - height, along_u + twist * b, along_v + twist * a, twist])
}
