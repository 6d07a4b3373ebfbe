//! Lights that are tiny, touching, many, hidden behind glass or of any power.

use std::f64::consts::PI;

use glam::DVec3;

use super::oracles;
use super::renders::{Picture, STRATEGIES, deviation, max_or_nan, path};
use super::scenes::{SceneBuilder, glass, lambertian};
use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::math::F32s;
use crate::math::mis::power_heuristic;
use crate::scene::{
    BsdfDescription, Budget, RenderSettings, SamplerKind, SceneDescription, Strategy, procedural,
};

/// Albedo of receivers.
const ALBEDO: f64 = 0.5;

/// A floor of this half size, seen at the origin from a side.
fn floor(half: f64) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let matte = scene.matter(lambertian(ALBEDO));
    scene.floor(half, 0.0, matte);
    scene.aim([3.0 * half, -4.0 * half, 2.5 * half], [0.0; 3]);
    scene
}

/// Pictures of one pixel's content: many pixels, and few samples in each.
const SIZE: [u32; 2] = [40, 25];

/// Renders `samples` in all by this strategy, direct light alone.
fn direct(
    trial: &mut Trial<'_>,
    scene: &SceneDescription,
    strategy: Strategy,
    samples: u64,
) -> Result<Picture> {
    let per_pixel = (samples / 1000).max(2);
    let settings = RenderSettings {
        budget: Budget::Samples(per_pixel),
        block: per_pixel.div_ceil(16).min(64) as u32,
        ..path(strategy, 2)
    };
    trial.picture(scene, SIZE, &settings)
}

/// Standard errors that the radiance of irradiance `e` is off, rounding apart.
fn figure(picture: &Picture, e: f64, rounding: f64) -> Figure {
    let (mean, error) = picture.mean();
    let expected = ALBEDO / PI * e;
    let off = deviation(mean - expected, error, rounding * expected);
    Figure::standard_errors(off, picture.film.total_samples())
}

pub(super) fn tiny_spheres(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(100_000);
    for exponent in 1..=6 {
        let radius = 10f64.powi(-exponent);
        for strategy in [Strategy::Mis, Strategy::Nee] {
            let mut scene = floor(2.0);
            let light = scene.one_sided(BsdfDescription::Black, 1.0 / (PI * radius * radius));
            scene.sphere([0.0, 0.0, 1.0], radius, light);
            let picture = direct(trial, &scene.build(), strategy, samples)?;
            trial.note(
                format!("radius {radius:e} at 1, {strategy:?}"),
                "πL(r/d)², 1e-5 + 4 s.e.",
                figure(&picture, 1.0, 1e-5),
            );
        }
    }
    Ok(())
}

pub(super) fn tiny_flat_lights(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(400_000);
    let (side, radiance) = (1e-4, 1e10);
    for distance in [1.0, 1e-1, 1e-2, 1e-3, 1e-4] {
        for corners in [3, 4] {
            // No larger than it has to be: positions are good to a share of the scene's size.
            let mut scene = floor(20.0 * distance);
            let light = scene.one_sided(BsdfDescription::Black, radiance);
            let place = [[0.0, 0.0], [0.0, side], [side, side], [side, 0.0]]
                .map(|[x, y]| [x - 0.3 * side, y - 0.4 * side, distance]);
            let corners_of = place.map(DVec3::from);
            let name = if corners == 4 {
                scene.quad(place, light);
                "square"
            } else {
                scene.mesh(corners_of[..3].to_vec(), vec![[0, 1, 2]], light);
                "triangle"
            };
            let e = radiance
                * oracles::polygon_irradiance(DVec3::ZERO, DVec3::Z, &corners_of[..corners]);
            let scene = scene.build();
            for strategy in [Strategy::Mis, Strategy::Nee] {
                let picture = direct(trial, &scene, strategy, samples)?;
                trial.note(
                    format!("{name} of 1e-4 and 1e10 at {distance:e}, {strategy:?}"),
                    "Lambert, 1e-4 + 4 s.e.",
                    figure(&picture, e, 1e-4),
                );
            }
        }
    }
    Ok(())
}

/// Width of the strip of floor before a glowing wall.
const STRIP: f64 = 0.05;

