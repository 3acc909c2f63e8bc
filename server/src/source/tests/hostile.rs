//! Damaged and hostile files: an error or a result, never a panic, a hang or memory without end.

use crate::source::raster_height::RasterHeight;
use crate::source::{
    ColourField, HeightField, HeightOptions, RequestCrs, SampleGrid, SourceOptions, open_colour, open_height,
};
use proptest::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// A small strip GeoTIFF, 16 × 16 of Int16, made by hand, byte by byte.
fn tiny() -> Vec<u8> {
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    let mut data: Vec<u8> = Vec::new();
    let entries: Vec<(u16, u16, Vec<u8>)> = {
        let short = |value: u16| value.to_le_bytes().to_vec();
        let long = |value: u32| value.to_le_bytes().to_vec();
        let doubles =
            |values: &[f64]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
        vec![
            (256, 3, short(16)),
            (257, 3, short(16)),
            (258, 3, short(16)),
            (259, 3, short(1)),
            (262, 3, short(1)),
            (273, 4, long(0)),
            (277, 3, short(1)),
            (278, 3, short(16)),
            (279, 4, long(512)),
            (339, 3, short(2)),
            (33550, 12, doubles(&[0.01, 0.01, 0.0])),
            (33922, 12, doubles(&[0.0, 0.0, 0.0, 8.0, 46.0, 0.0])),
            (
                34735,
                3,
                [1_u16, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4326]
                    .iter()
                    .flat_map(|v| v.to_le_bytes())
                    .collect(),
            ),
        ]
    };
    let data_start = 8 + 2 + 12 * entries.len() + 4;
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, value) in &entries {
        let size = match kind {
            3 => 2,
            4 => 4,
            _ => 8,
        };
        bytes.extend(tag.to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(((value.len() / size) as u32).to_le_bytes());
        if value.len() <= 4 {
            let mut inline = value.clone();
            inline.resize(4, 0);
            bytes.extend(inline);
        } else {
            bytes.extend(((data_start + data.len()) as u32).to_le_bytes());
            data.extend(value);
        }
    }
    bytes.extend([0; 4]);
    let strip = (data_start + data.len()) as u32;
    bytes.extend(data);
    let offset_entry = 10 + 5 * 12 + 8;
    bytes[offset_entry..offset_entry + 4].copy_from_slice(&strip.to_le_bytes());
    bytes.extend((0..256_i16).flat_map(|value| value.to_le_bytes()));
    bytes
}

/// Sets a value of the tiny file: the entry's place among its thirteen, and the number.
fn set(bytes: &mut [u8], entry: usize, value: u32) {
    let at = 10 + 12 * entry;
    bytes[at + 2..at + 4].copy_from_slice(&4_u16.to_le_bytes());
    bytes[at + 8..at + 12].copy_from_slice(&value.to_le_bytes());
}

const WIDTH: usize = 0;
const HEIGHT: usize = 1;
const COMPRESSION: usize = 3;
const STRIP_OFFSET: usize = 5;
const ROWS_PER_STRIP: usize = 7;
const STRIP_COUNT: usize = 8;

/// The tiny file with other values, opened as terrain.
fn altered(values: &[(usize, u32)], nodata: Option<f64>) -> Result<Arc<RasterHeight>, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("altered.tif");
    let mut bytes = tiny();
    for &(entry, value) in values {
        set(&mut bytes, entry, value);
    }
    std::fs::write(&path, bytes).unwrap();
    let source = SourceOptions { assume_crs: None, nodata };
    open_height(&path, &HeightOptions { source, ..HeightOptions::default() })
        .map_err(|error| error.to_string())
}

fn try_everything(path: &Path) {
    let grid = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: 7.9,
        south: 45.8,
        east: 8.2,
        north: 46.1,
        width: 20,
        height: 20,
    };
    if let Ok(field) = open_height(path, &HeightOptions::default()) {
        let _ = field.sample(&grid, &mut vec![0.0; grid.len()]);
        if field.raster().size().0 < 5000 && field.raster().size().1 < 5000 {
            let _ = field.range();
            let _ = field.maxima(&field.extent().bounds, 3, 3);
        }
        let _ = field.describe().to_string();
    }
    if let Ok(field) = open_colour(path, &SourceOptions::default()) {
        let _ = field.sample(&grid, &mut vec![[0; 4]; grid.len()]);
    }
}

