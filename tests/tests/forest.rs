//! The forest on the GPU: seeds bit for bit as `core` has them, crowns and their light against the twins.

use glam::{UVec2, Vec2, Vec3};
use treeline_core::seeds::pattern::{
    CELL_UNITS, CellRow, LEVEL, ROWS, candidate, pattern_of_cell, sub_cell_place,
};
use treeline_shaders::layout::View;
use treeline_shaders::twin::crown_light::{light_into_canopy, mean_crown_height, mean_crown_light};
use treeline_shaders::twin::crowns::{CanopyRay, Met, first_crown, place_of_grid, stand_of};
use treeline_shaders::{CROWN_LIGHT, CROWNS, FRAME_BINDINGS, LAYOUT, LIGHTING, PHOTO, SEEDS, SHADOW, SKY};
use treeline_tests::kernel::ask;

const SEEDS_KERNEL: &str = r"
struct Answer { row: vec2<u32>, pattern: u32, rank: u32, place: vec2<u32>, units: vec2<u32>, looks: vec2<u32> }
@group(1) @binding(0) var<storage, read> questions: array<vec4<u32>>;
@group(1) @binding(1) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&questions) {
        return;
    }
    let question = questions[id.x];
    let row = seed_row(question.y);
    let pattern = pattern_of_cell(question.xy, view.scene_seed);
    let sub_cell = vec2<u32>(question.z % max(row.columns, 1u), question.w % SEED_ROWS);
    let candidate = seed_candidate(seed_pattern(pattern), sub_cell);
    answers[id.x] = Answer(
        vec2<u32>(row.columns, row.aspect),
        pattern,
        candidate.rank,
        candidate.place,
        seed_units(candidate, max(row.columns, 1u)),
        vec2<u32>(candidate.size, candidate.rotation),
    );
}
";

#[test]
fn seeds_are_the_same_bit_for_bit() {
    let mut state = 1_u32;
    let mut random = || {
        state = treeline_core::hash::mix(state.wrapping_add(0x9e37_79b9));
        state
    };
    let rows = 1_u32 << LEVEL;
    let mut questions: Vec<[u32; 4]> =
        (0..20_000).map(|_| [random() % (2 * rows), random() % rows, random(), random()]).collect();
    // The poles, beyond the matrix, and columns past the antimeridian.
    for row in [0, 1, rows / 2, rows - 1, rows, u32::MAX] {
        questions.extend([0, 2 * rows - 1, 2 * rows, 5 * rows, u32::MAX].map(|column| [column, row, row, 7]));
    }
    for scene_seed in [1, 0, 0xdead_beef] {
        let view = View { scene_seed, ..View::default() };
        let text = [LAYOUT, FRAME_BINDINGS, SEEDS, SEEDS_KERNEL].concat();
        let answers: Vec<[u32; 10]> = ask(&text, &[(0, bytemuck::bytes_of(&view))], &questions);
        for (&[column, row, i, j], answer) in questions.iter().zip(&answers) {
            let cells = CellRow::new(row);
            let columns = cells.columns.max(1);
            let pattern = pattern_of_cell(column, row, scene_seed);
            let (i, j) = (i % columns, j % ROWS);
            let tree = candidate(pattern, columns, i, j);
            let [u, v] = sub_cell_place(pattern, i, j);
            let expected = [
                cells.columns,
                cells.aspect,
                u32::from(pattern),
                tree.rank,
                u,
                v,
                tree.x,
                tree.y,
                u32::from(tree.size),
                u32::from(tree.rotation),
            ];
            assert_eq!(*answer, expected, "cell {column}, {row}, sub-cell {i}, {j}");
        }
    }
}

const CROWNS_KERNEL: &str = r"
struct Question { unit: vec2<u32>, along: vec2<f32>, height: f32, fall: f32, sun_rise: f32, sun_behind: f32 }
struct Answer { met: u32, height: f32, outward: vec2<f32>, tone: f32, sunlit: f32, mean: vec2<f32> }
@group(1) @binding(0) var<storage, read> questions: array<Question>;
@group(1) @binding(1) var<storage, read_write> answers: array<Answer>;

@compute @workgroup_size(64)
fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&questions) {
        return;
    }
    let question = questions[id.x];
    let stand = stand_of(question.height, 1.0);
    let place = place_of_grid(question.unit);
    let ray = CanopyRay(place, question.height, question.along, question.fall, vec2<f32>(0.0064, 0.00933));
    let hit = first_crown(ray, stand);
    let sunlit = light_into_canopy(stand, 0.7, question.sun_rise, question.sun_behind);
    let height = mean_crown_height(stand, question.fall);
    let mean = mean_crown_light(view.sun.xyz * 0.8, stand, height, question.sun_rise, question.sun_behind);
    let met = select(select(0u, 1u, hit.cut_short), 2u, hit.found);
    answers[id.x] = Answer(met, hit.height, hit.outward, hit.tone, sunlit, vec2<f32>(mean.direct, mean.ambient));
}
";

