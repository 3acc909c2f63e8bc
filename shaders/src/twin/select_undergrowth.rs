//! Twin of `select_undergrowth.wgsl`: which plants are drawn, in which order, and how far each has grown, in high summer
//! (what the year takes away the shader alone knows).
//!
//! Metaseeds, clusters and members are `treeline_core::seeds::metaseed`'s own: the shader is their twin.

use super::leaf_at::{grid_of_place, leaf_index_at};
use super::load_map_place::enu_from_place;
use super::shadow::{MapPlace, cell_in, ground_leaf, node_height};
use super::sky::smoothstep;
use super::{Texels, World};
use crate::layout::{EMPTY, VOID_HEIGHT, View};
use crate::season::SPECIES_SHIFT;
use crate::undergrowth::{BINS, BLOCK_SIDE, FAR_GRASS, UndergrowthBlock, UndergrowthFrame};
use glam::{IVec2, UVec2, Vec2, Vec3, Vec4, Vec4Swizzles};
use treeline_core::layer::SurfaceType;
use treeline_core::seeds::metaseed::{
    Cluster, Community, Kind, Member, Metaseed, ROWS, cluster, member, metaseed,
};
use treeline_core::seeds::pattern::CELL_UNITS;

const UNIT_RADIANS: f32 = 1.462_918e-9;
const SIZE_METRES: f32 = 1.0 / 1024.0;
const CLUSTER_METRES: f32 = 3.4;
const LEAST_CROWN: u8 = 8;
const CROWNS_METRES: f32 = 3.5;
const CANOPY_FOOT: f32 = 0.05;
const CANOPY_UNIT: f32 = 0.25;
const VOID_BELOW: f32 = -1.0e5;
const LEAST_PIXELS: f32 = 1.6;
const GROWTH_BAND: f32 = 0.3;
const RANGE_SPREAD: f32 = 0.75;
const NEAR_EYE: [f32; 2] = [0.25, 0.9];
const KIND_RANGES: [f32; 6] = [0.75, 0.6, 0.9, 0.9, 1.0, 1.0];
const NEAR_GRASS: f32 = 12.0;
const TYPE_MASK: u8 = (1 << SPECIES_SHIFT) - 1;

/// What the texture arrays hold beside heights.
pub trait SurfaceTexels: Texels {
    /// Surface type (with the species' code above its bits) and canopy height; the texel counts the border.
    fn surface(&self, slot: u32, x: i32, y: i32) -> [u8; 2];
}

/// What the pass has bound.
pub struct PlantWorld<'a, T: SurfaceTexels> {
    /// The frame and the tiles.
    pub world: World<'a, T>,
    /// The pass's own.
    pub frame: &'a UndergrowthFrame,
}

/// A metaseed on its ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// The seed.
    pub seed: Metaseed,
    /// What grows.
    pub cluster: Cluster,
    /// Index of its leaf.
    pub leaf: u32,
}

/// A member that is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planted {
    /// Block (from bit 12), place of the metaseed in it (from bit 6), number of the member.
    pub seed: u32,
    /// Of its cluster.
    pub community: Community,
    /// The member.
    pub member: Member,
    /// How far it has grown, 0…1.
    pub grown: f32,
    /// Foot, metres from the eye.
    pub foot: Vec3,
}

