//! Every ray against every primitive, one by one: what answers are held against. Unlike
//! [`crate::accel::LinearScan`] it merges no faces and leaves none out.

use rayon::prelude::*;

use super::rays::RaySet;
use crate::geometry::sphere::{SpherePack, sphere_distance};
use crate::geometry::triangle::{ShearRay, TrianglePack};
use crate::geometry::{Geometry, PrimitiveId};
use crate::math::lanes::{Compare, F32s, LANES, Mask, U32s};
use crate::math::vec3::Vec3s;

/// Rays that meet a pack while it is in the cache.
const CHUNK: usize = 64;

/// Nearest hit: distance and primitive, infinite and [`PrimitiveId::NONE`] if there is none.
pub(super) type Hit = (f32, u32);

/// All primitives in packs.
#[derive(Debug)]
pub(super) struct Scan {
    triangles: Vec<TrianglePack>,
    spheres: Vec<SpherePack>,
}

/// A ray on its way.
struct Ray {
    shear: ShearRay,
    origin: Vec3s,
    direction: Vec3s,
    nearest: Hit,
}

impl Scan {
    /// Packs the primitives.
    pub(super) fn new(geometry: &Geometry) -> Self {
        let first_sphere = geometry.triangles.len();
        Self {
            triangles: packs(&geometry.triangles, 0, TrianglePack::new),
            spheres: packs(&geometry.spheres, first_sphere, SpherePack::new),
        }
    }

    /// The nearest hit of each ray with t > 0, wherever its segment ends; the lower primitive of equally
    /// near ones.
    pub(super) fn nearest(&self, rays: &RaySet) -> Vec<Hit> {
        let numbers: Vec<usize> = (0..rays.len()).collect();
        let chunks = numbers.par_chunks(CHUNK);
        chunks
            .flat_map_iter(|chunk| self.chunk(rays, chunk))
            .collect()
    }

    fn chunk(&self, rays: &RaySet, numbers: &[usize]) -> Vec<Hit> {
        let mut rays: Vec<Ray> = numbers
            .iter()
            .map(|&number| {
                let (origin, direction, _) = rays.ray(number);
                Ray {
                    shear: ShearRay::new(origin, direction),
                    origin: Vec3s::splat(origin),
                    direction: Vec3s::splat(direction),
                    nearest: (f32::INFINITY, PrimitiveId::NONE),
                }
            })
            .collect();
        for pack in &self.triangles {
            for ray in &mut rays {
                let (hits, t) = ray.shear.intersect_pack(pack);
                ray.take(hits, t, pack.ids);
            }
        }
        for pack in &self.spheres {
            for ray in &mut rays {
                let t = sphere_distance(
                    pack.center,
                    pack.radius,
                    ray.origin,
                    ray.direction,
                    Mask::NONE,
                );
                ray.take(t.lt(F32s::splat(f32::INFINITY)), t, pack.ids);
            }
        }
        rays.into_iter().map(|ray| ray.nearest).collect()
    }
}

impl Ray {
    fn take(&mut self, hits: Mask, t: F32s, ids: U32s) {
        let hits = hits & t.lt(F32s::splat(self.nearest.0));
        if hits.any() {
            let (t, ids) = (t.to_array(), ids.to_array());
            for lane in hits.lanes() {
                // Primitives come in order, so that the first of equals is the lower.
                if t[lane] < self.nearest.0 {
                    self.nearest = (t[lane], ids[lane]);
                }
            }
        }
    }
}

/// Packs of items, which are the primitives from `first` on.
fn packs<T: Copy, P>(items: &[T], first: usize, pack: impl Fn(Vec<(u32, T)>) -> P) -> Vec<P> {
    items
        .chunks(LANES)
        .enumerate()
        .map(|(number, chunk)| {
            let ids = (first + number * LANES) as u32..;
            pack(ids.zip(chunk.iter().copied()).collect())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{Accel, AccelCounters, HitBatch, LinearScan};
    use crate::geometry::Sphere;
    use crate::geometry::testing::{Rng, lat_long_sphere};
    use crate::math::lanes::padded;
    use crate::report::accels::rays::RayKind;

    #[test]
    fn nearest_hits_are_those_of_the_linear_structure() {
        let mut rng = Rng(5);
        let spheres = (0..5).map(|_| Sphere {
            center: rng.sphere().map(|x| 3.0 * x),
            radius: 0.3,
        });
        let spheres = spheres.collect();
        let geometry = Geometry {
            triangles: lat_long_sphere(7, 9, 0.2, &mut rng).triangles(),
            spheres,
            ..Geometry::default()
        };
        let rays: Vec<_> = (0..1000)
            .map(|_| {
                // Towards points about the middle.
                let (origin, target) = (rng.sphere().map(|x| 5.0 * x), rng.sphere());
                let way = [0, 1, 2].map(|k| 3.0 * target[k] - origin[k]);
                let length = way.iter().map(|x| x * x).sum::<f32>().sqrt();
                (origin, way.map(|x| x / length), f32::INFINITY)
            })
            .collect();
        let rays = RaySet::of(RayKind::Diffuse, &rays);
        let none = vec![PrimitiveId::NONE; padded(rays.len())];
        let (mut t, mut primitive) = (vec![0.0; none.len()], none.clone());
        LinearScan::new(&geometry).closest(
            rays.rays(0, rays.len(), &none),
            HitBatch {
                t: &mut t,
                primitive: &mut primitive,
            },
            &mut AccelCounters::default(),
        );
        let nearest = Scan::new(&geometry).nearest(&rays);
        let found: Vec<u32> = nearest.iter().map(|hit| hit.1).collect();
        assert_eq!(found, primitive[..rays.len()]);
        let hits = found.iter().filter(|&&id| id != PrimitiveId::NONE).count();
        assert!(hits > 100 && hits < 1000, "{hits}");
    }
}
