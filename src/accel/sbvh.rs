//! A binary tree built from the top with splits of objects and of space (Stich, Friedrich and Dietrich, "Spatial
//! Splits in Bounding Volume Hierarchies", 2009): where the children of the best split of objects overlap, a
//! plane may cut triangles in two instead, if that costs less by surface area and the budget of references
//! allows. References that are better whole on one side are not cut (reference unsplitting there).

use glam::Vec3A;
use obvhs::aabb::Aabb;
use rayon::prelude::*;

use super::clip::halves;
use super::tree::Node;
use crate::geometry::{Geometry, Triangle};

/// Most bins per axis. With 32 instead, Sponza takes 1.3 times as long to build, and rays inside of it visit up to
/// 16 % more nodes.
const BINS: usize = 16;

/// Most references added, as a share of the primitives.
const SHARE: f64 = 0.3;

/// Space is split only where the children of the best split of objects share a box of more than this much of
/// the root's surface area. With 1e-4 Sponza takes three quarters of the time to build, and rays inside of it
/// visit 3 to 5 % more nodes.
const LEAST_OVERLAP: f32 = 1e-5;

/// Space is not split for fewer references: their triangles end up in one leaf anyway.
const LEAST_SPLIT: usize = 16;

/// Levels below which references are halved without a search, so that no scene takes quadratic time.
const MOST_SEARCHED: usize = 64;

/// References per parallel task.
const CHUNK: usize = 4096;

/// Subtrees of a tree, about.
const TASKS: usize = 256;

/// Subtrees that are built in parallel before the progress is told.
const GROUP: usize = 64;

/// Builds a tree over references to primitives, each with a box that holds its part of it. The tree has at most
/// `limit` leaves if there are no more references than that. Children are neighbours; the root is node 0, and
/// nodes lie level by level. `progress` hears the share of subtrees done. The tree does not depend on the number
/// of threads.
pub(super) fn build(
    geometry: &Geometry,
    references: Vec<Node>,
    limit: usize,
    progress: impl Fn(f64),
) -> Vec<Node> {
    let total = references.len();
    if total <= 1 {
        return references;
    }
    let builder = Builder::new(geometry, &references);
    let budget = ((SHARE * total as f64) as usize).min(limit.saturating_sub(total));
    let mut nodes = vec![Node::default()];
    let mut large = vec![Subtree {
        node: 0,
        references,
        budget,
        depth: 1,
    }];
    let mut small = Vec::new();
    while !large.is_empty() {
        // One level after the other, until there are enough subtrees for all threads.
        let split: Vec<_> = large
            .into_par_iter()
            .map(|tree| builder.halve(tree))
            .collect();
        large = Vec::new();
        for (node, mut children) in split {
            let first = nodes.len();
            nodes[node].make_inner(first as u32);
            nodes.resize(first + 2, Node::default());
            children[0].node = first;
            children[1].node = first + 1;
            for child in children {
                if child.references.len() > CHUNK.max(total / TASKS) {
                    large.push(child);
                } else {
                    small.push(child);
                }
            }
        }
    }
    let subtrees = small.len();
    while !small.is_empty() {
        let group = small.split_off(small.len().saturating_sub(GROUP));
        let built: Vec<_> = group
            .into_par_iter()
            .map(|tree| (tree.node, builder.finish(tree)))
            .collect();
        for (node, part) in built {
            place(&mut nodes, node, &part);
        }
        progress((subtrees - small.len()) as f64 / subtrees as f64);
    }
    by_level(&nodes)
}

/// Adds a subtree: its first node at `node`, the others at the end.
fn place(nodes: &mut Vec<Node>, node: usize, part: &[Node]) {
    let shift = nodes.len() as u32 - 1;
    let moved = |mut node: Node| {
        if !node.is_leaf() {
            node.first_index += shift;
        }
        node
    };
    let mut moved = part.iter().copied().map(moved);
    nodes[node] = moved.next().expect("a subtree has a node");
    nodes.extend(moved);
}

