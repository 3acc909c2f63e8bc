//! What lies and grows at a place: one set of rules, read by the photo and by the land cover alike.

use super::ground::Ground;
use super::random::{mix, smoothstep};

/// Height up to which forest climbs on an even slope, metres.
pub(super) const TREE_LINE: f32 = 1_980.0;
/// Height above which snow lies through the summer on an even slope, metres.
const SNOW_LINE: f32 = 2_740.0;

/// Shares of what is seen from above, each 0…1. Later ones lie over earlier ones: grass, field,
/// debris, rock, forest, gravel, snow, water.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Materials {
    /// Mown and sown land of the valleys, of what is not forest.
    pub field: f32,
    /// Scree, moraine and bare debris.
    pub debris: f32,
    /// Standing rock.
    pub rock: f32,
    /// Ground under crowns.
    pub forest: f32,
    /// Share of beech in the forest, the rest is spruce.
    pub beech: f32,
    /// Vigour of the forest: 1 in the valleys, less towards the tree line.
    pub vigour: f32,
    /// Gravel of rivers and shores.
    pub gravel: f32,
    /// Snow and ice.
    pub snow: f32,
    /// River or lake.
    pub water: f32,
    /// Slope (rise over run).
    pub steep: f32,
}

/// The rules. `footprint` (metres) is the width over which the shares are meant; 0 is a point.
#[inline(always)]
pub(super) fn materials(ground: &Ground, footprint: f32) -> Materials {
    let z = ground.height;
    let steep = (ground.dx * ground.dx + ground.dy * ground.dy).sqrt();
    // −1 where the slope faces south … 1 where it faces north; 0 on level ground.
    let northward = -ground.dy / (steep + 0.12);
    let (broad, middle, fine) = (&ground.broad, &ground.middle, &ground.fine);
    let hollow = ground.hollow.clamp(-60.0, 60.0);
    let mut out = Materials { steep, ..Materials::default() };

    // Water and what it has washed clean.
    let mut water = if ground.above_lake < 0.0 { 1.0 } else { 0.0 };
    let shore = (1.6 + 1.2 * middle.other) * (1.0 - 0.75 * smoothstep(0.25, 0.8, steep));
    let mut gravel = 1.0 - smoothstep(0.0, shore + 0.3, ground.above_lake);
    if footprint > 0.0 && ground.above_lake < 1000.0 {
        // The share of the footprint that is under water, if the slope goes on.
        let rise = footprint * (steep + 0.03);
        water = (0.5 - ground.above_lake / rise).clamp(0.0, 1.0);
        gravel = (0.5 - (ground.above_lake - 0.7 * shore) / rise).clamp(0.0, 1.0);
    }
    let mut riverside = 0.0;
    if let Some(river) = &ground.river {
        let blur = footprint.max(0.8);
        let across = ((river.half_width + 0.5 * blur - river.distance) / blur).clamp(0.0, 1.0);
        water = f32::max(water, across * (2.0 * river.half_width / blur).min(1.0));
        let bar = river.half_width * (1.35 + 1.3 * (middle.other + middle.soft)) + 1.5;
        let bars = 1.0 - smoothstep(bar, bar + 2.0 + 0.5 * footprint, river.distance);
        gravel = f32::max(gravel, bars * (1.0 - smoothstep(8.0, 40.0, footprint) * 0.6));
        riverside = smoothstep(bar + 3.0, bar + 8.0, river.distance)
            * (1.0 - smoothstep(22.0, 46.0, river.distance - 30.0 * middle.soft));
    }
    out.water = water;
    out.gravel = gravel;

    // Rock stands where it is too steep for anything to lie.
    let alpine = smoothstep(1650.0, 2500.0, z);
    let bare = steep + 0.17 * middle.creased + 0.14 * ground.rib + 0.07 * fine.creased;
    let limit = mix(1.22, 0.92, alpine);
    out.rock = smoothstep(limit - 0.13, limit + 0.13, bare);

    // Snow: high, on the shady side, in hollows, never on walls.
    let gentle = 1.0 - smoothstep(0.18, 0.62, steep);
    let line = SNOW_LINE - 190.0 * northward - 200.0 * gentle
        + 190.0 * broad.soft
        + 110.0 * middle.soft
        + 35.0 * fine.soft
        - 2.2 * hollow;
    let lying = (z - line) * (1.0 / 210.0)
        - 3.4 * (steep - 0.80).max(0.0)
        - 1.1 * ground.rib * smoothstep(0.4, 0.8, steep)
        - 0.5 * out.rock * middle.creased.abs();
    out.snow = smoothstep(-0.12, 0.30, lying);

    // Debris: the high slopes, and aprons under the walls.
    let bareness = z + 230.0 * broad.soft + 120.0 * middle.other + 60.0 * fine.other - 1.5 * hollow
        + 260.0 * (steep - 0.5)
        + 60.0 * northward;
    let high = smoothstep(2380.0, 2700.0, bareness);
    let apron = smoothstep(6.0, 34.0, hollow + 14.0 * middle.soft)
        * smoothstep(0.50, 0.64, steep)
        * smoothstep(1800.0, 2050.0, z + 260.0 * broad.other);
    out.debris = high.max(0.92 * apron);

    // Open land: valley floors and the gentle country below the mountains.
    let floor = (1.0 - smoothstep(0.13, 0.27, steep))
        * (1.0 - smoothstep(30.0, 90.0, ground.above_stream + 40.0 * middle.soft));
    let farmland = (1.0 - smoothstep(0.17, 0.36, steep + 0.1 * middle.soft))
        * (1.0 - smoothstep(0.02, 0.16, broad.soft + 0.35 * middle.other - 0.12));
    let low = 1.0 - smoothstep(1150.0, 1350.0, z + 120.0 * broad.other);
    let copse =
        smoothstep(0.34, 0.42, broad.other + 0.4 * middle.soft + 0.1 * fine.soft).max(0.9 * riverside);
    let open = floor.max(farmland * low) * (1.0 - copse);
    out.field = floor.max(farmland) * low;

    // Forest up to the tree line; avalanches and herdsmen keep some of it open.
    let edge = TREE_LINE + 130.0 * broad.soft + 75.0 * broad.other + 55.0 * middle.soft + 25.0 * fine.soft
        - 70.0 * northward
        + 130.0 * ground.rib
        - z;
    let below = smoothstep(-35.0, 75.0 + footprint, edge);
    let track = smoothstep(0.10, 0.26, -ground.rib + 0.12 * middle.soft)
        * smoothstep(1150.0, 1650.0, z + 250.0 * broad.other)
        * smoothstep(0.42, 0.62, steep)
        * smoothstep(-0.10, 0.12, broad.other + 0.2);
    let clearing =
        smoothstep(0.20, 0.30, broad.other - 0.35 * broad.soft + 0.22 * middle.soft - 0.55 * (steep - 0.42))
            * smoothstep(850.0, 1100.0, z);
    let density = 0.80 + 0.35 * middle.other - 0.35 * (1.0 - smoothstep(0.0, 260.0, edge));
    out.forest = below
        * (1.0 - out.rock)
        * (1.0 - out.debris)
        * (1.0 - open)
        * (1.0 - clearing)
        * (1.0 - 0.94 * track)
        * (1.0 - gravel)
        * (1.0 - smoothstep(1.1, 1.35, steep))
        * density.clamp(0.0, 1.0);
    out.vigour = smoothstep(-20.0, 420.0, edge);
    let warm = z + 240.0 * broad.other + 110.0 * middle.other + 70.0 * northward;
    out.beech = 0.92 * (1.0 - smoothstep(820.0, 1380.0, warm)) + 0.04;
    out
}
