//! A photograph of the built-in landscape as a camera would take it: lit from the south-east with shadows
//! that mountains cast, through haze, with noise, as a JPEG. Written with its terrain as GeoTIFFs.

use image::codecs::jpeg::JpegEncoder;
use std::path::{Path, PathBuf};
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::{Gray32Float, RGB8};
use tiff::tags::Tag;
use treeline_core::tile::GeographicBox;
use treeline_server::source::{ColourField as _, Cover, CoverField as _, HeightField as _};
use treeline_server::source::{RequestCrs, SampleGrid, procedural};

/// A square kilometre or more of the landscape, and the size of its pixels.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Western edge, degrees.
    pub west: f64,
    /// Northern edge, degrees.
    pub north: f64,
    /// Width of a pixel, degrees.
    pub step_x: f64,
    /// Height of a pixel, degrees.
    pub step_y: f64,
    /// Columns.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
}

/// Longitude that parts the landscape: constants may be measured west of it, figures are of what lies east.
pub const PARTING: f64 = 10.986_328_125;
/// Degrees of a metre, eastward and northward, at the landscape's middle.
const DEGREES: (f64, f64) = (1.0 / 76_150.0, 1.0 / 111_170.0);
/// To the sun: from the south-east, 38° high; of length 1.
const SUN: [f32; 3] = [0.557, -0.557, 0.616];
/// Light in full shadow, of the light on level ground.
const AMBIENT: f32 = 0.32;
/// What the haze adds to red, green and blue.
const HAZE: [f32; 3] = [5.0, 8.0, 13.0];
/// Standard deviation of the noise in each channel.
const NOISE: f32 = 4.0;
/// Quality of the JPEG.
const QUALITY: u8 = 85;

impl Frame {
    /// A frame of `kilometres` from its north-western corner, with pixels of so many metres.
    pub fn new(west: f64, north: f64, kilometres: (f64, f64), metres: f64) -> Self {
        Self {
            west,
            north,
            step_x: metres * DEGREES.0,
            step_y: metres * DEGREES.1,
            columns: (1000.0 * kilometres.0 / metres) as u32,
            rows: (1000.0 * kilometres.1 / metres) as u32,
        }
    }

    /// The pixels' centres.
    pub fn grid(&self) -> SampleGrid {
        let bounds = self.bounds();
        SampleGrid::Box {
            crs: RequestCrs::Geographic,
            west: bounds.west,
            south: bounds.south,
            east: bounds.east,
            north: bounds.north,
            width: self.columns,
            height: self.rows,
        }
    }

    fn bounds(&self) -> GeographicBox {
        GeographicBox {
            west: self.west,
            south: self.north - self.step_y * f64::from(self.rows),
            east: self.west + self.step_x * f64::from(self.columns),
            north: self.north,
        }
    }

    /// What really grows at the pixels' centres.
    pub fn truth(&self) -> Vec<Cover> {
        let mut covers = vec![Cover::default(); self.columns as usize * self.rows as usize];
        procedural::cover().sample(&self.grid(), &mut covers).expect("the built-in cover answers");
        covers
    }

    /// Writes terrain and photograph into a folder: their paths.
    pub fn write(&self, folder: &Path) -> (PathBuf, PathBuf) {
        let count = self.columns as usize * self.rows as usize;
        let mut heights = vec![0.0; count];
        procedural::height().sample(&self.grid(), &mut heights).expect("the built-in terrain answers");
        let mut colours = vec![[0; 4]; count];
        procedural::colour().sample(&self.grid(), &mut colours).expect("the built-in photo answers");
        let (dem, photo) = (folder.join("dem.tif"), folder.join("photo.tif"));
        self.write_tiff::<Gray32Float>(&dem, &heights);
        self.write_tiff::<RGB8>(&photo, &self.develop(&heights, &colours));
        (dem, photo)
    }

