//! How answers differ from those of a brute-force scan, and which differences rounding explains.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::rays::RaySet;
use super::rounds::Answers;
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

/// The scan's answers to a sample, against which others are held.
#[derive(Debug)]
pub struct Reference {
    /// The sample.
    pub rays: RaySet,
    /// The scan's answers.
    pub answers: Answers,
    /// Of shadow rays, the closest hits on the unbounded rays; otherwise empty.
    pub beyond: Vec<(f32, u32)>,
}

impl Reference {
    /// Counts in what `answers` to the same sample differ.
    ///
    /// # Panics
    /// If they are answers to another kind or number of rays.
    pub fn compare(&self, geometry: &Geometry, answers: &Answers) -> Differences {
        let mut differences = Differences {
            rays: self.rays.len() as u64,
            ..Differences::default()
        };
        let mut count = |ray, same: bool, tie: &dyn Fn(usize) -> bool| match (same, tie) {
            (true, _) => {}
            (false, tie) if tie(ray) => differences.ties += 1,
            (false, _) => differences.differing += 1,
        };
        match (&self.answers, answers) {
            (Answers::Closest(ours), Answers::Closest(theirs)) => {
                assert_eq!(ours.len(), theirs.len(), "the same rays");
                for (ray, (&a, &b)) in ours.iter().zip(theirs).enumerate() {
                    count(ray, a.1 == b.1, &|ray| {
                        let ray = self.rays.ray(ray);
                        let slack = rounding(geometry, ray, a.1).max(rounding(geometry, ray, b.1));
                        (f64::from(a.0) - f64::from(b.0)).abs() <= slack
                    });
                }
            }
            (Answers::Occluded(ours), Answers::Occluded(theirs)) => {
                assert_eq!(ours.len(), theirs.len(), "the same rays");
                for (ray, (&a, &b)) in ours.iter().zip(theirs).enumerate() {
                    count(ray, a == b, &|ray| {
                        let (t, primitive) = self.beyond[ray];
                        let ray = self.rays.ray(ray);
                        (f64::from(t) - f64::from(ray.2)).abs()
                            <= rounding(geometry, ray, primitive)
                    });
                }
            }
            _ => unreachable!("answers to the same rays are of the same kind"),
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