/// The same tree with nodes level by level and exact boxes.
fn by_level(nodes: &[Node]) -> Vec<Node> {
    let mut sorted = Vec::with_capacity(nodes.len());
    sorted.push(nodes[0]);
    let mut at = 0;
    while at < sorted.len() {
        let node = sorted[at];
        if !node.is_leaf() {
            let first = node.first_index as usize;
            sorted[at].first_index = sorted.len() as u32;
            sorted.extend_from_slice(&nodes[first..first + 2]);
        }
        at += 1;
    }
    for at in (0..sorted.len()).rev() {
        if !sorted[at].is_leaf() {
            let first = sorted[at].first_index as usize;
            let bounds = sorted[first].aabb().union(sorted[first + 1].aabb());
            sorted[at].set_aabb(bounds);
        }
    }
    sorted
}

/// References of which a subtree is to be made.
struct Subtree {
    /// Its place.
    node: usize,
    references: Vec<Node>,
    /// How many references may be added.
    budget: usize,
    /// Levels down to it, 1 for the root.
    depth: usize,
}

struct Builder<'a> {
    triangles: &'a [Triangle],
    /// Brings areas near 1, so that they neither overflow nor vanish.
    scale: f32,
    /// See [`LEAST_OVERLAP`].
    least_overlap: f32,
}

impl<'a> Builder<'a> {
    fn new(geometry: &'a Geometry, references: &[Node]) -> Self {
        let bounds = Extent::of(references).bounds;
        let size = (bounds.max - bounds.min).max_element();
        let mut builder = Self {
            triangles: &geometry.triangles,
            scale: if size > 0.0 { 1.0 / size } else { 1.0 },
            least_overlap: 0.0,
        };
        builder.least_overlap = LEAST_OVERLAP * builder.area(&bounds);
        builder
    }

    /// Half of the surface area, scaled.
    fn area(&self, bounds: &Aabb) -> f32 {
        let [x, y, z] = ((bounds.max - bounds.min) * self.scale).to_array();
        (x + y) * z + x * y
    }

    /// Splits a subtree into two, whose places are not known yet.
    fn halve(&self, tree: Subtree) -> (usize, [Subtree; 2]) {
        let Subtree {
            node,
            mut references,
            budget,
            depth,
        } = tree;
        let before = references.len();
        let left = self.split(&mut references, 0, budget, depth);
        let right = references.split_off(left);
        let budgets = shares(budget, before, [left, right.len()]);
        let child = |references, budget| Subtree {
            node: 0,
            references,
            budget,
            depth: depth + 1,
        };
        (
            node,
            [child(references, budgets[0]), child(right, budgets[1])],
        )
    }

    /// The nodes of a subtree. Without recursion.
    fn finish(&self, tree: Subtree) -> Vec<Node> {
        struct Work {
            node: usize,
            /// It has so many of the last references.
            count: usize,
            budget: usize,
            depth: usize,
        }
        let mut references = tree.references;
        let mut nodes = vec![Node::default()];
        let mut work = vec![Work {
            node: 0,
            count: references.len(),
            budget: tree.budget,
            depth: tree.depth,
        }];
        while let Some(Work {
            node,
            count,
            budget,
            depth,
        }) = work.pop()
        {
            let begin = references.len() - count;
            if count == 1 {
                nodes[node] = references[begin];
                references.truncate(begin);
                continue;
            }
            let left = self.split(&mut references, begin, budget, depth);
            let counts = [left, references.len() - begin - left];
            let budgets = shares(budget, count, counts);
            let first = nodes.len();
            nodes[node].make_inner(first as u32);
            for side in 0..2 {
                nodes.push(Node::default());
                work.push(Work {
                    node: first + side,
                    count: counts[side],
                    budget: budgets[side],
                    depth: depth + 1,
                });
            }
        }
        nodes
    }

