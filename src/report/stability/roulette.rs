//! Ends of paths: roulette is unbiased, and ends what nothing else would.

use glam::DVec3;

use super::renders::{deviation, endless, max_or_nan};
use super::scenes::{SceneBuilder, glowing_room, lambertian, mirror};
use super::trial::{Figure, Trial};
use crate::error::Result;
use crate::scene::{Budget, RenderSettings, Strategy};

pub(super) fn unbiased(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(512);
    for albedo in [0.5, 0.9, 0.99] {
        let scene = glowing_room(lambertian(albedo), 1.0, DVec3::ZERO, true).build();
        let settings = RenderSettings {
            roulette_depth: 1,
            budget: Budget::Samples(samples),
            block: samples.div_ceil(16).min(64) as u32,
            ..endless(Strategy::Bsdf)
        };
        let picture = trial.picture(&scene, [32, 32], &settings)?;
        let paths = picture.stats.paths;
        trial.note(
            format!("albedo {albedo}, roulette from the first hit"),
            "1/(1 − ρ)",
            Figure::standard_errors(picture.deviation(1.0 / (1.0 - albedo)), paths),
        );
        // Geometric: a path goes on with probability ρ at each hit.
        let length = picture.stats.rays() as f64 / paths as f64;
        let error = albedo.sqrt() / (1.0 - albedo) / (paths as f64).sqrt();
        let off = deviation(length - 1.0 / (1.0 - albedo), error, 0.0);
        trial.note(
            format!("albedo {albedo}, roulette from the first hit"),
            "segments per path 1/(1 − ρ)",
            Figure::standard_errors(off, paths),
        );
    }
    Ok(())
}

pub(super) fn perfect_mirrors(trial: &mut Trial<'_>) -> Result<()> {
    let samples = trial.count(64);
    let mut scene = SceneBuilder::new();
    let wall = scene.matter(mirror(1.0));
    scene.sphere([0.0; 3], 1.0, wall);
    scene.aim([0.1, 0.2, 0.3], [0.4, 0.4, 0.9]);
    let first = 5;
    let settings = RenderSettings {
        roulette_depth: first,
        budget: Budget::Samples(samples),
        ..endless(Strategy::Mis)
    };
    let picture = trial.picture(&scene.build(), [16, 16], &settings)?;
    let paths = picture.stats.paths;
    trial.note(
        "closed hall, albedo 1, no depth limit",
        "black",
        Figure::absolute(picture.worst_pixel(0.0), 0.0, paths),
    );
    // Survival is 0.99 from the fifth segment on: 5 + 99 segments, with a deviation of √0.99/0.01.
    let length = picture.stats.rays() as f64 / paths as f64;
    let error = 0.99f64.sqrt() / 0.01 / (paths as f64).sqrt();
    trial.note(
        "closed hall, albedo 1, no depth limit",
        "104 segments per path",
        Figure::standard_errors(deviation(length - 104.0, error, 0.0), paths),
    );
    Ok(())
}

pub(super) fn denormals(trial: &mut Trial<'_>) -> Result<()> {
    // Throughput falls below the smallest normal number after 126 bounces, below any after 149.
    let samples = trial.count(64);
    // With the sum of what every bounce adds.
    let cases = [(1.0, 400.0), (0.5, 2.0)];
    let (mut seconds, mut worst) = ([f64::INFINITY; 2], 0.0);
    for _ in 0..3 {
        for ((albedo, expected), seconds) in cases.into_iter().zip(&mut seconds) {
            let scene = glowing_room(lambertian(albedo), 1.0, DVec3::ZERO, true).build();
            let settings = RenderSettings {
                max_depth: Some(400),
                budget: Budget::Samples(samples),
                ..endless(Strategy::Bsdf)
            };
            let picture = trial.picture(&scene, [8, 8], &settings)?;
            // Of a ray, since what carries nothing may end.
            let per_ray = picture.stats.cpu_seconds / picture.stats.rays() as f64;
            *seconds = seconds.min(per_ray);
            worst = max_or_nan(worst, picture.worst_pixel(expected));
        }
    }
    trial.note(
        "400 bounces of albedo 1 and 0.5",
        "400 and 2, every pixel",
        Figure::relative(worst, 1e-6, 6 * 64 * samples),
    );
    let ratio = seconds[1] / seconds[0];
    trial.note(
        "400 bounces of albedo 0.5",
        "time per ray at albedo 1",
        Figure::time_ratio(ratio, 2.0, 6 * 64 * samples),
    );
    Ok(())
}
