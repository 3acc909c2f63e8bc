//! Brings children to the mean of their parents' colours without showing where a parent ends.
//!
//! A parent coloured at its centre differs from the mean of its children where something begins or
//! ends within it. Shifting its four children alone would draw a square. So the differences are first
//! spread smoothly over the neighbours, twice, and only what is then left is shifted by fours.

/// An sRGB colour, 0…255.
pub(super) type Colour = [f32; 3];

/// Parents beyond a window whose children bear on those inside: one for each spreading.
pub(super) const MARGIN: usize = 2;

/// Mean of four colours.
pub(super) fn mean(of: [Colour; 4]) -> Colour {
    std::array::from_fn(|k| 0.25 * (of[0][k] + of[1][k] + of[2][k] + of[3][k]))
}

/// Corrects `children` (2·width a row) of `parents` (`width` a row).
pub(super) fn settle(children: &mut [Colour], parents: &[Colour], width: usize) {
    for _ in 0..MARGIN {
        let missing = differences(children, parents, width);
        spread(children, &missing, width);
    }
    for (index, &parent) in parents.iter().enumerate() {
        let places = four(index, width);
        let settled = shifted(places.map(|place| children[place]), parent);
        for (place, colour) in places.into_iter().zip(settled) {
            children[place] = colour;
        }
    }
}

/// Indices of a parent's children: north-west, north-east, south-west, south-east.
fn four(index: usize, width: usize) -> [usize; 4] {
    let at = 4 * width * (index / width) + 2 * (index % width);
    [at, at + 1, at + 2 * width, at + 2 * width + 1]
}

/// What each parent's colour exceeds the mean of its children by.
fn differences(children: &[Colour], parents: &[Colour], width: usize) -> Vec<Colour> {
    let difference = |(index, parent): (usize, &Colour)| -> Colour {
        let now = mean(four(index, width).map(|place| children[place]));
        std::array::from_fn(|k| parent[k] - now[k])
    };
    parents.iter().enumerate().map(difference).collect()
}

/// Adds the parents' differences, bilinear between their centres, to the children.
fn spread(children: &mut [Colour], missing: &[Colour], width: usize) {
    let height = missing.len() / width;
    // A child's centre lies a quarter from its parent's: ¾ of that, ¼ of the next one.
    let next = |i: usize, count: usize| {
        if i.is_multiple_of(2) { (i / 2).saturating_sub(1) } else { (i / 2 + 1).min(count - 1) }
    };
    let mut line = vec![[0.0_f32; 3]; width];
    for (j, row) in children.chunks_exact_mut(2 * width).enumerate() {
        let (near, far) = (j / 2 * width, next(j, height) * width);
        for (i, sum) in line.iter_mut().enumerate() {
            *sum = std::array::from_fn(|k| 0.75 * missing[near + i][k] + 0.25 * missing[far + i][k]);
        }
        for (i, child) in row.iter_mut().enumerate() {
            let (here, beside) = (line[i / 2], line[next(i, width)]);
            *child = std::array::from_fn(|k| child[k] + (0.75 * here[k] + 0.25 * beside[k]));
        }
    }
}

/// Moves four children so that their mean is the parent's colour; where a child would leave
/// 0…255 all four draw nearer to the parent.
fn shifted(children: [Colour; 4], parent: Colour) -> [Colour; 4] {
    let now = mean(children);
    let mut out = children;
    for k in 0..3 {
        let mut pull = 1.0_f32;
        for child in &children {
            let away = child[k] - now[k];
            if parent[k] + away > 255.0 {
                pull = pull.min((255.0 - parent[k]) / away);
            } else if parent[k] + away < 0.0 {
                pull = pull.min(parent[k] / -away);
            }
        }
        for (out, child) in out.iter_mut().zip(&children) {
            out[k] = parent[k] + (child[k] - now[k]) * pull;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::random::{hash, unit};
    use super::*;

    #[test]
    fn means_are_kept_and_colours_stay_in_range() {
        let width = 9;
        let random = |i: usize, seed: u32| -> Colour {
            std::array::from_fn(|k| 255.0 * unit(hash(i as u32, k as u32, seed)))
        };
        let parents: Vec<Colour> = (0..width * 7).map(|i| random(i, 1)).collect();
        let mut children: Vec<Colour> = (0..width * 7 * 4).map(|i| random(i, 2)).collect();
        settle(&mut children, &parents, width);
        for (index, parent) in parents.iter().enumerate() {
            let found = mean(four(index, width).map(|place| children[place]));
            for k in 0..3 {
                assert!((found[k] - parent[k]).abs() < 1e-3);
            }
        }
        assert!(children.iter().flatten().all(|v| (-1e-3..=255.001).contains(v)));
    }

    #[test]
    fn a_step_between_parents_becomes_a_ramp_across_their_children() {
        let width = 10;
        let parents: Vec<Colour> =
            (0..width * width).map(|i| if i % width < 5 { [100.0; 3] } else { [140.0; 3] }).collect();
        let mut children = vec![[120.0; 3]; 4 * width * width];
        settle(&mut children, &parents, width);
        // Shifting by fours alone would leave the whole step of 40 between two children.
        let row = &children[8 * 2 * width..9 * 2 * width];
        let largest = row.windows(2).map(|pair| (pair[0][0] - pair[1][0]).abs()).fold(0.0, f32::max);
        assert!(largest < 30.0, "{largest}");
    }
}
