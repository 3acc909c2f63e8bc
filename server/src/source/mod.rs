//! Where data comes from: fields over the ellipsoid, whatever stands behind them.
//!
//! A recipe asks a field for values at the places of a [`SampleGrid`]; rasters in files and the
//! built-in procedural landscape answer alike.

pub mod coarse_lattice;
pub mod crs;
pub mod description;
pub mod geotiff;
pub mod growth;
pub mod land_cover_tables;
pub mod open;
mod patches;
pub mod picture;
pub mod placement;
pub mod procedural;
pub mod projector;
pub mod raster_colour;
pub mod raster_cover;
pub mod raster_height;
pub mod summary;
pub mod upstream;
mod wide;
pub mod window;

pub use geotiff::cache::held_by_all;

#[cfg(test)]
mod tests;

pub use description::Description;
pub use open::{
    HeightOptions, SourceOptions, open_canopy_height, open_colour, open_height, open_land_cover,
    open_topographic_map, photo_cover,
};

use treeline_core::grid::LatticeWindow;
use treeline_core::layer::SurfaceType;
use treeline_core::tile::GeographicBox;

/// Reference system of a request's box.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum RequestCrs {
    /// Longitude and latitude in degrees, WGS84 (CRS:84; EPSG:4326 once its axes are turned).
    Geographic,
    /// EPSG:3857, metres.
    WebMercator,
    /// The scene's own projected CRS, easting and northing in metres, by its EPSG code.
    Projected(u32),
}

/// The places at which values are wanted, row-major from the north-west.
#[derive(Clone, Debug, PartialEq)]
pub enum SampleGrid {
    /// A window of a level's lattice: values depend on the global indices alone, so that two
    /// windows that share a sample share its bits.
    Lattice(LatticeWindow),
    /// The pixel centres of any box: sample (i, j) stands at west + (i + ½)·(east − west)/width,
    /// north − (j + ½)·(north − south)/height.
    Box {
        /// Reference system of the numbers.
        crs: RequestCrs,
        /// West edge (or least easting).
        west: f64,
        /// South edge.
        south: f64,
        /// East edge.
        east: f64,
        /// North edge.
        north: f64,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
}

impl SampleGrid {
    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        match self {
            Self::Lattice(window) => (window.width, window.height),
            Self::Box { width, height, .. } => (*width, *height),
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        let (width, height) = self.size();
        width as usize * height as usize
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// What went wrong with a source: one line for people, that names the file and the mend.
#[derive(Clone, Debug, thiserror::Error)]
pub enum SourceError {
    /// The file cannot be used as it is; the text says what is wrong and what mends it.
    #[error("{path}: {problem}; {mend}")]
    Unusable {
        /// The file as the user named it.
        path: String,
        /// What is wrong.
        problem: String,
        /// What the user can do, often a gdal_translate or gdalwarp command.
        mend: String,
    },
    /// The server that has the source does not answer as it should.
    #[error("{address}: {problem}; ask again later")]
    Upstream {
        /// The source's address.
        address: String,
        /// What happened.
        problem: String,
    },
    /// Reading failed later than at opening: the file changed, or part of it is damaged.
    #[error("{path}: {problem}; the file is damaged or was not copied whole: fetch it again")]
    Read {
        /// The file as the user named it.
        path: String,
        /// What happened.
        problem: String,
    },
}

/// Where a field has data and how fine it is.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldExtent {
    /// Box in degrees (east may exceed 180).
    pub bounds: GeographicBox,
    /// Finest sample distance, metres.
    pub resolution_metres: f64,
    /// The raster's own CRS as an EPSG code, where it has one that requests may name: a projected one,
    /// or a geographic one whose coordinates are taken for WGS84's.
    pub projected_epsg: Option<u32>,
}

/// Heights of the ground, metres.
pub trait HeightField: Send + Sync {
    /// Where it has data.
    fn extent(&self) -> &FieldExtent;

    /// Fills `out` (one value a sample) with heights, NaN where there is no data. The value is that
    /// of the place, whatever the level: bilinear between the source's samples, a void never
    /// blended into data. Only the windows and overviews that the grid needs are read.
    fn sample(&self, grid: &SampleGrid, out: &mut [f32]) -> Result<(), SourceError>;

    /// For each of the columns × rows equal parts of the box (row-major from the north-west), an
    /// upper bound of the height anywhere in it, NaN where there is no data at all.
    fn maxima(&self, bounds: &GeographicBox, columns: u32, rows: u32) -> Result<Vec<f32>, SourceError>;

    /// Bounds of all heights, metres: (never above the least, never below the greatest).
    fn range(&self) -> (f32, f32);
}

/// Colours: the photo.
pub trait ColourField: Send + Sync {
    /// Where it has data.
    fn extent(&self) -> &FieldExtent;

    /// Fills `out` with RGBA, alpha 0 where there is no data (colour then 0 too), straight alpha.
    ///
    /// On the lattice, a sample at the source's own level or deeper is bilinear at its centre; on a
    /// coarser level it is the mean of the four samples of the level below, so that a parent is the
    /// mean of its children (±1). Elsewhere it is the mean over the pixel's footprint.
    fn sample(&self, grid: &SampleGrid, out: &mut [[u8; 4]]) -> Result<(), SourceError>;
}

/// What grows or lies at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cover {
    /// Species code, 0 for none (no trees). Below a [`growth::GrownCover`]: the code of a growth.
    pub species: u8,
    /// Share of the ground under crowns, 0…255.
    pub closure: u8,
    /// Height of the stand, in quarter metres (as in tiles); 0: the species' own.
    pub height: u8,
    /// What the ground is made of where no crown stands.
    pub surface: u8,
}

impl Cover {
    /// The surface type of the ground.
    pub fn surface(&self) -> SurfaceType {
        SurfaceType::from_code(self.surface).unwrap_or_default()
    }
}

/// Land cover, from a raster, a rule on the photo, or the procedural landscape.
pub trait CoverField: Send + Sync {
    /// Where it has data.
    fn extent(&self) -> &FieldExtent;

    /// Fills `out` with the cover at each sample: nearest, never blended.
    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError>;
}
