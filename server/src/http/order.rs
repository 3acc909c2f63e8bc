//! What a map request comes down to, in one canonical spelling: the cache's key.

use crate::cache::TileKey;
use crate::recipe::{Drawn, Format, TileRequest};
use crate::source::{RequestCrs, SampleGrid};
use std::fmt::Write as _;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::layer::Layer;
use treeline_core::tile::{CELLS, GeographicBox, columns};

/// A map or tile to be made, with everything that cannot change its bytes set to the default, so
/// that equal answers have equal keys.
#[derive(Clone, Debug, PartialEq)]
pub struct Order(TileRequest);

impl Order {
    /// The layer's samples on a grid, in a format.
    pub fn new(layer: Layer, grid: SampleGrid, format: Format) -> Self {
        Self(TileRequest::new(layer, grid, format))
    }

    /// Sets the style `filled`: where the photo has nothing, the relief's colours.
    #[must_use]
    pub fn filled(mut self, filled: bool) -> Self {
        self.0.filled = filled && self.0.layer == Layer::Texture;
        self
    }

    /// Sets the layers that are drawn over this one, the lowest first.
    #[must_use]
    pub fn above(mut self, above: Vec<Drawn>) -> Self {
        self.0.above = above;
        self
    }

    /// Sets what pixels without data look like in pictures.
    #[must_use]
    pub fn gaps(mut self, transparent: bool, background: [u8; 3]) -> Self {
        let request = &mut self.0;
        request.transparent = transparent && matches!(request.format, Format::Png | Format::WebP);
        let is_opaque_picture = request.format.is_picture() && !request.transparent;
        request.background = if is_opaque_picture { background } else { [255; 3] };
        self
    }

    /// Sets the number for "no data" in bil.
    #[must_use]
    pub fn nodata(mut self, nodata: f64) -> Self {
        if matches!(self.0.format, Format::Bil16 | Format::Bil32 | Format::XBil32) {
            // Adding zero makes −0 the same as 0.
            self.0.nodata = nodata + 0.0;
        }
        self
    }

    /// What recipes make.
    pub fn request(&self) -> &TileRequest {
        &self.0
    }

    /// The media type of the answer: the one asked for, without parameters.
    pub fn content_type(&self) -> &'static str {
        self.0.format.content_type(self.0.layer)
    }

    /// The key: everything that changes the bytes.
    pub fn key(&self) -> TileKey {
        let request = &self.0;
        let mut text = request.layer.name().to_owned();
        for above in &request.above {
            text += if above.filled { "+filled-" } else { "+" };
            text += above.layer.name();
        }
        text += "|";
        // Writing to a String cannot fail.
        let _ = match &request.grid {
            SampleGrid::Lattice(window) => write!(
                text,
                "{}{}/{}/{}/{}x{}",
                if window.registration == Registration::Node { "nodes" } else { "cells" },
                window.level,
                window.first_row,
                window.first_column,
                window.width,
                window.height
            ),
            SampleGrid::Box { crs, west, south, east, north, width, height } => {
                let crs = match crs {
                    RequestCrs::Geographic => "geographic".to_owned(),
                    RequestCrs::WebMercator => "mercator".to_owned(),
                    RequestCrs::Projected(epsg) => format!("epsg{epsg}"),
                };
                write!(text, "{crs}/{west:?}/{south:?}/{east:?}/{north:?}/{width}x{height}")
            }
        };
        let [red, green, blue] = request.background;
        let _ = write!(
            text,
            "|{}|{}{}|{red:02x}{green:02x}{blue:02x}|{:?}",
            request.format.media_type(request.layer),
            if request.filled { "filled" } else { "" },
            if request.transparent { "+transparent" } else { "" },
            request.nodata
        );
        TileKey { product: request.layer.into(), text: text.into() }
    }
}

