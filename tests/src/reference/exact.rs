//! The first hit of a ray, exactly: every cell along it, every patch's quadratic.

use super::Ground;
use glam::DVec3;

/// Distance along the unit `direction` to the first hit, +∞ where there is none.
pub fn first_hit(ground: &Ground, eye: DVec3, direction: DVec3) -> f64 {
    if ground.columns < 2 || ground.rows < 2 {
        return f64::INFINITY;
    }
    let start = ground.grid_place(eye.x, eye.y);
    let slope = [direction.x / ground.cell, -direction.y / ground.cell];
    let start = [start.x, start.y];
    let cells = [ground.columns as i64 - 1, ground.rows as i64 - 1];
    let curvature = ground.bend * (direction.x * direction.x + direction.y * direction.y);

    let mut enter = 0.0_f64;
    let mut leave = f64::INFINITY;
    for axis in 0..2 {
        let ends = [-start[axis], cells[axis] as f64 - start[axis]];
        if slope[axis] == 0.0 {
            if ends[0] > 0.0 || ends[1] < 0.0 {
                return f64::INFINITY;
            }
        } else {
            let ends = ends.map(|end| end / slope[axis]);
            enter = enter.max(ends[0].min(ends[1]));
            leave = leave.min(ends[0].max(ends[1]));
        }
    }
    if enter > leave {
        return f64::INFINITY;
    }

    let mut t = enter;
    let mut cell = [0_i64; 2];
    for axis in 0..2 {
        let place = start[axis] + t * slope[axis];
        // Just inside, where the ray stands on a line and goes back from it.
        let first = if slope[axis] < 0.0 { place.ceil() - 1.0 } else { place.floor() };
        cell[axis] = (first as i64).clamp(0, cells[axis] - 1);
    }
    // The side on which the ray left the cell before, where that was no void.
    let mut side = 0.0_f64;
    loop {
        let exit_of = |axis: usize| {
            if slope[axis] == 0.0 {
                f64::INFINITY
            } else {
                ((cell[axis] + i64::from(slope[axis] > 0.0)) as f64 - start[axis]) / slope[axis]
            }
        };
        let exits = [exit_of(0), exit_of(1)];
        let out = exits[0].min(exits[1]).min(leave).max(t);
        if let Some([nw, ne, sw, se]) = ground.patch(cell[0] as usize, cell[1] as usize) {
            let a = start[0] + t * slope[0] - cell[0] as f64;
            let b = start[1] + t * slope[1] - cell[1] as f64;
            let (east, south) = (ne - nw, sw - nw);
            let twist = se - sw - east;
            let height = nw + east * a + south * b + twist * a * b;
            let c0 = eye.z + t * (direction.z + t * curvature) - height;
            let c1 = direction.z + 2.0 * t * curvature
                - (east * slope[0] + south * slope[1] + twist * (a * slope[1] + b * slope[0]));
            let c2 = curvature - twist * slope[0] * slope[1];
            if side * c0 < 0.0 {
                return t;
            }
            // A vertical ray ends in its cell, or nowhere.
            let span = if out.is_finite() { out - t } else { f64::MAX };
            if let Some(root) = first_root([c0, c1, c2], span) {
                return t + root;
            }
            side = c0.signum();
        } else {
            side = 0.0;
        }
        if out >= leave {
            return f64::INFINITY;
        }
        for axis in 0..2 {
            if exits[axis] <= out {
                cell[axis] += if slope[axis] > 0.0 { 1 } else { -1 };
            }
            if !(0..cells[axis]).contains(&cell[axis]) {
                return f64::INFINITY;
            }
        }
        t = out;
    }
}

