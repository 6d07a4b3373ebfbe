//! How surfaces scatter.
//!
//! Directions are unit vectors away from the surface: `wo` to where the path came from, `wi` to
//! where it goes. `normal` is on the side of `wo`; what comes from below it is not scattered.

use std::f64::consts::{FRAC_1_PI, TAU};

use glam::DVec3;

use super::random::Random;
use super::specular::{Dielectric, Specular};
use super::warp::{Frame, cosine_hemisphere, cosine_hemisphere_pdf};
use crate::scene::BsdfDescription;

/// The scattering of a material.
#[derive(Debug, Clone, Copy)]
pub(super) enum Bsdf {
    /// Found by light sampling.
    Lobe(Lobe),
    /// Out of light sampling's reach.
    Specular(Specular),
}

/// Scattering into a range of directions.
#[derive(Debug, Clone, Copy)]
pub(super) enum Lobe {
    /// Reflectance, then A and B of the model; Lambert's law is A = 1, B = 0.
    OrenNayar(DVec3, f64, f64),
    /// Reflectance and exponent.
    Phong(DVec3, f64),
    /// Reflectance by Lambert's law, that of a Phong lobe, and its exponent.
    Glossy(DVec3, DVec3, f64),
}

impl Bsdf {
    /// `None` for what scatters nothing.
    pub(super) fn new(description: &BsdfDescription) -> Option<Self> {
        let (bsdf, reflectance) = match *description {
            BsdfDescription::Black => return None,
            BsdfDescription::Lambertian { reflectance } => (
                Self::Lobe(Lobe::OrenNayar(reflectance, 1.0, 0.0)),
                reflectance,
            ),
            BsdfDescription::OrenNayar { reflectance, sigma } => {
                let [a, b] = oren_nayar_coefficients(sigma);
                (Self::Lobe(Lobe::OrenNayar(reflectance, a, b)), reflectance)
            }
            BsdfDescription::Phong {
                reflectance,
                exponent,
            } => (Self::Lobe(Lobe::Phong(reflectance, exponent)), reflectance),
            BsdfDescription::Glossy {
                diffuse,
                specular,
                exponent,
            } => (
                Self::Lobe(Lobe::Glossy(diffuse, specular, exponent)),
                diffuse + specular,
            ),
            BsdfDescription::Mirror { reflectance } => {
                (Self::Specular(Specular::Mirror(reflectance)), reflectance)
            }
            BsdfDescription::Dielectric { ior, fresnel } => {
                let glass = Dielectric {
                    ior,
                    formula: fresnel,
                };
                (Self::Specular(Specular::Dielectric(glass)), DVec3::ONE)
            }
        };
        (reflectance != DVec3::ZERO).then_some(bsdf)
    }

    /// The same under a texture of this colour; of a glossy surface, the diffuse part.
    pub(super) fn tinted(self, colour: DVec3) -> Self {
        match self {
            Self::Lobe(Lobe::OrenNayar(reflectance, a, b)) => {
                Self::Lobe(Lobe::OrenNayar(reflectance * colour, a, b))
            }
            Self::Lobe(Lobe::Phong(reflectance, exponent)) => {
                Self::Lobe(Lobe::Phong(reflectance * colour, exponent))
            }
            Self::Lobe(Lobe::Glossy(diffuse, specular, exponent)) => {
                Self::Lobe(Lobe::Glossy(diffuse * colour, specular, exponent))
            }
            Self::Specular(Specular::Mirror(reflectance)) => {
                Self::Specular(Specular::Mirror(reflectance * colour))
            }
            Self::Specular(Specular::Dielectric(_)) => self,
        }
    }
}

impl Lobe {
    /// BSDF per steradian, without the cosine.
    pub(super) fn eval(&self, normal: DVec3, wo: DVec3, wi: DVec3) -> DVec3 {
        let cos_i = normal.dot(wi);
        let cos_o = normal.dot(wo);
        if cos_i <= 0.0 || cos_o <= 0.0 {
            return DVec3::ZERO;
        }
        match *self {
            Self::OrenNayar(reflectance, a, b) => {
                // cos Δφ·sin α·tan β without angles: the scalar product of the tangential parts is
                // cos Δφ·sin θi·sin θo, and β is the angle with the larger cosine.
                let tangential = wi.dot(wo) - cos_i * cos_o;
                let backscatter = (tangential / cos_i.max(cos_o)).max(0.0);
                reflectance * (FRAC_1_PI * (a + b * backscatter))
            }
            Self::Phong(reflectance, exponent) => {
                let cos_alpha = mirrored(normal, wo).dot(wi);
                if cos_alpha <= 0.0 {
                    return DVec3::ZERO;
                }
                reflectance * ((exponent + 2.0) / TAU * cos_alpha.powf(exponent))
            }
            Self::Glossy(diffuse, specular, exponent) => {
                let [matte, gloss] = parts(diffuse, specular, exponent);
                matte.eval(normal, wo, wi) + gloss.eval(normal, wo, wi)
            }
        }
    }