#[test]
fn the_tiny_file_is_good() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tiny.tif");
    std::fs::write(&path, tiny()).unwrap();
    let field = open_height(&path, &HeightOptions::default()).unwrap();
    assert_eq!(field.range(), (0.0, 255.0));
}

#[test]
fn directories_in_a_circle_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("circle.tif");
    let mut bytes = tiny();
    let link = 10 + 13 * 12;
    bytes[link..link + 4].copy_from_slice(&8_u32.to_le_bytes());
    std::fs::write(&path, bytes).unwrap();
    assert!(open_height(&path, &HeightOptions::default()).is_ok());
}

#[test]
fn giants_of_a_few_bytes_are_refused_at_once() {
    let giant = [(WIDTH, 1 << 20), (HEIGHT, 0x7fff_ffff), (ROWS_PER_STRIP, 0x7fff_ffff)];
    let sparse = [(STRIP_OFFSET, 0), (STRIP_COUNT, 0)];
    let error = altered(&[&giant[..], &sparse[..]].concat(), None).err().unwrap();
    assert!(error.contains("longer than any real image"), "{error}");
    let error = altered(&giant, None).err().unwrap();
    assert!(error.contains("beyond its end"), "{error}");
    let error = altered(&[&giant[..], &[(COMPRESSION, 8)]].concat(), None).err().unwrap();
    assert!(error.contains("MiB") && error.contains("TILED=YES"), "{error}");
}

#[test]
fn strips_that_were_never_written_are_zeros_or_nodata() {
    let sparse = [(STRIP_OFFSET, 0), (STRIP_COUNT, 0)];
    let grid = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: 8.0,
        south: 45.84,
        east: 8.16,
        north: 46.0,
        width: 16,
        height: 16,
    };
    for (nodata, expected) in [(None, 0.0), (Some(-1.0), f32::NAN)] {
        let field = altered(&sparse, nodata).unwrap();
        let mut heights = vec![5.0; grid.len()];
        field.sample(&grid, &mut heights).unwrap();
        assert!(heights.iter().all(|height| height.to_bits() == f32::to_bits(expected)), "{heights:?}");
    }
}

#[test]
fn a_length_that_is_too_short_is_made_right() {
    assert_eq!(altered(&[(STRIP_COUNT, 100)], None).unwrap().range(), (0.0, 255.0));
}

#[test]
fn a_photo_of_which_nothing_can_be_decoded_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("photo.tif");
    let mut bytes = tiny();
    set(&mut bytes, COMPRESSION, 8);
    std::fs::write(&path, bytes).unwrap();
    let error = open_colour(&path, &SourceOptions::default()).err().unwrap().to_string();
    assert!(error.contains("cannot be decoded") && error.contains("fetch it again"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn a_changed_byte_or_a_cut(
        changes in proptest::collection::vec((0_usize..350, any::<u8>()), 1..5),
        cut in proptest::option::of(0_usize..900),
    ) {
        let mut bytes = tiny();
        for (at, value) in changes {
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.min(bytes.len()));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("changed.tif");
        std::fs::write(&path, bytes).unwrap();
        try_everything(&path);
    }
}

#[test]
fn what_is_no_geotiff_is_told_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let cases: [(&str, &[u8], &str); 7] = [
        ("empty.tif", b"", "fetch it again"),
        ("short.tif", b"II*\0", "fetch it again"),
        ("heights.hgt", &[0; 100], "gdal_translate"),
        ("grid.asc", b"ncols 3\nnrows 3\n", "gdal_translate"),
        ("picture.png", b"\x89PNG\r\n\x1a\n0000000000000000", "-a_ullr"),
        ("archive.tif", b"PK\x03\x04000000000000000000", "unpack"),
        ("text.tif", b"this is no raster at all, it is text", "GDAL"),
    ];
    for (name, bytes, mend) in cases {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let error = open_height(&path, &HeightOptions::default()).err().unwrap().to_string();
        assert!(error.contains(name) && error.contains(mend) && !error.contains('\n'), "{error}");
    }
    let missing =
        open_height(&folder.path().join("missing.tif"), &HeightOptions::default()).err().unwrap().to_string();
    assert!(missing.contains("no such file"), "{missing}");
    let wrong = SourceOptions { assume_crs: Some("32632".to_owned()), nodata: None };
    let path = folder.path().join("tiny.tif");
    std::fs::write(&path, tiny()).unwrap();
    let error =
        open_height(&path, &HeightOptions { source: wrong, ..HeightOptions::default() }).err().unwrap();
    assert!(error.to_string().contains("EPSG:32632"), "{error}");
}
