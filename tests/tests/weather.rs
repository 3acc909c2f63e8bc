//! Wind and clouds: the shaders' are their twins', a moment looks the same twice, trees and ground lie under the same
//! shadows, and fair weather costs nothing.

use glam::{Vec2, Vec3};
use treeline_client::engine::{Engine, EngineOptions, ViewRequest, Weather};
use treeline_client::headless::{self, AdapterChoice, Session};
use treeline_client::stream::StreamOptions;
use treeline_core::camera::GeographicCamera;
use treeline_shaders::layout::View;
use treeline_shaders::twin::weather::{cloud_light, gust_at};
use treeline_shaders::weather::{FLAG_CLOUDS, FLAG_WIND};
use treeline_shaders::{FRAME_BINDINGS, LAYOUT, WEATHER};
use treeline_tests::kernel::ask;
use treeline_tests::router_tiles::RouterTiles;

const KERNEL: &str = r"
@group(1) @binding(0) var<storage, read> questions: array<vec4<f32>>;
@group(1) @binding(1) var<storage, read_write> answers: array<vec2<f32>>;

@compute @workgroup_size(64)
fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&questions) {
        let question = questions[id.x];
        answers[id.x] = vec2<f32>(gust_at(question.xy), cloud_light(question.xyz, question.w));
    }
}
";

#[test]
fn the_gpu_has_the_gusts_and_the_clouds_of_the_twin() {
    for (weather, eye) in [
        (Weather { wind: 5.0, seconds: 31.5, clouds: 0.5 }, [10.9, 46.9]),
        (Weather { wind: 17.0, seconds: 8_000.0, clouds: 0.2 }, [-179.99, -44.0]),
    ] {
        let mut view = View { sun: [0.5, -0.4, 0.768, 6.37e6], ..View::default() };
        weather.write(&mut view, eye, eye[1]);
        let at = |index: usize, base: f64| ((index as f64 * base).fract() - 0.5) as f32;
        let questions: Vec<[f32; 4]> = (0..2_000)
            .map(|index| {
                let place = [9_000.0 * at(index, 0.754_877_67), 9_000.0 * at(index, 0.569_840_29)];
                [place[0], place[1], 400.0 * at(index, 0.618), 1_500.0 + 2_000.0 * at(index, 0.414)]
            })
            .collect();
        let text = [LAYOUT, FRAME_BINDINGS, WEATHER, KERNEL].concat();
        let answers: Vec<[f32; 2]> = ask(&text, &[(0, bytemuck::bytes_of(&view))], &questions);
        let mut between = 0;
        for (&[x, y, z, height], &[gust, light]) in questions.iter().zip(&answers) {
            let expected = [gust_at(&view, Vec2::new(x, y)), cloud_light(&view, Vec3::new(x, y, z), height)];
            assert!((gust - expected[0]).abs() < 1e-3, "{gust} {expected:?}");
            assert!((light - expected[1]).abs() < 1e-2, "{light} {expected:?}");
            between += usize::from((0.3..0.9).contains(&expected[1]));
        }
        assert!(between > 50, "{between} places lie at a cloud's edge");
    }
}

const SIZE: [u32; 2] = [160, 120];

/// Among trees, 40 m above their tops.
const AMONG: GeographicCamera = GeographicCamera {
    lon: 10.9358,
    lat: 46.907,
    height: 1_485.0,
    heading_deg: 330.0,
    pitch_deg: -12.0,
    fov_y_deg: 50.0,
};

fn session(tiles: &RouterTiles, tree_metres: f64) -> Session {
    let gpu = headless::open(AdapterChoice::Software).unwrap();
    let options = EngineOptions {
        stream: StreamOptions { fade_seconds: 0.0, ..StreamOptions::default() },
        tree_metres: Some(tree_metres),
        uploads_per_step: usize::MAX,
        ..EngineOptions::default()
    };
    Session::new(Engine::new(gpu, tiles.scene().unwrap(), options).unwrap(), SIZE[0], SIZE[1], 2).unwrap()
}

fn shot(session: &mut Session, tiles: &RouterTiles, weather: Weather) -> (Vec<u8>, u32) {
    let view = ViewRequest {
        camera: AMONG,
        width: SIZE[0],
        height: SIZE[1],
        sun_unix_seconds: None,
        shadow_steps: 8,
        weather,
    };
    session.settle(&view, tiles).unwrap();
    (session.capture().unwrap().rgba, session.engine.drawn_view().unwrap().flags)
}

/// Mean of a picture's lower half, where there is no sky.
fn brightness(rgba: &[u8]) -> f64 {
    let lower = &rgba[rgba.len() / 2..];
    let colours = lower.iter().enumerate().filter(|(index, _)| index % 4 != 3);
    colours.map(|(_, &value)| f64::from(value)).sum::<f64>() / (0.75 * lower.len() as f64)
}

fn changed(a: &[u8], b: &[u8]) -> usize {
    let pixels = a.as_chunks::<4>().0.iter().zip(b.as_chunks::<4>().0);
    pixels.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 8)).count()
}

#[test]
fn a_moment_of_wind_is_the_same_twice_and_another_differs() {
    let tiles = RouterTiles::built_in().unwrap();
    let mut session = session(&tiles, 400.0);
    let wind = |seconds| Weather { wind: 12.0, seconds, ..Weather::default() };
    let (still, flags) = shot(&mut session, &tiles, Weather::default());
    assert_eq!(flags & (FLAG_WIND | FLAG_CLOUDS), 0);
    let (first, flags) = shot(&mut session, &tiles, wind(3.0));
    assert_eq!(flags & (FLAG_WIND | FLAG_CLOUDS), FLAG_WIND);
    let (later, _) = shot(&mut session, &tiles, wind(3.6));
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    assert!(changed(&first, &later) > pixels / 50, "{} pixels", changed(&first, &later));
    // Trees sway about where they stand: the wood is as bright as without wind.
    assert!((brightness(&first) / brightness(&still) - 1.0).abs() < 0.06);
    assert_eq!(shot(&mut session, &tiles, wind(3.0)).0, first);
    assert_eq!(shot(&mut session, &tiles, Weather { seconds: 99.0, ..Weather::default() }).0, still);
    // What moves has to be drawn again, what does not has not.
    assert!(session.engine.stirs(&wind(0.0)));
    assert!(!session.engine.stirs(&Weather { clouds: 0.5, ..Weather::default() }));
    assert!(!session.engine.stirs(&Weather::default()));
}

#[test]
fn one_shadow_lies_on_trees_and_canopy() {
    let tiles = RouterTiles::built_in().unwrap();
    for tree_metres in [400.0, 0.0] {
        let mut session = session(&tiles, tree_metres);
        let mut of = |clouds| {
            let (rgba, flags) = shot(&mut session, &tiles, Weather { clouds, ..Weather::default() });
            assert_eq!(flags & FLAG_CLOUDS != 0, clouds > 0.0);
            brightness(&rgba)
        };
        let (fair, covered) = (of(0.0), of(1.0));
        println!("trees up to {tree_metres} m: {fair:.1} in the sun, {covered:.1} under clouds");
        assert!((0.25..0.8).contains(&(covered / fair)), "{fair} {covered}");
    }
}
