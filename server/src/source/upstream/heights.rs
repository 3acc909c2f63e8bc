//! Heights from a WMS: a part of what it has, fetched whole before it is used.
//!
//! Ray casting must know the greatest height of every square, and pictures of means do not tell it. So all samples of a box
//! are fetched once, at one distance, and are then a raster like that of a file. Maps are asked for in geographic
//! coordinates (WMS 1.1.1, EPSG:4326: longitude first), one for each chunk.

use super::wms::maps_of;
use super::{client, printable};
use crate::source::SourceError;
use crate::source::crs::Crs;
use crate::source::geotiff::bytes::FileBytes;
use crate::source::geotiff::chunk::Samples;
use crate::source::geotiff::directory;
use crate::source::geotiff::georeference::Affine;
use crate::source::geotiff::image::{ChunkService, Image, SourceFile, ValueRule};
use crate::source::geotiff::layout::Layout;
use crate::source::geotiff::{Raster, metadata};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use treeline_core::tile::GeographicBox;

/// Samples along a chunk's side.
const SIDE: u32 = 512;
/// Samples at most: 256 MiB of them.
const MOST_SAMPLES: u64 = 1 << 26;
/// Samples where nobody says how far apart they shall be.
const DEFAULT_SAMPLES: f64 = (1 << 22) as f64;
/// Bytes of a map at most: 64-bit samples and a header.
const LARGEST_MAP: u64 = (SIDE * SIDE) as u64 * 8 + (1 << 16);
/// Maps asked for at once.
const AT_ONCE: usize = 4;
/// Metres in a degree of latitude, near enough to choose a distance.
const DEGREE_METRES: f64 = 111_320.0;
const MEND: &str =
    "check the address and its FORMAT (application/bil32, image/tiff), and whether the server is up";

/// Samples of a box, at equal distances in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Lattice {
    west: f64,
    north: f64,
    /// Degrees between samples, east and south.
    step: [f64; 2],
    /// Columns and rows.
    size: [u32; 2],
}

impl Lattice {
    fn of(bounds: &GeographicBox, metres: Option<f64>) -> Result<Self, (String, String)> {
        let spans = [bounds.east - bounds.west, bounds.north - bounds.south];
        let cosine = bounds.centre().1.to_radians().cos().max(0.01);
        let extent = [spans[0] * DEGREE_METRES * cosine, spans[1] * DEGREE_METRES];
        let metres = metres.unwrap_or_else(|| (extent[0] * extent[1] / DEFAULT_SAMPLES).sqrt());
        let counts = extent.map(|length| (length / metres).ceil().max(2.0));
        if counts[0] * counts[1] > MOST_SAMPLES as f64 {
            return Err((
                format!(
                    "{:.0} × {:.0} samples {metres} m apart are more than are fetched ({MOST_SAMPLES})",
                    counts[0], counts[1]
                ),
                "say a smaller bbox or a greater resolution_metres under [dem], or fetch it to a file: gdal_translate"
                    .to_owned(),
            ));
        }
        let size = counts.map(|count| count as u32);
        let step = [0, 1].map(|axis| spans[axis] / f64::from(size[axis]));
        Ok(Self { west: bounds.west, north: bounds.north, step, size })
    }

    fn chunks(&self) -> [u32; 2] {
        self.size.map(|samples| samples.div_ceil(SIDE))
    }

    /// West, south, east, north of a chunk, whole even where the box ends within it.
    fn bounds(&self, column: u32, row: u32) -> [f64; 4] {
        let place = |axis: usize, chunk: u32| f64::from(chunk * SIDE) * self.step[axis];
        [
            self.west + place(0, column),
            self.north - place(1, row + 1),
            self.west + place(0, column + 1),
            self.north - place(1, row),
        ]
    }
}

/// The address of a map.
fn address_of(address: &str, [west, south, east, north]: [f64; 4]) -> String {
    let maps = maps_of(address, &[("SRS", "EPSG:4326"), ("FORMAT", "application/bil32")]);
    maps + &format!("&BBOX={west},{south},{east},{north}&WIDTH={SIDE}&HEIGHT={SIDE}")
}

