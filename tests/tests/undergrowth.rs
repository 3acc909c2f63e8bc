//! Undergrowth: the GPU's plants are the twin's, bit for bit; they change the ground near the eye and nothing else; and
//! where none is near or wanted nothing is made for it.

use glam::Vec4;
use image::RgbaImage;
use std::collections::{BTreeSet, HashMap};
use treeline_client::engine::{Engine, EngineOptions, ViewRequest, Weather};
use treeline_client::headless::trees::drawn_depths;
use treeline_client::headless::undergrowth::plants;
use treeline_client::headless::{self, AdapterChoice, Session};
use treeline_client::stream::StreamOptions;
use treeline_client::stream::decode::{self, ELEVATION_SIDE, ElevationPixels};
use treeline_core::camera::GeographicCamera;
use treeline_core::layer::Layer;
use treeline_core::query::get_map_query;
use treeline_core::scene::SceneDescription;
use treeline_core::seeds::metaseed::{Community, Kind};
use treeline_core::seeds::season::NamedSeason;
use treeline_core::sun::unix_seconds_from_rfc3339;
use treeline_core::tile::TileAddress;
use treeline_shaders::layout::VOID_HEIGHT;
use treeline_shaders::twin::select_undergrowth::{PlantWorld, Planted, SurfaceTexels};
use treeline_shaders::twin::{Texels, World};
use treeline_shaders::undergrowth::{BINS, PLACE_ZERO};
use treeline_tests::picture::{contrast, difference, keep};
use treeline_tests::router_tiles::RouterTiles;

const SIZE: [u32; 2] = [240, 160];

/// At a height over the ground (metres).
fn at(
    tiles: &RouterTiles,
    [lon, lat]: [f64; 2],
    above: f64,
    heading_deg: f64,
    pitch_deg: f64,
) -> GeographicCamera {
    let half = 4e-6;
    let url = format!(
        "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=elevation&STYLES=&CRS=CRS:84&BBOX={},{},{},{}&WIDTH=1&HEIGHT=1&FORMAT=application/bil32",
        lon - half,
        lat - half,
        lon + half,
        lat + half
    );
    let ground: Vec<f32> = bytemuck::pod_collect_to_vec(&tiles.get(&url).unwrap());
    GeographicCamera {
        lon,
        lat,
        height: f64::from(ground[0]) + above,
        heading_deg,
        pitch_deg,
        fov_y_deg: 50.0,
    }
}

/// An alp with a view; a wood by a lake; the upper edge of a wood; stones and grass.
const ALP: [f64; 2] = [11.070_84, 46.953_68];
const WOOD: [f64; 2] = [10.930_225, 46.910_39];
const EDGE: [f64; 2] = [10.9345, 46.9145];
const STONES: [f64; 2] = [10.965_72, 46.985_04];

fn request(camera: GeographicCamera, time: Option<f64>) -> ViewRequest {
    ViewRequest {
        camera,
        width: SIZE[0],
        height: SIZE[1],
        sun_unix_seconds: time,
        shadow_steps: 8,
        weather: Weather::default(),
    }
}

fn session(scene: SceneDescription, undergrowth_metres: f64, tree_metres: f64) -> Session {
    let gpu = headless::open(AdapterChoice::Software).unwrap();
    let options = EngineOptions {
        stream: StreamOptions { fade_seconds: 0.0, ..StreamOptions::default() },
        tree_metres: Some(tree_metres),
        undergrowth_metres: Some(undergrowth_metres),
        uploads_per_step: usize::MAX,
        count_fetches: true,
        ..EngineOptions::default()
    };
    Session::new(Engine::new(gpu, scene, options).unwrap(), SIZE[0], SIZE[1], 2).unwrap()
}

/// A settled session with undergrowth and trees up to such distances.
fn settled(tiles: &RouterTiles, view: &ViewRequest, undergrowth_metres: f64, tree_metres: f64) -> Session {
    let mut session = session(tiles.scene().unwrap(), undergrowth_metres, tree_metres);
    session.settle(view, tiles).unwrap();
    assert_eq!(session.engine.gpu().error(), None);
    session
}

fn picture(session: &mut Session) -> RgbaImage {
    RgbaImage::from_raw(SIZE[0], SIZE[1], session.capture().unwrap().rgba).unwrap()
}

/// The frame's tiles by slot, as the server gave them.
struct Tiles(HashMap<u32, ElevationPixels>);

impl Tiles {
    fn of(tiles: &RouterTiles, engine: &Engine) -> Self {
        let tables = engine.drawn_tables().unwrap();
        let revision = &engine.scene().revision;
        let mut found: HashMap<u32, ElevationPixels> = HashMap::new();
        for (leaf, tile) in tables.leaves.iter().zip(&tables.leaf_tiles) {
            let Some(tile) = *tile else { continue };
            found.entry(leaf.slot).or_insert_with(|| Self::get(tiles, tile, revision));
        }
        Self(found)
    }

