//! Pixel coordinates for the samples of a grid, many at once.
//!
//! Projecting is dear, so it is exact at anchors every 32 samples and cubic between them. Each
//! cell between anchors is checked against the exact projection at its middle; where that differs,
//! the cell is cut to anchors every 8 samples, and where that still differs every sample is exact.
//! All of it depends on global lattice indices alone, never on the window that was asked for: two
//! windows that share a sample get the same bits.

use super::crs::Crs;
use super::placement::{Placement, over_the_pole};
use super::{RequestCrs, SampleGrid};
use treeline_core::geodesy;

/// Samples between anchors.
const COARSE: i64 = 32;
/// Samples between anchors in a cell that bends.
const FINE: i64 = 8;
/// Greatest difference at a cell's middle, source pixels.
const TOLERANCE: f64 = 0.000_2;

type Pixel = (f64, f64);
const NOWHERE: Pixel = (f64::NAN, f64::NAN);

/// A grid seen from a raster.
pub struct Projector<'a> {
    placement: &'a Placement,
    grid: &'a SampleGrid,
    kind: Kind,
    /// The request's system, where it is a projected one that is not the raster's own.
    foreign: Option<Crs>,
}

enum Kind {
    /// Column fixes u, row fixes v.
    Separable,
    /// The request speaks the raster's own system.
    Affine,
    General,
}

impl<'a> Projector<'a> {
    /// Looks at a grid from a raster.
    pub fn new(placement: &'a Placement, grid: &'a SampleGrid) -> Self {
        let crs = placement.crs();
        let cylindrical = crs.is_plain_geographic() || crs.is_web_mercator();
        let cylindrical_request = match grid {
            SampleGrid::Lattice(_) => true,
            SampleGrid::Box { crs, .. } => !matches!(crs, RequestCrs::Projected(_)),
        };
        let own = matches!(grid, SampleGrid::Box { crs: RequestCrs::Projected(code), .. } if crs.epsg() == Some(*code));
        let kind = if own {
            Kind::Affine
        } else if cylindrical && cylindrical_request && placement.crs_from_pixel().is_axis_aligned() {
            Kind::Separable
        } else {
            Kind::General
        };
        let foreign = match grid {
            SampleGrid::Box { crs: RequestCrs::Projected(code), .. } if !own => Crs::from_epsg(*code).ok(),
            _ => None,
        };
        Self { placement, grid, kind, foreign }
    }

    /// Global index of the grid's first sample.
    fn first(&self) -> (i64, i64) {
        match self.grid {
            SampleGrid::Lattice(window) => (window.first_column, window.first_row),
            SampleGrid::Box { .. } => (0, 0),
        }
    }

    /// Coordinates in the request's system of a (fractional) global index; geographic ones in degrees.
    fn place(&self, column: f64, row: f64) -> (f64, f64) {
        match self.grid {
            SampleGrid::Lattice(window) => {
                let offset = match window.registration {
                    treeline_core::grid::Registration::Cell => 0.5,
                    treeline_core::grid::Registration::Node => 0.0,
                };
                let step = window.step_degrees();
                (-180.0 + (column + offset) * step, 90.0 - (row + offset) * step)
            }
            SampleGrid::Box { west, south, east, north, width, height, .. } => (
                west + (column + 0.5) * ((east - west) / f64::from(*width)),
                north - (row + 0.5) * ((north - south) / f64::from(*height)),
            ),
        }
    }

    /// Longitude and latitude of a global index, degrees; `None` outside the request system's domain.
    fn geographic(&self, column: f64, row: f64) -> Option<(f64, f64)> {
        let (x, y) = self.place(column, row);
        match self.grid {
            SampleGrid::Box { crs: RequestCrs::WebMercator, .. } => {
                Some(geodesy::geographic_from_web_mercator(x, y))
            }
            SampleGrid::Box { crs: RequestCrs::Projected(_), .. } => {
                self.foreign.as_ref()?.to_geographic(x, y).ok()
            }
            _ => Some((x, y)),
        }
    }

