use super::combined_elevation::Combined;
use super::grid_places::{band, with_margin};
use super::test_fields::{Hills, Woods, extent, scene, scene_of};
use super::*;
use crate::source::{Cover, RequestCrs};
use std::sync::Arc;
use treeline_core::codec::elevation::{ElevationTile, VOID, metres, quantum_metres};
use treeline_core::codec::land_cover::{LandCoverTile, Step};
use treeline_core::grid::{LatticeWindow, Registration};
use treeline_core::layer::{LAYERS, SurfaceType};
use treeline_core::seeds::place::{latitude_from_y, longitude_from_x, x_from_longitude, y_from_latitude};
use treeline_core::seeds::{Window, for_each_tree};
use treeline_core::tile::{CELLS, TileAddress};

fn window(layer: Layer, address: TileAddress) -> LatticeWindow {
    let row = layer.row();
    LatticeWindow::of_tile(address, row.registration, row.border)
}

fn own(scene: &Scene, layer: Layer, address: TileAddress) -> Vec<u8> {
    let grid = SampleGrid::Lattice(window(layer, address));
    make(scene, &TileRequest::new(layer, grid, Format::Own)).unwrap()
}

fn combined(scene: &Scene, address: TileAddress) -> ElevationTile {
    ElevationTile::decode(&own(scene, Layer::CombinedElevation, address)).unwrap()
}

/// What two tiles hold of the nodes that both have, canopy and surface type included.
fn assert_shared_nodes_agree(a: &ElevationTile, b: &ElevationTile, shift: (u32, u32), name: &str) {
    let side = a.side;
    let mut trees = 0;
    for row in shift.1..side {
        for column in shift.0..side {
            let here = (row * side + column) as usize;
            let there = ((row - shift.1) * side + column - shift.0) as usize;
            assert_eq!(a.heights[here], b.heights[there], "{name}: height at {column}, {row}");
            if let (Some(left), Some(right)) = (&a.surface, &b.surface) {
                assert_eq!(left.types[here], right.types[there], "{name}: type at {column}, {row}");
                assert_eq!(left.canopy[here], right.canopy[there], "{name}: canopy at {column}, {row}");
                trees += u32::from(left.canopy[here] > 0);
            }
        }
    }
    let _ = trees;
}

#[test]
fn neighbours_share_bits_on_every_level() {
    let scene = scene();
    for (level, places) in
        [(6, 1), (9, 1), (11, 2), (13, 1), (14, 2), (15, 3), (16, 3), (17, 2), (18, 1), (20, 1), (23, 1)]
    {
        for place in 0..places {
            // The second place is at the border of the data.
            let longitude = [10.371, 10.0, 10.777][place];
            let at = TileAddress::at(level, longitude, 46.437 + 0.2 * place as f64);
            let tile = combined(&scene, at);
            let east = TileAddress { column: at.column + 1, ..at };
            let south = TileAddress { row: at.row + 1, ..at };
            let both = TileAddress { column: at.column + 1, ..south };
            for (other, shift) in [(east, (CELLS, 0)), (south, (0, CELLS)), (both, (CELLS, CELLS))] {
                assert_shared_nodes_agree(
                    &tile,
                    &combined(&scene, other),
                    shift,
                    &format!("{at} and {other}"),
                );
            }
        }
    }
}

#[test]
fn neighbours_share_bits_over_the_antimeridian() {
    let mut scene = scene_of(extent(-180.0, -18.0, 180.0, -16.0, 30.0));
    scene.cover = Some(Arc::new(Woods { extent: extent(-180.0, -18.0, 180.0, -16.0, 30.0), closed: true }));
    for level in [12, 15, 17] {
        let west = TileAddress::at(level, 179.999_999, -17.2);
        let east = TileAddress { column: 0, ..west };
        let (a, b) = (combined(&scene, west), combined(&scene, east));
        assert!(a.surface.as_ref().is_some_and(|surface| surface.canopy.iter().any(|&canopy| canopy > 20)));
        let side = a.side as usize;
        for row in 0..side {
            // The analytic hills are f64 sines of the longitude, which differ in the last bit by turn;
            // the forest must not.
            let left = &a.heights[row * side + CELLS as usize..][..3];
            let right = &b.heights[row * side..][..3];
            for (left, right) in left.iter().zip(right) {
                assert!((left - right).abs() <= 1, "level {level}, row {row}: {left} and {right}");
            }
        }
    }
}

