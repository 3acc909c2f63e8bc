// The photo, through its page table: level by the pixel's footprint, the nearest resident ancestor where a
// tile is missing, a blend of two levels. Filtering stays within a tile's border. Twin: `twin/photo.rs`.

// Texels along a tile's side, and beyond it on each side.
const PHOTO_CELLS: f32 = 512.0;
const PHOTO_BORDER: f32 = 4.0;
const PHOTO_SIDE: f32 = 520.0;
// Samples along a footprint that grazing light of sight stretches.
const PHOTO_TAPS: u32 = 3u;
// A texel is at most this many pixel footprints long.
const TEXELS_PER_FOOTPRINT: f32 = 1.42;
// A texel of level 0, metres.
const LEVEL_0_TEXEL: f32 = 39135.76;
// Part of a level, from its far end, over which it comes in over the coarser one.
const PHOTO_BLEND: f32 = 0.25;

// A page that has colours: its layer, its matrix level, and how far it has faded in.
struct PhotoPage {
    slot: u32,
    level: u32,
    fade: f32,
}

// The resident page of level `deepest` at a place, else the next finer one, else the nearest coarser one;
// and the next resident one above it. (Of what is in sight only the level wanted may be resident: beside
// it stand far coarser ones, and finer is better than those.)
struct PhotoPages {
    fine: PhotoPage,
    coarse: PhotoPage,
}

// Continuous level at which a texel is exactly as long as a footprint (metres) allows.
fn photo_level(footprint: f32) -> f32 {
    return log2(LEVEL_0_TEXEL / max(TEXELS_PER_FOOTPRINT * footprint, 1e-6));
}

// Entry of the root grid at grid coordinates, or EMPTY outside it.
fn root_entry(grid: vec2<u32>) -> u32 {
    let root = grid >> vec2<u32>(ROOT_BITS);
    if root.x >= view.root_size.x || root.y >= view.root_size.y {
        return EMPTY;
    }
    return root.y * view.root_size.x + root.x;
}

fn photo_pages(grid: vec2<u32>, deepest: u32) -> PhotoPages {
    let nothing = PhotoPage(EMPTY, 0u, 0.0);
    var pages = PhotoPages(nothing, nothing);
    var entry = root_entry(grid);
    // A root tile has 2^26 units a side: deeper than 26 levels below it there is no page.
    for (var depth = 0u; depth <= ROOT_BITS; depth++) {
        if entry == EMPTY {
            break;
        }
        let level = view.root_level + depth;
        let page = texture_pages[entry];
        if page.slot != EMPTY {
            pages.coarse = pages.fine;
            pages.fine = PhotoPage(page.slot, level, bitcast<f32>(page.fade));
        }
        let enough = level >= deepest && pages.fine.slot != EMPTY && pages.fine.level >= deepest;
        if page.children == EMPTY || enough || depth == ROOT_BITS {
            break;
        }
        let quadrant = (grid >> vec2<u32>(ROOT_BITS - 1u - depth)) & vec2<u32>(1u);
        entry = page.children + 2u * quadrant.y + quadrant.x;
    }
    return pages;
}

// Mean colour of a page along a stretch of so many grid units about a place. The stretch is kept within
// the border, so that no filter reaches beyond the tile's own texels.
fn photo_in_page(page: PhotoPage, grid: vec2<u32>, fraction: vec2<f32>, stretch: vec2<f32>) -> vec4<f32> {
    let bits = ROOT_BITS - (page.level - view.root_level);
    let within = grid & vec2<u32>((1u << bits) - 1u);
    let texels_per_unit = PHOTO_CELLS / f32(1u << bits);
    let texel = (vec2<f32>(within) + fraction) * texels_per_unit + PHOTO_BORDER;
    let along = stretch * texels_per_unit;
    let length_along = length(along);
    if length_along < 1.5 {
        return textureSampleLevel(photo, photo_sampler, texel / PHOTO_SIDE, page.slot, 0.0);
    }
    let reach = along * min(1.0, 2.0 * (PHOTO_BORDER - 0.5) / length_along);
    var sum = vec4<f32>(0.0);
    for (var tap = 0u; tap < PHOTO_TAPS; tap++) {
        let offset = (f32(tap) + 0.5) / f32(PHOTO_TAPS) - 0.5;
        sum += textureSampleLevel(photo, photo_sampler, (texel + offset * reach) / PHOTO_SIDE, page.slot, 0.0);
    }
    return sum / f32(PHOTO_TAPS);
}

