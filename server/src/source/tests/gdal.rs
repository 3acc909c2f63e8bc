//! GDAL as the judge: heights and photos against `gdalwarp -r bilinear` with exact transforms. Skipped, with
//! a word, where there is no python3 with GDAL or there are no data.

use super::data;
use crate::source::{
    ColourField, HeightField, HeightOptions, RequestCrs, SampleGrid, SourceOptions, open_colour, open_height,
};
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::tile::{self, TileAddress};

/// Warps a file to a geographic grid, compares it with the raw samples of ours, and prints numbers.
const JUDGE: &str = r#"
import sys
import numpy as np
from osgeo import gdal
gdal.UseExceptions()
kind, path, ours, west, south, east, north, width, height = sys.argv[1:10]
width, height = int(width), int(height)
bounds = [float(v) for v in (west, south, east, north)]
options = dict(format='MEM', dstSRS='EPSG:4326', outputBounds=bounds, width=width, height=height,
               resampleAlg='bilinear', errorThreshold=0, warpOptions=['XSCALE=1', 'YSCALE=1'])
if kind == 'height':
    # The plain kernel of two by two pixels, also where GDAL would take a wider one.
    warped = gdal.Warp('', path, dstNodata=-1e30, outputType=gdal.GDT_Float32, **options)
    theirs = warped.GetRasterBand(1).ReadAsArray().astype(float)
    found = np.fromfile(ours, '<f4').reshape(height, width).astype(float)
    # Beside a void GDAL blends what is left of the neighbours, and we have none: compare where all are data.
    source = gdal.Open(path)
    band = source.GetRasterBand(1)
    stored = band.ReadAsArray()
    valid = (band.GetMaskBand().ReadAsArray() > 0) & ~np.isnan(stored)
    flags = gdal.GetDriverByName('MEM').Create('', source.RasterXSize, source.RasterYSize, 1, gdal.GDT_Float32)
    flags.SetProjection(source.GetProjection())
    flags.SetGeoTransform(source.GetGeoTransform())
    flags.GetRasterBand(1).WriteArray(np.where(valid, 100.0, 0.0))
    flags = gdal.Warp('', flags, dstNodata=-1e30, **options)
    sure = flags.GetRasterBand(1).ReadAsArray() > 99.99
    both = sure & (theirs > -1e29) & ~np.isnan(found)
    # A grid round the Earth joins for us and not for GDAL: leave out the half pixels at its ends.
    west_edge, step = source.GetGeoTransform()[0], source.GetGeoTransform()[1]
    if abs(source.RasterXSize * step - 360) < step:
        longitude = bounds[0] + (np.arange(width) + 0.5) * (bounds[2] - bounds[0]) / width
        sure[:, (longitude < west_edge + step / 2) | (longitude > west_edge + 360 - step / 2)] = False
        both &= sure
    either = sure
    error = np.abs(theirs - found)[both]
    print(both.sum(), np.median(error), np.quantile(error, 0.99), error.max(), 1 - both.sum() / max(either.sum(), 1))
else:
    warped = gdal.Warp('', path, dstAlpha=True, **options)
    theirs = np.moveaxis(warped.ReadAsArray(), 0, -1).astype(float)
    found = np.fromfile(ours, 'u1').reshape(height, width, 4).astype(float)
    both = (theirs[..., -1] == 255) & (found[..., 3] == 255)
    both[[0, -1], :] = False
    both[:, [0, -1]] = False
    grey, own = theirs[..., :3].mean(-1), found[..., :3].mean(-1)
    gy, gx = np.gradient(grey)
    a = np.stack([gx[both], gy[both]], 1)
    shift = np.linalg.lstsq(a, (own - grey)[both], rcond=None)[0]
    print(both.sum(), np.abs(theirs[..., :3] - found[..., :3])[both].mean(), abs(shift[0]), abs(shift[1]), 0)
"#;

fn python() -> Option<&'static str> {
    static PYTHON: OnceLock<Option<&'static str>> = OnceLock::new();
    *PYTHON.get_or_init(|| {
        let works = |name: &&str| {
            let probe = Command::new(name).args(["-c", "import numpy; from osgeo import gdal"]).output();
            probe.is_ok_and(|output| output.status.success())
        };
        let found = ["python3", "/usr/bin/python3"].into_iter().find(works);
        if found.is_none() {
            println!("skipped: no python3 with numpy and GDAL");
        }
        found
    })
}

