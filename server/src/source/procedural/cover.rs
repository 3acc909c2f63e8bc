//! The massif's land cover: which trees, how dense, how tall, and what the ground is.

use super::geography::{BOUNDS, Places};
use super::ground::{Ground, Landscape, Survey};
use super::material::{Materials, for_each_place};
use crate::source::wide::wide;
use crate::source::{Cover, CoverField, FieldExtent, SampleGrid, SourceError};
use std::sync::LazyLock;
use treeline_core::layer::SurfaceType;

/// Species code of spruce in the built-in table.
const SPRUCE: u8 = 1;
/// Species code of beech in the built-in table.
const BEECH: u8 = 2;
/// Codes of the species that grow on the massif.
pub const SPECIES: [u8; 2] = [SPRUCE, BEECH];
/// Least share of crowns that counts as trees.
const LEAST_CLOSURE: f32 = 0.07;

/// Land cover of the built-in massif, by the same rules as its photo.
pub struct ProceduralCover {
    land: &'static LazyLock<Landscape>,
    extent: FieldExtent,
}

impl ProceduralCover {
    pub(super) fn new(land: &'static LazyLock<Landscape>) -> Self {
        // Stands and edges vary over 5 m and more; single trees are placed finer than that anyway.
        let extent = FieldExtent { bounds: BOUNDS, resolution_metres: 4.8, projected_epsg: None };
        Self { land, extent }
    }
}

impl CoverField for ProceduralCover {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        out.fill(Cover::default());
        let places = Places::of(grid)?;
        if places.x.is_empty() || places.y.is_empty() {
            return Ok(());
        }
        let mut survey = Survey::new(self.land, &places.x, 0.0, true);
        let mut row = vec![Ground::default(); survey.width()];
        for (&j, &y) in places.rows.iter().zip(&places.y) {
            survey.row(y, &mut row);
            let line = &mut out[j * places.width..(j + 1) * places.width];
            wide!(covers(row: &[Ground] = &row, columns: &[usize] = &places.columns, line: &mut [Cover] = line));
        }
        Ok(())
    }
}

/// Cover along a row, whose samples stand at `columns` of the line.
#[inline(always)]
fn covers(row: &[Ground], columns: &[usize], line: &mut [Cover]) {
    for_each_place(row, 0.0, |k, ground, here| line[columns[k]] = cover(ground, here));
}

/// Cover at a place.
#[inline(always)]
fn cover(ground: &Ground, here: &Materials) -> Cover {
    let bare = here.debris.max(here.rock);
    let surface = if here.water > 0.5 {
        SurfaceType::Water
    } else if here.snow > 0.5 {
        SurfaceType::Snow
    } else if bare > 0.5 && here.forest < 0.5 {
        SurfaceType::Rock
    } else if here.gravel > 0.5 || here.forest > 0.3 {
        SurfaceType::Plain
    } else {
        SurfaceType::Grass
    };
    let grows = surface != SurfaceType::Water && surface != SurfaceType::Snow;
    if !grows || here.forest < LEAST_CLOSURE {
        return Cover { species: 0, closure: 0, height: 0, surface: surface as u8 };
    }
    // Mixed in groups: the noise of a few metres, spread evenly enough over −½…½.
    let chance = 0.5 + 0.9 * (0.6 * ground.fine.other + 0.6 * ground.middle.other);
    let species = if chance < here.beech { BEECH } else { SPRUCE };
    let tallest = if species == BEECH { 27.0 } else { 31.0 };
    let stand = tallest * (0.28 + 0.72 * here.vigour) * (0.92 + 0.16 * ground.middle.soft);
    Cover {
        species,
        closure: (here.forest.min(1.0) * 255.0 + 0.5) as u8,
        height: (stand.clamp(3.0, 40.0) * 4.0 + 0.5) as u8,
        surface: surface as u8,
    }
}