    fn get(tiles: &RouterTiles, tile: TileAddress, revision: &str) -> ElevationPixels {
        let url = format!("/wms?{}", get_map_query(Layer::CombinedElevation, tile, revision));
        decode::elevation(&tiles.get(&url).unwrap(), tile).unwrap()
    }

    fn index(x: i32, y: i32) -> Option<usize> {
        let side = ELEVATION_SIDE as i32;
        ((0..side).contains(&x) && (0..side).contains(&y)).then_some((y * side + x) as usize)
    }
}

impl Texels for Tiles {
    fn height(&self, slot: u32, x: i32, y: i32) -> f32 {
        Self::index(x, y).map_or(VOID_HEIGHT, |index| self.0[&slot].summary.heights[index])
    }

    fn maximum(&self, _slot: u32, _mip: u32, _x: i32, _y: i32) -> f32 {
        unreachable!("no ray is cast")
    }

    fn minimum(&self, _slot: u32, _mip: u32, _x: i32, _y: i32) -> f32 {
        unreachable!("no ray is cast")
    }

    fn levels(&self) -> u32 {
        9
    }
}

impl SurfaceTexels for Tiles {
    fn surface(&self, slot: u32, x: i32, y: i32) -> [u8; 2] {
        let surface = self.0[&slot].surface.as_ref();
        let pairs = surface.map_or(&[][..], |surface| surface.as_chunks::<2>().0);
        Self::index(x, y).and_then(|index| pairs.get(index)).copied().unwrap_or_default()
    }
}

#[test]
fn the_twin_selects_the_same_plants_in_the_same_order() {
    let tiles = RouterTiles::built_in().unwrap();
    for (place, above, pitch, kinds, communities) in [
        (ALP, 1.7, -6.0, vec![Kind::Grass, Kind::Flower], vec![Community::Meadow]),
        (WOOD, 1.7, -8.0, vec![Kind::Fern, Kind::Shrub, Kind::Wood, Kind::Stone], vec![Community::Wood]),
        (EDGE, 10.0, -30.0, vec![Kind::Grass, Kind::Shrub], vec![Community::Wood, Community::Meadow]),
        (STONES, 1.7, -8.0, vec![Kind::Stone, Kind::Grass], vec![Community::Rock]),
    ] {
        let view = request(at(&tiles, place, above, 330.0, pitch), None);
        let session = settled(&tiles, &view, 50.0, 120.0);
        let engine = &session.engine;
        let seen = engine.drawn_undergrowth().unwrap();
        let (found, metaseeds) = plants(engine).unwrap();
        let texels = Tiles::of(&tiles, engine);
        let tables = engine.drawn_tables().unwrap();
        let mut frame = seen.frame;
        // Trees are drawn up to 120 m.
        frame.canopy_gone = 0.62 * 120.0;
        let world = PlantWorld {
            world: World {
                view: engine.drawn_view().unwrap(),
                nodes: &tables.nodes,
                leaves: &tables.leaves,
                texels: &texels,
                sheet: None,
                use_minima: false,
            },
            frame: &frame,
        };
        let (expected, expected_metaseeds) = world.select(&seen.blocks);
        assert_eq!((found.len(), expected.len()), (BINS as usize, BINS as usize));
        let (mut all, mut apart) = (0, 0);
        let mut known = (BTreeSet::new(), BTreeSet::new());
        for (found, expected) in found.iter().zip(&expected) {
            assert!(found.iter().map(|plant| plant.seed).is_sorted(), "by block, metaseed and member");
            let by_seed: HashMap<u32, &Planted> = expected.iter().map(|plant| (plant.seed, plant)).collect();
            all += expected.len();
            apart += found.len().abs_diff(expected.len());
            for plant in found {
                // Rounding may decide otherwise at the very edge of a test.
                let Some(twin) = by_seed.get(&plant.seed) else {
                    apart += 1;
                    continue;
                };
                let member = &twin.member;
                let place = [plant.place & 0xffff, plant.place >> 16].map(|units| units as i32 - PLACE_ZERO);
                assert_eq!(place, [member.x, member.y]);
                assert_eq!((plant.size & 0xffff, plant.look as u8), (member.size, member.rotation));
                assert_eq!(plant.look >> 8 & 0xff, member.bits >> 24);
                assert_eq!(plant.look >> 16 & 0xff, member.kind as u32);
                assert_eq!(plant.look >> 24 & 15, twin.community as u32);
                assert!((plant.foot_size[3] - member.size as f32 / 1024.0 * twin.grown).abs() < 2e-3);
                let off = (Vec4::from(plant.foot_size).truncate() - twin.foot).length();
                assert!(off < 5e-3, "{off} m");
                known.0.insert(member.kind as u8);
                known.1.insert(twin.community as u8);
            }
        }
        println!("{place:?}: {all} plants of {metaseeds} metaseeds, {apart} apart");
        assert!(all > 300 && apart * 300 <= all, "{apart} of {all}");
        assert!(metaseeds.abs_diff(expected_metaseeds) * 100 <= metaseeds);
        assert!(kinds.iter().all(|&kind| known.0.contains(&(kind as u8))), "{known:?}");
        assert!(communities.iter().all(|&kind| known.1.contains(&(kind as u8))), "{known:?}");
    }
}

