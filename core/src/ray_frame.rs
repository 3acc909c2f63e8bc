//! The frame in which a leaf is ray-cast: its tile's coordinates as quadratics of the place.
//!
//! For a point x (metres, east-north-up axes at the eye, from the eye) u and v are the place in cells of the
//! tile, from its north-west node eastward and southward, and h is the height in metres above the
//! ellipsoid. The exact functions are fitted once over the leaf's volume ([`LeafFit::new`]) in the
//! axes of its own centre, and re-expressed, exactly, for every new eye ([`LeafFit::at_eye`]).
//! All of it is f64: only the coefficients leave for the GPU.

use crate::geodesy::{self, Geodetic};
use crate::tile::{self, TileAddress};
use glam::{DMat3, DVec3};

/// A quadratic function of a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quadratic {
    /// Value at the origin.
    pub constant: f64,
    /// First order, per metre.
    pub gradient: DVec3,
    /// Second order, per square metre: xx, yy, zz, xy, xz, yz; mixed terms hold both halves.
    pub second: [f64; 6],
}

impl Quadratic {
    /// Value at x.
    pub fn evaluate(&self, x: DVec3) -> f64 {
        self.constant + self.gradient.dot(x) + x.dot(self.half_hessian() * x)
    }

    /// The function of the distance s along a ray x = s·direction: constant, s and s² coefficients.
    pub fn along(&self, direction: DVec3) -> [f64; 3] {
        [self.constant, self.gradient.dot(direction), direction.dot(self.half_hessian() * direction)]
    }

    fn half_hessian(&self) -> DMat3 {
        let [xx, yy, zz, xy, xz, yz] = self.second;
        DMat3::from_cols(
            DVec3::new(xx, 0.5 * xy, 0.5 * xz),
            DVec3::new(0.5 * xy, yy, 0.5 * yz),
            DVec3::new(0.5 * xz, 0.5 * yz, zz),
        )
    }

    /// The same function of x where this one is a function of rotation·x + offset.
    fn substituted(&self, rotation: DMat3, offset: DVec3) -> Self {
        let half = self.half_hessian();
        let turned = rotation.transpose() * half * rotation;
        Self {
            constant: self.evaluate(offset),
            gradient: rotation.transpose() * (self.gradient + 2.0 * (half * offset)),
            second: [
                turned.x_axis.x,
                turned.y_axis.y,
                turned.z_axis.z,
                2.0 * turned.x_axis.y,
                2.0 * turned.x_axis.z,
                2.0 * turned.y_axis.z,
            ],
        }
    }
}

/// Where the eye is, and its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeFrame {
    /// The eye, ECEF metres.
    pub ecef: DVec3,
    /// Columns are east, north and up at the eye.
    pub ecef_from_enu: DMat3,
}

impl EyeFrame {
    /// The frame of an eye.
    pub fn at(place: Geodetic) -> Self {
        Self {
            ecef: geodesy::ecef_from_geodetic(place),
            ecef_from_enu: geodesy::ecef_from_enu(place.longitude, place.latitude),
        }
    }
}

/// A leaf's three functions for an eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayFrame {
    /// Cells of the tile, eastward from its north-west node.
    pub u: Quadratic,
    /// Cells of the tile, southward from its north-west node.
    pub v: Quadratic,
    /// Metres above the ellipsoid.
    pub h: Quadratic,
    /// Least and greatest distance from the eye at which a ray can be in the leaf's volume, metres.
    pub distance_range: [f64; 2],
}

/// A square of a tile, in cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileSquare {
    /// First cell along u.
    pub u: f64,
    /// First cell along v.
    pub v: f64,
    /// Cells along either axis.
    pub side: f64,
}

impl TileSquare {
    /// The whole tile.
    pub const WHOLE: Self = Self { u: 0.0, v: 0.0, side: tile::CELLS as f64 };
}

/// The three functions in the east-north-up axes of the leaf's centre; independent of the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeafFit {
    centre: DVec3,
    ecef_from_local: DMat3,
    radius: f64,
    u: Quadratic,
    v: Quadratic,
    h: Quadratic,
}

