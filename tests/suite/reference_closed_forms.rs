//! The reference renderer against closed forms.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use wavepath::reference::{RayCounts, Reference};
use wavepath::scene::{
    BsdfDescription, Fresnel, IntegratorKind, MaterialId, RenderSettings, SceneDescription,
    Strategy,
};

use crate::builder::{SceneBuilder, glass, lambertian, mirror};
use crate::oracles;
use crate::ztest::{ImageEstimate, assert_same};

const STRATEGIES: [Strategy; 3] = [Strategy::Mis, Strategy::Nee, Strategy::Bsdf];

/// Path tracing to this many segments, without roulette.
fn path(strategy: Strategy, max_depth: u32) -> RenderSettings {
    RenderSettings {
        max_depth: Some(max_depth),
        ..endless(strategy)
    }
}

/// Path tracing to any depth, without roulette: for scenes that paths leave.
fn endless(strategy: Strategy) -> RenderSettings {
    RenderSettings {
        strategy,
        roulette_depth: u32::MAX,
        seed: 1,
        ..RenderSettings::default()
    }
}

/// Whitted's method to this many segments, without roulette.
fn whitted(max_depth: u32) -> RenderSettings {
    RenderSettings {
        integrator: IntegratorKind::Whitted,
        ..path(Strategy::Mis, max_depth)
    }
}

/// Mean of a one-pixel picture and its standard error.
#[derive(Debug, Clone, Copy)]
struct Measured {
    mean: f64,
    error: f64,
    counts: RayCounts,
}

fn measure(scene: &SceneDescription, settings: &RenderSettings, samples: u64) -> Measured {
    let reference = Reference::new(scene, 0, 1, 1, settings).expect("the scene is sound");
    let mut counts = RayCounts::default();
    let pixel = ImageEstimate::from_samples([1, 1], samples, |_, _, sample| {
        reference.sample(0, 0, sample, &mut counts).to_array()
    });
    Measured {
        mean: pixel.mean[0][0],
        error: pixel.variance_of_mean[0][0].sqrt(),
        counts,
    }
}

impl Measured {
    /// Within four standard errors, or rounding where there is no noise.
    #[track_caller]
    fn assert_is(self, expected: f64) {
        let tolerance = 4.0 * self.error + 1e-12 * expected.abs();
        assert!(
            (self.mean - expected).abs() <= tolerance,
            "{self:?} is not {expected}"
        );
    }

    /// The same in every sample, but for rounding.
    #[track_caller]
    fn assert_is_exactly(self, expected: f64) {
        assert!(self.error <= 1e-12 * expected, "{self:?} has noise");
        self.assert_is(expected);
    }
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

#[test]
fn rectangle_lights_match_lamberts_formula() {
    let overhead = [
        [-0.5, -0.5, 1.0],
        [-0.5, 0.5, 1.0],
        [0.5, 0.5, 1.0],
        [0.5, -0.5, 1.0],
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
    for corners in [overhead, tilted, cut] {
        let expected = reflected(oracles::polygon_irradiance(
            DVec3::ZERO,
            DVec3::Z,
            &corners.map(DVec3::from),
        ));
        for strategy in STRATEGIES {
            let mut scene = lit_floor();
            let light = scene.two_sided(BsdfDescription::Black, 1.0);
            scene.quad(corners, light);
            measure(&scene.build(), &path(strategy, 2), 20_000).assert_is(expected);
        }
    }
}

#[test]
fn a_light_that_touches_the_floor_is_bounded_by_mis() {
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
    let measured = measure(&scene.build(), &path(Strategy::Mis, 2), 20_000);
    measured.assert_is(reflected(irradiance));
    assert!(measured.error < 0.01 * measured.mean, "{measured:?}");
}

#[test]
fn a_wall_in_the_plane_of_a_light_does_not_hide_it() {
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
        measure(&scene.build(), &settings, 20_000).assert_is(reflected(irradiance));
    }
}

#[test]
fn sphere_lights_match_their_closed_form_also_when_the_horizon_cuts_them() {
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
            measure(&scene.build(), &path(strategy, 2), 20_000).assert_is(expected);
        }
    }
}

