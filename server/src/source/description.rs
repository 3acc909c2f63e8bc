//! What there is to say about an open raster, for people.

use super::crs::Datum;
use super::geotiff::Raster;
use super::geotiff::layout::compression_name;
use super::placement::Placement;
use super::upstream::pictures;
use std::path::Path;
use treeline_core::tile::{self, GeographicBox};

/// An open raster, described. Its `Display` is what `treeline check` prints, a line each.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// The file as the user named it.
    pub path: String,
    /// File format, compression, tiles or strips.
    pub encoding: String,
    /// Columns and rows.
    pub size: (u32, u32),
    /// Bands and type of a sample.
    pub samples: String,
    /// Reference system: name and code.
    pub crs: String,
    /// What is to be known about its datum, where that is not WGS84.
    pub datum: Option<String>,
    /// Bounds in degrees.
    pub bounds: GeographicBox,
    /// Width and height of a pixel in the system's units.
    pub pixel_size: (f64, f64),
    /// The unit of `pixel_size`.
    pub unit: &'static str,
    /// Sample distance in metres.
    pub resolution_metres: f64,
    /// Nodata, as declared or given.
    pub nodata: Option<f64>,
    /// Mask, where there is one.
    pub has_mask: bool,
    /// Widths and heights of the overviews.
    pub overviews: Vec<(u32, u32)>,
    /// Deepest level of the tile matrix at which it has detail.
    pub deepest_level: u8,
}

impl Description {
    /// Describes an open raster; `nodata` is what a person gave.
    pub fn of(raster: &Raster, placement: &Placement, nodata: Option<f64>) -> Self {
        let layout = &raster.full().layout;
        let crs = placement.crs();
        let form = if raster.big_tiff { "BigTIFF" } else { "GeoTIFF" };
        let predictor = match layout.predictor {
            2 => ", horizontal predictor",
            3 => ", floating-point predictor",
            _ => "",
        };
        let chunks = if layout.tiled {
            format!("tiles of {} × {}", layout.chunk_width, layout.chunk_height)
        } else {
            format!("strips of {} rows", layout.chunk_height)
        };
        let degrees = crs.is_geographic();
        Self {
            path: raster.path.clone(),
            encoding: if pictures::is_service(Path::new(&raster.path)) {
                format!("maps of a service, {chunks}")
            } else {
                format!("{form}, {}{predictor}, {chunks}", compression_name(layout.compression))
            },
            size: raster.size(),
            samples: format!("{} × {}", layout.samples, layout.type_name()),
            crs: crs.to_string(),
            datum: match crs.datum() {
                Datum::Shifted { accuracy_metres } => {
                    Some(format!("its datum is shifted to WGS84, good to about {accuracy_metres} m"))
                }
                Datum::Wgs84 | Datum::Unknown => None,
            },
            bounds: placement.bounds(),
            pixel_size: raster.affine.pixel_size(),
            unit: match crs.metres_per_unit() {
                _ if degrees => "°",
                metre if (metre - 1.0).abs() < 1e-9 => "m",
                foot if (foot - 0.3048).abs() < 1e-5 => "ft",
                _ => "units",
            },
            resolution_metres: placement.resolution_metres(),
            nodata: nodata.or(raster.nodata),
            has_mask: raster.full().mask.is_some(),
            overviews: raster.images[1..]
                .iter()
                .map(|image| (image.layout.width, image.layout.height))
                .collect(),
            deepest_level: tile::level_for_cell_metres(placement.resolution_metres()),
        }
    }
}

impl std::fmt::Display for Description {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let bounds = &self.bounds;
        writeln!(formatter, "{}", self.path)?;
        writeln!(formatter, "  encoding    {}", self.encoding)?;
        writeln!(formatter, "  size        {} × {} pixels, {}", self.size.0, self.size.1, self.samples)?;
        writeln!(formatter, "  CRS         {}", self.crs)?;
        if let Some(datum) = &self.datum {
            writeln!(formatter, "              {datum}")?;
        }
        writeln!(
            formatter,
            "  extent      {:.6} … {:.6}° E, {:.6} … {:.6}° N",
            bounds.west, bounds.east, bounds.south, bounds.north
        )?;
        writeln!(
            formatter,
            "  resolution  {} × {} {} ({:.2} m)",
            self.pixel_size.0, self.pixel_size.1, self.unit, self.resolution_metres
        )?;
        let nodata = match (self.nodata, self.has_mask) {
            (Some(value), _) => value.to_string(),
            (None, true) => "by mask".to_owned(),
            (None, false) => "none declared".to_owned(),
        };
        writeln!(formatter, "  nodata      {nodata}")?;
        let overviews: Vec<String> =
            self.overviews.iter().map(|size| format!("{} × {}", size.0, size.1)).collect();
        let overviews = if overviews.is_empty() { "none".to_owned() } else { overviews.join(", ") };
        writeln!(formatter, "  overviews   {overviews}")?;
        write!(formatter, "  levels      0 … {}", self.deepest_level)
    }
}