/// The grid of a geographic box: a window of the lattice where its pixels are one, however the box
/// is spelt and on whichever turn of longitude; else the box itself.
pub fn geographic_grid(layer: Layer, bounds: &GeographicBox, width: u32, height: u32) -> SampleGrid {
    let own = layer.row().registration;
    let other = if own == Registration::Node { Registration::Cell } else { Registration::Node };
    let window = [own, other]
        .into_iter()
        .find_map(|registration| LatticeWindow::from_pixel_box(bounds, width, height, registration));
    match window {
        Some(window) => SampleGrid::Lattice(on_the_first_turn(window)),
        None => SampleGrid::Box {
            crs: RequestCrs::Geographic,
            west: bounds.west,
            south: bounds.south,
            east: bounds.east,
            north: bounds.north,
            width,
            height,
        },
    }
}

/// The same window with its middle between 180° W and 180° E.
fn on_the_first_turn(mut window: LatticeWindow) -> LatticeWindow {
    let turn = i64::from(columns(window.level)) * i64::from(CELLS);
    let middle = window.first_column + i64::from(window.width / 2);
    window.first_column -= middle.div_euclid(turn) * turn;
    window
}

#[cfg(test)]
mod tests {
    use super::*;
    use treeline_core::tile::TileAddress;

    fn of_box(west: f64, south: f64, east: f64, north: f64, side: u32) -> Order {
        let bounds = GeographicBox { west, south, east, north };
        Order::new(Layer::Texture, geographic_grid(Layer::Texture, &bounds, side, side), Format::Png)
    }

    #[test]
    fn a_tile_has_one_key_however_it_is_spelt() {
        let key = of_box(0.0, 0.0, 90.0, 90.0, 512).key();
        assert_eq!(&*key.text, "texture|cells1/0/1024/512x512|image/png||ffffff|0.0");
        assert_eq!(of_box(1e-9, -1e-9, 90.000_000_001, 90.0, 512).key(), key);
        assert_eq!(of_box(360.0, 0.0, 450.0, 90.0, 512).key(), key);
        assert_eq!(of_box(-360.0, 0.0, -270.0, 90.0, 512).key(), key);
        assert_ne!(of_box(0.0, 0.0, 90.0, 90.0, 256).key(), key);
        assert_ne!(of_box(0.0, 0.0, 20.0, 20.0, 512).key(), of_box(0.0, 0.0, 36.0, 36.0, 512).key());
    }

    #[test]
    fn the_bordered_tile_of_every_layer_is_a_tile() {
        for layer in treeline_core::layer::LAYERS {
            let address = TileAddress::new(9, 100, 0).unwrap();
            let window = LatticeWindow::of_tile(address, layer.registration, layer.border);
            let grid = geographic_grid(layer.layer, &window.pixel_box(), window.width, window.height);
            assert_eq!(grid, SampleGrid::Lattice(window));
        }
    }

    #[test]
    fn what_changes_no_byte_changes_no_key() {
        let order = of_box(0.0, 0.0, 90.0, 90.0, 512);
        assert_eq!(order.clone().nodata(-9999.0).key(), order.key());
        assert_eq!(order.clone().gaps(true, [1, 2, 3]).key(), order.clone().gaps(true, [9; 3]).key());
        assert_ne!(order.clone().gaps(false, [1, 2, 3]).key(), order.key());
        let grid = order.request().grid.clone();
        let bil = Order::new(Layer::Elevation, grid.clone(), Format::Bil16);
        assert_eq!(bil.clone().gaps(true, [1, 2, 3]).key(), bil.key());
        assert_eq!(bil.clone().nodata(-0.0).key(), bil.key());
        assert_ne!(bil.clone().nodata(-9999.0).key(), bil.key());
        let elevation = Order::new(Layer::Elevation, grid, Format::Png);
        assert_eq!(elevation.clone().filled(true).key(), elevation.key());
        assert_ne!(order.clone().filled(true).key(), order.key());
    }
}