/// The first root of c0 + c1 r + c2 r² in 0…span.
fn first_root([c0, c1, c2]: [f64; 3], span: f64) -> Option<f64> {
    if c0 == 0.0 {
        return Some(0.0);
    }
    let discriminant = c1 * c1 - 4.0 * c2 * c0;
    if discriminant < 0.0 {
        return None;
    }
    let q = -0.5 * (c1 + discriminant.sqrt().copysign(c1));
    [c0 / q, q / c2]
        .into_iter()
        .filter(|root| root.is_finite() && (0.0..=span).contains(root))
        .min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::super::marching;
    use super::*;
    use proptest::prelude::*;

    fn plane(slope_x: f64, slope_y: f64, z: f64) -> Ground {
        Ground::from_function(41, 31, 2.0, |column, row| {
            z + slope_x * column as f64 * 2.0 + slope_y * (30 - row) as f64 * 2.0
        })
    }

    proptest! {
        #[test]
        fn a_plane_is_hit_where_algebra_says(
            sx in -1.0..1.0_f64, sy in -1.0..1.0_f64, x in 10.0..70.0_f64, y in 10.0..50.0_f64, over in 0.001..40.0_f64,
            dx in -1.0..1.0_f64, dy in -1.0..1.0_f64, dz in -1.0..-0.05_f64,
        ) {
            let ground = plane(sx, sy, 5.0);
            let direction = DVec3::new(dx, dy, dz).normalize();
            let eye = DVec3::new(x, y, 5.0 + sx * x + sy * y + over);
            let falling = sx * direction.x + sy * direction.y - direction.z;
            let t = over / falling;
            let at = eye + t * direction;
            let inside = t > 0.0 && (0.0..=80.0).contains(&at.x) && (0.0..=60.0).contains(&at.y);
            let found = first_hit(&ground, eye, direction);
            if inside {
                prop_assert!((found - t).abs() < 1e-9 * (1.0 + t), "{found} instead of {t}");
            } else {
                prop_assert!(found.is_infinite());
            }
        }

        #[test]
        fn marching_agrees(
            heights in prop::collection::vec(prop_oneof![8 => -30.0..30.0_f64, 1 => Just(f64::NAN), 1 => Just(0.0)], 64),
            x in -4.0..11.0_f64, y in -4.0..11.0_f64, z in -40.0..40.0_f64,
            tx in 0.0..7.0_f64, ty in 0.0..7.0_f64, tz in -20.0..20.0_f64, bend in prop_oneof![Just(0.0), Just(0.01)],
        ) {
            let mut ground = Ground::from_function(8, 8, 1.0, |column, row| heights[row * 8 + column]);
            ground.bend = bend;
            let eye = DVec3::new(x, y, z);
            let direction = (DVec3::new(tx, ty, tz) - eye).normalize();
            let found = first_hit(&ground, eye, direction);
            let marched = marching::first_hit(&ground, eye, direction, 1e-3, 120.0);
            match marched {
                // It steps over what is thinner than its step.
                Some(range) => prop_assert!(found <= range[1] + 1e-9, "{found} behind {range:?}"),
                None => prop_assert!(found.is_infinite() || marching::on_surface(&ground, eye, direction, found)),
            }
            if found.is_finite() {
                prop_assert!(marching::on_surface(&ground, eye, direction, found), "{found} is not on the surface");
            }
        }
    }

    #[test]
    fn a_saddle_is_hit_twice_and_first_where_it_rises() {
        // z = x y on one cell: along its diagonal z = t²/2.
        let ground = Ground::from_function(2, 2, 1.0, |column, row| (column * (1 - row)) as f64);
        let direction = DVec3::new(1.0, 1.0, 0.0).normalize();
        let found = first_hit(&ground, DVec3::new(-1.0, -1.0, 0.25), direction);
        assert!((found - (1.5 * 2.0_f64.sqrt())).abs() < 1e-12, "{found}");
    }

    #[test]
    fn a_wedge_and_a_ball() {
        let wedge = Ground::from_function(21, 5, 1.0, |column, _| 10.0 - (column as f64 - 10.0).abs());
        let found = first_hit(&wedge, DVec3::new(0.0, 2.0, 9.5), DVec3::X);
        assert!((found - 9.5).abs() < 1e-12);
        assert!(first_hit(&wedge, DVec3::new(0.0, 2.0, 10.5), DVec3::X).is_infinite());
        // A fine grid of a dome, against the sphere itself.
        let radius = 50.0_f64;
        let dome = Ground::from_function(801, 801, 0.1, |column, row| {
            let (x, y) = (column as f64 * 0.1 - 40.0, row as f64 * 0.1 - 40.0);
            (radius * radius - x * x - y * y).max(0.0).sqrt()
        });
        let eye = DVec3::new(-60.0, 31.0, 70.0);
        let direction = (DVec3::new(38.0, 42.0, 20.0) - eye).normalize();
        let centre = DVec3::new(40.0, 40.0, 0.0);
        let b = (eye - centre).dot(direction);
        let exact = -b - (b * b - (eye - centre).length_squared() + radius * radius).sqrt();
        assert!((first_hit(&dome, eye, direction) - exact).abs() < 1e-3);
    }

    #[test]
    fn curvature_lowers_what_is_far() {
        let radius = 6.371e6;
        let mut sea = Ground::from_function(2001, 3, 100.0, |_, _| 0.0);
        sea.bend = 0.5 / radius;
        let eye = DVec3::new(0.0, 100.0, 100.0);
        // A level ray never comes down to it; 35.7 km away is the horizon, 0.0056 rad below the level.
        assert!(first_hit(&sea, eye, DVec3::X).is_infinite());
        let found = first_hit(&sea, eye, DVec3::new(1.0, 0.0, -0.00561).normalize());
        assert!((30_000.0..36_000.0).contains(&found), "{found}");
    }
}
