//! PNG, JPEG and WebP.

use super::failure;
use crate::recipe::{Format, RecipeError, TileRequest};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder};
use jpeg_encoder::{ColorType, Encoder as JpegEncoder, SamplingFactor};

/// Quality of JPEGs: 37 dB on photos, a tenth of the PNG's size. Chrominance is at half the resolution, as everywhere.
const JPEG_QUALITY: u8 = 85;

/// Pixels with straight alpha as an image; what is transparent shows the background unless
/// transparency is asked for and the format has it.
pub fn picture(request: &TileRequest, mut pixels: Vec<[u8; 4]>) -> Result<Vec<u8>, RecipeError> {
    let (width, height) = request.grid.size();
    let alpha = request.transparent && request.format != Format::Jpeg;
    let opaque = pixels.iter().all(|pixel| pixel[3] == 255);
    if !alpha && !opaque {
        for pixel in &mut pixels {
            *pixel = over_background(*pixel, request.background);
        }
    }
    if request.format == Format::Jpeg {
        return jpeg(&pixels, width, height).map_err(|problem| failure(request, &problem));
    }
    let mut bytes = Vec::new();
    let (samples, colour) = if alpha && !opaque {
        (pixels.as_flattened().to_vec(), ExtendedColorType::Rgba8)
    } else {
        let samples = pixels.iter().flat_map(|&[red, green, blue, _]| [red, green, blue]).collect();
        (samples, ExtendedColorType::Rgb8)
    };
    let result = match request.format {
        Format::WebP => WebPEncoder::new_lossless(&mut bytes).encode(&samples, width, height, colour),
        _ => PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
            .write_image(&samples, width, height, colour),
    };
    result.map_err(|error| failure(request, &error.to_string()))?;
    Ok(bytes)
}

fn jpeg(pixels: &[[u8; 4]], width: u32, height: u32) -> Result<Vec<u8>, String> {
    let side =
        |side: u32| u16::try_from(side).map_err(|_| "a side of a JPEG has 65535 pixels at most".to_owned());
    let mut bytes = Vec::new();
    let mut encoder = JpegEncoder::new(&mut bytes, JPEG_QUALITY);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    let encoded = encoder.encode(pixels.as_flattened(), side(width)?, side(height)?, ColorType::Rgba);
    encoded.map_err(|error| error.to_string())?;
    Ok(bytes)
}

fn over_background([red, green, blue, alpha]: [u8; 4], background: [u8; 3]) -> [u8; 4] {
    let alpha = u32::from(alpha);
    let blend = |above: u8, below: u8| {
        ((u32::from(above) * alpha + u32::from(below) * (255 - alpha) + 127) / 255) as u8
    };
    [blend(red, background[0]), blend(green, background[1]), blend(blue, background[2]), 255]
}
