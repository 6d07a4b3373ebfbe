//! Properties of the reference renderer alone.

use glam::DVec3;
use wavepath::reference::{RayCounts, Reference};
use wavepath::scene::{MaterialId, RenderSettings};

use crate::builder::busy_room;

#[test]
fn a_sample_depends_on_seed_pixel_and_number_alone() {
    let scene = busy_room().build();
    let settings = RenderSettings::default();
    let reference = Reference::new(&scene, 0, 16, 16, &settings).expect("the scene is sound");
    let other_seed = RenderSettings {
        seed: 1,
        ..settings
    };
    let other = Reference::new(&scene, 0, 16, 16, &other_seed).expect("the scene is sound");
    let sample = |reference: &Reference, [x, y, sample]: [u32; 3]| {
        reference.sample(x, y, sample.into(), &mut RayCounts::default())
    };
    for i in 0..16 {
        let at = [i, 15 - i, 7];
        let first = sample(&reference, at);
        assert!(first.is_finite() && first.min_element() >= 0.0);
        sample(&reference, [i + 1, 3, 0]);
        assert_eq!(sample(&reference, at), first);
        for different in [
            sample(&other, at),
            sample(&reference, [i, 15 - i, 8]),
            sample(&reference, [i + 1, 15 - i, 7]),
        ] {
            assert_ne!(different, first);
        }
    }
}

#[test]
fn wrong_indices_and_empty_films_are_errors() {
    let settings = RenderSettings::default();
    let scene = busy_room().build();
    assert!(Reference::new(&scene, 1, 8, 8, &settings).is_err());
    assert!(Reference::new(&scene, 0, 0, 8, &settings).is_err());
    let mut no_material = busy_room();
    no_material.floor(1.0, 1.0, MaterialId(99));
    assert!(Reference::new(&no_material.build(), 0, 8, 8, &settings).is_err());
    let mut no_vertex = busy_room();
    no_vertex.mesh(vec![DVec3::X, DVec3::Y], vec![[0, 1, 2]], MaterialId(0));
    assert!(Reference::new(&no_vertex.build(), 0, 8, 8, &settings).is_err());
}