/// The judge's five numbers on a file and our samples of a window.
fn judge(kind: &str, path: &Path, window: &LatticeWindow, samples: &[u8]) -> [f64; 5] {
    let folder = tempfile::tempdir().unwrap();
    let ours = folder.path().join("samples");
    std::fs::write(&ours, samples).unwrap();
    let bounds = window.pixel_box();
    let numbers = [bounds.west, bounds.south, bounds.east, bounds.north].map(|number| format!("{number}"));
    let output = Command::new(python().unwrap())
        .args(["-c", JUDGE, kind])
        .arg(path)
        .arg(&ours)
        .args(numbers)
        .args([window.width.to_string(), window.height.to_string()])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();
    numbers.try_into().unwrap()
}

fn window_at(longitude: f64, latitude: f64, level: u8) -> LatticeWindow {
    LatticeWindow::of_tile(TileAddress::at(level, longitude, latitude), Registration::Cell, 0)
}

#[test]
fn heights_agree_with_gdal() {
    // Places as (east, north) shares of the extent.
    let cases = [
        ("scene_hongkong/dem_aster30m_4326.tif", None, (0.5, 0.5)),
        ("scene_hongkong/dem_utm50n_30m.tif", None, (0.3, 0.6)),
        ("scene_lolo_montana/dem_m.tif", None, (0.5, 0.5)),
        ("scene_jotunheimen_norway/dem_117m_utm32n.tif", None, (0.5, 0.5)),
        ("robust_crs_extent/nz_antimeridian.tif", None, (0.99, 0.6)),
        ("robust_crs_extent/nz_antimeridian.tif", None, (0.01, 0.6)),
        ("robust_crs_extent/antarctica_vestfold_polar_stereo.tif", None, (0.5, 0.5)),
        ("robust_crs_extent/columbia_custom_tmerc_negative.tif", None, (0.5, 0.5)),
        ("robust_crs_extent/rotated_geotransform.tif", None, (0.5, 0.5)),
        ("robust_crs_extent/oregon_nad83_f32.tif", None, (0.5, 0.5)),
        ("robust_crs_extent/zurich_lv03_no_crs.tif", Some("EPSG:21781"), (0.5, 0.5)),
        ("robust_crs_extent/nrw_dsm_1m_utm32.tif", None, (0.5, 0.5)),
        ("robust_crs_extent/bigtujunga_utm11_tiled.tif", None, (0.5, 0.5)),
        ("robust_voids_nan/nz_1km_nan_sea.tif", None, (0.5, 0.5)),
        ("robust_voids_nan/some_nodata.tif", None, (0.5, 0.5)),
        ("robust_voids_nan/denali.tif", None, (0.5, 0.5)),
    ];
    for (name, crs, (east, north)) in cases {
        let (Some(path), Some(_)) = (data::find(name), python()) else { return };
        let source = SourceOptions { assume_crs: crs.map(str::to_owned), nodata: None };
        let field = open_height(&path, &HeightOptions { source, ..HeightOptions::default() }).unwrap();
        let extent = field.extent();
        let level = tile::level_for_cell_metres(extent.resolution_metres);
        let bounds = extent.bounds;
        let longitude = bounds.west + east * (bounds.east - bounds.west);
        let latitude = bounds.south + north * (bounds.north - bounds.south);
        let window = window_at(longitude, latitude, level);
        let mut heights = vec![0.0_f32; window.len()];
        field.sample(&SampleGrid::Lattice(window), &mut heights).unwrap();
        let bytes: Vec<u8> = heights.iter().flat_map(|height| height.to_le_bytes()).collect();
        let placed;
        let judged = match crs {
            Some(crs) => {
                let folder = tempfile::tempdir().unwrap();
                let copy = folder.path().join("placed.vrt");
                let status = Command::new("gdal_translate")
                    .args(["-q", "-of", "VRT", "-a_srs", crs])
                    .arg(&path)
                    .arg(&copy)
                    .status();
                if !status.is_ok_and(|status| status.success()) {
                    println!("skipped: no gdal_translate");
                    continue;
                }
                placed = (folder, copy);
                placed.1.as_path()
            }
            None => path.as_path(),
        };
        let [count, median, p99, most, apart] = judge("height", judged, &window, &bytes);
        println!(
            "{name} level {level}: {count} samples, median {median:.4} m, 99 % {p99:.4} m, most {most:.3} m; {:.2} % missed",
            100.0 * apart
        );
        assert!(count > 200.0, "{name}: {count}");
        assert!(median <= 0.05 && p99 <= 0.3, "{name}: median {median}, 99 % {p99}");
        assert!(apart < 0.005, "{name}: {apart}");
    }
}

