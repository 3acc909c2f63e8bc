//! Where undergrowth is drawn: the blocks of metaseeds about the eye. It needs no tiles of its own: it stands on the
//! terrain that is drawn, and the surface types that come with that say what grows.

use super::view::ViewGeometry;
use glam::DVec3;
use treeline_core::geodesy;
use treeline_core::scene::SceneDescription;
use treeline_core::seeds::metaseed::{self, REACH_UNITS, ROWS};
use treeline_core::seeds::pattern::{CELL_UNITS, CellRow, LEVEL};
use treeline_core::seeds::place::{
    UNIT_METRES, latitude_from_y, longitude_from_x, x_from_longitude, y_from_latitude,
};
use treeline_core::tile::{columns, rows};
use treeline_shaders::undergrowth::{BLOCK_SIDE, UndergrowthBlock, UndergrowthFrame};

/// Undergrowth is drawn no farther than this, whatever is asked for.
pub const FARTHEST_UNDERGROWTH_METRES: f64 = 120.0;
/// Blocks looked at in a frame at most, nearest first.
const MOST_BLOCKS: usize = 512;
/// What members hang over their block and the ground is off its bounds, metres.
const MARGIN_METRES: f64 = REACH_UNITS as f64 * UNIT_METRES + 1.5;

/// A scene's undergrowth, as far as it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UndergrowthField {
    range: f64,
}

/// The blocks of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UndergrowthBlocks {
    /// What the passes are told.
    pub frame: UndergrowthFrame,
    /// The blocks, by cell and place in it.
    pub blocks: Vec<UndergrowthBlock>,
}

impl UndergrowthField {
    /// Of a scene, up to a distance (metres); `None` where there is no land cover or none is wanted.
    pub fn new(scene: &SceneDescription, range: f64) -> Option<Self> {
        let range = range.min(FARTHEST_UNDERGROWTH_METRES);
        (scene.vegetation && scene.land_cover.is_some() && range > 0.0).then_some(Self { range })
    }

    /// Up to which distance anything is drawn, metres.
    pub fn range(&self) -> f64 {
        self.range
    }