    /// Brings the references from `begin` on, at least two, into an order in which those of the left child come
    /// first, and gives their number. May add up to `budget` references.
    fn split(
        &self,
        references: &mut Vec<Node>,
        begin: usize,
        budget: usize,
        depth: usize,
    ) -> usize {
        let own = &references[begin..];
        let count = own.len();
        if count == 2 || depth > MOST_SEARCHED {
            return count / 2;
        }
        let extent = Extent::of(own);
        let grid = Grid::new(&extent.centers, count.min(BINS));
        let bins = gather(own, |bins, reference| {
            bins.add_whole(grid.cells(center(reference)), reference);
        });
        let Some(objects) = bins.best(self, grid.cells, count, 0) else {
            // All centers are in one place.
            return count / 2;
        };
        let shared = objects.bounds[0].intersection(&objects.bounds[1]);
        if count >= LEAST_SPLIT
            && budget > 0
            && shared.valid()
            && self.area(&shared) > self.least_overlap
        {
            let grid = Grid::new(&extent.bounds, count.min(BINS));
            let bins = gather(own, |bins, reference| {
                self.add_parts(bins, &grid, reference);
            });
            let space = bins.best(self, grid.cells, count, budget);
            if let Some(space) = space.filter(|space| space.cost < objects.cost) {
                let place = grid.plane(space.axis, space.bin);
                return self.cut(references, begin, &space, place);
            }
        }
        partition(references, begin, |reference| {
            whole(
                reference,
                grid.cells(center(&reference))[objects.axis] < objects.bin,
            )
        })
    }

    /// Adds what lies in each bin of a reference's primitive.
    fn add_parts(&self, bins: &mut Bins, grid: &Grid, reference: &Node) {
        let Some(triangle) = self.triangles.get(reference.first_index as usize) else {
            bins.add_whole(grid.cells(0.5 * center(reference)), reference);
            return;
        };
        let bounds = own_box(reference);
        for axis in 0..3 {
            let exit = grid.above(axis, bounds.max[axis]);
            let entry = grid.below(axis, bounds.min[axis]).min(exit);
            let column = &mut bins.axes[axis];
            column[entry].entries += 1;
            column[exit].exits += 1;
            if entry == exit {
                column[exit].extend(&bounds);
            } else {
                let mut parts = [Aabb::empty(); BINS];
                grid.cut_into(triangle, &bounds, axis, [entry, exit], &mut parts);
                for (bin, part) in column.iter_mut().zip(&parts).take(exit + 1).skip(entry) {
                    bin.extend(&part.intersection(&bounds));
                }
            }
        }
    }

    /// Distributes the references to the sides of a plane, cut where that is better than whole.
    fn cut(&self, references: &mut Vec<Node>, begin: usize, split: &Split, place: f32) -> usize {
        let axis = split.axis;
        let areas = split.bounds.map(|bounds| self.area(&bounds));
        let counts = split.counts.map(|count| count as f32);
        let left = partition(references, begin, |reference| {
            let bounds = own_box(&reference);
            let triangle = self.triangles.get(reference.first_index as usize);
            let Some(triangle) = triangle else {
                return whole(reference, 0.5 * center(&reference)[axis] < place);
            };
            if bounds.max[axis] <= place || bounds.min[axis] >= place {
                return whole(reference, bounds.max[axis] <= place);
            }
            let with = |side: usize| {
                let other = 1 - side;
                self.area(&split.bounds[side].union(&bounds)) * counts[side]
                    + areas[other] * (counts[other] - 1.0)
            };
            let both = areas[0] * counts[0] + areas[1] * counts[1];
            let uncut = [with(0), with(1)];
            if uncut[0].min(uncut[1]) < both {
                return whole(reference, uncut[0] <= uncut[1]);
            }
            match halves(triangle, &bounds, axis, place) {
                [None, None] => whole(reference, true),
                parts => {
                    parts.map(|part| part.map(|part| Node::new(part, 1, reference.first_index)))
                }
            }
        });
        let count = references.len() - begin;
        if left == 0 || left == count {
            count / 2
        } else {
            left
        }
    }
}

