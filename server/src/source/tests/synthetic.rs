//! Exactness on GeoTIFFs written here, of which every value is known.

use crate::source::growth::Growth;
use crate::source::{
    ColourField, Cover, CoverField, HeightField, HeightOptions, RequestCrs, SampleGrid, SourceOptions,
    open_canopy_height, open_colour, open_height, open_land_cover,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tiff::encoder::colortype::{ColorType, Gray8, Gray32Float, GrayI16, RGB8, RGBA8};
use tiff::encoder::{Compression, TiffEncoder, TiffValue};
use tiff::tags::Tag;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::tile::{GeographicBox, TileAddress};

/// Growths of a scene without species.
const NOTHING: Growth = Growth { conifer: 0, broadleaf: 0, mixed: 0 };

/// Where a raster lies and what it declares.
struct Placed<'a> {
    /// West, north, pixel width and height.
    corner: (f64, f64, f64, f64),
    epsg: u16,
    nodata: Option<&'a str>,
    point: bool,
}

fn write<C: ColorType>(path: &Path, width: u32, height: u32, samples: &[C::Inner], placed: &Placed<'_>)
where
    [C::Inner]: TiffValue,
{
    let file = std::fs::File::create(path).unwrap();
    let mut encoder =
        TiffEncoder::new(file).unwrap().with_compression(Compression::Deflate(Default::default()));
    let mut image = encoder.new_image::<C>(width, height).unwrap();
    image.rows_per_strip(7).unwrap();
    let (west, north, dx, dy) = placed.corner;
    let geographic = placed.epsg == 4326;
    let keys: Vec<u16> = [
        vec![1, 1, 0, 3],
        vec![1024, 0, 1, if geographic { 2 } else { 1 }],
        vec![1025, 0, 1, if placed.point { 2 } else { 1 }],
        vec![if geographic { 2048 } else { 3072 }, 0, 1, placed.epsg],
    ]
    .concat();
    let directory = image.encoder();
    directory.write_tag(Tag::ModelPixelScaleTag, &[dx, dy, 0.0][..]).unwrap();
    directory.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, west, north, 0.0][..]).unwrap();
    directory.write_tag(Tag::GeoKeyDirectoryTag, &keys[..]).unwrap();
    if let Some(nodata) = placed.nodata {
        directory.write_tag(Tag::GdalNodata, nodata).unwrap();
    }
    image.write_data(samples).unwrap();
}

fn file(folder: &tempfile::TempDir, name: &str) -> PathBuf {
    folder.path().join(name)
}

/// A plane in longitude and latitude, which bilinear interpolation reproduces.
fn plane(longitude: f64, latitude: f64) -> f64 {
    300.0 + 1000.0 * (longitude - 8.0) - 700.0 * (latitude - 46.0)
}

const SIZE: u32 = 200;
const PIXEL: f64 = 0.0005;

/// 200 × 200 pixels of the plane from 8° E, 46° N.
fn plane_file(folder: &tempfile::TempDir, point: bool) -> PathBuf {
    let path = file(folder, "plane.tif");
    let shift = if point { 0.0 } else { 0.5 };
    let values: Vec<f32> = (0..SIZE * SIZE)
        .map(|index| {
            let (column, row) = (f64::from(index % SIZE) + shift, f64::from(index / SIZE) + shift);
            plane(8.0 + PIXEL * column, 46.0 - PIXEL * row) as f32
        })
        .collect();
    let placed = Placed { corner: (8.0, 46.0, PIXEL, PIXEL), epsg: 4326, nodata: None, point };
    write::<Gray32Float>(&path, SIZE, SIZE, &values, &placed);
    path
}

fn node_window(level: u8, longitude: f64, latitude: f64) -> LatticeWindow {
    LatticeWindow::of_tile(TileAddress::at(level, longitude, latitude), Registration::Node, 1)
}