/// The floor from the foot of a glowing wall with these corners, at x = 0, to [`STRIP`] before it, in each of a column
/// of pixels.
fn foot_of_a_wall(corners: &[DVec3]) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let matte = scene.matter(lambertian(ALBEDO));
    let light = scene.one_sided(BsdfDescription::Black, 1.0);
    scene.floor(2.0, 0.0, matte);
    match *corners {
        [a, b, c, d] => scene.quad([a, b, c, d].map(|p| p.to_array()), light),
        _ => scene.mesh(corners.to_vec(), vec![[0, 1, 2]], light),
    }
    scene.window([1.0, 0.0, 1.5], [0.0; 3], [STRIP, 0.0, 0.0], [0.0; 3]);
    scene
}

pub(super) fn touching_light(trial: &mut Trial<'_>) -> Result<()> {
    let wall = |corners: &[[f64; 2]]| -> Vec<DVec3> {
        let at = |&[y, z]: &[f64; 2]| DVec3::new(0.0, y, z);
        corners.iter().map(at).collect()
    };
    for (name, corners) in [
        (
            "square wall",
            wall(&[[-0.5, 0.0], [0.5, 0.0], [0.5, 1.0], [-0.5, 1.0]]),
        ),
        (
            "triangle on its side",
            wall(&[[-0.5, 0.0], [0.5, 0.0], [0.1, 1.0]]),
        ),
        (
            "triangle on its corner",
            wall(&[[0.0, 0.0], [0.5, 1.0], [-0.5, 0.8]]),
        ),
    ] {
        touching_wall(trial, name, &corners)?;
    }
    Ok(())
}

/// Mean irradiance of the strip before a wall of radiance 1.
fn strip_irradiance(corners: &[DVec3]) -> f64 {
    const STEPS: u32 = 10_000;
    let at = |i: u32| {
        let point = DVec3::X * (STRIP * (f64::from(i) + 0.5) / f64::from(STEPS));
        oracles::polygon_irradiance(point, DVec3::Z, corners)
    };
    (0..STEPS).map(at).sum::<f64>() / f64::from(STEPS)
}

fn touching_wall(trial: &mut Trial<'_>, name: &str, corners: &[DVec3]) -> Result<()> {
    let expected = ALBEDO / PI * strip_irradiance(corners);
    let height = trial.count(1_024).clamp(1_024, 4_096) as u32;
    let scene = foot_of_a_wall(corners).build();
    for strategy in STRATEGIES {
        let mut errors = Vec::new();
        let mut last = 0.0;
        for samples in [16, 64, 256] {
            let settings = RenderSettings {
                sampler: SamplerKind::Independent,
                budget: Budget::Samples(samples),
                block: 16,
                ..path(strategy, 2)
            };
            let picture = trial.picture(&scene, [1, height], &settings)?;
            let film = &picture.film;
            let squares = (0..film.len()).map(|p| (film.mean(p)[0] - expected).powi(2));
            let rmse = (squares.sum::<f64>() / f64::from(height)).sqrt();
            errors.push(((samples as f64).ln(), rmse.ln()));
            let mean = (0..film.len()).map(|p| film.mean(p)[0]).sum::<f64>() / f64::from(height);
            last = deviation(
                mean - expected,
                rmse / f64::from(height).sqrt(),
                1e-5 * expected,
            );
        }
        let samples = u64::from(height) * 336;
        trial.note(
            format!("{name}, {strategy:?}"),
            "slope of RMSE is −1/2",
            Figure::absolute((slope(&errors) + 0.5).abs(), 0.03, samples),
        );
        trial.note(
            format!("{name}, {strategy:?}"),
            "Lambert's formula",
            Figure::standard_errors(last, samples),
        );
    }
    Ok(())
}

/// Slope of the line of least squares.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    mean(&|p| (p.0 - x) * (p.1 - y)) / mean(&|p| (p.0 - x).powi(2))
}

/// A floor of half size 2.
fn matte_floor() -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let matte = scene.matter(lambertian(ALBEDO));
    scene.floor(2.0, 0.0, matte);
    scene
}

/// A camera that sees the floor before whatever stands on it.
fn look_at_floor(scene: &mut SceneBuilder) {
    scene.window(
        [0.0, -3.0, 2.0],
        [-1.0, -0.5, 0.0],
        [2.0, 0.0, 0.0],
        [0.0, 1.4, 0.0],
    );
}