/// Sample places in −1…1: the Chebyshev points of five, among whose polynomials the least-squares
/// fit is near the one with the least greatest error.
const ACROSS: [f64; 5] = [
    -0.951_056_516_295_153_6,
    -0.587_785_252_292_473_1,
    0.0,
    0.587_785_252_292_473_1,
    0.951_056_516_295_153_6,
];
const UPWARD: [f64; 3] = [-0.866_025_403_784_438_6, 0.0, 0.866_025_403_784_438_6];
const TERMS: usize = 10;

impl LeafFit {
    /// Fits the exact conversion over the square of the tile and from `heights.0` to `heights.1`, metres
    /// above the ellipsoid, by least squares.
    ///
    /// Up to [`coarsest_leaf_level`] of its latitude a leaf's u and v are right to 1/8 cell everywhere in that volume.
    pub fn new(address: TileAddress, square: TileSquare, heights: (f64, f64)) -> Self {
        let bounds = address.bounds();
        let step = tile::span_degrees(address.level) / f64::from(tile::CELLS);
        let half_side = 0.5 * square.side;
        let (u_middle, v_middle) = (square.u + half_side, square.v + half_side);
        // A sheet has no least-squares slope along the vertical: never thinner than the leaf bends.
        let side_metres = tile::cell_metres(address.level) * square.side;
        let bend = side_metres * side_metres / (4.0 * geodesy::SEMI_MAJOR_METRES);
        let half_height = (0.5 * (heights.1 - heights.0)).max(bend).max(1e-3 * side_metres).max(1.0);
        let h_middle = 0.5 * (heights.0 + heights.1);
        let place = |u: f64, v: f64, height: f64| Geodetic {
            longitude: bounds.west + u * step,
            latitude: bounds.north - v * step,
            height,
        };
        let middle = place(u_middle, v_middle, h_middle);
        let centre = geodesy::ecef_from_geodetic(middle);
        let ecef_from_local = geodesy::ecef_from_enu(middle.longitude, middle.latitude);
        let local = |u: f64, v: f64, height: f64| {
            ecef_from_local.transpose() * (geodesy::ecef_from_geodetic(place(u, v, height)) - centre)
        };

        let mut radius = 0.0_f64;
        for (u, v, h) in (0..8).map(|corner| (corner & 1, corner >> 1 & 1, corner >> 2)) {
            let sign = |bit: i32| f64::from(2 * bit - 1);
            let corner = local(
                u_middle + sign(u) * half_side,
                v_middle + sign(v) * half_side,
                h_middle + sign(h) * half_height,
            );
            radius = radius.max(corner.length());
        }

        // In units of the half extents all terms are of one size, and the normal equations well conditioned.
        let east = local(u_middle + half_side, v_middle, h_middle).length().max(1e-3);
        let north = local(u_middle, v_middle - half_side, h_middle).length().max(1e-3);
        let unit = DVec3::new(east, north, half_height);
        let mut normal = [[0.0; TERMS]; TERMS];
        let mut right = [[0.0; TERMS]; 3];
        for &a in &ACROSS {
            for &b in &ACROSS {
                for &c in &UPWARD {
                    let values = [a * half_side, b * half_side, c * half_height];
                    let x = local(u_middle + values[0], v_middle + values[1], h_middle + values[2]) / unit;
                    let terms = monomials(x);
                    for row in 0..TERMS {
                        for column in 0..TERMS {
                            normal[row][column] += terms[row] * terms[column];
                        }
                        for (sums, value) in right.iter_mut().zip(values) {
                            sums[row] += terms[row] * value;
                        }
                    }
                }
            }
        }
        let [u, v, h] = solve(normal, right).map(|c| quadratic_of(c, unit));
        let at = |quadratic: Quadratic, middle: f64| Quadratic {
            constant: quadratic.constant + middle,
            ..quadratic
        };
        Self { centre, ecef_from_local, radius, u: at(u, u_middle), v: at(v, v_middle), h: at(h, h_middle) }
    }