#[test]
fn the_envelope_is_the_terrain_or_the_highest_crown() {
    let scene = scene();
    let levels = land_cover_levels(&scene).unwrap();
    let address = TileAddress::at(16, 10.37, 46.43);
    let window = window(Layer::CombinedElevation, address);
    let bounds = address.bounds();
    let tile = combined(&scene, address);
    // All trees of the tile and round it, straight from `core`.
    let margin = 4_000.0;
    let units = Window {
        west: (x_from_longitude(bounds.west) - margin) as i64,
        east: (x_from_longitude(bounds.east) + margin) as i64,
        north: (y_from_latitude(bounds.north) - margin) as i64,
        south: (y_from_latitude(bounds.south) + margin) as i64,
    };
    let cover = |x: f64, y: f64| {
        // The class at the middle of the level-1 cell.
        let cell = treeline_core::seeds::place::units_of_cell(levels.l1);
        let middle = |value: f64| ((value / cell).floor() + 0.5) * cell;
        Woods { extent: extent(10.0, 46.0, 11.0, 47.0, 15.0), closed: false }
            .cover(longitude_from_x(middle(x)), latitude_from_y(middle(y)))
    };
    let stand_at = |x: i64, y: i64| stands::stand_of(cover(x as f64, y as f64));
    let mut trees = Vec::new();
    for_each_tree(&units, scene.seed, &scene.species, stand_at, |tree| trees.push(tree));
    assert!(trees.len() > 300, "{}", trees.len());
    let elevation = elevation::tile(&scene, &window).unwrap();
    let surface = tile.surface.as_ref().unwrap();
    let (mut under, mut off) = (0, 0.0_f64);
    for index in (0..tile.heights.len()).step_by(1_013) {
        let (column, row) = (index as u32 % tile.side, index as u32 / tile.side);
        let x = x_from_longitude(window.longitude(window.first_column + i64::from(column)));
        let y = y_from_latitude(window.latitude(window.first_row + i64::from(row)));
        let ground = elevation.metres(column, row);
        let mut wanted = ground;
        let mut over = Vec::new();
        for tree in &trees {
            let unit = treeline_core::seeds::place::UNIT_METRES;
            let dx = (tree.x as f64 - x) * unit * latitude_from_y(tree.y as f64).to_radians().cos();
            let dy = (tree.y as f64 - y) * unit;
            if dx.hypot(dy) > 20.0 {
                continue;
            }
            let species = &scene.species[tree.species];
            if let Some(crown) = species.crown_surface(tree.height_metres(), dx.hypot(dy) as f32) {
                over.push(species.code);
                let place = point(&scene, longitude_from_x(tree.x as f64), latitude_from_y(tree.y as f64));
                wanted = wanted.max(place.unwrap().terrain.unwrap() + f64::from(crown));
            }
        }
        let found = tile.metres(column, row);
        off = off.max((found - wanted).abs());
        let canopy = f64::from(surface.canopy[index]) * 0.25;
        assert!((canopy - (found - ground)).abs() <= 0.126, "{canopy} for {}", found - ground);
        let is_canopy = surface.types[index] == SurfaceType::Canopy as u8;
        assert!(is_canopy || found == ground);
        if !is_canopy {
            assert_eq!(surface.types[index], cover(x, y).surface);
        }
        let code = surface.species.as_ref().unwrap()[index];
        assert!(if is_canopy { over.contains(&code) } else { code == 0 }, "{code} of {over:?}");
        under += u32::from(is_canopy);
    }
    // Anchors are bilinear between nodes 5 m apart (the scene's terrain is said to be of 30 m, and
    // has waves of 70 m): their error is most of this.
    assert!(off < 1.5, "{off}");
    assert!(under > 50, "{under}");
}

