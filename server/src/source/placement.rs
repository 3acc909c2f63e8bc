//! Where a raster lies on the ellipsoid: from longitude and latitude to its pixels, exactly.

use super::SourceError;
use super::crs::{Crs, OutOfDomain};
use super::geotiff::Raster;
use super::geotiff::georeference::Affine;
use treeline_core::geodesy;
use treeline_core::tile::GeographicBox;

/// Points along each side by which the geographic bounds of a projected raster are found.
const EDGE_POINTS: u32 = 64;

/// A raster's place. Pixel coordinates here have whole numbers at pixel *centres*: the raster
/// covers −½ … width − ½.
#[derive(Clone, Debug)]
pub struct Placement {
    crs: Crs,
    crs_from_pixel: Affine,
    pixel_from_crs: Affine,
    width: u32,
    height: u32,
    /// First coordinate of its middle, in its own system.
    middle_x: f64,
    bounds: GeographicBox,
    /// Its middle in degrees, on the turn on which its own coordinates count.
    centre: (f64, f64),
    pixels_per_degree: (f64, f64),
    wraps: bool,
}

impl Placement {
    /// The place of an open file.
    ///
    /// # Errors
    /// Where the coordinates make no sense in the reference system.
    pub fn of(raster: &Raster) -> Result<Self, SourceError> {
        let (width, height) = raster.size();
        Self::new(raster.crs.clone(), raster.affine, width, height).map_err(|OutOfDomain| {
            raster.unusable(
                &format!("its coordinates do not lie in its reference system, {}", raster.crs),
                "give the right one with --assume-crs EPSG:N, or gdal_edit.py -a_srs EPSG:N FILE",
            )
        })
    }

    /// A raster of so many pixels under an affine transform in a reference system.
    ///
    /// # Errors
    /// Where its middle lies outside the system's domain.
    pub fn new(crs: Crs, crs_from_pixel: Affine, width: u32, height: u32) -> Result<Self, OutOfDomain> {
        let middle = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        let (x, y) = crs_from_pixel.apply(middle.0, middle.1);
        let centre = crs.to_geographic(x, y)?;
        if centre.1.abs() > 90.0 || centre.0.abs() > 720.0 {
            return Err(OutOfDomain);
        }
        let mut placement = Self {
            pixel_from_crs: crs_from_pixel.inverse(),
            crs,
            crs_from_pixel,
            width,
            height,
            middle_x: x,
            bounds: GeographicBox::WORLD,
            centre,
            pixels_per_degree: (1.0, 1.0),
            wraps: false,
        };
        let (mut bounds, whole_turn) = placement.find_bounds()?;
        // West in −180 … 180, as everybody expects; the east may then exceed 180.
        let turn = 360.0 * ((bounds.west + 180.0) / 360.0 + 1e-9).floor();
        bounds.west -= turn;
        bounds.east -= turn;
        placement.bounds = bounds;
        placement.wraps = whole_turn;
        placement.pixels_per_degree = placement.measure();
        Ok(placement)
    }

    /// Bounds in degrees, and whether rows go once round the Earth and join.
    fn find_bounds(&self) -> Result<(GeographicBox, bool), OutOfDomain> {
        let (width, height) = (f64::from(self.width), f64::from(self.height));
        let mut bounds = GeographicBox {
            west: f64::INFINITY,
            south: f64::INFINITY,
            east: f64::NEG_INFINITY,
            north: f64::NEG_INFINITY,
        };
        let mut missed = 0;
        for row in 0..=EDGE_POINTS {
            for column in 0..=EDGE_POINTS {
                let place = |index: u32, side: f64| f64::from(index) / f64::from(EDGE_POINTS) * side;
                let (x, y) = self.crs_from_pixel.apply(place(column, width), place(row, height));
                let Ok((longitude, latitude)) = self.crs.to_geographic(x, y) else {
                    missed += 1;
                    continue;
                };
                let longitude = if self.crs.is_plain_geographic() {
                    longitude
                } else {
                    nearest_turn(longitude, self.centre.0)
                };
                bounds.west = bounds.west.min(longitude);
                bounds.east = bounds.east.max(longitude);
                bounds.south = bounds.south.min(latitude);
                bounds.north = bounds.north.max(latitude);
            }
        }
        if bounds.west > bounds.east || bounds.south < -90.0 - 2.0 || bounds.north > 90.0 + 2.0 {
            return Err(OutOfDomain);
        }
        let step = self.crs_from_pixel.pixel_size().0;
        let turn = width * step;
        let period = if self.crs.is_plain_geographic() {
            360.0
        } else if self.crs.is_web_mercator() {
            geodesy::EQUATOR_METRES
        } else {
            f64::INFINITY
        };
        // Rows join where they are a whole turn to half a pixel; one doubled column still joins.
        let whole_turn = self.crs_from_pixel.is_axis_aligned() && (turn - period).abs() < 1.5 * step;
        if turn > period + 1.5 * step {
            return Err(OutOfDomain);
        }
        for (pole, latitude) in [(&mut bounds.north, 90.0), (&mut bounds.south, -90.0)] {
            let inside = !self.crs.is_plain_geographic()
                && self.exact_pixel(self.centre.0, latitude).is_ok_and(|(u, v)| self.contains_pixel(u, v));
            if inside {
                *pole = latitude;
                (bounds.west, bounds.east) = (-180.0, 180.0);
            }
        }
        if whole_turn || missed > 0 || bounds.east - bounds.west > 359.0 {
            // Round the Earth, or partly outside the projection's domain.
            if !whole_turn {
                (bounds.west, bounds.east) = (-180.0, 180.0);
            } else {
                bounds.east = bounds.west + 360.0;
            }
        }
        bounds.south = bounds.south.max(-90.0);
        bounds.north = bounds.north.min(90.0);
        Ok((bounds, whole_turn))
    }

