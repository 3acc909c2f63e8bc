//! A small world of elevation tiles of several levels, made from a function of the place, with its page table: what
//! the terrain pass sees of a scene, without a server or a client.

use crate::height_field::mountains;
use glam::{DVec2, DVec3, UVec2};
use treeline_core::camera::GeographicCamera;
use treeline_core::geodesy::{self, Geodetic};
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::ray_frame::{EyeFrame, LeafFit, TileSquare};
use treeline_core::tile::{CELLS, TileAddress, cell_metres};
use treeline_shaders::layout::{EMPTY, LEAF_BIT, Leaf, LeafPlace, ROOT_BITS, VOID_HEIGHT, View};
use treeline_shaders::twin::maximum_mip::Pyramid;
use treeline_shaders::twin::terrain::{Hit, cast_ray, pixel_share, view_ray};
use treeline_shaders::twin::{Texels, World};

/// Samples along a bordered tile's side.
pub const SIDE: u32 = CELLS + 3;

/// A tile's samples and pyramid.
pub struct Tile {
    /// Which it is.
    pub address: TileAddress,
    /// Bordered samples, metres; voids at `VOID_HEIGHT`.
    pub heights: Vec<f32>,
    /// Greatest heights.
    pub maxima: Pyramid,
    /// Least heights.
    pub minima: Pyramid,
}

/// Makes a tile's samples, row-major over the window, metres; NaN for voids.
type Sampler<'a> = &'a dyn Fn(&LatticeWindow) -> Vec<f32>;

/// A leaf of the cut: which square, drawn from which tile.
#[derive(Clone, Copy)]
struct Cut {
    square: TileAddress,
    slot: usize,
    fade: f32,
    stand_in: u32,
}

/// Tiles, and the cut that draws them.
pub struct TileWorld {
    /// By slot.
    pub tiles: Vec<Tile>,
    /// The page table.
    pub nodes: Vec<u32>,
    root: TileAddress,
    root_size: [u32; 2],
    cuts: Vec<Cut>,
    range: (f64, f64),
}

/// What a camera makes of a world.
pub struct Frame {
    /// Binding 0.
    pub view: View,
    /// Binding 2.
    pub leaves: Vec<Leaf>,
    eye: EyeFrame,
}

/// Heights of the world: alps of some 2,000 m.
pub fn alpine_height(longitude: f64, latitude: f64) -> f64 {
    // Metres, nearly.
    let (x, y) = ((longitude - 11.0) * 76_000.0, (latitude - 47.0) * 111_000.0);
    400.0 + mountains(x / 10.0, y / 10.0, 500.0, 2200.0, 21)
}

/// Samples a function of the place (longitude, latitude) over a window.
pub fn sampled(window: &LatticeWindow, height: &dyn Fn(f64, f64) -> f64) -> Vec<f32> {
    let side = i64::from(window.width);
    let at = |index| {
        let (column, row) = (window.first_column + index % side, window.first_row + index / side);
        height(window.longitude(column), window.latitude(row)) as f32
    };
    (0..side * i64::from(window.height)).map(at).collect()
}

impl Tile {
    fn new(address: TileAddress, samples: Sampler<'_>) -> Self {
        let window = LatticeWindow::of_tile(address, Registration::Node, 1);
        let mut heights = samples(&window);
        for value in heights.iter_mut().filter(|value| !value.is_finite()) {
            *value = VOID_HEIGHT;
        }
        let [maxima, minima] = [false, true].map(|minimum| Pyramid::new(&heights, SIDE, SIDE, 1, minimum));
        Self { address, heights, maxima, minima }
    }

    /// The bilinear surface at a place of the tile, in cells; `None` over a void.
    pub fn surface(&self, place: DVec2) -> Option<f64> {
        let last = f64::from(CELLS) - 1.0;
        let cell = place.floor().clamp(DVec2::ZERO, DVec2::splat(last));
        let (a, b) = (place.x - cell.x, place.y - cell.y);
        let at = |x: u32, y: u32| {
            f64::from(self.heights[((cell.y as u32 + 1 + y) * SIDE + cell.x as u32 + 1 + x) as usize])
        };
        let nodes = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
        nodes.iter().all(|&node| node > -1e29).then(|| {
            (1.0 - b) * ((1.0 - a) * nodes[0] + a * nodes[1]) + b * ((1.0 - a) * nodes[2] + a * nodes[3])
        })
    }
}

impl TileWorld {
    /// A root grid of `columns` × `rows` tiles from `root` on, in which each square for which `split` says so is
    /// divided, and those for which `empty` says so have nothing. `stands_in` says which are drawn from
    /// their parent's tile, and which share of their pixels is their own (1: no parent is needed).
    pub fn new(
        root: TileAddress,
        root_size: [u32; 2],
        height: &dyn Fn(f64, f64) -> f64,
        split: &dyn Fn(TileAddress) -> bool,
        empty: &dyn Fn(TileAddress) -> bool,
        own_share: &dyn Fn(TileAddress) -> f32,
    ) -> Self {
        let samples = |window: &LatticeWindow| sampled(window, height);
        Self::sampled(root, root_size, &samples, split, empty, own_share)
    }