#[test]
fn a_tree_top_stands_where_its_seed_says() {
    let scene = scene();
    let levels = land_cover_levels(&scene).unwrap();
    let (x, y) = (x_from_longitude(10.37) as i64, y_from_latitude(46.43) as i64);
    let window = Window { west: x, north: y, east: x + 40_000, south: y + 20_000 };
    let stands = stands::Stands::read(&scene, &levels, &window).unwrap().unwrap();
    let trees = canopy::trees(&scene, &window, &stands);
    let anchors =
        canopy::Anchors::read(&scene, canopy::Anchors::window(anchor_level(&scene), &window)).unwrap();
    assert!(trees.len() > 100);
    let mut highest = 0;
    for tree in &trees {
        let info = point(&scene, longitude_from_x(tree.x as f64), latitude_from_y(tree.y as f64)).unwrap();
        let top = info.terrain.unwrap() + info.canopy.unwrap();
        let own = f64::from(anchors.height(tree.x, tree.y).unwrap() + tree.height_metres());
        // Another crown may overtop it, never less.
        assert!(top > own - 0.01, "{top} and {own}");
        highest += u32::from((top - own).abs() < 0.01);
    }
    assert!(highest as usize > trees.len() * 3 / 4, "{highest} of {}", trees.len());
}

/// Mean of terrain and canopy, and of the terrain, over the nodes of a box of degrees.
fn mean_canopy(scene: &Scene, level: u8, west: f64, north: f64, degrees: f64) -> f64 {
    let step = treeline_core::tile::span_degrees(level) / f64::from(CELLS);
    let side = (degrees / step) as u32;
    let window = LatticeWindow {
        level,
        registration: Registration::Node,
        first_column: ((west + 180.0) / step) as i64,
        first_row: ((90.0 - north) / step) as i64,
        width: side,
        height: side,
    };
    let grid = SampleGrid::Lattice(window);
    let mean =
        |heights: &[f32]| heights.iter().map(|&height| f64::from(height)).sum::<f64>() / heights.len() as f64;
    mean(&Combined::sample(scene, &grid).unwrap().heights) - mean(&elevation::sample(scene, &grid).unwrap())
}

#[test]
fn nothing_jumps_where_crowns_give_way_to_their_mean() {
    let mut scene = scene();
    for closed in [true, false] {
        scene.cover = Some(Arc::new(Woods { extent: extent(10.0, 46.0, 11.0, 47.0, 15.0), closed }));
        let exact = mean_canopy(&scene, 15, 10.3, 46.5, 0.009);
        let coarse = mean_canopy(&scene, 14, 10.3, 46.5, 0.009);
        let coarser = mean_canopy(&scene, 12, 10.3, 46.5, 0.009);
        println!(
            "closed {closed}: mean canopy {exact:.2} m, level 14 {coarse:.2} m, level 12 {coarser:.2} m"
        );
        assert!(exact > 4.0);
        assert!((coarse / exact - 1.0).abs() < 0.06, "{coarse} and {exact}");
        assert!((coarser / exact - 1.0).abs() < 0.08, "{coarser} and {exact}");
    }
}

#[test]
fn maxima_bound_every_deeper_level() {
    let scene = scene();
    let deep = TileAddress::at(18, 10.371_3, 46.437);
    for level in [7, 11, 13, 14, 15, 16, 17] {
        let ancestor = deep.ancestor(level).unwrap();
        let bound = combined(&scene, ancestor);
        assert_eq!(bound.maxima_side, 64);
        for deeper in level..=18 {
            let address = deep.ancestor(deeper).unwrap();
            let tile = combined(&scene, address);
            let (x, y, side) = address.place_in_ancestor(level).unwrap();
            let across = side / 512.0;
            for row in (1..514_u32).step_by(3) {
                for column in (1..514_u32).step_by(3) {
                    // Nodes within the tile, at the ancestor's cells; one on an edge belongs to both.
                    let (u, v) = (x + f64::from(column - 1) * across, y + f64::from(row - 1) * across);
                    let height = tile.metres(column, row);
                    if height.is_nan() {
                        continue;
                    }
                    for (u, v) in [(u, v), (u - 1e-9, v - 1e-9)] {
                        if u < 0.0 || v < 0.0 || u >= 512.0 || v >= 512.0 {
                            continue;
                        }
                        let block = (v / 8.0) as usize * 64 + (u / 8.0) as usize;
                        let most = metres(bound.maxima[block], level);
                        assert!(height <= most, "{address} in {ancestor}: {height} over {most}");
                    }
                }
            }
        }
    }
}

