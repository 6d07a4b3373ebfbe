//! Order along a Morton curve, in which neighbours are mostly near each other in space.

use glam::DVec3;
use obvhs::aabb::Aabb;
use rayon::prelude::*;

use super::huge_pages;
use super::tree::Node;

/// Bits of each coordinate in a Morton code.
const BITS: u32 = 21;

/// Leading bits of codes by which boxes are first put into buckets. Sorting the few in each is then
/// cheap, and the numbers of a task's buckets still fit a second-level cache.
const BUCKET_BITS: u32 = 15;

/// Least boxes per parallel task: their keys fit a second-level cache.
const LEAST_CHUNK: usize = 1 << 16;

/// Most parallel tasks, each of which remembers where its part of each bucket begins.
const MOST_CHUNKS: usize = 64;

/// Buckets per parallel task.
const BUCKETS: usize = 256;

/// The boxes number 0 .. `count`, asked for more than once, in the order of the Morton codes of their centres;
/// equal codes in the order of their numbers. `scratch` has as many nodes, which are overwritten.
///
/// Parts of the list are counted and sorted into buckets by the leading bits of their codes, then the parts of each
/// bucket are brought together and sorted by the rest.
pub(super) fn sorted(
    count: usize,
    scratch: &mut [Node],
    get: impl Fn(u32) -> Node + Sync,
) -> Vec<Node> {
    let curve = Curve::over(
        (0..count as u32)
            .into_par_iter()
            .map(|index| *get(index).aabb())
            .reduce(Aabb::empty, |a, b| a.union(&b)),
    );
    let buckets = 1 << BUCKET_BITS;
    let bucket = |key: u128| (key >> (32 + 3 * BITS - BUCKET_BITS)) as usize;
    let keys: &mut [u128] = &mut bytemuck::cast_slice_mut(scratch)[..count];
    let chunk = count.div_ceil(MOST_CHUNKS).max(LEAST_CHUNK);
    // Where each bucket begins in each chunk, and where the last one ends.
    let starts: Vec<Vec<u32>> = keys
        .par_chunks_mut(chunk)
        .enumerate()
        .map_init(Vec::new, |unsorted, (number, keys)| {
            let first = (number * chunk) as u32;
            unsorted.clear();
            unsorted.extend((first..).take(keys.len()).map(|index| {
                // One number each, so that comparing takes no branches.
                u128::from(curve.code(&get(index))) << 32 | u128::from(index)
            }));
            let mut starts = vec![0u32; buckets + 1];
            for &key in &*unsorted {
                starts[bucket(key) + 1] += 1;
            }
            for at in 0..buckets {
                starts[at + 1] += starts[at];
            }
            let mut next = starts.clone();
            for &key in &*unsorted {
                let next = &mut next[bucket(key)];
                keys[*next as usize] = key;
                *next += 1;
            }
            starts
        })
        .collect();
    let mut sorted: Vec<Node> = huge_pages::zeroed(count);
    let mut tasks = Vec::with_capacity(buckets / BUCKETS);
    let mut rest = &mut *sorted;
    for first in (0..buckets).step_by(BUCKETS) {
        let length = |starts: &Vec<u32>| (starts[first + BUCKETS] - starts[first]) as usize;
        let (own, others) = rest.split_at_mut(starts.iter().map(length).sum());
        tasks.push((first, own));
        rest = others;
    }
    tasks
        .into_par_iter()
        .for_each_init(Vec::new, |together, (first, sorted)| {
            let mut sorted = sorted.iter_mut();
            for bucket in first..first + BUCKETS {
                together.clear();
                for (keys, starts) in keys.chunks(chunk).zip(&starts) {
                    let part = starts[bucket] as usize..starts[bucket + 1] as usize;
                    together.extend_from_slice(&keys[part]);
                }
                together.sort_unstable();
                for (&mut key, node) in together.iter_mut().zip(&mut sorted) {
                    *node = get(key as u32);
                }
            }
        });
    sorted
}

/// A Morton curve through a cube.
struct Curve {
    low: DVec3,
    /// Cells per unit of length.
    scale: f64,
}

impl Curve {
    /// Through the smallest cube at the lower corner of a box that holds it. In f64, so that no extent
    /// overflows.
    fn over(bounds: Aabb) -> Self {
        let low = bounds.min.as_dvec3();
        let extent = (bounds.max.as_dvec3() - low).max_element();
        Self {
            low,
            scale: f64::from((1 << BITS) - 1) / if extent > 0.0 { extent } else { 1.0 },
        }
    }

    /// The code of the centre of a box.
    fn code(&self, node: &Node) -> u64 {
        let center = 0.5 * (node.min.as_dvec3() + node.max.as_dvec3());
        let cell = (center - self.low) * self.scale;
        spread(cell.x as u32) | spread(cell.y as u32) << 1 | spread(cell.z as u32) << 2
    }
}

/// Two zero bits between each two of the lowest 21.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x) & 0x1f_ffff;
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::*;
    use crate::geometry::testing::Rng;

    #[test]
    fn spreading_puts_each_bit_at_three_times_its_place() {
        for bit in 0..BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread(1 << BITS), 0, "higher bits are left out");
    }

    #[test]
    fn boxes_are_in_the_order_of_their_codes_then_of_their_numbers() {
        let mut rng = Rng(21);
        for count in [0, 1, 2, 1_000, LEAST_CHUNK + 1, 3 * LEAST_CHUNK] {
            // Many have the same place.
            let places: Vec<Vec3A> = (0..count)
                .map(|_| (100.0 * Vec3A::from_array(rng.sphere())).round())
                .collect();
            let get = |index: u32| {
                let place = places[index as usize];
                Node::new(Aabb::new(place, place + Vec3A::ONE), 1, index)
            };
            let everything = (places.iter()).fold(Aabb::empty(), |all, &place| {
                all.union(&Aabb::new(place, place + Vec3A::ONE))
            });
            let curve = Curve::over(everything);
            let mut expected: Vec<(u64, u32)> = (0..count as u32)
                .map(|index| (curve.code(&get(index)), index))
                .collect();
            expected.sort_unstable();
            let sorted = sorted(count, &mut vec![Node::default(); count], get);
            let numbers = sorted.iter().map(|node| node.first_index);
            assert!(numbers.eq(expected.iter().map(|&(_, index)| index)));
        }
    }
}
