//! escaped rays → radiance: the constant background.

use super::emission::{emission_counts, is_specular};
use super::surface::gather_throughput;
use crate::compile::{CompiledScene, Features};
use crate::light;
use crate::math::lanes::{F32s, LANES, Mask, U32s, gather, gather_u32, load_u32};
use crate::math::{Vec3s, mis};
use crate::wave::{Wave, add_radiance};

/// Adds the background seen by rays that left the scene.
pub(super) fn shade_escaped<const F: u32>(scene: &CompiledScene, wave: &mut Wave) {
    let rays = &wave.rays;
    for at in (0..wave.escaped.len).step_by(LANES) {
        let active = Mask::first(wave.escaped.len - at);
        let ray = load_u32(&wave.escaped.index, at);
        let ray_state = gather_u32(&rays.state, ray);
        let mut weight = F32s::splat(1.0);
        if scene.on::<F>(Features::MIS) {
            let light = U32s::splat(scene.lights.background().unwrap_or(0));
            let light_pdf =
                light::pdf_background::<F>(&scene.lights, light, gather(&rays.cosine, ray));
            let shared = mis::power_heuristic(gather(&rays.pdf, ray), light_pdf);
            weight = is_specular(ray_state).select(weight, shared);
        }
        let counts = active & emission_counts::<F>(scene, ray_state);
        let throughput = gather_throughput(rays, ray);
        let radiance = throughput.mul_elem(Vec3s::splat(scene.background)) * weight;
        let path = gather_u32(&rays.path, ray);
        add_radiance(
            &mut wave.radiance,
            &mut wave.counters.rejected.emission,
            counts,
            path,
            radiance,
        );
    }
}
