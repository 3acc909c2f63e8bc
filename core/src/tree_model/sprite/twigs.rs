//! How twigs of each kind look.

use super::canvas::{Canvas, Picture};
use crate::tree_model::growth::{Bark, Twig};
use crate::tree_model::random::Random;
use glam::{Vec2, Vec3};

/// Colour of a twig's wood.
const WOOD: Vec3 = Vec3::new(0.36, 0.30, 0.24);

/// Paints a twig of a kind in a colour (sRGB 0 … 1).
pub fn twig(kind: Twig, colour: Vec3, random: &mut Random) -> Picture {
    match kind {
        Twig::Spray { density } => spray(density, colour, random),
        Twig::Tufts { needle } => tufts(needle, colour, random),
        Twig::Leaves { length, width, lobes, hanging } => {
            leaves(Vec2::new(length, width), lobes, hanging, colour, random)
        }
    }
}

/// The colour, a little lighter or darker, and yellower or bluer.
fn varied(colour: Vec3, random: &mut Random) -> Vec3 {
    let light = random.between(0.72, 1.22);
    let warm = random.around(0.07);
    colour * light * Vec3::new(1.0 + warm, 1.0, 1.0 - warm)
}

fn turned(direction: Vec2, degrees: f32) -> Vec2 {
    Vec2::from_angle(degrees.to_radians()).rotate(direction)
}

/// A flat branch of a fir or a spruce: shoots to both sides, needles on all of them.
fn spray(density: f32, colour: Vec3, random: &mut Random) -> Picture {
    let (width, height) = (96.0, 192.0);
    let mut canvas = Canvas::new(width as usize, height as usize);
    let root = Vec2::new(0.5 * width, height);
    let tip = Vec2::new(0.5 * width, 4.0);
    let shoots = 26;
    let mut lines = vec![(root, tip)];
    for index in 0..shoots {
        let along = (index as f32 + random.around(0.3)) / shoots as f32;
        let side = if index % 2 == 0 { 1.0 } else { -1.0 };
        // Widest at a third of the way.
        let reach = if along < 0.3 { 0.55 + 1.5 * along } else { 1.0 - (along - 0.3) / 0.78 };
        let from = root.lerp(tip, 0.03 + 0.94 * along);
        let direction = turned(Vec2::NEG_Y, side * (52.0 + random.around(9.0)));
        let length = reach * 0.60 * width * random.between(0.8, 1.05);
        lines.push((from, from + direction * length));
        // Second shoots on the long ones.
        for share in [0.35, 0.65] {
            let start = from + direction * length * share;
            let outward = turned(direction, -side * (38.0 + random.around(8.0)));
            lines.push((start, start + outward * length * (1.0 - share) * 0.75));
        }
    }
    for &(from, to) in &lines {
        canvas.stroke(from, to, [1.8, 0.9], WOOD * 0.8);
    }
    for &(from, to) in lines.iter().rev() {
        let way = to - from;
        let count = (way.length() * density) as usize;
        let direction = way.normalize_or_zero();
        for index in 0..count {
            let start = from + way * ((index as f32 + 0.5) / count as f32);
            let side = if index % 2 == 0 { 1.0 } else { -1.0 };
            let needle = turned(direction, side * (42.0 + random.around(22.0)));
            let length = random.between(4.0, 6.5);
            canvas.stroke(start, start + needle * length, [1.5, 1.0], varied(colour, random));
        }
    }
    canvas.picture()
}

/// A twig of a pine or a larch: bundles of needles along and at its end.
fn tufts(needle: f32, colour: Vec3, random: &mut Random) -> Picture {
    let side = 128.0;
    let mut canvas = Canvas::new(side as usize, side as usize);
    let root = Vec2::new(0.5 * side, side);
    let mut heads = Vec::new();
    for (degrees, length) in
        [(0.0, 0.72), (-34.0, 0.62), (36.0, 0.6), (-64.0, 0.44), (66.0, 0.42), (-15.0, 0.42), (17.0, 0.4)]
    {
        let direction = turned(Vec2::NEG_Y, degrees + random.around(7.0));
        let end = root + direction * length * side;
        canvas.stroke(root, end, [2.6, 1.2], WOOD);
        for share in [0.45, 0.62, 0.8, 1.0] {
            heads.push((root.lerp(end, share), direction));
        }
    }
    let length = needle * side;
    for &(head, direction) in &heads {
        for _ in 0..34 {
            let ray = turned(direction, random.around(118.0));
            let reach = length * random.between(0.65, 1.0);
            canvas.stroke(head, head + ray * reach, [1.5, 0.8], varied(colour, random));
        }
    }
    canvas.picture()
}

