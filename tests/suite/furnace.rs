//! Closed rooms of which the radiance is known.

use glam::DVec3;
use wavepath::integrator::Outcome;
use wavepath::scene::{
    Budget, EmissionDescription, RenderSettings, SamplerKind, SceneDescription, Strategy,
};

use crate::builder::{glowing_room, lambertian};
use crate::renderer::{STRUCTURES, path};
use crate::support::{image_mean, load, parse, picture};
use wavepath::report::stability::oracles;

/// A box whose walls have `bsdf` and emit `emission`, seen from inside, with `inside` in it.
fn room(bsdf: &str, emission: f64, inside: &str) -> String {
    format!(
        r#"
        [film]
        width = 16
        height = 16
        [cameras.inside]
        eye = [0.1, 0.2, -0.3]
        look_at = [1.0, 0.4, 0.2]
        up = [0.0, 0.0, 1.0]
        fov = 90.0
        [materials.wall]
        {bsdf}
        emission = [{emission}, {emission}, {emission}]
        two_sided = true
        [[shapes]]
        type = "mesh"
        mesh = "box"
        material = "wall"
        {inside}
        "#
    )
}

/// Roulette starts where what it decides on is still seen: its rare survivors carry much.
fn settings(strategy: Strategy) -> RenderSettings {
    RenderSettings {
        roulette_depth: 30,
        budget: Budget::Samples(64),
        threads: 2,
        strategy,
        ..RenderSettings::default()
    }
}

#[test]
fn a_closed_emitting_room_has_radiance_l_over_one_minus_rho() {
    for rho in [0.0, 0.1, 0.5, 0.9, 0.99] {
        for bsdf in [
            format!("type = \"lambertian\"\nreflectance = {rho}"),
            format!("type = \"oren-nayar\"\nreflectance = {rho}\nsigma = 0.0"),
            format!("type = \"mirror\"\nreflectance = {rho}"),
        ] {
            let scene = parse(&room(&bsdf, 1.0 - rho, ""));
            for strategy in [Strategy::Mis, Strategy::Nee, Strategy::Bsdf] {
                let outcome = picture(&scene, 0, [16, 16], &settings(strategy));
                for (mean, error) in image_mean(&outcome) {
                    assert!(
                        (mean - 1.0).abs() <= 3.0 * error + 1e-5,
                        "{bsdf}, {strategy:?}: {mean} ± {error}"
                    );
                }
            }
        }
    }
}

#[test]
fn without_light_sampling_and_roulette_a_furnace_has_no_variance() {
    // Le·(1 − ρ^n)/(1 − ρ) after n segments, in every sample of every pixel.
    let (rho, emission, depth) = (0.5, 0.5, 20);
    let scene = parse(&room(
        "type = \"lambertian\"\nreflectance = 0.5",
        emission,
        "",
    ));
    let settings = RenderSettings {
        max_depth: Some(depth),
        roulette_depth: 1000,
        budget: Budget::Samples(4),
        ..settings(Strategy::Bsdf)
    };
    let expected = emission * (1.0 - f64::powi(rho, depth as i32)) / (1.0 - rho);
    let outcome = picture(&scene, 0, [16, 16], &settings);
    for pixel in 0..outcome.film.len() {
        for value in outcome.film.mean(pixel) {
            assert!(
                (value - expected).abs() < 1e-6,
                "pixel {pixel}: {value}, not {expected}"
            );
        }
    }
}

#[test]
fn lossless_glass_in_a_furnace_is_invisible() {
    for fresnel in ["exact", "schlick"] {
        let inside = format!(
            r#"
            [materials.glass]
            type = "dielectric"
            ior = 1.5
            fresnel = "{fresnel}"
            [[shapes]]
            type = "sphere"
            material = "glass"
            center = [0.3, 0.25, 0.0]
            radius = 0.12
            "#
        );
        let scene = parse(&room(
            "type = \"lambertian\"\nreflectance = 0.5",
            0.5,
            &inside,
        ));
        for strategy in [Strategy::Mis, Strategy::Nee, Strategy::Bsdf] {
            let outcome = picture(&scene, 0, [16, 16], &settings(strategy));
            for (mean, error) in image_mean(&outcome) {
                assert!(
                    (mean - 1.0).abs() <= 3.0 * error + 1e-5,
                    "{strategy:?}: {mean} ± {error}"
                );
            }
        }
    }
}

#[test]
fn a_hall_of_perfect_mirrors_ends_by_roulette_alone() {
    // Reflectance 1 and no emission: survival is at most 0.99, so the render ends, black.
    let scene = parse(&room("type = \"mirror\"\nreflectance = 1.0", 0.0, ""));
    let outcome = picture(&scene, 0, [16, 16], &settings(Strategy::Mis));
    assert_eq!(image_mean(&outcome)[0].0, 0.0);
    let mean_length = outcome.stats.rays() as f64 / outcome.stats.paths as f64;
    // From depth 30 on a path lasts 1/(1 − 0.99) = 100 segments more on average; 4σ of the mean.
    assert!(
        (mean_length - 129.0).abs() < 4.0 * 100.0 / (outcome.stats.paths as f64).sqrt() + 1.0,
        "{mean_length}"
    );
}

