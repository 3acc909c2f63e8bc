//! Opening sources by path: from files to fields, with everything a person may say about them.

use super::geotiff::Raster;
use super::geotiff::image::{Rect, ValueRule};
use super::geotiff::layout::{Layout, SampleKind, photometric};
use super::growth::Growth;
use super::land_cover_tables::{KNOWN_TABLES, recognise};
use super::picture::PictureCover;
use super::picture::map::{MapJudge, MapKey};
use super::picture::photo::PhotoJudge;
use super::raster_colour::RasterColour;
use super::raster_cover::{CanopyHeightCover, NearestRaster, RasterCover};
use super::raster_height::{BELIEVABLE_METRES, RasterHeight};
use super::upstream::wms::is_wms;
use super::upstream::{heights, pictures};
use super::{ColourField, Cover, CoverField, HeightField, SourceError};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use treeline_core::tile::GeographicBox;

/// Canopies above this, metres, are taken for another unit.
const TALLEST_TREE_METRES: f32 = 120.0;
/// Pixels of a terrain model that are read once for their least and greatest, at most: beyond, it has to
/// have overviews.
const MAXIMUM_SUMMARY_PIXELS: u64 = 1 << 32;
/// Windows along each side, and pixels along their sides, by which a raster's values are known before
/// all of it is read.
const PROBES: u32 = 8;
const PROBE_PIXELS: u32 = 128;

/// What a person says about a source.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceOptions {
    /// `EPSG:N`, in place of what the file says.
    pub assume_crs: Option<String>,
    /// The stored number that stands for no data, in place of what the file says.
    pub nodata: Option<f64>,
}

/// What a person says about heights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeightOptions {
    /// Reference system and nodata.
    pub source: SourceOptions,
    /// Heights are multiplied by this, in place of the unit that the file names.
    pub vertical_scale: Option<f64>,
    /// Then this is added, metres.
    pub vertical_offset: Option<f64>,
    /// The part that is fetched where the path is a service.
    pub bounds: Option<GeographicBox>,
    /// Distance of its samples, metres.
    pub resolution_metres: Option<f64>,
}

/// Opens a terrain model.
///
/// # Errors
/// One line: the file, what is wrong, the mend.
pub fn open_height(path: &Path, options: &HeightOptions) -> Result<Arc<RasterHeight>, SourceError> {
    let raster = match path.to_str().filter(|_| is_wms(path)) {
        Some(address) => {
            let bounds = options.bounds.ok_or_else(|| SourceError::Unusable {
                path: address.to_owned(),
                problem: "it is a service that may have heights of all the Earth".to_owned(),
                mend: "say which part: bbox = [west, south, east, north] under [dem] in scene.toml, degrees"
                    .to_owned(),
            })?;
            heights::open(address, &bounds, options.resolution_metres, options.source.nodata)?
        }
        None => Raster::open(path, options.source.assume_crs.as_deref())?,
    };
    if is_picture(&raster.full().layout) || raster.full().layout.palette.is_some() {
        return Err(raster.unusable(
            "it is a picture in colours, not a terrain model",
            "give it as --photo, and a raster of heights as --dem",
        ));
    }
    let smallest = raster.images.last().map_or(0, |image| image.rect().len() as u64);
    if smallest > MAXIMUM_SUMMARY_PIXELS {
        let (width, height) = raster.size();
        return Err(raster.unusable(
            &format!("it has {width} × {height} pixels, and no overviews"),
            "gdaladdo -r average FILE",
        ));
    }
    let unit = match (options.vertical_scale, raster.vertical_unit_metres) {
        (Some(scale), _) => scale,
        (None, Some(unit)) => unit,
        (None, None) => {
            return Err(raster.unusable(
                "its heights are in a unit that is not known",
                "say how many metres it has: vertical_scale in [dem] of scene.toml",
            ));
        }
    };
    let (scale, offset) = raster.scale_and_offset;
    let rule = ValueRule {
        nodata: options.source.nodata.or(raster.nodata),
        scale: scale * unit,
        offset: offset * unit + options.vertical_offset.unwrap_or(0.0),
        limit: BELIEVABLE_METRES,
    };
    Ok(Arc::new(RasterHeight::new(Arc::new(raster), rule)?))
}

/// Opens a photo.
///
/// # Errors
/// As [`open_height`].
pub fn open_colour(path: &Path, options: &SourceOptions) -> Result<Arc<RasterColour>, SourceError> {
    colour_of(Raster::open(path, options.assume_crs.as_deref())?, options)
}

/// Opens a photo: a file, or what a service of pictures has within `bounds` to a zoom.
///
/// # Errors
/// As [`open_height`].
pub fn open_photo(
    path: &Path,
    options: &SourceOptions,
    bounds: &GeographicBox,
    zoom: Option<u8>,
) -> Result<Arc<RasterColour>, SourceError> {
    match path.to_str() {
        Some(address) if pictures::is_service(path) => {
            colour_of(pictures::open(address, bounds, zoom)?, options)
        }
        _ => open_colour(path, options),
    }
}

fn colour_of(raster: Raster, options: &SourceOptions) -> Result<Arc<RasterColour>, SourceError> {
    raster.verify_anything()?;
    Ok(Arc::new(RasterColour::new(Arc::new(raster), options.nodata)?))
}

