//! Twin of `wgsl/shadow.wgsl`: what the ground keeps of the light from the ground.

use super::photo::root_entry;
use super::sky::smoothstep;
use super::{Texels, World};
use crate::layout::{EMPTY, LEAF_BIT, ROOT_BITS, VOID_HEIGHT};
use glam::{IVec2, UVec2, Vec2, Vec3};

const SHADOW_FIRST_STEP: f32 = 1.7;
/// How far the march looks for what stands in the light, metres.
pub const SHADOW_REACH: f32 = 3500.0;
const SHADOW_EDGE: f32 = 0.6;
const SHADOW_EDGE_GROWTH: f32 = 0.035;

/// A leaf as a walk over the ground needs it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundLeaf {
    /// Its north-west corner, grid units.
    pub origin: UVec2,
    /// Its side, grid units.
    pub side: u32,
    /// Layer of its tile, or [`EMPTY`].
    pub slot: u32,
    /// Its first cell in the tile.
    pub first_cell: Vec2,
    /// Cells a grid unit.
    pub cells_per_unit: Vec2,
    /// No height in it is greater, metres.
    pub maximum: f32,
}

/// A place on the map: whole grid units, and the rest in units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPlace {
    /// Whole units.
    pub unit: UVec2,
    /// The rest, 0…1.
    pub fraction: Vec2,
}

/// What a point of the ground knows of its surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Where it is.
    pub place: MapPlace,
    /// Index of its leaf.
    pub leaf: u32,
    /// Metres.
    pub height: f32,
    /// Grid units per metre eastward and southward.
    pub units_per_metre: Vec2,
    /// Length of a cell over the pixel's width there.
    pub cell_over_footprint: f32,
    /// How far the nearest node's height may be from the surface's, metres.
    pub node_error: f32,
}

pub(crate) fn ground_leaf<T: Texels>(world: &World<'_, T>, index: u32) -> GroundLeaf {
    let leaf = &world.leaves[index as usize];
    GroundLeaf {
        origin: UVec2::from(leaf.grid_origin),
        side: leaf.grid_side,
        slot: leaf.slot,
        first_cell: UVec2::from(leaf.first_cell).as_vec2(),
        cells_per_unit: UVec2::from(leaf.cells).as_vec2() / leaf.grid_side as f32,
        maximum: leaf.h_cross_maximum_fade[2],
    }
}

fn no_ground(unit: UVec2) -> GroundLeaf {
    GroundLeaf {
        origin: unit,
        side: 1,
        slot: EMPTY,
        first_cell: Vec2::ZERO,
        cells_per_unit: Vec2::ONE,
        maximum: VOID_HEIGHT,
    }
}

/// The leaf at a place, by the page table.
pub fn ground_leaf_at<T: Texels>(world: &World<'_, T>, place: UVec2) -> GroundLeaf {
    let mut unit = place;
    let columns = world.view.root_size[0].wrapping_shl(ROOT_BITS);
    if world.view.wraps != 0 && (unit.x >> ROOT_BITS) >= world.view.root_size[0] {
        unit.x = if unit.x >= 1 << 31 { unit.x.wrapping_add(columns) } else { unit.x.wrapping_sub(columns) };
    }
    let root = root_entry(world.view, unit);
    if root == EMPTY {
        return no_ground(place);
    }
    let mut entry = world.nodes[root as usize];
    for depth in 0..ROOT_BITS {
        if entry & LEAF_BIT != 0 {
            break;
        }
        let quadrant = (unit >> (ROOT_BITS - 1 - depth)) & 1;
        entry = world.nodes[(entry + 2 * quadrant.y + quadrant.x) as usize];
    }
    if entry == EMPTY || entry & LEAF_BIT == 0 {
        return no_ground(place);
    }
    let mut leaf = ground_leaf(world, entry & !LEAF_BIT);
    if leaf.slot == EMPTY {
        return no_ground(place);
    }
    leaf.origin.x = leaf.origin.x.wrapping_add(place.x.wrapping_sub(unit.x));
    leaf
}

fn moved(place: MapPlace, by: Vec2) -> MapPlace {
    let sum = place.fraction + by;
    let whole = sum.floor();
    let unit = UVec2::new(
        place.unit.x.wrapping_add(whole.x as i32 as u32),
        place.unit.y.wrapping_add(whole.y as i32 as u32),
    );
    MapPlace { unit, fraction: sum - whole }
}

pub(crate) fn cell_in(leaf: &GroundLeaf, place: MapPlace) -> Vec2 {
    let within = IVec2::new(
        place.unit.x.wrapping_sub(leaf.origin.x) as i32,
        place.unit.y.wrapping_sub(leaf.origin.y) as i32,
    );
    leaf.first_cell + (within.as_vec2() + place.fraction) * leaf.cells_per_unit
}

