//! Ray sets from a scene itself: what a path tracer would ask of its structure.

use rand_core::Rng;
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

use crate::accel::{HitBatch, RayBatch, ShadowBatch};
use crate::compile::{CompiledScene, Features, TILE, WorkItem};
use crate::geometry::{PrimitiveId, SurfacePoint, spawn_origin};
use crate::integrator::schedule::Tiles;
use crate::light::{self, Receiver, kinds};
use crate::math::lanes::{F32s, LANES, Mask, U32s, compress, iota, load, load_u32, padded, to_f32};
use crate::math::warp::cosine_hemisphere;
use crate::math::{Compare, Frame, Vec3s};
use crate::sampler::Pcg32s;
use crate::sampler::pcg::STREAM;
use crate::stage::surface::surface;

/// Most samples of a pixel in one work item, as renders have them.
const MOST_SAMPLES: usize = 16;

/// Camera rays for each wanted ray of a set, after which no more are tried: the rest escapes.
const MOST_TRIES: u64 = 64;

/// What rays a set has.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    clap::ValueEnum,
)]
#[serde(rename_all = "kebab-case")]
pub enum RayKind {
    /// Camera rays, tile by tile.
    Primary,
    /// Cosine-distributed bounces from the hits of camera rays, in their order.
    Diffuse,
    /// Bounces from the hits of those, shuffled.
    Diffuse2,
    /// Segments from hits of camera rays and of their bounces to points on the lights.
    Shadow,
}

impl RayKind {
    /// Every kind.
    pub const ALL: [Self; 4] = [Self::Primary, Self::Diffuse, Self::Diffuse2, Self::Shadow];

    /// Name as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Diffuse => "diffuse",
            Self::Diffuse2 => "diffuse2",
            Self::Shadow => "shadow",
        }
    }
}

/// Rays of one kind, in columns.
#[derive(Debug, Clone)]
pub struct RaySet {
    kind: RayKind,
    len: usize,
    /// Columns are at least `len` rounded up to the lane width long, and one vector of lanes more.
    origin: [Vec<f32>; 3],
    direction: [Vec<f32>; 3],
    /// Ends of shadow segments; empty otherwise.
    t_max: Vec<f32>,
}

impl RaySet {
    fn new(kind: RayKind) -> Self {
        let mut set = Self {
            kind,
            len: 0,
            origin: Default::default(),
            direction: Default::default(),
            t_max: Vec::new(),
        };
        set.resize();
        set
    }

    /// The set of these rays: origin, direction, end.
    #[cfg(test)]
    pub(super) fn of(kind: RayKind, rays: &[([f32; 3], [f32; 3], f32)]) -> Self {
        let mut set = Self::new(kind);
        for &(origin, direction, end) in rays {
            let (origin, direction) = (Vec3s::splat(origin), Vec3s::splat(direction));
            set.push(Mask::first(1), origin, direction, F32s::splat(end));
        }
        set
    }

    /// What rays these are.
    pub fn kind(&self) -> RayKind {
        self.kind
    }

    /// Number of rays.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Origin of ray `at`, direction (unit length), and end of its segment (infinite unless it is a
    /// shadow ray's).
    pub fn ray(&self, at: usize) -> ([f32; 3], [f32; 3], f32) {
        (
            [0, 1, 2].map(|axis| self.origin[axis][at]),
            [0, 1, 2].map(|axis| self.direction[axis][at]),
            self.t_max.get(at).copied().unwrap_or(f32::INFINITY),
        )
    }

    /// The `len` rays from `at` on. `none` is a column of [`PrimitiveId::NONE`], as long as the batch
    /// rounded up to the lane width: rays start on no primitive, since other projects' structures know
    /// no such thing.
    pub fn rays<'a>(&'a self, at: usize, len: usize, none: &'a [u32]) -> RayBatch<'a> {
        RayBatch {
            len,
            origin: [0, 1, 2].map(|axis| &self.origin[axis][at..]),
            direction: [0, 1, 2].map(|axis| &self.direction[axis][at..]),
            skip: none,
        }
    }

    /// As [`Self::rays`], for shadow rays.
    pub fn shadows<'a>(&'a self, at: usize, len: usize, none: &'a [u32]) -> ShadowBatch<'a> {
        ShadowBatch {
            rays: self.rays(at, len, none),
            t_max: &self.t_max[at..],
            target: none,
        }
    }

