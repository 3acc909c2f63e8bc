//! Places for pictures in an atlas: shelves from the top, each as high as its first picture.

use super::atlas::{Atlas, Region};

/// Texels that stay free between pictures.
const GUTTER: u32 = 2;

/// What is taken of an atlas so far.
#[derive(Clone, Debug)]
pub struct Packer {
    side: u32,
    next: [u32; 2],
    shelf: u32,
}

impl Packer {
    /// An empty atlas.
    pub fn new(side: u32) -> Self {
        Self { side, next: [0; 2], shelf: 0 }
    }

    /// A place for a picture of a size, aligned; `None` where there is none left.
    pub fn place(&mut self, width: u32, height: u32) -> Option<Region> {
        let aligned = |length: u32| (length + GUTTER).next_multiple_of(Atlas::ALIGNMENT);
        if self.next[0] + width > self.side {
            self.next = [0, self.next[1] + self.shelf];
            self.shelf = 0;
        }
        let [x, y] = self.next;
        if x + width > self.side || y + height > self.side {
            return None;
        }
        self.next[0] = (x + aligned(width)).min(self.side);
        self.shelf = self.shelf.max(aligned(height));
        let short = |length: u32| u16::try_from(length).ok();
        Some(Region { x: short(x)?, y: short(y)?, width: short(width)?, height: short(height)? })
    }

    /// Places for pictures of sizes, in their order; `None` where they do not all fit.
    pub fn place_all(&mut self, sizes: &[[u32; 2]]) -> Option<Vec<Region>> {
        let mut order: Vec<usize> = (0..sizes.len()).collect();
        // High ones first: shelves then waste little.
        order.sort_by_key(|&index| std::cmp::Reverse(sizes[index][1]));
        let mut regions = vec![Region::default(); sizes.len()];
        for index in order {
            regions[index] = self.place(sizes[index][0], sizes[index][1])?;
        }
        Some(regions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pictures_lie_apart(sizes in proptest::collection::vec([1..60_u32, 1..60_u32], 0..40)) {
            let Some(regions) = Packer::new(256).place_all(&sizes) else { return Ok(()) };
            for (index, a) in regions.iter().enumerate() {
                prop_assert!(u32::from(a.x) + u32::from(a.width) <= 256 && u32::from(a.y) + u32::from(a.height) <= 256);
                for b in &regions[index + 1..] {
                    let apart = a.x + a.width <= b.x || b.x + b.width <= a.x || a.y + a.height <= b.y || b.y + b.height <= a.y;
                    prop_assert!(apart, "{a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_said() {
        assert_eq!(Packer::new(64).place(65, 1), None);
        assert!(Packer::new(64).place_all(&[[64, 40], [64, 40]]).is_none());
    }
}
