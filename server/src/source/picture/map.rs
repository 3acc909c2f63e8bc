//! Forest and water of a topographic map: by their tints, with the gaps closed that lettering, roads and contours tear
//! into them, then blurred into a cover.
//!
//! Closing is dilating twice, then eroding twice, with 3 × 3 kernels as 3 × 1 and 1 × 3 (dilating and eroding by turns
//! would close only gaps of two cells). Masks are bytes and kernels whole numbers, so that a cell's cover depends on
//! nothing but the cells around it.

use super::tint::Tint;
use super::{Judge, Patch, Picture};
use crate::source::{Cover, SourceError};
use std::sync::{Arc, Mutex, PoisonError};
use treeline_core::layer::SurfaceType;

/// Times that masks grow and shrink again.
const CLOSINGS: usize = 2;
/// Cells that the blur reaches.
const BLUR_REACH: usize = 2;
/// Covers from this are forest, of 255; it grows as densely as the blurred cover says, up to the second.
const LEAST_COVER: u8 = 90;
const FULL_CLOSURE: u32 = 215;
/// Where more than this of the cells around is tinted as forest, blue is print in it, of 255.
const PRINT_SHARE: u8 = 50;
const SET: u8 = 255;

/// What a person says of a map's colours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapKey {
    /// Colours of forest; none: found by itself.
    pub forest: Vec<[u8; 3]>,
    /// Colours of water; none: whatever is blue.
    pub water: Vec<[u8; 3]>,
    /// Distance within which a colour is taken for a given one.
    pub tolerance: Option<f64>,
}

impl MapKey {
    /// Default distance from a given colour.
    pub const TOLERANCE: f64 = 24.0;
}

/// The judge of maps.
pub struct MapJudge {
    growth: u8,
    key: MapKey,
    /// The forest tint, found when the map is first asked for.
    forest: Mutex<Option<Arc<Tint>>>,
    water: Tint,
}

impl MapJudge {
    /// A judge whose forests are of a growth.
    pub fn new(growth: u8, key: MapKey) -> Self {
        let tolerance = key.tolerance.unwrap_or(MapKey::TOLERANCE) as f32;
        let given =
            |colours: &[[u8; 3]]| (!colours.is_empty()).then(|| Tint::Colours(colours.to_vec(), tolerance));
        let water = given(&key.water).unwrap_or(Tint::WATER);
        let forest = Mutex::new(given(&key.forest).map(Arc::new));
        Self { growth, key, forest, water }
    }

    /// What the person said.
    pub fn key(&self) -> &MapKey {
        &self.key
    }

    fn forest(&self, picture: &Picture) -> Result<Arc<Tint>, SourceError> {
        // A panic elsewhere leaves it whole: it is written in one step.
        let mut held = self.forest.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(tint) = &*held {
            return Ok(Arc::clone(tint));
        }
        let tint = Arc::new(Tint::of_forest(&picture.probes()?));
        *held = Some(Arc::clone(&tint));
        Ok(tint)
    }
}

impl Judge for MapJudge {
    fn margin(&self) -> u32 {
        // Closing, opening by one, blur.
        (2 * CLOSINGS + 2 + BLUR_REACH) as u32
    }

    fn needs_terrain(&self) -> bool {
        false
    }

    fn judge(&self, picture: &Picture, patch: &Patch) -> Result<Vec<Cover>, SourceError> {
        let forest = self.forest(picture)?;
        let (width, height) = (patch.width(), patch.height());
        let mask = |tint: &Tint| -> Vec<u8> {
            let held = |colour: &[u8; 4]| colour[3] != 0 && tint.holds([colour[0], colour[1], colour[2]]);
            patch.colours.iter().map(|colour| if held(colour) { SET } else { 0 }).collect()
        };
        let tinted = mask(&forest);
        let around = blurred(&tinted, width);
        let cover = blurred(&closed(tinted, width), width);
        let mut blue = closed(mask(&self.water), width);
        // What is narrower than three cells is a stream or a letter.
        blue = grown(&shrunk(&blue, width), width);
        let margin = self.margin() as usize;
        let mut covers = Vec::with_capacity((width - 2 * margin) * (height - 2 * margin));
        for row in margin..height - margin {
            for index in row * width + margin..(row + 1) * width - margin {
                covers.push(if patch.colours[index][3] == 0 {
                    Cover::default()
                } else if blue[index] == SET && around[index] < PRINT_SHARE {
                    Cover { surface: SurfaceType::Water as u8, ..Cover::default() }
                } else if cover[index] >= LEAST_COVER {
                    let closure = (u32::from(cover[index]) * FULL_CLOSURE / 255) as u8;
                    Cover { species: self.growth, closure, height: 0, surface: SurfaceType::Plain as u8 }
                } else {
                    Cover::default()
                });
            }
        }
        Ok(covers)
    }
}

