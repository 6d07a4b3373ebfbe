//! The binary tree becomes one of eight children per node, with leaves of several primitives, at the least
//! surface-area cost that subtrees of the binary tree allow: dynamic programming after Ylitie, Karras and
//! Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017, section 3.1.

use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;
use wide::f32x8;

use super::build_options::{BuildOptions, BuildPhase};
use super::huge_pages;
use super::tree::{self, Node, node_bounds};
use crate::geometry::Geometry;
use crate::geometry::slab::Bounds;
use crate::math::prefetch;

/// Most children of a node.
pub(super) const WIDTH: usize = 8;

/// What traversal costs, in any one unit, and how large leaves may be.
#[derive(Debug, Clone, Copy)]
pub(super) struct CollapseCosts {
    /// Visiting a node.
    pub(super) node: f32,
    /// Testing a pack of primitives, full or not.
    pub(super) pack: f32,
    /// Primitives that fit a pack.
    pub(super) pack_size: u32,
    /// Most primitives in a leaf.
    pub(super) largest_leaf: u32,
}

impl CollapseCosts {
    /// Cost of testing all primitives of a leaf.
    fn leaf(&self, count: u32) -> f32 {
        self.pack * count.div_ceil(self.pack_size) as f32
    }
}

/// What is below a slot of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WideChild {
    /// The node of this index.
    Node(u32),
    /// A run of [`WideTree::order`].
    Leaf {
        /// Its first place.
        first: u32,
        /// Its length, > 0.
        count: u32,
    },
}

/// A node of up to eight children.
#[derive(Debug, Clone, Copy)]
pub(super) struct WideNode {
    /// Boxes of the children; [`Bounds::EMPTY`] from `len` on.
    pub(super) bounds: [Bounds; WIDTH],
    /// The children; empty leaves from `len` on.
    pub(super) children: [WideChild; WIDTH],
    /// Number of children, at least 2.
    pub(super) len: u8,
}

impl WideNode {
    fn new() -> Self {
        Self {
            bounds: [Bounds::EMPTY; WIDTH],
            children: [WideChild::Leaf { first: 0, count: 0 }; WIDTH],
            len: 0,
        }
    }

    /// A node of one child, of any size.
    pub(super) fn of_one(child: WideChild) -> Self {
        let mut node = Self::new();
        node.push(Bounds::EMPTY, child);
        node
    }

    fn push(&mut self, bounds: Bounds, child: WideChild) {
        self.bounds[usize::from(self.len)] = bounds;
        self.children[usize::from(self.len)] = child;
        self.len += 1;
    }

    /// The children with their boxes.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&Bounds, &WideChild)> {
        self.bounds
            .iter()
            .zip(&self.children)
            .take(usize::from(self.len))
    }
}

/// A tree of [`WideNode`]s.
#[derive(Debug)]
pub(super) struct WideTree {
    /// Every node comes before its children; mostly depth first.
    pub(super) nodes: Vec<WideNode>,
    /// Primitive ids, leaf by leaf.
    pub(super) order: Vec<u32>,
    /// Box of everything and the root, node 0 or a leaf; `None` without primitives.
    pub(super) root: Option<(Bounds, WideChild)>,
    /// Levels of nodes.
    pub(super) depth: usize,
}

impl WideTree {
    /// Builds over all primitives.
    pub(super) fn build(
        geometry: &Geometry,
        options: &BuildOptions<'_>,
        costs: &CollapseCosts,
    ) -> Self {
        let binary = tree::build(geometry, options);
        options.report(BuildPhase::Collapse, 0.0);
        let wide = Self::new(&binary, costs);
        options.report(BuildPhase::Collapse, 1.0);
        wide
    }

