//! GeoTIFF files: opened once, checked, then read by windows from any number of threads.

pub mod bytes;
pub mod cache;
pub mod chunk;
pub mod colour;
pub mod directory;
pub mod geokeys;
pub mod georeference;
pub mod image;
pub mod layout;
pub mod metadata;

use crate::source::crs::{Crs, CrsError};
use crate::source::{SourceError, upstream};
use bytes::FileBytes;
use geokeys::{GeoKeys, Stated};
use georeference::Affine;
use image::{Image, SourceFile};
use layout::{Layout, Refusal};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Mend for a file that does not say its reference system in words that can be used.
const SAY_CRS: &str = "gdal_edit.py -a_srs EPSG:N FILE, or say crs = \"EPSG:N\" for it in scene.toml (for --dem also: --assume-crs EPSG:N)";

/// Chunks of an image that are tried when a person asks whether a file is sound.
const VERIFIED_CHUNKS: u32 = 256;
/// Chunks that are tried when a file is opened.
const GLANCED_CHUNKS: u32 = 3;

/// An open GeoTIFF.
#[derive(Debug)]
pub struct Raster {
    /// The file as the user named it.
    pub path: String,
    /// The image, then its overviews, each smaller than the one before.
    pub images: Vec<Image>,
    /// From pixel coordinates to the reference system's.
    pub affine: Affine,
    /// Reference system.
    pub crs: Crs,
    /// Nodata that the file declares.
    pub nodata: Option<f64>,
    /// Scale and offset of the first band.
    pub scale_and_offset: (f64, f64),
    /// Metres in the unit of the heights.
    pub vertical_unit_metres: Option<f64>,
    /// Whether it is a BigTIFF.
    pub big_tiff: bool,
}

impl Raster {
    /// Opens a file; `assume_crs` (`EPSG:N`) stands in for, or overrides, what the file says.
    ///
    /// # Errors
    /// One line that names the file, what is wrong, and the mend.
    pub fn open(path: &Path, assume_crs: Option<&str>) -> Result<Self, SourceError> {
        open(path, assume_crs).map_err(|refusal| unusable(path, refusal))
    }

    /// The full image.
    pub fn full(&self) -> &Image {
        &self.images[0]
    }

    /// Columns and rows of the full image.
    pub fn size(&self) -> (u32, u32) {
        (self.full().layout.width, self.full().layout.height)
    }

    /// Tries some chunks of every image.
    ///
    /// # Errors
    /// The first that cannot be decoded.
    pub fn verify(&self) -> Result<(), SourceError> {
        let problem = self.images.iter().find_map(|image| image.try_chunks(VERIFIED_CHUNKS).1);
        problem.map_or(Ok(()), |problem| Err(self.read_error(problem)))
    }

    /// Tries a few chunks of the full image.
    ///
    /// # Errors
    /// Where none of them can be decoded: nothing will ever be seen of it.
    pub fn verify_anything(&self) -> Result<(), SourceError> {
        match self.full().try_chunks(GLANCED_CHUNKS) {
            (0, Some(problem)) => Err(self.read_error(problem)),
            _ => Ok(()),
        }
    }

    /// An error for people, from what a read says.
    pub fn read_error(&self, problem: String) -> SourceError {
        if upstream::is_address(Path::new(&self.path)) {
            return SourceError::Upstream { address: self.path.clone(), problem };
        }
        SourceError::Read { path: self.path.clone(), problem }
    }

    /// A refusal for people.
    pub fn unusable(&self, problem: &str, mend: &str) -> SourceError {
        unusable(Path::new(&self.path), Refusal::new(problem, mend))
    }
}

fn unusable(path: &Path, refusal: Refusal) -> SourceError {
    let shown = path.display().to_string();
    let quoted = if shown.contains(char::is_whitespace) { format!("'{shown}'") } else { shown.clone() };
    SourceError::Unusable {
        path: shown,
        problem: refusal.problem,
        mend: refusal.mend.replace("FILE", &quoted),
    }
}

