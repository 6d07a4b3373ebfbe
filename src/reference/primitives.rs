//! Triangles and spheres, and rays against all of them, one after the other.

use glam::DVec3;

/// Bound of the rounding error of a hit point over the largest absolute coordinate of the
/// primitive. The point is a sum of three products of numbers of at most twice that size, with a
/// dozen roundings of 2⁻⁵³ each, hence 24·2⁻⁵³; the rest is reserve for the rounding of the
/// neighbour's own test. At a coordinate of 1 m this is 1.4e-14 m.
pub(super) const POSITION_ERROR: f64 = 128.0 * (f64::EPSILON / 2.0);

/// How far outside of a triangle, in barycentric units, a ray still hits it. Two triangles that
/// share an edge round their barycentrics differently, by some units of 2⁻⁵³; with this slack they
/// overlap by a hair and no ray passes between them.
const EDGE_SLACK: f64 = 16.0 * (f64::EPSILON / 2.0);

/// A planar patch or a sphere, by number: what a ray that starts on it does not hit there.
/// A triangle of a mesh is a patch of its own; the two halves of a quad are one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PatchId(u32);

impl PatchId {
    /// In mid-air.
    pub(super) const NONE: Self = Self(u32::MAX);
}

/// A ray, or the segment of one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) origin: DVec3,
    /// Unit length.
    pub(super) direction: DVec3,
    /// Hits at this distance or nearer do not count.
    pub(super) t_min: f64,
    /// Where it starts: a planar patch is not hit again, a sphere only from within.
    pub(super) start: PatchId,
}

/// The closest hit of a ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// Distance along the ray.
    pub(super) t: f64,
    /// Index into the tables of primitives: triangles first, then spheres.
    pub(super) primitive: usize,
    pub(super) patch: PatchId,
    pub(super) position: DVec3,
    /// Unit geometric normal; along (b − a) × (c − a), or outward.
    pub(super) normal: DVec3,
    /// Barycentric coordinates of b and c on a triangle.
    pub(super) barycentrics: [f64; 2],
}

#[derive(Debug, Clone, Copy)]
struct Triangle {
    a: DVec3,
    ab: DVec3,
    ac: DVec3,
    patch: PatchId,
}

#[derive(Debug, Clone, Copy)]
struct Sphere {
    center: DVec3,
    radius: f64,
}

/// Every primitive of a scene.
#[derive(Debug, Default)]
pub(super) struct Primitives {
    triangles: Vec<Triangle>,
    spheres: Vec<Sphere>,
}

impl Triangle {
    /// Distance and barycentric coordinates of b and c (Möller & Trumbore 1997). A zero
    /// determinant or a NaN anywhere fails the comparisons.
    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<(f64, f64, f64)> {
        let p = ray.direction.cross(self.ac);
        let inverse_determinant = 1.0 / self.ab.dot(p);
        let from_a = ray.origin - self.a;
        let u = from_a.dot(p) * inverse_determinant;
        let q = from_a.cross(self.ab);
        let v = ray.direction.dot(q) * inverse_determinant;
        let t = self.ac.dot(q) * inverse_determinant;
        // One branch that is seldom taken: without an exit after each coordinate, hard to predict,
        // the hexagonal room makes 30 % more paths per CPU second.
        let inside = (u >= -EDGE_SLACK) & (v >= -EDGE_SLACK) & (u + v <= 1.0 + EDGE_SLACK);
        (inside & (t > ray.t_min)).then_some((t, u, v))
    }
}

impl Sphere {
    /// The distances at which the ray enters and leaves the sphere, in ascending order, either sign.
    #[inline]
    fn roots(&self, ray: &Ray) -> Option<[f64; 2]> {
        let from_center = ray.origin - self.center;
        let b = from_center.dot(ray.direction);
        // The squared distance of the line from the centre by its perpendicular vector: the
        // textbook b² − c cancels for small or far spheres (Haines et al., Ray Tracing Gems, ch. 7).
        let perpendicular = from_center - ray.direction * b;
        let discriminant = self.radius * self.radius - perpendicular.length_squared();
        if discriminant < 0.0 {
            return None;
        }
        // The root without cancellation, and the other from their product.
        let far_from_zero = -b - discriminant.sqrt().copysign(b);
        let product = (from_center.length() - self.radius) * (from_center.length() + self.radius);
        let near_zero = product / far_from_zero;
        Some(if far_from_zero < near_zero {
            [far_from_zero, near_zero]
        } else {
            [near_zero, far_from_zero]
        })
    }

