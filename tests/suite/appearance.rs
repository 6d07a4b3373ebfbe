//! Smooth normals, textures, opacity and glossy surfaces of both renderers against closed forms.

use glam::DVec3;
use wavepath::scene::{BsdfDescription, Mesh, RenderSettings, SceneDescription, Strategy};

use crate::builder::{SceneBuilder, ball, glass, glowing_room, lambertian, mirror, sheet};
use crate::renderer::{Renderer, STRATEGIES, STRUCTURES, endless, path, shown_by_both, whitted};
use crate::support::picture;
use wavepath::report::stability::oracles;

shown_by_both! {
    a_plate_lets_its_share_of_the_light_straight_on,
    a_hollow_body_lets_light_straight_on_twice,
    opacity_follows_its_texture,
    a_white_plate_of_any_opacity_vanishes_in_a_furnace,
    light_behind_a_veil_is_counted_once,
    a_textured_floor_reflects_what_its_texture_says,
    faces_without_coordinates_show_no_texture,
    glossy_albedos_match_their_closed_forms,
    a_point_light_sees_the_shading_normal,
    a_tilted_mirror_shows_what_its_shading_normal_reflects,
    no_light_passes_a_closed_shell_whatever_its_normals,
    a_shell_with_any_normals_reflects_at_most_its_albedo,
    smooth_glass_gains_no_energy,
}

fn glossy(diffuse: f64, specular: f64, exponent: f64) -> BsdfDescription {
    BsdfDescription::Glossy {
        diffuse: DVec3::splat(diffuse),
        specular: DVec3::splat(specular),
        exponent,
    }
}

/// Linear value of an sRGB byte.
fn linear(byte: u8) -> f64 {
    let x = f64::from(byte) / 255.0;
    if x <= 0.04045 {
        x / 12.92
    } else {
        ((x + 0.055) / 1.055).powf(2.4)
    }
}

/// A sky of 0.5 above a plate of this material at z = 0, and a lamp of 3 below it that the eye, which
/// looks down, sees through it. Nothing lights the plate from below but the lamp, which it cannot see
/// from above.
fn plate_over_a_lamp(bsdf: BsdfDescription, opacity: f64) -> SceneDescription {
    let mut scene = SceneBuilder::new();
    let plate = scene.matter(bsdf);
    scene.thin(plate, opacity);
    scene.floor(1.0, 0.0, plate);
    let lamp = scene.one_sided(BsdfDescription::Black, 3.0);
    scene.floor(0.5, -1.0, lamp);
    scene.background(0.5);
    scene.aim([0.2, 0.1, 3.0], [0.0; 3]);
    scene.build()
}

fn a_plate_lets_its_share_of_the_light_straight_on(by: Renderer) {
    for (bsdf, albedo) in [
        (lambertian(0.6), 0.6),
        (mirror(0.7), 0.7),
        (glossy(0.6, 0.0, 3.0), 0.6),
        (BsdfDescription::Black, 0.0),
    ] {
        for opacity in [0.0, 0.3, 0.75, 1.0] {
            let scene = plate_over_a_lamp(bsdf, opacity);
            let expected = (1.0 - opacity) * 3.0 + opacity * albedo * 0.5;
            for strategy in STRATEGIES {
                by.measure(&scene, &endless(strategy), 4000)
                    .assert_is(expected);
            }
            by.measure(&scene, &whitted(5), 4000).assert_is(expected);
        }
    }
}

fn a_hollow_body_lets_light_straight_on_twice(by: Renderer) {
    for (opacity, is_mesh) in [(0.0, false), (0.4, false), (0.4, true)] {
        let mut scene = SceneBuilder::new();
        let soot = scene.matter(BsdfDescription::Black);
        scene.thin(soot, opacity);
        if is_mesh {
            scene.attributed_mesh(ball(DVec3::ZERO, 1.0, |_, n| n), soot);
        } else {
            scene.sphere([0.1, 0.0, 0.0], 1.0, soot);
        }
        scene.background(2.0);
        scene.aim([3.0, 0.1, 0.2], [0.0; 3]);
        let expected = 2.0 * (1.0 - opacity) * (1.0 - opacity);
        for strategy in STRATEGIES {
            by.measure(&scene.build(), &endless(strategy), 4000)
                .assert_is(expected);
        }
        // The depth limit counts surfaces that were not there.
        by.measure(&scene.build(), &path(Strategy::Mis, 2), 400)
            .assert_is_exactly(0.0);
    }
}