    /// `count` of the rays, evenly spread over the set; all of them if there are not more.
    #[must_use]
    pub fn sample(&self, count: usize) -> Self {
        let count = count.min(self.len);
        self.pick((0..count).map(|i| i * self.len / count.max(1)))
    }

    /// The rays of these numbers, in this order.
    fn pick(&self, numbers: impl ExactSizeIterator<Item = usize> + Clone) -> Self {
        let mut picked = Self {
            len: numbers.len(),
            ..Self::new(self.kind)
        };
        let column = |values: &[f32]| {
            if values.is_empty() {
                Vec::new()
            } else {
                numbers.clone().map(|number| values[number]).collect()
            }
        };
        for axis in 0..3 {
            picked.origin[axis] = column(&self.origin[axis]);
            picked.direction[axis] = column(&self.direction[axis]);
        }
        picked.t_max = column(&self.t_max);
        picked.resize();
        picked
    }

    /// All rays in random order.
    fn shuffled(&self, seed: u64) -> Self {
        let mut order: Vec<usize> = (0..self.len).collect();
        let mut random = Pcg32::new(seed, STREAM);
        for last in (1..order.len()).rev() {
            // Fisher and Yates; the bias of the product is below 2⁻³².
            let other = (random.next_u64() as u128 * (last as u128 + 1)) >> 64;
            order.swap(last, other as usize);
        }
        self.pick(order.into_iter())
    }

    /// Makes room for one more vector of lanes.
    fn resize(&mut self) {
        let room = padded(self.len) + LANES;
        for column in self.origin.iter_mut().chain(&mut self.direction) {
            column.resize(room, 0.0);
        }
        if self.kind == RayKind::Shadow {
            self.t_max.resize(room, 0.0);
        }
    }

    /// Appends the rays of the lanes in `mask`.
    fn push(&mut self, mask: Mask, origin: Vec3s, direction: Vec3s, t_max: F32s) {
        for (column, value) in self
            .origin
            .iter_mut()
            .zip([origin.x, origin.y, origin.z])
            .chain(
                self.direction
                    .iter_mut()
                    .zip([direction.x, direction.y, direction.z]),
            )
        {
            compress(column, self.len, mask, value);
        }
        if self.kind == RayKind::Shadow {
            compress(&mut self.t_max, self.len, mask, t_max);
        }
        self.len += mask.count();
        self.resize();
    }

    /// Appends rays of another set until there are `most`.
    fn append(&mut self, other: &Self, most: usize) {
        let taken = other.len.min(most - self.len);
        let extend = |column: &mut Vec<f32>, values: &[f32]| {
            column.truncate(self.len);
            column.extend_from_slice(&values[..taken]);
        };
        for axis in 0..3 {
            extend(&mut self.origin[axis], &other.origin[axis]);
            extend(&mut self.direction[axis], &other.direction[axis]);
        }
        if self.kind == RayKind::Shadow {
            extend(&mut self.t_max, &other.t_max);
        }
        self.len += taken;
        self.resize();
    }
}

/// Sets of up to `count` rays of each of these kinds, always the same for the same scene and seed.
/// Where few camera rays hit anything, sets are smaller, and may be empty.
pub fn ray_sets(scene: &CompiledScene, wanted: &[RayKind], count: usize, seed: u64) -> Vec<RaySet> {
    let maker = Maker { scene, seed };
    let mut sets: Vec<RaySet> = wanted.iter().map(|&kind| RaySet::new(kind)).collect();
    let tiles = Tiles::new(scene.width, scene.height);
    let pixels = scene.width as usize * scene.height as usize;
    let (mut first_sample, mut block, mut tried) = (0, 0, 0);
    loop {
        let missing = sets.iter().map(|set| count - set.len).max().unwrap_or(0);
        if missing == 0 || tried >= MOST_TRIES * count as u64 {
            break;
        }
        // As many samples as fill the missing rays from the whole image, or, where one sample is too
        // many, tiles evenly spread over it.
        let samples = missing.div_ceil(pixels).clamp(1, MOST_SAMPLES) as u32;
        let per_tile = (TILE * TILE * samples) as usize;
        let visited = missing.div_ceil(per_tile).min(tiles.count());
        for i in 0..visited {
            let tile = i * tiles.count() / visited;
            let item = tiles.item(tile, block, (first_sample, samples));
            tried += u64::from(item.paths());
            // Every other tile, so that all parts of the image have both kinds of shadow rays.
            let from_camera = (tile as u64 + block).is_multiple_of(2);
            let made = maker.chain(&item, from_camera, wanted);
            for set in &mut sets {
                if let Some(rays) = made.iter().find(|rays| rays.kind == set.kind) {
                    set.append(rays, count);
                }
            }
        }
        first_sample += u64::from(samples);
        block += 1;
    }
    sets.into_iter()
        .map(|set| match set.kind {
            RayKind::Diffuse2 => set.shuffled(seed),
            _ => set,
        })
        .collect()
}