    /// Collapses a binary tree with one primitive per leaf. The result does not depend on the number of
    /// threads.
    pub(super) fn new(binary: &[Node], costs: &CollapseCosts) -> Self {
        let Some(root) = binary.first() else {
            return Self {
                nodes: Vec::new(),
                order: Vec::new(),
                root: None,
                depth: 0,
            };
        };
        let choices = Choices::new(binary, costs);
        let mut tree = choices.emit();
        let child = if choices.is_leaf(0) {
            WideChild::Leaf {
                first: 0,
                count: tree.order.len() as u32,
            }
        } else {
            WideChild::Node(0)
        };
        tree.root = Some((node_bounds(root), child));
        tree
    }

    /// Expected cost of a ray that hits the box of everything.
    #[cfg(test)]
    pub(super) fn sah_cost(&self, costs: &CollapseCosts) -> f64 {
        let cost = |bounds: &Bounds, child: &WideChild| {
            let each = match *child {
                WideChild::Node(_) => costs.node,
                WideChild::Leaf { count, .. } => costs.leaf(count),
            };
            f64::from(bounds.half_area()) * f64::from(each)
        };
        let Some((bounds, root)) = &self.root else {
            return 0.0;
        };
        let inner = self.nodes.iter().flat_map(WideNode::iter);
        let sum: f64 = inner.map(|(bounds, child)| cost(bounds, child)).sum();
        (cost(bounds, root) + sum) / f64::from(bounds.half_area())
    }
}

/// Least costs of a binary subtree.
#[derive(Debug, Clone, Copy)]
struct Costs {
    /// When it takes up to 1, 2, ... 7 slots of a node; the last is of no meaning.
    slots: [f32; WIDTH],
    /// Primitives in it.
    count: u32,
}

/// What to do with a binary node that takes up to `slots` slots.
enum Split {
    /// It takes one slot fewer.
    Fewer,
    /// Its left child takes up to this many of them, its right child the rest.
    Left(usize),
}

/// The choices at each inner binary node that make the cheapest tree.
struct Choices<'a> {
    binary: &'a [Node],
    costs: &'a CollapseCosts,
    /// Brings areas near 1, so that they neither overflow nor vanish.
    scale: f32,
    /// By number of the pair of children: three bits for each number of slots from 2 to 8, [`Split::Fewer`]
    /// as 0, then whether the node is a leaf where it takes one slot.
    words: Vec<AtomicU32>,
}

/// The bit that says that a node is a leaf.
const LEAF: u32 = 1 << (3 * (WIDTH - 1));

/// Subtrees that are worked on in parallel.
const TASKS: usize = 256;

impl<'a> Choices<'a> {
    fn new(binary: &'a [Node], costs: &'a CollapseCosts) -> Self {
        let bounds = node_bounds(&binary[0]);
        let extent = (0..3)
            .map(|k| bounds.corners[1][k] - bounds.corners[0][k])
            .fold(0.0, f32::max);
        let words = huge_pages::zeroed::<u32>(binary.len() / 2);
        let words = words.into_iter().map(AtomicU32::new).collect();
        let choices = Self {
            binary,
            costs,
            scale: if extent > 0.0 { 1.0 / extent } else { 1.0 },
            words,
        };
        let ready: HashMap<u32, Costs> = choices
            .cut()
            .into_par_iter()
            .map(|root| (root, choices.solve(root, &HashMap::new())))
            .collect();
        choices.solve(0, &ready);
        choices
    }

    /// Up to about [`TASKS`] subtrees that have all leaves of the tree below them.
    fn cut(&self) -> Vec<u32> {
        let mut open = VecDeque::from([0]);
        let mut closed = Vec::new();
        while open.len() + closed.len() < TASKS
            && let Some(index) = open.pop_front()
        {
            let node = &self.binary[index as usize];
            if node.is_leaf() {
                closed.push(index);
            } else {
                open.extend([node.first_index, node.first_index + 1]);
            }
        }
        closed.extend(open);
        closed
    }

