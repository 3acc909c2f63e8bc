//! What stands: tufts of grass, flowers, ferns, dwarf shrubs.

use super::{Corner, Mesh, Part, level};
use crate::tree_model::Random;
use glam::Vec3;
use std::f32::consts::TAU;

/// Blades of a tuft, and how many of them are drawn of a far one.
const BLADES: u32 = 50;
pub const FAR_BLADES: u32 = 12;
/// Triangles of a blade.
pub const BLADE_TRIANGLES: u32 = 5;
const FRONDS: u32 = 7;
/// Leaflets on each side of a frond.
const LEAFLETS: u32 = 9;
const LEAVES: u32 = 64;

/// A blade: a ribbon that bends over.
#[derive(Clone, Copy, Debug)]
struct Blade {
    foot: Vec3,
    /// Which way it leans, turns.
    way: f32,
    length: f32,
    /// From upright at the foot, and how much more at the tip, radians.
    lean: [f32; 2],
    /// At its widest.
    half_width: f32,
    /// Turned out of its own plane, turns.
    twist: f32,
    /// At the foot and at the tip.
    tones: [Vec3; 2],
}

impl Blade {
    /// Points along it with its direction there: at shares of its length.
    fn along(&self, shares: &[f32]) -> Vec<(Vec3, Vec3)> {
        const PIECES: usize = 24;
        let out = level(self.way);
        let mut point = self.foot;
        let mut points = Vec::new();
        let mut next = shares.iter().peekable();
        for piece in 0..=PIECES {
            let share = piece as f32 / PIECES as f32;
            let angle = self.lean[0] + self.lean[1] * share * share;
            let direction = out * angle.sin() + Vec3::Z * angle.cos();
            while next.next_if(|&&wanted| wanted <= share + 1e-3).is_some() {
                points.push((point, direction));
            }
            point += direction * (self.length / PIECES as f32);
        }
        points
    }

    /// Two corners at each of four places, and one at the tip.
    fn grow(&self, mesh: &mut Mesh) {
        const PLACES: [(f32, f32); 4] = [(0.0, 0.75), (0.36, 1.0), (0.7, 0.72), (1.0, 0.0)];
        let points = self.along(&PLACES.map(|(share, _)| share));
        let lateral = (self.way + 0.25 + self.twist).rem_euclid(1.0);
        let mut before: Option<[u32; 2]> = None;
        for ((point, direction), (share, width)) in points.into_iter().zip(PLACES) {
            let normal = level(lateral).cross(direction).normalize_or(Vec3::Z);
            let normal = if normal.z < 0.0 { -normal } else { normal };
            let corner = Corner {
                position: point,
                side: self.half_width * width,
                lateral,
                normal,
                tone: self.tones[0].lerp(self.tones[1], share),
                shade: (0.15 + 0.95 * point.z).clamp(0.0, 1.0),
                part: Part::Own,
                near: false,
            };
            if width <= 0.0 {
                let tip = mesh.corner(corner);
                if let Some([left, right]) = before {
                    mesh.triangle([left, right, tip]);
                }
                continue;
            }
            let pair = [corner, Corner { side: -corner.side, ..corner }].map(|corner| mesh.corner(corner));
            if let Some([left, right]) = before {
                mesh.triangle([left, right, pair[0]]);
                mesh.triangle([right, pair[1], pair[0]]);
            }
            before = Some(pair);
        }
    }
}

/// A blade of a tuft.
fn blade(random: &mut Random, number: u32, spread: f32, tallest: bool) -> Blade {
    let way = (number as f32 + random.around(0.4)) * 0.618 % 1.0;
    let length = if tallest { 1.02 } else { random.between(0.55, 1.0) };
    let dry = if random.unit() < 0.16 { 1.0 } else { random.unit() * 0.3 };
    let tip = Vec3::new(1.04, 1.1, 0.85).lerp(Vec3::new(1.5, 1.24, 0.95), dry);
    Blade {
        foot: level(random.unit()) * spread * random.unit().sqrt(),
        way,
        length,
        lean: [
            random.between(0.02, 0.3),
            if tallest { random.between(0.1, 0.3) } else { random.between(0.3, 1.3) },
        ],
        half_width: random.between(0.013, 0.022),
        twist: random.around(0.12),
        tones: [Vec3::new(0.85, 0.87, 0.75), tip],
    }
}

