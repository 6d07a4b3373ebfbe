//! Scenes and settings at the ends of what is allowed, through the wavefront.

use std::f64::consts::PI;

use glam::DVec3;
use wavepath::compile::compile;
use wavepath::integrator::Outcome;
use wavepath::scene::{
    BsdfDescription, Budget, RenderSettings, SamplerKind, SceneDescription, Strategy,
};

use crate::builder::{SceneBuilder, glowing_room, lambertian, mirror};
use crate::renderer::{Renderer, STRATEGIES, STRUCTURES, endless, path, whitted};
use crate::support::picture;
use wavepath::report::stability::oracles;

/// Path tracing by every strategy, and Whitted's method, to this many segments.
fn all_methods(max_depth: u32) -> impl Iterator<Item = RenderSettings> {
    STRATEGIES
        .into_iter()
        .map(move |strategy| path(strategy, max_depth))
        .chain([whitted(max_depth)])
}

/// A picture of odd size: no side is a multiple of a tile's.
fn odd_picture(scene: &SceneDescription, settings: &RenderSettings) -> Outcome {
    let settings = RenderSettings {
        budget: Budget::Samples(4),
        ..settings.clone()
    };
    picture(scene, 0, [21, 19], &settings)
}

#[track_caller]
fn assert_every_pixel_is(outcome: &Outcome, expected: f64) {
    for pixel in 0..outcome.film.len() {
        for value in outcome.film.mean(pixel) {
            assert!(
                (value - expected).abs() <= 1e-5 * expected,
                "pixel {pixel} is {value}, not {expected}"
            );
        }
    }
}

/// Nothing but camera rays was traced.
#[track_caller]
fn assert_no_second_ray(outcome: &Outcome) {
    let stats = &outcome.stats;
    assert_eq!(stats.camera_rays, outcome.film.total_samples());
    assert_eq!((stats.bounce_rays, stats.shadow_rays), (0, 0));
}

#[test]
fn nothing_at_all_is_black() {
    let mut scene = SceneBuilder::new();
    scene.aim([1.0, 2.0, 3.0], [0.0; 3]);
    for settings in all_methods(5) {
        for accel in STRUCTURES {
            let settings = RenderSettings {
                accel,
                ..settings.clone()
            };
            for force_features in [false, true] {
                let settings = RenderSettings {
                    force_features,
                    ..settings.clone()
                };
                let outcome = odd_picture(&scene.build(), &settings);
                assert_every_pixel_is(&outcome, 0.0);
                assert_no_second_ray(&outcome);
            }
        }
    }
}

#[test]
fn a_background_alone_fills_the_picture() {
    let mut scene = SceneBuilder::new();
    scene.background(0.25);
    // At the origin and far from it: the scene has no other place than the eye.
    for eye in [[0.0; 3], [1e6, 0.0, -1e6]] {
        let mut scene = scene.clone();
        scene.window(eye, [1.0; 3], [2.0, 0.0, 0.0], [0.0, -2.0, 0.0]);
        for settings in all_methods(5) {
            let outcome = odd_picture(&scene.build(), &settings);
            assert_every_pixel_is(&outcome, 0.25);
            assert_no_second_ray(&outcome);
        }
    }
}

#[test]
fn lights_with_nothing_to_light_are_seen_and_not_sampled() {
    let mut scene = SceneBuilder::new();
    let light = scene.one_sided(BsdfDescription::Black, 3.0);
    scene.sphere([0.0; 3], 1.0, light);
    scene.ceiling(1.0, 5.0, light);
    scene.point_light([0.0, 0.0, 2.0], 7.0);
    let [mut at_sphere, mut at_quad] = [scene.clone(), scene.clone()];
    at_sphere.aim([3.0, 1.0, 0.5], [0.0, 0.2, 0.1]);
    at_quad.aim([3.0, 1.0, 0.5], [0.3, 0.2, 5.0]);
    for scene in [at_sphere, at_quad] {
        for settings in all_methods(5) {
            let outcome = odd_picture(&scene.build(), &settings);
            assert_every_pixel_is(&outcome, 3.0);
            assert_no_second_ray(&outcome);
        }
    }
}

