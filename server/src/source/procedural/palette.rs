//! The photo's colour of a place: sRGB values 0…255 as an aerial camera on a clear summer noon gives.

use super::ground::Ground;
use super::material::Materials;
use super::random::{hash, mix, signed, smoothstep, unit};

type Colour = [f32; 3];

const SPRUCE: Colour = [45.0, 58.0, 38.0];
const BEECH: Colour = [70.0, 90.0, 46.0];
const VALLEY_GRASS: Colour = [104.0, 124.0, 66.0];
const ALPINE_GRASS: Colour = [118.0, 119.0, 74.0];
const DRY_GRASS: Colour = [146.0, 135.0, 98.0];
const GNEISS: Colour = [121.0, 116.0, 109.0];
const LIMESTONE: Colour = [150.0, 144.0, 133.0];
const RUSTY_ROCK: Colour = [122.0, 110.0, 97.0];
const SCREE: Colour = [150.0, 144.0, 134.0];
const GRAVEL: Colour = [168.0, 163.0, 151.0];
const SUNLIT_SNOW: Colour = [240.0, 242.0, 245.0];
const SHADED_SNOW: Colour = [186.0, 203.0, 226.0];
const BARE_ICE: Colour = [190.0, 203.0, 210.0];
const DEEP_WATER: Colour = [30.0, 72.0, 86.0];
const SHALLOW_WATER: Colour = [112.0, 140.0, 126.0];
const RIVER: Colour = [122.0, 146.0, 142.0];

/// Direction to the sun that the photo was taken in: from the south-south-west, 52° high.
const SUN: [f32; 3] = [-0.236, -0.569, 0.788];
/// Share of the sun's shading that is baked into the photo; the client lights the rest.
const BAKED: f32 = 0.34;
/// Colours keep away from the ends of the scale, so that corrections rarely clamp.
const RANGE: (f32, f32) = (10.0, 247.0);

fn blend(a: Colour, b: Colour, t: f32) -> Colour {
    [mix(a[0], b[0], t), mix(a[1], b[1], t), mix(a[2], b[2], t)]
}

fn scaled(a: Colour, factor: f32) -> Colour {
    a.map(|v| v * factor)
}

/// The colour of a place over a footprint (metres).
#[inline(always)]
pub(super) fn colour(ground: &Ground, here: &Materials, footprint: f32) -> Colour {
    let (broad, middle, fine) = (&ground.broad, &ground.middle, &ground.fine);
    let z = ground.height;

    // Grass: lush in the valley, browner above, tufted.
    let dryness = smoothstep(1500.0, 2400.0, z + 300.0 * broad.soft + 150.0 * middle.soft);
    let lush = blend(VALLEY_GRASS, ALPINE_GRASS, smoothstep(900.0, 1700.0, z + 200.0 * broad.other));
    let mut out = blend(lush, DRY_GRASS, 0.75 * dryness);
    out = scaled(out, 1.0 + 0.10 * broad.other + 0.10 * middle.soft + 0.11 * fine.soft);
    if here.field > 0.01 {
        out = blend(out, field(ground, footprint), here.field);
    }
    if here.debris > 0.005 {
        let stones = scaled(SCREE, 0.90 + 0.10 * middle.other + 0.16 * fine.domes + 0.10 * fine.creased);
        out = blend(out, blend(stones, GNEISS, 0.3 + 0.5 * broad.other.max(0.0)), here.debris);
    }
    if here.rock > 0.005 {
        out = blend(out, rock(ground, footprint), here.rock);
    }
    if here.forest > 0.005 {
        let leaves = smoothstep(-0.25, 0.25, here.beech - 0.5 - 0.55 * (fine.other + middle.other));
        let mut crowns = blend(SPRUCE, BEECH, leaves);
        crowns = scaled(crowns, 1.0 + 0.10 * broad.soft + 0.12 * middle.soft);
        // Crowns lit on top, dark between; the mean of the domes is about 0.6.
        crowns = scaled(crowns, 0.60 + 0.66 * fine.domes + 0.12 * fine.soft);
        let gaps = smoothstep(0.0, 0.45, here.forest * 1.25 - 0.55 + fine.domes * 0.8 - 0.2);
        out = blend(
            out,
            crowns,
            mix(gaps, here.forest, smoothstep(3.0, 14.0, footprint)) * smoothstep(0.0, 0.25, here.forest),
        );
    }
    if here.gravel > 0.005 {
        let stones = scaled(GRAVEL, 0.93 + 0.12 * fine.other + 0.10 * fine.domes);
        // Wet just above the water.
        let wet = 1.0 - smoothstep(0.0, 0.5, ground.above_lake.max(0.0));
        out = blend(out, scaled(stones, 1.0 - 0.35 * wet), here.gravel);
    }
    let light = (SUN[2] - ground.dx * SUN[0] - ground.dy * SUN[1])
        / (1.0 + ground.dx * ground.dx + ground.dy * ground.dy).sqrt();
    let light = light.max(0.0) * (1.0 / SUN[2]);
    out = scaled(out, 1.0 + BAKED * (light - 1.0));
    if here.snow > 0.005 {
        out = blend(out, snow(ground, light, here.steep), here.snow);
    }
    if here.water > 0.005 {
        out = blend(out, water(ground), here.water);
    }
    out.map(|v| v.clamp(RANGE.0, RANGE.1))
}

