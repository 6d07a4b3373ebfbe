//! Diffuse and glossy reflection together: Lambert's law and the normalised Phong lobe.
//!
//! | name | type | meaning | default |
//! | --- | --- | --- | --- |
//! | `diffuse` | RGB ≥ 0 | albedo ρ of the diffuse part | – |
//! | `specular` | RGB ≥ 0 | weight k of the lobe; ρ + k ≤ 1 | – |
//! | `exponent` | [0, 1e6] | n; the lobe is about √(2/n) radians wide | – |
//!
//! f = ρ/π + k·(n + 2)/(2π)·cosⁿα with α the angle to the mirror direction; the lobe is 0 for
//! α ≥ 90°. The directional albedo is at most ρ + k.
//!
//! The lobe is sampled with probability s = max k/(max ρ + max k), the diffuse part with 1 − s. The
//! density of a direction is that of both together, (1 − s)·cos θ/π + s·(n + 1)/(2π)·cosⁿα, whichever
//! it was drawn from (Veach's one-sample model with the balance heuristic), so the weight is at most
//! about the albedo. What falls below the surface is absorbed.
//!
//! Source: E. P. Lafortune, Y. D. Willems, "Using the Modified Phong Reflectance Model for
//! Physically Based Rendering", report CW 197, K. U. Leuven, 1994; Veach 1997, section 9.2.4.

use super::phong::{lobe, sample_lobe};
use super::{BsdfSample, Material, MaterialKind, MaterialTable};
use crate::math::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use crate::math::{Compare, F32s, U32s, Vec3s};

/// Lambert's law and a Phong lobe; see the module's text.
#[derive(Debug, Clone, Copy)]
pub struct Glossy;

/// Parameters of [`Glossy`] hits.
#[derive(Debug, Clone, Copy)]
pub struct GlossyParams {
    /// ρ.
    pub diffuse: Vec3s,
    /// k.
    pub specular: Vec3s,
    /// n.
    pub exponent: F32s,
}

impl GlossyParams {
    /// s, the probability with which the lobe is sampled; 0 where nothing is reflected.
    #[inline(always)]
    fn lobe_share(&self) -> F32s {
        let (diffuse, specular) = (self.diffuse.max_elem(), self.specular.max_elem());
        // A black surface has 0/0; the smallest normal number makes that 0.
        specular / (diffuse + specular).fast_max(F32s::splat(f32::MIN_POSITIVE))
    }
}

impl Material for Glossy {
    const SPECULAR: bool = false;
    const KIND: MaterialKind = MaterialKind::Glossy;
    type Params = GlossyParams;

    #[inline(always)]
    fn fetch(table: &MaterialTable, material: U32s) -> GlossyParams {
        GlossyParams {
            diffuse: table.reflectance(material),
            specular: table.specular(material),
            exponent: table.parameters(material)[0],
        }
    }

    #[inline(always)]
    fn tint(params: &mut GlossyParams, by: Vec3s) {
        params.diffuse = params.diffuse.mul_elem(by);
    }

    #[inline(always)]
    fn eval(params: &GlossyParams, wo: Vec3s, wi: Vec3s) -> (Vec3s, F32s) {
        let n = params.exponent;
        let cosine = cosine_hemisphere_pdf(wi.z.fast_max(F32s::splat(0.0)));
        let scaled = lobe(n, wo, wi);
        let value = (params.diffuse * cosine)
            .add_scaled(params.specular, (n + F32s::splat(2.0)) * scaled * wi.z);
        let s = params.lobe_share();
        let one = F32s::splat(1.0);
        (value, (one - s) * cosine + s * ((n + one) * scaled))
    }

    #[inline(always)]
    fn sample(params: &GlossyParams, wo: Vec3s, u: [F32s; 3]) -> BsdfSample {
        let direction = [u[0], u[1]];
        let from_lobe = u[2].lt(params.lobe_share());
        let wi = Vec3s::select(
            from_lobe,
            sample_lobe(params.exponent, wo, direction).wi,
            cosine_hemisphere(u[0], u[1]),
        );
        let (value, pdf) = Self::eval(params, wo, wi);
        let zero = F32s::splat(0.0);
        BsdfSample {
            wi,
            weight: value * (F32s::splat(1.0) / pdf),
            pdf,
            eta: F32s::splat(1.0),
            // A direction of the lobe next to 90° from its axis may be rounded out of it.
            valid: wi.z.gt(zero) & pdf.gt(zero),
        }
    }
}