    /// The blocks that may have a plant in the picture; `None` where there are none. `ground`: between which heights the
    /// ground lies about a place (degrees).
    pub fn blocks_in_sight(
        &self,
        view: &ViewGeometry,
        ground: impl Fn(f64, f64) -> Option<[f32; 2]>,
    ) -> Option<UndergrowthBlocks> {
        let side = i64::from(CELL_UNITS);
        let (eye_x, eye_y) = (x_from_longitude(view.eye.longitude), y_from_latitude(view.eye.latitude));
        let (whole_x, whole_y) = (eye_x.floor() as i64, eye_y.floor() as i64);
        let cosine = view.eye.latitude.to_radians().cos();
        let metres = [UNIT_METRES * cosine, UNIT_METRES];
        let reach = self.range + MARGIN_METRES;
        let all = i64::from(columns(LEVEL));
        let half = [0, 1].map(|axis| (reach / metres[axis]).ceil() as i64);
        // Near the poles, where nothing grows, a cell is no longer narrower than the reach.
        let cells_east = ((whole_x - half[0]).div_euclid(side)..=(whole_x + half[0]).div_euclid(side))
            .take(columns(LEVEL) as usize);
        let last_row = i64::from(rows(LEVEL)) - 1;
        let cells_south =
            (whole_y - half[1]).div_euclid(side).max(0)..=(whole_y + half[1]).div_euclid(side).min(last_row);
        let mut found: Vec<(f64, UndergrowthBlock)> = Vec::new();
        for row in cells_south {
            let count = metaseed::columns(&CellRow::new(row as u32));
            for column in cells_east.clone() {
                let corner = [column * side - whole_x, row * side - whole_y];
                let blocks = (0..ROWS)
                    .step_by(BLOCK_SIDE as usize)
                    .flat_map(|south| (0..count).step_by(BLOCK_SIDE as usize).map(move |east| [east, south]));
                for first in blocks {
                    let edges = [count, ROWS];
                    // Metres from the eye, east and south.
                    let apart = [0, 1].map(|axis| {
                        let from =
                            corner[axis] as f64 - ([eye_x, eye_y][axis] - [whole_x, whole_y][axis] as f64);
                        [first[axis], (first[axis] + BLOCK_SIDE).min(edges[axis])].map(|sub_cell| {
                            (from + f64::from(sub_cell) * side as f64 / f64::from(edges[axis])) * metres[axis]
                        })
                    });
                    let beside = |range: [f64; 2]| range[0].max(-range[1]).max(0.0);
                    let distance = beside(apart[0]).hypot(beside(apart[1]));
                    if distance > reach {
                        continue;
                    }
                    let Some(up) = height_bounds(&apart, metres, [eye_x, eye_y], view.eye.height, &ground)
                    else {
                        continue;
                    };
                    let distance = distance.hypot(beside(up) - MARGIN_METRES.min(beside(up)));
                    if distance > reach || is_beside(view, &apart, up) {
                        continue;
                    }
                    let block = UndergrowthBlock {
                        cell: [column.rem_euclid(all) as u32, row as u32],
                        offset: corner.map(|units| units as i32),
                        first,
                        columns: count,
                        padding: 0,
                    };
                    found.push((distance, block));
                }
            }
        }
        if found.is_empty() {
            return None;
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.truncate(MOST_BLOCKS);
        let mut blocks: Vec<UndergrowthBlock> = found.into_iter().map(|(_, block)| block).collect();
        // The same order whatever is nearest.
        blocks.sort_unstable_by_key(|block| (block.cell[1], block.cell[0], block.first[1], block.first[0]));
        let frame = self.frame(view, [eye_x, eye_y], blocks.len() as u32);
        Some(UndergrowthBlocks { frame, blocks })
    }

    fn frame(&self, view: &ViewGeometry, eye: [f64; 2], blocks: u32) -> UndergrowthFrame {
        let latitude = view.eye.latitude.to_radians();
        let side = |normal: &DVec3| {
            let unit = normal.normalize();
            [unit.x as f32, unit.y as f32, unit.z as f32, 0.0]
        };
        UndergrowthFrame {
            eye: [
                latitude.sin() as f32,
                latitude.cos() as f32,
                view.eye.height as f32,
                geodesy::prime_vertical_radius(view.eye.latitude) as f32,
            ],
            sides: view.side_normals().each_ref().map(side),
            eye_fraction: eye.map(|units| (units - units.floor()) as f32),
            range: self.range as f32,
            blocks,
            ..UndergrowthFrame::default()
        }
    }
}

/// Between which heights over the eye the ground of a block lies, metres: by its corners and its middle.
fn height_bounds(
    apart: &[[f64; 2]; 2],
    metres: [f64; 2],
    eye: [f64; 2],
    height: f64,
    ground: impl Fn(f64, f64) -> Option<[f32; 2]>,
) -> Option<[f64; 2]> {
    let [east, south] = *apart;
    let middle = [0.5 * (east[0] + east[1]), 0.5 * (south[0] + south[1])];
    let places = [[east[0], south[0]], [east[1], south[0]], middle, [east[0], south[1]], [east[1], south[1]]];
    places
        .into_iter()
        .filter_map(|[east, south]| {
            let longitude = longitude_from_x(eye[0] + east / metres[0]);
            let latitude = latitude_from_y(eye[1] + south / metres[1]);
            ground(longitude, latitude)
        })
        .map(|between| between.map(|ground| f64::from(ground) - height))
        .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// Whether a box (metres from the eye: east and south, up) lies outside the picture.
fn is_beside(view: &ViewGeometry, apart: &[[f64; 2]; 2], up: [f64; 2]) -> bool {
    view.side_normals().iter().any(|normal| {
        let farthest = |range: [f64; 2], along: f64| (range[0] * along).max(range[1] * along);
        let reach = farthest(apart[0], normal.x) + farthest(apart[1], -normal.y) + farthest(up, normal.z);
        reach < -MARGIN_METRES * normal.length()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use treeline_core::camera::GeographicCamera;

    fn view(latitude: f64, height: f64, pitch_deg: f64) -> ViewGeometry {
        let camera = GeographicCamera {
            lon: 179.9999,
            lat: latitude,
            height,
            heading_deg: 30.0,
            pitch_deg,
            fov_y_deg: 60.0,
        };
        ViewGeometry::new(&camera, 320, 240)
    }

    #[test]
    fn blocks_about_the_eye_are_looked_at_and_none_from_above() {
        let field = UndergrowthField { range: 60.0 };
        for latitude in [0.0, 47.0, -71.0, 85.0] {
            let flat = |_, _| Some([100.0, 100.0]);
            let ahead = field.blocks_in_sight(&view(latitude, 101.7, -5.0), flat).unwrap();
            let down = field.blocks_in_sight(&view(latitude, 140.0, -90.0), flat).unwrap();
            for seen in [&ahead, &down] {
                let mut places: Vec<_> = seen.blocks.iter().map(|block| (block.cell, block.first)).collect();
                assert_eq!(seen.frame.blocks as usize, places.len());
                places.sort_unstable();
                places.dedup();
                assert_eq!(places.len(), seen.blocks.len(), "each once");
            }
            // A block is 17 m wide; a sixth of the circle is in sight.
            assert!((8..120).contains(&ahead.blocks.len()), "{latitude}: {}", ahead.blocks.len());
            assert_eq!(field.blocks_in_sight(&view(latitude, 300.0, -90.0), flat), None);
            assert_eq!(field.blocks_in_sight(&view(latitude, 101.7, -5.0), |_, _| None), None);
        }
        assert_eq!(field.blocks_in_sight(&view(90.0, 1.0, -5.0), |_, _| Some([0.0, 0.0])), None);
    }
}
