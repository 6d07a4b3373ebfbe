//! Which emission a path may count, so that nothing is counted twice or left out.

use crate::compile::{CompiledScene, Features};
use crate::math::Compare;
use crate::math::lanes::{F32s, Mask, U32s};
use crate::scene::Strategy;
use crate::wave::state;

/// Whether emission found by rays with this packed state counts.
///
/// Emission seen by the camera or by a delta lobe always does, but for what a transparent shadow
/// ray has brought already; emission found by another lobe does unless lights are only sampled.
#[inline(always)]
pub(super) fn emission_counts<const F: u32>(scene: &CompiledScene, ray_state: U32s) -> Mask {
    let mut counts = match scene.strategy {
        Strategy::Nee => is_specular(ray_state),
        Strategy::Mis | Strategy::Bsdf => Mask::ALL,
    };
    if scene.on::<F>(Features::TRANSPARENT_SHADOWS) {
        counts = counts & !has(ray_state, state::THROUGH_GLASS);
    }
    counts
}

/// Expected number of a hit's light samples per unit of solid angle, of which each has density `pdf`: what
/// multiple importance sampling weighs against the one sampled direction (Veach 1997, section 9.2.2).
#[inline(always)]
pub(super) fn expected_samples<const F: u32>(scene: &CompiledScene, pdf: F32s) -> F32s {
    if scene.on::<F>(Features::LIGHT_SAMPLES) {
        pdf * F32s::splat(scene.branching.light_samples as f32)
    } else {
        pdf
    }
}

/// Whether the rays come from a delta lobe or the camera.
#[inline(always)]
pub(super) fn is_specular(ray_state: U32s) -> Mask {
    has(ray_state, state::SPECULAR)
}

/// Whether `bit` is set.
#[inline(always)]
pub(super) fn has(ray_state: U32s, bit: u32) -> Mask {
    (ray_state & U32s::splat(bit)).eq(U32s::splat(bit))
}
