//! Isotropic points: one direction, irradiance I/d² across it.

use super::{LightSample, LightTable, PointLight, Row};
use crate::geometry::PrimitiveId;
use crate::math::{Compare, F32s, Mask, U32s, Vec3s};

/// The columns' entries.
pub(super) fn row(light: &PointLight) -> Row {
    Row {
        radiance: light.intensity,
        density: 1.0,
        position: light.position,
        primitives: [PrimitiveId::NONE; 2],
        ..Row::default()
    }
}

/// The direction to the point.
#[inline(always)]
pub(super) fn sample<const KINDS: u32>(lights: &LightTable, light: U32s, p: Vec3s) -> LightSample {
    let to_light = lights.get3::<KINDS>(&lights.position, light) - p;
    let distance2 = to_light.length_squared();
    let inverse2 = F32s::splat(1.0) / distance2;
    LightSample {
        direction: to_light * inverse2.sqrt(),
        distance: distance2.sqrt(),
        radiance: lights.get3::<KINDS>(&lights.radiance, light) * inverse2,
        pdf: lights.get::<KINDS, f32>(&lights.density, light),
        delta: Mask::ALL,
        primitive: U32s::splat(PrimitiveId::NONE),
        // At the point itself there is no direction.
        valid: distance2.gt(F32s::splat(0.0)),
    }
}
