//! A view that shows a landscape well, where the scene names none.

use crate::source::{HeightField, RequestCrs, SampleGrid, SourceError};
use treeline_core::camera::{DEFAULT_FIELD_OF_VIEW_DEGREES, GeographicCamera};
use treeline_core::geodesy::{meridian_radius, prime_vertical_radius};

/// Samples along a side of the coarse look at the terrain.
const SIDE: u32 = 96;
/// Headings that are tried, degrees: into the north, where the light is best, before others.
const HEADINGS: [f64; 7] = [0.0, -25.0, 25.0, -50.0, 50.0, -80.0, 80.0];

/// A coarse look at the terrain on a plane: x east, y north, metres from the middle of its box.
struct Look {
    heights: Vec<f32>,
    centre: (f64, f64),
    metres_per_degree: (f64, f64),
    size: (f64, f64),
}

impl Look {
    fn at(field: &dyn HeightField) -> Result<Self, SourceError> {
        let bounds = field.extent().bounds;
        let centre = bounds.centre();
        let grid = SampleGrid::Box {
            crs: RequestCrs::Geographic,
            west: bounds.west,
            south: bounds.south,
            east: bounds.east,
            north: bounds.north,
            width: SIDE,
            height: SIDE,
        };
        let mut heights = vec![f32::NAN; grid.len()];
        field.sample(&grid, &mut heights)?;
        let metres_per_degree = (
            (prime_vertical_radius(centre.1) * centre.1.to_radians().cos()).max(1.0).to_radians(),
            meridian_radius(centre.1).to_radians(),
        );
        let size = (
            (bounds.east - bounds.west) * metres_per_degree.0,
            (bounds.north - bounds.south) * metres_per_degree.1,
        );
        Ok(Self { heights, centre, metres_per_degree, size })
    }

    /// East, north and height of all samples with data.
    fn points(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        self.heights.iter().enumerate().filter(|(_, height)| height.is_finite()).map(|(index, &height)| {
            let (column, row) = (index as u32 % SIDE, index as u32 / SIDE);
            let share = |cell: u32| (f64::from(cell) + 0.5) / f64::from(SIDE) - 0.5;
            (share(column) * self.size.0, -share(row) * self.size.1, f64::from(height))
        })
    }

    fn camera(
        &self,
        east: f64,
        north: f64,
        height: f64,
        heading_deg: f64,
        pitch_deg: f64,
    ) -> GeographicCamera {
        // Seven decimals of a degree are a centimetre: enough for a link that people read.
        let decimals = |value: f64, factor: f64| (value * factor).round() / factor;
        GeographicCamera {
            lon: decimals(self.centre.0 + east / self.metres_per_degree.0, 1e7),
            lat: decimals((self.centre.1 + north / self.metres_per_degree.1).clamp(-89.9, 89.9), 1e7),
            height: decimals(height, 10.0),
            heading_deg: decimals(heading_deg.rem_euclid(360.0), 10.0),
            pitch_deg: decimals(pitch_deg, 10.0),
            fov_y_deg: DEFAULT_FIELD_OF_VIEW_DEGREES,
        }
    }
}

