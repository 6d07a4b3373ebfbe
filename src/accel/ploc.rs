//! Parallel locally-ordered clustering (Meister and Bittner, "Parallel Locally-Ordered Clustering for
//! Bounding Volume Hierarchy Construction", 2018): clusters lie along a Morton curve, each looks for the
//! neighbour with which it makes the smallest box, and those that choose each other merge.
//!
//! Two rules keep the number of rounds logarithmic, which it is not by itself (a row of equal boxes, or of
//! boxes one within the other, merges one pair per round): equal areas are resolved in favour of the pair
//! whose indices differ in the lowest bits, and a round that hardly merges anything pairs by index.

use rayon::prelude::*;
use wide::f32x8;

use super::huge_pages;
use super::tree::Node;
use crate::math::lanes::{Compare, F32s, LANES, U32s, load};

/// Largest window.
pub(super) const MOST_WINDOW: usize = 32;

/// Clusters per parallel task: the columns of the search take most of a first-level cache.
const CHUNK: usize = 1024;

/// A round with more clusters than this must merge at least one in [`LEAST_SHARE`]. With fewer clusters,
/// rounds that merge single pairs are what the best tree asks for, and cost nothing.
const FEW: usize = 1024;

/// See [`FEW`]. Meshes merge about one in three.
const LEAST_SHARE: usize = 32;

/// Merges the leaves, sorted along a space-filling curve, into a binary tree. The children of a node are
/// neighbours and come after it; the root is node 0.
///
/// `scratch` has as many nodes, which are overwritten. `window` neighbours on each side are looked at, up to
/// [`MOST_WINDOW`]. `progress` hears the share of merges done. The tree does not depend on the number of threads.
pub(super) fn cluster(
    leaves: Vec<Node>,
    scratch: Vec<Node>,
    window: usize,
    progress: impl Fn(f64),
) -> Vec<Node> {
    debug_assert!((1..=MOST_WINDOW).contains(&window));
    let total = leaves.len();
    if total <= 1 {
        return leaves;
    }
    let mut nodes: Vec<Node> = huge_pages::zeroed(2 * total - 1);
    let mut partners: Vec<u32> = huge_pages::zeroed(total);
    let (mut current, mut next) = (leaves, scratch);
    // Nodes are filled from the back.
    let mut free = nodes.len();
    let mut count = total;
    while count > 1 {
        let (clusters, partners) = (&current[..count], &mut partners[..count]);
        // Leaves and pairs of them mostly find their partner near by.
        let window = if count > total / 2 {
            window.div_ceil(2)
        } else {
            window
        };
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
        progress((total - count) as f64 / (total - 1) as f64);
    }
    nodes[0] = current[0];
    nodes
}

/// Columns of the boxes of one chunk of clusters and of its surroundings.
struct Search {
    planes: [[Vec<f32>; 3]; 2],
}

/// Clusters before the chunk of which the columns have room.
const BEFORE: usize = MOST_WINDOW;

impl Search {
    fn new() -> Self {
        // Neighbours on both sides, and whole vectors to the end.
        let length = (BEFORE + CHUNK + MOST_WINDOW).next_multiple_of(LANES) + LANES;
        let column = || vec![f32::INFINITY; length];
        Self {
            planes: [
                [column(), column(), column()],
                [column(), column(), column()],
            ],
        }
    }

    /// Writes the best partner of `clusters[begin ..]` for as many as `partners` has.
    fn run(&mut self, clusters: &[Node], window: usize, begin: usize, partners: &mut [u32]) {
        self.fill(clusters, window, begin, partners.len());
        for (step, partners) in partners.chunks_mut(LANES).enumerate() {
            let best = self.best_of(window, begin, step * LANES);
            partners.copy_from_slice(&best.to_array()[..partners.len()]);
        }
    }

    /// Fills the columns such that number [`BEFORE`] is that of `clusters[begin]`. What lies in the window of
    /// any of the `count` clusters but does not exist is infinitely far away.
    fn fill(&mut self, clusters: &[Node], window: usize, begin: usize, count: usize) {
        let first = begin - window.min(begin);
        let end = clusters.len().min(begin + count + window);
        let known = &clusters[first..end];
        let at = BEFORE - (begin - first);
        let (blocks, rest) = known.as_chunks::<8>();
        for (block, at) in blocks.iter().zip((at..).step_by(8)) {
            let rows = f32x8::transpose(block.map(bytemuck::cast));
            for (columns, rows) in self.planes.iter_mut().zip([&rows[..3], &rows[4..7]]) {
                for (column, values) in columns.iter_mut().zip(rows) {
                    column[at..at + 8].copy_from_slice(values.as_array());
                }
            }
        }
        let end = at + known.len();
        for (side, columns) in self.planes.iter_mut().enumerate() {
            for (axis, column) in columns.iter_mut().enumerate() {
                for (node, at) in rest.iter().zip(end - rest.len()..) {
                    column[at] = [node.min, node.max][side][axis];
                }
                column[BEFORE - window..at].fill(f32::INFINITY);
                column[end..BEFORE + count + window].fill(f32::INFINITY);
            }
        }
    }

