//! The year: the shaders' leaves and snow are `core`'s, near trees and far canopy turn alike, and summer is as if there
//! were no seasons.

use treeline_client::engine::{Engine, EngineOptions, ViewRequest, Weather};
use treeline_client::headless::{self, AdapterChoice, Session};
use treeline_client::stream::StreamOptions;
use treeline_core::camera::GeographicCamera;
use treeline_core::seeds::Species;
use treeline_core::seeds::season::{self, NamedSeason, ROWS, YearDay};
use treeline_core::sun::unix_seconds_from_rfc3339;
use treeline_shaders::layout::View;
use treeline_shaders::season::{FLAG_SEASON, rows, season_of_view};
use treeline_shaders::{FRAME_BINDINGS, LAYOUT, LIGHTING, SEASON, SKY};
use treeline_tests::kernel::ask;
use treeline_tests::router_tiles::RouterTiles;

const KERNEL: &str = r"
@group(1) @binding(0) var<storage, read> questions: array<vec2<f32>>;
@group(1) @binding(1) var<storage, read_write> answers: array<vec4<f32>>;

@compute @workgroup_size(64)
fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&questions) {
        let question = questions[id.x];
        let foliage = foliage_at(season_row(u32(question.x)), question.y);
        answers[id.x] = vec4<f32>(foliage.leaves, foliage.turned, foliage.fresh, snow_at(question.y));
    }
}
";

#[test]
fn the_gpu_has_the_leaves_and_the_snow_of_core() {
    let species = Species::built_in();
    let table = season::table(species.iter().map(|species| (species.code, &species.definition)));
    let gpu_rows = rows(&table);
    let mut between = 0;
    for (date, latitude) in [
        ("2026-01-12T08:00:00Z", 46.9),
        ("2026-04-30T12:00:00Z", 41.0),
        ("2026-05-25T12:00:00Z", 60.0),
        ("2026-10-16T12:00:00Z", 46.9),
        ("2026-11-03T12:00:00Z", 26.0),
        ("2026-04-20T12:00:00Z", -43.0),
    ] {
        let day = YearDay::at(unix_seconds_from_rfc3339(date).unwrap(), latitude).unwrap();
        let view = View { season: season_of_view(&day, latitude), ..View::default() };
        let questions: Vec<[f32; 2]> = (0..ROWS)
            .flat_map(|row| (0..40).map(move |step| [row as f32, 90.0 * step as f32 - 200.0]))
            .collect();
        let text = [LAYOUT, FRAME_BINDINGS, SKY, LIGHTING, SEASON, KERNEL].concat();
        let uniforms = [(0, bytemuck::bytes_of(&view)), (10, bytemuck::cast_slice(&gpu_rows))];
        let answers: Vec<[f32; 4]> = ask(&text, &uniforms, &questions);
        for (&[row, height], answer) in questions.iter().zip(&answers) {
            // What is beyond the table is an evergreen; the ground's own row is asked for by its number alone.
            let row = if row as usize == season::GROUND { 0 } else { row as usize };
            let foliage = table[row].foliage(&day, height);
            let expected = [foliage.leaves, foliage.turned, foliage.fresh, day.snow(height)];
            for (found, expected) in answer.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-4, "{date} {row} {height}: {answer:?} {expected:?}");
                between += u32::from((0.05..0.95).contains(&expected));
            }
        }
    }
    assert!(between > 300, "{between} answers lie between the ends");
}

const SIZE: [u32; 2] = [160, 120];

/// A wooded slope with larches, seen from 250 m above.
const SLOPE: GeographicCamera = GeographicCamera {
    lon: 10.938,
    lat: 46.903,
    height: 1_680.0,
    heading_deg: 330.0,
    pitch_deg: -32.0,
    fov_y_deg: 40.0,
};

/// Mean colour (0 … 255) of the picture's lower half, where there is nothing but forest, and the flags of the view.
fn look(tiles: &RouterTiles, season: NamedSeason, tree_metres: f64) -> ([f64; 3], u32) {
    let gpu = headless::open(AdapterChoice::Software).unwrap();
    let options = EngineOptions {
        stream: StreamOptions { fade_seconds: 0.0, ..StreamOptions::default() },
        tree_metres: Some(tree_metres),
        uploads_per_step: usize::MAX,
        ..EngineOptions::default()
    };
    let scene = tiles.scene().unwrap();
    let summer = unix_seconds_from_rfc3339(&scene.sun.time).unwrap();
    let view = ViewRequest {
        camera: SLOPE,
        width: SIZE[0],
        height: SIZE[1],
        sun_unix_seconds: Some(season.near(summer, SLOPE.lat)),
        shadow_steps: 12,
        weather: Weather::default(),
    };
    let mut session = Session::new(Engine::new(gpu, scene, options).unwrap(), SIZE[0], SIZE[1], 2).unwrap();
    session.settle(&view, tiles).unwrap();
    let rgba = session.capture().unwrap().rgba;
    let lower = &rgba[rgba.len() / 2..];
    let mean = [0, 1, 2].map(|channel| {
        let sum: f64 = lower.iter().skip(channel).step_by(4).map(|&value| f64::from(value)).sum();
        sum / (lower.len() / 4) as f64
    });
    (mean, session.engine.drawn_view().unwrap().flags)
}

#[test]
fn trees_and_canopy_turn_alike() {
    let tiles = RouterTiles::built_in().unwrap();
    let warmth = |[red, green, _]: [f64; 3]| red / green;
    let mut looks = Vec::new();
    for season in [NamedSeason::Summer, NamedSeason::Autumn, NamedSeason::Winter] {
        let (trees, flags) = look(&tiles, season, 1_000.0);
        let (canopy, _) = look(&tiles, season, 0.0);
        println!("{season:?}: trees {trees:.1?}, canopy {canopy:.1?}");
        assert_eq!(flags & FLAG_SEASON != 0, season != NamedSeason::Summer);
        assert!((warmth(trees) / warmth(canopy) - 1.0).abs() < 0.15, "{trees:?} {canopy:?}");
        looks.push([trees, canopy]);
    }
    for one in [0, 1] {
        let [summer, autumn, winter] = [0, 1, 2].map(|season: usize| looks[season][one]);
        assert!(warmth(autumn) > 1.08 * warmth(summer), "it turns: {summer:?} {autumn:?}");
        let blue = |[_, green, blue]: [f64; 3]| blue / green;
        assert!(blue(winter) > 1.15 * blue(summer), "snow lies: {summer:?} {winter:?}");
    }
}
