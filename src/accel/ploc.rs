//! Parallel locally-ordered clustering (Meister and Bittner, "Parallel Locally-Ordered Clustering for
//! Bounding Volume Hierarchy Construction", 2018): clusters lie along a Morton curve, each looks for the
//! neighbour with which it makes the smallest box, and those that choose each other merge.
//!
//! Two rules keep the number of rounds logarithmic, which it is not by itself (a row of equal boxes, or of
//! boxes one within the other, merges one pair per round): equal areas are resolved in favour of the pair
//! whose indices differ in the lowest bits, and a round that hardly merges anything pairs by index.

use rayon::prelude::*;

use super::tree::Node;
use crate::math::lanes::{Compare, F32s, LANES, U32s, load, load_u32, store, store_u32};

/// Largest window.
pub(super) const MOST_WINDOW: usize = 32;

/// Clusters per parallel task: the columns of the search take most of a first-level cache.
const CHUNK: usize = 1024;

/// A round with more clusters than this must merge at least one in [`LEAST_SHARE`]. With fewer clusters,
/// rounds that merge single pairs are what the best tree asks for, and cost nothing.
const FEW: usize = 1024;

/// See [`FEW`]. Meshes merge about one in three.
const LEAST_SHARE: usize = 32;

/// A binary tree.
#[derive(Debug)]
pub(super) struct Clustered {
    pub(super) nodes: Vec<Node>,
    /// At least the number of levels.
    pub(super) depth_bound: usize,
}

/// Merges the leaves, sorted along a space-filling curve, into a binary tree. The children of a node are
/// neighbours and come after it; the root is node 0.
///
/// `window` neighbours on each side are looked at, up to [`MOST_WINDOW`]. `progress` hears the share of
/// merges done. The tree does not depend on the number of threads.
pub(super) fn cluster(leaves: Vec<Node>, window: usize, progress: impl Fn(f64)) -> Clustered {
    debug_assert!((1..=MOST_WINDOW).contains(&window));
    let total = leaves.len();
    if total <= 1 {
        return Clustered {
            nodes: leaves,
            depth_bound: 1,
        };
    }
    let mut nodes: Vec<Node> = bytemuck::zeroed_vec(2 * total - 1);
    let mut next: Vec<Node> = bytemuck::zeroed_vec(total);
    let mut partners: Vec<u32> = bytemuck::zeroed_vec(total);
    let mut current = leaves;
    // Nodes are filled from the back.
    let mut free = nodes.len();
    let mut count = total;
    let mut depth_bound = 1;
    while count > 1 {
        let (clusters, partners) = (&current[..count], &mut partners[..count]);
        find_partners(clusters, window, partners);
        let mut tallies = tally(partners);
        let mut merged: usize = tallies.iter().map(|tally| tally.merged).sum();
        if merged == 0 || (count > FEW && merged * LEAST_SHARE < count) {
            pair_by_index(partners);
            tallies = tally(partners);
            merged = tallies.iter().map(|tally| tally.merged).sum();
        }
        free -= 2 * merged;
        let pairs = &mut nodes[free..free + 2 * merged];
        merge(clusters, partners, &tallies, &mut next, pairs, free);
        std::mem::swap(&mut current, &mut next);
        count -= merged;
        depth_bound += 1;
        progress((total - count) as f64 / (total - 1) as f64);
    }
    nodes[0] = current[0];
    Clustered { nodes, depth_bound }
}

/// Columns of the boxes of one chunk and of its surroundings, and the best pair of each so far.
struct Search {
    planes: [[Vec<f32>; 3]; 2],
    /// Smallest area with a later cluster, then with an earlier one.
    area: [Vec<f32>; 2],
    /// Both indices of that pair, xor-ed.
    pair: [Vec<u32>; 2],
}

impl Search {
    fn new() -> Self {
        let length = CHUNK + 3 * MOST_WINDOW + 2 * LANES;
        let column = || vec![0.0; length];
        Self {
            planes: [
                [column(), column(), column()],
                [column(), column(), column()],
            ],
            area: [column(), column()],
            pair: [vec![0; length], vec![0; length]],
        }
    }

