//! Every odd file that we have is opened, or refused with a mend.

use super::data;
use crate::source::growth::Growths;
use crate::source::raster_cover::LayeredCover;
use crate::source::{
    ColourField, Cover, CoverField, HeightField, HeightOptions, RequestCrs, SampleGrid, SourceOptions,
    open_canopy_height, open_colour, open_height, open_land_cover,
};
use std::collections::BTreeMap;
use std::path::Path;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::seeds::Species;
use treeline_core::tile::TileAddress;

/// Samples a field's whole extent coarsely.
fn overview_grid(extent: &crate::source::FieldExtent) -> SampleGrid {
    let bounds = extent.bounds;
    SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: bounds.west,
        south: bounds.south,
        east: bounds.east,
        north: bounds.north,
        width: 64,
        height: 64,
    }
}

/// What comes of a file as terrain: least and greatest of 64 × 64 samples and the share that has data, or
/// the error.
fn as_terrain(path: &Path, options: &HeightOptions) -> Result<(f32, f32, f32), String> {
    let field = open_height(path, options).map_err(|error| error.to_string())?;
    let grid = overview_grid(field.extent());
    let mut heights = vec![0.0; grid.len()];
    field.sample(&grid, &mut heights).map_err(|error| error.to_string())?;
    let valid: Vec<f32> = heights.iter().copied().filter(|height| !height.is_nan()).collect();
    let least = valid.iter().copied().fold(f32::NAN, f32::min);
    let greatest = valid.iter().copied().fold(f32::NAN, f32::max);
    let range = field.range();
    assert!(valid.is_empty() || range.0 <= least && range.1 >= greatest, "{range:?} {least} {greatest}");
    Ok((least, greatest, valid.len() as f32 / heights.len() as f32))
}

fn as_photo(path: &Path) -> Result<f32, String> {
    let field = open_colour(path, &SourceOptions::default()).map_err(|error| error.to_string())?;
    let grid = overview_grid(field.extent());
    let mut colours = vec![[0; 4]; grid.len()];
    field.sample(&grid, &mut colours).map_err(|error| error.to_string())?;
    Ok(colours.iter().map(|colour| f32::from(colour[3]) / 255.0).sum::<f32>() / colours.len() as f32)
}

fn given(crs: &str) -> HeightOptions {
    let source = SourceOptions { assume_crs: Some(crs.to_owned()), nodata: None };
    HeightOptions { source, ..HeightOptions::default() }
}

#[test]
fn terrain_that_opens() {
    // Name, least and greatest height in the whole file as GDAL finds them.
    let cases = [
        ("robust_crs_extent/antarctica_vestfold_polar_stereo.tif", 18.104, 332.607),
        ("robust_crs_extent/bigtujunga_utm11_tiled.tif", 315.0, 2295.0),
        ("robust_crs_extent/capehorn_negative.tif", -54.525, 2439.19),
        ("robust_crs_extent/columbia_custom_tmerc_negative.tif", -147.185, 3688.25),
        ("robust_crs_extent/lisbon_negative.tif", -6.829, 217.941),
        ("robust_crs_extent/nrw_dsm_1m_utm32.tif", 87.29, 167.74),
        ("robust_crs_extent/nz_antimeridian.tif", 1.0, 71.0),
        ("robust_crs_extent/oetztal_srtm.tif", 387.0, 3727.0),
        ("robust_crs_extent/oregon_nad83_f32.tif", 49.529, 1772.53),
        ("robust_crs_extent/rotated_geotransform.tif", 74.0, 255.0),
        ("robust_tiff_encodings/cog_f32_nodata.tif", 0.001, 29.848),
        ("robust_tiff_encodings/cog_int16_overviews.tif", 69.0, 201.0),
        ("robust_voids_nan/capetown_negative.tif", -28.0, 1077.0),
        ("robust_voids_nan/denali.tif", 597.0, 6129.0),
        ("robust_voids_nan/dtm_nan_no_nodata.tif", 0.0, 244.914),
        ("robust_voids_nan/exploradores_spikes.tif", 317.71, 3959.9),
        ("robust_voids_nan/geog_zero_fill.tif", 0.0, 3627.92),
        ("robust_voids_nan/hawaii_mauna_kea.tif", 0.0, 4205.0),
        ("robust_voids_nan/nz_1km_nan_sea.tif", 0.0, 4140.33),
        ("robust_voids_nan/some_nodata.tif", 1733.17, 3602.77),
        ("robust_voids_nan/swellendam_zero_border_nodata_fltmax.tif", 0.0, 1699.0),
        ("scene_hongkong/dem_aster30m_4326.tif", f32::NAN, f32::NAN),
        ("scene_jotunheimen_norway/dem_117m_utm32n.tif", f32::NAN, f32::NAN),
        ("scene_lolo_montana/dem_m.tif", f32::NAN, f32::NAN),
        ("scene_slovenia_eopatch/dem.tif", f32::NAN, f32::NAN),
    ];
    for (name, least, greatest) in cases {
        let Some(path) = data::find(name) else { return };
        let found = as_terrain(&path, &HeightOptions::default());
        let (low, high, share) = found.unwrap_or_else(|error| panic!("{error}"));
        assert!(share > 0.03, "{name}: {share}");
        let range = open_height(&path, &HeightOptions::default()).unwrap().range();
        if !least.is_nan() {
            // GDAL's figures are rounded to six digits.
            assert!(
                (range.0 - least).abs() <= 0.006 && (range.1 - greatest).abs() <= 0.6,
                "{name}: {range:?}"
            );
            assert!(low >= range.0 && high <= range.1, "{name}");
        }
    }
}

