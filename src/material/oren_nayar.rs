//! Rough diffuse reflection by Oren and Nayar's qualitative (A/B) model.
//!
//! | name | type | meaning | default |
//! | --- | --- | --- | --- |
//! | `reflectance` | RGB in [0, 1] | Lambertian albedo ρ of the facets | – |
//! | `sigma` | radians in [0, ∞] | standard deviation σ of the facets' slope angle | – |
//!
//! f = ρ/π·\[A + B·max(0, cos(φ_i − φ_o))·sin α·tan β\] with α the larger and β the smaller of the two
//! polar angles, A = 1 − 0.5·σ²/(σ² + 0.33) and B = 0.45·σ²/(σ² + 0.09). Without trigonometry,
//! cos(φ_i − φ_o)·sin α·tan β = (x_i·x_o + y_i·y_o)/max(z_i, z_o).
//!
//! σ = 0 is Lambert's law to the last bit. The model gains energy at grazing angles for
//! 0 < σ < 0.3261: up to 1.52 % (σ = 0.1987, ρ = 1, 90°). Directions are drawn in proportion to the
//! cosine.
//!
//! Source: M. Oren, S. K. Nayar, "Generalization of Lambert's Reflectance Model", SIGGRAPH 1994,
//! equation 30.

use super::{BsdfSample, Material, MaterialKind, MaterialTable};
use crate::math::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use crate::math::{F32s, Mask, U32s, Vec3s};

/// Rough diffuse reflection; see the module's text.
#[derive(Debug, Clone, Copy)]
pub struct OrenNayar;

/// Parameters of [`OrenNayar`] hits.
#[derive(Debug, Clone, Copy)]
pub struct OrenNayarParams {
    /// ρ.
    pub reflectance: Vec3s,
    /// A, in [0.5, 1].
    pub a: F32s,
    /// B, in [0, 0.45].
    pub b: F32s,
}

/// The table's two numbers: A and B.
pub(super) fn parameters(sigma: f64) -> [f32; 2] {
    // σ²/(σ² + c) as 1/(1 + c/σ²): right at 0 and at infinity too.
    let share = |c: f64| 1.0 / (1.0 + c / (sigma * sigma));
    [
        (1.0 - 0.5 * share(0.33)) as f32,
        (0.45 * share(0.09)) as f32,
    ]
}

/// (x_i·x_o + y_i·y_o)⁺ / max(z_i, z_o).
#[inline(always)]
fn azimuthal_term(wo: Vec3s, wi: Vec3s) -> F32s {
    let along = wo.x.mul_add(wi.x, wo.y * wi.y).fast_max(F32s::splat(0.0));
    // Two grazing directions leave 0/0; the smallest normal number makes that 0.
    along / wo.z.fast_max(wi.z).fast_max(F32s::splat(f32::MIN_POSITIVE))
}

impl Material for OrenNayar {
    const SPECULAR: bool = false;
    const KIND: MaterialKind = MaterialKind::OrenNayar;
    type Params = OrenNayarParams;

    #[inline(always)]
    fn fetch(table: &MaterialTable, material: U32s) -> OrenNayarParams {
        let [a, b] = table.parameters(material);
        OrenNayarParams {
            reflectance: table.reflectance(material),
            a,
            b,
        }
    }

    #[inline(always)]
    fn tint(params: &mut Self::Params, by: Vec3s) {
        params.reflectance = params.reflectance.mul_elem(by);
    }

    #[inline(always)]
    fn eval(params: &OrenNayarParams, wo: Vec3s, wi: Vec3s) -> (Vec3s, F32s) {
        let pdf = cosine_hemisphere_pdf(wi.z.fast_max(F32s::splat(0.0)));
        let shape = params.b.mul_add(azimuthal_term(wo, wi), params.a);
        (params.reflectance * (pdf * shape), pdf)
    }

    #[inline(always)]
    fn sample(params: &OrenNayarParams, wo: Vec3s, u: [F32s; 3]) -> BsdfSample {
        let wi = cosine_hemisphere(u[0], u[1]);
        let shape = params.b.mul_add(azimuthal_term(wo, wi), params.a);
        BsdfSample {
            wi,
            weight: params.reflectance * shape,
            pdf: cosine_hemisphere_pdf(wi.z),
            eta: F32s::splat(1.0),
            valid: Mask::ALL,
        }
    }
}
