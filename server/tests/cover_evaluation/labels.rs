//! Places labelled by eye: longitude, latitude, label.

use std::path::{Path, PathBuf};

/// A labelled place, degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// East.
    pub longitude: f64,
    /// North.
    pub latitude: f64,
    /// `forest`, `open` (grass, bush, bare), `water` or `built`.
    pub label: String,
}

/// The labels of a file of `tests/labels`.
pub fn read(name: &str) -> Vec<Label> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/labels").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.lines()
        .skip(1)
        .map(|line| {
            let mut fields = line.split(',');
            let mut field = || fields.next().unwrap_or_else(|| panic!("{}: {line}", path.display()));
            Label {
                longitude: field().parse().expect("a longitude"),
                latitude: field().parse().expect("a latitude"),
                label: field().to_owned(),
            }
        })
        .collect()
}

/// A real raster; `None`, after a printed word, where there are none.
pub fn raster(relative: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("TREELINE_DATA").map_or(beside, PathBuf::from);
    let path = folder.join(relative);
    if !path.exists() {
        println!("skipped: no {}; TREELINE_DATA may name a folder that has it", path.display());
    }
    path.exists().then_some(path)
}

#[test]
fn labels_are_what_their_readers_expect() {
    for (name, count) in [
        ("hong_kong.csv", 299),
        ("hong_kong_again.csv", 299),
        ("hong_kong_blind.csv", 299),
        ("minnesota_map.csv", 150),
        ("jotunheimen_map.csv", 150),
    ] {
        let labels = read(name);
        assert_eq!(labels.len(), count, "{name}");
        for label in labels {
            assert!(["forest", "open", "water", "built"].contains(&label.label.as_str()), "{label:?}");
            assert!(label.longitude.abs() <= 180.0 && label.latitude.abs() <= 90.0);
        }
    }
}
