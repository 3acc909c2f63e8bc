//! The tints of a map: what is green or blue enough to stand for forest or water.

use super::Patch;

/// Hues among which the tint of forest is looked for, degrees, and the least that is called green.
const GREENS: std::ops::Range<usize> = 70..170;
const LEAST_GREEN: usize = 62;
/// Hues of water.
const BLUES: std::ops::Range<f32> = 165.0..260.0;
/// Colours less saturated or darker than this are paper, shading and print.
const LEAST_SATURATION: f32 = 0.12;
const LEAST_VALUE: f32 = 0.3;
/// Degrees over which hues are counted together.
const SMOOTH: usize = 3;
/// Share of the commonest hue's count under which a hue is another colour.
const TAIL: f32 = 0.05;
/// Share of a map that must be green for a tint to be believed.
const LEAST_SHARE: f32 = 0.002;

/// Which colours stand for something.
#[derive(Clone, Debug, PartialEq)]
pub enum Tint {
    /// Saturated colours of these hues, degrees.
    Hues(f32, f32),
    /// Colours within a distance of one of these, shading apart.
    Colours(Vec<[u8; 3]>, f32),
    /// None.
    Nothing,
}

impl Tint {
    /// Blue.
    pub const WATER: Self = Self::Hues(BLUES.start, BLUES.end);

    /// The forest tint of a map that is known by some patches: around the commonest green, down to where the next
    /// colour begins.
    pub fn of_forest(patches: &[Patch]) -> Self {
        let mut counts = [0.0_f32; 360];
        let mut total = 0.0_f32;
        for colour in patches.iter().flat_map(|patch| &patch.colours).filter(|colour| colour[3] == 255) {
            total += 1.0;
            let (hue, saturation, value) = hue_saturation_value([colour[0], colour[1], colour[2]]);
            if saturation >= LEAST_SATURATION && value >= LEAST_VALUE {
                counts[(hue as usize).min(359)] += 1.0;
            }
        }
        let smooth: Vec<f32> = (0..360)
            .map(|hue| (0..=2 * SMOOTH).map(|step| counts[(hue + 360 + step - SMOOTH) % 360]).sum())
            .collect();
        let Some(peak) = GREENS.max_by(|&a, &b| smooth[a].total_cmp(&smooth[b])) else {
            return Self::Nothing;
        };
        let tail = TAIL * smooth[peak];
        let mut low = peak;
        // Down the slope; a rise is the next colour's, of which the valley between is the edge.
        while low > LEAST_GREEN && smooth[low - 1] > tail && smooth[low - 1] <= smooth[low] * 1.02 {
            low -= 1;
        }
        let mut high = peak;
        while high < GREENS.end && smooth[high + 1] > 0.0 {
            high += 1;
        }
        let share: f32 = counts[low..=high].iter().sum::<f32>() / total.max(1.0);
        if share < LEAST_SHARE { Self::Nothing } else { Self::Hues(low as f32, high as f32 + 1.0) }
    }

    /// Whether a colour is of the tint.
    pub fn holds(&self, colour: [u8; 3]) -> bool {
        match self {
            Self::Nothing => false,
            Self::Hues(low, high) => {
                let (hue, saturation, value) = hue_saturation_value(colour);
                saturation >= LEAST_SATURATION && value >= LEAST_VALUE && (*low..*high).contains(&hue)
            }
            Self::Colours(keys, tolerance) => keys.iter().any(|key| distance(colour, *key) <= *tolerance),
        }
    }
}

/// Distance of a colour to a key that may be shaded or lightened by a third.
fn distance(colour: [u8; 3], key: [u8; 3]) -> f32 {
    let (colour, key) = (colour.map(f32::from), key.map(f32::from));
    let sum = |c: [f32; 3]| c.iter().sum::<f32>().max(1.0);
    let light = (sum(key) / sum(colour)).clamp(0.75, 1.5);
    (0..3).map(|k| (colour[k] * light - key[k]).powi(2)).sum::<f32>().sqrt()
}

/// Hue in degrees, saturation and value 0 … 1.
pub fn hue_saturation_value(colour: [u8; 3]) -> (f32, f32, f32) {
    let [r, g, b] = colour.map(|value| f32::from(value) / 255.0);
    let (greatest, least) = (r.max(g).max(b), r.min(g).min(b));
    let chroma = greatest - least;
    if chroma == 0.0 {
        return (0.0, 0.0, greatest);
    }
    let sextant = if greatest == r {
        ((g - b) / chroma).rem_euclid(6.0)
    } else if greatest == g {
        (b - r) / chroma + 2.0
    } else {
        (r - g) / chroma + 4.0
    };
    (60.0 * sextant, chroma / greatest, greatest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use treeline_core::grid::{LatticeWindow, Registration};

    fn map(colours: &[([u8; 3], usize)]) -> Vec<Patch> {
        let colours: Vec<[u8; 4]> = colours
            .iter()
            .flat_map(|&([r, g, b], count)| std::iter::repeat_n([r, g, b, 255], count))
            .collect();
        let window = LatticeWindow {
            level: 12,
            registration: Registration::Cell,
            first_column: 0,
            first_row: 0,
            width: colours.len() as u32,
            height: 1,
        };
        let heights = vec![0.0; colours.len()];
        vec![Patch::new(window, colours, heights)]
    }

    #[test]
    fn the_green_of_a_map_is_found_beside_its_yellow() {
        let tint = Tint::of_forest(&map(&[
            ([255, 255, 255], 500),
            ([230, 225, 150], 400), // yellow lowland
            ([205, 228, 165], 300), // woodland
            ([120, 80, 40], 50),
        ]));
        assert!(tint.holds([205, 228, 165]) && tint.holds([164, 182, 132]), "{tint:?}");
        assert!(!tint.holds([230, 225, 150]) && !tint.holds([255, 255, 255]) && !tint.holds([0, 0, 0]));
    }

    #[test]
    fn a_map_without_green_has_no_tint() {
        assert_eq!(Tint::of_forest(&map(&[([255, 255, 255], 900), ([230, 225, 150], 400)])), Tint::Nothing);
        assert_eq!(Tint::of_forest(&[]), Tint::Nothing);
    }

    #[test]
    fn a_given_colour_may_be_shaded() {
        let tint = Tint::Colours(vec![[180, 215, 158]], 24.0);
        assert!(tint.holds([180, 215, 158]) && tint.holds([144, 172, 126]));
        assert!(!tint.holds([215, 215, 215]) && !tint.holds([60, 72, 53]));
    }

    #[test]
    fn hues() {
        assert_eq!(hue_saturation_value([255, 0, 0]), (0.0, 1.0, 1.0));
        assert_eq!(hue_saturation_value([0, 255, 0]).0, 120.0);
        assert_eq!(hue_saturation_value([0, 0, 255]).0, 240.0);
        assert_eq!(hue_saturation_value([7, 7, 7]).1, 0.0);
    }
}
