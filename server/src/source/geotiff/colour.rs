//! What colour a pixel has: grey, RGB, palette, YCbCr, 8 bits or more, alpha, nodata and masks.

use super::Raster;
use super::image::{Image, Rect, ValueRule};
use super::layout::{Layout, SampleKind, photometric};

/// Share of the sampled values that stays below white where more than 8 bits are brought to 8.
const WHITE_QUANTILE: f64 = 0.99;
/// Windows along each side of the image by which that is found, and pixels along their sides.
const PROBES: u32 = 8;
const PROBE_PIXELS: u32 = 64;

/// How an image's samples become colour.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourRule {
    bands: Bands,
    /// Band of alpha, and whether colours are multiplied by it.
    alpha: Option<(u16, bool)>,
    nodata: Option<f64>,
    /// Stored number times this is 0 … 255.
    to_byte: f32,
    /// Greatest alpha, as stored.
    full_alpha: f32,
}

#[derive(Clone, Debug, PartialEq)]
enum Bands {
    Palette(Vec<[u8; 3]>),
    Grey { inverted: bool },
    Rgb,
    YCbCr,
}

impl ColourRule {
    /// The rule of an open raster. Images of more than 8 bits are scaled by one factor for all bands:
    /// by their type's range where they fill most of it, else so that 99 % of the values (found on a
    /// sample of the image) stay below white.
    ///
    /// # Errors
    /// In words, what colours these are that we cannot show, with the mend; or that the image cannot
    /// be read.
    pub fn of(raster: &Raster, nodata: Option<f64>) -> Result<Self, (String, String)> {
        let layout = &raster.full().layout;
        let nodata = nodata.or(raster.nodata);
        let colours = match layout.photometric {
            photometric::RGB | photometric::YCBCR => 3,
            photometric::PALETTE => 1,
            photometric::WHITE_IS_ZERO | photometric::BLACK_IS_ZERO if layout.samples >= 3 => 3,
            photometric::WHITE_IS_ZERO | photometric::BLACK_IS_ZERO => 1,
            photometric::CMYK => {
                return Err((
                    "its colours are CMYK".to_owned(),
                    "convert it to RGB, for example with ImageMagick, and place it again with gdal_translate"
                        .to_owned(),
                ));
            }
            other => {
                return Err((
                    format!("its colours (photometric interpretation {other}) are not known here"),
                    "gdal_translate -co PHOTOMETRIC=RGB FILE rgb.tif".to_owned(),
                ));
            }
        };
        if layout.samples < colours {
            return Err(("it has fewer bands than its colours need".to_owned(), "fetch it again".to_owned()));
        }
        let bands = match (layout.photometric, colours) {
            (photometric::PALETTE, _) => Bands::Palette(layout.palette.clone().unwrap_or_default()),
            (photometric::YCBCR, _) => Bands::YCbCr,
            (_, 3) => Bands::Rgb,
            (number, _) => Bands::Grey { inverted: number == photometric::WHITE_IS_ZERO },
        };
        // The extra samples are the last ones, whatever the photometric ones are.
        let first_extra = usize::from(layout.samples).saturating_sub(layout.extra_samples.len());
        let alpha = layout
            .extra_samples
            .iter()
            .position(|&extra| matches!(extra, 1 | 2))
            .map(|index| ((first_extra + index) as u16, layout.extra_samples[index] == 1))
            .filter(|&(band, _)| band >= colours && band < layout.samples);
        let mut rule = Self { bands, alpha, nodata, to_byte: 1.0, full_alpha: full_range(layout) };
        if !matches!(rule.bands, Bands::Palette(_))
            && (layout.bits != 8 || layout.kind != SampleKind::Unsigned)
        {
            rule.to_byte =
                rule.find_scale(raster).map_err(|problem| (problem, "fetch it again".to_owned()))?;
        }
        Ok(rule)
    }

    /// Number of bands that make a colour.
    fn colour_bands(&self) -> u16 {
        if matches!(self.bands, Bands::Rgb | Bands::YCbCr) { 3 } else { 1 }
    }

