//! emitter hits → radiance: light found by following a ray.

use super::emission::{emission_counts, is_specular};
use super::surface::{Surface, gather_rays, gather_throughput, surface};
use crate::compile::{CompiledScene, Features};
use crate::light::{self, Receiver};
use crate::math::lanes::{F32s, LANES, Mask, gather, gather_u32, load_u32};
use crate::math::{Vec3s, mis};
use crate::wave::{Wave, add_radiance};

/// Adds what the emitters that were hit send along the rays.
pub(super) fn shade_emission<const F: u32>(scene: &CompiledScene, wave: &mut Wave) {
    let rays = &wave.rays;
    for at in (0..wave.emitters.len).step_by(LANES) {
        let active = Mask::first(wave.emitters.len - at);
        let ray = load_u32(&wave.emitters.index, at);
        let ray_state = gather_u32(&rays.state, ray);
        let counts = active & emission_counts::<F>(scene, ray_state);
        if counts.none() {
            continue;
        }
        let (origin, direction) = gather_rays(rays, ray);
        let primitive = gather_u32(&wave.hits.primitive, ray);
        let t = gather(&wave.hits.t, ray);
        let light = scene.surfaces.light.get(primitive);
        let Surface { point, normal, .. } = surface::<F>(scene, primitive, origin, direction, t);
        let mut weight = F32s::splat(1.0);
        if scene.on::<F>(Features::MIS) {
            let receiver = Receiver {
                p: origin,
                // Read for the background alone, which is not hit here.
                n: normal,
                primitive: gather_u32(&rays.skip, ray),
            };
            let light_pdf = light::pdf::<F>(&scene.lights, light, &receiver, point.p, direction, t);
            let shared = mis::power_heuristic(gather(&rays.pdf, ray), light_pdf);
            weight = is_specular(ray_state).select(weight, shared);
        }
        let emitted: Vec3s = light::emitted::<F>(&scene.lights, light, -direction.dot(normal));
        let radiance = gather_throughput(rays, ray).mul_elem(emitted) * weight;
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
