//! Both renderers against closed forms.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use wavepath::reference::RayCounts;
use wavepath::scene::{
    BsdfDescription, Fresnel, RenderSettings, SceneDescription, Strategy, Supersampling,
};

use crate::builder::{SceneBuilder, busy_room, glass, glowing_room, lambertian, mirror};
use crate::renderer::{Renderer, STRATEGIES, endless, path, shown_by_both, whitted};
use crate::ztest::assert_same;
use wavepath::report::stability::oracles;

shown_by_both! {
    rectangle_lights_match_lamberts_formula,
    triangle_lights_match_lamberts_formula,
    a_light_that_touches_the_floor_has_bounded_errors,
    the_floor_at_the_foot_of_a_glowing_wall_has_its_closed_form,
    a_wall_in_the_plane_of_a_light_does_not_hide_it,
    sphere_lights_match_their_closed_form_also_when_the_horizon_cuts_them,
    a_sphere_light_lights_the_floor_that_it_lies_on,
    tiny_bright_spheres_keep_their_power,
    a_tiny_sphere_of_huge_radiance_lights_near_and_far,
    point_lights_add_up_and_fall_with_the_square_of_the_distance,
    one_sided_emitters_are_black_from_behind,
    an_emissive_sphere_covers_its_share_of_the_picture,
    pixels_run_right_and_down_and_are_box_filtered,
    a_furnace_is_exact_in_every_sample_at_any_size,
    a_furnace_keeps_its_mean_with_light_sampling_and_roulette,
    every_bounce_of_an_integrating_sphere_is_uniform,
    a_point_light_in_a_sphere_lights_it_evenly_from_the_first_bounce_on,
    concentric_spheres_reach_their_balance,
    an_oren_nayar_sphere_that_emits_glows_by_the_angle_of_exit,
    directional_albedos_match_their_closed_forms,
    slabs_transmit_the_sum_of_their_inner_reflections,
    lossless_glass_vanishes_in_a_uniform_room_and_magnifies_radiance_inside,
    a_light_within_glass_is_dimmed_by_reflection_and_by_the_square_of_the_index,
    glass_that_glows_adds_up_what_is_emitted_on_both_sides,
    a_boundary_between_equal_indices_is_not_there,
    a_glass_sphere_fills_in_with_the_number_of_its_surface_events,
    a_mirror_hall_shows_every_reflection_exactly,
    a_mirror_hall_shows_every_reflection_in_every_pixel,
    a_hall_of_perfect_mirrors_ends_by_roulette_or_is_counted_as_truncated,
    transparent_shadows_dim_by_both_faces_without_bending,
    transparent_shadows_do_not_count_light_through_glass_twice,
    all_strategies_make_the_same_picture,
    whitteds_picture_is_the_path_tracers_where_no_light_is_indirect,
    roulette_and_depth_do_not_shift_whitteds_picture,
    an_empty_scene_shows_its_background,
    the_mean_of_several_light_samples_is_lamberts_formula,
    glass_that_splits_shows_its_reflectance_in_every_sample,
}

/// A Lambertian floor of albedo 0.6 seen at the origin.
fn lit_floor() -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(0.6));
    scene.floor(2.0, 0.0, floor);
    scene.aim([3.0, -4.0, 2.5], [0.0; 3]);
    scene
}

/// Radiance of [`lit_floor`] under this irradiance.
fn reflected(irradiance: f64) -> f64 {
    0.6 / PI * irradiance
}

fn rectangle_lights_match_lamberts_formula(by: Renderer) {
    let overhead = [
        [-0.5, -0.5, 1.0],
        [-0.5, 0.5, 1.0],
        [0.5, 0.5, 1.0],
        [0.5, -0.5, 1.0],
    ];
    let over_a_corner = [
        [0.0, 0.0, 1.0],
        [0.0, 1.0, 1.0],
        [1.0, 1.0, 1.0],
        [1.0, 0.0, 1.0],
    ];
    let tilted = [
        [-1.0, 1.0, 0.4],
        [-0.5, 1.5, 1.5],
        [1.0, 1.5, 1.2],
        [0.5, 1.0, 0.1],
    ];
    // The lower half is below the floor.
    let cut = [
        [-1.0, 0.7, -1.0],
        [-1.0, 0.7, 1.0],
        [1.0, 0.7, 1.0],
        [1.0, 0.7, -1.0],
    ];
    for corners in [overhead, over_a_corner, tilted, cut] {
        let expected = reflected(oracles::polygon_irradiance(
            DVec3::ZERO,
            DVec3::Z,
            &corners.map(DVec3::from),
        ));
        for strategy in STRATEGIES {
            let mut scene = lit_floor();
            let light = scene.two_sided(BsdfDescription::Black, 1.0);
            scene.quad(corners, light);
            by.measure(&scene.build(), &path(strategy, 2), 20_000)
                .assert_is(expected);
        }
    }
}

fn triangle_lights_match_lamberts_formula(by: Renderer) {
    // A fan of triangles of one mesh: each is a light of its own.
    let corners = [
        [-0.8, -0.2, 0.9],
        [0.1, 1.0, 0.6],
        [0.9, 0.3, 0.7],
        [0.2, -0.7, 1.3],
    ]
    .map(DVec3::from);
    let faces = [[0, 1, 2], [0, 2, 3]];
    let expected: f64 = faces
        .iter()
        .map(|face| {
            oracles::polygon_irradiance(DVec3::ZERO, DVec3::Z, &face.map(|i| corners[i as usize]))
        })
        .sum();
    for strategy in STRATEGIES {
        let mut scene = lit_floor();
        let light = scene.two_sided(BsdfDescription::Black, 1.0);
        scene.mesh(corners.to_vec(), faces.to_vec(), light);
        by.measure(&scene.build(), &path(strategy, 2), 20_000)
            .assert_is(reflected(expected));
    }
}

