//! The queues of one worker: all that its stages read and write beside the scene.

pub mod items;
pub mod soa;

use crate::accel::{AccelCounters, HitBatch, RayBatch, ShadowBatch};
use crate::compile::{Branching, Features, WorkItem};
use crate::material::MaterialKind;
use serde::{Deserialize, Serialize};
use wide::f32x4;

use crate::math::lanes::{F32s, LANES, Mask, U32s, load, load_u32, store, store_u32};
use crate::math::{Compare, Vec3s};

pub use items::{HitQueue, IndexQueue, RayQueue, ShadowQueue, state};

/// Number of material kinds, each with a queue of its own.
pub const MATERIAL_KINDS: usize = MaterialKind::COUNT;

/// Depths that are counted apart; deeper rays are counted with the last.
pub const COUNTED_DEPTHS: usize = 64;

/// Contributions and path weights that were not finite or negative, by the stage that met them first.
/// None reaches the film.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rejections {
    /// Light found by following a ray.
    pub emission: u64,
    /// Light that a shadow ray would bring, or the weight of a path after scattering.
    pub shade: u64,
    /// Light that a shadow ray brought.
    pub connect: u64,
}

impl Rejections {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.emission + self.shade + self.connect
    }

    /// Adds those of another worker.
    pub fn add(&mut self, other: &Self) {
        self.emission += other.emission;
        self.shade += other.shade;
        self.connect += other.connect;
    }
}

/// Counts of one worker.
#[derive(Debug, Clone)]
pub struct WaveCounters {
    /// Closest-hit rays by depth − 1.
    pub rays: [u64; COUNTED_DEPTHS],
    /// Shadow rays by depth − 1 of the hit that sent them.
    pub shadow_rays: [u64; COUNTED_DEPTHS],
    /// Work of the acceleration structure.
    pub accel: AccelCounters,
    /// What was not finite or negative, and was left out.
    pub rejected: Rejections,
    /// Paths cut at the depth limit while they carried weight.
    pub truncated: u64,
}

impl Default for WaveCounters {
    fn default() -> Self {
        Self {
            rays: [0; COUNTED_DEPTHS],
            shadow_rays: [0; COUNTED_DEPTHS],
            accel: AccelCounters::default(),
            rejected: Rejections::default(),
            truncated: 0,
        }
    }
}

/// Sums over the samples of a pixel of what the first hit looks like.
#[derive(Debug, Clone, Copy, Default)]
pub struct AuxSums {
    /// Albedo.
    pub albedo: [f64; 3],
    /// Unit normal on the camera's side.
    pub normal: [f64; 3],
    /// Distance from the eye, scene units (0 where nothing is hit).
    pub depth: f64,
}

/// The queues of one worker.
#[derive(Debug)]
pub struct Wave {
    /// Most paths in flight.
    pub capacity: usize,
    /// Next path of the work item to start.
    pub next_path: u32,
    /// Rays to intersect.
    pub rays: RayQueue,
    /// Rays leaving the hits, before roulette; those with zero throughput are dead.
    pub next: RayQueue,
    /// Hits of `rays`.
    pub hits: HitQueue,
    /// Shadow rays of this pass.
    pub shadows: ShadowQueue,
    /// Shadow rays that crossed a boundary of glass (empty without transparent shadows).
    pub crossed: ShadowQueue,
    /// Hits to shade, per kind of material (empty for kinds the scene has not).
    pub by_material: [IndexQueue; MATERIAL_KINDS],
    /// Hits of emitters.
    pub emitters: IndexQueue,
    /// Rays that left the scene.
    pub escaped: IndexQueue,
    /// Radiance per path of the work item; the fourth number is padding.
    pub radiance: Vec<[f32; 4]>,
    /// First-hit sums per pixel of the tile (empty without auxiliary images).
    pub aux: Vec<AuxSums>,
    /// Counts.
    pub counters: WaveCounters,
}

impl Wave {
    /// Queues for `capacity` paths in flight of work items of at most `item_paths` paths on
    /// `item_pixels` pixels, with what `features` need where rays have several successors.
    pub fn new(
        capacity: usize,
        features: Features,
        branching: Branching,
        item_paths: usize,
        item_pixels: usize,
    ) -> Self {
        let when = |needs: Features, n: usize| if features.intersects(needs) { n } else { 0 };
        let lights = Features::LIGHT_FLAT | Features::LIGHT_SPHERE;
        // All rays that one path may split into have room.
        let capacity = capacity.max(1 << branching.splits);
        let shadow_rays = capacity * branching.light_samples as usize;
        // Shadow rays through glass have their hits here too.
        let hits = capacity.max(when(Features::TRANSPARENT_SHADOWS, shadow_rays));
        // A queue that the scene does not need still has room for the one vector of lanes that
        // every column is padded with.
        Self {
            capacity,
            next_path: 0,
            rays: RayQueue::new(capacity, features),
            next: RayQueue::new(capacity * branching.next_per_ray(), features),
            hits: HitQueue::new(hits, features),
            shadows: ShadowQueue::new(when(Features::SHADOW_RAYS, shadow_rays), features),
            crossed: ShadowQueue::new(when(Features::TRANSPARENT_SHADOWS, shadow_rays), features),
            by_material: std::array::from_fn(|kind| {
                IndexQueue::new(when(material_feature(kind), capacity), features)
            }),
            emitters: IndexQueue::new(when(lights, capacity), features),
            escaped: IndexQueue::new(when(Features::BACKGROUND, capacity), features),
            radiance: vec![[0.0; 4]; item_paths],
            aux: vec![AuxSums::default(); when(Features::AUX, item_pixels)],
            counters: WaveCounters::default(),
        }
    }

