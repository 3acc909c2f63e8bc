//! Twin of `wgsl/photo.wgsl`: which photo tiles colour a place, and in what shares.

use crate::layout::{EMPTY, ROOT_BITS, TexturePage, View};
use glam::{UVec2, Vec2};

/// Texels along a tile's side, border not counted.
pub const PHOTO_CELLS: f32 = 512.0;
/// Texels beyond the tile on each side.
pub const PHOTO_BORDER: f32 = 4.0;
const TEXELS_PER_FOOTPRINT: f32 = 1.42;
const LEVEL_0_TEXEL: f32 = 39_135.76;
/// Part of a level, from its far end, over which it comes in over the coarser one.
pub const PHOTO_BLEND: f32 = 0.25;

/// A page that has colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotoPage {
    /// Layer of the photo array, or [`EMPTY`].
    pub slot: u32,
    /// Matrix level.
    pub level: u32,
    /// How far it has faded in, 0…1.
    pub fade: f32,
}

/// The deepest resident page at a place, and the next resident one above it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotoPages {
    /// The deepest.
    pub fine: PhotoPage,
    /// The one above.
    pub coarse: PhotoPage,
}

/// Continuous level at which a texel is exactly as long as a footprint (metres) allows.
pub fn photo_level(footprint: f32) -> f32 {
    (LEVEL_0_TEXEL / (TEXELS_PER_FOOTPRINT * footprint).max(1e-6)).log2()
}

/// Entry of the root grid at grid coordinates, or [`EMPTY`] outside it.
pub fn root_entry(view: &View, grid: UVec2) -> u32 {
    let root = grid >> ROOT_BITS;
    if root.x >= view.root_size[0] || root.y >= view.root_size[1] {
        return EMPTY;
    }
    root.y * view.root_size[0] + root.x
}

/// The pages at a place: `fine` is of level `deepest` where that is resident, else the next finer one, else
/// the nearest coarser one.
pub fn photo_pages(view: &View, texture_pages: &[TexturePage], grid: UVec2, deepest: u32) -> PhotoPages {
    let nothing = PhotoPage { slot: EMPTY, level: 0, fade: 0.0 };
    let mut pages = PhotoPages { fine: nothing, coarse: nothing };
    let mut entry = root_entry(view, grid);
    for depth in 0..=ROOT_BITS {
        if entry == EMPTY {
            break;
        }
        let level = view.root_level + depth;
        let page = texture_pages[entry as usize];
        if page.slot != EMPTY {
            pages.coarse = pages.fine;
            pages.fine = PhotoPage { slot: page.slot, level, fade: f32::from_bits(page.fade) };
        }
        let enough = level >= deepest && pages.fine.slot != EMPTY && pages.fine.level >= deepest;
        if page.children == EMPTY || enough || depth == ROOT_BITS {
            break;
        }
        let quadrant = (grid >> (ROOT_BITS - 1 - depth)) & 1;
        entry = page.children + 2 * quadrant.y + quadrant.x;
    }
    pages
}

/// Position in a page's tile, texels from its north-west corner (border not counted).
pub fn photo_texel(view: &View, page: PhotoPage, grid: UVec2, fraction: Vec2) -> Vec2 {
    let bits = ROOT_BITS - (page.level - view.root_level);
    let within = grid & ((1 << bits) - 1);
    (within.as_vec2() + fraction) * (PHOTO_CELLS / (1_u32 << bits) as f32)
}

/// The pages that colour a place for a footprint (metres), and the finer one's share of the colour.
pub fn photo_blend(
    view: &View,
    texture_pages: &[TexturePage],
    grid: UVec2,
    footprint: f32,
    elongation: f32,
) -> (PhotoPages, f32) {
    let wanted =
        (photo_level(footprint) - (elongation.max(1.0) / 5.0).log2().max(0.0)).max(view.root_level as f32);
    let deepest = wanted.ceil();
    let pages = photo_pages(view, texture_pages, grid, deepest as u32);
    let mut share = pages.fine.fade;
    if pages.fine.level as f32 == deepest && pages.coarse.level + 1 == pages.fine.level {
        share *= ((wanted - (deepest - 1.0)) / PHOTO_BLEND).clamp(0.0, 1.0);
    }
    if pages.coarse.slot == EMPTY {
        share = 1.0;
    }
    (pages, share)
}

/// Taps along a side of a patch.
pub const PATCH_TAPS: u32 = 4;