fn opacity_follows_its_texture(by: Renderer) {
    let mut scene = SceneBuilder::new();
    let plate = scene.matter(BsdfDescription::Black);
    scene.thin(plate, 0.8);
    let texture = scene.texture(2, vec![[10, 200, 90], [255; 3], [0; 3], [60, 60, 60]]);
    scene.cut_out(plate, texture);
    scene.attributed_mesh(sheet(1.0, 0.0, [0.0; 3]), plate);
    scene.background(1.0);
    let top_left = (linear(10) + linear(200) + linear(90)) / 3.0;
    for (x, y, texel) in [
        (-0.5, 0.5, top_left),
        (0.5, 0.5, 1.0),
        (-0.5, -0.5, 0.0),
        (0.5, -0.5, linear(60)),
        // Halfway between the lower two.
        (0.0, -0.5, 0.5 * linear(60)),
    ] {
        let mut scene = scene.clone();
        scene.aim([x, y, 2.0], [x, y, 0.0]);
        by.measure(&scene.build(), &endless(Strategy::Mis), 4000)
            .assert_is_within(1.0 - 0.8 * texel, 1e-5);
    }
}

fn a_white_plate_of_any_opacity_vanishes_in_a_furnace(by: Renderer) {
    for opacity in [0.0, 0.3, 1.0] {
        for bsdf in [lambertian(1.0), mirror(1.0), glass(1.5)] {
            let mut scene = glowing_room(lambertian(0.5), 3.0, DVec3::ZERO, true);
            let plate = scene.matter(bsdf);
            scene.thin(plate, opacity);
            if !matches!(bsdf, BsdfDescription::Dielectric { .. }) {
                scene.attributed_mesh(sheet(1.2, 0.3, [0.0; 3]), plate);
            }
            scene.sphere([0.5, -0.5, 1.6], 0.8, plate);
            scene.background(0.0);
            for strategy in STRATEGIES {
                // Of 80 segments enough are at walls.
                by.measure(&scene.build(), &path(strategy, 80), 4000)
                    .assert_is_within(oracles::furnace(0.5, 79), 1e-6);
            }
        }
    }
}

fn light_behind_a_veil_is_counted_once(by: Renderer) {
    // A veil of soot between floor and light: Lambert's formula times what the veil lets pass, found
    // by following directions alone.
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(0.6));
    scene.floor(2.0, 0.0, floor);
    let veil = scene.matter(BsdfDescription::Black);
    scene.thin(veil, 0.25);
    scene.floor(50.0, 0.5, veil);
    let lamp = scene.one_sided(BsdfDescription::Black, 5.0);
    scene.ceiling(1.0, 1.0, lamp);
    scene.aim([0.3, 0.2, 0.4], [0.0; 3]);
    // Four corners of 1 × 1 at height 1 (Lambert's formula).
    let expected = 0.6 / std::f64::consts::PI * 5.0 * 4.0 * 0.435209875684 * 0.75;
    for strategy in STRATEGIES {
        by.measure(&scene.build(), &endless(strategy), 40_000)
            .assert_is(expected);
    }
}

