//! What grows, from rasters: land-cover classes by a table, canopy heights, or both.

use super::geotiff::Raster;
use super::geotiff::image::ValueRule;
use super::placement::Placement;
use super::projector::Projector;
use super::raster_height::field_extent;
use super::window::{View, choose_image};
use super::{Cover, CoverField, Description, FieldExtent, SampleGrid, SourceError};
use std::collections::BTreeMap;
use std::sync::Arc;
use treeline_core::tile::CELLS;

/// Windows up to this many pixels are read at full resolution.
const FULL_WINDOW_PIXELS: f64 = 64.0 * 1024.0 * 1024.0;
/// Vegetation below this is no forest, metres.
const LEAST_TREE_METRES: f32 = 2.0;
/// Pixels coarser than this, metres, hold gaps between their crowns.
const CROWN_METRES: f64 = 3.0;
/// Share of the ground under crowns in a coarse pixel of which only the canopy's height is known, of 255.
const USUAL_CLOSURE: u8 = 200;

/// Nearest values of a raster's first band.
pub struct NearestRaster {
    raster: Arc<Raster>,
    placement: Placement,
    rule: ValueRule,
    extent: FieldExtent,
}

impl NearestRaster {
    /// Values of an open raster by a rule.
    ///
    /// # Errors
    /// Where its coordinates make no sense in its reference system.
    pub fn new(raster: Arc<Raster>, rule: ValueRule) -> Result<Self, SourceError> {
        let placement = Placement::of(&raster)?;
        let extent = field_extent(&placement);
        Ok(Self { raster, placement, rule, extent })
    }

    /// The file.
    pub fn raster(&self) -> &Raster {
        &self.raster
    }

    /// Its place.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// What there is to say about it.
    pub fn describe(&self) -> Description {
        Description::of(&self.raster, &self.placement, self.rule.nodata)
    }

    /// Calls `put` (sample's index, value; NaN where there is none) for every sample of the grid.
    fn sample(&self, grid: &SampleGrid, mut put: impl FnMut(usize, f32)) -> Result<(), SourceError> {
        let projector = Projector::new(&self.placement, grid);
        let step = projector.pixels_per_sample();
        let samples = match grid {
            SampleGrid::Lattice(_) => f64::from(CELLS).powi(2),
            SampleGrid::Box { .. } => grid.len() as f64,
        };
        let index = choose_image(&self.raster, step, samples * step.0 * step.1, FULL_WINDOW_PIXELS, 1.0);
        let image = &self.raster.images[index];
        let view = View::of(&self.raster, &self.placement, index);
        let width = grid.size().0 as usize;
        view.visit(&projector, grid.size(), &mut |block| {
            let window = if block.is_outside() {
                Vec::new()
            } else {
                view.fetch(block, |rect| {
                    image.read_values(0, rect, &self.rule).map_err(|problem| self.raster.read_error(problem))
                })?
            };
            let (left, top) = (block.window_origin.0 as f64, block.window_origin.1 as f64);
            for row in 0..block.size.1 {
                let start = (block.origin.1 + row) as usize * width + block.origin.0 as usize;
                for (index, &(u, v)) in block.row(row).iter().enumerate() {
                    let value = if u.is_nan() {
                        f32::NAN
                    } else {
                        // Half a pixel belongs to the pixel that begins there.
                        let (column, line) = ((u + 0.5).floor() - left, (v + 0.5).floor() - top);
                        window[line as usize * block.window_size.0 as usize + column as usize]
                    };
                    put(start + index, value);
                }
            }
            Ok(())
        })
    }
}

/// Land cover by classes.
pub struct RasterCover {
    classes: NearestRaster,
    table: BTreeMap<i64, Cover>,
    /// The same for 0 … 255, where nearly all classes are.
    small: [Cover; 256],
    table_name: String,
}

impl RasterCover {
    /// Classes of a raster and what they mean; a class that is not in the table is plain ground.
    pub fn new(classes: NearestRaster, table: BTreeMap<i64, Cover>, table_name: String) -> Self {
        let small = std::array::from_fn(|value| table.get(&(value as i64)).copied().unwrap_or_default());
        Self { classes, table, small, table_name }
    }

