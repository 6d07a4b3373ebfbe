//! Perfect mirror.
//!
//! | name | type | meaning | default |
//! | --- | --- | --- | --- |
//! | `reflectance` | RGB in [0, 1] | reflected share, the same at every angle | – |
//!
//! One delta lobe in the direction (−x, −y, z).

use super::{BsdfSample, Material, MaterialKind, MaterialTable};
use crate::math::frame::renormalize;
use crate::math::{F32s, Mask, U32s, Vec3s};

/// Perfect reflection; see the module's text.
#[derive(Debug, Clone, Copy)]
pub struct Mirror;

/// Parameters of [`Mirror`] hits.
#[derive(Debug, Clone, Copy)]
pub struct MirrorParams {
    /// Reflected share.
    pub reflectance: Vec3s,
}

/// `wo` reflected about z.
#[inline(always)]
pub(super) fn reflect(wo: Vec3s) -> Vec3s {
    Vec3s::new(-wo.x, -wo.y, wo.z)
}

impl Material for Mirror {
    const SPECULAR: bool = true;
    const KIND: MaterialKind = MaterialKind::Mirror;
    type Params = MirrorParams;

    #[inline(always)]
    fn fetch(table: &MaterialTable, material: U32s) -> MirrorParams {
        MirrorParams {
            reflectance: table.reflectance(material),
        }
    }

    #[inline(always)]
    fn tint(params: &mut Self::Params, by: Vec3s) {
        params.reflectance = params.reflectance.mul_elem(by);
    }

    #[inline(always)]
    fn eval(_: &MirrorParams, _: Vec3s, _: Vec3s) -> (Vec3s, F32s) {
        (Vec3s::zero(), F32s::splat(0.0))
    }

    #[inline(always)]
    fn sample(params: &MirrorParams, wo: Vec3s, _: [F32s; 3]) -> BsdfSample {
        BsdfSample {
            // A path in a hall of mirrors is nothing but this map, thousands of times over.
            wi: renormalize(reflect(wo)),
            weight: params.reflectance,
            pdf: F32s::splat(0.0),
            eta: F32s::splat(1.0),
            valid: Mask::ALL,
        }
    }
}