    /// Writes the best partner of `clusters[begin ..]` for as many as `partners` has.
    fn run(&mut self, clusters: &[Node], window: usize, begin: usize, partners: &mut [u32]) {
        // The columns begin with the neighbours before the chunk and end with those after it.
        let first = begin - window.min(begin);
        let end = begin + partners.len();
        let known = &clusters[first..(end + window).min(clusters.len())];
        for (at, cluster) in known.iter().enumerate() {
            let bounds = cluster.aabb();
            for (columns, corner) in self.planes.iter_mut().zip([bounds.min, bounds.max]) {
                for (column, value) in columns.iter_mut().zip(corner.to_array()) {
                    column[at] = value;
                }
            }
        }
        self.area
            .iter_mut()
            .for_each(|area| area.fill(f32::INFINITY));
        self.pair.iter_mut().for_each(|pair| pair.fill(u32::MAX));
        for distance in 1..=window {
            for lower in (0..end - first).step_by(LANES) {
                self.compare(first, lower, distance, known.len());
            }
        }
        for (at, partner) in partners.iter_mut().enumerate() {
            let (at, index) = (begin - first + at, (begin + at) as u32);
            let [later, earlier] = [0, 1].map(|side| (self.area[side][at], self.pair[side][at]));
            let (_, pair) = if later < earlier { later } else { earlier };
            // Boxes so large that their areas are not numbers have no best partner.
            *partner = if pair == u32::MAX {
                index
            } else {
                index ^ pair
            };
        }
    }

    /// Compares the clusters from `lower` on with those `distance` later, of `known` in the columns.
    #[inline(always)]
    fn compare(&mut self, first: usize, lower: usize, distance: usize, known: usize) {
        let upper = lower + distance;
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let [low, high] = &self.planes;
            load(&high[axis], lower).fast_max(load(&high[axis], upper))
                - load(&low[axis], lower).fast_min(load(&low[axis], upper))
        });
        let area = (x + y) * z + x * y;
        let lower_index = crate::math::lanes::iota() + U32s::splat((first + lower) as u32);
        let upper_index = lower_index + U32s::splat(distance as u32);
        let exists = upper_index.lt(U32s::splat((first + known) as u32));
        let pair = lower_index ^ upper_index;
        for (side, at) in [lower, upper].into_iter().enumerate() {
            let best_area: F32s = load(&self.area[side], at);
            let best_pair = load_u32(&self.pair[side], at);
            let better = area.lt(best_area) | (area.eq(best_area) & pair.lt(best_pair));
            let better = better & exists;
            store(&mut self.area[side], at, better.select(area, best_area));
            store_u32(&mut self.pair[side], at, better.select_u32(pair, best_pair));
        }
    }
}

/// Writes the index of the best partner of each cluster.
fn find_partners(clusters: &[Node], window: usize, partners: &mut [u32]) {
    partners.par_chunks_mut(CHUNK).enumerate().for_each_init(
        Search::new,
        |search, (chunk, partners)| {
            search.run(clusters, window, chunk * CHUNK, partners);
        },
    );
}

/// Makes neighbours partners of each other; the last of an odd number stays alone.
fn pair_by_index(partners: &mut [u32]) {
    let last = partners.len() as u32 - 1;
    for (index, partner) in (0u32..).zip(partners) {
        *partner = (index ^ 1).min(last);
    }
}

/// Whether the cluster has the partner that has it.
#[inline(always)]
fn is_mutual(partners: &[u32], index: usize) -> bool {
    let partner = partners[index] as usize;
    partner != index && partners[partner] as usize == index
}

/// What becomes of a chunk of clusters.
struct Tally {
    /// Pairs of which the first is in the chunk.
    merged: usize,
    /// Clusters that go on, those pairs included.
    remaining: usize,
}

fn tally(partners: &[u32]) -> Vec<Tally> {
    let chunks = partners.len().div_ceil(CHUNK);
    (0..chunks)
        .into_par_iter()
        .map(|chunk| {
            let range = chunk_range(chunk, partners.len());
            let mut tally = Tally {
                merged: 0,
                remaining: range.len(),
            };
            for index in range.filter(|&index| is_mutual(partners, index)) {
                if partners[index] as usize > index {
                    tally.merged += 1;
                } else {
                    // The first of the pair goes on, maybe in another chunk.
                    tally.remaining -= 1;
                }
            }
            tally
        })
        .collect()
}

