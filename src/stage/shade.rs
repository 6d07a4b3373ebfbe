//! material queue → shadow rays and next rays: one generic stage, compiled once per material.
//!
//! A specular material has no light sampling in it at all.

use super::appearance::{opacity, reflectance_factor, shading_normal};
use super::emission::{expected_samples, has};
use super::numbers::Numbers;
use super::surface::{
    Surface, gather_rays, gather_throughput, leave, left_behind, material, surface,
};
use crate::compile::{CompiledScene, Features, PrimitiveClass, WorkItem};
use crate::light::{self, Receiver};
use crate::material::{Black, BsdfSample, Material};
use crate::math::lanes::{
    F32s, LANES, Mask, U32s, compress, compress_u32, gather, gather_u32, gather_u64, load_u32,
    store, store_u32,
};
use crate::math::{Compare, Frame, Vec3s, mis};
use crate::sampler::{Dimension, Pcg32s};
use crate::scene::Strategy;
use crate::wave::{Wave, count_depths, keep_sound, state};

/// What a chunk of hits has in common with what leaves it.
struct Hits {
    active: Mask,
    primitive: U32s,
    material: U32s,
    surface: Surface,
    /// Unit direction of the ray.
    direction: Vec3s,
    /// Unit geometric normal; on the ray's side unless the material transmits.
    normal: Vec3s,
    /// Where the shading normal is not the geometric one.
    smooth: Mask,
    /// Where rays to the normal's side start.
    origin: Vec3s,
    /// About the shading normal, which is on the geometric normal's side.
    frame: Frame,
    /// Towards where the ray came from, in the frame.
    wo: Vec3s,
    /// Share of the light that meets the surface.
    opacity: F32s,
    /// Where the path goes straight on, as if there were no surface.
    passes: Mask,
    /// n_t/n_i of what goes straight on.
    straight_eta: F32s,
    throughput: Vec3s,
    path: U32s,
    state: U32s,
    eta: F32s,
    /// Generators at the first dimension of the hit.
    random: Pcg32s,
}

/// A ray that may leave each hit.
struct Onward {
    sample: BsdfSample,
    /// Where the path goes straight on instead.
    passes: Mask,
    /// Generators at the first dimension of the hit.
    random: Pcg32s,
    /// Packed state of the path before the hit.
    state: U32s,
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
    /// None: another light sample, of this number.
    Light(u32),
}

/// Shades the hits of the queue of `M`'s kind: sends shadow rays to sampled lights and appends the
/// next ray of each path, with zero throughput where the path ends.
pub(super) fn shade<M: Material, const F: u32>(
    scene: &CompiledScene,
    item: &WorkItem,
    wave: &mut Wave,
) {
    let whitted = scene.on::<F>(Features::WHITTED);
    let splits = scene.on::<F>(Features::WHITTED | Features::GLASS_SPLITS);
    // All first branches (and light samples) come before all second ones, so that the order of a path's rays does not
    // depend on which vector of lanes it happens to be in.
    let branches: &[Branch] = if splits && M::TRANSMISSIVE {
        &[Branch::First, Branch::Second]
    } else {
        &[Branch::Sampled]
    };
    let several = scene.on::<F>(Features::LIGHT_SAMPLES) && !M::SPECULAR;
    let light_samples = if several {
        scene.branching.light_samples
    } else {
        1
    };
    let rounds = branches.iter().copied();
    for branch in rounds.chain((1..light_samples).map(Branch::Light)) {
        for at in (0..wave.by_material[M::KIND as usize].len).step_by(LANES) {
            let mut hits = Hits::fetch::<M, F>(scene, wave, at);
            let numbers = Numbers::of_hit::<F>(scene, item, hits.random, hits.path, hits.state);
            let mut params = M::fetch(&scene.materials, hits.material);
            if scene.on::<F>(Features::TEXTURES) {
                let by = reflectance_factor(scene, hits.primitive, hits.material, &hits.surface);
                M::tint(&mut params, by);
            }
            if scene.on::<F>(Features::OPACITY) {
                hits.let_through::<F>(scene, &numbers);
                hits.straight_eta = M::straight_eta(&params, hits.wo);
            }
            if !M::SPECULAR && scene.on::<F>(Features::SHADOW_RAYS) {
                let number = match branch {
                    Branch::Light(number) => number,
                    _ => 0,
                };
                let numbers = if several {
                    numbers.of_light_sample(light_samples, number)
                } else {
                    numbers
                };
                sample_light::<M, F>(scene, &hits, &numbers, &params, wave);
            }
            if let Branch::Light(_) = branch {
                continue;
            }
            if whitted && !M::SPECULAR {
                if hits.passes.any() {
                    pass_on::<M, F>(scene, &hits, wave);
                }
                continue;
            }
            match branch {
                Branch::Sampled => {
                    let numbers = direction_numbers::<F>(scene, &hits, &numbers);
                    let onward = Onward {
                        sample: M::sample(&params, hits.wo, numbers),
                        passes: hits.passes,
                        random: hits.random,
                        state: hits.state,
                    };
                    continue_path::<M, F>(scene, &hits, &onward, wave);
                }
                Branch::First | Branch::Second => {
                    follow_split::<M, F>(scene, &hits, &numbers, &params, branch, wave);
                }
                Branch::Light(_) => {}
            }
        }
    }
}

