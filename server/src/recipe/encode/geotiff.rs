//! GeoTIFF of 32-bit floats, with its georeference and NaN as nodata.

use std::io::Cursor;
use tiff::TiffError;
use tiff::encoder::colortype::Gray32Float;
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder};
use tiff::tags::Tag;

// Keys and values of the GeoTIFF standard (OGC 19-008).
const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const GEOGRAPHIC_CODE: u16 = 2048;
const ANGULAR_UNITS: u16 = 2054;
const PROJECTED_CODE: u16 = 3072;
const MODEL_PROJECTED: u16 = 1;
const MODEL_GEOGRAPHIC: u16 = 2;
const PIXEL_IS_AREA: u16 = 1;
const DEGREES: u16 = 9102;

/// `transform` is west, north and the steps eastward and southward of the pixels' box, in the units
/// of the EPSG code.
pub fn geotiff(
    metres: &[f32],
    width: u32,
    height: u32,
    transform: [f64; 4],
    epsg: u32,
) -> Result<Vec<u8>, TiffError> {
    let [west, north, step_x, step_y] = transform;
    // Infinity is no height either.
    let samples: Vec<f32> =
        metres.iter().map(|&metres| if metres.is_finite() { metres } else { f32::NAN }).collect();
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder =
        TiffEncoder::new(&mut bytes)?.with_compression(Compression::Deflate(DeflateLevel::Fast));
    let mut image = encoder.new_image::<Gray32Float>(width, height)?;
    let directory = image.encoder();
    directory.write_tag(Tag::ModelPixelScaleTag, &[step_x, step_y, 0.0][..])?;
    directory.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, west, north, 0.0][..])?;
    directory.write_tag(Tag::GeoKeyDirectoryTag, &geo_keys(epsg)[..])?;
    directory.write_tag(Tag::GdalNodata, "nan")?;
    image.write_data(&samples)?;
    Ok(bytes.into_inner())
}

fn geo_keys(epsg: u32) -> Vec<u16> {
    let code = u16::try_from(epsg).unwrap_or(u16::MAX);
    let own = if epsg == 4326 {
        [
            [MODEL_TYPE, 0, 1, MODEL_GEOGRAPHIC],
            [RASTER_TYPE, 0, 1, PIXEL_IS_AREA],
            [GEOGRAPHIC_CODE, 0, 1, code],
        ]
        .into_iter()
        .chain([[ANGULAR_UNITS, 0, 1, DEGREES]])
        .collect::<Vec<_>>()
    } else {
        vec![
            [MODEL_TYPE, 0, 1, MODEL_PROJECTED],
            [RASTER_TYPE, 0, 1, PIXEL_IS_AREA],
            [PROJECTED_CODE, 0, 1, code],
        ]
    };
    // Version 1.1.0 of the directory, then the number of keys.
    let mut keys = vec![1, 1, 0, own.len() as u16];
    keys.extend(own.as_flattened());
    keys
}
