//! Glossy reflection by the normalised Phong lobe.
//!
//! | name | type | meaning | default |
//! | --- | --- | --- | --- |
//! | `reflectance` | RGB in [0, 1] | weight k of the lobe | – |
//! | `exponent` | [0, 1e6] | n; the lobe is about √(2/n) radians wide | – |
//!
//! f = k·(n + 2)/(2π)·cosⁿα with α the angle to the mirror direction; 0 for α ≥ 90° and below the
//! surface. The directional albedo is k at normal incidence and smaller elsewhere, so energy is
//! never gained. Directions are drawn with density (n + 1)/(2π)·cosⁿα; those that fall below the
//! surface are absorbed, so the density integrates to less than 1 at grazing angles.
//!
//! With δ = 1 − cos α taken from the difference of the two directions, δ = |wi − r|²/2, and
//! cosⁿα = 2^(n·log₂(1 − δ)), the lobe keeps its shape up to n = 1e6, where α is a thousandth of a
//! radian and cos α in f32 has no digits left. What remains is the rounding of wi itself: about 1e-4
//! of the density at n = 1e6, in proportion to √n.
//!
//! Source: E. P. Lafortune, Y. D. Willems, "Using the Modified Phong Reflectance Model for
//! Physically Based Rendering", report CW 197, K. U. Leuven, 1994.

use std::f32::consts::PI;

use super::mirror::reflect;
use super::{BsdfSample, Material, MaterialKind, MaterialTable};
use crate::math::elementary::{
    exp2_and_complement, exp2_nonpositive, log2_one_minus, sin_cos_turns,
};
use crate::math::{Compare, F32s, Frame, Mask, U32s, Vec3s};

/// Normalised Phong lobe; see the module's text.
#[derive(Debug, Clone, Copy)]
pub struct Phong;

/// Parameters of [`Phong`] hits.
#[derive(Debug, Clone, Copy)]
pub struct PhongParams {
    /// k.
    pub reflectance: Vec3s,
    /// n.
    pub exponent: F32s,
}

/// cosⁿα/(2π) of the directions; 0 for α ≥ 90° and below the surface.
#[inline(always)]
pub(super) fn lobe(n: F32s, wo: Vec3s, wi: Vec3s) -> F32s {
    let (zero, one) = (F32s::splat(0.0), F32s::splat(1.0));
    let delta = (wi - reflect(wo)).length_squared() * F32s::splat(0.5);
    let inside = delta.lt(one) & wi.z.gt(zero);
    let power = exp2_nonpositive(n * log2_one_minus(inside.select(delta, zero)));
    inside.select(power * F32s::splat(0.5 / PI), zero)
}

/// A direction of the lobe, which may lie below the surface.
pub(super) struct LobeSample {
    /// Unit length.
    pub(super) wi: Vec3s,
    /// cos α.
    pub(super) cos: F32s,
    /// 1/(n + 1).
    pub(super) inverse: F32s,
}

/// A direction with density (n + 1)/(2π)·cosⁿα.
#[inline(always)]
pub(super) fn sample_lobe(n: F32s, wo: Vec3s, u: [F32s; 2]) -> LobeSample {
    let one = F32s::splat(1.0);
    let inverse = one / (n + one);
    // cos^(n + 1) α = 1 − u₁, so cos α = 2^(log₂(1 − u₁)/(n + 1)).
    let (cos, delta) = exp2_and_complement(log2_one_minus(u[0]) * inverse);
    let sin = (delta * (one + cos)).sqrt();
    let (sin_phi, cos_phi) = sin_cos_turns(u[1]);
    let frame = Frame::from_normal(reflect(wo));
    let wi = frame.to_world(Vec3s::new(sin * cos_phi, sin * sin_phi, cos));
    LobeSample { wi, cos, inverse }
}

impl Material for Phong {
    const SPECULAR: bool = false;
    const KIND: MaterialKind = MaterialKind::Phong;
    type Params = PhongParams;

    #[inline(always)]
    fn fetch(table: &MaterialTable, material: U32s) -> PhongParams {
        PhongParams {
            reflectance: table.reflectance(material),
            exponent: table.parameters(material)[0],
        }
    }

    #[inline(always)]
    fn tint(params: &mut Self::Params, by: Vec3s) {
        params.reflectance = params.reflectance.mul_elem(by);
    }

    #[inline(always)]
    fn eval(params: &PhongParams, wo: Vec3s, wi: Vec3s) -> (Vec3s, F32s) {
        let n = params.exponent;
        let scaled = lobe(n, wo, wi);
        let pdf = (n + F32s::splat(1.0)) * scaled;
        (
            params.reflectance * ((n + F32s::splat(2.0)) * scaled * wi.z),
            pdf,
        )
    }

    #[inline(always)]
    fn sample(params: &PhongParams, wo: Vec3s, u: [F32s; 3]) -> BsdfSample {
        let one = F32s::splat(1.0);
        let n = params.exponent;
        let LobeSample { wi, cos, inverse } = sample_lobe(n, wo, [u[0], u[1]]);
        let valid: Mask = wi.z.gt(F32s::splat(0.0));
        BsdfSample {
            wi,
            weight: params.reflectance * ((one + inverse) * wi.z),
            pdf: (n + one) * (F32s::splat(0.5 / PI) * (one - u[0])) / cos,
            eta: one,
            valid,
        }
    }
}
