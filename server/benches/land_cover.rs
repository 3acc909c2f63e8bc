//! How well land cover is told, by scene: confusion matrices, accuracy, F1 of forest, κ, as JSON lines.
//!
//! Each line names its truth. The constants of the photo classifier were measured on the western half of the
//! built-in landscape; of Hong Kong's labels the even ones were looked at while it was written, the odd ones not.

#[path = "../tests/cover_evaluation/mod.rs"]
mod cover_evaluation;

use cover_evaluation::confusion::Confusion;
use cover_evaluation::labels::{self, Label};
use cover_evaluation::photograph::{Frame, PARTING};
use cover_evaluation::{Class, FOREST_CLOSURE};
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;
use treeline_server::opening;
use treeline_server::scene_file::{CanopyHeightSource, DemSource, LandCoverSource, PhotoSource, SceneFile};
use treeline_server::source::{Cover, CoverField, RequestCrs, SampleGrid};

/// Labels and what they are held against.
const PLACES: [&str; 3] = ["forest", "water", "other"];

fn main() {
    built_in("western half (constants measured there)", PARTING - 0.255, 46.77 + 0.33, (19.0, 36.0), 10.0);
    built_in("eastern half", PARTING + 0.002, 46.77 + 0.33, (19.0, 36.0), 10.0);
    built_in("eastern half, the tests' window", PARTING + 0.02, 47.02, (8.0, 8.0), 10.0);
    built_in("eastern half, 2.5 m", PARTING + 0.06, 46.95, (4.0, 4.0), 2.5);
    hong_kong();
    map("Minnesota, scanned map", "topo_usgs_drg/drgncimq1942_26915.tif", "minnesota_map.csv");
    map(
        "Jotunheimen, rendered map",
        "scene_jotunheimen_norway/topomap_texture_15m_utm32n.tif",
        "jotunheimen_map.csv",
    );
    lolo();
}

fn report(scene: &str, truth: &str, matrix: &Confusion, seconds: f64) {
    let told = |name: &str, value: f64| {
        println!("{}", json!({ "name": format!("{scene}: {name}"), "value": value, "unit": "" }));
    };
    told("accuracy", matrix.accuracy());
    told("F1 of forest", matrix.f1(0));
    told("kappa", matrix.kappa());
    let line = json!({
        "scene": scene, "truth": truth, "places": matrix.total(), "classes": matrix.names(),
        "confusion": matrix.counts(), "seconds": seconds,
    });
    println!("{line}");
}

/// The photograph of a part of the built-in landscape, every pixel.
fn built_in(part: &str, west: f64, north: f64, kilometres: (f64, f64), metres: f64) {
    let folder = tempfile::tempdir().expect("a folder");
    let frame = Frame::new(west, north, kilometres, metres);
    let (dem, photo) = frame.write(folder.path());
    let scene = opening::open_file(&SceneFile {
        dem: Some(DemSource { path: dem, ..DemSource::default() }),
        photo: Some(PhotoSource { path: photo, ..PhotoSource::default() }),
        ..SceneFile::default()
    })
    .expect("the photograph opens")
    .scene;
    let mut told = vec![Cover::default(); frame.grid().len()];
    let start = Instant::now();
    scene.cover.expect("a cover").sample(&frame.grid(), &mut told).expect("it is told");
    let seconds = start.elapsed().as_secs_f64();
    let mut matrix = Confusion::new(&Class::NAMES);
    for (truth, told) in frame.truth().into_iter().zip(told) {
        matrix.add(Class::of(truth, FOREST_CLOSURE) as usize, Class::of(told, 1) as usize);
    }
    report(&format!("built-in, {part}"), "the rules that the photograph was painted by", &matrix, seconds);
}

/// The cover at a place.
fn at(cover: &dyn CoverField, label: &Label) -> Cover {
    let half = 1e-6;
    let grid = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: label.longitude - half,
        south: label.latitude - half,
        east: label.longitude + half,
        north: label.latitude + half,
        width: 1,
        height: 1,
    };
    let mut out = [Cover::default()];
    cover.sample(&grid, &mut out).expect("a place can be asked for");
    out[0]
}

fn place_of_label(label: &str) -> usize {
    PLACES.iter().position(|&place| place == label).unwrap_or(2)
}

fn place_of_cover(cover: Cover) -> usize {
    match Class::of(cover, 1) {
        Class::Forest => 0,
        Class::Water => 1,
        Class::Grass | Class::Bare | Class::Snow => 2,
    }
}

fn against_labels(cover: &dyn CoverField, labels: &[Label]) -> Confusion {
    let mut matrix = Confusion::new(&PLACES);
    for label in labels {
        matrix.add(place_of_label(&label.label), place_of_cover(at(cover, label)));
    }
    matrix
}

/// What two lists of labels of the same places say.
fn of_two(first: &[Label], second: &[Label]) -> Confusion {
    let mut matrix = Confusion::new(&["forest", "water", "open", "built"]);
    let names = matrix.names().to_vec();
    let class = |label: &Label| names.iter().position(|name| *name == label.label).unwrap_or(2);
    for (first, second) in first.iter().zip(second) {
        matrix.add(class(first), class(second));
    }
    matrix
}

