//! Cost by hand: `cargo test --release -p treeline-server --lib source::tests::cost -- --ignored --nocapture`.

use super::data;
use crate::source::{
    ColourField, HeightField, HeightOptions, SampleGrid, SourceOptions, open_colour, open_height,
};
use std::time::Instant;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::tile::{self, TileAddress};

fn median_ms(mut work: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..9)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[4]
}

#[test]
#[ignore = "measures time, checks nothing"]
fn windows_once_their_chunks_are_decoded() {
    for name in [
        "scene_hongkong/dem_aster30m_4326.tif",
        "scene_hongkong/dem_utm50n_30m.tif",
        "scene_lolo_montana/dem_m.tif",
        "robust_crs_extent/nrw_dsm_1m_utm32.tif",
        "robust_crs_extent/antarctica_vestfold_polar_stereo.tif",
    ] {
        let Some(path) = data::find(name) else { return };
        let field = open_height(&path, &HeightOptions::default()).unwrap();
        let (longitude, latitude) = field.extent().bounds.centre();
        let own = tile::level_for_cell_metres(field.extent().resolution_metres);
        for level in [own - 6, own - 2, own, own + 2] {
            let tile = TileAddress::at(level, longitude, latitude);
            let window = LatticeWindow::of_tile(tile, Registration::Node, 1);
            let mut heights = vec![0.0; window.len()];
            let time = median_ms(|| field.sample(&SampleGrid::Lattice(window), &mut heights).unwrap());
            println!("{name} level {level}: {time:.2} ms for 515 × 515");
        }
    }
    for name in
        ["scene_hongkong/ortho_landsat8_4326.tif", "scene_jotunheimen_norway/topomap_texture_15m_utm32n.tif"]
    {
        let Some(path) = data::find(name) else { return };
        let field = open_colour(&path, &SourceOptions::default()).unwrap();
        let (longitude, latitude) = field.extent().bounds.centre();
        let own = tile::level_for_cell_metres(field.extent().resolution_metres);
        for level in [own - 3, own - 2, own - 1, own, own + 2] {
            let tile = TileAddress::at(level, longitude, latitude);
            let window = LatticeWindow::of_tile(tile, Registration::Cell, 4);
            let mut colours = vec![[0; 4]; window.len()];
            let time = median_ms(|| field.sample(&SampleGrid::Lattice(window), &mut colours).unwrap());
            println!("{name} level {level}: {time:.2} ms for 520 × 520");
        }
    }
}

/// The files that TREELINE_COST_PHOTO and TREELINE_COST_DEM name, level by level from the coarsest, cold as a
/// client asks for them, then again.
#[test]
#[ignore = "measures time, checks nothing"]
fn a_large_file_from_the_coarsest_level_down() {
    let tile_at = |bounds: &tile::GeographicBox, level| {
        let (longitude, latitude) = bounds.centre();
        TileAddress::at(level, longitude, latitude)
    };
    let once = |work: &mut dyn FnMut()| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64() * 1e3
    };
    if let Some(path) = std::env::var_os("TREELINE_COST_PHOTO") {
        let field = open_colour(path.as_ref(), &SourceOptions::default()).unwrap();
        let own = tile::level_for_cell_metres(field.extent().resolution_metres);
        for level in (own - 8..=own + 1).chain([own - 1, own - 2]) {
            let tile = tile_at(&field.extent().bounds, level);
            let window = LatticeWindow::of_tile(tile, Registration::Cell, 4);
            let mut colours = vec![[0; 4]; window.len()];
            let mut sample = || field.sample(&SampleGrid::Lattice(window), &mut colours).unwrap();
            let (cold, warm) = (once(&mut sample), once(&mut sample));
            println!("photo, own level {own:+}, level {level}: {cold:.1} ms, again {warm:.1} ms");
        }
    }
    if let Some(path) = std::env::var_os("TREELINE_COST_DEM") {
        let field = open_height(path.as_ref(), &HeightOptions::default()).unwrap();
        let own = tile::level_for_cell_metres(field.extent().resolution_metres);
        for level in own - 8..=own + 1 {
            let tile = tile_at(&field.extent().bounds, level);
            let window = LatticeWindow::of_tile(tile, Registration::Node, 1);
            let mut heights = vec![0.0; window.len()];
            let mut sample = || field.sample(&SampleGrid::Lattice(window), &mut heights).unwrap();
            let (cold, warm) = (once(&mut sample), once(&mut sample));
            println!("heights, own level {own}, level {level}: {cold:.1} ms, again {warm:.1} ms");
        }
    }
}