    /// Chooses at every node below `root` and gives its costs, with those in `ready` done before. Without
    /// recursion: trees of bad scenes are as deep as they are large.
    fn solve(&self, root: u32, ready: &HashMap<u32, Costs>) -> Costs {
        enum Step {
            Enter(u32),
            Leave(u32),
        }
        let mut work = vec![Step::Enter(root)];
        let mut done: Vec<Costs> = Vec::new();
        while let Some(step) = work.pop() {
            match step {
                Step::Enter(index) => {
                    let node = &self.binary[index as usize];
                    let first = node.first_index;
                    if let Some(&costs) = ready.get(&index) {
                        done.push(costs);
                    } else if node.is_leaf() {
                        done.push(self.leaf(index));
                    } else if self.is_primitive(first) && self.is_primitive(first + 1) {
                        done.push(self.choose_pair(index));
                    } else {
                        // The right subtree comes later, and lies elsewhere.
                        prefetch(
                            self.binary,
                            self.binary[first as usize + 1].first_index as usize,
                        );
                        work.push(Step::Leave(index));
                        work.push(Step::Enter(first + 1));
                        work.push(Step::Enter(first));
                    }
                }
                Step::Leave(index) => {
                    if let (Some(right), Some(left)) = (done.pop(), done.pop()) {
                        done.push(self.choose(index, &left, &right));
                    }
                }
            }
        }
        done[0]
    }

    fn is_primitive(&self, index: u32) -> bool {
        self.binary[index as usize].is_leaf()
    }

    /// The costs of a leaf of the binary tree.
    fn leaf(&self, index: u32) -> Costs {
        Costs {
            slots: [self.area(index) * self.costs.leaf(1); WIDTH],
            count: 1,
        }
    }

    /// Half of the surface area of a node, scaled.
    fn area(&self, index: u32) -> f32 {
        let node = &self.binary[index as usize];
        // Not as four lanes: the fourth holds an index, a denormal number that takes long to multiply.
        let [x, y, z] = ((node.max - node.min) * self.scale).to_array();
        (x + y) * z + x * y
    }

    /// Finds and keeps the best choice for each number of slots.
    fn choose(&self, index: u32, left: &Costs, right: &Costs) -> Costs {
        let swapped = left.count > right.count;
        let (small, large) = if swapped {
            (right, left)
        } else {
            (left, right)
        };
        // Lane s - 1 is for s slots in all, of which the smaller child takes `taken`.
        let mut padded = [f32::INFINITY; 2 * WIDTH];
        padded[WIDTH..].copy_from_slice(&large.slots);
        let mut best = f32x8::splat(f32::INFINITY);
        // One, so that a node is split even where areas are so large that costs are not numbers.
        let mut best_taken = f32x8::splat(1.0);
        // More slots than primitives are of no use.
        for taken in 1..WIDTH.min(small.count as usize + 1) {
            let rest = f32x8::from(&padded[WIDTH - taken..2 * WIDTH - taken]);
            let cost = f32x8::splat(small.slots[taken - 1]) + rest;
            let better = cost.simd_lt(best);
            best = better.select(cost, best);
            best_taken = better.select(f32x8::splat(taken as f32), best_taken);
        }
        if swapped {
            best_taken = f32x8::from([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]) - best_taken;
        }
        let (best, taken) = (best.to_array(), best_taken.to_array());
        let (area, count) = (self.area(index), left.count + right.count);
        let as_node = best[WIDTH - 1] + area * self.costs.node;
        let as_leaf = if count <= self.costs.largest_leaf {
            area * self.costs.leaf(count)
        } else {
            f32::INFINITY
        };
        let is_leaf = as_leaf < f32::INFINITY && as_leaf <= as_node;
        let mut slots = [if is_leaf { as_leaf } else { as_node }; WIDTH];
        let mut word = (taken[WIDTH - 1] as u32) << (3 * (WIDTH - 2));
        word |= if is_leaf { LEAF } else { 0 };
        for extra in 1..WIDTH - 1 {
            let better = best[extra] < slots[extra - 1];
            slots[extra] = if better {
                best[extra]
            } else {
                slots[extra - 1]
            };
            word |= if better { taken[extra] as u32 } else { 0 } << (3 * (extra - 1));
        }
        self.word(index).store(word, Ordering::Relaxed);
        Costs { slots, count }
    }