/// Lights that touch the floor or a wall, or are themselves closed meshes.
fn touching_scenes() -> Vec<(String, SceneBuilder)> {
    let mut scenes = Vec::new();
    let mut mesh = matte_floor();
    let light = mesh.one_sided(BsdfDescription::Black, 1.0);
    let ball = procedural::icosphere(0.5, 1);
    let positions = ball
        .positions
        .iter()
        .map(|p| *p + DVec3::new(0.0, 0.4, 1.0));
    mesh.mesh(positions.collect(), ball.faces.clone(), light);
    scenes.push(("closed mesh of 80 lights".to_owned(), mesh));
    for gap in [1e-6, 1e-4] {
        scenes.push((format!("light in a wall, gap {gap:e}"), light_in_wall(gap)));
    }
    scenes.push((
        "light in a hole of a wall, gap 0".to_owned(),
        light_in_a_hole(),
    ));
    let mut tangent = matte_floor();
    let light = tangent.one_sided(BsdfDescription::Black, 1.0);
    tangent.sphere([0.0, 0.4, 0.5], 0.5, light);
    scenes.push(("sphere light on the floor".to_owned(), tangent));
    for (_, scene) in &mut scenes {
        look_at_floor(scene);
    }
    scenes
}

/// A floor before a wall, and in the wall's plane but for a gap a light.
fn light_in_wall(gap: f64) -> SceneBuilder {
    let mut scene = matte_floor();
    let wall = scene.matter(lambertian(ALBEDO));
    let light = scene.one_sided(BsdfDescription::Black, 1.0);
    let square = |half: f64, y: f64| {
        [
            [-half, 0.0],
            [half, 0.0],
            [half, 2.0 * half],
            [-half, 2.0 * half],
        ]
        .map(|[x, z]| [x, y, z])
    };
    scene.quad(square(1.0, 1.0), wall);
    scene.quad(square(0.5, 1.0 - gap), light);
    scene
}

/// A floor before a wall, and in a hole of the wall, flush with it, a light.
fn light_in_a_hole() -> SceneBuilder {
    let mut scene = matte_floor();
    let wall = scene.matter(lambertian(ALBEDO));
    let light = scene.one_sided(BsdfDescription::Black, 1.0);
    let part = |[x0, x1]: [f64; 2], [z0, z1]: [f64; 2]| {
        [[x0, z0], [x1, z0], [x1, z1], [x0, z1]].map(|[x, z]| [x, 1.0, z])
    };
    scene.quad(part([-1.0, -0.5], [0.0, 2.0]), wall);
    scene.quad(part([0.5, 1.0], [0.0, 2.0]), wall);
    scene.quad(part([-0.5, 0.5], [1.0, 2.0]), wall);
    scene.quad(part([-0.5, 0.5], [0.0, 1.0]), light);
    scene
}

pub(super) fn light_ends(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(1_024);
    let settings = |strategy: Strategy| RenderSettings {
        budget: Budget::Samples(samples),
        block: 16,
        seed: strategy as u64,
        ..path(strategy, 2)
    };
    for (label, scene) in touching_scenes() {
        let scene = scene.build();
        let mut pictures = Vec::new();
        for strategy in STRATEGIES {
            pictures.push(trial.picture(&scene, [32, 32], &settings(strategy))?);
        }
        let mut worst = 0.0;
        for other in &pictures[1..] {
            worst = max_or_nan(worst, worst_tile(&pictures[0], other));
        }
        trial.note(
            label,
            "MIS = NEE = BSDF, per tile",
            Figure::standard_errors(worst, 3 * 1_024 * samples),
        );
    }
    // A light on a wall, not in a hole of it, and no gap: which of two coincident surfaces a ray meets is not
    // defined, so that only rays which are sent to the light have an answer to be held against.
    let [mut without, mut with] = [0.0, 1e-6].map(light_in_wall);
    look_at_floor(&mut without);
    look_at_floor(&mut with);
    let sampled = trial.picture(&without.build(), [32, 32], &settings(Strategy::Nee))?;
    let expected = trial.picture(&with.build(), [32, 32], &settings(Strategy::Mis))?;
    trial.note(
        "light on a wall, gap 0, NEE: others are undefined",
        "MIS at gap 1e-6, per tile",
        Figure::standard_errors(worst_tile(&expected, &sampled), 2 * 1_024 * samples),
    );
    Ok(())
}

/// Pixels of a tile's side in comparisons of pictures.
const TILE: usize = 8;

