//! Building the octree: from a cube about everything, cells are halved along all axes until few primitives
//! are left in them.

use std::ops::Range;

use rayon::prelude::*;

use super::super::tree::{node_bounds, primitive_box};
use super::leaves::Leaves;
use super::{Child, MAX_DEPTH, Node, Octree};
use crate::geometry::Geometry;
use crate::geometry::slab::{Bounds, Bounds8};
use crate::math::LANES;

/// Cells with no more primitives are not divided. Measured as in the module above: against leaves of one
/// pack, leaves of three take 0.65 to 1.02 times the time and 0.5 to 0.7 times the memory; leaves of four and
/// six take 0.87 to 1.10 times the time of those.
const LEAF_SIZE: usize = 3 * LANES;

/// A cube.
#[derive(Debug, Clone, Copy)]
struct Cell {
    center: [f32; 3],
    /// Half of the edge.
    half: f32,
}

impl Cell {
    fn around(bounds: &Bounds) -> Self {
        let [low, high] = bounds.corners;
        Self {
            center: centroid(bounds),
            half: [0, 1, 2]
                .map(|k| 0.5 * high[k] - 0.5 * low[k])
                .into_iter()
                .fold(0.0, f32::max),
        }
    }

    /// Which of the eight cells within this one a point is in.
    #[inline]
    fn place(&self, point: [f32; 3]) -> usize {
        (0..3)
            .map(|axis| usize::from(point[axis] > self.center[axis]) << axis)
            .sum()
    }

    /// The cell within this one at a place.
    fn child(&self, place: usize) -> Self {
        let half = 0.5 * self.half;
        Self {
            center: [0, 1, 2].map(|axis| {
                let upper = place >> axis & 1 == 1;
                self.center[axis] + if upper { half } else { -half }
            }),
            half,
        }
    }
}

fn centroid(bounds: &Bounds) -> [f32; 3] {
    let [low, high] = bounds.corners;
    [0, 1, 2].map(|k| 0.5 * low[k] + 0.5 * high[k])
}

/// Cells of more primitives are divided in parallel, if there are several threads.
const TASK: usize = 4096;

pub(super) fn build(geometry: &Geometry) -> Octree {
    let bounds: Vec<Bounds> = (0..geometry.len() as u32)
        .into_par_iter()
        .map(|id| node_bounds(&primitive_box(geometry, id)))
        .collect();
    if bounds.is_empty() {
        return Octree {
            nodes: Vec::new(),
            leaves: Leaves::new(),
            root: None,
        };
    }
    let whole = bounds
        .par_iter()
        .copied()
        .reduce(|| Bounds::EMPTY, |a, b| a.union(&b));
    let grower = Grower {
        geometry,
        bounds: &bounds,
        // Parts of the tree are copied once, which one thread can do without.
        task: if rayon::current_num_threads() > 1 {
            TASK
        } else {
            usize::MAX
        },
    };
    let mut order: Vec<u32> = (0..bounds.len() as u32).collect();
    match grower.grow(Cell::around(&whole), 0, &mut order) {
        Tree::Part(octree) => octree,
        tree => tree.join(),
    }
}

/// Part of an octree.
#[derive(Debug)]
enum Tree {
    /// With its own numbers of nodes and leaves.
    Part(Octree),
    /// A node over further parts, each with its place, in ascending order.
    Node(Bounds8, Vec<(usize, Tree)>),
}

impl Tree {
    /// Copies all parts into one, every node before its children and those in the order of their places.
    fn join(self) -> Octree {
        let mut octree = Octree {
            nodes: Vec::new(),
            leaves: Leaves::new(),
            root: None,
        };
        // With the node and place where they hang; `None` for the root.
        let mut work: Vec<(Tree, Option<(usize, usize)>)> = vec![(self, None)];
        while let Some((tree, parent)) = work.pop() {
            let first = octree.nodes.len();
            let child = match tree {
                Self::Part(part) => {
                    let first_leaf = octree.leaves.len();
                    let moved = |child: Child| {
                        if child.is_leaf() {
                            Child::leaf(child.index() + first_leaf)
                        } else if child == Child::default() {
                            // The root is nobody's child: there is nothing in this place.
                            child
                        } else {
                            Child::node(child.index() + first)
                        }
                    };
                    octree.nodes.extend(part.nodes.iter().map(|node| Node {
                        bounds: node.bounds,
                        children: node.children.map(moved),
                    }));
                    octree.leaves.append(part.leaves);
                    part.root.map(|root| match root {
                        root if root.is_leaf() => moved(root),
                        _ => Child::node(first),
                    })
                }
                Self::Node(bounds, children) => {
                    octree.nodes.push(Node {
                        bounds,
                        children: [Child::default(); 8],
                    });
                    let children = children.into_iter().rev();
                    work.extend(children.map(|(place, tree)| (tree, Some((first, place)))));
                    Some(Child::node(first))
                }
            };
            match (parent, child) {
                (Some((node, place)), Some(child)) => octree.nodes[node].children[place] = child,
                _ => octree.root = child,
            }
        }
        octree
    }
}