#[test]
fn a_plane_is_reproduced_and_its_edge_is_the_raster_s() {
    for point in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let field = open_height(&plane_file(&folder, point), &HeightOptions::default()).unwrap();
        let window = node_window(11, 8.05, 45.95);
        let mut heights = vec![0.0; window.len()];
        field.sample(&SampleGrid::Lattice(window), &mut heights).unwrap();
        let half = if point { 0.5 * PIXEL } else { 0.0 };
        let (west, north) = (8.0 - half, 46.0 + half);
        let side = f64::from(SIZE) * PIXEL;
        let mut inside = 0;
        for (index, height) in heights.iter().enumerate() {
            let longitude = window.longitude(window.first_column + index as i64 % i64::from(window.width));
            let latitude = window.latitude(window.first_row + index as i64 / i64::from(window.width));
            let (east, south) = (longitude - west, north - latitude);
            let spare = 1e-9;
            if east < -spare || south < -spare || east > side + spare || south > side + spare {
                assert!(height.is_nan(), "{longitude} {latitude}: {height}");
            } else if (PIXEL..side - PIXEL).contains(&east) && (PIXEL..side - PIXEL).contains(&south) {
                inside += 1;
                let error = (f64::from(*height) - plane(longitude, latitude)).abs();
                assert!(error < 1e-3, "{longitude} {latitude}: {height}, off by {error}");
            } else if (spare..side - spare).contains(&east) && (spare..side - spare).contains(&south) {
                assert!(!height.is_nan(), "the border of half a pixel is data: {longitude} {latitude}");
            }
        }
        assert!(inside > 10_000);
    }
}

#[test]
fn neighbours_share_bits_and_parents_are_their_children() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, "utm.tif");
    let values: Vec<f32> =
        (0..400_u32 * 400).map(|i| ((i.wrapping_mul(2_654_435_761) >> 16) % 2000) as f32 * 0.37).collect();
    let placed =
        Placed { corner: (463_000.0, 6_834_000.0, 30.0, 30.0), epsg: 32632, nodata: None, point: false };
    write::<Gray32Float>(&path, 400, 400, &values, &placed);
    let field = open_height(&path, &HeightOptions::default()).unwrap();
    let sample = |window: LatticeWindow| {
        let mut heights = vec![0.0; window.len()];
        field.sample(&SampleGrid::Lattice(window), &mut heights).unwrap();
        heights
    };
    let (longitude, latitude) = field.extent().bounds.centre();
    let mut shared = 0;
    for level in 8..13_u8 {
        let window = node_window(level, longitude, latitude);
        let east = LatticeWindow { first_column: window.first_column + 512, ..window };
        let south = LatticeWindow { first_row: window.first_row + 512, ..window };
        let (here, right, below) = (sample(window), sample(east), sample(south));
        let width = window.width as usize;
        for index in 0..width {
            for overlap in 0..3 {
                assert_eq!(
                    here[index * width + 512 + overlap].to_bits(),
                    right[index * width + overlap].to_bits()
                );
                assert_eq!(
                    here[(512 + overlap) * width + index].to_bits(),
                    below[overlap * width + index].to_bits()
                );
            }
        }
        let child = LatticeWindow {
            level: level + 1,
            first_column: 2 * window.first_column,
            first_row: 2 * window.first_row,
            ..window
        };
        let finer = sample(child);
        for row in 0..width / 2 {
            for column in 0..width / 2 {
                let (parent, child) = (here[row * width + column], finer[2 * row * width + 2 * column]);
                assert_eq!(parent.is_nan(), child.is_nan());
                // Anchors differ between levels: a fraction of a thousandth of a pixel on slopes of 740 m a pixel.
                assert!(parent.is_nan() || (parent - child).abs() < 0.3, "{parent} {child}");
                shared += usize::from(!parent.is_nan());
            }
        }
    }
    assert!(shared > 10_000);
}

