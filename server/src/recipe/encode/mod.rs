//! Bytes of the formats that others read.

mod bil;
mod geotiff;
pub mod own;
mod picture;

pub use picture::picture;

use super::grid_places::georeference;
use super::{Format, RecipeError, TileRequest};

/// Heights in metres, NaN for no data, as bil or GeoTIFF.
pub fn heights(request: &TileRequest, metres: &[f32]) -> Result<Vec<u8>, RecipeError> {
    match request.format {
        Format::Bil16 => Ok(bil::bil16(metres, request.nodata)),
        Format::Bil32 | Format::XBil32 => Ok(bil::bil32(metres, request.nodata)),
        _ => {
            let (width, height) = request.grid.size();
            let (transform, epsg) = georeference(&request.grid);
            geotiff::geotiff(metres, width, height, transform, epsg)
                .map_err(|error| failure(request, &error.to_string()))
        }
    }
}

/// An encoder's refusal, named.
fn failure(request: &TileRequest, problem: &str) -> RecipeError {
    let (width, height) = request.grid.size();
    RecipeError::Encode {
        format: request.format.media_type(request.layer),
        width,
        height,
        problem: problem.to_owned(),
    }
}
