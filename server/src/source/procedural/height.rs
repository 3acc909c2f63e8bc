//! The massif as a height field.

use super::geography::{self, BOUNDS, Places, east_from_longitude, north_from_latitude};
use super::ground::{Ground, Landscape, Survey, cell_of};
use crate::source::{FieldExtent, HeightField, SampleGrid, SourceError};
use std::sync::LazyLock;
use treeline_core::tile::GeographicBox;

/// Heights of the built-in massif: a function of the place alone, detail down to 1 m.
pub struct ProceduralHeight {
    land: &'static LazyLock<Landscape>,
    extent: FieldExtent,
}

impl ProceduralHeight {
    pub(super) fn new(land: &'static LazyLock<Landscape>) -> Self {
        let extent = FieldExtent { bounds: BOUNDS, resolution_metres: 1.0, projected_epsg: None };
        Self { land, extent }
    }
}

impl HeightField for ProceduralHeight {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [f32]) -> Result<(), SourceError> {
        out.fill(f32::NAN);
        let places = Places::of(grid)?;
        if places.x.is_empty() || places.y.is_empty() {
            return Ok(());
        }
        let mut survey = Survey::new(self.land, &places.x, 0.0, false);
        let mut row = vec![Ground::default(); survey.width()];
        for (&j, &y) in places.rows.iter().zip(&places.y) {
            survey.row(y, &mut row);
            let line = &mut out[j * places.width..(j + 1) * places.width];
            for (&i, ground) in places.columns.iter().zip(&row) {
                line[i] = ground.height;
            }
        }
        Ok(())
    }

    fn maxima(&self, bounds: &GeographicBox, columns: u32, rows: u32) -> Result<Vec<f32>, SourceError> {
        let mut out = vec![f32::NAN; columns as usize * rows as usize];
        let across = parts(columns, |k| {
            let at = |k: f64| bounds.west + (bounds.east - bounds.west) * k / f64::from(columns);
            let half = 0.5 * (BOUNDS.east - BOUNDS.west) * geography::METRES_PER_DEGREE_EAST;
            let west = east_from_longitude(at(f64::from(k)));
            clipped(
                west,
                west + (bounds.east - bounds.west) / f64::from(columns) * geography::METRES_PER_DEGREE_EAST,
                half,
            )
        });
        let down = parts(rows, |k| {
            let at = |k: f64| bounds.north - (bounds.north - bounds.south) * k / f64::from(rows);
            let half = 0.5 * (BOUNDS.north - BOUNDS.south) * geography::METRES_PER_DEGREE_NORTH;
            clipped(north_from_latitude(at(f64::from(k + 1))), north_from_latitude(at(f64::from(k))), half)
        });
        for (j, row) in down.iter().enumerate() {
            for (i, column) in across.iter().enumerate() {
                if let (Some(row), Some(column)) = (row, column) {
                    out[j * columns as usize + i] = self.land.bound(*column, *row);
                }
            }
        }
        Ok(out)
    }

    fn range(&self) -> (f32, f32) {
        let all = (1, super::massif::SIDE - 3);
        (self.land.lower_bound(), self.land.bound(all, all))
    }
}

fn parts(count: u32, cells: impl Fn(u32) -> Option<(usize, usize)>) -> Vec<Option<(usize, usize)>> {
    (0..count).map(cells).collect()
}

/// First and last grid cell of the part of low…high (metres) that lies within ±half.
fn clipped(low: f64, high: f64, half: f64) -> Option<(usize, usize)> {
    // A metre of margin: parts are cut in degrees, cells in metres.
    let (low, high) = ((low - 1.0).max(-half), (high + 1.0).min(half));
    (low <= high).then(|| (cell_of(low).0, cell_of(high).0))
}
