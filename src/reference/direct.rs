//! Light that arrives without a detour.

use glam::DVec3;

use super::appearance::same_side;
use super::bsdf::{Bsdf, Lobe};
use super::light::{LightSample, Vertex};
use super::primitives::Ray;
use super::random::Random;
use super::specular::Specular;
use super::{RayCounts, Reference};

/// How much of a light is seen.
struct Visibility {
    /// In [0, 1].
    transmittance: f64,
    /// Whether glass is in the way.
    through_glass: bool,
}

/// Share of strategy `a` in the power heuristic for two strategies (Veach 1997, 9.2.4), densities
/// in the same measure. As a ratio it neither overflows nor underflows.
pub(super) fn power_heuristic(a: f64, b: f64) -> f64 {
    if a > b {
        1.0 / (1.0 + (b / a).powi(2))
    } else {
        let ratio = if b > 0.0 { a / b } else { 0.0 };
        ratio * ratio / (1.0 + ratio * ratio)
    }
}

impl Reference {
    /// Radiance towards the unit vector `wo` by one shadow ray to one light. With
    /// `shares_with_directions` it is the part that multiple importance sampling leaves to light
    /// sampling, else all of it.
    pub(super) fn direct_light(
        &self,
        vertex: &Vertex,
        lobe: &Lobe,
        wo: DVec3,
        shares_with_directions: bool,
        random: &mut Random,
        counts: &mut RayCounts,
    ) -> DVec3 {
        let Some(light) = self.lights.sample(vertex, random) else {
            return DVec3::ZERO;
        };
        if !same_side(vertex.face, vertex.normal, light.direction) {
            return DVec3::ZERO;
        }
        let value = lobe.eval(vertex.normal, wo, light.direction);
        if value == DVec3::ZERO {
            return DVec3::ZERO;
        }
        counts.shadow += 1;
        let visibility = self.visibility(vertex, &light);
        let weight = if shares_with_directions && !light.is_delta && !visibility.through_glass {
            power_heuristic(light.pdf, lobe.pdf(vertex.normal, wo, light.direction))
        } else {
            1.0
        };
        let cos = vertex.normal.dot(light.direction);
        let arriving = light.radiance * (cos * weight * visibility.transmittance / light.pdf);
        Self::keep_sound(value * arriving, &mut counts.rejected.connect)
    }

    fn visibility(&self, vertex: &Vertex, light: &LightSample) -> Visibility {
        let ray = Ray {
            origin: vertex.point,
            direction: light.direction,
            t_min: 0.0,
            start: self.left_behind(vertex.patch),
        };
        let mut through_glass = false;
        let mut transmittance = 1.0;
        let open = self
            .primitives
            .all_pass(&ray, light.distance, |primitive, t| {
                let surface = &self.surfaces[primitive];
                let Some(Bsdf::Specular(Specular::Dielectric(glass))) = surface.bsdf else {
                    return false;
                };
                if !self.transparent_shadows || !surface.is_opaque() {
                    return false;
                }
                let normal = self
                    .primitives
                    .normal(primitive, ray.origin + ray.direction * t);
                through_glass = true;
                transmittance *= 1.0 - glass.split(ray.direction, normal).reflectance;
                transmittance > 0.0
            });
        Visibility {
            transmittance: if open { transmittance } else { 0.0 },
            through_glass,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::power_heuristic;

    #[test]
    fn shares_of_two_strategies_add_to_one_at_any_size() {
        for (a, b) in [
            (1.0, 2.0),
            (1e200, 1e200),
            (1e300, 1.0),
            (1e-200, 1e-200),
            (0.0, 3.0),
        ] {
            let sum = power_heuristic(a, b) + power_heuristic(b, a);
            assert!((sum - 1.0).abs() < 1e-15, "{a}, {b}: {sum}");
        }
        assert_eq!(power_heuristic(1.0, 2.0), 0.2);
        assert_eq!(power_heuristic(0.0, 0.0), 0.0);
    }
}