    /// The functions for an eye. Exact: a change of coordinates.
    pub fn at_eye(&self, eye: &EyeFrame) -> RayFrame {
        let local_from_ecef = self.ecef_from_local.transpose();
        let rotation = local_from_ecef * eye.ecef_from_enu;
        let offset = local_from_ecef * (eye.ecef - self.centre);
        let distance = offset.length();
        RayFrame {
            u: self.u.substituted(rotation, offset),
            v: self.v.substituted(rotation, offset),
            h: self.h.substituted(rotation, offset),
            distance_range: [(distance - self.radius).max(0.0), distance + self.radius],
        }
    }
}

/// The coarsest level whose whole tiles may be leaves where none of the leaf is nearer to a pole than `latitude`
/// (degrees): their frames are right to 1/8 cell. Meridians converge, so that a square near a pole
/// must be smaller. At the pole itself, where longitude ends, no quadratic serves; the answer stays at
/// [`DEEPEST_LEAF_LEVEL`], whose tiles are some 300 m a side.
pub fn coarsest_leaf_level(latitude: f64) -> u8 {
    // The error of u is of third order: measured, 0.0202·tan²(latitude) cells for a tile of level 7, a quarter of
    // that on each next level. The factor leaves some to spare.
    let slope = latitude.abs().min(89.999_999).to_radians().tan();
    let halvings = (0.0202 * 1.2 * 8.0 * slope * slope).log2() / 2.0;
    COARSEST_LEAF_LEVEL + (halvings.ceil().max(0.0) as u8).min(DEEPEST_LEAF_LEVEL - COARSEST_LEAF_LEVEL)
}

/// No leaf is larger than a tile of this level.
pub const COARSEST_LEAF_LEVEL: u8 = 7;
/// No leaf need be smaller than a tile of this level for its frame's sake.
pub const DEEPEST_LEAF_LEVEL: u8 = 16;

fn monomials(x: DVec3) -> [f64; TERMS] {
    [1.0, x.x, x.y, x.z, x.x * x.x, x.y * x.y, x.z * x.z, x.x * x.y, x.x * x.z, x.y * x.z]
}

fn quadratic_of(c: [f64; TERMS], unit: DVec3) -> Quadratic {
    Quadratic {
        constant: c[0],
        gradient: DVec3::new(c[1], c[2], c[3]) / unit,
        second: [
            c[4] / (unit.x * unit.x),
            c[5] / (unit.y * unit.y),
            c[6] / (unit.z * unit.z),
            c[7] / (unit.x * unit.y),
            c[8] / (unit.x * unit.z),
            c[9] / (unit.y * unit.z),
        ],
    }
}