    /// The best partners of the clusters from number `begin` + `at` on.
    #[inline(always)]
    fn best_of(&self, window: usize, begin: usize, at: usize) -> U32s {
        let column = |side: usize, axis: usize, at| load(&self.planes[side][axis], at);
        let own = |axis| [column(0, axis, BEFORE + at), column(1, axis, BEFORE + at)];
        let [x, y, z] = [own(0), own(1), own(2)];
        let index = crate::math::lanes::iota() + U32s::splat((begin + at) as u32);
        // Areas beyond that are as good as none.
        let mut best_area = F32s::splat(f32::MAX);
        // Both indices of the best pair, xor-ed; a cluster without any is its own partner.
        let mut best_pair = U32s::splat(0);
        let mut look = |at, other_index: U32s| {
            // Written out: arrays of boxes would be put together in memory.
            let x = x[1].fast_max(column(1, 0, at)) - x[0].fast_min(column(0, 0, at));
            let y = y[1].fast_max(column(1, 1, at)) - y[0].fast_min(column(0, 1, at));
            let z = z[1].fast_max(column(1, 2, at)) - z[0].fast_min(column(0, 2, at));
            let area = (x + y) * z + x * y;
            let pair = index ^ other_index;
            let better = area.lt(best_area) | (area.eq(best_area) & pair.lt(best_pair));
            best_area = better.select(area, best_area);
            best_pair = better.select_u32(pair, best_pair);
        };
        for distance in 1..=window {
            let offset = U32s::splat(distance as u32);
            look(BEFORE + at - distance, index - offset);
            look(BEFORE + at + distance, index + offset);
        }
        index ^ best_pair
    }
}

/// Writes the index of the best partner of each cluster; a cluster that has none is its own.
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

/// Whether the cluster has the partner that has it, and that is another one.
#[inline(always)]
fn is_mutual(partners: &[u32], index: usize) -> bool {
    let partner = partners[index] as usize;
    (partner != index) & (partners[partner] as usize == index)
}

/// What becomes of a chunk of clusters.
struct Tally {
    /// Pairs of which the first is in the chunk.
    merged: usize,
    /// Clusters that go on, those pairs included.
    remaining: usize,
}

/// Counts without branches, which would be taken as if at random.
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
            for index in range {
                let mutual = is_mutual(partners, index);
                let is_first = partners[index] as usize > index;
                tally.merged += usize::from(mutual & is_first);
                // The first of the pair goes on, maybe in another chunk.
                tally.remaining -= usize::from(mutual & !is_first);
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
            let pairs = pairs.as_chunks_mut::<2>().0;
            let (mut made, mut gone_on) = (0, 0);
            // Everything is written as if it was merged and went on, and overwritten by the next if not: what
            // becomes of a cluster is no branch, which would be taken as if at random.
            for index in range {
                let cluster = clusters[index];
                let mutual = is_mutual(partners, index);
                let partner = if mutual {
                    partners[index] as usize
                } else {
                    index
                };
                let is_first = partner > index;
                let other = clusters[partner];
                if let Some(pair) = pairs.get_mut(made) {
                    *pair = [cluster, other];
                }
                if let Some(place) = output.get_mut(gone_on) {
                    let pair_index = (first + 2 * made) as u32;
                    *place = Node::new(
                        cluster.aabb().union(other.aabb()),
                        if is_first { 0 } else { cluster.prim_count },
                        if is_first {
                            pair_index
                        } else {
                            cluster.first_index
                        },
                    );
                }
                made += usize::from(is_first);
                gone_on += usize::from(partner >= index);
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
        let scratch = leaves.clone();
        let tree = cluster(leaves, scratch, 8, |_| ());
        let mut levels = vec![1; tree.len()];
        let mut seen = vec![false; count];
        for (index, node) in tree.iter().enumerate() {
            let first = node.first_index as usize;
            if node.is_leaf() {
                assert!(!seen[first]);
                seen[first] = true;
            } else {
                assert!(first > index);
                levels[first] = levels[index] + 1;
                levels[first + 1] = levels[index] + 1;
                let [a, b] = [0, 1].map(|side| *tree[first + side].aabb());
                assert_eq!(*node.aabb(), a.union(&b));
            }
        }
        assert!(seen.into_iter().all(|seen| seen));
        levels.into_iter().max().unwrap_or(0)
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