#[test]
fn maxima_are_not_far_above() {
    let scene = scene();
    let tile = combined(&scene, TileAddress::at(16, 10.371_3, 46.437));
    let mut gap = 0.0;
    for block in 0..64 * 64 {
        let (row, column) = (block / 64 * 8 + 1, block % 64 * 8 + 1);
        let mut most = VOID;
        for y in row..=row + 8 {
            for x in column..=column + 8 {
                most = most.max(tile.heights[y * tile.side as usize + x]);
            }
        }
        gap += f64::from(tile.maxima[block] - most) * quantum_metres(16);
    }
    assert!(gap / 4096.0 < 4.0, "{} m on average", gap / 4096.0);
}

#[test]
fn without_cover_the_combined_map_is_the_terrain() {
    let mut scene = scene();
    scene.cover = None;
    for level in [8, 16] {
        let address = TileAddress::at(level, 10.4, 46.4);
        assert_eq!(own(&scene, Layer::CombinedElevation, address), own(&scene, Layer::Elevation, address));
    }
    let request = TileRequest::new(
        Layer::Lcc,
        SampleGrid::Lattice(window(Layer::Lcc, TileAddress::at(8, 10.4, 46.4))),
        Format::Png,
    );
    assert!(matches!(make(&scene, &request), Err(RecipeError::NoLayer { layer: "lcc" })));
    assert_eq!((land_cover_levels(&scene), tallest_tree_metres(&scene)), (None, 0.0));
}

#[test]
fn a_box_grows_the_same_trees_as_the_lattice() {
    let scene = scene();
    let address = TileAddress::at(17, 10.371, 46.437);
    let nodes = LatticeWindow::of_tile(address, Registration::Node, 0);
    let exact = Combined::sample(&scene, &SampleGrid::Lattice(nodes)).unwrap();
    let bounds = nodes.pixel_box();
    let grid = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: bounds.west,
        south: bounds.south,
        east: bounds.east,
        north: bounds.north,
        width: nodes.width,
        height: nodes.height,
    };
    let boxed = Combined::sample(&scene, &grid).unwrap();
    let differing = |a: &[f32], b: &[f32]| {
        a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 0.02).count() as f64 / a.len() as f64
    };
    let share = differing(&exact.heights, &boxed.heights);
    assert!(share < 1e-3, "{share}");
    // In bands it is the same map.
    let halves: Vec<f32> = [band(&grid, 0, 200), band(&grid, 200, 313)]
        .iter()
        .flat_map(|part| Combined::sample(&scene, part).unwrap().heights)
        .collect();
    assert!(differing(&boxed.heights, &halves) < 1e-3);
    let inner = Combined::sample(&scene, &with_margin(&grid, 1)).unwrap().heights;
    let stride = nodes.width as usize + 2;
    assert!((inner[stride + 1] - boxed.heights[0]).abs() < 0.05);
}

#[test]
fn a_projected_box_grows_the_same_trees() {
    let scene = scene();
    let crs = crate::source::crs::Crs::from_epsg(32632).unwrap();
    let (x, y) = crs.from_geographic(10.371, 46.437).unwrap();
    let grid = SampleGrid::Box {
        crs: RequestCrs::Projected(32632),
        west: x,
        south: y - 100.0,
        east: x + 100.0,
        north: y,
        width: 100,
        height: 100,
    };
    let heights = Combined::sample(&scene, &grid).unwrap().heights;
    let mut canopies = 0;
    for index in (0..10_000).step_by(37) {
        let (column, row) = (index % 100, index / 100);
        let (longitude, latitude) =
            crs.to_geographic(x + f64::from(column) + 0.5, y - f64::from(row) - 0.5).unwrap();
        let info = point(&scene, longitude, latitude).unwrap();
        let wanted = info.terrain.unwrap() + info.canopy.unwrap();
        assert!((f64::from(heights[index as usize]) - wanted).abs() < 0.02);
        canopies += u32::from(info.canopy.unwrap() > 2.0);
    }
    assert!(canopies > 30, "{canopies}");
}

