use super::*;
use crate::source::RequestCrs;
use proptest::prelude::*;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::layer::SurfaceType;
use treeline_core::tile::GeographicBox;

const SPRUCE: u8 = 1;
const LARCH: u8 = 4;

/// A slope that rises to the north, all of one growth.
struct Slope {
    extent: FieldExtent,
    growth: u8,
    foot: f32,
}

impl Slope {
    fn new(growth: u8, foot: f32) -> Arc<Self> {
        let bounds = GeographicBox { west: 10.0, south: 46.0, east: 11.0, north: 47.0 };
        let extent = FieldExtent { bounds, resolution_metres: 10.0, projected_epsg: None };
        Arc::new(Self { extent, growth, foot })
    }
}

impl CoverField for Slope {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, _: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
        out.fill(Cover { species: self.growth, closure: 200, height: 0, surface: SurfaceType::Plain as u8 });
        Ok(())
    }
}

impl HeightField for Slope {
    fn extent(&self) -> &FieldExtent {
        &self.extent
    }

    fn sample(&self, grid: &SampleGrid, out: &mut [f32]) -> Result<(), SourceError> {
        let places = Places::of(grid);
        let width = grid.size().0 as usize;
        for (index, out) in out.iter_mut().enumerate() {
            let latitude = places.latitude(index % width, index / width);
            *out = self.foot + (3000.0 * (latitude - 46.0)) as f32;
        }
        Ok(())
    }

    fn maxima(&self, _: &GeographicBox, columns: u32, rows: u32) -> Result<Vec<f32>, SourceError> {
        Ok(vec![4000.0; (columns * rows) as usize])
    }

    fn range(&self) -> (f32, f32) {
        (0.0, 4000.0)
    }
}

fn grown(growths: Growths, growth: u8, foot: f32) -> GrownCover {
    let slope = Slope::new(growth, foot);
    GrownCover::new(slope.clone(), growths, slope, 1)
}

/// Shares by species of a square kilometre or so at a latitude.
fn shares(cover: &GrownCover, latitude: f64) -> [f64; 256] {
    let grid = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: 10.3,
        south: latitude - 0.005,
        east: 10.4,
        north: latitude + 0.005,
        width: 1000,
        height: 100,
    };
    let mut out = vec![Cover::default(); grid.len()];
    cover.sample(&grid, &mut out).unwrap();
    let mut shares = [0.0; 256];
    out.iter().for_each(|cover| shares[usize::from(cover.species)] += 1.0 / out.len() as f64);
    shares
}

#[test]
fn a_mixture_has_its_shares() {
    let mut growths = Growths::new(&Species::built_in());
    let growth = growths.mixture(LARCH, SPRUCE, 0.3).unwrap();
    assert_eq!(growths.species_of(&[growth]), [SPRUCE, LARCH]);
    let shares = shares(&grown(growths, growth, 0.0), 46.5);
    assert!((shares[usize::from(LARCH)] - 0.7).abs() < 0.03, "{}", shares[usize::from(LARCH)]);
    assert!((shares[usize::from(SPRUCE)] - 0.3).abs() < 0.03);
}

#[test]
fn belts_of_conifers_follow_the_height() {
    let growths = Growths::new(&Species::built_in());
    let conifer = growths.rules().conifer;
    let listed = growths.species_of(&[conifer]);
    let cover = grown(growths, conifer, 0.0);
    // 0.3° are 900 m, 0.7° are 2,100 m, 0.99° are 2,970 m: spruce below, stone pine and larch above, dwarf pine last.
    let (low, high, highest) = (shares(&cover, 46.3), shares(&cover, 46.68), shares(&cover, 46.985));
    assert!(low[1] > 0.4 && low[6] == 0.0 && low[11] == 0.0, "{:?}", &low[..13]);
    assert!(high[6] > 0.3 && high[4] > 0.1 && high[1] == 0.0, "{:?}", &high[..13]);
    assert!(highest[11] > 0.99, "{:?}", &highest[..13]);
    for (code, share) in low.iter().enumerate() {
        assert!(*share == 0.0 || listed.contains(&(code as u8)));
        assert!(![2, 7, 8, 9, 10, 12].contains(&code) || *share == 0.0, "{code} is no conifer");
    }
}

#[test]
fn belts_sink_toward_the_poles() {
    assert_eq!(altitude_at_47_degrees(1000.0, 47.0), 1000.0);
    assert_eq!(altitude_at_47_degrees(1000.0, -61.0), 2540.0);
    assert_eq!(altitude_at_47_degrees(1000.0, 10.0), altitude_at_47_degrees(1000.0, 25.0));
}

#[test]
fn codes_end() {
    let mut growths = Growths::new(&Species::built_in());
    let mut last = Ok(0);
    for share in 0..300 {
        last = growths.mixture(1, 2, f64::from(share) / 300.0);
    }
    assert!(last.unwrap_err().contains("more mixtures"));
}

#[test]
fn a_scene_without_species_grows_nothing() {
    let growths = Growths::new(&[]);
    assert_eq!(growths.rules(), Growth { conifer: 0, broadleaf: 0, mixed: 0 });
    assert_eq!(growths.species_of(&[0]), Vec::<u8>::new());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn a_place_has_one_species_in_all_windows(dx in 0_u32..90, dy in 0_u32..90, foot in 0.0_f32..1500.0) {
        let growths = Growths::new(&Species::built_in());
        let mixed = growths.rules().mixed;
        let cover = grown(growths, mixed, foot);
        let whole = LatticeWindow {
            level: 12, registration: Registration::Cell,
            first_column: 1_107_000, first_row: 253_000, width: 100, height: 100,
        };
        let part = LatticeWindow {
            first_column: whole.first_column + i64::from(dx), first_row: whole.first_row + i64::from(dy),
            width: 10, height: 10, ..whole
        };
        let read = |window: LatticeWindow| {
            let mut out = vec![Cover::default(); window.len()];
            cover.sample(&SampleGrid::Lattice(window), &mut out).map(|()| out)
        };
        let (whole, part) = (read(whole).unwrap(), read(part).unwrap());
        for y in 0..10 {
            for x in 0..10 {
                prop_assert_eq!(part[y * 10 + x], whole[(y + dy as usize) * 100 + x + dx as usize]);
            }
        }
    }
}
