//! The land-cover quadtree over the router: the same class at the same place on every level.

mod common;
mod cover_evaluation;

use axum::Router;
use common::get;
use cover_evaluation::photograph::Frame;
use std::sync::Arc;
use treeline_core::codec::land_cover::{CodeBits, LandCoverTile, Step};
use treeline_core::layer::Layer;
use treeline_core::scene::SceneDescription;
use treeline_core::tile::{CELLS, TileAddress};
use treeline_server::config::Config;
use treeline_server::http::router;
use treeline_server::opening;
use treeline_server::scene_file::{DemSource, PhotoSource, SceneFile};
use treeline_server::state::App;

/// A scene from a photograph of a part of the built-in landscape.
fn scene_file(folder: &std::path::Path) -> SceneFile {
    let (dem, photo) = Frame::new(10.80, 47.0, (5.0, 4.0), 20.0).write(folder);
    SceneFile {
        dem: Some(DemSource { path: dem, ..DemSource::default() }),
        photo: Some(PhotoSource { path: photo, ..PhotoSource::default() }),
        ..SceneFile::default()
    }
}

async fn tile(router: &Router, address: TileAddress) -> LandCoverTile {
    let uri = format!(
        "/tiles/lcc/TreelineGeographic/{}/{}/{}?f=treeline",
        address.level, address.row, address.column
    );
    let answer = get(router, &uri).await;
    LandCoverTile::decode(&answer.body).unwrap_or_else(|error| panic!("{uri}: {} {error}", answer.status))
}

/// Index in a tile of a cell of its level, by the cell's global column and row.
fn index(tile: &LandCoverTile, address: TileAddress, column: u32, row: u32) -> usize {
    let border = Layer::Lcc.row().border;
    let x = column - address.column * CELLS + border;
    let y = row - address.row * CELLS + border;
    (y * tile.side + x) as usize
}

#[tokio::test]
async fn a_place_has_one_class_on_every_level() {
    let folder = tempfile::tempdir().unwrap();
    let scene = opening::open_file(&scene_file(folder.path())).unwrap().scene;
    let router = router(App::new(Arc::new(scene), &Config::default()).unwrap());
    let description: SceneDescription =
        serde_json::from_slice(&get(&router, "/scene.json").await.body).unwrap();
    let levels = description.land_cover.unwrap();
    assert_eq!((levels.l0, levels.l2, levels.bits), (levels.l1 + 1, levels.l1 - 1, 16));
    assert!(levels.l1 + 1 >= levels.anchor, "a tile carries no more than four anchors a cell");
    let bits = CodeBits::new(levels.bits).unwrap();
    let (longitude, latitude) = description.extent.centre();
    let middle = TileAddress::at(levels.l2, longitude, latitude);
    let packed = tile(&router, middle).await;
    assert_eq!((packed.step, packed.level), (Step::Packed, levels.l2));
    let mut seen = std::collections::BTreeMap::new();
    for quarter in 0..4 {
        let child = TileAddress {
            level: levels.l1,
            column: 2 * middle.column + quarter % 2,
            row: 2 * middle.row + quarter / 2,
        };
        let classes = tile(&router, child).await;
        assert_eq!(classes.step, Step::Classes);
        assert!(classes.stands.is_some(), "closure and height travel with the classes");
        let grandchild = TileAddress { level: levels.l0, column: 2 * child.column, row: 2 * child.row };
        let repeated = tile(&router, grandchild).await;
        assert_eq!(repeated.step, Step::Repeated);
        // Every seventh cell of the child, and what its parent and its own children say of it.
        for row in (0..CELLS).step_by(7) {
            for column in (0..CELLS).step_by(7) {
                let (x, y) = (child.column * CELLS + column, child.row * CELLS + row);
                let class = classes.codes[index(&classes, child, x, y)];
                let four = bits.unpack(packed.codes[index(&packed, middle, x / 2, y / 2)]);
                assert_eq!(u32::from(four[(y % 2) as usize][(x % 2) as usize]), class, "{x} {y}");
                if column < CELLS / 2 && row < CELLS / 2 {
                    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                        let below = index(&repeated, grandchild, 2 * x + dx, 2 * y + dy);
                        assert_eq!(repeated.codes[below], class, "{x} {y}");
                    }
                }
                *seen.entry(class).or_insert(0) += 1;
            }
        }
    }
    assert!(seen.contains_key(&0) && seen.len() >= 4, "a forest of several species: {seen:?}");
    let listed: Vec<u32> = description.species.iter().map(|species| u32::from(species.code)).collect();
    assert!(seen.keys().all(|class| *class == 0 || listed.contains(class)), "{seen:?} of {listed:?}");
    assert!(!listed.contains(&12), "a photo grows no stones");
}

#[tokio::test]
async fn codes_too_narrow_are_refused_before_any_tile() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = scene_file(folder.path());
    file.land_cover_bits = Some(8);
    let error = opening::open_file(&file).err().unwrap().to_string();
    assert!(error.contains("land_cover_bits is 8") && error.contains("land_cover_bits = 16"), "{error}");
    file.land_cover_bits = Some(32);
    let scene = opening::open_file(&file).unwrap().scene;
    let router = router(App::new(Arc::new(scene), &Config::default()).unwrap());
    let description: SceneDescription =
        serde_json::from_slice(&get(&router, "/scene.json").await.body).unwrap();
    assert_eq!(description.land_cover.unwrap().bits, 32);
}
