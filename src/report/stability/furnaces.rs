//! Closed rooms that glow, of which the radiance is known everywhere.

use glam::DVec3;

use super::oracles;
use super::renders::{kind, path};
use super::scenes::{SceneBuilder, glowing_room, lambertian, mirror};
use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::scene::{BsdfDescription, Budget, RenderSettings, Strategy};

/// Pixels of a picture's side.
const SIDE: u32 = 16;

/// Materials of which every sample of a furnace is the mean, at this albedo.
fn without_variance(albedo: f64) -> [(&'static str, BsdfDescription); 3] {
    let rough = BsdfDescription::OrenNayar {
        reflectance: DVec3::splat(albedo),
        sigma: 0.0,
    };
    [
        ("Lambert", lambertian(albedo)),
        ("Oren–Nayar σ 0", rough),
        ("mirror", mirror(albedo)),
    ]
}

/// The albedo as the kernels have it: beyond roundings of paths, not of the number.
fn rounded(albedo: f64) -> f64 {
    f64::from(albedo as f32)
}

pub(super) fn exact(trial: &mut Trial<'_>) -> Result<()> {
    for albedo in [0.0, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0] {
        for depth in [1, 2, 6, 20, 65] {
            if depth < 65 && albedo > 0.0 && albedo < 0.9 && albedo != 0.5 {
                continue;
            }
            let expected = oracles::furnace(rounded(albedo), depth - 1);
            trial.on_structures(
                format!("albedo {albedo}, {} bounces", depth - 1),
                "(1 − ρⁿ⁺¹)/(1 − ρ), every pixel",
                |trial, structure| {
                    let settings = RenderSettings {
                        accel: kind(structure),
                        budget: Budget::Samples(1),
                        ..path(Strategy::Bsdf, depth)
                    };
                    let mut worst = 0.0f64;
                    let mut samples = 0;
                    for (_, bsdf) in without_variance(albedo) {
                        for is_sphere in [false, true] {
                            let scene = glowing_room(bsdf, 1.0, DVec3::ZERO, is_sphere).build();
                            let picture = trial.picture(&scene, [SIDE; 2], &settings)?;
                            worst = worst.max(picture.worst_pixel(expected));
                            samples += picture.film.total_samples();
                        }
                    }
                    Ok(Figure::relative(worst, 1e-6, samples))
                },
            )?;
        }
    }
    Ok(())
}

pub(super) fn scaled(trial: &mut Trial<'_>) -> Result<()> {
    let sizes = [1e-12, 1e-6, 1e-3, 1.0, 1e3, 1e7, 1e18].map(|size| (size, 0.0));
    let places = [1e3, 1e4, 1e5, 1e6].map(|far| (1.0, far));
    let depth = 20;
    for (size, far) in sizes.into_iter().chain(places) {
        let place = far * DVec3::new(1.0, -0.3, 0.7);
        trial.on_structures(
            format!("size {size:e} at {far:e}, albedo 0.5"),
            "2, every pixel",
            |trial, structure| {
                let settings = RenderSettings {
                    accel: kind(structure),
                    budget: Budget::Samples(4),
                    ..path(Strategy::Bsdf, depth)
                };
                let mut worst = 0.0f64;
                for is_sphere in [false, true] {
                    let scene = glowing_room(lambertian(0.5), size, place, is_sphere).build();
                    let picture = trial.picture(&scene, [SIDE; 2], &settings)?;
                    worst = worst.max(picture.worst_pixel(oracles::furnace(0.5, depth - 1)));
                }
                Ok(Figure::relative(worst, 1e-6, u64::from(8 * SIDE * SIDE)))
            },
        )?;
    }
    Ok(())
}

pub(super) fn lit(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(256);
    for strategy in [Strategy::Mis, Strategy::Nee] {
        for (name, bsdf) in without_variance(0.5) {
            for is_sphere in [false, true] {
                let mut scene = glowing_room(bsdf, 1.0, DVec3::ZERO, is_sphere).build();
                // Light sampling sees the background too; leaks are the business of other cases.
                scene.background = DVec3::ZERO;
                let settings = RenderSettings {
                    budget: Budget::Samples(samples),
                    block: samples.div_ceil(16).min(64) as u32,
                    ..path(strategy, 12)
                };
                let picture = trial.picture(&scene, [SIDE; 2], &settings)?;
                let shape = if is_sphere { "sphere" } else { "cube" };
                trial.note(
                    format!("{shape} of {name}, {strategy:?}"),
                    "(1 − ρⁿ⁺¹)/(1 − ρ)",
                    Figure::standard_errors(
                        picture.deviation(oracles::furnace(0.5, 11)),
                        picture.film.total_samples(),
                    ),
                );
            }
        }
    }
    Ok(())
}

pub(super) fn long_paths(trial: &mut Trial<'_>) -> Result<()> {
    // Every mirror adds its emission, to any depth.
    for depth in [1_000, 10_001] {
        let scene = glowing_room(mirror(1.0), 1.0, DVec3::ZERO, true).build();
        let settings = RenderSettings {
            budget: Budget::Samples(1),
            ..path(Strategy::Bsdf, depth)
        };
        let picture = trial.picture(&scene, [8, 8], &settings)?;
        let samples = picture.film.total_samples();
        trial.note(
            format!("{} perfect reflections", depth - 1),
            "n + 1, every pixel",
            Figure::relative(picture.worst_pixel(f64::from(depth)), 1e-6, samples),
        );
        let stats = &picture.stats;
        let miscounted =
            stats.rays().abs_diff(u64::from(depth) * samples) + stats.truncated.abs_diff(samples);
        trial.note(
            format!("{} perfect reflections", depth - 1),
            "cut paths and rays counted",
            Figure::none_of(miscounted, samples),
        );
    }
    mirror_hall(trial)
}

/// Two perfect mirrors and between them, far down the hall, a wall that emits 1: all of it arrives, after
/// 10⁴ reflections and more, and in the mean also where roulette ends most paths.
fn mirror_hall(trial: &mut Trial<'_>) -> Result<()> {
    for (reflections, roulette_depth, samples) in
        [(20_000, u32::MAX, 1), (300, 5, trial.count(4_096))]
    {
        let mut scene = SceneBuilder::new();
        let wall = scene.matter(mirror(1.0));
        let light = scene.two_sided(BsdfDescription::Black, 1.0);
        let length = 10.0;
        scene.floor(2.0 * length, 0.0, wall);
        scene.ceiling(2.0 * length, 1.0, wall);
        scene.quad(
            [
                [length, -length, 0.0],
                [length, length, 0.0],
                [length, length, 1.0],
                [length, -length, 1.0],
            ],
            light,
        );
        let slope = f64::from(reflections) / length;
        scene.aim([0.0, 0.0, 0.5], [1e-3, 0.0, 0.5 + 1e-3 * slope]);
        let settings = RenderSettings {
            budget: Budget::Samples(samples),
            roulette_depth,
            max_depth: None,
            ..path(Strategy::Mis, 1)
        };
        let picture = trial.picture(&scene.build(), [8, 8], &settings)?;
        let taken = picture.film.total_samples();
        let (label, oracle) = (
            format!("hall of {reflections} reflections"),
            "all light arrives",
        );
        if samples == 1 {
            let figure = Figure::relative(picture.worst_pixel(1.0), 1e-6, taken);
            trial.note(label, oracle, figure);
        } else {
            let figure = Figure::standard_errors(picture.deviation(1.0), taken);
            trial.note(format!("{label}, roulette"), oracle, figure);
        }
    }
    Ok(())
}
