//! Twin of `load_map_pixels.wgsl`: what each pixel of the ray caster says of the load map.

use super::Texels;
use super::distance_pyramid::{NO_DISTANCES, join_distances};
use super::load_map::{BLENDS_FROM, ENDLESS, LoadMap, MARK_BLENDED, MARK_WANTED, radial_mark};
use crate::layout::{EMPTY, ROOT_BITS};
use glam::{IVec2, UVec2, Vec2, Vec4};

/// Places in a quad, along each axis, at which what lies between its pixels is marked.
const BETWEEN: u32 = 4;
/// Pixels whose distances differ by more are of two slopes.
const SMOOTH: f32 = 1.25;

/// A pixel's hit.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// Metres from the eye; negative: a miss.
    distance: f32,
    /// Grid coordinates of the hit.
    grid: UVec2,
}

fn sample_at<T: Texels>(map: &LoadMap<'_, T>, pixel: IVec2, distances: &[f32], hits: &[[u32; 4]]) -> Sample {
    let index = (pixel.y * map.world.view.size[0] as i32 + pixel.x) as usize;
    let distance = distances[index];
    if distance < 0.0 {
        return Sample { distance: -1.0, grid: UVec2::ZERO };
    }
    let [leaf, u, v, _] = hits[index];
    let place = Vec2::new(f32::from_bits(u), f32::from_bits(v));
    let leaf = &map.world.leaves[leaf as usize];
    let side = leaf.grid_side;
    let unit = Vec2::splat(side as f32) / UVec2::from_array(leaf.cells).as_vec2();
    let along = (place - UVec2::from_array(leaf.first_cell).as_vec2()) * unit;
    let whole = along.clamp(Vec2::ZERO, Vec2::splat(side as f32)).as_uvec2();
    Sample { distance, grid: UVec2::from_array(leaf.grid_origin) + whole.min(UVec2::splat(side - 1)) }
}

/// As far beyond `a` as `b` lies on its other side, within 0…limit.
fn mirrored(a: u32, b: u32, limit: u32) -> u32 {
    if a >= b {
        return a + (a - b).min(limit - a);
    }
    a - (b - a).min(a)
}

fn sample_around<T: Texels>(
    map: &LoadMap<'_, T>,
    pixel: IVec2,
    distances: &[f32],
    hits: &[[u32; 4]],
) -> Sample {
    let last = UVec2::from_array(map.world.view.size).as_ivec2() - 1;
    let inside = pixel.clamp(IVec2::ZERO, last);
    let near = sample_at(map, inside, distances, hits);
    if pixel == inside {
        return near;
    }
    let far = sample_at(map, (2 * inside - pixel).clamp(IVec2::ZERO, last), distances, hits);
    if near.distance < 0.0 || far.distance < 0.0 {
        return near;
    }
    // 64 roots along an axis are all of 32 bits.
    let limit = map.world.view.root_size.map(|roots| (roots << ROOT_BITS).wrapping_sub(1));
    let grid =
        UVec2::new(mirrored(near.grid.x, far.grid.x, limit[0]), mirrored(near.grid.y, far.grid.y, limit[1]));
    Sample { distance: (2.0 * near.distance - far.distance).max(0.5 * near.distance), grid }
}

fn mark_pattern<T: Texels>(map: &mut LoadMap<'_, T>, hit: Sample, marks: u32) {
    if radial_mark(hit.distance) != 0 && map.stack.pattern_map < map.stack.maps {
        let pattern = map.cell_index(map.stack.pattern_map, hit.grid);
        if pattern != EMPTY {
            map.mark_cell(pattern, marks);
        }
    }
}

fn marks_of<T: Texels>(map: &LoadMap<'_, T>, hit: Sample, of: u32) -> u32 {
    map.wanted_marks(of, hit.distance, hit.distance)
}

/// Marks a place that shows; answers its cell, `EMPTY` where no map has it.
fn mark_place<T: Texels>(map: &mut LoadMap<'_, T>, hit: Sample) -> u32 {
    let of = map.map_at(hit.distance);
    let marks = marks_of(map, hit, of);
    let cell = map.cell_index(of, hit.grid);
    if cell != EMPTY {
        map.mark_cell(cell, marks | MARK_WANTED);
    }
    mark_pattern(map, hit, marks);
    cell
}

fn mark_pixel<T: Texels>(map: &mut LoadMap<'_, T>, hit: Sample) {
    let cell = mark_place(map, hit);
    if cell != EMPTY {
        map.pixels[cell as usize] += 1;
    }
    let of = map.map_at(hit.distance);
    if of > 0 && hit.distance >= BLENDS_FROM * map.stack.levels[of as usize].band[1] {
        let coarser = map.cell_index(of - 1, hit.grid);
        if coarser != EMPTY {
            map.mark_cell(coarser, MARK_BLENDED);
        }
    }
}

