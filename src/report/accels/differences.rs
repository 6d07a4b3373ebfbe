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
    /// No errors, within [`rounding`]: another primitive at the same distance, as on a shared edge or
    /// where a polygon is one primitive for several; a shadow ray that ends on the primitive in
    /// question; a ray that starts on it.
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
        for (number, &scanned) in self.hits.iter().enumerate() {
            let ray = self.rays.ray(number);
            let end = ray.2;
            // What the scan's distance is held against, and the primitive there.
            let (same, other) = match answers {
                Answers::Closest(hits) => (hits[number].1 == scanned.1, hits[number]),
                Answers::Occluded(blocked) => {
                    (blocked[number] == (scanned.0 < end), (end, scanned.1))
                }
            };
            if same {
                continue;
            }
            let rounding = |(_, primitive): Hit| rounding(geometry, ray, primitive);
            let nearer = if scanned.0 <= other.0 { scanned } else { other };
            let apart = (f64::from(scanned.0) - f64::from(other.0)).abs();
            if apart <= rounding(scanned).max(rounding(other))
                || f64::from(nearer.0) <= rounding(nearer)
            {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Triangle;
    use crate::report::accels::rays::RayKind;

    /// Rays down the z axis from z = 0 through (0.25, 0.25).
    const RAY: ([f32; 3], [f32; 3]) = ([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]);

    /// Parallel triangles across the axis, at these heights.
    fn layers(heights: &[f32]) -> Geometry {
        let triangles = heights.iter().map(|&z| Triangle {
            corners: [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]],
        });
        Geometry {
            triangles: triangles.collect(),
            ..Geometry::default()
        }
    }

    fn compare(
        kind: RayKind,
        end: f32,
        heights: &[f32],
        hit: Hit,
        answers: &Answers,
    ) -> Differences {
        let reference = Reference {
            rays: RaySet::of(kind, &[(RAY.0, RAY.1, end)]),
            hits: vec![hit],
        };
        reference.compare(&layers(heights), answers)
    }

    /// (ties, differing) of one closest hit against the scan's.
    fn closest(heights: &[f32], hit: Hit, other: Hit) -> (u64, u64) {
        let answers = Answers::Closest(vec![other]);
        let found = compare(RayKind::Diffuse, f32::INFINITY, heights, hit, &answers);
        assert_eq!(found.rays, 1);
        (found.ties, found.differing)
    }

    fn shadow(heights: &[f32], end: f32, hit: Hit, blocked: bool) -> (u64, u64) {
        let answers = Answers::Occluded(vec![blocked]);
        let found = compare(RayKind::Shadow, end, heights, hit, &answers);
        (found.ties, found.differing)
    }

    const MISS: Hit = (f32::INFINITY, PrimitiveId::NONE);

    #[test]
    fn the_same_primitive_is_no_difference_and_a_lost_hit_is_one() {
        assert_eq!(closest(&[2.0], (2.0, 0), (2.0, 0)), (0, 0));
        assert_eq!(closest(&[2.0], MISS, MISS), (0, 0));
        assert_eq!(closest(&[2.0], (2.0, 0), MISS), (0, 1));
        assert_eq!(closest(&[2.0], MISS, (2.0, 0)), (0, 1));
    }

    #[test]
    fn another_primitive_is_a_tie_up_to_rounding_and_a_difference_beyond() {
        let next = 2.0f32.next_up();
        assert_eq!(closest(&[2.0, next], (2.0, 0), (next, 1)), (1, 0));
        let far = 2.0 * (1.0 + 40.0 * gamma(8));
        assert_eq!(closest(&[2.0, far], (2.0, 0), (far, 1)), (0, 1));
        assert_eq!(closest(&[2.0, 3.0], (2.0, 0), (3.0, 1)), (0, 1));
    }

    #[test]
    fn a_hit_where_the_ray_starts_is_a_tie() {
        assert_eq!(closest(&[1e-9, 3.0], (1e-9, 0), (3.0, 1)), (1, 0));
        assert_eq!(closest(&[1e-9, 3.0], (3.0, 1), (1e-9, 0)), (1, 0));
        assert_eq!(closest(&[1e-3, 3.0], (1e-3, 0), (3.0, 1)), (0, 1));
    }

    #[test]
    fn occlusion_differs_unless_the_segment_ends_where_the_hit_is() {
        assert_eq!(shadow(&[2.0], 3.0, (2.0, 0), true), (0, 0));
        assert_eq!(shadow(&[2.0], 1.0, (2.0, 0), false), (0, 0));
        assert_eq!(shadow(&[2.0], 3.0, (2.0, 0), false), (0, 1));
        assert_eq!(shadow(&[2.0], 1.0, (2.0, 0), true), (0, 1));
        assert_eq!(shadow(&[2.0], 2.0f32.next_up(), (2.0, 0), false), (1, 0));
        assert_eq!(shadow(&[2.0], 2.0, (2.0, 0), true), (1, 0));
        assert_eq!(shadow(&[2.0], f32::INFINITY, MISS, true), (0, 1));
    }

    #[test]
    fn rounding_grows_with_distance_and_towards_grazing() {
        let geometry = layers(&[2.0]);
        let at = |origin, direction| rounding(&geometry, (origin, direction, f32::INFINITY), 0);
        let near = at(RAY.0, RAY.1);
        assert!(near > 0.0 && near < 2e-5, "{near}");
        assert!(at([0.25, 0.25, -100.0], RAY.1) > 20.0 * near);
        assert!(at(RAY.0, [0.8, 0.0, 0.6]) > 1.5 * near);
        assert_eq!(
            rounding(&geometry, (RAY.0, RAY.1, 1.0), PrimitiveId::NONE),
            0.0
        );
    }
}
