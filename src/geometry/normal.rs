//! Shading normals, interpolated between those of a triangle's corners.
//!
//! They decide in which directions a surface scatters, and nothing else: on which side of the surface
//! a ray runs and starts is up to the geometric normal.

use crate::math::lanes::{Compare, F32s, Mask};
use crate::math::vec3::Vec3s;

/// Squared length below which normals of the corners cancel, and their rounding (about 1e-7) would
/// decide the direction of the sum to no better than a hundredth of a radian.
const CANCELLED: f32 = 1e-10;

/// Least cosine to the geometric normal, where the ray's own allows it, that a mirrored ray has: far
/// above rounding (about 1e-7), and too small a turn to be seen.
const LEAST_COSINE: f32 = 1e-4;

/// Least cosine between a bent normal and the ray: a few roundings of the scalar product, so that its
/// sign is right.
const SURELY_ABOVE: f32 = 1e-6;

/// The unit normal at the barycentric coordinates `weights`, between the unit normals of the corners,
/// each turned to the side of the unit normal `face`; where they cancel or are not finite, `face`.
#[inline(always)]
pub fn interpolated_normal(corners: [Vec3s; 3], weights: [F32s; 3], face: Vec3s) -> Vec3s {
    let mut sum = Vec3s::zero();
    for (normal, weight) in corners.into_iter().zip(weights) {
        let away = normal.dot(face).lt(F32s::splat(0.0));
        sum = sum.add_scaled(Vec3s::select(away, -normal, normal), weight);
    }
    // NaN compares false, and an infinite length is refused too.
    let squared = sum.length_squared();
    let sound = squared.gt(F32s::splat(CANCELLED)) & squared.lt(F32s::splat(f32::MAX));
    Vec3s::select(sound, sum.normalize(), face)
}