#[test]
fn classes_are_the_same_on_all_levels() {
    let scene = scene();
    let levels = land_cover_levels(&scene).unwrap();
    assert_eq!((levels.l0, levels.l1, levels.l2, levels.bits), (13, 12, 11, 16));
    let parent = TileAddress::at(levels.l2, 10.371, 46.437);
    let packed = LandCoverTile::decode(&own(&scene, Layer::Lcc, parent)).unwrap();
    assert_eq!((packed.step, packed.stands.as_ref()), (Step::Packed, None));
    for (quarter, child) in parent.children().into_iter().enumerate() {
        let classes = LandCoverTile::decode(&own(&scene, Layer::Lcc, child)).unwrap();
        let stands = classes.stands.as_ref().unwrap();
        assert_eq!(classes.step, Step::Classes);
        let (left, top) = (quarter % 2 * 256, quarter / 2 * 256);
        for row in 0..256 {
            for column in 0..256 {
                let four = classes.bits.unpack(packed.codes[(top + row) * 512 + left + column]);
                for (y, pair) in four.iter().enumerate() {
                    for (x, &class) in pair.iter().enumerate() {
                        let index = (2 * row + y) * 512 + 2 * column + x;
                        assert_eq!(u32::from(class), classes.codes[index]);
                        assert!(class == 0 || stands.closures[index] > 0);
                    }
                }
            }
        }
        let grandchild = child.children()[2];
        let repeated = LandCoverTile::decode(&own(&scene, Layer::Lcc, grandchild)).unwrap();
        assert_eq!(repeated.step, Step::Repeated);
        for index in 0..512 * 512 {
            let (column, row) = (index % 512 / 2, 256 + index / 512 / 2);
            assert_eq!(repeated.codes[index], classes.codes[row * 512 + column]);
        }
    }
    // Coarser: the class of the level-1 cell south-east of the middle.
    let coarse = TileAddress::at(9, 10.371, 46.437);
    let tile = LandCoverTile::decode(&own(&scene, Layer::Lcc, coarse)).unwrap();
    let cells = window(Layer::Lcc, coarse);
    for index in (0..512 * 512).step_by(997) {
        let place = |first: i64, offset: i64| (first + offset) * 8 + 4;
        let one = LatticeWindow {
            level: 12,
            first_column: place(cells.first_column, index % 512),
            first_row: place(cells.first_row, index / 512),
            width: 1,
            height: 1,
            ..cells
        };
        let cover = stands::cover_of_cells(&scene, &levels, &one).unwrap()[0];
        assert_eq!(tile.codes[index as usize], u32::from(cover.species));
    }
}

#[test]
fn a_place_has_one_class_on_every_level() {
    let scene = scene();
    let levels = land_cover_levels(&scene).unwrap();
    let class_at_level_1 = |column: i64, row: i64| {
        let one = LatticeWindow {
            level: levels.l1,
            registration: Registration::Cell,
            first_column: column,
            first_row: row,
            width: 1,
            height: 1,
        };
        stands::cover_of_cells(&scene, &levels, &one).unwrap()[0]
    };
    let mut wooded = 0;
    for level in 4..=levels.l1 + 3 {
        let whole = LatticeWindow::of_tile(TileAddress::at(level, 10.371, 46.437), Registration::Cell, 0);
        let (column, row) = match level {
            // The box of the land cover is smaller than a tile.
            0..=8 => {
                let step = whole.step_degrees();
                (((10.371 + 180.0) / step) as i64 - 8, ((90.0 - 46.437) / step) as i64 - 8)
            }
            _ => (whole.first_column + 200, whole.first_row + 300),
        };
        let cells = LatticeWindow { first_column: column, first_row: row, width: 16, height: 16, ..whole };
        let classes = stands::cover_of_cells(&scene, &levels, &cells).unwrap();
        for (index, class) in classes.iter().enumerate() {
            let (column, row) = (column + index as i64 % 16, row + index as i64 / 16);
            // The level-1 cell south-east of the cell's middle, or the one that the cell is part of.
            let place = |cell: i64| {
                if level >= levels.l1 {
                    return cell >> (level - levels.l1);
                }
                (2 * cell + 1) << (levels.l1 - level - 1)
            };
            assert_eq!(*class, class_at_level_1(place(column), place(row)), "level {level}");
        }
        wooded += usize::from(classes.iter().any(|cover| cover.species > 0));
    }
    assert!(wooded > 4, "{wooded}");
}

