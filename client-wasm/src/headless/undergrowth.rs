//! The undergrowth of the last frame, read back: for tests.

use super::HeadlessError;
use super::trees::read_buffer;
use crate::engine::Engine;
use treeline_shaders::undergrowth::{BINS, Plant, UndergrowthDraws};

/// The plants of each bin, and how many metaseeds have any; nothing where the last frame had none.
pub fn plants(engine: &Engine) -> Result<(Vec<Vec<Plant>>, u32), HeadlessError> {
    let (Some(pass), Some(seen)) = (engine.select_undergrowth(), engine.drawn_undergrowth()) else {
        return Ok((Vec::new(), 0));
    };
    let draws: Vec<UndergrowthDraws> = read_buffer(engine.gpu(), pass.draws())?;
    let counts: Vec<u32> = read_buffer(engine.gpu(), pass.counts())?;
    let all: Vec<Plant> = read_buffer(engine.gpu(), pass.plants())?;
    let draws = &draws[0].draws;
    let bins = (0..BINS as usize).map(|bin| {
        let first = counts[bin * seen.blocks.len()] as usize;
        all[first..first + draws[bin].instance_count as usize].to_vec()
    });
    Ok((bins.collect(), draws[BINS as usize].instance_count))
}