    /// Distances at which a ray hits the sphere beyond its `t_min`: those that are not NaN.
    #[inline]
    fn hits(&self, ray: &Ray, starts_here: bool) -> [f64; 2] {
        if starts_here {
            // The near root is the start itself. The other end of the chord is ahead if the ray
            // points inward; no formula for the roots tells a tiny chord from rounding.
            let normal = (ray.origin - self.center).normalize();
            let chord = -2.0 * normal.dot(ray.direction) * self.radius;
            return [if chord > 0.0 { chord } else { f64::NAN }, f64::NAN];
        }
        match self.roots(ray) {
            Some(roots) => roots.map(|t| if t > ray.t_min { t } else { f64::NAN }),
            None => [f64::NAN; 2],
        }
    }
}

impl Primitives {
    /// Adds the triangle (a, b, c) as a patch of its own.
    pub(super) fn add_triangle(&mut self, [a, b, c]: [DVec3; 3]) {
        let patch = PatchId(self.triangles.len() as u32);
        self.triangles.push(Triangle {
            a,
            ab: b - a,
            ac: c - a,
            patch,
        });
    }

    /// Adds a planar convex quad as two triangles, (a, b, c) and (a, c, d).
    pub(super) fn add_quad(&mut self, [a, b, c, d]: [DVec3; 4]) {
        self.add_triangle([a, b, c]);
        let patch = self.triangles[self.triangles.len() - 1].patch;
        self.triangles.push(Triangle {
            a,
            ab: c - a,
            ac: d - a,
            patch,
        });
    }

    /// Adds a sphere.
    pub(super) fn add_sphere(&mut self, center: DVec3, radius: f64) {
        self.spheres.push(Sphere { center, radius });
    }

    /// Number of triangles.
    pub(super) fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// The patch that a primitive belongs to.
    pub(super) fn patch(&self, primitive: usize) -> PatchId {
        match self.triangles.get(primitive) {
            Some(triangle) => triangle.patch,
            None => PatchId(primitive as u32),
        }
    }

    /// Unit geometric normal at a point of a primitive.
    pub(super) fn normal(&self, primitive: usize, position: DVec3) -> DVec3 {
        match self.triangles.get(primitive) {
            Some(triangle) => triangle.ab.cross(triangle.ac).normalize(),
            None => (position - self.spheres[primitive - self.triangles.len()].center).normalize(),
        }
    }

    /// Bound of the distance between a computed point of a primitive and its surface, in scene units.
    pub(super) fn position_error(&self, primitive: usize) -> f64 {
        let largest_coordinate = match self.triangles.get(primitive) {
            Some(t) => {
                t.a.abs()
                    .max((t.a + t.ab).abs())
                    .max((t.a + t.ac).abs())
                    .max_element()
            }
            None => {
                let sphere = self.spheres[primitive - self.triangles.len()];
                sphere.center.abs().max_element() + sphere.radius
            }
        };
        POSITION_ERROR * largest_coordinate
    }

