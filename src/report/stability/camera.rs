//! Cameras and pictures at the ends of what is possible, and scenes with next to nothing in them.

use std::f64::consts::PI;

use glam::DVec3;

use super::renders::{STRATEGIES, deviation, endless, kind, path};
use super::scenes::{SceneBuilder, glass, glowing_room, lambertian};
use super::trial::{Figure, Trial};
use crate::error::{ErrorKind, Result};
use crate::film::memory::available_bytes;
use crate::film::{Film, check_memory};
use crate::scene::{self, BsdfDescription, Budget, RenderSettings, SceneDescription, Strategy};

/// A scene of which every pixel has a known value on every structure.
fn known(
    trial: &mut Trial<'_>,
    label: &str,
    scene: &SceneDescription,
    expected: f64,
) -> Result<()> {
    trial.on_structures(label, "known value, every pixel", |trial, structure| {
        let mut worst = 0.0f64;
        let mut samples = 0;
        for strategy in STRATEGIES {
            let settings = RenderSettings {
                accel: kind(structure),
                budget: Budget::Samples(4),
                ..endless(strategy)
            };
            let picture = trial.picture(scene, [21, 19], &settings)?;
            worst = worst.max(picture.worst_pixel(expected));
            samples += picture.film.total_samples();
        }
        Ok(Figure::relative(worst, 1e-5, samples))
    })
}

pub(super) fn small_scenes(trial: &mut Trial<'_>) -> Result<()> {
    let mut nothing = SceneBuilder::new();
    nothing.aim([1.0, 2.0, 3.0], [0.0; 3]);
    known(trial, "no surface, no light", &nothing.build(), 0.0)?;

    for eye in [[0.0; 3], [1e6, 0.0, -1e6]] {
        let mut sky = SceneBuilder::new();
        sky.background(0.25);
        sky.window(
            eye,
            [eye[0] - 1.0, eye[1] + 1.0, eye[2] - 1.0],
            [2.0, 0.0, 0.0],
            [0.0, -2.0, 0.0],
        );
        known(
            trial,
            &format!("background alone, eye at {:e}", eye[0]),
            &sky.build(),
            0.25,
        )?;
    }
    let mut lights = SceneBuilder::new();
    let light = lights.one_sided(BsdfDescription::Black, 3.0);
    lights.sphere([0.0; 3], 1.0, light);
    lights.ceiling(1.0, 5.0, light);
    lights.point_light([0.0, 0.0, 2.0], 7.0);
    lights.aim([3.0, 1.0, 0.5], [0.0, 0.2, 0.1]);
    known(trial, "lights alone", &lights.build(), 3.0)?;

    let mut triangle = SceneBuilder::new();
    let matte = triangle.matter(lambertian(0.6));
    let corners = [[-1.0, -1.0, 0.1], [1.0, -1.0, 0.0], [0.0, 1.0, -0.2]];
    triangle.mesh(corners.map(DVec3::from).to_vec(), vec![[0, 1, 2]], matte);
    let mut sphere = SceneBuilder::new();
    let matte = sphere.matter(lambertian(0.6));
    sphere.sphere([0.0; 3], 0.5, matte);
    for (label, mut scene) in [("1 triangle", triangle), ("1 sphere", sphere)] {
        scene.background(2.0);
        scene.aim([0.5, -0.3, 4.0], [0.0; 3]);
        known(trial, &format!("{label} under a sky"), &scene.build(), 1.2)?;
    }
    let mut unlit = SceneBuilder::new();
    let matte = unlit.matter(lambertian(0.6));
    unlit.floor(1.0, 0.0, matte);
    unlit.aim([0.5, -0.3, 4.0], [0.0; 3]);
    known(trial, "a surface, no light", &unlit.build(), 0.0)
}