#[test]
fn the_same_terrain_in_every_encoding() {
    let Some(folder) = data::find("robust_dem_encoding_matrix") else { return };
    let reference = open_height(&folder.join("ref_int16_none_strip.tif"), &HeightOptions::default()).unwrap();
    let window = LatticeWindow::of_tile(
        TileAddress::at(12, reference.extent().bounds.centre().0, reference.extent().bounds.centre().1),
        Registration::Node,
        1,
    );
    let sample = |field: &dyn HeightField| {
        let mut heights = vec![0.0_f32; window.len()];
        field.sample(&SampleGrid::Lattice(window), &mut heights).unwrap();
        heights
    };
    let expected = sample(&*reference);
    for name in [
        "float32_deflate_p3_tile32",
        "float32_lzw_p3_strip",
        "float32_packbits",
        "float32_scale10",
        "float32_zstd_p2_strip",
        "float64_zstd_p3_tile256",
        "int16_bigendian",
        "int16_bigtiff_deflate",
        "int16_cog_ovr",
        "int16_tile16",
        "int32_deflate_p2_tile64",
        "uint16_lzw_p2_strip",
    ] {
        let field = open_height(&folder.join(format!("{name}.tif")), &HeightOptions::default()).unwrap();
        let found = sample(&*field);
        for (a, b) in expected.iter().zip(&found) {
            let same = a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
            // Heights divided by ten and multiplied again are off by a rounding.
            assert!(same || name == "float32_scale10" && (a - b).abs() < 1e-3, "{name}: {a} {b}");
        }
    }
}

#[test]
fn what_is_refused_says_what_mends_it() {
    let cases = [
        ("robust_crs_extent/europa_moon_crs.tif", "Earth"),
        ("robust_crs_extent/gcps_only.tif", "gdalwarp"),
        ("robust_crs_extent/zurich_lv03_no_crs.tif", "--assume-crs EPSG:N"),
        ("robust_crs_extent/pa_landcover_1m_palette_cog.tif", "--photo"),
        ("robust_crs_extent/santabarbara.asc", "gdal_translate"),
        ("robust_crs_extent/santabarbara.dt0", "gdal_translate"),
        ("robust_crs_extent/santabarbara_usgs.dem", "gdal_translate"),
        ("robust_dem_encoding_matrix/EMPTY.tif", "empty"),
        ("robust_dem_encoding_matrix/TRUNCATED_header.tif", "fetch it again"),
        ("robust_dem_encoding_matrix/TRUNCATED_int16.tif", "fetch it again"),
        ("robust_dem_encoding_matrix/float32_lerc_lossless.tif", "COMPRESS=DEFLATE"),
        ("robust_tiff_encodings/truncated_jpeg_tile.tif", "fetch it again"),
        ("robust_tiff_encodings/float16.tif", "-a_ullr"),
        ("robust_tiff_encodings/u16_no_georeference.tif", "-a_ullr"),
        ("robust_tiff_encodings/planar_rgb.tif", "-a_ullr"),
        ("robust_voids_nan/N44E005.hgt", "gdal_translate"),
        ("robust_voids_nan/gredos_ed50_25m.tif", "gdalwarp -t_srs EPSG:4326"),
        ("scene_hongkong/HongKong_RGB.jpg", "gdal_translate"),
    ];
    for (name, mend) in cases {
        let Some(path) = data::find(name) else { return };
        let error = as_terrain(&path, &HeightOptions::default()).unwrap_err();
        assert!(error.starts_with(&path.display().to_string()) && error.contains(mend), "{error}");
        assert!(!error.contains('\n'), "{error}");
    }
}

#[test]
fn a_given_crs_rescues() {
    let Some(zurich) = data::find("robust_crs_extent/zurich_lv03_no_crs.tif") else { return };
    let field = open_height(&zurich, &given("EPSG:21781")).unwrap();
    assert!(field.extent().bounds.contains(8.54, 47.38), "{:?}", field.extent().bounds);
    let wrong = open_height(&zurich, &given("EPSG:4326")).err().unwrap().to_string();
    assert!(wrong.contains("--assume-crs"), "{wrong}");
    let corrupt = data::find("robust_voids_nan/sba_dem_corrupt_geokeys.tif").unwrap();
    assert!(open_height(&corrupt, &given("EPSG:4326")).unwrap().extent().bounds.contains(-119.83, 34.44));
}

