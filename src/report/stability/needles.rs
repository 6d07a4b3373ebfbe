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
    let count = trial.count(20_000);
    for aspect in [1.0, 10.0, 1e3, 1e5, 1e7] {
        for degrees in [30.0, 0.5, 0.01] {
            let label = format!("aspect {aspect:e}, {degrees}° to the plane");
            let (geometry, rays, distances) = needle_rays(aspect, degrees, count);
            // A ray within rounding of the plane may be a miss; a hit must be where the needle is.
            let oracle = "f64; off by 2 sizes";
            trial.on_structures(label, oracle, |_, structure| {
                let accel = accel::build(structure, &geometry)?;
                let hits = nearest_of_own(&*accel, &rays);
                let wrong = hits.iter().zip(&distances).filter(|(hit, t)| {
                    hit.is_some_and(|hit| (f64::from(hit) - **t).abs() > 2.0 * EDGE)
                });
                Ok(Figure::none_of(wrong.count() as u64, count))
            })?;
        }
    }
    Ok(())
}

/// Length of a needle.
const EDGE: f64 = 10.0;
/// How far away rays to needles start.
const AWAY: f64 = 100.0;

/// Needles far apart, and for each a ray to a point of it at this angle to its plane, with the distance.
fn needle_rays(aspect: f64, degrees: f64, count: u64) -> (Geometry, Rays, Vec<f64>) {
    let mut random = Random(23);
    let (mut triangles, mut rays, mut distances) = (Vec::new(), Rays::default(), Vec::new());
    let (sin, cos) = f64::to_radians(degrees).sin_cos();
    for _ in 0..count.min(2_000) {
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
        distances.push(AWAY);
    }
    let geometry = Geometry {
        triangles,
        ..Geometry::default()
    };
    (geometry, rays, distances)
}

/// The hit of each ray, if it is of the needle that the ray was aimed at.
fn nearest_of_own(accel: &dyn Accel, aimed: &Rays) -> Vec<Option<f32>> {
    let mut rays = Rays::default();
    for i in 0..aimed.len() {
        let [origin, direction] = aimed.ray(i);
        rays.push(origin, direction, PrimitiveId::NONE);
    }
    let hits = rays.closest(accel);
    (0..aimed.len())
        .map(|i| (hits[i].1 == aimed.skip(i)).then_some(hits[i].0))
        .collect()
}