    /// The smallest box around everything, or `None` if there is nothing.
    pub(super) fn bounds(&self) -> Option<[DVec3; 2]> {
        let corners = self
            .triangles
            .iter()
            .flat_map(|t| [t.a, t.a + t.ab, t.a + t.ac])
            .map(|p| [p, p]);
        let spheres = self
            .spheres
            .iter()
            .map(|s| [s.center - s.radius, s.center + s.radius]);
        corners
            .chain(spheres)
            .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// The closest hit; of hits at the same distance, the one with the lower index.
    pub(super) fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut closest = f64::INFINITY;
        let mut found = None;
        for (i, triangle) in self.triangles.iter().enumerate() {
            if let Some((t, u, v)) = triangle.intersect(ray)
                && t < closest
                && triangle.patch != ray.start
            {
                closest = t;
                found = Some((i, u, v));
            }
        }
        for (i, sphere) in (self.triangles.len()..).zip(&self.spheres) {
            for t in sphere.hits(ray, PatchId(i as u32) == ray.start) {
                if t < closest {
                    closest = t;
                    found = Some((i, 0.0, 0.0));
                }
            }
        }
        let (primitive, u, v) = found?;
        // Points are computed on their primitive, not along the ray: their error is then that of
        // the primitive's coordinates, however far away the ray started.
        let (position, normal) = match self.triangles.get(primitive) {
            Some(triangle) => {
                let position = triangle.a + triangle.ab * u + triangle.ac * v;
                (position, self.normal(primitive, position))
            }
            None => {
                let sphere = self.spheres[primitive - self.triangles.len()];
                let normal = self.normal(primitive, ray.origin + ray.direction * closest);
                (sphere.center + normal * sphere.radius, normal)
            }
        };
        let patch = self.patch(primitive);
        Some(Hit {
            t: closest,
            primitive,
            patch,
            position,
            normal,
            barycentrics: [u, v],
        })
    }

    /// Shows every primitive that the ray crosses before `t_max`, in no particular order, to
    /// `passes(primitive, distance)` until that says no. Returns whether it never said no.
    #[inline]
    pub(super) fn all_pass(
        &self,
        ray: &Ray,
        t_max: f64,
        mut passes: impl FnMut(usize, f64) -> bool,
    ) -> bool {
        for (i, triangle) in self.triangles.iter().enumerate() {
            if let Some((t, ..)) = triangle.intersect(ray)
                && t < t_max
                && triangle.patch != ray.start
                && !passes(i, t)
            {
                return false;
            }
        }
        for (i, sphere) in (self.triangles.len()..).zip(&self.spheres) {
            for t in sphere.hits(ray, PatchId(i as u32) == ray.start) {
                if t < t_max && !passes(i, t) {
                    return false;
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: DVec3, towards: DVec3) -> Ray {
        Ray {
            origin,
            direction: (towards - origin).normalize(),
            t_min: 0.0,
            start: PatchId::NONE,
        }
    }

    fn spheres(center: DVec3, radius: f64) -> Primitives {
        let mut primitives = Primitives::default();
        primitives.add_sphere(center, radius);
        primitives
    }

    /// Corners of a unit cube turned about a skew axis, at a size.
    fn cube(size: f64) -> (Vec<DVec3>, Primitives) {
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.3, 1.1, -0.7));
        let corners: Vec<DVec3> = (0..8)
            .map(|i| turn * DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) * size)
            .collect();
        let mut primitives = Primitives::default();
        for [a, b, c, d] in [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ] {
            primitives.add_triangle([corners[a], corners[b], corners[c]]);
            primitives.add_triangle([corners[a], corners[c], corners[d]]);
        }
        (corners, primitives)
    }

