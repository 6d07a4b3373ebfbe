//! Lambert's ideal diffuse reflection.
//!
//! | name | type | meaning | default |
//! | --- | --- | --- | --- |
//! | `reflectance` | RGB in [0, 1] | albedo ρ | – |
//!
//! f = ρ/π. Directions are drawn in proportion to the cosine, so that each weight is ρ exactly.
//!
//! Source: J. H. Lambert, "Photometria", 1760; Pharr, Jakob, Humphreys, "Physically Based
//! Rendering", 4th ed., section 9.2.

use super::{BsdfSample, Material, MaterialKind, MaterialTable};
use crate::math::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use crate::math::{F32s, Mask, U32s, Vec3s};

/// Ideal diffuse reflection; see the module's text.
#[derive(Debug, Clone, Copy)]
pub struct Lambertian;

/// Parameters of [`Lambertian`] hits.
#[derive(Debug, Clone, Copy)]
pub struct LambertianParams {
    /// ρ.
    pub reflectance: Vec3s,
}

impl Material for Lambertian {
    const SPECULAR: bool = false;
    const KIND: MaterialKind = MaterialKind::Lambertian;
    type Params = LambertianParams;

    #[inline(always)]
    fn fetch(table: &MaterialTable, material: U32s) -> LambertianParams {
        LambertianParams {
            reflectance: table.reflectance(material),
        }
    }

    #[inline(always)]
    fn tint(params: &mut Self::Params, by: Vec3s) {
        params.reflectance = params.reflectance.mul_elem(by);
    }

    #[inline(always)]
    fn eval(params: &LambertianParams, _: Vec3s, wi: Vec3s) -> (Vec3s, F32s) {
        let pdf = cosine_hemisphere_pdf(wi.z.fast_max(F32s::splat(0.0)));
        (params.reflectance * pdf, pdf)
    }

    #[inline(always)]
    fn sample(params: &LambertianParams, _: Vec3s, u: [F32s; 3]) -> BsdfSample {
        let wi = cosine_hemisphere(u[0], u[1]);
        BsdfSample {
            wi,
            weight: params.reflectance,
            pdf: cosine_hemisphere_pdf(wi.z),
            eta: F32s::splat(1.0),
            valid: Mask::ALL,
        }
    }
}