#[test]
fn a_class_beyond_the_table_is_refused() {
    let mut scene = scene();
    struct Strange(crate::source::FieldExtent);
    impl crate::source::CoverField for Strange {
        fn extent(&self) -> &crate::source::FieldExtent {
            &self.0
        }
        fn sample(&self, _: &SampleGrid, out: &mut [Cover]) -> Result<(), SourceError> {
            out.fill(Cover { species: 16, closure: 255, height: 0, surface: 0 });
            Ok(())
        }
    }
    scene.cover = Some(Arc::new(Strange(extent(10.0, 46.0, 11.0, 47.0, 15.0))));
    let grid = SampleGrid::Lattice(window(Layer::Lcc, TileAddress::at(12, 10.4, 46.4)));
    let error = make(&scene, &TileRequest::new(Layer::Lcc, grid, Format::Own)).unwrap_err();
    assert!(matches!(error, RecipeError::Class(_)), "{error}");
    // The other layers do without its trees.
    assert!(combined(&scene, TileAddress::at(15, 10.4, 46.4)).surface.is_some());
}

#[test]
fn voids_stay_voids() {
    let mut scene = scene();
    let bounds = extent(10.0, 46.0, 11.0, 47.0, 30.0);
    scene.height = Arc::new(Hills { extent: bounds, void_west: 10.371 });
    scene.cover = Some(Arc::new(Woods { extent: extent(10.0, 46.0, 11.0, 47.0, 15.0), closed: true }));
    for level in [12, 16] {
        let address = TileAddress::at(level, 10.371, 46.437);
        let window = window(Layer::CombinedElevation, address);
        let tile = combined(&scene, address);
        for column in 0..tile.side {
            let longitude = window.longitude(window.first_column + i64::from(column));
            assert_eq!(tile.heights[(100 * tile.side + column) as usize] == VOID, longitude < 10.371);
        }
        let mut request =
            TileRequest::new(Layer::CombinedElevation, SampleGrid::Lattice(window), Format::Bil16);
        let shorts = |request: &TileRequest| -> Vec<i16> {
            make(&scene, request).unwrap().chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect()
        };
        assert_eq!(shorts(&request)[0], 0);
        request.nodata = -9999.0;
        assert_eq!(shorts(&request)[0], -9999);
        request.format = Format::Png;
        request.background = [1, 2, 3];
        let pixel = |request: &TileRequest| {
            let picture = image::load_from_memory(&make(&scene, request).unwrap()).unwrap().to_rgba8();
            (picture.get_pixel(0, 0).0, picture.get_pixel(514, 0).0[3])
        };
        assert_eq!(pixel(&request), ([1, 2, 3, 255], 255));
        request.transparent = true;
        assert_eq!(pixel(&request), ([0; 4], 255));
    }
    let info = point(&scene, 10.1, 46.437).unwrap();
    assert_eq!((info.terrain, info.canopy, info.class), (None, None, Some(1)));
}

#[test]
fn the_photo_is_filled_where_it_has_nothing() {
    let scene = scene();
    // The photo begins at 10.5°.
    let address = TileAddress::at(9, 10.5, 46.5);
    let grid = SampleGrid::Lattice(window(Layer::Texture, address));
    let plain = texture::pixels(&scene, &grid, false).unwrap();
    let filled = texture::pixels(&scene, &grid, true).unwrap();
    assert!(plain.contains(&[0; 4]) && plain.iter().any(|pixel| pixel[3] == 255));
    for (plain, filled) in plain.iter().zip(&filled) {
        if plain[3] == 255 {
            assert_eq!(plain, filled);
        }
    }
    let gained =
        plain.iter().zip(&filled).filter(|(plain, filled)| plain[3] == 0 && filled[3] == 255).count();
    assert!(gained > 1_000, "{gained}");
    for format in [Format::Jpeg, Format::WebP, Format::Png] {
        let bytes = make(&scene, &TileRequest::new(Layer::Texture, grid.clone(), format)).unwrap();
        let picture = image::load_from_memory(&bytes).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (520, 520));
    }
}

