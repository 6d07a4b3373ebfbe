//! Spheres: from outside, sampled uniformly within the cone that the sphere fills; from inside or on
//! it, uniformly by area.
//!
//! With s = R/d, 1 − cos θ_max = s²/(1 + √(1 − s²)), which keeps its precision for tiny and distant
//! spheres where 1 − cos in f32 is 0.
//!
//! Source: Shirley, Wang, Zimmerman, "Monte Carlo Techniques for Direct Lighting Calculations", ACM
//! TOG 15(1), 1996, section 3.1; Pharr, Jakob, Humphreys, "Physically Based Rendering", 4th ed.,
//! section 6.2.4.

use std::f64::consts::PI;

use super::{LightSample, LightTable, Receiver, Row, SphereLight};
use crate::math::warp::{uniform_cone, uniform_sphere};
use crate::math::{Compare, F32s, Frame, Mask, U32s, Vec3s};

/// The columns' entries.
pub(super) fn row(light: &SphereLight) -> Row {
    Row {
        radiance: light.radiance,
        two_sided: light.two_sided,
        density: 0.5 / PI,
        position: light.center,
        radius: light.radius,
        primitives: [light.primitive; 2],
        ..Row::default()
    }
}

/// The sphere as it is seen from a reference point.
struct View {
    radius: F32s,
    /// Centre minus reference point, and its squared length.
    to_center: Vec3s,
    distance2: F32s,
    /// s² = (R/d)².
    sin2_max: F32s,
    /// 1 − cos θ_max, of points outside.
    one_minus_cos_max: F32s,
    outside: Mask,
    /// Choice probability / 2π.
    density: F32s,
}

impl View {
    #[inline(always)]
    fn new<const KINDS: u32>(lights: &LightTable, light: U32s, at: &Receiver) -> Self {
        let (zero, one) = (F32s::splat(0.0), F32s::splat(1.0));
        let radius = lights.get::<KINDS>(&lights.radius, light);
        let to_center = lights.get3::<KINDS>(&lights.position, light) - at.p;
        let distance2 = to_center.length_squared();
        let sin2_max = radius * radius / distance2;
        let own = at
            .primitive
            .eq(lights.get_u32::<KINDS>(&lights.primitives[0], light));
        let cos_max = (one - sin2_max).fast_max(zero).sqrt();
        Self {
            radius,
            to_center,
            distance2,
            sin2_max,
            one_minus_cos_max: sin2_max / (one + cos_max),
            outside: sin2_max.lt(one) & !own,
            density: lights.get::<KINDS>(&lights.density, light),
        }
    }

    /// Density per steradian in the cone.
    #[inline(always)]
    fn pdf_outside(&self) -> F32s {
        self.density / self.one_minus_cos_max
    }

    /// Density per steradian of area sampling, choice/(4πR²)·d²/|cos|.
    #[inline(always)]
    fn pdf_inside(&self, cos: F32s, distance: F32s) -> F32s {
        self.density * (distance * distance)
            / (F32s::splat(2.0) * self.radius * self.radius * cos.abs())
    }
}

/// A direction to the sphere.
#[inline(always)]
pub(super) fn sample<const KINDS: u32>(
    lights: &LightTable,
    light: U32s,
    at: &Receiver,
    u1: F32s,
    u2: F32s,
) -> LightSample {
    let (zero, one) = (F32s::splat(0.0), F32s::splat(1.0));
    let view = View::new::<KINDS>(lights, light, at);
    let center_distance = view.distance2.sqrt();
    let local = uniform_cone(view.one_minus_cos_max, u1, u2);
    let sin2 = local.x.mul_add(local.x, local.y * local.y);
    // To the nearer of the two points where the ray meets the sphere.
    let half_chord = (view.sin2_max - sin2).fast_max(zero).sqrt();
    let distance = center_distance * (local.z - half_chord).fast_max(zero);
    let axis = view.to_center * (one / center_distance);
    let mut found = LightSample {
        direction: Frame::from_normal(axis).to_world(local),
        distance,
        radiance: lights.get3::<KINDS>(&lights.radiance, light),
        pdf: view.pdf_outside(),
        delta: Mask::NONE,
        primitive: lights.get_u32::<KINDS>(&lights.primitives[0], light),
        valid: view.outside,
    };
    if view.outside != Mask::ALL {
        let outward = uniform_sphere(u1, u2);
        let to_light = view.to_center.add_scaled(outward, view.radius);
        let distance = to_light.length_squared().sqrt();
        let direction = to_light * (one / distance);
        let cos = direction.dot(outward);
        let two_sided = lights.get::<KINDS>(&lights.back, light).gt(zero);
        let inside = LightSample {
            direction,
            distance,
            pdf: view.pdf_inside(cos, distance),
            valid: two_sided & cos.gt(zero),
            ..found
        };
        found = LightSample::select(view.outside, found, inside);
    }
    found
}

/// Density per steradian with which [`super::sample`] finds, from the receivers, the point `hit` of a
/// sphere light, `distance` along the unit vector `direction`.
#[inline(always)]
pub fn pdf_sphere<const KINDS: u32>(
    lights: &LightTable,
    light: U32s,
    at: &Receiver,
    hit: Vec3s,
    direction: Vec3s,
    distance: F32s,
) -> F32s {
    let view = View::new::<KINDS>(lights, light, at);
    let outward = hit - lights.get3::<KINDS>(&lights.position, light);
    let cos = direction.dot(outward) / view.radius;
    view.outside
        .select(view.pdf_outside(), view.pdf_inside(cos, distance))
}