/// A tuft of blades.
pub fn grass(random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    for number in 0..BLADES {
        let first = mesh.corners.len();
        blade(random, number, if number < FAR_BLADES { 0.75 } else { 1.6 }, number == 0).grow(&mut mesh);
        for corner in &mut mesh.corners[first..] {
            corner.near = number >= FAR_BLADES;
        }
    }
    mesh
}

/// Blossoms on stems over a few leaves.
pub fn flower(random: &mut Random) -> Mesh {
    const STEMS: u32 = 3;
    const PETALS: u32 = 6;
    let mut mesh = Mesh::default();
    for number in 0..STEMS {
        let stem = Blade {
            foot: level(random.unit()) * random.between(0.0, 0.3),
            way: number as f32 / STEMS as f32 + random.around(0.12),
            length: if number == 0 { 0.97 } else { random.between(0.55, 0.9) },
            lean: [random.between(0.02, 0.12), random.between(0.05, 0.3)],
            half_width: 0.010,
            twist: random.around(0.2),
            tones: [Vec3::splat(0.7), Vec3::splat(0.95)],
        };
        stem.grow(&mut mesh);
        let (top, direction) = stem.along(&[1.0])[0];
        let face = (direction + level(random.unit()) * 0.45).normalize();
        let across = face.cross(Vec3::X).normalize();
        let radius = random.between(0.085, 0.135);
        let corner = |position: Vec3, tone: Vec3, part| Corner {
            position,
            side: 0.0,
            lateral: 0.0,
            normal: face,
            tone,
            shade: 1.0,
            part,
            near: false,
        };
        let heart = mesh.corner(corner(top + face * 0.012, Vec3::new(0.55, 0.38, 0.04), Part::Plain));
        let rim: Vec<u32> = (0..2 * PETALS)
            .map(|petal| {
                let outer = petal % 2 == 0;
                let turn = (petal as f32 / (2 * PETALS) as f32) * TAU;
                let way = across * turn.cos() + face.cross(across) * turn.sin();
                let reach = radius * if outer { 1.0 } else { 0.5 };
                let lift = if outer { random.between(0.0, 0.25) } else { 0.08 };
                let tone = Vec3::splat(if outer { 1.0 } else { 0.75 });
                mesh.corner(corner(top + (way + face * lift) * reach, tone, Part::Petal))
            })
            .collect();
        for petal in 0..rim.len() {
            mesh.triangle([heart, rim[petal], rim[(petal + 1) % rim.len()]]);
        }
    }
    for number in 0..3 {
        let mut leaf = blade(random, number, 0.2, false);
        leaf.length = random.between(0.3, 0.55);
        leaf.half_width *= 1.5;
        leaf.grow(&mut mesh);
    }
    mesh
}

