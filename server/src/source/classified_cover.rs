//! Land cover seen in a picture: a photo, or a topographic map with its forest tint.

use super::{ColourField, Cover, CoverField, FieldExtent, HeightField, RequestCrs, SampleGrid, SourceError};
use std::sync::Arc;
use treeline_core::geodesy;
use treeline_core::grid::LatticeWindow;
use treeline_core::layer::SurfaceType;

/// What is known of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Colour of the picture, sRGB.
    pub colour: [u8; 3],
    /// Height of the ground, metres; NaN where it is not known.
    pub height: f32,
    /// Steepness of the ground, metres per metre; NaN where it is not known.
    pub slope: f32,
}

/// Tells what grows at a place from what is known of it.
pub trait Classifier: Send + Sync {
    /// The cover of a place.
    fn classify(&self, site: &Site) -> Cover;

    /// Whether it looks at the ground's height and slope.
    fn needs_terrain(&self) -> bool;
}

/// Cover by a classifier on a picture and the terrain below it.
pub struct ClassifiedCover {
    colour: Arc<dyn ColourField>,
    height: Option<Arc<dyn HeightField>>,
    classifier: Box<dyn Classifier>,
}

impl ClassifiedCover {
    /// Classifies a picture; without terrain the classifier sees NaN.
    pub fn new(
        colour: Arc<dyn ColourField>,
        height: Option<Arc<dyn HeightField>>,
        classifier: Box<dyn Classifier>,
    ) -> Self {
        let height = height.filter(|_| classifier.needs_terrain());
        Self { colour, height, classifier }
    }
}

impl CoverField for ClassifiedCover {
    fn extent(&self) -> &FieldExtent {
        self.colour.extent()
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        let mut colours = vec![[0; 4]; grid.len()];
        self.colour.sample(grid, &mut colours)?;
        if colours.iter().all(|colour| colour[3] == 0) {
            out.fill(Cover::default());
            return Ok(());
        }
        let (width, rows) = grid.size();
        let stride = width as usize + 2;
        let mut heights = vec![f32::NAN; stride * (rows as usize + 2)];
        if let Some(height) = &self.height {
            height.sample(&with_border(grid), &mut heights)?;
        }
        for row in 0..rows as usize {
            let (dx, dy) = spacing_metres(grid, row as u32);
            for column in 0..width as usize {
                let index = row * width as usize + column;
                let [r, g, b, alpha] = colours[index];
                if alpha == 0 {
                    out[index] = Cover::default();
                    continue;
                }
                let at = (row + 1) * stride + column + 1;
                let east = (heights[at + 1] - heights[at - 1]) / (2.0 * dx);
                let north = (heights[at - stride] - heights[at + stride]) / (2.0 * dy);
                let site = Site { colour: [r, g, b], height: heights[at], slope: east.hypot(north) };
                out[index] = self.classifier.classify(&site);
            }
        }
        Ok(())
    }
}

/// The grid with one more sample on each side.
fn with_border(grid: &SampleGrid) -> SampleGrid {
    match grid {
        SampleGrid::Lattice(window) => SampleGrid::Lattice(LatticeWindow {
            first_column: window.first_column - 1,
            first_row: window.first_row - 1,
            width: window.width + 2,
            height: window.height + 2,
            ..*window
        }),
        SampleGrid::Box { crs, west, south, east, north, width, height } => {
            let (dx, dy) = ((east - west) / f64::from(*width), (north - south) / f64::from(*height));
            SampleGrid::Box {
                crs: crs.clone(),
                west: west - dx,
                south: south - dy,
                east: east + dx,
                north: north + dy,
                width: width + 2,
                height: height + 2,
            }
        }
    }
}

/// Metres between samples along a row and along a column.
fn spacing_metres(grid: &SampleGrid, row: u32) -> (f32, f32) {
    let degree = geodesy::EQUATOR_METRES / 360.0;
    let at_latitude = |latitude: f64| latitude.to_radians().cos().abs().max(1e-3);
    let (dx, dy) = match grid {
        SampleGrid::Lattice(window) => {
            let step = window.step_degrees() * degree;
            (step * at_latitude(window.latitude(window.first_row + i64::from(row))), step)
        }
        SampleGrid::Box { crs, west, south, east, north, width, height } => {
            let (dx, dy) = ((east - west) / f64::from(*width), (north - south) / f64::from(*height));
            let y = north - (f64::from(row) + 0.5) * dy;
            match crs {
                RequestCrs::Geographic => (dx * degree * at_latitude(y), dy * degree),
                RequestCrs::WebMercator => {
                    let shrink = at_latitude(geodesy::geographic_from_web_mercator(0.0, y).1);
                    (dx * shrink, dy * shrink)
                }
                RequestCrs::Projected(_) => (dx, dy),
            }
        }
    };
    (dx.abs().max(1e-6) as f32, dy.abs().max(1e-6) as f32)
}

fn forest(species: u8, closure: u8) -> Cover {
    if species == 0 {
        return Cover::default();
    }
    Cover { species, closure, height: 0, surface: SurfaceType::Plain as u8 }
}

fn ground(surface: SurfaceType) -> Cover {
    Cover { surface: surface as u8, ..Cover::default() }
}

/// One rule on each pixel of a photo: dark and green is forest, so is deep shadow on a slope; blue and
/// flat is water, so is dark ground at sea level; brighter green is grass; bright and grey is snow
/// where it is high, grey is rock where it is steep.
pub struct PhotoRule {
    /// What grows below [`Self::conifers_above`].
    pub broadleaf: u8,
    /// What grows above it.
    pub conifer: u8,
    /// Height from which conifers take over, metres.
    pub conifers_above: f32,
    /// Height above which no forest is believed, metres.
    pub tree_line: f32,
}

