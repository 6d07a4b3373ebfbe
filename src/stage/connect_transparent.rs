//! shadow rays → radiance, straight through glass: each boundary lets its transmittance pass and
//! bends nothing. A fast picture of the shadow of glass, and biased: caustics are lost.

use super::surface::{Surface, gather3, leave, left_behind, material, surface};
use crate::accel::{HitBatch, RayBatch};
use crate::compile::{CompiledScene, PrimitiveClass};
use crate::material::{Dielectric, Material, MaterialKind};
use crate::math::lanes::{F32s, LANES, Mask, U32s, iota, load, load_u32, store, store_u32};
use crate::math::{Compare, Vec3s};
use crate::wave::{Wave, add_radiance};

/// Boundaries of glass that one shadow ray may cross; beyond, it counts as occluded.
const MOST_CROSSINGS: u32 = 64;

/// Traces the shadow rays from boundary to boundary and adds the light of those that get through.
pub(super) fn connect_transparent<const F: u32>(scene: &CompiledScene, wave: &mut Wave) {
    for _ in 0..=MOST_CROSSINGS {
        if wave.shadows.len == 0 {
            break;
        }
        trace(scene, wave);
        let (shadows, hits) = (&mut wave.shadows, &wave.hits);
        wave.crossed.len = 0;
        for at in (0..shadows.len).step_by(LANES) {
            let active = Mask::first(shadows.len - at);
            let (t, t_max) = (load(&hits.t, at), load(&shadows.t_max, at));
            let primitive = load_u32(&hits.primitive, at);
            let blocked = t.lt(t_max) & !primitive.eq(load_u32(&shadows.target, at));
            let (path, radiance) = (shadows.paths(at), shadows.radiance(at));
            let rejected = &mut wave.counters.rejected.connect;
            add_radiance(
                &mut wave.radiance,
                rejected,
                active & !blocked,
                path,
                radiance,
            );

            let class = scene.surfaces.class.get(primitive);
            // Glass that is partly not there blocks: what passes is found by following rays alone.
            let kind = class & U32s::splat(PrimitiveClass::KIND | PrimitiveClass::PARTIAL);
            let crosses = active & blocked & kind.eq(U32s::splat(MaterialKind::Dielectric as u32));
            if crosses.none() {
                continue;
            }
            let index = U32s::splat(at as u32) + iota();
            let direction = gather3(
                [
                    &shadows.direction_x,
                    &shadows.direction_y,
                    &shadows.direction_z,
                ],
                index,
            );
            let origin = gather3(
                [&shadows.origin_x, &shadows.origin_y, &shadows.origin_z],
                index,
            );
            let Surface { point, normal, .. } =
                surface::<F>(scene, primitive, origin, direction, t);
            let params = Dielectric::fetch(&scene.materials, material(scene, primitive));
            let passes = Dielectric::transmittance(&params, -direction.dot(normal));
            let origin = leave::<F>(scene, &point, normal, direction);
            let radiance: Vec3s = radiance * (passes / load(&shadows.weight, at));
            store(&mut shadows.weight, at, F32s::splat(1.0));
            store(&mut shadows.origin_x, at, origin.x);
            store(&mut shadows.origin_y, at, origin.y);
            store(&mut shadows.origin_z, at, origin.z);
            store(&mut shadows.t_max, at, t_max - t);
            store_u32(&mut shadows.skip, at, left_behind::<F>(scene, primitive));
            store(&mut shadows.radiance_r, at, radiance.x);
            store(&mut shadows.radiance_g, at, radiance.y);
            store(&mut shadows.radiance_b, at, radiance.z);
            wave.crossed
                .append_lanes(shadows, at, crosses & passes.gt(F32s::splat(0.0)));
        }
        std::mem::swap(&mut wave.shadows, &mut wave.crossed);
    }
    wave.shadows.len = 0;
}

/// Closest hits of the shadow rays; the hit queue is free once its hits are shaded.
fn trace(scene: &CompiledScene, wave: &mut Wave) {
    let shadows = &wave.shadows;
    let rays = RayBatch {
        len: shadows.len,
        origin: [&shadows.origin_x, &shadows.origin_y, &shadows.origin_z],
        direction: [
            &shadows.direction_x,
            &shadows.direction_y,
            &shadows.direction_z,
        ],
        skip: &shadows.skip,
    };
    let hits = HitBatch {
        t: &mut wave.hits.t,
        primitive: &mut wave.hits.primitive,
    };
    scene.accel.closest(rays, hits, &mut wave.counters.accel);
}
