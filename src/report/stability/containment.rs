//! Rays that are no rays: they hit nothing, take no longer, and leave their neighbours alone.

use super::closed_meshes::{ClosedMesh, Random};
use super::rays::{Rays, narrow};
use super::trial::{Figure, Trial};
use crate::accel::{self, Structure};
use crate::error::Result;
use crate::geometry::PrimitiveId;

/// Rays within a sphere; every `every`-th of them has a component that is not finite, or no direction.
fn rays(count: u64, every: u64) -> Rays {
    let mut random = Random(13);
    let mut rays = Rays::default();
    for i in 0..count {
        let mut origin = narrow(random.direction() * 0.3);
        let mut direction = narrow(random.direction());
        let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][random.below(3)];
        let (axis, kind) = (random.below(3), random.below(3));
        if every > 0 && i % every == 0 {
            match kind {
                0 => origin[axis] = bad,
                1 => direction[axis] = bad,
                _ => direction = [0.0; 3],
            }
        }
        rays.push(origin, direction, PrimitiveId::NONE);
    }
    rays
}

pub(super) fn invalid_rays(trial: &mut Trial<'_>) -> Result<()> {
    let mesh = ClosedMesh::sphere(8, 4);
    let count = trial.count(40_000);
    let (sound, mixed, unsound) = (rays(count, 0), rays(count, 3), rays(count, 1));
    trial.on_structures(
        "origin or direction NaN, ±inf or 0",
        "no hit",
        |_, structure| {
            let accel = accel::build(structure, &mesh.geometry)?;
            let hits = unsound.closest(&*accel);
            let wrong = hits.iter().filter(|hit| hit.1 != PrimitiveId::NONE);
            Ok(Figure::none_of(wrong.count() as u64, count))
        },
    )?;
    trial.on_structures(
        "a third of a batch unsound",
        "the others as alone",
        |_, structure| {
            let accel = accel::build(structure, &mesh.geometry)?;
            let (alone, among) = (sound.closest(&*accel), mixed.closest(&*accel));
            let others = (0..alone.len()).filter(|i| i % 3 != 0);
            let wrong = others.filter(|&i| alone[i] != among[i]);
            Ok(Figure::none_of(wrong.count() as u64, count))
        },
    )?;
    // The scan has nothing to leave out for a ray that meets no box, and is left out itself.
    let trees: Vec<Structure> = trial
        .structures
        .iter()
        .copied()
        .filter(|&structure| structure != Structure::Linear)
        .collect();
    trial.on(
        &trees,
        "batch of unsound rays",
        "time of sound ones",
        |_, structure| {
            let accel = accel::build(structure, &mesh.geometry)?;
            // The best of a few, in turns: the machine has other work too.
            let [mut good, mut bad] = [f64::INFINITY; 2];
            for _ in 0..5 {
                good = good.min(sound.seconds(&*accel));
                bad = bad.min(unsound.seconds(&*accel));
            }
            Ok(Figure::time_ratio(bad / good, 2.5, count))
        },
    )
}