/// The same picture twice; another one than without, where the ground is near, and nowhere else; the same depths and
/// trees; no darker and no lighter a meadow.
#[test]
fn a_meadow_is_grown_over_and_the_rest_is_as_it_was() {
    let tiles = RouterTiles::built_in().unwrap();
    let view = request(at(&tiles, ALP, 1.7, 200.0, -4.0), None);
    let mut grown = settled(&tiles, &view, 60.0, 300.0);
    let mut again = settled(&tiles, &view, 60.0, 300.0);
    let mut bare = settled(&tiles, &view, 0.0, 300.0);
    let (first, second, before) = (picture(&mut grown), picture(&mut again), picture(&mut bare));
    assert_eq!(first, second);
    assert_eq!(grown.capture().unwrap().distance, bare.capture().unwrap().distance);
    assert_eq!(grown.trees().unwrap(), bare.trees().unwrap());
    let crop = |picture: &RgbaImage, from: u32, to: u32| {
        image::imageops::crop_imm(picture, 0, from, SIZE[0], to - from).to_image()
    };
    // The meadow's edge lies at three fifths of the height.
    let (sky, meadow) = ((0, SIZE[1] / 2), (3 * SIZE[1] / 4, SIZE[1]));
    let above = difference(&crop(&first, sky.0, sky.1), &crop(&before, sky.0, sky.1), 8);
    let (near, flat) = (crop(&first, meadow.0, meadow.1), crop(&before, meadow.0, meadow.1));
    let below = difference(&near, &flat, 8);
    let mean = |picture: &RgbaImage| {
        [0, 1, 2].map(|channel| {
            let sum: f64 = picture.pixels().map(|pixel| f64::from(pixel[channel])).sum();
            sum / f64::from(picture.width() * picture.height())
        })
    };
    println!(
        "{above:?} {below:?} {:?} {:?} {} {}",
        mean(&near),
        mean(&flat),
        contrast(&near),
        contrast(&flat)
    );
    let path = keep("meadow", &first).unwrap();
    assert_eq!(above.share_over, 0.0, "{}", path.display());
    assert!(below.share_over > 0.6 && below.mean > 8.0, "{below:?}");
    assert!(contrast(&near) > 1.6 * contrast(&flat), "blades have light and dark");
    // Green leaves take more of the blue than the photo's pale ground.
    for ((with, without), most) in mean(&near).into_iter().zip(mean(&flat)).zip([0.25, 0.25, 0.4]) {
        assert!((with / without - 1.0).abs() < most, "{:?} {:?}", mean(&near), mean(&flat));
    }
}

/// At 1.7 m below crowns: the lower half of the picture is the ground before the eye, not what lies behind the hill.
#[test]
fn an_eye_below_the_canopy_sees_the_ground_before_it() {
    let tiles = RouterTiles::built_in().unwrap();
    let view = request(at(&tiles, [10.9340, 46.9118], 1.7, 120.0, -12.0), None);
    let session = settled(&tiles, &view, 40.0, 200.0);
    let eye = &view.camera;
    let surface = session.engine.ground_height(eye.lon, eye.lat).unwrap();
    assert!(surface > eye.height + 2.0, "a crown is over the eye: {surface} {}", eye.height);
    let depths = drawn_depths(&session.engine).unwrap().unwrap();
    let lower = &depths[depths.len() / 2..];
    let farthest = lower.iter().copied().fold(0.0, f32::max);
    println!("the ground lies up to {farthest} m away");
    assert!(farthest < 60.0, "{farthest}");
}