#[test]
fn one_triangle_or_one_sphere_reflects_the_sky_by_its_albedo() {
    let [mut triangle, mut sphere] = [SceneBuilder::new(), SceneBuilder::new()];
    let matte = triangle.matter(lambertian(0.6));
    let corners = [[-1.0, -1.0, 0.1], [1.0, -1.0, 0.0], [0.0, 1.0, -0.2]];
    triangle.mesh(corners.map(DVec3::from).to_vec(), vec![[0, 1, 2]], matte);
    let matte = sphere.matter(lambertian(0.6));
    sphere.sphere([0.0; 3], 0.5, matte);
    for mut scene in [triangle, sphere] {
        scene.background(2.0);
        scene.aim([0.5, -0.3, 4.0], [0.0; 3]);
        for strategy in STRATEGIES {
            for accel in STRUCTURES {
                // Light and directions are both sampled by the cosine: nothing is left to chance.
                let settings = RenderSettings {
                    accel,
                    ..endless(strategy)
                };
                assert_every_pixel_is(&odd_picture(&scene.build(), &settings), 1.2);
            }
        }
    }
}

#[test]
fn what_is_behind_the_camera_is_not_seen() {
    let mut scene = glowing_room(lambertian(0.5), 1.0, DVec3::ZERO, true);
    scene.sphere([0.0, 0.0, 3.0], 0.5, wavepath::scene::MaterialId(0));
    scene.background(0.5);
    let mut scene = scene.build();
    scene.cameras.clear();
    let mut view = SceneBuilder::new();
    view.window(
        [0.0, 0.0, -1.5],
        [-1.0, 1.0, -2.5],
        [2.0, 0.0, 0.0],
        [0.0, -2.0, 0.0],
    );
    scene.cameras = view.build().cameras;
    for settings in all_methods(5) {
        for accel in STRUCTURES {
            let settings = RenderSettings {
                accel,
                ..settings.clone()
            };
            let outcome = odd_picture(&scene, &settings);
            assert_every_pixel_is(&outcome, 0.5);
            assert_no_second_ray(&outcome);
        }
    }
}

#[test]
fn an_eye_on_a_surface_sees_what_is_before_it() {
    let mut scene = SceneBuilder::new();
    let black = scene.matter(BsdfDescription::Black);
    let light = scene.two_sided(BsdfDescription::Black, 3.0);
    scene.floor(1.0, 0.0, black);
    scene.ceiling(9.0, 1.0, light);
    scene.sphere([0.0, 0.0, -2.0], 1.0, light);
    scene.background(0.5);
    for (eye, at, expected) in [
        // On the floor's middle, on its diagonal, on an edge and on a corner.
        ([0.1, 0.3, 0.0], [0.2, 0.1, 1.0], 3.0),
        ([0.5, 0.5, 0.0], [0.2, 0.1, 1.0], 3.0),
        ([1.0, 0.3, 0.0], [0.2, 0.1, 1.0], 3.0),
        ([-1.0, -1.0, 0.0], [-0.2, 0.1, 1.0], 3.0),
        ([0.5, 0.5, 0.0], [0.4, 0.4, -1.5], 3.0),
        // Along the floor.
        ([0.5, 0.25, 0.0], [30.0, 0.25, 0.0], 0.5),
        // On the sphere's lowest point, outward and inward.
        ([0.0, 0.0, -3.0], [0.5, 0.0, -4.0], 0.5),
        ([0.0, 0.0, -3.0], [0.1, 0.0, -2.0], 3.0),
    ] {
        let mut scene = scene.clone();
        scene.aim(eye, at);
        for accel in STRUCTURES {
            let settings = RenderSettings {
                accel,
                ..path(Strategy::Mis, 3)
            };
            assert_every_pixel_is(&odd_picture(&scene.build(), &settings), expected);
        }
    }
}

#[test]
fn every_size_of_picture_gets_every_sample_in_every_pixel() {
    let scene = glowing_room(lambertian(0.5), 1.0, DVec3::ZERO, false).build();
    for size in [[1, 1], [1, 33], [17, 1], [16, 16], [31, 47], [300, 2]] {
        for (samples, block) in [(1, 16), (3, 16), (7, 2), (40, 64)] {
            for sampler in [SamplerKind::Independent, SamplerKind::Stratified] {
                let settings = RenderSettings {
                    budget: Budget::Samples(samples),
                    block,
                    sampler,
                    ..path(Strategy::Bsdf, 8)
                };
                let outcome = picture(&scene, 0, size, &settings);
                assert_every_pixel_is(&outcome, oracles::furnace(0.5, 7));
                assert_eq!(outcome.film.min_samples(), samples);
                assert_eq!(outcome.film.max_samples(), samples);
                // One sample tells nothing of its error.
                assert_eq!(outcome.film.variance(0).is_some(), samples > 1);
            }
        }
    }
}

