//! Trunks and branches as lines with radii, grown into the crown's envelope.

use super::envelope::Envelope;
use super::growth::{Branches, GrowthForm};
use super::random::Random;
use glam::{Quat, Vec3};

/// A trunk or branch: a line of places in the tree frame, and its radius at each.
#[derive(Clone, Debug, PartialEq)]
pub struct Stem {
    /// Places from its foot to its tip, at least two.
    pub points: Vec<Vec3>,
    /// Radii.
    pub radii: Vec<f32>,
    /// 0 trunk, 1 limb, 2 twig.
    pub order: u32,
    /// Whether foliage sits on it.
    pub bears: bool,
}

impl Stem {
    /// Length along it.
    pub fn length(&self) -> f32 {
        self.points.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
    }

    /// Place, direction and radius at a share of its pieces, 0 … 1.
    pub fn at(&self, share: f32) -> (Vec3, Vec3, f32) {
        let pieces = self.points.len() - 1;
        let place = share.clamp(0.0, 1.0) * pieces as f32;
        let index = (place as usize).min(pieces - 1);
        let rest = place - index as f32;
        let (from, to) = (self.points[index], self.points[index + 1]);
        let radius = self.radii[index] + (self.radii[index + 1] - self.radii[index]) * rest;
        (from.lerp(to, rest), (to - from).normalize_or(Vec3::Z), radius)
    }
}

/// Degrees between one branch's azimuth and the next one's.
const TURN: f32 = 137.5;
/// Pieces of a trunk.
const TRUNK_PIECES: usize = 7;

/// All stems of a tree, parents before children.
pub fn grow(form: &GrowthForm, envelope: &Envelope, random: &mut Random) -> Vec<Stem> {
    let mut stems = Vec::new();
    let first_turn = random.between(0.0, 360.0);
    for number in 0..form.stems {
        let turn = first_turn + TURN * number as f32;
        let trunk = trunk(form, envelope, number, turn, random);
        let limbs = limbs(form, envelope, &trunk, random);
        stems.push(trunk);
        for limb in limbs {
            let twigs = form.twigs.map(|twigs| branches(&twigs, form, envelope, &limb, random));
            stems.push(limb);
            stems.extend(twigs.into_iter().flatten());
        }
    }
    stems
}

fn trunk(form: &GrowthForm, envelope: &Envelope, number: u32, turn: f32, random: &mut Random) -> Stem {
    // The first of several stems stands upright and reaches the top.
    let lean = if number == 0 { 0.0 } else { form.lean * random.between(0.5, 1.1) };
    let out = Quat::from_rotation_z(turn.to_radians()) * Vec3::X;
    let direction = (Vec3::Z * lean.to_radians().cos() + out * lean.to_radians().sin()).normalize();
    let mut shape = vec![Vec3::ZERO];
    let mut heading = direction;
    for _ in 0..TRUNK_PIECES {
        let bend = Quat::from_euler(
            glam::EulerRot::XYZ,
            random.around(form.trunk_bend).to_radians(),
            random.around(form.trunk_bend).to_radians(),
            0.0,
        );
        heading = (bend * heading).normalize();
        shape.push(shape[shape.len() - 1] + heading / TRUNK_PIECES as f32);
    }
    let tip = shape[TRUNK_PIECES];
    let points = if number == 0 {
        // Straightened until it ends on the axis: the top of the tree stands over its foot.
        let scale = form.trunk_top / tip.z;
        let sideways = Vec3::new(tip.x, tip.y, 0.0);
        shape
            .iter()
            .enumerate()
            .map(|(index, &place)| {
                let share = index as f32 / TRUNK_PIECES as f32;
                (place - sideways * share) * Vec3::new(0.7, 0.7, scale)
            })
            .collect()
    } else {
        let length = reach(envelope, Vec3::new(0.0, 0.0, envelope.bottom), &shape, form.trunk_top);
        shape.iter().map(|&place| place * length * random.between(0.8, 0.98)).collect()
    };
    let radius = form.trunk_radius * if number == 0 { 1.0 } else { 0.7 };
    let radii = (0..=TRUNK_PIECES)
        .map(|index| {
            let share = index as f32 / TRUNK_PIECES as f32;
            // A flare at the foot, then a straight taper.
            radius * (1.02 - share) * (1.0 + 0.5 * (-12.0 * share).exp())
        })
        .collect();
    Stem { points, radii, order: 0, bears: form.stems > 1 }
}