/// What is left of the budget once `before` references have become `counts`, divided like them.
fn shares(budget: usize, before: usize, counts: [usize; 2]) -> [usize; 2] {
    let after = counts[0] + counts[1];
    let budget = budget.saturating_sub(after - before);
    let left = (budget as u128 * counts[0] as u128 / after as u128) as usize;
    [left, budget - left]
}

/// A reference on one side of a split, as [`partition`] takes it.
fn whole(reference: Node, is_left: bool) -> [Option<Node>; 2] {
    if is_left {
        [Some(reference), None]
    } else {
        [None, Some(reference)]
    }
}

/// Sorts the references from `begin` on by side, and gives the number on the left. `sides` says what becomes of a
/// reference on each.
fn partition(
    references: &mut Vec<Node>,
    begin: usize,
    sides: impl Fn(Node) -> [Option<Node>; 2],
) -> usize {
    let mut right = Vec::new();
    let mut end = begin;
    for at in begin..references.len() {
        let [left, other] = sides(references[at]);
        if let Some(left) = left {
            references[end] = left;
            end += 1;
        }
        right.extend(other);
    }
    references.truncate(end);
    references.append(&mut right);
    end - begin
}

/// Box of a reference, with nothing but zero in the fourth lanes.
fn own_box(reference: &Node) -> Aabb {
    Aabb::new(reference.min.into(), reference.max.into())
}

/// Twice the center of a reference's box.
fn center(reference: &Node) -> Vec3A {
    Vec3A::from(reference.min) + Vec3A::from(reference.max)
}

/// Boxes of references, and of twice their centers.
#[derive(Clone, Copy)]
struct Extent {
    bounds: Aabb,
    centers: Aabb,
}

impl Extent {
    fn of(references: &[Node]) -> Self {
        let of_some = |references: &[Node]| {
            let mut extent = Self {
                bounds: Aabb::empty(),
                centers: Aabb::empty(),
            };
            for reference in references {
                extent.bounds = extent.bounds.union(&own_box(reference));
                extent.centers.extend(center(reference));
            }
            extent
        };
        if references.len() <= CHUNK {
            return of_some(references);
        }
        (references.par_chunks(CHUNK).map(of_some))
            .reduce_with(|a, b| Self {
                bounds: a.bounds.union(&b.bounds),
                centers: a.centers.union(&b.centers),
            })
            .expect("there are references")
    }
}

/// Bins of equal width between two corners.
struct Grid {
    low: Vec3A,
    width: Vec3A,
    /// Bins per unit, 0 for a flat axis.
    scale: Vec3A,
    /// Bins per axis.
    cells: usize,
}

impl Grid {
    fn new(bounds: &Aabb, cells: usize) -> Self {
        let size = bounds.max - bounds.min;
        Self {
            low: bounds.min,
            width: size / cells as f32,
            scale: Vec3A::select(size.cmpgt(Vec3A::ZERO), cells as f32 / size, Vec3A::ZERO),
            cells,
        }
    }

    /// The bin of a point along each axis.
    #[inline]
    fn cells(&self, point: Vec3A) -> [usize; 3] {
        let cell = ((point - self.low) * self.scale).to_array();
        cell.map(|x| (x as usize).min(self.cells - 1))
    }

    /// The plane below a bin.
    #[inline]
    fn plane(&self, axis: usize, bin: usize) -> f32 {
        self.low[axis] + self.width[axis] * bin as f32
    }

    /// The last bin whose plane below is not above x.
    #[inline]
    fn below(&self, axis: usize, x: f32) -> usize {
        let mut bin = self.guess(axis, x);
        while bin > 0 && self.plane(axis, bin) > x {
            bin -= 1;
        }
        while bin + 1 < self.cells && self.plane(axis, bin + 1) <= x {
            bin += 1;
        }
        bin
    }

    /// The first bin whose plane above is not below x.
    #[inline]
    fn above(&self, axis: usize, x: f32) -> usize {
        let mut bin = self.guess(axis, x);
        while bin > 0 && self.plane(axis, bin) >= x {
            bin -= 1;
        }
        while bin + 1 < self.cells && self.plane(axis, bin + 1) < x {
            bin += 1;
        }
        bin
    }