#[test]
fn tiny_bright_spheres_keep_their_power() {
    for radius in [1e-3, 1e-6, 1e-9] {
        let mut scene = lit_floor();
        let light = scene.one_sided(BsdfDescription::Black, 1.0 / (PI * radius * radius));
        scene.sphere([0.0, 0.0, 1.0], radius, light);
        let measured = measure(&scene.build(), &path(Strategy::Mis, 2), 1000);
        // The irradiance is 1 at any size; beyond first order every sample is the same.
        assert!(
            (measured.mean / reflected(1.0) - 1.0).abs() < 1e-6,
            "{measured:?} at {radius}"
        );
    }
}

#[test]
fn point_lights_add_up_and_fall_with_the_square_of_the_distance() {
    let mut scene = lit_floor();
    scene.point_light([0.0, 0.0, 2.0], 3.0);
    for strategy in STRATEGIES {
        let lit = measure(&scene.build(), &path(strategy, 2), 10);
        lit.assert_is_exactly(reflected(3.0 / 4.0));
        assert_eq!(
            lit.counts,
            RayCounts {
                camera: 10,
                bounce: 10,
                shadow: 10,
                truncated: 0
            }
        );
        measure(&scene.build(), &path(strategy, 1), 10).assert_is_exactly(0.0);
    }
    measure(&scene.build(), &whitted(2), 10).assert_is_exactly(reflected(3.0 / 4.0));
    measure(&scene.build(), &whitted(1), 10).assert_is_exactly(0.0);

    scene.point_light([0.0, 3.0, 4.0], 7.0);
    let both = reflected(3.0 / 4.0 + 7.0 * 0.8 / 25.0);
    measure(&scene.build(), &path(Strategy::Mis, 2), 10_000).assert_is(both);
    measure(&scene.build(), &whitted(2), 10_000).assert_is(both);

    let black = scene.matter(BsdfDescription::Black);
    scene.sphere([0.0, 0.0, 1.0], 0.1, black);
    scene.sphere([0.0, 1.5, 2.0], 0.1, black);
    measure(&scene.build(), &path(Strategy::Mis, 2), 100).assert_is_exactly(0.0);
}

#[test]
fn one_sided_emitters_are_black_from_behind() {
    for (two_sided, from_above, expected) in [
        (false, true, 5.0),
        (false, false, 0.0),
        (true, true, 5.0),
        (true, false, 5.0),
    ] {
        let mut scene = SceneBuilder::new();
        let black = BsdfDescription::Black;
        let light = if two_sided {
            scene.two_sided(black, 5.0)
        } else {
            scene.one_sided(black, 5.0)
        };
        scene.floor(1.0, 0.0, light);
        scene.aim(
            [0.3, 0.2, if from_above { 1.0 } else { -1.0 }],
            [0.1, 0.0, 0.0],
        );
        measure(&scene.build(), &path(Strategy::Mis, 1), 2).assert_is_exactly(expected);
        measure(&scene.build(), &whitted(1), 2).assert_is_exactly(expected);
    }
}

#[test]
fn pixels_run_right_and_down_and_are_box_filtered() {
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
    for (settings, second) in [(path(Strategy::Mis, 1), 0.4), (whitted(1), 0.0)] {
        let reference = Reference::new(&scene, 0, 3, 2, &settings).expect("the scene is sound");
        let image = ImageEstimate::from_samples([3, 2], 10_000, |x, y, sample| {
            let mut counts = RayCounts::default();
            reference
                .sample(x as u32, y as u32, sample, &mut counts)
                .to_array()
        });
        for (pixel, expected) in [1.0, second, 0.0, 0.0, 0.0, 0.0].into_iter().enumerate() {
            let tolerance = 4.0 * image.variance_of_mean[pixel][0].sqrt();
            assert!(
                (image.mean[pixel][0] - expected).abs() <= tolerance,
                "pixel {pixel}"
            );
        }
    }
}

/// A closed room that emits 1 everywhere, or a sphere, seen from within.
fn furnace(bsdf: BsdfDescription, size: f64, is_sphere: bool) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let wall = scene.two_sided(bsdf, 1.0);
    if is_sphere {
        scene.sphere([0.0; 3], size, wall);
    } else {
        scene.skew_cube(size, DVec3::ZERO, wall);
    }
    let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.3, 1.1, -0.7));
    let eye = if is_sphere {
        DVec3::splat(0.2)
    } else {
        turn * DVec3::splat(0.4)
    } * size;
    let at = eye + DVec3::new(0.3, -0.5, 0.7) * size;
    scene.window(eye.into(), at.into(), [size, 0.0, 0.0], [0.0, -size, 0.0]);
    // A ray that leaks would find this.
    scene.background(1e9);
    scene
}

