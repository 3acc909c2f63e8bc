//! The massif's land cover: which trees, how dense, how tall, and what the ground is.

use super::geography::{BOUNDS, Places};
use super::ground::{Ground, Landscape, Survey};
use super::material::{Materials, for_each_place};
use crate::source::wide::wide;
use crate::source::{Cover, CoverField, FieldExtent, SampleGrid, SourceError};
use std::sync::LazyLock;
use treeline_core::layer::SurfaceType;

/// A species of the massif: its code in the built-in table, and the height of its best stands, metres.
type Grown = (u8, f32);

const SPRUCE: Grown = (1, 31.0);
const BEECH: Grown = (2, 27.0);
const FIR: Grown = (3, 33.0);
const LARCH: Grown = (4, 28.0);
const PINE: Grown = (5, 22.0);
const STONE_PINE: Grown = (6, 18.0);
const OAK: Grown = (7, 24.0);
const BIRCH: Grown = (8, 19.0);
const WILLOW: Grown = (9, 14.0);
const SHRUB: Grown = (10, 3.5);
const DWARF_PINE: Grown = (11, 3.0);
/// Codes of the species that grow on the massif.
pub const SPECIES: [u8; 11] = [
    SPRUCE.0,
    BEECH.0,
    FIR.0,
    LARCH.0,
    PINE.0,
    STONE_PINE.0,
    OAK.0,
    BIRCH.0,
    WILLOW.0,
    SHRUB.0,
    DWARF_PINE.0,
];
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
    let (species, tallest) = species(ground, here);
    let stand = tallest * (0.28 + 0.72 * here.vigour) * (0.92 + 0.16 * ground.middle.soft);
    Cover {
        species,
        closure: (here.forest.min(1.0) * 255.0 + 0.5) as u8,
        height: (stand.clamp(2.5, 40.0) * 4.0 + 0.5) as u8,
        surface: surface as u8,
    }
}

/// What grows at a place: leaves below and needles above, as the photo has it, and among those by height, slope and
/// thinness of the wood.
#[inline(always)]
fn species(ground: &Ground, here: &Materials) -> Grown {
    let (broad, middle, fine) = (&ground.broad, &ground.middle, &ground.fine);
    // Mixed in groups: the noise of a few metres, spread evenly enough over −½…½.
    let leaves = 0.5 + 0.9 * (0.6 * fine.other + 0.6 * middle.other) < here.beech;
    // Among either, in patches with frayed edges.
    let patch = 0.5 + 0.55 * middle.soft + 0.4 * fine.soft;
    let height = ground.height + 150.0 * broad.soft;
    // Where the wood is thin or young.
    let open = 1.0 - here.forest.min(1.0);
    if leaves {
        if ground.above_stream < 4.0 && patch > 0.35 && here.forest > 0.4 {
            return WILLOW;
        }
        let oaks = 1.0 - (height - 640.0).max(0.0) / 320.0;
        return if patch < 0.15 + 0.75 * open {
            BIRCH
        } else if 1.0 - patch < 0.9 * oaks {
            OAK
        } else {
            BEECH
        };
    }
    if here.vigour < 0.1 && patch < 0.6 {
        return if height < 2_010.0 && patch < 0.3 { SHRUB } else { DWARF_PINE };
    }
    let larches = 0.06 + 0.62 * ((height - 1_380.0) / 420.0).clamp(0.0, 1.0) + 0.25 * open;
    if patch < larches {
        return LARCH;
    }
    if height > 1_640.0 && 1.0 - patch < 0.3 {
        return STONE_PINE;
    }
    let dry = (here.steep - 0.6).clamp(0.0, 0.3) + 0.2 * open;
    if height < 1_640.0 && 1.0 - patch < 0.12 + dry {
        return PINE;
    }
    // Firs in what is moist.
    let hollow = 0.12 + (0.02 * ground.hollow).clamp(-0.1, 0.2);
    if height < 1_350.0 && (patch - 0.55).abs() < hollow { FIR } else { SPRUCE }
}