    /// Pixels that one passes per degree of longitude and of latitude, at the middle.
    fn measure(&self) -> (f64, f64) {
        let (longitude, latitude) = self.centre;
        // A step of about a pixel, away from the poles.
        let size = self.crs_from_pixel.pixel_size();
        let metres = size.0.min(size.1) * self.crs.metres_per_unit();
        let step = (metres / geodesy::EQUATOR_METRES * 360.0).clamp(1e-9, 1.0);
        let inward = if latitude > 0.0 { -step } else { step };
        let from = self.exact_pixel(longitude, latitude);
        let distance = |to: Result<(f64, f64), OutOfDomain>| match (from, to) {
            (Ok(a), Ok(b)) => (a.0 - b.0).hypot(a.1 - b.1) / step,
            _ => 1.0 / step,
        };
        let along_parallel = distance(self.exact_pixel(longitude + step, latitude));
        let along_meridian = distance(self.exact_pixel(longitude, latitude + inward));
        (along_parallel.max(1e-9), along_meridian.max(1e-9))
    }

    /// Reference system.
    pub fn crs(&self) -> &Crs {
        &self.crs
    }

    /// Transform from its pixels (corners at whole numbers) to the system's coordinates.
    pub fn crs_from_pixel(&self) -> &Affine {
        &self.crs_from_pixel
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Bounds in degrees.
    pub fn bounds(&self) -> GeographicBox {
        self.bounds
    }

    /// Whether its last column is the first one's western neighbour.
    pub fn wraps(&self) -> bool {
        self.wraps
    }

    /// Pixels passed per degree of longitude and of latitude, at its middle.
    pub fn pixels_per_degree(&self) -> (f64, f64) {
        self.pixels_per_degree
    }

    /// The sample distance along a meridian, in metres, at which neither direction skips a pixel: what
    /// [`treeline_core::tile::level_for_cell_metres`] wants.
    pub fn resolution_metres(&self) -> f64 {
        geodesy::EQUATOR_METRES / 360.0 / self.pixels_per_degree.0.max(self.pixels_per_degree.1)
    }

    /// Whether a pixel coordinate lies in the raster (with a millionth of a pixel to spare).
    pub fn contains_pixel(&self, u: f64, v: f64) -> bool {
        let spare = 0.5 + 1e-6;
        u >= -spare
            && u <= f64::from(self.width) - 1.0 + spare
            && v >= -spare
            && v <= f64::from(self.height) - 1.0 + spare
    }

    /// Pixel coordinate of a place. Latitudes beyond a pole are those of the far side.
    ///
    /// # Errors
    /// [`OutOfDomain`] where the projection does not reach.
    pub fn exact_pixel(&self, longitude: f64, latitude: f64) -> Result<(f64, f64), OutOfDomain> {
        let (mut longitude, latitude) = over_the_pole(longitude, latitude);
        if self.crs.is_web_mercator() {
            longitude = nearest_turn(longitude, self.centre.0);
        }
        let (mut x, y) = self.crs.from_geographic(longitude, latitude)?;
        if self.crs.is_geographic() {
            // A raster may count its longitudes beyond ±180: the turn is the one on which it lies.
            x = nearest_turn(x, self.middle_x);
        }
        Ok(self.pixel_of(x, y))
    }

    /// Pixel coordinate of a point of the raster's own system.
    pub fn pixel_of(&self, x: f64, y: f64) -> (f64, f64) {
        let (column, row) = self.pixel_from_crs.apply(x, y);
        (column - 0.5, row - 0.5)
    }

    /// Whether a geographic box may touch the raster; generous by some pixels.
    pub fn may_touch(&self, west: f64, south: f64, east: f64, north: f64) -> bool {
        let spare_x = 3.0 / self.pixels_per_degree.0 + 0.01 * (self.bounds.east - self.bounds.west);
        let spare_y = 3.0 / self.pixels_per_degree.1 + 0.01 * (self.bounds.north - self.bounds.south);
        if south < -90.0 || north > 90.0 {
            return true;
        }
        self.bounds.intersects(&GeographicBox {
            west: west - spare_x,
            south: south - spare_y,
            east: east + spare_x,
            north: north + spare_y,
        })
    }
}

/// The longitude plus whole turns that lies nearest to `centre`: in centre − 180 … centre + 180.
pub fn nearest_turn(longitude: f64, centre: f64) -> f64 {
    longitude - 360.0 * ((longitude - centre) / 360.0 + 0.5).floor()
}

/// A latitude beyond a pole, brought back on the far side of the Earth.
pub fn over_the_pole(longitude: f64, latitude: f64) -> (f64, f64) {
    if latitude > 90.0 {
        (longitude + 180.0, 180.0 - latitude)
    } else if latitude < -90.0 {
        (longitude + 180.0, -180.0 - latitude)
    } else {
        (longitude, latitude)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn north_up(x: f64, y: f64, size: f64) -> Affine {
        Affine { x: (x, size, 0.0), y: (y, 0.0, -size) }
    }

    #[test]
    fn a_raster_over_the_antimeridian_keeps_its_box_small() {
        let crs = Crs::from_epsg(32760).unwrap();
        let (x, y) = crs.from_geographic(179.9, -17.0).unwrap();
        let placement = Placement::new(crs, north_up(x - 50_000.0, y + 50_000.0, 100.0), 1000, 1000).unwrap();
        let bounds = placement.bounds();
        assert!(bounds.west > 178.0 && bounds.east > 180.0 && bounds.east < 182.0, "{bounds:?}");
        let east_of_it = placement.exact_pixel(-179.9, -17.0).unwrap();
        assert!((placement.exact_pixel(180.1, -17.0).unwrap().0 - east_of_it.0).abs() < 1e-6);
        assert!((placement.resolution_metres() - 100.0).abs() < 2.0);
    }

    #[test]
    fn a_raster_over_a_pole_reaches_it() {
        let placement =
            Placement::new(Crs::from_epsg(3031).unwrap(), north_up(-1e6, 1e6, 1000.0), 2000, 2000).unwrap();
        assert_eq!(placement.bounds().south, -90.0);
        assert_eq!((placement.bounds().west, placement.bounds().east), (-180.0, 180.0));
    }

    #[test]
    fn a_world_grid_wraps_and_a_regional_one_does_not() {
        let world = Placement::new(Crs::wgs84(), north_up(-180.0, 90.0, 0.25), 1440, 720).unwrap();
        assert!(world.wraps());
        let shifted = Placement::new(Crs::wgs84(), north_up(0.0, 90.0, 0.25), 1440, 720).unwrap();
        assert!(shifted.wraps());
        let (u, _) = shifted.exact_pixel(-90.0, 0.0).unwrap();
        assert!((u - (1080.0 - 0.5)).abs() < 1e-9);
        assert!(!Placement::new(Crs::wgs84(), north_up(5.0, 50.0, 0.01), 100, 100).unwrap().wraps());
    }

    #[test]
    fn longitudes_may_be_counted_on_any_turn() {
        let systems = [Crs::wgs84(), Crs::from_epsg(4277).unwrap()];
        for crs in systems {
            let at = |west: f64| Placement::new(crs.clone(), north_up(west, 55.0, 0.01), 100, 100).unwrap();
            let plain = at(-3.0);
            for turn in [-360.0, 360.0] {
                let turned = at(-3.0 + turn);
                let (bounds, expected) = (turned.bounds(), plain.bounds());
                assert!((bounds.west - expected.west).abs() < 1e-9, "{bounds:?}");
                assert!((bounds.east - expected.east).abs() < 1e-9, "{bounds:?}");
                for longitude in [-2.5, 357.5] {
                    let (found, expected) =
                        (turned.exact_pixel(longitude, 54.5), plain.exact_pixel(longitude, 54.5));
                    let (found, expected) = (found.unwrap(), expected.unwrap());
                    assert!((found.0 - expected.0).abs() < 1e-6 && (found.1 - expected.1).abs() < 1e-6);
                    assert!(turned.contains_pixel(found.0, found.1));
                }
            }
        }
    }

    #[test]
    fn coordinates_that_are_not_degrees_are_refused() {
        assert!(Placement::new(Crs::wgs84(), north_up(5e5, 5e6, 30.0), 100, 100).is_err());
    }
}