    /// About the boxes of the parts of a triangle within `bounds` that lie in the bins from `entry` to `exit` along
    /// an axis: good enough to compare costs.
    #[inline]
    fn cut_into(
        &self,
        triangle: &Triangle,
        bounds: &Aabb,
        axis: usize,
        [entry, exit]: [usize; 2],
        parts: &mut [Aabb; BINS],
    ) {
        // Where the part in a bin begins.
        let start = |bin: usize| match bin {
            _ if bin == entry => bounds.min[axis],
            _ if bin > exit => bounds.max[axis],
            _ => self.plane(axis, bin),
        };
        let corners = triangle.corners.map(Vec3A::from);
        for at in 0..3 {
            let (mut from, mut to) = (corners[at], corners[(at + 1) % 3]);
            if from[axis] > to[axis] {
                (from, to) = (to, from);
            }
            let slope = (to - from) / (to[axis] - from[axis]);
            for bin in entry..=exit + 1 {
                let place = start(bin);
                if place <= from[axis] {
                    continue;
                }
                if bin > entry && start(bin - 1) <= from[axis] {
                    parts[bin - 1].extend(from);
                }
                if place > to[axis] {
                    if bin > entry && start(bin - 1) <= to[axis] {
                        parts[bin - 1].extend(to);
                    }
                    break;
                }
                let point = from + slope * (place - from[axis]);
                if bin > entry {
                    parts[bin - 1].extend(point);
                }
                if bin <= exit {
                    parts[bin].extend(point);
                }
            }
        }
    }

    #[inline]
    fn guess(&self, axis: usize, x: f32) -> usize {
        (((x - self.low[axis]) * self.scale[axis]) as usize).min(self.cells - 1)
    }
}

/// What is in a slab of space.
#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    /// References of which this is the first bin.
    entries: u32,
    /// References of which this is the last bin.
    exits: u32,
}

impl Bin {
    #[inline]
    fn extend(&mut self, bounds: &Aabb) {
        self.bounds = self.bounds.union(bounds);
    }
}

struct Bins {
    axes: [[Bin; BINS]; 3],
}

/// The least costly way found to make two children.
struct Split {
    /// Sum over the children of area times references.
    cost: f32,
    axis: usize,
    /// The first bin on the right.
    bin: usize,
    bounds: [Aabb; 2],
    counts: [usize; 2],
}

impl Bins {
    fn new() -> Self {
        let bin = Bin {
            bounds: Aabb::empty(),
            entries: 0,
            exits: 0,
        };
        Self {
            axes: [[bin; BINS]; 3],
        }
    }

    /// Adds a reference to one bin per axis.
    #[inline]
    fn add_whole(&mut self, cells: [usize; 3], reference: &Node) {
        for (column, cell) in self.axes.iter_mut().zip(cells) {
            let bin = &mut column[cell];
            bin.extend(&own_box(reference));
            bin.entries += 1;
            bin.exits += 1;
        }
    }

    fn merge(mut self, other: &Self) -> Self {
        let others = other.axes.iter().flatten();
        for (bin, other) in self.axes.iter_mut().flatten().zip(others) {
            bin.extend(&other.bounds);
            bin.entries += other.entries;
            bin.exits += other.exits;
        }
        self
    }