fn a_light_that_touches_the_floor_has_bounded_errors(by: Renderer) {
    let mut scene = lit_floor();
    let light = scene.two_sided(BsdfDescription::Black, 1.0);
    let wall = [
        [-0.5, 0.01, 0.0],
        [-0.5, 0.01, 1.0],
        [0.5, 0.01, 1.0],
        [0.5, 0.01, 0.0],
    ];
    scene.quad(wall, light);
    let irradiance = oracles::polygon_irradiance(DVec3::ZERO, DVec3::Z, &wall.map(DVec3::from));
    for strategy in [Strategy::Mis, Strategy::Nee] {
        let measured = by.measure(&scene.build(), &path(strategy, 2), 20_000);
        measured.assert_is(reflected(irradiance));
        assert!(measured.error < 0.01 * measured.mean, "{measured:?}");
    }
}

fn the_floor_at_the_foot_of_a_glowing_wall_has_its_closed_form(by: Renderer) {
    // The floor from the wall's foot to 5 cm before it, on the middle line: half of the wall's
    // square light is nearer than any step, and its mean over that stretch is known.
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(0.6));
    let light = scene.one_sided(BsdfDescription::Black, 1.0);
    scene.floor(2.0, 0.0, floor);
    scene.quad(
        [
            [0.0, -0.5, 0.0],
            [0.0, 0.5, 0.0],
            [0.0, 0.5, 1.0],
            [0.0, -0.5, 1.0],
        ],
        light,
    );
    scene.window([1.0, 0.0, 1.5], [0.0; 3], [0.05, 0.0, 0.0], [0.0; 3]);
    for strategy in STRATEGIES {
        // The mean is given to seven digits.
        let measured = by.measure(&scene.build(), &path(strategy, 2), 20_000);
        measured.assert_is_within(reflected(1.509302), 1e-6);
        // Of light sampling by area, the error would have no bound.
        assert!(measured.error < 0.01 * measured.mean, "{measured:?}");
    }
}

fn a_wall_in_the_plane_of_a_light_does_not_hide_it(by: Renderer) {
    let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.4, 0.3, 0.8));
    let place = |x: f64, y: f64| (turn * DVec3::new(x, y, 1.3)).to_array();
    let corners = [
        place(-0.3, -0.2),
        place(-0.3, 0.5),
        place(0.4, 0.5),
        place(0.4, -0.2),
    ];
    let mut scene = lit_floor();
    let light = scene.one_sided(BsdfDescription::Black, 1.0);
    scene.quad(corners, light);
    let wall = scene.matter(BsdfDescription::Black);
    scene.quad(
        [
            place(-0.9, -0.9),
            place(-0.9, 0.9),
            place(0.9, 0.9),
            place(0.9, -0.9),
        ],
        wall,
    );
    let irradiance = oracles::polygon_irradiance(DVec3::ZERO, DVec3::Z, &corners.map(DVec3::from));
    for settings in [path(Strategy::Nee, 2), whitted(2)] {
        by.measure(&scene.build(), &settings, 20_000)
            .assert_is(reflected(irradiance));
    }
}

fn sphere_lights_match_their_closed_form_also_when_the_horizon_cuts_them(by: Renderer) {
    for (distance, radius, cos) in [
        (2.0, 1.0, 0.8f64),
        (2.0, 1.0, 0.0),
        (2.0, 1.0, -0.3),
        (1.05, 1.0, 0.3),
        (1.0, 0.1, 0.5),
    ] {
        let expected = reflected(oracles::sphere_irradiance(distance, radius, cos));
        for strategy in STRATEGIES {
            let mut scene = lit_floor();
            let light = scene.one_sided(BsdfDescription::Black, 1.0);
            let sin = (1.0 - cos * cos).sqrt();
            // On the far side of the floor's normal, where it does not hide the point from the eye.
            scene.sphere([-distance * sin, 0.0, distance * cos], radius, light);
            by.measure(&scene.build(), &path(strategy, 2), 20_000)
                .assert_is(expected);
        }
    }
}

fn a_sphere_light_lights_the_floor_that_it_lies_on(by: Renderer) {
    // So near to where it touches the floor that it fills almost all of the hemisphere.
    for x in [0.3, 0.01] {
        let mut scene = SceneBuilder::new();
        let floor = scene.matter(lambertian(0.6));
        let light = scene.one_sided(BsdfDescription::Black, 1.0);
        scene.floor(4.0, 0.0, floor);
        scene.sphere([-x, 0.0, 1.0], 1.0, light);
        // From beneath the tangent.
        scene.aim([3.0, 0.0, 3.0 * x], [0.0; 3]);
        let distance = x.hypot(1.0);
        let expected = reflected(oracles::sphere_irradiance(distance, 1.0, 1.0 / distance));
        for strategy in STRATEGIES {
            by.measure(&scene.build(), &path(strategy, 2), 20_000)
                .assert_is(expected);
        }
    }
}

fn tiny_bright_spheres_keep_their_power(by: Renderer) {
    for radius in [1e-3, 1e-6, 1e-9] {
        let mut scene = lit_floor();
        let light = scene.one_sided(BsdfDescription::Black, 1.0 / (PI * radius * radius));
        scene.sphere([0.0, 0.0, 1.0], radius, light);
        let measured = by.measure(&scene.build(), &path(Strategy::Mis, 2), 1000);
        // The irradiance is 1 at any size; beyond first order every sample is the same.
        measured.assert_is_within(reflected(1.0), 1e-6 * reflected(1.0));
        assert!(measured.error < 1e-6 * measured.mean, "{measured:?}");
    }
}