/// A leafy twig.
fn leaves(size: Vec2, lobes: f32, hanging: bool, colour: Vec3, random: &mut Random) -> Picture {
    let side = 128.0;
    let mut canvas = Canvas::new(side as usize, side as usize);
    let root = Vec2::new(0.5 * side, side);
    let mut places = Vec::new();
    let spread: &[(f32, f32)] = if hanging {
        &[(0.0, 0.93), (-9.0, 0.85), (9.0, 0.88), (-18.0, 0.66), (18.0, 0.7), (-28.0, 0.4), (28.0, 0.42)]
    } else {
        &[(0.0, 0.84), (-28.0, 0.8), (29.0, 0.78), (-56.0, 0.6), (57.0, 0.58), (-82.0, 0.38), (82.0, 0.36)]
    };
    for &(degrees, length) in spread {
        let direction = turned(Vec2::NEG_Y, degrees + random.around(6.0));
        let end = root + direction * length * side;
        canvas.stroke(root, end, [2.2, 1.0], WOOD);
        let count = (length * side / (0.36 * size.x * side)) as usize + 2;
        for index in 0..count {
            let share = 0.22 + 0.78 * index as f32 / (count - 1) as f32;
            places.push((root.lerp(end, share), direction, index));
        }
    }
    let outline = move |along: f32| {
        let body = (4.0 * along * (1.0 - along)).max(0.0).sqrt() * (1.15 - 0.3 * along);
        body * (1.0 - lobes * 0.5 * (1.0 + (along * 31.0).cos()))
    };
    for (place, direction, index) in places {
        for turn in [-1.0, 1.0] {
            let turn = if index % 2 == 0 { turn } else { -turn };
            let along = turned(direction, turn * (48.0 + random.around(26.0)));
            let scale = random.between(0.75, 1.12) * side;
            canvas.leaf(place, along, size * scale, varied(colour, random), outline);
        }
        let ahead = turned(direction, random.around(20.0));
        canvas.leaf(place, ahead, size * side * 0.9, varied(colour, random), outline);
    }
    canvas.picture()
}

/// Bark, covered everywhere: streaks along the trunk, or a birch's dark bands on white.
pub fn bark(kind: Bark, random: &mut Random) -> Picture {
    let (width, height) = (32.0, 64.0);
    let mut canvas = Canvas::new(width as usize, height as usize);
    let base = Vec3::from(kind.colour);
    canvas.fill(Vec2::ZERO, Vec2::new(width, height), |_| Some(base));
    for _ in 0..90 {
        let at = Vec2::new(random.between(0.0, width), random.between(0.0, height));
        let light = random.between(1.0 - kind.contrast, 1.0 + 0.5 * kind.contrast);
        let (length, thick) = if kind.bands {
            (Vec2::new(random.between(2.0, 9.0), 0.0), random.between(0.6, 1.8))
        } else {
            (Vec2::new(random.around(1.0), random.between(5.0, 18.0)), random.between(0.8, 2.2))
        };
        canvas.stroke(at, at + length, [thick, thick], base * light);
    }
    canvas.picture()
}

/// Rock, covered everywhere: flecks of many sizes.
pub fn stone(colour: Vec3, random: &mut Random) -> Picture {
    let side = 64.0;
    let mut canvas = Canvas::new(side as usize, side as usize);
    canvas.fill(Vec2::ZERO, Vec2::splat(side), |_| Some(colour));
    for index in 0..400 {
        let at = Vec2::new(random.between(0.0, side), random.between(0.0, side));
        let radius = 6.0 * (1.0 - index as f32 / 400.0) + 0.7;
        let light = random.between(0.78, 1.2);
        let to = at + turned(Vec2::X, random.around(180.0)) * radius;
        canvas.stroke(at, to, [radius, 0.6 * radius], colour * light);
    }
    canvas.picture()
}
