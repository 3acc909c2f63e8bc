//! A species' atlas: colour and coverage of twigs, bark and the planes of billboard clouds.

/// A rectangle of texels of an atlas: one picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Region {
    /// Left edge.
    pub x: u16,
    /// Upper edge.
    pub y: u16,
    /// Width.
    pub width: u16,
    /// Height.
    pub height: u16,
}

/// Colour (sRGB) and coverage of a species' pictures, square, with its mips.
///
/// Colours under no coverage are those of their neighbours, so that filtering mixes in nothing dark.
/// A mip's alpha is scaled, picture by picture, until as many of its texels pass
/// [`Atlas::ALPHA_TEST`] as of the first mip: a tree neither thins nor thickens with distance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Atlas {
    /// Texels along a side of the first mip, a power of two.
    pub side: u32,
    /// RGBA8, row-major from the upper left; every mip has half the side of the one before.
    pub mips: Vec<Vec<u8>>,
    /// The pictures.
    pub regions: Vec<Region>,
}

impl Atlas {
    /// Texels with at least this alpha are there (of 255).
    pub const ALPHA_TEST: u8 = 128;
    /// Largest side.
    pub const MAXIMUM_SIDE: u32 = 4096;
    /// Pictures begin at multiples of this, so that they do not mix in the first mips, texels.
    pub const ALIGNMENT: u32 = 8;
    /// The last mip has this side: beyond it pictures would run into each other.
    const LAST_SIDE: u32 = 16;

    /// Number of mips of an atlas of a side.
    pub fn mip_count(side: u32) -> u32 {
        (side / Self::LAST_SIDE).max(1).ilog2() + 1
    }

    /// Fills in what follows from the pictures: colours under no coverage, and the mips.
    ///
    /// `rgba` has side × side texels; regions reach no further than the atlas.
    pub fn new(side: u32, rgba: Vec<u8>, regions: Vec<Region>) -> Self {
        let count = Self::mip_count(side) as usize;
        let mut mips = vec![rgba];
        for mip in 1..count {
            mips.push(halved(&mips[mip - 1], (side >> (mip - 1)) as usize));
        }
        for mip in (0..count - 1).rev() {
            let (fine, coarse) = mips.split_at_mut(mip + 1);
            fill_uncovered(&mut fine[mip], &coarse[0], (side >> mip) as usize);
        }
        for region in &regions {
            let wanted = share_covered(&mips[0], side as usize, region.at_mip(0, side));
            for (mip, texels) in mips.iter_mut().enumerate().skip(1) {
                keep_coverage(texels, (side >> mip) as usize, region.at_mip(mip as u32, side), wanted);
            }
        }
        Self { side, mips, regions }
    }

    /// Share of the texels of a region that pass the alpha test on a mip.
    pub fn coverage(&self, region: &Region, mip: u32) -> f32 {
        share_covered(&self.mips[mip as usize], (self.side >> mip) as usize, region.at_mip(mip, self.side))
    }
}

/// Columns and rows, ends excluded.
type Window = [std::ops::Range<usize>; 2];

impl Region {
    /// The texels of a mip that show more of the region than of what is beside it.
    fn at_mip(&self, mip: u32, side: u32) -> Window {
        let half = (1_u32 << mip) >> 1;
        let range = |start: u16, length: u16| {
            let (start, end) = (u32::from(start), u32::from(start) + u32::from(length));
            let last = side >> mip;
            let first = ((start + half) >> mip).min(last.saturating_sub(1));
            first as usize..((end + half) >> mip).clamp(first + 1, last.max(first + 1)) as usize
        };
        [range(self.x, self.width), range(self.y, self.height)]
    }
}

fn texels(window: &Window, side: usize) -> impl Iterator<Item = usize> + use<> {
    let [columns, rows] = window.clone();
    rows.flat_map(move |row| columns.clone().map(move |column| (row * side + column) * 4))
}

fn share_covered(rgba: &[u8], side: usize, window: Window) -> f32 {
    let (mut covered, mut all) = (0_u32, 0_u32);
    for texel in texels(&window, side) {
        covered += u32::from(rgba[texel + 3] >= Atlas::ALPHA_TEST);
        all += 1;
    }
    covered as f32 / all.max(1) as f32
}

