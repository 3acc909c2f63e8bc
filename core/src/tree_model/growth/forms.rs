//! The growth forms.

use super::{Bark, Branches, Foliage, GrowthForm, Twig};

const BROWN: Bark = Bark { colour: [0.34, 0.28, 0.23], contrast: 0.4, bands: false };
const GREY: Bark = Bark { colour: [0.47, 0.46, 0.42], contrast: 0.22, bands: false };
const RED: Bark = Bark { colour: [0.50, 0.34, 0.24], contrast: 0.35, bands: false };
const WHITE: Bark = Bark { colour: [0.80, 0.79, 0.75], contrast: 0.75, bands: true };

/// Layered, drooping branches that turn up at their ends.
pub const SPRUCE: GrowthForm = GrowthForm {
    stems: 1,
    lean: 0.0,
    trunk_radius: 0.012,
    trunk_top: 0.97,
    trunk_bend: 0.4,
    hanging: 0.06,
    limbs: Branches {
        count: 170,
        whorl: 5,
        range: [0.0, 0.965],
        down: [104.0, 48.0],
        down_variation: 7.0,
        curve: [-12.0, 26.0],
        curve_variation: 9.0,
        length: 1.0,
        least_reach: 0.82,
        segments: 3,
    },
    crowding: 1.45,
    twigs: None,
    attraction: 0.0,
    foliage: Foliage::Sheets { width: 0.7, fold: 28.0, curtain: 0.42 },
    twig: Twig::Spray { density: 1.5 },
    colour: [0.32, 0.42, 0.26],
    bark: BROWN,
};

/// Flat branches that stand out.
pub const FIR: GrowthForm = GrowthForm {
    limbs: Branches { down: [96.0, 60.0], curve: [-4.0, 8.0], whorl: 6, ..SPRUCE.limbs },
    foliage: Foliage::Sheets { width: 0.78, fold: 14.0, curtain: 0.3 },
    colour: [0.27, 0.38, 0.27],
    bark: GREY,
    ..SPRUCE
};

/// Light and irregular.
pub const LARCH: GrowthForm = GrowthForm {
    limbs: Branches {
        count: 130,
        whorl: 1,
        down: [98.0, 52.0],
        down_variation: 14.0,
        curve: [-8.0, 34.0],
        curve_variation: 16.0,
        least_reach: 0.68,
        ..SPRUCE.limbs
    },
    foliage: Foliage::Sheets { width: 0.6, fold: 30.0, curtain: 0.34 },
    twig: Twig::Spray { density: 0.85 },
    colour: [0.47, 0.55, 0.29],
    bark: RED,
    trunk_bend: 1.0,
    ..SPRUCE
};

/// A bare trunk under clumps of needles.
pub const PINE: GrowthForm = GrowthForm {
    trunk_radius: 0.015,
    trunk_top: 0.9,
    trunk_bend: 2.2,
    hanging: 0.12,
    limbs: Branches {
        count: 30,
        whorl: 4,
        range: [0.02, 0.93],
        down: [88.0, 40.0],
        down_variation: 12.0,
        curve: [-6.0, 30.0],
        curve_variation: 22.0,
        length: 1.0,
        least_reach: 0.74,
        segments: 3,
    },
    crowding: 1.0,
    twigs: Some(Branches {
        count: 7,
        whorl: 1,
        range: [0.35, 1.0],
        down: [58.0, 34.0],
        down_variation: 14.0,
        curve: [6.0, 14.0],
        curve_variation: 12.0,
        length: 0.36,
        least_reach: 0.7,
        segments: 1,
    }),
    attraction: 0.35,
    foliage: Foliage::Cards { count: 4, size: 0.072, hang: 0.0 },
    twig: Twig::Tufts { needle: 0.2 },
    colour: [0.33, 0.42, 0.29],
    bark: RED,
    ..SPRUCE
};

/// Dense and upright, branched far down.
pub const STONE_PINE: GrowthForm = GrowthForm {
    trunk_radius: 0.02,
    limbs: Branches { count: 40, down: [80.0, 30.0], curve: [0.0, 44.0], ..PINE.limbs },
    foliage: Foliage::Cards { count: 4, size: 0.068, hang: 0.0 },
    twig: Twig::Tufts { needle: 0.17 },
    colour: [0.27, 0.37, 0.27],
    bark: BROWN,
    ..PINE
};

/// Stems that lie down and rise.
pub const DWARF_PINE: GrowthForm = GrowthForm {
    stems: 7,
    lean: 42.0,
    trunk_radius: 0.025,
    trunk_top: 0.75,
    trunk_bend: 9.0,
    hanging: 0.3,
    limbs: Branches { count: 9, whorl: 1, range: [0.1, 0.98], down: [62.0, 30.0], ..PINE.limbs },
    twigs: Some(Branches {
        count: 4,
        whorl: 1,
        range: [0.3, 1.0],
        down: [52.0, 34.0],
        down_variation: 16.0,
        curve: [6.0, 14.0],
        curve_variation: 12.0,
        length: 0.45,
        least_reach: 0.7,
        segments: 1,
    }),
    foliage: Foliage::Cards { count: 4, size: 0.17, hang: 0.0 },
    ..STONE_PINE
};

