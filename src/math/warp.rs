//! Maps from uniform numbers in [0, 1) to points and directions, each with its density.
//!
//! Directions are of unit length, in a frame whose pole is z. Densities are per steradian for
//! directions. Source: Pharr, Jakob, Humphreys, "Physically Based Rendering", 4th ed., appendix A.5,
//! where no other is named.

use std::f32::consts::{FRAC_1_PI, PI};

use super::elementary::sin_cos_turns;
use super::lanes::F32s;
use super::vec3::Vec3s;

/// Direction about z with density cos θ / π. Its z is > 0 for every u < 1.
///
/// Polar coordinates with z = √(1 − u₁): as fast as the concentric map of the disk (0.5 ns per lane,
/// measured), and exact at the ends, where that map's z = √(1 − x² − y²) cancels to 0.
#[inline(always)]
pub fn cosine_hemisphere(u1: F32s, u2: F32s) -> Vec3s {
    let (sin, cos) = sin_cos_turns(u2);
    let r = u1.sqrt();
    Vec3s::new(r * cos, r * sin, (F32s::splat(1.0) - u1).sqrt())
}

/// Density of [`cosine_hemisphere`] at a direction with cosine `cos` ≥ 0 to z.
#[inline(always)]
pub fn cosine_hemisphere_pdf(cos: F32s) -> F32s {
    cos * F32s::splat(FRAC_1_PI)
}

/// Direction with density 1/(4π) everywhere.
#[inline(always)]
pub fn uniform_sphere(u1: F32s, u2: F32s) -> Vec3s {
    // The whole sphere is the cone of 1 − cos θ_max = 2.
    uniform_cone(F32s::splat(2.0), u1, u2)
}

/// Density of [`uniform_sphere`].
pub const UNIFORM_SPHERE_PDF: f32 = 0.25 * FRAC_1_PI;

/// Direction within the cone about z of half angle θ_max, uniform in solid angle; the cone is given
/// by `one_minus_cos` = 1 − cos θ_max in (0, 2], so that narrow cones keep their precision.
#[inline(always)]
pub fn uniform_cone(one_minus_cos: F32s, u1: F32s, u2: F32s) -> Vec3s {
    let height = u1 * one_minus_cos;
    let (sin, cos) = sin_cos_turns(u2);
    let r = (height * (F32s::splat(2.0) - height)).sqrt();
    Vec3s::new(r * cos, r * sin, F32s::splat(1.0) - height)
}

/// Density of [`uniform_cone`] inside the cone.
#[inline(always)]
pub fn uniform_cone_pdf(one_minus_cos: F32s) -> F32s {
    F32s::splat(0.5 / PI) / one_minus_cos
}

/// Barycentric weights (of the second and the third corner) uniform over a triangle, if `fold` is
/// 1/2; the point (u1, u2) of the unit square itself, if `fold` is 0.
///
/// The map for triangles keeps neighbours together, so it keeps strata compact (Heitz, "A
/// Low-Distortion Map Between Triangle and Square", 2019); it is measure preserving up to the
/// triangle's half area.
#[inline(always)]
pub fn triangle_or_square(fold: F32s, u1: F32s, u2: F32s) -> (F32s, F32s) {
    let shift = fold * u1.fast_min(u2);
    (u1 - shift, u2 - shift)
}

#[cfg(test)]
mod tests {
    use super::super::lanes::LANES;
    use super::super::testing::{ChiSquared, DirectionBins, Uniform};
    use super::*;

    /// Ends and middles of [0, 1).
    const ENDS: [f32; 6] = [
        0.0,
        1.0 / 16_777_216.0,
        0.25,
        0.5,
        0.75,
        1.0 - 1.0 / 16_777_216.0,
    ];

    fn splat(u: f32) -> F32s {
        F32s::splat(u)
    }

    #[test]
    fn directions_have_unit_length_at_the_ends_of_the_unit_interval() {
        for u1 in ENDS {
            for u2 in ENDS {
                let (u1, u2) = (splat(u1), splat(u2));
                let cosine = cosine_hemisphere(u1, u2);
                assert!(cosine.z.to_array()[0] > 0.0);
                for v in [
                    cosine,
                    uniform_sphere(u1, u2),
                    uniform_cone(splat(1e-9), u1, u2),
                ] {
                    let length = v.to_lanes()[0].iter().map(|x| x * x).sum::<f64>().sqrt();
                    assert!((length - 1.0).abs() < 3e-7, "{length} at {u1:?} {u2:?}");
                }
            }
        }
    }

    /// Chi-squared test of a warp on the directions of its pole and beyond.
    fn follows(
        seed: u64,
        bins: &DirectionBins,
        warp: impl Fn(F32s, F32s) -> Vec3s,
        pdf: impl Fn(Vec3s) -> F32s,
    ) {
        let mut random = Uniform::new(seed);
        let mut counts = ChiSquared::new(bins);
        for _ in 0..200_000 / LANES {
            counts.add(
                warp(random.lanes(), random.lanes()),
                super::super::Mask::ALL,
            );
        }
        let integral = counts.check(&pdf, "warp");
        assert!((integral - 1.0).abs() < 1e-5, "{integral}");
    }

    #[test]
    fn warps_follow_their_densities() {
        let sphere = DirectionBins::new([0.0, 0.0, 1.0], 2.0);
        let hemisphere_pdf = |v: Vec3s| cosine_hemisphere_pdf(v.z.max(splat(0.0)));
        follows(11, &sphere, cosine_hemisphere, hemisphere_pdf);
        follows(12, &sphere, uniform_sphere, |_| splat(UNIFORM_SPHERE_PDF));
        for one_minus_cos in [1.0, 0.1, 1e-4] {
            let bins = DirectionBins::new([0.0, 0.0, 1.0], f64::from(one_minus_cos));
            let width = splat(one_minus_cos);
            follows(
                13,
                &bins,
                |u, v| uniform_cone(width, u, v),
                |_| uniform_cone_pdf(width),
            );
        }
    }

    #[test]
    fn folded_square_fills_the_triangle_evenly() {
        const CELLS: usize = 16;
        let mut random = Uniform::new(3);
        let mut counts = [[0u32; CELLS]; CELLS];
        let n = 400_000 / LANES * LANES;
        for _ in 0..n / LANES {
            let (a, b) = triangle_or_square(splat(0.5), random.lanes(), random.lanes());
            for (a, b) in a.to_array().into_iter().zip(b.to_array()) {
                assert!(a >= 0.0 && b >= 0.0 && a + b <= 1.0);
                counts[(a * CELLS as f32) as usize][(b * CELLS as f32) as usize] += 1;
            }
        }
        // Whole cells below the diagonal hold 2/CELLS² of the samples, cut ones half of that.
        let (mut chi2, mut cells) = (0.0, 0.0);
        for (i, row) in counts.iter().enumerate() {
            for (j, &count) in row.iter().enumerate().take(CELLS - i) {
                let whole = if i + j + 1 < CELLS { 2.0 } else { 1.0 };
                let expected = n as f64 * whole / (CELLS * CELLS) as f64;
                chi2 += (f64::from(count) - expected).powi(2) / expected;
                cells += 1.0;
            }
        }
        let deviations = (chi2 - (cells - 1.0)) / (2.0 * (cells - 1.0f64)).sqrt();
        assert!(deviations.abs() < 4.0, "chi² = {chi2} over {cells} cells");
        let (a, b) = triangle_or_square(splat(0.0), splat(0.3), splat(0.9));
        assert_eq!((a.to_array()[0], b.to_array()[0]), (0.3, 0.9));
    }
}