#[test]
fn a_furnace_is_exact_in_every_sample_at_any_size() {
    for size in [1e-6, 1.0, 1e7] {
        for is_sphere in [false, true] {
            for (bsdf, albedo) in [
                (BsdfDescription::Black, 0.0),
                (lambertian(0.5), 0.5),
                (lambertian(1.0), 1.0),
                (mirror(0.9), 0.9),
            ] {
                let scene = furnace(bsdf, size, is_sphere).build();
                for bounces in [0, 1, 30] {
                    measure(&scene, &path(Strategy::Bsdf, bounces + 1), 500)
                        .assert_is_exactly(oracles::furnace(albedo, bounces));
                }
            }
        }
    }
}

#[test]
fn a_furnace_keeps_its_mean_with_light_sampling_and_roulette() {
    for is_sphere in [false, true] {
        for (albedo, samples) in [(0.5, 20_000), (0.9, 5_000)] {
            let mut scene = furnace(lambertian(albedo), 1.0, is_sphere);
            scene.background(0.0);
            for strategy in STRATEGIES {
                for roulette_depth in [0, 5] {
                    let settings = RenderSettings {
                        roulette_depth,
                        ..endless(strategy)
                    };
                    measure(&scene.build(), &settings, samples).assert_is(1.0 / (1.0 - albedo));
                }
            }
        }
    }
}

#[test]
fn every_bounce_of_an_integrating_sphere_is_uniform() {
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
            measure(&scene.build(), &path(strategy, bounces + 1), 20_000).assert_is(expected);
        }
    }
}

#[test]
fn a_point_light_in_a_sphere_lights_it_evenly_from_the_first_bounce_on() {
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
        measure(&scene.build(), &path(Strategy::Mis, bounces + 1), 20_000)
            .assert_is(0.7 / PI * (direct + indirect));
    }
}

