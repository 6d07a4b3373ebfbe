//! material queue → shadow rays and next rays: one generic stage, compiled once per material.
//!
//! A specular material has no light sampling in it at all.

use super::emission::has;
use super::surface::{gather_rays, gather_throughput, material, surface};
use crate::compile::{CompiledScene, Features, WorkItem};
use crate::geometry::{SurfacePoint, spawn_origin};
use crate::light::{self, Receiver};
use crate::material::{BsdfSample, Material};
use crate::math::lanes::{
    F32s, LANES, Mask, U32s, compress, compress_u32, gather, gather_u32, gather_u64, load_u32,
    store, store_u32,
};
use crate::math::{Compare, Frame, Vec3s, mis};
use crate::sampler::{BOUNCE_DIMENSIONS, CAMERA_DIMENSIONS, Dimension, Pcg32s, Strata};
use crate::scene::Strategy;
use crate::wave::{RayQueue, Wave, count_depths, state};

/// What a chunk of hits has in common with what leaves it.
struct Hits {
    active: Mask,
    primitive: U32s,
    point: SurfacePoint,
    /// Unit geometric normal; on the ray's side unless the material transmits.
    normal: Vec3s,
    frame: Frame,
    /// Towards where the ray came from, in the frame.
    wo: Vec3s,
    throughput: Vec3s,
    path: U32s,
    state: U32s,
    eta: F32s,
    /// Generators at the first dimension of the hit.
    random: Pcg32s,
}

/// Strata of the chunk's samples with the first dimension of the hit, if sampling is stratified.
#[derive(Clone, Copy)]
struct HitStrata(Option<(Strata, U32s)>);

impl HitStrata {
    #[inline(always)]
    fn one(self, dimension: Dimension, u: F32s) -> F32s {
        match self.0 {
            Some((strata, first)) => strata.one(first + U32s::splat(dimension as u32), u),
            None => u,
        }
    }

    #[inline(always)]
    fn pair(self, dimension: Dimension, u: [F32s; 2]) -> [F32s; 2] {
        match self.0 {
            Some((strata, first)) => strata.pair(first + U32s::splat(dimension as u32), u),
            None => u,
        }
    }
}

/// Which ray of a hit a round over the queue sends on.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Branch {
    /// The one that the material samples.
    Sampled,
    /// The first of two, or a sampled one where the path may not split any more.
    First,
    /// The second of two.
    Second,
}

/// Shades the hits of the queue of `M`'s kind: sends shadow rays to sampled lights and appends the
/// next ray of each path, with zero throughput where the path ends.
pub(super) fn shade<M: Material, const F: u32>(
    scene: &CompiledScene,
    item: &WorkItem,
    wave: &mut Wave,
) {
    let whitted = scene.on::<F>(Features::WHITTED);
    // All first branches come before all second ones, so that the order of a path's rays does not
    // depend on which vector of lanes it happens to be in.
    let branches: &[Branch] = if whitted && M::TRANSMISSIVE {
        &[Branch::First, Branch::Second]
    } else {
        &[Branch::Sampled]
    };
    for &branch in branches {
        for at in (0..wave.by_material[M::KIND as usize].len).step_by(LANES) {
            let hits = Hits::fetch::<M, F>(scene, wave, at);
            let strata = strata::<F>(scene, item, &hits);
            let params = M::fetch(&scene.materials, material(scene, hits.primitive));
            if !M::SPECULAR && scene.on::<F>(Features::SHADOW_RAYS) {
                sample_light::<M, F>(scene, &hits, strata, &params, wave);
            }
            if whitted && !M::SPECULAR {
                continue;
            }
            match branch {
                Branch::Sampled => {
                    let sample = M::sample(&params, hits.wo, direction_numbers(&hits, strata));
                    let random = hits.random;
                    continue_path::<M, F>(
                        scene,
                        &hits,
                        &sample,
                        random,
                        hits.state,
                        &mut wave.next,
                    );
                }
                Branch::First | Branch::Second => {
                    follow_split::<M, F>(scene, &hits, strata, &params, branch, &mut wave.next);
                }
            }
        }
    }
}