    /// The same, whose tiles are sampled whole.
    pub fn sampled(
        root: TileAddress,
        root_size: [u32; 2],
        height: Sampler<'_>,
        split: &dyn Fn(TileAddress) -> bool,
        empty: &dyn Fn(TileAddress) -> bool,
        own_share: &dyn Fn(TileAddress) -> f32,
    ) -> Self {
        let mut world = Self {
            tiles: Vec::new(),
            nodes: vec![EMPTY; (root_size[0] * root_size[1]) as usize],
            root,
            root_size,
            cuts: Vec::new(),
            range: (f64::INFINITY, f64::NEG_INFINITY),
        };
        for index in 0..world.nodes.len() {
            let (column, row) = (index as u32 % root_size[0], index as u32 / root_size[0]);
            let tile = TileAddress { level: root.level, row: root.row + row, column: root.column + column };
            let slot = world.slot_of(tile, height);
            world.cuts.push(Cut { square: tile, slot, fade: 1.0, stand_in: EMPTY });
        }
        for index in 0..world.nodes.len().min((root_size[0] * root_size[1]) as usize) {
            let square = world.cuts[index].square;
            let entry = world.entry_of(square, height, split, empty, own_share);
            world.nodes[index] = entry;
        }
        for tile in &world.tiles {
            for &value in tile.heights.iter().filter(|&&value| value > VOID_HEIGHT) {
                world.range = (world.range.0.min(f64::from(value)), world.range.1.max(f64::from(value)));
            }
        }
        world
    }

    fn slot_of(&mut self, address: TileAddress, height: Sampler<'_>) -> usize {
        if let Some(slot) = self.tiles.iter().position(|tile| tile.address == address) {
            return slot;
        }
        self.tiles.push(Tile::new(address, height));
        self.tiles.len() - 1
    }

    fn entry_of(
        &mut self,
        square: TileAddress,
        height: Sampler<'_>,
        split: &dyn Fn(TileAddress) -> bool,
        empty: &dyn Fn(TileAddress) -> bool,
        own_share: &dyn Fn(TileAddress) -> f32,
    ) -> u32 {
        if empty(square) {
            return EMPTY;
        }
        if split(square) {
            let first = self.nodes.len();
            self.nodes.extend([EMPTY; 4]);
            for (index, child) in square.children().into_iter().enumerate() {
                self.nodes[first + index] = self.entry_of(child, height, split, empty, own_share);
            }
            return first as u32;
        }
        let share = own_share(square);
        let mut stand_in = EMPTY;
        if share < 1.0 {
            let parent = square.parent().expect("a square that fades has a parent");
            let slot = self.slot_of(parent, height);
            stand_in = self.cuts.len() as u32;
            self.cuts.push(Cut { square, slot, fade: 1.0, stand_in: EMPTY });
        }
        let slot = self.slot_of(square, height);
        self.cuts.push(Cut { square, slot, fade: share, stand_in });
        LEAF_BIT | (self.cuts.len() as u32 - 1)
    }

