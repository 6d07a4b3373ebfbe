//! Auxiliary images: albedo, normal and depth of the first hit.

use glam::DVec3;
use wavepath::film::Film;
use wavepath::scene::{
    BsdfDescription, Budget, IntegratorKind, RenderSettings, SceneDescription, Strategy,
};

use crate::builder::{SceneBuilder, busy_room, glass, mirror, sheet};
use crate::renderer::{STRUCTURES, endless, whitted};
use crate::support::picture;

fn film(scene: &SceneDescription, size: [u32; 2], settings: &RenderSettings) -> Film {
    let settings = RenderSettings {
        aux: true,
        budget: Budget::Samples(8),
        ..settings.clone()
    };
    picture(scene, 0, size, &settings).film
}

#[test]
fn the_first_hit_is_what_auxiliary_images_show() {
    let mut scene = SceneBuilder::new();
    let tinted = DVec3::new(0.8, 0.5, 0.1);
    let floor = scene.matter(BsdfDescription::Lambertian {
        reflectance: tinted,
    });
    let clear = scene.matter(glass(1.5));
    let silver = scene.matter(mirror(0.9));
    let lamp = scene.two_sided(BsdfDescription::Black, 1.0);
    scene.floor(1.0, 0.0, floor);
    scene.sphere([5.0, 0.0, 0.0], 1.0, clear);
    scene.sphere([-5.0, 0.0, 0.0], 2.0, silver);
    scene.ceiling(1.0, 9.0, lamp);
    let up = [0.0, 0.0, 1.0];
    let down = [0.0, 0.0, -1.0];
    let nothing = [0.0; 3];
    for (eye, at, albedo, normal, depth) in [
        // The floor at an angle; from below, with the normal on the eye's side.
        ([0.3, 0.4, 1.2], nothing, tinted.into(), up, 1.3),
        ([0.3, 0.4, -1.2], nothing, tinted.into(), down, 1.3),
        ([5.0, 0.0, 4.0], [5.0, 0.0, 0.0], [1.0; 3], up, 3.0),
        // From the glass sphere's middle its inside is seen.
        ([5.0, 0.0, 0.0], [5.0, 0.0, 0.5], [1.0; 3], down, 1.0),
        ([-5.0, 0.0, 4.0], [-5.0, 0.0, 0.0], [0.9; 3], up, 2.0),
        ([0.0, 0.0, 5.0], [0.0, 0.0, 6.0], nothing, down, 4.0),
        ([0.0, 0.0, 5.0], [9.0, 0.0, 5.0], nothing, nothing, 0.0),
    ] {
        let mut scene = scene.clone();
        scene.aim(eye, at);
        for settings in [endless(Strategy::Mis), whitted(5)] {
            for accel in STRUCTURES {
                let settings = RenderSettings {
                    accel,
                    ..settings.clone()
                };
                let film = film(&scene.build(), [19, 3], &settings);
                for pixel in 0..film.len() {
                    let aux = film.aux(pixel).expect("they were asked for");
                    let shown = [aux.albedo, aux.normal, [aux.depth, 0.0, 0.0]];
                    let expected = [albedo, normal, [depth, 0.0, 0.0]];
                    for (value, expected) in
                        shown.as_flattened().iter().zip(expected.as_flattened())
                    {
                        assert!(
                            (value - expected).abs() < 1e-6,
                            "{aux:?} from {eye:?} to {at:?}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn auxiliary_images_show_textures_and_shading_normals() {
    let mut scene = SceneBuilder::new();
    let glossy = scene.matter(BsdfDescription::Glossy {
        diffuse: DVec3::new(0.5, 0.4, 0.2),
        specular: DVec3::splat(0.25),
        exponent: 9.0,
    });
    let texture = scene.texture(2, vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3]]);
    scene.paint(glossy, texture);
    let mut mesh = sheet(1.0, 0.0, [0.0; 3]);
    // Corner by corner: upright, flipped and leaning to x, of no direction, leaning to y.
    mesh.normals = vec![
        [0.0, 0.0, 7.0],
        [-0.6, 0.0, -0.8],
        [0.0; 3],
        [0.0, 1.2, 1.6],
    ];
    mesh.face_normals = mesh.faces.clone();
    scene.attributed_mesh(mesh, glossy);
    // Barycentric weights of (x, y) in the first face, which is below the diagonal.
    let [x, y] = [0.5, -0.5];
    let [b, c] = [(x - y) / 2.0, (y + 1.0) / 2.0];
    let normal = DVec3::new(0.6 * b, 0.0, 1.0 - b - c + 0.8 * b + c).normalize();
    for (eye, side) in [(3.0, 1.0), (-3.0, -1.0)] {
        let mut scene = scene.clone();
        scene.aim([x, y, eye], [x, y, 0.0]);
        for accel in STRUCTURES {
            let settings = RenderSettings {
                accel,
                ..endless(Strategy::Mis)
            };
            let film = film(&scene.build(), [5, 3], &settings);
            let aux = film.aux(7).expect("they were asked for");
            // The lower right texel.
            let albedo = [0.75, 0.65, 0.45];
            let expected = [albedo, (normal * side).to_array(), [3.0, 0.0, 0.0]];
            let shown = [aux.albedo, aux.normal, [aux.depth, 0.0, 0.0]];
            for (value, expected) in shown.as_flattened().iter().zip(expected.as_flattened()) {
                assert!((value - expected).abs() < 1e-6, "{aux:?}, not {expected}");
            }
        }
    }
}

#[test]
fn auxiliary_images_do_not_depend_on_threads_or_waves_and_leave_the_picture_alone() {
    let scene = busy_room().build();
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        let settings = RenderSettings {
            integrator,
            roulette_depth: 5,
            ..endless(Strategy::Mis)
        };
        let one = film(&scene, [37, 21], &settings);
        for (threads, wave) in [(2, 1024), (5, 64), (1, 16_384), (2, 1)] {
            let settings = RenderSettings {
                threads,
                wave,
                ..settings.clone()
            };
            assert!(film(&scene, [37, 21], &settings) == one, "{settings:?}");
        }
        let without = RenderSettings {
            budget: Budget::Samples(8),
            ..settings
        };
        let without = picture(&scene, 0, [37, 21], &without).film;
        for pixel in 0..one.len() {
            assert_eq!(one.mean(pixel), without.mean(pixel));
            assert_eq!(without.aux(pixel), None);
        }
    }
}
