//! Which layers a scene has, and on which levels.

use crate::scene::Scene;
use crate::source::FieldExtent;
use treeline_core::layer::{LAYERS, Layer, LayerRow};
use treeline_core::tile::{CELLS, GeographicBox, MAXIMUM_LEVEL, level_for_cell_metres, span_degrees};

/// Whether the scene has the layer: all have terrain and colours, some have land cover.
pub fn has_layer(scene: &Scene, layer: Layer) -> bool {
    layer != Layer::Lcc || scene.cover.is_some()
}

/// The scene's rows of the layer table.
pub fn layers(scene: &Scene) -> impl Iterator<Item = &'static LayerRow> {
    LAYERS.iter().filter(move |row| has_layer(scene, row.layer))
}

/// WMS names of the scene's layers.
pub fn layer_names(scene: &Scene) -> Vec<&'static str> {
    layers(scene).map(|row| row.name).collect()
}

/// The field that says where a layer has data.
pub fn extent(scene: &Scene, layer: Layer) -> &FieldExtent {
    match layer {
        Layer::Elevation | Layer::CombinedElevation => scene.height.extent(),
        // The style "filled" gives colours wherever there is terrain.
        Layer::Texture => scene.height.extent(),
        Layer::Lcc => scene.cover.as_ref().map_or(scene.height.extent(), |cover| cover.extent()),
    }
}

/// Crowns are a few metres wide: where trees grow, the combined map is worth asking for to this
/// sample distance, metres, however coarse the terrain under them.
const CANOPY_DETAIL_METRES: f64 = 0.7;

/// Deepest level of a layer: below it the source has no more detail.
pub fn maximum_level(scene: &Scene, layer: Layer) -> u8 {
    let terrain = level_for_cell_metres(scene.height.extent().resolution_metres);
    match layer {
        Layer::Elevation => terrain,
        Layer::CombinedElevation if scene.cover.is_some() => {
            terrain.max(level_for_cell_metres(CANOPY_DETAIL_METRES))
        }
        Layer::CombinedElevation => terrain,
        Layer::Texture => match &scene.colour {
            Some(colour) => level_for_cell_metres(colour.extent().resolution_metres),
            // Colours of the relief have the relief's detail.
            None => terrain,
        },
        Layer::Lcc => crate::recipe::land_cover_levels(scene).map_or(terrain, |levels| levels.l0),
    }
}

/// Coarsest level at which a tile of the extent shows more than a speck: its longer side covers at
/// least an eighth of a tile's cells.
pub fn minimum_level(extent: &GeographicBox) -> u8 {
    let span = (extent.east - extent.west).max(extent.north - extent.south);
    let wanted = f64::from(CELLS) / 8.0;
    (0..MAXIMUM_LEVEL)
        .find(|&level| span / span_degrees(level) * f64::from(CELLS) >= wanted)
        .unwrap_or(MAXIMUM_LEVEL)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speck_is_not_shown() {
        let of = |span: f64| {
            minimum_level(&GeographicBox {
                west: 10.0,
                south: 46.0,
                east: 10.0 + span,
                north: 46.0 + span / 2.0,
            })
        };
        assert_eq!(of(360.0), 0);
        // 0.5° are 64 cells of 1/128°: level 5.5, so the next deeper.
        assert_eq!(of(0.5), 6);
        assert_eq!(of(0.0), MAXIMUM_LEVEL);
    }
}