/// The samples of a map: a TIFF of one band, or nothing but little-endian numbers of 32 or 16 bits.
fn decode(body: Vec<u8>) -> Result<Vec<f32>, String> {
    let count = (SIDE * SIDE) as usize;
    if body.starts_with(b"II") || body.starts_with(b"MM") {
        return decode_tiff(body);
    }
    if body.len() == 4 * count {
        return Ok(body
            .chunks_exact(4)
            .map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]]))
            .collect());
    }
    if body.len() == 2 * count {
        return Ok(body.chunks_exact(2).map(|two| f32::from(i16::from_le_bytes([two[0], two[1]]))).collect());
    }
    Err(format!("it gives no heights, but {} bytes: {}", body.len(), printable(&body)))
}

fn decode_tiff(body: Vec<u8>) -> Result<Vec<f32>, String> {
    let bytes = FileBytes::held(body);
    let skeleton = directory::read(&bytes)?;
    let first = skeleton.directories.first().ok_or("its TIFF is empty")?;
    let layout = Layout::read(&bytes, first).map_err(|refusal| refusal.problem)?;
    if (layout.width, layout.height) != (SIDE, SIDE) {
        return Err(format!(
            "its TIFF has {} × {} samples, not {SIDE} × {SIDE}",
            layout.width, layout.height
        ));
    }
    if layout.samples != 1 || layout.palette.is_some() {
        return Err("its TIFF is a picture in colours, no heights".to_owned());
    }
    let rule = ValueRule { nodata: metadata::nodata(&bytes, first), ..ValueRule::RAW };
    let image = Image::new(Arc::new(SourceFile::new(bytes, skeleton.big_endian)), 0, layout);
    image.read_values(0, image.rect(), &rule)
}

/// All chunks, row by row.
#[derive(Debug)]
struct Held {
    across: u32,
    chunks: Vec<Vec<f32>>,
}

impl ChunkService for Held {
    fn chunk(&self, _: u32, column: u32, row: u32) -> Result<Samples, String> {
        let chunk = self.chunks.get((row * self.across + column) as usize);
        Ok(chunk.map_or(Samples::Sparse, |samples| Samples::F32(samples.clone())))
    }
}

/// Fetches all chunks, some at once; what is not there is no data.
fn fetch(address: &str, lattice: &Lattice) -> Result<Vec<Vec<f32>>, String> {
    let [across, down] = lattice.chunks();
    let count = (across * down) as usize;
    let next = AtomicUsize::new(0);
    let found = Mutex::new(Ok(vec![Vec::new(); count]));
    let lock = || found.lock().unwrap_or_else(PoisonError::into_inner);
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count || lock().is_err() {
                return;
            }
            let bounds = lattice.bounds(index as u32 % across, index as u32 / across);
            let map = client()
                .get(&address_of(address, bounds), LARGEST_MAP)
                .and_then(|body| body.map_or_else(|| Ok(vec![f32::NAN; (SIDE * SIDE) as usize]), decode));
            let mut all = lock();
            match (map, &mut *all) {
                (Ok(map), Ok(chunks)) => chunks[index] = map,
                (Err(problem), Ok(_)) => *all = Err(problem),
                (_, Err(_)) => {}
            }
            drop(all);
            if index % 16 == 15 {
                tracing::info!("{address}: {} of {count} maps of heights fetched", index + 1);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..AT_ONCE.min(count) {
            scope.spawn(work);
        }
        work();
    });
    found.into_inner().unwrap_or_else(PoisonError::into_inner)
}