fn open(path: &Path, assume_crs: Option<&str>) -> Result<Raster, Refusal> {
    let bytes = FileBytes::open(path).map_err(|error| {
        let problem = match error.kind() {
            std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
            std::io::ErrorKind::PermissionDenied => "it may not be read".to_owned(),
            _ => error.to_string(),
        };
        let mend = if upstream::is_address(path) {
            "check the address, and whether the server is up"
        } else {
            "check the path and its permissions"
        };
        Refusal::new(problem, mend)
    })?;
    check_format(path, &bytes)?;
    let skeleton = directory::read(&bytes)
        .map_err(|problem| Refusal::new(problem, "it is damaged or was not copied whole: fetch it again"))?;
    let main = skeleton
        .directories
        .iter()
        .position(|directory| {
            directory.unsigned_value(&bytes, directory::tag::NEW_SUBFILE_TYPE).unwrap_or(0) & 5 == 0
        })
        .unwrap_or(0);
    let first = &skeleton.directories[main];
    let layout = Layout::read(&bytes, first)?;
    let keys = GeoKeys::read(&bytes, first);
    let affine = georeference::read(path, &bytes, first, &keys)?;
    let crs = system(&keys, assume_crs)?;
    let aside = metadata::Beside::read(path);
    let nodata = metadata::nodata(&bytes, first).or(aside.nodata);
    let scale_and_offset = metadata::scale_and_offset(&bytes, first, 0, &aside);
    let layouts = layouts_of(&bytes, &skeleton, main);
    let file = Arc::new(SourceFile::new(bytes, skeleton.big_endian));
    let mut others = images_of(&file, layouts);
    let mut image = Image::new(Arc::clone(&file), main as u32, layout);
    others.extend(beside(path, "ovr"));
    let mut masks = Vec::new();
    let mut overviews = Vec::new();
    for other in others {
        if other.layout.is_mask() {
            masks.push(other);
        } else {
            overviews.push(other);
        }
    }
    masks.extend(beside(path, "msk"));
    overviews.retain(|overview| is_overview_of(&overview.layout, &image.layout));
    overviews.sort_by_key(|overview| std::cmp::Reverse(overview.layout.width));
    overviews.dedup_by_key(|overview| overview.layout.width);
    attach_mask(&mut image, &mut masks);
    let masked = image.mask.is_some();
    for overview in &mut overviews {
        attach_mask(overview, &mut masks);
    }
    // An overview that lacks the mask of its image would show what the mask hides.
    overviews.retain(|overview| overview.mask.is_some() == masked);
    let mut images = vec![image];
    images.append(&mut overviews);
    Ok(Raster {
        path: path.display().to_string(),
        images,
        affine,
        crs,
        nodata,
        scale_and_offset,
        vertical_unit_metres: keys.vertical_unit_metres(),
        big_tiff: skeleton.big_tiff,
    })
}

/// The images of a file.
fn images_of(file: &Arc<SourceFile>, layouts: Vec<(u32, Layout)>) -> Vec<Image> {
    layouts.into_iter().map(|(index, layout)| Image::new(Arc::clone(file), index, layout)).collect()
}

/// The layouts that can be read, by the numbers of their directories, but for the one at `except`.
fn layouts_of(bytes: &FileBytes, skeleton: &directory::Skeleton, except: usize) -> Vec<(u32, Layout)> {
    let directories = skeleton.directories.iter().enumerate().filter(|(index, _)| *index != except);
    directories
        .filter_map(|(index, directory)| {
            let layout = Layout::read(bytes, directory).ok()?;
            Some((index as u32, layout))
        })
        .collect()
}

/// The images of `FILE.extension`, where there is one that can be read: overviews and masks that
/// GDAL keeps beside a file.
fn beside(path: &Path, extension: &str) -> Vec<Image> {
    if upstream::is_address(path) {
        return Vec::new();
    }
    let mut name = path.as_os_str().to_owned();
    name.push(".");
    name.push(extension);
    let Ok(bytes) = FileBytes::open(&PathBuf::from(name)) else { return Vec::new() };
    let Ok(skeleton) = directory::read(&bytes) else { return Vec::new() };
    let layouts = layouts_of(&bytes, &skeleton, usize::MAX);
    let file = Arc::new(SourceFile::new(bytes, skeleton.big_endian));
    images_of(&file, layouts)
}

/// Whether it is a smaller copy: as many bands of the same kind, the same shape to a pixel.
fn is_overview_of(overview: &Layout, full: &Layout) -> bool {
    let ratio = f64::from(full.width) / f64::from(overview.width);
    let rows = f64::from(full.height) / ratio;
    overview.width < full.width
        && overview.samples == full.samples
        && overview.kind == full.kind
        && overview.photometric == full.photometric
        && overview.is_reduced()
        && (rows - f64::from(overview.height)).abs() <= 1.5
}

fn attach_mask(image: &mut Image, masks: &mut Vec<Image>) {
    let size = (image.layout.width, image.layout.height);
    let fits = |mask: &Image| (mask.layout.width, mask.layout.height) == size && mask.layout.bits <= 8;
    if let Some(index) = masks.iter().position(fits) {
        image.mask = Some(Box::new(masks.swap_remove(index)));
    }
}