/// Where a page is read for its mean over a square patch about a place, `metres` wide: texels from its tile's
/// north-west corner (border not counted); kept within the tile and its border.
pub fn patch_texels(view: &View, page: PhotoPage, grid: UVec2, metres: f32) -> Vec<Vec2> {
    let texel = photo_texel(view, page, grid, Vec2::splat(0.5));
    let side = metres / LEVEL_0_TEXEL * (page.level as f32).exp2();
    if side < 1.5 {
        return vec![texel];
    }
    let (least, greatest) = (Vec2::splat(0.5 - PHOTO_BORDER), Vec2::splat(PHOTO_CELLS + PHOTO_BORDER - 0.5));
    (0..PATCH_TAPS * PATCH_TAPS)
        .map(|tap| {
            let at = UVec2::new(tap % PATCH_TAPS, tap / PATCH_TAPS).as_vec2();
            let offset = (at + 0.5) / PATCH_TAPS as f32 - 0.5;
            (texel + offset * side).clamp(least, greatest)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ROOT_LEVEL: u32 = 8;

    fn view() -> View {
        View { root_size: [2, 1], root_level: ROOT_LEVEL, ..View::default() }
    }

    fn page(slot: u32, children: u32, fade: f32) -> TexturePage {
        TexturePage { slot, children, fade: fade.to_bits(), padding: 0 }
    }

    /// Two roots; the western one has four children, of which only the south-eastern is resident, and
    /// that one a resident north-western child.
    fn pages() -> Vec<TexturePage> {
        let none = page(EMPTY, EMPTY, 0.0);
        let mut pages = vec![page(0, 2, 1.0), page(1, EMPTY, 1.0)];
        pages.extend([none, none, none, page(2, 6, 1.0)]);
        pages.extend([page(3, EMPTY, 0.25), none, none, none]);
        pages
    }

    fn in_root(x: f64, y: f64) -> UVec2 {
        let units = f64::from(1_u32 << ROOT_BITS);
        UVec2::new((x * units) as u32, (y * units) as u32)
    }

    #[test]
    fn the_nearest_resident_ancestor_stands_in() {
        let slots = |x, y, deepest| {
            let found = photo_pages(&view(), &pages(), in_root(x, y), deepest);
            (found.fine.slot, found.fine.level, found.coarse.slot)
        };
        assert_eq!(slots(0.1, 0.1, 12), (0, 8, EMPTY), "a missing child: the root");
        assert_eq!(slots(0.9, 0.9, 12), (2, 9, 0), "a missing grandchild: its parent");
        assert_eq!(slots(0.6, 0.6, 12), (3, 10, 2));
        assert_eq!(slots(0.6, 0.6, 9), (2, 9, 0), "no deeper than asked for");
        assert_eq!(slots(1.5, 0.6, 12), (1, 8, EMPTY));
        let mut sparse = pages();
        sparse[5].slot = EMPTY;
        let found = photo_pages(&view(), &sparse, in_root(0.6, 0.6), 9);
        assert_eq!((found.fine.level, found.coarse.level), (10, 8), "finer, where the level is missing");
        assert_eq!(slots(2.5, 0.6, 12), (EMPTY, 0, EMPTY), "outside the root grid");
    }

    #[test]
    fn the_level_is_that_of_the_load_map() {
        // The smallest level whose texel, 39,136 m / 2^L, is at most 1.42 footprints.
        for footprint in [0.3_f32, 1.0, 7.7, 120.0] {
            let level = photo_level(footprint).ceil();
            assert!(LEVEL_0_TEXEL * (-level).exp2() <= TEXELS_PER_FOOTPRINT * footprint);
            assert!(LEVEL_0_TEXEL * (1.0 - level).exp2() > TEXELS_PER_FOOTPRINT * footprint);
        }
    }

    #[test]
    fn a_new_page_fades_in_over_its_ancestor() {
        let (found, share) = photo_blend(&view(), &pages(), in_root(0.6, 0.6), 1e-3, 1.0);
        assert_eq!((found.fine.slot, found.coarse.slot, share), (3, 2, 0.25));
        let (found, share) = photo_blend(&view(), &pages(), in_root(0.1, 0.6), 1e-3, 1.0);
        assert_eq!((found.fine.slot, share), (0, 1.0), "there is nothing above a root to blend with");
    }

    proptest! {
        #[test]
        fn a_patch_lies_about_its_place_and_within_the_tile(x in 0.0..1.0_f64, y in 0.0..1.0_f64, below in 0..10_u32, metres in 0.1..200.0_f32) {
            let page = PhotoPage { slot: 0, level: ROOT_LEVEL + below, fade: 1.0 };
            let taps = patch_texels(&view(), page, in_root(x, y), metres);
            let texel = photo_texel(&view(), page, in_root(x, y), Vec2::splat(0.5));
            let side = metres / LEVEL_0_TEXEL * (page.level as f32).exp2();
            prop_assert!(taps.len() == 1 && taps[0] == texel || side >= 1.5 && taps.len() == 16);
            for tap in &taps {
                prop_assert!((*tap - texel).abs().max_element() <= 0.5 * side.max(1.0));
                prop_assert!(tap.min_element() >= -3.5 && tap.max_element() <= 515.5);
            }
            if taps.len() > 1 && texel.min_element() > 0.5 * side && texel.max_element() < 512.0 - 0.5 * side {
                let mean = taps.iter().sum::<Vec2>() / 16.0;
                prop_assert!((mean - texel).length() < 1e-2, "{mean} {texel}");
            }
        }

        #[test]
        fn levels_blend_without_a_step(x in 0.5..0.75_f64, log_footprint in 0.0..12.0_f32) {
            // The texel sizes in effect, averaged by share, move little with the footprint.
            let mut pages = pages();
            pages[6].fade = 1.0_f32.to_bits();
            let mean_level = |log: f32| {
                let (found, share) = photo_blend(&view(), &pages, in_root(x, x), log.exp2(), 1.0);
                let coarse = if found.coarse.slot == EMPTY { found.fine.level } else { found.coarse.level };
                share * found.fine.level as f32 + (1.0 - share) * coarse as f32
            };
            let step = (mean_level(log_footprint) - mean_level(log_footprint + 0.01)).abs();
            prop_assert!(step < 0.05, "{step}");
        }

        #[test]
        fn a_texel_is_found_to_a_thousandth(x in 0.5..0.75_f64, y in 0.5..0.75_f64) {
            let grid = in_root(x, y);
            let page = photo_pages(&view(), &pages(), grid, 12).fine;
            prop_assert_eq!(page.level, 10);
            let texel = photo_texel(&view(), page, grid, Vec2::ZERO);
            prop_assert!((f64::from(texel.x) - (x - 0.5) * 4.0 * 512.0).abs() < 1e-3);
            prop_assert!((f64::from(texel.y) - (y - 0.5) * 4.0 * 512.0).abs() < 1e-3);
        }
    }
}