#[test]
fn a_geotiff_says_where_it_is() {
    let scene = scene();
    let address = TileAddress::at(12, 10.4, 46.4);
    let nodes = LatticeWindow::of_tile(address, Registration::Node, 0);
    let request = TileRequest::new(Layer::Elevation, SampleGrid::Lattice(nodes), Format::GeoTiff);
    let bytes = make(&scene, &request).unwrap();
    let mut decoder = tiff::decoder::Decoder::new(std::io::Cursor::new(&bytes)).unwrap();
    assert_eq!(decoder.dimensions().unwrap(), (513, 513));
    let tie = decoder.get_tag_f64_vec(tiff::tags::Tag::ModelTiepointTag).unwrap();
    assert_eq!((tie[3], tie[4]), (nodes.pixel_box().west, nodes.pixel_box().north));
    assert_eq!(decoder.get_tag_ascii_string(tiff::tags::Tag::GdalNodata).unwrap(), "nan");
    let tiff::decoder::DecodingResult::F32(samples) = decoder.read_image().unwrap() else {
        panic!("not f32")
    };
    assert_eq!(samples, elevation::sample(&scene, &request.grid).unwrap());
}

#[test]
fn what_is_not_made_is_refused() {
    let scene = scene();
    let boxed = SampleGrid::Box {
        crs: RequestCrs::WebMercator,
        west: 1.15e6,
        south: 5.85e6,
        east: 1.16e6,
        north: 5.86e6,
        width: 64,
        height: 64,
    };
    for row in LAYERS {
        for format in Format::ALL {
            let result = make(&scene, &TileRequest::new(row.layer, boxed.clone(), format));
            match result {
                Ok(bytes) => assert!(format.serves(row.layer) && !bytes.is_empty()),
                Err(RecipeError::NotATile { .. }) => assert_eq!(format, Format::Own),
                Err(error @ RecipeError::Format { .. }) => {
                    assert!(!format.serves(row.layer));
                    assert!(error.to_string().contains("its formats are image/png"), "{error}");
                }
                Err(error) => panic!("{error}"),
            }
        }
    }
    // A tile of the wrong registration is none of ours.
    let cells = LatticeWindow::of_tile(TileAddress::at(12, 10.4, 46.4), Registration::Cell, 0);
    let request = TileRequest::new(Layer::Elevation, SampleGrid::Lattice(cells), Format::Own);
    assert!(matches!(make(&scene, &request), Err(RecipeError::NotATile { .. })));
    let strange = SampleGrid::Box {
        crs: RequestCrs::Projected(1),
        west: 0.0,
        south: 0.0,
        east: 10.0,
        north: 10.0,
        width: 8,
        height: 8,
    };
    let error =
        make(&scene, &TileRequest::new(Layer::CombinedElevation, strange, Format::Bil32)).unwrap_err();
    assert!(error.is_request() && error.to_string().starts_with("EPSG:1"), "{error}");
}

#[test]
fn the_ends_of_the_earth_are_ordinary() {
    let mut scene = scene_of(extent(-180.0, -90.0, 180.0, 90.0, 30.0));
    scene.cover = Some(Arc::new(Woods { extent: extent(-180.0, -90.0, 180.0, 90.0, 30.0), closed: true }));
    for (longitude, latitude) in [(-180.0, 90.0), (179.99, -90.0), (0.0, 89.9), (12.0, -86.45), (12.0, 86.2)]
    {
        for level in [0, 3, 13, 15, 22, 26] {
            let address = TileAddress::at(level, longitude, latitude);
            for row in LAYERS {
                let grid = SampleGrid::Lattice(window(row.layer, address));
                for format in [Format::Own, Format::Png] {
                    if format.serves(row.layer) {
                        let small = level != 0 && level != 15;
                        if small && format == Format::Png {
                            continue;
                        }
                        make(&scene, &TileRequest::new(row.layer, grid.clone(), format)).unwrap();
                    }
                }
            }
        }
        point(&scene, longitude, latitude).unwrap();
    }
    assert_eq!(point(&scene, f64::NAN, 0.0).unwrap().terrain, None);
    let empty = SampleGrid::Box {
        crs: RequestCrs::Geographic,
        west: 10.0,
        south: 46.0,
        east: 10.0,
        north: 46.0,
        width: 4,
        height: 4,
    };
    for row in LAYERS {
        for format in Format::ALL {
            if format.serves(row.layer) && format != Format::Own {
                make(&scene, &TileRequest::new(row.layer, empty.clone(), format)).unwrap();
            }
        }
    }
}
