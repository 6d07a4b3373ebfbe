//! shadow rays → radiance: what nothing occludes arrives.

use crate::compile::CompiledScene;
use crate::math::Compare;
use crate::math::lanes::{LANES, Mask, U32s, load_u32};
use crate::wave::{Wave, add_radiance};

/// Traces the shadow rays and adds the light of those that are free.
pub(super) fn connect(scene: &CompiledScene, wave: &mut Wave) {
    let (batch, occluded) = wave.shadows.batch();
    scene
        .accel
        .occluded(batch, occluded, &mut wave.counters.accel);
    let shadows = &wave.shadows;
    for at in (0..shadows.len).step_by(LANES) {
        let active = Mask::first(shadows.len - at);
        let free = active & load_u32(&shadows.occluded, at).eq(U32s::splat(0));
        let (path, radiance) = (shadows.paths(at), shadows.radiance(at));
        add_radiance(
            &mut wave.radiance,
            &mut wave.counters.rejected.connect,
            free,
            path,
            radiance,
        );
    }
    wave.shadows.len = 0;
}
