//! Path tracing.

use glam::DVec3;

use super::bsdf::Bsdf;
use super::direct::power_heuristic;
use super::light::{Vertex, emitted};
use super::primitives::{Hit, Ray};
use super::random::Random;
use super::{RayCounts, Reference};
use crate::scene::Strategy;

/// How much of the emission that a ray meets counts.
enum EmissionWeight {
    /// All of it: light sampling could not find it.
    Full,
    /// Its share by multiple importance sampling: the ray left this vertex with this density per
    /// solid angle, and light was sampled there as well.
    Shared(Vertex, f64),
    /// Nothing: light sampling found it.
    Zero,
}

impl Reference {
    /// Radiance that arrives against `ray`.
    pub(super) fn path_radiance(
        &self,
        mut ray: Ray,
        random: &mut Random,
        counts: &mut RayCounts,
    ) -> DVec3 {
        let mut radiance = DVec3::ZERO;
        let mut throughput = DVec3::ONE;
        let mut eta_scale = 1.0;
        let mut emission_weight = EmissionWeight::Full;

        for depth in 1..=self.max_depth {
            let Some(hit) = self.trace(&ray, depth, counts) else {
                let share = self.share(&emission_weight, self.background_light, &ray, None);
                let found = throughput * self.background * share;
                return radiance + Self::keep_sound(found, &mut counts.rejected.emission);
            };
            let surface = &self.surfaces[hit.primitive];
            if let Some(emission) = &surface.emission {
                let share = self.share(&emission_weight, surface.light, &ray, Some(&hit));
                let found = throughput * emitted(emission, hit.normal, ray.direction) * share;
                radiance += Self::keep_sound(found, &mut counts.rejected.emission);
            }
            if surface.bsdf.is_none() && surface.is_opaque() {
                return radiance;
            }
            if depth == self.max_depth {
                counts.truncated += 1;
                return radiance;
            }

            let appearance = self.appearance(&hit, ray.direction);
            let direction = if appearance.opacity < 1.0 && random.next() >= appearance.opacity {
                // Shadow rays from before did not come through, so what is found now counts.
                emission_weight = EmissionWeight::Full;
                let straight = Bsdf::straight(surface.bsdf.as_ref(), ray.direction, hit.normal);
                throughput *= straight.weight;
                eta_scale *= straight.eta;
                ray.direction
            } else {
                match &appearance.bsdf {
                    None => return radiance,
                    Some(Bsdf::Lobe(lobe)) => {
                        let vertex = self.vertex(&hit, &appearance);
                        let wo = -ray.direction;
                        let shares = self.strategy == Strategy::Mis;
                        let direct = self.direct_light(&vertex, lobe, wo, shares, random, counts);
                        radiance += throughput * direct;
                        let (wi, weight) = lobe.sample(vertex.normal, wo, random);
                        throughput *= weight;
                        emission_weight = match self.strategy {
                            Strategy::Mis => {
                                EmissionWeight::Shared(vertex, lobe.pdf(vertex.normal, wo, wi))
                            }
                            Strategy::Nee => EmissionWeight::Zero,
                            Strategy::Bsdf => EmissionWeight::Full,
                        };
                        if !appearance.same_side(wi) {
                            return radiance;
                        }
                        wi
                    }
                    Some(Bsdf::Specular(specular)) => {
                        let outward = appearance.outward(&hit);
                        let branch = specular.split(ray.direction, outward).choose(random);
                        throughput *= branch.weight;
                        eta_scale *= branch.eta;
                        emission_weight = match emission_weight {
                            EmissionWeight::Shared(..) | EmissionWeight::Zero
                                if self.transparent_shadows
                                    && branch.is_refracted
                                    && surface.is_opaque() =>
                            {
                                EmissionWeight::Zero
                            }
                            _ => EmissionWeight::Full,
                        };
                        if !appearance.same_side(branch.direction) {
                            return radiance;
                        }
                        branch.direction
                    }
                }
            };

            throughput = Self::keep_sound(throughput, &mut counts.rejected.shade);
            throughput *= self.roulette(throughput, eta_scale, depth, random);
            if throughput == DVec3::ZERO {
                return radiance;
            }
            ray = self.spawn(&hit, direction);
        }
        radiance
    }

    /// How much counts of the emission that `ray` finds at `hit`, or beyond the scene, of what is
    /// this light in the table.
    fn share(
        &self,
        weight: &EmissionWeight,
        light: Option<usize>,
        ray: &Ray,
        hit: Option<&Hit>,
    ) -> f64 {
        match (weight, light) {
            (EmissionWeight::Full, _) | (_, None) => 1.0,
            (EmissionWeight::Zero, _) => 0.0,
            (EmissionWeight::Shared(vertex, pdf), Some(light)) => {
                power_heuristic(*pdf, self.lights.pdf(light, vertex, ray.direction, hit))
            }
        }
    }
}