#[test]
fn the_antimeridian_and_the_pole_keep_their_boxes() {
    let Some(path) = data::find("robust_voids_nan/nz_1km_nan_sea.tif") else { return };
    let bounds = open_height(&path, &HeightOptions::default()).unwrap().extent().bounds;
    assert!(bounds.west > 160.0 && bounds.east < 185.0, "{bounds:?}");
    let path = data::find("robust_crs_extent/antarctica_vestfold_polar_stereo.tif").unwrap();
    let bounds = open_height(&path, &HeightOptions::default()).unwrap().extent().bounds;
    assert!(bounds.contains(78.0, -68.6) && bounds.east - bounds.west < 2.0, "{bounds:?}");
}

#[test]
fn photos_that_open() {
    // Name, and the share of the picture that there is, out of its geographic box.
    let cases = [
        ("scene_hongkong/ortho_landsat8_4326.tif", 0.99..1.01),
        ("scene_hongkong/ortho_utm50n_15m.tif", 0.85..1.0),
        ("scene_jotunheimen_norway/topomap_texture_15m_utm32n.tif", 0.85..1.0),
        ("robust_tiff_encodings/cogeo_jpeg_ycbcr.tif", 0.99..1.01),
        ("robust_tiff_encodings/jpeg_with_alpha_3857.tif", 0.005..0.03),
        ("robust_tiff_encodings/rgb_deflate_utm18.tif", 0.5..0.8),
        ("robust_tiff_encodings/all_nodata_u16_predictor2.tif", -0.01..0.001),
        ("robust_crs_extent/pa_landcover_1m_palette_cog.tif", 0.4..0.7),
        ("robust_voids_nan/sba_ortho_same_area.tif", 0.99..1.01),
    ];
    for (name, share) in cases {
        let Some(path) = data::find(name) else { return };
        let found = as_photo(&path).unwrap_or_else(|error| panic!("{error}"));
        assert!(share.contains(&found), "{name}: {found}");
    }
}

#[test]
fn alpha_mask_and_mask_beside_hide_what_they_should() {
    let Some(plain) = data::find("robust_tiff_encodings/colorado_ortho_15cm_alpha.tif") else { return };
    let sample = |path: &Path| {
        let field = open_colour(path, &SourceOptions::default()).unwrap();
        let grid = overview_grid(field.extent());
        let mut colours = vec![[0; 4]; grid.len()];
        field.sample(&grid, &mut colours).unwrap();
        colours
    };
    let hidden = |colours: &[[u8; 4]]| {
        assert!(colours.iter().all(|colour| colour[3] > 0 || *colour == [0; 4]));
        colours.iter().filter(|colour| colour[3] == 0).count() as f32 / colours.len() as f32
    };
    // Shares of the raster that the file itself hides: 11.3 % by alpha, 3.1 % by mask.
    let by_alpha = hidden(&sample(&plain));
    assert!((0.08..0.16).contains(&by_alpha), "{by_alpha}");
    let by_mask = sample(&plain.with_file_name("colorado_ortho_15cm_mask.tif"));
    assert!((0.015..0.06).contains(&hidden(&by_mask)), "{}", hidden(&by_mask));
    let beside = sample(&plain.with_file_name("colorado_ortho_15cm_extmask.tif"));
    // The two pictures are different JPEGs of one photo; what they hide is the same.
    assert!(by_mask.iter().zip(&beside).all(|(a, b)| a[3] == b[3]));
}

#[test]
fn land_cover_is_recognised() {
    let Some(path) = data::find("scene_lolo_montana/fuel_fbfm40.tif") else { return };
    let growth = Growths::new(&Species::built_in()).rules();
    let cover = open_land_cover(&path, &SourceOptions::default(), &BTreeMap::new(), &growth).unwrap();
    assert_eq!(cover.table_name(), "LANDFIRE FBFM40");
    let canopy = data::find("scene_lolo_montana/canopy_height_dm.tif").unwrap();
    let error = open_canopy_height(&canopy, &SourceOptions::default(), None, growth.conifer)
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("scale = 0.1"), "{error}");
    let canopy = open_canopy_height(&canopy, &SourceOptions::default(), Some(0.1), growth.conifer).unwrap();
    let layered = LayeredCover::new(cover, canopy);
    let grid = overview_grid(layered.extent());
    let mut covers = vec![Cover::default(); grid.len()];
    layered.sample(&grid, &mut covers).unwrap();
    let forest = covers.iter().filter(|cover| cover.species > 0 && cover.height > 20).count();
    assert!(forest * 4 > covers.len(), "{forest} of {}", covers.len());
}
