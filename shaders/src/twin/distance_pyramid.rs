//! Twin of `distance_pyramid.wgsl` and `distance_mips.wgsl`: the picture's distances as a pyramid.

use glam::{UVec2, Vec4};

/// The distances of no quad at all.
pub const NO_DISTANCES: Vec4 = Vec4::new(3.0e38, -1.0, 3.0e38, -1.0);

/// Mips, finest first; each row-major.
pub struct DistancePyramid {
    size: UVec2,
    mips: Vec<Vec<Vec4>>,
}

/// Joins what two places say.
pub fn join_distances(a: Vec4, b: Vec4) -> Vec4 {
    Vec4::new(a.x.min(b.x), a.y.max(b.y), a.z.min(b.z), a.w.max(b.w))
}

/// Columns and rows of a mip for a picture of so many pixels.
pub fn mip_size(size: UVec2, mip: u32) -> UVec2 {
    let base = (size + 2) >> UVec2::ONE;
    (base + ((1 << mip) - 1)) >> UVec2::splat(mip)
}

/// Mips down to one texel.
pub fn mip_count(size: UVec2) -> u32 {
    (0..).find(|&mip| mip_size(size, mip) == UVec2::ONE).unwrap_or(0) + 1
}

impl DistancePyramid {
    /// Without any distance.
    pub fn new(size: UVec2) -> Self {
        let mip = |mip| vec![NO_DISTANCES; mip_size(size, mip).element_product() as usize];
        Self { size, mips: (0..mip_count(size)).map(mip).collect() }
    }

    /// Columns and rows of a mip.
    pub fn mip_size(&self, mip: u32) -> UVec2 {
        mip_size(self.size, mip)
    }

    /// Stores a texel, if the mip has it.
    pub fn store(&mut self, mip: u32, texel: UVec2, distances: Vec4) {
        let size = self.mip_size(mip);
        if texel.cmplt(size).all() {
            self.mips[mip as usize][(texel.y * size.x + texel.x) as usize] = distances;
        }
    }

    /// A texel; that of nothing where the mip has none.
    pub fn load(&self, mip: u32, texel: UVec2) -> Vec4 {
        let size = self.mip_size(mip);
        if texel.cmpge(size).any() {
            return NO_DISTANCES;
        }
        self.mips[mip as usize][(texel.y * size.x + texel.x) as usize]
    }

    /// Makes a mip from the one before it.
    pub fn derive(&mut self, mip: u32) {
        let size = self.mip_size(mip);
        for index in 0..size.element_product() {
            let texel = UVec2::new(index % size.x, index / size.x);
            let first = 2 * texel;
            let joined = [(0, 0), (1, 0), (0, 1), (1, 1)]
                .map(|(x, y)| self.load(mip - 1, first + UVec2::new(x, y)))
                .into_iter()
                .fold(NO_DISTANCES, join_distances);
            self.store(mip, texel, joined);
        }
    }
}