impl<T: SurfaceTexels> PlantWorld<'_, T> {
    fn surface(&self, node: IVec2, slot: u32) -> [u8; 2] {
        let inside = node.clamp(IVec2::splat(-1), IVec2::splat(513));
        self.world.texels.surface(slot, inside.x + 1, inside.y + 1)
    }

    fn nearest_node(&self, index: u32, unit: UVec2) -> IVec2 {
        let leaf = &self.world.leaves[index as usize];
        let units: UVec2 = (UVec2::splat(leaf.grid_side) / UVec2::from_array(leaf.cells)).max(UVec2::ONE);
        let within: UVec2 = (unit - UVec2::from_array(leaf.grid_origin)) + (units >> 1);
        let node: UVec2 = UVec2::from_array(leaf.first_cell) + within / units;
        node.as_ivec2()
    }

    fn surface_type(&self, index: u32, unit: UVec2) -> u8 {
        let slot = self.world.leaves[index as usize].slot;
        self.surface(self.nearest_node(index, unit), slot)[0] & TYPE_MASK
    }

    /// Height of the ground that is drawn, below any canopy, and of the canopy over it, metres.
    fn drawn_ground(&self, index: u32, unit: UVec2) -> Vec2 {
        let leaf = ground_leaf(&self.world, index);
        let cell = cell_in(&leaf, MapPlace { unit, fraction: Vec2::splat(0.5) });
        let base = cell.floor().as_ivec2();
        let part = cell - cell.floor();
        let node = |offset: IVec2| self.bare_node(base + offset, leaf.slot);
        let mix = |a: Vec2, b: Vec2, share: f32| a * (1.0 - share) + b * share;
        let north = mix(node(IVec2::ZERO), node(IVec2::X), part.x);
        let south = mix(node(IVec2::Y), node(IVec2::ONE), part.x);
        let ground = mix(north, south, part.y);
        if ground.x < VOID_BELOW { Vec2::new(VOID_HEIGHT, 0.0) } else { ground }
    }

    /// Height of a node's ground and of the canopy over it, metres.
    fn bare_node(&self, node: IVec2, slot: u32) -> Vec2 {
        let inside = node.clamp(IVec2::splat(-1), IVec2::splat(513));
        let canopy = f32::from(self.surface(inside, slot)[1]) * CANOPY_UNIT;
        Vec2::new(node_height(&self.world, inside, slot) - canopy, canopy)
    }

    fn crowns_about(&self, index: u32, unit: UVec2) -> u32 {
        let leaf = &self.world.leaves[index as usize];
        let node = self.nearest_node(index, unit);
        let reach = (Vec2::splat(CROWNS_METRES) / Vec2::from(leaf.cell_metres)).round().max(Vec2::ONE);
        (0..9)
            .filter(|tap| {
                let offset = IVec2::new(tap % 3 - 1, tap / 3 - 1) * reach.as_ivec2();
                self.surface(node + offset, leaf.slot)[1] >= LEAST_CROWN
            })
            .count() as u32
    }

    fn foot_of(&self, block: &UndergrowthBlock, place: [i32; 2], height: f32) -> Vec3 {
        let angles = [0, 1].map(|axis| {
            ((block.offset[axis] + place[axis]) as f32 - self.frame.eye_fraction[axis]) * UNIT_RADIANS
        });
        enu_from_place(self.frame.eye, angles[0], -angles[1], height)
    }

    fn outside_picture(&self, centre: Vec3, radius: f32) -> bool {
        self.frame.sides.iter().any(|&side| Vec4::from(side).xyz().dot(centre) < -radius)
    }

    fn unit_of(&self, block: &UndergrowthBlock, place: [i32; 2]) -> UVec2 {
        let units =
            [0, 1].map(|axis| block.cell[axis].wrapping_mul(CELL_UNITS).wrapping_add(place[axis] as u32));
        grid_of_place(self.world.view, UVec2::from(units))
    }

    /// The cluster of a metaseed of a block, where one grows in the picture.
    pub fn site_of(&self, block: &UndergrowthBlock, local: u32) -> Option<Site> {
        let sub_cell = [block.first[0] + local % BLOCK_SIDE, block.first[1] + local / BLOCK_SIDE];
        if sub_cell[0] >= block.columns || sub_cell[1] >= ROWS {
            return None;
        }
        let seed = metaseed(block.cell, sub_cell, self.world.view.scene_seed);
        let place = [seed.x as i32, seed.y as i32];
        let unit = self.unit_of(block, place);
        let leaf = leaf_index_at(&self.world, unit);
        if leaf == EMPTY {
            return None;
        }
        let ground = self.drawn_ground(leaf, unit);
        if ground.x <= VOID_HEIGHT {
            return None;
        }
        let foot = self.foot_of(block, place, ground.x);
        if foot.length() > self.frame.range + CLUSTER_METRES || self.outside_picture(foot, CLUSTER_METRES) {
            return None;
        }
        let kind = u32::from(self.surface_type(leaf, unit));
        let community = Community::of(kind, self.crowns_about(leaf, unit), seed.bits);
        if community == Community::Nothing {
            return None;
        }
        Some(Site { seed, cluster: cluster(&seed, community)?, leaf })
    }

    /// A member, where it is drawn: how far it has grown, and its foot.
    pub fn placed_member(
        &self,
        block: &UndergrowthBlock,
        site: &Site,
        member: &Member,
    ) -> Option<(f32, Vec3)> {
        let place = [member.x, member.y];
        let unit = self.unit_of(block, place);
        let mut leaf = site.leaf;
        let about = &self.world.leaves[leaf as usize];
        let within = [0, 1].map(|axis| unit[axis].wrapping_sub(about.grid_origin[axis]));
        if within.iter().any(|&within| within >= about.grid_side) {
            leaf = leaf_index_at(&self.world, unit);
            if leaf == EMPTY {
                return None;
            }
        }
        let ground = self.drawn_ground(leaf, unit);
        if ground.x <= VOID_HEIGHT {
            return None;
        }
        let foot = self.foot_of(block, place, ground.x);
        let away = foot.length();
        if ground.y > CANOPY_FOOT && away >= self.frame.canopy_gone {
            return None;
        }
        let size = member.size as f32 * SIZE_METRES;
        if self.outside_picture(foot + 0.5 * size * Vec3::Z, 1.4 * size) {
            return None;
        }
        let kind = self.surface_type(leaf, unit);
        if kind == SurfaceType::Water as u8 || kind == SurfaceType::Snow as u8 {
            return None;
        }
        let grown = grown_at(self.world.view, self.frame.range, member, away);
        (grown > 0.0).then_some((grown, foot))
    }

    /// The plants of every bin, each in the order of blocks, metaseeds and members; and how many metaseeds have any.
    pub fn select(&self, blocks: &[UndergrowthBlock]) -> (Vec<Vec<Planted>>, u32) {
        let mut bins = vec![Vec::new(); BINS as usize];
        let mut metaseeds = 0;
        for (index, block) in (0..).zip(blocks) {
            for local in 0..BLOCK_SIDE * BLOCK_SIDE {
                let Some(site) = self.site_of(block, local) else { continue };
                let mut any = false;
                for number in 0..site.cluster.members {
                    let member = member(&site.seed, &site.cluster, number);
                    let Some((grown, foot)) = self.placed_member(block, &site, &member) else { continue };
                    any = true;
                    bins[bin_of(member.kind, foot.length()) as usize].push(Planted {
                        seed: index << 12 | local << 6 | number,
                        community: site.cluster.community,
                        member,
                        grown,
                        foot,
                    });
                }
                metaseeds += u32::from(any);
            }
        }
        (bins, metaseeds)
    }
}