#[test]
fn photos_agree_with_gdal() {
    let cases = [
        "scene_hongkong/ortho_landsat8_4326.tif",
        "scene_hongkong/ortho_utm50n_15m.tif",
        "scene_jotunheimen_norway/topomap_texture_15m_utm32n.tif",
        "robust_tiff_encodings/cogeo_jpeg_ycbcr.tif",
        "robust_tiff_encodings/colorado_ortho_15cm_alpha.tif",
        "robust_tiff_encodings/rgb_deflate_utm18.tif",
    ];
    for name in cases {
        let (Some(path), Some(_)) = (data::find(name), python()) else { return };
        let field = open_colour(&path, &SourceOptions::default()).unwrap();
        let extent = field.extent();
        let level = tile::level_for_cell_metres(extent.resolution_metres);
        let (longitude, latitude) = extent.bounds.centre();
        let window = window_at(longitude, latitude, level);
        let mut colours = vec![[0; 4]; window.len()];
        field.sample(&SampleGrid::Lattice(window), &mut colours).unwrap();
        let [count, error, dx, dy, _] = judge("photo", &path, &window, colours.as_flattened());
        println!(
            "{name} level {level}: {count} samples, mean difference {error:.3}, shift {dx:.4} × {dy:.4} samples"
        );
        assert!(count > 1000.0 && error < 1.5 && dx < 0.1 && dy < 0.1, "{name}: {count} {error} {dx} {dy}");
    }
}

/// Prints nothing, writes what GDAL reads: the first band as Float32, or red, green and blue as bytes.
const READER: &str = r#"
import sys
import numpy as np
from osgeo import gdal
gdal.UseExceptions()
kind, path, out = sys.argv[1:4]
source = gdal.Open(path)
if kind == 'height':
    source.GetRasterBand(1).ReadAsArray().astype('<f4').tofile(out)
else:
    if source.GetRasterBand(1).GetColorTable():
        source = gdal.Translate('', path, format='MEM', rgbExpand='rgb')
    bands = [source.GetRasterBand(min(i, source.RasterCount)).ReadAsArray() for i in (1, 2, 3)]
    np.stack(bands, -1).astype('u1').tofile(out)
print(source.RasterXSize, source.RasterYSize)
"#;

/// Files without a georeference get one by a world file beside a copy: a pixel is a metre.
#[test]
fn odd_encodings_read_as_gdal_reads_them() {
    let cases = [
        ("height", "float16.tif", 0.0),
        ("height", "int16_negative.tif", 0.0),
        ("height", "int16_zstd.tif", 0.0),
        ("height", "predictor3_f32_lzw.tif", 0.0),
        ("height", "u16_no_georeference.tif", 0.0),
        ("photo", "bigtiff_be.tif", 0.0),
        ("photo", "bigtiff_le.tif", 0.0),
        ("photo", "jpeg_tiles.tif", 6.0),
        ("photo", "no_rows_per_strip.tif", 0.0),
        // GDAL divides a palette's 16 bits by 257, we take the upper 8: right for writers of either habit.
        ("photo", "palette_4bit.tif", 1.0),
        ("photo", "planar_rgb.tif", 0.0),
    ];
    for (kind, name, allowed) in cases {
        let (Some(original), Some(python)) = (data::find("robust_tiff_encodings"), python()) else { return };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::copy(original.join(name), &path).unwrap();
        std::fs::write(path.with_extension("tfw"), "1\n0\n0\n-1\n500000.5\n5999999.5\n").unwrap();
        let out = folder.path().join("out");
        let output = Command::new(python).args(["-c", READER, kind]).arg(&path).arg(&out).output().unwrap();
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).unwrap();
        let size: Vec<u32> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();
        let (width, height) = (size[0], size[1]);
        let theirs = std::fs::read(&out).unwrap();
        let grid = SampleGrid::Box {
            crs: RequestCrs::Projected(32632),
            west: 500_000.0,
            south: 6_000_000.0 - f64::from(height),
            east: 500_000.0 + f64::from(width),
            north: 6_000_000.0,
            width,
            height,
        };
        let source = SourceOptions { assume_crs: Some("EPSG:32632".to_owned()), nodata: None };
        let mut most = 0.0_f32;
        if kind == "height" {
            let field = open_height(&path, &HeightOptions { source, ..HeightOptions::default() }).unwrap();
            let mut heights = vec![0.0; grid.len()];
            field.sample(&grid, &mut heights).unwrap();
            for (found, stored) in heights.iter().zip(theirs.chunks_exact(4)) {
                let stored = f32::from_le_bytes(stored.try_into().unwrap());
                most = most.max(if found.is_nan() { f32::INFINITY } else { (found - stored).abs() });
            }
        } else {
            let field = open_colour(&path, &source).unwrap();
            let mut colours = vec![[0; 4]; grid.len()];
            field.sample(&grid, &mut colours).unwrap();
            for (found, stored) in colours.iter().zip(theirs.chunks_exact(3)) {
                assert_eq!(found[3], 255, "{name}");
                for channel in 0..3 {
                    most = most.max(f32::from(found[channel].abs_diff(stored[channel])));
                }
            }
        }
        assert!(most <= allowed, "{name}: off by {most}");
    }
}