#[test]
fn black_surfaces_send_no_ray() {
    for bsdf in [lambertian(0.0), BsdfDescription::Black] {
        let mut scene = SceneBuilder::new();
        let black = scene.matter(bsdf);
        let light = scene.one_sided(bsdf, 3.0);
        scene.floor(1.0, 0.0, black);
        scene.ceiling(1.0, 5.0, light);
        scene.point_light([0.0, 0.0, 2.0], 7.0);
        scene.background(1.0);
        scene.aim([0.2, 0.1, 1.0], [0.0; 3]);
        for settings in all_methods(9) {
            let outcome = odd_picture(&scene.build(), &settings);
            assert_every_pixel_is(&outcome, 0.0);
            assert_no_second_ray(&outcome);
        }
    }
}

#[test]
fn at_depth_one_only_emission_is_seen_and_no_other_ray_is_sent() {
    let scene = glowing_room(lambertian(0.5), 1.0, DVec3::ZERO, false).build();
    for settings in all_methods(1) {
        let outcome = odd_picture(&scene, &settings);
        assert_every_pixel_is(&outcome, 1.0);
        assert_no_second_ray(&outcome);
        assert_eq!(outcome.stats.truncated, outcome.stats.paths);
    }
}

#[test]
fn lights_without_power_change_nothing() {
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(0.6));
    let dark = scene.one_sided(BsdfDescription::Black, 0.0);
    scene.floor(2.0, 0.0, floor);
    scene.ceiling(1.0, 3.0, dark);
    scene.sphere([1.0, 0.0, 2.5], 0.2, dark);
    scene.point_light([0.0, 1.0, 1.0], 0.0);
    scene.aim([0.5, 0.5, 2.0], [0.0; 3]);
    for settings in all_methods(4) {
        let outcome = odd_picture(&scene.build(), &settings);
        assert_every_pixel_is(&outcome, 0.0);
        assert_eq!(outcome.stats.shadow_rays, 0, "there is nothing to sample");
    }
    // The one light with power is chosen every time.
    scene.point_light([0.0, 0.0, 2.0], 8.0);
    for settings in all_methods(2) {
        let outcome = odd_picture(&scene.build(), &settings);
        assert_every_pixel_is(&outcome, 0.6 / PI * 2.0);
    }
}

#[test]
fn a_thousand_lights_add_up() {
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(0.6));
    scene.floor(9.0, 0.0, floor);
    scene.aim([0.0, -8.0, 1.0], [0.0; 3]);
    let mut irradiance = 0.0;
    for i in 0..500 {
        let (x, y) = (f64::from(i % 25) - 12.0, f64::from(i / 25) - 9.5);
        let power = f64::from(1 + i % 7);
        let position = DVec3::new(x, y, 4.0);
        let distance = position.length();
        scene.point_light(position.into(), power);
        irradiance += power * (4.0 / distance) / (distance * distance);

        let light = scene.one_sided(BsdfDescription::Black, power);
        let corners = [[0.1, 0.1], [0.1, 0.4], [0.4, 0.4], [0.4, 0.1]]
            .map(|[dx, dy]| DVec3::new(x + dx, y + dy, 5.0));
        scene.quad(corners.map(DVec3::into), light);
        irradiance += power * oracles::polygon_irradiance(DVec3::ZERO, DVec3::Z, &corners);
    }
    for settings in [path(Strategy::Mis, 2), path(Strategy::Nee, 2), whitted(2)] {
        Renderer::Wavefront
            .measure(&scene.build(), &settings, 40_000)
            .assert_is(0.6 / PI * irradiance);
    }
}

#[test]
fn roulette_makes_paths_as_long_as_the_albedo_says() {
    for albedo in [0.5, 0.9] {
        let scene = glowing_room(lambertian(albedo), 1.0, DVec3::ZERO, true).build();
        let settings = RenderSettings {
            roulette_depth: 1,
            budget: Budget::Samples(16),
            ..endless(Strategy::Bsdf)
        };
        let stats = picture(&scene, 0, [40, 40], &settings).stats;
        let paths = stats.paths as f64;
        let segments = stats.rays() as f64 / paths;
        // Geometric: a path goes on with probability ρ at each hit.
        let expected = 1.0 / (1.0 - albedo);
        let deviation = albedo.sqrt() / (1.0 - albedo);
        assert!(
            (segments - expected).abs() < 4.0 * deviation / paths.sqrt(),
            "{segments} segments per path at albedo {albedo}, not {expected}"
        );
    }
}

