//! next rays → rays: survival, reweighting, compaction.

use crate::compile::{CompiledScene, Features};
use crate::math::Compare;
use crate::math::lanes::{F32s, LANES, Mask, U32s, load, load_u32};
use crate::sampler::{BOUNCE_DIMENSIONS, Dimension, Pcg32s};
use crate::wave::{Wave, state};

/// Most that roulette lets a path survive with, so that a path between perfect mirrors ends.
pub const MOST_SURVIVAL: f32 = 0.99;

/// Lets paths survive with the largest channel of their throughput (with the scaling of radiance
/// by refraction undone), from the scene's roulette depth on, and packs the survivors.
pub(super) fn roulette<const F: u32>(scene: &CompiledScene, wave: &mut Wave) {
    let next = &mut wave.next;
    wave.rays.len = 0;
    for at in (0..next.len).step_by(LANES) {
        let active = Mask::first(next.len - at);
        let throughput = next.throughput(at);
        let largest = throughput.max_elem();
        let mut alive = active & largest.gt(F32s::splat(0.0));
        let mut random = Pcg32s::from_states(
            next.random[at..at + LANES]
                .try_into()
                .expect("LANES states"),
        );
        // A ray of depth d leaves a hit at which d − 1 segments have been traced.
        let traced = (load_u32(&next.state, at) & U32s::splat(state::DEPTH)) - U32s::splat(1);
        let plays = alive & traced.ge(U32s::splat(scene.roulette_depth));
        let u = random.next_f32();
        if plays.any() {
            let mut survival = largest;
            if scene.on::<F>(Features::DIELECTRIC) {
                let eta = load(&next.eta, at);
                survival = survival * eta * eta;
            }
            let survival = survival.fast_min(F32s::splat(MOST_SURVIVAL));
            let survives = u.lt(survival);
            alive = alive & (survives | !plays);
            let scale = plays.select(F32s::splat(1.0) / survival, F32s::splat(1.0));
            next.set_throughput(at, throughput * scale);
        }
        const REST: u32 = BOUNCE_DIMENSIONS - Dimension::Roulette as u32 - 1;
        next.random[at..at + LANES].copy_from_slice(&random.skip::<REST>().states());
        wave.rays.append_lanes(next, at, alive);
    }
    next.len = 0;
}