fn a_tiny_sphere_of_huge_radiance_lights_near_and_far(by: Renderer) {
    for distance in [1.0, 0.1, 0.01] {
        let mut scene = lit_floor();
        let light = scene.one_sided(BsdfDescription::Black, 1e10);
        scene.sphere([0.0, 0.6 * distance, 0.8 * distance], 1e-4, light);
        let expected = reflected(1e10 * oracles::sphere_irradiance(distance, 1e-4, 0.8));
        for strategy in [Strategy::Mis, Strategy::Nee] {
            by.measure(&scene.build(), &path(strategy, 2), 10_000)
                .assert_is(expected);
        }
    }
}

fn point_lights_add_up_and_fall_with_the_square_of_the_distance(by: Renderer) {
    let mut scene = lit_floor();
    scene.point_light([0.0, 0.0, 2.0], 3.0);
    for strategy in STRATEGIES {
        let lit = by.measure(&scene.build(), &path(strategy, 2), 10);
        lit.assert_is_exactly(reflected(3.0 / 4.0));
        assert_eq!(
            lit.counts,
            RayCounts {
                camera: 10,
                bounce: 10,
                shadow: 10,
                ..RayCounts::default()
            }
        );
        by.measure(&scene.build(), &path(strategy, 1), 10)
            .assert_is_exactly(0.0);
    }
    by.measure(&scene.build(), &whitted(2), 10)
        .assert_is_exactly(reflected(3.0 / 4.0));
    by.measure(&scene.build(), &whitted(1), 10)
        .assert_is_exactly(0.0);

    scene.point_light([0.0, 3.0, 4.0], 7.0);
    let both = reflected(3.0 / 4.0 + 7.0 * 0.8 / 25.0);
    by.measure(&scene.build(), &path(Strategy::Mis, 2), 10_000)
        .assert_is(both);
    by.measure(&scene.build(), &whitted(2), 10_000)
        .assert_is(both);

    let black = scene.matter(BsdfDescription::Black);
    scene.sphere([0.0, 0.0, 1.0], 0.1, black);
    scene.sphere([0.0, 1.5, 2.0], 0.1, black);
    by.measure(&scene.build(), &path(Strategy::Mis, 2), 100)
        .assert_is_exactly(0.0);
}

fn one_sided_emitters_are_black_from_behind(by: Renderer) {
    for two_sided in [false, true] {
        let mut scene = SceneBuilder::new();
        let black = BsdfDescription::Black;
        let light = if two_sided {
            scene.two_sided(black, 5.0)
        } else {
            scene.one_sided(black, 5.0)
        };
        scene.floor(1.0, 0.0, light);
        scene.sphere([0.0, 0.0, 5.0], 1.0, light);
        let behind = if two_sided { 5.0 } else { 0.0 };
        for (eye, at, expected) in [
            ([0.3, 0.2, 1.0], [0.1, 0.0, 0.0], 5.0),
            ([0.3, 0.2, -1.0], [0.1, 0.0, 0.0], behind),
            ([0.3, 0.2, 3.0], [0.0, 0.0, 5.0], 5.0),
            ([0.3, 0.2, 5.0], [0.0, 0.0, 9.0], behind),
        ] {
            let mut scene = scene.clone();
            scene.aim(eye, at);
            for settings in [path(Strategy::Mis, 1), whitted(1)] {
                by.measure(&scene.build(), &settings, 2)
                    .assert_is_exactly(expected);
            }
        }
    }
}

fn an_emissive_sphere_covers_its_share_of_the_picture(by: Renderer) {
    // A cone of half angle asin(r/d) about the axis cuts the image plane in a circle.
    let (radius, distance, fov_y) = (1.0, 5.0, 40f64);
    let mut scene = SceneBuilder::new();
    let light = scene.one_sided(BsdfDescription::Black, 1.0);
    scene.sphere([1.0, 2.0, 3.0], radius, light);
    let target = DVec3::new(1.0, 2.0, 3.0);
    scene.look_at(target + distance * DVec3::new(0.6, 0.0, 0.8), target, fov_y);
    let scene = scene.build();
    let circle = PI * (radius / distance).asin().tan().powi(2);
    let square = 4.0 * (fov_y.to_radians() / 2.0).tan().powi(2);
    for (size, aspect) in [([32, 32], 1.0), ([64, 32], 2.0), ([32, 48], 2.0 / 3.0)] {
        let (image, _) = by.image(&scene, &path(Strategy::Mis, 1), size, 16);
        let n = image.mean.len() as f64;
        let covered = image.mean.iter().map(|pixel| pixel[0]).sum::<f64>() / n;
        let variance: f64 = image.variance_of_mean.iter().map(|pixel| pixel[0]).sum();
        let expected = circle / square / aspect;
        assert!(
            (covered - expected).abs() < 4.0 * variance.sqrt() / n,
            "{size:?}: {covered}, not {expected}"
        );
    }
}

fn pixels_run_right_and_down_and_are_box_filtered(by: Renderer) {
    // A poster over the top row's first pixel and 40 % of its second, of three by two.
    let mut scene = SceneBuilder::new();
    let poster = scene.two_sided(BsdfDescription::Black, 1.0);
    scene.quad(
        [
            [0.0, 0.0, 2.0],
            [0.0, -1.4, 2.0],
            [0.0, -1.4, 1.0],
            [0.0, 0.0, 1.0],
        ],
        poster,
    );
    scene.window(
        [-5.0, -1.0, 1.0],
        [0.0, 0.0, 2.0],
        [0.0, -3.0, 0.0],
        [0.0, 0.0, -2.0],
    );
    let scene = scene.build();
    // Without supersampling the centre of the pixel decides, in Whitted's method unless asked for.
    let set = |supersampling, settings| RenderSettings {
        supersampling,
        ..settings
    };
    for (settings, second) in [
        (path(Strategy::Mis, 1), 0.4),
        (whitted(1), 0.0),
        (set(Supersampling::Off, path(Strategy::Mis, 1)), 0.0),
        (set(Supersampling::On, whitted(1)), 0.4),
    ] {
        let (image, _) = by.image(&scene, &settings, [3, 2], 10_000);
        for (pixel, expected) in [1.0, second, 0.0, 0.0, 0.0, 0.0].into_iter().enumerate() {
            let tolerance = 4.0 * image.variance_of_mean[pixel][0].sqrt();
            assert!(
                (image.mean[pixel][0] - expected).abs() <= tolerance,
                "pixel {pixel}"
            );
        }
    }
}