/// A smooth trunk that dissolves into a full dome.
pub const BEECH: GrowthForm = GrowthForm {
    stems: 1,
    lean: 0.0,
    trunk_radius: 0.016,
    trunk_top: 0.82,
    trunk_bend: 2.0,
    hanging: 0.24,
    limbs: Branches {
        count: 26,
        whorl: 1,
        range: [0.04, 0.86],
        down: [76.0, 22.0],
        down_variation: 9.0,
        curve: [6.0, -4.0],
        curve_variation: 16.0,
        length: 1.0,
        least_reach: 0.8,
        segments: 3,
    },
    crowding: 1.0,
    twigs: Some(Branches {
        count: 7,
        whorl: 1,
        range: [0.26, 1.0],
        down: [56.0, 34.0],
        down_variation: 14.0,
        curve: [0.0, 0.0],
        curve_variation: 14.0,
        length: 0.42,
        least_reach: 0.75,
        segments: 1,
    }),
    attraction: 0.12,
    foliage: Foliage::Cards { count: 6, size: 0.078, hang: 0.15 },
    twig: Twig::Leaves { length: 0.15, width: 0.095, lobes: 0.0, hanging: false },
    colour: [0.39, 0.50, 0.27],
    bark: GREY,
};

/// Crooked limbs that reach far.
pub const OAK: GrowthForm = GrowthForm {
    trunk_radius: 0.022,
    trunk_bend: 4.0,
    limbs: Branches {
        count: 20,
        down: [84.0, 26.0],
        curve: [14.0, -10.0],
        curve_variation: 30.0,
        least_reach: 0.74,
        ..BEECH.limbs
    },
    twig: Twig::Leaves { length: 0.18, width: 0.12, lobes: 0.42, hanging: false },
    foliage: Foliage::Cards { count: 7, size: 0.088, hang: 0.1 },
    colour: [0.36, 0.46, 0.25],
    bark: BROWN,
    ..BEECH
};

/// Slender, with hanging twigs on a white trunk.
pub const BIRCH: GrowthForm = GrowthForm {
    trunk_radius: 0.01,
    trunk_top: 0.92,
    trunk_bend: 1.6,
    hanging: 0.2,
    limbs: Branches { count: 28, down: [58.0, 24.0], curve: [4.0, -38.0], least_reach: 0.74, ..BEECH.limbs },
    attraction: -0.35,
    foliage: Foliage::Cards { count: 6, size: 0.066, hang: 0.6 },
    twig: Twig::Leaves { length: 0.115, width: 0.085, lobes: 0.0, hanging: false },
    colour: [0.44, 0.54, 0.29],
    bark: WHITE,
    ..BEECH
};

/// Limbs that rise and hang over.
pub const WILLOW: GrowthForm = GrowthForm {
    trunk_radius: 0.024,
    trunk_top: 0.88,
    hanging: 0.4,
    limbs: Branches {
        count: 32,
        range: [0.04, 0.95],
        down: [56.0, 26.0],
        curve: [14.0, -60.0],
        ..BEECH.limbs
    },
    attraction: -0.9,
    foliage: Foliage::Cards { count: 6, size: 0.095, hang: 0.65 },
    twig: Twig::Leaves { length: 0.17, width: 0.042, lobes: 0.0, hanging: true },
    colour: [0.44, 0.53, 0.33],
    bark: BROWN,
    ..BEECH
};

/// Many stems from the ground, leaves all over.
pub const SHRUB: GrowthForm = GrowthForm {
    stems: 8,
    lean: 34.0,
    trunk_radius: 0.018,
    trunk_top: 0.7,
    trunk_bend: 8.0,
    hanging: 0.6,
    limbs: Branches { count: 7, range: [0.0, 0.95], down: [56.0, 26.0], ..BEECH.limbs },
    twigs: Some(Branches {
        count: 4,
        whorl: 1,
        range: [0.26, 1.0],
        down: [54.0, 34.0],
        down_variation: 14.0,
        curve: [0.0, 0.0],
        curve_variation: 14.0,
        length: 0.5,
        least_reach: 0.75,
        segments: 1,
    }),
    foliage: Foliage::Cards { count: 5, size: 0.16, hang: 0.05 },
    twig: Twig::Leaves { length: 0.13, width: 0.075, lobes: 0.0, hanging: false },
    colour: [0.40, 0.48, 0.28],
    bark: BROWN,
    ..BEECH
};