/// Fronds that arch outward, cut into leaflets.
pub fn fern(random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    let shares: Vec<f32> =
        (0..=LEAFLETS).map(|number| 0.14 + 0.86 * number as f32 / LEAFLETS as f32).collect();
    for number in 0..FRONDS {
        let way = (number as f32 + random.around(0.25)) / FRONDS as f32;
        let old = random.unit();
        let spine = Blade {
            foot: level(way) * 0.04,
            way,
            length: if number == 0 { 1.3 } else { random.between(0.95, 1.3) },
            lean: [random.between(0.22, 0.5), random.between(0.9, 1.5)],
            half_width: 0.0,
            twist: 0.0,
            tones: [Vec3::ONE; 2],
        };
        let points = spine.along(&shares);
        let across = level(way + 0.25);
        for pair in points.windows(2).zip(shares.windows(2)) {
            let ([(from, direction), (to, _)], [share, _]) = pair else { continue };
            // Longest a third of the way out.
            let along = (share - 0.14) / 0.86;
            let reach =
                0.32 * ((1.0 - along) * (0.45 + 2.2 * along)).clamp(0.02, 1.0).sqrt() * (1.0 - 0.35 * along);
            let up = across.cross(*direction).normalize_or(Vec3::Z);
            let up = if up.z < 0.0 { -up } else { up };
            for side in [1.0, -1.0] {
                let tip = from.lerp(*to, 0.5) + across * side * reach + *direction * (0.28 * reach)
                    - Vec3::Z * reach * random.between(0.1, 0.3);
                let normal = (up + across * side * 0.25).normalize();
                let tone =
                    Vec3::new(0.85, 0.9, 0.8).lerp(Vec3::new(1.2, 1.2, 0.8), along) * (1.1 - 0.2 * old);
                let corner = |position: Vec3, bright: f32| Corner {
                    position,
                    side: 0.0,
                    lateral: 0.0,
                    normal,
                    tone: tone * bright,
                    shade: (0.25 + 0.9 * position.z).clamp(0.0, 1.0),
                    part: Part::Own,
                    near: false,
                };
                let corners = [corner(*from, 0.8), corner(from.lerp(*to, 0.85), 0.85), corner(tip, 1.15)];
                let corners = corners.map(|corner| mesh.corner(corner));
                mesh.triangle(corners);
            }
        }
    }
    fit(&mut mesh);
    mesh
}

/// Small leaves over a low dome.
pub fn shrub(random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    for number in 0..LEAVES {
        let turn = (number as f32 * 0.618 + random.around(0.05)).rem_euclid(1.0);
        // Evenly over the dome, more of them high.
        let rise = ((number as f32 + 0.5) / LEAVES as f32).powf(0.7);
        let depth = random.between(0.7, 1.0);
        let out = level(turn) * (1.0 - rise * rise).max(0.0).sqrt();
        let middle = out * 0.72 * depth + Vec3::Z * (0.08 + 0.84 * rise * depth);
        let normal = (out + Vec3::Z * (0.35 + rise) + level(random.unit()) * 0.7).normalize();
        let along = normal.cross(level(random.unit())).normalize_or(Vec3::X);
        let across = normal.cross(along);
        let (length, width) = (random.between(0.11, 0.17), random.between(0.06, 0.095));
        let bright = random.between(0.75, 1.25);
        let corner = |position: Vec3, tone: f32| Corner {
            position: position.with_z(position.z.max(0.0)),
            side: 0.0,
            lateral: 0.0,
            normal,
            tone: Vec3::new(0.95, 1.0, 0.95) * bright * tone,
            shade: (0.1 + 0.95 * middle.z * depth).clamp(0.0, 1.0),
            part: Part::Own,
            near: false,
        };
        let ends = [
            corner(middle - along * length, 0.8),
            corner(middle + across * width, 1.0),
            corner(middle + along * length, 1.1),
            corner(middle - across * width, 1.0),
        ]
        .map(|corner| mesh.corner(corner));
        mesh.triangle([ends[0], ends[1], ends[2]]);
        mesh.triangle([ends[0], ends[2], ends[3]]);
    }
    fit(&mut mesh);
    mesh
}

/// Makes a model as high as its member's size.
fn fit(mesh: &mut Mesh) {
    let top = mesh.corners.iter().map(|corner| corner.position.z).fold(1e-3, f32::max);
    for corner in &mut mesh.corners {
        corner.position /= top;
        corner.position.z = corner.position.z.max(0.0);
        let reach = corner.position.truncate().length();
        if reach > 1.2 {
            corner.position *= Vec3::new(1.2 / reach, 1.2 / reach, 1.0);
        }
    }
}