#[test]
fn voids_declared_given_and_unbelievable_never_blend() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, "voids.tif");
    let mut values = vec![100_i16; 50 * 50];
    values[10 * 50 + 10] = -9999;
    values[20 * 50 + 20] = 77;
    let corner = (8.0, 46.0, 0.01, 0.01);
    write::<GrayI16>(
        &path,
        50,
        50,
        &values,
        &Placed { corner, epsg: 4326, nodata: Some("-9999"), point: false },
    );
    let sample = |nodata: Option<f64>| {
        let source = SourceOptions { assume_crs: None, nodata };
        let field = open_height(&path, &HeightOptions { source, ..HeightOptions::default() }).unwrap();
        let grid = SampleGrid::Box {
            crs: RequestCrs::Geographic,
            west: 8.0,
            south: 45.5,
            east: 8.5,
            north: 46.0,
            width: 500,
            height: 500,
        };
        let mut heights = vec![0.0; grid.len()];
        field.sample(&grid, &mut heights).unwrap();
        (heights, field.range())
    };
    let (declared, range) = sample(None);
    assert_eq!(range, (77.0, 100.0));
    assert!(declared.iter().all(|height| height.is_nan() || (77.0..=100.0).contains(height)));
    let voids = declared.iter().filter(|height| height.is_nan()).count();
    assert!((360..=400).contains(&voids), "all within a pixel of the void, {voids}");
    let (given, range) = sample(Some(77.0));
    assert_eq!(range, (-9999.0, 100.0));
    assert!(given.iter().any(|height| height.is_nan()));
}

#[test]
fn a_world_grid_joins_over_the_antimeridian() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, "world.tif");
    let values: Vec<f32> = (0..360 * 180).map(|index| if index % 360 < 180 { 0.0 } else { 100.0 }).collect();
    let placed = Placed { corner: (-180.0, 90.0, 1.0, 1.0), epsg: 4326, nodata: None, point: false };
    write::<Gray32Float>(&path, 360, 180, &values, &placed);
    let field = open_height(&path, &HeightOptions::default()).unwrap();
    for (west, east) in [(179.0, 181.0), (-181.0, -179.0)] {
        let grid = SampleGrid::Box {
            crs: RequestCrs::Geographic,
            west,
            south: -1.0,
            east,
            north: 1.0,
            width: 5,
            height: 1,
        };
        let mut heights = vec![0.0; 5];
        field.sample(&grid, &mut heights).unwrap();
        for (found, expected) in heights.iter().zip([100.0, 100.0, 50.0, 0.0, 0.0]) {
            assert!((found - expected).abs() < 11.0, "{heights:?}");
        }
        assert_eq!(heights[2], 50.0);
    }
    let poles = node_window(1, 0.0, 90.0);
    let mut heights = vec![0.0; poles.len()];
    field.sample(&SampleGrid::Lattice(poles), &mut heights).unwrap();
    assert!(heights.iter().all(|height| !height.is_nan()), "beyond the pole lies the far side");
}

#[test]
fn maxima_bound_everything_in_their_parts() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, "rough.tif");
    let size = 1500_u32;
    let values: Vec<f32> =
        (0..size * size).map(|i| ((i.wrapping_mul(2_654_435_761) >> 16) % 3000) as f32 - 200.0).collect();
    let placed =
        Placed { corner: (463_000.0, 6_834_000.0, 10.0, 10.0), epsg: 32632, nodata: None, point: false };
    write::<Gray32Float>(&path, size, size, &values, &placed);
    let field = open_height(&path, &HeightOptions::default()).unwrap();
    let bounds = field.extent().bounds;
    let wide = GeographicBox {
        west: bounds.west - 0.1,
        south: bounds.south - 0.05,
        east: bounds.east + 0.1,
        north: bounds.north,
    };
    let small = GeographicBox { west: 8.40, south: 61.55, east: 8.42, north: 61.56 };
    for part in [bounds, wide, small] {
        let (columns, rows) = (8_u32, 5_u32);
        let maxima = field.maxima(&part, columns, rows).unwrap();
        let (width, height) = (columns * 40, rows * 40);
        let grid = SampleGrid::Box {
            crs: RequestCrs::Geographic,
            west: part.west,
            south: part.south,
            east: part.east,
            north: part.north,
            width,
            height,
        };
        let mut heights = vec![0.0; grid.len()];
        field.sample(&grid, &mut heights).unwrap();
        let (least, greatest) = field.range();
        for (index, &found) in heights.iter().enumerate() {
            let (column, row) = (index as u32 % width / 40, index as u32 / width / 40);
            let bound = maxima[(row * columns + column) as usize];
            assert!(found.is_nan() || found <= bound, "{found} above {bound}");
            assert!(found.is_nan() || (least..=greatest).contains(&found));
            assert!(bound.is_nan() || bound <= greatest);
        }
    }
    assert!(
        field
            .maxima(&GeographicBox { west: 20.0, south: 10.0, east: 21.0, north: 11.0 }, 2, 2)
            .unwrap()
            .iter()
            .all(|m| m.is_nan())
    );
}

