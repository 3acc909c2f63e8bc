//! Photos from a service of pictures: `{z}/{x}/{y}` tiles or a WMS, as a raster whose chunks are the service's tiles.
//!
//! Both are asked in Web Mercator, tile by tile; the zooms are the raster's overviews. A tile that is not there (404,
//! 204) is no data.

use super::wms::{is_wms, maps_of};
use super::{client, printable};
use crate::source::SourceError;
use crate::source::crs::Crs;
use crate::source::geotiff::Raster;
use crate::source::geotiff::chunk::Samples;
use crate::source::geotiff::georeference::Affine;
use crate::source::geotiff::image::{ChunkService, Image, SourceFile};
use crate::source::geotiff::layout::Layout;
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;
use treeline_core::geodesy::{EQUATOR_METRES, web_mercator_from_geographic};
use treeline_core::tile::GeographicBox;

/// Deepest zoom where nobody says: 0.6 m at the equator.
pub const DEFAULT_ZOOM: u8 = 18;
/// Deepest zoom that makes sense: centimetres.
pub const DEEPEST_ZOOM: u8 = 22;
/// Zooms that one raster has at most: more tiles cannot be counted.
const MOST_ZOOMS: u8 = 14;
/// Sides of tiles that services have, pixels.
const SIDES: [u32; 2] = [256, 512];
/// Bytes of a tile at most.
const LARGEST_TILE: u64 = 4 << 20;
/// Latitude at which Web Mercator's square ends, degrees.
const LAST_LATITUDE: f64 = 85.05;

/// Whether a source's path is the address of such a service.
pub fn is_service(path: &Path) -> bool {
    is_wms(path) || super::is_address(path) && path.to_str().is_some_and(is_template)
}

fn is_template(address: &str) -> bool {
    address.contains("{z}")
        && address.contains("{x}")
        && (address.contains("{y}") || address.contains("{-y}"))
}

/// The address of tiles, with places for their numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Template(String);

impl Template {
    fn of(address: &str) -> Self {
        if is_template(address) {
            return Self(address.to_owned());
        }
        let text =
            maps_of(address, &[("SRS", "EPSG:3857"), ("FORMAT", "image/png"), ("TRANSPARENT", "TRUE")]);
        Self(text + "&BBOX={west},{south},{east},{north}&WIDTH=256&HEIGHT=256")
    }

    fn address(&self, zoom: u8, column: u32, row: u32) -> String {
        let count = 1_u32 << zoom;
        let span = EQUATOR_METRES / f64::from(count);
        let west = -0.5 * EQUATOR_METRES + span * f64::from(column);
        let north = 0.5 * EQUATOR_METRES - span * f64::from(row);
        self.0
            .replace("{z}", &zoom.to_string())
            .replace("{x}", &column.to_string())
            .replace("{-y}", &(count - 1 - row).to_string())
            .replace("{y}", &row.to_string())
            .replace("{west}", &west.to_string())
            .replace("{south}", &(north - span).to_string())
            .replace("{east}", &(west + span).to_string())
            .replace("{north}", &north.to_string())
    }
}

/// The tiles of a box: those of a coarse zoom, and all that lie within them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cut {
    /// The coarse zoom.
    zoom: u8,
    /// Its first column and row; the column may lie beyond a turn.
    first: [i64; 2],
    /// Its columns and rows.
    count: [u32; 2],
}

impl Cut {
    /// The deepest zoom of which two by two tiles hold the box.
    fn of(bounds: &GeographicBox, deepest: u8) -> Self {
        let range = |zoom: u8| {
            let span = EQUATOR_METRES / f64::from(1_u32 << zoom);
            let place = |longitude: f64, latitude: f64| {
                let latitude = latitude.clamp(-LAST_LATITUDE, LAST_LATITUDE);
                let (x, y) = web_mercator_from_geographic(longitude, latitude);
                [(x + 0.5 * EQUATOR_METRES) / span, (0.5 * EQUATOR_METRES - y) / span]
            };
            let first = place(bounds.west, bounds.north).map(|value| value.floor() as i64);
            // An edge between two tiles belongs to the one within.
            let last = place(bounds.east, bounds.south).map(|value| (value - 1e-9).ceil() as i64 - 1);
            (first, [0, 1].map(|axis| last[axis].max(first[axis])))
        };
        let fits = |zoom: &u8| {
            let (first, last) = range(*zoom);
            last[0] - first[0] < 2 && last[1] - first[1] < 2
        };
        let zoom = (0..=deepest).rev().find(fits).unwrap_or(0);
        let (first, last) = range(zoom);
        let count = [0, 1].map(|axis| (last[axis] - first[axis] + 1).clamp(1, 1 << zoom.min(1)) as u32);
        Self { zoom, first, count }
    }
}