fn covers(leaf: &GroundLeaf, place: MapPlace) -> bool {
    place.unit.x.wrapping_sub(leaf.origin.x) < leaf.side
        && place.unit.y.wrapping_sub(leaf.origin.y) < leaf.side
}

pub(crate) fn node_height<T: Texels>(world: &World<'_, T>, node: IVec2, slot: u32) -> f32 {
    world.texels.height(slot, node.x + 1, node.y + 1)
}

/// Height at a cell coordinate, metres: the nearest node's, or smooth between the four around it.
pub fn height_at<T: Texels>(world: &World<'_, T>, cell: Vec2, slot: u32, smooth_between: bool) -> f32 {
    if !smooth_between {
        let node = IVec2::new(cell.x.round_ties_even() as i32, cell.y.round_ties_even() as i32)
            .clamp(IVec2::splat(-1), IVec2::splat(513));
        return node_height(world, node, slot);
    }
    let base = cell.floor().as_ivec2().clamp(IVec2::splat(-1), IVec2::splat(512));
    let part = (cell - base.as_vec2()).clamp(Vec2::ZERO, Vec2::ONE);
    let north_west = node_height(world, base, slot);
    let north_east = node_height(world, base + IVec2::X, slot);
    let south_west = node_height(world, base + IVec2::Y, slot);
    let south_east = node_height(world, base + IVec2::ONE, slot);
    if north_west.min(north_east).min(south_west.min(south_east)) <= VOID_HEIGHT {
        return VOID_HEIGHT;
    }
    let mix = |a: f32, b: f32, share: f32| a * (1.0 - share) + b * share;
    mix(mix(north_west, north_east, part.x), mix(south_west, south_east, part.x), part.y)
}

/// Share of the sun's disc that a point sees, `sun` being east, south and up there; `dither` in 0…1
/// shifts the steps.
pub fn sun_visibility<T: Texels>(world: &World<'_, T>, ground: &Ground, sun: Vec3, dither: f32) -> f32 {
    let steps = world.view.shadow_steps;
    if steps == 0 {
        return 1.0;
    }
    let mut leaf = ground_leaf(world, ground.leaf);
    let count = steps as f32;
    let cell = 1.0 / (leaf.cells_per_unit.y * ground.units_per_metre.y).max(1e-6);
    let first = SHADOW_FIRST_STEP.max(0.7 * cell);
    let growth = (2.0 * (SHADOW_REACH - count * first) / (count * (count - 1.0)).max(1.0)).max(0.0);
    let reach = count * first + 0.5 * growth * count * (count - 1.0);
    let rate = sun.truncate() * ground.units_per_metre;
    let mut light = 1.0;
    let mut travelled = 0.0;
    for step in 0..steps {
        let stride = first + step as f32 * growth;
        let at = travelled + stride * (0.35 + 0.65 * dither);
        travelled += stride;
        let ray = ground.height + at * sun.z;
        if ray > world.view.forward[3] {
            break;
        }
        let place = moved(ground.place, at * rate);
        if !covers(&leaf, place) {
            leaf = ground_leaf_at(world, place.unit);
        }
        let edge = SHADOW_EDGE + SHADOW_EDGE_GROWTH * at;
        if ray > leaf.maximum + edge {
            continue;
        }
        let smooth_between = ground.cell_over_footprint > 1.5 && step < 8;
        let height = height_at(world, cell_in(&leaf, place), leaf.slot, smooth_between);
        if height <= VOID_HEIGHT {
            continue;
        }
        let above = height - ray - if smooth_between { 0.0 } else { ground.node_error };
        let chance = 1.0 / (1.0 + (stride - 6.0).max(0.0) / 45.0);
        let far = at / reach;
        let weight = (1.0 - far * far * far) * chance.max(smoothstep(0.3, 1.0, above / stride));
        light *= 1.0 - weight * smoothstep(0.0, edge, above);
        if light < 0.02 {
            return 0.0;
        }
    }
    light
}

/// Share of the sky that the surroundings leave to a point, from the slopes to four sides at two distances (metres).
pub fn sky_visibility<T: Texels>(world: &World<'_, T>, ground: &Ground, near: f32, far: f32) -> f32 {
    let leaf = ground_leaf(world, ground.leaf);
    let mut open = 0.0;
    for along in [Vec2::X, Vec2::Y, Vec2::NEG_X, Vec2::NEG_Y] {
        let between = Vec2::new(along.x - along.y, along.x + along.y) * std::f32::consts::FRAC_1_SQRT_2;
        let near_slope = slope_to(world, &leaf, ground, along, near);
        let far_slope = slope_to(world, &leaf, ground, between, far);
        let slope = near_slope.max(0.0) * 0.5 + far_slope.max(0.0) * 0.8;
        open += 1.0 / (1.0 + slope * slope);
    }
    0.25 * open
}