    /// Light, haze, noise and JPEG.
    fn develop(&self, heights: &[f32], colours: &[[u8; 4]]) -> Vec<u8> {
        let width = self.columns as usize;
        let mut pixels = Vec::with_capacity(3 * colours.len());
        for (index, colour) in colours.iter().enumerate() {
            let light = self.light(heights, index % width, index / width);
            for channel in 0..3 {
                let value = f32::from(colour[channel]) * light + HAZE[channel];
                let noise = NOISE * normal(3 * index as u32 + channel as u32);
                pixels.push((value + noise).round().clamp(0.0, 255.0) as u8);
            }
        }
        let mut jpeg = Vec::new();
        JpegEncoder::new_with_quality(&mut jpeg, QUALITY)
            .encode(&pixels, self.columns, self.rows, image::ExtendedColorType::Rgb8)
            .expect("a JPEG can be written");
        image::load_from_memory(&jpeg).expect("and read").into_rgb8().into_raw()
    }

    /// Light on a pixel, 1 on level ground in the sun.
    fn light(&self, heights: &[f32], column: usize, row: usize) -> f32 {
        let (width, height) = (self.columns as usize, self.rows as usize);
        let at = |x: usize, y: usize| heights[y.min(height - 1) * width + x.min(width - 1)];
        let metres = (self.step_x / DEGREES.0) as f32;
        let dx = (at(column + 1, row) - at(column.saturating_sub(1), row)) / (2.0 * metres);
        let dy = (at(column, row.saturating_sub(1)) - at(column, row + 1)) / (2.0 * metres);
        let facing = (SUN[2] - dx * SUN[0] - dy * SUN[1]) / (1.0 + dx * dx + dy * dy).sqrt() / SUN[2];
        let here = at(column, row);
        let level = SUN[0].hypot(SUN[1]);
        let mut distance = 3.0 * metres;
        while distance < 3000.0 {
            let pixels = distance / level / metres;
            let (x, y) = (column as f32 + SUN[0] * pixels, row as f32 - SUN[1] * pixels);
            if x < 0.0 || y < 0.0 || x >= width as f32 || y >= height as f32 {
                break;
            }
            if at(x as usize, y as usize) > here + distance * SUN[2] / level + 2.0 {
                return AMBIENT;
            }
            distance += metres.max(0.04 * distance);
        }
        AMBIENT + (1.0 - AMBIENT) * facing.max(0.0)
    }

    fn write_tiff<C: tiff::encoder::colortype::ColorType>(&self, path: &Path, samples: &[C::Inner])
    where
        [C::Inner]: tiff::encoder::TiffValue,
    {
        let file = std::fs::File::create(path).expect("the folder can be written to");
        let mut encoder = TiffEncoder::new(std::io::BufWriter::new(file)).expect("a TIFF can be begun");
        let mut image = encoder.new_image::<C>(self.columns, self.rows).expect("an image can be begun");
        image.rows_per_strip(64).expect("strips are allowed");
        let scale = [self.step_x, self.step_y, 0.0];
        let corner = [0.0, 0.0, 0.0, self.west, self.north, 0.0];
        // Version 1.1.0, three keys: a geographic model, pixels are areas, EPSG:4326.
        let keys: [u16; 16] = [1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326];
        let directory = image.encoder();
        directory.write_tag(Tag::ModelPixelScaleTag, &scale[..]).expect("a tag");
        directory.write_tag(Tag::ModelTiepointTag, &corner[..]).expect("a tag");
        directory.write_tag(Tag::GeoKeyDirectoryTag, &keys[..]).expect("a tag");
        image.write_data(samples).expect("samples can be written");
    }
}

/// Nearly normal, of mean 0 and standard deviation 1, by index: four hashed bytes.
fn normal(index: u32) -> f32 {
    let mut bits = index.wrapping_mul(0x9E37_79B9) ^ 0x5bd1_e995;
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x7feb_352d);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x846c_a68b);
    bits ^= bits >> 16;
    let sum: f32 = bits.to_le_bytes().iter().map(|&byte| f32::from(byte) - 127.5).sum();
    sum / (2.0 * 73.9)
}

#[test]
fn the_noise_is_what_it_is_said_to_be() {
    let count = 100_000;
    let (mut mean, mut square) = (0.0_f64, 0.0_f64);
    for index in 0..count {
        let value = f64::from(normal(index));
        mean += value / f64::from(count);
        square += value * value / f64::from(count);
    }
    assert!(mean.abs() < 0.02 && (square - 1.0).abs() < 0.03, "{mean} {square}");
}