/// The unit shading normal `normal` bent towards `wo` where needed, so that the mirror image of `wo`
/// about it is above the face: then `wo` is above the shading horizon, and no mirror is black.
///
/// All are of unit length, and `normal` and `wo` on the side of the unit geometric normal `face`. A
/// mirror image below the horizon is drawn up along `face` to just above it, and the half vector
/// between that and `wo` is the answer. A normal equal to `face` is never bent.
///
/// Source: A. Keller et al., "The Iray Light Transport Simulation and Rendering System",
/// arXiv:1705.01263, 2017, section A.3 ("Local Shading Normal Adaption").
#[inline(always)]
pub fn facing_normal(normal: Vec3s, face: Vec3s, wo: Vec3s) -> Vec3s {
    let mirrored = (-wo).add_scaled(normal, F32s::splat(2.0) * wo.dot(normal));
    let cosine = mirrored.dot(face);
    let own = wo.dot(face);
    // Half of the ray's own cosine: a normal equal to the face's keeps clear of it.
    let least = (own * F32s::splat(0.5)).fast_min(F32s::splat(LEAST_COSINE));
    let below = cosine.lt(least);
    if below.none() {
        return normal;
    }
    let lifted = mirrored.add_scaled(face, least - cosine).normalize();
    let half = (lifted + wo).normalize();
    // Where the ray grazes the face and both directions cancel, rounding is all that is left of them.
    let least = F32s::splat(SURELY_ABOVE);
    let sound: Mask = half.dot(wo).gt(least) & half.dot(face).gt(least);
    let bent = Vec3s::select(sound, half, face);
    Vec3s::select(below, bent, normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::{Rng, column, lane};
    use crate::math::LANES;

    fn dot(a: [f32; 3], b: [f32; 3]) -> f64 {
        (0..3).map(|k| f64::from(a[k]) * f64::from(b[k])).sum()
    }

    /// Vectors of the sphere, on the side of these.
    fn beside(rng: &mut Rng, faces: &[[f32; 3]; LANES]) -> [[f32; 3]; LANES] {
        faces.map(|face| {
            let v = rng.sphere();
            if dot(v, face) < 0.0 { v.map(|x| -x) } else { v }
        })
    }

    #[test]
    fn mirrored_rays_stay_above_the_face_and_rays_above_the_shading_horizon() {
        let mut rng = Rng(71);
        for round in 0..100_000 / LANES {
            let faces = [(); LANES].map(|()| rng.sphere());
            let normals = beside(&mut rng, &faces);
            let mut rays = beside(&mut rng, &faces);
            if round % 2 == 0 {
                // Down to 1e-5 above the face.
                let share = 10f32.powf(-5.0 * rng.uniform());
                for (ray, face) in rays.iter_mut().zip(&faces) {
                    let cosine = dot(*ray, *face) as f32;
                    let flat: [f32; 3] =
                        std::array::from_fn(|k| ray[k] - cosine * (1.0 - share) * face[k]);
                    let length = dot(flat, flat).sqrt() as f32;
                    *ray = flat.map(|x| x / length);
                }
            }
            let (face, wo) = (column(&faces), column(&rays));
            let bent = facing_normal(column(&normals), face, wo);
            for i in 0..LANES {
                let (n, wo) = (lane(bent, i), rays[i]);
                assert!((dot(n, n) - 1.0).abs() < 1e-5, "{n:?}");
                let above = dot(n, wo);
                let own = dot(wo, faces[i]);
                // Of a ray in the plane of the face itself rounding decides the side.
                let resolved = own > f64::from(SURELY_ABOVE);
                assert!(
                    above > if resolved { 0.0 } else { -1e-6 },
                    "{wo:?} is below {n:?}, {own} above the face"
                );
                let mirrored = 2.0 * above * dot(n, faces[i]) - own;
                // Rounding of the half vector grows where both directions nearly cancel.
                let rounding = 1e-6 / (above + 1e-3);
                assert!(
                    mirrored > (0.5 * own).min(f64::from(LEAST_COSINE)) - rounding,
                    "{mirrored}: {n:?}, {:?}, {wo:?}",
                    faces[i]
                );
                // What was right is left alone.
                let before = dot(normals[i], wo);
                if 2.0 * before * dot(normals[i], faces[i]) - own > 2.0 * f64::from(LEAST_COSINE) {
                    assert_eq!(n, normals[i]);
                }
            }
        }
    }

    #[test]
    fn a_normal_equal_to_that_of_the_face_is_not_bent_at_any_angle() {
        let mut rng = Rng(72);
        for exponent in 0..30 {
            let faces = [(); LANES].map(|()| rng.sphere());
            let rays = faces.map(|face| {
                let v = rng.sphere();
                let along = dot(v, face) as f32;
                let cosine = 2f32.powi(-exponent);
                let flat: [f32; 3] = std::array::from_fn(|k| v[k] - along * face[k]);
                let length = dot(flat, flat).sqrt() as f32;
                let sine = (1.0 - cosine * cosine).sqrt();
                std::array::from_fn(|k| sine * flat[k] / length + cosine * face[k])
            });
            let face = column(&faces);
            let bent = facing_normal(face, face, column(&rays));
            for (i, face) in faces.iter().enumerate() {
                // Below 1e-6 rounding may bend it by as much as that.
                let close = (0..3).all(|k| (lane(bent, i)[k] - face[k]).abs() < 1e-6);
                assert!(close || exponent > 18, "2^-{exponent}");
                if exponent <= 18 {
                    assert_eq!(lane(bent, i), *face, "2^-{exponent}");
                }
            }
        }
    }

    #[test]
    fn corners_are_met_turned_to_the_face_and_replaced_where_they_cancel() {
        let up = [0.0, 0.0, 1.0];
        let tilted = [0.6, 0.0, 0.8];
        let flipped = [-0.6, 0.0, -0.8];
        let weights = |w: [f32; 3]| w.map(F32s::splat);
        let normal = |corners: [[f32; 3]; 3], w: [f32; 3]| {
            let normal =
                interpolated_normal(corners.map(Vec3s::splat), weights(w), Vec3s::splat(up));
            lane(normal, 0)
        };
        for (corner, expected) in [(0, up), (1, tilted), (2, tilted)] {
            let mut w = [0.0; 3];
            w[corner] = 1.0;
            let got = normal([up, tilted, flipped], w);
            assert!(
                (0..3).all(|k| (got[k] - expected[k]).abs() < 1e-6),
                "{got:?}"
            );
        }
        let [x, minus_x] = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]];
        assert_eq!(normal([x, minus_x, x], [0.25, 0.5, 0.25]), up);
        assert_eq!(normal([[f32::NAN; 3], up, up], [0.2, 0.4, 0.4]), up);
        assert_eq!(normal([[f32::INFINITY; 3], up, up], [0.2, 0.4, 0.4]), up);
    }
}
