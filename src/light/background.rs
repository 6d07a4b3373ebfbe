//! Constant background, sampled in proportion to the cosine about the shading normal: the density
//! that has no variance at a Lambertian surface without obstacles.

use std::f64::consts::PI;

use super::{BackgroundLight, LightSample, LightTable, Row};
use crate::geometry::PrimitiveId;
use crate::math::warp::cosine_hemisphere;
use crate::math::{Compare, F32s, Frame, Mask, U32s, Vec3s};

/// The columns' entries.
pub(super) fn row(light: &BackgroundLight) -> Row {
    Row {
        radiance: light.radiance,
        density: 1.0 / PI,
        primitives: [PrimitiveId::NONE; 2],
        ..Row::default()
    }
}

/// A direction above the surface with unit normal `n`.
#[inline(always)]
pub(super) fn sample<const KINDS: u32>(
    lights: &LightTable,
    light: U32s,
    n: Vec3s,
    u1: F32s,
    u2: F32s,
) -> LightSample {
    let direction = Frame::from_normal(n).to_world(cosine_hemisphere(u1, u2));
    let pdf = pdf_background::<KINDS>(lights, light, n.dot(direction));
    LightSample {
        direction,
        distance: F32s::splat(f32::INFINITY),
        radiance: lights.get3::<KINDS>(&lights.radiance, light),
        pdf,
        delta: Mask::NONE,
        primitive: U32s::splat(PrimitiveId::NONE),
        valid: pdf.gt(F32s::splat(0.0)),
    }
}

/// Density per steradian with which [`super::sample`] finds a direction to the background whose cosine
/// to the shading normal is `cos`: choice·cos⁺/π.
#[inline(always)]
pub fn pdf_background<const KINDS: u32>(lights: &LightTable, light: U32s, cos: F32s) -> F32s {
    lights.get::<KINDS, f32>(&lights.density, light) * cos.fast_max(F32s::splat(0.0))
}