impl Hits {
    /// Where a ray in `direction` starts. What reflects sends rays to the normal's side only.
    #[inline(always)]
    fn start<M: Material, const F: u32>(&self, scene: &CompiledScene, direction: Vec3s) -> Vec3s {
        if M::TRANSMISSIVE {
            leave::<F>(scene, &self.surface.point, self.normal, direction)
        } else {
            self.origin
        }
    }

    /// The hits at `at ..` of the queue of `M`'s kind.
    #[inline(always)]
    fn fetch<M: Material, const F: u32>(scene: &CompiledScene, wave: &Wave, at: usize) -> Self {
        let queue = &wave.by_material[M::KIND as usize];
        let rays = &wave.rays;
        let ray = load_u32(&queue.index, at);
        let (origin, direction) = gather_rays(rays, ray);
        let primitive = gather_u32(&wave.hits.primitive, ray);
        let t = gather(&wave.hits.t, ray);
        let surface = surface::<F>(scene, primitive, origin, direction, t);
        let behind = || surface.normal.dot(direction).gt(F32s::splat(0.0));
        let normal = if M::TRANSMISSIVE {
            surface.normal
        } else {
            Vec3s::select(behind(), -surface.normal, surface.normal)
        };
        let (mut shading, mut smooth) = (normal, Mask::NONE);
        if scene.on::<F>(Features::MESH_NORMALS) {
            // Bent while on the ray's side, then turned back to the outside of what transmits.
            let turned = if M::TRANSMISSIVE {
                behind()
            } else {
                Mask::NONE
            };
            let facing = Vec3s::select(turned, -normal, normal);
            (shading, smooth) =
                shading_normal(scene, primitive, surface.weights, facing, -direction);
            shading = Vec3s::select(turned, -shading, shading);
        }
        let frame = Frame::from_normal(shading);
        Self {
            active: Mask::first(queue.len - at),
            primitive,
            material: material(scene, primitive),
            origin: leave::<F>(scene, &surface.point, normal, normal),
            surface,
            direction,
            normal,
            smooth,
            wo: frame.to_local(-direction),
            frame,
            opacity: F32s::splat(1.0),
            passes: Mask::NONE,
            straight_eta: F32s::splat(1.0),
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

    /// Decides where the path goes straight on: with a probability of 1 − opacity.
    #[inline(always)]
    fn let_through<const F: u32>(&mut self, scene: &CompiledScene, numbers: &Numbers) {
        self.opacity = opacity::<F>(scene, self.primitive, self.material, &self.surface);
        let u = numbers.one::<{ Dimension::Lobe as u32 }>();
        self.passes = self.active & u.lt(F32s::splat(1.0) - self.opacity);
    }

    /// Where directions are on the same side of the surface and of its shading normal; `cosines` are
    /// those to the latter. Elsewhere nothing is scattered, so that no light passes a closed surface.
    #[inline(always)]
    fn same_side(&self, direction: Vec3s, cosines: F32s) -> Mask {
        let zero = F32s::splat(0.0);
        let differ = Mask(self.normal.dot(direction).gt(zero).0 ^ cosines.gt(zero).0);
        !(self.smooth & differ)
    }
}

/// Two numbers for the direction, one for the lobe.
#[inline(always)]
fn direction_numbers<const F: u32>(
    scene: &CompiledScene,
    hits: &Hits,
    numbers: &Numbers,
) -> [F32s; 3] {
    let [u, v] = numbers.pair::<{ Dimension::Direction as u32 }>();
    let mut lobe = numbers.one::<{ Dimension::Lobe as u32 }>();
    if scene.on::<F>(Features::OPACITY) {
        // Above 1 − opacity the number has not been used: that part becomes [0, 1) again.
        let passing = F32s::splat(1.0) - hits.opacity;
        let most = F32s::splat(1.0 - f32::EPSILON / 2.0);
        lobe = ((lobe - passing) / (F32s::splat(1.0) - passing)).fast_min(most);
    }
    [u, v, lobe]
}

/// Samples a point on a light and queues a shadow ray to it where it would bring anything.
#[inline(always)]
fn sample_light<M: Material, const F: u32>(
    scene: &CompiledScene,
    hits: &Hits,
    numbers: &Numbers,
    params: &M::Params,
    wave: &mut Wave,
) {
    let [u, v] = numbers.pair::<{ Dimension::LightPoint as u32 }>();
    let choice = numbers.one::<{ Dimension::LightChoice as u32 }>();
    // A ray that starts off the surface by more than rounding must be aimed from there.
    let start = if scene.on::<F>(Features::SHADOW_BIAS) {
        hits.origin
    } else {
        hits.surface.point.p
    };
    let receiver = Receiver {
        p: start,
        n: hits.frame.normal,
        primitive: hits.primitive,
    };
    let sample = light::sample::<F>(&scene.lights, &receiver, [choice, u, v]);
    let mut valid = hits.active & sample.valid;
    if scene.on::<F>(Features::OPACITY) {
        valid = valid & !hits.passes;
    }
    if scene.strategy == Strategy::Bsdf && !scene.on::<F>(Features::WHITTED) {
        // Every other light is found by hitting it.
        valid = valid & sample.delta;
    }
    let wi = hits.frame.to_local(sample.direction);
    if scene.on::<F>(Features::MESH_NORMALS) {
        valid = valid & hits.same_side(sample.direction, wi.z);
    }
    let (value, pdf) = M::eval(params, hits.wo, wi);
    // Weight over density; the weight of a delta light is 1.
    let density = expected_samples::<F>(scene, sample.pdf);
    let alone = F32s::splat(1.0) / density;
    let over_pdf = if scene.on::<F>(Features::MIS) {
        sample
            .delta
            .select(alone, mis::power_heuristic_over_pdf(density, pdf))
    } else {
        alone
    };
    let incoming = sample.radiance * over_pdf;
    let radiance = hits.throughput.mul_elem(value).mul_elem(incoming);
    let sound = keep_sound(&mut wave.counters.rejected.shade, valid, radiance);
    let brings = sound & radiance.max_elem().gt(F32s::splat(0.0));
    if brings.none() {
        return;
    }
    let origin = hits.start::<M, F>(scene, sample.direction);
    let t_max = sample.distance - F32s::splat(scene.light_point_error);
    let shadows = &mut wave.shadows;
    let at = shadows.len;
    compress(&mut shadows.origin_x, at, brings, origin.x);
    compress(&mut shadows.origin_y, at, brings, origin.y);
    compress(&mut shadows.origin_z, at, brings, origin.z);
    compress(&mut shadows.direction_x, at, brings, sample.direction.x);
    compress(&mut shadows.direction_y, at, brings, sample.direction.y);
    compress(&mut shadows.direction_z, at, brings, sample.direction.z);
    let skip = left_behind::<F>(scene, hits.primitive);
    compress_u32(&mut shadows.skip, at, brings, skip);
    compress(&mut shadows.t_max, at, brings, t_max);
    compress_u32(&mut shadows.target, at, brings, sample.primitive);
    compress(&mut shadows.radiance_r, at, brings, radiance.x);
    compress(&mut shadows.radiance_g, at, brings, radiance.y);
    compress(&mut shadows.radiance_b, at, brings, radiance.z);
    compress_u32(&mut shadows.path, at, brings, hits.path);
    if scene.on::<F>(Features::TRANSPARENT_SHADOWS) {
        compress(&mut shadows.weight, at, brings, over_pdf * density);
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
    numbers: &Numbers,
    params: &M::Params,
    branch: Branch,
    wave: &mut Wave,
) {
    let Some([first, second]) = M::split(params, hits.wo) else {
        return;
    };
    let may_split = (hits.state & U32s::splat(state::SPLITS)).gt(U32s::splat(0));
    let split_state = hits.state - U32s::splat(state::SPLIT);
    if branch == Branch::Second {
        let onward = Onward {
            sample: BsdfSample {
                valid: second.valid & may_split & !hits.passes,
                ..second
            },
            passes: Mask::NONE,
            random: hits.random.branch(),
            state: split_state,
        };
        continue_path::<M, F>(scene, hits, &onward, wave);
        return;
    }
    let numbers = direction_numbers::<F>(scene, hits, numbers);
    let sampled = M::sample(params, hits.wo, numbers);
    let onward = Onward {
        sample: BsdfSample {
            wi: Vec3s::select(may_split, first.wi, sampled.wi),
            weight: Vec3s::select(may_split, first.weight, sampled.weight),
            pdf: sampled.pdf,
            eta: may_split.select(first.eta, sampled.eta),
            valid: (may_split & first.valid) | (!may_split & sampled.valid),
        },
        passes: hits.passes,
        random: hits.random,
        state: (may_split & !hits.passes).select_u32(split_state, hits.state),
    };
    continue_path::<M, F>(scene, hits, &onward, wave);
}

/// Appends the rays of the paths that go straight on where nothing else goes on.
#[inline(always)]
fn pass_on<M: Material, const F: u32>(scene: &CompiledScene, hits: &Hits, wave: &mut Wave) {
    let onward = Onward {
        sample: Black::sample(&(), hits.wo, [F32s::splat(0.0); 3]),
        passes: hits.passes,
        random: hits.random,
        state: hits.state,
    };
    continue_path::<M, F>(scene, hits, &onward, wave);
}

/// Appends the next ray of each active lane, with zero throughput where the path ends.
#[inline(always)]
fn continue_path<M: Material, const F: u32>(
    scene: &CompiledScene,
    hits: &Hits,
    onward: &Onward,
    wave: &mut Wave,
) {
    let (next, rejected) = (&mut wave.next, &mut wave.counters.rejected.shade);
    let at = next.len;
    let sample = &onward.sample;
    let (zero, one) = (F32s::splat(0.0), F32s::splat(1.0));
    let mut direction = hits.frame.to_world(sample.wi);
    let mut valid = sample.valid;
    if scene.on::<F>(Features::MESH_NORMALS) {
        valid = valid & hits.same_side(direction, sample.wi.z);
    }
    let weighted = hits.throughput.mul_elem(sample.weight);
    let sound = keep_sound(rejected, hits.active & valid, weighted);
    let mut throughput = Vec3s::select(sound, weighted, Vec3s::zero());
    let mut kept =
        onward.state & U32s::splat(!(state::SPECULAR | state::THROUGH_GLASS | state::UNREFLECTED));
    if !M::SPECULAR && scene.on::<F>(Features::GLASS_SPLITS) {
        // What has been scattered splits no more; what goes straight on has not been.
        let splits = onward.passes.select_u32(kept, U32s::splat(0)) & U32s::splat(state::SPLITS);
        kept = (kept & U32s::splat(!state::SPLITS)) | splits;
    }
    let mut history = if M::TRANSMISSIVE {
        let mut through = Mask(sample.wi.z.lt(zero).0 ^ hits.wo.z.lt(zero).0)
            & has(onward.state, state::UNREFLECTED);
        if scene.on::<F>(Features::OPACITY) {
            // It blocks transparent shadow rays, so they do not bring what is behind.
            let class = scene.surfaces.class.get(hits.primitive);
            through = through & !has(class, PrimitiveClass::PARTIAL);
        }
        through.select_u32(
            U32s::splat(state::SPECULAR | state::THROUGH_GLASS | state::UNREFLECTED),
            U32s::splat(state::SPECULAR),
        )
    } else if M::SPECULAR {
        U32s::splat(state::SPECULAR)
    } else {
        U32s::splat(state::UNREFLECTED)
    };
    let (mut pdf, mut eta) = (sample.pdf, sample.eta);
    let mut origin = hits.start::<M, F>(scene, direction);
    if scene.on::<F>(Features::OPACITY) {
        // A delta transmission without a bend: light behind is not sampled from here, and shadow
        // rays from before do not reach it.
        let passes = onward.passes;
        direction = Vec3s::select(passes, hits.direction, direction);
        let beyond = leave::<F>(scene, &hits.surface.point, hits.normal, hits.direction);
        origin = Vec3s::select(passes, beyond, origin);
        let straight = hits.throughput * (one / (hits.straight_eta * hits.straight_eta));
        throughput = Vec3s::select(passes, straight, throughput);
        history = passes.select_u32(U32s::splat(state::SPECULAR), history);
        pdf = passes.select(zero, pdf);
        eta = passes.select(hits.straight_eta, eta);
    }
    next.set_ray(
        at,
        origin,
        direction,
        left_behind::<F>(scene, hits.primitive),
    );
    next.set_throughput(at, throughput);
    store_u32(&mut next.path, at, hits.path);
    store_u32(&mut next.state, at, (kept | history) + U32s::splat(1));
    next.random[at..at + LANES].copy_from_slice(
        &onward
            .random
            .skip::<{ Dimension::Roulette as u32 }>()
            .states(),
    );
    if scene.on::<F>(Features::MIS) {
        store(&mut next.pdf, at, pdf);
    }
    if scene.on::<F>(Features::DIELECTRIC) {
        store(&mut next.eta, at, hits.eta * eta);
    }
    if scene.on::<F>(Features::BACKGROUND) {
        store(&mut next.cosine, at, hits.frame.normal.dot(direction));
    }
    next.len += hits.active.count();
}