#[test]
fn depth_counts_segments_in_every_strategy() {
    // Depth n leaves Le·(1 + ρ + … + ρ^(n−1)).
    let scene = parse(&room("type = \"lambertian\"\nreflectance = 0.5", 1.0, ""));
    for strategy in [Strategy::Mis, Strategy::Nee, Strategy::Bsdf] {
        for (depth, expected) in [(1, 1.0), (2, 1.5), (3, 1.75), (4, 1.875)] {
            let settings = RenderSettings {
                max_depth: Some(depth),
                roulette_depth: 100,
                ..settings(strategy)
            };
            let outcome = picture(&scene, 0, [16, 16], &settings);
            let (mean, error) = image_mean(&outcome)[0];
            assert!(
                (mean - expected).abs() <= 4.0 * error + 1e-5,
                "{strategy:?} at depth {depth}: {mean} ± {error}, not {expected}"
            );
        }
    }
}

/// Asserts that every pixel is Σ ρ^k, k < depth, for emission 1, but for rounding.
#[track_caller]
fn assert_uniform(outcome: &Outcome, albedo: f64, depth: u32, label: &str) {
    let expected = oracles::furnace(albedo, depth - 1);
    for pixel in 0..outcome.film.len() {
        for value in outcome.film.mean(pixel) {
            assert!(
                (value - expected).abs() <= 1e-5 * expected,
                "{label}: pixel {pixel} is {value}, not {expected}"
            );
        }
    }
}

#[test]
fn a_furnace_is_exact_at_any_size_and_place_in_every_structure() {
    let sizes = [1e-12, 1e-6, 1e-3, 1.0, 1e3, 1e7, 1e18].map(|size| (size, DVec3::ZERO));
    let places = [1e3, 1e4, 1e5, 1e6].map(|far| (1.0, DVec3::new(far, -0.3 * far, 0.7 * far)));
    for (size, place) in sizes.into_iter().chain(places) {
        for is_sphere in [false, true] {
            let scene = glowing_room(lambertian(0.5), size, place, is_sphere).build();
            for accel in STRUCTURES {
                let settings = RenderSettings {
                    accel,
                    budget: Budget::Samples(8),
                    ..path(Strategy::Bsdf, 20)
                };
                let outcome = picture(&scene, 0, [16, 16], &settings);
                let label = format!("size {size} at {place}, sphere {is_sphere}, {accel:?}");
                assert_uniform(&outcome, 0.5, 20, &label);
            }
        }
    }
}

/// The hexagonal room with all that is in it, of which everything emits 1 and reflects one half.
fn glowing_hexagonal_room() -> SceneDescription {
    let mut scene = load("hexroom.toml");
    for material in &mut scene.materials {
        material.bsdf = lambertian(0.5);
        material.emission = Some(EmissionDescription {
            radiance: DVec3::ONE,
            two_sided: true,
        });
    }
    scene.background = DVec3::splat(1e9);
    scene
}

#[test]
fn the_hexagonal_room_as_a_furnace_shows_no_leak_and_no_line_from_its_edge() {
    let scene = glowing_hexagonal_room();
    for accel in STRUCTURES {
        let settings = RenderSettings {
            accel,
            budget: Budget::Samples(2),
            ..path(Strategy::Bsdf, 12)
        };
        for (camera, view) in scene.cameras.iter().enumerate() {
            let outcome = picture(&scene, camera, [200, 200], &settings);
            assert_uniform(
                &outcome,
                0.5,
                12,
                &format!("camera {}, {accel:?}", view.name),
            );
        }
    }
}

#[test]
fn the_hexagonal_room_as_a_furnace_keeps_its_mean_when_its_lights_are_sampled() {
    // Triangles, parallelograms and spheres seen from outside light one another and themselves.
    let mut scene = glowing_hexagonal_room();
    scene.background = DVec3::ZERO;
    for strategy in [Strategy::Mis, Strategy::Nee] {
        for sampler in [SamplerKind::Independent, SamplerKind::Stratified] {
            let settings = RenderSettings {
                sampler,
                threads: 2,
                ..path(strategy, 12)
            };
            for camera in 0..scene.cameras.len() {
                let outcome = picture(&scene, camera, [32, 32], &settings);
                let expected = oracles::furnace(0.5, 11);
                let (mean, error) = image_mean(&outcome)[0];
                assert!(
                    (mean - expected).abs() <= 4.0 * error + 1e-5,
                    "{strategy:?}, {sampler:?}, camera {camera}: {mean} ± {error}, not {expected}"
                );
            }
        }
    }
}
