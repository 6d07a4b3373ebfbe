//! rays → hits: one batch call into the acceleration structure.

use crate::compile::CompiledScene;
use crate::wave::Wave;

/// Finds the closest hit of every ray.
pub(super) fn intersect(scene: &CompiledScene, wave: &mut Wave) {
    scene.accel.closest(
        wave.rays.batch(),
        wave.hits.batch(),
        &mut wave.counters.accel,
    );
    wave.hits.len = wave.rays.len;
}