fn a_textured_floor_reflects_what_its_texture_says(by: Renderer) {
    for bsdf in [
        lambertian(0.8),
        mirror(0.8),
        BsdfDescription::OrenNayar {
            reflectance: DVec3::splat(0.8),
            sigma: 0.0,
        },
        glossy(0.8, 0.0, 4.0),
    ] {
        let mut scene = SceneBuilder::new();
        let floor = scene.matter(bsdf);
        let texture = scene.texture(2, vec![[7; 3], [255; 3], [70; 3], [200; 3]]);
        scene.paint(floor, texture);
        scene.attributed_mesh(sheet(1.0, 0.0, [0.0; 3]), floor);
        scene.background(2.0);
        for (x, y, texel) in [
            (-0.5, 0.5, linear(7)),
            (0.5, 0.5, 1.0),
            (-0.5, -0.5, linear(70)),
            (0.5, -0.5, linear(200)),
            (0.5, 0.0, 0.5 * (1.0 + linear(200))),
        ] {
            let mut scene = scene.clone();
            scene.aim([x, y, 2.0], [x, y, 0.0]);
            by.measure(&scene.build(), &path(Strategy::Bsdf, 2), 400)
                .assert_is_exactly(2.0 * 0.8 * texel);
        }
    }
}

fn faces_without_coordinates_show_no_texture(by: Renderer) {
    let mut scene = SceneBuilder::new();
    let floor = scene.matter(lambertian(0.8));
    let black = scene.texture(1, vec![[0; 3]]);
    scene.paint(floor, black);
    let mut mesh = sheet(1.0, 0.0, [0.0; 3]);
    mesh.face_uvs[0][2] = Mesh::ABSENT;
    scene.attributed_mesh(mesh, floor);
    scene.sphere([0.0, 0.0, -3.0], 0.5, floor);
    scene.background(1.0);
    for (eye, at, expected) in [
        ([0.5, -0.5, 2.0], [0.5, -0.5, 0.0], 0.8),
        ([-0.5, 0.5, 2.0], [-0.5, 0.5, 0.0], 0.0),
        // The sphere from below, where it does not see the floor.
        ([0.5, 0.0, -8.0], [0.0, 0.0, -3.0], 0.8),
    ] {
        let mut scene = scene.clone();
        scene.aim(eye, at);
        by.measure(&scene.build(), &path(Strategy::Bsdf, 2), 400)
            .assert_is_exactly(expected);
    }
}

fn glossy_albedos_match_their_closed_forms(by: Renderer) {
    // Albedo of the lobe by quadrature, at weight 1.
    for (exponent, degrees, lobe) in [
        (1.0, 30.0, 0.880843),
        (5.0, 75.0, 0.327132),
        (10.0, 60.0, 0.504736),
        (50.0, 75.0, 0.260465),
    ] {
        let mut scene = SceneBuilder::new();
        let floor = scene.matter(glossy(0.3, 0.6, exponent));
        scene.floor(1.0, 0.0, floor);
        scene.background(1.0);
        let (sin, cos) = f64::to_radians(degrees).sin_cos();
        scene.aim([sin, 0.0, cos], [0.0; 3]);
        for strategy in STRATEGIES {
            by.measure(&scene.build(), &path(strategy, 2), 10_000)
                .assert_is_within(0.3 + 0.6 * lobe, 5e-7);
        }
    }
}

fn a_point_light_sees_the_shading_normal(by: Renderer) {
    // Of numbers that f32 has, so that both renderers see the same normal.
    let exact = DVec3::new(0.75, 0.0, 1.0);
    let normal = exact.normalize();
    for scale in [1.0, -1.0, f64::powi(2.0, -100), f64::powi(2.0, 100)] {
        let mut scene = SceneBuilder::new();
        let floor = scene.matter(lambertian(0.5));
        scene.attributed_mesh(sheet(1.0, 0.0, (exact * scale).as_vec3().to_array()), floor);
        scene.aim([0.3, 0.0, 2.0], [0.0; 3]);
        for light in [
            DVec3::new(1.0, 0.5, 2.0),
            DVec3::new(-1.0, 0.0, 1.0),
            // Above the face and below the shading horizon, and the other way round.
            DVec3::new(-4.0, 0.0, 1.0),
            DVec3::new(4.0, 0.0, -1.0),
        ] {
            let mut scene = scene.clone();
            scene.point_light(light.to_array(), 3.0);
            let cos = if light.z > 0.0 {
                normal.dot(light.normalize()).max(0.0)
            } else {
                0.0
            };
            let expected = 0.5 / std::f64::consts::PI * 3.0 * cos / light.length_squared();
            by.measure(&scene.build(), &path(Strategy::Mis, 2), 400)
                .assert_is_exactly(expected);
        }
    }
}