    /// Pixel coordinate of a global index, exactly.
    pub fn exact(&self, column: f64, row: f64) -> Pixel {
        if let Kind::Affine = self.kind {
            let (x, y) = self.place(column, row);
            return self.placement.pixel_of(x, y);
        }
        self.geographic(column, row)
            .and_then(|(longitude, latitude)| self.placement.exact_pixel(longitude, latitude).ok())
            .unwrap_or(NOWHERE)
    }

    /// Pixels that one passes from a sample to the next along a row and along a column, at the
    /// middle of the grid or wherever near it the projection reaches. For a lattice it is the level's
    /// own figure at the raster's middle, the same for every window.
    pub fn pixels_per_sample(&self) -> (f64, f64) {
        match self.grid {
            SampleGrid::Lattice(window) => {
                let step = window.step_degrees();
                let (x, y) = self.placement.pixels_per_degree();
                (step * x, step * y)
            }
            SampleGrid::Box { width, height, .. } => {
                let mut least = (f64::INFINITY, f64::INFINITY);
                for (a, b) in [(0.5, 0.5), (0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
                    let (column, row) = (a * f64::from(*width), b * f64::from(*height));
                    let here = self.exact(column, row);
                    let distance = |to: Pixel| (to.0 - here.0).hypot(to.1 - here.1);
                    let across = distance(self.exact(column + 1.0, row));
                    let down = distance(self.exact(column, row + 1.0));
                    if across.is_finite() && down.is_finite() && across * down < least.0 * least.1 {
                        least = (across, down);
                    }
                }
                if least.0.is_finite() { least } else { (1.0, 1.0) }
            }
        }
    }

    /// Pixel coordinates of the samples (x, y) … of the grid, `width` × `height`, row-major; NaN
    /// where there is none. Those outside the raster may be NaN or any number outside it.
    pub fn project(&self, x: u32, y: u32, width: u32, height: u32) -> Vec<Pixel> {
        let mut out = vec![NOWHERE; width as usize * height as usize];
        let (first_column, first_row) = self.first();
        let view = View {
            column: first_column + i64::from(x),
            row: first_row + i64::from(y),
            width: i64::from(width),
            height: i64::from(height),
        };
        match self.kind {
            Kind::Separable => self.separable(&view, &mut out),
            Kind::Affine => {
                for row in 0..view.height {
                    for column in 0..view.width {
                        out[(row * view.width + column) as usize] =
                            self.exact((view.column + column) as f64, (view.row + row) as f64);
                    }
                }
            }
            Kind::General => self.general(&view, &mut out),
        }
        out
    }

    fn separable(&self, view: &View, out: &mut [Pixel]) {
        let mut columns: [Option<Vec<f64>>; 2] = [None, None];
        for row in 0..view.height {
            let Some((_, latitude)) = self.geographic(view.column as f64, (view.row + row) as f64) else {
                continue;
            };
            let beyond = latitude.abs() > 90.0;
            let v = self.placement.exact_pixel(0.0, latitude).map_or(f64::NAN, |pixel| pixel.1);
            let us = columns[usize::from(beyond)].get_or_insert_with(|| {
                // A latitude beyond the pole turns the longitude; which one does not matter for u.
                let latitude = if beyond { 180.0 } else { 0.0 };
                (0..view.width)
                    .map(|column| {
                        self.geographic((view.column + column) as f64, 0.0)
                            .and_then(|(longitude, _)| self.placement.exact_pixel(longitude, latitude).ok())
                            .map_or(f64::NAN, |pixel| pixel.0)
                    })
                    .collect()
            });
            let start = (row * view.width) as usize;
            for (target, &u) in out[start..start + view.width as usize].iter_mut().zip(us.iter()) {
                *target = (u, v);
            }
        }
    }

    fn general(&self, view: &View, out: &mut [Pixel]) {
        let first = (view.column.div_euclid(COARSE), view.row.div_euclid(COARSE));
        let last = (
            (view.column + view.width - 1).div_euclid(COARSE),
            (view.row + view.height - 1).div_euclid(COARSE),
        );
        // Anchors from one before the first cell to two after the last one's origin, on demand:
        // most of a coarse tile may lie outside the raster.
        let across = (last.0 - first.0 + 4) as usize;
        let down = (last.1 - first.1 + 4) as usize;
        let mut anchors: Vec<Option<Pixel>> = vec![None; across * down];
        for cell_row in first.1..=last.1 {
            for cell_column in first.0..=last.0 {
                let (column, row) = (cell_column * COARSE, cell_row * COARSE);
                if !self.cell_may_touch(column, row) {
                    continue;
                }
                let stencil = std::array::from_fn(|j| {
                    std::array::from_fn(|i| {
                        let slot = ((cell_row - first.1) as usize + j) * across
                            + (cell_column - first.0) as usize
                            + i;
                        *anchors[slot].get_or_insert_with(|| {
                            let index =
                                |cell: i64, offset: usize| ((cell - 1 + offset as i64) * COARSE) as f64;
                            self.exact(index(cell_column, i), index(cell_row, j))
                        })
                    })
                });
                if self.fits(&stencil, column, row, COARSE) {
                    interpolate(&stencil, column, row, COARSE, view, out);
                } else {
                    self.fine(column, row, view, out);
                }
            }
        }
    }

    /// A coarse cell that bends, by finer ones.
    fn fine(&self, column: i64, row: i64, view: &View, out: &mut [Pixel]) {
        const SIDE: usize = (COARSE / FINE) as usize + 3;
        let mut anchors: [[Option<Pixel>; SIDE]; SIDE] = [[None; SIDE]; SIDE];
        for cell_row in 0..SIDE - 3 {
            for cell_column in 0..SIDE - 3 {
                let at = (column + cell_column as i64 * FINE, row + cell_row as i64 * FINE);
                if !view.touches(at.0, at.1, FINE) {
                    continue;
                }
                let stencil = std::array::from_fn(|j| {
                    std::array::from_fn(|i| {
                        *anchors[cell_row + j][cell_column + i].get_or_insert_with(|| {
                            self.exact(
                                (at.0 + (i as i64 - 1) * FINE) as f64,
                                (at.1 + (j as i64 - 1) * FINE) as f64,
                            )
                        })
                    })
                });
                if self.fits(&stencil, at.0, at.1, FINE) {
                    interpolate(&stencil, at.0, at.1, FINE, view, out);
                } else {
                    view.each_in(at.0, at.1, FINE, |column, row, slot| {
                        out[slot] = self.exact(column as f64, row as f64);
                    });
                }
            }
        }
    }

    fn fits(&self, stencil: &Stencil, column: i64, row: i64, side: i64) -> bool {
        let middle = side as f64 / 2.0;
        let found = at(stencil, 0.5, 0.5);
        let exact = self.exact(column as f64 + middle, row as f64 + middle);
        (found.0 - exact.0).abs() <= TOLERANCE && (found.1 - exact.1).abs() <= TOLERANCE
    }

    fn cell_may_touch(&self, column: i64, row: i64) -> bool {
        let corner =
            |i: i64, j: i64| self.geographic((column + i * COARSE) as f64, (row + j * COARSE) as f64);
        let (Some((west, north)), Some((east, south))) = (corner(0, 0), corner(1, 1)) else { return true };
        if north > 90.0 || south < -90.0 {
            let (_, clamped) = over_the_pole(0.0, if north > 90.0 { north } else { south });
            let reach = clamped.abs().min(north.abs()).min(south.abs());
            return self.placement.bounds().north >= reach || self.placement.bounds().south <= -reach;
        }
        self.placement.may_touch(west, south, east, north)
    }
}

/// A part of a grid, by global indices.
struct View {
    column: i64,
    row: i64,
    width: i64,
    height: i64,
}

impl View {
    fn touches(&self, column: i64, row: i64, side: i64) -> bool {
        column < self.column + self.width
            && self.column < column + side
            && row < self.row + self.height
            && self.row < row + side
    }