pub(super) fn eyes(trial: &mut Trial<'_>) -> Result<()> {
    let mut room = glowing_room(lambertian(0.5), 1.0, DVec3::ZERO, true).build();
    room.background = DVec3::splat(0.5);
    room.cameras.clear();
    let mut view = SceneBuilder::new();
    view.window(
        [0.0, 0.0, -1.5],
        [-1.0, 1.0, -2.5],
        [2.0, 0.0, 0.0],
        [0.0, -2.0, 0.0],
    );
    room.cameras = view.build().cameras;
    known(trial, "everything is behind the camera", &room, 0.5)?;

    // Inside of a ball of glass in a uniform room radiance is n² times that outside.
    let mut ball = SceneBuilder::new();
    let clear = ball.matter(glass(1.5));
    ball.sphere([0.0; 3], 1.0, clear);
    ball.background(2.0);
    ball.window(
        [0.0; 3],
        [-1.0, 1.0, 1.0],
        [2.0, 0.0, 0.0],
        [0.0, -2.0, 0.0],
    );
    known(trial, "eye within glass", &ball.build(), 2.0 * 1.5 * 1.5)?;

    let mut scene = SceneBuilder::new();
    let black = scene.matter(BsdfDescription::Black);
    let light = scene.two_sided(BsdfDescription::Black, 3.0);
    scene.floor(1.0, 0.0, black);
    scene.ceiling(9.0, 1.0, light);
    scene.sphere([0.0, 0.0, -2.0], 1.0, light);
    scene.background(0.5);
    for (label, eye, at, expected) in [
        ("eye on a triangle", [0.1, 0.3, 0.0], [0.2, 0.1, 1.0], 3.0),
        ("eye on a diagonal", [0.5, 0.5, 0.0], [0.2, 0.1, 1.0], 3.0),
        ("eye on a corner", [-1.0, -1.0, 0.0], [-0.2, 0.1, 1.0], 3.0),
        (
            "eye in the plane of a triangle",
            [0.5, 0.25, 0.0],
            [30.0, 0.25, 0.0],
            0.5,
        ),
        (
            "eye on a sphere, outward",
            [0.0, 0.0, -3.0],
            [0.5, 0.0, -4.0],
            0.5,
        ),
        (
            "eye on a sphere, inward",
            [0.0, 0.0, -3.0],
            [0.1, 0.0, -2.0],
            3.0,
        ),
    ] {
        let mut scene = scene.clone();
        scene.aim(eye, at);
        known(trial, label, &scene.build(), expected)?;
    }
    Ok(())
}

pub(super) fn coverage(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(1_024);
    for (radius, distance, fov) in [
        (1.0, 5.0, 40f64),
        (1.0, 1e5, 2e-3),
        (1.0, 1.000_001, 179.0),
        (2e6, 1e7, 40.0),
    ] {
        // A cone of half angle asin(r/d) about the axis cuts the image plane in a circle.
        let size: f64 = radius / distance;
        let tan = size / (1.0 - size * size).sqrt();
        let half = (fov.to_radians() / 2.0).tan();
        // All of the disc is in the picture, or all of the picture is on the disc.
        let expected = (PI * (tan / half).powi(2) / 4.0).min(1.0);
        let mut scene = SceneBuilder::new();
        let light = scene.one_sided(BsdfDescription::Black, 1.0);
        scene.sphere([1.0, 2.0, 3.0], radius, light);
        let target = DVec3::new(1.0, 2.0, 3.0);
        scene.look_at(target + distance * DVec3::new(0.6, 0.0, 0.8), target, fov);
        let scene = scene.build();
        let settings = RenderSettings {
            budget: Budget::Samples(samples),
            ..path(Strategy::Mis, 1)
        };
        let picture = trial.picture(&scene, [32, 32], &settings)?;
        let (mean, error) = picture.mean();
        // A far camera's f32 position is good to an ulp of its distance.
        let off = deviation(mean - expected, error.max(1e-12), 1e-5 * expected);
        trial.note(
            format!("fov {fov:e}°, radius {radius:e} from {distance:e}"),
            "π tan²α/(4 tan²(fov/2))",
            Figure::standard_errors(off, picture.film.total_samples()),
        );
    }
    let text = r#"
        [film]
        width = 4
        height = 4
        [cameras.a]
        eye = [0, 0, 0]
        look_at = [0, 0, 1]
        up = [0, 0, 2]
        fov = 40
    "#;
    let parsed = scene::parse(text, std::path::Path::new("camera.toml"), &[]);
    let wrong = u64::from(!parsed.is_err_and(|error| error.place.is_some()));
    trial.note(
        "up along the view",
        "refused with file and line",
        Figure::none_of(wrong, 1),
    );
    Ok(())
}

pub(super) fn picture_sizes(trial: &mut Trial<'_>) -> Result<()> {
    let scene = glowing_room(lambertian(0.5), 1.0, DVec3::ZERO, false).build();
    let settings = RenderSettings {
        budget: Budget::Samples(1),
        ..path(Strategy::Bsdf, 3)
    };
    for size in [[1, 1], [8192, 1], [1, 8192], [65_535, 1], [17, 31]] {
        let picture = trial.picture(&scene, size, &settings)?;
        trial.note(
            format!("{} × {} pixels", size[0], size[1]),
            "1.75, every pixel",
            Figure::relative(
                picture.worst_pixel(1.75),
                1e-6,
                picture.film.total_samples(),
            ),
        );
    }
    for side in [16_384, 65_535] {
        let needed = Film::bytes(side, side, false);
        let fits = available_bytes().is_none_or(|available| needed <= available / 4);
        let wrong = match check_memory(side, side, false, 1) {
            Ok(()) => available_bytes().is_some_and(|available| needed > available),
            Err(error) => error.kind != ErrorKind::Limit || fits,
        };
        trial.note(
            format!("{side} × {side} pixels"),
            "refused if memory is short",
            Figure::none_of(wrong.into(), 1),
        );
    }
    Ok(())
}