    /// Bytes of queues per path in flight with these features.
    pub fn bytes_per_path(features: Features, branching: Branching) -> usize {
        let kinds = (0..MATERIAL_KINDS)
            .filter(|&k| features.intersects(material_feature(k)))
            .count();
        let lights =
            usize::from(features.intersects(Features::LIGHT_FLAT | Features::LIGHT_SPHERE));
        let escaped = usize::from(features.intersects(Features::BACKGROUND));
        let samples = branching.light_samples as usize;
        let transparent = features.intersects(Features::TRANSPARENT_SHADOWS);
        let shadows = samples
            * (usize::from(features.intersects(Features::SHADOW_RAYS)) + usize::from(transparent));
        let hits = if transparent { samples } else { 1 };
        (1 + branching.next_per_ray()) * RayQueue::bytes_per_item(features)
            + hits * HitQueue::bytes_per_item(features)
            + shadows * ShadowQueue::bytes_per_item(features)
            + (kinds + lights + escaped) * IndexQueue::bytes_per_item(features)
    }

    /// Begins a work item: no path started, no light gathered.
    pub fn begin(&mut self, item: &WorkItem) {
        self.next_path = 0;
        self.rays.len = 0;
        self.radiance[..item.paths() as usize].fill([0.0; 4]);
        self.aux.fill(AuxSums::default());
    }

    /// Whether paths are in flight or still to start.
    pub fn is_busy(&self, item: &WorkItem) -> bool {
        self.rays.len > 0 || self.next_path < item.paths()
    }
}

/// The feature that a material kind's queue needs.
pub fn material_feature(kind: usize) -> Features {
    match MaterialKind::ALL[kind] {
        MaterialKind::Black => Features(0),
        MaterialKind::Lambertian => Features::LAMBERTIAN,
        MaterialKind::OrenNayar => Features::OREN_NAYAR,
        MaterialKind::Mirror => Features::MIRROR,
        MaterialKind::Dielectric => Features::DIELECTRIC,
        MaterialKind::Phong => Features::PHONG,
        MaterialKind::Glossy => Features::GLOSSY,
    }
}

/// Counts the lanes of `mask` by the depth in their packed state. Neighbours in a queue mostly have
/// the same depth, so that few rounds do.
#[inline(always)]
pub fn count_depths(counts: &mut [u64; COUNTED_DEPTHS], ray_state: U32s, mask: Mask) {
    let depths = ray_state & U32s::splat(state::DEPTH);
    let mut left = mask;
    while left.any() {
        let depth = depths.as_array()[left.0.trailing_zeros() as usize];
        let same = left & depths.eq(U32s::splat(depth));
        counts[(depth as usize).clamp(1, COUNTED_DEPTHS) - 1] += same.count() as u64;
        left = left & !same;
    }
}

/// The lanes of `mask` whose `radiance`, or weight, is finite and not negative; the others are added to
/// `rejected`. Debug builds assert that there are none.
#[inline(always)]
pub fn keep_sound(rejected: &mut u64, mask: Mask, radiance: Vec3s) -> Mask {
    let (least, most) = (F32s::splat(0.0), F32s::splat(f32::MAX));
    let sound = |c: F32s| c.ge(least) & c.le(most);
    let good = mask & sound(radiance.x) & sound(radiance.y) & sound(radiance.z);
    debug_assert_eq!(good, mask, "unsound contribution {radiance:?}");
    *rejected += (mask.count() - good.count()) as u64;
    good
}

/// Adds `radiance` of the lanes of `mask` to their paths; what is not finite or is negative is
/// left out and counted.
#[inline(always)]
pub fn add_radiance(
    gathered: &mut [[f32; 4]],
    rejected: &mut u64,
    mask: Mask,
    path: U32s,
    radiance: Vec3s,
) {
    let good = keep_sound(rejected, mask, radiance);
    // Four lanes at a time turned into rows, so that a path takes one addition.
    let [r, g, b]: [[f32x4; LANES / 4]; 3] =
        [radiance.x, radiance.y, radiance.z].map(bytemuck::cast);
    let path = path.as_array();
    for quarter in 0..LANES / 4 {
        let lanes = good.0 >> (4 * quarter) & 15;
        let rows = f32x4::transpose([r[quarter], g[quarter], b[quarter], f32x4::ZERO]);
        for lane in Mask(lanes).lanes() {
            let sum = &mut gathered[path[4 * quarter + lane] as usize];
            *sum = (f32x4::from(*sum) + rows[lane]).to_array();
        }
    }
}

