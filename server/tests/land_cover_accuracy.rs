//! How well the cover of the built-in landscape is told from its photograph alone.

mod cover_evaluation;

use cover_evaluation::photograph::{Frame, PARTING};
use cover_evaluation::{Class, FOREST_CLOSURE, confusion::Confusion};
use treeline_server::opening;
use treeline_server::scene_file::{DemSource, PhotoSource, SceneFile};
use treeline_server::source::Cover;

/// Least share of places told right, and least F1 of forest, in a window at the tree line, where forest is thinnest; the
/// whole eastern half reaches 0.90 and 0.93.
const ACCURACY: f64 = 0.885;
const FOREST_F1: f64 = 0.845;

#[test]
fn the_photograph_of_the_built_in_landscape() {
    let folder = tempfile::tempdir().unwrap();
    let frame = Frame::new(PARTING + 0.02, 47.02, (8.0, 8.0), 10.0);
    let (dem, photo) = frame.write(folder.path());
    let file = SceneFile {
        dem: Some(DemSource { path: dem, ..DemSource::default() }),
        photo: Some(PhotoSource { path: photo, ..PhotoSource::default() }),
        ..SceneFile::default()
    };
    let scene = opening::open_file(&file).unwrap().scene;
    let mut told = vec![Cover::default(); frame.grid().len()];
    scene.cover.unwrap().sample(&frame.grid(), &mut told).unwrap();
    let mut matrix = Confusion::new(&Class::NAMES);
    for (truth, told) in frame.truth().into_iter().zip(told) {
        matrix.add(Class::of(truth, FOREST_CLOSURE) as usize, Class::of(told, 1) as usize);
    }
    let (accuracy, forest) = (matrix.accuracy(), matrix.f1(Class::Forest as usize));
    println!("accuracy {accuracy:.4}, F1 of forest {forest:.4}, {:?}", matrix.counts());
    assert!(accuracy >= ACCURACY, "{accuracy}: {:?}", matrix.counts());
    assert!(forest >= FOREST_F1, "{forest}: {:?}", matrix.counts());
}
