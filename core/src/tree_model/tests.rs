//! What every model keeps, on the built-in species and on nasty ones.

use super::cloud::pieces::Pieces;
use super::cloud::{Budget, cover};
use super::*;
use crate::seeds::CrownShape;
use std::sync::LazyLock;

/// Models of a conifer and a broadleaf: growing all takes half a minute.
static MODELS: LazyLock<Vec<(Species, TreeSpecies)>> = LazyLock::new(|| {
    let two = Species::built_in().into_iter().take(2);
    two.map(|species| (species.clone(), TreeSpecies::grow(&species))).collect()
});

fn foliage(quads: &[Quad]) -> impl Iterator<Item = &Quad> {
    quads.iter().filter(|quad| quad.corners[0].foliage > 0.5)
}

fn unlikely(name: &str, crown: CrownShape, radius: f64, base: f64, tallest: f64) -> Species {
    let mut definition = Species::built_in()[0].definition.clone();
    name.clone_into(&mut definition.name);
    (definition.crown, definition.crown_radius_ratio, definition.crown_base_ratio) = (crown, radius, base);
    (definition.lowest_metres, definition.highest_metres) = (0.5, 0.5);
    definition.tallest_metres = tallest;
    Species::new(9, definition).unwrap()
}

#[test]
fn a_model_is_the_tree_of_the_canopy_map() {
    for (species, model) in MODELS.iter() {
        for quads in &model.levels[0].variants {
            let top = geometry::top(quads);
            assert!((top - 1.0).abs() < 1e-4, "the top is at {top}");
            let mut shares = [0.0_f32; 10];
            for place in foliage(quads).flat_map(Quad::places) {
                let distance = place.x.hypot(place.y);
                let surface = species.crown_surface(1.0, distance - 1e-4);
                assert!(surface.is_some_and(|surface| place.z <= surface + 1e-3), "a leaf at {place}");
                // How much of the crown's radius foliage fills, in ten slices of its height.
                let base = species.definition.crown_base_ratio as f32;
                let slice = ((place.z - base) / (1.0 - base) * 10.0).floor();
                if (0.0..10.0).contains(&slice) {
                    let envelope = Envelope::new(&species.definition, 0.1);
                    let lower = envelope.radius_at(base + slice * 0.1 * (1.0 - base));
                    shares[slice as usize] = shares[slice as usize].max(distance / lower);
                }
            }
            assert!(shares.iter().all(|&share| share > 0.75), "foliage fills {shares:?} of the crown");
        }
    }
}

#[test]
fn every_corner_is_near_a_plane_of_every_cloud() {
    for (species, model) in MODELS.iter() {
        for (level, bound) in model.levels[1..].iter().zip([0.3, 0.6, 1.0]) {
            assert!(level.epsilon <= bound * model.crown_radius, "ε {}", level.epsilon);
            for (quads, planes) in model.levels[0].variants.iter().zip(&level.variants) {
                for quad in quads {
                    for place in quad.places() {
                        let nearest = planes
                            .iter()
                            .filter_map(|plane| {
                                let places = plane.places();
                                let normal =
                                    (places[1] - places[0]).cross(places[3] - places[0]).try_normalize()?;
                                Some((place - places[0]).dot(normal).abs())
                            })
                            .fold(f32::INFINITY, f32::min);
                        // The wire's steps turn a plane a little.
                        assert!(nearest <= level.epsilon + 3e-4, "{}: {nearest}", species.definition.name);
                    }
                }
            }
        }
    }
}

#[test]
fn levels_have_the_quads_that_they_claim() {
    for (_, model) in MODELS.iter() {
        assert_eq!(model.levels.len(), 4);
        assert!((600..=2_500).contains(&model.levels[0].quads()), "{}", model.levels[0].quads());
        for (level, most) in model.levels[1..].iter().zip([17, 8, 4]) {
            assert!(level.quads() <= most && level.quads() > most / 2);
        }
        for level in &model.levels {
            assert_eq!(level.variants.len(), VARIANTS as usize);
            assert!(level.variants.iter().all(|quads| quads.len() == level.quads()));
            assert_eq!(level.words().len(), level.quads() * VARIANTS as usize * 16);
        }
        assert_ne!(model.levels[0].variants[0], model.levels[0].variants[1], "no twins");
    }
}