fn a_tilted_mirror_shows_what_its_shading_normal_reflects(by: Renderer) {
    // A ray straight down on a mirror tilted by 20° goes 40° off the vertical.
    let mut scene = SceneBuilder::new();
    let silver = scene.matter(mirror(0.9));
    let (sin, cos) = f64::to_radians(20.0).sin_cos();
    scene.attributed_mesh(sheet(1.0, 0.0, [sin as f32, 0.0, cos as f32]), silver);
    let lamp = scene.two_sided(BsdfDescription::Black, 2.0);
    let (sin, cos) = f64::to_radians(40.0).sin_cos();
    scene.sphere([10.0 * sin, 0.0, 10.0 * cos], 1e-3, lamp);
    scene.aim([0.0, 0.0, 2.0], [0.0; 3]);
    by.measure(&scene.build(), &endless(Strategy::Mis), 400)
        .assert_is_exactly(1.8);
    // Tilted by 60° its image of the ray would be below the face: the nearest to that is the horizon.
    let mut scene = SceneBuilder::new();
    let silver = scene.matter(mirror(0.9));
    scene.attributed_mesh(sheet(1.0, 0.0, [0.866_025_4, 0.0, 0.5]), silver);
    let lamp = scene.two_sided(BsdfDescription::Black, 2.0);
    scene.sphere([10.0, 0.0, 0.0], 0.1, lamp);
    scene.aim([0.0, 0.0, 2.0], [0.0; 3]);
    by.measure(&scene.build(), &endless(Strategy::Mis), 400)
        .assert_is_exactly(1.8);
}

/// From a vertex's number and right normal to another.
type Spoiler = fn(usize, DVec3) -> DVec3;

/// Ways to spoil the normals of a ball, by vertex number.
const SPOILERS: [(&str, Spoiler); 6] = [
    ("right", |_, n| n),
    ("flipped", |_, n| -n),
    ("zero", |i, n| if i % 2 == 0 { DVec3::ZERO } else { n }),
    ("not a number", |i, n| {
        if i % 3 == 0 {
            DVec3::splat(f64::NAN)
        } else {
            n
        }
    }),
    // 89° off, each to another side.
    ("grazing", |i, n| {
        let side = n.any_orthonormal_vector();
        let side = side * (i as f64).cos() + n.cross(side) * (i as f64).sin();
        n * 0.0175 + side
    }),
    ("random", |i, n| {
        (n.any_orthogonal_vector() * (7.0 * i as f64).sin() + n * (11.0 * i as f64).cos()) * 3.0
    }),
];

const SHELLS: [fn() -> BsdfDescription; 5] = [
    || lambertian(0.8),
    || mirror(0.8),
    || glossy(0.4, 0.4, 20.0),
    || BsdfDescription::OrenNayar {
        reflectance: DVec3::splat(0.8),
        sigma: 0.0,
    },
    || BsdfDescription::Phong {
        reflectance: DVec3::splat(0.8),
        exponent: 5.0,
    },
];

fn no_light_passes_a_closed_shell_whatever_its_normals(by: Renderer) {
    for (name, spoil) in SPOILERS {
        for shell in SHELLS {
            for is_inside in [false, true] {
                let mut scene = SceneBuilder::new();
                let wall = scene.matter(shell());
                scene.attributed_mesh(ball(DVec3::ZERO, 1.0, spoil), wall);
                let lamp = scene.two_sided(BsdfDescription::Black, 1e6);
                // The eye on one side, all light on the other.
                if is_inside {
                    scene.background(1e6);
                    scene.sphere([0.0, 0.0, 3.0], 0.5, lamp);
                    scene.point_light([2.0, 0.0, 0.0], 1e6);
                    scene.window(
                        [0.1; 3],
                        [1.0, 1.0, 1.0],
                        [0.0, -2.0, 0.0],
                        [0.0, 0.0, -2.0],
                    );
                } else {
                    scene.sphere([0.1, 0.0, 0.2], 0.3, lamp);
                    scene.point_light([-0.3, 0.2, 0.1], 1e6);
                    scene.window(
                        [-3.0, 0.0, 0.0],
                        [-1.0, 1.0, 1.0],
                        [0.0, -2.0, 0.0],
                        [0.0, 0.0, -2.0],
                    );
                }
                for strategy in STRATEGIES {
                    let measured = by.measure(&scene.build(), &path(strategy, 12), 2000);
                    assert_eq!(
                        measured.mean, 0.0,
                        "{name}, inside {is_inside}: {measured:?}"
                    );
                }
            }
        }
    }
}