#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct CrownQuestion {
    unit: [u32; 2],
    along: [f32; 2],
    height: f32,
    fall: f32,
    sun_rise: f32,
    sun_behind: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct CrownAnswer {
    met: u32,
    height: f32,
    outward: [f32; 2],
    tone: f32,
    sunlit: f32,
    mean: [f32; 2],
}

#[test]
fn crowns_agree_with_the_twins() {
    let at = |index: usize, base: f64| ((index as f64 + 0.5) * base).fract();
    let questions: Vec<CrownQuestion> = (0..4096)
        .map(|index| {
            let turn = at(index, 0.618_033_988_749_895) * std::f64::consts::TAU;
            CrownQuestion {
                unit: [at(index, 0.754_877_666_246_693), at(index, 0.569_840_290_998_053)]
                    .map(|share| (share * 5.0e7) as u32),
                along: [turn.sin() as f32, -turn.cos() as f32],
                height: (1.0 + 12.0 * at(index, 0.414_213_562_373_095)) as f32,
                fall: (0.06_f64 * 60.0_f64.powf(at(index, 0.236_067_977_499_79))) as f32,
                sun_rise: at(index, 0.302_775_637_731_995) as f32,
                sun_behind: at(index, 0.192_582_403_567_252) as f32,
            }
        })
        .collect();
    let text =
        [LAYOUT, FRAME_BINDINGS, SKY, PHOTO, SHADOW, LIGHTING, SEEDS, CROWNS, CROWN_LIGHT, CROWNS_KERNEL]
            .concat();
    // A root of level 9 at 47° N, one that begins at the antimeridian, and one near the pole.
    for (root_level, grid_place) in
        [(9_u32, [542_u32 << 22, 122_u32 << 22]), (3, [u32::MAX - 500, 1 << 29]), (12, [77, 30_000_000])]
    {
        let view = View {
            root_level,
            grid_place,
            tree_size: [24.75, 0.1725],
            scene_seed: 5,
            sun: [0.3, 0.6, 0.741_62, 6.4e6],
            ..View::default()
        };
        let answers: Vec<CrownAnswer> = ask(&text, &[(0, bytemuck::bytes_of(&view))], &questions);
        let (mut crowns, mut apart) = (0, 0);
        for (question, answer) in questions.iter().zip(&answers) {
            let stand = stand_of(&view, question.height, 1.0);
            let ray = CanopyRay {
                place: place_of_grid(&view, UVec2::from(question.unit)),
                height: question.height,
                along: Vec2::from(question.along),
                fall: question.fall,
                unit_metres: Vec2::new(0.0064, 0.00933),
            };
            let agrees = match first_crown(&view, &ray, &stand) {
                Met::Crown(hit) => {
                    crowns += 1;
                    answer.met == 2
                        && (answer.height - hit.height).abs() < 0.01
                        && (Vec2::from(answer.outward) - hit.outward).length() < 0.05
                        && (answer.tone - hit.tone).abs() < 1e-5
                }
                Met::CutShort => answer.met == 1,
                Met::Gap => answer.met == 0,
            };
            // Rounding may choose another sub-cell, or the other side of a crown's edge.
            apart += usize::from(!agrees);
            let sunlit = light_into_canopy(&stand, 0.7, question.sun_rise, question.sun_behind);
            assert!((sunlit - answer.sunlit).abs() < 1e-3, "{question:?}: {sunlit} {answer:?}");
            let height = mean_crown_height(&stand, question.fall);
            let sun = Vec3::new(view.sun[0], view.sun[1], view.sun[2]);
            let mean =
                mean_crown_light(sun * 0.8, sun, &stand, height, question.sun_rise, question.sun_behind);
            assert!((mean.direct - answer.mean[0]).abs() < 2e-3, "{question:?}: {mean:?} {answer:?}");
            assert!((mean.ambient - answer.mean[1]).abs() < 2e-3, "{question:?}: {mean:?} {answer:?}");
        }
        println!("root level {root_level}: {crowns} crowns, {apart} rays differ");
        assert!(apart * 100 <= questions.len(), "{apart} rays differ");
        assert!(crowns > 1_500 || root_level == 12, "{crowns} crowns were met");
    }
}

#[test]
fn a_cell_of_the_pattern_has_the_units_that_the_shader_says() {
    assert_eq!(CELL_UNITS, 1 << 14);
    assert!(
        SEEDS.contains("const SEED_CELL_BITS: u32 = 14u;") && SEEDS.contains("const SEED_ROWS: u32 = 24u;")
    );
    assert_eq!(ROWS, 24);
}