/// Heights of a box, `metres` apart (default: some four million of them), as a raster.
///
/// # Errors
/// One line that names the address: it cannot be asked, it gives no heights, they are too many.
pub fn open(
    address: &str,
    bounds: &GeographicBox,
    metres: Option<f64>,
    nodata: Option<f64>,
) -> Result<Raster, SourceError> {
    let unusable = |problem: String, mend: &str| SourceError::Unusable {
        path: address.to_owned(),
        problem,
        mend: mend.to_owned(),
    };
    let lattice = Lattice::of(bounds, metres).map_err(|(problem, mend)| unusable(problem, &mend))?;
    let chunks = fetch(address, &lattice).map_err(|problem| unusable(problem, MEND))?;
    let is_height = |height: &f32| !height.is_nan() && nodata != Some(f64::from(*height));
    if !chunks.iter().flatten().any(is_height) {
        return Err(unusable(
            "it has no heights there".to_owned(),
            "check dem.bbox: west, south, east, north",
        ));
    }
    let [width, height] = lattice.size;
    let file = Arc::new(SourceFile::of_service(Arc::new(Held { across: lattice.chunks()[0], chunks })));
    let crs = Crs::from_epsg(4326).map_err(|error| unusable(error.to_string(), MEND))?;
    Ok(Raster {
        path: address.to_owned(),
        images: vec![Image::new(file, 0, Layout::of_heights(width, height, SIDE))],
        affine: Affine { x: (lattice.west, lattice.step[0], 0.0), y: (lattice.north, 0.0, -lattice.step[1]) },
        crs,
        nodata: None,
        scale_and_offset: (1.0, 0.0),
        vertical_unit_metres: Some(1.0),
        big_tiff: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ALPS: GeographicBox = GeographicBox { west: 10.0, south: 46.0, east: 10.5, north: 46.4 };

    #[test]
    fn chunks_lie_side_by_side_from_the_north_west() {
        let lattice = Lattice::of(&ALPS, Some(30.0)).unwrap();
        let metres = lattice.step[1] * DEGREE_METRES;
        assert!((29.9..=30.0).contains(&metres), "{metres}");
        let [west, south, east, north] = lattice.bounds(0, 0);
        assert_eq!((west, north), (10.0, 46.4));
        assert_eq!(lattice.bounds(1, 1)[0], east);
        assert_eq!(lattice.bounds(1, 1)[3], south);
        let [across, down] = lattice.chunks();
        let last = lattice.bounds(across - 1, down - 1);
        assert!(last[2] >= ALPS.east && last[1] <= ALPS.south);
        // Without a word on it, some four million.
        let lattice = Lattice::of(&ALPS, None).unwrap();
        let samples = f64::from(lattice.size[0]) * f64::from(lattice.size[1]);
        assert!((samples / DEFAULT_SAMPLES - 1.0).abs() < 0.01, "{samples}");
        assert!(Lattice::of(&ALPS, Some(1.0)).unwrap_err().0.contains("more than are fetched"));
    }

    /// A TIFF of the right size, made by hand: 16-bit numbers in one strip.
    fn tiff() -> Vec<u8> {
        let entries: [(u16, u16, u32); 9] = [
            (256, 4, SIDE),
            (257, 4, SIDE),
            (258, 3, 16),
            (259, 3, 1),
            (262, 3, 1),
            (273, 4, 8 + 2 + 9 * 12 + 4),
            (277, 3, 1),
            (278, 4, SIDE),
            (279, 4, 2 * SIDE * SIDE),
        ];
        let mut bytes = b"II*\0\x08\0\0\0\x09\0".to_vec();
        for (tag, kind, value) in entries {
            bytes.extend(tag.to_le_bytes());
            bytes.extend(kind.to_le_bytes());
            bytes.extend(1_u32.to_le_bytes());
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([0; 4]);
        bytes.extend([0x9a, 0x02].repeat((SIDE * SIDE) as usize));
        bytes
    }

    #[test]
    fn a_tiff_is_read() {
        assert!(decode(tiff()).unwrap().iter().all(|&height| height == 666.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        /// Whatever an upstream answers, there are 512 × 512 heights or a line on what is wrong.
        #[test]
        fn answers_of_any_kind_are_heights_or_an_error(
            flips in prop::collection::vec((0_usize..140, any::<u8>()), 0..6), cut in 0_usize..600_000, noise in prop::collection::vec(any::<u8>(), 0..64),
        ) {
            let mut body = tiff();
            for (place, value) in flips {
                body[place] = value;
            }
            body.truncate(cut.max(8));
            for body in [body, noise] {
                match decode(body) {
                    Ok(heights) => prop_assert_eq!(heights.len(), (SIDE * SIDE) as usize),
                    Err(problem) => prop_assert!(!problem.contains('\n') && problem.len() < 400, "{}", problem),
                }
            }
        }
    }

    #[test]
    fn numbers_are_told_apart_by_their_bytes() {
        let count = (SIDE * SIDE) as usize;
        assert_eq!(decode([0x9a, 0x02].repeat(count)).unwrap()[7], 666.0);
        assert_eq!(decode(1234.5_f32.to_le_bytes().repeat(count)).unwrap()[7], 1234.5);
        let error = decode(b"<ServiceException>no such layer</ServiceException>".to_vec()).unwrap_err();
        assert!(error.contains("no such layer"), "{error}");
        for start in [&b"II*\0"[..], b"MM\0*", b"II"] {
            assert!(decode([start, &[7; 64]].concat()).is_err());
        }
    }
}