/// Mean of every 2 × 2 texels, colours weighed by alpha.
fn halved(rgba: &[u8], side: usize) -> Vec<u8> {
    let half = side / 2;
    let mut out = Vec::with_capacity(half * half * 4);
    for row in 0..half {
        for column in 0..half {
            let first = (2 * row * side + 2 * column) * 4;
            let four = [first, first + 4, first + side * 4, first + side * 4 + 4];
            let alpha: u32 = four.iter().map(|&texel| u32::from(rgba[texel + 3])).sum();
            for channel in 0..3 {
                let sum: u32 = four
                    .iter()
                    .map(|&texel| u32::from(rgba[texel + channel]) * u32::from(rgba[texel + 3]))
                    .sum();
                out.push(((sum + alpha / 2) / alpha.max(1)) as u8);
            }
            out.push(((alpha + 2) / 4) as u8);
        }
    }
    out
}

/// Gives texels without coverage the colour that the coarser mip has there.
fn fill_uncovered(fine: &mut [u8], coarse: &[u8], side: usize) {
    for row in 0..side {
        for column in 0..side {
            let texel = (row * side + column) * 4;
            if fine[texel + 3] == 0 {
                let above = ((row / 2) * (side / 2) + column / 2) * 4;
                fine[texel..texel + 3].copy_from_slice(&coarse[above..above + 3]);
            }
        }
    }
}

/// Scales a window's alpha until the wanted share of its texels passes the alpha test.
fn keep_coverage(rgba: &mut [u8], side: usize, window: Window, wanted: f32) {
    let mut alphas: Vec<u8> = texels(&window, side).map(|texel| rgba[texel + 3]).collect();
    alphas.sort_unstable_by(|a, b| b.cmp(a));
    // Texels of equal alpha pass or fail together: the nearer of the two counts.
    let count = wanted * alphas.len() as f32;
    let Some(place) = (count.round() as usize).checked_sub(1) else { return };
    let (with, without) = (
        alphas.partition_point(|&alpha| alpha >= alphas[place]),
        alphas.partition_point(|&alpha| alpha > alphas[place]),
    );
    let last = if without > 0 && count - without as f32 <= with as f32 - count {
        u32::from(alphas[without - 1])
    } else {
        u32::from(alphas[place])
    };
    if last == 0 {
        return;
    }
    for texel in texels(&window, side) {
        let scaled = u32::from(rgba[texel + 3]) * u32::from(Atlas::ALPHA_TEST) / last;
        rgba[texel + 3] = scaled.min(255) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hash::hash;

    /// A picture of specks of which a share is covered.
    fn specks(side: u32, share: u32) -> Vec<u8> {
        (0..side * side)
            .flat_map(|texel| {
                let covered = hash(texel, 0, 3) % 100 < share;
                [90, 120, 60, if covered { 255 } else { 0 }]
            })
            .collect()
    }

    #[test]
    fn mips_keep_the_coverage_of_every_picture() {
        for share in [10, 35, 70] {
            let regions = vec![
                Region { x: 0, y: 0, width: 96, height: 128 },
                Region { x: 96, y: 8, width: 32, height: 100 },
            ];
            let atlas = Atlas::new(128, specks(128, share), regions.clone());
            assert_eq!(atlas.mips.len(), 4);
            for region in &regions {
                for mip in 1..3 {
                    let (first, kept) = (atlas.coverage(region, 0), atlas.coverage(region, mip));
                    // Texels with equal alpha pass or fail together.
                    assert!((kept - first).abs() < 0.12, "share {share}, mip {mip}: {first} becomes {kept}");
                }
            }
        }
    }

    #[test]
    fn colours_under_no_coverage_are_those_beside() {
        let mut rgba = vec![0; 32 * 32 * 4];
        rgba[..4].copy_from_slice(&[80, 90, 100, 255]);
        let atlas = Atlas::new(32, rgba, Vec::new());
        assert_eq!(atlas.mips.len(), 2);
        assert_eq!(atlas.mips[0][4..8], [80, 90, 100, 0]);
        assert_eq!(atlas.mips[1][..4], [80, 90, 100, 64]);
    }

    #[test]
    fn a_region_of_nothing_stays_nothing() {
        let region = Region { x: 0, y: 0, width: 16, height: 16 };
        let atlas = Atlas::new(64, vec![0; 64 * 64 * 4], vec![region, Region::default()]);
        assert!(atlas.mips.iter().all(|mip| mip.iter().all(|&byte| byte == 0)));
    }
}