// The photo at a place (grid coordinates and the fraction of a unit). `footprint` is the pixel's width
// there in metres, `stretch` the pixel's extent over the ground along the line of sight in grid units,
// `elongation` how many footprints long that is. Alpha 0: there is no photo.
fn photo_colour(grid: vec2<u32>, fraction: vec2<f32>, footprint: f32, stretch: vec2<f32>, elongation: f32) -> vec4<f32> {
    // A stretch longer than the taps cover asks for coarser texels.
    let wanted = max(photo_level(footprint) - max(log2(max(elongation, 1.0) / 5.0), 0.0), f32(view.root_level));
    let deepest = ceil(wanted);
    let pages = photo_pages(grid, u32(deepest));
    if pages.fine.slot == EMPTY {
        return vec4<f32>(0.0);
    }
    // Between two levels the finer comes in as it is needed, and a new tile as it fades in.
    var share = pages.fine.fade;
    if f32(pages.fine.level) == deepest && pages.coarse.level + 1u == pages.fine.level {
        share *= saturate((wanted - (deepest - 1.0)) / PHOTO_BLEND);
    }
    if share > 0.995 || pages.coarse.slot == EMPTY {
        return photo_in_page(pages.fine, grid, fraction, stretch);
    }
    let coarse = photo_in_page(pages.coarse, grid, fraction, stretch);
    if share < 0.005 {
        return coarse;
    }
    return mix(coarse, photo_in_page(pages.fine, grid, fraction, stretch), share);
}

// Taps along a side of a patch.
const PATCH_TAPS: u32 = 4u;

// Mean colour of a page over a square patch about a place, `metres` wide. It is kept within the tile.
fn patch_in_page(page: PhotoPage, grid: vec2<u32>, metres: f32) -> vec4<f32> {
    let bits = ROOT_BITS - (page.level - view.root_level);
    let within = grid & vec2<u32>((1u << bits) - 1u);
    let texel = (vec2<f32>(within) + 0.5) * (PHOTO_CELLS / f32(1u << bits)) + PHOTO_BORDER;
    let side = metres / LEVEL_0_TEXEL * exp2(f32(page.level));
    if side < 1.5 {
        return textureSampleLevel(photo, photo_sampler, texel / PHOTO_SIDE, page.slot, 0.0);
    }
    var sum = vec4<f32>(0.0);
    for (var tap = 0u; tap < PATCH_TAPS * PATCH_TAPS; tap++) {
        let at = vec2<f32>(vec2<u32>(tap % PATCH_TAPS, tap / PATCH_TAPS));
        let offset = (at + 0.5) / f32(PATCH_TAPS) - 0.5;
        let place = clamp(texel + offset * side, vec2<f32>(0.5), vec2<f32>(PHOTO_SIDE - 0.5));
        sum += textureSampleLevel(photo, photo_sampler, place / PHOTO_SIDE, page.slot, 0.0);
    }
    return sum / f32(PATCH_TAPS * PATCH_TAPS);
}

// Mean colour of the photo over a square patch, from texels as wide as its taps are apart or finer where there are
// any: coarser ones know of what lies round it, and a tree would change its colour with what happens to be resident.
// Alpha 0: there is no photo.
fn photo_patch(grid: vec2<u32>, metres: f32) -> vec4<f32> {
    let wanted = max(photo_level(metres / f32(PATCH_TAPS)), f32(view.root_level));
    let pages = photo_pages(grid, u32(ceil(wanted)));
    if pages.fine.slot == EMPTY {
        return vec4<f32>(0.0);
    }
    let fine = patch_in_page(pages.fine, grid, metres);
    if pages.fine.fade > 0.995 || pages.coarse.slot == EMPTY {
        return fine;
    }
    return mix(patch_in_page(pages.coarse, grid, metres), fine, pages.fine.fade);
}
