//! Settings that trade light for robustness, and what is counted instead of shown.

use wavepath::integrator::Outcome;
use wavepath::report::bias;
use wavepath::scene::{BsdfDescription, Budget, IntegratorKind, RenderSettings, Strategy};

use crate::builder::{SceneBuilder, lambertian};
use crate::renderer::{endless, path};
use crate::support::{image_mean, picture};

/// The picture of both renderers.
fn by_both(scene: &SceneBuilder, settings: &RenderSettings, samples: u64) -> [Outcome; 2] {
    [settings.integrator, IntegratorKind::Reference].map(|integrator| {
        let settings = RenderSettings {
            integrator,
            budget: Budget::Samples(samples),
            threads: 1,
            ..settings.clone()
        };
        picture(&scene.build(), 0, [16, 16], &settings)
    })
}

/// A sphere of albedo 0.6 that fills the picture, under a sky of radiance 1.
fn ball_under_the_sky() -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let grey = scene.matter(lambertian(0.6));
    scene.sphere([0.1, 0.2, 0.3], 1.0, grey);
    scene.background(1.0);
    let right = [0.1, 0.0, 0.0];
    scene.window([0.1, -4.0, 0.3], [0.0, -3.0, 0.4], right, [0.0, 0.0, -0.1]);
    scene
}

#[test]
fn a_clamp_darkens_what_is_brighter_counts_it_and_is_told_as_bias() {
    // Every sample is 0.6 exactly but for rounding.
    let scene = ball_under_the_sky();
    let settings = RenderSettings {
        clamp: Some(0.25),
        ..path(Strategy::Nee, 2)
    };
    for outcome in by_both(&scene, &settings, 4) {
        assert_eq!(outcome.stats.clamped, 16 * 16 * 4);
        for pixel in 0..outcome.film.len() {
            for mean in outcome.film.mean(pixel) {
                assert!((mean - 0.25).abs() < 1e-12, "{mean}");
            }
        }
        let told = bias(&settings, &outcome.stats);
        assert!(
            told.contains(&"clamp 0.25: 1024 samples darkened".to_owned()),
            "{told:?}"
        );
    }
    let high = RenderSettings {
        clamp: Some(0.61),
        ..settings.clone()
    };
    let none = RenderSettings {
        clamp: None,
        ..settings
    };
    for (high, none) in by_both(&scene, &high, 4)
        .iter()
        .zip(by_both(&scene, &none, 4))
    {
        assert_eq!(high.stats.clamped, 0);
        for pixel in 0..none.film.len() {
            assert_eq!(high.film.mean(pixel), none.film.mean(pixel));
        }
    }
}

#[test]
fn a_clamp_keeps_the_hue() {
    let mut scene = SceneBuilder::new();
    let black = scene.matter(BsdfDescription::Black);
    scene.floor(1.0, -1.0, black);
    scene.aim([0.0, 0.0, 1.0], [0.0, 0.0, 2.0]);
    let mut scene = scene.build();
    scene.background = glam::DVec3::new(8.0, 4.0, 1.0);
    let settings = RenderSettings {
        clamp: Some(2.0),
        ..endless(Strategy::Mis)
    };
    let outcome = picture(&scene, 0, [2, 2], &settings);
    assert_eq!(outcome.film.mean(0), [2.0, 1.0, 0.25]);
}

#[test]
fn a_bias_too_small_shades_a_surface_by_itself_and_the_error_bound_does_not() {
    let scene = ball_under_the_sky();
    let computed = path(Strategy::Nee, 2);
    let none = RenderSettings {
        shadow_bias: Some(0.0),
        ..computed.clone()
    };
    for outcome in by_both(&scene, &computed, 16) {
        let [(mean, _), ..] = image_mean(&outcome);
        assert!((mean - 0.6).abs() < 1e-6, "{mean}");
        assert!(bias(&computed, &outcome.stats).is_empty());
    }
    for outcome in by_both(&scene, &none, 16) {
        let [(mean, _), ..] = image_mean(&outcome);
        assert!(mean < 0.59, "{mean}: no acne");
        let told = bias(&none, &outcome.stats);
        let is_told = told.iter().any(|line| line.starts_with("shadow bias 0: "));
        assert!(is_told, "{told:?}");
    }
}

#[test]
fn a_bias_too_large_loses_the_shadow_of_what_is_near_and_the_error_bound_does_not() {
    // Seen through the gap between a floor and a plate that hides the lamp from it.
    let mut scene = SceneBuilder::new();
    let (grey, black) = (
        scene.matter(lambertian(0.6)),
        scene.matter(BsdfDescription::Black),
    );
    let lamp = scene.one_sided(BsdfDescription::Black, 10.0);
    scene.floor(1.0, 0.0, grey);
    scene.floor(5.0, 1e-3, black);
    scene.ceiling(1.0, 2.0, lamp);
    scene.aim([0.5, 0.0, 5e-4], [0.0; 3]);
    let computed = path(Strategy::Nee, 2);
    for outcome in by_both(&scene, &computed, 4) {
        assert_eq!(image_mean(&outcome)[0].0, 0.0);
    }
    let large = RenderSettings {
        shadow_bias: Some(1e-2),
        ..computed
    };
    for outcome in by_both(&scene, &large, 4) {
        assert!(image_mean(&outcome)[0].0 > 0.5);
    }
}

#[test]
fn a_biased_ray_is_aimed_from_where_it_starts_and_ends_before_what_is_behind_the_lamp() {
    // A lamp just under a ceiling that the sky, too, is hidden by: shadow rays are as long as from the surface, or
    // shorter by the bias; then the ceiling is not reached.
    let mut scene = SceneBuilder::new();
    let grey = scene.matter(lambertian(0.6));
    let black = scene.matter(BsdfDescription::Black);
    let lamp = scene.one_sided(BsdfDescription::Black, 10.0);
    scene.floor(1.0, 0.0, grey);
    scene.ceiling(3.0, 1.0, black);
    scene.ceiling(0.5, 0.99, lamp);
    scene.background(0.1);
    scene.aim([0.5, -2.0, 0.5], [0.0; 3]);
    let settings = RenderSettings {
        shadow_bias: Some(0.1),
        ..path(Strategy::Nee, 2)
    };
    let [ours, reference] = by_both(&scene, &settings, 256).map(|outcome| image_mean(&outcome)[0]);
    let error = ours.1.hypot(reference.1);
    assert!(
        (ours.0 - reference.0).abs() < 4.0 * error,
        "{ours:?}, not {reference:?}"
    );
    assert!(reference.0 > 0.5 && error < 0.02, "{reference:?}");
}

#[test]
fn a_good_bias_shows_the_picture_of_the_error_bound() {
    let settings = RenderSettings {
        shadow_bias: Some(1e-4),
        ..path(Strategy::Nee, 2)
    };
    for outcome in by_both(&ball_under_the_sky(), &settings, 4) {
        let [(mean, _), ..] = image_mean(&outcome);
        assert!((mean - 0.6).abs() < 1e-3, "{mean}");
    }
}