fn a_shell_with_any_normals_reflects_at_most_its_albedo(by: Renderer) {
    for (name, spoil) in SPOILERS {
        for shell in SHELLS {
            let mut scene = SceneBuilder::new();
            let wall = scene.matter(shell());
            scene.attributed_mesh(ball(DVec3::ZERO, 1.0, spoil), wall);
            scene.background(1.0);
            for eye in [[-3.0, 0.4, 0.3], [0.3, -2.0, -1.0], [0.0, 0.5, 4.0]] {
                let mut scene = scene.clone();
                scene.aim(eye, [0.0; 3]);
                for strategy in STRATEGIES {
                    let measured = by.measure(&scene.build(), &endless(strategy), 2000);
                    assert!(
                        measured.mean <= 0.8 * (1.0 + by.rounding()) + 4.0 * measured.error,
                        "{name}: {measured:?}"
                    );
                    // It is not black either.
                    assert!(measured.mean > 0.0, "{name}: {measured:?}");
                }
            }
        }
    }
}

fn smooth_glass_gains_no_energy(by: Renderer) {
    for (name, spoil) in SPOILERS {
        let mut scene = SceneBuilder::new();
        let clear = scene.matter(glass(1.5));
        scene.attributed_mesh(ball(DVec3::splat(0.5), 1.0, spoil), clear);
        scene.background(1.0);
        scene.aim([-1.5, -1.0, -1.0], [0.5, 0.4, 0.5]);
        let measured = by.measure(&scene.build(), &path(Strategy::Mis, 50), 2000);
        let most = 1.0 + by.rounding() + 4.0 * measured.error;
        assert!(measured.mean <= most, "{name}: {measured:?}");
        let least = if name == "right" { 0.9 } else { 0.0 };
        assert!(measured.mean > least, "{name}: {measured:?}");
    }
}

#[test]
fn normals_without_a_direction_leave_the_picture_as_it_is_to_the_last_bit() {
    let image = |normal: Option<[f32; 3]>, settings: &RenderSettings| {
        let mut scene = SceneBuilder::new();
        let wall = scene.matter(lambertian(0.8));
        let mut mesh = ball(DVec3::ZERO, 1.0, |_, n| n);
        match normal {
            Some(normal) => mesh.normals.fill(normal),
            None => (mesh.normals, mesh.face_normals) = Default::default(),
        }
        scene.attributed_mesh(mesh, wall);
        scene.background(0.5);
        scene.window(
            [-3.0, 0.0, 0.0],
            [-1.0, 1.0, 1.0],
            [0.0, -2.0, 0.0],
            [0.0, 0.0, -2.0],
        );
        let film = picture(&scene.build(), 0, [24, 24], settings).film;
        (0..film.len())
            .map(|p| film.mean(p).map(f64::to_bits))
            .collect::<Vec<_>>()
    };
    for accel in STRUCTURES {
        let settings = RenderSettings {
            accel,
            ..path(Strategy::Mis, 4)
        };
        let flat = image(None, &settings);
        for normal in [[0.0; 3], [f32::NAN, 1.0, 0.0], [0.0, f32::INFINITY, 0.0]] {
            assert!(
                flat == image(Some(normal), &settings),
                "{normal:?}, {accel:?}"
            );
        }
    }
}