/// A service, of which a raster's chunks are asked.
#[derive(Debug)]
struct Service {
    template: Template,
    cut: Cut,
    /// Zoom of the full image; each of the others is one coarser.
    deepest: u8,
    side: u32,
}

impl Service {
    fn tile(&self, zoom: u8, column: u32, row: u32) -> Result<Option<Vec<u8>>, String> {
        let Some(body) = client().get(&self.template.address(zoom, column, row), LARGEST_TILE)? else {
            return Ok(None);
        };
        let picture = decode(&body).map_err(|problem| {
            format!("tile {zoom}/{column}/{row} is no picture ({problem}): {}", printable(&body))
        })?;
        if picture.width() != self.side || picture.height() != self.side {
            return Err(format!(
                "tile {zoom}/{column}/{row} has {} × {} pixels, others {}",
                picture.width(),
                picture.height(),
                self.side
            ));
        }
        Ok(Some(picture.into_raw()))
    }
}

impl ChunkService for Service {
    fn chunk(&self, image: u32, column: u32, row: u32) -> Result<Samples, String> {
        // Images are numbered from the deepest zoom.
        let zoom = self.deepest - image as u8;
        let shift = zoom - self.cut.zoom;
        let turn = 1_i64 << zoom;
        let column = ((self.cut.first[0] << shift) + i64::from(column)).rem_euclid(turn) as u32;
        let row = (self.cut.first[1] << shift) + i64::from(row);
        let Some(row) = u32::try_from(row).ok().filter(|row| i64::from(*row) < turn) else {
            return Ok(Samples::Sparse);
        };
        Ok(self.tile(zoom, column, row)?.map_or(Samples::Sparse, Samples::U8))
    }
}

fn decode(body: &[u8]) -> Result<image::RgbaImage, image::ImageError> {
    let mut reader = image::ImageReader::new(Cursor::new(body)).with_guessed_format()?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(SIDES[1]);
    limits.max_image_height = Some(SIDES[1]);
    reader.limits(limits);
    Ok(reader.decode()?.to_rgba8())
}

/// The pictures of a service over a box, as a raster with an overview for each zoom.
///
/// # Errors
/// One line that names the address: it cannot be asked, it gives no pictures.
pub fn open(address: &str, bounds: &GeographicBox, zoom: Option<u8>) -> Result<Raster, SourceError> {
    let deepest = zoom.unwrap_or(DEFAULT_ZOOM).min(DEEPEST_ZOOM);
    let cut = Cut::of(bounds, deepest);
    let deepest = deepest.min(cut.zoom + MOST_ZOOMS);
    let template = Template::of(address);
    let unusable = |problem: String| SourceError::Unusable {
        path: address.to_owned(),
        problem,
        mend: "check the address, and whether the server is up".to_owned(),
    };
    let side = side(&template, &cut, deepest).map_err(unusable)?;
    let tiles = |axis: usize, zoom: u8| (cut.count[axis] << (zoom - cut.zoom)) * side;
    let service = Service { template, cut, deepest, side };
    let file = Arc::new(SourceFile::of_service(Arc::new(service)));
    let images = (cut.zoom..=deepest)
        .rev()
        .zip(0..)
        .map(|(zoom, index)| {
            let layout = Layout::of_pictures(tiles(0, zoom), tiles(1, zoom), side);
            Image::new(file.clone(), index, layout)
        })
        .collect();
    let span = EQUATOR_METRES / f64::from(1_u32 << cut.zoom);
    let pixel = EQUATOR_METRES / f64::from(1_u32 << deepest) / f64::from(side);
    let crs = Crs::from_epsg(3857).map_err(|error| unusable(error.to_string()))?;
    Ok(Raster {
        path: address.to_owned(),
        images,
        affine: Affine {
            x: (-0.5 * EQUATOR_METRES + span * cut.first[0] as f64, pixel, 0.0),
            y: (0.5 * EQUATOR_METRES - span * cut.first[1] as f64, 0.0, -pixel),
        },
        crs,
        nodata: None,
        scale_and_offset: (1.0, 0.0),
        vertical_unit_metres: Some(1.0),
        big_tiff: false,
    })
}