/// Marks what lies between four pixels of one smooth slope, as flat as it is between them.
fn mark_between<T: Texels>(map: &mut LoadMap<'_, T>, corners: [Sample; 4], quad: UVec2, low: UVec2) {
    let closeness = 1.0 / Vec4::from_array(corners.map(|corner| corner.distance));
    let [a, b, c, d] = corners.map(|corner| (corner.grid - low).as_vec2());
    let size = UVec2::from_array(map.world.view.size).as_vec2();
    for part in 0..BETWEEN * BETWEEN {
        let share = (UVec2::new(part % BETWEEN, part / BETWEEN).as_vec2() + 0.5) / BETWEEN as f32;
        let place = quad.as_vec2() + share - 0.5;
        if place.cmplt(Vec2::ZERO).any() || place.cmpgt(size).any() {
            continue;
        }
        let rest = 1.0 - share;
        let weights =
            closeness * Vec4::new(rest.x * rest.y, share.x * rest.y, rest.x * share.y, share.x * share.y);
        let distance = 1.0 / weights.dot(Vec4::ONE);
        let offset = (a * weights.x + b * weights.y + c * weights.z + d * weights.w) * distance;
        mark_place(map, Sample { distance, grid: low + offset.as_uvec2() });
    }
}

/// Cells of a map that a box touches, less one, along each axis.
fn spread<T: Texels>(map: &LoadMap<'_, T>, of: u32, low: UVec2, high: UVec2) -> UVec2 {
    let bits = UVec2::splat(map.cell_bits(of));
    (high >> bits) - (low >> bits)
}

fn spreads<T: Texels>(map: &LoadMap<'_, T>, of: u32, low: UVec2, high: UVec2) -> bool {
    spread(map, of, low, high).cmpgt(UVec2::ONE).any()
}

fn mark_quad<T: Texels>(map: &mut LoadMap<'_, T>, corners: [Sample; 4], quad: UVec2) -> Vec4 {
    let seen = corners.map(|corner| if corner.distance >= 0.0 { corner.distance } else { ENDLESS });
    let nearest = seen.into_iter().fold(ENDLESS, f32::min);
    let farthest = seen.into_iter().fold(0.0, f32::max);
    // Half a pixel of the picture lies beyond the outermost centres: what is nearer may begin there.
    let outermost = quad.cmpeq(UVec2::ZERO).any() || quad.cmpeq(UVec2::from_array(map.world.view.size)).any();
    let none = Vec4::new(NO_DISTANCES.x, NO_DISTANCES.y, nearest, farthest);
    if corners.iter().all(|corner| corner.distance < 0.0) {
        return if outermost { Vec4::new(0.0, ENDLESS, nearest, farthest) } else { none };
    }
    let gap = Vec4::new(if outermost { 0.0 } else { nearest }, farthest, nearest, farthest);
    if corners.iter().any(|corner| corner.distance < 0.0) {
        return gap;
    }
    let low = corners.iter().fold(UVec2::MAX, |low, corner| low.min(corner.grid));
    let high = corners.iter().fold(UVec2::ZERO, |high, corner| high.max(corner.grid));
    let finest = map.map_at(nearest);
    let coarsest = map.map_at(farthest);
    let radial = radial_mark(nearest);
    let pattern_map = map.stack.pattern_map;
    let patterned = radial != 0 && pattern_map < map.stack.maps;
    let is_gap = farthest > SMOOTH * nearest
        || finest > coarsest + 1
        || spreads(map, finest, low, high)
        || (patterned && spreads(map, pattern_map, low, high));
    if is_gap {
        return gap;
    }
    let parts = |of: u32| spread(map, of, low, high) != UVec2::ZERO;
    if coarsest != finest || parts(finest) || (patterned && parts(pattern_map)) {
        mark_between(map, corners, quad, low);
    }
    if outermost { gap } else { none }
}

/// Counts and marks what every pixel hits, and makes mip 0 of the pyramid.
pub fn mark_pixels<T: Texels>(map: &mut LoadMap<'_, T>, distances: &[f32], hits: &[[u32; 4]]) {
    let size = UVec2::from_array(map.world.view.size).as_ivec2();
    for y in 0..=size.y {
        for x in 0..=size.x {
            let pixel = IVec2::new(x, y);
            let corners = [(-1, -1), (0, -1), (-1, 0), (0, 0)]
                .map(|(a, b)| sample_around(map, pixel + IVec2::new(a, b), distances, hits));
            let own = corners[3];
            if pixel.cmplt(size).all() && own.distance >= 0.0 {
                mark_pixel(map, own);
            }
            let distances = mark_quad(map, corners, pixel.as_uvec2());
            let texel = pixel.as_uvec2() >> UVec2::ONE;
            let joined = join_distances(map.pyramid.load(0, texel), distances);
            map.pyramid.store(0, texel, joined);
        }
    }
}
