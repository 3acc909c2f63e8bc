//! Layers to look at, one over the other.

use super::{
    Drawn, RecipeError, TileRequest, combined_elevation, elevation, encode, land_cover, shaded_relief,
    texture,
};
use crate::scene::Scene;
use crate::source::SampleGrid;
use treeline_core::layer::Layer;

/// The picture in the format asked for.
pub fn make(scene: &Scene, request: &TileRequest) -> Result<Vec<u8>, RecipeError> {
    let lowest = Drawn { layer: request.layer, filled: request.filled };
    let mut pixels = layer(scene, &request.grid, lowest)?;
    for &above in &request.above {
        for (below, above) in pixels.iter_mut().zip(layer(scene, &request.grid, above)?) {
            *below = over(above, *below);
        }
    }
    encode::picture(request, pixels)
}

/// RGBA of one layer, straight alpha; nothing is drawn where it has no data.
fn layer(scene: &Scene, grid: &SampleGrid, drawn: Drawn) -> Result<Vec<[u8; 4]>, RecipeError> {
    match drawn.layer {
        Layer::Elevation => shaded_relief::pixels(grid, |grid| Ok((elevation::sample(scene, grid)?, None))),
        Layer::CombinedElevation => combined_elevation::pixels(scene, grid),
        Layer::Lcc => land_cover::pixels(scene, grid),
        Layer::Texture => texture::pixels(scene, grid, drawn.filled),
    }
}

/// One pixel over another, both with straight alpha (Porter & Duff's *over*), rounded to nearest.
pub fn over(above: [u8; 4], below: [u8; 4]) -> [u8; 4] {
    let (above_alpha, below_alpha) = (u32::from(above[3]), u32::from(below[3]));
    match (above_alpha, below_alpha) {
        (255, _) | (_, 0) => return above,
        (0, _) => return below,
        _ => {}
    }
    // In units of 1/255².
    let shown = below_alpha * (255 - above_alpha);
    let alpha = 255 * above_alpha + shown;
    let channel = |index: usize| {
        let sum = 255 * above_alpha * u32::from(above[index]) + shown * u32::from(below[index]);
        ((sum + alpha / 2) / alpha) as u8
    };
    [channel(0), channel(1), channel(2), ((alpha + 127) / 255) as u8]
}

#[cfg(test)]
mod tests {
    use super::over;

    #[test]
    fn one_over_another() {
        assert_eq!(over([1, 2, 3, 255], [9, 9, 9, 255]), [1, 2, 3, 255]);
        assert_eq!(over([1, 2, 3, 0], [9, 8, 7, 6]), [9, 8, 7, 6]);
        assert_eq!(over([1, 2, 3, 4], [9, 8, 7, 0]), [1, 2, 3, 4]);
        assert_eq!(over([255, 0, 0, 51], [0, 0, 255, 255]), [51, 0, 204, 255]);
        // Two halves cover three quarters; the upper one has two thirds of what is seen.
        assert_eq!(over([255, 0, 0, 128], [0, 0, 255, 128]), [170, 0, 85, 192]);
    }
}
