//! Reinsertion: nodes of large boxes are taken out of the binary tree and put back where they enlarge it least
//! (Meister and Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization", Computer Graphics
//! Forum 37(2), 2018).
//!
//! Take out node x. Its parent becomes its sibling, and the boxes of the ancestors shrink: that is what is won. Put x
//! beside a node y, the boxes from there up to the lowest common ancestor grow by x, and a new parent of both
//! is made: that is what is lost. All moves of a pass are searched for in parallel in the same tree; then they are
//! made one after the other, those that win most first, if none before has touched the same nodes.

use obvhs::aabb::Aabb;
use rayon::prelude::*;

use super::huge_pages;
use super::tree::Node;

/// Passes; each looks at fewer nodes than the one before, and so nearer to the root.
const PASSES: usize = 16;

/// Improves the tree. The first pass looks at this `share` of the nodes, pass i at 1 / (2 i + 1) of that.
/// Afterwards a node may come before its parent. The tree does not depend on the number of threads.
pub(super) fn optimize(nodes: Vec<Node>, share: f32, progress: impl Fn(f64)) -> Vec<Node> {
    let count = nodes.len();
    let size = |pass: usize| (count as f32 * share) as usize / (2 * pass + 1);
    if size(0) == 0 {
        return nodes;
    }
    let mut tree = Linked::new(nodes);
    for pass in 0..PASSES {
        if size(pass) == 0 {
            break;
        }
        tree.improve(size(pass));
        progress((pass + 1) as f64 / PASSES as f64);
    }
    tree.nodes
}

/// A tree in which parents are known.
struct Linked {
    nodes: Vec<Node>,
    /// By number of the pair of children.
    parents: Vec<u32>,
    /// By node: the last pass that changed it.
    touched: Vec<u8>,
    /// Number of the running pass, from 1 on.
    pass: u8,
}

/// A node that is to be put beside another one.
#[derive(Debug, Clone, Copy)]
struct Move {
    from: u32,
    to: u32,
    /// By how much the surface area of all inner nodes shrinks, halved; > 0.
    gain: f32,
}

/// A node beside which the one that is out may go, or below.
#[derive(Debug, Clone, Copy)]
struct Open {
    node: u32,
    /// What is won above the node, its own growth counted.
    gain: f32,
}

fn sibling(node: u32) -> u32 {
    // Pairs of children begin at odd numbers.
    ((node - 1) ^ 1) + 1
}

/// Number of the pair that a node belongs to.
fn pair(node: u32) -> usize {
    (node as usize - 1) / 2
}

impl Linked {
    fn new(nodes: Vec<Node>) -> Self {
        let mut parents: Vec<u32> = huge_pages::zeroed(nodes.len() / 2);
        for (index, node) in (0u32..).zip(&nodes) {
            if !node.is_leaf() {
                parents[pair(node.first_index)] = index;
            }
        }
        let touched = huge_pages::zeroed(nodes.len());
        Self {
            nodes,
            parents,
            touched,
            pass: 0,
        }
    }

    fn parent(&self, node: u32) -> u32 {
        self.parents[pair(node)]
    }

    fn bounds(&self, node: u32) -> &Aabb {
        self.nodes[node as usize].aabb()
    }