    /// The best plane between the first `cells` bins that leaves something on either side and adds no more than
    /// `budget` to `count` references.
    fn best(
        &self,
        builder: &Builder<'_>,
        cells: usize,
        count: usize,
        budget: usize,
    ) -> Option<Split> {
        let mut best: Option<Split> = None;
        for (axis, bins) in self.axes.iter().enumerate() {
            let mut above = [(Aabb::empty(), 0); BINS];
            let mut sum = (Aabb::empty(), 0);
            for bin in (1..cells).rev() {
                sum.0 = sum.0.union(&bins[bin].bounds);
                sum.1 += bins[bin].exits as usize;
                above[bin] = sum;
            }
            let mut below = (Aabb::empty(), 0);
            for bin in 1..cells {
                below.0 = below.0.union(&bins[bin - 1].bounds);
                below.1 += bins[bin - 1].entries as usize;
                let above = above[bin];
                if below.1 == 0 || above.1 == 0 || below.1 + above.1 > count + budget {
                    continue;
                }
                let cost = builder.area(&below.0) * below.1 as f32
                    + builder.area(&above.0) * above.1 as f32;
                if cost < best.as_ref().map_or(f32::INFINITY, |best| best.cost) {
                    best = Some(Split {
                        cost,
                        axis,
                        bin,
                        bounds: [below.0, above.0],
                        counts: [below.1, above.1],
                    });
                }
            }
        }
        best
    }
}

/// Bins filled with all references.
fn gather(references: &[Node], add: impl Fn(&mut Bins, &Node) + Sync) -> Bins {
    let of_some = |references: &[Node]| {
        let mut bins = Bins::new();
        references
            .iter()
            .for_each(|reference| add(&mut bins, reference));
        bins
    };
    if references.len() <= CHUNK {
        return of_some(references);
    }
    (references.par_chunks(CHUNK).map(of_some))
        .reduce_with(|a, b| a.merge(&b))
        .expect("there are references")
}

#[cfg(test)]
mod tests {
    use super::super::tree;
    use super::*;
    use crate::accel::{BuildOptions, BuildQuality};
    use crate::geometry::Sphere;
    use crate::geometry::testing::{Rng, cube, lat_long_sphere};

    /// The tree of primitives before any other improvement, of at most so many leaves.
    fn tree_of(geometry: &Geometry, limit: usize) -> Vec<Node> {
        let references = (0..geometry.len() as u32)
            .map(|id| tree::primitive_box(geometry, id))
            .collect();
        build(geometry, references, limit, |_| ())
    }

    /// Long thin triangles in all directions.
    fn needles(count: usize) -> Geometry {
        let mut rng = Rng(9);
        let triangles = (0..count)
            .map(|_| {
                let [from, along, aside] = [0, 1, 2].map(|_| rng.sphere());
                let corner =
                    |a: f32, b: f32| [0, 1, 2].map(|k| from[k] + a * along[k] + b * aside[k]);
                Triangle {
                    corners: [corner(0.0, 0.0), corner(1.0, 0.01), corner(1.0, 0.0)],
                }
            })
            .collect();
        Geometry {
            triangles,
            ..Geometry::default()
        }
    }

