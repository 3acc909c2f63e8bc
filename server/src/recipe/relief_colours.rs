//! Colours of the ground where there is no photo: by height, slope and what is known to lie there.

use crate::source::Cover;
use treeline_core::layer::SurfaceType;
use treeline_core::seeds::Species;

/// Tints of open ground by height, metres and sRGB: meadow, pasture, scree, snow.
const TINTS: [(f32, [f32; 3]); 8] = [
    (0.0, [122.0, 148.0, 92.0]),
    (400.0, [138.0, 158.0, 98.0]),
    (1_000.0, [158.0, 164.0, 108.0]),
    (1_700.0, [168.0, 160.0, 116.0]),
    (2_300.0, [164.0, 152.0, 126.0]),
    (2_900.0, [166.0, 160.0, 150.0]),
    (3_500.0, [214.0, 216.0, 220.0]),
    (4_300.0, [246.0, 248.0, 252.0]),
];
const ROCK: [f32; 3] = [134.0, 126.0, 116.0];
const SEA: [f32; 3] = [98.0, 136.0, 164.0];
const WATER: [f32; 3] = [74.0, 112.0, 142.0];
const SNOW: [f32; 3] = [240.0, 244.0, 250.0];
const GRASS: [f32; 3] = [136.0, 158.0, 92.0];
/// Slopes (rise over run) between which open ground gives way to rock.
const ROCK_SLOPES: (f32, f32) = (0.75, 1.35);
/// Ground as low and as flat as this is the sea (many terrain models fill it with zeros).
const SEA_SLOPE: f32 = 1e-4;

/// Colour of the ground, sRGB 0 … 255: `height` in metres, `slope` as rise over run.
pub fn ground(height: f32, slope: f32, cover: Option<(Cover, &[Species])>) -> [f32; 3] {
    let steep = smooth_step(ROCK_SLOPES.0, ROCK_SLOPES.1, slope);
    let open = |colour: [f32; 3]| mix(colour, ROCK, steep);
    let Some((cover, species)) = cover else {
        return if height <= 0.0 && slope < SEA_SLOPE { SEA } else { open(tint(height)) };
    };
    let bare = match cover.surface() {
        SurfaceType::Water => WATER,
        SurfaceType::Snow => SNOW,
        SurfaceType::Rock => ROCK,
        SurfaceType::Grass => open(mix(tint(height), GRASS, 0.6)),
        SurfaceType::Plain | SurfaceType::Canopy => {
            if height <= 0.0 && slope < SEA_SLOPE {
                SEA
            } else {
                open(tint(height))
            }
        }
    };
    let trees = usize::from(cover.species).checked_sub(1).and_then(|index| species.get(index));
    match trees {
        // Crowns and their shadows are darker than the same green in a map.
        Some(trees) => {
            let green = trees.definition.colour.map(|value| 0.85 * f32::from(value));
            mix(bare, green, f32::from(cover.closure) / 255.0)
        }
        None => bare,
    }
}

/// Colour of a surface type in maps of land cover; none for [`SurfaceType::Plain`], of which nothing
/// is known.
pub fn surface_map_colour(surface: SurfaceType) -> Option<[u8; 3]> {
    match surface {
        SurfaceType::Plain => None,
        SurfaceType::Canopy => Some([60, 110, 60]),
        SurfaceType::Water => Some([90, 150, 200]),
        SurfaceType::Rock => Some([150, 140, 130]),
        SurfaceType::Snow => Some([240, 245, 250]),
        SurfaceType::Grass => Some([184, 204, 120]),
    }
}

fn tint(height: f32) -> [f32; 3] {
    let above = TINTS.iter().position(|&(from, _)| from > height).unwrap_or(TINTS.len());
    if above == 0 {
        return TINTS[0].1;
    }
    if above == TINTS.len() {
        return TINTS[above - 1].1;
    }
    let ((low, from), (high, to)) = (TINTS[above - 1], TINTS[above]);
    mix(from, to, (height - low) / (high - low))
}

/// `a` + `share`·(`b` − `a`).
pub fn mix(a: [f32; 3], b: [f32; 3], share: f32) -> [f32; 3] {
    std::array::from_fn(|channel| a[channel] + share * (b[channel] - a[channel]))
}

/// 0 below `from`, 1 above `to`, smooth between.
pub fn smooth_step(from: f32, to: f32, value: f32) -> f32 {
    let share = ((value - from) / (to - from)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
