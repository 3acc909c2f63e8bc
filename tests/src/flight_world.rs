//! An analytic landscape as a server would give it: hills, a photo of them, and a sea without data in the east.

use treeline_client::engine::{Payload, PhotoPixels};
use treeline_client::stream::decode::{ELEVATION_SIDE, TEXTURE_SIDE};
use treeline_client::stream::requests::TileKey;
use treeline_client::stream::view::ViewGeometry;
use treeline_core::camera::GeographicCamera;
use treeline_core::codec::elevation::{
    ElevationTile, Surface, VOID, lattice_above_metres, lattice_from_metres,
};
use treeline_core::geodesy;
use treeline_core::grid::LatticeWindow;
use treeline_core::layer::Layer;
use treeline_core::scene::{SceneDescription, SceneLayer, Sun};
use treeline_core::tile::{CELLS, GeographicBox, TileAddress};

/// Where there is terrain, or sea.
pub const EXTENT: GeographicBox = GeographicBox { west: 10.8, south: 46.8, east: 11.5, north: 47.3 };
/// East of this there are no data.
pub const COAST: f64 = 11.3;
/// Mean height, and how far the hills rise over it and the valleys lie below, metres.
const HEIGHTS: [f64; 2] = [1_400.0, 400.0];
/// Hills along a degree of longitude and of latitude, radians: one in some 3 km.
const WAVES: [f64; 2] = [150.0, 190.0];
/// Deepest levels of elevation and photo.
pub const DEEPEST: [u8; 2] = [14, 16];
/// The coarsest tiles stray from the hills by less than this, metres.
const STRAY_METRES: f64 = 25.0;
/// At least so far from the coast (and the extent's edge) coarse tiles have data, degrees.
const MARGIN: f64 = 0.01;

/// Height of the land, metres; NaN over the sea.
pub fn height(longitude: f64, latitude: f64) -> f64 {
    if longitude > COAST {
        return f64::NAN;
    }
    HEIGHTS[0] + HEIGHTS[1] * (longitude * WAVES[0]).sin() * (latitude * WAVES[1]).cos()
}

/// The highest hill's height, metres.
pub fn highest() -> f64 {
    HEIGHTS[0] + HEIGHTS[1]
}

/// The landscape as `/scene.json` would describe it.
pub fn scene() -> SceneDescription {
    let row = |name: Layer, maximum_level| SceneLayer {
        name,
        title: name.row().title.into(),
        minimum_level: 0,
        maximum_level,
        registration: name.row().registration,
        border: name.row().border,
        client_format: name.row().client_format.into(),
        formats: vec![],
        extent: EXTENT,
    };
    SceneDescription {
        name: "hills by the sea".into(),
        revision: "1".into(),
        wms: "/wms?".into(),
        attribution: vec![],
        extent: EXTENT,
        minimum_height: HEIGHTS[0] - HEIGHTS[1],
        maximum_height: highest(),
        layers: vec![row(Layer::CombinedElevation, DEEPEST[0]), row(Layer::Texture, DEEPEST[1])],
        vegetation: true,
        land_cover: None,
        species: vec![],
        trees: None,
        seed: 1,
        sun: Sun { time: "2026-07-15T09:00:00Z".into() },
        camera: GeographicCamera {
            lon: 11.0,
            lat: 47.0,
            height: 2_500.0,
            heading_deg: 0.0,
            pitch_deg: -15.0,
            fov_y_deg: 50.0,
        },
        places: vec![],
    }
}

/// A tile's answer.
pub fn payload(key: TileKey) -> Payload {
    if key.layer.is_elevation() { Payload::Bytes(elevation(key.address)) } else { photo(key.address) }
}

/// Whether an elevation tile has nothing.
pub fn is_empty(address: &TileAddress) -> bool {
    address.bounds().west > COAST
}

/// Whether a square certainly has data on every level, and land enough that none may be left out.
pub fn has_land(address: &TileAddress) -> bool {
    let bounds = address.bounds();
    let land = GeographicBox { east: COAST, ..EXTENT };
    bounds.west < land.east - MARGIN
        && bounds.east > land.west + MARGIN
        && bounds.south < land.north - MARGIN
        && bounds.north > land.south + MARGIN
}