    /// Density per solid angle with which [`Self::sample`] proposes `wi`.
    pub(super) fn pdf(&self, normal: DVec3, wo: DVec3, wi: DVec3) -> f64 {
        match *self {
            Self::OrenNayar(..) => cosine_hemisphere_pdf(normal.dot(wi)),
            Self::Phong(_, exponent) => {
                let cos_alpha = mirrored(normal, wo).dot(wi);
                if cos_alpha <= 0.0 {
                    return 0.0;
                }
                (exponent + 1.0) / TAU * cos_alpha.powf(exponent)
            }
            Self::Glossy(diffuse, specular, exponent) => {
                let [matte, gloss] = parts(diffuse, specular, exponent);
                let share = gloss_share(diffuse, specular);
                matte.pdf(normal, wo, wi) * (1.0 - share) + gloss.pdf(normal, wo, wi) * share
            }
        }
    }

    /// A direction and its weight, BSDF × cosine / pdf. The weight is zero below the horizon,
    /// where the Phong lobe may reach.
    pub(super) fn sample(&self, normal: DVec3, wo: DVec3, random: &mut Random) -> (DVec3, DVec3) {
        match *self {
            Self::OrenNayar(..) => {
                let u = random.next_2d();
                let wi = cosine_hemisphere(normal, u);
                // The cosine cancels against that of the pdf, 1/π remains.
                (wi, self.eval(normal, wo, wi) / FRAC_1_PI)
            }
            Self::Phong(reflectance, exponent) => {
                let u = random.next_2d();
                // ln(1 − u) is exact where cos α is next to 1, at large exponents.
                let log_cos_alpha = (-u[0]).ln_1p() / (exponent + 1.0);
                let sin_alpha = (-(2.0 * log_cos_alpha).exp_m1()).sqrt();
                let lobe = Frame::about(mirrored(normal, wo));
                let wi = lobe.direction(log_cos_alpha.exp(), sin_alpha, TAU * u[1]);
                let cos_i = normal.dot(wi).max(0.0);
                (
                    wi,
                    reflectance * ((exponent + 2.0) / (exponent + 1.0) * cos_i),
                )
            }
            Self::Glossy(diffuse, specular, exponent) => {
                let [matte, gloss] = parts(diffuse, specular, exponent);
                let chosen = if random.next() < gloss_share(diffuse, specular) {
                    gloss
                } else {
                    matte
                };
                let (wi, _) = chosen.sample(normal, wo, random);
                // The density of either part, whichever drew the direction.
                let pdf = self.pdf(normal, wo, wi);
                let cos_over_pdf = if pdf > 0.0 {
                    normal.dot(wi).max(0.0) / pdf
                } else {
                    0.0
                };
                (wi, self.eval(normal, wo, wi) * cos_over_pdf)
            }
        }
    }
}

/// The diffuse and the specular part of a glossy surface.
fn parts(diffuse: DVec3, specular: DVec3, exponent: f64) -> [Lobe; 2] {
    [
        Lobe::OrenNayar(diffuse, 1.0, 0.0),
        Lobe::Phong(specular, exponent),
    ]
}

/// Probability of sampling the specular part: its share of the mean reflectance.
fn gloss_share(diffuse: DVec3, specular: DVec3) -> f64 {
    let total = (diffuse + specular).element_sum();
    if total > 0.0 {
        specular.element_sum() / total
    } else {
        0.0
    }
}

/// A = 1 − 0.5σ²/(σ² + 0.33) and B = 0.45σ²/(σ² + 0.09) of Oren & Nayar 1994, also for σ = ∞.
fn oren_nayar_coefficients(sigma: f64) -> [f64; 2] {
    let precision = 1.0 / (sigma * sigma);
    [
        1.0 - 0.5 / (1.0 + 0.33 * precision),
        0.45 / (1.0 + 0.09 * precision),
    ]
}