/// Which draw a member is in.
pub fn bin_of(kind: Kind, away: f32) -> u32 {
    if kind == Kind::Grass && away >= NEAR_GRASS { FAR_GRASS } else { kind as u32 }
}

/// How far a member so far from the eye has grown, 0…1. Nothing is drawn farther than `range`, metres.
pub fn grown_at(view: &View, range: f32, member: &Member, away: f32) -> f32 {
    let jitter = (member.bits >> 8 & 0xffff) as f32 / 65_535.0;
    let end = range * KIND_RANGES[member.kind as usize] * (1.0 - RANGE_SPREAD * jitter * jitter);
    let end = end.min(member.size as f32 * SIZE_METRES / (LEAST_PIXELS * view.right[3]));
    let grown = smoothstep(0.0, 1.0, ((end - away) / (GROWTH_BAND * end)).clamp(0.0, 1.0));
    let grown = grown * smoothstep(NEAR_EYE[0], NEAR_EYE[1], away);
    if grown < 0.02 { 0.0 } else { grown }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the far end to the eye a plant grows little by little, each from a distance of its own.
    #[test]
    fn plants_grow_from_nothing() {
        let view = View { right: [0.0, 0.0, 0.0, 0.0015], ..View::default() };
        let seed = metaseed([139_035, 31_373], [5, 11], 1);
        let Some(cluster) = cluster(&seed, Community::Wood) else { panic!("it lives") };
        let mut ends = Vec::new();
        for number in 0..cluster.members {
            let member = member(&seed, &cluster, number);
            let mut before = 0.0;
            let mut end = 0.0;
            for step in 0..1_200 {
                let away = 60.0 - 0.05 * step as f32;
                let grown = grown_at(&view, 60.0, &member, away);
                // 5 cm nearer: no more than a twelfth of its size, farther than the few plants at the eye.
                assert!(
                    away < 1.5 || (grown - before).abs() < 0.085,
                    "{member:?} at {away}: {before} {grown}"
                );
                if before == 0.0 && grown > 0.0 {
                    end = away;
                }
                before = grown;
            }
            assert!((5.0..60.0).contains(&end), "{member:?} {end}");
            ends.push(end);
            assert_eq!(grown_at(&view, 60.0, &member, 0.2), 0.0, "nothing stands in the eye");
        }
        ends.sort_by(f32::total_cmp);
        ends.dedup();
        assert_eq!(ends.len(), cluster.members as usize);
    }
}