    /// Factor to 8 bits, from a sample of the smallest image that is large enough.
    fn find_scale(&self, raster: &Raster) -> Result<f32, String> {
        let layout = &raster.full().layout;
        let range = full_range(layout);
        if layout.bits < 8 {
            return Ok(255.0 / range);
        }
        let enough = PROBES * PROBE_PIXELS;
        let image =
            raster.images.iter().rev().find(|image| image.layout.width >= enough).unwrap_or(raster.full());
        let (width, height) = (image.layout.width, image.layout.height);
        let rule = ValueRule { nodata: self.nodata, ..ValueRule::RAW };
        let mut values = Vec::new();
        let place = |index: u32, size: u32| (u64::from(size) * u64::from(index) / u64::from(PROBES)) as u32;
        for row in 0..PROBES {
            for column in 0..PROBES {
                let (x, y) = (place(column, width), place(row, height));
                let rect =
                    Rect { x, y, width: PROBE_PIXELS.min(width - x), height: PROBE_PIXELS.min(height - y) };
                for band in 0..self.colour_bands() {
                    values.extend(
                        image.read_values(band, rect, &rule)?.into_iter().filter(|value| *value > 0.0),
                    );
                }
            }
        }
        if values.is_empty() {
            return Ok(255.0 / range);
        }
        let rank = ((values.len() - 1) as f64 * WHITE_QUANTILE) as usize;
        let (_, &mut white, _) = values.select_nth_unstable_by(rank, f32::total_cmp);
        if layout.kind == SampleKind::Float {
            return Ok(255.0 / if white <= 1.0 { 1.0 } else { white });
        }
        Ok(255.0 / if white > 0.5 * range { range } else { white })
    }

    /// Colours of a window: straight alpha, colour 0 where there is no data.
    ///
    /// # Errors
    /// A chunk that cannot be read, in words.
    pub fn read(&self, image: &Image, rect: Rect) -> Result<Vec<[u8; 4]>, String> {
        let mut pixels = match self.read_fast(image, rect)? {
            Some(pixels) => pixels,
            None => self.read_planes(image, rect)?,
        };
        if let Some(mask) = &image.mask {
            for (pixel, valid) in pixels.iter_mut().zip(mask.read_mask(rect)?) {
                if !valid {
                    *pixel = [0; 4];
                }
            }
        }
        Ok(pixels)
    }

    /// Chunky 8-bit images, which nearly all are.
    fn read_fast(&self, image: &Image, rect: Rect) -> Result<Option<Vec<[u8; 4]>>, String> {
        if let (Bands::Grey { .. }, true) = (&self.bands, image.layout.bits < 8) {
            return Ok(None);
        }
        // No byte is 256: such a nodata matches nothing.
        let nodata =
            self.nodata.map_or(256, |value| if (0.0..256.0).contains(&value) { value as u16 } else { 256 });
        let is_nodata = |colour: &[u8]| colour.iter().all(|&value| u16::from(value) == nodata);
        let finish = |colour: [u8; 3], stored: &[u8], samples: &[u8]| {
            if is_nodata(stored) {
                return [0; 4];
            }
            let [r, g, b] = colour;
            match self.alpha {
                None => [r, g, b, 255],
                Some((band, associated)) => with_alpha([r, g, b], samples[usize::from(band)], associated),
            }
        };
        match &self.bands {
            Bands::Palette(palette) => image.read_bytes_as(rect, |samples| {
                let [r, g, b] = palette.get(usize::from(samples[0])).copied().unwrap_or_default();
                if is_nodata(&samples[..1]) { [0; 4] } else { [r, g, b, 255] }
            }),
            Bands::Grey { inverted } => image.read_bytes_as(rect, |samples| {
                let grey = if *inverted { 255 - samples[0] } else { samples[0] };
                finish([grey; 3], &samples[..1], samples)
            }),
            Bands::Rgb if self.alpha.is_none() && nodata == 256 => {
                image.read_bytes_as(rect, |samples| [samples[0], samples[1], samples[2], 255])
            }
            Bands::YCbCr if self.alpha.is_none() && nodata == 256 => image.read_bytes_as(rect, |samples| {
                let [r, g, b] = rgb_from_ycbcr([samples[0], samples[1], samples[2]]);
                [r, g, b, 255]
            }),
            Bands::Rgb => image.read_bytes_as(rect, |samples| {
                finish([samples[0], samples[1], samples[2]], &samples[..3], samples)
            }),
            Bands::YCbCr => image.read_bytes_as(rect, |samples| {
                let colour = rgb_from_ycbcr([samples[0], samples[1], samples[2]]);
                finish(colour, &colour, samples)
            }),
        }
    }