impl PhotoRule {
    /// Ground steeper than this is no water.
    const FLAT: f32 = 0.04;
    /// Ground steeper than this carries no closed forest.
    const CLIFF: f32 = 1.8;

    /// The rule with a scene's species.
    pub fn new(conifer: u8, broadleaf: u8) -> Self {
        Self { broadleaf, conifer, conifers_above: 900.0, tree_line: 4200.0 }
    }
}

impl Classifier for PhotoRule {
    fn needs_terrain(&self) -> bool {
        true
    }

    fn classify(&self, site: &Site) -> Cover {
        let [r, g, b] = site.colour.map(f32::from);
        let brightness = (r + g + b) / 3.0;
        // Comparisons with an unknown slope or height (NaN) are false: unknown ground counts as flat and low.
        let steep = site.slope > Self::FLAT;
        let blue = b > r + 30.0 && b > 1.15 * g;
        let dark_sea = brightness < 60.0 && g < 1.25 * r + 12.0 && b >= r && site.height <= 1.0;
        // Surface models are rough along a shore: what is vividly blue and near sea level is the sea all the same.
        let shore = b > r + 70.0 && b > 1.1 * g && site.slope < 0.4 && site.height < 40.0;
        if !steep && (blue || dark_sea) || shore {
            return ground(SurfaceType::Water);
        }
        let spread = r.max(g).max(b) - r.min(g).min(b);
        if brightness > 200.0 && spread < 30.0 && site.height > 1200.0 {
            return ground(SurfaceType::Snow);
        }
        // Haze lends blue to dark crowns, and shadow takes nearly all colour from them.
        let dark_green = brightness < 95.0 && g >= r + 4.0 && b <= 1.2 * g + 6.0;
        let shadow = brightness < 35.0 && steep && g >= r;
        let too_steep = site.slope > Self::CLIFF || site.height > self.tree_line;
        if (dark_green || shadow) && !too_steep {
            let species = if site.height > self.conifers_above { self.conifer } else { self.broadleaf };
            // The darker, the more closed.
            let closure = (250.0 - 1.4 * brightness).clamp(100.0, 235.0);
            return forest(species, closure as u8);
        }
        if g > r + 3.0 && g > b + 3.0 {
            return ground(SurfaceType::Grass);
        }
        if spread < 40.0 && site.slope > 0.7 {
            return ground(SurfaceType::Rock);
        }
        Cover::default()
    }
}

/// The forest tint of topographic maps: a clear, light green; water is a clear, light blue.
pub struct MapTint {
    /// What grows in the tint.
    pub species: u8,
}

impl Classifier for MapTint {
    fn needs_terrain(&self) -> bool {
        false
    }

    fn classify(&self, site: &Site) -> Cover {
        let (hue, saturation, value) = hue_saturation_value(site.colour);
        if saturation > 0.10 && value > 0.35 && (75.0..170.0).contains(&hue) {
            return forest(self.species, 210);
        }
        if saturation > 0.12 && value > 0.4 && (175.0..255.0).contains(&hue) {
            return ground(SurfaceType::Water);
        }
        Cover::default()
    }
}

/// Hue in degrees, saturation and value 0 … 1.
fn hue_saturation_value(colour: [u8; 3]) -> (f32, f32, f32) {
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

    #[test]
    fn the_photo_rule_on_plain_cases() {
        let rule = PhotoRule::new(1, 2);
        let at = |colour, height, slope| rule.classify(&Site { colour, height, slope });
        assert_eq!(at([40, 62, 38], 300.0, 0.3).species, 2);
        assert_eq!(at([40, 62, 38], 1500.0, 0.3).species, 1);
        assert_eq!(at([20, 40, 70], 0.0, 0.0).surface(), SurfaceType::Water);
        assert_eq!(at([20, 40, 70], 300.0, 0.5).surface(), SurfaceType::Plain);
        assert_eq!(at([20, 90, 160], 12.0, 0.3).surface(), SurfaceType::Water, "a rough shore");
        assert_eq!(at([20, 90, 160], 300.0, 0.3).surface(), SurfaceType::Plain, "a blue roof up a hill");
        assert_eq!(at([170, 165, 160], 20.0, 0.05), Cover::default());
        assert_eq!(at([140, 180, 110], 200.0, 0.1).surface(), SurfaceType::Grass);
        assert_eq!(at([240, 242, 245], 2500.0, 0.3).surface(), SurfaceType::Snow);
        assert_eq!(
            at([40, 62, 38], f32::NAN, f32::NAN).species,
            2,
            "unknown ground is no reason against forest"
        );
    }

    #[test]
    fn the_map_tint() {
        let map = MapTint { species: 1 };
        let at = |colour| map.classify(&Site { colour, height: f32::NAN, slope: f32::NAN });
        assert_eq!(at([200, 230, 180]).species, 1);
        assert_eq!(at([255, 255, 255]), Cover::default());
        assert_eq!(at([170, 210, 240]).surface(), SurfaceType::Water);
        assert_eq!(at([180, 120, 60]), Cover::default());
    }

    #[test]
    fn hues() {
        assert_eq!(hue_saturation_value([255, 0, 0]), (0.0, 1.0, 1.0));
        assert_eq!(hue_saturation_value([0, 255, 0]).0, 120.0);
        assert_eq!(hue_saturation_value([0, 0, 255]).0, 240.0);
        assert_eq!(hue_saturation_value([7, 7, 7]).1, 0.0);
    }
}
