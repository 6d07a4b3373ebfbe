//! Where samples go: error goals, adaptive sampling, several light samples, splitting at glass.

use wavepath::film::{Film, RELATIVE_EPSILON};
use wavepath::integrator::stats::EndReason;
use wavepath::scene::{
    BsdfDescription, Budget, IntegratorKind, RenderSettings, SamplerKind, SceneDescription,
    Strategy,
};

use crate::builder::{SceneBuilder, adorned_room, lambertian};
use crate::renderer::{Renderer, path};
use crate::support::{estimate, load, picture};
use crate::ztest::{ImageEstimate, assert_same, compare};

/// Root of the mean of (mean − reference)² / (reference² + ε²), by which relative errors are defined.
fn relative_error(film: &Film, reference: &Film) -> f64 {
    let epsilon = RELATIVE_EPSILON * reference.image_mean();
    let terms = (0..film.len()).flat_map(|pixel| {
        let pairs = film.mean(pixel).into_iter().zip(reference.mean(pixel));
        pairs.map(move |(a, b)| (a - b).powi(2) / (b * b + epsilon * epsilon))
    });
    (terms.sum::<f64>() / (3 * film.len()) as f64).sqrt()
}

/// Without a limit of time, on one thread.
fn settings(scene: &SceneDescription, budget: Budget) -> RenderSettings {
    RenderSettings {
        budget,
        threads: 1,
        wave: 1024,
        ..RenderSettings::from_defaults(&scene.render)
    }
}

#[test]
#[expect(
    clippy::print_stdout,
    reason = "how often, for those who ask with --nocapture"
)]
fn error_goals_are_met_and_the_interval_holds_the_true_error_in_most_of_100_renders() {
    let scene = load("cornell.toml");
    let size = [8, 8];
    let goal = 0.08;
    for (max_depth, sampler, adaptive, least) in [
        // 95 if block means were normal and relative errors had the true mean in their denominator. The
        // figures are fixed by the seeds; printed by the test, they are 85 and more.
        (Some(2), SamplerKind::Independent, false, 80),
        (Some(2), SamplerKind::Independent, true, 80),
        // With all bounces rare bright samples, which the estimate has not seen, cost a tenth of the renders.
        (None, SamplerKind::Independent, false, 80),
        // The estimate is conservative: the error may be below the interval.
        (Some(2), SamplerKind::Sobol, false, 0),
    ] {
        let base = RenderSettings {
            max_depth,
            ..settings(&scene, Budget::Error(goal))
        };
        let long = RenderSettings {
            budget: Budget::Samples(1 << 15),
            seed: 1000,
            ..base.clone()
        };
        let reference = picture(&scene, 0, size, &long).film;
        let (mut held, mut below) = (0, 0);
        for seed in 0..100 {
            let settings = RenderSettings {
                sampler,
                adaptive,
                seed,
                ..base.clone()
            };
            let outcome = picture(&scene, 0, size, &settings);
            assert_eq!(outcome.ended, EndReason::Error);
            let error = outcome.film.error_estimate().expect("several blocks");
            assert!(error.estimate <= goal);
            let truth = relative_error(&outcome.film, &reference);
            let [low, high] = error.interval;
            held += u32::from((low..=high).contains(&truth));
            below += u32::from(truth <= high);
        }
        println!(
            "depth {max_depth:?}, {sampler:?}, adaptive {adaptive}: {held} held, {below} not above"
        );
        assert!(held >= least && below >= least.max(80));
    }
}

#[test]
fn several_light_samples_and_splits_do_not_change_the_expectation() {
    let scenes = [
        load("hexroom.toml"),
        load("materials.toml"),
        load("many-lights.toml"),
        adorned_room().build(),
    ];
    let size = [24, 24];
    for (index, scene) in scenes.iter().enumerate() {
        let base = RenderSettings {
            max_depth: Some(8),
            block: 2,
            ..settings(scene, Budget::Samples(64))
        };
        let (expected, _) = Renderer::Reference.image(scene, &base, size, 64);
        for (light_samples, glass_splits, strategy, sampler) in [
            (3, 0, Strategy::Mis, SamplerKind::Independent),
            (2, 3, Strategy::Mis, SamplerKind::Stratified),
            (4, 2, Strategy::Nee, SamplerKind::Sobol),
            (1, 8, Strategy::Bsdf, SamplerKind::Sobol),
        ] {
            let settings = RenderSettings {
                light_samples,
                glass_splits,
                strategy,
                sampler,
                seed: 5,
                ..base.clone()
            };
            let label = format!("scene {index}, {settings:?}");
            let ours = estimate(&picture(scene, 0, size, &settings).film);
            let comparison = compare(&ours, &expected, 1e-4);
            assert!(comparison.passes(), "wavefront, {label}: {comparison}");
            let (reference, _) = Renderer::Reference.image(scene, &settings, size, 32);
            let comparison = compare(&reference, &ours, 1e-4);
            assert!(comparison.passes(), "reference, {label}: {comparison}");
        }
    }
}