fn a_furnace_is_exact_in_every_sample_at_any_size(by: Renderer) {
    for size in [1e-6, 1e-3, 1.0, 1e3, 1e7] {
        for is_sphere in [false, true] {
            for (bsdf, albedo) in [
                (BsdfDescription::Black, 0.0),
                (lambertian(0.5), 0.5),
                (lambertian(1.0), 1.0),
                (mirror(0.9), 0.9),
            ] {
                let scene = glowing_room(bsdf, size, DVec3::ZERO, is_sphere).build();
                for bounces in [0, 1, 30] {
                    by.measure(&scene, &path(Strategy::Bsdf, bounces + 1), 500)
                        .assert_is_exactly(oracles::furnace(albedo, bounces));
                }
            }
        }
    }
}

fn a_furnace_keeps_its_mean_with_light_sampling_and_roulette(by: Renderer) {
    for is_sphere in [false, true] {
        for (albedo, samples) in [(0.5, 20_000), (0.9, 5_000)] {
            let mut scene = glowing_room(lambertian(albedo), 1.0, DVec3::ZERO, is_sphere);
            scene.background(0.0);
            for strategy in STRATEGIES {
                for roulette_depth in [0, 5] {
                    let settings = RenderSettings {
                        roulette_depth,
                        ..endless(strategy)
                    };
                    by.measure(&scene.build(), &settings, samples)
                        .assert_is(1.0 / (1.0 - albedo));
                }
            }
        }
    }
}

fn every_bounce_of_an_integrating_sphere_is_uniform(by: Renderer) {
    // A plane at height 0.6 R cuts off a cap of a fifth of the area; the quad reaches beyond it.
    let radius = 2.0;
    let mut scene = SceneBuilder::new();
    let wall = scene.matter(lambertian(0.8));
    let cap = scene.one_sided(BsdfDescription::Black, 3.0);
    scene.sphere([0.0; 3], radius, wall);
    scene.ceiling(1.9, 0.6 * radius, cap);
    scene.aim([0.1, 0.2, 0.3], [0.5, 1.0, -1.0]);
    for bounces in [1, 2, 4] {
        let expected: f64 = (1..=bounces)
            .map(|k| 3.0 * oracles::integrating_sphere_bounce(0.2, 0.8, k))
            .sum();
        for strategy in STRATEGIES {
            by.measure(&scene.build(), &path(strategy, bounces + 1), 20_000)
                .assert_is(expected);
        }
    }
}

fn a_point_light_in_a_sphere_lights_it_evenly_from_the_first_bounce_on(by: Renderer) {
    let mut scene = SceneBuilder::new();
    let wall = scene.matter(lambertian(0.7));
    scene.sphere([0.0; 3], 2.0, wall);
    scene.point_light([0.9, 0.0, 0.5], 1.0);
    let at = DVec3::new(0.48, 0.64, -0.6) * 2.0;
    scene.aim([0.0; 3], at.into());
    let to_light = DVec3::new(0.9, 0.0, 0.5) - at;
    let direct = to_light.normalize().dot(-at / 2.0) / to_light.length_squared();
    for bounces in [1, 2, 4] {
        let indirect: f64 = (1..bounces)
            .map(|k| oracles::point_in_sphere_bounce(2.0, 0.7, k))
            .sum();
        by.measure(&scene.build(), &path(Strategy::Mis, bounces + 1), 20_000)
            .assert_is(0.7 / PI * (direct + indirect));
    }
}

fn concentric_spheres_reach_their_balance(by: Renderer) {
    let mut scene = SceneBuilder::new();
    let wall = scene.matter(lambertian(0.7));
    let light = scene.one_sided(BsdfDescription::Black, 1.0);
    scene.sphere([0.0; 3], 1.0, wall);
    scene.sphere([0.0; 3], 0.5, light);
    scene.aim([0.0, 0.0, 0.7], [0.3, 0.0, 0.9]);
    let expected = 0.7 / PI * oracles::concentric_spheres_irradiance(0.5, 1.0, 0.7);
    for strategy in STRATEGIES {
        let settings = RenderSettings {
            roulette_depth: 3,
            ..endless(strategy)
        };
        by.measure(&scene.build(), &settings, 20_000)
            .assert_is(expected);
    }
}