fn elevation(address: TileAddress) -> Vec<u8> {
    let window = LatticeWindow::of_tile(address, treeline_core::grid::Registration::Node, 1);
    let side = ELEVATION_SIDE as usize;
    // The hills are a product of waves along each axis.
    let along = |index: usize| window.longitude(window.first_column + index as i64);
    let east: Vec<f64> = (0..side).map(|column| (along(column) * WAVES[0]).sin()).collect();
    let land: Vec<bool> = (0..side).map(|column| along(column) <= COAST).collect();
    let down = |index: usize| (window.latitude(window.first_row + index as i64) * WAVES[1]).cos();
    let metres = |east: f64, north: f64| HEIGHTS[0] + HEIGHTS[1] * east * north;
    let heights: Vec<i32> = (0..side)
        .map(down)
        .flat_map(|north| {
            let columns = east.iter().zip(&land);
            columns.map(
                move |(&east, &land)| {
                    if land { lattice_from_metres(metres(east, north), address.level) } else { VOID }
                },
            )
        })
        .collect();
    // A bound for every block alike: conservative is enough.
    let bound = lattice_above_metres(highest(), address.level);
    let blocks = 64_usize;
    let cells = CELLS as usize / blocks;
    let maxima = (0..blocks * blocks).map(|index| if land[index % blocks * cells] { bound } else { VOID });
    let surface = Some(Surface { types: vec![5; side * side], canopy: vec![0; side * side], species: None });
    let (maxima_side, maxima) = (blocks as u32, maxima.collect());
    ElevationTile { level: address.level, side: ELEVATION_SIDE, heights, maxima_side, maxima, surface }
        .encode()
}

/// Meadows and fields, smooth enough that every level shows the same.
fn photo(address: TileAddress) -> Payload {
    let bounds = address.bounds();
    let texel = (bounds.east - bounds.west) / f64::from(CELLS);
    let at = |index: u32| (f64::from(index) - 3.5) * texel;
    let wave = |angle: f64| (127.5 + 100.0 * angle.sin()) as u8;
    let east: Vec<u8> = (0..TEXTURE_SIDE).map(|x| wave((bounds.west + at(x)) * 700.0)).collect();
    let mut rgba = Vec::with_capacity(4 * (TEXTURE_SIDE * TEXTURE_SIDE) as usize);
    for y in 0..TEXTURE_SIDE {
        let north = wave((bounds.north - at(y)) * 900.0);
        for &east in &east {
            rgba.extend([east, north, 60, 255]);
        }
    }
    Payload::Photo { width: TEXTURE_SIDE, height: TEXTURE_SIDE, pixels: PhotoPixels::Rgba(rgba) }
}

/// Whether the ray through a pixel's centre certainly meets the land, whatever level it is drawn from: it goes
/// deeper below the hills than the coarsest tile strays from them.
pub fn certainly_hits(view: &ViewGeometry, x: u32, y: u32) -> bool {
    /// Length of a step, as a share of the distance; and the first one, metres.
    const STEP: (f64, f64) = (0.02, 20.0);
    let direction = view.direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
    let radius = geodesy::gaussian_radius(view.eye.latitude);
    let bend = (1.0 - direction.z * direction.z) / (2.0 * radius);
    let lowest = if direction.z < 0.0 {
        view.eye.height - direction.z * direction.z / (4.0 * bend).max(1e-12)
    } else {
        view.eye.height
    };
    if lowest > highest() {
        return false;
    }
    let metres = [
        geodesy::prime_vertical_radius(view.eye.latitude) * view.eye.latitude.to_radians().cos(),
        geodesy::meridian_radius(view.eye.latitude),
    ]
    .map(|radius| radius.to_radians());
    let mut distance = 0.0_f64;
    while distance < 120_000.0 {
        distance += STEP.1.max(STEP.0 * distance);
        let above = view.eye.height + distance * (direction.z + distance * bend);
        if direction.z > 0.0 && above > highest() {
            return false;
        }
        let longitude = view.eye.longitude + distance * direction.x / metres[0];
        let latitude = view.eye.latitude + distance * direction.y / metres[1];
        let inside = (EXTENT.west + MARGIN..COAST - MARGIN).contains(&longitude)
            && (EXTENT.south + MARGIN..EXTENT.north - MARGIN).contains(&latitude);
        let below = |longitude, latitude, above| above < height(longitude, latitude) - STRAY_METRES;
        if inside && below(longitude, latitude, above) {
            // Degrees are counted out plainly above: a few dozen metres off, far away.
            let place = view.geodetic(direction * distance);
            if below(place.longitude, place.latitude, place.height) {
                return true;
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use treeline_client::stream::decode;

    #[test]
    fn tiles_are_what_the_hills_are() {
        let address = TileAddress::at(12, 11.1, 47.05);
        let pixels = decode::elevation(&elevation(address), address).unwrap();
        let bounds = address.bounds();
        let step = (bounds.east - bounds.west) / f64::from(CELLS);
        for (u, v) in [(3.0, 500.0), (256.0, 1.0)] {
            let found = pixels.summary.height(u, v).unwrap();
            assert!((found - height(bounds.west + u * step, bounds.north - v * step)).abs() < 0.1);
        }
        let sea = TileAddress::at(12, 11.4, 47.0);
        assert!(is_empty(&sea) && decode::elevation(&elevation(sea), sea).unwrap().summary.is_empty());
    }

    #[test]
    fn a_ray_down_hits_and_one_up_does_not() {
        let camera = GeographicCamera { pitch_deg: -20.0, ..scene().camera };
        let view = ViewGeometry::new(&camera, 40, 40);
        assert!(certainly_hits(&view, 20, 39) && !certainly_hits(&view, 20, 0));
    }
}
