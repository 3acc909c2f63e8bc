//! Where pixels stand in the file's reference system.

use super::bytes::FileBytes;
use super::directory::{Directory, tag};
use super::geokeys::GeoKeys;
use super::layout::Refusal;
use std::path::Path;

/// An affine transform `crs_from_pixel`: pixel coordinates have whole numbers on pixel corners,
/// (0, 0) the outer corner of the first pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// x = x.0 + x.1·column + x.2·row.
    pub x: (f64, f64, f64),
    /// y = y.0 + y.1·column + y.2·row.
    pub y: (f64, f64, f64),
}

impl Affine {
    /// Place in the reference system of a pixel coordinate.
    pub fn apply(&self, column: f64, row: f64) -> (f64, f64) {
        (self.x.0 + self.x.1 * column + self.x.2 * row, self.y.0 + self.y.1 * column + self.y.2 * row)
    }

    fn determinant(&self) -> f64 {
        self.x.1 * self.y.2 - self.x.2 * self.y.1
    }

    /// The transform `pixel_from_crs`.
    pub fn inverse(&self) -> Self {
        let scale = 1.0 / self.determinant();
        let (a, b, c, d) = (self.y.2 * scale, -self.x.2 * scale, -self.y.1 * scale, self.x.1 * scale);
        Self { x: (-(a * self.x.0 + b * self.y.0), a, b), y: (-(c * self.x.0 + d * self.y.0), c, d) }
    }

    /// Whether rows and columns run along the axes.
    pub fn is_axis_aligned(&self) -> bool {
        self.x.2 == 0.0 && self.y.1 == 0.0
    }

    /// Width and height of a pixel in the system's units.
    pub fn pixel_size(&self) -> (f64, f64) {
        (self.x.1.hypot(self.y.1), self.x.2.hypot(self.y.2))
    }

    fn is_usable(&self) -> bool {
        let all = [self.x.0, self.x.1, self.x.2, self.y.0, self.y.1, self.y.2];
        all.iter().all(|value| value.is_finite()) && self.determinant() != 0.0
    }
}

/// The transform of a file: from its tags, else from a world file beside it.
///
/// # Errors
/// Where there is none, or it is degenerate.
pub fn read(
    path: &Path,
    bytes: &FileBytes,
    directory: &Directory,
    keys: &GeoKeys,
) -> Result<Affine, Refusal> {
    let degenerate = || {
        Refusal::new(
            "its georeference is degenerate (a pixel has no area)",
            "gdal_edit.py -a_ullr WEST NORTH EAST SOUTH FILE",
        )
    };
    let found = from_tags(bytes, directory, keys).or_else(|| from_world_file(path));
    if let Some(affine) = found {
        return if affine.is_usable() { Ok(affine) } else { Err(degenerate()) };
    }
    let points = directory.real_values(bytes, tag::MODEL_TIEPOINT).map_or(0, |values| values.len() / 6);
    if points > 1 {
        return Err(Refusal::new(
            format!("it is placed by {points} ground control points only"),
            "gdalwarp -t_srs EPSG:4326 FILE warped.tif",
        ));
    }
    Err(Refusal::new(
        "it has no georeference",
        "gdal_translate -a_srs EPSG:N -a_ullr WEST NORTH EAST SOUTH FILE placed.tif",
    ))
}

fn from_tags(bytes: &FileBytes, directory: &Directory, keys: &GeoKeys) -> Option<Affine> {
    // The tie point of a point raster is the middle of its pixel.
    let shift = if keys.pixel_is_point() { 0.5 } else { 0.0 };
    let shifted = |mut affine: Affine| {
        (affine.x.0, affine.y.0) = affine.apply(-shift, -shift);
        affine
    };
    let scale = directory.real_values(bytes, tag::MODEL_PIXEL_SCALE).filter(|scale| scale.len() >= 2);
    let points = directory.real_values(bytes, tag::MODEL_TIEPOINT).unwrap_or_default();
    if let (Some(scale), [column, row, _, x, y, ..]) = (scale, points.as_slice()) {
        let across = (scale[0], 0.0);
        // Some writers give the scale a sign of its own; the raster runs from the north all the same.
        let down = (0.0, -scale[1].abs());
        return Some(shifted(Affine {
            x: (x - column * across.0, across.0, 0.0),
            y: (y - row * down.1, 0.0, down.1),
        }));
    }
    let matrix =
        directory.real_values(bytes, tag::MODEL_TRANSFORMATION).filter(|matrix| matrix.len() >= 8)?;
    Some(shifted(Affine { x: (matrix[3], matrix[0], matrix[1]), y: (matrix[7], matrix[4], matrix[5]) }))
}

/// Six lines: x per column, y per column, x per row, y per row, then the middle of the first pixel.
fn from_world_file(path: &Path) -> Option<Affine> {
    let text = ["tfw", "TFW", "tifw", "wld"].iter().find_map(|extension| {
        let beside = path.with_extension(extension);
        // A world file has six numbers; anything longer is something else.
        (std::fs::metadata(&beside).ok()?.len() < 4096).then(|| std::fs::read_to_string(beside).ok())?
    })?;
    // Some programs write numbers as their country does.
    let number = |word: &str| word.replace(',', ".").parse().ok();
    let numbers: Vec<f64> = text.split_whitespace().map_while(number).collect();
    let [x_column, y_column, x_row, y_row, x, y] = numbers.try_into().ok()?;
    let mut affine = Affine { x: (x, x_column, x_row), y: (y, y_column, y_row) };
    (affine.x.0, affine.y.0) = affine.apply(-0.5, -0.5);
    Some(affine)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_inverse_of_a_rotated_transform(angle in 0.0..6.2_f64, size in 0.1..100.0_f64, column in 0.0..5000.0_f64, row in 0.0..5000.0_f64) {
            let (sine, cosine) = angle.sin_cos();
            let affine = Affine { x: (5e5, size * cosine, size * sine), y: (5e6, size * sine, -size * cosine) };
            let (x, y) = affine.apply(column, row);
            let (found_column, found_row) = affine.inverse().apply(x, y);
            prop_assert!((found_column - column).abs() < 1e-5 && (found_row - row).abs() < 1e-5);
        }
    }
}