    /// The squares of the cut, those of stand-ins too.
    pub fn squares(&self) -> impl Iterator<Item = TileAddress> + '_ {
        self.cuts.iter().map(|cut| cut.square)
    }

    /// Least and greatest height.
    pub fn range(&self) -> (f64, f64) {
        self.range
    }

    /// The tile that a leaf of a frame is drawn from.
    pub fn tile_of(&self, leaf: u32) -> &Tile {
        &self.tiles[self.cuts[leaf as usize].slot]
    }

    /// Grid coordinates of a place, where it lies in the root grid.
    fn grid_of(&self, longitude: f64, latitude: f64) -> Option<UVec2> {
        let bounds = self.root.bounds();
        let span = bounds.east - bounds.west;
        let x = (longitude - bounds.west) / span;
        let y = (bounds.north - latitude) / span;
        let inside = (0.0..f64::from(self.root_size[0])).contains(&x)
            && (0.0..f64::from(self.root_size[1])).contains(&y);
        let unit = f64::from(1_u32 << ROOT_BITS);
        inside.then(|| UVec2::new((x * unit) as u32, (y * unit) as u32))
    }

    /// The tile under a place by the cut, and the place in it, in cells. Fading squares answer their own tile.
    pub fn tile_at(&self, longitude: f64, latitude: f64) -> Option<(&Tile, DVec2)> {
        let grid = self.grid_of(longitude, latitude)?;
        let mut entry =
            self.nodes[((grid.y >> ROOT_BITS) * self.root_size[0] + (grid.x >> ROOT_BITS)) as usize];
        let mut bits = ROOT_BITS;
        while entry & LEAF_BIT == 0 {
            bits -= 1;
            entry = self.nodes[(entry + (grid.x >> bits & 1) + 2 * (grid.y >> bits & 1)) as usize];
        }
        if entry == EMPTY {
            return None;
        }
        let tile = &self.tiles[self.cuts[(entry & !LEAF_BIT) as usize].slot];
        let bounds = tile.address.bounds();
        let step = (bounds.east - bounds.west) / f64::from(CELLS);
        Some((tile, DVec2::new((longitude - bounds.west) / step, (bounds.north - latitude) / step)))
    }

    /// The frame of a camera.
    pub fn frame(&self, camera: &GeographicCamera, size: [u32; 2]) -> Frame {
        let eye = EyeFrame::at(camera.place());
        let leaves = self.cuts.iter().map(|cut| self.leaf(cut, &eye)).collect();
        let axes = camera.enu_from_view();
        let half = (0.5 * camera.fov_y_deg.to_radians()).tan();
        let vector = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
        let grid = self.grid_of(camera.lon, camera.lat);
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let view = View {
            right: vector(axes.x_axis * half * aspect, camera.fov_y_deg.to_radians() / f64::from(size[1])),
            up: vector(axes.y_axis * half, camera.height),
            forward: vector(-axes.z_axis, self.range.1),
            sun: [0.0, 0.0, 1.0, geodesy::gaussian_radius(camera.lat) as f32],
            size,
            root_size: self.root_size,
            eye_grid: grid.unwrap_or_default().to_array(),
            eye_inside: u32::from(grid.is_some()),
            root_level: u32::from(self.root.level),
            ..View::default()
        };
        Frame { view, leaves, eye }
    }

    fn leaf(&self, cut: &Cut, eye: &EyeFrame) -> Leaf {
        let tile = &self.tiles[cut.slot];
        let (u, v, side) =
            cut.square.place_in_ancestor(tile.address.level).expect("a tile covers its squares");
        let fit = LeafFit::new(tile.address, TileSquare { u, v, side }, self.range);
        let deeper = cut.square.level - self.root.level;
        let unit = 1_u32 << (ROOT_BITS - u32::from(deeper));
        let metres = cell_metres(tile.address.level) as f32;
        let cosine = cut.square.bounds().centre().1.to_radians().cos() as f32;
        Leaf::from_frame(
            &fit.at_eye(eye),
            &LeafPlace {
                first_cell: [u as u32, v as u32],
                cells: [side as u32; 2],
                grid_origin: [
                    (cut.square.column - (self.root.column << deeper)) * unit,
                    (cut.square.row - (self.root.row << deeper)) * unit,
                ],
                grid_side: unit,
                slot: cut.slot as u32,
                level: tile.address.level,
                stand_in: cut.stand_in,
                maximum: tile.maxima.mips.last().map_or(0.0, |(_, _, texels)| texels[0]),
                fade: cut.fade,
                cell_metres: [metres * cosine, metres],
            },
        )
    }

    /// What the passes of a frame have bound.
    pub fn bound<'a>(&'a self, frame: &'a Frame) -> World<'a, Self> {
        World {
            view: &frame.view,
            nodes: &self.nodes,
            leaves: &frame.leaves,
            texels: self,
            sheet: None,
            use_minima: false,
        }
    }

    /// The root tile in the north-west, and the columns and rows of roots.
    pub fn roots(&self) -> (TileAddress, [u32; 2]) {
        (self.root, self.root_size)
    }

    /// The pixel's answer by the twin.
    pub fn by_twin(&self, frame: &Frame, pixel: UVec2) -> Hit {
        cast_ray(&self.bound(frame), &view_ray(&frame.view, pixel), pixel_share(pixel))
    }

    /// Height of a ray's point over the surface (f64, by the exact conversion): `None` beside the data and over voids.
    pub fn clearance(&self, frame: &Frame, direction: DVec3, distance: f64) -> Option<f64> {
        let point = frame.eye.ecef + frame.eye.ecef_from_enu * (direction * distance);
        let Geodetic { longitude, latitude, height } = geodesy::geodetic_from_ecef(point);
        let (tile, place) = self.tile_at(longitude, latitude)?;
        tile.surface(place).map(|surface| height - surface)
    }
}

impl Frame {
    /// Direction of a pixel's ray, f64.
    pub fn direction(&self, camera: &GeographicCamera, pixel: UVec2) -> DVec3 {
        let axes = camera.enu_from_view();
        let half = (0.5 * camera.fov_y_deg.to_radians()).tan();
        let [width, height] = self.view.size.map(f64::from);
        let x = ((f64::from(pixel.x) + 0.5) * 2.0 / width - 1.0) * half * width / height;
        let y = (1.0 - (f64::from(pixel.y) + 0.5) * 2.0 / height) * half;
        (axes * DVec3::new(x, y, -1.0)).normalize()
    }
}

impl Texels for TileWorld {
    fn height(&self, slot: u32, x: i32, y: i32) -> f32 {
        self.tiles[slot as usize].heights[(y as u32 * SIDE + x as u32) as usize]
    }

    fn maximum(&self, slot: u32, mip: u32, x: i32, y: i32) -> f32 {
        self.tiles[slot as usize].maxima.at(mip, x, y)
    }

    fn minimum(&self, slot: u32, mip: u32, x: i32, y: i32) -> f32 {
        self.tiles[slot as usize].minima.at(mip, x, y)
    }

    fn levels(&self) -> u32 {
        self.tiles[0].maxima.mips.len() as u32
    }
}
