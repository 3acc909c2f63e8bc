//! Numbers of a frame.

use serde_json::{Value, json};
use std::collections::BTreeSet;
use treeline_client::headless::Capture;
use treeline_client::stream::view::ViewGeometry;
use treeline_core::tile::{self, TileAddress};

/// A photo texel may be as long as this many pixels, looked at squarely.
const TEXEL_PIXELS: f64 = 1.42;

/// The middle one of some numbers (the upper of two), 0 for none.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

/// Mean, 99th percentile and largest.
pub fn fetch_statistics(fetches: impl Iterator<Item = u32>) -> Value {
    let mut sorted: Vec<u32> = fetches.collect();
    sorted.sort_unstable();
    let sum: u64 = sorted.iter().map(|&count| u64::from(count)).sum();
    let mean = sum as f64 / sorted.len().max(1) as f64;
    let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).or(sorted.last()).copied();
    json!({"mean": mean, "p99": at(0.99).unwrap_or(0), "max": sorted.last().copied().unwrap_or(0)})
}

/// The photo tiles that a frame needs: for each pixel that hits, the one at the smallest level whose texel
/// is small enough for its distance, or on the source's deepest.
pub fn visible_textures(capture: &Capture, view: &ViewGeometry, deepest: u8) -> BTreeSet<TileAddress> {
    let mut tiles = BTreeSet::new();
    for (index, &distance) in capture.distance.iter().enumerate() {
        if distance < 0.0 {
            continue;
        }
        let (x, y) = (index as u32 % capture.width, index as u32 / capture.width);
        let direction = view.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let place = view.geodetic(direction * f64::from(distance));
        let longest = TEXEL_PIXELS * f64::from(distance) * view.pixel_angle;
        let level = (0..deepest).find(|&level| tile::cell_metres(level) <= longest).unwrap_or(deepest);
        tiles.insert(TileAddress::at(level, place.longitude, place.latitude));
    }
    tiles
}

/// Tiles as `[level, row, column]`.
pub fn addresses<'a>(tiles: impl IntoIterator<Item = &'a TileAddress>) -> Value {
    tiles.into_iter().map(|tile| json!([tile.level, tile.row, tile.column])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles() {
        let statistics = fetch_statistics(0..1000);
        assert_eq!((statistics["p99"].as_u64(), statistics["max"].as_u64()), (Some(990), Some(999)));
        assert_eq!(fetch_statistics(std::iter::empty())["max"], 0);
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
    }
}