    #[test]
    fn rays_from_inside_a_closed_mesh_hit_its_vertices_edges_and_diagonals() {
        for size in [1e-6, 1.0, 1e7] {
            let (corners, primitives) = cube(size);
            let middle = corners.iter().sum::<DVec3>() / 8.0;
            for step in 0..200 {
                let origin = middle + (corners[step % 8] - middle) * (0.004 * step as f64);
                for a in &corners {
                    for b in &corners {
                        // Corners, edges, and both diagonals of faces; also through the middle.
                        let target = a.lerp(*b, step as f64 / 199.0);
                        if target.distance(origin) > 1e-6 * size {
                            assert!(primitives.closest(&ray(origin, target)).is_some());
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn sphere_hits_are_exact_from_far_and_for_small_spheres() {
        for distance in [2.0, 1e3, 1e6] {
            let center = DVec3::new(0.6, -0.8, 0.0) * distance;
            let primitives = spheres(center, 1.0);
            // Aim beside the centre by 0.6 radii: the near hit is 0.8 before the foot point.
            let aside = DVec3::new(0.8, 0.6, 0.0) * 0.6;
            let straight = DVec3::new(0.6, -0.8, 0.0);
            let ray = Ray {
                origin: aside,
                direction: straight,
                t_min: 0.0,
                start: PatchId::NONE,
            };
            let hit = primitives.closest(&ray).expect("aimed at the sphere");
            assert!((hit.t - (distance - 0.8)).abs() < 4.0 * f64::EPSILON * distance);
            assert!((hit.position.distance(center) - 1.0).abs() < 2.0 * f64::EPSILON * distance);
            assert!(
                (hit.normal - (aside - straight * 0.8)).length() < 4.0 * f64::EPSILON * distance
            );
        }
    }

    #[test]
    fn a_ray_leaves_its_sphere_outward_and_crosses_it_inward() {
        for radius in [1e-6, 1.0, 1e6] {
            let center = DVec3::new(1.0, 2.0, 3.0);
            let primitives = spheres(center, radius);
            let normal = DVec3::new(2.0, -1.0, 2.0) / 3.0;
            for cos in [1.0, 0.5, 1e-3, 1e-9] {
                let tangent = normal.any_orthonormal_vector() * (1.0f64 - cos * cos).sqrt();
                let start = |direction| Ray {
                    origin: center + normal * radius,
                    direction,
                    t_min: 0.0,
                    start: primitives.patch(0),
                };
                if cos > 1e-6 {
                    assert!(primitives.closest(&start(tangent + normal * cos)).is_none());
                    let hit = primitives
                        .closest(&start(tangent - normal * cos))
                        .expect("a chord");
                    let rounding = 8.0 * f64::EPSILON * (radius + 3.0) / cos;
                    assert!(
                        (hit.t - 2.0 * cos * radius).abs() < rounding,
                        "{radius} {cos}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_quad_cannot_be_hit_from_itself() {
        let mut primitives = Primitives::default();
        // Turned, so that the corners are not quite in one plane.
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.2, -0.9, 0.4));
        let corners =
            [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y].map(|p| turn * p);
        primitives.add_quad(corners);
        let down = ray(
            corners[1].lerp(corners[3], 0.3) + turn * DVec3::Z,
            corners[1],
        );
        let hit = primitives.closest(&down).expect("aimed at the quad");
        for i in 0..1000 {
            let angle = f64::from(i) * 0.37;
            let grazing = turn * DVec3::new(angle.cos(), angle.sin(), 1e-9 * (angle * 3.0).sin());
            for (primitive, origin) in [(0, hit.position), (1, corners[0].lerp(corners[2], 0.4))] {
                let start = primitives.patch(primitive);
                let ray = Ray {
                    origin,
                    direction: grazing,
                    t_min: 0.0,
                    start,
                };
                assert!(primitives.closest(&ray).is_none());
                assert!(primitives.all_pass(&ray, f64::INFINITY, |_, _| false));
            }
        }
    }

    #[test]
    fn a_segment_crosses_a_sphere_twice_and_ends_before_what_is_beyond() {
        let primitives = spheres(DVec3::new(0.0, 0.0, 5.0), 1.0);
        let up = ray(DVec3::ZERO, DVec3::Z);
        for (t_max, expected) in [(3.9, 0), (4.1, 1), (6.1, 2)] {
            let mut crossings = 0;
            primitives.all_pass(&up, t_max, |_, _| {
                crossings += 1;
                true
            });
            assert_eq!(crossings, expected);
        }
    }

    #[test]
    fn rays_that_are_not_numbers_hit_nothing() {
        let (_, mut primitives) = cube(1.0);
        primitives.add_sphere(DVec3::ZERO, 1.0);
        for (origin, direction) in [(DVec3::NAN, DVec3::X), (DVec3::ZERO, DVec3::NAN)] {
            let ray = Ray {
                origin,
                direction,
                t_min: 0.0,
                start: PatchId::NONE,
            };
            assert!(primitives.closest(&ray).is_none());
        }
    }
}
