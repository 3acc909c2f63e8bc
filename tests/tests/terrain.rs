//! The terrain pass over tiles of several levels: its twin against the exact geodetic conversion in f64, and
//! the GPU against the twin.

use glam::UVec2;
use treeline_core::camera::GeographicCamera;
use treeline_core::tile::TileAddress;
use treeline_shaders::twin::World;
use treeline_shaders::twin::terrain::{cast_ray, pixel_share, view_ray};
use treeline_tests::terrain_gpu::terrain_by_gpu;
use treeline_tests::tile_world::{Frame, TileWorld, alpine_height};

const SIZE: [u32; 2] = [128, 80];

fn world(own_share: &dyn Fn(TileAddress) -> f32) -> TileWorld {
    let root = TileAddress::at(11, 11.0, 47.0);
    let south_east = TileAddress { level: 11, row: root.row + 1, column: root.column + 1 };
    let split = |square: TileAddress| match square.level {
        11 => square.column == root.column + 1 || square.row == root.row + 1,
        12 => (square.column + square.row).is_multiple_of(3),
        _ => false,
    };
    // A corner of the last root tile has nothing.
    let empty = move |square: TileAddress| square == south_east.children()[3];
    TileWorld::new(root, [2, 2], &alpine_height, &split, &empty, own_share)
}

fn camera(lon: f64, lat: f64, height: f64, heading_deg: f64, pitch_deg: f64) -> GeographicCamera {
    GeographicCamera { lon, lat, height, heading_deg, pitch_deg, fov_y_deg: 50.0 }
}

/// An eighth of a cell of level 11, along a ray that falls at 80°, metres.
const WALL_TOLERANCE: f64 = 15.0;

/// What is wrong with a pixel's hit, or nothing.
fn fault(world: &TileWorld, frame: &Frame, camera: &GeographicCamera, pixel: UVec2) -> Option<String> {
    let hit = world.by_twin(frame, pixel);
    let direction = frame.direction(camera, pixel);
    let far =
        if hit.distance < 0.0 { 60_000.0_f64.max(3.0 * camera.height) } else { f64::from(hit.distance) };
    // March from where the ray may first be low enough: the first place that is under the surface by more than
    // the frames' residual on the steepest slope that there is.
    let tolerance = 3.0;
    let steps = 2000;
    for step in 1..steps {
        let distance = far * f64::from(step) / f64::from(steps);
        if let Some(clearance) = world.clearance(frame, direction, distance)
            // A ray from space that comes in under the data, deep in the Earth, meets no wall.
            && (-2000.0..-tolerance).contains(&clearance)
        {
            return Some(format!("{pixel}: {clearance} m under ground at {distance} m, hit {hit:?}"));
        }
    }
    if hit.distance >= 0.0 {
        // At a wall the ray is under the surface behind it; frames know where it stands to 1/8 cell.
        let clearance = world.clearance(frame, direction, far).unwrap_or(f64::INFINITY);
        let after = world.clearance(frame, direction, far + WALL_TOLERANCE).unwrap_or(f64::INFINITY);
        if clearance > tolerance && after > tolerance {
            return Some(format!("{pixel}: hit {clearance} m over the ground at {far} m: {hit:?}"));
        }
    }
    None
}

fn check(name: &str, world: &TileWorld, camera: &GeographicCamera) -> usize {
    let frame = world.frame(camera, SIZE);
    let (mut faults, mut hits, mut fetches, mut most) = (Vec::new(), 0, 0, 0);
    for index in 0..SIZE[0] * SIZE[1] {
        let pixel = UVec2::new(index % SIZE[0], index / SIZE[0]);
        let hit = world.by_twin(&frame, pixel);
        hits += usize::from(hit.distance >= 0.0);
        fetches += hit.fetches;
        most = most.max(hit.fetches);
        // One pixel of a few suffices: marching is slow.
        if index % 17 == 0 {
            faults.extend(fault(world, &frame, camera, pixel));
        }
    }
    let (distances, words) = terrain_by_gpu(world, &frame, false);
    let mut other = 0;
    for (index, (&distance, words)) in distances.iter().zip(&words).enumerate() {
        let index = index as u32;
        let hit = world.by_twin(&frame, UVec2::new(index % SIZE[0], index / SIZE[0]));
        // Contraction and division differ: at silhouettes the two may see different things.
        let alike = if hit.distance < 0.0 {
            distance < 0.0 && words[0] == hit.leaf
        } else {
            (distance - hit.distance).abs() <= 1e-3 * hit.distance
        };
        other += u32::from(!alike);
    }
    println!("{name}: the GPU sees {other} pixels otherwise");
    assert!(other * 500 < SIZE[0] * SIZE[1], "{name}: the GPU sees {other} pixels otherwise than the twin");
    println!(
        "{name}: {hits} hits, {} faults, fetches {:.1}, at most {most}",
        faults.len(),
        f64::from(fetches) / f64::from(SIZE[0] * SIZE[1])
    );
    for fault in faults.iter().take(5) {
        println!("  {fault}");
    }
    assert!(faults.is_empty(), "{name}: {} faults, first {}", faults.len(), faults[0]);
    hits
}

