//! Smooth boundary of a transparent, non-absorbing body such as glass.
//!
//! | name | type | meaning | default |
//! | --- | --- | --- | --- |
//! | `ior` | > 0 | index of refraction n, inside over outside | – |
//! | `fresnel` | formula | `Schlick` or `Exact` | – |
//!
//! Two delta lobes: reflection with probability R, refraction by Snell's law with 1 − R. With
//! η = n_t/n_i and the cosine c on the side of the ray:
//! - c_t² = 1 − (1 − c²)/η²; total internal reflection, R = 1, where that is not positive;
//! - exact: R = (r_s² + r_p²)/2, r_s = (c − η·c_t)/(c + η·c_t), r_p = (η·c − c_t)/(η·c + c_t), with
//!   the differences rewritten, r_s = (1 − η²)/(c + η·c_t)² and
//!   r_p = (η² − 1)(c² − (1 − c²)/η²)/(η·c + c_t)², which keeps their precision for n near 1;
//! - Schlick: R = R₀ + (1 − R₀)(1 − c)⁵, R₀ = ((n − 1)/(n + 1))², with the cosine on the optically
//!   thin side, which is the smaller of c and c_t. It does not vanish for n = 1 at grazing angles.
//!
//! Radiance is compressed by refraction: the weight of the refracted ray contains 1/η², and the
//! sample reports η, so that roulette can leave it out.
//!
//! Source: Born, Wolf, "Principles of Optics", 7th ed., section 1.5; C. Schlick, "An Inexpensive
//! BRDF Model for Physically-based Rendering", Computer Graphics Forum 13(3), 1994, equation 24;
//! Veach 1997, section 5.2 for the factor 1/η².

use super::mirror::reflect;
use super::{BsdfSample, Material, MaterialKind, MaterialTable};
use crate::math::frame::renormalize;
use crate::math::{Compare, F32s, Mask, U32s, Vec3s};

/// Smooth transparent boundary; see the module's text.
#[derive(Debug, Clone, Copy)]
pub struct Dielectric;

/// Formula of the reflectance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FresnelFormula {
    /// Schlick's approximation.
    Schlick,
    /// The exact unpolarised equations.
    Exact,
}

/// Parameters of [`Dielectric`] hits.
#[derive(Debug, Clone, Copy)]
pub struct DielectricParams {
    /// n.
    pub ior: F32s,
    /// Where the exact formula is asked for.
    pub exact: Mask,
}

/// Both ways that light can take, for integrators that follow each.
#[derive(Debug, Clone, Copy)]
pub struct DielectricBranches {
    /// Reflected direction, of unit length.
    pub reflected: Vec3s,
    /// R, the weight of the reflected ray, in [0, 1].
    pub reflectance: F32s,
    /// Refracted direction, of unit length; meaningless where `reflectance` is 1.
    pub refracted: Vec3s,
    /// (1 − R)/η², the weight of the refracted ray; 0 in total internal reflection.
    pub transmission_weight: F32s,
    /// η = n_t/n_i of the refracted ray.
    pub eta: F32s,
}

/// The table's two numbers: n, and 1 for the exact formula or 0 for Schlick's.
pub(super) fn parameters(ior: f32, fresnel: FresnelFormula) -> [f32; 2] {
    [
        ior,
        if fresnel == FresnelFormula::Exact {
            1.0
        } else {
            0.0
        },
    ]
}

/// Everything about a boundary that depends on the cosine alone.
struct Interface {
    /// R.
    reflectance: F32s,
    /// Cosine on the far side; 0 in total internal reflection.
    cos_t: F32s,
    /// n_t/n_i.
    eta: F32s,
    /// n_i/n_t.
    inverse_eta: F32s,
}

impl Interface {
    /// For the signed cosine to the outward normal: negative means that the ray comes from inside.
    #[inline(always)]
    fn new(params: &DielectricParams, signed_cos: F32s) -> Self {
        let (zero, one) = (F32s::splat(0.0), F32s::splat(1.0));
        let n = params.ior;
        let inverse_n = one / n;
        let entering = signed_cos.gt(zero);
        let cos = signed_cos.abs();
        let eta = entering.select(n, inverse_n);
        let inverse_eta = entering.select(inverse_n, n);
        // 1 − 1/η² from the factors of n² − 1, which is exact enough for n near 1.
        let n2_minus_1 = (n - one) * (n + one);
        let one_minus_inverse_eta2 =
            entering.select(n2_minus_1 * inverse_n * inverse_n, -n2_minus_1);
        let scaled_cos = inverse_eta * cos;
        let cos2_t = scaled_cos.mul_add(scaled_cos, one_minus_inverse_eta2);
        let total = cos2_t.le(zero);
        let cos_t = cos2_t.fast_max(zero).sqrt();
        let mut reflectance = zero;
        if params.exact != Mask::ALL {
            let r0 = (n - one) / (n + one);
            let r0 = r0 * r0;
            let m = one - cos.fast_min(cos_t);
            let m2 = m * m;
            reflectance = (one - r0).mul_add(m2 * m2 * m, r0);
        }
        if params.exact.any() {
            let one_minus_eta2 = entering.select(-n2_minus_1, n2_minus_1 * inverse_n * inverse_n);
            let s = eta.mul_add(cos_t, cos);
            let p = eta.mul_add(cos, cos_t);
            // c² − (1 − c²)/η² = (c·c + scaled_cos²) − 1/η².
            let brewster = cos.mul_add(
                cos,
                scaled_cos.mul_sub(scaled_cos, inverse_eta * inverse_eta),
            );
            // At c = 0 exactly with n = 1 both denominators vanish.
            let tiny = F32s::splat(f32::MIN_POSITIVE);
            let r_s = one_minus_eta2 / (s * s).fast_max(tiny);
            let r_p = one_minus_eta2 * brewster / (p * p).fast_max(tiny);
            let exact = r_s.mul_add(r_s, r_p * r_p) * F32s::splat(0.5);
            reflectance = params.exact.select(exact, reflectance);
        }
        // Rounding may leave R a little above 1 at grazing angles.
        let reflectance = total.select(one, reflectance.fast_min(one));
        Self {
            reflectance,
            cos_t,
            eta,
            inverse_eta,
        }
    }

