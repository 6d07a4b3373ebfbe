//! In which order the rays of a batch take off: by octant of their directions where groups of like rays may come of it,
//! and then the others as they are.

use super::RayBatch;
use super::octant::OCTANTS;
use super::packet;
use super::stream::Packets;
use crate::math::lanes::{
    Compare, F32s, LANES, Mask, U32s, compress_u32, iota, load, load_u32, padded, store_u32,
    to_bits,
};

/// Where in an order the rays of each octant begin that may make groups; last where those begin that take off as they
/// are. If that is 0, the order is that of the batch.
pub(super) type Starts = [usize; OCTANTS + 1];

/// Memory of a worker.
#[derive(Debug, Default)]
pub(super) struct Order {
    /// The rays in their order, a vector more than there are; unset where that is the order of the batch.
    pub(super) rays: Vec<u32>,
    /// Octants of the rays, [`OCTANTS`] for those that hit nothing.
    pub(super) octant: Vec<u32>,
    /// Octants of rays that may make groups, [`OCTANTS`] for others.
    group: Vec<u32>,
}

impl Order {
    /// Tells octants and orders the rays. Where most neighbours are of different octants, only those make groups whose
    /// directions are alike if `alike` asks for that, and the others take off as they are, which costs less. Bounces per
    /// CPU second over those by octant: Sponza 1.10, Suzanne 1.10, teapot 1.10, bunny 1.05, dragon 1.06, hairball 1.00;
    /// shuffled ones 1.01, 1.07, 1.06, 1.03, 1.02, 1.00.
    pub(super) fn arrange(&mut self, rays: &RayBatch<'_>, packets: Packets, alike: bool) -> Starts {
        let room = padded(rays.len) + LANES;
        if self.rays.len() < room {
            for column in [&mut self.rays, &mut self.octant, &mut self.group] {
                column.resize(room, 0);
            }
        }
        let (mut present, mut mixed) = (0, 0);
        for at in (0..rays.len).step_by(LANES) {
            let octant = octant_of(rays, at);
            store_u32(&mut self.octant, at, octant);
            // The rays of a chunk mostly share an octant.
            let first = octant.as_array()[0];
            let valid = Mask::first(rays.len - at);
            present |= if (valid & !octant.eq(U32s::splat(first))).none() {
                1 << first
            } else {
                mixed += 1;
                u32::MAX
            };
        }
        let mut key = &self.octant;
        if packets == Packets::Coherent && 2 * mixed > rays.len / LANES {
            let middle = if alike { most_alike(rays) } else { None };
            let Some(middle) = middle else {
                return [0; OCTANTS + 1];
            };
            let none = U32s::splat(OCTANTS as u32);
            for at in (0..rays.len).step_by(LANES) {
                let like = like(rays.direction.map(|column| load(column, at)), middle);
                let octant = load_u32(&self.octant, at);
                store_u32(&mut self.group, at, like.select_u32(octant, none));
            }
            key = &self.group;
        }
        if present.is_power_of_two() {
            for at in (0..rays.len).step_by(LANES) {
                store_u32(&mut self.rays, at, iota() + U32s::splat(at as u32));
            }
            let only = present.trailing_zeros() as usize;
            return std::array::from_fn(|octant| if octant > only { rays.len } else { 0 });
        }
        let mut starts = [0; OCTANTS + 1];
        let mut count = 0;
        for (octant, start) in starts.iter_mut().enumerate() {
            *start = count;
            if present >> octant & 1 == 0 {
                continue;
            }
            for at in (0..rays.len).step_by(LANES) {
                let here =
                    load_u32(key, at).eq(U32s::splat(octant as u32)) & Mask::first(rays.len - at);
                let ray = iota() + U32s::splat(at as u32);
                compress_u32(&mut self.rays, count, here, ray);
                count += here.count();
            }
        }
        starts
    }
}

/// Shadow rays towards one light are put together in trees of no more primitives than this. In millions per CPU
/// second, against letting all take off in the order of the batch: of Suzanne (968 triangles) 1.06, of the teapot
/// (6 thousand) 1.04, of the bunny (69 thousand) 0.89, of Sponza (262 thousand) 1.03, of the dragon (871 thousand) 0.90,
/// of the hairball (3 million) 0.97. The more triangles there are between neighbouring rays, the sooner groups part;
/// Sponza has large ones. Measured with the other rays by octant; that they take off as they are has since given Suzanne
/// 1.03, the bunny 1.02 and Sponza 1.04 more.
pub(super) const ALIKE_MOST: usize = 500_000;

/// Rays looked at to find out whether many are alike.
const SAMPLE: usize = 128;
const SAMPLE_VECTORS: usize = SAMPLE / LANES;

/// The middle of directions that many rays have, if many are alike: those towards a small or far light among others.
fn most_alike(rays: &RayBatch<'_>) -> Option<[f32; 3]> {
    // Whole vectors spread over all.
    let step = rays.len / SAMPLE_VECTORS;
    if step < LANES {
        return None;
    }
    let vector = |k: usize| rays.direction.map(|column| load(column, k * step));
    let sample: [[F32s; 3]; SAMPLE_VECTORS] = std::array::from_fn(vector);
    let mut best = (SAMPLE / 8, None);
    for vector in &sample {
        let middle = vector.map(|column| column.as_array()[0]);
        let count: usize = sample.iter().map(|d| like(*d, middle).count()).sum();
        if count > best.0 {
            best = (count, Some(middle));
        }
    }
    best.1
}

