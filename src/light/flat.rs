//! Triangles and parallelograms, sampled uniformly by area.
//!
//! With the area A and the cosine at the light, the density per steradian is d²/(A·|cos|). Next to
//! the light it has no finite variance on its own: combine it with direction sampling.
//!
//! Source: Shirley, Wang, Zimmerman, "Monte Carlo Techniques for Direct Lighting Calculations", ACM
//! TOG 15(1), 1996, section 3.2.

use super::{FlatLight, LightSample, LightTable, Row};
use crate::math::warp::triangle_or_square;
use crate::math::{Compare, F32s, Mask, U32s, Vec3s};

/// edge 1 × edge 2, in f64.
fn area_vector(light: &FlatLight) -> [f64; 3] {
    let [a, b] = light.edges.map(|edge| edge.map(f64::from));
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Area.
pub(super) fn area(light: &FlatLight) -> f64 {
    let parallelogram = area_vector(light).iter().map(|x| x * x).sum::<f64>().sqrt();
    if light.is_triangle {
        0.5 * parallelogram
    } else {
        parallelogram
    }
}

/// The columns' entries.
pub(super) fn row(light: &FlatLight) -> Row {
    let normal = area_vector(light);
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    let area = area(light);
    Row {
        radiance: light.radiance,
        two_sided: light.two_sided,
        // A light without area has no power and is never chosen.
        density: if area > 0.0 { 1.0 / area } else { 0.0 },
        position: light.corner,
        edges: light.edges,
        normal: if length > 0.0 {
            normal.map(|x| (x / length) as f32)
        } else {
            [0.0; 3]
        },
        fold: if light.is_triangle { 0.5 } else { 0.0 },
        primitives: if light.is_triangle {
            [light.primitives[0]; 2]
        } else {
            light.primitives
        },
        ..Row::default()
    }
}

/// The density per steradian that belongs to `density` per area.
#[inline(always)]
fn per_steradian(density: F32s, cos: F32s, distance: F32s) -> F32s {
    density * (distance * distance) / cos.abs()
}

/// A point on the light and the direction to it.
#[inline(always)]
pub(super) fn sample<const KINDS: u32>(
    lights: &LightTable,
    light: U32s,
    p: Vec3s,
    u1: F32s,
    u2: F32s,
) -> LightSample {
    let zero = F32s::splat(0.0);
    let (b1, b2) = triangle_or_square(lights.get::<KINDS, f32>(&lights.fold, light), u1, u2);
    let to_light = (lights.get3::<KINDS>(&lights.position, light) - p)
        .add_scaled(lights.get3::<KINDS>(&lights.edge1, light), b1)
        .add_scaled(lights.get3::<KINDS>(&lights.edge2, light), b2);
    let distance = to_light.length_squared().sqrt();
    let direction = to_light * (F32s::splat(1.0) / distance);
    let cos = -direction.dot(lights.get3::<KINDS>(&lights.normal, light));
    let two_sided = lights.get::<KINDS, f32>(&lights.back, light).gt(zero);
    let first = b1.ge(b2);
    LightSample {
        direction,
        distance,
        radiance: lights.get3::<KINDS>(&lights.radiance, light),
        pdf: per_steradian(
            lights.get::<KINDS, f32>(&lights.density, light),
            cos,
            distance,
        ),
        delta: Mask::NONE,
        primitive: first.select_u32(
            lights.get::<KINDS, u32>(&lights.primitives[0], light),
            lights.get::<KINDS, u32>(&lights.primitives[1], light),
        ),
        valid: cos.gt(zero) | (two_sided & cos.lt(zero)),
    }
}

/// Density per steradian with which [`super::sample`] finds a point of a flat light at `distance`
/// along the unit vector `direction`, from either side.
#[inline(always)]
pub fn pdf_flat<const KINDS: u32>(
    lights: &LightTable,
    light: U32s,
    direction: Vec3s,
    distance: F32s,
) -> F32s {
    let cos = -direction.dot(lights.get3::<KINDS>(&lights.normal, light));
    per_steradian(
        lights.get::<KINDS, f32>(&lights.density, light),
        cos,
        distance,
    )
}