impl Hits {
    /// The hits at `at ..` of the queue of `M`'s kind.
    #[inline(always)]
    fn fetch<M: Material, const F: u32>(scene: &CompiledScene, wave: &Wave, at: usize) -> Self {
        let queue = &wave.by_material[M::KIND as usize];
        let rays = &wave.rays;
        let ray = load_u32(&queue.index, at);
        let (origin, direction) = gather_rays(rays, ray);
        let primitive = gather_u32(&wave.hits.primitive, ray);
        let t = gather(&wave.hits.t, ray);
        let (point, outward) = surface::<F>(scene, primitive, origin, direction, t);
        let normal = if M::TRANSMISSIVE {
            outward
        } else {
            let behind = outward.dot(direction).gt(F32s::splat(0.0));
            Vec3s::select(behind, -outward, outward)
        };
        let frame = Frame::from_normal(normal);
        Self {
            active: Mask::first(queue.len - at),
            primitive,
            point,
            normal,
            wo: frame.to_local(-direction),
            frame,
            throughput: gather_throughput(rays, ray),
            path: gather_u32(&rays.path, ray),
            state: gather_u32(&rays.state, ray),
            eta: if scene.on::<F>(Features::DIELECTRIC) {
                gather(&rays.eta, ray)
            } else {
                F32s::splat(1.0)
            },
            random: Pcg32s::from_states(gather_u64(&rays.random, ray)),
        }
    }
}

/// The chunk's strata: dimensions count from the camera's through those of the earlier hits.
#[inline(always)]
fn strata<const F: u32>(scene: &CompiledScene, item: &WorkItem, hits: &Hits) -> HitStrata {
    HitStrata(scene.on::<F>(Features::STRATIFIED).then(|| {
        let (x, y, sample) = item.locate(hits.path);
        let pixel = y * U32s::splat(item.image_width) + x;
        let bounce = (hits.state & U32s::splat(state::DEPTH)) - U32s::splat(1);
        let first = bounce * U32s::splat(BOUNCE_DIMENSIONS) + U32s::splat(CAMERA_DIMENSIONS);
        (
            Strata::new(scene.seed, pixel, item.block, item.samples, sample),
            first,
        )
    }))
}

/// Two numbers for the direction, one for the lobe.
#[inline(always)]
fn direction_numbers(hits: &Hits, strata: HitStrata) -> [F32s; 3] {
    let mut random = hits.random.skip::<{ Dimension::Direction as u32 }>();
    let pair = [random.next_f32(), random.next_f32()];
    let [u, v] = strata.pair(Dimension::Direction, pair);
    [u, v, strata.one(Dimension::Lobe, random.next_f32())]
}

/// Samples a point on a light and queues a shadow ray to it where it would bring anything.
#[inline(always)]
fn sample_light<M: Material, const F: u32>(
    scene: &CompiledScene,
    hits: &Hits,
    strata: HitStrata,
    params: &M::Params,
    wave: &mut Wave,
) {
    let mut random = hits.random;
    let pair = [random.next_f32(), random.next_f32()];
    let [u, v] = strata.pair(Dimension::LightPoint, pair);
    let choice = strata.one(Dimension::LightChoice, random.next_f32());
    let receiver = Receiver {
        p: hits.point.p,
        n: hits.normal,
        primitive: hits.primitive,
    };
    let sample = light::sample::<F>(&scene.lights, &receiver, [choice, u, v]);
    let mut valid = hits.active & sample.valid;
    if scene.strategy == Strategy::Bsdf && !scene.on::<F>(Features::WHITTED) {
        // Every other light is found by hitting it.
        valid = valid & sample.delta;
    }
    let (value, pdf) = M::eval(params, hits.wo, hits.frame.to_local(sample.direction));
    // Weight over density; the weight of a delta light is 1.
    let alone = F32s::splat(1.0) / sample.pdf;
    let over_pdf = if scene.on::<F>(Features::MIS) {
        sample
            .delta
            .select(alone, mis::power_heuristic_over_pdf(sample.pdf, pdf))
    } else {
        alone
    };
    let incoming = sample.radiance * over_pdf;
    let radiance = hits.throughput.mul_elem(value).mul_elem(incoming);
    let brings = valid & radiance.max_elem().gt(F32s::splat(0.0));
    if brings.none() {
        return;
    }
    let origin = spawn_origin(&hits.point, hits.normal, sample.direction);
    let t_max = sample.distance - F32s::splat(scene.light_point_error);
    let shadows = &mut wave.shadows;
    let at = shadows.len;
    compress(&mut shadows.origin_x, at, brings, origin.x);
    compress(&mut shadows.origin_y, at, brings, origin.y);
    compress(&mut shadows.origin_z, at, brings, origin.z);
    compress(&mut shadows.direction_x, at, brings, sample.direction.x);
    compress(&mut shadows.direction_y, at, brings, sample.direction.y);
    compress(&mut shadows.direction_z, at, brings, sample.direction.z);
    compress_u32(&mut shadows.skip, at, brings, hits.primitive);
    compress(&mut shadows.t_max, at, brings, t_max);
    compress_u32(&mut shadows.target, at, brings, sample.primitive);
    compress(&mut shadows.radiance_r, at, brings, radiance.x);
    compress(&mut shadows.radiance_g, at, brings, radiance.y);
    compress(&mut shadows.radiance_b, at, brings, radiance.z);
    compress_u32(&mut shadows.path, at, brings, hits.path);
    if scene.on::<F>(Features::TRANSPARENT_SHADOWS) {
        compress(&mut shadows.weight, at, brings, over_pdf * sample.pdf);
    }
    shadows.len += brings.count();
    count_depths(&mut wave.counters.shadow_rays, hits.state, brings);
}

