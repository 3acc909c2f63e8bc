//! What lies and grows at a place: one set of rules, read by the photo and by the land cover alike.

use super::ground::Ground;
use super::lanes::{LANES, Lanes};
use super::random::smoothstep;

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

/// A lane's places' fields, one after the other.
struct Places<'a>(&'a [Ground; LANES]);

impl Places<'_> {
    #[inline(always)]
    fn of(&self, field: impl Fn(&Ground) -> f32) -> Lanes {
        Lanes(std::array::from_fn(|k| field(&self.0[k])))
    }
}

/// What water has to do with a place.
#[derive(Clone, Copy, Default)]
struct Waterside {
    water: f32,
    gravel: f32,
    riverside: f32,
}

/// Calls `each` with every place of a row and what lies there.
#[inline(always)]
pub(super) fn for_each_place(
    row: &[Ground],
    footprint: f32,
    mut each: impl FnMut(usize, &Ground, &Materials),
) {
    for (chunk, grounds) in row.chunks(LANES).enumerate() {
        let mut padded = [Ground::default(); LANES];
        let lane = grounds.first_chunk().unwrap_or_else(|| {
            padded[..grounds.len()].copy_from_slice(grounds);
            &padded
        });
        let here = materials(lane, footprint);
        for (k, (ground, here)) in grounds.iter().zip(&here).enumerate() {
            each(chunk * LANES + k, ground, here);
        }
    }
}

/// The rules, for a lane's places at once. `footprint` (metres) is the width over which the shares are meant;
/// 0 is a point.
#[inline(always)]
fn materials(grounds: &[Ground; LANES], footprint: f32) -> [Materials; LANES] {
    let all = Places(grounds);
    let (z, dx, dy) = (all.of(|g| g.height), all.of(|g| g.dx), all.of(|g| g.dy));
    let (rib, above_stream) = (all.of(|g| g.rib), all.of(|g| g.above_stream));
    let (broad_soft, broad_other) = (all.of(|g| g.broad.soft), all.of(|g| g.broad.other));
    let (middle_soft, middle_other) = (all.of(|g| g.middle.soft), all.of(|g| g.middle.other));
    let (fine_soft, fine_other) = (all.of(|g| g.fine.soft), all.of(|g| g.fine.other));
    let (middle_creased, fine_creased) = (all.of(|g| g.middle.creased), all.of(|g| g.fine.creased));
    let steep = (dx * dx + dy * dy).sqrt();
    // −1 where the slope faces south … 1 where it faces north; 0 on level ground.
    let northward = dy * -1.0 / (steep + 0.12);
    let hollow = all.of(|g| g.hollow).clamp(-60.0, 60.0);
    let beside: [Waterside; LANES] = std::array::from_fn(|k| waterside(&grounds[k], steep.0[k], footprint));
    let gravel = Lanes(beside.map(|beside| beside.gravel));
    let riverside = Lanes(beside.map(|beside| beside.riverside));

    // Rock stands where it is too steep for anything to lie.
    let alpine = z.smoothstep(1650.0, 2500.0);
    let bare = steep + middle_creased * 0.17 + rib * 0.14 + fine_creased * 0.07;
    let limit = alpine.mix(1.22, 0.92);
    let t = ((bare - (limit + -0.13)) * ((limit + 0.13) - (limit + -0.13)).divide(1.0)).clamp(0.0, 1.0);
    let rock = t * t * (t * -2.0 + 3.0);

    // Snow: high, on the shady side, in hollows, never on walls.
    let gentle = steep.smoothstep(0.18, 0.62).complement();
    let line = Lanes::all(SNOW_LINE) - northward * 190.0 - gentle * 200.0
        + broad_soft * 190.0
        + middle_soft * 110.0
        + fine_soft * 35.0
        - hollow * 2.2;
    let lying = (z - line) * (1.0 / 210.0)
        - (steep + -0.80).max(Lanes::all(0.0)) * 3.4
        - rib * 1.1 * steep.smoothstep(0.4, 0.8)
        - rock * 0.5 * middle_creased.abs();
    let snow = lying.smoothstep(-0.12, 0.30);

    // Debris: the high slopes, and aprons under the walls.
    let bareness = z + broad_soft * 230.0 + middle_other * 120.0 + fine_other * 60.0 - hollow * 1.5
        + (steep + -0.5) * 260.0
        + northward * 60.0;
    let high = bareness.smoothstep(2380.0, 2700.0);
    let apron = (hollow + middle_soft * 14.0).smoothstep(6.0, 34.0)
        * steep.smoothstep(0.50, 0.64)
        * (z + broad_other * 260.0).smoothstep(1800.0, 2050.0);
    let debris = high.max(apron * 0.92);

    // Open land: valley floors and the gentle country below the mountains.
    let floor = steep.smoothstep(0.13, 0.27).complement()
        * (above_stream + middle_soft * 40.0).smoothstep(30.0, 90.0).complement();
    let farmland = (steep + middle_soft * 0.1).smoothstep(0.17, 0.36).complement()
        * (broad_soft + middle_other * 0.35 + -0.12).smoothstep(0.02, 0.16).complement();
    let low = (z + broad_other * 120.0).smoothstep(1150.0, 1350.0).complement();
    let copse =
        (broad_other + middle_soft * 0.4 + fine_soft * 0.1).smoothstep(0.34, 0.42).max(riverside * 0.9);
    let open = floor.max(farmland * low) * copse.complement();
    let field = floor.max(farmland) * low;

    // Forest up to the tree line; avalanches and herdsmen keep some of it open.
    let edge = broad_soft * 130.0 + TREE_LINE + broad_other * 75.0 + middle_soft * 55.0 + fine_soft * 25.0
        - northward * 70.0
        + rib * 130.0
        - z;
    let below = edge.smoothstep(-35.0, 75.0 + footprint);
    let track = (rib * -1.0 + middle_soft * 0.12).smoothstep(0.10, 0.26)
        * (z + broad_other * 250.0).smoothstep(1150.0, 1650.0)
        * steep.smoothstep(0.42, 0.62)
        * (broad_other + 0.2).smoothstep(-0.10, 0.12);
    let clearing = (broad_other - broad_soft * 0.35 + middle_soft * 0.22 - (steep + -0.42) * 0.55)
        .smoothstep(0.20, 0.30)
        * z.smoothstep(850.0, 1100.0);
    let density = middle_other * 0.35 + 0.80 - edge.smoothstep(0.0, 260.0).complement() * 0.35;
    let forest = below
        * rock.complement()
        * debris.complement()
        * open.complement()
        * clearing.complement()
        * (track * -0.94 + 1.0)
        * gravel.complement()
        * steep.smoothstep(1.1, 1.35).complement()
        * density.clamp(0.0, 1.0);
    let vigour = edge.smoothstep(-20.0, 420.0);
    let warm = z + broad_other * 240.0 + middle_other * 110.0 + northward * 70.0;
    let beech = warm.smoothstep(820.0, 1380.0).complement() * 0.92 + 0.04;
    std::array::from_fn(|k| Materials {
        field: field.0[k],
        debris: debris.0[k],
        rock: rock.0[k],
        forest: forest.0[k],
        beech: beech.0[k],
        vigour: vigour.0[k],
        gravel: gravel.0[k],
        snow: snow.0[k],
        water: beside[k].water,
        steep: steep.0[k],
    })
}