/// Opens a raster of land-cover classes. `classes` says what its values mean in the scene's growths;
/// where it is empty, a known table is recognised by the raster's values.
///
/// # Errors
/// As [`open_height`]; also where no table is given and none is recognised.
pub fn open_land_cover(
    path: &Path,
    options: &SourceOptions,
    classes: &BTreeMap<i64, Cover>,
    growth: &Growth,
) -> Result<Arc<RasterCover>, SourceError> {
    let raster = Raster::open(path, options.assume_crs.as_deref())?;
    let layout = &raster.full().layout;
    if layout.kind == SampleKind::Float && layout.bits == 64 || is_picture(layout) {
        return Err(raster.unusable(
            "its samples are no classes",
            "give a raster of whole numbers: gdal_translate -ot Byte FILE classes.tif",
        ));
    }
    let rule = ValueRule { nodata: options.nodata.or(raster.nodata), ..ValueRule::RAW };
    let source = NearestRaster::new(Arc::new(raster), rule)?;
    if !classes.is_empty() {
        return Ok(Arc::new(RasterCover::new(source, classes.clone(), "given".to_owned())));
    }
    let mut counts = BTreeMap::new();
    for value in probe(source.raster(), &rule)? {
        *counts.entry(value as i64).or_insert(0_usize) += 1;
    }
    let Some(table) = recognise(&counts) else {
        let known: Vec<&str> = KNOWN_TABLES.iter().map(|table| table.name).collect();
        let mut commonest: Vec<_> = counts.into_iter().collect();
        commonest.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
        let values: Vec<String> = commonest.iter().take(8).map(|(value, _)| value.to_string()).collect();
        return Err(source.raster().unusable(
            &format!(
                "its classes ({}) are of no table that is known ({})",
                values.join(", "),
                known.join(", ")
            ),
            "say what they mean under [land_cover.classes] in scene.toml",
        ));
    };
    Ok(Arc::new(RasterCover::new(source, table.covers(growth), table.name.to_owned())))
}

/// Opens a raster of canopy heights; `scale` is metres in its unit (`None`: the file's own scale, in
/// metres). `growth` grows there where no other source says what does.
///
/// # Errors
/// As [`open_height`]; also where the heights are too great for metres and no scale is given.
pub fn open_canopy_height(
    path: &Path,
    options: &SourceOptions,
    scale: Option<f64>,
    growth: u8,
) -> Result<Arc<CanopyHeightCover>, SourceError> {
    let raster = Raster::open(path, options.assume_crs.as_deref())?;
    if is_picture(&raster.full().layout) || raster.full().layout.palette.is_some() {
        return Err(raster.unusable(
            "it is a picture in colours, no heights of a canopy",
            "give it as --topographic-map or --photo, and a raster of heights as --canopy-height",
        ));
    }
    let (own_scale, own_offset) = raster.scale_and_offset;
    let unit = scale.unwrap_or(1.0);
    let rule = ValueRule {
        nodata: options.nodata.or(raster.nodata),
        scale: own_scale * unit,
        offset: own_offset * unit,
        limit: BELIEVABLE_METRES,
    };
    let source = NearestRaster::new(Arc::new(raster), rule)?;
    if scale.is_none() {
        let mut heights = probe(source.raster(), &rule)?;
        heights.sort_unstable_by(f32::total_cmp);
        // A few spikes are no reason: one value in a hundred may be wrong.
        let tall = heights.get(heights.len() * 99 / 100).copied().unwrap_or(0.0);
        if tall > TALLEST_TREE_METRES {
            return Err(source.raster().unusable(
                &format!("its canopy would be {tall:.0} m high: its unit is no metre"),
                "say how many metres it has in scene.toml, for decimetres: [canopy_height] scale = 0.1",
            ));
        }
    }
    Ok(Arc::new(CanopyHeightCover::new(source, growth)))
}

/// Opens a scanned or rendered topographic map: forest of a growth where it has the tint of the key.
///
/// # Errors
/// As [`open_height`].
pub fn open_topographic_map(
    path: &Path,
    options: &SourceOptions,
    key: &MapKey,
    growth: u8,
) -> Result<Arc<dyn CoverField>, SourceError> {
    let map = open_colour(path, options)?;
    Ok(Arc::new(PictureCover::new(map, None, Box::new(MapJudge::new(growth, key.clone())))))
}

/// Cover from a photo and the terrain below it.
pub fn photo_cover(
    colour: Arc<dyn ColourField>,
    height: Arc<dyn HeightField>,
    growth: Growth,
) -> Arc<dyn CoverField> {
    Arc::new(PictureCover::new(colour, Some(height), Box::new(PhotoJudge::new(growth))))
}

/// Whether the samples are red, green and blue (or luma and chroma): no quantity that could be measured
/// in one band.
fn is_picture(layout: &Layout) -> bool {
    let whole = layout.kind == SampleKind::Unsigned && layout.bits <= 16;
    layout.photometric == photometric::YCBCR
        || layout.photometric == photometric::RGB && layout.samples >= 3 && whole
}

/// Some of a raster's values, from windows spread over the smallest image that is large enough.
fn probe(raster: &Raster, rule: &ValueRule) -> Result<Vec<f32>, SourceError> {
    let enough = PROBES * PROBE_PIXELS;
    let image =
        raster.images.iter().rev().find(|image| image.layout.width >= enough).unwrap_or(raster.full());
    let (width, height) = (image.layout.width, image.layout.height);
    let place = |index: u32, size: u32| (u64::from(size) * u64::from(index) / u64::from(PROBES)) as u32;
    let mut values = Vec::new();
    for row in 0..PROBES {
        for column in 0..PROBES {
            let (x, y) = (place(column, width), place(row, height));
            let rect =
                Rect { x, y, width: PROBE_PIXELS.min(width - x), height: PROBE_PIXELS.min(height - y) };
            let read = image.read_values(0, rect, rule).map_err(|problem| raster.read_error(problem))?;
            values.extend(read.into_iter().filter(|value| !value.is_nan()));
        }
    }
    Ok(values)
}
