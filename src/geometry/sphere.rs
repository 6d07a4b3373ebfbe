//! Ray–sphere intersection in lanes. The discriminant is r² − |f − (f·d)·d|², the squared half chord by
//! the distance of the centre from the ray, which stays accurate for small and far spheres (Haines,
//! Günther and Akenine-Möller, "Precision Improvements for Ray/Sphere Intersection", *Ray Tracing Gems*,
//! chapter 7, 2019).

use super::Sphere;
use crate::math::lanes::{Compare, F32s, LANES, Mask, U32s};
use crate::math::vec3::Vec3s;

/// Distance, > 0, at which each ray meets its sphere; infinite where it does not. Any of the arguments may
/// be the same in all lanes: many rays against one sphere, or one ray against many.
///
/// A ray that starts on its sphere (`leaving`) cannot find its own origin again: if it points inward it
/// leaves by the chord, t = −2·(n·d)·r, and if it points outward it never returns. Directions are unit length.
#[inline(always)]
pub fn sphere_distance(
    center: Vec3s,
    radius: F32s,
    origin: Vec3s,
    direction: Vec3s,
    leaving: Mask,
) -> F32s {
    let zero = F32s::splat(0.0);
    let to_center = center - origin;
    let middle = to_center.dot(direction);
    let mut across = to_center.add_scaled_exactly(direction, -middle);
    if cfg!(not(target_feature = "fma")) {
        // The dot product has rounded more often: what it has left along the direction goes as well.
        across = across.add_scaled(direction, -across.dot(direction));
    }
    let discriminant = radius * radius - across.length_squared();
    let half_chord = discriminant.sqrt();
    let near = middle - half_chord;
    let far = middle + half_chord;
    // f = −r·n on the sphere, so the chord is −2·(n·d)·r = 2·(f·d).
    let chord = middle + middle;
    let t = leaving.select(chord, near.gt(zero).select(near, far));
    // A negative discriminant makes its root NaN, and so do rays with NaN.
    (t.gt(zero) & (leaving | discriminant.ge(zero))).select(t, F32s::splat(f32::INFINITY))
}

/// [`LANES`] spheres in columns.
#[derive(Debug, Clone, Copy)]
pub struct SpherePack {
    /// Centres; NaN in lanes without a sphere, which are never hit.
    pub center: Vec3s,
    /// Radii.
    pub radius: F32s,
    /// Primitive ids, [`super::PrimitiveId::NONE`] in lanes without a sphere.
    pub ids: U32s,
}