    /// What [`Self::choose`] does for a node of two primitives.
    fn choose_pair(&self, index: u32) -> Costs {
        let first = self.binary[index as usize].first_index;
        let one = self.costs.leaf(1);
        let apart = self.area(first) * one + self.area(first + 1) * one;
        let area = self.area(index);
        let as_node = apart + area * self.costs.node;
        let as_leaf = if self.costs.largest_leaf >= 2 {
            area * self.costs.leaf(2)
        } else {
            f32::INFINITY
        };
        let is_leaf = as_leaf < f32::INFINITY && as_leaf <= as_node;
        let together = if is_leaf { as_leaf } else { as_node };
        // With eight slots they are always apart, with more than two never more so.
        let mut word = 1 << (3 * (WIDTH - 2)) | if is_leaf { LEAF } else { 0 };
        let mut slots = [together; WIDTH];
        if apart < together {
            word |= 1;
            slots[1..].fill(apart);
        }
        self.word(index).store(word, Ordering::Relaxed);
        Costs { slots, count: 2 }
    }

    /// The choices at an inner node.
    fn word(&self, index: u32) -> &AtomicU32 {
        // Pairs of children begin at odd numbers.
        &self.words[self.binary[index as usize].first_index as usize / 2]
    }

    /// Whether the subtree is a leaf where it takes one slot.
    fn is_leaf(&self, index: u32) -> bool {
        self.binary[index as usize].is_leaf()
            || self.word(index).load(Ordering::Relaxed) & LEAF != 0
    }

    /// What to do with an inner node that takes up to `slots` slots, at least 2.
    fn split(&self, index: u32, slots: usize) -> Split {
        let word = self.word(index).load(Ordering::Relaxed);
        match word >> (3 * (slots - 2)) & 7 {
            0 => Split::Fewer,
            left => Split::Left(left as usize),
        }
    }

    /// The binary nodes that are the children of the node made from an inner node, from left to right.
    fn children(&self, index: u32, mut visit: impl FnMut(u32)) {
        let mut work = [(0, 0); WIDTH];
        work[0] = (index, WIDTH);
        let mut size = 1;
        while size > 0 {
            size -= 1;
            let (mut index, mut slots) = work[size];
            loop {
                let node = &self.binary[index as usize];
                if slots == 1 || node.is_leaf() {
                    visit(index);
                    break;
                }
                match self.split(index, slots) {
                    Split::Fewer => slots -= 1,
                    Split::Left(left) => {
                        work[size] = (node.first_index + 1, slots - left);
                        size += 1;
                        (index, slots) = (node.first_index, left);
                    }
                }
            }
        }
    }

    /// The whole tree but for its root's entry.
    fn emit(&self) -> WideTree {
        let mut top = Part::default();
        if self.is_leaf(0) {
            top.push_leaf(self, 0);
            return top.finish();
        }
        // From the root down, level by level, until there are enough subtrees for all threads.
        let mut pending = VecDeque::from([Pending {
            source: 0,
            parent: None,
            depth: 1,
        }]);
        while pending.len() < TASKS
            && let Some(next) = pending.pop_front()
        {
            top.push_node(self, next, |child| pending.push_back(child));
        }
        let parts: Vec<Part> = pending
            .par_iter()
            .map(|root| {
                let mut part = Part::default();
                let mut work = vec![Pending {
                    parent: None,
                    ..*root
                }];
                while let Some(next) = work.pop() {
                    let first = work.len();
                    part.push_node(self, next, |child| work.push(child));
                    work[first..].reverse();
                }
                part
            })
            .collect();
        for (root, part) in pending.into_iter().zip(parts) {
            top.append(part, root.parent);
        }
        top.finish()
    }
}

/// An inner binary node of which a node is still to be made.
#[derive(Debug, Clone, Copy)]
struct Pending {
    source: u32,
    /// Node and slot where it hangs; `None` for the root of a part.
    parent: Option<(usize, usize)>,
    /// Levels of nodes down to it, 1 for the root.
    depth: usize,
}

