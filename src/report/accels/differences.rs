//! How answers differ from those of a brute-force scan, and which differences rounding explains.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::rays::RaySet;
use super::rounds::Answers;
use super::scan::Hit;
use crate::geometry::{Geometry, PrimitiveId};
use crate::math::float::gamma;

/// Counts over a sample of a ray set.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Differences {
    /// Rays compared.
    pub rays: u64,
    /// Another primitive at the same distance, as on a shared edge, or a shadow ray that ends on the
    /// primitive in question: no error. "Same" is within [`rounding`].
    pub ties: u64,
    /// All other differences.
    pub differing: u64,
}

/// The nearest hits of a sample, by a scan over all primitives, against which answers are held.
#[derive(Debug)]
pub(super) struct Reference {
    /// The sample.
    pub(super) rays: RaySet,
    /// Nearest hit of each ray, for shadow rays wherever they end.
    pub(super) hits: Vec<Hit>,
}

impl Reference {
    /// Counts in what the answers to the same sample differ.
    pub(super) fn compare(&self, geometry: &Geometry, answers: &Answers) -> Differences {
        let mut differences = Differences {
            rays: self.rays.len() as u64,
            ..Differences::default()
        };
        for (number, &(t, primitive)) in self.hits.iter().enumerate() {
            let ray = self.rays.ray(number);
            // What the distance is to be compared with, and whose rounding matters beside its own.
            let (same, distance, other) = match answers {
                Answers::Closest(hits) => {
                    (hits[number].1 == primitive, hits[number].0, hits[number].1)
                }
                Answers::Occluded(blocked) => (blocked[number] == (t < ray.2), ray.2, primitive),
            };
            if same {
                continue;
            }
            let slack = [primitive, other]
                .map(|id| rounding(geometry, ray, id))
                .into_iter()
                .fold(0.0, f64::max);
            if (f64::from(t) - f64::from(distance)).abs() <= slack {
                differences.ties += 1;
            } else {
                differences.differing += 1;
            }
        }
        differences
    }
}

/// Bound of the difference between two distances, calculated by whichever of the usual tests in f32,
/// at which a ray meets a primitive: 0 for none.
///
/// A test sees the corners p relative to the origin o, rounded, and calculates with products and sums
/// of them: as if each corner had moved by at most γ(8)·|p − o| (summed over axes), which moves the
/// point where the ray meets the plane by that over the cosine of incidence. Two tests differ by twice
/// that. For spheres, whose centre and radius take the place of corners, likewise.
pub fn rounding(
    geometry: &Geometry,
    (origin, direction, _): ([f32; 3], [f32; 3], f32),
    primitive: u32,
) -> f64 {
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let (origin, direction) = (vector(origin), vector(direction));
    let reach = |v: DVec3| v.abs().element_sum();
    if primitive == PrimitiveId::NONE {
        return 0.0;
    }
    let index = primitive as usize;
    let (reach, cosine) = match geometry.triangles.get(index) {
        Some(triangle) => {
            let [a, b, c] = triangle.corners.map(|corner| vector(corner) - origin);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let reach = reach(a).max(reach(b)).max(reach(c));
            (reach, normal.dot(direction).abs())
        }
        None => {
            let sphere = &geometry.spheres[index - geometry.triangles.len()];
            let (arm, radius) = (vector(sphere.center) - origin, f64::from(sphere.radius));
            let off = arm - arm.dot(direction) * direction;
            let cosine = (1.0 - (off.length() / radius).powi(2)).max(0.0).sqrt();
            (reach(arm) + radius, cosine)
        }
    };
    2.0 * f64::from(gamma(8)) * reach / cosine
}