fn an_oren_nayar_sphere_that_emits_glows_by_the_angle_of_exit(by: Renderer) {
    // The inside of a sphere that emits 1. Both ends of a chord meet it at the same angle, so
    // radiance depends on that angle alone; an integral equation over it gives these.
    for (reflectance, sigma, degrees, bounces, expected) in [
        (0.5, 0.3, 5.0, None, 1.84734),
        (0.5, 0.3, 80.0, None, 1.937473),
        (0.8, 0.3, 60.0, Some(2), 2.346646),
        (0.8, 0.7, 30.0, None, 2.605587),
        (0.8, 0.7, 60.0, Some(2), 2.061284),
        (0.8, f64::INFINITY, 60.0, None, 1.977966),
        (1.0, f64::INFINITY, 60.0, Some(2), 2.015958),
        (1.0, f64::INFINITY, 80.0, None, 2.760219),
    ] {
        let mut scene = SceneBuilder::new();
        let wall = scene.two_sided(
            BsdfDescription::OrenNayar {
                reflectance: DVec3::splat(reflectance),
                sigma,
            },
            1.0,
        );
        scene.sphere([0.0; 3], 1.0, wall);
        // Along a chord that meets the sphere at this angle to the normal.
        let (sin, cos) = f64::to_radians(degrees).sin_cos();
        scene.aim([0.0, sin, -0.5 * cos], [0.0, sin, 0.5 * cos]);
        for strategy in [Strategy::Mis, Strategy::Bsdf] {
            let settings = RenderSettings {
                max_depth: bounces.map(|bounces: u32| bounces + 1),
                roulette_depth: 8,
                ..endless(strategy)
            };
            // The table has six digits.
            by.measure(&scene.build(), &settings, 10_000)
                .assert_is_within(expected, 1e-6);
        }
    }
}

/// A floor under a uniform sky of radiance 1, seen at this angle to its normal.
fn under_the_sky(bsdf: BsdfDescription, degrees: f64) -> SceneDescription {
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(bsdf);
    scene.floor(1.0, 0.0, floor);
    let (sin, cos) = degrees.to_radians().sin_cos();
    scene.aim([0.6 * sin, 0.8 * sin, cos], [0.0; 3]);
    scene.background(1.0);
    scene.build()
}

fn directional_albedos_match_their_closed_forms(by: Renderer) {
    for sigma in [0.0, 0.3, 0.5, 0.7, f64::INFINITY] {
        for degrees in [0.0, 45.0, 85.0] {
            let bsdf = BsdfDescription::OrenNayar {
                reflectance: DVec3::splat(0.5),
                sigma,
            };
            let expected = 0.5 * oracles::oren_nayar_albedo(sigma, f64::to_radians(degrees));
            for strategy in STRATEGIES {
                let scene = under_the_sky(bsdf, degrees);
                by.measure(&scene, &path(strategy, 2), 4000)
                    .assert_is(expected);
            }
        }
    }
    // Phong's lobe has a closed form at normal incidence and at grazing angle alone; the rest is
    // by quadrature.
    for (exponent, degrees, expected) in [
        (1.0, 30.0, 0.880843),
        (5.0, 75.0, 0.327132),
        (10.0, 60.0, 0.504736),
        (50.0, 75.0, 0.260465),
    ] {
        let bsdf = BsdfDescription::Phong {
            reflectance: DVec3::splat(0.5),
            exponent,
        };
        for strategy in STRATEGIES {
            let scene = under_the_sky(bsdf, degrees);
            by.measure(&scene, &path(strategy, 2), 10_000)
                .assert_is_within(0.5 * expected, 5e-7);
        }
    }
}

/// A plate of glass, this thick, between z = 0 and an eye that looks at it at this angle, over a
/// wall that emits 1.
fn slab(bsdf: BsdfDescription, thickness: f64, degrees: f64) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let plate = scene.matter(bsdf);
    scene.ceiling(20.0, 0.0, plate);
    scene.floor(20.0, thickness, plate);
    let wall = scene.two_sided(BsdfDescription::Black, 1.0);
    scene.floor(200.0, -1.0, wall);
    let (sin, cos) = degrees.to_radians().sin_cos();
    scene.aim([sin, 0.0, cos + thickness], [0.0, 0.0, thickness]);
    scene
}

fn slabs_transmit_the_sum_of_their_inner_reflections(by: Renderer) {
    for degrees in [0.0, 45.0, 60.0, 80.0] {
        for ior in [1.5, 1.75] {
            let face = oracles::fresnel(ior, f64::to_radians(degrees).cos());
            let expected = oracles::slab_transmittance(face);
            let scene = slab(glass(ior), 0.1, degrees).build();
            by.measure(&scene, &endless(Strategy::Mis), 4000)
                .assert_is(expected);
            let both_branches = by.measure(&scene, &whitted(100), 4000);
            both_branches.assert_is(expected);
            assert!(both_branches.error < 2e-3, "{both_branches:?}");
        }
    }
    // Thin plates are seen as plates.
    for thickness in by.resolved(&[1e-3, 1e-5, 1e-9]) {
        let expected = oracles::slab_transmittance(oracles::fresnel(1.5, 0.5));
        let scene = slab(glass(1.5), thickness, 60.0).build();
        by.measure(&scene, &endless(Strategy::Mis), 4000)
            .assert_is(expected);
    }
    // Schlick's reflectance at 60° for n = 1.5 is 0.04 + 0.96/32 = 0.07.
    let schlick = BsdfDescription::Dielectric {
        ior: 1.5,
        fresnel: Fresnel::Schlick,
    };
    by.measure(
        &slab(schlick, 0.1, 60.0).build(),
        &endless(Strategy::Mis),
        4000,
    )
    .assert_is(oracles::slab_transmittance(0.07));
}

fn lossless_glass_vanishes_in_a_uniform_room_and_magnifies_radiance_inside(by: Renderer) {
    for ior in [1.5, 1.0, 0.7] {
        let mut scene = SceneBuilder::new();
        let ball = scene.matter(glass(ior));
        scene.sphere([0.0; 3], 1.0, ball);
        scene.skew_cube(1.0, DVec3::new(1.0, 1.0, 0.0), ball);
        scene.background(2.0);
        let mut outside = scene.clone();
        outside.window(
            [0.0, 0.0, 5.0],
            [-2.0, 2.0, 0.0],
            [4.0, 0.0, 0.0],
            [0.0, -4.0, 0.0],
        );
        // Light can circle in the cube for ever by total reflection; roulette ends that.
        let settings = RenderSettings {
            roulette_depth: 40,
            ..endless(Strategy::Mis)
        };
        by.measure(&outside.build(), &settings, 4000).assert_is(2.0);
        // From its centre every ray meets the sphere at a right angle and leaves at last.
        scene.window(
            [0.0; 3],
            [-1.0, 1.0, 1.0],
            [2.0, 0.0, 0.0],
            [0.0, -2.0, 0.0],
        );
        by.measure(&scene.build(), &settings, 4000)
            .assert_is(2.0 * ior * ior);
    }
}