#[test]
fn strata_lower_the_error_of_a_smooth_picture_and_the_estimate_of_it() {
    // The floor under the middle of a wide lamp that nothing hides.
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(0.6));
    let light = scene.one_sided(BsdfDescription::Black, 1.0);
    scene.floor(2.0, 0.0, floor);
    let corners = [
        [-1.0, -1.0, 1.5],
        [-1.0, 1.0, 1.5],
        [1.0, 1.0, 1.5],
        [1.0, -1.0, 1.5],
    ];
    scene.quad(corners, light);
    scene.aim([3.0, -4.0, 1.0], [0.0; 3]);
    let corners = corners.map(DVec3::from);
    let expected = 0.6 / PI * oracles::polygon_irradiance(DVec3::ZERO, DVec3::Z, &corners);
    for strategy in STRATEGIES {
        let [independent, stratified] =
            [SamplerKind::Independent, SamplerKind::Stratified].map(|sampler| {
                let settings = RenderSettings {
                    sampler,
                    budget: Budget::Samples(64),
                    block: 16,
                    ..path(strategy, 2)
                };
                let film = picture(&scene.build(), 0, [40, 25], &settings).film;
                let mean = |value: &dyn Fn(usize) -> f64| {
                    (0..film.len()).map(value).sum::<f64>() / film.len() as f64
                };
                let squared_error = mean(&|pixel| (film.mean(pixel)[0] - expected).powi(2));
                let estimate = mean(&|pixel| film.variance(pixel).expect("four blocks")[0]);
                // Squared errors of 1000 pixels have a mean good to √(2/1000), their estimates by
                // four blocks to √(2/3000): together 5.2 %, four times of which is 21 %.
                assert!(
                    (estimate / squared_error - 1.0).abs() < 0.21,
                    "{strategy:?}, {sampler:?}: error² {squared_error}, estimated {estimate}"
                );
                squared_error
            });
        assert!(
            stratified < 0.5 * independent,
            "{strategy:?}: {stratified} is not much less than {independent}"
        );
    }
}

#[test]
fn paths_longer_than_depths_are_counted_apart_keep_their_number_and_their_light() {
    // Each mirror adds its emission, to any depth; only the counts are summed up at the end.
    let scene = glowing_room(mirror(1.0), 1.0, DVec3::ZERO, true).build();
    for settings in [path(Strategy::Mis, 1000), whitted(1000)] {
        let outcome = odd_picture(&scene, &settings);
        assert_every_pixel_is(&outcome, 1000.0);
        let stats = &outcome.stats;
        assert_eq!(stats.rays(), 1000 * stats.paths);
        assert_eq!(stats.truncated, stats.paths);
        let by_depth: u64 = stats.depths.iter().map(|depth| depth.rays).sum();
        assert_eq!(by_depth, stats.rays());
        assert!(stats.depths.len() < 1000);
        assert_eq!(stats.depths[62].rays, stats.paths);
    }
}

#[test]
fn the_widest_film_is_filled() {
    let scene = glowing_room(lambertian(0.5), 1.0, DVec3::ZERO, false).build();
    let settings = RenderSettings {
        budget: Budget::Samples(1),
        ..path(Strategy::Bsdf, 3)
    };
    for size in [[65_535, 1], [1, 65_535]] {
        assert_every_pixel_is(&picture(&scene, 0, size, &settings), 1.75);
    }
}

#[test]
fn faces_without_area_in_f32_are_dropped_counted_and_do_not_show() {
    // A sliver far from the middle of the scene, narrower than the spacing of f32 there; it would
    // be a light if it were there.
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(0.6));
    scene.floor(1000.0, 0.0, floor);
    let light = scene.two_sided(BsdfDescription::Black, 5.0);
    let (x, z) = (900.0, 1e-9);
    let sliver = [[x, 0.0, z], [x + 1e-9, 0.0, z], [x, 1e-9, z]];
    scene.mesh(sliver.map(DVec3::from).to_vec(), vec![[0, 1, 2]], light);
    scene.background(1.0);
    scene.aim([900.0, 0.0, 2.0], [900.0, 0.0, 0.0]);
    for settings in all_methods(5) {
        let scene = scene.build();
        let compiled = compile(&scene, 0, 16, 16, &settings).expect("the scene is sound");
        assert_eq!((compiled.dropped, compiled.lights.len()), (1, 1));
        assert_every_pixel_is(&odd_picture(&scene, &settings), 0.6);
    }
}