/// Largest difference of two pictures' tiles, in its standard errors.
fn worst_tile(a: &Picture, b: &Picture) -> f64 {
    let (width, height) = (a.film.width() as usize, a.film.height() as usize);
    let tiles_across = width / TILE;
    let tile = |picture: &Picture, tile: usize| {
        let (x, y) = (tile % tiles_across * TILE, tile / tiles_across * TILE);
        let pixels = (0..TILE * TILE).map(|i| (y + i / TILE) * width + x + i % TILE);
        pixels.fold((0.0, 0.0), |(mean, variance), pixel| {
            let spread = picture.film.variance(pixel).map_or(f64::NAN, |v| v[0]);
            (mean + picture.film.mean(pixel)[0], variance + spread)
        })
    };
    (0..tiles_across * (height / TILE))
        .map(|i| {
            let ((mean_a, variance_a), (mean_b, variance_b)) = (tile(a, i), tile(b, i));
            let error = (variance_a + variance_b).sqrt();
            deviation(mean_a - mean_b, error, 1e-5 * mean_a.abs())
        })
        .fold(0.0, max_or_nan)
}

pub(super) fn behind_glass(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(400_000);
    let corners = [
        [-0.5, -0.5, 1.0],
        [-0.5, 0.5, 1.0],
        [0.5, 0.5, 1.0],
        [0.5, -0.5, 1.0],
    ];
    let e = oracles::polygon_irradiance(DVec3::ZERO, DVec3::Z, &corners.map(DVec3::from));
    for strategy in [Strategy::Mis, Strategy::Bsdf] {
        // A plate of index 1 is not there, but the light is seen through it alone.
        let mut scene = floor(2.0);
        let light = scene.one_sided(BsdfDescription::Black, 1.0);
        scene.quad(corners, light);
        let nothing = scene.matter(glass(1.0));
        scene.floor(1.9, 0.6, nothing);
        scene.ceiling(1.9, 0.5, nothing);
        let settings = RenderSettings {
            budget: Budget::Samples(samples / 1000),
            block: (samples / 16_000).clamp(1, 64) as u32,
            ..path(strategy, 6)
        };
        let picture = trial.picture(&scene.build(), SIZE, &settings)?;
        trial.note(
            format!("light through glass alone, {strategy:?}"),
            "Lambert's formula",
            figure(&picture, e, 1e-5),
        );
    }
    Ok(())
}

pub(super) fn many_lights(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(400_000);
    let mut scene = floor(60.0);
    let mut e = 0.0;
    for i in 0..5_000 {
        let (x, y) = (f64::from(i % 100) - 49.7, f64::from(i / 100) - 24.7);
        let power = f64::from(1 + i % 7);
        let position = DVec3::new(x, y, 4.0);
        scene.point_light(position.to_array(), power);
        e += power * position.z / position.length().powi(3);
        let light = scene.one_sided(BsdfDescription::Black, power);
        let corners = [[0.1, 0.1], [0.1, 0.4], [0.4, 0.4], [0.4, 0.1]]
            .map(|[dx, dy]| DVec3::new(x + dx, y + dy, 5.0));
        scene.quad(corners.map(|corner| corner.to_array()), light);
        e += power * oracles::polygon_irradiance(DVec3::ZERO, DVec3::Z, &corners);
    }
    let mut view = SceneBuilder::new();
    view.aim([0.0, -30.0, 2.0], [0.0; 3]);
    let mut scene = scene.build();
    scene.cameras = view.build().cameras;
    let picture = direct(trial, &scene, Strategy::Mis, samples)?;
    trial.note(
        "1e4 lights",
        "sum of closed forms",
        figure(&picture, e, 1e-5),
    );
    Ok(())
}

pub(super) fn mis_weights(trial: &mut Trial<'_>) -> Result<()> {
    let lane =
        |a: f32, b: f32| f64::from(power_heuristic(F32s::splat(a), F32s::splat(b)).to_array()[0]);
    let pairs = [
        (1e20, 1e20),
        (1e30, 1.0),
        (f32::INFINITY, 1.0),
        (1e-30, 1e-30),
        (f32::MIN_POSITIVE, f32::MAX),
    ];
    for (a, b) in pairs {
        let sum = lane(a, b) + lane(b, a);
        trial.note(
            format!("densities {a:e} and {b:e}"),
            "weights sum to 1",
            Figure::absolute((sum - 1.0).abs(), 1e-6, 2),
        );
    }
    trial.note(
        "densities 0 and 0",
        "weight 0",
        Figure::absolute(lane(0.0, 0.0).abs(), 0.0, 1),
    );
    Ok(())
}