fn a_light_within_glass_is_dimmed_by_reflection_and_by_the_square_of_the_index(by: Renderer) {
    // Looking at the common middle of a ball of glass and a black lamp in it. What the boundary
    // reflects back falls onto the lamp again and is absorbed.
    for ior in [1.5, 0.8] {
        let mut scene = SceneBuilder::new();
        let clear = scene.matter(glass(ior));
        let lamp = scene.one_sided(BsdfDescription::Black, 3.0);
        scene.sphere([0.0; 3], 1.0, clear);
        scene.sphere([0.0; 3], 0.4, lamp);
        scene.aim([4.0, 0.0, 0.0], [0.0; 3]);
        let expected = 3.0 * (1.0 - oracles::fresnel(ior, 1.0)) / (ior * ior);
        for strategy in STRATEGIES {
            by.measure(&scene.build(), &endless(strategy), 4000)
                .assert_is(expected);
        }
        by.measure(&scene.build(), &whitted(9), 4000)
            .assert_is_exactly(expected);
    }
}

fn glass_that_glows_adds_up_what_is_emitted_on_both_sides(by: Renderer) {
    // A ray through the middle of a ball sees 1 from its outside and Σ R^k = 1/(1 − R) from within,
    // of which (1 − R)/n² gets out.
    for ior in [1.5, 0.8] {
        let mut scene = SceneBuilder::new();
        let glowing = scene.two_sided(glass(ior), 1.0);
        scene.sphere([0.0; 3], 1.0, glowing);
        scene.aim([4.0, 0.0, 0.0], [0.0; 3]);
        for strategy in STRATEGIES {
            by.measure(&scene.build(), &endless(strategy), 4000)
                .assert_is(1.0 + 1.0 / (ior * ior));
        }
    }
}

fn a_boundary_between_equal_indices_is_not_there(by: Renderer) {
    // A cube in a ball before a striped wall, as glass in glass of the same index would be: nothing
    // is reflected, so nothing is random, and nothing is bent, so every pixel stays as it is.
    let mut scene = SceneBuilder::new();
    for stripe in 0..8 {
        let light = scene.two_sided(BsdfDescription::Black, f64::from(1 << stripe));
        let (left, right) = (f64::from(stripe - 4), f64::from(stripe - 3));
        let corners = [[left, -4.0], [right, -4.0], [right, 4.0], [left, 4.0]];
        scene.quad(corners.map(|[x, y]| [x, y, -1.0]), light);
    }
    scene.window(
        [0.1, 0.2, 4.0],
        [-2.0, 2.0, 0.0],
        [4.0, 0.0, 0.0],
        [0.0, -4.0, 0.0],
    );
    let mut filled = scene.clone();
    let nothing = filled.matter(glass(1.0));
    filled.sphere([0.0, 0.0, 1.0], 1.2, nothing);
    filled.skew_cube(0.5, DVec3::new(0.1, 0.0, 0.6), nothing);
    for settings in [path(Strategy::Mis, 5), whitted(5)] {
        let [with, without] =
            [&filled, &scene].map(|scene| by.image(&scene.build(), &settings, [16; 2], 4).0.mean);
        assert!(with.iter().any(|pixel| pixel[0] != with[0][0]));
        for (a, b) in with.iter().zip(&without) {
            assert!((a[0] - b[0]).abs() <= by.rounding() * b[0], "{a:?}, {b:?}");
        }
    }
}

fn a_glass_sphere_fills_in_with_the_number_of_its_surface_events(by: Renderer) {
    // Mean over the disc of the share that has left after so many events, n = 1.5.
    let table = [(1, 0.091778), (2, 0.927322), (3, 0.988506), (5, 0.998467)];
    for size in [1e-6, 1.0, 1e6] {
        let mut scene = SceneBuilder::new();
        let ball = scene.matter(glass(1.5));
        scene.sphere([0.0; 3], size, ball);
        scene.background(1.0);
        // So far away that the rays are as good as parallel, to a share of 1e-6 of the disc; the
        // window holds the disc and its corners.
        scene.window(
            [0.0, 0.0, 1e3 * size],
            [-size, size, 0.0],
            [2.0 * size, 0.0, 0.0],
            [0.0, -2.0 * size, 0.0],
        );
        for (events, disc) in table {
            let expected = 1.0 + (disc - 1.0) * PI / 4.0;
            let measured = by.measure(&scene.build(), &path(Strategy::Mis, events + 1), 20_000);
            measured.assert_is_within(expected, 1e-6);
            let missing = measured.counts.truncated as f64 / 20_000.0;
            assert!((expected + missing - 1.0).abs() < 0.02, "{measured:?}");
        }
    }
}

/// Mirrors of reflectance 0.9 at z = 0 and z = 1, and an end wall at x = 9 that emits 1.
fn mirror_hall() -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let wall = scene.matter(mirror(0.9));
    let light = scene.two_sided(BsdfDescription::Black, 1.0);
    scene.floor(50.0, 0.0, wall);
    scene.ceiling(50.0, 1.0, wall);
    scene.quad(
        [
            [9.0, -9.0, 0.0],
            [9.0, 9.0, 0.0],
            [9.0, 9.0, 1.0],
            [9.0, -9.0, 1.0],
        ],
        light,
    );
    scene
}

