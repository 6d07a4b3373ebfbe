//! The uniform numbers of a vector of samples, from the scene's sampler.

use crate::compile::{CompiledScene, Features, WorkItem};
use crate::math::lanes::{F32s, U32s};
use crate::sampler::{BOUNCE_DIMENSIONS, CAMERA_DIMENSIONS, Pcg32s, Sobol, Strata};
use crate::wave::state;

/// How the samples are spread.
#[derive(Clone, Copy)]
enum Points {
    Independent,
    Stratified(Strata),
    Sobol(Sobol),
}

impl Points {
    #[inline(always)]
    fn new<const F: u32>(
        scene: &CompiledScene,
        item: &WorkItem,
        pixel_and_sample: impl FnOnce() -> (U32s, U32s),
    ) -> Self {
        if scene.on::<F>(Features::STRATIFIED) {
            let (pixel, sample) = pixel_and_sample();
            Self::Stratified(Strata::new(
                scene.seed,
                pixel,
                item.block,
                item.samples,
                sample,
            ))
        } else if scene.on::<F>(Features::SOBOL) {
            let (pixel, sample) = pixel_and_sample();
            Self::Sobol(Sobol::new(scene.seed, pixel, item.first_sample, sample))
        } else {
            Self::Independent
        }
    }
}

/// Numbers in [0, 1) of the camera or of one hit, by dimension from the first of them.
#[derive(Clone, Copy)]
pub(super) struct Numbers {
    /// Generators at the first dimension.
    random: Pcg32s,
    points: Points,
    /// The first dimension, of the points.
    first: U32s,
}

impl Numbers {
    /// Those of the camera, for these samples of the pixels.
    #[inline(always)]
    pub(super) fn of_camera<const F: u32>(
        scene: &CompiledScene,
        item: &WorkItem,
        random: Pcg32s,
        pixel: U32s,
        sample: U32s,
    ) -> Self {
        Self {
            random,
            points: Points::new::<F>(scene, item, || (pixel, sample)),
            first: U32s::splat(0),
        }
    }

    /// Those of the hits of rays with these packed states: dimensions count from the camera's through those
    /// of the earlier hits. The branches of a split path have the same points, and generators of their own.
    #[inline(always)]
    pub(super) fn of_hit<const F: u32>(
        scene: &CompiledScene,
        item: &WorkItem,
        random: Pcg32s,
        path: U32s,
        ray_state: U32s,
    ) -> Self {
        let points = Points::new::<F>(scene, item, || {
            let (x, y, sample) = item.locate(path);
            (y * U32s::splat(item.image_width) + x, sample)
        });
        let bounce = (ray_state & U32s::splat(state::DEPTH)) - U32s::splat(1);
        Self {
            random,
            points,
            first: bounce * U32s::splat(BOUNCE_DIMENSIONS) + U32s::splat(CAMERA_DIMENSIONS),
        }
    }

    /// Those of light sample `i` of the `count` of a hit: together they are spread as `count` times as many
    /// samples are.
    #[inline(always)]
    pub(super) fn of_light_sample(&self, count: u32, i: u32) -> Self {
        Self {
            random: if i == 0 {
                self.random
            } else {
                self.random.fork(i)
            },
            points: match self.points {
                Points::Independent => Points::Independent,
                Points::Stratified(strata) => Points::Stratified(strata.refined(count, i)),
                Points::Sobol(sobol) => Points::Sobol(sobol.refined(count, i)),
            },
            ..*self
        }
    }

    /// The number of the dimension with offset `AT` from the first.
    #[inline(always)]
    pub(super) fn one<const AT: u32>(&self) -> F32s {
        let uniform = || self.random.skip::<AT>().next_f32();
        let dimension = self.first + U32s::splat(AT);
        match self.points {
            Points::Independent => uniform(),
            Points::Stratified(strata) => strata.one(dimension, uniform()),
            Points::Sobol(sobol) => sobol.one(dimension),
        }
    }

    /// The numbers of the dimensions with offsets `AT` and `AT` + 1.
    #[inline(always)]
    pub(super) fn pair<const AT: u32>(&self) -> [F32s; 2] {
        let uniform = || {
            let mut random = self.random.skip::<AT>();
            [random.next_f32(), random.next_f32()]
        };
        let dimension = self.first + U32s::splat(AT);
        match self.points {
            Points::Independent => uniform(),
            Points::Stratified(strata) => strata.pair(dimension, uniform()),
            Points::Sobol(sobol) => sobol.pair(dimension),
        }
    }
}