    /// Looks for better places of `size` nodes and moves those that win most.
    fn improve(&mut self, size: usize) {
        let mut moves: Vec<Move> = largest(&self.nodes, size)
            .into_par_iter()
            .with_min_len(64)
            .map_init(Vec::new, |open, node| self.search(node, open))
            .flatten_iter()
            .collect();
        moves.par_sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.from.cmp(&b.from)));
        self.pass += 1;
        for Move { from, to, .. } in moves {
            let [from_parent, to_parent] = [from, to].map(|node| self.parent(node));
            let changed =
                [from, to, sibling(from), from_parent, to_parent].map(|node| node as usize);
            let is_free = changed.iter().all(|&node| self.touched[node] < self.pass);
            // An earlier move may have brought the goal below the node itself.
            if is_free && !self.is_below(to, from) {
                for node in changed {
                    self.touched[node] = self.pass;
                }
                self.make(from, to);
            }
        }
    }

    /// Whether `above` is an ancestor of a node.
    fn is_below(&self, mut node: u32, above: u32) -> bool {
        while node != 0 && node != above {
            node = self.parent(node);
        }
        node == above
    }

    /// The best place for a node other than the root, if that is another one than its own.
    fn search(&self, from: u32, open: &mut Vec<Open>) -> Option<Move> {
        let bounds = self.bounds(from);
        let own_area = bounds.half_area();
        let parent = self.parent(from);
        let mut best = Move {
            from,
            to: 0,
            gain: 0.0,
        };
        let mut gain = self.bounds(parent).half_area();
        // From the parent up: everything below the other child of each ancestor.
        let mut pivot = parent;
        let mut other = sibling(from);
        let mut remaining = *self.bounds(other);
        loop {
            self.visit(other, gain, bounds, &mut best, open);
            while let Some(next) = open.pop() {
                // Beside any node below, the new parent is at least as large as what is put there.
                if next.gain - own_area > best.gain {
                    let first = self.nodes[next.node as usize].first_index;
                    self.visit(first, next.gain, bounds, &mut best, open);
                    self.visit(first + 1, next.gain, bounds, &mut best, open);
                }
            }
            if pivot == 0 {
                break;
            }
            if pivot != parent {
                remaining = remaining.union(self.bounds(other));
                gain += self.bounds(pivot).half_area() - remaining.half_area();
            }
            other = sibling(pivot);
            pivot = self.parent(pivot);
        }
        // Beside its sibling is where it was, and beside its parent means the same.
        (best.gain > 0.0 && best.to != sibling(from) && best.to != parent).then_some(best)
    }

    /// Compares with the best place that beside `node`, with what is won above, and opens the node.
    #[inline(always)]
    fn visit(&self, node: u32, gain: f32, bounds: &Aabb, best: &mut Move, open: &mut Vec<Open>) {
        let at = &self.nodes[node as usize];
        let beside = gain - at.aabb().union(bounds).half_area();
        if beside > best.gain {
            best.to = node;
            best.gain = beside;
        }
        if !at.is_leaf() {
            open.push(Open {
                node,
                gain: beside + at.aabb().half_area(),
            });
        }
    }

    /// Puts a node beside another one: its pair moves there, its sibling into the parent's place.
    fn make(&mut self, from: u32, to: u32) {
        let (beside, parent) = (sibling(from), self.parent(from));
        let stays = self.nodes[beside as usize];
        let joined = self.nodes[to as usize];
        self.nodes[to as usize].make_inner(from.min(beside));
        self.put(beside, joined);
        self.put(parent, stays);
        self.parents[pair(from)] = to;
        self.refit(to);
        if parent != 0 {
            self.refit(self.parent(parent));
        }
    }

    /// Puts a node with what is below it into a place.
    fn put(&mut self, place: u32, node: Node) {
        self.nodes[place as usize] = node;
        if !node.is_leaf() {
            self.parents[pair(node.first_index)] = place;
        }
    }

    /// Makes boxes exact again from an inner node upwards.
    fn refit(&mut self, mut node: u32) {
        loop {
            let first = self.nodes[node as usize].first_index;
            let bounds = self.bounds(first).union(self.bounds(first + 1));
            let before = self.bounds(node);
            if (before.min, before.max) == (bounds.min, bounds.max) {
                return;
            }
            self.nodes[node as usize].set_aabb(bounds);
            if node == 0 {
                return;
            }
            node = self.parent(node);
        }
    }
}

/// Those `size` nodes among the first 2 · `size`, which are mostly near the root, that have the largest boxes.
fn largest(nodes: &[Node], size: usize) -> Vec<u32> {
    let end = nodes.len().min(2 * size + 1);
    let mut candidates: Vec<(f32, u32)> = (1..end as u32)
        .into_par_iter()
        .with_min_len(4096)
        .map(|index| (nodes[index as usize].aabb().half_area(), index))
        .collect();
    if size < candidates.len() {
        candidates.select_nth_unstable_by(size, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        candidates.truncate(size);
    }
    candidates.into_iter().map(|(_, index)| index).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::super::ploc;
    use super::*;
    use crate::geometry::testing::Rng;

    /// Half of the surface area of all inner nodes. Checks that every leaf is there once, and boxes are exact.
    fn check(nodes: &[Node], leaves: usize) -> f64 {
        let mut seen = vec![false; leaves];
        let (mut visited, mut area) = (0, 0.0);
        let mut work = vec![0];
        while let Some(index) = work.pop() {
            visited += 1;
            assert!(visited <= nodes.len(), "the tree has no cycles");
            let node: &Node = &nodes[index];
            let first = node.first_index as usize;
            if node.is_leaf() {
                assert!(!seen[first]);
                seen[first] = true;
                continue;
            }
            let union = nodes[first].aabb().union(nodes[first + 1].aabb());
            assert_eq!((node.aabb().min, node.aabb().max), (union.min, union.max));
            area += f64::from(union.half_area());
            work.extend([first, first + 1]);
        }
        assert!(seen.into_iter().all(|seen| seen));
        area
    }

    #[test]
    fn moves_keep_every_leaf_within_exact_boxes_and_shrink_the_tree() {
        let mut rng = Rng(31);
        for count in [2, 3, 5, 100, 5_000] {
            // In no order, so that much is to be moved.
            let leaves: Vec<Node> = (0..count as u32)
                .map(|index| {
                    let low = Vec3A::from_array(rng.sphere());
                    let size = 0.3 * rng.uniform() * Vec3A::from_array(rng.sphere()).abs();
                    Node::new(Aabb::new(low, low + size), 1, index)
                })
                .collect();
            let tree = ploc::cluster(leaves.clone(), leaves, 1, |_| ());
            let before = check(&tree, count);
            let after = check(&optimize(tree, 1.0, |_| ()), count);
            if count < 100 {
                assert!(after <= 1.000_01 * before);
            } else {
                assert!(after < 0.8 * before, "{after} of {before}");
            }
        }
    }
}
