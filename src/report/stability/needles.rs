//! Triangles as thin as needles, seen at grazing angles.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::DVec3;

use super::closed_meshes::Random;
use super::rays::{Rays, narrow, wide};
use super::trial::{Figure, Trial};
use crate::accel::{self, Accel};
use crate::error::Result;
use crate::geometry::{Geometry, PrimitiveId, Triangle};

pub(super) fn needles(trial: &mut Trial<'_>) -> Result<()> {
    let count = trial.count(2_000);
    for aspect in [1.0, 10.0, 1e3, 1e5, 1e7] {
        for degrees in [30.0, 0.5, 0.01] {
            let label = format!("aspect {aspect:e}, {degrees}° to the plane");
            let (geometry, rays) = needle_rays(aspect, degrees, count);
            let samples = rays.len() as u64;
            // Nearly in its plane a needle may be missed; what is hit must be where the needle is.
            let mut worst = Vec::new();
            trial.on_structures(&*label, "f64: t within 2 sizes", |_, structure| {
                let accel = accel::build(structure, &geometry)?;
                let errors = errors_of_own(&*accel, &rays);
                let wrong = errors.iter().filter(|error| **error > 2.0 * EDGE).count();
                let unseen = u64::from(degrees == 30.0 && aspect <= 1e3 && errors.is_empty());
                worst.push(errors.into_iter().fold(0.0, f64::max));
                Ok(Figure::none_of(wrong as u64 + unseen, samples))
            })?;
            if aspect == 1e5 && degrees == 0.01 {
                let mut worst = worst.into_iter();
                trial.on_structures(label, "f64: largest error of t", |_, _| {
                    let error = worst.next().unwrap_or(f64::NAN);
                    Ok(Figure::absolute(error, 1.0, samples))
                })?;
            }
        }
    }
    Ok(())
}

/// Length of a needle.
const EDGE: f64 = 10.0;
/// How far away rays to needles start.
const AWAY: f64 = 100.0;

/// Needles, and for each a ray to a point of it at this angle to its plane from [`AWAY`].
fn needle_rays(aspect: f64, degrees: f64, count: u64) -> (Geometry, Rays) {
    let mut random = Random(23);
    let (mut triangles, mut rays) = (Vec::new(), Rays::default());
    let (sin, cos) = f64::to_radians(degrees).sin_cos();
    for _ in 0..count {
        let along = random.direction();
        let normal = along.cross(random.direction()).normalize();
        let across = normal.cross(along);
        let a = random.direction() * 20.0;
        let corners = [a, a + EDGE * along, a + EDGE / aspect * across];
        let corners = corners.map(|p| p.as_vec3().to_array());
        let [a, b, c] = corners.map(wide);
        if (b - a).cross(c - a) == DVec3::ZERO {
            continue;
        }
        let (u, v) = (random.uniform(), random.uniform());
        let (u, v) = if u + v > 1.0 {
            (1.0 - u, 1.0 - v)
        } else {
            (u, v)
        };
        let target = a + u * (b - a) + v * (c - a);
        let slanted = (along + across) * FRAC_1_SQRT_2;
        let direction = cos * slanted + sin * normal;
        let id = triangles.len() as u32;
        triangles.push(Triangle { corners });
        // Kept beside the ray: whose needle it is aimed at.
        rays.push(narrow(target - AWAY * direction), narrow(direction), id);
    }
    let geometry = Geometry {
        triangles,
        ..Geometry::default()
    };
    (geometry, rays)
}

/// By how much the distances of hits are off, of the rays that hit the needle that they were aimed at.
fn errors_of_own(accel: &dyn Accel, aimed: &Rays) -> Vec<f64> {
    let mut rays = Rays::default();
    for i in 0..aimed.len() {
        let [origin, direction] = aimed.ray(i);
        rays.push(origin, direction, PrimitiveId::NONE);
    }
    let hits = rays.closest(accel);
    (0..aimed.len())
        .filter(|&i| hits[i].1 == aimed.skip(i))
        .map(|i| (f64::from(hits[i].0) - AWAY).abs())
        .collect()
}