    /// The raster behind it.
    pub fn source(&self) -> &NearestRaster {
        &self.classes
    }

    /// Which table its classes follow.
    pub fn table_name(&self) -> &str {
        &self.table_name
    }

    /// The growths that its classes may have, ascending.
    pub fn growths(&self) -> Vec<u8> {
        let mut growths: Vec<u8> = self.table.values().map(|cover| cover.species).collect();
        growths.sort_unstable();
        growths.dedup();
        growths
    }

    fn of(&self, value: f32) -> Cover {
        if value.is_nan() {
            return Cover::default();
        }
        let class = value as i64;
        match usize::try_from(class) {
            Ok(index) if index < self.small.len() => self.small[index],
            _ => self.table.get(&class).copied().unwrap_or_default(),
        }
    }
}

impl CoverField for RasterCover {
    fn extent(&self) -> &FieldExtent {
        &self.classes.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        self.classes.sample(grid, |index, value| out[index] = self.of(value))
    }
}

/// Forest where a canopy-height raster says so, of the height that it says.
pub struct CanopyHeightCover {
    heights: NearestRaster,
    growth: u8,
    closure: u8,
}

impl CanopyHeightCover {
    /// Canopy heights in metres; `growth` grows there.
    pub fn new(heights: NearestRaster, growth: u8) -> Self {
        let crowns = heights.placement.resolution_metres() <= CROWN_METRES;
        Self { heights, growth, closure: if crowns { 255 } else { USUAL_CLOSURE } }
    }

    /// The raster behind it.
    pub fn source(&self) -> &NearestRaster {
        &self.heights
    }

    /// Puts the stand that a canopy of so many metres is on top of what is known of the ground.
    fn put(&self, metres: f32, ground: Cover) -> Cover {
        if metres.is_nan() {
            return ground;
        }
        if metres < LEAST_TREE_METRES {
            return Cover { species: 0, closure: 0, height: 0, surface: ground.surface };
        }
        Cover {
            species: if ground.species > 0 { ground.species } else { self.growth },
            closure: if ground.closure > 0 { ground.closure } else { self.closure },
            height: (metres * 4.0).round().clamp(1.0, 255.0) as u8,
            surface: ground.surface,
        }
    }
}

impl CoverField for CanopyHeightCover {
    fn extent(&self) -> &FieldExtent {
        &self.heights.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        self.heights.sample(grid, |index, metres| out[index] = self.put(metres, Cover::default()))
    }
}

/// Canopy heights over another cover: where and how high from the heights, species and ground from
/// the cover.
pub struct LayeredCover {
    below: Arc<dyn CoverField>,
    canopy: Arc<CanopyHeightCover>,
    extent: FieldExtent,
}

impl LayeredCover {
    /// Lays canopy heights over a cover. Where there are no heights, the cover stands as it is.
    pub fn new(below: Arc<dyn CoverField>, canopy: Arc<CanopyHeightCover>) -> Self {
        let (a, b) = (below.extent(), canopy.extent());
        let mut bounds = a.bounds;
        // Of a box that lies a turn away, the turn that joins on.
        let turn = 360.0 * ((bounds.centre().0 - b.bounds.centre().0) / 360.0).round();
        bounds.west = bounds.west.min(b.bounds.west + turn);
        bounds.east = bounds.east.max(b.bounds.east + turn);
        bounds.south = bounds.south.min(b.bounds.south);
        bounds.north = bounds.north.max(b.bounds.north);
        let extent = FieldExtent {
            bounds,
            resolution_metres: a.resolution_metres.min(b.resolution_metres),
            projected_epsg: a.projected_epsg.filter(|_| a.projected_epsg == b.projected_epsg),
        };
        Self { below, canopy, extent }
    }
}

impl CoverField for LayeredCover {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        self.below.sample(grid, out)?;
        self.canopy.heights.sample(grid, |index, metres| out[index] = self.canopy.put(metres, out[index]))
    }
}