/// Water, and what it has washed clean.
#[inline(always)]
fn waterside(ground: &Ground, steep: f32, footprint: f32) -> Waterside {
    let middle = &ground.middle;
    let mut out = Waterside::default();
    if ground.above_lake < 1000.0 {
        out.water = if ground.above_lake < 0.0 { 1.0 } else { 0.0 };
        let shore = (1.6 + 1.2 * middle.other) * (1.0 - 0.75 * smoothstep(0.25, 0.8, steep));
        out.gravel = 1.0 - smoothstep(0.0, shore + 0.3, ground.above_lake);
        if footprint > 0.0 {
            // The share of the footprint that is under water, if the slope goes on.
            let rise = footprint * (steep + 0.03);
            out.water = (0.5 - ground.above_lake / rise).clamp(0.0, 1.0);
            out.gravel = (0.5 - (ground.above_lake - 0.7 * shore) / rise).clamp(0.0, 1.0);
        }
    }
    if let Some(river) = &ground.river {
        let blur = footprint.max(0.8);
        let across = ((river.half_width + 0.5 * blur - river.distance) / blur).clamp(0.0, 1.0);
        out.water = f32::max(out.water, across * (2.0 * river.half_width / blur).min(1.0));
        let bar = river.half_width * (1.35 + 1.3 * (middle.other + middle.soft)) + 1.5;
        let bars = 1.0 - smoothstep(bar, bar + 2.0 + 0.5 * footprint, river.distance);
        out.gravel = f32::max(out.gravel, bars * (1.0 - smoothstep(8.0, 40.0, footprint) * 0.6));
        out.riverside = smoothstep(bar + 3.0, bar + 8.0, river.distance)
            * (1.0 - smoothstep(22.0, 46.0, river.distance - 30.0 * middle.soft));
    }
    out
}