fn limbs(form: &GrowthForm, envelope: &Envelope, trunk: &Stem, random: &mut Random) -> Vec<Stem> {
    let limbs = &form.limbs;
    let mut turn = random.between(0.0, 360.0);
    let mut grown = Vec::new();
    let upright = trunk.points.last().is_some_and(|tip| tip.x.hypot(tip.y) < 1e-4);
    for index in 0..limbs.count {
        let whorl = limbs.whorl.max(1);
        let groups = limbs.count.div_ceil(whorl);
        let group = index / whorl;
        let within = if whorl > 1 { random.around(0.4) } else { random.around(0.45) };
        let along = ((group as f32 + 0.5 + within) / groups as f32).clamp(0.0, 1.0);
        turn +=
            if whorl > 1 { 360.0 / whorl as f32 + random.around(18.0) } else { TURN + random.around(20.0) };
        if whorl > 1 && index % whorl == 0 {
            turn += 0.5 * 360.0 / whorl as f32 + random.around(20.0);
        }
        // Denser where the crown is narrower.
        let upward = 1.0 - (1.0 - along).powf(form.crowding);
        let share = limbs.range[0] + (limbs.range[1] - limbs.range[0]) * upward;
        // On the main trunk by height over the crown's bottom, on others by length.
        let place = if upright {
            let height = envelope.bottom + share * (1.0 - envelope.bottom);
            (height / trunk.points[TRUNK_PIECES].z).min(1.0)
        } else {
            share
        };
        let (start, axis, parent_radius) = trunk.at(place);
        let down =
            limbs.down[0] + (limbs.down[1] - limbs.down[0]) * upward + random.around(limbs.down_variation);
        let direction = branch_direction(axis, down, turn);
        let shape = branch_shape(limbs, direction, random);
        let keep = random.between(limbs.least_reach, 1.0);
        let full = reach(envelope, start.max(Vec3::new(-1.0, -1.0, envelope.bottom)), &shape, 1.0);
        let length = full * keep;
        if length < 0.004 {
            continue;
        }
        let from = Vec3::new(start.x, start.y, start.z.max(envelope.bottom));
        let radius = (parent_radius * 0.62).min(0.055 * length + 0.001);
        grown.push(stem(from, &shape, length, radius, 1, form.twigs.is_none()));
    }
    grown
}

fn branches(
    kind: &Branches,
    form: &GrowthForm,
    envelope: &Envelope,
    parent: &Stem,
    random: &mut Random,
) -> Vec<Stem> {
    let mut turn = random.between(0.0, 360.0);
    let parent_length = parent.length();
    let mut grown = Vec::new();
    for index in 0..kind.count {
        let along = (index as f32 + 0.5 + random.around(0.3)) / kind.count as f32;
        turn += TURN + random.around(25.0);
        let last = index + 1 == kind.count;
        let place = if last { 1.0 } else { kind.range[0] + (kind.range[1] - kind.range[0]) * along };
        let (start, axis, parent_radius) = parent.at(place);
        let spread = kind.down[0] + (kind.down[1] - kind.down[0]) * along;
        let down = if last { 0.0 } else { spread } + random.around(kind.down_variation);
        let mut direction = branch_direction(axis, down, turn);
        direction = (direction + Vec3::Z * form.attraction).normalize_or(axis);
        let shape = branch_shape(kind, direction, random);
        let wanted = kind.length * parent_length * (1.15 - 0.5 * along) * random.between(0.8, 1.2);
        let wanted = wanted.max(0.35 * envelope.radius * kind.length);
        let length = reach(envelope, start, &shape, wanted) * random.between(kind.least_reach, 1.0);
        if length < 0.003 {
            continue;
        }
        grown.push(stem(start, &shape, length, (parent_radius * 0.7).min(0.05 * length + 0.0006), 2, true));
    }
    grown
}

/// A direction at an angle to an axis, at an azimuth about it, degrees.
fn branch_direction(axis: Vec3, down: f32, turn: f32) -> Vec3 {
    // For an upright axis the azimuth is the compass's.
    let across = if axis.z.abs() > 0.95 { Vec3::X } else { Vec3::Z };
    let side = (across - axis * axis.dot(across)).normalize();
    let other = axis.cross(side);
    let (turn, down) = (turn.to_radians(), down.to_radians());
    axis * down.cos() + (side * turn.cos() + other * turn.sin()) * down.sin()
}

/// A branch of length 1 from the origin: bent in the vertical plane by its curve.
fn branch_shape(kind: &Branches, direction: Vec3, random: &mut Random) -> Vec<Vec3> {
    let mut points = vec![Vec3::ZERO];
    let mut heading = direction;
    for index in 0..kind.segments {
        let half = usize::from(2 * index >= kind.segments && kind.segments > 1);
        let share = if kind.segments > 1 { 2.0 / kind.segments as f32 } else { 0.5 };
        let bend = kind.curve[half] * share + random.around(kind.curve_variation) / kind.segments as f32;
        let side = heading.cross(Vec3::Z);
        if side.length_squared() > 1e-6 {
            let lift = Quat::from_axis_angle(side.normalize(), bend.to_radians());
            let sway = Quat::from_rotation_z(
                (random.around(kind.curve_variation) / kind.segments as f32).to_radians(),
            );
            heading = (sway * lift * heading).normalize();
        }
        points.push(points[index] + heading / kind.segments as f32);
    }
    points
}

/// The greatest length, up to a limit, with which a shape from a start stays in the crown.
fn reach(envelope: &Envelope, start: Vec3, shape: &[Vec3], limit: f32) -> f32 {
    let fits = |length: f32| shape[1..].iter().all(|&place| envelope.contains(start + place * length));
    if fits(limit) {
        return limit;
    }
    let (mut inside, mut outside) = (0.0, limit);
    for _ in 0..14 {
        let middle = 0.5 * (inside + outside);
        if fits(middle) { inside = middle } else { outside = middle }
    }
    inside
}

fn stem(start: Vec3, shape: &[Vec3], length: f32, radius: f32, order: u32, bears: bool) -> Stem {
    let pieces = (shape.len() - 1) as f32;
    Stem {
        points: shape.iter().map(|&place| start + place * length).collect(),
        radii: (0..shape.len()).map(|index| radius * (1.0 - 0.85 * index as f32 / pieces)).collect(),
        order,
        bears,
    }
}