/// Part of the tree, with its own numbers of nodes and places in the order.
#[derive(Default)]
struct Part {
    nodes: Vec<WideNode>,
    order: Vec<u32>,
    depth: usize,
    /// Binary nodes of a leaf that wait for their turn; empty between leaves.
    waiting: Vec<u32>,
}

impl Part {
    /// Adds the node of an inner binary node, and its leaves; its inner children go to `later`.
    fn push_node(&mut self, choices: &Choices<'_>, at: Pending, mut later: impl FnMut(Pending)) {
        let index = self.nodes.len();
        if let Some((parent, slot)) = at.parent {
            self.nodes[parent].children[slot] = WideChild::Node(index as u32);
        }
        let mut node = WideNode::new();
        choices.children(at.source, |source| {
            let bounds = node_bounds(&choices.binary[source as usize]);
            if choices.is_leaf(source) {
                let leaf = self.push_leaf(choices, source);
                node.push(bounds, leaf);
            } else {
                later(Pending {
                    source,
                    parent: Some((index, usize::from(node.len))),
                    depth: at.depth + 1,
                });
                // The number follows when the child is added.
                node.push(bounds, WideChild::Node(u32::MAX));
            }
        });
        self.nodes.push(node);
        self.depth = self.depth.max(at.depth);
    }

    /// Adds all primitives of a binary subtree to the order.
    fn push_leaf(&mut self, choices: &Choices<'_>, source: u32) -> WideChild {
        let first = self.order.len();
        self.waiting.push(source);
        while let Some(index) = self.waiting.pop() {
            let node = &choices.binary[index as usize];
            if node.is_leaf() {
                self.order.push(node.first_index);
            } else {
                self.waiting.push(node.first_index + 1);
                self.waiting.push(node.first_index);
            }
        }
        WideChild::Leaf {
            first: first as u32,
            count: (self.order.len() - first) as u32,
        }
    }

    /// Adds a part whose first node hangs at this node and slot.
    fn append(&mut self, part: Self, parent: Option<(usize, usize)>) {
        let (nodes, places) = (self.nodes.len() as u32, self.order.len() as u32);
        if let Some((parent, slot)) = parent {
            self.nodes[parent].children[slot] = WideChild::Node(nodes);
        }
        self.nodes.extend(part.nodes.into_iter().map(|mut node| {
            for child in &mut node.children[..usize::from(node.len)] {
                match child {
                    WideChild::Node(index) => *index += nodes,
                    WideChild::Leaf { first, .. } => *first += places,
                }
            }
            node
        }));
        self.order.extend(part.order);
        self.depth = self.depth.max(part.depth);
    }