/// Among trees the load map sees crowns' walls and the inside of the hill: the quadtree chooses the tiles, so that the ground
/// between the trunks is as fine as from above; and rays from below the surface do not creep through the hill.
#[test]
fn among_trees_the_ground_between_them_is_fine() {
    let tiles = RouterTiles::built_in().unwrap();
    let view = request(at(&tiles, [10.9340, 46.9118], 1.7, 300.0, -2.0), None);
    let session = settled(&tiles, &view, 40.0, 200.0);
    let hits = session.capture().unwrap().hit;
    let engine = &session.engine;
    let tables = engine.drawn_tables().unwrap();
    let tile_under = |level| TileAddress::at(level, view.camera.lon, view.camera.lat);
    let finest = engine.scene().layer(Layer::CombinedElevation).unwrap().maximum_level;
    let is_drawn = tables.leaf_tiles.iter().flatten().any(|&tile| tile == tile_under(finest));
    assert!(is_drawn, "level {finest} is drawn about the eye: {:?}", tables.leaf_tiles);
    let fetches = hits.iter().map(|hit| f64::from(hit[3])).sum::<f64>() / hits.len() as f64;
    println!("{fetches:.1} fetches a ray");
    assert!((1.0..80.0).contains(&fetches), "{fetches}");
}

#[test]
fn where_none_is_wanted_or_near_nothing_is_compiled_or_allocated() {
    let tiles = RouterTiles::built_in().unwrap();
    let low = at(&tiles, ALP, 1.7, 200.0, -10.0);
    let high = at(&tiles, ALP, 45.0, 200.0, -60.0);
    let bare = SceneDescription { vegetation: false, land_cover: None, ..tiles.scene().unwrap() };
    let full = tiles.scene().unwrap();
    for (scene, camera, metres) in [(&full, low, 0.0), (&full, high, 40.0), (&bare, low, 40.0)] {
        let mut session = session(scene.clone(), metres, 0.0);
        session.settle(&request(camera, None), &tiles).unwrap();
        let stats = session.engine.stats();
        assert_eq!(stats.undergrowth, None);
        assert!(stats.pipelines.iter().all(|name| !name.contains("undergrowth")), "{:?}", stats.pipelines);
        assert!(session.engine.select_undergrowth().is_none());
        assert!(session.engine.targets().unwrap().depth.is_none(), "no depths are written");
    }
    // From just below the height it is there, at once, and it asks for no tile more; and it goes when the eye rises.
    let mut session = session(full.clone(), 40.0, 0.0);
    session.settle(&request(high, None), &tiles).unwrap();
    let before = session.engine.stats();
    session.settle(&request(at(&tiles, ALP, 20.0, 200.0, -60.0), None), &tiles).unwrap();
    session.repeat(&request(at(&tiles, ALP, 20.0, 200.0, -60.0), None), 3).unwrap();
    let stats = session.engine.stats();
    let undergrowth = stats.undergrowth.unwrap();
    println!("{undergrowth:?}");
    assert!(undergrowth.plants > 100 && undergrowth.metaseeds > 10, "{undergrowth:?}");
    assert!(undergrowth.plants <= 40 * undergrowth.metaseeds && undergrowth.draw_calls == BINS);
    assert!(stats.pipelines.contains(&"undergrowth") && !stats.pipelines.contains(&"trees"));
    assert!(!stats.tiles.contains_key("lcc") && !before.tiles.contains_key("lcc"));
    session.settle(&request(high, None), &tiles).unwrap();
    assert_eq!(session.engine.stats().undergrowth, None);
}

/// What the year leaves: no blossoms in autumn; above the snow line in winter nothing but stones.
#[test]
fn the_year_takes_flowers_and_then_all_but_stones() {
    let tiles = RouterTiles::built_in().unwrap();
    let summer = unix_seconds_from_rfc3339(&tiles.scene().unwrap().sun.time).unwrap();
    let grown = |place: [f64; 2], season: NamedSeason| {
        let view = request(at(&tiles, place, 1.7, 330.0, -8.0), Some(season.near(summer, place[1])));
        let session = settled(&tiles, &view, 40.0, 0.0);
        let (bins, _) = plants(&session.engine).unwrap();
        let count = |kind: Kind| bins.get(kind as usize).map_or(0, Vec::len);
        Kind::ALL.map(count)
    };
    let [grass, flowers, ..] = grown(ALP, NamedSeason::Summer);
    assert!(grass > 200 && flowers > 10, "{grass} {flowers}");
    let [grass, flowers, ..] = grown(ALP, NamedSeason::Autumn);
    assert!(grass > 200 && flowers == 0, "{grass} {flowers}");
    let [grass, flowers, ferns, shrubs, ..] = grown(ALP, NamedSeason::Winter);
    assert_eq!([grass, flowers, ferns, shrubs], [0; 4]);
    let [grass, _, _, _, stones, _] = grown(STONES, NamedSeason::Winter);
    assert!(grass == 0 && stones > 3, "{grass} {stones}");
    let [.., stones, wood] = grown(STONES, NamedSeason::Summer);
    assert!(stones > 100 && wood == 0, "{stones} {wood}");
}