/// A closed grey cube about the origin with corners at ±1.
fn closed_box() -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let wall = scene.matter(lambertian(0.6));
    scene.floor(1.0, -1.0, wall);
    scene.floor(1.0, 1.0, wall);
    for [a, b] in [[[-1.0, -1.0], [1.0, -1.0]], [[1.0, 1.0], [-1.0, 1.0]]] {
        let across = [b, [b[0], -b[1]]];
        for [p, q] in [[a, b], across] {
            let corners = [(p, -1.0), (q, -1.0), (q, 1.0), (p, 1.0)];
            scene.quad(corners.map(|([x, y], z)| [x, y, z]), wall);
        }
    }
    scene
}

#[test]
fn closed_rooms_keep_light_out() {
    type Light = fn(&mut SceneBuilder);
    let lights: [Light; 5] = [
        |scene| scene.point_light([0.3, 0.2, 3.0], 50.0),
        |scene| scene.point_light([0.3, 0.2, 1.0 + 1e-4], 50.0),
        |scene| scene.background(10.0),
        |scene| {
            let light = scene.one_sided(BsdfDescription::Black, 50.0);
            scene.sphere([3.0, 0.5, 0.4], 1.0, light);
        },
        |scene| {
            let light = scene.two_sided(BsdfDescription::Black, 50.0);
            scene.ceiling(1.0, 1.5, light);
        },
    ];
    for add in lights {
        for filled in [false, true] {
            let mut scene = closed_box();
            add(&mut scene);
            if filled {
                let matte = scene.matter(lambertian(0.5));
                scene.sphere([0.2, 0.3, -0.6], 0.3, matte);
            }
            scene.window(
                [-0.5, -0.4, 0.1],
                [0.0, 0.9, 0.8],
                [1.0, -1.0, 0.0],
                [0.0, 0.0, -1.6],
            );
            for settings in all_methods(5) {
                for accel in STRUCTURES {
                    let settings = RenderSettings {
                        accel,
                        ..settings.clone()
                    };
                    assert_every_pixel_is(&odd_picture(&scene.build(), &settings), 0.0);
                }
            }
        }
    }
}

#[test]
fn a_closed_room_casts_shadow_and_is_lit_from_outside() {
    // A lamp above a box on a wide floor, another within it that nothing outside may see.
    let mut scene = closed_box();
    let floor = scene.matter(lambertian(0.6));
    scene.floor(9.0, -1.0 - 1e-3, floor);
    scene.point_light([0.0, 0.0, 4.0], 18.0);
    let lamp = scene.two_sided(BsdfDescription::Black, 10.0);
    scene.sphere([0.0, 0.0, 0.0], 0.2, lamp);
    let lit = |point: DVec3, normal: DVec3| {
        let to_light = DVec3::new(0.0, 0.0, 4.0) - point;
        0.6 / PI * 18.0 * to_light.normalize().dot(normal) / to_light.length_squared()
    };
    let on_floor = DVec3::new(0.0, -6.0, -1.001);
    for (eye, at, expected) in [
        ([0.5, -3.0, 3.0], [0.0, 0.0, 1.0], lit(DVec3::Z, DVec3::Z)),
        ([0.0, -8.0, 1.0], on_floor.into(), lit(on_floor, DVec3::Z)),
        // In the shadow of the box, and a wall of it that the lamp does not see.
        ([0.0, -8.0, 1.0], [0.0, -1.3, -1.001], 0.0),
        ([0.0, -8.0, 1.0], [0.3, -1.0, 0.2], 0.0),
    ] {
        let mut scene = scene.clone();
        scene.aim(eye, at);
        for strategy in STRATEGIES {
            for accel in STRUCTURES {
                let settings = RenderSettings {
                    accel,
                    ..path(strategy, 2)
                };
                let measured = Renderer::Wavefront.measure(&scene.build(), &settings, 40_000);
                measured.assert_is(expected);
            }
        }
    }
}