/// Solves the symmetric positive definite system for three right-hand sides (Cholesky).
fn solve(mut matrix: [[f64; TERMS]; TERMS], mut right: [[f64; TERMS]; 3]) -> [[f64; TERMS]; 3] {
    for column in 0..TERMS {
        for row in column..TERMS {
            let sum: f64 = (0..column).map(|k| matrix[row][k] * matrix[column][k]).sum();
            matrix[row][column] = if row == column {
                (matrix[row][row] - sum).max(f64::MIN_POSITIVE).sqrt()
            } else {
                (matrix[row][column] - sum) / matrix[column][column]
            };
        }
    }
    for values in &mut right {
        for row in 0..TERMS {
            let sum: f64 = (0..row).map(|k| matrix[row][k] * values[k]).sum();
            values[row] = (values[row] - sum) / matrix[row][row];
        }
        for row in (0..TERMS).rev() {
            let sum: f64 = (row + 1..TERMS).map(|k| matrix[k][row] * values[k]).sum();
            values[row] = (values[row] - sum) / matrix[row][row];
        }
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Greatest error over the leaf's volume: in cells of u and v, and metres of h.
    fn residual(address: TileAddress, square: TileSquare, heights: (f64, f64), eye: &EyeFrame) -> [f64; 3] {
        let frame = LeafFit::new(address, square, heights).at_eye(eye);
        let bounds = address.bounds();
        let step = tile::span_degrees(address.level) / f64::from(tile::CELLS);
        let mut worst = [0.0_f64; 3];
        let count = 8;
        for index in 0..=count * (count + 2) * (count + 2) {
            let part = |divisor: i32| f64::from(index / divisor % (count + 1)) / f64::from(count);
            let u = square.u + part(1) * square.side;
            let v = square.v + part(count + 1) * square.side;
            let h = heights.0 + part((count + 1) * (count + 1)) * (heights.1 - heights.0);
            let place =
                Geodetic { longitude: bounds.west + u * step, latitude: bounds.north - v * step, height: h };
            let x = eye.ecef_from_enu.transpose() * (geodesy::ecef_from_geodetic(place) - eye.ecef);
            assert!((frame.distance_range[0] - 1e-3..=frame.distance_range[1] + 1e-3).contains(&x.length()));
            let found = [frame.u.evaluate(x), frame.v.evaluate(x), frame.h.evaluate(x)];
            for ((worst, found), exact) in worst.iter_mut().zip(found).zip([u, v, h]) {
                *worst = worst.max((found - exact).abs());
            }
        }
        worst
    }

    fn eye_of(longitude: f64, latitude: f64, height: f64) -> EyeFrame {
        EyeFrame::at(Geodetic { longitude, latitude, height })
    }

    proptest! {
        #[test]
        fn a_leaf_is_right_to_an_eighth_of_a_cell_wherever_the_eye_is(
            latitude in -89.0..89.0_f64, longitude in -180.0..180.0_f64, finer in 0_u8..12,
            away in 0.0..30.0_f64, turn in 0.0..6.3_f64, exponent in 0.0..7.0_f64,
        ) {
            let at = |level| TileAddress::at(level, longitude, latitude);
            let poleward = |tile: TileAddress| tile.bounds().north.max(-tile.bounds().south);
            let mut level = (COARSEST_LEAF_LEVEL + finer).min(18);
            while level < coarsest_leaf_level(poleward(at(level))) {
                level += 1;
            }
            let eye_latitude = (latitude + away * turn.sin()).clamp(-90.0, 90.0);
            let eye = eye_of(longitude + away * turn.cos(), eye_latitude, 10.0_f64.powf(exponent));
            let worst = residual(at(level), TileSquare::WHOLE, (-500.0, 9000.0), &eye);
            prop_assert!(worst[0] <= 0.125 && worst[1] <= 0.125, "level {level}: {worst:?}");
            prop_assert!(worst[2] <= 0.5 / f64::from(1_u32 << (2 * (level - 7).min(9))) + 0.001, "level {level}: {worst:?}");
        }

        #[test]
        fn along_a_ray_the_three_are_quadratics(x in -1.0..1.0_f64, y in -1.0..1.0_f64, z in -1.0..0.0_f64, s in 0.0..1e5_f64) {
            let eye = eye_of(10.0, 47.0, 3000.0);
            let frame = LeafFit::new(TileAddress::at(9, 10.2, 47.1), TileSquare::WHOLE, (0.0, 3000.0)).at_eye(&eye);
            let direction = DVec3::new(x, y, z - 0.01).normalize();
            for quadratic in [frame.u, frame.v, frame.h] {
                let [c, b, a] = quadratic.along(direction);
                let value = quadratic.evaluate(s * direction);
                prop_assert!((c + s * (b + s * a) - value).abs() < 1e-9 * (1.0 + value.abs()));
            }
        }
    }

    #[test]
    fn a_part_of_a_coarse_tile_is_as_good_as_a_tile_of_its_size() {
        let tile = TileAddress::at(2, 11.0, 47.0);
        let (u, v, side) = TileAddress::at(7, 11.0, 47.0).place_in_ancestor(2).unwrap();
        let worst = residual(tile, TileSquare { u, v, side }, (-500.0, 9000.0), &eye_of(11.0, 46.0, 2.0e6));
        assert!(worst[0] < 0.01 && worst[1] < 0.01, "{worst:?}");
        let whole = residual(tile, TileSquare::WHOLE, (-500.0, 9000.0), &eye_of(11.0, 46.0, 2.0e6));
        assert!(whole[0] > 1.0, "the whole tile bends too much: {whole:?}");
    }

    #[test]
    fn leaves_shrink_toward_the_poles() {
        assert_eq!(coarsest_leaf_level(0.0), 7);
        assert_eq!(coarsest_leaf_level(-65.0), 7);
        assert!(coarsest_leaf_level(80.0) > 7);
        assert_eq!(coarsest_leaf_level(90.0), DEEPEST_LEAF_LEVEL);
    }
}
