//! The URL of a tile: a WMS 1.3.0 GetMap request whose box is the tile's bordered box.

use crate::grid::LatticeWindow;
use crate::layer::Layer;
use crate::tile::TileAddress;

/// Style in which the client asks for the photo: where the photo has nothing, the relief's colours.
pub const FILLED_STYLE: &str = "filled";

/// The query string (no `?`) by which the client asks for a tile in its layer's own format, with
/// its border. `revision` is the scene's data version and makes the answer immutable for caches.
///
/// Numbers are written as the shortest decimals that read back as the same f64, so the server
/// finds the lattice again exactly ([`LatticeWindow::from_pixel_box`]).
pub fn get_map_query(layer: Layer, address: TileAddress, revision: &str) -> String {
    let row = layer.row();
    let window = LatticeWindow::of_tile(address, row.registration, row.border);
    let bounds = window.pixel_box();
    let style = if layer == Layer::Texture { FILLED_STYLE } else { "" };
    format!(
        "SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS={}&STYLES={style}&CRS=CRS:84&BBOX={},{},{},{}&WIDTH={}&HEIGHT={}&FORMAT={}&revision={revision}",
        row.name,
        bounds.west,
        bounds.south,
        bounds.east,
        bounds.north,
        window.width,
        window.height,
        row.client_format,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_query_of_a_tile() {
        let address = TileAddress::new(1, 0, 2).unwrap();
        assert_eq!(
            get_map_query(Layer::Lcc, address, "7"),
            "SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=lcc&STYLES=&CRS=CRS:84&BBOX=0,0,90,90&WIDTH=512&HEIGHT=512&FORMAT=application/vnd.treeline.lcc&revision=7"
        );
    }
}