    fn finish(self) -> WideTree {
        WideTree {
            nodes: self.nodes,
            order: self.order,
            root: None,
            depth: self.depth,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::build_options::BuildQuality;
    use super::*;
    use crate::geometry::testing::{Rng, lat_long_sphere};
    use crate::geometry::{Sphere, Triangle};

    const fn costs(pack_size: u32) -> CollapseCosts {
        CollapseCosts {
            node: 1.0,
            pack: 0.6,
            pack_size,
            largest_leaf: pack_size,
        }
    }

    const COSTS: [CollapseCosts; 3] = [costs(4), costs(8), costs(16)];

    fn binary(geometry: &Geometry) -> Vec<Node> {
        tree::build(geometry, &BuildOptions::default())
    }

    /// Checks the tree over a binary one and gives its depth.
    fn check(binary: &[Node], costs: &CollapseCosts) -> usize {
        let tree = WideTree::new(binary, costs);
        let boxes: HashMap<u32, Bounds> = binary
            .iter()
            .filter(|node| node.is_leaf())
            .map(|node| (node.first_index, node_bounds(node)))
            .collect();
        let mut covered = vec![false; tree.order.len()];
        let mut depth = 0;
        let mut work: Vec<_> = (tree.root.iter())
            .map(|(bounds, child)| (*bounds, *child, 1))
            .collect();
        while let Some((bounds, child, level)) = work.pop() {
            let union = match child {
                WideChild::Node(index) => {
                    depth = depth.max(level);
                    let node = &tree.nodes[index as usize];
                    assert!(node.len >= 2);
                    work.extend(
                        node.iter()
                            .map(|(bounds, child)| (*bounds, *child, level + 1)),
                    );
                    node.iter()
                        .fold(Bounds::EMPTY, |all, (bounds, _)| all.union(bounds))
                }
                WideChild::Leaf { first, count } => {
                    assert!((1..=costs.largest_leaf).contains(&count));
                    let run = first as usize..(first + count) as usize;
                    covered[run.clone()].iter_mut().for_each(|covered| {
                        assert!(!*covered, "runs do not overlap");
                        *covered = true;
                    });
                    let ids = &tree.order[run];
                    ids.iter()
                        .fold(Bounds::EMPTY, |all, id| all.union(&boxes[id]))
                }
            };
            assert_eq!(bounds, union, "boxes are exact");
        }
        assert!(covered.into_iter().all(|covered| covered));
        assert_eq!(tree.depth, depth);
        let mut order = tree.order;
        order.sort_unstable();
        assert!(
            order.into_iter().eq(0..boxes.len() as u32),
            "every primitive is in one leaf"
        );
        depth
    }

    fn spheres(count: usize, rng: &mut Rng) -> Vec<Sphere> {
        (0..count)
            .map(|_| Sphere {
                center: rng.sphere(),
                radius: 0.2 * rng.uniform(),
            })
            .collect()
    }

    #[test]
    fn wide_trees_hold_every_primitive_once_within_exact_boxes() {
        let mut rng = Rng(3);
        let mesh = lat_long_sphere(30, 60, 0.2, &mut rng).triangles();
        for costs in &COSTS {
            let depth = check(
                &binary(&Geometry {
                    triangles: mesh.clone(),
                    spheres: spheres(100, &mut rng),
                    ..Geometry::default()
                }),
                costs,
            );
            assert!(depth >= 4, "8³ leaves of 4 would be too few at 3 levels");
            for count in 0..20 {
                for (triangles, spheres) in [(count, 0), (0, count), (count, count)] {
                    check(
                        &binary(&Geometry {
                            triangles: mesh[..triangles].to_vec(),
                            spheres: self::spheres(spheres, &mut rng),
                            ..Geometry::default()
                        }),
                        costs,
                    );
                }
            }
        }
    }

    /// Cost of the usual tree: the child of largest area is opened until there are eight, and what fits a
    /// leaf is one.
    fn greedy_cost(binary: &[Node], costs: &CollapseCosts) -> f64 {
        let mut counts = vec![1; binary.len()];
        let mut order = vec![0];
        for at in 0..binary.len() {
            let node = &binary[order[at]];
            if !node.is_leaf() {
                order.extend([node.first_index as usize, node.first_index as usize + 1]);
            }
        }
        for &index in order.iter().rev() {
            if !binary[index].is_leaf() {
                let first = binary[index].first_index as usize;
                counts[index] = counts[first] + counts[first + 1];
            }
        }
        let area = |index: usize| f64::from(node_bounds(&binary[index]).half_area());
        let is_leaf = |index: usize| counts[index] <= costs.largest_leaf;
        let (mut sum, mut work) = (0.0, vec![0]);
        while let Some(index) = work.pop() {
            if is_leaf(index) {
                sum += area(index) * f64::from(costs.leaf(counts[index]));
                continue;
            }
            sum += area(index) * f64::from(costs.node);
            let mut open = vec![index];
            while open.len() < WIDTH {
                let inner = (0..open.len()).filter(|&at| !is_leaf(open[at]));
                let Some(at) = inner.max_by(|&a, &b| area(open[a]).total_cmp(&area(open[b])))
                else {
                    break;
                };
                let first = binary[open[at]].first_index as usize;
                open.splice(at..=at, [first, first + 1]);
            }
            work.extend(open);
        }
        sum / area(0)
    }

    #[test]
    fn no_greedy_tree_is_cheaper() {
        let mut rng = Rng(4);
        for costs in &COSTS {
            let binary = binary(&Geometry {
                triangles: lat_long_sphere(40, 90, 0.3, &mut rng).triangles(),
                spheres: spheres(300, &mut rng),
                ..Geometry::default()
            });
            let best = WideTree::new(&binary, costs).sah_cost(costs);
            let greedy = greedy_cost(&binary, costs);
            assert!(best < 0.99 * greedy, "{best} against {greedy}");
        }
    }

    #[test]
    fn the_tree_is_the_same_for_any_number_of_threads() {
        let mut rng = Rng(5);
        let geometry = Geometry {
            triangles: lat_long_sphere(60, 120, 0.1, &mut rng).triangles(),
            ..Geometry::default()
        };
        for quality in [BuildQuality::Fast, BuildQuality::Medium, BuildQuality::Best] {
            let trees = [1, 3].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                pool.expect("threads start").install(|| {
                    let options = BuildOptions {
                        quality,
                        ..BuildOptions::default()
                    };
                    let tree = WideTree::build(&geometry, &options, &COSTS[0]);
                    (tree.order, format!("{:?}", tree.nodes))
                })
            });
            assert!(trees[0] == trees[1]);
        }
    }