#[test]
fn models_round_trip_and_grow_alike_each_time() {
    let (species, model) = &MODELS[0];
    assert_eq!(TreeSpecies::decode(&model.encode()).as_ref(), Ok(model));
    assert_eq!(&TreeSpecies::grow(species), model);
}

#[test]
fn unlikely_species_have_models_too() {
    for species in [
        unlikely("Rock", CrownShape::Dome, 0.5, 0.0, 4.0),
        unlikely("Needle", CrownShape::Cone, 0.02, 0.95, 60.0),
        unlikely("Moss", CrownShape::Dome, 0.5, 0.95, 0.5),
        unlikely("Disc", CrownShape::Paraboloid, 0.5, 0.0, 60.0),
    ] {
        let model = TreeSpecies::grow(&species);
        let name = &species.definition.name;
        assert!(model.levels.iter().all(|level| level.quads() > 0 && level.epsilon.is_finite()), "{name}");
        assert!((geometry::top(&model.levels[0].variants[0]) - 1.0).abs() < 1e-4, "{name}");
        assert_eq!(TreeSpecies::decode(&model.encode()), Ok(model), "{name}");
    }
}

/// A quad of foliage in a plane, or what is left of one.
fn quad(places: [[f32; 3]; 4]) -> Quad {
    Quad { corners: places.map(|position| Corner { position, foliage: 1.0, ..Corner::default() }) }
}

#[test]
fn clouds_of_next_to_nothing() {
    let budget = Budget { foliage: 6, wood: 2 };
    let flat = quad([[0.0, 0.0, 0.1], [0.3, 0.0, 0.1], [0.3, 0.1, 0.1], [0.0, 0.1, 0.1]]);
    let point = quad([[0.1, 0.2, 0.3]; 4]);
    let triangle = quad([[0.0; 3], [0.2, 0.0, 0.4], [0.0, 0.2, 0.4], [0.0, 0.2, 0.4]]);
    let sprites = Atlas::new(16, vec![255; 16 * 16 * 4], Vec::new());
    for model in [vec![flat], vec![point], vec![triangle], vec![flat, flat, point, flat], Vec::new()] {
        let cover = cover(&model, budget);
        assert!(cover.foliage.len() <= budget.foliage);
        assert!(cover.reached(&model) <= cover.epsilon && cover.epsilon < 0.2, "{cover:?}");
        let drawn = cloud::Layout::new(&model, &cover).draw(&sprites, 64.0);
        // A plane that takes nothing is not drawn.
        assert!(drawn.len() <= cover.foliage.len() + cover.wood.len());
        assert_eq!(drawn.is_empty(), model.is_empty());
        assert!(drawn.iter().all(|picture| picture.rgba.len() == picture.width * picture.height * 4));
    }
    // What lies in one plane gets that plane.
    let one = cover(&[flat, flat], budget);
    assert_eq!(one.foliage.len(), 1, "{one:?}");
    let drawn = cloud::Layout::new(&[flat], &one).draw(&sprites, 64.0);
    let covered = drawn[0].rgba.chunks_exact(4).filter(|texel| texel[3] >= Atlas::ALPHA_TEST).count();
    // The outermost texels are half covered.
    let inner = (drawn[0].width - 2) * (drawn[0].height - 2);
    assert!(covered >= inner, "the picture shows the quad");
}

#[test]
fn welding_joins_what_touches_and_nothing_else() {
    let left = quad([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0]]);
    let right = quad([[0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.1, 0.0], [0.1, 0.1, 0.0]]);
    let pieces = Pieces::new(&[left, right], 1.0, 0.001);
    assert_eq!((pieces.vertices.len(), pieces.list.len()), (6, 2));
    let cut = Pieces::new(&[left], 0.05, 0.001);
    assert_eq!((cut.vertices.len(), cut.list.len()), (9, 4));
    assert!((cut.list.iter().map(|piece| piece.area).sum::<f32>() - 0.01).abs() < 1e-6);
}