/// `wo` mirrored about the normal; away from the surface as `wo` is.
pub(super) fn mirrored(normal: DVec3, wo: DVec3) -> DVec3 {
    normal * (2.0 * normal.dot(wo)) - wo
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOBES: [Lobe; 7] = [
        Lobe::OrenNayar(DVec3::ONE, 1.0, 0.0),
        Lobe::OrenNayar(DVec3::ONE, 0.5, 0.45),
        Lobe::Phong(DVec3::ONE, 0.0),
        Lobe::Phong(DVec3::ONE, 3.0),
        Lobe::Phong(DVec3::ONE, 40.0),
        Lobe::Glossy(DVec3::new(0.5, 0.3, 0.1), DVec3::splat(0.4), 20.0),
        Lobe::Glossy(DVec3::ZERO, DVec3::ONE, 3.0),
    ];

    fn at_degrees(degrees: f64, phi: f64) -> DVec3 {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Frame::about(DVec3::Z).direction(cos, sin, phi)
    }

    #[test]
    fn oren_nayar_equals_its_formula_in_angles() {
        for sigma in [0.0, 1e-6, 0.3, 0.5, 0.7, f64::INFINITY] {
            let Some(Bsdf::Lobe(bsdf)) = Bsdf::new(&BsdfDescription::OrenNayar {
                reflectance: DVec3::splat(0.8),
                sigma,
            }) else {
                panic!("Oren–Nayar is a lobe")
            };
            let (a, b) = if sigma.is_finite() {
                let s2 = sigma * sigma;
                (1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09))
            } else {
                (0.5, 0.45)
            };
            for (ti, to, phi) in [
                (10f64, 70f64, 0.3f64),
                (70.0, 10.0, 0.3),
                (45.0, 45.0, 0.0),
                (80.0, 85.0, 2.5),
            ] {
                let alpha = ti.max(to).to_radians();
                let beta = ti.min(to).to_radians();
                let expected = 0.8 / std::f64::consts::PI
                    * (a + b * phi.cos().max(0.0) * alpha.sin() * beta.tan());
                let got = bsdf
                    .eval(DVec3::Z, at_degrees(to, 1.0), at_degrees(ti, 1.0 + phi))
                    .x;
                assert!(
                    (got / expected - 1.0).abs() < 1e-12,
                    "σ {sigma}: {got}, not {expected}"
                );
            }
        }
    }

    #[test]
    fn samples_follow_the_pdf_and_weights_are_value_times_cosine_over_pdf() {
        for (index, bsdf) in LOBES.into_iter().enumerate() {
            for degrees in [0.0, 50.0, 85.0] {
                let wo = at_degrees(degrees, 0.7);
                // Moments of the direction, from samples and by a uniform quadrature of the pdf.
                let moments = |w: DVec3| [1.0, w.x, w.y, w.z, w.z * w.z, w.x * w.y];
                let mut exact = [0.0; 6];
                // The error of the midpoint rule at the pole, where cos⁴⁰ is steepest, is 1e-4.
                let (rows, columns) = (1600, 100);
                for row in 0..rows {
                    let z = 1.0 - 2.0 * (f64::from(row) + 0.5) / f64::from(rows);
                    for column in 0..columns {
                        let phi = TAU * (f64::from(column) + 0.5) / f64::from(columns);
                        let w = Frame::about(DVec3::Z).direction(z, (1.0 - z * z).sqrt(), phi);
                        let weight =
                            bsdf.pdf(DVec3::Z, wo, w) * 2.0 * TAU / f64::from(rows * columns);
                        for (sum, moment) in exact.iter_mut().zip(moments(w)) {
                            *sum += moment * weight;
                        }
                    }
                }
                assert!(
                    (exact[0] - 1.0).abs() < 1e-3,
                    "lobe {index}: the pdf integrates to {}",
                    exact[0]
                );
                let mut random = Random::new(index as u64, degrees as u32, 0, 0);
                let n = 40_000;
                let mut sums = [[0.0; 2]; 6];
                for _ in 0..n {
                    let (wi, weight) = bsdf.sample(DVec3::Z, wo, &mut random);
                    assert!((wi.length() - 1.0).abs() < 1e-12);
                    let expected = bsdf.eval(DVec3::Z, wo, wi) * wi.z / bsdf.pdf(DVec3::Z, wo, wi);
                    assert!(
                        (weight - expected).length() <= 1e-9,
                        "{weight} is not {expected}"
                    );
                    for (sum, moment) in sums.iter_mut().zip(moments(wi)) {
                        sum[0] += moment;
                        sum[1] += moment * moment;
                    }
                }
                for (k, (sum, exact)) in sums.iter().zip(exact).enumerate() {
                    let mean = sum[0] / f64::from(n);
                    let variance = (sum[1] / f64::from(n) - mean * mean).max(0.0);
                    let tolerance = 4.0 * (variance / f64::from(n)).sqrt() + 1e-3;
                    assert!(
                        (mean - exact).abs() < tolerance,
                        "lobe {index}, moment {k}: {mean}, not {exact}"
                    );
                }
            }
        }
    }

    #[test]
    fn values_are_reciprocal() {
        for bsdf in LOBES {
            for (ti, to, phi) in [(10.0, 70.0, 0.3), (80.0, 30.0, 2.0), (60.0, 60.0, 3.1)] {
                let (a, b) = (at_degrees(ti, 0.2), at_degrees(to, 0.2 + phi));
                let there = bsdf.eval(DVec3::Z, a, b).x;
                let back = bsdf.eval(DVec3::Z, b, a).x;
                assert!((there - back).abs() <= 1e-12 * there, "{there} and {back}");
            }
        }
    }

    #[test]
    fn nothing_comes_from_below_the_horizon() {
        for bsdf in LOBES {
            assert_eq!(
                bsdf.eval(DVec3::Z, at_degrees(80.0, 0.0), at_degrees(91.0, 3.1)),
                DVec3::ZERO
            );
        }
        let black = BsdfDescription::Lambertian {
            reflectance: DVec3::ZERO,
        };
        assert!(Bsdf::new(&black).is_none());
    }
}