fn slope_to<T: Texels>(
    world: &World<'_, T>,
    leaf: &GroundLeaf,
    ground: &Ground,
    direction: Vec2,
    distance: f32,
) -> f32 {
    let place = moved(ground.place, direction * distance * ground.units_per_metre);
    let mut there = *leaf;
    if !covers(&there, place) {
        there = ground_leaf_at(world, place.unit);
        if there.slot == EMPTY {
            return 0.0;
        }
    }
    let height = height_at(world, cell_in(&there, place), there.slot, ground.cell_over_footprint > 1.5);
    if height <= VOID_HEIGHT { 0.0 } else { (height - ground.height) / distance }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{Leaf, View};

    /// Length of a root tile, metres: a unit is 0.1 mm.
    const ROOT_METRES: f32 = 6_710.886;
    const UNITS_PER_METRE: f32 = 10_000.0;

    /// Heights as functions of slot and of metres from the root grid's north-west corner.
    struct Fields {
        leaves: Vec<Leaf>,
        height: fn(u32, f32, f32) -> f32,
    }

    impl Texels for Fields {
        fn height(&self, slot: u32, x: i32, y: i32) -> f32 {
            let leaf = self.leaves.iter().find(|leaf| leaf.slot == slot).expect("a slot that some leaf has");
            let metres = |origin: u32, texel: i32| {
                origin as f32 / UNITS_PER_METRE + (texel - 1) as f32 * leaf.cell_metres[0]
            };
            (self.height)(slot, metres(leaf.grid_origin[0], x), metres(leaf.grid_origin[1], y))
        }

        fn maximum(&self, _: u32, _: u32, _: i32, _: i32) -> f32 {
            unreachable!("shadows use the leaf's own maximum")
        }

        fn minimum(&self, _: u32, _: u32, _: i32, _: i32) -> f32 {
            unreachable!("shadows know no minima")
        }

        fn levels(&self) -> u32 {
            9
        }
    }

    /// Two root tiles side by side; the western one is cut into four leaves.
    fn leaves() -> (Vec<u32>, Vec<Leaf>) {
        let root = 1_u32 << ROOT_BITS;
        let leaf = |slot: u32, x: u32, y: u32, side: u32| Leaf {
            first_cell: [0, 0],
            cells: [512, 512],
            grid_origin: [x, y],
            grid_side: side,
            slot,
            cell_metres: [side as f32 / UNITS_PER_METRE / 512.0; 2],
            h_cross_maximum_fade: [0.0, 0.0, 1_000.0, 1.0],
            ..Leaf::default()
        };
        let half = root / 2;
        let leaves = vec![
            leaf(0, 0, 0, half),
            leaf(1, half, 0, half),
            leaf(2, 0, half, half),
            leaf(3, half, half, half),
            leaf(4, root, 0, root),
        ];
        (vec![2, LEAF_BIT | 4, LEAF_BIT, LEAF_BIT | 1, LEAF_BIT | 2, LEAF_BIT | 3], leaves)
    }

    fn sun(elevation_degrees: f32, east: f32) -> Vec3 {
        let (sine, cosine) = elevation_degrees.to_radians().sin_cos();
        Vec3::new(cosine * east, 0.0, sine)
    }

    fn with_world<R>(
        height: fn(u32, f32, f32) -> f32,
        wraps: u32,
        answer: impl FnOnce(&World<'_, Fields>) -> R,
    ) -> R {
        let (nodes, leaves) = leaves();
        let view = View {
            root_size: [2, 1],
            forward: [0.0, 1.0, 0.0, 1_000.0],
            shadow_steps: 30,
            wraps,
            ..View::default()
        };
        let texels = Fields { leaves: leaves.clone(), height };
        answer(&World {
            view: &view,
            nodes: &nodes,
            leaves: &leaves,
            texels: &texels,
            sheet: None,
            use_minima: false,
        })
    }

    fn ground(world: &World<'_, Fields>, x: f32, y: f32) -> Ground {
        let unit = UVec2::new((x * UNITS_PER_METRE) as u32, (y * UNITS_PER_METRE) as u32);
        let found = ground_leaf_at(world, unit);
        let index = world.leaves.iter().position(|leaf| leaf.slot == found.slot).unwrap();
        let place = MapPlace { unit, fraction: Vec2::ZERO };
        Ground {
            place,
            leaf: index as u32,
            height: height_at(world, cell_in(&found, place), found.slot, true),
            units_per_metre: Vec2::splat(UNITS_PER_METRE),
            cell_over_footprint: 0.5,
            node_error: 0.0,
        }
    }

    /// A wall 300 m high, from 3,400 m to 3,900 m east: it stands on the edge between two leaves.
    fn wall(_: u32, x: f32, _: f32) -> f32 {
        if (3_400.0..3_900.0).contains(&x) { 300.0 } else { 0.0 }
    }

    #[test]
    fn a_plain_lies_in_full_light() {
        with_world(
            |_, _, _| 10.0,
            0,
            |world| {
                for elevation in [3.0, 20.0, 90.0] {
                    for dither in [0.0, 0.5, 0.99] {
                        let light =
                            sun_visibility(world, &ground(world, 900.0, 900.0), sun(elevation, 1.0), dither);
                        assert_eq!(light, 1.0, "{elevation}° {dither}");
                    }
                }
                let open = sky_visibility(world, &ground(world, 900.0, 900.0), 10.0, 100.0);
                assert_eq!(open, 1.0);
            },
        );
    }

    #[test]
    fn a_wall_in_the_next_tile_casts_its_shadow_as_far_as_it_should() {
        with_world(wall, 0, |world| {
            // 300 m at 20° reach 824 m, at 45° 300 m.
            for (elevation, distance, dark) in
                [(20.0, 500.0, true), (20.0, 1_000.0, false), (45.0, 200.0, true), (45.0, 400.0, false)]
            {
                let at = ground(world, 3_400.0 - distance, 1_000.0);
                for dither in [0.0, 0.3, 0.6, 0.9] {
                    let light = sun_visibility(world, &at, sun(elevation, 1.0), dither);
                    assert!(
                        if dark { light < 0.35 } else { light > 0.9 },
                        "{elevation}° at {distance} m: {light}"
                    );
                    assert_eq!(
                        sun_visibility(world, &at, sun(elevation, -1.0), dither),
                        1.0,
                        "the other way"
                    );
                }
            }
        });
    }

    #[test]
    fn the_shadow_has_no_seam_where_levels_meet() {
        // A ridge north to south that both the fine leaf and the coarse one beyond it hold.
        fn ridge(_: u32, x: f32, _: f32) -> f32 {
            (250.0 - (x - 7_100.0).abs() * 0.8).max(0.0)
        }
        with_world(ridge, 0, |world| {
            let edge = ROOT_METRES;
            let at = |x: f32| {
                let light: f32 = (0..16)
                    .map(|k| {
                        sun_visibility(world, &ground(world, x, 2_000.0), sun(12.0, 1.0), k as f32 / 16.0)
                    })
                    .sum();
                light / 16.0
            };
            let (west, east) = (at(edge - 4.0), at(edge + 4.0));
            assert!((west - east).abs() < 0.08, "{west} {east}");
        });
    }

    #[test]
    fn light_goes_round_the_earth_where_the_grid_does() {
        // A wall at the very west of the grid shades the very east of it.
        fn western(_: u32, x: f32, _: f32) -> f32 {
            if x < 400.0 { 300.0 } else { 0.0 }
        }
        let light = |wraps| {
            with_world(western, wraps, |world| {
                sun_visibility(world, &ground(world, 2.0 * ROOT_METRES - 60.0, 900.0), sun(30.0, 1.0), 0.4)
            })
        };
        assert!(light(1) < 0.3, "{}", light(1));
        assert_eq!(light(0), 1.0, "without wrapping there is nothing beyond the edge");
    }

    #[test]
    fn voids_cast_no_shadow_and_no_steps_cost_nothing() {
        let light = |steps| {
            with_world(
                |_, x, _| if (1_000.0..1_200.0).contains(&x) { 2.0 * VOID_HEIGHT } else { 0.0 },
                0,
                |world| {
                    let view = View { shadow_steps: steps, ..*world.view };
                    let world = World { view: &view, ..*world };
                    sun_visibility(&world, &ground(&world, 900.0, 900.0), sun(3.0, 1.0), 0.5)
                },
            )
        };
        assert_eq!(light(30), 1.0);
        assert_eq!(light(0), 1.0);
    }

    #[test]
    fn a_gorge_sees_less_sky_than_a_ridge() {
        fn gorge(_: u32, x: f32, _: f32) -> f32 {
            ((x - 1_000.0).abs() * 1.5).min(400.0)
        }
        with_world(gorge, 0, |world| {
            let floor = sky_visibility(world, &ground(world, 1_000.0, 900.0), 20.0, 150.0);
            let rim = sky_visibility(world, &ground(world, 1_400.0, 900.0), 20.0, 150.0);
            assert!(floor < 0.7 && rim > 0.95, "{floor} {rim}");
        });
    }

    #[test]
    fn a_higher_sun_never_darkens() {
        with_world(wall, 0, |world| {
            let at = ground(world, 3_100.0, 1_500.0);
            let mut last = 0.0;
            for elevation in 1..90 {
                let light = sun_visibility(world, &at, sun(elevation as f32, 1.0), 0.5);
                assert!(light >= last - 0.12, "{elevation}°: {light} after {last}");
                last = light;
            }
            assert_eq!(last, 1.0);
        });
    }
}