/// What the tree is made of.
struct Grower<'a> {
    geometry: &'a Geometry,
    bounds: &'a [Bounds],
    /// See [`TASK`].
    task: usize,
}

/// A cell that waits to be divided, or to become a leaf.
#[derive(Debug)]
struct Pending {
    cell: Cell,
    /// Its primitives, as a range of the order.
    range: Range<usize>,
    /// How often the first cell was halved.
    depth: usize,
    /// Node and place where it hangs; `None` for the root.
    parent: Option<(usize, usize)>,
}

impl Grower<'_> {
    /// The tree in a cell that was halved `depth` times, over these primitives.
    fn grow(&self, cell: Cell, depth: usize, order: &mut [u32]) -> Tree {
        let mut pending = Pending {
            cell,
            range: 0..order.len(),
            depth,
            parent: None,
        };
        if order.len() <= self.task {
            return Tree::Part(self.grow_alone(pending, order));
        }
        let Some(parts) = divide(&mut pending, order, self.bounds, &mut Vec::new()) else {
            return Tree::Part(self.grow_alone(pending, order));
        };
        let mut children = Vec::with_capacity(8);
        let mut rest = order;
        for (place, &count) in parts.count.iter().enumerate() {
            let (own, others) = rest.split_at_mut(count);
            if count > 0 {
                children.push((place, own));
            }
            rest = others;
        }
        let (cell, depth) = (pending.cell, pending.depth);
        let children = children
            .into_par_iter()
            .map(|(place, order)| (place, self.grow(cell.child(place), depth + 1, order)))
            .collect();
        Tree::Node(Bounds8::new(&parts.bounds), children)
    }

    /// The same on one thread.
    fn grow_alone(&self, root: Pending, order: &mut [u32]) -> Octree {
        let mut octree = Octree {
            nodes: Vec::new(),
            leaves: Leaves::new(),
            root: None,
        };
        let mut sorted = Vec::new();
        let mut work = vec![root];
        while let Some(mut pending) = work.pop() {
            let ids = &mut order[pending.range.clone()];
            let child = match divide(&mut pending, ids, self.bounds, &mut sorted) {
                None => Child::leaf(octree.leaves.push(self.geometry, ids)),
                Some(parts) => {
                    let node = octree.nodes.len();
                    octree.nodes.push(Node {
                        bounds: Bounds8::new(&parts.bounds),
                        children: [Child::default(); 8],
                    });
                    let mut end = pending.range.end;
                    for place in (0..8).rev() {
                        let range = end - parts.count[place]..end;
                        end = range.start;
                        if !range.is_empty() {
                            work.push(Pending {
                                cell: pending.cell.child(place),
                                range,
                                depth: pending.depth + 1,
                                parent: Some((node, place)),
                            });
                        }
                    }
                    Child::node(node)
                }
            };
            match pending.parent {
                Some((node, place)) => octree.nodes[node].children[place] = child,
                None => octree.root = Some(child),
            }
        }
        octree
    }
}

/// What is in the eight cells within a cell.
#[derive(Debug)]
struct Parts {
    count: [usize; 8],
    bounds: [Bounds; 8],
}

