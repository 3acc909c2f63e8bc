//! What kinds of ground look like in a photo: the constants that classification starts from.
//!
//! Colours as the logarithms of green over red and of blue over green, and of brightness on level ground.
//! Self-measured on the western half of the built-in landscape (medians and half the 10th to the 90th
//! percentile, on sunlit slopes); what that lacks (haze-blue forest, bush, soil, roofs, the sea) from the
//! order of reflectances in textbooks of remote sensing. A photo's own figures are found from these
//! ([`super::model`]).

/// What the ground is told to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Kind {
    /// Crowns.
    Forest = 0,
    /// Meadow, pasture, bush.
    Grass = 1,
    /// Rock, gravel, soil, roofs, roads.
    Bare = 2,
    /// Snow and ice.
    Snow = 3,
    /// Sea, lake, river.
    Water = 4,
}

/// Number of kinds.
pub const KINDS: usize = 5;

/// A cluster of colours.
#[derive(Clone, Copy, Debug)]
pub struct Cluster {
    /// What it is.
    pub kind: Kind,
    /// Means: ln(green/red), ln(blue/green), ln(brightness).
    pub mean: [f32; 3],
    /// Standard deviations of the same.
    pub deviation: [f32; 3],
    /// Commonness, to scale.
    pub weight: f32,
}

const fn cluster(kind: Kind, mean: [f32; 3], deviation: [f32; 3], weight: f32) -> Cluster {
    Cluster { kind, mean, deviation, weight }
}

/// Index of the cluster of conifers.
pub const CONIFERS: usize = 0;
/// Index of the cluster of broadleaves.
pub const BROADLEAVES: usize = 1;

/// All clusters.
pub const CLUSTERS: [Cluster; 17] = [
    cluster(Kind::Forest, [0.18, -0.43, 4.05], [0.075, 0.09, 0.20], 1.0), // conifers
    cluster(Kind::Forest, [0.22, -0.62, 4.25], [0.05, 0.07, 0.13], 1.0),  // broadleaves
    cluster(Kind::Forest, [0.28, -0.20, 3.85], [0.08, 0.10, 0.25], 0.5),  // crowns through haze
    cluster(Kind::Grass, [0.12, -0.54, 4.57], [0.05, 0.08, 0.12], 1.0),   // lush meadow
    cluster(Kind::Grass, [0.02, -0.45, 4.65], [0.04, 0.08, 0.14], 0.7),   // alpine pasture
    cluster(Kind::Grass, [-0.04, -0.35, 4.73], [0.04, 0.08, 0.13], 0.7),  // dry grass
    cluster(Kind::Grass, [0.06, -0.33, 4.50], [0.06, 0.09, 0.18], 0.2),   // bush
    cluster(Kind::Bare, [-0.03, -0.08, 4.80], [0.04, 0.06, 0.18], 0.8),   // rock and scree
    cluster(Kind::Bare, [0.04, -0.17, 4.93], [0.04, 0.07, 0.12], 0.2),    // gravel
    cluster(Kind::Bare, [-0.18, -0.22, 4.83], [0.07, 0.08, 0.20], 0.2),   // soil
    cluster(Kind::Bare, [0.00, 0.02, 5.00], [0.06, 0.10, 0.30], 0.4),     // roofs and roads
    cluster(Kind::Snow, [0.01, 0.00, 5.33], [0.03, 0.03, 0.14], 0.4),     // snow in the sun
    cluster(Kind::Snow, [0.07, 0.09, 5.22], [0.04, 0.05, 0.18], 0.2),     // snow in the shade
    cluster(Kind::Water, [0.96, 0.22, 4.09], [0.15, 0.10, 0.25], 0.4),    // deep lake
    cluster(Kind::Water, [1.15, 0.46, 4.52], [0.30, 0.20, 0.35], 0.7),    // sea
    cluster(Kind::Water, [0.22, -0.11, 4.80], [0.06, 0.08, 0.20], 0.1),   // shallows
    cluster(Kind::Water, [0.15, -0.03, 4.85], [0.06, 0.06, 0.20], 0.05),  // river
];

/// Means and standard deviations of ln(texture), the local deviation of ln(brightness), and the logarithms of those
/// deviations, by [`Kind`]: crowns are rough, water is smooth.
pub const TEXTURE: [[f32; 3]; KINDS] =
    [[-2.0, 0.7, -0.357], [-2.7, 0.8, -0.223], [-2.2, 0.8, -0.223], [-2.6, 0.9, -0.105], [-3.3, 0.8, -0.223]];

/// What the darkest of a photo still reflect, of 255: crowns in shadow. What is brighter than this in each channel
/// is haze.
pub const DARKEST: [f32; 3] = [8.0, 11.0, 7.0];
/// Standard deviation of a photo's noise, compression included, of 255.
pub const NOISE: f32 = 4.0;
/// Light in a cast shadow, of the light that the slope would have: ln 0.35.
pub const LN_SHADOW: f32 = -1.049_822;
/// Share of places in cast shadow, and in the light: ln 0.08 and ln 0.92.
pub const LN_SHADOW_SHARE: f32 = -2.525_728_6;
/// See [`LN_SHADOW_SHARE`].
pub const LN_SUNLIT: f32 = -0.083_381_6;