/// Rock: two kinds and a rusty third, in bands that dip to the east, cracked.
#[inline(always)]
fn rock(ground: &Ground, footprint: f32) -> Colour {
    let (broad, middle, fine) = (&ground.broad, &ground.middle, &ground.fine);
    let kind = smoothstep(-0.25, 0.35, broad.soft + 0.2 * middle.soft);
    let mut out = blend(GNEISS, LIMESTONE, kind);
    out = blend(out, RUSTY_ROCK, 0.6 * smoothstep(0.2, 0.6, broad.other));
    let depth = (ground.height + 0.22 * ground.x - 0.10 * ground.y + 26.0 * middle.soft + 3.0 * fine.soft)
        * (1.0 / 27.0);
    let bed = depth.floor();
    let within = depth - bed;
    let tone = |k: f32| signed(hash((k + 100_000.0) as u32, 5, 77));
    let strata = mix(tone(bed), tone(bed + 1.0), smoothstep(0.72, 1.0, within));
    let visible = 1.0 - smoothstep(6.0, 24.0, footprint);
    scaled(out, 0.98 + 0.10 * strata * visible + 0.16 * middle.creased + 0.15 * fine.creased)
}

/// Snow, blue in the shade; bare ice low on the glaciers.
#[inline(always)]
fn snow(ground: &Ground, light: f32, steep: f32) -> Colour {
    let (middle, fine) = (&ground.middle, &ground.fine);
    let mut out = blend(SHADED_SNOW, SUNLIT_SNOW, smoothstep(0.35, 0.95, light + 0.06 * middle.soft));
    let ice = (1.0
        - smoothstep(2780.0, 2960.0, ground.height + 120.0 * ground.broad.soft + 60.0 * middle.soft))
        * (1.0 - smoothstep(0.35, 0.6, steep));
    let crevassed = scaled(BARE_ICE, 0.94 + 0.10 * middle.creased + 0.06 * fine.creased);
    out = blend(out, crevassed, 0.8 * ice);
    scaled(out, 0.985 + 0.018 * fine.soft + 0.02 * middle.soft)
}

/// Water: the bed shines through where it is shallow.
#[inline(always)]
fn water(ground: &Ground) -> Colour {
    if ground.above_lake < 30.0 {
        let deep = smoothstep(0.0, 11.0, -ground.above_lake);
        let out = blend(SHALLOW_WATER, DEEP_WATER, deep.sqrt());
        scaled(out, 1.0 + 0.03 * ground.broad.other + 0.015 * ground.middle.soft)
    } else {
        scaled(RIVER, 1.0 + 0.10 * ground.fine.creased)
    }
}

/// A patchwork of parcels, some mown, some sown, in strips that bend with the land.
#[inline(always)]
fn field(ground: &Ground, footprint: f32) -> Colour {
    const KINDS: [Colour; 6] = [
        [102.0, 122.0, 66.0],
        [110.0, 129.0, 71.0],
        [119.0, 134.0, 78.0],
        [134.0, 139.0, 86.0],
        [96.0, 116.0, 63.0],
        [130.0, 126.0, 88.0],
    ];
    const MEAN: Colour = [113.0, 128.0, 74.0];
    let (broad, fine) = (&ground.broad, &ground.fine);
    let plain = scaled(MEAN, 1.0 + 0.05 * ground.middle.soft);
    let visible = 1.0 - smoothstep(18.0, 60.0, footprint);
    if visible == 0.0 {
        return plain;
    }
    // Blocks of parcels, each turned its own way.
    let (bx, by) = (ground.x + 420.0 * broad.soft, ground.y + 420.0 * broad.other);
    let block = hash((bx * (1.0 / 640.0) + 500.0) as u32, (by * (1.0 / 640.0) + 500.0) as u32, 21);
    let (cosine, sine) = [(0.92, 0.39), (0.39, 0.92), (0.71, -0.71), (0.98, -0.2)][(block & 3) as usize];
    let (u, v) =
        ((bx * cosine + by * sine) * (1.0 / 150.0) + 500.0, (by * cosine - bx * sine) * (1.0 / 52.0) + 500.0);
    let shift = 0.7 * unit(hash(v as u32, block, 22));
    let parcel = hash((u + shift) as u32, v as u32, block);
    let kind = KINDS[(parcel % 13 % 6) as usize];
    let along = (v - v.floor()) * 52.0;
    let rim = smoothstep(0.0, 1.6 + footprint, along.min(52.0 - along));
    let rows = 1.0 + 0.05 * fine.other + 0.06 * fine.soft;
    let colour = scaled(kind, rows * (0.94 + 0.12 * unit(parcel.rotate_left(9))) * mix(0.86, 1.0, rim));
    blend(plain, colour, visible)
}