/// Makes rays, one work item after the other.
struct Maker<'a> {
    scene: &'a CompiledScene,
    seed: u64,
}

/// Rays with their hits.
struct Traced {
    rays: RaySet,
    t: Vec<f32>,
    primitive: Vec<u32>,
}

/// A vector of hits.
struct Hits {
    active: Mask,
    primitive: U32s,
    point: SurfacePoint,
    /// Unit geometric normal, on the ray's side.
    normal: Vec3s,
}

impl Maker<'_> {
    /// Camera rays of the item and what follows from them, as far as it is wanted. Shadow rays leave
    /// either the hits of camera rays or those of their bounces.
    fn chain(&self, item: &WorkItem, from_camera: bool, wanted: &[RayKind]) -> Vec<RaySet> {
        let wants = |kind| wanted.contains(&kind);
        let camera = self.camera(item);
        if wanted == [RayKind::Primary] {
            return vec![camera];
        }
        let camera = self.trace(camera);
        let bounces = self.bounce(item, &camera, RayKind::Diffuse);
        let mut made = Vec::new();
        if wants(RayKind::Shadow) && from_camera {
            made.push(self.shadows(item, &camera));
        }
        if wants(RayKind::Diffuse2) || (wants(RayKind::Shadow) && !from_camera) {
            let bounces = self.trace(bounces.clone());
            if wants(RayKind::Shadow) && !from_camera {
                made.push(self.shadows(item, &bounces));
            }
            made.push(self.bounce(item, &bounces, RayKind::Diffuse2));
        }
        made.extend([camera.rays, bounces]);
        made
    }

    /// The rays that the generate stage makes of the item, with independent samples.
    fn camera(&self, item: &WorkItem) -> RaySet {
        let mut rays = RaySet::new(RayKind::Primary);
        for start in (0..item.paths()).step_by(LANES) {
            let path = U32s::splat(start) + iota();
            let (x, y, sample) = item.locate(path);
            let pixel = y * U32s::splat(item.image_width) + x;
            let mut random = Pcg32s::for_paths(self.seed, pixel, item.first_sample, sample);
            let jitter = [random.next_f32(), random.next_f32()];
            let direction = self
                .scene
                .camera
                .directions(to_f32(x) + jitter[0], to_f32(y) + jitter[1]);
            rays.push(
                Mask::first((item.paths() - start) as usize),
                Vec3s::splat(self.scene.camera.eye),
                direction,
                F32s::splat(f32::INFINITY),
            );
        }
        rays
    }

    /// Finds the closest hits by the scene's own structure.
    fn trace(&self, rays: RaySet) -> Traced {
        let room = padded(rays.len);
        let none = vec![PrimitiveId::NONE; room];
        let (mut t, mut primitive) = (vec![0.0; room], none.clone());
        self.scene.accel.closest(
            rays.rays(0, rays.len, &none),
            HitBatch {
                t: &mut t,
                primitive: &mut primitive,
            },
            &mut Default::default(),
        );
        Traced { rays, t, primitive }
    }

    /// The hits of the rays from `at` on.
    #[inline]
    fn hits(&self, traced: &Traced, at: usize) -> Hits {
        let vector = |[x, y, z]: &[Vec<f32>; 3]| Vec3s::new(load(x, at), load(y, at), load(z, at));
        let (origin, direction) = (vector(&traced.rays.origin), vector(&traced.rays.direction));
        let primitive = load_u32(&traced.primitive, at);
        let hit = !primitive.eq(U32s::splat(PrimitiveId::NONE));
        let (point, outward) = surface::<{ Features::all().0 }>(
            self.scene,
            primitive,
            origin,
            direction,
            load(&traced.t, at),
        );
        let behind = outward.dot(direction).gt(F32s::splat(0.0));
        Hits {
            active: Mask::first(traced.rays.len - at) & hit,
            primitive,
            point,
            normal: Vec3s::select(behind, -outward, outward),
        }
    }

    /// The generators of the rays of this kind that leave the item's hits from `at` on.
    fn random(&self, item: &WorkItem, kind: RayKind, at: usize) -> Pcg32s {
        /// First of the sample numbers that no camera ray has.
        const BEYOND_ALL_SAMPLES: u64 = 1 << 63;
        /// An item has fewer rays than this.
        const MOST_RAYS: u64 = 1 << 16;
        let run = item.first_sample * RayKind::ALL.len() as u64 + kind as u64;
        Pcg32s::for_paths(
            self.seed,
            U32s::splat(item.image_index(0) as u32),
            BEYOND_ALL_SAMPLES + run * MOST_RAYS + at as u64,
            iota(),
        )
    }

    /// Bounces from the hits, in their order, on the side that the rays came from.
    fn bounce(&self, item: &WorkItem, traced: &Traced, kind: RayKind) -> RaySet {
        let mut rays = RaySet::new(kind);
        for at in (0..traced.rays.len).step_by(LANES) {
            let mut random = self.random(item, kind, at);
            let hits = self.hits(traced, at);
            let local = cosine_hemisphere(random.next_f32(), random.next_f32());
            let direction = Frame::from_normal(hits.normal).to_world(local).normalize();
            let origin = spawn_origin(&hits.point, hits.normal, hits.normal);
            rays.push(hits.active, origin, direction, F32s::splat(f32::INFINITY));
        }
        rays
    }

    /// Shadow rays from the hits to points on the lights, ending as far before them as renders let
    /// them end. Without lights they go in directions of a bounce, and have no end.
    fn shadows(&self, item: &WorkItem, traced: &Traced) -> RaySet {
        let scene = self.scene;
        let mut rays = RaySet::new(RayKind::Shadow);
        for at in (0..traced.rays.len).step_by(LANES) {
            let mut random = self.random(item, RayKind::Shadow, at);
            let u = [random.next_f32(), random.next_f32(), random.next_f32()];
            let hits = self.hits(traced, at);
            let (direction, t_max, valid) = if scene.lights.kinds() == 0 {
                let local = cosine_hemisphere(u[1], u[2]);
                (
                    Frame::from_normal(hits.normal).to_world(local).normalize(),
                    F32s::splat(f32::INFINITY),
                    Mask::ALL,
                )
            } else {
                let receiver = Receiver {
                    p: hits.point.p,
                    n: hits.normal,
                    primitive: hits.primitive,
                };
                let sample = light::sample::<{ kinds::ALL }>(&scene.lights, &receiver, u);
                // Light from behind the surface is not asked for.
                let before = hits.normal.dot(sample.direction).gt(F32s::splat(0.0));
                (
                    sample.direction,
                    sample.distance - F32s::splat(scene.light_point_error),
                    sample.valid & before,
                )
            };
            let origin = spawn_origin(&hits.point, hits.normal, hits.normal);
            let asked = hits.active & valid & t_max.gt(F32s::splat(0.0));
            rays.push(asked, origin, direction, t_max);
        }
        rays
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::compile::compile;
    use crate::scene::{self, RenderSettings};

    /// A room of 2 m about the origin with a lamp, or a floor under the open sky.
    fn scene(room: bool) -> CompiledScene {
        let shape = if room {
            "mesh = \"box\"\nsize = [2, 2, 2]"
        } else {
            "mesh = \"box\"\nsize = [2, 2, 0.2]\ntranslate = [0, 0, -0.9]"
        };
        let text = format!(
            r#"
            [film]
            width = 70
            height = 40
            [cameras.inside]
            eye = [0.1, 0.2, 0.3]
            look_at = [1, 0, -0.2]
            up = [0, 0, 1]
            fov = 90
            [materials.wall]
            type = "lambertian"
            reflectance = 0.5
            [materials.lamp]
            type = "emitter"
            emission = 1
            two_sided = true
            [[shapes]]
            type = "mesh"
            material = "wall"
            {shape}
            [[shapes]]
            type = "quad"
            material = "lamp"
            corners = [[0.2, 0.2, 0.9], [0.4, 0.2, 0.9], [0.4, 0.4, 0.9], [0.2, 0.4, 0.9]]
            "#
        );
        let scene = scene::parse(text, Path::new("room.toml"), &[]).unwrap();
        let film = scene.film;
        compile(
            &scene,
            0,
            film.width,
            film.height,
            &RenderSettings::default(),
        )
        .unwrap()
    }

    fn all(set: &RaySet) -> Vec<([f32; 3], [f32; 3], f32)> {
        (0..set.len()).map(|at| set.ray(at)).collect()
    }

    #[test]
    fn sets_are_complete_unit_length_and_inside_of_a_closed_room() {
        let scene = scene(true);
        for count in [1, 1000, 70 * 40, 30_000] {
            for set in ray_sets(&scene, &RayKind::ALL, count, 1) {
                assert_eq!(set.len(), count, "{:?}", set.kind());
                for (origin, direction, end) in all(&set) {
                    let length = direction.iter().map(|x| x * x).sum::<f32>().sqrt();
                    assert!((length - 1.0).abs() < 1e-6, "{direction:?}");
                    assert!(origin.iter().all(|x| x.abs() <= 1.0), "{origin:?}");
                    let shadow = set.kind() == RayKind::Shadow;
                    assert!(if shadow {
                        end > 0.0 && end < 4.0
                    } else {
                        end == f32::INFINITY
                    });
                }
            }
        }
    }

    #[test]
    fn sets_depend_on_the_seed_and_not_on_one_another() {
        let scene = scene(true);
        let make = |wanted: &[RayKind], seed| ray_sets(&scene, wanted, 3000, seed);
        let (a, b, c) = (
            make(&RayKind::ALL, 1),
            make(&RayKind::ALL, 1),
            make(&RayKind::ALL, 2),
        );
        for i in 0..a.len() {
            assert_eq!(all(&a[i]), all(&b[i]));
            assert_ne!(all(&a[i]), all(&c[i]));
        }
        for (i, kind) in RayKind::ALL.into_iter().enumerate() {
            // In a closed room no set has to wait for another.
            assert_eq!(all(&make(&[kind], 1)[0]), all(&a[i]));
        }
    }

    #[test]
    fn shadow_rays_end_just_before_the_lamp() {
        let scene = scene(true);
        let lamp = 0.9 - f32::EPSILON;
        for (origin, direction, end) in all(&ray_sets(&scene, &[RayKind::Shadow], 5000, 1)[0]) {
            let tip = [0, 1, 2].map(|k| origin[k] + end * direction[k]);
            assert!((tip[2] - lamp).abs() < 1e-4, "{tip:?}");
            assert!((0.199..0.401).contains(&tip[0]) && (0.199..0.401).contains(&tip[1]));
        }
    }

    #[test]
    fn bounces_are_cosine_distributed_about_the_floor() {
        let scene = scene(false);
        let set = &ray_sets(&scene, &[RayKind::Diffuse], 20_000, 1)[0];
        // From the floor's upper side; its mean cosine is 2/3, with a deviation of √(1/18).
        let up: Vec<f64> = all(set)
            .iter()
            .filter(|(origin, ..)| origin[2] > -0.9 && origin[2] < 0.5)
            .map(|(_, direction, _)| f64::from(direction[2]))
            .collect();
        assert!(up.len() > 5000);
        let mean = up.iter().sum::<f64>() / up.len() as f64;
        let sigma = (1.0 / 18.0 / up.len() as f64).sqrt();
        assert!((mean - 2.0 / 3.0).abs() < 4.0 * sigma, "{mean}");
    }

    #[test]
    fn sets_stay_small_where_all_rays_escape_and_none_is_waited_for() {
        let scene = scene(false);
        let sets = ray_sets(&scene, &RayKind::ALL, 500, 1);
        assert_eq!(sets[0].len(), 500);
        // From a convex box under a lamp, bounces meet nothing but the lamp.
        assert!(sets[2].len() < 500, "{}", sets[2].len());
    }

    #[test]
    fn shuffling_keeps_every_ray_and_samples_are_evenly_spread() {
        let rays: Vec<_> = (0..100)
            .map(|i| ([i as f32, 0.0, 0.0], [0.0, 0.0, 1.0], 1.0))
            .collect();
        let set = RaySet::of(RayKind::Shadow, &rays);
        let mut shuffled = all(&set.shuffled(3));
        assert_ne!(shuffled, rays);
        shuffled.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
        assert_eq!(shuffled, rays);
        let sample: Vec<f32> = all(&set.sample(4)).iter().map(|ray| ray.0[0]).collect();
        assert_eq!(sample, [0.0, 25.0, 50.0, 75.0]);
        assert_eq!(all(&set.sample(1000)), rays);
        assert!(set.sample(0).is_empty());
    }
}