#[test]
fn several_light_samples_in_whitteds_method_and_through_glass_do_not_change_the_expectation() {
    let scene = load("hexroom.toml");
    for (integrator, transparent_shadows) in [
        (IntegratorKind::Whitted, false),
        (IntegratorKind::Whitted, true),
        (IntegratorKind::Path, true),
    ] {
        let base = RenderSettings {
            integrator,
            transparent_shadows,
            max_depth: Some(8),
            block: 1,
            ..settings(&scene, Budget::Samples(64))
        };
        let several = RenderSettings {
            light_samples: 5,
            glass_splits: 2,
            seed: 3,
            ..base.clone()
        };
        let [one, several] =
            [base, several].map(|s| estimate(&picture(&scene, 0, [24, 24], &s).film));
        assert_same(&several, &one);
    }
}

#[test]
fn more_light_samples_lower_the_variance_of_direct_light_and_cost_their_shadow_rays() {
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(0.6));
    scene.floor(2.0, 0.0, floor);
    let light = scene.one_sided(BsdfDescription::Black, 1.0);
    scene.ceiling(0.8, 1.0, light);
    scene.aim([3.0, -4.0, 2.5], [0.0; 3]);
    let scene = scene.build();
    let [one, eight] = [1, 8].map(|light_samples| {
        let settings = RenderSettings {
            light_samples,
            ..path(Strategy::Nee, 2)
        };
        let (image, counts) = Renderer::Wavefront.image(&scene, &settings, [64, 4], 64);
        assert_eq!(counts.shadow, u64::from(light_samples) * counts.camera);
        image.variance_of_mean.iter().map(|v| v[0]).sum::<f64>()
    });
    // The ratio of two variances from 256 pixels with 31 degrees of freedom each.
    assert!((one / eight / 8.0 - 1.0).abs() < 0.1, "{}", one / eight);
}

/// Floor under a small bright lamp in one half of the picture, an even sky in the other.
fn uneven() -> SceneDescription {
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(0.8));
    scene.floor(1.0, 0.0, floor);
    let lamp = scene.one_sided(BsdfDescription::Black, 20.0);
    scene.ceiling(0.3, 0.7, lamp);
    scene.background(0.5);
    scene.window(
        [0.0, -3.0, 1.0],
        [-2.0, -2.0, 1.4],
        [4.0, 0.0, 0.0],
        [0.0, 0.0, -1.5],
    );
    scene.build()
}

#[test]
fn adaptive_renders_are_unbiased_over_many_seeds() {
    let scene = uneven();
    let size = [80, 40];
    let base = settings(&scene, Budget::Samples(16));
    let uniform = RenderSettings {
        budget: Budget::Samples(1024),
        seed: 99,
        ..base.clone()
    };
    let expected = estimate(&picture(&scene, 0, size, &uniform).film);
    let runs = 60;
    for sampler in [SamplerKind::Independent, SamplerKind::Sobol] {
        let films: Vec<Film> = (0..runs)
            .map(|seed| {
                let settings = RenderSettings {
                    adaptive: true,
                    sampler,
                    seed,
                    ..base.clone()
                };
                picture(&scene, 0, size, &settings).film
            })
            .collect();
        assert!(films[0].max_samples() > 2 * films[0].min_samples());
        // Each render is one sample of what an adaptive render shows.
        let over_seeds =
            ImageEstimate::from_samples(size.map(|n| n as usize), runs, |x, y, run| {
                films[run as usize].mean(y * size[0] as usize + x)
            });
        assert_same(&over_seeds, &expected);
    }
}

#[test]
fn adaptive_renders_have_less_error_with_as_many_samples_and_tell_it() {
    let scene = uneven();
    let size = [128, 64];
    let base = settings(&scene, Budget::Samples(64));
    let long = RenderSettings {
        budget: Budget::Samples(4096),
        seed: 99,
        ..base.clone()
    };
    let reference = picture(&scene, 0, size, &long).film;
    let [uniform, adaptive] = [false, true].map(|adaptive| {
        let settings = RenderSettings {
            adaptive,
            ..base.clone()
        };
        let film = picture(&scene, 0, size, &settings).film;
        let samples = film.total_samples() as f64 / film.len() as f64;
        assert!((samples / 64.0 - 1.0).abs() < 0.05, "{samples} samples");
        let error = relative_error(&film, &reference);
        let told = film.relative_error().expect("several blocks");
        assert!(
            (told / error - 1.0).abs() < 0.1,
            "{told} told, {error} true"
        );
        error
    });
    assert!(adaptive < 0.9 * uniform, "{adaptive} and {uniform}");
}

#[test]
fn adaptive_renders_of_too_few_samples_are_refused() {
    let scene = uneven();
    let settings = RenderSettings {
        adaptive: true,
        ..settings(&scene, Budget::Samples(7))
    };
    let compiled =
        wavepath::compile::compile(&scene, 0, 8, 8, &settings).expect("the scene is sound");
    let refused = wavepath::integrator::render(&scene, &compiled, &settings, &|_| {
        std::ops::ControlFlow::Continue(())
    });
    let message = refused.expect_err("too few").to_string();
    assert!(message.contains("at least 8 samples"), "{message}");
}
