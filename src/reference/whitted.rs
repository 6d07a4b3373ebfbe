//! Whitted's method (1980): mirrors and glass are followed, other surfaces get direct light alone.

use glam::DVec3;

use super::bsdf::Bsdf;
use super::light::emitted;
use super::primitives::{Hit, Ray};
use super::random::Random;
use super::specular::Branch;
use super::{RayCounts, Reference};

/// Splits at glass along one path after which a single branch is followed, chosen at random.
const MAX_SPLITS: u32 = 4;

/// A ray and what led to it.
#[derive(Debug, Clone, Copy)]
struct Path {
    ray: Ray,
    /// Segment number of the ray.
    depth: u32,
    throughput: DVec3,
    /// Product of the refraction indices' ratios.
    eta_scale: f64,
    /// Times that glass has split it in two.
    splits: u32,
}

impl Reference {
    /// Radiance that arrives against `ray`.
    pub(super) fn whitted_radiance(
        &self,
        ray: Ray,
        random: &mut Random,
        counts: &mut RayCounts,
    ) -> DVec3 {
        let path = Path {
            ray,
            depth: 1,
            throughput: DVec3::ONE,
            eta_scale: 1.0,
            splits: 0,
        };
        self.follow(path, random, counts)
    }

    /// Radiance that a path finds, times its throughput. A loop along the path and a recursion at
    /// each of its splits.
    fn follow(&self, mut path: Path, random: &mut Random, counts: &mut RayCounts) -> DVec3 {
        let mut radiance = DVec3::ZERO;
        while path.throughput != DVec3::ZERO && path.depth <= self.max_depth {
            let direction = path.ray.direction;
            let Some(hit) = self.trace(&path.ray, path.depth, counts) else {
                let found = path.throughput * self.background;
                return radiance + Self::keep_sound(found, &mut counts.rejected.emission);
            };
            let surface = &self.surfaces[hit.primitive];
            if let Some(emission) = &surface.emission {
                let found = path.throughput * emitted(emission, hit.normal, direction);
                radiance += Self::keep_sound(found, &mut counts.rejected.emission);
            }
            if surface.bsdf.is_none() && surface.is_opaque() {
                return radiance;
            }
            if path.depth == self.max_depth {
                counts.truncated += 1;
                return radiance;
            }

            let appearance = self.appearance(&hit, direction);
            if appearance.opacity < 1.0 && random.next() >= appearance.opacity {
                let straight = Bsdf::straight(surface.bsdf.as_ref(), direction, hit.normal);
                path = self.extend(&path, &hit, &straight, 1.0, random);
                continue;
            }
            let specular = match &appearance.bsdf {
                None => return radiance,
                Some(Bsdf::Lobe(lobe)) => {
                    let vertex = self.vertex(&hit, &appearance);
                    let direct =
                        self.direct_light(&vertex, lobe, -direction, false, random, counts);
                    return radiance + path.throughput * direct;
                }
                Some(Bsdf::Specular(specular)) => specular,
            };
            let mut split = specular.split(direction, appearance.outward(&hit));
            for branch in std::iter::once(&mut split.reflected).chain(&mut split.refracted) {
                if !appearance.same_side(branch.direction) {
                    branch.weight = DVec3::ZERO;
                }
            }
            path = match split.refracted {
                Some(refracted) if path.splits < MAX_SPLITS && split.reflectance > 0.0 => {
                    path.splits += 1;
                    let reflected =
                        self.extend(&path, &hit, &split.reflected, split.reflectance, random);
                    radiance += self.follow(reflected, random, counts);
                    self.extend(&path, &hit, &refracted, 1.0 - split.reflectance, random)
                }
                _ => self.extend(&path, &hit, &split.choose(random), 1.0, random),
            };
        }
        radiance
    }

    /// The path that goes on along one branch of its last hit with this share of the radiance.
    fn extend(
        &self,
        path: &Path,
        hit: &Hit,
        branch: &Branch,
        share: f64,
        random: &mut Random,
    ) -> Path {
        let throughput = path.throughput * branch.weight * share;
        let eta_scale = path.eta_scale * branch.eta;
        let survival = self.roulette(throughput, eta_scale, path.depth, random);
        Path {
            ray: self.spawn(hit, branch.direction),
            depth: path.depth + 1,
            throughput: throughput * survival,
            eta_scale,
            splits: path.splits,
        }
    }
}
