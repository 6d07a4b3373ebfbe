//! The image depends on scene, settings and seed, and on nothing else.

use wavepath::scene::{Budget, IntegratorKind, RenderSettings, SamplerKind, Strategy};

use crate::builder::adorned_room;
use crate::support::{load, picture};

const SIZE: [u32; 2] = [50, 37];

/// The scene that is made in code: smooth normals, textures, opacity.
const ADORNED: &str = "adorned room";

/// Bits of every mean and variance.
fn bits(name: &str, settings: &RenderSettings) -> Vec<u64> {
    let scene = if name == ADORNED {
        adorned_room().build()
    } else {
        load(name)
    };
    let outcome = picture(&scene, 0, SIZE, settings);
    let film = &outcome.film;
    (0..film.len())
        .flat_map(|p| {
            film.mean(p)
                .into_iter()
                .chain(film.variance(p).unwrap_or_default())
        })
        .map(f64::to_bits)
        .collect()
}

fn base() -> RenderSettings {
    RenderSettings {
        budget: Budget::Samples(20),
        threads: 2,
        ..RenderSettings::default()
    }
}

/// Scenes and settings that reach every kernel.
fn cases() -> Vec<(&'static str, RenderSettings)> {
    let whitted = RenderSettings {
        integrator: IntegratorKind::Whitted,
        ..base()
    };
    vec![
        ("hexroom.toml", base()),
        (
            "hexroom.toml",
            RenderSettings {
                sampler: SamplerKind::Stratified,
                ..base()
            },
        ),
        (
            "hexroom.toml",
            RenderSettings {
                strategy: Strategy::Nee,
                ..base()
            },
        ),
        (
            "hexroom.toml",
            RenderSettings {
                strategy: Strategy::Bsdf,
                max_depth: Some(4),
                ..base()
            },
        ),
        (
            "hexroom.toml",
            RenderSettings {
                transparent_shadows: true,
                ..base()
            },
        ),
        ("hexroom.toml", whitted.clone()),
        ("materials.toml", base()),
        ("materials.toml", whitted.clone()),
        (ADORNED, base()),
        (
            ADORNED,
            RenderSettings {
                sampler: SamplerKind::Stratified,
                transparent_shadows: true,
                ..whitted
            },
        ),
        ("many-lights.toml", base()),
        (
            "hexroom.toml",
            RenderSettings {
                sampler: SamplerKind::Sobol,
                light_samples: 3,
                glass_splits: 3,
                ..base()
            },
        ),
        (
            "hexroom.toml",
            RenderSettings {
                adaptive: true,
                transparent_shadows: true,
                light_samples: 2,
                ..base()
            },
        ),
        (
            "materials.toml",
            RenderSettings {
                adaptive: true,
                budget: Budget::Error(0.5),
                glass_splits: 1,
                ..base()
            },
        ),
    ]
}

#[test]
fn the_image_is_bit_identical_for_any_number_of_threads() {
    for (scene, settings) in cases() {
        let one = bits(
            scene,
            &RenderSettings {
                threads: 1,
                ..settings.clone()
            },
        );
        for threads in [2, 5] {
            let many = bits(
                scene,
                &RenderSettings {
                    threads,
                    ..settings.clone()
                },
            );
            assert!(
                one == many,
                "{scene} differs with {threads} threads: {settings:?}"
            );
        }
    }
}

#[test]
fn the_image_is_bit_identical_for_any_wave_size() {
    for (scene, settings) in cases() {
        let reference = bits(scene, &settings);
        for wave in [1, 64, 1000, 1024, 16_384] {
            let other = bits(
                scene,
                &RenderSettings {
                    wave,
                    ..settings.clone()
                },
            );
            assert!(
                reference == other,
                "{scene} differs with a wave of {wave}: {settings:?}"
            );
        }
    }
}

#[test]
fn the_image_is_bit_identical_with_every_feature_forced_in() {
    for (scene, settings) in cases() {
        let lean = bits(scene, &settings);
        let full = bits(
            scene,
            &RenderSettings {
                force_features: true,
                ..settings.clone()
            },
        );
        assert!(
            lean == full,
            "{scene} differs with every feature: {settings:?}"
        );
    }
}

#[test]
fn another_seed_gives_another_image() {
    let settings = base();
    let other = RenderSettings {
        seed: 1,
        ..settings.clone()
    };
    assert!(bits("hexroom.toml", &settings) != bits("hexroom.toml", &other));
}

#[test]
fn block_size_does_not_change_independent_samples() {
    // The same samples in other blocks: equal up to the order of f64 sums.
    let scene = load("hexroom.toml");
    let [a, b] = [4, 7].map(|block| picture(&scene, 0, SIZE, &RenderSettings { block, ..base() }));
    for pixel in 0..a.film.len() {
        for (x, y) in a.film.mean(pixel).into_iter().zip(b.film.mean(pixel)) {
            assert!(
                (x - y).abs() <= 1e-12 * x.abs(),
                "pixel {pixel}: {x} and {y}"
            );
        }
    }
}