#[test]
fn rays_go_from_leaf_to_leaf_as_the_exact_conversion_says() {
    let world = world(&|_| 1.0);
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let (lon, lat) = (11.02, 46.97);
    let ground = |lon, lat| alpine_height(lon, lat);
    let from_hill = camera(lon, lat, ground(lon, lat) + 300.0, 40.0, -10.0);
    check("from a hill", &world, &from_hill);
    let low = camera(lon, lat, ground(lon, lat) + 5.0, 250.0, 0.0);
    check("from the ground", &world, &low);
    let up = camera(lon, lat, ground(lon, lat) + 2.0, 120.0, 30.0);
    check("looking up", &world, &up);
    let down = camera(lon, lat, 3500.0, 0.0, -90.0);
    assert_eq!(check("straight down", &world, &down), pixels, "no hole across levels");
    let high = camera(lon, lat, 9000.0, 17.0, -80.0);
    check("from above everything", &world, &high);
    let beside = camera(10.7, 46.9, 2600.0, 80.0, -8.0);
    assert!(check("from beside the data", &world, &beside) > 500);
    let mut space = camera(11.0, 46.0, 700_000.0, 0.0, -80.9);
    space.fov_y_deg = 4.0;
    assert!(check("from space", &world, &space) > 300);
}

#[test]
fn a_tile_that_fades_in_leaves_no_hole() {
    let world = world(&|square| if square.level == 13 { 0.4 } else { 1.0 });
    let (lon, lat) =
        world.squares().find(|square| square.level == 13).expect("a square that fades").bounds().centre();
    let camera = camera(lon, lat, 3500.0, 0.0, -90.0);
    let frame = world.frame(&camera, SIZE);
    let (mut own, mut parents) = (0, 0);
    for index in 0..SIZE[0] * SIZE[1] {
        let hit = world.by_twin(&frame, UVec2::new(index % SIZE[0], index / SIZE[0]));
        assert!(hit.distance > 0.0, "a hole at pixel {index}");
        let leaf = &frame.leaves[hit.leaf as usize];
        if leaf.stand_in != u32::MAX {
            own += 1;
        } else if leaf.cells == [256, 256] {
            parents += 1;
        }
    }
    let share = f64::from(own) / f64::from(own + parents);
    assert!((0.3..0.5).contains(&share), "{own} of its own, {parents} of the parent");
}

/// From inside the ground rays go out to the surface's other side, and those that can be told what lies wholly above them
/// find the same with far fewer fetches.
#[test]
fn an_eye_below_the_surface_sees_its_other_side_and_gets_there_soon() {
    let world = world(&|_| 1.0);
    let (lon, lat) = (11.02, 46.97);
    for (depth, heading, pitch) in [(20.0, 40.0, -2.0), (400.0, 250.0, 10.0), (60.0, 120.0, -40.0)] {
        let camera = camera(lon, lat, alpine_height(lon, lat) - depth, heading, pitch);
        let frame = world.frame(&camera, SIZE);
        let plain = world.bound(&frame);
        let with_minima = World { use_minima: true, ..plain };
        let (distances, words) = terrain_by_gpu(&world, &frame, true);
        let (mut hits, mut other, mut fetches) = (0, 0, [0_u64; 2]);
        for (index, (&distance, words)) in distances.iter().zip(&words).enumerate() {
            let pixel = UVec2::new(index as u32 % SIZE[0], index as u32 / SIZE[0]);
            let cast = |world| cast_ray(world, &view_ray(&frame.view, pixel), pixel_share(pixel));
            let (slow, quick) = (cast(&plain), cast(&with_minima));
            assert_eq!(slow.distance < 0.0, quick.distance < 0.0, "{pixel}: {slow:?} {quick:?}");
            assert!(
                (slow.distance - quick.distance).abs() <= 1e-4 * slow.distance.abs(),
                "{slow:?} {quick:?}"
            );
            hits += usize::from(slow.distance >= 0.0);
            other += usize::from((distance - quick.distance).abs() > 1e-3 * quick.distance.abs());
            fetches[0] += u64::from(slow.fetches);
            fetches[1] += u64::from(words[3]);
        }
        println!("{depth} m under the ground: {hits} hits, {other} otherwise, {fetches:?} fetches");
        assert!(other * 500 < distances.len(), "the GPU sees {other} pixels otherwise");
        assert!(hits > distances.len() / 20 || pitch < -20.0, "{hits} hits");
        assert!(2 * fetches[1] < fetches[0], "{fetches:?}");
    }
}