fn system(keys: &GeoKeys, assume_crs: Option<&str>) -> Result<Crs, Refusal> {
    if let Some(text) = assume_crs {
        return Crs::parse(text).map_err(|error| {
            let mend = match &error {
                CrsError::UnknownDatum(_) => {
                    "gdalwarp -s_srs THAT -t_srs EPSG:4326 FILE warped.tif".replace("THAT", text)
                }
                _ => "give a code such as EPSG:32632 (https://epsg.io lists them)".to_owned(),
            };
            // A wrong spelling says how to write it already.
            let problem = match &error {
                CrsError::Spelling(_) => format!("crs = {error}"),
                _ => format!("the reference system given for it cannot be used: {error}"),
            };
            Refusal::new(problem, mend)
        });
    }
    match keys.system() {
        Stated::System(Ok(crs)) => Ok(crs),
        Stated::System(Err(CrsError::UnknownCode(code))) => Err(Refusal::new(
            format!("its reference system EPSG:{code} is not known"),
            "gdalwarp -t_srs EPSG:4326 FILE warped.tif",
        )),
        Stated::System(Err(error)) => {
            let named = error.to_string().contains("EPSG:");
            Err(Refusal::new(
                format!("its reference system cannot be used: {error}"),
                // What has no code GDAL does not know better than we do: it would warp, and be off.
                if named { "gdalwarp -t_srs EPSG:4326 FILE warped.tif" } else { SAY_CRS },
            ))
        }
        Stated::OtherBody(body) => Err(Refusal::new(
            format!("it does not show the Earth ({body})"),
            "only data of the Earth can be served",
        )),
        Stated::Nothing => Err(Refusal::new(
            "it does not say in which reference system it stands, or that part is damaged",
            SAY_CRS,
        )),
    }
}

/// Tells apart, for people, what is no TIFF at all.
fn check_format(path: &Path, bytes: &FileBytes) -> Result<(), Refusal> {
    if bytes.length() == 0 {
        return Err(Refusal::new("it is empty", "fetch it again"));
    }
    let head = bytes.read(0, bytes.length().min(64)).map_err(|error| {
        Refusal::new(format!("it cannot be read: {error}"), "check the disk and its permissions")
    })?;
    if head.starts_with(b"II") || head.starts_with(b"MM") {
        return if bytes.length() < 16 {
            Err(Refusal::new("it ends within its header", "fetch it again"))
        } else {
            Ok(())
        };
    }
    let extension = path.extension().and_then(|text| text.to_str()).unwrap_or_default().to_ascii_lowercase();
    let format = match (head.as_slice(), extension.as_str()) {
        ([0x89, b'P', b'N', b'G', ..], _) => Some("a PNG"),
        ([0xff, 0xd8, 0xff, ..], _) => Some("a JPEG"),
        ([0, 0, 0, 12, b'j', b'P', ..], _) => Some("a JPEG 2000"),
        ([b'P', b'K', 3, 4, ..], _) => return Err(Refusal::new("it is a ZIP archive", "unpack it first")),
        ([0x1f, 0x8b, ..], _) => return Err(Refusal::new("it is compressed with gzip", "gunzip it first")),
        ([0x89, b'H', b'D', b'F', ..], _) => Some("an HDF5 or netCDF"),
        ([b'C', b'D', b'F', ..], _) => Some("a netCDF"),
        (_, "hgt") => Some("an SRTM height file"),
        (_, "asc" | "grd") => Some("a text grid"),
        (_, "dt0" | "dt1" | "dt2") => Some("a DTED"),
        (_, "dem" | "ddf") => Some("a USGS DEM"),
        (
            _,
            "bil" | "flt" | "img" | "vrt" | "adf" | "jp2" | "nc" | "sdat" | "ecw" | "sid" | "las" | "laz",
        ) => Some("a raster in another format"),
        _ => None,
    };
    let pictures = matches!(format, Some("a PNG" | "a JPEG" | "a JPEG 2000"));
    Err(match format {
        Some(format) if pictures => Refusal::new(
            format!("it is {format}, not a GeoTIFF"),
            "gdal_translate -a_srs EPSG:N -a_ullr WEST NORTH EAST SOUTH FILE placed.tif",
        ),
        Some(format) => Refusal::new(
            format!("it is {format}, not a GeoTIFF"),
            format!("gdal_translate FILE {}", tif_name(path)),
        ),
        None => Refusal::new(
            "it is not a GeoTIFF",
            format!("if GDAL reads it: gdal_translate FILE {}", tif_name(path)),
        ),
    })
}

fn tif_name(path: &Path) -> String {
    let stem = path.file_stem().and_then(|text| text.to_str()).unwrap_or("converted");
    // Never the file's own name: GDAL would write over what it reads.
    let own = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("tif"));
    let stem = if own || stem.contains(char::is_whitespace) { "converted" } else { stem };
    format!("{stem}.tif")
}
