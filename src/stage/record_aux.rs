//! camera hits → auxiliary sums: what the first hit looks like, for denoisers and debugging.

use super::appearance::{reflectance_factor, shading_normal};
use super::surface::{gather_rays, material, surface};
use crate::compile::{CompiledScene, Features, WorkItem};
use crate::geometry::PrimitiveId;
use crate::math::lanes::{LANES, Mask, U32s, iota, load, load_u32};
use crate::math::{Compare, F32s, Vec3s};
use crate::wave::{Wave, state};

/// Adds albedo, normal and depth of the camera rays' hits to their pixels.
pub(super) fn record_aux<const F: u32>(scene: &CompiledScene, item: &WorkItem, wave: &mut Wave) {
    for at in (0..wave.rays.len).step_by(LANES) {
        let active = Mask::first(wave.rays.len - at);
        let depth = load_u32(&wave.rays.state, at) & U32s::splat(state::DEPTH);
        let primitive = load_u32(&wave.hits.primitive, at);
        let first =
            active & depth.eq(U32s::splat(1)) & !primitive.eq(U32s::splat(PrimitiveId::NONE));
        if first.none() {
            continue;
        }
        let (origin, direction) = gather_rays(&wave.rays, U32s::splat(at as u32) + iota());
        let t = load(&wave.hits.t, at);
        let surface = surface::<F>(scene, primitive, origin, direction, t);
        let behind = surface.normal.dot(direction).gt(F32s::splat(0.0));
        let mut normal = Vec3s::select(behind, -surface.normal, surface.normal);
        if scene.on::<F>(Features::MESH_NORMALS) {
            (normal, _) = shading_normal(scene, primitive, surface.weights, normal, -direction);
        }
        let material = material(scene, primitive);
        let mut factor = Vec3s::splat([1.0; 3]);
        if scene.on::<F>(Features::TEXTURES) {
            factor = reflectance_factor(scene, primitive, material, &surface);
        }
        let normal = [normal.x, normal.y, normal.z].map(F32s::to_array);
        let factor = [factor.x, factor.y, factor.z].map(F32s::to_array);
        let path = load_u32(&wave.rays.path, at).to_array();
        for lane in first.lanes() {
            let sums = &mut wave.aux[(path[lane] / item.samples) as usize];
            let albedo = scene.albedo[material.as_array()[lane] as usize];
            let albedo = albedo.under([0, 1, 2].map(|k| factor[k][lane]));
            for (sum, albedo) in sums.albedo.iter_mut().zip(albedo) {
                *sum += f64::from(albedo);
            }
            for (sum, normal) in sums.normal.iter_mut().zip(&normal) {
                *sum += f64::from(normal[lane]);
            }
            sums.depth += f64::from(t.as_array()[lane]);
        }
    }
}