#[test]
fn concentric_spheres_reach_their_balance() {
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
        measure(&scene.build(), &settings, 20_000).assert_is(expected);
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

#[test]
fn directional_albedos_match_their_closed_forms() {
    for sigma in [0.0, 0.3, 0.5, 0.7, f64::INFINITY] {
        for degrees in [0.0, 45.0, 85.0] {
            let bsdf = BsdfDescription::OrenNayar {
                reflectance: DVec3::splat(0.5),
                sigma,
            };
            let expected = 0.5 * oracles::oren_nayar_albedo(sigma, f64::to_radians(degrees));
            for strategy in STRATEGIES {
                let scene = under_the_sky(bsdf, degrees);
                measure(&scene, &path(strategy, 2), 4000).assert_is(expected);
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
            let measured = measure(&scene, &path(strategy, 2), 10_000);
            let tolerance = 4.0 * measured.error + 5e-7;
            assert!(
                (measured.mean - 0.5 * expected).abs() < tolerance,
                "{measured:?}, n {exponent}"
            );
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

#[test]
fn slabs_transmit_the_sum_of_their_inner_reflections() {
    for degrees in [0.0, 45.0, 60.0, 80.0] {
        for ior in [1.5, 1.75] {
            let face = oracles::fresnel(ior, f64::to_radians(degrees).cos());
            let expected = oracles::slab_transmittance(face);
            let scene = slab(glass(ior), 0.1, degrees).build();
            measure(&scene, &endless(Strategy::Mis), 4000).assert_is(expected);
            let both_branches = measure(&scene, &whitted(100), 4000);
            both_branches.assert_is(expected);
            assert!(both_branches.error < 2e-3, "{both_branches:?}");
        }
    }
    // Thin plates are seen as plates.
    for thickness in [1e-3, 1e-6, 1e-9] {
        let expected = oracles::slab_transmittance(oracles::fresnel(1.5, 0.5));
        let scene = slab(glass(1.5), thickness, 60.0).build();
        measure(&scene, &endless(Strategy::Mis), 4000).assert_is(expected);
    }
    // Schlick's reflectance at 60° for n = 1.5 is 0.04 + 0.96/32 = 0.07.
    let schlick = BsdfDescription::Dielectric {
        ior: 1.5,
        fresnel: Fresnel::Schlick,
    };
    measure(
        &slab(schlick, 0.1, 60.0).build(),
        &endless(Strategy::Mis),
        4000,
    )
    .assert_is(oracles::slab_transmittance(0.07));
}

#[test]
fn lossless_glass_vanishes_in_a_uniform_room_and_magnifies_radiance_inside() {
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
        measure(&outside.build(), &settings, 4000).assert_is(2.0);
        // From its centre every ray meets the sphere at a right angle and leaves at last.
        scene.window(
            [0.0; 3],
            [-1.0, 1.0, 1.0],
            [2.0, 0.0, 0.0],
            [0.0, -2.0, 0.0],
        );
        measure(&scene.build(), &settings, 4000).assert_is(2.0 * ior * ior);
    }
}

#[test]
fn a_glass_sphere_fills_in_with_the_number_of_its_surface_events() {
    // Mean over the disc of the share that has left after so many events, n = 1.5.
    let table = [(1, 0.091778), (2, 0.927322), (3, 0.988506), (5, 0.998467)];
    let mut scene = SceneBuilder::new();
    let ball = scene.matter(glass(1.5));
    scene.sphere([0.0; 3], 1.0, ball);
    scene.background(1.0);
    // So far away that the rays are parallel; the window holds the disc and its corners.
    scene.window(
        [0.0, 0.0, 1e6],
        [-1.0, 1.0, 0.0],
        [2.0, 0.0, 0.0],
        [0.0, -2.0, 0.0],
    );
    for (events, disc) in table {
        let expected = 1.0 + (disc - 1.0) * PI / 4.0;
        let measured = measure(&scene.build(), &path(Strategy::Mis, events + 1), 20_000);
        assert!(
            (measured.mean - expected).abs() < 4.0 * measured.error + 1e-6,
            "{measured:?}"
        );
        assert!((expected + measured.counts.truncated as f64 / 20_000.0 - 1.0).abs() < 0.02);
    }
}

#[test]
fn a_mirror_hall_shows_every_reflection_exactly() {
    let reflectance = 0.9;
    let mut scene = SceneBuilder::new();
    let wall = scene.matter(mirror(reflectance));
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
            measure(&scene, &settings, 2).assert_is_exactly(reflectance.powi(bounces));
        }
    }
}

#[test]
fn a_hall_of_perfect_mirrors_ends_by_roulette_or_is_counted_as_truncated() {
    let mut scene = SceneBuilder::new();
    let wall = scene.matter(mirror(1.0));
    scene.sphere([0.0; 3], 1.0, wall);
    scene.aim([0.1, 0.2, 0.3], [0.4, 0.4, 0.9]);
    for settings in [path(Strategy::Mis, 50), whitted(50)] {
        let dark = measure(&scene.build(), &settings, 20);
        dark.assert_is_exactly(0.0);
        let counts = RayCounts {
            camera: 20,
            bounce: 20 * 49,
            shadow: 0,
            truncated: 20,
        };
        assert_eq!(dark.counts, counts);
        let unlimited = RenderSettings {
            max_depth: None,
            roulette_depth: 5,
            ..settings
        };
        let ended = measure(&scene.build(), &unlimited, 500);
        assert_eq!(ended.counts.truncated, 0);
        // Survival 0.99 from depth 5 on: 4 + 99 bounces in the mean, standard deviation 100/√500.
        let mean_bounces = ended.counts.bounce as f64 / 500.0;
        assert!(
            (mean_bounces - 103.0).abs() < 4.0 * 100.0 / 500f64.sqrt(),
            "{mean_bounces}"
        );
    }
}

#[test]
fn transparent_shadows_dim_by_both_faces_without_bending() {
    let mut scene = lit_floor();
    let plate = scene.matter(glass(1.5));
    scene.ceiling(20.0, 3.0, plate);
    scene.floor(20.0, 3.1, plate);
    scene.point_light([2.0, 0.0, 5.0], 10.0);
    let cos = 5.0 / 29f64.sqrt();
    let pass = (1.0 - oracles::fresnel(1.5, cos)) * (1.0 - oracles::fresnel(1.0 / 1.5, cos));
    for settings in [path(Strategy::Mis, 2), path(Strategy::Nee, 2), whitted(2)] {
        measure(&scene.build(), &settings, 4).assert_is_exactly(0.0);
        let transparent = RenderSettings {
            transparent_shadows: true,
            ..settings
        };
        measure(&scene.build(), &transparent, 4)
            .assert_is_exactly(reflected(10.0 * cos / 29.0 * pass));
    }
}

#[test]
fn transparent_shadows_do_not_count_light_through_glass_twice() {
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
        let measured = measure(&scene.build(), &settings, 40_000);
        // The quadrature is good to 1e-6 at the edge of total reflection.
        let tolerance = 4.0 * measured.error + 1e-5;
        assert!(
            (measured.mean - expected).abs() < tolerance,
            "{measured:?}, not {expected}"
        );
    }
}

/// A box of many materials with every kind of light, seen from within.
fn busy_room() -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let reflectance = DVec3::new(0.8, 0.6, 0.3);
    let white = scene.matter(lambertian(0.7));
    let rough = scene.matter(BsdfDescription::OrenNayar {
        reflectance,
        sigma: 0.5,
    });
    let glossy = scene.matter(BsdfDescription::Phong {
        reflectance,
        exponent: 8.0,
    });
    let silver = scene.matter(mirror(0.9));
    let clear = scene.matter(glass(1.5));
    let lamp = scene.one_sided(lambertian(0.2), 4.0);
    let bulb = scene.one_sided(BsdfDescription::Black, 6.0);
    scene.floor(2.0, 0.0, white);
    scene.ceiling(2.0, 3.0, rough);
    scene.ceiling(1.0, 2.9, lamp);
    let wall = |scene: &mut SceneBuilder, a: [f64; 2], b: [f64; 2], material: MaterialId| {
        let corners = [(a, 0.0), (b, 0.0), (b, 3.0), (a, 3.0)].map(|([x, y], z)| [x, y, z]);
        scene.quad(corners, material);
    };
    wall(&mut scene, [-2.0, -2.0], [2.0, -2.0], glossy);
    wall(&mut scene, [2.0, -2.0], [2.0, 2.0], white);
    wall(&mut scene, [2.0, 2.0], [-2.0, 2.0], rough);
    // The fourth wall is open to the sky.
    scene.background(0.3);
    scene.sphere([0.8, 0.9, 0.8], 0.5, clear);
    scene.sphere([0.5, -0.8, 0.7], 0.6, silver);
    scene.sphere([1.2, 0.2, 2.2], 0.3, bulb);
    scene.point_light([-0.5, 1.0, 1.5], 2.0);
    scene.window(
        [-2.5, 0.0, 1.5],
        [-1.5, 1.0, 2.5],
        [0.0, -2.0, 0.0],
        [0.0, 0.0, -2.0],
    );
    scene
}