impl RayQueue {
    /// The rays as the acceleration structures take them.
    pub fn batch(&self) -> RayBatch<'_> {
        RayBatch {
            len: self.len,
            origin: [&self.origin_x, &self.origin_y, &self.origin_z],
            direction: [&self.direction_x, &self.direction_y, &self.direction_z],
            skip: &self.skip,
        }
    }

    /// Throughput of the items `at ..`.
    #[inline(always)]
    pub fn throughput(&self, at: usize) -> Vec3s {
        Vec3s::new(
            load(&self.throughput_r, at),
            load(&self.throughput_g, at),
            load(&self.throughput_b, at),
        )
    }

    /// Sets the throughput of the items `at ..`.
    #[inline(always)]
    pub fn set_throughput(&mut self, at: usize, throughput: Vec3s) {
        store(&mut self.throughput_r, at, throughput.x);
        store(&mut self.throughput_g, at, throughput.y);
        store(&mut self.throughput_b, at, throughput.z);
    }

    /// Sets where the rays `at ..` start and go.
    #[inline(always)]
    pub fn set_ray(&mut self, at: usize, origin: Vec3s, direction: Vec3s, skip: U32s) {
        store(&mut self.origin_x, at, origin.x);
        store(&mut self.origin_y, at, origin.y);
        store(&mut self.origin_z, at, origin.z);
        store(&mut self.direction_x, at, direction.x);
        store(&mut self.direction_y, at, direction.y);
        store(&mut self.direction_z, at, direction.z);
        store_u32(&mut self.skip, at, skip);
    }
}

impl HitQueue {
    /// The hits as the acceleration structures write them.
    pub fn batch(&mut self) -> HitBatch<'_> {
        HitBatch {
            t: &mut self.t,
            primitive: &mut self.primitive,
        }
    }
}

impl ShadowQueue {
    /// The shadow rays as the acceleration structures take them, and where the answers go.
    pub fn batch(&mut self) -> (ShadowBatch<'_>, &mut [u32]) {
        let batch = ShadowBatch {
            rays: RayBatch {
                len: self.len,
                origin: [&self.origin_x, &self.origin_y, &self.origin_z],
                direction: [&self.direction_x, &self.direction_y, &self.direction_z],
                skip: &self.skip,
            },
            t_max: &self.t_max,
            target: &self.target,
        };
        (batch, &mut self.occluded)
    }

    /// Radiance of the items `at ..`.
    #[inline(always)]
    pub fn radiance(&self, at: usize) -> Vec3s {
        Vec3s::new(
            load(&self.radiance_r, at),
            load(&self.radiance_g, at),
            load(&self.radiance_b, at),
        )
    }

    /// Path numbers of the items `at ..`.
    #[inline(always)]
    pub fn paths(&self, at: usize) -> U32s {
        load_u32(&self.path, at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// NaN, negative and infinite in one channel of the first three lanes, 1 in all others.
    fn mostly_sound() -> Vec3s {
        let column = |bad: f32, at: usize| {
            let mut values = [1.0; LANES];
            values[at] = bad;
            F32s::from(values)
        };
        Vec3s::new(
            column(f32::NAN, 0),
            column(-1e-30, 1),
            column(f32::INFINITY, 2),
        )
    }

    #[cfg(not(debug_assertions))]
    #[test]
    fn unsound_contributions_are_counted_and_kept_out() {
        let mut gathered = vec![[0.0; 4]; LANES];
        let mut rejected = 0;
        let (mask, path) = (Mask::first(LANES - 1), crate::math::lanes::iota());
        add_radiance(&mut gathered, &mut rejected, mask, path, mostly_sound());
        assert_eq!(rejected, 3);
        for (lane, sum) in gathered.iter().enumerate() {
            let expected = if (3..LANES - 1).contains(&lane) {
                1.0
            } else {
                0.0
            };
            assert_eq!(sum[..3], [expected; 3], "lane {lane}");
        }
    }

    #[cfg(debug_assertions)]
    #[test]
    #[should_panic(expected = "unsound contribution")]
    fn debug_builds_assert_where_a_contribution_is_unsound() {
        keep_sound(&mut 0, Mask::ALL, mostly_sound());
    }

    #[test]
    fn lanes_that_hold_nothing_may_hold_anything() {
        let mut rejected = 0;
        let mask = !Mask::first(3);
        assert_eq!(keep_sound(&mut rejected, mask, mostly_sound()), mask);
        assert_eq!(rejected, 0);
    }
}
