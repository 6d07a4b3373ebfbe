//! A black body: absorbs everything. The material of pure emitters.
//!
//! It has no parameters.

use super::{BsdfSample, Material, MaterialTable};
use crate::math::{F32s, Mask, U32s, Vec3s};

/// Absorbs everything.
#[derive(Debug, Clone, Copy)]
pub struct Black;

impl Material for Black {
    const SPECULAR: bool = true;
    type Params = ();

    #[inline(always)]
    fn fetch(_: &MaterialTable, _: U32s) {}

    #[inline(always)]
    fn eval((): &(), _: Vec3s, _: Vec3s) -> (Vec3s, F32s) {
        (Vec3s::zero(), F32s::splat(0.0))
    }

    #[inline(always)]
    fn sample((): &(), _: Vec3s, _: [F32s; 3]) -> BsdfSample {
        let zero = F32s::splat(0.0);
        BsdfSample {
            wi: Vec3s::zero(),
            weight: Vec3s::zero(),
            pdf: zero,
            eta: F32s::splat(1.0),
            valid: Mask::NONE,
        }
    }
}