    #[test]
    fn progress_passes_through_all_phases_to_their_ends() {
        let geometry = Geometry {
            triangles: lat_long_sphere(30, 60, 0.1, &mut Rng(6)).triangles(),
            ..Geometry::default()
        };
        let heard = std::cell::RefCell::new(Vec::new());
        let options = BuildOptions {
            quality: BuildQuality::Medium,
            progress: Some(&|phase, share| heard.borrow_mut().push((phase, share))),
        };
        WideTree::build(&geometry, &options, &COSTS[0]);
        let heard = heard.into_inner();
        for pair in heard.windows(2) {
            assert!(pair[0].0 != pair[1].0 || pair[0].1 < pair[1].1, "{pair:?}");
        }
        let ends = heard.iter().filter(|(_, share)| *share == 1.0);
        assert!(ends.map(|(phase, _)| *phase).eq([
            BuildPhase::Sort,
            BuildPhase::Cluster,
            BuildPhase::Optimize,
            BuildPhase::Collapse,
        ]));
    }

    #[test]
    fn a_deep_tree_is_collapsed_without_recursion() {
        // A chain: each node has a leaf and the rest of the chain as children.
        let levels = 300_000u32;
        let node = |x: u32, inner: bool, first: u32| {
            let corner = |x: f32| glam::Vec3A::new(x, 1.0, 1.0);
            let bounds = obvhs::aabb::Aabb::new(corner(x as f32), corner(levels as f32 + 1.0));
            Node::new(bounds, u32::from(!inner), first)
        };
        let mut binary = vec![node(0, true, 1)];
        for level in 0..levels {
            let last = level + 1 == levels;
            let mut leaf = node(level, false, level);
            leaf.max.x = level as f32 + 1.0;
            binary.push(leaf);
            binary.push(if last {
                node(levels, false, levels)
            } else {
                node(level + 1, true, 2 * level + 3)
            });
        }
        let depth = check(&binary, &COSTS[0]);
        assert!(depth > levels as usize / 8 / 4);
    }

    #[test]
    fn areas_beyond_f32_still_give_a_tree() {
        let triangles = (0..100)
            .map(|k| {
                let x = (k as f32 - 50.0) * 6e36;
                Triangle {
                    corners: [[x, 0.0, 0.0], [x, 3e38, 0.0], [x, 0.0, -3e38]],
                }
            })
            .collect();
        check(
            &binary(&Geometry {
                triangles,
                ..Geometry::default()
            }),
            &COSTS[1],
        );
    }
}