fn hong_kong() {
    let found = |name: &str| labels::raster(&format!("scene_hongkong/{name}"));
    let (Some(dem), Some(photo)) = (found("dem_aster30m_4326.tif"), found("ortho_landsat8_4326.tif")) else {
        return;
    };
    let scene = opening::open_file(&SceneFile {
        dem: Some(DemSource { path: dem, ..DemSource::default() }),
        photo: Some(PhotoSource { path: photo, ..PhotoSource::default() }),
        ..SceneFile::default()
    })
    .expect("Hong Kong opens")
    .scene;
    let cover = scene.cover.expect("a cover");
    let first = labels::read("hong_kong.csv");
    let blind = labels::read("hong_kong_blind.csv");
    for (who, labels) in
        [("itself", labels::read("hong_kong_again.csv")), ("a second, blind eye", blind.clone())]
    {
        report(&format!("Hong Kong, the eye against {who}"), "the first pass", &of_two(&first, &labels), 0.0);
    }
    let on_land: Vec<(Label, Label)> = (first.iter().cloned().zip(blind.iter().cloned()))
        .filter(|(first, blind)| first.label != "water" || blind.label != "water")
        .collect();
    let (first_on_land, blind_on_land): (Vec<Label>, Vec<Label>) = on_land.into_iter().unzip();
    let matrix = of_two(&first_on_land, &blind_on_land);
    report("Hong Kong, the eye against a second, blind eye, on land", "the first pass", &matrix, 0.0);
    let agreed: Vec<Label> = (first.iter().zip(&blind))
        .filter(|(first, blind)| first.label == blind.label)
        .map(|(first, _)| first.clone())
        .collect();
    for (part, labels) in [("the blind eye's labels", &blind), ("where both eyes agree", &agreed)] {
        let start = Instant::now();
        let matrix = against_labels(cover.as_ref(), labels);
        report(&format!("Hong Kong, {part}"), "labelled by eye", &matrix, start.elapsed().as_secs_f64());
    }
    for (part, remainder) in [("even labels", 0), ("odd labels", 1)] {
        let labels: Vec<Label> = first.iter().skip(remainder).step_by(2).cloned().collect();
        let start = Instant::now();
        let matrix = against_labels(cover.as_ref(), &labels);
        report(&format!("Hong Kong, {part}"), "labelled by eye", &matrix, start.elapsed().as_secs_f64());
    }
}

/// A map over level ground: the terrain plays no part.
fn map(scene: &str, path: &str, names: &str) {
    let Some(path) = labels::raster(path) else { return };
    let key = treeline_server::source::picture::map::MapKey::default();
    let opened = treeline_server::source::open_topographic_map(&path, &Default::default(), &key, 1);
    let labels = labels::read(names);
    let start = Instant::now();
    let matrix = against_labels(opened.expect("the map opens").as_ref(), &labels);
    report(scene, "what the map says, read by eye", &matrix, start.elapsed().as_secs_f64());
}

/// Classes and canopy heights of one source, against the canopy cover of the same: circular.
fn lolo() {
    let found = |name: &str| labels::raster(&format!("scene_lolo_montana/{name}"));
    let (Some(dem), Some(fuel), Some(height), Some(cover)) = (
        found("dem_m.tif"),
        found("fuel_fbfm40.tif"),
        found("canopy_height_dm.tif"),
        found("canopy_cover_pct.tif"),
    ) else {
        return;
    };
    let open = |canopy: Option<PathBuf>| {
        let canopy_height =
            canopy.map(|path| CanopyHeightSource { path, scale: Some(0.1), ..Default::default() });
        let land_cover = Some(LandCoverSource { path: fuel.clone(), ..LandCoverSource::default() });
        let dem = Some(DemSource { path: dem.clone(), ..DemSource::default() });
        opening::open_file(&SceneFile { dem, land_cover, canopy_height, ..SceneFile::default() })
            .expect("Lolo opens")
            .scene
            .cover
            .expect("a cover")
    };
    // The truth as a canopy of its own: a per cent is taken for a metre, and what is over 0 is forest.
    let source = SceneFile {
        dem: Some(DemSource { path: dem.clone(), ..DemSource::default() }),
        canopy_height: Some(CanopyHeightSource { path: cover, scale: Some(1.0), ..Default::default() }),
        ..SceneFile::default()
    };
    let truth = opening::open_file(&source).expect("the truth opens").scene.cover.expect("a cover");
    let bounds = truth.extent().bounds;
    let grid = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: bounds.west,
        south: bounds.south,
        east: bounds.east,
        north: bounds.north,
        width: 500,
        height: 500,
    };
    let all = |cover: &dyn CoverField| {
        let mut out = vec![Cover::default(); grid.len()];
        cover.sample(&grid, &mut out).expect("it is told");
        out
    };
    let truth = all(truth.as_ref());
    for (name, canopy) in [("fuel classes", None), ("fuel classes and canopy height", Some(height.clone()))] {
        let start = Instant::now();
        let told = all(open(canopy).as_ref());
        let mut matrix = Confusion::new(&["forest", "other"]);
        for (truth, told) in truth.iter().zip(told) {
            matrix.add(usize::from(truth.species == 0), usize::from(told.species == 0));
        }
        let what = "LANDFIRE canopy cover over 0: circular, made with the classes it judges";
        report(&format!("Lolo, {name}"), what, &matrix, start.elapsed().as_secs_f64());
    }
}