/// An oblique view of the highest terrain, from the side from which most of the scene stands
/// behind it; straight down where the scene is a continent or has no data.
pub fn default_camera(field: &dyn HeightField) -> Result<GeographicCamera, SourceError> {
    const CONTINENT_METRES: f64 = 800_000.0;
    let look = Look::at(field)?;
    let span = look.size.0.max(look.size.1);
    let Some(peak) = look.points().max_by(|a, b| a.2.total_cmp(&b.2)) else {
        return Ok(look.camera(0.0, 0.0, span.max(1000.0), 0.0, -90.0));
    };
    if span > CONTINENT_METRES {
        return Ok(look.camera(0.0, 0.0, (1.1 * span).min(2.0e7), 0.0, -90.0));
    }
    let lowest = look.points().map(|point| point.2).fold(f64::INFINITY, f64::min);
    let relief = peak.2 - lowest;
    // Near enough that the relief fills a good part of the picture, far enough to see it as a whole.
    let distance = (4.0 * relief).clamp(0.2 * span, 0.42 * span).max(20.0);
    // The peak draws the eye, but the picture is of the whole: half way to the middle.
    let target = (peak.0 * 0.5, peak.1 * 0.5, lowest + 0.45 * relief);
    let best = HEADINGS
        .iter()
        .map(|&heading| (heading, score(&look, target, distance, heading)))
        .fold((HEADINGS[0], f64::NEG_INFINITY), |best, tried| if tried.1 > best.1 { tried } else { best });
    let (sine, cosine) = best.0.to_radians().sin_cos();
    let eye = (target.0 - distance * sine, target.1 - distance * cosine);
    let near = look
        .points()
        .filter(|(x, y, _)| (x - eye.0).hypot(y - eye.1) < 0.25 * distance)
        .map(|point| point.2)
        .fold(lowest, f64::max);
    let height = (target.2 + 0.36 * distance).max(near + 0.08 * distance + 2.0);
    let pitch = (target.2 - height).atan2(distance).to_degrees();
    Ok(look.camera(eye.0, eye.1, height, best.0, pitch))
}

/// How much of the scene's data stands in the picture, less a little for turning away from north.
fn score(look: &Look, target: (f64, f64, f64), distance: f64, heading: f64) -> f64 {
    const HALF_FIELD_DEGREES: f64 = 35.0;
    let (sine, cosine) = heading.to_radians().sin_cos();
    let eye = (target.0 - distance * sine, target.1 - distance * cosine);
    let seen = look
        .points()
        .filter(|(x, y, _)| {
            let (x, y) = (x - eye.0, y - eye.1);
            let ahead = x * sine + y * cosine;
            let aside = x * cosine - y * sine;
            ahead > 0.2 * distance && aside.abs() < ahead * HALF_FIELD_DEGREES.to_radians().tan()
        })
        .count();
    seen as f64 / f64::from(SIDE * SIDE) - heading.abs() * 0.004
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::FieldExtent;
    use treeline_core::tile::GeographicBox;

    /// A cone in the middle of a plain, or nothing at all.
    struct Cone(FieldExtent, bool);

    fn cone(degrees: f64, there: bool) -> Cone {
        let bounds = GeographicBox { west: 10.0, south: 46.0, east: 10.0 + degrees, north: 46.0 + degrees };
        Cone(FieldExtent { bounds, resolution_metres: 30.0, projected_epsg: None }, there)
    }

    impl HeightField for Cone {
        fn extent(&self) -> &FieldExtent {
            &self.0
        }

        fn sample(&self, grid: &SampleGrid, out: &mut [f32]) -> Result<(), SourceError> {
            let (width, height) = grid.size();
            for (index, value) in out.iter_mut().enumerate() {
                let x = (index as u32 % width) as f32 / width as f32 - 0.5;
                let y = (index as u32 / width) as f32 / height as f32 - 0.5;
                *value = if self.1 { 500.0 + 2000.0 * (1.0 - 4.0 * x.hypot(y)).max(0.0) } else { f32::NAN };
            }
            Ok(())
        }

        fn maxima(&self, _: &GeographicBox, columns: u32, rows: u32) -> Result<Vec<f32>, SourceError> {
            Ok(vec![2500.0; (columns * rows) as usize])
        }

        fn range(&self) -> (f32, f32) {
            (500.0, 2500.0)
        }
    }

    #[test]
    fn it_looks_north_and_down_at_the_mountain_from_above_the_ground() {
        let camera = default_camera(&cone(0.4, true)).unwrap();
        assert_eq!(camera.check(), Ok(()));
        assert_eq!(camera.heading_deg, 0.0);
        assert!(camera.lat < 46.2 && (camera.lon - 10.2).abs() < 0.01, "{camera:?}");
        assert!(camera.height > 1000.0 && (-45.0..-8.0).contains(&camera.pitch_deg), "{camera:?}");
    }

    #[test]
    fn nothing_and_continents_are_seen_from_above() {
        for field in [cone(0.4, false), cone(30.0, true)] {
            let camera = default_camera(&field).unwrap();
            assert_eq!((camera.check(), camera.pitch_deg), (Ok(()), -90.0));
        }
    }
}