/// Sorts the ids of a cell by place, in ascending order within each. A cell in which all of them have one
/// place is replaced by the cell there. `None` if the cell shall not be divided.
fn divide(
    pending: &mut Pending,
    ids: &mut [u32],
    bounds: &[Bounds],
    sorted: &mut Vec<u32>,
) -> Option<Parts> {
    if ids.len() <= LEAF_SIZE {
        return None;
    }
    while pending.depth < MAX_DEPTH {
        let cell = pending.cell;
        let place = |id: u32| cell.place(centroid(&bounds[id as usize]));
        let mut parts = Parts {
            count: [0; 8],
            bounds: [Bounds::EMPTY; 8],
        };
        for &id in &*ids {
            let place = place(id);
            parts.count[place] += 1;
            parts.bounds[place] = parts.bounds[place].union(&bounds[id as usize]);
        }
        if let Some(only) = parts.count.iter().position(|&count| count == ids.len()) {
            pending.cell = cell.child(only);
            pending.depth += 1;
            continue;
        }
        let mut next = [0; 8];
        for place in 1..8 {
            next[place] = next[place - 1] + parts.count[place - 1];
        }
        sorted.clear();
        sorted.resize(ids.len(), 0);
        for &id in &*ids {
            let next = &mut next[place(id)];
            sorted[*next] = id;
            *next += 1;
        }
        ids.copy_from_slice(sorted);
        return Some(parts);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::{Rng, lat_long_sphere};
    use crate::geometry::{Sphere, Triangle};

    /// Walks the octree of the primitives, checks what must hold of it, and returns the depth in nodes and
    /// the size of the largest leaf.
    fn check(geometry: &Geometry) -> (usize, usize) {
        let octree = build(geometry);
        let bounds: Vec<Bounds> = geometry.bounds().collect();
        let leaves = octree.leaves.ids();
        let mut seen: Vec<u32> = leaves.concat();
        seen.sort_unstable();
        assert!(
            seen.into_iter().eq(0..bounds.len() as u32),
            "every primitive is in one leaf"
        );
        let mut deepest = 0;
        let mut work: Vec<(Child, Option<Bounds>, usize)> = octree
            .root
            .map(|root| (root, None, 1))
            .into_iter()
            .collect();
        while let Some((child, outer, depth)) = work.pop() {
            deepest = deepest.max(depth);
            let inner = if child.is_leaf() {
                let ids = leaves[child.index()].iter();
                ids.fold(Bounds::EMPTY, |all, &id| all.union(&bounds[id as usize]))
            } else {
                let node = &octree.nodes[child.index()];
                let boxes = [0, 1, 2, 3, 4, 5, 6, 7].map(|place| Bounds {
                    corners: node
                        .bounds
                        .planes
                        .map(|axes| axes.map(|column| column[place])),
                });
                for (&child, &bounds) in node.children.iter().zip(&boxes) {
                    if bounds != Bounds::EMPTY {
                        work.push((child, Some(bounds), depth + 1));
                    }
                }
                boxes.iter().fold(Bounds::EMPTY, |all, b| all.union(b))
            };
            assert!(outer.is_none_or(|outer| outer == inner), "boxes are exact");
        }
        let largest = leaves.iter().map(Vec::len).max().unwrap_or(0);
        (deepest, largest)
    }

    #[test]
    fn every_primitive_is_in_one_leaf_within_exact_boxes() {
        let mut rng = Rng(3);
        let triangles = lat_long_sphere(20, 40, 0.2, &mut rng).triangles();
        let spheres: Vec<Sphere> = (0..150)
            .map(|_| Sphere {
                center: rng.sphere(),
                radius: rng.uniform(),
            })
            .collect();
        for (n, m) in [(0, 0), (1, 0), (0, 1), (49, 0), (0, 150), (1520, 150)] {
            let (depth, largest) = check(&Geometry {
                triangles: triangles[..n].to_vec(),
                spheres: spheres[..m].to_vec(),
                ..Geometry::default()
            });
            assert!(largest <= LEAF_SIZE && depth <= 7, "{depth} {largest}");
        }
    }

    #[test]
    fn the_octree_is_the_same_for_any_number_of_threads() {
        let mut rng = Rng(4);
        let shells = [1.0, 1e-3].map(|size| {
            let mesh = lat_long_sphere(120, 240, 0.2, &mut rng).triangles();
            mesh.into_iter().map(move |Triangle { corners }| Triangle {
                corners: corners.map(|corner| corner.map(|x| size * x)),
            })
        });
        let geometry = Geometry {
            triangles: shells.into_iter().flatten().collect(),
            spheres: (0..5_000)
                .map(|_| Sphere {
                    center: rng.sphere(),
                    radius: 0.1 * rng.uniform(),
                })
                .collect(),
            ..Geometry::default()
        };
        assert!(geometry.len() > 8 * TASK);
        let [one, three] = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let octree = pool.expect("threads start").install(|| build(&geometry));
            (
                octree.leaves.ids(),
                octree.root,
                format!("{:?}", octree.nodes),
            )
        });
        assert!(one == three);
    }

    #[test]
    fn what_shares_its_centroid_is_one_leaf() {
        let triangle = Triangle {
            corners: [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        };
        let spheres = (1..=1_000).map(|k| Sphere {
            center: [7.0, 7.0, 7.0],
            radius: 0.001 * k as f32,
        });
        let identical = Geometry {
            triangles: vec![triangle; 100_000],
            ..Geometry::default()
        };
        assert_eq!(check(&identical), (1, 100_000));
        let nested = Geometry {
            spheres: spheres.collect(),
            ..identical
        };
        assert_eq!(check(&nested), (2, 100_000));
    }

    #[test]
    fn shrinking_triangles_are_told_apart_down_to_the_last_level() {
        // Sixteen per halving of the distance from the corner of the cube.
        let triangles = (0..2_000)
            .map(|k| {
                let x = 2f32.powf(-(k as f32) / 16.0);
                Triangle {
                    corners: [[x, 0.0, 0.0], [x, x * 0.1, 0.0], [x, 0.0, x * 0.1]],
                }
            })
            .collect();
        let (depth, largest) = check(&Geometry {
            triangles,
            ..Geometry::default()
        });
        assert!(depth <= MAX_DEPTH + 1, "{depth}");
        assert!((900..1_100).contains(&largest), "{largest}");
    }
}