/// A photo of noise, 1 pixel = 1 level-13 cell or so, with a transparent corner.
fn photo_file(folder: &tempfile::TempDir) -> PathBuf {
    let path = file(folder, "photo.tif");
    let size = 1024_u32;
    let samples: Vec<u8> = (0..size * size)
        .flat_map(|index| {
            let noise = (index.wrapping_mul(2_654_435_761) >> 13) as u8;
            let void = index % size < 300 && index / size < 300;
            if void { [0; 4] } else { [noise, (index % 251) as u8, (index / size % 256) as u8, 255] }
        })
        .collect();
    let placed =
        Placed { corner: (463_000.0, 6_834_000.0, 5.0, 5.0), epsg: 32632, nodata: None, point: false };
    write::<RGBA8>(&path, size, size, &samples, &placed);
    path
}

#[test]
fn a_parent_s_colour_is_the_mean_of_its_children() {
    let folder = tempfile::tempdir().unwrap();
    let field = open_colour(&photo_file(&folder), &SourceOptions::default()).unwrap();
    let (longitude, latitude) = field.extent().bounds.centre();
    let sample = |window: LatticeWindow| {
        let mut colours = vec![[0; 4]; window.len()];
        field.sample(&SampleGrid::Lattice(window), &mut colours).unwrap();
        colours
    };
    let mut compared = 0;
    // The photo's own level is 13: its cells are 4.8 m.
    for level in 9..13_u8 {
        let whole =
            LatticeWindow::of_tile(TileAddress::at(level, longitude, latitude), Registration::Cell, 0);
        let window =
            LatticeWindow { first_column: whole.first_column - 1, first_row: whole.first_row + 3, ..whole };
        let children = LatticeWindow {
            level: level + 1,
            first_column: 2 * window.first_column,
            first_row: 2 * window.first_row,
            width: 1024,
            height: 1024,
            ..window
        };
        let (parents, children) = (sample(window), sample(children));
        for row in 0..512 {
            for column in 0..512 {
                let parent = parents[row * 512 + column];
                let four = [(0, 0), (0, 1), (1, 0), (1, 1)]
                    .map(|(y, x)| children[(2 * row + y) * 1024 + 2 * column + x]);
                let alpha: f32 = four.iter().map(|child| f32::from(child[3])).sum();
                assert!((f32::from(parent[3]) - alpha / 4.0).abs() <= 1.0, "{parent:?} {four:?}");
                if parent[3] < 16 {
                    continue;
                }
                compared += 1;
                for channel in 0..3 {
                    let mean =
                        four.iter().map(|child| f32::from(child[3]) * f32::from(child[channel])).sum::<f32>()
                            / alpha;
                    // Where children are thin their own rounding weighs more.
                    let allowed = if alpha >= 1020.0 { 1.0 } else { 1.0 + 510.0 / alpha };
                    assert!((f32::from(parent[channel]) - mean).abs() <= allowed, "{parent:?} {four:?}");
                }
            }
        }
    }
    assert!(compared > 100_000, "{compared}");
}

