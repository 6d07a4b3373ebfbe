//! hits → one queue per kind of material in the scene, escaped rays, emitter hits.

use crate::compile::{CompiledScene, PrimitiveClass};
use crate::geometry::PrimitiveId;
use crate::math::Compare;
use crate::math::lanes::{LANES, Mask, U32s, compress_u32, iota, load_u32};
use crate::wave::{IndexQueue, MATERIAL_KINDS, Wave, count_depths, state};

/// Puts each hit's index where it belongs. Hits at the depth limit are not shaded.
pub(super) fn sort(scene: &CompiledScene, wave: &mut Wave) {
    for queue in wave
        .by_material
        .iter_mut()
        .chain([&mut wave.emitters, &mut wave.escaped])
    {
        queue.len = 0;
    }
    let none = U32s::splat(PrimitiveId::NONE);
    for at in (0..wave.rays.len).step_by(LANES) {
        let active = Mask::first(wave.rays.len - at);
        let index = U32s::splat(at as u32) + iota();
        let depth = load_u32(&wave.rays.state, at) & U32s::splat(state::DEPTH);
        count_depths(&mut wave.counters.rays, depth, active);
        let primitive = load_u32(&wave.hits.primitive, at);
        let hit = active & !primitive.eq(none);
        push(&mut wave.escaped, active & !hit, index);
        if hit.none() {
            continue;
        }
        let class = scene.surfaces.class.get(primitive);
        let emits = hit & !(class & U32s::splat(PrimitiveClass::EMITS)).eq(U32s::splat(0));
        push(&mut wave.emitters, emits, index);
        let mut shaded = hit;
        if let Some(limit) = scene.max_depth {
            let at_limit = hit & depth.ge(U32s::splat(limit));
            let black = (class & U32s::splat(PrimitiveClass::KIND)).eq(U32s::splat(0));
            wave.counters.truncated += (at_limit & !black).count() as u64;
            shaded = hit & !at_limit;
        }
        let kind = class & U32s::splat(PrimitiveClass::KIND);
        // Kind 0 is black: it scatters nothing.
        for k in 1..MATERIAL_KINDS {
            push(
                &mut wave.by_material[k],
                shaded & kind.eq(U32s::splat(k as u32)),
                index,
            );
        }
    }
}

/// Appends indices to a queue, unless the scene has nothing for it.
#[inline(always)]
fn push(queue: &mut IndexQueue, mask: Mask, index: U32s) {
    if mask.any() && queue.index.len() > LANES {
        compress_u32(&mut queue.index, queue.len, mask, index);
        queue.len += mask.count();
    }
}