    /// Snell's law: the refracted direction on the far side of `wo`.
    #[inline(always)]
    fn refract(&self, wo: Vec3s) -> Vec3s {
        let far_side = wo.z.gt(F32s::splat(0.0)).select(-self.cos_t, self.cos_t);
        let scale = -self.inverse_eta;
        renormalize(Vec3s::new(scale * wo.x, scale * wo.y, far_side))
    }
}

impl Dielectric {
    /// Both branches and their weights for `wo` (z signed: negative comes from inside).
    #[inline(always)]
    pub fn branches(params: &DielectricParams, wo: Vec3s) -> DielectricBranches {
        let interface = Interface::new(params, wo.z);
        let transmitted = F32s::splat(1.0) - interface.reflectance;
        DielectricBranches {
            reflected: renormalize(reflect(wo)),
            reflectance: interface.reflectance,
            refracted: interface.refract(wo),
            transmission_weight: transmitted * interface.inverse_eta * interface.inverse_eta,
            eta: interface.eta,
        }
    }

    /// 1 − R at the cosine between the outward normal and the direction back along the ray
    /// (negative: from inside, with total internal reflection), without the factor 1/η².
    #[inline(always)]
    pub fn transmittance(params: &DielectricParams, cos: F32s) -> F32s {
        F32s::splat(1.0) - Interface::new(params, cos).reflectance
    }
}

impl Material for Dielectric {
    const SPECULAR: bool = true;
    const TRANSMISSIVE: bool = true;
    const KIND: MaterialKind = MaterialKind::Dielectric;
    type Params = DielectricParams;

    #[inline(always)]
    fn fetch(table: &MaterialTable, material: U32s) -> DielectricParams {
        let [ior, exact] = table.parameters(material);
        DielectricParams {
            ior,
            exact: exact.gt(F32s::splat(0.5)),
        }
    }

    #[inline(always)]
    fn eval(_: &DielectricParams, _: Vec3s, _: Vec3s) -> (Vec3s, F32s) {
        (Vec3s::zero(), F32s::splat(0.0))
    }

    #[inline(always)]
    fn sample(params: &DielectricParams, wo: Vec3s, u: [F32s; 3]) -> BsdfSample {
        let one = F32s::splat(1.0);
        let interface = Interface::new(params, wo.z);
        // R = 1 beats every u < 1: total internal reflection has no other branch.
        let reflects = u[2].lt(interface.reflectance);
        let weight = reflects.select(one, interface.inverse_eta * interface.inverse_eta);
        BsdfSample {
            wi: Vec3s::select(reflects, renormalize(reflect(wo)), interface.refract(wo)),
            weight: Vec3s::new(weight, weight, weight),
            pdf: F32s::splat(0.0),
            eta: reflects.select(one, interface.eta),
            valid: Mask::ALL,
        }
    }

    #[inline(always)]
    fn straight_eta(params: &DielectricParams, wo: Vec3s) -> F32s {
        let entering = wo.z.gt(F32s::splat(0.0));
        entering.select(params.ior, F32s::splat(1.0) / params.ior)
    }

    #[inline(always)]
    fn split(params: &DielectricParams, wo: Vec3s) -> Option<[BsdfSample; 2]> {
        let branches = Self::branches(params, wo);
        let branch = |wi: Vec3s, weight: F32s, eta: F32s| BsdfSample {
            wi,
            weight: Vec3s::new(weight, weight, weight),
            pdf: F32s::splat(0.0),
            eta,
            valid: weight.gt(F32s::splat(0.0)),
        };
        Some([
            branch(branches.reflected, branches.reflectance, F32s::splat(1.0)),
            branch(
                branches.refracted,
                branches.transmission_weight,
                branches.eta,
            ),
        ])
    }
}