fn chunk_range(chunk: usize, count: usize) -> std::ops::Range<usize> {
    chunk * CHUNK..count.min((chunk + 1) * CHUNK)
}

/// Writes pairs to `pairs`, the nodes from number `first` on, and what remains, in order, to `next`.
fn merge(
    clusters: &[Node],
    partners: &[u32],
    tallies: &[Tally],
    next: &mut [Node],
    pairs: &mut [Node],
    first: usize,
) {
    let mut tasks = Vec::with_capacity(tallies.len());
    let (mut next, mut pairs, mut first) = (next, pairs, first);
    for (chunk, tally) in tallies.iter().enumerate() {
        let (output, later_output) = next.split_at_mut(tally.remaining);
        let (own, later) = pairs.split_at_mut(2 * tally.merged);
        let range = chunk_range(chunk, clusters.len());
        tasks.push((range, output, own, first));
        (next, pairs, first) = (later_output, later, first + 2 * tally.merged);
    }
    tasks
        .into_par_iter()
        .for_each(|(range, output, pairs, first)| {
            let mut output = output.iter_mut();
            let mut pairs = pairs.chunks_exact_mut(2).zip((first..).step_by(2));
            for index in range {
                let mut cluster = clusters[index];
                if is_mutual(partners, index) {
                    let partner = partners[index] as usize;
                    if partner < index {
                        continue;
                    }
                    if let Some((pair, place)) = pairs.next() {
                        pair.copy_from_slice(&[cluster, clusters[partner]]);
                        let bounds = cluster.aabb().union(clusters[partner].aabb());
                        cluster = Node::new(bounds, 0, place as u32);
                    }
                }
                if let Some(place) = output.next() {
                    *place = cluster;
                }
            }
        });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Depth of the tree over boxes at these lower corners, of these sizes.
    fn depth(boxes: impl Iterator<Item = (f32, f32)>) -> usize {
        let leaves: Vec<Node> = (0u32..)
            .zip(boxes)
            .map(|(id, (low, size))| {
                let low = glam::Vec3A::new(low, 0.0, 0.0);
                let bounds = obvhs::aabb::Aabb::new(low, low + glam::Vec3A::splat(size));
                Node::new(bounds, 1, id)
            })
            .collect();
        let count = leaves.len();
        let tree = cluster(leaves, 8, |_| ());
        let mut levels = vec![1; tree.nodes.len()];
        let mut seen = vec![false; count];
        for (index, node) in tree.nodes.iter().enumerate() {
            let first = node.first_index as usize;
            if node.is_leaf() {
                assert!(!seen[first]);
                seen[first] = true;
            } else {
                assert!(first > index);
                levels[first] = levels[index] + 1;
                levels[first + 1] = levels[index] + 1;
                let [a, b] = [0, 1].map(|side| *tree.nodes[first + side].aabb());
                assert_eq!(*node.aabb(), a.union(&b));
            }
        }
        assert!(seen.into_iter().all(|seen| seen));
        let depth = levels.into_iter().max().unwrap_or(0);
        assert!(depth <= tree.depth_bound);
        depth
    }

    #[test]
    fn equal_boxes_in_a_row_or_in_one_place_make_a_balanced_tree() {
        assert_eq!(depth((0..1 << 15).map(|k| (k as f32, 1.0))), 16);
        assert_eq!(depth((0..1 << 15).map(|_| (3.0, 1.0))), 16);
    }

    #[test]
    fn boxes_within_boxes_take_few_rounds() {
        let nested = |k: u32| (-1.0 - k as f32, 2.0 * (1.0 + k as f32));
        // Single merges, but no more than there are clusters when they are let be.
        assert!(depth((0..100_000).map(nested)) < FEW + 400);
        assert!(depth((0..100_000).rev().map(nested)) < FEW + 400);
    }
}
