use super::map::{MapJudge, MapKey};
use super::photo::PhotoJudge;
use super::*;
use crate::source::growth::Growth;
use crate::source::{RequestCrs, procedural};
use treeline_core::tile::TileAddress;

const GROWTH: Growth = Growth { conifer: 1, broadleaf: 2, mixed: 3 };

fn by_photo() -> PictureCover {
    let height = Arc::new(procedural::height());
    PictureCover::new(Arc::new(procedural::colour()), Some(height), Box::new(PhotoJudge::new(GROWTH)))
}

fn by_map() -> PictureCover {
    PictureCover::new(Arc::new(procedural::colour()), None, Box::new(MapJudge::new(1, MapKey::default())))
}

fn read(cover: &PictureCover, window: LatticeWindow) -> Vec<Cover> {
    let mut out = vec![Cover::default(); window.len()];
    cover.sample(&SampleGrid::Lattice(window), &mut out).unwrap();
    out
}

/// Cells across the corner of four blocks of the finest level, and their blocks' side there.
fn corner(cover: &PictureCover) -> LatticeWindow {
    let level = cover.picture.finest;
    let (longitude, latitude) = cover.extent.bounds.centre();
    let tile = LatticeWindow::of_tile(TileAddress::at(level, longitude, latitude), Registration::Cell, 0);
    LatticeWindow {
        first_column: (tile.first_column.div_euclid(SIDE) + 1) * SIDE - 24,
        first_row: (tile.first_row.div_euclid(SIDE) + 1) * SIDE - 24,
        width: 48,
        height: 48,
        ..tile
    }
}

#[test]
fn blocks_show_no_seam() {
    for cover in [by_photo(), by_map()] {
        let window = corner(&cover);
        let told = read(&cover, window);
        // The same cells judged at once, in one patch with a margin.
        let margin = cover.judge.margin();
        let patch = cover
            .picture
            .patch(LatticeWindow {
                first_column: window.first_column - i64::from(margin),
                first_row: window.first_row - i64::from(margin),
                width: window.width + 2 * margin,
                height: window.height + 2 * margin,
                ..window
            })
            .unwrap();
        assert_eq!(told, cover.judge.judge(&cover.picture, &patch).unwrap());
        assert!(told.iter().any(|cover| cover.species != 0));
    }
}

#[test]
fn a_box_reads_the_cells_that_the_lattice_reads() {
    let cover = by_photo();
    let window = corner(&cover);
    let bounds = window.pixel_box();
    let grid = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: bounds.west,
        south: bounds.south,
        east: bounds.east,
        north: bounds.north,
        width: window.width,
        height: window.height,
    };
    let mut told = vec![Cover::default(); grid.len()];
    cover.sample(&grid, &mut told).unwrap();
    assert_eq!(told, read(&cover, window));
}

#[test]
fn far_views_do_not_judge_every_cell() {
    let cover = by_photo();
    let (longitude, latitude) = cover.extent.bounds.centre();
    let window = LatticeWindow::of_tile(TileAddress::at(5, longitude, latitude), Registration::Cell, 0);
    let step = |level: u8| {
        let grid = SampleGrid::Lattice(LatticeWindow { level, ..window });
        let (placement, ..) = cover.placement(cover.picture.finest).unwrap();
        cover.picture.finest - cover.coarser(Projector::new(&placement, &grid).pixels_per_sample())
    };
    let finest = cover.picture.finest;
    assert_eq!(step(finest + 2), finest);
    assert_eq!(step(finest), finest);
    assert_eq!(step(finest - 1), finest, "level 2 of the quadtree is packed from level 1");
    assert_eq!(step(finest - 4), finest - 3);
    let told = read(&cover, window);
    assert!(told.iter().any(|cover| cover.species != 0) && told.iter().any(|cover| cover.species == 0));
}

#[test]
fn beside_the_picture_nothing_is_told() {
    let cover = by_photo();
    let window = LatticeWindow { level: 12, first_column: 0, first_row: 300_000, ..corner(&cover) };
    assert!(read(&cover, window).iter().all(|cover| *cover == Cover::default()));
}