/// Sends one of both branches on where the path may still split; where not, the first branch is
/// one chosen at random.
#[inline(always)]
fn follow_split<M: Material, const F: u32>(
    scene: &CompiledScene,
    hits: &Hits,
    strata: HitStrata,
    params: &M::Params,
    branch: Branch,
    next: &mut RayQueue,
) {
    let Some([first, second]) = M::split(params, hits.wo) else {
        return;
    };
    let splits = hits.state >> state::SPLIT.trailing_zeros();
    let may_split = splits.lt(U32s::splat(state::MOST_SPLITS));
    let split_state = hits.state + U32s::splat(state::SPLIT);
    if branch == Branch::Second {
        let second = BsdfSample {
            valid: second.valid & may_split,
            ..second
        };
        continue_path::<M, F>(
            scene,
            hits,
            &second,
            hits.random.branch(),
            split_state,
            next,
        );
        return;
    }
    let sampled = M::sample(params, hits.wo, direction_numbers(hits, strata));
    let first = BsdfSample {
        wi: Vec3s::select(may_split, first.wi, sampled.wi),
        weight: Vec3s::select(may_split, first.weight, sampled.weight),
        pdf: sampled.pdf,
        eta: may_split.select(first.eta, sampled.eta),
        valid: (may_split & first.valid) | (!may_split & sampled.valid),
    };
    let first_state = may_split.select_u32(split_state, hits.state);
    continue_path::<M, F>(scene, hits, &first, hits.random, first_state, next);
}

/// Appends the next ray of each active lane; `random` stands at the hit's first dimension.
#[inline(always)]
fn continue_path<M: Material, const F: u32>(
    scene: &CompiledScene,
    hits: &Hits,
    sample: &BsdfSample,
    random: Pcg32s,
    path_state: U32s,
    next: &mut RayQueue,
) {
    let at = next.len;
    let direction = hits.frame.to_world(sample.wi);
    let origin = spawn_origin(&hits.point, hits.normal, direction);
    let weighted = hits.throughput.mul_elem(sample.weight);
    next.set_ray(at, origin, direction, hits.primitive);
    next.set_throughput(at, Vec3s::select(sample.valid, weighted, Vec3s::zero()));
    store_u32(&mut next.path, at, hits.path);
    let kept =
        path_state & U32s::splat(!(state::SPECULAR | state::THROUGH_GLASS | state::UNREFLECTED));
    let history = if M::TRANSMISSIVE {
        let zero = F32s::splat(0.0);
        let crossed = Mask(sample.wi.z.lt(zero).0 ^ hits.wo.z.lt(zero).0);
        let through = crossed & has(path_state, state::UNREFLECTED);
        through.select_u32(
            U32s::splat(state::SPECULAR | state::THROUGH_GLASS | state::UNREFLECTED),
            U32s::splat(state::SPECULAR),
        )
    } else if M::SPECULAR {
        U32s::splat(state::SPECULAR)
    } else {
        U32s::splat(state::UNREFLECTED)
    };
    store_u32(&mut next.state, at, (kept | history) + U32s::splat(1));
    next.random[at..at + LANES]
        .copy_from_slice(&random.skip::<{ Dimension::Roulette as u32 }>().states());
    if scene.on::<F>(Features::MIS) {
        store(&mut next.pdf, at, sample.pdf);
    }
    if scene.on::<F>(Features::DIELECTRIC) {
        store(&mut next.eta, at, hits.eta * sample.eta);
    }
    if scene.on::<F>(Features::BACKGROUND) {
        store(&mut next.cosine, at, hits.normal.dot(direction));
    }
    next.len += hits.active.count();
}