    /// Calls `each` (global column, global row, slot) for the samples of a cell that lie in the view.
    fn each_in(&self, column: i64, row: i64, side: i64, mut each: impl FnMut(i64, i64, usize)) {
        for y in row.max(self.row)..(row + side).min(self.row + self.height) {
            for x in column.max(self.column)..(column + side).min(self.column + self.width) {
                each(x, y, ((y - self.row) * self.width + (x - self.column)) as usize);
            }
        }
    }
}

/// Anchors around a cell, by row and column: −1, 0, 1, 2.
type Stencil = [[Pixel; 4]; 4];

/// Coefficients of the cubic through values at −1, 0, 1, 2.
fn cubic(values: [f64; 4]) -> [f64; 4] {
    let [before, here, next, after] = values;
    [
        here,
        next - before / 3.0 - here / 2.0 - after / 6.0,
        (before + next) / 2.0 - here,
        (here - next) / 2.0 + (after - before) / 6.0,
    ]
}

fn evaluate(c: [f64; 4], t: f64) -> f64 {
    c[0] + t * (c[1] + t * (c[2] + t * c[3]))
}

/// The cubics along a row at height t of a cell.
fn row_cubics(stencil: &Stencil, t: f64) -> ([f64; 4], [f64; 4]) {
    let along = |pick: fn(&Pixel) -> f64| {
        cubic(std::array::from_fn(|i| evaluate(cubic(std::array::from_fn(|j| pick(&stencil[j][i]))), t)))
    };
    (along(|pixel| pixel.0), along(|pixel| pixel.1))
}

fn at(stencil: &Stencil, s: f64, t: f64) -> Pixel {
    let (u, v) = row_cubics(stencil, t);
    (evaluate(u, s), evaluate(v, s))
}

fn interpolate(stencil: &Stencil, column: i64, row: i64, side: i64, view: &View, out: &mut [Pixel]) {
    let scale = 1.0 / side as f64;
    let columns = column.max(view.column)..(column + side).min(view.column + view.width);
    for y in row.max(view.row)..(row + side).min(view.row + view.height) {
        let (u, v) = row_cubics(stencil, (y - row) as f64 * scale);
        let start = (y - view.row) * view.width - view.column;
        for x in columns.clone() {
            let s = (x - column) as f64 * scale;
            out[(start + x) as usize] = (evaluate(u, s), evaluate(v, s));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::crs::Crs;
    use super::super::geotiff::georeference::Affine;
    use super::*;
    use proptest::prelude::*;
    use treeline_core::grid::{LatticeWindow, Registration};
    use treeline_core::tile::TileAddress;

    fn placements() -> Vec<Placement> {
        let place = |code: u32, longitude: f64, latitude: f64, size: f64, pixels: u32| {
            let crs = Crs::from_epsg(code).unwrap();
            let (x, y) = crs.from_geographic(longitude, latitude).unwrap();
            let half = size * f64::from(pixels) / 2.0;
            let affine = Affine { x: (x - half, size, 0.0), y: (y + half, 0.0, -size) };
            Placement::new(crs, affine, pixels, pixels).unwrap()
        };
        let rotated = {
            let affine = Affine { x: (8.0, 2e-4, 1e-4), y: (47.0, 1e-4, -2e-4) };
            Placement::new(Crs::wgs84(), affine, 3000, 3000).unwrap()
        };
        vec![
            place(32632, 8.3, 61.6, 10.0, 6000),
            place(3031, 77.9, -68.5, 30.0, 3000),
            place(3031, 0.0, -89.9, 500.0, 3000),
            place(3035, 9.0, 50.0, 1000.0, 4000),
            place(2193, 179.0, -38.0, 100.0, 4000),
            rotated,
        ]
    }

    #[test]
    fn close_to_the_exact_projection_everywhere() {
        for placement in placements() {
            let bounds = placement.bounds();
            for level in [3_u8, 6, 9, 11] {
                let (longitude, latitude) = bounds.centre();
                let tile = TileAddress::at(level, longitude, latitude);
                let grid = SampleGrid::Lattice(LatticeWindow::of_tile(tile, Registration::Node, 1));
                let projector = Projector::new(&placement, &grid);
                let (width, height) = grid.size();
                let found = projector.project(0, 0, width, height);
                let (first_column, first_row) = projector.first();
                let mut inside = 0;
                for (slot, pixel) in found.iter().enumerate().step_by(37) {
                    let column = first_column + slot as i64 % i64::from(width);
                    let row = first_row + slot as i64 / i64::from(width);
                    let exact = projector.exact(column as f64, row as f64);
                    if placement.contains_pixel(exact.0, exact.1) {
                        inside += 1;
                        let error = (pixel.0 - exact.0).hypot(pixel.1 - exact.1);
                        assert!(error < 0.002, "{} level {level}: {error}", placement.crs());
                    } else {
                        assert!(
                            !placement.contains_pixel(pixel.0, pixel.1) || (pixel.0 - exact.0).abs() < 0.01
                        );
                    }
                }
                assert!(
                    level < 9 || inside > 0 || bounds.south == -90.0,
                    "{} level {level}",
                    placement.crs()
                );
            }
        }
    }

    #[test]
    fn a_box_in_a_projected_system_that_is_not_the_raster_s_own() {
        let request = Crs::from_epsg(32632).unwrap();
        let (x, y) = request.from_geographic(8.3, 61.6).unwrap();
        for placement in placements() {
            let (longitude, latitude) = placement.bounds().centre();
            let (x, y) = request.from_geographic(longitude, latitude.max(-80.0)).unwrap_or((x, y));
            let grid = SampleGrid::Box {
                crs: RequestCrs::Projected(32632),
                west: x - 2000.0,
                south: y - 1500.0,
                east: x + 2000.0,
                north: y + 1500.0,
                width: 80,
                height: 60,
            };
            let found = Projector::new(&placement, &grid).project(0, 0, 80, 60);
            for (slot, pixel) in found.iter().enumerate() {
                let (column, row) = ((slot % 80) as f64 + 0.5, (slot / 80) as f64 + 0.5);
                let (longitude, latitude) =
                    request.to_geographic(x - 2000.0 + 50.0 * column, y + 1500.0 - 50.0 * row).unwrap();
                let exact = placement.exact_pixel(longitude, latitude).unwrap();
                if placement.contains_pixel(exact.0, exact.1) {
                    let error = (pixel.0 - exact.0).hypot(pixel.1 - exact.1);
                    assert!(error < 0.002, "{}: {error}", placement.crs());
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn two_windows_share_bits(level in 6_u8..13, dx in 1_u32..80, dy in 1_u32..80, which in 0_usize..6) {
            let placement = &placements()[which];
            let (longitude, latitude) = placement.bounds().centre();
            let tile = TileAddress::at(level, longitude, latitude.max(-89.0));
            let whole = LatticeWindow { width: 100, height: 100, ..LatticeWindow::of_tile(tile, Registration::Cell, 4) };
            let part = LatticeWindow {
                first_column: whole.first_column + i64::from(dx),
                first_row: whole.first_row + i64::from(dy),
                width: 20, height: 20, ..whole
            };
            let (whole, part) = (SampleGrid::Lattice(whole), SampleGrid::Lattice(part));
            let of_whole = Projector::new(placement, &whole).project(0, 0, 100, 100);
            let of_part = Projector::new(placement, &part).project(0, 0, 20, 20);
            for y in 0..20_u32 {
                for x in 0..20_u32 {
                    let a = of_whole[((y + dy) * 100 + x + dx) as usize];
                    let b = of_part[(y * 20 + x) as usize];
                    prop_assert_eq!((a.0.to_bits(), a.1.to_bits()), (b.0.to_bits(), b.1.to_bits()));
                }
            }
        }
    }
}