fn render(
    scene: &SceneDescription,
    settings: &RenderSettings,
    size: u32,
    samples: u64,
) -> ImageEstimate {
    let reference = Reference::new(scene, 0, size, size, settings).expect("the scene is sound");
    let mut counts = RayCounts::default();
    ImageEstimate::from_samples([size as usize; 2], samples, |x, y, sample| {
        reference
            .sample(x as u32, y as u32, sample, &mut counts)
            .to_array()
    })
}

#[test]
fn all_strategies_make_the_same_picture() {
    let scene = busy_room().build();
    let [mis, nee, bsdf] = STRATEGIES.map(|strategy| {
        let settings = RenderSettings {
            strategy,
            seed: strategy as u64,
            ..RenderSettings::default()
        };
        render(&scene, &settings, 16, 200)
    });
    assert_same(&mis, &nee);
    assert_same(&mis, &bsdf);
}

#[test]
fn roulette_and_depth_do_not_shift_whitteds_picture() {
    let scene = busy_room().build();
    let settings = RenderSettings {
        roulette_depth: 1,
        seed: 9,
        ..whitted(60)
    };
    assert_same(
        &render(&scene, &whitted(60), 16, 200),
        &render(&scene, &settings, 16, 200),
    );
}

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

#[test]
fn an_empty_scene_shows_its_background() {
    let mut scene = SceneBuilder::new();
    scene.background(0.25);
    scene.aim([0.0; 3], [0.0, 0.0, 1.0]);
    measure(&scene.build(), &endless(Strategy::Mis), 2).assert_is_exactly(0.25);
    measure(&scene.build(), &whitted(5), 2).assert_is_exactly(0.25);
}