fn a_mirror_hall_shows_every_reflection_in_every_pixel(by: Renderer) {
    let mut scene = mirror_hall();
    let (width, height) = (8, 400);
    let eye = [0.0, 0.0, 0.3];
    scene.window(eye, [1.0, 0.25, 1.8], [0.0, -0.5, 0.0], [0.0, 0.0, -3.0]);
    let (image, _) = by.image(&scene.build(), &whitted(100), [width, height], 2);
    let mut bands = 0;
    for (pixel, mean) in image.mean.iter().enumerate() {
        let row = (pixel as u32 / width) as f64 + 0.5;
        let slope = 1.5 - 3.0 * row / f64::from(height);
        // Where the ray would meet the plane of the end wall if it went straight on.
        let height_at_wall = 0.3 + 9.0 * slope;
        if (height_at_wall - height_at_wall.round()).abs() < 1e-4 {
            continue;
        }
        let bounces = oracles::mirror_hall_bounces(0.3, slope, 9.0, 1.0);
        let expected = 0.9f64.powi(bounces);
        assert!(
            (mean[0] - expected).abs() <= by.rounding() * expected,
            "row {row}: {mean:?} after {bounces} bounces"
        );
        bands = bands.max(bounces);
    }
    assert_eq!(bands, 14);
}

fn a_mirror_hall_shows_every_reflection_exactly(by: Renderer) {
    let scene = mirror_hall();
    for step in 0..60 {
        let slope = f64::from(step - 30) * 0.0337;
        let bounces = oracles::mirror_hall_bounces(0.3, slope, 9.0, 1.0);
        let mut scene = scene.clone();
        scene.aim([0.0, 0.0, 0.3], [1.0, 0.1, 0.3 + slope]);
        let scene = scene.build();
        for settings in [
            path(Strategy::Mis, 100),
            path(Strategy::Nee, 100),
            whitted(100),
        ] {
            by.measure(&scene, &settings, 2)
                .assert_is_exactly(0.9f64.powi(bounces));
        }
    }
}

fn a_hall_of_perfect_mirrors_ends_by_roulette_or_is_counted_as_truncated(by: Renderer) {
    let mut scene = SceneBuilder::new();
    let wall = scene.matter(mirror(1.0));
    scene.sphere([0.0; 3], 1.0, wall);
    scene.aim([0.1, 0.2, 0.3], [0.4, 0.4, 0.9]);
    for settings in [path(Strategy::Mis, 50), whitted(50)] {
        let dark = by.measure(&scene.build(), &settings, 20);
        dark.assert_is_exactly(0.0);
        let counts = RayCounts {
            camera: 20,
            bounce: 20 * 49,
            truncated: 20,
            ..RayCounts::default()
        };
        assert_eq!(dark.counts, counts);
        let unlimited = RenderSettings {
            max_depth: None,
            roulette_depth: 5,
            ..settings
        };
        let ended = by.measure(&scene.build(), &unlimited, 500);
        assert_eq!(ended.counts.truncated, 0);
        // Survival 0.99 from depth 5 on: 4 + 99 bounces in the mean, standard deviation 100/√500.
        let mean_bounces = ended.counts.bounce as f64 / 500.0;
        assert!(
            (mean_bounces - 103.0).abs() < 4.0 * 100.0 / 500f64.sqrt(),
            "{mean_bounces}"
        );
    }
}

fn transparent_shadows_dim_by_both_faces_without_bending(by: Renderer) {
    let mut scene = lit_floor();
    let plate = scene.matter(glass(1.5));
    scene.ceiling(20.0, 3.0, plate);
    scene.floor(20.0, 3.1, plate);
    scene.point_light([2.0, 0.0, 5.0], 10.0);
    let cos = 5.0 / 29f64.sqrt();
    let pass = (1.0 - oracles::fresnel(1.5, cos)) * (1.0 - oracles::fresnel(1.0 / 1.5, cos));
    for settings in [path(Strategy::Mis, 2), path(Strategy::Nee, 2), whitted(2)] {
        by.measure(&scene.build(), &settings, 4)
            .assert_is_exactly(0.0);
        let transparent = RenderSettings {
            transparent_shadows: true,
            ..settings
        };
        by.measure(&scene.build(), &transparent, 4)
            .assert_is_exactly(reflected(10.0 * cos / 29.0 * pass));
    }
}

fn transparent_shadows_do_not_count_light_through_glass_twice(by: Renderer) {
    // A patch of floor under a plate without end, sky all around. By shadow rays arrives what both
    // faces let through unbent; by direction sampling all that is reflected somewhere on its way.
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(1.0));
    scene.floor(1e-4, 0.0, floor);
    let plate = scene.matter(glass(1.5));
    scene.ceiling(1e5, 0.01, plate);
    scene.floor(1e5, 0.011, plate);
    scene.background(1.0);
    scene.aim([0.003, 0.0, 0.002], [0.0; 3]);
    let quadrature = |share: fn(f64, f64) -> f64| -> f64 {
        let steps = 20_000;
        (0..steps)
            .map(|i| {
                let theta = FRAC_PI_2 * (f64::from(i) + 0.5) / f64::from(steps);
                let (sin, cos) = theta.sin_cos();
                let from_outside = oracles::fresnel(1.5, cos);
                let from_inside = oracles::fresnel(1.0 / 1.5, cos);
                2.0 * sin * cos * share(from_outside, from_inside)
            })
            .sum::<f64>()
            * FRAC_PI_2
            / f64::from(steps)
    };
    let straight = quadrature(|outside, inside| (1.0 - outside) * (1.0 - inside));
    let reflected = quadrature(|outside, _| 1.0 - (1.0 - outside).powi(2));
    for (settings, expected) in [
        (endless(Strategy::Mis), straight + reflected),
        (endless(Strategy::Nee), straight + reflected),
        // Nothing but point lights is sampled, so nothing can be counted twice.
        (endless(Strategy::Bsdf), 1.0),
        (whitted(100), straight),
    ] {
        let settings = RenderSettings {
            transparent_shadows: true,
            ..settings
        };
        // The quadrature is good to 1e-6 at the edge of total reflection.
        by.measure(&scene.build(), &settings, 40_000)
            .assert_is_within(expected, 1e-5);
    }
}