    /// Levels of the tree.
    fn depth(tree: &[Node]) -> usize {
        let mut levels = vec![1; tree.len()];
        for (at, node) in tree.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
            let first = node.first_index as usize;
            let level = levels[at] + 1;
            levels[first..first + 2].fill(level);
        }
        levels.into_iter().max().unwrap_or(0)
    }

    /// Boxes of the leaves by primitive. Checks that boxes are exact.
    fn leaves(tree: &[Node], primitives: usize) -> Vec<Vec<Aabb>> {
        let mut leaves = vec![Vec::new(); primitives];
        for (at, node) in tree.iter().enumerate() {
            let first = node.first_index as usize;
            if node.is_leaf() {
                leaves[first].push(own_box(node));
                continue;
            }
            assert!(first > at && first % 2 == 1);
            let [left, right] = [first, first + 1].map(|child| own_box(&tree[child]));
            assert_eq!(own_box(node), left.union(&right));
        }
        leaves
    }

    #[test]
    fn every_point_of_a_triangle_is_in_one_of_its_leaves() {
        let mut rng = Rng(11);
        let geometry = needles(2_000);
        let tree = tree_of(&geometry, usize::MAX);
        for (triangle, boxes) in geometry.triangles.iter().zip(leaves(&tree, 2_000)) {
            let [a, b, c] = triangle.corners.map(|p| p.map(f64::from));
            for _ in 0..20 {
                let (u, v) = rng.barycentrics();
                let point = [0, 1, 2]
                    .map(|k| a[k] + f64::from(u) * (b[k] - a[k]) + f64::from(v) * (c[k] - a[k]));
                let inside = |bounds: &Aabb| {
                    (0..3).all(|k| {
                        f64::from(bounds.min[k]) - 1e-15 <= point[k]
                            && point[k] <= f64::from(bounds.max[k]) + 1e-15
                    })
                };
                assert!(boxes.iter().any(inside), "{point:?} in {boxes:?}");
            }
        }
    }

    #[test]
    fn references_stay_within_budget_and_limit() {
        let geometry = needles(2_000);
        let whole = tree_of(&geometry, 2_000);
        assert!(leaves(&whole, 2_000).iter().all(|boxes| boxes.len() == 1));
        let few = tree_of(&geometry, 2_100);
        assert!(few.len().div_ceil(2) <= 2_100);
        let most = tree_of(&geometry, usize::MAX);
        assert!(most.len().div_ceil(2) <= 2_600);
    }

    #[test]
    fn what_is_not_cut_is_in_one_leaf() {
        let mut rng = Rng(12);
        let spheres = (0..3_000).map(|_| Sphere {
            center: rng.sphere(),
            radius: 0.3,
        });
        let geometry = Geometry {
            spheres: spheres.collect(),
            ..Geometry::default()
        };
        let tree = tree_of(&geometry, usize::MAX);
        assert!(leaves(&tree, 3_000).iter().all(|boxes| boxes.len() == 1));
        let walls = Geometry {
            triangles: cube().triangles(),
            ..Geometry::default()
        };
        let tree = tree_of(&walls, usize::MAX);
        assert!(leaves(&tree, 12).iter().all(|boxes| boxes.len() == 1));
    }

    #[test]
    fn what_lies_in_one_place_or_shrinks_makes_a_shallow_tree() {
        let triangle = |x: f32| Triangle {
            corners: [[x, 0.0, 0.0], [x, x * 0.1, 0.0], [x, 0.0, x * 0.1]],
        };
        let same = Geometry {
            triangles: vec![triangle(1.0); 50_000],
            ..Geometry::default()
        };
        assert_eq!(depth(&tree_of(&same, usize::MAX)), 17);
        let shrinking = Geometry {
            triangles: (0..2_000)
                .map(|k| triangle(2f32.powf(-(k as f32) / 16.0)))
                .collect(),
            ..Geometry::default()
        };
        let tree = tree_of(&shrinking, usize::MAX);
        leaves(&tree, 2_000);
        let depth = depth(&tree);
        assert!(depth <= MOST_SEARCHED + 12, "{depth}");
    }

    #[test]
    fn areas_beyond_f32_still_give_a_tree() {
        let triangles = (0..100).map(|k| {
            let x = (k as f32 - 50.0) * 6e36;
            Triangle {
                corners: [[x, 0.0, 0.0], [x, 3e38, 0.0], [x, 0.0, -3e38]],
            }
        });
        let geometry = Geometry {
            triangles: triangles.collect(),
            ..Geometry::default()
        };
        let tree = tree_of(&geometry, usize::MAX);
        assert!(leaves(&tree, 100).iter().all(|boxes| !boxes.is_empty()));
    }

    #[test]
    fn the_final_tree_of_best_quality_holds_every_primitive() {
        let mut rng = Rng(13);
        let geometry = Geometry {
            triangles: lat_long_sphere(40, 80, 0.2, &mut rng).triangles(),
            spheres: vec![Sphere {
                center: [0.0; 3],
                radius: 0.5,
            }],
            ..Geometry::default()
        };
        let options = BuildOptions {
            quality: BuildQuality::Best,
            ..BuildOptions::default()
        };
        let mut ids: Vec<u32> = tree::build(&geometry, &options)
            .iter()
            .filter(|node| node.is_leaf())
            .map(|node| node.first_index)
            .collect();
        ids.sort_unstable();
        ids.dedup();
        assert!(ids.into_iter().eq(0..geometry.len() as u32));
    }
}
