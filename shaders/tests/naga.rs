//! Every pass, exactly as it is assembled, through naga; and every struct of `layout` against naga's layout.

use naga::{Module, TypeInner};
use std::mem::{offset_of, size_of};
use treeline_shaders::layout::{Leaf, Sheet, TexturePage, View};
use treeline_shaders::load_map::{LoadMapFrame, LoadMapLevel};
use treeline_shaders::season::SeasonRow;
use treeline_shaders::trees::{Draw, SeedCell, SeedFrame, SeedSpecies, TreeCells, TreeDraw, TreeInstance};
use treeline_shaders::undergrowth::{
    IndexedDraw, Plant, PlantDraw, PlantLight, UndergrowthBlock, UndergrowthDraws, UndergrowthFrame,
};
use treeline_shaders::{Pass, source};

fn parsed(pass: Pass) -> Module {
    let text = source(pass);
    let module = naga::front::wgsl::parse_str(&text)
        .unwrap_or_else(|error| panic!("{pass:?}: {}", error.emit_to_string(&text)));
    let mut validator =
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
    if let Err(error) = validator.validate(&module) {
        panic!("{pass:?}: {}", error.emit_to_string(&text));
    }
    module
}

#[test]
fn every_pass_is_valid_within_what_every_adapter_has() {
    for pass in Pass::ALL {
        assert!(!parsed(pass).entry_points.is_empty(), "{pass:?} has no entry point");
    }
}

macro_rules! layout_of {
    ($name:ident: $($field:ident),* $(,)?) => {
        (stringify!($name), size_of::<$name>(), vec![$((stringify!($field), offset_of!($name, $field))),*])
    };
}

#[test]
fn structs_are_laid_out_alike_on_both_sides() {
    let module = parsed(Pass::HeightField);
    let table = [
        layout_of!(Leaf: u_gradient, v_gradient, h_gradient, u_second, v_second, h_second, uv_cross,
            h_cross_maximum_fade, eye_cell, first_cell, cells, grid_origin, grid_side, slot, level, stand_in,
            cell_metres, distance_range),
        layout_of!(View: right, up, forward, sun, size, root_size, eye_grid, eye_inside, wraps, root_level,
            shadow_steps, flags, frame, grid_place, tree_size, scene_seed, clouds, season, wind, gust_cell, cloud_cell, gust_part, cloud_part),
        layout_of!(Sheet: eye_patch, base, eye_patch_known, padding),
        layout_of!(TexturePage: slot, children, fade, padding),
    ];
    compare(&module, table);
}

/// A struct's name and size, and its members' names and offsets.
type Layout = (&'static str, usize, Vec<(&'static str, usize)>);

fn compare<const N: usize>(module: &Module, table: [Layout; N]) {
    for (name, size, fields) in table {
        let (_, found) = module
            .types
            .iter()
            .find(|(_, candidate)| candidate.name.as_deref() == Some(name))
            .unwrap_or_else(|| panic!("no struct {name} in the shader"));
        let TypeInner::Struct { members, span } = &found.inner else { panic!("{name} is no struct") };
        assert_eq!(*span as usize, size, "size of {name}");
        let members: Vec<_> = members
            .iter()
            .map(|member| (member.name.as_deref().unwrap_or_default(), member.offset as usize))
            .collect();
        assert_eq!(members, fields, "members of {name}");
    }
}

#[test]
fn trees_are_laid_out_alike_on_both_sides() {
    compare(
        &parsed(Pass::SelectTrees),
        [
            layout_of!(SeedSpecies: lowest, highest, mean, tallest, share, crown_radius, padding),
            layout_of!(SeedCell: cell, offset, slot, padding),
            layout_of!(SeedFrame: eye, sides, level_pixels, eye_fraction, range, anchor_quantum, cells, blocks, species,
                cover_bits, tile_bits, anchor_bits, padding),
            layout_of!(TreeInstance: foot_height, look, seed, ground, height_units, colour, sun, sky, air),
            layout_of!(Draw: vertex_count, instance_count, first_vertex, first_instance),
        ],
    );
}

#[test]
fn what_draws_trees_is_laid_out_alike_on_both_sides() {
    compare(&parsed(Pass::ShadeTrees), [layout_of!(TreeCells: first, range, turf, under, bits)]);
    compare(&parsed(Pass::Trees), [layout_of!(TreeDraw: model, foliage)]);
    for pass in [Pass::Shade, Pass::ShadeTrees, Pass::SelectTrees] {
        compare(&parsed(pass), [layout_of!(SeasonRow: out_turn, fall, turned, bare)]);
    }
}

#[test]
fn the_undergrowth_is_laid_out_alike_on_both_sides() {
    compare(
        &parsed(Pass::SelectUndergrowth),
        [
            layout_of!(UndergrowthBlock: cell, offset, first, columns, padding),
            layout_of!(UndergrowthFrame: eye, sides, eye_fraction, range, canopy_gone, blocks, padding, more_padding),
            layout_of!(Plant: foot_size, look, seed, place, size, colour, ground, padding),
            layout_of!(PlantLight: sun, sky, air),
            layout_of!(UndergrowthDraws: draws, light),
            layout_of!(IndexedDraw: index_count, instance_count, first_index, base_vertex, first_instance),
        ],
    );
    compare(&parsed(Pass::Undergrowth), [layout_of!(PlantDraw: model)]);
}

#[test]
fn the_load_map_is_laid_out_alike_on_both_sides() {
    for pass in [Pass::LoadMapPixels, Pass::LoadMapCells] {
        compare(
            &parsed(pass),
            [
                layout_of!(LoadMapLevel: first, eye, band, span, level),
                layout_of!(LoadMapFrame: eye, look_ahead, heights, maps, pattern_map, scene_seed, texel_angle, elevation_level,
                    coarser_from,
                    levels),
            ],
        );
    }
}