fn all_strategies_make_the_same_picture(by: Renderer) {
    let scene = busy_room().build();
    let [mis, nee, bsdf] = STRATEGIES.map(|strategy| {
        let settings = RenderSettings {
            strategy,
            seed: strategy as u64,
            ..RenderSettings::default()
        };
        by.image(&scene, &settings, [16; 2], 200).0
    });
    assert_same(&mis, &nee);
    assert_same(&mis, &bsdf);
}

fn whitteds_picture_is_the_path_tracers_where_no_light_is_indirect(by: Renderer) {
    // Mirrors, glass and emitters alone; then a floor with nothing to bounce to but its lamps.
    let mut specular = SceneBuilder::new();
    let silver = specular.matter(mirror(0.8));
    let clear = specular.matter(glass(1.5));
    let lamp = specular.one_sided(BsdfDescription::Black, 3.0);
    specular.floor(3.0, 0.0, silver);
    specular.ceiling(1.0, 2.0, lamp);
    specular.sphere([0.6, 0.0, 0.6], 0.5, silver);
    specular.sphere([-0.6, 0.0, 0.6], 0.5, clear);
    specular.background(0.5);
    let mut lit = SceneBuilder::new();
    let floor = lit.matter(lambertian(0.6));
    let lamp = lit.one_sided(BsdfDescription::Black, 3.0);
    let black = lit.matter(BsdfDescription::Black);
    lit.floor(3.0, 0.0, floor);
    lit.ceiling(1.0, 2.0, lamp);
    lit.sphere([0.2, 0.1, 0.9], 0.4, black);
    lit.point_light([0.0, 2.0, 2.0], 4.0);
    // Whitted's rays go through pixel centres, so the paths have to look at one point as well.
    for scene in [specular, lit] {
        for at in [
            [0.1, 0.3, 0.0],
            [0.6, -0.2, 0.8],
            [-0.5, -0.4, 0.7],
            [-0.7, 0.3, 0.2],
            [0.0, 0.0, 2.0],
        ] {
            let mut scene = scene.clone();
            scene.aim([0.0, -4.0, 1.5], at);
            let scene = scene.build();
            for depth in [2, 3, 7] {
                let direct = by.measure(&scene, &whitted(depth), 10_000);
                let paths = by.measure(&scene, &path(Strategy::Mis, depth), 10_000);
                let error = direct.error.hypot(paths.error);
                assert!(
                    (direct.mean - paths.mean).abs() <= 4.0 * error + by.rounding(),
                    "{direct:?}, {paths:?}"
                );
            }
        }
    }
}

fn roulette_and_depth_do_not_shift_whitteds_picture(by: Renderer) {
    let scene = busy_room().build();
    let settings = RenderSettings {
        roulette_depth: 1,
        seed: 9,
        ..whitted(60)
    };
    assert_same(
        &by.image(&scene, &whitted(60), [16; 2], 200).0,
        &by.image(&scene, &settings, [16; 2], 200).0,
    );
}

fn an_empty_scene_shows_its_background(by: Renderer) {
    let mut scene = SceneBuilder::new();
    scene.background(0.25);
    scene.aim([0.0; 3], [0.0, 0.0, 1.0]);
    by.measure(&scene.build(), &endless(Strategy::Mis), 2)
        .assert_is_exactly(0.25);
    by.measure(&scene.build(), &whitted(5), 2)
        .assert_is_exactly(0.25);
}

fn the_mean_of_several_light_samples_is_lamberts_formula(by: Renderer) {
    let corners = [
        [-1.0, 1.0, 0.4],
        [-0.5, 1.5, 1.5],
        [1.0, 1.5, 1.2],
        [0.5, 1.0, 0.1],
    ];
    let expected = reflected(oracles::polygon_irradiance(
        DVec3::ZERO,
        DVec3::Z,
        &corners.map(DVec3::from),
    ));
    let mut scene = lit_floor();
    let light = scene.two_sided(BsdfDescription::Black, 1.0);
    scene.quad(corners, light);
    for strategy in STRATEGIES {
        for light_samples in [2, 7] {
            let settings = RenderSettings {
                light_samples,
                ..path(strategy, 2)
            };
            by.measure(&scene.build(), &settings, 10_000)
                .assert_is(expected);
        }
    }
}

fn glass_that_splits_shows_its_reflectance_in_every_sample(by: Renderer) {
    // Glass without end over black ground, under a sky of 1: one branch sees the sky, the other nothing.
    let mut scene = SceneBuilder::new();
    let clear = scene.matter(glass(1.5));
    scene.floor(100.0, 0.0, clear);
    let ground = scene.matter(BsdfDescription::Black);
    scene.floor(100.0, -0.1, ground);
    scene.background(1.0);
    for x in [0.1, 1.0, 3.0] {
        scene.aim([x, 0.0, 1.0], [0.0; 3]);
        let expected = oracles::fresnel(1.5, 1.0 / f64::hypot(x, 1.0));
        for glass_splits in [1, 8] {
            let settings = RenderSettings {
                glass_splits,
                ..path(Strategy::Bsdf, 5)
            };
            let mut of_this_camera = scene.build();
            of_this_camera.cameras.reverse();
            by.measure(&of_this_camera, &settings, 2000)
                .assert_is_exactly(expected);
        }
    }
}
