//! camera hits → auxiliary sums: what the first hit looks like, for denoisers and debugging.

use super::surface::{gather_rays, surface};
use crate::compile::{CompiledScene, WorkItem};
use crate::geometry::PrimitiveId;
use crate::math::Compare;
use crate::math::lanes::{LANES, Mask, U32s, iota, load, load_u32};
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
        let (_, normal) = surface::<F>(scene, primitive, origin, direction, t);
        let flip = normal.dot(direction).to_array();
        let normal = [normal.x, normal.y, normal.z].map(|c| c.to_array());
        let path = load_u32(&wave.rays.path, at).to_array();
        for lane in first.lanes() {
            let sums = &mut wave.aux[(path[lane] / item.samples) as usize];
            let material = scene.surfaces.material[primitive.as_array()[lane] as usize];
            let side = if flip[lane] > 0.0 { -1.0 } else { 1.0 };
            for c in 0..3 {
                sums.albedo[c] += f64::from(scene.albedo[material as usize][c]);
                sums.normal[c] += f64::from(side * normal[c][lane]);
            }
            sums.depth += f64::from(t.as_array()[lane]);
        }
    }
}
