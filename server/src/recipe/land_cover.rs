//! Land-cover classes: packed by level in the own format, as colours in PNG.

use super::canopy::Anchors;
use super::encode::own;
use super::levels::{code_bits, land_cover_levels};
use super::relief_colours;
use super::stands::cover_of_cells;
use super::{RecipeError, TileRequest};
use crate::scene::Scene;
use crate::source::{Cover, SampleGrid};
use treeline_core::codec::land_cover::{CodeBits, LandCoverTile, Stands, Step};
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::layer::Layer;
use treeline_core::scene::LandCoverLevels;
use treeline_core::seeds::Window;
use treeline_core::seeds::place::UNIT_LEVEL;

/// The tile in Treeline's own format.
pub fn make(scene: &Scene, request: &TileRequest) -> Result<Vec<u8>, RecipeError> {
    Ok(tile(scene, &levels(scene)?, &own::tile_window(request)?)?.encode())
}

fn levels(scene: &Scene) -> Result<LandCoverLevels, RecipeError> {
    land_cover_levels(scene).ok_or(RecipeError::NoLayer { layer: Layer::Lcc.name() })
}

/// The classes' colours, RGBA; nothing where nothing is known.
pub fn pixels(scene: &Scene, grid: &SampleGrid) -> Result<Vec<[u8; 4]>, RecipeError> {
    let levels = levels(scene)?;
    let covers = match grid {
        SampleGrid::Lattice(window) if window.registration == Registration::Cell => {
            cover_of_cells(scene, &levels, window)?
        }
        grid => {
            let mut covers = vec![Cover::default(); grid.len()];
            if let Some(field) = &scene.cover {
                field.sample(grid, &mut covers)?;
            }
            covers
        }
    };
    Ok(covers.iter().map(|&cover| class_colour(scene, cover)).collect())
}

/// A decoded tile: what [`make`] packs as [`super::Format::Own`].
///
/// On the quadtree's levels it is what its level says; deeper, classes are repeated; coarser, each
/// cell has the class at its middle.
pub fn tile(
    scene: &Scene,
    levels: &LandCoverLevels,
    window: &LatticeWindow,
) -> Result<LandCoverTile, RecipeError> {
    let bits = code_bits(levels);
    if window.level == levels.l2 {
        return packed(scene, levels, window, bits);
    }
    let covers = cover_of_cells(scene, levels, window)?;
    let codes =
        covers.iter().map(|cover| bits.check(cover.species).map(u32::from)).collect::<Result<_, _>>()?;
    let stands = (window.level == levels.l1).then(|| Stands {
        closures: covers.iter().map(|cover| cover.closure).collect(),
        heights: covers.iter().map(|cover| cover.height).collect(),
    });
    let anchors = if window.level == levels.l1 && covers.iter().any(|cover| cover.species != 0) {
        Some(Anchors::read(scene, Anchors::window(levels.anchor, &places(window)))?.into_nodes())
    } else {
        None
    };
    let step = if window.level > levels.l1 { Step::Repeated } else { Step::Classes };
    Ok(LandCoverTile { level: window.level, side: window.width, step, bits, codes, stands, anchors })
}

/// The places of a window of cells.
fn places(window: &LatticeWindow) -> Window {
    let shift = UNIT_LEVEL - window.level;
    Window {
        west: window.first_column << shift,
        north: window.first_row << shift,
        east: (window.first_column + i64::from(window.width)) << shift,
        south: (window.first_row + i64::from(window.height)) << shift,
    }
}

fn packed(
    scene: &Scene,
    levels: &LandCoverLevels,
    window: &LatticeWindow,
    bits: CodeBits,
) -> Result<LandCoverTile, RecipeError> {
    let children = LatticeWindow {
        level: levels.l1,
        first_column: 2 * window.first_column,
        first_row: 2 * window.first_row,
        width: 2 * window.width,
        height: 2 * window.height,
        ..*window
    };
    let covers = cover_of_cells(scene, levels, &children)?;
    let width = children.width as usize;
    let mut codes = Vec::with_capacity(window.len());
    for rows in covers.chunks_exact(2 * width) {
        let (north, south) = rows.split_at(width);
        for (north, south) in north.chunks_exact(2).zip(south.chunks_exact(2)) {
            let classes = [north, south].map(|pair| [pair[0].species, pair[1].species]);
            codes.push(bits.pack(classes)?);
        }
    }
    Ok(LandCoverTile {
        level: window.level,
        side: window.width,
        step: Step::Packed,
        bits,
        codes,
        stands: None,
        anchors: None,
    })
}

/// Colour of a class; transparent where nothing is known.
fn class_colour(scene: &Scene, cover: Cover) -> [u8; 4] {
    let species = usize::from(cover.species).checked_sub(1).and_then(|index| scene.species.get(index));
    match species {
        Some(species) => {
            let [red, green, blue] = species.definition.colour;
            [red, green, blue, 255]
        }
        None => relief_colours::surface_map_colour(cover.surface())
            .map_or([0; 4], |[red, green, blue]| [red, green, blue, 255]),
    }
}