/// Grown [`CLOSINGS`] times, then shrunk as often.
fn closed(mut mask: Vec<u8>, width: usize) -> Vec<u8> {
    for _ in 0..CLOSINGS {
        mask = grown(&mask, width);
    }
    for _ in 0..CLOSINGS {
        mask = shrunk(&mask, width);
    }
    mask
}

/// The greatest of 3 × 3.
fn grown(mask: &[u8], width: usize) -> Vec<u8> {
    separable(mask, width, |[a, b, c]| a.max(b).max(c))
}

/// The least of 3 × 3.
fn shrunk(mask: &[u8], width: usize) -> Vec<u8> {
    separable(mask, width, |[a, b, c]| a.min(b).min(c))
}

/// A function of three, along rows and then along columns; the edge is repeated.
fn separable(mask: &[u8], width: usize, of: impl Fn([u8; 3]) -> u8) -> Vec<u8> {
    let mut rows = Vec::with_capacity(mask.len());
    for line in mask.chunks_exact(width) {
        for column in 0..width {
            rows.push(of([line[column.saturating_sub(1)], line[column], line[(column + 1).min(width - 1)]]));
        }
    }
    let height = mask.len() / width;
    let mut out = Vec::with_capacity(mask.len());
    for row in 0..height {
        let line = |row: usize| &rows[row * width..(row + 1) * width];
        let (above, here, below) = (line(row.saturating_sub(1)), line(row), line((row + 1).min(height - 1)));
        out.extend((0..width).map(|column| of([above[column], here[column], below[column]])));
    }
    out
}

/// Weighted mean over 5 × 5: 1, 4, 6, 4, 1 along either axis, of 16.
fn blurred(mask: &[u8], width: usize) -> Vec<u8> {
    const WEIGHTS: [u32; 2 * BLUR_REACH + 1] = [1, 4, 6, 4, 1];
    let height = mask.len() / width;
    let near = |at: usize, step: usize, count: usize| (at + step).saturating_sub(BLUR_REACH).min(count - 1);
    let mut rows = Vec::with_capacity(mask.len());
    for line in mask.chunks_exact(width) {
        for column in 0..width {
            let part = |step: usize| WEIGHTS[step] * u32::from(line[near(column, step, width)]);
            rows.push((0..WEIGHTS.len()).map(part).sum::<u32>());
        }
    }
    let mut out = Vec::with_capacity(mask.len());
    for row in 0..height {
        for column in 0..width {
            let part = |step: usize| WEIGHTS[step] * rows[near(row, step, height) * width + column];
            out.push(((0..WEIGHTS.len()).map(part).sum::<u32>() / 256) as u8);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closing_heals_four_cells_and_not_five() {
        let width = 40;
        let torn = |gap: usize| -> Vec<u8> {
            (0..width * width)
                .map(|index| if (18..18 + gap).contains(&(index % width)) { 0 } else { SET })
                .collect()
        };
        assert!(closed(torn(4), width).iter().all(|&cell| cell == SET));
        assert!(closed(torn(5), width).contains(&0));
        // Growing and shrinking by turns heals less.
        let turns = shrunk(&grown(&shrunk(&grown(&torn(4), width), width), width), width);
        assert!(turns.contains(&0));
    }

    #[test]
    fn closing_keeps_the_outline() {
        let width = 30;
        let square: Vec<u8> = (0..width * width)
            .map(|index| {
                let inside = |at: usize| (10..20).contains(&at);
                if inside(index % width) && inside(index / width) { SET } else { 0 }
            })
            .collect();
        assert_eq!(closed(square.clone(), width), square);
        let soft = blurred(&square, width);
        assert_eq!(soft[15 * width + 15], SET);
        assert!((100..180).contains(&soft[15 * width + 10]), "half at the edge: {}", soft[15 * width + 10]);
        assert_eq!(soft[15 * width + 5], 0);
    }
}
