//! Small GeoTIFFs of which every value is known.

use anyhow::Context;
use std::path::Path;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::Gray32Float;
use tiff::tags::Tag;

/// Where a raster of heights lies: WGS 84, degrees.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Longitude of the western edge.
    pub west: f64,
    /// Latitude of the northern edge.
    pub north: f64,
    /// Width and height of a pixel.
    pub step: [f64; 2],
    /// Columns.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
}

/// Marks a void, and is declared.
pub const NODATA: f32 = -9999.0;

/// Writes heights (metres, by longitude and latitude of the pixel's centre) as an uncompressed GeoTIFF of 32-bit
/// floats, row by row from the north-west.
pub fn write_heights(
    path: &Path,
    placement: &Placement,
    height: impl Fn(f64, f64) -> f32,
) -> anyhow::Result<()> {
    let Placement { west, north, step, columns, rows } = *placement;
    let file = std::fs::File::create(path).with_context(|| format!("{}", path.display()))?;
    let mut encoder = TiffEncoder::new(std::io::BufWriter::new(file))?;
    let mut image = encoder.new_image::<Gray32Float>(columns, rows)?;
    image.rows_per_strip(64)?;
    let directory = image.encoder();
    directory.write_tag(Tag::ModelPixelScaleTag, &[step[0], step[1], 0.0][..])?;
    directory.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, west, north, 0.0][..])?;
    // Version 1.1.0, three keys: a geographic model, pixels are areas, EPSG:4326.
    let keys: [u16; 16] = [1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326];
    directory.write_tag(Tag::GeoKeyDirectoryTag, &keys[..])?;
    directory.write_tag(Tag::GdalNodata, format!("{NODATA}").as_str())?;
    let samples: Vec<f32> = (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (row, column)))
        .map(|(row, column)| {
            height(west + step[0] * (f64::from(column) + 0.5), north - step[1] * (f64::from(row) + 0.5))
        })
        .collect();
    image.write_data(&samples)?;
    Ok(())
}