#[test]
fn a_photo_is_bilinear_at_its_own_level_and_opaque_to_its_edge() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, "ramp.tif");
    let samples: Vec<u8> = (0..200_u32 * 200).flat_map(|i| [(i % 200) as u8, (i / 200) as u8, 9]).collect();
    let placed = Placed { corner: (8.0, 46.0, PIXEL, PIXEL), epsg: 4326, nodata: None, point: false };
    write::<RGB8>(&path, 200, 200, &samples, &placed);
    let field = open_colour(&path, &SourceOptions::default()).unwrap();
    let grid = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: 8.0 - PIXEL,
        south: 46.0 - 201.0 * PIXEL,
        east: 8.0 + 201.0 * PIXEL,
        north: 46.0 + PIXEL,
        width: 202,
        height: 202,
    };
    let mut colours = vec![[0; 4]; grid.len()];
    field.sample(&grid, &mut colours).unwrap();
    for row in 0..202_usize {
        for column in 0..202_usize {
            let found = colours[row * 202 + column];
            if (1..201).contains(&row) && (1..201).contains(&column) {
                assert_eq!(found, [column as u8 - 1, row as u8 - 1, 9, 255]);
            } else {
                assert_eq!(found, [0; 4]);
            }
        }
    }
}

#[test]
fn a_picture_is_taken_for_nothing_that_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, "picture.tif");
    let placed = Placed { corner: (8.0, 46.0, PIXEL, PIXEL), epsg: 4326, nodata: None, point: false };
    write::<RGB8>(&path, 20, 20, &[9; 1200], &placed);
    let options = SourceOptions::default();
    let errors = [
        open_height(&path, &HeightOptions::default()).err().unwrap(),
        open_land_cover(&path, &options, &BTreeMap::new(), &NOTHING).err().unwrap(),
        open_canopy_height(&path, &options, Some(0.1), 0).err().unwrap(),
    ];
    for (error, word) in errors.iter().zip(["terrain model", "no classes", "no heights of a canopy"]) {
        assert!(error.to_string().contains(word), "{error}");
    }
}

#[test]
fn classes_are_never_blended() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, "classes.tif");
    let samples: Vec<u8> =
        (0..100_u32 * 100).map(|i| if (i % 100 / 3 + i / 300) % 2 == 0 { 10 } else { 200 }).collect();
    let placed = Placed { corner: (8.0, 46.0, 0.001, 0.001), epsg: 4326, nodata: Some("255"), point: false };
    write::<Gray8>(&path, 100, 100, &samples, &placed);
    let forest = Cover { species: 1, closure: 200, height: 0, surface: 0 };
    let rock = Cover { surface: 3, ..Cover::default() };
    let table = BTreeMap::from([(10, forest), (200, rock)]);
    let field = open_land_cover(&path, &SourceOptions::default(), &table, &NOTHING).unwrap();
    let window = LatticeWindow::of_tile(TileAddress::at(11, 8.05, 45.95), Registration::Cell, 0);
    let mut covers = vec![Cover::default(); window.len()];
    field.sample(&SampleGrid::Lattice(window), &mut covers).unwrap();
    for (index, cover) in covers.iter().enumerate() {
        let longitude = window.longitude(window.first_column + index as i64 % 512);
        let latitude = window.latitude(window.first_row + index as i64 / 512);
        let (column, row) = (((longitude - 8.0) / 0.001).floor(), ((46.0 - latitude) / 0.001).floor());
        let expected = if (0.0..100.0).contains(&column) && (0.0..100.0).contains(&row) {
            if (column as u32 / 3 + row as u32 / 3).is_multiple_of(2) { forest } else { rock }
        } else {
            Cover::default()
        };
        assert_eq!(*cover, expected, "{longitude} {latitude}");
    }
    let unknown = open_land_cover(&path, &SourceOptions::default(), &BTreeMap::new(), &NOTHING)
        .err()
        .unwrap()
        .to_string();
    assert!(unknown.contains("classes.tif") && unknown.contains("land_cover.classes"), "{unknown}");
}

#[test]
fn scale_offset_and_unit() {
    let folder = tempfile::tempdir().unwrap();
    let path = plane_file(&folder, false);
    let options =
        HeightOptions { vertical_scale: Some(2.0), vertical_offset: Some(-5.0), ..HeightOptions::default() };
    let (plain, scaled) =
        (open_height(&path, &HeightOptions::default()).unwrap(), open_height(&path, &options).unwrap());
    let (a, b) = (plain.range(), scaled.range());
    assert!((b.0 - (2.0 * a.0 - 5.0)).abs() < 1e-3 && (b.1 - (2.0 * a.1 - 5.0)).abs() < 1e-3);
}