/// The side of the service's tiles, from the first that it has: a coarse one, or one of the deeper zooms.
fn side(template: &Template, cut: &Cut, deepest: u8) -> Result<u32, String> {
    for zoom in cut.zoom..=deepest {
        let shift = zoom - cut.zoom;
        let turn = 1_i64 << zoom;
        // The tile at the box's middle.
        let middle = |axis: usize| (cut.first[axis] << shift) + (i64::from(cut.count[axis]) << shift) / 2;
        let column = middle(0).rem_euclid(turn) as u32;
        let row = middle(1).clamp(0, turn - 1) as u32;
        let Some(body) = client().get(&template.address(zoom, column, row), LARGEST_TILE)? else { continue };
        let picture =
            decode(&body).map_err(|error| format!("it gives no pictures ({error}): {}", printable(&body)))?;
        let side = picture.width();
        if picture.height() != side || !SIDES.contains(&side) {
            return Err(format!("its tiles have {side} × {} pixels; 256 or 512 are read", picture.height()));
        }
        return Ok(side);
    }
    Err("it has no tile in the middle of the terrain".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_of_tiles() {
        let xyz = Template::of("https://a.org/{z}/{x}/{y}.jpg");
        assert_eq!(xyz.address(3, 5, 1), "https://a.org/3/5/1.jpg");
        assert_eq!(Template::of("https://a.org/{z}/{x}/{-y}").address(3, 5, 1), "https://a.org/3/5/6");
        let wms = Template::of("https://a.org/wms?LAYERS=ortho&FORMAT=image/jpeg").address(1, 1, 0);
        assert_eq!(
            wms,
            "https://a.org/wms?LAYERS=ortho&FORMAT=image/jpeg&SERVICE=WMS&VERSION=1.1.1&REQUEST=GetMap&STYLES=&SRS=EPSG:3857&TRANSPARENT=TRUE&BBOX=0,0,20037508.342789244,20037508.342789244&WIDTH=256&HEIGHT=256"
        );
        for (path, is) in [
            ("https://a.org/{z}/{x}/{y}.jpg", true),
            ("https://a.org/wms?map=x&layers=y", true),
            ("https://a.org/cog.tif", false),
            ("/srv/{z}/{x}/{y}.jpg", false),
        ] {
            assert_eq!(is_service(Path::new(path)), is, "{path}");
        }
    }

    #[test]
    fn a_box_is_cut_out_of_few_coarse_tiles() {
        let alps = GeographicBox { west: 10.0, south: 46.0, east: 10.5, north: 46.4 };
        let cut = Cut::of(&alps, 18);
        assert!(
            (8..=10).contains(&cut.zoom) && cut.count.iter().all(|count| (1..=2).contains(count)),
            "{cut:?}"
        );
        assert_eq!(Cut::of(&GeographicBox::WORLD, 18).zoom, 1);
        assert_eq!(Cut::of(&GeographicBox::WORLD, 0), Cut { zoom: 0, first: [0, 0], count: [1, 1] });
        let beyond = GeographicBox { west: 179.9, south: -17.0, east: 180.1, north: -16.9 };
        let cut = Cut::of(&beyond, 18);
        assert_eq!(cut.first[0] + 1, 1 << cut.zoom, "the second column lies beyond the turn");
    }
}