/// Which directions are within a group's spread around `middle`.
#[inline(always)]
fn like(direction: [F32s; 3], middle: [f32; 3]) -> Mask {
    let near = |k: usize| {
        let offset = direction[k] - F32s::splat(middle[k]);
        offset.abs().le(F32s::splat(0.5 * packet::GROUP_SPREAD))
    };
    near(0) & near(1) & near(2)
}

/// The octant of each direction, or [`OCTANTS`] for rays with NaN or infinity, or without direction.
#[inline(always)]
fn octant_of(rays: &RayBatch<'_>, at: usize) -> U32s {
    let direction = rays.direction.map(|column| load(column, at));
    let [ox, oy, oz] = rays.origin.map(|column| load(column, at));
    let [x, y, z] = direction;
    // NaN where one of them is NaN or infinity.
    let zero = F32s::splat(0.0);
    let sum = [y, z, ox, oy, oz]
        .into_iter()
        .fold(x * zero, |sum, number| number.mul_add(zero, sum));
    let moves = bytemuck::cast::<U32s, F32s>(to_bits(x) | to_bits(y) | to_bits(z));
    let sound = sum.eq(zero) & moves.ne(zero);
    let sign = |k: usize| (to_bits(direction[k]) >> 31) << k as u32;
    sound.select_u32(sign(0) | sign(1) | sign(2), U32s::splat(OCTANTS as u32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::Rng;

    const RAYS: usize = 1000;

    /// Arranges rays from the origin with these directions, of which one has none.
    fn arrange(
        direction: impl Fn(usize, &mut Rng) -> [f32; 3],
        packets: Packets,
        alike: bool,
    ) -> Starts {
        let mut rng = Rng(3);
        let mut columns = [0; 3].map(|_| vec![0.0; padded(RAYS) + LANES]);
        for ray in (0..RAYS).filter(|&ray| ray != 500) {
            for (column, d) in columns.iter_mut().zip(direction(ray, &mut rng)) {
                column[ray] = d;
            }
        }
        let zeros = vec![0.0; padded(RAYS) + LANES];
        let rays = RayBatch {
            len: RAYS,
            origin: [&zeros; 3],
            direction: columns.each_ref().map(|column| &**column),
            skip: &[],
        };
        let mut order = Order::default();
        let starts = order.arrange(&rays, packets, alike);
        if starts[OCTANTS] == 0 {
            return starts;
        }
        let mut all = order.rays[..RAYS].to_vec();
        for (octant, places) in starts.windows(2).enumerate() {
            for &ray in &order.rays[places[0]..places[1]] {
                let negative = |k: usize| usize::from(columns[k][ray as usize] < 0.0) << k;
                assert_eq!(negative(0) | negative(1) | negative(2), octant);
            }
        }
        assert!(all[starts[OCTANTS]..].contains(&500));
        all.sort_unstable();
        assert!(all.into_iter().eq(0..RAYS as u32), "each ray once");
        starts
    }

    fn everywhere(_: usize, rng: &mut Rng) -> [f32; 3] {
        [0; 3].map(|_| rng.uniform() - 0.5)
    }

    #[test]
    fn rays_in_all_directions_take_off_as_they_are_unless_groups_are_asked_for() {
        assert_eq!(arrange(everywhere, Packets::Coherent, false)[OCTANTS], 0);
        assert_eq!(arrange(everywhere, Packets::Coherent, true)[OCTANTS], 0);
        assert_eq!(
            arrange(everywhere, Packets::Always, false)[OCTANTS],
            RAYS - 1
        );
    }

    #[test]
    fn rays_of_few_octants_and_rays_towards_one_light_are_sorted() {
        let one = |_: usize, rng: &mut Rng| [0; 3].map(|_| rng.uniform() + 0.1);
        assert_eq!(arrange(one, Packets::Coherent, false)[OCTANTS], RAYS - 1);
        let blocks = |ray: usize, rng: &mut Rng| {
            let sign = if (ray / 100).is_multiple_of(2) {
                1.0
            } else {
                -1.0
            };
            [0; 3].map(|_| sign * (rng.uniform() + 0.1))
        };
        assert_eq!(arrange(blocks, Packets::Coherent, false)[OCTANTS], RAYS - 1);
        let towards_a_light = |ray: usize, rng: &mut Rng| {
            if ray.is_multiple_of(2) {
                [0.6, 0.6, 0.5]
            } else {
                everywhere(ray, rng)
            }
        };
        assert_eq!(
            arrange(towards_a_light, Packets::Coherent, false)[OCTANTS],
            0
        );
        let grouped = arrange(towards_a_light, Packets::Coherent, true)[OCTANTS];
        assert!((RAYS / 2 - 1..RAYS * 5 / 8).contains(&grouped), "{grouped}");
    }
}