    fn read_planes(&self, image: &Image, rect: Rect) -> Result<Vec<[u8; 4]>, String> {
        let count = self.colour_bands();
        let mut planes = Vec::new();
        for band in (0..count).chain(self.alpha.map(|(band, _)| band)) {
            // The mask comes last, for all bands at once.
            planes.push(image.read_values(band, rect, &ValueRule::RAW)?);
        }
        let colours = usize::from(count);
        let nodata = self.nodata.map(|value| value as f32);
        let pixels = (0..rect.len()).map(|index| {
            let stored = |band: usize| planes[band][index];
            let all = |test: &dyn Fn(f32) -> bool| (0..colours).all(|band| test(stored(band)));
            if all(&|value: f32| value.is_nan() || Some(value) == nodata) {
                return [0; 4];
            }
            let byte = |value: f32| (value * self.to_byte).round().clamp(0.0, 255.0) as u8;
            let mut colour = [0, 1, 2].map(|band| byte(stored(if colours == 3 { band } else { 0 })));
            match self.bands {
                Bands::YCbCr => colour = rgb_from_ycbcr(colour),
                Bands::Grey { inverted: true } => colour = colour.map(|value| 255 - value),
                _ => {}
            }
            match self.alpha {
                None => [colour[0], colour[1], colour[2], 255],
                Some((_, associated)) => {
                    let alpha = stored(colours) / self.full_alpha * 255.0;
                    with_alpha(colour, alpha.round().clamp(0.0, 255.0) as u8, associated)
                }
            }
        });
        Ok(pixels.collect())
    }

    /// The stored number that stands for no data in all bands.
    pub fn nodata(&self) -> Option<f64> {
        self.nodata
    }
}

/// The greatest number of an integer type; 1 for floats.
fn full_range(layout: &Layout) -> f32 {
    match layout.kind {
        SampleKind::Unsigned => (2.0_f64.powi(i32::from(layout.bits)) - 1.0) as f32,
        SampleKind::Signed => (2.0_f64.powi(i32::from(layout.bits) - 1) - 1.0) as f32,
        SampleKind::Float => 1.0,
    }
}

fn with_alpha([r, g, b]: [u8; 3], alpha: u8, associated: bool) -> [u8; 4] {
    if alpha == 0 {
        return [0; 4];
    }
    if !associated {
        return [r, g, b, alpha];
    }
    let part =
        |value: u8| ((u32::from(value) * 255 + u32::from(alpha) / 2) / u32::from(alpha)).min(255) as u8;
    [part(r), part(g), part(b), alpha]
}

/// Full-range BT.601, as JPEG and TIFF's default coefficients have it; in 65536ths, as the common JPEG
/// libraries do.
#[inline(always)]
fn rgb_from_ycbcr([y, cb, cr]: [u8; 3]) -> [u8; 3] {
    let (y, cb, cr) = (i32::from(y), i32::from(cb) - 128, i32::from(cr) - 128);
    let add = |part: i32| (y + ((part + 0x8000) >> 16)).clamp(0, 255) as u8;
    [add(91_881 * cr), add(-22_554 * cb - 46_802 * cr), add(116_130 * cb)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_spaces() {
        assert_eq!(rgb_from_ycbcr([128, 128, 128]), [128; 3]);
        assert_eq!(rgb_from_ycbcr([76, 85, 255]), [254, 0, 0]);
        assert_eq!(with_alpha([50, 0, 100], 128, true), [100, 0, 199, 128]);
        assert_eq!(with_alpha([50, 60, 70], 0, false), [0; 4]);
    }
}