impl SpherePack {
    /// Packs up to [`LANES`] spheres with their ids.
    ///
    /// # Panics
    /// If there are more.
    pub fn new(spheres: impl IntoIterator<Item = (u32, Sphere)>) -> Self {
        let mut center = [[f32::NAN; LANES]; 3];
        let mut radius = [0.0; LANES];
        let mut ids = [super::PrimitiveId::NONE; LANES];
        for (lane, (id, sphere)) in spheres.into_iter().enumerate() {
            ids[lane] = id;
            radius[lane] = sphere.radius;
            for (axis, column) in center.iter_mut().enumerate() {
                column[lane] = sphere.center[axis];
            }
        }
        let [x, y, z] = center.map(F32s::from);
        Self {
            center: Vec3s::new(x, y, z),
            radius: F32s::from(radius),
            ids: U32s::from(ids),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::{Rng, column};

    /// f64 answer for the f32 inputs: nearest root > 0, and the squared half chord over r².
    fn oracle(
        center: [f32; 3],
        radius: f32,
        origin: [f32; 3],
        direction: [f32; 3],
    ) -> (Option<f64>, f64) {
        let f = [0, 1, 2].map(|k| f64::from(center[k]) - f64::from(origin[k]));
        let d = direction.map(f64::from);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (a, b) = (dot(d, d), dot(f, d));
        let across = [0, 1, 2].map(|k| f[k] - b / a * d[k]);
        let r2 = f64::from(radius) * f64::from(radius);
        let inside = (r2 - dot(across, across)) / r2;
        if inside < 0.0 {
            return (None, inside);
        }
        let root = (inside * r2 / a).sqrt();
        let t = if b / a - root > 0.0 {
            b / a - root
        } else {
            b / a + root
        };
        ((t > 0.0).then_some(t), inside)
    }

    fn lanes(rays: &[([f32; 3], [f32; 3]); LANES]) -> (Vec3s, Vec3s) {
        (
            column(&rays.map(|ray| ray.0)),
            column(&rays.map(|ray| ray.1)),
        )
    }

    /// The distance of the centre from the ray is known to γ(8)·D, so only rays that pass that close to
    /// the silhouette may be judged wrongly.
    #[test]
    fn hits_agree_with_f64_away_from_the_silhouette_for_small_and_far_spheres() {
        let mut rng = Rng(19);
        for ratio in [2.0f32, 1e1, 1e2, 1e3, 1e4, 1e5] {
            let mut hits = 0;
            for _ in 0..20_000 / LANES {
                let radius = 0.7;
                let center = rng.sphere().map(|x| x * ratio * radius);
                let rays = [(); LANES].map(|()| {
                    let aside = rng.sphere().map(|x| x * radius * 1.05 * rng.uniform());
                    let target = [0, 1, 2].map(|k| center[k] + aside[k]);
                    let length = target.iter().map(|x| x * x).sum::<f32>().sqrt();
                    ([0.0; 3], target.map(|x| x / length))
                });
                let (origin, direction) = lanes(&rays);
                let got = sphere_distance(
                    Vec3s::splat(center),
                    F32s::splat(radius),
                    origin,
                    direction,
                    Mask::NONE,
                );
                for (ray, t) in rays.iter().zip(got.to_array()) {
                    let (expected, inside) = oracle(center, radius, ray.0, ray.1);
                    let slack = f64::from(crate::math::float::gamma(8)) * f64::from(ratio);
                    if inside.abs() < 2.0 * slack {
                        continue;
                    }
                    assert_eq!(
                        t.is_finite(),
                        expected.is_some(),
                        "at {ratio} radii, chord {inside}"
                    );
                    if let Some(expected) = expected {
                        hits += 1;
                        // Rounding of f·d, and of the half chord through its square.
                        let bound = f64::from(radius) * slack * (2.0 + 1.0 / inside.sqrt());
                        assert!(
                            (f64::from(t) - expected).abs() <= bound,
                            "{t} {expected} at {ratio}"
                        );
                    }
                }
            }
            assert!(hits > 5_000, "{hits} hits at {ratio}");
        }
    }

    #[test]
    fn a_ray_leaving_its_sphere_finds_the_chord_inward_and_nothing_outward() {
        let mut rng = Rng(21);
        for radius in [1e-6f32, 1.0, 1e7] {
            for _ in 0..20_000 / LANES {
                let center = [radius * 3.0, -radius, radius * 0.5];
                let rays = [(); LANES].map(|()| {
                    let n = rng.sphere();
                    ([0, 1, 2].map(|k| center[k] + radius * n[k]), rng.sphere())
                });
                let (origin, direction) = lanes(&rays);
                let got = sphere_distance(
                    Vec3s::splat(center),
                    F32s::splat(radius),
                    origin,
                    direction,
                    Mask::ALL,
                );
                for (ray, t) in rays.iter().zip(got.to_array()) {
                    let n = [0, 1, 2].map(|k| f64::from(ray.0[k] - center[k]) / f64::from(radius));
                    let cosine: f64 = (0..3).map(|k| n[k] * f64::from(ray.1[k])).sum();
                    if cosine.abs() < 1e-6 {
                        continue;
                    }
                    assert_eq!(t.is_finite(), cosine < 0.0);
                    if cosine < 0.0 {
                        let chord = -2.0 * cosine * f64::from(radius);
                        assert!((f64::from(t) - chord).abs() <= 1e-6 * f64::from(radius));
                    }
                }
            }
        }
    }

    #[test]
    fn from_inside_the_far_side_is_hit_and_bad_rays_miss() {
        let unit = |o: [f32; 3], d: [f32; 3]| {
            let center = Vec3s::zero();
            sphere_distance(
                center,
                F32s::splat(2.0),
                Vec3s::splat(o),
                Vec3s::splat(d),
                Mask::NONE,
            )
            .to_array()[0]
        };
        assert_eq!(unit([0.0; 3], [0.0, 1.0, 0.0]), 2.0);
        assert_eq!(unit([0.0, -3.0, 0.0], [0.0, 1.0, 0.0]), 1.0);
        assert_eq!(unit([0.0, 3.0, 0.0], [0.0, 1.0, 0.0]), f32::INFINITY);
        for bad in [f32::NAN, f32::INFINITY] {
            assert_eq!(unit([bad, 0.0, 0.0], [0.0, 1.0, 0.0]), f32::INFINITY);
            assert_eq!(unit([0.0; 3], [0.0, bad, 0.0]), f32::INFINITY);
        }
    }
}
