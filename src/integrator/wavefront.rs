//! The driver loop of the wavefront: the order of the stages, and nothing but the order.

use super::clock::{StageClock, Step};
use crate::compile::{CompiledScene, WorkItem};
use crate::stage::Kernels;
use crate::wave::Wave;

/// Traces all paths of `item`; their radiance is then in `wave.radiance`.
pub fn trace(
    scene: &CompiledScene,
    kernels: &Kernels,
    item: &WorkItem,
    wave: &mut Wave,
    clock: &mut StageClock,
) -> Passes {
    let mut passes = Passes::default();
    wave.begin(item);
    while wave.is_busy(item) {
        let started = wave.next_path;
        clock.run(Step::Generate, 0, || (kernels.generate)(scene, item, wave));
        clock.items[Step::Generate as usize] += u64::from(wave.next_path - started);

        let rays = wave.rays.len;
        passes.add(rays);
        clock.run(Step::Intersect, rays, || (kernels.intersect)(scene, wave));
        clock.run(Step::Sort, rays, || (kernels.sort)(scene, wave));

        let seen = wave.escaped.len + wave.emitters.len;
        clock.run(Step::Emission, seen, || {
            if let Some(record_aux) = kernels.record_aux {
                record_aux(scene, item, wave);
            }
            if let Some(shade_escaped) = kernels.shade_escaped {
                shade_escaped(scene, wave);
            }
            if let Some(shade_emission) = kernels.shade_emission {
                shade_emission(scene, wave);
            }
        });

        let shaded = wave.by_material.iter().map(|queue| queue.len).sum();
        clock.run(Step::Shade, shaded, || {
            for shade in kernels.shade.iter().flatten() {
                shade(scene, item, wave);
            }
        });

        if let Some(connect) = kernels.connect {
            clock.run(Step::Connect, wave.shadows.len, || connect(scene, wave));
        }
        clock.run(Step::Roulette, wave.next.len, || {
            (kernels.roulette)(scene, wave)
        });
    }
    passes
}

/// How often the loop went round, and with how many rays.
#[derive(Debug, Clone, Copy, Default)]
pub struct Passes {
    /// Rounds of the loop.
    pub count: u64,
    /// Rays over all rounds.
    pub rays: u64,
}

impl Passes {
    fn add(&mut self, rays: usize) {
        self.count += 1;
        self.rays += rays as u64;
    }
}
